"""All claims of the four papers in one table."""
