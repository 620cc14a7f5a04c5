"""Error-state and full-state Kalman filters of the strapdown equations: position, velocity,
attitude and biases."""
