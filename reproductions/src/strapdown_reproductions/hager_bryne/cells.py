"""Open against closed loop on one cell (flight and IMU) in numbers: what the claims of Hager &
Bryne are decided with.

Everything is compared on the same runs. A ratio is RMSE of the first filter by RMSE of the second,
the geometric mean over runs, with 95 % ends. The paper gives a run up at 500 m or when the filter
is "highly inconsistent", which it does not define; what depends on our definition is computed with
both rules and with the 500 m rule alone (names that end in _500): the filters go on after an abort,
only the score stops.
"""

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from strapdown.core.contract import BA, BG, POS, STATES, VEL
from strapdown.evaluation.consistency import (
    POSITION_LOST,
    SURVIVED,
    Interval,
    paired,
    proportion,
    rmse,
)
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.scoring import ERROR_GROUPS, QUARANTINED, RUN_REASONS
from strapdown.experiments.monte_carlo.summaries import SETTLED_AFTER
from strapdown.typing import Array, Mask

ONSET = 10.0
"""m: a run diverges once its position error exceeds ten times the noise of a fix, whatever its
NEES."""
EARLY = 300.0
"""s: "a few minutes"."""
RESOLVED = 0.01
"""m/s^2: the accelerometer bias counts as resolved while the error of its three axes together
stays below; the start's 0.1 deg of roll and pitch look like 0.017 m/s^2 on each horizontal axis,
so that it takes more than a level start."""
LIMIT = 500.0
"""m, of the paper."""
VECTORS = {
    "velocity": VEL,
    "tilt": slice(6, 8),
    "heading": slice(8, 9),
    "accel_bias": BA,
    "gyro_bias": BG,
}
"""Compared after SETTLED_AFTER and while both filters are within LIMIT; tilt: north and east of the
attitude's rotation vector (roll and pitch together)."""
FIRST, SECOND = "open", "closed"
SAME_TIME = 1e-6
Stored: TypeAlias = NDArray[np.float32]
"""As the chunk files keep rows: 4 bytes a number."""
Numbers: TypeAlias = dict[str, Array]
"""{name: (filter, run, ...)} of Campaign.numbers, or of one of the filters (run, ...)."""


class Rows(NamedTuple):
    """Stored rows of the runs of a cell: error, sd (filter, run, epoch, 15), nees and the two
    masks (filter, run, epoch), t (epoch,) s."""

    t: Array
    error: Stored  # m, m/s, rad, m/s^2 and rad/s, in the order of the error states
    sd: Stored  # the same
    nees: Stored
    bias: Stored  # (run, epoch, 6) true biases, m/s^2 and rad/s
    alive: Mask  # not given up yet by either rule
    distance: Array  # (filter, run, epoch) m, inf where the filter has no estimate
    within: Mask  # not beyond LIMIT yet


Part: TypeAlias = tuple[Numbers, Rows, int]
"""(numbers, Rows, place) of a filter of a cell: what the cell has, and which one of it."""


def numbers_of(campaign: Campaign, cell: str) -> tuple[Numbers, Mask]:
    """(numbers of the runs of a cell that were not quarantined, mask of them (run,))."""
    numbers = campaign.numbers(cell)
    ran = ~(numbers["reason"] == QUARANTINED).any(axis=0)
    return {name: values[:, ran] for name, values in numbers.items()}, ran


def rows_of(campaign: Campaign, cell: str, numbers: Numbers, ran: Mask) -> Rows:
    """Rows of the same runs; some MB, for one cell at a time."""
    parts = campaign.read(cell, ("t", "error", "sd", "nees_rows", "bias"))
    joined = {
        name: np.concatenate([part[name] for part in parts], axis=axis)
        for name, axis in (("error", 1), ("sd", 1), ("nees_rows", 1), ("bias", 0))
    }
    joined = {
        name: values[ran] if name == "bias" else values[:, ran] for name, values in joined.items()
    }
    t, error = parts[0]["t"], joined["error"]
    with np.errstate(over="ignore"):
        distance = np.sqrt(np.square(error[..., POS], dtype=float).sum(axis=-1))
    distance = np.where(np.isfinite(distance), distance, np.inf)
    lost = (numbers["reason"] == POSITION_LOST)[..., None] & (
        t > numbers["lasted"][..., None] + SAME_TIME
    )
    within = ~np.logical_or.accumulate((distance > LIMIT) | lost, axis=-1)
    return Rows(
        t,
        error,
        joined["sd"],
        joined["nees_rows"],
        joined["bias"],
        t <= numbers["lasted"][..., None] + SAME_TIME,
        distance,
        within,
    )


def table(campaign: Campaign) -> pd.DataFrame:
    """pandas DataFrame with a row per cell: `compared` of the campaign's first two filters, with
    flight, grade, minutes."""
    found = []
    for cell in campaign.manifest["cells"]:
        numbers, ran = numbers_of(campaign, cell["name"])
        flight = cell["scenario"]["name"].removesuffix("-offset").removesuffix("-initial")
        found.append(
            {
                "flight": flight.removeprefix("paper1-"),
                "grade": cell["imu"]["name"].removeprefix("paper1-"),
                "minutes": cell["scenario"]["duration_s"] / 60,
                "runs": numbers["reason"].shape[1],
                **compared(numbers, rows_of(campaign, cell["name"], numbers, ran)),
            }
        )
    return pd.DataFrame(found)


def stacked(*parts: Part) -> tuple[Numbers, Rows]:
    """(numbers, Rows) of filters from different campaigns with the same runs: parts are
    (numbers, Rows, place)."""
    numbers = {
        name: np.stack([own[name][place] for own, _, place in parts]) for name in parts[0][0]
    }
    joined = [
        np.stack([getattr(rows, name)[place] for _, rows, place in parts])
        for name in ("error", "sd", "nees", "alive", "distance", "within")
    ]
    error, sd, nees, alive, distance, within = joined
    return numbers, Rows(parts[0][1].t, error, sd, nees, parts[0][1].bias, alive, distance, within)


def compared(numbers: Numbers, rows: Rows, first: int = 0, second: int = 1) -> dict[str, float]:
    """A dict of what two filters of a cell did, at those places in the campaign: ratios of the
    two, and figures of each (open_, closed_)."""
    found = ratio("position", *np.log(numbers["censored"][[first, second]]))
    found |= ratio("position_500", *np.log(censored(rows)[[first, second]]))
    both = rows.within[first] & rows.within[second] & (rows.t >= SETTLED_AFTER)
    for name, states in VECTORS.items():
        squares = mean_squares(rows.error[[first, second]][..., states], both)
        found |= ratio(name, *np.log(squares))
        if name in ("tilt", "heading"):
            found |= {
                f"{who}_{name}_500_deg": float(np.degrees(rmse(own).value))
                for who, own in zip((FIRST, SECOND), squares)
            }
    for name, place in ((FIRST, first), (SECOND, second)):
        own = {key: values[place] for key, values in numbers.items()}
        found |= {
            f"{name}_{key}": value
            for key, value in (*_ends(own, rows.within[place]), *_errors(own), *_times(rows, place))
        }
    return found


def ratio(name: str, a: Array, b: Array) -> dict[str, float]:
    """{name, name_low, name_high, name_count}: ratio of RMSEs from logarithms of mean squares
    (runs,) of two filters."""
    p = paired(a, b)
    return dict(
        zip(
            (name, f"{name}_low", f"{name}_high", f"{name}_count"),
            (*np.exp(np.array([p.difference, p.low, p.high]) / 2), p.count),
        )
    )


def mean_squares(error: Stored, mask: Mask) -> Array:
    """(filter, run) mean squared length of `error` (filter, run, epoch, axis) over the epochs of
    `mask` (run, epoch); NaN where there is none."""
    squares = np.where(mask, np.square(error, dtype=float).sum(axis=-1), 0.0).sum(axis=-1)
    count = mask.sum(axis=-1)
    return squares / np.where(count, count, np.nan)


def censored(rows: Rows) -> Array:
    """(filter, run) m^2: mean squared distance with the 500 m rule alone; every stored epoch
    from there on counts as 500 m."""
    return np.where(rows.within, np.minimum(rows.distance, LIMIT) ** 2, LIMIT**2).mean(axis=-1)


def _ends(own: Numbers, within: Mask) -> Iterator[tuple[str, float]]:
    """How the runs of a filter ended: survival with its interval, by both rules and by one; also
    where a raw INS that left its model counts as lost."""
    left = np.isfinite(own["left_model"])
    for name, alive in (("survived", own["reason"] == SURVIVED), ("survived_500", within[:, -1])):
        yield from _interval(name, proportion(int(alive.sum()), len(alive)))
        yield from _interval(f"{name}_in_model", proportion(int((alive & ~left).sum()), len(alive)))
    yield from (
        (reason, int((own["reason"] == code).sum()))
        for code, reason in enumerate(RUN_REASONS)
        if code
    )
    yield "left_model", int(left.sum())
    yield "lasted_median_s", float(np.median(own["lasted"])) if len(left) else np.nan


def _errors(own: Numbers) -> Iterator[tuple[str, float]]:
    alive, squares = own["reason"] == SURVIVED, own["mean_square"]
    yield from _interval("rmse_m", rmse(squares[alive, 0]))
    yield "std_m", float(np.sqrt(squares[alive, 0]).std(ddof=1)) if alive.sum() > 1 else np.nan
    yield from _interval("censored_m", rmse(own["censored"]))
    for angle in ("roll", "pitch", "heading"):
        yield f"{angle}_deg", float(np.degrees(rmse(squares[:, ERROR_GROUPS.index(angle)]).value))
    yield from _geometric("anees", own["nees"] / STATES)


def _times(rows: Rows, place: int) -> Iterator[tuple[str, float]]:
    """When runs diverge (restricted to the flight), how the accelerometer bias is found, and the
    error with the 500 m rule alone."""
    yield from _interval("censored_500_m", rmse(censored(rows)[place]))
    onset, end = onsets(rows, place), float(rows.t[-1])
    for name, limit in (("early", EARLY), ("diverged", np.inf)):
        yield from _interval(name, proportion(int((onset < limit).sum()), len(onset)))
    yield from _geometric("onset_s", np.clip(onset, 1.0, end))
    bias = np.sqrt(np.square(rows.error[place][..., BA], dtype=float).sum(axis=-1))
    yield from _geometric("resolved_s", resolved(bias, rows.t))
    yield from _interval(
        "end_accel_bias_m_s2", rmse(np.where(rows.within[place][:, -1], bias[:, -1], np.nan) ** 2)
    )


def onsets(rows: Rows, place: int) -> Array:
    """(run,) s: when the position error first exceeds ONSET; inf for never."""
    beyond = rows.distance[place] > ONSET
    return np.where(beyond.any(axis=-1), rows.t[beyond.argmax(axis=-1)], np.inf)


def resolved(bias: Array, t: Array) -> Array:
    """(run,) s: from when on the bias error (run, epoch) m/s^2 stays below RESOLVED; the last
    time where it never does."""
    above = ~(bias <= RESOLVED)
    last = bias.shape[1] - 1 - above[:, ::-1].argmax(axis=-1)
    return np.where(above.any(axis=-1), t[np.minimum(last + 1, len(t) - 1)], t[0])


def _interval(name: str, interval: Interval) -> Iterator[tuple[str, float]]:
    return zip((name, f"{name}_low", f"{name}_high"), interval)


def _geometric(name: str, values: Array) -> Iterator[tuple[str, float]]:
    """Geometric mean over runs with its interval."""
    with np.errstate(all="ignore"):
        p = paired(np.log(values), np.zeros(len(values)))
    return zip(
        (name, f"{name}_low", f"{name}_high"), np.exp([p.difference, p.low, p.high]).tolist()
    )
