"""Clean, sort and check the fixes of a source and the rows of a reference: possible values, and
overlap with the IMU record."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..aiding import find
from ..aiding.more_parameters import check_more_parameters
from ..checks import DataError
from ..core.loop.contract import Imu, MeasurementModel
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..data.solution import Source, Trajectory
from ..data.vehicle import GivenVehicle
from ..data.verdict import Reason
from ..typing import Array, ArrayLike
from ..units.quantities import REGISTRY as QUANTITIES, dimension, si
from ..units.time_scales import DAY, GPS_ZERO, WEEK, iso, span, utc
from ..units.wording import count_text
from .attitude_checks import refuse_unit
from .attitude_record import possible_attitude, together
from .baseline_length import check_baseline
from .imu_samples import imu_from_arrays, sort_rows
from .origin import Origin, RowsOfFile

PRESSURES = (5e3, 200e3)
"""Lowest and highest air pressure for a vehicle, Pa: 20 km above the sea, where the library's
standard atmosphere ends, and a pressurised or submerged sensor."""
MIN_SHARE, LONG_RECORD = 0.2, 10.0
"""A source and an IMU record, both longer than LONG_RECORD (s), probably have different clocks if
they overlap by less than MIN_SHARE of either."""
PRESSURE_SLIPS = {
    1e-5: "bar read as Pa",
    1e-3: "kPa read as Pa",
    1e-2: "hPa or mbar read as Pa",
    1e-1: "kPa read as hPa or mbar",
    10.0: "hPa or mbar read as kPa",
    100.0: "Pa read as hPa or mbar",
    1e3: "Pa read as kPa",
    1e5: "Pa read as bar",
}
"""Factors of mistaken units in the pressure near the ground, and their messages."""
DRAG, MAX_DRAG = "drag", 5.0
"""Meaning of parameters, and 1/s: multicopters have 0.1 to 0.6."""


def clean_recording(
    t: ArrayLike,
    gyro: ArrayLike,
    accel: ArrayLike,
    sources: Iterable[Source],
    kind: str,
    vehicle: GivenVehicle | None,
) -> tuple[Imu, tuple[Source, ...], list[str]]:
    """(Imu, sources, notes), cleaned and checked, of a recording from the arrays of
    `Recording.from_arrays`. Raises DataError."""
    imu, notes = imu_from_arrays(t, gyro, accel, kind, vehicle)
    checked, more = checked_sources(imu, sources)
    return imu, checked, [*notes, *more]


def _check_parameters(source: Source) -> None:
    """Raise DataError where the parameters of a source are no field of the Earth or no drag."""
    meaning, given = find(source.kind).parameters, tuple(source.parameters)
    if meaning == "field" and not 1e-6 <= np.linalg.norm(given) <= 100e-6:
        raise DataError(
            f"{source.name or source.kind}: parameters are {given}, but the Earth's field north, "
            f"east, down in T is needed; geomagnetic_field returns it"
        )
    if meaning == DRAG and not (
        len(given) >= 2 and 0 < min(given[:2]) and max(given[:2]) <= MAX_DRAG
    ):
        raise DataError(
            f"{source.name or source.kind}: parameters are {given}, where the drag coefficients forward "
            f"and to the right in 1/s are needed, each above 0 and at most {MAX_DRAG:g}"
        )


def checked_sources(imu: Imu, sources: Iterable[Source]) -> tuple[tuple[Source, ...], list[str]]:
    """(sources, notes): each source cleaned and checked by its kind's MeasurementModel. Raises
    DataError."""
    done: list[Source] = []
    notes: list[str] = []
    for source in sources:
        _check_parameters(source)
        check_baseline(source)
        check_more_parameters(find(source.kind), source.parameters, source.name or source.kind)
        if source.kind == "attitude":
            possible_attitude(np.asarray(source.y, float), Origin(source.name or source.kind))
        source, more = clean(source, find(source.kind))
        if find(source.kind).recorded:
            overlap(imu, source.t, source.name or source.kind)
            more = more + [each.line for each in little_overlap(imu, source)]
        if source.kind == "attitude":
            refuse_unit(source.t, source.y, imu, source.name or source.kind)
        done.append(source)
        notes += more
    return tuple(done), notes


def clean(
    source: Source, sensor: MeasurementModel, origin: Origin | None = None
) -> tuple[Source, list[str]]:
    """(Source, notes): rows without a time or a value are dropped, late rows sorted, repeated rows
    dropped. Raises DataError naming the row.

    A single missing component stays NaN; infinite components become NaN; without roll or pitch,
    both become NaN. A row without a standard deviation is dropped; a zero or negative one is
    refused.
    """
    origin = origin or Origin(source.name or source.kind)
    t, y, std = _arrays(source, sensor, origin)
    y = np.where(np.isfinite(y), y, np.nan)
    y = together(y) if sensor.name == "attitude" else y
    keep = (
        np.isfinite(t) & np.isfinite(y).any(axis=1) & (np.isnan(y) | np.isfinite(std)).all(axis=1)
    )
    rows = RowsOfFile(origin, (t, y, std), []).without(
        ~keep, "row", "without time, value or standard deviation dropped"
    )
    if len(keep) and not keep.any():
        raise DataError(f"{origin.name}: no usable fix of kind {sensor.name}; {rows.notes[-1]}")
    rows = sort_rows(rows)
    t, y, _ = rows.columns
    repeated = (np.diff(t) == 0) & ((y[1:] == y[:-1]) | np.isnan(y[1:])).all(axis=1)
    rows = rows.without(np.r_[False, repeated][: len(t)], "repeated row")
    t, y, std = rows.columns
    # angles are checked as recorded, before any rotation
    if sensor.name != "attitude":
        possible(y, sensor.quantities, rows.origin)
    wrong = np.any(~np.isnan(y) & ~(std > 0), axis=1)
    rows.origin.refuse(
        wrong,
        lambda row: (
            f"standard deviation {np.nanmin(std[row]):g} of kind {sensor.name}; it must be above 0"
        ),
    )
    if sensor.name == "attitude":
        rows.notes.extend(_without_heading(t, y, source.name or source.kind))
    return replace(source, t=_column(t), y=_column(y), std=_column(std)), rows.notes


def _without_heading(t: Array, y: Array, name: str) -> list[str]:
    """Return notes on an attitude with a heading in some rows only: the number of rows without it,
    and the longest time without it."""
    known = np.isfinite(y[:, 2])
    if known.all() or not known.any():
        return []
    times = np.unique(np.r_[t[0], t[known], t[-1]])
    k = int(np.argmax(np.diff(times)))
    return [
        f"{name}: {count_text(int((~known).sum()), 'row')} of {len(t)} without heading, "
        f"the longest time without one {times[k + 1] - times[k]:.3g} s from {times[k]:.3f} s"
    ]


def _column(values: Array) -> Array:
    return np.require(values, float, ["C", "W"])


def _arrays(source: Source, sensor: MeasurementModel, origin: Origin) -> tuple[Array, Array, Array]:
    t, y, std = (np.asarray(values, float) for values in (source.t, source.y, source.std))
    y = y[:, None] if y.ndim == 1 and len(sensor.quantities) == 1 else y
    shape = (len(t), len(sensor.quantities))
    try:
        std = np.broadcast_to(
            std[:, None] if std.ndim == 1 and shape[1] == 1 and len(std) == len(t) else std, shape
        )
    except ValueError:
        pass
    if t.ndim != 1 or y.shape != shape or std.shape != shape:
        raise DataError(
            f"{origin.name}: kind {sensor.name} needs y and std of shape {shape} for t of shape "
            f"{t.shape}; "
            f"y has {y.shape}, std {std.shape}"
        )
    return t, y, std


def possible(y: Array, quantities: Sequence[str], origin: Origin) -> None:
    """Raise DataError naming the first row of y (m, k), SI and radians, with a latitude that is
    impossible or beyond the library's limit, or a magnitude that is impossible for a vehicle."""
    for quantity, column in zip(quantities, y.T):
        size = np.abs(column)
        if quantity == "latitude":
            _latitude(column, size, origin)
        elif quantity == "pressure":
            _pressure(column, origin)
        elif (size > (known := QUANTITIES.find(quantity)).most).any():
            row = int(np.nanargmax(size))
            raise DataError(
                f"{origin.row(row)}: {quantity} is {column[row]:.6g} {si(dimension(quantity))}; "
                f"{known.hint or 'which is impossible; check unit and scale'}"
            )


def _latitude(column: Array, size: Array, origin: Origin) -> None:
    for limit, text in (
        (np.pi / 2 * (1 + 1e-12), "the limit is 90; check columns, unit and scale"),
        (
            LATITUDE_LIMIT,
            f"results hold up to {np.degrees(LATITUDE_LIMIT):.0f} deg latitude; leave such rows out",
        ),
    ):
        origin.refuse(
            size > limit, lambda row: f"latitude is {np.degrees(column[row]):.6g} deg; {text}"
        )


def _pressure(column: Array, origin: Origin) -> None:
    def text(row: int) -> str:
        typical = float(np.nanmedian(column)) / 1e5
        likely = next(
            (f"{slip}?" for ratio, slip in PRESSURE_SLIPS.items() if 0.29 < typical / ratio < 1.15),
            "check columns, unit and scale, or leave such rows out",
        )
        return (
            f"pressure is {column[row]:.6g} Pa, but that of air is {PRESSURES[0]:g} to {PRESSURES[1]:g}: "
            f"{likely}"
        )

    origin.refuse((column < PRESSURES[0]) | (column > PRESSURES[1]), text)


def overlap(imu: Imu, t: Array, name: str, epoch: float | None = None) -> None:
    """Raise DataError where none of the times `t` (s) is within the IMU record. `epoch`, if known,
    is the time of t = 0 in seconds of GPS time since its zero; the message then has dates too."""
    start, stop = float(imu.t[0] - imu.dt[0]), float(imu.t[-1])
    if len(t) and not ((t >= start) & (t <= stop)).any():
        raise DataError(
            f"{name}: nothing falls within the IMU record: IMU {start:.3f} to {stop:.3f} s, here "
            f"{t[0]:.3f} to {t[-1]:.3f} s; "
            + _of_other_days(np.array([start, stop]), t[[0, -1]], epoch)
            + (likely_shift(start, stop, float(t[0]), float(t[-1])) or "")
            + "add `offset` to one `time`, or check the units of time"
        )


def _of_other_days(imu: Array, fixes: Array, epoch: float | None) -> str:
    """Return a text that the IMU and the fixes are from different days, "" where the days are the
    same or unknown. First and last times of both are in s since `epoch`."""
    if epoch is None:
        return ""
    of_imu, here = (utc(iso(epoch), t) for t in (imu, fixes))
    if of_imu[0].astype("M8[D]") == here[0].astype("M8[D]"):
        return ""
    return (
        f"they are from different days, the IMU {span(of_imu)}, here {span(here)}: give files of one "
        f"recording, or if a clock is incorrect: "
    )


def likely_shift(start: float, stop: float, first: float, last: float) -> str | None:
    """Return a text on the shift that moves fixes from `first` to `last` into the record from
    `start` to `stop` (s): a time zone, whole days, or another epoch. None where none of these
    fits."""
    shifts = [(1800.0 * k, f"a time zone, {k / 2:+g} h?") for k in range(-28, 29) if k]
    shifts += [(float(DAY * k), f"whole days, {k:+d}?") for k in range(-7, 8) if k]
    for sign in (1.0, -1.0):
        shifts.append((sign * GPS_ZERO, "the epochs of Unix time and GPS time?"))
        weeks = round((sign * (start - first) - GPS_ZERO) / WEEK)
        shifts.append((sign * (GPS_ZERO + WEEK * weeks), "Unix time against seconds of the week?"))
    least = 0.5 * min(stop - start, last - first)
    common = [(min(stop, last + s) - max(start, first + s), -abs(s), s, what) for s, what in shifts]
    overlap, _, shift, what = max(common)
    if overlap < max(least, 1e-9):
        return None
    return f"{shift:+.0f} s added to its time make it overlap ({what}); "


def little_overlap(imu: Imu, source: Source) -> list[Reason]:
    """Return a Reason where a Source overlaps with little of the IMU record or of its own."""
    if not len(source.t):
        return []
    start, stop = float(imu.t[0] - imu.dt[0]), float(imu.t[-1])
    inside = int(((source.t >= start) & (source.t <= stop)).sum())
    common = min(stop, float(source.t[-1])) - max(start, float(source.t[0]))
    if (
        min(stop - start, float(np.ptp(source.t))) <= LONG_RECORD
        or min(inside / len(source.t), common / (stop - start)) >= MIN_SHARE
    ):
        return []
    seen = (
        f"only {inside} of {len(source.t)} fixes fall within the IMU record, {max(common, 0.0):.1f} "
        f"of its {stop - start:.1f} s"
    )
    remedy = "check unit and offset of time"
    return [Reason("clock", seen, remedy, source.name or source.kind)]


def clean_reference(
    t: Array, lla: Array, v_n: Array | None, q_nb: Array | None, origin: Origin
) -> tuple[Trajectory, list[str]]:
    """(Trajectory, notes) of a reference: rows without time or position, or where it has no
    position at all without a velocity or an attitude, are dropped; in order, each time once.
    Arguments as the fields of a Trajectory. Raises DataError."""
    placed = np.isfinite(lla).all(axis=1)
    needed = "position"
    if not placed.any():
        others = [np.isfinite(each).any(axis=1) for each in (v_n, q_nb) if each is not None]
        placed, needed = np.any([placed, *others], axis=0), "position, velocity or attitude"
    rows = RowsOfFile(origin, (t, np.arange(len(t))), []).without(
        ~(np.isfinite(t) & placed), "row", f"of the reference without time or {needed} dropped"
    )
    keep = np.isfinite(t) & placed
    if keep.sum() < 2:
        raise DataError(
            f"{origin.name}: the reference has {keep.sum()} usable rows; at least 2 are needed"
        )
    rows = sort_rows(rows)
    rows = rows.keep_rows(np.r_[True, np.diff(rows.columns[0]) > 0])
    index = rows.columns[1]
    possible(lla[index], ("latitude", "longitude", "length"), rows.origin)
    v_n, q_nb = (None if each is None else _column(each[index]) for each in (v_n, q_nb))
    return Trajectory(_column(t[index]), _column(lla[index]), v_n, q_nb), rows.notes
