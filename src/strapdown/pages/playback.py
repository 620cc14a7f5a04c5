"""The bar at the foot of a page that plays what was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from ..core.loop.contract import ATT, POS, VEL
from ..core.mathematics.rotation import quaternion_to_euler
from ..data.solution import Solution
from ..typing import Array
from ..units.time_scales import utc
from .drawing import even_indices, ground
from .figures import euler_std
from .packing import pack_json
from .summary import claimed_std

SHOWN = (
    ("north", "m"),
    ("east", "m"),
    ("height", "m"),
    ("speed", "m/s"),
    ("roll", "deg"),
    ("pitch", "deg"),
    ("heading", "deg"),
)
"""Numbers of the bar, and their units; north and east are from the start."""
RATES = (1, 10, 100)
"""Seconds of the recording per second."""


def playback_bar(solutions: Mapping[str, Solution]) -> str:
    """HTML of the bar and of what it plays, at most 2000 rows of each of {name: Solution}; "" where
    there is nothing to play."""
    played = {name: solution for name, solution in solutions.items() if len(solution.t) > 1}
    if not played:
        return ""
    epoch = next((s.meta["epoch"] for s in played.values() if "epoch" in s.meta), None)
    # ms since 1970
    clock = None if epoch is None else int(utc(epoch, [0.0])[0].astype("M8[ms]").astype(np.int64))
    rows = [_rows(solution) for solution in played.values()]
    first = min(float(solution.t[0]) for solution in played.values())
    last = max(float(solution.t[-1]) for solution in played.values())
    known = [
        (name, unit)
        for name, unit in SHOWN
        if any(np.isfinite(each[name]).any() for each in rows if name in each)
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd data-of={name} data-unit='{unit}'>–</dd></div>"
        for name, unit in known
    )
    rates = "".join(f"<option value={rate}>{rate}×</option>" for rate in RATES)
    names = "".join(f"<option value={i}>{escape(name)}</option>" for i, name in enumerate(played))
    choice = f"<select name=solution aria-label=Solution>{names}</select>"
    return (
        "<div id=playback role=group aria-label=Playback hidden><div>"
        "<button type=button aria-label=Play>▶</button>"
        f"<select name=rate aria-label=Speed>{rates}</select>"
        f"<input type=range aria-label=Time min={first} max={last} value={first} "
        f"step={max((last - first) / 10000, 1e-3):.4g}>"
        "<output>–</output><span class=utc></span>"
        f"{choice if len(played) > 1 else ''}"
        "<button type=button name=all>Whole time</button></div>"
        f"<dl>{cells}</dl></div>"
        "<script type='application/x-deflate' id=playback-data>"
        f"{pack_json({'clock': clock, 'solutions': rows})}</script>"
    )


def _rows(solution: Solution) -> dict[str, Any]:
    """{column: values} at even steps, and {"std " + column: standard deviations that are claimed}."""
    keep = even_indices(len(solution.t))
    std = claimed_std(solution)[keep]
    trajectory = solution.trajectory
    found: dict[str, Array] = {"t": solution.t[keep]}
    if solution.has_position:
        lla = trajectory.lla
        east, north = ground(lla[keep], lla[np.isfinite(lla).all(axis=1)][0]).T
        found |= {"north": north, "east": east, "height": lla[keep, 2]}
        found |= dict(zip(("std north", "std east", "std height"), std[:, POS].T))
    if trajectory.v_n is not None:
        v = trajectory.v_n[keep]
        found["speed"] = np.linalg.norm(v, axis=1)
        along = v / np.maximum(found["speed"], 1e-3)[:, None]
        found["std speed"] = np.linalg.norm(along * std[:, VEL], axis=1)
    if trajectory.q_nb is not None:
        rph = quaternion_to_euler(trajectory.q_nb[keep])
        rph[:, 2] %= 2 * np.pi
        found |= dict(zip(("roll", "pitch", "heading"), np.degrees(rph).T))
        angles = np.degrees(euler_std(rph, std[:, ATT]))
        found |= dict(zip(("std roll", "std pitch", "std heading"), angles.T))
    return {name: np.asarray(values, float) for name, values in found.items()}
