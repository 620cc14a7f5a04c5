"""Content of calibration data: rests of an accelerometer, directions that were seen, and the choice
between two fits of a magnetometer."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..preprocessing.stationary import at_rest, stretches
from ..typing import Array, Ints
from ..units.wording import count_text
from .ellipsoid import EllipsoidFit, ellipsoid
from .gyro_aided import fit_by_turns

DETAIL = {"accelerometer": ("m/s^2", 1.0, "m/s^2"), "magnetometer": ("T", 1e6, "uT")}
"""SI unit, factor to the unit of tables, and that unit."""
BANDS = 6
SECTORS = 8
"""Cells of the sphere for `coverage`: bands of equal height, so of equal area, in sectors of
azimuth."""
NEAR_AXIS = np.radians(30.0)
"""An axis counts as seen where a direction lies within this angle of it."""
BLOCK_TIME, SAME, BLOCKS_PER_REST = 1.0, np.radians(2.0), 2
"""A rest is BLOCKS_PER_REST blocks of BLOCK_TIME (s) or more whose mean specific force has one
direction within SAME (rad)."""
MIN_CHANGE = 5e-6
"""T: half the range that a sensor must have seen where the strength is unknown; the Earth's
field has 22 to 67 uT."""
HALF_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


class RestPeriods(NamedTuple):
    """Mean specific force of each rest."""

    t: Array  # (n,) s, the middle
    force: Array  # (n, 3) m/s^2
    std: float  # m/s^2, of a mean, from the scatter of the blocks


def rests(imu: Imu) -> RestPeriods:
    """The RestPeriods of an Imu: where it stands still, block by block, split where it was turned."""
    width = max(2, round(BLOCK_TIME / float(np.median(imu.dt))))
    found, scatter = [], []
    for first, last in stretches(at_rest(imu)):
        n = (last - first) // width
        if n < BLOCKS_PER_REST:
            continue
        rows = slice(first, first + n * width)
        force = (
            imu.dv[rows].reshape(n, width, 3).sum(axis=1)
            / imu.dt[rows].reshape(n, width).sum(axis=1)[:, None]
        )
        t = imu.t[rows].reshape(n, width).mean(axis=1)
        for group in _groups(force):
            if len(group) >= BLOCKS_PER_REST:
                found.append((t[group].mean(), *force[group].mean(axis=0)))
                scatter.append(force[group].var(axis=0, ddof=1).mean() / len(group))
    table = np.array(found).reshape(-1, 4)
    return RestPeriods(
        table[:, 0], table[:, 1:], float(np.sqrt(np.mean(scatter))) if scatter else 0.0
    )


def _groups(force: Array) -> list[list[int]]:
    """Row numbers of neighbours whose direction is that of the first."""
    unit = force / np.maximum(np.linalg.norm(force, axis=1), 1e-9)[:, None]
    groups = [[0]]
    for k in range(1, len(force)):
        if unit[k] @ unit[groups[-1][0]] > np.cos(SAME):
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def coverage(vectors: Array) -> tuple[float, Ints, tuple[str, ...]]:
    """(share of the sphere's `BANDS` x `SECTORS` cells of equal area that hold a direction,
    (BANDS, SECTORS) counts, half-axes with none near)."""
    unit = vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-30)[:, None]
    band = np.clip(((unit[:, 2] + 1) / 2 * BANDS).astype(int), 0, BANDS - 1)
    sector = ((np.arctan2(unit[:, 1], unit[:, 0]) / (2 * np.pi) + 0.5) * SECTORS).astype(
        int
    ) % SECTORS
    counts = np.zeros((BANDS, SECTORS), int)
    np.add.at(counts, (band, sector), 1)
    nearest = np.c_[unit.max(axis=0), -unit.min(axis=0)].ravel() if len(unit) else np.full(6, -1.0)
    return (
        float((counts > 0).mean()),
        counts,
        tuple(axis for axis, cosine in zip(HALF_AXES, nearest) if cosine < np.cos(NEAR_AXIS)),
    )


def six_positions(found: RestPeriods, gravity: float) -> EllipsoidFit:
    """The EllipsoidFit of an accelerometer to gravity (m/s^2) in its RestPeriods. Raises DataError with the
    directions that lack."""
    if len(found.t) < 3:
        raise DataError(
            f"accelerometer: {count_text(len(found.t), 'rest')} of "
            f"{BLOCKS_PER_REST * BLOCK_TIME:g} s and longer; a calibration needs at least six, "
            "with each axis once up and once down"
        )
    fit = ellipsoid(found.force, gravity, found.std)
    if fit.missing:
        raise DataError(
            f"accelerometer: too few directions in {len(found.t)} rests: "
            f"{missing_directions(coverage(found.force)[2], 'no rest with')}; "
            "rest with each axis once up and once down"
        )
    return fit


def hard_and_soft_iron(
    t: Array, y: Array, imu: Imu, strength: float | None, dip: float | None = None
) -> tuple[EllipsoidFit, str, Array | None]:
    """(Fit, form, gyro bias or None) of a magnetometer y (n, 3) T at t (n,) s; form is "ellipsoid"
    or "turning".

    Of two forms that determine all their parameters, the one whose calibrated field is the more
    certain is taken; else the one that determines more. strength: T; dip: rad, or None where they
    are not known (a scale of its own is then kept). Raises DataError with the directions that lack.
    """
    known = np.isfinite(y).all(axis=1)
    _refuse_still(y[known], strength)
    size = strength if strength is not None else typical(y[known])
    static, turned = ellipsoid(y, size), fit_by_turns(t, y, imu, size, dip)
    if turned is not None and not turned[0].held and np.linalg.det(turned[0].matrix) < 0:
        raise DataError(
            "magnetometer: its axes are left-handed against those of the gyros: one column has "
            "the wrong sign; correct it in the table, or with scale"
        )
    fits = [(static, "ellipsoid", None)] + (
        [(turned[0], "turning", turned[1])] if turned is not None else []
    )
    fits = [
        each
        for each in fits
        if not each[0].missing and each[0].used.sum() >= 10 and np.linalg.det(each[0].matrix) > 0
    ]
    if not fits:
        raise DataError(
            f"magnetometer: too few directions: "
            f"{missing_directions(coverage(y[known] - static.bias)[2], 'no field along')}; "
            "turn the sensor through all directions, upside down too"
        )
    determined = {"ellipsoid": 9, "turning": 12}
    complete = [each for each in fits if not each[0].held]
    fit, form, gyro = (
        min(complete, key=lambda each: uncertainty(each[0], size))
        if complete
        else max(fits, key=lambda each: determined[each[1]] - len(each[0].held))
    )
    return (fit if strength is not None else _own_scale(fit)), form, gyro


def _refuse_still(y: Array, strength: float | None) -> None:
    """Raises DataError where the samples y (n, 3), T, are too few, or show no turn, so that
    noise would be fitted."""
    if len(y) < 20:
        raise DataError(
            f"magnetometer: {len(y)} samples; a calibration needs at least 20, better some thousand"
        )
    if (np.ptp(y, axis=0) == 0).any():
        axis = "xyz"[int(np.argmin(np.ptp(y, axis=0)))]
        raise DataError(
            f"magnetometer: {axis} is constant: the sensor is stuck or was not turned; nothing can "
            f"be calibrated"
        )
    if strength is None and (change := typical(y)) < MIN_CHANGE:
        raise DataError(
            f"magnetometer: it changes by +-{change * 1e6:.2g} uT in its widest axis, and the "
            f"Earth's field has 22 to 67 uT: "
            "too few directions; turn the sensor through all directions, upside down too"
        )


def typical(y: Array) -> float:
    """Strength to begin with where none is known: half the range of the widest axis."""
    low, high = np.percentile(y, [1, 99], axis=0)
    return float((high - low).max() / 2)


def uncertainty(fit: EllipsoidFit, strength: float) -> float:
    """Standard deviation of the calibrated field, T, of a field of that strength, over all
    directions and axes."""
    variance = np.diag(fit.covariance)
    return float(np.sqrt((variance[:3].sum() + strength**2 * variance[3:].sum() / 3) / 3))


def _own_scale(fit: EllipsoidFit) -> EllipsoidFit:
    """The EllipsoidFit whose matrix keeps volumes, and so the typical strength."""
    factor = np.linalg.det(fit.matrix) ** (-1 / 3)
    resize = np.r_[np.ones(3), np.full(9, factor)]
    return fit._replace(
        matrix=fit.matrix * factor,
        residuals=fit.residuals * factor,
        covariance=fit.covariance * np.outer(resize, resize),
    )


def missing_directions(axes: Sequence[str], words: str) -> str:
    """ "no rest with the z axis up (within 30 deg), ..."; axes are half-axes such as "+z", the
    direction of specific force, or of the field."""
    within = f"(within {np.degrees(NEAR_AXIS):.0f} deg)"
    if "rest" in words:
        axes = [f"the {axis[1]} axis {'up' if axis[0] == '+' else 'down'}" for axis in axes]
    return (
        f"{words} {', '.join(axes)} {within}"
        if axes
        else "every direction is covered, but some are too similar"
    )
