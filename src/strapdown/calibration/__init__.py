"""Calibration of accelerometer and magnetometer from a record, and its page; of an installation from
a log."""
