"""Why fixes were rejected."""
