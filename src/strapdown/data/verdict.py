"""Reasons to doubt a result or a recording, with their probable cause, and the verdict that they
give. `inspection`, `installation` and `verdict` make Reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from .operations import operation

TRUSTED, DOUBTFUL, NOT_TO_BE_TRUSTED = "trusted", "doubtful", "not to be trusted"
NOT_JUDGED = "not judged"
"""The word where nothing is known of how a result came about, or too little was measured to test it;
its Verdict is not `trusted`."""
SEVERITY = (NOT_TO_BE_TRUSTED, DOUBTFUL, NOT_JUDGED, TRUSTED)
"""All words, the gravest first."""
GRAVE = 3.0
"""Sum of the weights that makes a result not to be trusted; a single one of 1 makes it doubtful, less
is a remark."""
HEAVIEST = 1000.0
"""A larger weight says no more, and JSON knows no infinity."""
CAUSES = {
    "clock": "time stamps",
    "unit": "unit or scale",
    "axes": "axes of the IMU",
    "frame": "axes",
    "height": "height above geoid or ellipsoid",
    "lever arm": "lever arm of the antenna",
    "mounting": "mounting of the IMU",
    "baseline": "vector between the antennas",
    "scale": "scale",
    "beacon": "place of the beacon",
    "disturbed field": "disturbed field",
    "fix noise": "standard deviations",
    "lasting errors": "time-correlated errors",
    "repeated": "repeated or held values",
    "calibration": "calibration",
    "imu noise": "description of the IMU",
    "accelerometer": "accelerometer bias or scale",
    "gyro": "gyro bias or scale",
    "outliers": "outliers",
    "samples": "missing samples of the IMU",
    "unknown": "set-up",
}
"""{cause: words for it}: what can be wrong with a set-up."""


POSITION, HEIGHT, VELOCITY = "horizontal position", "height", "velocity"
TILT, HEADING = "roll and pitch", "heading"
QUANTITIES = (POSITION, HEIGHT, VELOCITY, TILT, HEADING)
"""Quantities of a solution that a verdict vouches for, or not."""
RISK = 1e-3
"""Risk of misleading information of protection levels, where nobody states another."""


class Untested(NamedTuple):
    """Something that the data of a recording cannot show.

    Attributes
    ----------
    what : str
        What was not tested, such as "mounting of the IMU".
    why : str
        Why the data do not show it: one clause, no full stop.
    remedy : str
        What to record next time: one clause in the imperative; empty where nothing helps.
    rests : tuple of str
        Those of QUANTITIES that are no better than what was not tested.
    cause : str
        A key of CAUSES: what may be wrong unseen; empty where it is no single one.
    """

    what: str
    why: str
    remedy: str = ""
    rests: tuple[str, ...] = ()
    cause: str = ""

    @property
    def seen(self) -> str:
        """The thing that was not tested, and why."""
        return f"{self.what}: {self.why}"

    @property
    def line(self) -> str:
        """All of it, with what rests on it."""
        many = len(self.rests) > 1 or TILT in self.rests
        rest = f" ({', '.join(self.rests)} depend{'' if many else 's'} on it)"
        return str(self) + (rest if self.rests else "")

    def __str__(self) -> str:
        return f"{self.seen}; {self.remedy}" if self.remedy else self.seen


class SetUpBound(NamedTuple):
    """The smallest error of a set-up that its recording would have shown.

    Attributes
    ----------
    cause : str
        Of CAUSES: what may be off.
    what : str
        The parameter in words, with its source.
    size : float
        The smallest error that would have been a reason for doubt, in `unit`.
    unit : str
        s, m, deg, or "" of a scale.
    component : str
        The axis, such as "forward"; empty of the only one.
    """

    cause: str
    what: str
    size: float
    unit: str
    component: str = ""

    def __str__(self) -> str:
        return f"{self.what} {self.component}".rstrip() + f": {self.size:.2g} {self.unit}".rstrip()


class Reason(NamedTuple):
    """An observation that a correct set-up would not show.

    Attributes
    ----------
    cause : str
        The probable cause, a key of CAUSES.
    seen : str
        The observation, with number and unit, and the expected value: one clause, no full stop.
    remedy : str
        What to change or to run next: one clause in the imperative.
    source : str
        Name of the source of fixes concerned; empty: the IMU, or no single one.
    weight : float
        The observed value over the largest one of a correct set-up.
    """

    cause: str
    seen: str
    remedy: str
    source: str = ""
    weight: float = 1.0

    @property
    def what(self) -> str:
        """The cause in words, with the source."""
        words = CAUSES.get(self.cause, self.cause)  # a later version may know more causes
        return f"{words} of {self.source}" if self.source else words

    @property
    def line(self) -> str:
        """The words where no cause is said: source, unless what was seen begins with it, what was
        seen, what to do."""
        named = not self.source or self.seen.startswith(f"{self.source} ")
        return f"{'' if named else f'{self.source}: '}{self.seen}: {self.remedy}"

    def __str__(self) -> str:
        return f"{self.what}: {self.seen}; {self.remedy}"


def rank_reasons(reasons: Iterable[Reason]) -> list[Reason]:
    """Reasons in the order in which they are said: those that name a cause before those that name
    none, the weightiest first."""
    return sorted(reasons, key=lambda reason: (reason.cause == "unknown", -reason.weight))


@dataclass(frozen=True)
class Verdict:
    """The verdict on a result: `word` is one of TRUSTED, DOUBTFUL, NOT_TO_BE_TRUSTED, or
    NOT_JUDGED.

    Attributes
    ----------
    word : str
        TRUSTED, DOUBTFUL, NOT_TO_BE_TRUSTED or NOT_JUDGED.
    reasons : tuple of Reason
        The weightiest first.
    untested : tuple of Untested
        Parts that could not be tested, and why; first those on which most of the solution depends.
    bounds : tuple of SetUpBound
        Smallest errors of the set-up that this recording would have shown.
    """

    word: str
    reasons: tuple[Reason, ...] = ()
    untested: tuple[Untested, ...] = ()
    bounds: tuple[SetUpBound, ...] = ()

    @classmethod
    def of(
        cls,
        reasons: Iterable[Reason],
        untested: Iterable[Untested] = (),
        symptoms: Iterable[Reason] = (),
        bounds: Iterable[SetUpBound] = (),
    ) -> Verdict:
        """The verdict that these reasons come to. Symptoms, which may have several causes, stand
        behind reasons that have one."""
        ordered = tuple(
            reason._replace(weight=float(min(reason.weight, HEAVIEST)))
            for group in (reasons, symptoms)
            for reason in rank_reasons(group)
        )
        # a cause that shows in several places is one cause
        heaviest: dict[str, float] = {}
        for reason in ordered:
            if reason.weight >= 1.0:
                heaviest[reason.cause] = max(reason.weight, heaviest.get(reason.cause, 0.0))
        total = sum(heaviest.values())
        word = NOT_TO_BE_TRUSTED if total >= GRAVE else DOUBTFUL if total else TRUSTED
        first = sorted(untested, key=lambda each: -len(each.rests))
        return cls(word, ordered, tuple(first), tuple(bounds))

    @property
    def trusted(self) -> bool:
        """True where nothing speaks against the result."""
        return self.word == TRUSTED

    @property
    def vouched(self) -> tuple[str, ...]:
        """Those of QUANTITIES that it vouches for: none unless it is `trusted`, and none that rest on
        what was not tested."""
        rests = {quantity for each in self.untested for quantity in each.rests}
        return tuple(each for each in QUANTITIES if self.trusted and each not in rests)

    @property
    def line(self) -> str:
        """The verdict in one line, with its first reason."""
        if self.reasons and self.word in (DOUBTFUL, NOT_TO_BE_TRUSTED):
            return f"{self.word}: {self.reasons[0]}"
        if not self.untested:
            return self.word
        told = [each.seen if self.word == NOT_JUDGED else each.what for each in self.untested]
        return f"{self.word}; not tested: {', '.join(told)}"

    @property
    def lines(self) -> list[str]:
        """The verdict in lines for people: all reasons, remarks that are no reason to doubt, what could
        not be tested, what smaller errors would not have shown."""
        against = [reason for reason in self.reasons if reason.weight >= 1.0]
        remarks = [reason for reason in self.reasons if reason.weight < 1.0]
        return [
            self.word,
            *(f"  {number}. {reason}" for number, reason in enumerate(against, 1)),
            *(f"  remark: {reason}" for reason in remarks),
            *(f"  not tested: {each.line}" for each in self.untested),
            *([f"  smaller errors would not show: {self.bounds_line}"] if self.bounds else []),
        ]

    @property
    def bounds_line(self) -> str:
        """The bounds in one line."""
        return ", ".join(map(str, self.bounds))

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def __repr__(self) -> str:
        return f"Verdict({self.line})"

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def as_dict(self) -> dict[str, Any]:
        """As plain values, for files."""
        return {
            "word": self.word,
            "reasons": [reason._asdict() for reason in self.reasons],
            "untested": [each._asdict() for each in self.untested],
            "bounds": [each._asdict() for each in self.bounds],
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Verdict:
        """From what `as_dict` gave. Raises ValueError where it is something else."""
        if values["word"] not in SEVERITY:
            raise ValueError(f"the verdict {values['word']!r} is none of {', '.join(SEVERITY)}")
        reasons = tuple(Reason(**reason) for reason in values["reasons"])
        untested = tuple(
            Untested(**{**each, "rests": tuple(each["rests"])}) for each in values["untested"]
        )
        bounds = tuple(SetUpBound(**each) for each in values["bounds"])
        return cls(values["word"], reasons, untested, bounds)


def together(verdicts: Mapping[str, Verdict]) -> list[tuple[list[str], Verdict]]:
    """[(names, Verdict)] of the {name: Verdict} that have the same word and the same first cause,
    the gravest first.

    The Verdict of several has every reason once, as the result says it that has it weightiest.
    """
    alike: dict[tuple[str, ...], list[str]] = {}
    for name, verdict in verdicts.items():
        first = [(reason.cause, reason.source) for reason in verdict.reasons[:1]]
        alike.setdefault((verdict.word, *(first[0] if first else ())), []).append(name)
    groups = [
        (names, _merge_verdicts([verdicts[name] for name in names])) for names in alike.values()
    ]
    return sorted(groups, key=lambda group: SEVERITY.index(group[1].word))


def _merge_verdicts(verdicts: list[Verdict]) -> Verdict:
    heaviest: dict[tuple[str, str], Reason] = {}
    # of one result the first of a cause, since causes stand before symptoms
    firsts = (
        {(each.cause, each.source): each for each in reversed(verdict.reasons)}
        for verdict in verdicts
    )
    for reason in (each for first in firsts for each in reversed(first.values())):
        known_reason = heaviest.setdefault((reason.cause, reason.source), reason)
        if reason.weight > known_reason.weight:
            heaviest[reason.cause, reason.source] = reason
    ranked = list(heaviest.values())  # causes before symptoms, as each has them
    untested = dict.fromkeys(each for verdict in verdicts for each in verdict.untested)
    bounds: dict[tuple[str, str], SetUpBound] = {}
    for each in (bound for verdict in verdicts for bound in verdict.bounds):
        known = bounds.setdefault((each.what, each.component), each)
        if each.size > known.size:
            bounds[each.what, each.component] = each
    return Verdict(verdicts[0].word, tuple(ranked), tuple(untested), tuple(bounds.values()))
