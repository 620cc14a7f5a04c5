"""Filters whose attitude comes from elsewhere, such as an AHRS."""
