"""Checks of a magnetometer's samples: stuck and saturated samples, and, where the vertical is
known, strength and dip compared with the Earth's field.

The checks use that a working, calibrated magnetometer measures the same strength and the same angle
to the vertical (the dip) in every attitude.
"""

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.calibration_parameters import HARD_IRON
from ..data.solution import Source
from ..data.verdict import Reason
from ..preprocessing.axes import named_permutation, signed_permutations
from ..preprocessing.origin import Origin
from ..preprocessing.stuck import (
    STUCK_TIME,
    STUCK_TURN,
    integrated_gyro as turned_by,
    stuck_samples,
)
from ..typing import Array, ArrayLike, Mask
from ..units.constants import STANDARD_GRAVITY
from ..units.wording import count_text

MIN_LEVELS, PILE, TIMES = 20, 0.01, 5
"""A column is saturated where it has more than MIN_LEVELS values, and its extreme value occurs in
more than PILE of the samples and TIMES as often as the next value. (At the turning point of an
oscillation, the extreme value occurs at most 2.4 times as often as the next.)"""
QUIET_FORCE, QUIET_RATE, QUIET_WINDOW = 0.4, 0.35, 0.5
"""The vertical is known where, over QUIET_WINDOW (s), the specific force is within QUIET_FORCE
(m/s^2) of gravity and the rate below QUIET_RATE (rad/s)."""
VARIATION = 0.2
"""Relative variation of the strength, and relative difference from the Earth's field, above which a
magnetometer needs calibration."""
SCATTER, CLEARER = np.radians(5), 2.0
"""Axes count as doubtful where the dip scatters by more than SCATTER (rad), and with other axes by
less than 1 / CLEARER of that."""
BROKEN_AXIS_TURN = np.radians(30)
"""An axis that never changes while the body turns about the others by more than BROKEN_AXIS_TURN
(rad) is broken; above STUCK_TURN there is a note."""
AS_THE_BODY = np.eye(3)
"""Matrix of a sensor with the axes of the body."""


def sound_samples(
    t: Array, raw: Array, imu: Imu, name: str, origin: Origin, matrix: Array = AS_THE_BODY
) -> tuple[Mask, list[str]]:
    """(mask (m,), notes): the samples that are neither stuck nor saturated, and notes with the
    counts of the others; t (m,) s, raw (m, 3) as in the file.

    name: of the source, origin: Origin of the rows, matrix: from its columns to the body. Raises
    DataError where all are stuck or saturated, or one axis is.
    """
    notes = _constant_axis(t, raw, imu, name, origin, matrix)
    held = stuck_samples(t, raw, imu)
    if held.any():
        notes.append(
            f"{name}: {count_text(int(held.sum()), 'sample')} dropped, stuck at one value for "
            f"{STUCK_TIME:g} s and more while the gyro turns, "
            f"the first at {t[np.argmax(held)]:.3f} s: check the sensor"
        )
    elif len(t) > 10 and (raw == raw[0]).all():
        notes.append(f"{name}: it never changes; check that the sensor works")
    full = _is_saturated(raw[~held])
    mask = ~held
    if full.any():
        mask[np.flatnonzero(~held)[full]] = False
        notes.append(
            f"{name}: {count_text(int(full.sum()), 'sample')} dropped, at the limit of the sensor's "
            f"range (saturated), "
            f"the first at {t[~held][np.argmax(full)]:.3f} s: keep magnets and currents away, or "
            f"use a wider range"
        )
    if len(mask) and not mask.any():
        raise DataError(f"{origin.name}: no usable sample; {notes[-1]}")
    return mask, notes


def _constant_axis(
    t: Array, raw: Array, imu: Imu, name: str, origin: Origin, matrix: Array
) -> list[str]:
    """Return notes on one axis that never changes while the others do and the body turns about
    them. Raises DataError where it turns by BROKEN_AXIS_TURN."""
    known = np.isfinite(t) & np.isfinite(raw).all(axis=1)
    constant = np.ptp(raw[known], axis=0) == 0 if known.sum() > 10 else np.zeros(3, bool)
    if not constant.any() or constant.all():
        return []
    begin, end = np.searchsorted(imu.t, (t[known].min(), t[known].max()))
    turns = np.abs(matrix.T) @ np.ptp(turned_by(imu)[begin : end + 1], axis=0)  # about each column
    k = int(np.argmax(constant))
    # a turn about the axis itself does not change its reading
    turned = float(np.delete(turns, k).max())
    text = f"{'xyz'[k]} is constant while the body turns by {np.degrees(turned):.0f} deg about another axis: the sensor is stuck"
    if turned > BROKEN_AXIS_TURN:
        raise DataError(f"{origin.name}: {name}: {text}; check its column, or leave the source out")
    return [f"{name}: {text}, nothing was dropped: check its column"] if turned > STUCK_TURN else []


def _is_saturated(raw: Array) -> Mask:
    """(m,) bool: a column is at its largest or smallest value, in far more samples than at the next
    value."""
    full = np.zeros(len(raw), bool)
    for column in raw.T:
        values, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        if len(values) <= MIN_LEVELS:
            continue
        for extreme, following in ((0, slice(1, 4)), (-1, slice(-4, -1))):
            if counts[extreme] > max(20, PILE * len(raw), TIMES * counts[following].max()):
                full |= column == values[extreme]
    return full


def vertical(t: Array, imu: Imu) -> tuple[Array, Mask]:
    """(Down as unit vectors in body axes (m, 3), bool (m,) where it is known) at times t, from
    the mean specific force around each."""

    def mean(increments: Array) -> Array:
        total = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])

        def at(times: Array) -> Array:
            return np.stack([np.interp(times, ends, column) for column in total.T], axis=1)

        return (at(t + QUIET_WINDOW / 2) - at(t - QUIET_WINDOW / 2)) / seconds[:, None]

    ends = np.r_[imu.t[0] - imu.dt[0], imu.t]
    covered = np.r_[0.0, np.cumsum(imu.dt)]
    seconds = np.interp(t + QUIET_WINDOW / 2, ends, covered) - np.interp(
        t - QUIET_WINDOW / 2, ends, covered
    )
    whole = seconds > 0.5 * QUIET_WINDOW
    seconds = np.where(whole, seconds, QUIET_WINDOW)
    force, rate = mean(imu.dv), mean(imu.dtheta)
    magnitude = np.linalg.norm(force, axis=1)
    quiet = (
        whole
        & (np.abs(magnitude - STANDARD_GRAVITY) < QUIET_FORCE)
        & (np.linalg.norm(rate, axis=1) < QUIET_RATE)
    )
    return -force / np.maximum(magnitude, 1e-9)[:, None], quiet


def _strength(source: Source, field: ArrayLike | None, is_calibrated: bool) -> list[Reason]:
    """Return a Reason where the strength (T) varies or differs from that of `field` (3,) T; None:
    unknown."""
    if len(source.t) < 10:
        return []
    name = source.name or source.kind
    low, median, high = (
        float(value) for value in np.nanpercentile(np.linalg.norm(source.y, axis=1), [5, 50, 95])
    )
    remedy = (
        "the calibration does not fit this record, or iron or currents are near"
        if is_calibrated
        else "calibrate it (`strapdown calibrate`) and name the result as calibration"
    )
    if not median > 0 or (high - low) / median > VARIATION:
        seen = (
            f"its strength varies from {low * 1e6:.3g} to {high * 1e6:.3g} uT, but that of the Earth's "
            f"field does not"
        )
        return [Reason("calibration", seen, remedy, name)]
    total = float(np.linalg.norm(field)) if field is not None else median
    if abs(median / total - 1) > VARIATION:
        seen = (
            f"its median strength is {median * 1e6:.3g} uT, but that of the Earth's field is "
            f"{total * 1e6:.3g} uT"
        )
        return [Reason("calibration", seen, f"check the unit, or {remedy}", name)]
    return []


def facts_and_reasons(
    source: Source,
    imu: Imu,
    matrix: Array = AS_THE_BODY,
    known: bool = True,
    is_calibrated: bool = True,
) -> tuple[list[str], list[Reason]]:
    """(lines, Reasons) on a magnetometer: its dip over quiet samples, an incorrect strength, axes
    that fit clearly better.

    matrix: from its columns to the body; known: True where the parameters are the Earth's field,
    not that of the record itself. Where its hard iron is a state of the filter, neither strength nor
    dip of the record is the Earth's.
    """
    if HARD_IRON.name in source.estimate:
        return [f"{source.name or source.kind}: hard iron is estimated by the filter"], []
    facts, of_axes = _axes(source, imu, matrix, known)
    of_strength = _strength(source, source.parameters if known else None, is_calibrated)
    return facts, of_strength or of_axes  # without calibration the dip is not reliable


def _axes(source: Source, imu: Imu, matrix: Array, known: bool) -> tuple[list[str], list[Reason]]:
    name = source.name or source.kind
    down, quiet = vertical(source.t, imu)
    rows = np.flatnonzero(quiet & np.isfinite(source.y).all(axis=1))
    if len(rows) < 50:
        return [], []
    rows = rows[:: max(1, len(rows) // 5000)]
    field = source.y[rows] / np.linalg.norm(source.y[rows], axis=1)[:, None]
    reference = np.array(source.parameters[:3])
    earth = np.arcsin(reference[2] / np.linalg.norm(reference)) if known else None
    table = np.einsum("ni,nj->nij", down[rows], field @ matrix)  # in the axes of the columns

    def misfit(signed: Array) -> tuple[float, float]:
        dip = np.arcsin(np.clip(np.einsum("nij,ij->n", table, signed), -1, 1))
        return float(
            np.sqrt(np.mean((dip - (dip.mean() if earth is None else earth)) ** 2))
        ), float(dip.mean())

    now, dip = misfit(matrix)
    compared = (
        "scatter"
        if earth is None
        else f"the Earth's field {np.degrees(earth):.1f} deg, rms difference"
    )
    facts = [
        f"{name}: mean dip {np.degrees(dip):.1f} deg over "
        f"{count_text(len(rows), 'quiet sample')}, "
        f"{compared} {np.degrees(now):.1f} deg"
    ]
    if now < SCATTER:
        return facts, []
    candidates = [
        (misfit(candidate)[0], candidate)
        for candidate in signed_permutations()
        if earth is not None or np.linalg.det(candidate) > 0
    ]
    least = min(found for found, _ in candidates)
    fitting = [
        (-np.linalg.det(candidate), found, k)
        for k, (found, candidate) in enumerate(candidates)
        if found < 1.2 * least + np.radians(0.5)
    ]
    best, other = candidates[min(fitting)[2]]  # right-handed, if there is one
    if best > now / CLEARER:
        return facts, []
    remedy = (
        "check axes"
        if np.linalg.det(other) > 0
        else "they are left-handed, so one column has the opposite sign: correct it in the table"
    )
    seen = (
        f"{name} axes: the dip of the field is off by {np.degrees(now):.0f} deg rms; "
        f"with {named_permutation(other)!r} by {np.degrees(best):.0f}"
    )
    return facts, [Reason("frame", seen, remedy, name)]
