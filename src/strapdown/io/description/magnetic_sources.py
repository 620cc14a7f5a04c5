"""Magnetometers in a description: their calibration and the reference field of the Earth."""

from dataclasses import replace

import numpy as np

from ...checks import DataError
from ...core.loop.contract import Imu
from ...data.solution import Source
from ...sensor_models.geomagnetism import geomagnetic_field
from ...typing import Array
from ...units.conversion import UNITS
from ...units.wording import count_text
from ..calibration_file import read_calibration
from ..magnetic_record import facts_and_reasons, vertical
from .schema_source import SourcePart
from .source_files import Files

MAX_STRENGTH_RATIO, EARTH_FIELD = 5.0, 48e-6
"""Largest ratio of a median strength to the Earth's field, by default EARTH_FIELD (T); a larger one
is a mistaken unit."""


def calibrate_field(part: SourcePart, files: Files, raw: Array) -> Array:
    """Return the field in the axes of the columns, T, from raw samples (m, 3) in T: matrix @ (raw -
    bias) of the calibration file. Raises DataError.

    A sample with a missing component becomes NaN, since its strength and direction are unknown.
    """
    raw = np.where(np.all(np.isfinite(raw), axis=1)[:, None], raw, np.nan)
    if part.calibration is None:
        return raw
    path = files.locate(part.calibration)
    found = read_calibration(path)
    if "magnetometer" not in found:
        raise DataError(f"{path}: has no section [magnetometer]; `strapdown calibrate` writes one")
    bias, matrix = found["magnetometer"]
    return (raw - bias) @ np.asarray(matrix).T


def with_field(
    part: SourcePart, source: Source, imu: Imu, date: str | None, place: Array | None
) -> tuple[Source, list[str]]:
    """(Source whose parameters are the Earth's field north, east, down in T, notes on the field and
    on contradictions to it).

    part: its SourcePart; date: ISO text or None; place: latitude, longitude (rad), height (m) or
    None. Raises DataError.
    """
    field, notes = _field(part, source, imu, date, place)
    known = part.field != "record"
    _refuse_strength(part, source, float(np.linalg.norm(field)) if known else EARTH_FIELD)
    source = replace(source, parameters=tuple(map(float, field)))
    _, wrong = facts_and_reasons(
        source, imu, part.vector_matrix, known, part.calibration is not None
    )
    return source, notes + [each.line for each in wrong]


def _refuse_strength(part: SourcePart, source: Source, total: float) -> None:
    """Raises DataError where the median strength is beyond a factor MAX_STRENGTH_RATIO of `total`
    (T), which a mistaken unit makes of it, not hard iron."""
    if len(source.t) < 10:
        return
    median, change = (
        float(np.nanmedian(np.linalg.norm(source.y, axis=1))),
        float(np.nanmax(np.ptp(source.y, axis=0)) / 2),
    )
    # a turn changes the field by its strength, whatever the hard iron
    if 1 / MAX_STRENGTH_RATIO <= median / total <= MAX_STRENGTH_RATIO or 0.5 < change / total < 2:
        return
    known = UNITS["magnetic field"]
    likely = [
        unit for unit in known if 0.4 < median / total * known[unit] / known[part.units[0]] < 2.5
    ]
    raise DataError(
        f"unit: its median strength is {median * 1e6:.3g} uT, but that of the Earth's field "
        f"{total * 1e6:.3g} uT: "
        + (
            f"is the unit {' or '.join(likely)}, not {part.units[0]}?"
            if likely
            else "check unit, scale, columns and calibration"
        )
    )


def _field(
    part: SourcePart, source: Source, imu: Imu, date: str | None, place: Array | None
) -> tuple[tuple[float, ...], list[str]]:
    if part.field == "record":
        return _field_of_the_record(part, source, imu)
    if part.field is not None:
        return part.field, []
    if date is None or place is None:
        what, key = (
            ("date", 'date = "2012-10-10"')
            if date is None
            else ("place", 'place = { latitude = 44.7, longitude = -93.1, unit = "deg" }')
        )
        raise DataError(
            f"field: is missing, and the geomagnetic model needs the {what}: add {key} at the "
            f"top, or give field"
        )
    try:
        latitude, longitude, height = map(float, place)
        found = geomagnetic_field(date, latitude, longitude, height)
    except DataError as error:
        raise DataError(f"field: {error}") from None
    latitude, longitude = np.degrees(place[:2])
    notes = [
        f"{source.name}: the Earth's field is that of {found.model} on {date} at {latitude:.3f}, "
        f"{longitude:.3f} deg: "
        f"declination {np.degrees(found.declination):.2f} deg, dip "
        f"{np.degrees(found.inclination):.2f} deg, {found.total * 1e6:.2f} uT"
    ]
    return found.field, notes + ([f"{source.name}: {found.note}"] if found.note else [])


def _field_of_the_record(
    part: SourcePart, source: Source, imu: Imu
) -> tuple[tuple[float, ...], list[str]]:
    """Return the median strengths along and across the vertical over quiet times, with the given
    declination or 0."""
    down, quiet = vertical(source.t, imu)
    if quiet.sum() < 10:
        raise DataError(
            'field: "record" needs times without acceleration, but there are none; give north, east '
            "and down, "
            "or leave it out for the geomagnetic model"
        )
    y, down = source.y[quiet], down[quiet]
    along = np.einsum("ij,ij->i", y, down)
    vertically, horizontally = (
        np.median(along),
        np.median(np.linalg.norm(y - along[:, None] * down, axis=1)),
    )
    angle = part.declination.angle if part.declination is not None else 0.0
    heading = (
        f"declination {np.degrees(angle):.2f} deg as given"
        if part.declination is not None
        else "declination 0, so headings are from magnetic north; give declination for true north"
    )
    note = (
        f"{source.name}: the field is that of the record, medians over "
        f"{count_text(int(quiet.sum()), 'quiet sample')}: "
        f"{horizontally * 1e6:.2f} uT horizontal, {vertically * 1e6:.2f} uT down; {heading}"
    )
    return (horizontally * np.cos(angle), horizontally * np.sin(angle), vertically), [note]
