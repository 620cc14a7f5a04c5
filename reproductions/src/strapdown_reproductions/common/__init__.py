"""What all reproductions write, and the rules by which numbers become verdicts."""
