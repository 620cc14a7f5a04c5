"""Heading of a vehicle at one instant of a Recording, from the magnetic field or from the Earth's
rate, each with a standard deviation that covers its errors."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..core.loop.contract import Imu
from ..core.mathematics.earth import GRAVITY_EQUATOR, RATE
from ..data.calibration_parameters import HARD_IRON
from ..data.recording import Recording
from ..data.solution import Source
from ..geometry.geodesy import wrap
from ..geometry.rotation_products import running_matrices
from ..preprocessing.baseline_length import without_wrong_lengths
from ..preprocessing.stationary import motionless
from ..preprocessing.unbroken import nearest_felt
from ..sensor_models.imu import ImuSpec
from ..typing import Array, Mask
from .static_attitude import PARALLEL, gyrocompass, level, level_vector

LEVEL_STD_REST, LEVEL_STD_MOVING = np.radians(0.5), np.radians(5.0)
UNKNOWN_STD = np.radians(104.0)  # uniform over the circle
# smallest std of a magnetic heading: nearby iron, and errors of calibration and field model
MAGNETIC_STD = np.radians(5.0)
MAGNETIC_STD_LIMIT = np.radians(60.0)  # a magnetic heading with a larger std is not used
GYROCOMPASS_STD = np.radians(5.0)  # a heading from the Earth's rate with a larger std is not used
MIN_FELT = 0.8
"""Share of a window between fixes that samples must cover. An acceleration of 3 m/s^2 in the rest
of the window tilts the level by 3.5 deg, less than `LEVEL_STD_MOVING`."""


class HeadingFound(NamedTuple):
    """A heading (rad), its standard deviation (rad), and how it was found, or why not."""

    heading: float
    std: float
    note: str
    at_rest: bool = False  # True for a method that needs a rest

    @property
    def known(self) -> bool:
        """True where the standard deviation is below that of an unknown heading."""
        return self.std < UNKNOWN_STD


def magnetic_heading(
    recording: Recording, source: Source | None, t: float, b_g: Array, level_std: float
) -> HeadingFound | None:
    """Return the HeadingFound at t from the magnetic field of `source`, levelled with the mean
    specific force; None without a source.

    b_g: gyro bias, rad/s; level_std: rad, of that level. The standard deviation combines the noise,
    the level error times tan(dip), `MAGNETIC_STD`, and the differences of horizontal and vertical
    field from the reference. A disturbance is about as large across the field, where it rotates the
    heading. The declination is that of the source's reference field.
    """
    if source is None:
        return None
    if HARD_IRON.name in source.estimate:  # the filter finds it together with the heading
        return HeadingFound(
            0.0, UNKNOWN_STD, "the hard iron of the magnetometer is not estimated yet"
        )
    force = mean_force(recording, t, b_g)
    if force is None:
        return HeadingFound(0.0, UNKNOWN_STD, "no IMU sample there")
    near = np.flatnonzero((source.t >= force.begin) & (source.t <= force.end))
    if not len(near):
        return HeadingFound(0.0, UNKNOWN_STD, "no sample of the magnetic field there")
    m = np.einsum("nij,nj->i", force.turns(source.t[near]), source.y[near]) / len(near)
    seen, reference = (
        level_vector(m, *level(force.f)),
        np.array((*source.parameters, 0.0, 0.0, 0.0))[:3],
    )
    horizontal, size = np.hypot(seen[0], seen[1]), np.linalg.norm(m)
    if not horizontal > PARALLEL * size:
        return HeadingFound(
            0.0,
            UNKNOWN_STD,
            "the magnetic field is vertical" if size else "the magnetic field is 0",
        )
    strange = (
        np.hypot(horizontal - np.hypot(*reference[:2]), seen[2] - reference[2])
        if reference.any()
        else 0.0
    )
    noise = np.sqrt(np.mean(source.std[near] ** 2) / len(near))
    std = np.linalg.norm(
        [
            MAGNETIC_STD,
            strange / horizontal,
            noise / horizontal,
            seen[2] / horizontal * np.hypot(level_std, force.off),
        ]
    )
    words = f"dip {np.degrees(np.arctan2(seen[2], horizontal)):.0f} deg, {size * 1e6:.3g} uT"
    if std > MAGNETIC_STD_LIMIT:
        return HeadingFound(0.0, UNKNOWN_STD, f"the magnetic field ({words}) does not show it")
    heading = np.arctan2(-seen[1], seen[0]) + np.arctan2(reference[1], reference[0])
    return HeadingFound(
        float(wrap(heading)), float(std), f"heading from the magnetic field ({words})"
    )


def baseline_heading(
    recording: Recording, source: Source | None, t: float, b_g: Array, level_std: float
) -> HeadingFound | None:
    """The HeadingFound at t by the vector between two antennas of the fix nearest to it, levelled by
    the mean specific force; None without a source, or where the antennas stand above each other.

    b_g: gyro bias, rad/s; level_std: rad, of that level.
    """
    if source is not None:
        source, _ = without_wrong_lengths(source)
    if source is None or not len(source.t):
        return None
    k = int(np.argmin(np.abs(source.t - t)))
    at = float(source.t[k])
    force = mean_force(recording, at, b_g)
    if force is None or not np.isfinite(source.y[k]).all():
        return None
    flat = level_vector(np.array(source.parameters[:3]), *level(force.f))
    length = float(np.hypot(flat[0], flat[1]))
    if not length > 0.5 * np.linalg.norm(flat):
        return None
    rows = slice(*np.searchsorted(recording.imu.t, sorted((at, t)), side="right"))
    turned = np.linalg.norm(
        (recording.imu.dtheta[rows] - b_g * recording.imu.dt[rows, None]).sum(0)
    )
    north, east, _ = source.y[k]
    tilt = abs(flat[2]) / length * np.hypot(level_std, force.off)
    std = np.linalg.norm([source.std[k][:2].max() / length, tilt, turned])
    heading = np.arctan2(east, north) - np.arctan2(flat[1], flat[0])
    return HeadingFound(float(wrap(heading)), float(std), "heading from two antennas")


class MeanForce(NamedTuple):
    """Specific force over a second, and how the body turned in it."""

    f: Array  # (3,) m/s^2, in the body axes of the instant
    off: float  # difference of its magnitude from gravity, as a fraction of gravity
    begin: float  # s
    end: float  # s
    # times within it (m,) -> (m, 3, 3) from the body at those times to the body at the instant
    turns: Callable[[Array], Array]


def mean_force(
    recording: Recording,
    t: float,
    b_g: Array,
    window: tuple[float, float] | None = None,
    peak: float | None = None,
) -> MeanForce | None:
    """Return the MeanForce at t over the `window` (begin and end, s).

    Without a window, it is the mean over half a second before and after t, or over the second after
    or before t where a stretch without a gap begins or ends there. None where samples cover less
    than `MIN_FELT` of a given window, or where there are none. With `peak` (s), a triangle over the
    window weights the samples, as in a second difference.

    Every sample is rotated to the body axes at t with the gyro rate less the bias b_g (rad/s), so
    that rotation does not blur the mean.
    """
    imu = recording.imu
    begin, end = window or _second_around(imu, t)
    rows = slice(*np.searchsorted(imu.t, [begin + 1e-9, end + 1e-9]))
    seconds = imu.dt[rows]
    if not len(seconds) or (window and seconds.sum() < MIN_FELT * (end - begin)):
        return None
    turned = _body_rotations(imu.dtheta[rows] - b_g * seconds[:, None])
    middles, edges = imu.t[rows] - 0.5 * seconds, np.r_[imu.t[rows][0] - seconds[0], imu.t[rows]]
    to_now = turned[2 * int(np.argmin(np.abs(edges - t)))].T

    def turns(times: Array) -> Array:
        return (
            to_now
            @ turned[
                np.clip(np.searchsorted(middles, times, side="right") * 2 - 1, 0, len(turned) - 1)
            ]
        )

    weights = (
        np.ones(len(middles)) if peak is None else np.interp(middles, [begin, peak, end], [0, 1, 0])
    )
    f = np.einsum("n,nij,nj->i", weights, turns(middles), imu.dv[rows]) / (weights @ seconds)
    return MeanForce(
        f,
        float(abs(np.linalg.norm(f) / GRAVITY_EQUATOR - 1)),
        float(edges[0]),
        float(edges[-1]),
        turns,
    )


def _second_around(imu: Imu, t: float) -> tuple[float, float]:
    """Half a second before and after t, s, shifted into the stretch of samples without a gap."""
    rows, _ = nearest_felt(imu, t)
    first, last = imu.t[rows][0] - imu.dt[rows][0], imu.t[rows][-1]
    begin = min(max(t - 0.5, float(first)), float(last) - 1.0)
    return begin, begin + 1.0


def _body_rotations(dtheta: Array) -> Array:
    """(2 n + 1, 3, 3): from the body at the alternating edges and middles of n samples to the body
    at the first edge."""
    return running_matrices(np.vstack([np.zeros(3), np.repeat(0.5 * dtheta, 2, axis=0)]))


def earth_rate_heading(
    recording: Recording,
    imu: ImuSpec,
    t: float,
    place: Sequence[float] | Array | None,
    moves: Callable[[Array], Mask],
) -> HeadingFound | None:
    """Return the HeadingFound from the Earth's rate over the long rest around t; None without such
    a rest or where its standard deviation exceeds `GYROCOMPASS_STD`.

    place: (latitude rad, longitude, height), or None where it is unknown; moves: function of times
    that returns whether fixes show motion then. The standard deviation combines the gyro bias, the
    scatter of the rate, the level error, and the difference of the rate from the Earth's: by
    component at a known place, in magnitude elsewhere.
    """
    b_a_std, b_g_std = imu.bias_std()
    still = motionless(recording.imu, t) if b_g_std < GYROCOMPASS_STD * RATE else None
    if still is None or moves(np.linspace(still.start, still.stop, 20)).any():
        return None
    seen = gyrocompass(still.rate, still.force)
    strange = abs(seen.total - RATE)
    if place is not None:
        strange = np.hypot(
            seen.horizontal - RATE * np.cos(place[0]), seen.vertical - RATE * np.sin(place[0])
        )
    found = gyrocompass(
        still.rate,
        still.force,
        float(np.linalg.norm([b_g_std, still.rate_std, strange])),
        np.hypot(still.tilt_std, b_a_std / GRAVITY_EQUATOR),
    )
    if not found.heading_std < GYROCOMPASS_STD:
        return None
    note = (
        f"heading from the Earth's rate over {still.stop - still.start:.0f} s of rest "
        f"(latitude {np.degrees(found.latitude):.2f} deg by its vertical part)"
    )
    return HeadingFound(float(wrap(found.rph[2])), found.heading_std, note, True)
