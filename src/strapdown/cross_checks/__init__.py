"""What the parts of a recording say of each other, before any filter runs."""
