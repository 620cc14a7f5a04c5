"""Numbers that mean the same in several rooms, each with its reason. A number of one room stands there."""

STANDARD_GRAVITY = 9.80665
"""m/s^2, by definition; near that of 45 deg of latitude at sea level."""
MAX_PAUSE = 86400.0
"""s: a jump in time beyond this is no pause of one recording."""
COMMON_GYRO_RANGE = 35.0
"""rad/s (2000 deg/s) that the common MEMS gyros read at most."""
SETTLING = 25.0
"""s after its first fix in which a filter may still be wrong about its start."""
REST_SPEED = 0.3
"""m/s, which neither a receiver at rest nor the swing of a lever arm exceeds for long."""
CHI_SQUARE_95 = 3.841
"""95 % of one degree of freedom."""
NORMAL_95 = 1.96
"""Standard deviations to either side that hold 95 % of a normal distribution."""
MAX_TIME_CONSTANT = 1e6
"""s (12 days) of errors that last, and of the memory that follows them: what takes longer does not
change within a recording."""
MEDIAN_OF_NORMAL = 0.6745
"""Median of the size of N(0, 1)."""
FROZEN_TIME, FROZEN_ROWS, LIVELY = 5.0, 10, 0.5
"""A reading is frozen that holds its value for so many seconds and rows, where so large a share of the others
differs from the one before: of such readings, ten alike in a row come by chance once in a thousand."""
