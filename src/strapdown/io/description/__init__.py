"""`recording.toml`: its keys and their complaints, what it yields, and a draft of one for a bare
table."""
