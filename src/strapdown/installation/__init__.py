"""Finds what of an installation is wrong."""
