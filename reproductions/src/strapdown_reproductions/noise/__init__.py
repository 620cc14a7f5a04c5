"""Noise, told by the data: correlated errors, wrong noise, outliers and hidden fixes."""
