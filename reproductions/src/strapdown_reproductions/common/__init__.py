"""Output shared by all reproductions, and the rules that turn numbers into verdicts."""
