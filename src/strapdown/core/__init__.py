"""Compiled mathematics on arrays, SI and radians, one sample at a time."""
