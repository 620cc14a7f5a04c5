"""Filters run on recordings: in batch, live, smoothed, and after an AHRS."""
