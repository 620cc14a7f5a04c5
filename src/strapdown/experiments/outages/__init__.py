"""Filters side by side on the same outages of one recording: protocols, the runs, the scores,
what they say together."""
