"""Sensors beside GNSS, and what each keeps of the position in an outage."""
