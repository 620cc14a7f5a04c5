"""Particle Kalman filters: mixtures of Gaussians."""
