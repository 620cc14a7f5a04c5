"""Heights of two sources against each other: a constant difference is that of two zeros, such as
the geoid (mean sea level) and the ellipsoid."""

import re
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from ..preprocessing.lever_arm import lever_arm_of
from ..typing import Array
from .finding import Checked, label
from .motion import InspectedRecording

KINDS = {"position": 2, "altitude": 0}
"""Kinds that tell a height above the ellipsoid, and which component it is. Pressures are none: their
zero is estimated."""
MIN_FIXES, SEVERAL = 10, 4.0
"""Fixes that are needed, and standard deviations of both from which a difference counts."""
MIN_DIFFERENCE, GEOID = 5.0, 110.0
"""A difference counts from MIN_DIFFERENCE metres on; the geoid is up to GEOID off the ellipsoid."""
"""Key of the meta of a recording: {column of heights above the ellipsoid: source that takes it}."""
SEA_LEVEL = re.compile("msl|orthometric|geoid|sea_?level", re.IGNORECASE)
"""Part of the name of a column of heights above mean sea level."""


def check(subject: InspectedRecording) -> Checked:
    """Each pair of sources that tell a height above the ellipsoid, and the name of its column."""
    found = Checked.empty()
    for column, name in subject.recording.meta.get("height_columns", {}).items():
        found.reasons.extend(above_sea_level(name, column))
    sources = [(a, *_heights(a)) for a in subject.sources(*KINDS)]
    sources = [each for each in sources if len(each[1]) >= MIN_FIXES]
    if len(sources) == 1:
        found.add(
            Checked.with_unknown(
                f"zero of the height of {label(sources[0][0])}",
                "no other source shows whether it is above the ellipsoid or the geoid",
            )
        )
    for (one, t, h, std), (other, t_other, h_other, std_other) in combinations(sources, 2):
        inside = (t >= t_other[0]) & (t <= t_other[-1])
        if inside.sum() < MIN_FIXES:
            continue
        off = h[inside] - np.interp(t[inside], t_other, h_other)
        claimed = float(np.hypot(np.median(std), np.median(std_other)))
        found.add(_compare_pair(label(one), label(other), off, claimed))
    return found


def above_sea_level(name: str, column: str) -> Iterator[Reason]:
    """A Reason where the column of an ellipsoidal height is named as one above mean sea level."""
    if SEA_LEVEL.search(column):
        yield Reason(
            "height",
            f"its column {column!r} looks like a height above mean sea level; strapdown expects "
            "heights above the WGS-84 ellipsoid, up to 110 m different",
            'set geoid = "EGM96", or name the column of the undulation with geoid = { column, '
            "unit }; or use the ellipsoidal height",
            name,
        )


def _heights(source: Source) -> tuple[Array, Array, Array]:
    """t (m,) s, heights of the IMU (m,) m, as if it lay level, std (m,) m."""
    column, down = KINDS[source.kind], lever_arm_of(source)[2]
    t, h, std = source.t, source.y[:, column] + down, source.std[:, column]
    use = np.isfinite(t) & np.isfinite(h)
    return t[use], h[use], std[use]


def _compare_pair(one: str, other: str, off: Array, claimed: float) -> Checked:
    """Return the findings on differences (m,) in m of two heights; `claimed` is their std."""
    what = f"height of {one} minus that of {other}"
    middle = float(np.median(off))
    scatter = 1.48 * float(np.median(np.abs(off - middle)))
    fact = f"{what}: median {middle:+.1f} m, scatter {scatter:.1f} m"
    least = max(MIN_DIFFERENCE, SEVERAL * claimed, 2 * scatter)
    if abs(middle) <= least:
        return Checked([fact], [], [])
    likely = (
        "one is above the geoid (mean sea level), the other above the ellipsoid"
        if abs(middle) <= GEOID
        else "more than geoid and ellipsoid can differ: a wrong unit, scale or zero"
    )
    reason = Reason(
        "height",
        f"{what} is {middle:+.1f} m (scatter {scatter:.1f} m, claimed {claimed:.1f}): {likely}",
        "give both above the WGS-84 ellipsoid: for heights above mean sea level set geoid = "
        '"EGM96" in recording.toml, or name the column of the undulation',
        other if "height" not in one else one,
        abs(middle) / least,
    )
    return Checked([], [reason], [])
