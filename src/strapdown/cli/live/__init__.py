"""A filter in a running system: ports, formats, and the program between them."""
