"""Messages of ROS with values, of the classes of the double."""

import numpy as np
from ros_double import message_class


def message(name, **values):
    """A message, its fields given as paths with double underscores."""
    made = message_class(name)()
    for path, value in values.items():
        *parents, last = path.split("__")
        inner = made
        for parent in parents:
            inner = getattr(inner, parent)
        if isinstance(value, tuple):
            for axis, each in zip("xyzw", value):
                setattr(getattr(inner, last), axis, each)
        else:
            setattr(inner, last, value)
    return made


def imu(gyro=(0.0, 0.0, 0.0), accel=(0.0, 0.0, 9.8), **values):
    return message(
        "sensor_msgs/msg/Imu", angular_velocity=gyro, linear_acceleration=accel, **values
    )


def fix(lat=47.0, lon=8.5, height=400.0, variances=(4.0, 1.0, 9.0), kind=2, status=0):
    return message(
        "sensor_msgs/msg/NavSatFix",
        latitude=lat,
        longitude=lon,
        altitude=height,
        position_covariance=np.diag(variances).ravel(),
        position_covariance_type=kind,
        status__status=status,
    )


def of_receiver(linear, variances):
    """The velocity of a receiver, east, north, up."""
    return message(
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        twist__twist__linear=linear,
        twist__covariance=np.diag(variances).ravel(),
    )


def odometry(linear, variances=(0.0,) * 6):
    return message(
        "nav_msgs/msg/Odometry",
        twist__twist__linear=linear,
        twist__covariance=np.diag(variances).ravel(),
    )
