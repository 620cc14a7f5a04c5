"""Factors of a full cross of readings, of what Hager & Bryne leave open or print so that it can be
read in several ways, and how all readings together decide a claim."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import pandas as pd

from ..common.claims import Claim, in_lines, judge, verdict_of
from ..common.pages import REPRODUCED
from ..common.verdicts import over_readings, tally

LETTER, SPIRIT, CHARITY = "letter", "spirit", "charity"


class Level(NamedTuple):
    """One way to read a point."""

    key: str
    name: str
    word: str  # how near to the paper: LETTER, SPIRIT or CHARITY


class Factor(NamedTuple):
    """A point that is read in several ways, the first as chosen here."""

    field: str  # of WorldReading
    about: str
    levels: tuple[Level, ...]

    def name(self, key: str) -> str:
        """The name of a level."""
        return next(level.name for level in self.levels if level.key == key)


SIGMA = Factor(
    "sigma",
    "sigma of Table III",
    (
        Level("std", "stationary standard deviation", SPIRIT),
        Level("density", "density of the driving noise, as Q_c has it", LETTER),
    ),
)
P0 = Factor(
    "p0",
    "P0 of the accelerometer bias",
    (
        Level("alike", "0.1 m/s² at all grades", LETTER),
        Level("own", "the grade's own", CHARITY),
    ),
)
BIASES = Factor(
    "biases",
    "true biases at the start",
    (
        Level("drawn", "drawn from the grade", SPIRIT),
        Level("zero", "zero, as in figure 2", LETTER),
    ),
)
START = Factor(
    "start",
    "attitude error at the start of navigation grade",
    (
        Level("chosen", "0.1 and 0.2 deg", SPIRIT),
        Level("tenth", "a tenth of it", CHARITY),
        Level("exact", "none", CHARITY),
    ),
)
UPDATE = Factor(
    "update",
    "update of the closed loop",
    (
        Level("prior", "with prior", SPIRIT),
        Level("printed", "(15) as printed", LETTER),
    ),
)
ABORT = Factor(
    "abort",
    "aborted runs",
    (
        Level("500", "500 m rule alone, 500 m from there on", SPIRIT),
        Level("both", "both rules, 500 m from there on", SPIRIT),
        Level("until", "both rules, scored until interrupted", LETTER),
    ),
)
WITHOUT_COUNT = Factor("abort", ABORT.about, (ABORT.levels[0], ABORT.levels[2]))
"""Factor of the measures without a value that could count after an abort: attitude, biases,
survival, NEES."""
OFFSET = Factor(
    "offset",
    "the offset of 0.5 m/s²",
    (
        Level("constant", "constant", LETTER),
        Level("initial", "initial value of the bias process", SPIRIT),
    ),
)
DIVERGES = Factor(
    "diverges",
    "when divergence begins",
    (
        Level("given_up", "when the paper's rules interrupt the run", LETTER),
        Level("onset", "at 10 m of position error", SPIRIT),
    ),
)
MINUTES = Factor(
    "minutes",
    "a few minutes",
    (
        Level("300", "5 min", SPIRIT),
        Level("180", "3 min", SPIRIT),
        Level("600", "10 min", CHARITY),
    ),
)
FACTORS = (SIGMA, P0, BIASES, START, UPDATE, ABORT, OFFSET, DIVERGES, MINUTES)
OF_WORLD = (SIGMA, P0, BIASES, START)
"""Factors that change the flights; the others choose a filter for the same flights, or the
scores."""


class FlownWorld(NamedTuple):
    """A level of each of OF_WORLD, which define the flights."""

    sigma: str = "std"
    p0: str = "alike"
    biases: str = "drawn"
    start: str = "chosen"

    @property
    def name(self) -> str:
        """Names a campaign."""
        return "-".join(self)


class WorldReading(NamedTuple):
    """A level of each factor, by its key; the first of each as chosen here."""

    sigma: str = "std"
    p0: str = "alike"
    biases: str = "drawn"
    start: str = "chosen"
    update: str = "prior"
    abort: str = "500"
    offset: str = "constant"
    diverges: str = "given_up"
    minutes: str = "300"

    @property
    def world(self) -> FlownWorld:
        """The world that is flown for it."""
        return FlownWorld(*self[: len(OF_WORLD)])


CHOSEN = WorldReading()


def nearest(word: str) -> WorldReading:
    """The reading by the `word`: LETTER, else SPIRIT where nothing is printed, or SPIRIT, else
    LETTER where there is one reading that fits both."""
    other = {LETTER: SPIRIT, SPIRIT: LETTER}[word]
    found = {
        factor.field: next(
            level.key for want in (word, other) for level in factor.levels if level.word == want
        )
        for factor in FACTORS
    }
    return WorldReading(**found)


BY_LETTER, IN_SPIRIT = nearest(LETTER), nearest(SPIRIT)


def cross(factors: Sequence[Factor]) -> list[WorldReading]:
    """All readings that differ in these factors, the chosen one first."""
    levels = product(*([level.key for level in factor.levels] for factor in factors))
    return [CHOSEN._replace(**dict(zip([f.field for f in factors], keys))) for keys in levels]


def within(reading: WorldReading, factors: Sequence[Factor]) -> WorldReading:
    """The reading with the chosen levels of all other factors."""
    return CHOSEN._replace(**{f.field: getattr(reading, f.field) for f in factors})


class ReadClaim(NamedTuple):
    """A claim and the factors by which it is read."""

    claim: Claim
    factors: tuple[Factor, ...] = ()


def verdicts(read: ReadClaim, evidence: Any) -> dict[WorldReading, str]:
    """The verdict of each reading that was flown and has what the claim needs; `evidence` has
    `read`, which gives what the rules look at, or None."""
    found = {}
    for reading in cross(read.factors):
        own = evidence.read(reading)
        if own is not None and not (read.claim.lacks and read.claim.lacks(own)):
            found[reading] = verdict_of(read.claim, own)
    return found


def finding(read: ReadClaim, evidence: Any, found: Mapping[WorldReading, str]) -> dict[str, str]:
    """The Finding on a claim by all its readings, whose verdicts are `found`: numbers as chosen and
    by the letter, and how the readings vote."""
    claim, chosen = read.claim, judge(read.claim, evidence.read(CHOSEN))
    letter = within(BY_LETTER, read.factors)
    if len(found) < 2:
        return chosen
    measured = f"As chosen here: {chosen['measured']}"
    if letter in found and letter != CHOSEN:
        measured += f"\nBy the letter: {judge(claim, evidence.read(letter))['measured']}"
    identities = [claim.identity(evidence.read(each)) if claim.identity else "" for each in found]
    return chosen | {
        "rule": in_lines(f"{claim.rule}\nRead by {', '.join(f.about for f in read.factors)}"),
        "measured": in_lines(measured),
        "verdict": over_readings(*found.values()),
        "votes": votes(read.factors, found),
        "identity": identities[0] if all(identities) else "",
    }


def votes(factors: Sequence[Factor], found: Mapping[WorldReading, str]) -> str:
    """Text: the verdicts by the letter and in the spirit, how many readings give which, and which
    factor turns it."""
    near = [
        (text, found[own])
        for text, reading in (("by the letter", BY_LETTER), ("in the spirit", IN_SPIRIT))
        if (own := within(reading, factors)) in found
    ]
    said = [f"{text} {verdict}" for text, verdict in near]
    said.append(f"of {len(found)} readings {tally(found.values())}")
    if len(set(found.values())) > 1 and (turning := turned_by(factors, found)):
        said.append(f"what turns it most is {turning}")
    text = "; ".join(said)
    return f"{text[0].upper()}{text[1:]}."


def turned_by(factors: Sequence[Factor], found: Mapping[WorldReading, str]) -> str:
    """Text: the factor whose levels differ most in the share of readings that reproduce the claim,
    with these shares, or, where none does, in any other verdict."""
    for wanted in (REPRODUCED, *dict.fromkeys(found.values())):
        shares = {factor: by_level(factor, found, wanted) for factor in factors}
        spread = {
            factor: max(of / n for of, n in own.values()) - min(of / n for of, n in own.values())
            for factor, own in shares.items()
            if own
        }
        factor = max(spread, key=spread.__getitem__, default=None)
        if factor is not None and spread[factor] > 0:
            each = [f"{factor.name(key)} {of} of {n}" for key, (of, n) in shares[factor].items()]
            return f"{factor.about} ({wanted}: {', '.join(each)})"
    return ""


def by_level(
    factor: Factor, found: Mapping[WorldReading, str], wanted: str = REPRODUCED
) -> dict[str, tuple[int, int]]:
    """{key of a level: (readings with it of the verdict `wanted`, readings with it)}."""
    counts = {}
    for level in factor.levels:
        own = [v for reading, v in found.items() if getattr(reading, factor.field) == level.key]
        if own:
            counts[level.key] = (own.count(wanted), len(own))
    return counts


def votes_table(
    reads: Sequence[ReadClaim], found: Sequence[Mapping[WorldReading, str]]
) -> pd.DataFrame:
    """As text, a row per level of a factor: what it is, in a word, and for each claim in how many
    of the readings with it that is reproduced; two rows more, the verdicts of the letter and of the
    spirit."""
    rows = []
    for factor in FACTORS:
        for level in factor.levels:
            row = [factor.about, level.name, level.word]
            for read, own in zip(reads, found):
                of_claim = [f for f in read.factors if f.field == factor.field]
                count = by_level(of_claim[0], own).get(level.key) if of_claim else None
                row.append(f"{count[0]}/{count[1]}" if count else "")
            rows.append(row)
    names = ["read", "as", "in a word", *map(str, range(1, len(reads) + 1))]
    return pd.DataFrame(rows, columns=names)


def votes_rows(
    found: Sequence[Mapping[WorldReading, str]], reads: Sequence[ReadClaim]
) -> pd.DataFrame:
    """A row per claim and reading: its levels, where they are factors of the claim, and its
    verdict."""
    rows = []
    for number, (read, own) in enumerate(zip(reads, found), 1):
        fields = {factor.field for factor in read.factors}
        for reading, verdict in own.items():
            levels = reading._asdict().items()
            named = {field: key if field in fields else "" for field, key in levels}
            rows.append({"claim": number, **named, "verdict": verdict})
    return pd.DataFrame(rows, columns=["claim", *WorldReading._fields, "verdict"])
