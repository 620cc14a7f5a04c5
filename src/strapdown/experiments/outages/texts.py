"""Text of the result of a comparison over outages: the filter with the least drift and its
significance, and the filters that were not scored, with reasons."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...units.wording import count_text, join_words, number

if TYPE_CHECKING:
    from .result import Comparison

HEIGHTS = "altitude", "pressure", "zero-sea-level"
"""Kinds of sources that measure only the height."""


class ErrorRatio(NamedTuple):
    """Ratio of one filter's RMSE to another's on the same outages."""

    value: float  # geometric mean of the ratios
    low: float  # 95 % interval, NaN with fewer than two blocks
    high: float
    wins: int  # outages in which the first is smaller
    count: int  # type: ignore[assignment]  # outages scored for both; hides the method of tuples
    blocks: int  # of outages that overlap


def ratio(
    comparison: Comparison, name: str, base: str, length: float, axis: str = "horizontal"
) -> ErrorRatio:
    """The ErrorRatio of RMSE of `name` to that of `base` along an axis, over the outages of a
    length; NaN where they have none in common."""
    rows = comparison.paired
    rows = rows[(rows["axis"] == axis) & (rows["length_s"] == length)]
    for a, b, sign in (name, base, 1), (base, name, -1):
        for row in rows[(rows["a"] == a) & (rows["b"] == b)].to_dict("records"):
            low, high = (row["low"], row["high"])[::sign]
            wins = row["wins_a" if sign > 0 else "wins_b"]
            return ErrorRatio(
                row["ratio"] ** sign, low**sign, high**sign, wins, row["n"], row["blocks"]
            )
    return ErrorRatio(np.nan, np.nan, np.nan, 0, 0, 0)


def rank_filters(comparison: Comparison, length: float) -> list[str]:
    """The filters that were scored in most outages of a length, the one with the smallest mean
    logarithm of the horizontal RMSE first."""
    own = comparison.of_length(length)
    own = own[own["horizontal_rmse_m"] > 0]
    if not len(own):
        return []
    found = (
        own.assign(log=np.log(own["horizontal_rmse_m"]))
        .groupby("filter", sort=False)["log"]
        .agg(["size", "mean"])
    )
    return list(
        found[found["size"] == found["size"].max()].sort_values("mean", kind="stable").index
    )


def sentences(comparison: Comparison) -> list[str]:
    """The answer in words: which filter drifts least in these outages and how sure that is, of each
    length, sources that only some used, then who failed.

    A list of lines.
    """
    return [*answers(comparison), *unlike(comparison), *failures(comparison)]


def answers(comparison: Comparison) -> list[str]:
    """A sentence for each length of the outages."""
    return [_answer(comparison, length) for length in comparison.lengths]


def _answer(comparison: Comparison, length: float) -> str:
    order, count = (
        rank_filters(comparison, length),
        comparison.of_length(length)["outage"].nunique(),
    )
    where = count_text(count, "outage") + (
        f" of {length:g} s" if len(comparison.lengths) > 1 else ""
    )
    if not order:
        return f"Nothing was scored in {where}."
    if len(order) < 2:
        return f"Only {order[0]} was scored in {where}: there is nothing to compare it with."
    best, found = order[0], {name: ratio(comparison, name, order[0], length) for name in order[1:]}
    blocks, n = (max(getattr(r, part) for r in found.values()) for part in ("blocks", "count"))
    alike = told_alike(comparison, best, order[1:], length)
    within = f"in {where}" + (f" ({blocks} blocks of those that overlap)" if blocks < n else "")
    if blocks < 2:
        why = "they overlap" if n > 1 else "it is only one"
        return (
            f"{best} has the smallest horizontal RMSE in {where}; "
            f"{_times(best, found, order[1:2])}, the next; but {why}, "
            "so that it may be chance."
        )
    if not alike:
        return f"{best} drifts least {within}: {_times(best, found, order[1:2])}, the next."
    if len(alike) == len(found):
        return (
            f"The data do not separate the filters: {best} has the smallest horizontal RMSE "
            f"{within}, but there may be no difference to "
            f"{join_words(alike)}: {_times(best, found, alike)}."
        )
    rest = [name for name in found if name not in alike]
    return (
        f"{best} has the smallest horizontal RMSE {within}, but the data do not separate it from "
        f"{join_words(alike)}: "
        f"{_times(best, found, alike)}; {join_words(rest)} {'drift' if len(rest) > 1 else 'drifts'} "
        f"more."
    )


MAX_NAMED = 3
"""Names of filters that a headline has at most."""


def headline(comparison: Comparison) -> str:
    """The answer in a sentence, of the longest outages."""
    length = comparison.lengths[-1]
    order = rank_filters(comparison, length)
    count = count_text(comparison.of_length(length)["outage"].nunique(), "outage")
    where = count + (f" of {length:g} s" if len(comparison.lengths) > 1 else "")
    if len(order) < 2:
        return _answer(comparison, length)
    alike = told_alike(comparison, order[0], order[1:], length)
    if not alike:
        return f"{order[0]} drifts least in {where}."
    same = _some([order[0], *alike])
    if len(alike) == len(order) - 1:
        return f"{where[0].upper()}{where[1:]} cannot separate {same}."
    rest = [name for name in order[1:] if name not in alike]
    more = f"{_some(rest)} {'drift' if len(rest) > 1 else 'drifts'} more"
    return f"{same} drift least in {where} and cannot be separated; {more}."


def _some(names: list[str]) -> str:
    """The first names, and how many more there are."""
    few = names[:MAX_NAMED] if len(names) > MAX_NAMED + 1 else names
    more = [f"{len(names) - len(few)} others"] if len(few) < len(names) else []
    return join_words([*few, *more])


def told_alike(
    comparison: Comparison,
    best: str,
    others: Iterable[str],
    length: float,
    axis: str = "horizontal",
) -> list[str]:
    """Those of the others whose RMSE is not significantly larger than that of `best` along an
    axis."""
    ratios = {name: ratio(comparison, name, best, length, axis) for name in others}
    return [name for name, r in ratios.items() if not (r.blocks > 1 and r.low > 1)]


def _times(best: str, found: dict[str, ErrorRatio], names: Iterable[str]) -> str:
    """The RMSE of `best` beside that of each other: "best's horizontal RMSE is 0.5 times as
    large as worse's (95 %: 0.45 to 0.56)".

    found: {name: Ratio to it}.
    """

    def within(r: ErrorRatio) -> str:
        if not np.isfinite([r.low, r.high]).all():
            return ""
        return f" (95 %: {number(1 / r.high)} to {number(1 / r.low)})"

    ratios = [
        f"{number(1 / found[name].value)} times as large as {name}'s{within(found[name])}"
        for name in names
    ]
    return f"{best}'s horizontal RMSE is " + join_words(ratios)


def unlike(comparison: Comparison) -> list[str]:
    """A sentence for each source that is not withheld and that only some of the filters use, of
    those that could run."""
    used = {name: own for name, own in comparison.settings["sources"].items() if own}
    said = []
    for source, kind in comparison.settings["kept"].items():
        having = [name for name, own in used.items() if source in own]
        if 0 < len(having) < len(used):
            so = (
                "vertical errors do not compare"
                if kind in HEIGHTS
                else "mind this where errors are compared"
            )
            said.append(
                f"In the outages {join_words(having)} also used {source}, which "
                f"{join_words([name for name in used if name not in having])} "
                f"did not, so {so}."
            )
    return said


def failures(comparison: Comparison) -> list[str]:
    """A line for each filter that was not scored in all outages, with what was said."""
    lines = []
    for name in comparison.filters:
        own = comparison.scores[comparison.scores["filter"] == name]
        missing = own[~np.isfinite(own["horizontal_rmse_m"])]
        if len(missing):
            said = list(dict.fromkeys(filter(None, missing["said"]))) or ["no reason given"]
            said[2:] = [f"and {len(said) - 2} more"] if len(said) > 2 else []
            where = len(missing) if len(missing) < len(own) else "any"
            lines.append(
                f"{name} was not scored in {where} of {count_text(len(own), 'outage')}: {'; '.join(said)}"
            )
    return lines
