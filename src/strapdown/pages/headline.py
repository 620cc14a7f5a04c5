"""The sentence at the top of a report, and the few numbers that it and the cards show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..data.solution import Solution
from ..evaluation import metrics
from ..evaluation.metrics import Errors
from ..typing import Array
from ..units.wording import join_words, number
from .summary import claimed_std, heading_held

Window = tuple[float, float] | None
ALIKE = 1.1
"""Largest ratio of errors that the headline calls alike."""
NO_REFERENCE = "There is no reference to check that against."


class KeyFigure(NamedTuple):
    """A quantity by which solutions are compared at a glance; NaN where nothing tells it."""

    name: str
    unit: str
    error: float  # RMS, against the reference
    claimed: float  # RMS of the standard deviation, at the same times


def key_figures(solution: Solution, e: Errors | None, window: Window = None) -> list[KeyFigure]:
    """Those of a Solution of which anything is known; `e` are its Errors where there is a reference,
    scored over `window` in s."""
    if not len(solution.t):
        return []
    std = claimed_std(solution)
    claims = [("horizontal", "m", np.hypot(std[:, 0], std[:, 1]))]
    if not solution.has_position:
        claims.append(("inclination", "deg", np.degrees(np.hypot(std[:, 6], std[:, 7]))))
    if heading_held(solution):
        claims.append(("heading", "deg", np.degrees(std[:, 8])))
    errors = {} if e is None else _known_errors(e)
    found = []
    for name, unit, claimed in claims:
        error, own = np.nan, claimed
        if e is not None and name in errors:
            inside = e.inside(window)
            error, own = _rms(errors[name][inside]), claimed[e.rows][inside]
        found.append(KeyFigure(name, unit, error, _rms(own)))
    return [each for each in found if np.isfinite([each.error, each.claimed]).any()]


def _known_errors(e: Errors) -> dict[str, Array]:
    """{name of a KeyFigure: errors (n,)} of those that the reference knows."""
    errors = {"horizontal": e.horizontal, "heading": np.degrees(e.rph[:, 2])}
    if metrics.any_known(e.attitude):
        errors["inclination"] = np.degrees(metrics.attitude_angles(e).inclination)
    return {name: values for name, values in errors.items() if metrics.any_known(values)}


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan


def headline(
    solutions: Mapping[str, Solution], scores: Mapping[str, Errors], window: Window = None
) -> str:
    """The errors of the solutions, or without a reference what they claim, in a sentence or two."""
    figures = {
        name: key_figures(solution, scores.get(name), window)
        for name, solution in solutions.items()
    }
    if scored := {
        name: known
        for name, own in figures.items()
        if (known := [each for each in own if np.isfinite(each.error)])
    }:
        return _of_errors(scored)
    claimed = [
        f"{name} claims errors of {_texts(own, [each.claimed for each in own])} (1σ, RMS)"
        for name, own in figures.items()
        if own
    ]
    if claimed:
        return f"{'; '.join(claimed)}. {NO_REFERENCE}"
    return f"Neither errors nor standard deviations are known of {join_words(list(solutions))}."


def _texts(figures: Sequence[KeyFigure], values: Sequence[float]) -> str:
    """`0.82 m horizontal and 0.35 deg heading`."""
    known = [(each, value) for each, value in zip(figures, values) if np.isfinite(value)]
    return join_words([f"{number(value)} {each.unit} {each.name}" for each, value in known])


def _of_errors(scored: Mapping[str, Sequence[KeyFigure]]) -> str:
    """The errors of one solution beside its claims, or of several, the smallest first."""
    if len(scored) == 1:
        ((name, own),) = scored.items()
        said = f"RMS error of {name}: {_texts(own, [each.error for each in own])}"
        claims = _texts(own, [each.claimed for each in own])
        return f"{said}; it claims {claims}." if claims else f"{said}."
    first = next(iter(scored.values()))[0]
    same = {
        name: each.error for name, own in scored.items() for each in own if each.name == first.name
    }
    order = sorted(same, key=same.__getitem__)
    least, largest = same[order[0]], same[order[-1]]
    if len(order) > 1 and largest <= ALIKE * least:
        return (
            f"The RMS {first.name} errors are alike: {number(least)} {first.unit} of {order[0]} to "
            f"{number(largest)} {first.unit} of {order[-1]}."
        )
    rest = [f"{name} {number(same[name])} {first.unit}" for name in order[1:]]
    said = f"Smallest {first.name} error: {order[0]}, {number(same[order[0]])} {first.unit} RMS"
    return f"{said}; {join_words(rest)}." if rest else f"{said}."
