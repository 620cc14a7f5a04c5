"""Rules for text, attributes and JSON of our own files as pydantic models: those of a recording in
NetCDF, those of a solution, and common ones."""

import json
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from ...checks import DataError
from ...data.verdict import QUANTITIES, SEVERITY
from ...fileio.checksum import DAMAGED
from ...units.time_scales import gps_of

Model = TypeVar("Model")


def _known_moment(text: str) -> str:
    gps_of(text)
    return text


Name = Annotated[str, Field(max_length=1000)]
Line = Annotated[str, Field(max_length=100_000)]
Moment = Annotated[str, AfterValidator(_known_moment)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Deviation = Annotated[float, Field(ge=0)]


class SaidRules(BaseModel):
    """Attributes of a file. Unknown keys are kept, because a later version or a user may have added
    them."""

    model_config = ConfigDict(extra="allow", strict=True)


class Only(BaseModel):
    """Attributes of a file, where unknown keys are an error."""

    model_config = ConfigDict(extra="forbid", strict=True)


def from_json(text: Any, where: object) -> Any:
    """Return the values of a JSON text. Raises DataError that begins with `where`."""
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        said = str(error).splitlines()[0][:80]
        raise DataError(f"{where}: is not JSON ({said}); {DAMAGED}") from None


def check_values(model: Any, values: Any, where: object) -> Any:
    """Refuse values that do not fit a model or type; return them unchanged. Raises DataError with
    the first error message, which begins with `where`."""
    try:
        TypeAdapter(model).validate_python(values, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))[:80]
        said = " ".join(first["msg"].removeprefix("Value error, ").split())
        raise DataError(
            f"{where}: {place and place + ': '}{said[0].lower()}{said[1:160]}; {DAMAGED}"
        ) from None
    return values


# ---- recordings


class SourceAttributes(SaidRules):
    """Attributes of the group of a source."""

    kind: Name
    name: Name
    gate: Annotated[float, Field(gt=0)] | None = None
    parameters: list[Finite] = []
    estimate: dict[Name, list[Deviation]] = {}
    slip: Annotated[Finite, Field(ge=0)] = 0.0
    correlated_std: list[Deviation] = []
    correlation_time: Annotated[Finite, Field(gt=0)] = 1.0
    correlated_states: bool = True
    robust: bool = False
    adaptive: Annotated[Finite, Field(ge=0)] = 0.0
    receiver: Name | None = None


class RecordingMetaRules(SaidRules):
    """The keys of `Recording.meta` that the library uses."""

    name: Line = ""
    epoch: Moment | None = None
    date: Name | None = None
    grade: Name | dict[str, Any] | None = None
    notes: list[Line] = []
    read: list[Line] = []
    place: Triple | None = None
    vehicle: Name | dict[str, Any] | None = None
    imu_lever_arm: Triple = [0.0, 0.0, 0.0]
    imu_mounting: Triple = [0.0, 0.0, 0.0]
    guessed_axes: Name | None = None
    undecided_gyro: Line | None = None
    point: Name = "imu"
    estimate: dict[Name, list[Deviation]] | None = None
    sensors: dict[str, Any] = {}
    height_columns: dict[Name, Name] = {}


# ---- solutions

Sources = list[Name]
Gates = list[Annotated[float, Field(gt=0)] | None]
Event = Annotated[list[float | Line], Field(min_length=2, max_length=2)]
Events = list[Event]


class StartRules(SaidRules):
    """Where a filter began."""

    t: Finite
    std: list[float]
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


class SolutionMetaRules(SaidRules):
    """The keys of `Solution.meta` that the library uses."""

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
    bias_std: list[float] | None = None
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


class UntestedRules(Only):
    """A thing that a verdict could not test."""

    what: Line
    why: Line
    remedy: Line = ""
    rests: list[Literal[QUANTITIES]] = []  # type: ignore[valid-type]  # a tuple of texts
    cause: Name = ""


class BoundRules(Only):
    """An error that a recording would have shown."""

    cause: Name
    what: Line
    size: Annotated[float, Field(ge=0)]
    unit: Name
    component: Name = ""


class VerdictRules(SaidRules):
    """A verdict, as `Verdict.as_dict` gives it."""

    word: Literal[SEVERITY]  # type: ignore[valid-type]  # a tuple of texts
    reasons: list[ReasonRules]
    untested: list[UntestedRules]
    bounds: list[BoundRules]
    rows: Annotated[int, Field(ge=0)] | None = None  # of the table, in a CSV
