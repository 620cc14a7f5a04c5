"""Bare tables: guesses at what their columns are, as the sections of a description."""
