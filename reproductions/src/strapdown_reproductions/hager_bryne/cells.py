"""Open against closed loop on one cell (flight and IMU) in numbers: what the claims of Hager &
Bryne are decided with.

Everything is compared on the same runs. A ratio is RMSE of the first filter by RMSE of the second,
the geometric mean over runs, with 95 % ends. The paper gives a run up at 500 m or when the filter
is "highly inconsistent", which it does not define. The filters go on after an abort, only the score
stops, so that the same flights are scored in three ways (the end of a name): _500, by the 500 m
rule alone; _both, by both rules, each epoch after an abort counted as 500 m; _until, by both rules,
each filter until it is interrupted.
"""

from collections.abc import Sequence
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
MINUTES = (180, 300, 600)
"""s: readings of "a few minutes"."""
FIX_STD = 1.0
"""m, of a fix on each axis."""
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
"""Compared after SETTLED_AFTER and while both filters are within LIMIT, or each until it is
interrupted; tilt: north and east of the attitude's rotation vector (roll and pitch together)."""
COMPARED = ("position", "steps", *VECTORS)
"""Quantities that compare two filters; steps: of the position error from one stored epoch to the
next, which is what noise leaves of it."""
STRAIGHT = ("07", "10")
"""Flights without manoeuvres, whose errors are reported over time too."""
FIRST, SECOND = "open", "closed"
SAME_TIME = 1e-6
Stored: TypeAlias = NDArray[np.float32]
"""As the chunk files keep rows: 4 bytes a number."""
Numbers: TypeAlias = dict[str, Array]
"""{name: (filter, run, ...)} of Campaign.numbers, or of one of the filters (run, ...)."""


class CellRows(NamedTuple):
    """Stored rows of the runs of a cell: error, std (filter, run, epoch, 15), nees, distance
    and within (filter, run, epoch), t (epoch,) s."""

    t: Array
    error: Stored  # m, m/s, rad, m/s^2 and rad/s, in the order of the error states
    std: Stored  # the same
    nees: Stored
    bias: Stored  # (run, epoch, 6) true biases, m/s^2 and rad/s
    distance: Array  # (filter, run, epoch) m, inf where the filter has no estimate
    within: Mask  # not beyond LIMIT yet
    until: Mask  # not interrupted yet by either rule


Part: TypeAlias = tuple[Numbers, CellRows, int]
"""(numbers, Rows, index) of a filter of a cell."""


def numbers_of(campaign: Campaign, cell: str) -> tuple[Numbers, Mask]:
    """(numbers of the runs of a cell that were not quarantined, mask of them (run,))."""
    numbers = campaign.numbers(cell)
    ran = ~(numbers["reason"] == QUARANTINED).any(axis=0)
    return {name: values[:, ran] for name, values in numbers.items()}, ran


def rows_of(campaign: Campaign, cell: str, numbers: Numbers, ran: Mask) -> CellRows:
    """Rows of the same runs; some MB, for one cell at a time."""
    parts = campaign.read(cell, ("t", "error", "std", "nees_rows", "bias"))
    error, std, nees, bias = (
        np.concatenate([part[name] for part in parts], axis=axis).compress(ran, axis=axis)
        for name, axis in (("error", 1), ("std", 1), ("nees_rows", 1), ("bias", 0))
    )
    t = parts[0]["t"]
    with np.errstate(over="ignore"):
        distance = np.sqrt(np.square(error[..., POS], dtype=float).sum(axis=-1))
    distance = np.where(np.isfinite(distance), distance, np.inf)
    ended = t > numbers["lasted"][..., None] + SAME_TIME
    lost = (numbers["reason"] == POSITION_LOST)[..., None] & ended
    within = ~np.logical_or.accumulate((distance > LIMIT) | lost, axis=-1)
    return CellRows(t, error, std, nees, bias, distance, within, ~ended)


def flight_of(name: str) -> str:
    """Name of the flight of a scenario, with an offset or without."""
    return name.removeprefix("paper1-").removesuffix("-offset").removesuffix("-initial")


def grade_of(name: str) -> str:
    """Return the grade of an IMU, for any reading of it."""
    return name.removeprefix("paper1-").removesuffix("-zero").removesuffix("-density")


def tables(campaign: Campaign) -> list[pd.DataFrame]:
    """For each filter of the campaign but the first a pandas DataFrame with a row per cell:
    `compare_filters` of the first and this one, as open and closed loop, with flight, grade,
    minutes and scenario."""
    found: list[list[dict[str, float | str]]] = [[] for _ in campaign.manifest["filters"][1:]]
    ends = sorted({cell["scenario"]["duration_s"] for cell in campaign.manifest["cells"]})
    for cell in campaign.manifest["cells"]:
        numbers, ran = numbers_of(campaign, cell["name"])
        rows = rows_of(campaign, cell["name"], numbers, ran)
        about = {
            "scenario": cell["scenario"]["name"],
            "flight": flight_of(cell["scenario"]["name"]),
            "grade": grade_of(cell["imu"]["name"]),
            "minutes": cell["scenario"]["duration_s"] / 60,
            "runs": numbers["reason"].shape[1],
        }
        for place, own in enumerate(found, 1):
            own.append(about | compare_filters(numbers, rows, 0, place))
            if about["flight"] in STRAIGHT:
                own[-1] |= by_time(rows, ends)
    return [pd.DataFrame(own) for own in found]


def stack_parts(*parts: Part) -> tuple[Numbers, CellRows]:
    """(numbers, Rows) of filters from different campaigns with the same runs: parts are
    (numbers, Rows, place)."""
    numbers = {
        name: np.stack([own[name][place] for own, _, place in parts]) for name in parts[0][0]
    }
    by_filter = {
        name: np.stack([getattr(rows, name)[place] for _, rows, place in parts])
        for name in ("error", "std", "nees", "distance", "within", "until")
    }
    return numbers, parts[0][1]._replace(**by_filter)


def compare_filters(
    numbers: Numbers, rows: CellRows, first: int = 0, second: int = 1
) -> dict[str, float]:
    """A dict of what two filters of a cell did, at those places in the campaign: ratios of the
    two, and figures of each (open_, closed_)."""
    pair = [first, second]
    squares = _mean_squares(numbers, rows, pair)
    found: dict[str, float] = {}
    for name, own in squares.items():
        found |= ratio(name, *np.log(own))
    for name, place, side in ((FIRST, first, 0), (SECOND, second, 1)):
        own = {key: values[place] for key, values in numbers.items()}
        found |= {f"{name}_{key}": value for key, value in _figures(own, rows, place).items()}
        for angle in ("tilt", "heading"):
            for scored in ("500", "until"):
                rms = rmse(squares[f"{angle}_{scored}"][side]).value
                found[f"{name}_{angle}_{scored}_deg"] = float(np.degrees(rms))
    return found


def _mean_squares(numbers: Numbers, rows: CellRows, pair: list[int]) -> dict[str, Array]:
    """{name of a ratio: (2, run) mean squares of two filters}."""
    both = rows.within[pair].all(axis=0) & (rows.t >= SETTLED_AFTER)
    error, until = rows.error[pair], rows.until[pair]
    found = {
        "position_both": numbers["censored"][pair],
        "position_500": censored_mean_square(rows)[pair],
    }
    found["position_until"] = mean_squares(error[..., POS], until)
    parts = {name: error[..., states] for name, states in VECTORS.items()}
    with np.errstate(invalid="ignore"):  # of a filter that has no estimate any more
        parts["steps"] = np.diff(error[..., POS], axis=-2, prepend=np.nan)
    for name, part in parts.items():
        later = np.isfinite(part).all(axis=-1) if name == "steps" else True
        found[f"{name}_500"] = mean_squares(part, both & later)
        found[f"{name}_until"] = mean_squares(part, until & later)
    return found


def by_time(rows: CellRows, ends: Sequence[float]) -> dict[str, float]:
    """{name: value, with the ends of its interval}: RMSE of the first filter as in
    `censored_mean_square` over the first `ends` s, as long as its flight is."""
    most = np.where(rows.within[0], np.minimum(rows.distance[0], LIMIT), LIMIT) ** 2
    return {
        f"{FIRST}_by_{end:.0f}_s{bound}": float(value)
        for end in ends
        if end <= rows.t[-1] + SAME_TIME
        for bound, value in zip(
            ("", "_low", "_high"), rmse(most[:, rows.t <= end + SAME_TIME].mean(axis=-1))
        )
    }


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
    `mask` (filter, run, epoch) or (run, epoch); NaN where there is none."""
    with np.errstate(over="ignore"):
        squares = np.where(mask, np.square(error, dtype=float).sum(axis=-1), 0.0).sum(axis=-1)
    count = mask.sum(axis=-1)
    return squares / np.where(count, count, np.nan)


def censored_mean_square(rows: CellRows) -> Array:
    """(filter, run) m^2: mean squared distance with the 500 m rule alone; every stored epoch
    from there on counts as 500 m."""
    return np.where(rows.within, np.minimum(rows.distance, LIMIT) ** 2, LIMIT**2).mean(axis=-1)


def _figures(own: Numbers, rows: CellRows, place: int) -> dict[str, float]:
    """Return the results of one filter of a cell, {name: value}, with the ends of its interval
    (name_low, name_high) where it has one."""
    within, left, squares = rows.within[place], np.isfinite(own["left_model"]), own["mean_square"]
    survived, onset = own["reason"] == SURVIVED, onsets(rows, place)
    given_up = np.where(survived, np.inf, own["lasted"])
    bias = np.sqrt(np.square(rows.error[place][..., BA], dtype=float).sum(axis=-1))
    # how runs ended, also where a raw INS that left its model counts as lost; when they diverged
    shares = {
        "survived": survived,
        "survived_in_model": survived & ~left,
        "survived_500": within[:, -1],
        "survived_500_in_model": within[:, -1] & ~left,
        "diverged": onset < np.inf,
        "grew": grew(rows.distance[place]),
        "contained": is_contained(rows, place),
        **{f"onset_{limit}": onset < limit for limit in MINUTES},
        **{f"given_up_{limit}": given_up < limit for limit in MINUTES},
    }
    mean_squared = {
        "rmse_m": squares[survived, 0],
        "censored_m": own["censored"],
        "censored_500_m": censored_mean_square(rows)[place],
        "end_accel_bias_m_s2": np.where(within[:, -1], bias[:, -1], np.nan) ** 2,
    }
    typical = {
        "anees": own["nees"] / STATES,
        "anees_500": nees_within(rows, place) / STATES,
        "onset_s": np.clip(onset, 1.0, float(rows.t[-1])),
        "given_up_s": np.clip(given_up, 1.0, float(rows.t[-1])),
        "resolved_s": resolution_time(bias, rows.t),
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


def grew(distance: Array) -> Mask:
    """(run,) true where the mean squared distance (run, epoch) is larger in the last quarter than
    in the one before; chance alone makes it so in half of the runs."""
    end, quarter = distance.shape[1], distance.shape[1] // 4
    with np.errstate(over="ignore"):
        squares = np.square(distance)
    before = squares[:, end - 2 * quarter : end - quarter].mean(axis=-1)
    last = squares[:, end - quarter :].mean(axis=-1)
    return (last > before) | np.isinf(last)


def is_contained(rows: CellRows, place: int) -> Mask:
    """(run,) true where the position's stated standard deviation, all axes together, never exceeds
    that of a fix after SETTLED_AFTER."""
    std = np.sqrt(np.square(rows.std[place][..., POS], dtype=float).sum(axis=-1))
    late = rows.t >= SETTLED_AFTER
    return (std[:, late] <= np.sqrt(3) * FIX_STD).all(axis=-1)


def nees_within(rows: CellRows, place: int) -> Array:
    """(run,) mean NEES of the stored epochs within LIMIT; NaN where there is none."""
    known = rows.within[place] & np.isfinite(rows.nees[place])
    total = np.where(known, rows.nees[place].astype(float), 0.0).sum(axis=-1)
    count = known.sum(axis=-1)
    return total / np.where(count, count, np.nan)


def resolution_time(bias: Array, t: Array) -> Array:
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
