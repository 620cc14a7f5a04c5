"""The vehicle kit measured: the detector of rest, the slip test of wheel speed, and what the kit is
worth on a recorded drive."""
