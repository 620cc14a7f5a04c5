"""Files that strapdown writes and reads again: read into memory and checked against the declaration
of their format."""
