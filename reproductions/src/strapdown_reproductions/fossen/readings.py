"""Readings of what the chapter and its code leave open or print in two ways, in a full cross: which
filter, which weights and estimates of the biases, which biases of signal 2. Each has a vote.

One word for each: "letter" is what is printed, "spirit" what the text means by it, "charity" what
helps a filter beyond that.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from ..common.claims import Claim, JudgedClaim
from ..common.pages import UNDECIDED
from ..common.verdicts import over_readings
from .cases import CHAPTER, CONSIDERED, DECIDING, FADING, RIGHT
from .runs import KEYS
from .signals import CONSTANT, SIGNALS

Cells: TypeAlias = list[tuple[Any, pd.DataFrame]]
"""[(label of a cell, its rows, one for each run)]."""
LETTER, SPIRIT, CHARITY = WORDS = ("letter", "spirit", "charity")


class ReadPoint(NamedTuple):
    """A reading of one point."""

    name: str
    word: str
    about: str  # why it has this word


PRINTED = ReadPoint("as printed", LETTER, "the equations and code of the chapter, step by step")
LIBRARY = ReadPoint(
    "library", SPIRIT, "the same filter with exact Jacobians, every fix used when it comes"
)
ALLOWED = ReadPoint(
    "AHRS considered",
    CHARITY,
    "the library's filter knows what errors of the AHRS do to the velocity",
)
WEIGHTS = {
    CHAPTER: ReadPoint(
        "chapter's weights", LETTER, "weights and held biases of the published code"
    ),
    FADING: ReadPoint(
        "decaying estimates", SPIRIT, "the same weights, biases decay as in the error model"
    ),
    RIGHT: ReadPoint("true noises", CHARITY, "what is simulated, and a start with errors"),
}
BIASES = {
    ("signal 1", CONSTANT): ReadPoint(
        "constant biases", LETTER, "signal 2 as published with the chapter"
    ),
    tuple(SIGNALS): ReadPoint(
        "varying biases", SPIRIT, "signal 2 as its generator became later: they decay with 300 s"
    ),
}
"""{excitations in motion: reading of the biases of signal 2}."""
POINTS = {
    "filter": (PRINTED, LIBRARY, ALLOWED),
    "weights and estimates of biases": tuple(WEIGHTS.values()),
    "biases of signal 2": tuple(BIASES.values()),
}


class FossenReading(NamedTuple):
    """A reading of all points that a claim depends on."""

    points: tuple[ReadPoint, ...]

    @property
    def name(self) -> str:
        """Names of its points."""
        return ", ".join(point.name for point in self.points)

    @property
    def word(self) -> str:
        """The word of the point that is furthest from the letter."""
        return max((point.word for point in self.points), key=WORDS.index)


class ByReading(NamedTuple):
    """A part of a claim that is judged in every reading: `rule` of the cells of each and of a
    condition `what` on their runs."""

    rule: Callable[[Cells, str], JudgedClaim]
    what: str
    # {ReadPoint: names of cases} of the filters that are read so
    filters: Mapping[ReadPoint, Sequence[str]]
    tunings: Sequence[str]
    # excitations besides the signals, and whether the signals are flown
    others: Sequence[str] = ()
    moved: bool = True

    def cells(self, runs: pd.DataFrame) -> Iterator[tuple[FossenReading, Cells]]:
        """The cells of each reading that has runs."""
        motions = BIASES if self.moved else {(): None}
        for (own, names), tuning, (signals, biases) in product(
            self.filters.items(), self.tunings, motions.items()
        ):
            found = pick(runs, names, (*signals, *self.others), [tuning])
            if found:
                points = (own, WEIGHTS[tuning], *((biases,) if biases else ()))
                yield FossenReading(points), found

    def judge(self, evidence: Any) -> dict[FossenReading, JudgedClaim]:
        """The verdict in each reading."""
        return {
            reading: self.rule(cells, self.what) for reading, cells in self.cells(evidence.runs)
        }

    def __call__(self, evidence: Any) -> JudgedClaim:
        """The combined verdict of all readings, with the votes by kind of reading as its text."""
        judged = self.judge(evidence)
        by_word = {
            word: [found.verdict for each, found in judged.items() if each.word == word]
            for word in WORDS
        }
        said = [f"{word}: {_count_verdicts(found)}" for word, found in by_word.items() if found]
        return JudgedClaim(_verdict(judged.values()), "; ".join(said) or "no runs")

    def all_cells(self, evidence: Any) -> Cells:
        """The cells of all readings, each once."""
        found = {key: rows for _, cells in self.cells(evidence.runs) for key, rows in cells}
        return list(found.items())


def together(judged: Mapping[str, JudgedClaim]) -> JudgedClaim:
    """The verdict over readings that have names of their own, with the verdict of each as its
    text."""
    said = [f"{name}: {found.verdict}" for name, found in judged.items()]
    return JudgedClaim(_verdict(judged.values()), "; ".join(said))


def _verdict(judged: Iterable[JudgedClaim]) -> str:
    """The verdict over readings; without any none is decidable."""
    return over_readings(*([found.verdict for found in judged] or [UNDECIDED]))


def _count_verdicts(verdicts: Sequence[str]) -> str:
    """Text: how many verdicts there are of each kind."""
    if len(set(verdicts)) == 1:
        return verdicts[0]
    count = len(verdicts)
    return ", ".join(f"{verdicts.count(v)} of {count} {v}" for v in dict.fromkeys(verdicts))


def choose_cells(rows: pd.DataFrame, keys: Sequence[str], **wanted: Sequence[Any]) -> Cells:
    """[(values of `keys`, rows)] of the cells of the rows whose columns have one of the `wanted`
    values each."""
    all_of = [rows[name].isin(values) for name, values in wanted.items()]
    own = rows[np.logical_and.reduce([np.ones(len(rows), bool), *all_of])]
    return list(own.groupby(list(keys), sort=False))


def pick(
    runs: pd.DataFrame,
    cases: Sequence[str],
    excitations: Sequence[str],
    tunings: Sequence[str] = DECIDING,
) -> Cells:
    """[((case, excitation, tuning), rows)] of the cells asked for that have runs."""
    return choose_cells(runs, KEYS, case=cases, excitation=excitations, tuning=tunings)


def filters(
    printed: Sequence[str], library: Sequence[str], considered: bool = False
) -> dict[ReadPoint, Sequence[str]]:
    """{ReadPoint: names of cases}; considered: those of the library with an AHRS have a case each
    that considers its errors."""
    found: dict[ReadPoint, Sequence[str]] = {PRINTED: printed} if printed else {}
    if library:
        found[LIBRARY] = library
    if considered:
        found[ALLOWED] = [name + CONSIDERED for name in library]
    return found


def table(claims: Mapping[str, Claim], evidence: Any) -> pd.DataFrame:
    """A row per claim and reading: its number, the reading, its word, verdict and count of
    cells."""
    rows = [
        (i, reading.name, reading.word, found.verdict, str(found))
        for i, claim in enumerate(claims.values(), 1)
        for part in claim.parts.values()
        if isinstance(part, ByReading)
        for reading, found in part.judge(evidence).items()
    ]
    return pd.DataFrame(rows, columns=["claim", "reading", "word", "verdict", "cells"])


def points_table() -> pd.DataFrame:
    """A row per point and reading of it, with its word and why."""
    rows = [(about, *point) for about, points in POINTS.items() for point in points]
    return pd.DataFrame(rows, columns=["what is left open", "reading", "word", "why"])
