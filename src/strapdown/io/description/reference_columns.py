"""The columns that [reference] names, as a Trajectory has them."""

from typing import NamedTuple

import numpy as np

from ...checks import located
from ...preprocessing.attitude_record import quaternions
from ...preprocessing.axes import NAVIGATION_AXES, axes_matrix, turned
from ...preprocessing.origin import Origin
from ...preprocessing.other_forms import attitudes, over_ground, positions, vectors
from ...typing import Array
from .fix_columns import Whereabouts, separation, upright
from .schema import ReferencePart, Vector, vector_factors
from .schema_values import Separation
from .source_files import Files


class Reference(NamedTuple):
    """Rows of a reference as the fields of a Trajectory, where they are from, and notes."""

    t: Array  # (n,) s
    lla: Array  # (n, 3), NaN where there is no position
    v_n: Array | None
    q_nb: Array | None
    origin: Origin
    notes: list[str]


def read_columns(part: ReferencePart, files: Files, whereabouts: Whereabouts) -> Reference:
    """The rows of a [reference] that names its columns; what is told in ECEF is turned at the
    position of its row, or else where `whereabouts` says. Raises DataError."""
    assert part.time is not None  # the schema asks for it
    parts = part.parts
    names = [column for vector in parts.values() for column in vector.columns]
    geoid = part.position.geoid if part.position is not None else None
    if isinstance(geoid, Separation) and geoid.column is not None:
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
        with located(where):
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
    """((n, 3) m/s NED, notes) of the columns of a velocity, SI, at the positions `here`."""
    if part.form is not None:
        v_n, _, notes = over_ground(upright(values, part.form), np.zeros((len(values), 1)), origin)
        return v_n, notes
    if part.ecef:
        return vectors(values, here), []
    return turned(values, axes_matrix(part.axes or "NED", NAVIGATION_AXES, False)), []
