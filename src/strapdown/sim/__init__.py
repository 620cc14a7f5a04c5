"""Simulation: trajectories given as functions of time, and the records that ideal and real sensors make of them."""
