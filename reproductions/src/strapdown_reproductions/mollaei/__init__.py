"""Mollaei et al.: EKF, UKF and PKF on an aircraft in the loop."""
