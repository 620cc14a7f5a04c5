"""What a comparison over outages says in words: which filter drifts least and how sure that is, and which filters were not scored, with why."""
from typing import NamedTuple

import numpy as np

from .summary import number


class Ratio(NamedTuple):
    """How much larger one filter's RMSE is than another's on the same outages."""
    value: float        # geometric mean of the ratios
    low: float          # 95 % interval, NaN with fewer than two blocks
    high: float
    wins: int           # outages in which the first is smaller
    count: int          # outages scored for both
    blocks: int         # of outages that overlap


def ratio(comparison, name, base, length, axis="horizontal"):
    """The Ratio of RMSE of `name` to that of `base` along an axis, over the outages of a length; NaN where they have none in common."""
    rows = comparison.paired
    rows = rows[(rows["axis"] == axis) & (rows["length_s"] == length)]
    for a, b, sign in (name, base, 1), (base, name, -1):
        for _, row in rows[(rows["a"] == a) & (rows["b"] == b)].iterrows():
            low, high = (row["low"], row["high"])[::sign]
            wins = row["wins_a" if sign > 0 else "wins_b"]
            return Ratio(row["ratio"] ** sign, low ** sign, high ** sign, int(wins), int(row["n"]), int(row["blocks"]))
    return Ratio(np.nan, np.nan, np.nan, 0, 0, 0)


def ranked(comparison, length):
    """The filters that were scored in most outages of a length, the one with the smallest mean logarithm of the horizontal RMSE first."""
    own = comparison.of_length(length)
    own = own[own["horizontal_rmse_m"] > 0]
    if not len(own):
        return []
    found = own.assign(log=np.log(own["horizontal_rmse_m"])).groupby("filter", sort=False)["log"].agg(["size", "mean"])
    return list(found[found["size"] == found["size"].max()].sort_values("mean", kind="stable").index)


def sentences(comparison):
    """The answer in words: which filter drifts least in these outages and how sure that is, of each length, then who failed. A list of lines."""
    return [*answers(comparison), *failures(comparison)]


def answers(comparison):
    """A sentence for each length of the outages."""
    return [_answer(comparison, length) for length in comparison.lengths]


def _answer(comparison, length):
    order, count = ranked(comparison, length), comparison.of_length(length)["outage"].nunique()
    where = counted(count) + (f" of {length:g} s" if len(comparison.lengths) > 1 else "")
    if len(order) < 2:
        return f"Nothing was scored in {where}." if not order else f"Only {order[0]} was scored in {where}: there is nothing to compare it with."
    best, found = order[0], {name: ratio(comparison, name, order[0], length) for name in order[1:]}
    blocks, n = (max(getattr(r, part) for r in found.values()) for part in ("blocks", "count"))
    alike = [name for name, r in found.items() if not r.low > 1]
    within = f"in {where}" + (f" ({blocks} blocks of those that overlap)" if blocks < n else "")
    if blocks < 2:
        why = "they overlap" if n > 1 else "it is only one"
        return (f"{best} has the smallest horizontal RMSE in {where}, {_times(found[order[1]])} that of {order[1]}, the next; but {why}, "
                "so that it may be chance.")
    if not alike:
        return f"{best} drifts least {within}: its horizontal RMSE is {_times(found[order[1]])} that of {order[1]}, the next."
    if len(alike) == len(found):
        return (f"The data do not tell the filters apart: {best} has the smallest horizontal RMSE {within}, but there may be no difference to "
                f"{_named(found, alike)}.")
    rest = [name for name in found if name not in alike]
    return (f"{best} has the smallest horizontal RMSE {within}, but the data do not tell it apart from {_named(found, alike)}; "
            f"{_listed(rest)} {'drift' if len(rest) > 1 else 'drifts'} more.")


def _times(r):
    """How the second of a Ratio stands to the first: "0.71 (95 %: 0.6 to 0.83) times"."""
    within = f" (95 %: {number(1 / r.high)} to {number(1 / r.low)})" if np.isfinite([r.low, r.high]).all() else ""
    return f"{number(1 / r.value)}{within} times"


def _named(found, names):
    """The names with their Ratios: "mekf (ratio 1.03, 95 %: 0.993 to 1.06)"."""
    return _listed([f"{name} (ratio {number(found[name].value)}, 95 %: {number(found[name].low)} to {number(found[name].high)})" for name in names])


def _listed(words):
    """`a, b and c`."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def counted(n, noun="outage"):
    """`1 outage`, `2 outages`."""
    return f"{n} {noun}{'' if n == 1 else 's'}"


def failures(comparison):
    """A line for each filter that was not scored in all outages, with what was said."""
    lines = []
    for name in comparison.filters:
        own = comparison.scores[comparison.scores["filter"] == name]
        missing = own[~np.isfinite(own["horizontal_rmse_m"])]
        if len(missing):
            said = list(dict.fromkeys(text for text in missing["said"] if text)) or ["no reason given"]
            more = f"; and {len(said) - 2} more" if len(said) > 2 else ""
            where = f"{len(missing)} of {counted(len(own))}" if len(missing) < len(own) else f"any of {counted(len(own))}"
            lines.append(f"{name} was not scored in {where}: {'; '.join(said[:2])}{more}")
    return lines
