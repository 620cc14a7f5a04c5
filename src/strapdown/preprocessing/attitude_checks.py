"""Compare an attitude record with the IMU beside it: stuck fixes, mistaken units, axes and clocks.

The checks use that an attitude and a gyro on one body rotate by the same angle about the same axes
at the same time.
"""

from collections.abc import Callable

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.solution import Source
from ..data.verdict import Reason
from ..geometry.rotations import Rotation, RotationPath, running_products
from ..typing import Array, Ints, Mask
from ..units.wording import count_text
from .axes import named_permutation, signed_permutations
from .stationary import at_rest, without_bias
from .stuck import STUCK_TIME, stuck_samples

SECOND, MIN_TURN, PAIRS, ENOUGH = 1.0, np.radians(3), 1000, 20
"""Turns are compared over about SECOND (s), where the gyro turned by MIN_TURN (rad) and more; at
most PAIRS of them and at least ENOUGH."""
MAX_SHIFT = 3.0
"""s: largest shift for which clocks are compared."""


def sound_attitude(t: Array, y: Array, imu: Imu, name: str, where: str) -> tuple[Mask, list[str]]:
    """(mask (m,), notes): the fixes that are not stuck, and a note with the number of others; t
    (m,) s, y (m, 3) roll, pitch, heading, rad. Raises DataError where all are stuck, or where rad
    was read as deg.

    Incomplete rows are kept, and between complete rows they do not count as a change.
    """
    level, heading = np.isfinite(t) & np.isfinite(y[:, :2]).all(axis=1), np.isfinite(y[:, 2])
    held = np.zeros(len(t), bool)
    for rows, columns in (
        (np.flatnonzero(level & heading), 3),
        (np.flatnonzero(level & ~heading), 2),
    ):
        # roll and pitch do not change with turns about the vertical
        held[rows] = stuck_samples(
            t[rows], np.c_[y[rows, :columns], _pieces(t[rows])], imu, slice(0, columns)
        )
    sound = level & ~held
    if held.any() and sound.sum() < 2:
        raise DataError(
            f"{where}: no usable fix of kind attitude; it never changes while the gyro turns"
        )
    notes = (
        [
            f"{name}: {count_text(int(held.sum()), 'row')} dropped, stuck at one value while the gyro "
            f"turns, "
            f"the first at {t[np.argmax(held)]:.3f} s: check the sensor"
        ]
        if held.any()
        else []
    )
    rows = np.flatnonzero(sound)
    rows = rows[np.argsort(t[rows], kind="stable")]
    refuse_unit(t[rows], y[rows], imu, where)
    return ~held, notes


def refuse_unit(t: Array, y: Array, imu: Imu, where: str) -> None:
    """Raise DataError where these attitudes, in order, turn by about 1/57 of the gyro's angle."""
    recorded, gyro = turns(t, y, imu)()
    if len(gyro) >= ENOUGH and 0.5 < np.degrees(ratio(recorded, gyro)) < 2:
        raise DataError(
            f"{where} unit: the attitude turns {ratio(recorded, gyro):.3g} times as much as the "
            f"gyro: rad read as deg?"
        )


def _pieces(t: Array) -> Array:
    """(n,) number of the unbroken piece of a record of each time; a value that recurs after a pause
    was not stuck."""
    step = np.diff(t)
    return (
        np.r_[0, np.cumsum(step > max(STUCK_TIME, 3 * np.median(step)))]
        if len(step)
        else np.zeros(len(t))
    )


def ratio(recorded: Array, gyro: Array) -> float:
    """Ratio of the magnitude of the attitude's turns (k, 3) to that of the gyro's (k, 3), rad
    each."""
    size = float(np.median(np.linalg.norm(gyro, axis=1)))
    return float(np.median(np.linalg.norm(recorded, axis=1))) / size if size else np.nan


def turns(t: Array, y: Array, imu: Imu) -> Callable[..., tuple[Array, Array]]:
    """Return a function of a shift of the IMU's time (s) that gives the turns of the attitude and
    of the gyro, (k, 3) rad each, body, with the same k for all shifts.

    They are rotation vectors over about a second; without a heading, only the turns of the
    vertical.
    """
    whole = np.isfinite(y).all(axis=1)
    heading = whole.sum() > 0.5 * len(y)
    use = (
        (whole if heading else np.isfinite(y[:, :2]).all(axis=1))
        & (t > imu.t[0] + _margin(imu))
        & (t < imu.t[-1] - _margin(imu))
    )
    t, y = t[use], y[use]
    step = (
        max(1, round(SECOND / max(float(np.median(np.diff(t))), 1e-3)))
        if len(t) > ENOUGH
        else len(t)
    )
    first = np.arange(len(t) - step)
    first = first[t[first + step] - t[first] < 2.5 * SECOND]
    if not len(first):
        return _no_turns
    attitude, path = Rotation.from_rph(np.nan_to_num(y)), _gyro_path(imu)

    def vertical(turn: Rotation) -> Array:
        return turn.inv().apply([0.0, 0.0, 1.0])

    def gyro(rows: Ints, shift: float) -> Array:
        turn = path(t[rows] - shift).inv() * path(t[rows + step] - shift)
        before = vertical(attitude[rows])
        return turn.as_rotvec() if heading else np.cross(turn.inv().apply(before), before)

    first = first[np.linalg.norm(gyro(first, 0.0), axis=1) > MIN_TURN]
    first = first[:: max(1, -(-len(first) // PAIRS))]
    before, after = attitude[first], attitude[first + step]
    recorded = (
        (before.inv() * after).as_rotvec()
        if heading
        else np.cross(vertical(after), vertical(before))
    )

    def pair_at(shift: float = 0.0) -> tuple[Array, Array]:
        return recorded, gyro(first, shift)

    return pair_at


def _no_turns(shift: float = 0.0) -> tuple[Array, Array]:
    """Return the empty result of `turns` for too few rows."""
    return np.empty((0, 3)), np.empty((0, 3))


def _margin(imu: Imu) -> float:
    """s to leave at both ends of a record for a shift of time."""
    return MAX_SHIFT if np.ptp(imu.t) > 4 * MAX_SHIFT else 0.0


def _gyro_path(imu: Imu) -> RotationPath:
    """Attitude of the body since the first sample from the gyro alone, without its mean at rest."""
    return RotationPath(imu.t, running_products(Rotation.from_rotvec(without_bias(imu))))


def facts_and_reasons(source: Source, imu: Imu) -> tuple[list[str], list[Reason]]:
    """(lines, Reasons) on an attitude compared with an IMU: agreement of their turns, and likely
    mistakes of unit, axes or clock."""
    facts, reasons = _level(source, imu)
    name = source.name or source.kind
    fit = turns(source.t, source.y, imu)
    recorded, gyro = fit()
    if len(gyro) < ENOUGH:
        return facts, reasons
    now, factor = _likeness(recorded, gyro), ratio(recorded, gyro)
    facts = [
        f"turns of {name} against those of the gyro: correlation {now:.3f}, attitude / gyro "
        f"{factor:.3g} ({len(gyro)} intervals)",
        *facts,
    ]
    if not 0.4 < factor < 2.5:
        likely = (
            "rad read as deg"
            if 0.5 < np.degrees(factor) < 2
            else "an incorrect unit or scale, or other columns"
        )
        seen = f"{name} unit: it turns {factor:.3g} times as much as the gyro: {likely}"
        return facts, [Reason("unit", seen, "check its unit and columns", name), *reasons]
    shifts = np.arange(-MAX_SHIFT, MAX_SHIFT + 0.01, 0.05)[1:-1] if _margin(imu) else np.zeros(1)
    others = np.array([_likeness(*fit(shift)) for shift in shifts])
    best = int(np.argmax(others))
    if others[best] > 0.9 and 1 - others[best] < 0.5 * (1 - now) and abs(shifts[best]) > 0.2:
        seen = (
            f"it fits the gyro best with {-shifts[best]:+.2f} s added to its time, or "
            f"{shifts[best]:+.2f} s to that of the IMU"
        )
        reasons.append(Reason("clock", seen, "check `offset`", name))
    elif now < 0.7:
        fits = [
            (_likeness(recorded, gyro @ other.T), np.linalg.det(other), other)
            for other in signed_permutations()
        ]
        likeness, _, other = max(fits, key=lambda each: (round(each[0], 2), each[1]))
        if likeness > 0.9:
            seen = f"{name} axes: it turns like a gyro with the axes {named_permutation(other)!r}"
            remedy = "check axes, order and signs of its columns against those of the IMU"
            reasons.append(Reason("frame", seen, remedy, name))
    return facts, reasons


def _likeness(recorded: Array, gyro: Array) -> float:
    """Correlation of vectors without subtraction of a mean, 1 where they are equal."""
    size = np.sqrt((recorded**2).sum() * (gyro**2).sum())
    return float((recorded * gyro).sum() / size) if size > 0 else 0.0


def _level(source: Source, imu: Imu) -> tuple[list[str], list[Reason]]:
    """(lines, Reasons) from the verticals at rest, of the attitude and of the accelerometer."""
    rest = at_rest(imu)
    row = np.minimum(np.searchsorted(imu.t, source.t), len(imu.t) - 1)
    still = (
        rest[row]
        & (source.t <= imu.t[-1])
        & (source.t > imu.t[0])
        & np.isfinite(source.y[:, :2]).all(axis=1)
    )
    if still.sum() < 5:
        return [], []
    roll, pitch = source.y[still, :2].T
    down = np.c_[-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)]
    force = imu.dv[row[still]]
    cosine = -(down * force).sum(axis=1) / np.linalg.norm(force, axis=1)
    off = float(np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1)))))
    name = source.name or source.kind
    fact = f"at rest the vertical of {name} is {off:.1f} deg from that of the accelerometer"
    if off <= 10:
        return [fact], []
    seen = f"at rest its vertical is {off:.0f} deg from that of the accelerometer"
    remedy = "check axes, order and signs of its columns, and mounting"
    return [fact], [Reason("frame", seen, remedy, name)]
