"""Fossen (2021), chapter 14."""
