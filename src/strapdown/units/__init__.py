"""Units, quantities, time scales, shared numbers and numbers as text."""
