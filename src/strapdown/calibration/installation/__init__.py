"""An installation from a log: estimated, confirmed, written into recording.toml, and its page."""
