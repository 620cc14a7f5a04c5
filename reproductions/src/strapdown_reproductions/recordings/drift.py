"""Dead reckoning of every filter that estimates a position: how far it goes while position and
velocity fixes are withheld.

drive0708: nine windows of 15 s, one every 50 s, all in one run. thor75: consecutive windows of 30 s
from 240 to 570 s, each a run of its own with all fixes before, so that every second is withheld
once. Magnetometer and barometer need no receiver and stay.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from strapdown import filters
from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.engine.prepare import has_position
from strapdown.evaluation.metrics import outages
from strapdown.typing import Notify

from ..common.example_recordings import FLIGHT, windows_of
from .table import FEWER, FIXES, number, shorten, wrong

Row: TypeAlias = tuple[float, float, float, float, float, str]
"""start, stop, s; largest horizontal error, horizontal at the end, largest vertical, m; what was
said."""
LENGTH = 30.0
"""s of the windows of thor75."""
EACH = (
    "recording",
    "filter",
    "from, s",
    "to, s",
    "largest horizontal, m",
    "horizontal at the end, m",
    "largest vertical, m",
    "said",
)
MEASURES = (
    ("median", 0, np.median),
    ("largest", 0, np.max),
    ("median at the end", 1, np.median),
    ("median of the largest vertical", 2, np.median),
)
"""Column of the table of dead reckoning, which of the three errors of an outage it is of, and
what is taken of it."""
HEADING = "Dead reckoning without position and velocity fixes"


def consecutive(start: float, stop: float, length: float) -> list[tuple[float, float]]:
    """[(start, stop)] of as many windows of `length` s as fit, s."""
    return [
        (start + k * length, start + (k + 1) * length)
        for k in range(int((stop - start) / length + 1e-9))
    ]


def outage_scores(
    flight: Recording,
    drive: Recording,
    names: Sequence[str] | None = None,
    notify: Notify | None = None,
) -> pd.DataFrame:
    """DataFrame of EACH with a row per filter that estimates a position, recording and outage;
    NaN and `said` where a filter did not get there."""
    flights, rows = consecutive(*FLIGHT, LENGTH), []
    for name in names or filters.names():
        if not has_position(filters.find(name)):
            continue
        windows = windows_of(drive)
        rows += [("drive0708", name, *row) for row in together(drive, name, windows, notify)]
        rows += [
            ("thor75", name, *row)
            for window in flights
            for row in together(flight.between(stop=window[1]), name, [window], notify)
        ]
    return pd.DataFrame(rows, columns=EACH)


def together(
    recording: Recording,
    name: str,
    windows: Sequence[tuple[float, float]],
    notify: Notify | None = None,
) -> list[Row]:
    """[(start, stop, largest horizontal, horizontal at the end, largest vertical, said)] of
    windows that are withheld in one run; m and s."""
    try:
        solution = fuse(
            recording.hidden(windows, kinds=FIXES), name, notify=notify, options=FEWER.get(name, {})
        )
    except DataError as error:
        return [(*window, np.nan, np.nan, np.nan, shorten(error, name)) for window in windows]
    return [_outage(solution, recording, window) for window in windows]


def _outage(solution: Solution, recording: Recording, window: tuple[float, float]) -> Row:
    stopped = solution.meta.get("stopped", "")
    if stopped and solution.t[-1] < window[1]:
        return (*window, np.nan, np.nan, np.nan, shorten(stopped))
    score = outages(solution, recording.reference, [window])[0]
    return (*window, score.horizontal_max, score.horizontal_end, score.down_max, "")


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """DataFrame with a row per filter and MEASURES for each recording. An outage on whose way a
    filter stopped counts as infinitely far."""
    found = []
    for name in dict.fromkeys(table["filter"]):
        row, said = {"filter": name}, []
        for recording in dict.fromkeys(table["recording"]):
            own = table[(table["filter"] == name) & (table["recording"] == recording)]
            far = (
                own.iloc[:, 4:7].astype(float).where(~own["said"].str.startswith("stopped"), np.inf)
            )
            row |= {
                f"{recording} {title}, m": float(take(far.iloc[:, column]))
                for title, column, take in MEASURES
            }
            said += [f"{recording}: {text}" for text in wrong(own["said"])]
        found.append(row | {"said": "\n".join(said)})
    return pd.DataFrame(found)


def text_table(summary: pd.DataFrame) -> pd.DataFrame:
    """The DataFrame of `summary` as one of text."""
    return summary.map(lambda value: value if isinstance(value, str) else number(value))
