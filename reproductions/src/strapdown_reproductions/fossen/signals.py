"""The input signals of the case study of Fossen's chapter 14, as a truth for this library and as
recordings of it.

What the published generator (`insSignal` of the Marine Systems Simulator) gives on a flat Earth at
rest is integrated here on the turning ellipsoid: the accelerometer feels the published acceleration
less the gravity of the place, both in body axes, and the gyro the published rate against inertial
space. So the ideal IMU reads the published signals to the letter, and the trajectory is what they
mean on Earth.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.integrate import solve_ivp

from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.sensor_models.ahrs import Ahrs, AhrsPlan
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.gnss import Gnss, PositionPlan, VelocityPlan
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sensor_models.magnetometer import Magnetometer, MagnetometerPlan
from strapdown.sensor_models.sampling import fix_times
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.analytic import waves
from strapdown.sim.trajectory import DEG, EARTH_RATE, Motion, normal_gravity, radii, records
from strapdown.typing import Array, ArrayLike

Axes: TypeAlias = Sequence[Sequence[tuple[float, float, float]]]
"""Sines of each axis: amplitude, rad/s, phase in rad."""
TRONDHEIM = (float(np.radians(63.4305)), float(np.radians(10.3951)), 0.0)
"""Where all signals begin: rad, rad, m."""
FIELD = (13559e-9, 921e-9, 50209e-9)
"""The published field there, T NED; its direction is that of a field model, its strength that of
the Earth."""
ACCEL_BIAS, GYRO_BIAS = (0.1, 0.3, -0.1), (0.05, 0.1, -0.05)
"""m/s^2 and rad/s at the beginning."""
BIAS_TIME = 300.0
"""s: of the slowly varying biases, which decay from the values above."""
BIAS_STD = (20e-6 * 9.81, float(np.radians(8 / 3600)))
"""m/s^2 and rad/s: their stationary standard deviations."""
SAMPLE_NOISE = 0.005
"""Standard deviation of each sample of force (m/s^2) and rate (rad/s)."""
POSITION_STD, VELOCITY_STD = 0.05, 0.01  # m, m/s
DIRECTION_STD, COMPASS_STD, AHRS_STD = 0.005, 0.005, 0.005
"""Standard deviations of the field's unit vector, and in rad: chosen, for the published generator
has 0.005 nT, and an exact compass and AHRS."""
POSITION_INTERVAL, FIELD_RATE, AHRS_RATE = 0.2, 100.0, 10.0  # s, Hz, Hz
SPEED = 5.0
"""m/s of the steady straight motion."""
# (amplitude, rad/s, phase rad) of sines: acceleration forward, right, down, m/s^2; rate about
# forward, right, down, rad/s
SIGNALS = {
    "signal 1": (
        ([(0.1, 0.1, 0.0)], [(0.01, 0.1, np.pi / 2)], [(0.05, 0.05, 0.0)]),
        ([(0.03, 0.2, np.pi / 2)], [(-0.02, 0.1, 0.0)], [(0.01, 0.05, 0.0)]),
    ),
    "signal 2": (
        (
            [(0.2, 0.07, 0.5), (0.05, 0.2, 0.0)],
            [(0.1, 0.1, np.pi / 2), (0.02, 0.3, 0.3 + np.pi / 2)],
            [(0.15, 0.05, 1.0), (0.03, 0.2, np.pi / 2)],
        ),
        (
            [(0.05, 0.3, 0.0), (0.01, 0.1, 0.7 + np.pi / 2)],
            [(0.04, 0.2, 1.2 + np.pi / 2)],
            [(0.03, 0.15, 0.4)],
        ),
    ),
}
CONSTANT = "signal 2, constant biases"
MOVED = (*SIGNALS, CONSTANT)
"""The two signals, the second one with varying biases and with constant ones."""
EXCITATIONS = (*SIGNALS, "at rest", "steady", "turning", "steep", CONSTANT)
"""MOVED; level and still; level and straight at SPEED; level in one place, its heading swinging;
pitching through the vertical."""
SWINGS = {"turning": (0.0, 0.0, 40.0), "steep": (10.0, 95.0, 20.0)}
"""deg: amplitudes of roll, pitch and heading, with periods of 37, 80 and 60 s."""


class Ideal(NamedTuple):
    """Return the truth of an excitation and the readings of an IMU without errors."""

    truth: Trajectory  # n + 1 rows from 0 s
    imu: Imu  # n rows


def acceleration(name: str, t: ArrayLike) -> Array:
    """(..., 3) m/s^2, body: the specific force of a signal without gravity."""
    return _sines(SIGNALS[name][0], t)


def rate(name: str, t: ArrayLike) -> Array:
    """(..., 3) rad/s, body: the angular rate of a signal."""
    return _sines(SIGNALS[name][1], t)


def _sines(axes: Axes, t: ArrayLike) -> Array:
    return np.stack(
        [
            sum(size * np.sin(pace * np.asarray(t) + phase) for size, pace, phase in terms)
            for terms in axes
        ],
        axis=-1,
    )


@lru_cache(maxsize=8)
def ideal(name: str, rate_hz: float, duration: float) -> Ideal:
    """The Ideal of one of EXCITATIONS over `duration` s with `rate_hz` samples a second. Raises
    DataError for another name."""
    if name == CONSTANT:
        return ideal("signal 2", rate_hz, duration)
    t = np.arange(round(duration * rate_hz) + 1) / rate_hz
    if name in SIGNALS:
        return integrate_signal(name, t)
    if name not in EXCITATIONS:
        raise DataError(f"no excitation {name!r}; there is: {', '.join(EXCITATIONS)}")
    speed = SPEED if name == "steady" else 0.0
    swing = [
        (DEG * size, period, 0.0)
        for size, period in zip(SWINGS.get(name, (0.0, 0.0, 0.0)), (37.0, 80.0, 60.0))
    ]
    motion = Motion(
        name,
        TRONDHEIM,
        lambda s: (speed + 0 * s, 0 * s, 0 * s),
        lambda s: tuple(waves(s, (term,)) for term in swing),
    )
    return Ideal(*records(motion, t))


def integrate_signal(name: str, t: Array) -> Ideal:
    """The Ideal of a signal at times t (n + 1,) from 0, by a Runge-Kutta solution (order 8) of the
    strapdown equations to 1e-12.

    The state: latitude, longitude, height, velocity NED, quaternion, and the integral of the
    specific force, whose differences are the samples.
    """
    begin = np.r_[TRONDHEIM, np.zeros(3), 1.0, np.zeros(6)]
    scale = np.r_[1e-7, 1e-7, np.ones(4), np.full(4, 0.1), np.ones(3)]
    found = solve_ivp(
        lambda s, y: _slope(name, s, y),
        (0.0, t[-1]),
        begin,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12 * scale,
        max_step=0.25,
        t_eval=t,
    )
    y = found.y.T
    q = y[:, 6:10] / np.linalg.norm(y[:, 6:10], axis=1)[:, None]
    truth = Trajectory(t, y[:, :3].copy(), y[:, 3:6].copy(), q * np.where(q[:, :1] < 0, -1.0, 1.0))
    return Ideal(
        truth, Imu(t[1:], np.diff(t), np.diff(_angles(name, t), axis=0), np.diff(y[:, 10:], axis=0))
    )


def _angles(name: str, t: Array) -> Array:
    """(n, 3) integrals of the rate from 0, rad."""
    return np.stack(
        [
            sum(
                size / pace * (np.cos(phase) - np.cos(pace * t + phase))
                for size, pace, phase in terms
            )
            for terms in SIGNALS[name][1]
        ],
        axis=1,
    )


def _slope(name: str, t: float, y: Array) -> Array:
    lat, _, alt, north, east, down = y[:6]
    meridian, normal = radii(lat)
    earth = EARTH_RATE * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    frame = earth + np.array(
        [east / (normal + alt), -north / (meridian + alt), -east * np.tan(lat) / (normal + alt)]
    )
    gravity_north, gravity_down = normal_gravity(lat, alt)
    C, g = _matrix(y[6:10]), np.array([gravity_north, 0.0, gravity_down])
    force = acceleration(name, t) - C.T @ g
    moved = C @ force + g - np.cross(earth + frame, y[3:6])
    place = north / (meridian + alt), east / ((normal + alt) * np.cos(lat)), -down
    return np.r_[place, moved, 0.5 * _rate_matrix(rate(name, t) - C.T @ frame) @ y[6:10], force]


def _matrix(q: Array) -> Array:
    """C_nb of a quaternion, scalar first, whose length may be off by rounding."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def _rate_matrix(w: Array) -> Array:
    """The matrix W of dq/dt = W q / 2 for a rate w in body axes."""
    x, y, z = w
    return np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]])


def sensor(rate_hz: float) -> ImuSpec:
    """The ImuSpec behind the samples: white noise of 0.005 each, whatever their rate, and
    nothing else; biases are added by `recording`."""
    noise = SAMPLE_NOISE * rate_hz**-0.5
    return ImuSpec(
        "fossen",
        Triad(noise=noise),
        Triad(noise=noise),
        "white noise of insSignal, Marine Systems Simulator",
    )


def describe_imu(rate_hz: float, walking: bool) -> ImuSpec:
    """The ImuSpec that tells filters what the samples hold: noise, and biases of the published
    size, constant or decaying with BIAS_TIME."""
    size = lambda values: float(np.sqrt(np.mean(np.square(values))))
    terms = lambda values: (
        {"gauss_markov": size(values), "time_constant": BIAS_TIME}
        if walking
        else {"turn_on_bias": size(values)}
    )
    noise = SAMPLE_NOISE * rate_hz**-0.5
    return ImuSpec(
        "fossen",
        Triad(noise=noise, **terms(GYRO_BIAS)),
        Triad(noise=noise, **terms(ACCEL_BIAS)),
        "insSignal, Marine Systems Simulator",
    )


def biases(walking: bool, count: int, dt: float, stream: RandomStream) -> tuple[Array, ...]:
    """(b_a (count, 3) m/s^2, b_g rad/s) at the samples: constant, or where `walking` the
    published Gauss-Markov process begun at the constant values."""
    begun = np.array([ACCEL_BIAS, GYRO_BIAS])
    if not walking:
        return tuple(np.tile(value, (count, 1)) for value in begun)
    from scipy.signal import lfilter

    keep = np.exp(-dt / BIAS_TIME)
    steps = (
        np.sqrt(1 - keep * keep)
        * stream.standard_normal((2, count + 1, 3))
        * np.array(BIAS_STD)[:, None, None]
    )
    steps[:, 0] = begun
    return tuple(lfilter([1.0], [1.0, -keep], part, axis=0)[1:] for part in steps)


def recording(
    name: str,
    seed: int,
    rate_hz: float = 100.0,
    duration: float = 300.0,
    interval: float = POSITION_INTERVAL,
    walking: bool | None = None,
) -> Recording:
    """A Recording of an excitation with all that the filters may want: position, velocity, field,
    heading (compass), attitude (AHRS), gravity.

    interval: s between fixes of position and velocity; walking: whether biases vary, by default
    those of signal 2. `seed` is a whole number; each sensor has its own stream, so that excitations
    and rates share no draw by accident of order. meta holds the true biases "b_a" and "b_g".
    """
    truth, imu = ideal(name, float(rate_hz), float(duration))
    of = RandomStream.of([seed, EXCITATIONS.index(name)]).child
    noisy, _, _ = sensor(rate_hz).corrupt(imu, of("imu"))
    walks = name == "signal 2" if walking is None else walking
    b_a, b_g = biases(walks, len(imu.t), 1 / rate_hz, of("biases"))
    noisy = noisy._replace(
        dv=noisy.dv + b_a * imu.dt[:, None], dtheta=noisy.dtheta + b_g * imu.dt[:, None]
    )
    position, velocity, field, ahrs = plans(name, float(rate_hz), float(duration), float(interval))
    fixes = (
        position.fixes(of("position")),
        velocity.fixes(of("velocity")),
        field.fixes(of("field")),
        _compass(truth, of("compass")),
        ahrs.fixes(of("ahrs")),
        _gravity(position.source.t),
    )
    meta = {
        "name": f"{name}, seed {seed}",
        "grade": describe_imu(rate_hz, walks),
        "notes": [],
        "b_a": b_a,
        "b_g": b_g,
        "place": list(TRONDHEIM),
    }
    return Recording(noisy, fixes, truth, meta)


@lru_cache(maxsize=20)
def plans(
    name: str, rate_hz: float, duration: float, interval: float
) -> tuple[PositionPlan, VelocityPlan, MagnetometerPlan, AhrsPlan]:
    """Return the measurement plans that all seeds share: noise-free position, velocity, field and
    AHRS, to which each plan adds noise."""
    truth, strength = ideal(name, rate_hz, duration).truth, float(np.linalg.norm(FIELD))
    receiver = Gnss(interval, (POSITION_STD,) * 3, (VELOCITY_STD,) * 3).plan(truth, np.inf)
    field = Magnetometer(min(FIELD_RATE, rate_hz), DIRECTION_STD * strength, field=FIELD).plan(
        truth, gate=np.inf
    )
    return (
        receiver.position,
        receiver.velocity,
        field,
        Ahrs(AHRS_RATE, AHRS_STD).plan(truth, np.inf),
    )


def _compass(truth: Trajectory, stream: RandomStream) -> Source:
    t = fix_times(truth, 1 / FIELD_RATE)
    rows = np.searchsorted(truth.t, t)
    y = truth.rph[rows, 2] + COMPASS_STD * stream.standard_normal(len(t))
    return Source(
        "heading", t, y[:, None], np.full((len(t), 1), COMPASS_STD), gate=np.inf, name="compass"
    )


def _gravity(t: Array) -> Source:
    """The constraint that the body does not accelerate, which it does by 0.1 to 0.2 m/s^2 for
    tens of seconds."""
    return Source(
        "gravity", t, np.zeros((len(t), 3)), np.ones((len(t), 3)), gate=np.inf, name="gravity"
    )
