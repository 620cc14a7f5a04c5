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
Classes = Mapping[str, Sequence[int]]
"""{class: values of the column}."""


def by_class(section: Section, cells: NDArray[Any], column: str, classes: Classes) -> list[Section]:
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

    Returns
    -------
    list of Section
        With the keys `where`, `receiver` and `name`, and the correlated errors of float solutions.
    """
    many = {name: int(np.isin(cells, values).sum()) for name, values in classes.items()}
    there = [name for name in classes if many[name]]
    if len(there) < 2:
        return [_with_errors(section, there[0]) if there else section]
    receiver = "GNSS" if not section.instance else f"GNSS {section.instance}"
    return [
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


def _with_errors(section: Section, name: str) -> Section:
    """The section of a class with the errors that its receiver does not state."""
    if name != FLOAT:
        return section
    return section._replace(
        keys={**section.keys, "correlated": FLOAT_ERRORS},
        assumed={**section.assumed, "correlated": WHY},
    )
