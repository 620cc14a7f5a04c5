"""Files as such: whole, bounded, locked."""
