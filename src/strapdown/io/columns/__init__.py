"""Bare tables: the meaning of their columns, guessed, as sections of a description."""
