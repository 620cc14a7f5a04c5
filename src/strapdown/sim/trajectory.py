"""A motion as two functions of time, and the exact truth and IMU increments computed from it.

The Earth model here (radii, gravity, rate) is deliberately independent of that in `core`, so that
an error in one does not cancel in the other.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.solution import Trajectory
from ..geometry.rotations import Rotation
from ..typing import Array, ArrayLike, Ints
from .analytic import Numbers, Times

SEMI_MAJOR, FLATTENING, EARTH_RATE = 6378137.0, 1 / 298.257223563, 7.292115e-5
ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)
GRAVITY_EQUATOR, GRAVITY_POLE, GM = 9.7803253359, 9.8321849378, 3.986004418e14
"""WGS-84: m, -, rad/s, -, m/s^2, m/s^2, m^3/s^2."""
ZONAL = 1.082629821313e-3, -2.37091120053e-6, 6.083464988811e-9
"""J_2, J_4, J_6 of the normal field of the same ellipsoid, computed from the constants above by
Heiskanen & Moritz (1967), 2-90 and 2-92."""
DEG = np.pi / 180

# limit of the models: beyond it, heading and longitude change too fast to be meaningful
_POLEWARD = 89 * DEG
_MAX_SAMPLE = 0.02  # s; a longer sample is integrated in pieces
_STEP = 1e-20  # of the complex-step derivative: no cancellation, so it may vanish against t
_BLOCK = 400_000  # pieces worked on at a time: a day of samples is too long for temporary arrays
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18
_r = np.sqrt(15.0)
_INNER = np.array(
    [
        [5 / 36, 2 / 9 - _r / 15, 5 / 36 - _r / 30],
        [5 / 36 + _r / 24, 2 / 9, 5 / 36 - _r / 24],
        [5 / 36 + _r / 30, 2 / 9 + _r / 15, 5 / 36],
    ]
)
"""Three-point Gauss-Legendre collocation on [0, 1] (order 6): nodes, weights, and weights of the
integrals up to each node."""


OfTime: TypeAlias = Callable[[Times], Sequence[Numbers]]
"""Times -> three arrays of their shape, or numbers."""
Gravity: TypeAlias = Callable[[Array, Array], tuple[float | Array, float | Array]]
"""(latitude rad, height m) -> north and down, m/s^2."""


class Motion(NamedTuple):
    """A motion over the Earth: its initial position and two functions of time, which determine
    everything else.

    Both take an array of times (s, from 0) and return three arrays or numbers. They are
    differentiated by complex step: write them with analytic numpy functions that take complex
    arguments (no abs, arctan2, comparison or np.radians; use `ramp` for changes and `DEG` for
    degrees).
    """

    name: str
    lla: tuple[float, ...]  # at t = 0: latitude rad, longitude rad, ellipsoidal height m
    velocity: OfTime  # t -> north, east, down velocity, m/s
    attitude: OfTime  # t -> roll, pitch, heading, rad (ZYX; heading need not be wrapped)
    end: float = np.inf  # s, the last valid time of the functions


class _Positions(NamedTuple):
    """The integral of a motion's velocity, in pieces between the requested times."""

    lla: Array  # (n, 3) at these times
    nodes: Array  # (3, pieces, 3) latitude, longitude, height at the quadrature nodes
    times: Array  # (pieces, 3) of the nodes, s
    length: Array  # (pieces,) s
    first: Ints  # first piece of each interval


def sample(
    motion: Motion,
    t: ArrayLike,
    longest: float = _MAX_SAMPLE,
    lla: Sequence[float] | Array | None = None,
) -> Trajectory:
    """Truth at increasing times t (n,), s, at or after 0, as data.Trajectory; position is the exact
    integral of velocity. Raises DataError.

    The integral has pieces of at most `longest` s; a coarse view of a smooth motion allows more
    than the default. It begins at 0 with the motion or, if given, at t[0] with the position `lla`.
    """
    t = _check_times(motion, t)
    return _truth(motion, t, _positions(motion, t, lla, longest).lla)


def increments(motion: Motion, t: ArrayLike) -> Imu:
    """Return the increments of an ideal IMU at t[1:]: integrals of omega_ib_b (rad) and f_ib_b
    (m/s) since the time before. Raises DataError."""
    t = _check_times(motion, t)
    return _increments(motion, t, _positions(motion, t), normal_gravity)


def records(
    motion: Motion, t: ArrayLike, gravity_model: Gravity | None = None
) -> tuple[Trajectory, Imu]:
    """Return (`sample`, `increments`) together, which takes less time and memory: t[0] must be 0.
    Raises DataError.

    `gravity_model` is a function of latitude (rad) and height (m), which returns the north and
    down components in m/s^2, in place of this module's `normal_gravity`.
    """
    t = _check_times(motion, t)
    if t[0] != 0 or len(t) < 2:
        raise DataError(
            f"a recording must begin at 0 s and have two times or more, not {len(t)} from {t[0]:g} s"
        )
    rows = max(1, _BLOCK // max(1, int(np.ceil(np.diff(t).max() / _MAX_SAMPLE - 1e-9))))
    lla: Array | None = None
    truths: list[Trajectory] = []
    imus: list[Imu] = []
    for begin in range(0, len(t) - 1, rows):
        part = t[begin : begin + rows + 1]
        positions = _positions(motion, part, lla)
        lla, skip = positions.lla[-1], int(begin > 0)
        truths.append(_truth(motion, part[skip:], positions.lla[skip:]))
        imus.append(_increments(motion, part, positions, gravity_model or normal_gravity))
    if len(imus) == 1:
        return truths[0], imus[0]
    return (
        Trajectory(
            t,
            *(
                np.concatenate([getattr(truth, name) for truth in truths])
                for name in ("lla", "v_n", "q_nb")
            ),
        ),
        Imu(*(np.concatenate(columns) for columns in zip(*imus))),
    )


def _truth(motion: Motion, t: Array, lla: Array) -> Trajectory:
    q = Rotation.from_rph(np.transpose(_values(motion.attitude, t))).as_wxyz()
    return Trajectory(
        t,
        lla,
        np.ascontiguousarray(_values(motion.velocity, t).T),
        q * np.where(q[:, :1] < 0, -1.0, 1.0),
    )


def _increments(motion: Motion, t: Array, positions: _Positions, gravity_model: Gravity) -> Imu:
    _, nodes, times, length, first = positions
    omega, f = rates(motion, times.ravel(), nodes.reshape(3, -1), gravity_model)
    sums = [
        np.add.reduceat(length * (rate.reshape(3, *times.shape) @ _WEIGHTS), first, axis=1)
        for rate in (omega, f)
    ]
    return Imu(t[1:], np.diff(t), *(np.ascontiguousarray(total.T) for total in sums))


def rates(motion: Motion, t: Array, lla: Array, gravity_model: Gravity) -> tuple[Array, Array]:
    """(omega_ib_b rad/s, f_ib_b m/s^2), (3, n) each, at times t (n,), positions lla (3, n) and
    in the gravity that belong to them."""
    (north, east, down), acceleration = _with_derivative(motion.velocity, t)
    (roll, pitch, heading), (roll_rate, pitch_rate, heading_rate) = _with_derivative(
        motion.attitude, t
    )
    lat, _, alt = lla
    meridian, normal = radii(lat)
    earth = EARTH_RATE * np.stack([np.cos(lat), 0 * lat, -np.sin(lat)])
    transport = np.stack(
        [east / (normal + alt), -north / (meridian + alt), -east * np.tan(lat) / (normal + alt)]
    )
    force = acceleration + np.cross(2 * earth + transport, np.stack([north, east, down]), axis=0)
    north_gravity, down_gravity = gravity_model(lat, alt)
    force[0] -= north_gravity
    force[2] -= down_gravity
    omega_nb = np.stack(
        [
            roll_rate - heading_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + heading_rate * np.cos(pitch) * np.sin(roll),
            -pitch_rate * np.sin(roll) + heading_rate * np.cos(pitch) * np.cos(roll),
        ]
    )
    return omega_nb + _to_body(earth + transport, roll, pitch, heading), _to_body(
        force, roll, pitch, heading
    )


def radii(lat: float | Array) -> tuple[float | Array, float | Array]:
    """Radii of curvature of the ellipsoid in the meridian and in the prime vertical, m, at
    latitudes in rad."""
    w2 = 1 - ECCENTRICITY2 * np.sin(lat) ** 2
    return SEMI_MAJOR * (1 - ECCENTRICITY2) / w2**1.5, SEMI_MAJOR / np.sqrt(w2)


def normal_gravity(lat: float | Array, alt: float | Array) -> tuple[float | Array, float | Array]:
    """North and down component of normal gravity, m/s^2, at latitudes in rad and heights in m."""
    return gravity_north(lat, alt), gravity(lat, alt)


def gravity_north(lat: float | Array, alt: float | Array) -> float | Array:
    """North component of normal gravity, m/s^2, at latitudes in rad and heights in m: the slope
    to the north of the potential, by complex step.

    On the ellipsoid it should be 0; the harmonics left out there, from degree 8 on, are 1e-9
    m/s^2, above it less.
    """
    s, c = np.sin(lat), np.cos(lat)
    normal = radii(lat)[1]
    axial, polar = (normal + alt) * c, (normal * (1 - ECCENTRICITY2) + alt) * s
    return _potential(axial - 1j * _STEP * s, polar + 1j * _STEP * c).imag / _STEP


def _potential(axial: Numbers, polar: Numbers) -> Numbers:
    """Return the potential of gravity, m^2/s^2, at distances (m) from the axis and from the plane
    of the equator: zonal harmonics to degree 6 (Heiskanen & Moritz 1967, 2-39) and the centrifugal
    force's."""
    square = axial**2 + polar**2
    x, s2 = SEMI_MAJOR**2 / square, polar**2 / square
    j2, j4, j6 = ZONAL
    zonal = x * (
        j2 * (3 * s2 - 1) / 2
        + x
        * (
            j4 * (35 * s2**2 - 30 * s2 + 3) / 8
            + x * j6 * (231 * s2**3 - 315 * s2**2 + 105 * s2 - 5) / 16
        )
    )
    return GM / np.sqrt(square) * (1 - zonal) + (EARTH_RATE * axial) ** 2 / 2


def gravity(lat: float | Array, alt: float | Array) -> float | Array:
    """Down component of normal gravity, m/s^2, at latitudes in rad and heights in m: Somigliana
    on the ellipsoid, second order in height (Heiskanen & Moritz 1967, eq. 2-123)."""
    b = SEMI_MAJOR * (1 - FLATTENING)
    k = b * GRAVITY_POLE / (SEMI_MAJOR * GRAVITY_EQUATOR) - 1
    m = EARTH_RATE**2 * SEMI_MAJOR**2 * b / GM
    s2, x = np.sin(lat) ** 2, alt / SEMI_MAJOR
    surface = GRAVITY_EQUATOR * (1 + k * s2) / np.sqrt(1 - ECCENTRICITY2 * s2)
    return surface * (1 - 2 * (1 + FLATTENING + m - 2 * FLATTENING * s2) * x + 3 * x**2)


def ramp(t: Numbers, at: float, width: float) -> Numbers:
    """Smooth step from 0 to 1 around the time `at` (s): tanh, 12 % at -width and 88 % at +width."""
    return 0.5 + 0.5 * np.tanh((t - at) / width)


def ramp_rate(t: Numbers, at: float, width: float) -> Numbers:
    """Time derivative of `ramp`, 1/s; its peak is 0.5/width."""
    return 0.5 / width * (1 - np.tanh((t - at) / width) ** 2)


def static(lla: Sequence[float] | Array, rph: Sequence[float] = (0.0, 0.0, 0.0)) -> Motion:
    """A body at rest: lla rad, rad, m; rph rad."""
    return Motion("static", tuple(lla), lambda t: (0.0, 0.0, 0.0), lambda t: tuple(rph))


def demo_flight() -> Motion:
    """Ten minutes in a light aircraft over Lake Constance: 40 to 50 m/s, climbs and descents of
    3 m/s, coordinated turns, some turbulence."""
    turns = [
        (95, 120, 12),
        (170, -100, 11),
        (245, 190, 15),
        (335, -210, 15),
        (425, 150, 12),
        (520, 110, 12),
    ]  # s, deg, s
    climbs = [(40, 120, 3.0), (200, 270, -2.5), (380, 470, 3.0), (500, 570, -2.0)]  # s, s, m/s

    def wave(t: Times, period: float) -> Times:
        return np.sin(2 * np.pi * t / period)

    def speed(t: Times) -> Times:
        return 45 + 4 * wave(t, 97.0) + 1.0 * wave(t, 31.0)

    def course(t: Times) -> Numbers:
        return DEG * 55 + sum(DEG * angle * ramp(t, at, width) for at, angle, width in turns)

    def turn_rate(t: Times) -> Numbers:
        return sum(DEG * angle * ramp_rate(t, at, width) for at, angle, width in turns)

    def climb(t: Times) -> Numbers:
        return sum(
            rate * (ramp(t, start, 4.0) - ramp(t, stop, 4.0)) for start, stop, rate in climbs
        )

    def velocity(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        return speed(t) * np.cos(course(t)), speed(t) * np.sin(course(t)), -climb(t)

    def attitude(t: Times) -> tuple[Numbers, Numbers, Numbers]:
        bank = np.arctan(speed(t) * turn_rate(t) / 9.81)
        roll = bank + DEG * (1.5 * wave(t, 5.3) + 0.5 * wave(t, 1.9))
        pitch = DEG * 2.5 + climb(t) / speed(t) + DEG * (1.0 * wave(t, 4.1) + 0.4 * wave(t, 1.3))
        return roll, pitch, course(t) + DEG * 0.8 * wave(t, 6.7)

    return Motion("demo flight", (DEG * 47.63, DEG * 9.35, 900.0), velocity, attitude)


def _positions(
    motion: Motion,
    t: Array,
    lla: Sequence[float] | Array | None = None,
    longest: float = _MAX_SAMPLE,
) -> _Positions:
    """The positions at t (n,) and at the quadrature nodes between.

    `lla` is the position at t[0]; without it the integral begins with the motion, at 0.
    """
    edges = np.r_[0.0, t] if lla is None and t[0] > 0 else t
    pieces = np.maximum(1, np.ceil(np.diff(edges) / longest - 1e-9)).astype(int)
    first = np.cumsum(pieces) - pieces
    length = np.repeat(np.diff(edges) / pieces, pieces)
    start = (
        np.repeat(edges[:-1], pieces) + (np.arange(len(length)) - np.repeat(first, pieces)) * length
    )
    times = start[:, None] + length[:, None] * _NODES
    north, east, down = _values(motion.velocity, times)
    lat0, lon0, alt0 = motion.lla if lla is None else lla
    alt, alt_nodes = _integral(alt0, -down, length)
    lat_nodes = np.full(times.shape, lat0)
    # the rate depends on latitude only through the radius: each round gains three digits or more
    for _ in range(20):
        before = lat_nodes
        lat, lat_nodes = _integral(lat0, north / (radii(lat_nodes)[0] + alt_nodes), length)
        if np.abs(lat_nodes - before).max(initial=0.0) < 1e-15:
            break
    lon, lon_nodes = _integral(
        lon0, east / ((radii(lat_nodes)[1] + alt_nodes) * np.cos(lat_nodes)), length
    )
    if not np.all(np.isfinite(lat + lon + alt)):
        raise DataError(f"motion {motion.name!r}: its velocity or initial position is not finite")
    if np.abs(lat).max() > _POLEWARD:
        raise DataError(
            f"motion {motion.name!r} goes beyond {_POLEWARD / DEG:g} deg of latitude, where the "
            f"models are not valid; keep away from the poles"
        )
    at = np.r_[first, len(length)][len(edges) - len(t) :]
    skip = first[len(edges) - len(t)] if len(t) > 1 else 0
    keep = slice(skip, None)
    return _Positions(
        np.c_[lat[at], (lon[at] + np.pi) % (2 * np.pi) - np.pi, alt[at]],
        np.stack([lat_nodes, lon_nodes, alt_nodes])[:, keep],
        times[keep],
        length[keep],
        first[len(edges) - len(t) :] - skip,
    )


def _integral(start: float, rate: Array, length: Array) -> tuple[Array, Array]:
    """Integral of a rate given at the nodes: at the ends of all pieces, and at the nodes."""
    ends = start + np.r_[0.0, np.cumsum(length * (rate @ _WEIGHTS))]
    return ends, ends[:-1, None] + length[:, None] * (rate @ _INNER.T)


def _values(function: OfTime, t: Array) -> Array:
    return np.stack(np.broadcast_arrays(*function(t), t)[:3]).astype(float)


def _with_derivative(function: OfTime, t: Array) -> tuple[Array, Array]:
    """Values and time derivatives (3, n) of an analytic function, exact to rounding (Squire &
    Trapp 1998)."""
    z = np.stack(np.broadcast_arrays(*function(t + 1j * _STEP), t)[:3])
    value, slope = z.real.copy(), z.imag / _STEP
    some, half = slice(None, None, 1 + len(t) // 50), 1e-4
    difference = (_values(function, t[some] + half) - _values(function, t[some] - half)) / (
        2 * half
    )
    if not np.allclose(slope[:, some], difference, rtol=1e-3, atol=1e-3):
        raise DataError(
            "a motion's function is not analytic: its complex-step derivative is not its slope "
            "(abs, arctan2, comparison or jump?)"
        )
    return value, slope


def _to_body(vector: Array, roll: Array, pitch: Array, heading: Array) -> Array:
    """Components (3, n) in the body frame of vectors given in the navigation frame: turned about
    z, then y, then x."""
    v = vector.copy()
    for i, j, angle in ((0, 1, heading), (2, 0, pitch), (1, 2, roll)):
        c, s = np.cos(angle), np.sin(angle)
        v[i], v[j] = c * v[i] + s * v[j], c * v[j] - s * v[i]
    return v


def _check_times(motion: Motion, t: ArrayLike) -> Array:
    t = np.ascontiguousarray(t, float)
    if (
        t.ndim != 1
        or len(t) == 0
        or not np.all(np.isfinite(t))
        or t[0] < 0
        or np.any(np.diff(t) <= 0)
    ):
        raise DataError(
            "times of a simulation must be one or more, finite, increasing, and not before 0 s"
        )
    if t[-1] > motion.end + 1e-9:
        raise DataError(
            f"motion {motion.name!r} ends at {motion.end:g} s, but is requested to {t[-1]:g} s; "
            f"simulate a shorter time, or extend the motion"
        )
    return t
