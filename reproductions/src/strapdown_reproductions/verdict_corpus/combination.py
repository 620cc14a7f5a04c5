"""Two rules that combine evidence: the sum of weights that the verdict uses, and likelihood ratios, each
learned on one half of the corpus and counted on the other."""

import json
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from strapdown.data.verdict import CAUSES
from strapdown.typing import Array

from ..wrong_setups.cells import RIGHT

EDGES = (0.5, 1.0, 2.0, 5.0)
"""Weights between which the evidence of a cause counts alike; none at all is a class of its own."""
MAX_DOUBTED = 0.03
"""Share of right results of right set-ups that a threshold may doubt."""


def classes(evidence: Iterable[str]) -> pd.DataFrame:
    """(n, causes) the class of each cause's weight: 0 of none, 1 below the first of EDGES, and so
    on."""
    rows = [json.loads(each) for each in evidence]
    of = {cause: [row.get(cause, -1.0) for row in rows] for cause in CAUSES}
    return pd.DataFrame(
        {cause: np.searchsorted((0.0, *EDGES), weights, "right") for cause, weights in of.items()}
    )


def total_weight(evidence: Iterable[str]) -> Array:
    """(n,) the sum over causes of weights of 1 and more."""
    rows = (json.loads(each) for each in evidence)
    return np.array([sum(weight for weight in row.values() if weight >= 1.0) for row in rows])


def log_ratios(found: pd.DataFrame, wrong: pd.Series) -> Mapping[str, Array]:
    """{cause: (classes,) log of the likelihood ratio of wrong to right}, with one result added to each
    class, so that none is certain."""
    return {
        cause: np.log(_shares(found[cause][wrong]) / _shares(found[cause][~wrong]))
        for cause in found
    }


def _shares(values: pd.Series) -> Array:
    counts = np.bincount(values, minlength=len(EDGES) + 2) + 1.0
    return np.asarray(counts / counts.sum())


def scores(found: pd.DataFrame, ratios: Mapping[str, Array]) -> Array:
    """(n,) sums of log likelihood ratios, as if causes were independent."""
    return np.sum([ratios[cause][found[cause]] for cause in found], axis=0)


def threshold(score: Array, right: Array) -> float:
    """The least score that at most MAX_DOUBTED of those that are `right` reach."""
    right = np.sort(score[right])
    allowed = int(MAX_DOUBTED * len(right))
    return float(np.nextafter(right[-1 - allowed], np.inf))


def compare_rules(learned: pd.DataFrame, counted: pd.DataFrame) -> pd.DataFrame:
    """A row per rule: wrong results of the counted half that it trusts, right results of right set-ups that
    it doubts, and of set-ups with a mistake that does no harm."""
    wrong = learned["vouched_wrong"].to_numpy(bool)
    usual = (
        ~wrong & (learned["mistake"] == RIGHT).to_numpy() & ~learned["untested_axes"].to_numpy(bool)
    )
    before, now = classes(learned["evidence"]), classes(counted["evidence"])
    ratios = log_ratios(before, pd.Series(wrong))
    weights = [total_weight(half["evidence"]) for half in (learned, counted)]
    likely = [scores(half, ratios) for half in (before, now)]
    rules = {
        "sum of weights, 1 or more": weights[1] >= 1.0,
        "sum of weights, threshold learned": weights[1] >= threshold(weights[0], usual),
        "likelihood ratios, threshold learned": likely[1] >= threshold(likely[0], usual),
    }
    return pd.DataFrame([{"rule": name} | _outcome(counted, rule) for name, rule in rules.items()])


def _outcome(counted: pd.DataFrame, doubted: Array) -> dict[str, str]:
    wrong = counted["vouched_wrong"].to_numpy(bool)
    right = ~wrong & ~counted["untested_axes"].to_numpy(bool)
    plain = (counted["mistake"] == RIGHT).to_numpy()
    of = lambda part, those: f"{int((part & those).sum())} of {int(those.sum())}"
    return {
        "trusted and wrong": of(~doubted, wrong),
        "correct set-up doubted": of(doubted, right & plain),
        "harmless mistake doubted": of(doubted, right & ~plain),
    }
