"""Solutions as files, one module for each format; `../solution.py` picks by ending."""
