"""The rule of `strapdown advise`: evidence on each filter from the runs of a study, whether the
filter is admissible, and the answer.

Criteria and answer are in `Rules`, `judge` and `decide`; docs/how-to/advise.md lists them.
Everything is computed from the stored rows of the runs, so a shorter mission needs no further runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...checks import DataError
from ...core.loop.contract import POS, STATES
from ...evaluation.consistency import (
    SURVIVED,
    Interval,
    mean_of_known,
    paired_comparison,
    proportion,
)
from ...typing import Array
from ..monte_carlo.scoring import RUN_REASONS

if TYPE_CHECKING:
    from ..monte_carlo.campaign import Campaign

OPEN, CLOSED, RESET = "open-loop", "closed-loop", "periodic-reset:interval="
STRETCHES = 10
"""Number of equal parts of a mission in which the NEES is evaluated."""
MAX_RUNS = 100_000
"""Largest number of runs that is reported as necessary for a decision."""
YES, NO, UNDECIDED = "yes", "no", "undecided"


class Rules(NamedTuple):
    """Criteria for an admissible architecture; each is tested by a 95 % interval. Defaults:
    docs/how-to/advise.md."""

    survival: float = 0.9  # share of runs neither lost nor inconsistent, at least
    # NEES per state, mean over runs, in each tenth of the mission: between 1 / belief and belief
    belief: float = 2.0
    worse: float = 0.10  # position RMSE, censored: at most that share above the closed loop's


DEFAULT_RULES = Rules()


class FilterEvidence(NamedTuple):
    """Statistics of the runs of one filter."""

    filter: str
    count: int  # type: ignore[assignment]  # runs; hides the method of tuples
    lived: int  # runs that survived
    survived: Interval  # share
    nees: Interval  # NEES per state in the tenth of the mission where it is farthest from 1
    ratio: Interval  # censored position RMSE by the closed loop's on the same runs
    ahead: int  # runs in which it was smaller than the closed loop's
    rmse: float  # m, censored
    heading: float  # deg, root mean square over the rows before an abort


class FilterVerdict(NamedTuple):
    """Verdict on a filter: admissible YES, NO or UNDECIDED, also by criterion, and about how many
    runs in all a decision would need."""

    admissible: str
    survival: str
    belief: str
    worse: str
    runs: int


class Decision(NamedTuple):
    """The answer: "open", "reset", "closed", "none" or "undecided"; `filter` is the recommended
    one, for "undecided" the safe one (or None)."""

    answer: str
    filter: str | None
    verdicts: dict[str, FilterVerdict]  # {filter: Verdict}
    doubtful: str | None = None  # the filter that more runs would decide
    runs: int = 0  # approximate number of runs in all for a decision


class Runs(NamedTuple):
    """Stored rows of a cell's runs: t (n,) s; squares (filter, run, n) m^2, censored; nees
    (filter, run, n) per state, NaN after an abort."""

    filters: tuple[str, ...]
    t: Array
    squares: Array
    nees: Array
    heading: Array  # (filter, run, n) rad, error, NaN after an abort
    lasted: Array  # (filter, run) s; inf where the run survived

    @classmethod
    def of(cls, campaign: Campaign, cell: str) -> Runs:
        """Read the runs of a campaign's cell, without those that were quarantined. Raises DataError
        where none is left."""
        parts = campaign.read(cell, ("t", "error", "nees_rows", "lasted", "reason"))
        joined = {
            name: np.concatenate([part[name] for part in parts], axis=1)
            for name in ("error", "nees_rows", "lasted", "reason")
        }
        ran = (joined["reason"] != RUN_REASONS.index("quarantined")).all(axis=0)
        if not ran.any():
            raise DataError(
                f"{cell}: not one run came to its end; run again with another seed, or look at its "
                f"IMU"
            )
        error, nees, lasted, reason = (
            joined[name][:, ran] for name in ("error", "nees_rows", "lasted", "reason")
        )
        lasted = np.where(reason == SURVIVED, np.inf, lasted)
        t, limit = parts[0]["t"], campaign.manifest["limits"]["distance"] ** 2
        alive = t <= lasted[..., None]
        with np.errstate(all="ignore"):
            squares = np.square(error[..., POS].astype(float)).sum(axis=-1)
        squares = np.where(alive & (squares < limit), squares, limit)

        def mask_dead(values: NDArray[Any]) -> Array:
            return np.where(alive, values.astype(float), np.nan)

        return cls(
            tuple(campaign.manifest["filters"]),
            t,
            squares,
            mask_dead(nees) / STATES,
            mask_dead(error[..., 8]),
            lasted,
        )

    def until(self, t: float) -> Runs:
        """The same up to the time `t`, s."""
        rows = self.t <= t + 1e-6
        return self._replace(
            t=self.t[rows],
            squares=self.squares[..., rows],
            nees=self.nees[..., rows],
            heading=self.heading[..., rows],
            lasted=np.where(self.lasted >= self.t[rows][-1], np.inf, self.lasted),
        )


def evidence(runs: Runs) -> dict[str, FilterEvidence]:
    """Return {filter: FilterEvidence} of Runs in order of isolation: open loop first, closed loop
    last."""
    found, reference = {}, np.log(_mean_square(runs, CLOSED))
    for label in sorted(runs.filters, key=interval_of, reverse=True):
        place = runs.filters.index(label)
        own, count = np.log(_mean_square(runs, label)), runs.lasted.shape[1]
        lived = int(np.isinf(runs.lasted[place]).sum())
        apart = paired_comparison(own, reference)
        ratio = Interval(*np.exp(0.5 * np.array([apart.difference, apart.low, apart.high])))
        heading = float(np.degrees(np.sqrt(mean_of_known(runs.heading[place] ** 2))))
        found[label] = FilterEvidence(
            label,
            count,
            lived,
            proportion(lived, count),
            _worst(runs.nees[place]),
            ratio,
            apart.wins,
            float(np.sqrt(runs.squares[place].mean())),
            heading,
        )
    return found


def _mean_square(runs: Runs, label: str) -> Array:
    return runs.squares[runs.filters.index(label)].mean(axis=-1)


def _worst(nees: Array) -> Interval:
    """Interval over runs of the mean NEES per state (run, n) in the stretch where it is farthest
    from 1, as a factor."""
    found = []
    known = np.where(np.isfinite(nees), nees, np.nan)
    for part in np.array_split(known, min(STRETCHES, nees.shape[1]), axis=1):
        means = np.nanmean(part[np.isfinite(part).any(axis=1)], axis=1)
        if len(means):
            value, low, high, *_ = paired_comparison(means, np.zeros(len(means)))
            found.append(Interval(value, low if np.isnan(low) else max(low, 0.0), high))
    return max(
        found,
        key=lambda interval: abs(np.log(interval.value)),
        default=Interval(np.nan, np.nan, np.nan),
    )


def interval_of(label: str) -> float:
    """Seconds between resets of a filter's label: inf for the open loop, 0 for the closed."""
    return (
        np.inf
        if label == OPEN
        else float(label.removeprefix(RESET))
        if label.startswith(RESET)
        else 0.0
    )


def kind_of(label: str | None) -> str:
    """ "open", "reset" or "closed" of a filter's label; "none" of None."""
    return (
        "none"
        if label is None
        else "open"
        if label == OPEN
        else "reset"
        if label.startswith(RESET)
        else "closed"
    )


def display_name(label: str | None) -> str:
    """A filter's label for people: "open loop", "closed loop", "reset every 60 s"."""
    if label is not None and kind_of(label) == "reset":
        return f"reset every {interval_of(label):g} s"
    return {"open": "open loop", "closed": "closed loop", "none": "none"}[kind_of(label)]


def judge(found: FilterEvidence, rules: Rules = DEFAULT_RULES) -> FilterVerdict:
    """The FilterVerdict on an FilterEvidence: each criterion is met (YES) or broken (NO) where its
    whole interval says so."""
    survival = _between(found.survived, rules.survival, np.inf)
    belief = _between(found.nees, 1 / rules.belief, rules.belief)
    worse = YES if found.filter == CLOSED else _between(found.ratio, 0.0, 1 + rules.worse)
    criteria = (survival, belief, worse)
    if NO in criteria or UNDECIDED not in criteria:
        return FilterVerdict(NO if NO in criteria else YES, *criteria, 0)
    needed = zip(criteria, _runs_needed(found, rules))
    return FilterVerdict(
        UNDECIDED, *criteria, max(runs for state, runs in needed if state == UNDECIDED)
    )


def guess(found: FilterEvidence, rules: Rules = DEFAULT_RULES) -> FilterVerdict:
    """Verdict by the estimates alone, without intervals: for the map, whose runs are few."""

    survived, nees, ratio = found.survived.alone, found.nees.alone, found.ratio.alone
    return judge(found._replace(survived=survived, nees=nees, ratio=ratio), rules)


def _between(interval: Interval, least: float, most: float) -> str:
    if interval.low > most or interval.high < least:
        return NO
    return YES if least <= interval.low and interval.high <= most else UNDECIDED


def _runs_needed(found: FilterEvidence, rules: Rules) -> tuple[int, int, int]:
    """Return the number of runs in all that would decide each criterion if the estimates did not
    change; 0 where it is unknown."""
    count, share = found.count, found.survived.value
    sizes = np.unique(np.geomspace(count + 1, MAX_RUNS, 400).astype(int))

    def is_decided(n: int) -> bool:
        p = proportion(round(share * n), int(n))
        return p.low >= rules.survival or p.high < rules.survival

    survival = next((int(n) for n in sizes if is_decided(n)), int(sizes[-1]))
    return (
        survival,
        _shrunk(found.nees, (1 / rules.belief, rules.belief), count),
        _shrunk(found.ratio, (1 + rules.worse,), count),
    )


def _shrunk(interval: Interval, limits: tuple[float, ...], count: int) -> int:
    """Return the number of runs until an interval, whose width falls with their square root,
    excludes the nearest limit."""
    if not np.isfinite(interval).all():
        return 0
    half = 0.5 * (interval.high - interval.low)
    room = min(abs(interval.value - limit) for limit in limits)
    needed = np.ceil(count * (half / room) ** 2 - 1e-6) if room > 0 else MAX_RUNS
    return int(min(needed, MAX_RUNS))


def decide(
    found: Mapping[str, FilterEvidence],
    rules: Rules = DEFAULT_RULES,
    judged: Callable[[FilterEvidence, Rules], FilterVerdict] = judge,
) -> Decision:
    """The Decision on {filter: Evidence} in the order of isolation: the first admissible one, open
    loop first, closed loop last.

    If an earlier filter is undecided and could change the kind of the answer, the answer is
    "undecided".
    """
    verdicts = {label: judged(each, rules) for label, each in found.items()}
    order = list(verdicts)
    best = next((label for label in order if verdicts[label].admissible == YES), None)
    before = order[: order.index(best)] if best else order
    doubtful = next(
        (
            label
            for label in before
            if verdicts[label].admissible == UNDECIDED and kind_of(label) != kind_of(best)
        ),
        None,
    )
    if doubtful:
        return Decision("undecided", best, verdicts, doubtful, verdicts[doubtful].runs)
    return Decision(kind_of(best), best, verdicts)


def variants(rules: Rules = DEFAULT_RULES) -> dict[str, Rules]:
    """Return {description: Rules} with each threshold once stricter and once laxer, to show whether
    the answer depends on them."""
    lax, strict = max(1 - 2 * (1 - rules.survival), 0.0), 1 - 0.5 * (1 - rules.survival)
    changes = [
        *((f"survival of {100 * share:.3g} %", {"survival": share}) for share in (lax, strict)),
        *(
            (f"NEES within a factor {factor:.3g}", {"belief": factor})
            for factor in (rules.belief**2, rules.belief**0.5)
        ),
        *(
            (f"RMSE up to {100 * share:.3g} % worse", {"worse": share})
            for share in (rules.worse * 2.5, rules.worse / 2)
        ),
    ]
    return {name: rules._replace(**changed) for name, changed in changes}
