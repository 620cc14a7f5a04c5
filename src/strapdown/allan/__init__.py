"""Allan deviation of an IMU at rest, the coefficients behind it, the grade they suggest, and its
page."""
