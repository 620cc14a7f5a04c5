"""The mathematics of navigation: Earth, rotations, mechanization, error model, Kalman filter, smoother."""
