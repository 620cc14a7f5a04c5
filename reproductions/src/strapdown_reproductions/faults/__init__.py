"""Sensor faults, one at a time: whether a filter that is wrong says so."""
