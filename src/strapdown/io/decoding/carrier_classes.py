"""Positions of a receiver by its carrier solution: a section for each class that a log has."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reader import Section

FLOAT = "float"
FLOAT_ERRORS = {"std": [0.2, 0.2, 0.4], "time": 300}
"""Time-correlated errors of float solutions, m and s: twice the standard deviations of the receiver
`rtk-float` (sensor_models/receivers, with its sources), which hold for an open sky; beside trees and
houses, those of a recorded walk lie 0.19 m off at rest."""
WHY = "float ambiguities err by decimetres that last, and receivers state less; tune learns yours"
FEWEST_CHECKED = 6
"""Satellites with which a receiver can find a wrong one and go on without it; with five it finds that one is
wrong (Parkinson & Axelrad 1988, Navigation 35(2))."""
Classes = Mapping[str, Sequence[int]]
"""{class: values of the column}."""


def by_class(
    section: Section, cells: NDArray[Any], column: str, classes: Classes, satellites: str = ""
) -> list[Section]:
    """A section of positions as one for each class that the log has; as it is where it has one.

    Parameters
    ----------
    section : Section
        Of all positions.
    cells : (n,) array
        The column that says the class of each row.
    column : str
        Its name.
    classes : dict
        {name of the class: values of the column}; other rows are in none.
    satellites : str
        The column that has the number of satellites, if there is one.

    Returns
    -------
    list of Section
        With the keys `where`, `receiver` and `name`, and the correlated errors of float solutions; a
        remark says how to part the fixes with few satellites.
    """
    many = {name: int(np.isin(cells, values).sum()) for name, values in classes.items()}
    there = [name for name in classes if many[name]]
    if len(there) < 2:
        alone = _with_errors(section, there[0]) if there else section
        return [_with_remark(alone, satellites)]
    receiver = "GNSS" if not section.instance else f"GNSS {section.instance}"
    parted = [
        _with_errors(
            section._replace(
                keys={
                    **section.keys,
                    "where": [{"column": column, "equals": list(classes[name])}],
                    "receiver": receiver,
                    "name": f"{receiver} position {name}",
                },
                title=f"{section.title}, {many[name]} {name}",
            ),
            name,
        )
        for name in there
    ]
    return [_with_remark(each, satellites) for each in parted]


def _with_remark(section: Section, satellites: str) -> Section:
    """A section with the line that parts its fixes by their number of satellites."""
    if not satellites:
        return section
    own = [
        f'{{ column = "{each["column"]}", equals = {each["equals"]} }}'
        for each in section.keys.get("where", [])
    ]
    few = f'{{ column = "{satellites}", least = {FEWEST_CHECKED} }}'
    line = f"# where = [{', '.join([*own, few])}]    # those with fewer satellites: a [[source]] of their own"
    return section._replace(remarks=(*section.remarks, line))


def _with_errors(section: Section, name: str) -> Section:
    """The section of a class with the errors that its receiver does not state."""
    if name != FLOAT:
        return section
    return section._replace(
        keys={**section.keys, "correlated": FLOAT_ERRORS},
        assumed={**section.assumed, "correlated": WHY},
    )
