"""Experiments: many runs of several filters, and their evaluation."""
