"""When the vehicle stands still, judged by the IMU alone."""
import numpy as np

REST_ACCEL, REST_RATE, REST_MEAN = 0.25, 0.1, 0.1
"""At rest: bounds on the standard deviation of specific force (m/s^2) and rate (rad/s), three axes together, and on the mean rate (rad/s).

Measured with one-second windows: a car at rest with its engine running and a MEMS IMU 0.10-0.16 m/s^2, the slowest driving 0.37 m/s^2.
The mean rate leaves room for an uncalibrated MEMS gyro (5.7 deg/s).
"""


def at_rest(imu, window=1.0):
    """(n,) bool: the vehicle stands still, judged by the IMU alone over every `window` (s) that holds the sample; see `REST_ACCEL`.

    Smooth straight motion looks the same to an IMU: use it for what stops now and then, or together with the speed of fixes.
    """
    n, width = len(imu.t), max(2, round(window / float(np.median(imu.dt))))
    if n < width:
        return np.zeros(n, bool)
    force, _ = _spread(imu.dv, imu.dt, width)
    rate, mean = _spread(imu.dtheta, imu.dt, width)
    quiet = (force < REST_ACCEL ** 2) & (rate < REST_RATE ** 2) & (mean < REST_MEAN ** 2)
    moving = np.r_[0, np.cumsum(~quiet)]    # window k covers samples k ... k + width - 1, so sample i is in windows i - width + 1 ... i
    i = np.arange(n)
    return moving[np.minimum(i + 1, len(quiet))] == moving[np.maximum(i - width + 1, 0)]


def _spread(columns, dt, width):
    """Variance and squared mean of columns / dt over every window of `width` samples, summed over the axes."""
    variance, square = np.zeros((2, len(dt) - width + 1))
    for column in columns.T:
        values = column / dt
        centre = values.mean()
        values -= centre
        mean = _moving_sum(values, width) / width
        variance += np.maximum(_moving_sum(values * values, width) / width - mean * mean, 0)
        square += (mean + centre) ** 2
    return variance, square


def _moving_sum(values, width):
    total = np.r_[0.0, np.cumsum(values)]
    return total[width:] - total[:-width]
