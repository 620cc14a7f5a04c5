"""Geodesy and rotations of many samples at once."""
