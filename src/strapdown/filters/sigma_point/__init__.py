"""Sigma-point Kalman filters in square-root form."""
