"""Every filter on every recording."""
