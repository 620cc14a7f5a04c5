"""Fixes of one source, or the rows of a reference, in SI from the columns that a description names.
Speed and course, ECEF positions and velocities, and heights above the geoid are converted to the
library's form."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ...alignment.location import has_location
from ...checks import DataError, locate_errors
from ...data.solution import Source
from ...preprocessing.attitude_record import quaternions
from ...preprocessing.axes import NAVIGATION_AXES, axes_matrix, permute_axes
from ...preprocessing.origin import Origin
from ...preprocessing.other_forms import (
    attitudes,
    deviations,
    over_ground,
    places,
    positions,
    vectors,
)
from ...preprocessing.receiver_classes import join_classes
from ...sensor_models.geoid import undulation
from ...typing import Array, Mask
from ...units.conversion import factor, spread_factor
from ...units.quantities import dimension, innovation_dimension
from .schema import ReferencePart, Vector, vector_factors
from .schema_base import SeparationKeys
from .schema_source import SourcePart
from .source_files import Files


class FixColumns(NamedTuple):
    """Rows of a source: t (m,) s, y (m, components) and std in SI and radians, their origin, and
    notes."""

    t: Array
    y: Array
    std: Array
    origin: Origin
    notes: list[str]

    def keep_rows(self, keep: Mask, notes: list[str]) -> "FixColumns":
        """Only the rows of a mask (m,), with further notes."""
        origin = self.origin.keep_rows(keep, len(self.t))
        return FixColumns(self.t[keep], self.y[keep], self.std[keep], origin, [*self.notes, *notes])


class Whereabouts(NamedTuple):
    """The vehicle's position: from position fixes, else the place of the recording."""

    sources: Iterable[Source]
    place: Sequence[float] | None  # latitude, longitude, rad, and ellipsoidal height, m

    def at(self, t: Array) -> Array:
        """(m, 3) geodetic positions at the times t (m,), s. Raises DataError."""
        for source in join_classes(self.sources):
            whole = has_location(source) & np.isfinite(source.y[:, :2]).all(axis=1)
            if source.kind == "position" and whole.any():
                return places(t, source.t[whole], source.y[whole])
        if self.place is None:
            raise DataError(
                "its position is unknown; add a source of positions, or the key place at the top"
            )
        return np.broadcast_to(np.array(self.place), (len(t), 3))


def read_fixes(part: SourcePart, files: Files, whereabouts: Whereabouts, where: str) -> FixColumns:
    """Return the rows of a recorded source; an attitude and a magnetic field stay in the axes of
    the columns. Raises DataError, which names `where`."""
    # the schema requires these of every recorded kind
    assert part.file is not None and part.time is not None and part.columns is not None
    entries = part.deviations
    geoid = part.geoid.column if isinstance(part.geoid, SeparationKeys) else None
    wanted: list[str | int | None] = [*(_deviation_column(entry) for entry, _, _ in entries), geoid]
    more: list[str | int] = [name for name in wanted if name is not None]
    table, t, columns, notes = files.columns(
        part.file, part.time, [*part.columns, *more], part.table, part.where
    )
    # the rows that one class of a receiver lacks are in the others
    notes = [] if part.receiver else notes
    many, read = len(part.columns), iter(columns[len(part.columns) :])
    y = np.stack([column * size for column, size in zip(columns[:many], part.factors)], axis=1)
    std = np.stack(
        [
            _deviation(*entry, None if _deviation_column(entry[0]) is None else next(read), len(t))
            for entry in entries
        ],
        axis=1,
    )
    with locate_errors(where):
        return _in_ned(
            part, FixColumns(t, y, std, table.origin, notes), next(read, None), whereabouts
        )


def _in_ned(
    part: SourcePart, fixes: FixColumns, undulations: Array | None, whereabouts: Whereabouts
) -> FixColumns:
    """Return the rows with heights above the ellipsoid, latitude and longitude, and velocities
    north, east, down, converted where necessary; `undulations` is the column of `geoid`."""
    t, y, std, origin, notes = fixes
    if part.form is not None:
        y, std, said = over_ground(upright(y, part.form), std, origin)
        return fixes._replace(y=y, std=std, notes=notes + said)
    if part.ecef and part.kind == "position":
        lla = positions(y, origin)
        return fixes._replace(y=lla, std=deviations(std, lla))
    if part.ecef and part.kind in ("velocity", "baseline"):
        lla = whereabouts.at(t)
        return fixes._replace(y=vectors(y, lla), std=deviations(std, lla))
    if part.geoid is not None:
        lla = whereabouts.at(t) if part.needs_place else y
        above, what = separation(part.geoid, lla, undulations)
        y = y + np.eye(y.shape[1])[-1] * above[:, None]
        return fixes._replace(y=y, notes=[*notes, f"{part.name or part.kind}: {what}"])
    return fixes


def upright(values: Array, form: str) -> Array:
    """(m, 2 or 3) speed, course and, if there is one, the velocity down."""
    return values * [1.0, 1.0, -1.0] if form.endswith("up") else values


def separation(
    geoid: Literal["EGM96"] | SeparationKeys, lla: Array, column: Array | None
) -> tuple[Array, str]:
    """(height of the geoid above the ellipsoid (m,) in m, note on it) at geodetic positions lla (m,
    3), from the model, the column (m,) or the number of the key `geoid`."""
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
    """Return standard deviations (many,) in SI from an entry of `std`; `values` are those of its
    column, if it has one. Numbers and plain columns are in the unit of the component (latitude and
    longitude: m). A covariance keeps its sign."""
    if values is None:
        values = np.ones(many) * entry
    if isinstance(entry, dict):
        size, squared = spread_factor(entry["unit"], innovation_dimension(quantity))
        values = values * entry.get("scale", 1.0)
        return size * (np.sign(values) * np.sqrt(np.abs(values)) if squared else values)
    own = innovation_dimension(quantity) != dimension(quantity)
    return values * (1.0 if own else factor(unit, dimension(quantity)))


# ---- references


class Reference(NamedTuple):
    """Rows of a reference as the fields of a Trajectory, their origin, and notes."""

    t: Array  # (n,) s
    lla: Array  # (n, 3), NaN where there is no position
    v_n: Array | None
    q_nb: Array | None
    origin: Origin
    notes: list[str]


def read_columns(part: ReferencePart, files: Files, whereabouts: Whereabouts) -> Reference:
    """Return the rows of a [reference] that names its columns. ECEF vectors are rotated at the
    position of their row, or else at that of `whereabouts`. Raises DataError."""
    assert part.time is not None  # the schema requires it
    parts = part.parts
    names = [column for vector in parts.values() for column in vector.columns]
    geoid = part.position.geoid if part.position is not None else None
    if isinstance(geoid, SeparationKeys) and geoid.column is not None:
        names.append(geoid.column)
    table, t, columns, notes = files.columns(part.file, part.time, names, part.table, part.where)
    read, where = iter(columns), f"{files.path}: [reference]"
    values = {
        key: np.stack(
            [next(read) * unit for unit in vector_factors(vector, vector.quantities(key))], axis=1
        )
        for key, vector in parts.items()
    }
    lla = np.full((len(t), 3), np.nan)
    if part.position is not None:
        lla = values["position"]
        lla = positions(lla, table.origin) if part.position.ecef else lla
    if geoid is not None:
        above, said = separation(geoid, lla, next(read, None))
        lla, notes = lla + [0, 0, 1] * above[:, None], [*notes, f"reference: {said}"]
    here = lla
    if part.position is None and any(vector.ecef for vector in parts.values()):
        with locate_errors(where):
            here = whereabouts.at(t)
    v_n = q_nb = None
    if part.velocity is not None:
        v_n, more = _velocity(part.velocity, values["velocity"], here, table.origin)
        notes = notes + more
    if part.attitude is not None:
        attitude = part.attitude
        q_nb = quaternions(values["attitude"], attitude.quaternion, attitude.axes, table.origin)
        q_nb = attitudes(q_nb, here) if attitude.ecef else q_nb
    return Reference(t, lla, v_n, q_nb, table.origin, notes)


def _velocity(part: Vector, values: Array, here: Array, origin: Origin) -> tuple[Array, list[str]]:
    """((n, 3) m/s NED, notes) from the columns of a velocity, SI, at the positions `here`."""
    if part.form is not None:
        v_n, _, notes = over_ground(upright(values, part.form), np.zeros((len(values), 1)), origin)
        return v_n, notes
    if part.ecef:
        return vectors(values, here), []
    return permute_axes(values, axes_matrix(part.axes or "NED", NAVIGATION_AXES, False)), []
