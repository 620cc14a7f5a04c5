"""Magnetic fields that a filter cannot use are left out, and the log says so.

A field that is not the Earth's, beside iron or a current, turns the heading by as much as it is off in
strength or dip (core/mathematics/disturbed_field.py).

A magnetometer whose hard iron is a state waits until other sources know the heading. Iron and heading
together are seen by one field, and what separates them is a turn. While the heading is corrected by
many degrees, the directions at which H is taken turn as well, and a linear filter mistakes that for
a turn of the body.
"""

import math
from typing import Any

import numpy as np

from ....typing import Array
from ...compile.jit import helper, kernel
from ...mathematics.belief import FilterState
from ...mathematics.disturbed_field import iron_variance, is_disturbed
from ...mathematics.source import Kind, SourceRow
from ..cursor import Cursor
from ..kernels import STAGE, Kernels
from ..log import Code, notify
from ..tables import Fixes

KNOWN_HEADING = 0.05
"""rad: with 0.26 rad, the standard deviation of a course, errors of simulated flights were ten times the
claimed ones, with 0.05 and 0.03 rad they were as large."""
FAR_LESS = 3.0
"""Standard deviations of the field across that an uncertain heading leaves."""


@kernel(STAGE)
def exclude_disturbed_field(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, record: Array
) -> int:
    """Keep a disturbed field from the filter."""
    s, y, work = fixes.source[k], fixes.y[k], cursor.work[0]
    source = fixes.sources[s]
    if source.kind != Kind.MAGNETIC_FIELD or not work.believable:
        return 0
    if waits_for_heading(belief, source):
        _exclude(Code.IRON_WAITS, s, fixes.t[k], math.sqrt(belief.P[8, 8]), cursor)
    elif is_disturbed(belief, y, work.stds, source):
        size = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
        _exclude(Code.DISTURBED, s, fixes.t[k], size, cursor)
    return 0


@helper
def waits_for_heading(belief: FilterState, source: SourceRow) -> bool:
    """True while the heading is not known to KNOWN_HEADING, and the hard iron far less well than the
    field that so uncertain a heading leaves."""
    heading, m = belief.P[8, 8], source.parameters
    across = (m[0] * m[0] + m[1] * m[1]) * heading
    iron = iron_variance(belief, source)
    return heading > KNOWN_HEADING * KNOWN_HEADING and iron > FAR_LESS * FAR_LESS * across


@helper
def _exclude(code: int, s: int, t: float, value: float, cursor: Cursor) -> None:
    work = cursor.work[0]
    work.believable = 0
    for i in range(12):
        work.innovation[i] = math.nan
    notify(cursor, code, s, t, value)


def is_needed(sources: Any, cursor: Cursor) -> bool:
    """True where a run needs this stage: it has a magnetometer, and a filter with a position, whose
    attitude does not rest on that magnetometer alone."""
    return cursor.state[0].positioned > 0 and bool(np.any(sources["kind"] == Kind.MAGNETIC_FIELD))
