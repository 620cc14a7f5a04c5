"""Noise, told by the data: correlated errors, tuning, robust sources."""
