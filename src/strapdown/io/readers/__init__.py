"""One file for each format of a recording, which ends in `READER = Reader(...)`; `../registry.py`
finds them."""
