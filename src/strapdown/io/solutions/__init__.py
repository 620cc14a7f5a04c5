"""Solutions as files, one module per format; `../solution.py` chooses by ending."""
