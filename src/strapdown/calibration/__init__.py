"""Calibration of accelerometer and magnetometer from a record, and its page."""
