"""Files that strapdown writes and reads again: taken into memory, checked against what is declared of
their format."""
