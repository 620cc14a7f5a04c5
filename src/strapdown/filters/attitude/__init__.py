"""Filters of attitude alone, and what they share."""
