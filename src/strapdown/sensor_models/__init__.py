"""Error models of sensors, and the grades that ship with the package."""
