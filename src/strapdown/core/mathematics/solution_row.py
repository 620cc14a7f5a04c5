"""A row of the solution as kernels write it: its columns."""

T, LLA, V, Q, BIASES, STD, ROW_STATUS, NAV_WIDTH = 0, 1, 4, 7, 11, 17, 32, 33
"""Columns: time, position, velocity, quaternion, biases (accelerometer, gyro), 15
standard deviations, status; then a filter's own, then the augmented states and their standard
deviations."""
