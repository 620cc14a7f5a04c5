"""Logs of flight controllers, PX4 and ArduPilot, taken apart."""
