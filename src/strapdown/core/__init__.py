"""Compiled code: the mathematics, the loop that runs filters, and the tool that compiles."""
