"""Judges whether a solution can be trusted."""
