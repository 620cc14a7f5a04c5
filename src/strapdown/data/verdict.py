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
    "odometer scale": "scale of the odometer",
    "fix noise": "standard deviations",
    "lasting errors": "lasting errors",
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


class Reason(NamedTuple):
    """Something that should not be so in a right set-up."""

    cause: str  # the probable one, a key of CAUSES
    # what was seen, with its number and unit, and what was expected: one clause, no full stop
    seen: str
    remedy: str  # what to change or to run next: one clause in the imperative
    source: str = ""  # name of the source of fixes concerned; empty: the IMU, or no single one
    weight: float = 1.0  # what was seen over what a right set-up shows at most

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


@dataclass(frozen=True)
class Verdict:
    """The verdict on a result: `word` is one of TRUSTED, DOUBTFUL, NOT_TO_BE_TRUSTED, or
    NOT_JUDGED."""

    word: str
    reasons: tuple[Reason, ...] = ()  # the weightiest first
    untested: tuple[str, ...] = ()  # what could not be tested, and why

    @classmethod
    def of(
        cls,
        reasons: Iterable[Reason],
        untested: Iterable[str] = (),
        symptoms: Iterable[Reason] = (),
    ) -> Verdict:
        """The verdict that these reasons come to. Symptoms, which may have several causes, stand
        behind reasons that have one."""
        ranked = tuple(
            reason._replace(weight=float(min(reason.weight, HEAVIEST)))
            for group in (reasons, symptoms)
            for reason in sorted(group, key=lambda reason: -reason.weight)
        )
        # a cause that shows in several places is one cause
        heaviest: dict[str, float] = {}
        for reason in ranked:
            if reason.weight >= 1.0:
                heaviest[reason.cause] = max(reason.weight, heaviest.get(reason.cause, 0.0))
        total = sum(heaviest.values())
        word = NOT_TO_BE_TRUSTED if total >= GRAVE else DOUBTFUL if total else TRUSTED
        return cls(word, ranked, tuple(untested))

    @property
    def trusted(self) -> bool:
        """True where nothing speaks against the result."""
        return self.word == TRUSTED

    @property
    def line(self) -> str:
        """The verdict in one line, with its first reason."""
        if self.reasons and self.word in (DOUBTFUL, NOT_TO_BE_TRUSTED):
            return f"{self.word}: {self.reasons[0]}"
        return (
            f"{self.word}; not tested: {', '.join(self.untested)}" if self.untested else self.word
        )

    @property
    def lines(self) -> list[str]:
        """The verdict in lines for people: all reasons, what could not be tested."""
        return [
            self.word,
            *(f"  {number}. {reason}" for number, reason in enumerate(self.reasons, 1)),
            *(f"  not tested: {text}" for text in self.untested),
        ]

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
            "untested": list(self.untested),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Verdict:
        """From what `as_dict` gave. Raises ValueError where it is something else."""
        if values["word"] not in SEVERITY:
            raise ValueError(f"the verdict {values['word']!r} is none of {', '.join(SEVERITY)}")
        reasons = tuple(Reason(**reason) for reason in values["reasons"])
        return cls(values["word"], reasons, tuple(values["untested"]))


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
        known = heaviest.setdefault((reason.cause, reason.source), reason)
        if reason.weight > known.weight:
            heaviest[reason.cause, reason.source] = reason
    ranked = list(heaviest.values())  # causes before symptoms, as each has them
    untested = dict.fromkeys(text for verdict in verdicts for text in verdict.untested)
    return Verdict(verdicts[0].word, tuple(ranked), tuple(untested))
