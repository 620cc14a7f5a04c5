"""Attitude and gyro bias first, then motion in the body's axes with that attitude as known."""
