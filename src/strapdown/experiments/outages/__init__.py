"""Comparison of filters on the same outages of one recording: protocols, runs, scores and
summaries."""
