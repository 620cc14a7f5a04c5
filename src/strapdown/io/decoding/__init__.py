"""Formats of devices as tables: what several readers share, and formats too long for one file."""
