"""Alam et al.: observers and exogenous Kalman filters with outages."""
