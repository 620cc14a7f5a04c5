"""The motion of a small multicopter: to and fro at some metres a second, leaning into every
acceleration, with the quick corrections of its controller."""

import numpy as np
from scipy.special import jv

from strapdown.sim.trajectory import Motion

DEG = np.pi / 180
GRAVITY = 9.81
WAVES = ((4.0, 0.11, 0.3), (1.2, 0.31, 1.0)), ((3.0, 0.13, 1.2), (1.0, 0.37, 0.2))
"""(m/s, Hz, phase) of the velocities north and east."""


def _sum(waves, t):
    return sum(v * np.sin(2 * np.pi * f * t + p) for v, f, p in waves)


def _rate(waves, t):
    return sum(2 * np.pi * f * v * np.cos(2 * np.pi * f * t + p) for v, f, p in waves)


def motion():
    """Motion."""

    def velocity(t):
        return _sum(WAVES[0], t), _sum(WAVES[1], t), 0.6 * np.sin(2 * np.pi * 0.07 * t)

    def attitude(t):
        heading = DEG * (40 * np.sin(2 * np.pi * t / 23) + 25 * np.sin(2 * np.pi * t / 9))
        north, east = _rate(WAVES[0], t), _rate(WAVES[1], t)
        c, s = np.cos(heading), np.sin(heading)
        quick = DEG * (1.5 * np.sin(2 * np.pi * 1.3 * t) + 0.7 * np.sin(2 * np.pi * 3.1 * t))
        roll = np.arctan((c * east - s * north) / GRAVITY) + quick
        pitch = -np.arctan((c * north + s * east) / GRAVITY) + 0.8 * quick
        return roll, pitch, heading

    return Motion("multicopter", (DEG * 47.4, DEG * 8.5, 500.0), velocity, attitude)


def rocking(seed, angle=0.38, period=1.7):
    """Motion of a multicopter that rocks about its roll axis by `angle` (rad) at constant thrust: its
    accelerometer feels none of it. The integrals are series of Bessel functions (Jacobi-Anger)."""
    rng, rate = np.random.default_rng(seed), 2 * np.pi / period
    heading, phase = rng.uniform(0, 2 * np.pi, 2)
    thrust = GRAVITY / jv(0, angle)

    def velocity(t):
        forward = 3.0 + np.sin(2 * np.pi * t / 31 + phase)
        right = sum(jv(k, angle) * np.cos(k * rate * t) / (k * rate) for k in (1, 3, 5, 7))
        down = sum(jv(k, angle) * np.sin(k * rate * t) / (k * rate) for k in (2, 4, 6))
        c, s = np.cos(heading), np.sin(heading)
        right, down = -2 * thrust * right, -2 * thrust * down
        return c * forward - s * right, s * forward + c * right, down

    def attitude(t):
        return angle * np.sin(rate * t), 0 * t, heading + 0 * t

    return Motion("rocking", (DEG * 47.4, DEG * 8.5, 500.0), velocity, attitude)
