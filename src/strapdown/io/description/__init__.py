"""`recording.toml`: its keys and their error messages, the Recording that it yields, and the draft
of one for a bare table."""
