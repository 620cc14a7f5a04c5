"""The six-state filters of the paper, on a flat Earth."""
