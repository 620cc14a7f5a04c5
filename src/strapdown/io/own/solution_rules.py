"""What a solution says in words: meta, sources, gates, events and verdict."""

from typing import Annotated, Any, Literal

from pydantic import Field

from ...verdict import SEVERITY
from .text_rules import Finite, Line, Moment, Name, Only, Said

Sources = list[Name]
Gates = list[Annotated[float, Field(gt=0)] | None]
Event = Annotated[list[float | Line], Field(min_length=2, max_length=2)]
Events = list[Event]


class StartRules(Said):
    """Where a filter began."""

    t: Finite
    sd: list[float]
    lla: list[float] = []
    v: list[float] = []
    rph: list[float] = []
    note: Line = ""


class RejectedRules(Only):
    """A run of rejected fixes."""

    source: Name
    start: Finite
    stop: Finite
    number: Annotated[int, Field(ge=0)]
    of: Annotated[int, Field(ge=0)]
    cause: Name
    seen: Line
    remedy: Line


class SolutionMeta(Said):
    """`Solution.meta`, as far as the library asks for it."""

    filter: Line = ""
    recording: Line = ""
    epoch: Moment | None = None
    date: Name | None = None
    notes: list[Line] = []
    read: list[Line] = []
    imu: Line = ""
    vehicle: Name | None = None
    start: StartRules | None = None
    noise: dict[Name, float] | None = None
    kinds: dict[Name, Name] = {}
    bias_sd: list[float] | None = None
    fixes_outside: int = 0
    point: Name = "imu"
    withheld: list[Annotated[list[float], Field(min_length=2, max_length=2)]] = []
    installation: dict[str, Any] | None = None
    rejected: list[RejectedRules] = []


class ReasonRules(Only):
    """A reason of a verdict."""

    cause: Name
    seen: Line
    remedy: Line
    source: Name = ""
    weight: Annotated[float, Field(ge=0)] = 1.0


class VerdictRules(Said):
    """A verdict, as `Verdict.as_dict` gives it."""

    word: Literal[SEVERITY]  # type: ignore[valid-type]  # a tuple of texts
    reasons: list[ReasonRules]
    untested: list[Line]
    rows: Annotated[int, Field(ge=0)] | None = None  # of the table, in a CSV
