"""Fixes of one source from the columns that its description names, in SI: velocities as speed and
course, positions and velocities in ECEF and heights above the geoid in the form of the library."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ...alignment.location import known
from ...checks import DataError, located
from ...data import Aiding
from ...preprocessing.origin import Origin
from ...preprocessing.other_forms import deviations, over_ground, places, positions, vectors
from ...quantities import dimension, innovation_dimension
from ...sensor_models.geoid import undulation
from ...typing import Array
from ...units import factor, spread_factor
from .schema_aiding import AidingPart
from .schema_values import Separation
from .source_files import Files


class Fixes(NamedTuple):
    """Rows of a source: t (m,) s, y (m, components) and sd in SI and radians, where they are
    from, and notes."""

    t: Array
    y: Array
    sd: Array
    origin: Origin
    notes: list[str]


class Whereabouts(NamedTuple):
    """What says where the vehicle is: fixes of positions, else the place of the recording."""

    aidings: Iterable[Aiding]
    place: Sequence[float] | None  # latitude, longitude, rad, and ellipsoidal height, m

    def at(self, t: Array) -> Array:
        """(m, 3) geodetic positions at the times t (m,), s. Raises DataError."""
        for aiding in self.aidings:
            whole = known(aiding) & np.isfinite(aiding.y[:, :2]).all(axis=1)
            if aiding.kind == "position" and whole.any():
                return places(t, aiding.t[whole], aiding.y[whole])
        if self.place is None:
            raise DataError(
                "nothing says where it is; add a source of positions, or the key place at the top"
            )
        return np.broadcast_to(np.array(self.place), (len(t), 3))


def read_fixes(part: AidingPart, files: Files, whereabouts: Whereabouts, where: str) -> Fixes:
    """The rows of a source that is recorded; an attitude and a magnetic field as their columns
    have them. Raises DataError, which names `where`."""
    # the schema asks every kind that is recorded for these
    assert part.file is not None and part.time is not None and part.columns is not None
    entries = part.deviations
    geoid = part.geoid.column if isinstance(part.geoid, Separation) else None
    wanted: list[str | int | None] = [*(_deviation_column(entry) for entry, _, _ in entries), geoid]
    more: list[str | int] = [name for name in wanted if name is not None]
    table, t, columns, notes = files.columns(
        part.file, part.time, [*part.columns, *more], part.table, part.where
    )
    many, read = len(part.columns), iter(columns[len(part.columns) :])
    y = np.stack([column * size for column, size in zip(columns[:many], part.factors)], axis=1)
    sd = np.stack(
        [
            _deviation(*entry, None if _deviation_column(entry[0]) is None else next(read), len(t))
            for entry in entries
        ],
        axis=1,
    )
    with located(where):
        return _in_ned(part, Fixes(t, y, sd, table.origin, notes), next(read, None), whereabouts)


def _in_ned(
    part: AidingPart, fixes: Fixes, undulations: Array | None, whereabouts: Whereabouts
) -> Fixes:
    """The same with heights above the ellipsoid, latitude and longitude, and velocities north, east,
    down, of those that come otherwise; `undulations` is the column of `geoid`."""
    t, y, sd, origin, notes = fixes
    if part.form is not None:
        y, sd, said = over_ground(upright(y, part.form), sd, origin)
        return fixes._replace(y=y, sd=sd, notes=notes + said)
    if part.ecef and part.kind == "position":
        lla = positions(y, origin)
        return fixes._replace(y=lla, sd=deviations(sd, lla))
    if part.ecef and part.kind == "velocity":
        lla = whereabouts.at(t)
        return fixes._replace(y=vectors(y, lla), sd=deviations(sd, lla))
    if part.geoid is not None:
        lla = whereabouts.at(t) if part.needs_place else y
        above, what = separation(part.geoid, lla, undulations)
        y = y + np.eye(y.shape[1])[-1] * above[:, None]
        return fixes._replace(y=y, notes=[*notes, f"{part.name or part.kind}: {what}"])
    return fixes


def upright(values: Array, form: str) -> Array:
    """(m, 2 or 3) speed, course and, where there is one, the velocity down."""
    return values * [1.0, 1.0, -1.0] if form.endswith("up") else values


def separation(
    geoid: Literal["EGM96"] | Separation, lla: Array, column: Array | None
) -> tuple[Array, str]:
    """(height of the geoid above the ellipsoid (m,) in m, what is said of it) at geodetic positions
    lla (m, 3), as the model, the column (m,) or the number of the key `geoid` says."""
    if geoid == "EGM96":
        found, source = undulation(lla[:, 0], lla[:, 1]), "EGM96"
    elif column is not None:
        found, source = column * geoid.size, f"column {geoid.column!r}"
    else:
        found, source = np.full(len(lla), geoid.value), "the given number"
    some = found[np.isfinite(found)]
    span = f"{some.min():+.2f} to {some.max():+.2f} m" if len(some) else "no number"
    return found, f"its heights are above the geoid; {source} added, {span}"


def _deviation_column(entry: Any) -> str | int | None:
    return entry["column"] if isinstance(entry, dict) else entry if isinstance(entry, str) else None


def _deviation(entry: Any, quantity: str, unit: Any, values: Array | None, many: int) -> Array:
    """Standard deviations (many,) in SI of an entry of `sd`, whose column, where it has one, holds
    `values`: numbers and plain columns are in the unit of the component (latitude and longitude:
    m), and of a covariance the sign is kept."""
    if values is None:
        values = np.ones(many) * entry
    if isinstance(entry, dict):
        size, squared = spread_factor(entry["unit"], innovation_dimension(quantity))
        values = values * entry.get("scale", 1.0)
        return size * (np.sign(values) * np.sqrt(np.abs(values)) if squared else values)
    own = innovation_dimension(quantity) != dimension(quantity)
    return values * (1.0 if own else factor(unit, dimension(quantity)))
