"""A flight over a flat, still Earth: analytic speed, heading, bank and climb, exact increments
by quadrature, fixes of position and velocity."""

import numpy as np
import pyins.earth
from scipy.spatial.transform import Rotation

from strapdown import InitialState, Trajectory
from strapdown.core.loop.contract import Imu, Noise
from strapdown.core.mathematics.earth import gravity
from strapdown.data.recording import Recording
from strapdown.data.solution import Source

ORIGIN = np.array([np.radians(47.0), np.radians(8.0), 500.0])
NOISE = Noise(gyro=1e-5, accel=2e-3, gyro_bias=0.0, accel_bias=0.0, gyro_decay=0.0, accel_decay=0.0)
# m per rad of latitude and of longitude
RADII = np.array(pyins.earth.principal_radii(np.degrees(ORIGIN[0]), ORIGIN[2])[0::2])
GRAVITY = float(gravity(np.sin(ORIGIN[0]), ORIGIN[2]))


def motion(t, turning=True):
    """Position (m), velocity (m/s), acceleration (m/s^2), all NED, Euler angles (rad) and their
    rates (rad/s) at times t."""
    one = np.ones_like(t)
    rate, climb = (0.3 if turning else 0.0), 1.5
    heading, angle = rate * t + 0.4 * one, rate * one
    bank = 0.2 * np.sin(0.7 * t)
    speed = 25.0
    v = np.array([speed * np.cos(heading), speed * np.sin(heading), -climb * np.cos(0.5 * t)])
    a = np.array(
        [
            -speed * rate * np.sin(heading),
            speed * rate * np.cos(heading),
            0.5 * climb * np.sin(0.5 * t),
        ]
    )
    if turning:
        radius = speed / rate
        p = np.array(
            [
                radius * (np.sin(heading) - np.sin(0.4)),
                radius * (np.cos(0.4) - np.cos(heading)),
                -climb / 0.5 * np.sin(0.5 * t),
            ]
        )
    else:
        p = np.array([v[0] * t, v[1] * t, -climb / 0.5 * np.sin(0.5 * t)])
    return (
        p,
        v,
        a,
        np.array([bank, 0.05 * one, heading]),
        np.array([0.14 * np.cos(0.7 * t), 0 * one, angle]),
    )


def increments(t, dt, turning):
    """Plain integrals of rate and specific force over (t - dt, t], by Gauss quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    dtheta, dv = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for node, weight in zip(nodes, weights):
        _, _, a, (roll, pitch, heading), (roll_rate, pitch_rate, heading_rate) = motion(
            t - 0.5 * dt * (1 - node), turning
        )
        rates = [
            roll_rate - heading_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + heading_rate * np.sin(roll) * np.cos(pitch),
            -pitch_rate * np.sin(roll) + heading_rate * np.cos(roll) * np.cos(pitch),
        ]
        force = (
            Rotation.from_euler("ZYX", np.c_[heading, pitch, roll])
            .inv()
            .apply((a - [[0], [0], [GRAVITY]]).T)
        )
        dtheta += 0.5 * dt * weight * np.array(rates).T
        dv += 0.5 * dt * weight * force
    return dtheta, dv


def flight(
    seconds=20.0, rate=100.0, turning=True, seed=1, gps=0.2, cut=np.inf, noisy=True, std=(1.0, 0.1)
):
    """(Recording, Start at the truth displaced by its own standard deviations, flat truth (n +
    1, 6)) with fixes of both kinds until `cut` s."""
    rng = np.random.default_rng(seed)
    dt = 1 / rate
    t = dt * np.arange(0, int(seconds * rate) + 1)
    p, v, _, angles, _ = motion(t, turning)
    dtheta, dv = increments(t[1:], dt, turning)
    if noisy:
        dtheta = dtheta + rng.normal(0, NOISE.gyro * np.sqrt(dt), dtheta.shape)
        dv = dv + rng.normal(0, NOISE.accel * np.sqrt(dt), dv.shape)
    truth = np.r_[p, v].T
    fixed = np.arange(round(gps * rate), len(t), round(gps * rate))
    fixed = fixed[t[fixed] < cut]
    noise = rng.standard_normal((len(fixed), 6)) * np.repeat(std, 3)
    fixes = truth[fixed] + noise
    sources = (
        Source("position", t[fixed], geodetic(fixes[:, :3]), np.full((len(fixed), 3), std[0])),
        Source("velocity", t[fixed], fixes[:, 3:], np.full((len(fixed), 3), std[1])),
    )
    off = np.r_[np.full(3, 2.0), np.full(3, 0.3)] * rng.standard_normal(6)
    start = InitialState(
        0.0,
        tuple(geodetic(off[None, :3])[0]),
        tuple(truth[0, 3:] + off[3:]),
        tuple(angles[:, 0]),
        (0.0,) * 3,
        (0.0,) * 3,
        (2.0,) * 3 + (0.3,) * 3 + (1e-6,) * 9,
    )
    q = Rotation.from_euler("ZYX", angles[::-1].T).as_quat()[:, [3, 0, 1, 2]]
    reference = Trajectory(t, geodetic(truth[:, :3]), truth[:, 3:], q)
    return (
        Recording(
            Imu(t[1:], np.full(len(t) - 1, dt), dtheta, dv), sources, reference, {"name": "flat"}
        ),
        start,
        truth,
    )


def geodetic(p):
    """Latitude, longitude (rad) and height (m) of flat positions (n, 3), m, about ORIGIN."""
    return ORIGIN + p * [1 / RADII[0], 1 / RADII[1], -1.0]


def flat(lla, origin=ORIGIN):
    """The other way round, about `origin` and with the radii there."""
    north, _, east = pyins.earth.principal_radii(np.degrees(origin[0]), origin[2])
    return (lla - np.array(origin)) * [north, east, -1.0]
