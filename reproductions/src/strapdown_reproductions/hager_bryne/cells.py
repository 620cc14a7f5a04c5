"""Open against closed loop on one cell (flight and IMU) in numbers: what the claims of Hager &
Bryne are decided with.

Everything is compared on the same runs. A ratio is RMSE of the first filter by RMSE of the second,
the geometric mean over runs, with 95 % ends. The paper gives a run up at 500 m or when the filter
is "highly inconsistent", which it does not define; what depends on our definition is computed with
both rules and with the 500 m rule alone (names that end in _500): the filters go on after an abort,
only the score stops.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from strapdown.core.loop.contract import BA, BG, POS, STATES, VEL
from strapdown.evaluation.consistency import (
    POSITION_LOST,
    SURVIVED,
    Interval,
    paired_comparison,
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


class CellRows(NamedTuple):
    """Stored rows of the runs of a cell: error, sd (filter, run, epoch, 15), nees, distance
    and within (filter, run, epoch), t (epoch,) s."""

    t: Array
    error: Stored  # m, m/s, rad, m/s^2 and rad/s, in the order of the error states
    sd: Stored  # the same
    nees: Stored
    bias: Stored  # (run, epoch, 6) true biases, m/s^2 and rad/s
    distance: Array  # (filter, run, epoch) m, inf where the filter has no estimate
    within: Mask  # not beyond LIMIT yet


Part: TypeAlias = tuple[Numbers, CellRows, int]
"""(numbers, Rows, place) of a filter of a cell: what the cell has, and which one of it."""


def numbers_of(campaign: Campaign, cell: str) -> tuple[Numbers, Mask]:
    """(numbers of the runs of a cell that were not quarantined, mask of them (run,))."""
    numbers = campaign.numbers(cell)
    ran = ~(numbers["reason"] == QUARANTINED).any(axis=0)
    return {name: values[:, ran] for name, values in numbers.items()}, ran


def rows_of(campaign: Campaign, cell: str, numbers: Numbers, ran: Mask) -> CellRows:
    """Rows of the same runs; some MB, for one cell at a time."""
    parts = campaign.read(cell, ("t", "error", "sd", "nees_rows", "bias"))
    error, sd, nees, bias = (
        np.concatenate([part[name] for part in parts], axis=axis).compress(ran, axis=axis)
        for name, axis in (("error", 1), ("sd", 1), ("nees_rows", 1), ("bias", 0))
    )
    t = parts[0]["t"]
    with np.errstate(over="ignore"):
        distance = np.sqrt(np.square(error[..., POS], dtype=float).sum(axis=-1))
    distance = np.where(np.isfinite(distance), distance, np.inf)
    ended = t > numbers["lasted"][..., None] + SAME_TIME
    lost = (numbers["reason"] == POSITION_LOST)[..., None] & ended
    within = ~np.logical_or.accumulate((distance > LIMIT) | lost, axis=-1)
    return CellRows(t, error, sd, nees, bias, distance, within)


def flight_of(name: str) -> str:
    """Name of the flight of a scenario, with an offset or without."""
    return name.removeprefix("paper1-").removesuffix("-offset").removesuffix("-initial")


def tables(campaign: Campaign) -> list[pd.DataFrame]:
    """For each filter of the campaign but the first a pandas DataFrame with a row per cell:
    `compared` of the first and this one, as open and closed loop, with flight, grade, minutes."""
    found: list[list[dict[str, float | str]]] = [[] for _ in campaign.manifest["filters"][1:]]
    for cell in campaign.manifest["cells"]:
        numbers, ran = numbers_of(campaign, cell["name"])
        rows = rows_of(campaign, cell["name"], numbers, ran)
        about = {
            "flight": flight_of(cell["scenario"]["name"]),
            "grade": cell["imu"]["name"].removeprefix("paper1-"),
            "minutes": cell["scenario"]["duration_s"] / 60,
            "runs": numbers["reason"].shape[1],
        }
        for place, own in enumerate(found, 1):
            own.append(about | compared(numbers, rows, 0, place))
    return [pd.DataFrame(own) for own in found]


def stacked(*parts: Part) -> tuple[Numbers, CellRows]:
    """(numbers, Rows) of filters from different campaigns with the same runs: parts are
    (numbers, Rows, place)."""
    numbers = {
        name: np.stack([own[name][place] for own, _, place in parts]) for name in parts[0][0]
    }
    by_filter = {
        name: np.stack([getattr(rows, name)[place] for _, rows, place in parts])
        for name in ("error", "sd", "nees", "distance", "within")
    }
    return numbers, parts[0][1]._replace(**by_filter)


def compared(numbers: Numbers, rows: CellRows, first: int = 0, second: int = 1) -> dict[str, float]:
    """A dict of what two filters of a cell did, at those places in the campaign: ratios of the
    two, and figures of each (open_, closed_)."""
    pair = [first, second]
    both = rows.within[first] & rows.within[second] & (rows.t >= SETTLED_AFTER)
    squares = {
        "position": numbers["censored"][pair],
        "position_500": censored(rows)[pair],
        **{
            name: mean_squares(rows.error[pair][..., states], both)
            for name, states in VECTORS.items()
        },
    }
    found: dict[str, float] = {}
    for name, own in squares.items():
        found |= ratio(name, *np.log(own))
    for name, place, side in ((FIRST, first, 0), (SECOND, second, 1)):
        own = {key: values[place] for key, values in numbers.items()}
        found |= {f"{name}_{key}": value for key, value in _figures(own, rows, place).items()}
        for angle in ("tilt", "heading"):
            rms = rmse(squares[angle][side]).value
            found[f"{name}_{angle}_500_deg"] = float(np.degrees(rms))
    return found


def ratio(name: str, a: Array, b: Array) -> dict[str, float]:
    """{name, name_low, name_high, name_count}: ratio of RMSEs from logarithms of mean squares
    (runs,) of two filters."""
    p = paired_comparison(a, b)
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


def censored(rows: CellRows) -> Array:
    """(filter, run) m^2: mean squared distance with the 500 m rule alone; every stored epoch
    from there on counts as 500 m."""
    return np.where(rows.within, np.minimum(rows.distance, LIMIT) ** 2, LIMIT**2).mean(axis=-1)


def _figures(own: Numbers, rows: CellRows, place: int) -> dict[str, float]:
    """Return the results of one filter of a cell, {name: value}, with the ends of its interval
    (name_low, name_high) where it has one."""
    within, left, squares = rows.within[place], np.isfinite(own["left_model"]), own["mean_square"]
    survived, onset = own["reason"] == SURVIVED, onsets(rows, place)
    bias = np.sqrt(np.square(rows.error[place][..., BA], dtype=float).sum(axis=-1))
    # how runs ended, also where a raw INS that left its model counts as lost; when they diverged
    shares = {
        "survived": survived,
        "survived_in_model": survived & ~left,
        "survived_500": within[:, -1],
        "survived_500_in_model": within[:, -1] & ~left,
        "early": onset < EARLY,
        "diverged": onset < np.inf,
    }
    mean_squared = {
        "rmse_m": squares[survived, 0],
        "censored_m": own["censored"],
        "censored_500_m": censored(rows)[place],
        "end_accel_bias_m_s2": np.where(within[:, -1], bias[:, -1], np.nan) ** 2,
    }
    typical = {
        "anees": own["nees"] / STATES,
        "onset_s": np.clip(onset, 1.0, float(rows.t[-1])),
        "resolved_s": resolved(bias, rows.t),
    }
    intervals = {
        **{name: proportion(int(each.sum()), len(each)) for name, each in shares.items()},
        **{name: rmse(each) for name, each in mean_squared.items()},
        **{name: geometric(each) for name, each in typical.items()},
    }
    return {
        **{
            f"{name}{end}": float(value)
            for name, each in intervals.items()
            for end, value in zip(("", "_low", "_high"), each)
        },
        **{
            reason: int((own["reason"] == code).sum())
            for code, reason in enumerate(RUN_REASONS)
            if code
        },
        "left_model": int(left.sum()),
        "lasted_median_s": float(np.median(own["lasted"])) if len(left) else np.nan,
        "std_m": float(np.sqrt(squares[survived, 0]).std(ddof=1)) if survived.sum() > 1 else np.nan,
        **{
            f"{angle}_deg": float(np.degrees(rmse(squares[:, ERROR_GROUPS.index(angle)]).value))
            for angle in ("roll", "pitch", "heading")
        },
    }


def onsets(rows: CellRows, place: int) -> Array:
    """(run,) s: when the position error first exceeds ONSET; inf for never."""
    beyond = rows.distance[place] > ONSET
    return np.where(beyond.any(axis=-1), rows.t[beyond.argmax(axis=-1)], np.inf)


def resolved(bias: Array, t: Array) -> Array:
    """(run,) s: from when on the bias error (run, epoch) m/s^2 stays below RESOLVED; the last
    time where it never does."""
    above = ~(bias <= RESOLVED)
    last = bias.shape[1] - 1 - above[:, ::-1].argmax(axis=-1)
    return np.where(above.any(axis=-1), t[np.minimum(last + 1, len(t) - 1)], t[0])


def geometric(values: Array) -> Interval:
    """Geometric mean over runs (n,) with its interval."""
    with np.errstate(all="ignore"):
        p = paired_comparison(np.log(values), np.zeros(len(values)))
    return Interval(*np.exp([p.difference, p.low, p.high]))
