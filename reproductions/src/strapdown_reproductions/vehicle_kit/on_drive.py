"""Benefit of the vehicle kit on the recorded drive, in outages that played no part in choosing its
parameters."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.data.solution import Source

from ..common.example_recordings import windows_of

GNSS = ("position", "velocity")
LENGTH, SEED, DRAWS = 15.0, 20, 4000
WHEEL_STD = 0.1  # m/s
OTHERS = [(60.0, 75.0)] + [(110.0 + 50 * k, 125.0 + 50 * k) for k in range(8)]
"""s: other windows, in which the wrong set-ups of the installation are scored."""
CHOSEN_ON = [
    [(first + 50 * k, first + 50 * k + LENGTH) for k in range(9)] for first in (79.0, 94.0)
]
"""s: windows of two runs on which the numbers of the kit were chosen; no other window touches them."""


def outage_errors(folder: Path) -> pd.DataFrame:
    """Largest horizontal error of each outage, m, by windows and set-up."""
    given, constrained, kit = (
        sd.read(folder / f"drive0708{name}.toml") for name in ("", "-vehicle", "-kit")
    )
    wheeled = replace(kit, sources=(*kit.sources, _wheel(kit)))
    cases: dict[str, tuple[Recording, Sequence[str]]] = {
        "as given": (given, ()),
        "constraints": (constrained, ()),
        "kit": (kit, ("mounting",)),
        "kit, clock and lever arm as states too": (kit, ("clock", "lever-arm", "mounting")),
        "kit, and wheel speed made of the RTK": (wheeled, ("mounting", "scale")),
    }
    sets = {"evidence": [windows_of(given)], "others": [OTHERS], "chosen on": CHOSEN_ON}
    rows = []
    for name, runs in sets.items():
        for windows in runs:
            for case, (recording, estimate) in cases.items():
                solution = sd.fuse(recording.hidden(windows, GNSS), estimate=list(estimate) or None)
                rows += [
                    (name, case, s.start, s.stop, s.horizontal_max)
                    for s in sd.outages(solution, given.reference, windows)
                ]
    columns = ["windows", "set-up", "from, s", "to, s", "largest horizontal, m"]
    return pd.DataFrame(rows, columns=columns)


def _wheel(recording: Recording) -> Source:
    """A wheel speed such as this car could have had, 10 a second: the speed of its RTK velocity with
    noise, at the middle of the axle on the ground."""
    velocity = next(a for a in recording.sources if a.kind == "velocity")
    t = np.arange(velocity.t[0], velocity.t[-1], 0.1)
    speed = np.interp(t, velocity.t, np.linalg.norm(velocity.y, axis=1))
    y = (speed + np.random.default_rng(SEED).normal(0, WHEEL_STD, len(t)))[:, None]
    return Source("speed", t, y, np.full_like(y, WHEEL_STD), (0.0, 0.0, 0.65), name="wheel")


def summary(each: pd.DataFrame) -> pd.DataFrame:
    """Per windows and set-up: median, mean and largest, m, and the median of the paired differences
    from the constraints with its 95 % interval by bootstrap."""
    rng, rows = np.random.default_rng(SEED), []
    for name, group in each.groupby("windows", sort=False):
        wide = group.pivot(index="from, s", columns="set-up", values="largest horizontal, m")
        for case in dict.fromkeys(group["set-up"]):
            errors = wide[case].to_numpy()
            paired = errors - wide["constraints"].to_numpy()
            drawn = paired[rng.integers(0, len(paired), (DRAWS, len(paired)))]
            low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
            rows.append(
                (
                    *(name, case, len(errors), np.median(errors), errors.mean(), errors.max()),
                    *(np.median(paired), low, high),
                )
            )
    columns = ["windows", "set-up", "outages", "median, m", "mean, m", "largest, m"]
    return pd.DataFrame(rows, columns=[*columns, "against constraints, m", "from", "to"])
