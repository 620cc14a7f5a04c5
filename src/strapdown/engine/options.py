"""The options of a run, declared once: their types, their defaults and what they mean, for all
functions that run a filter."""

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import wraps
from inspect import Parameter, getdoc, signature
from textwrap import wrap
from typing import (
    Any,
    Final,
    NamedTuple,
    TypedDict,
    TypeVar,
    Unpack,
    cast,
    get_type_hints,
)

from ..checks import DataError, check_flag, check_number
from ..core.loop.contract import Filter, InitialState, Noise
from ..data.vehicle import GivenVehicle
from ..sensor_models.imu import GivenImu
from ..typing import Notify
from .installation import Estimate
from .source_weights import Adaptive, Robust

AHRS_RATE = 10.0
"""Default rate of the attitude of an AHRS, Hz."""
Call = TypeVar("Call", bound=Callable[..., Any])


class SetUpOptions(TypedDict, total=False):
    """The options of every function that runs a filter over a recording."""

    imu: GivenImu | None
    start: InitialState | None
    vehicle: GivenVehicle | None
    notify: Notify | None


class SourceOptions(SetUpOptions, total=False):
    """`SetUpOptions`, and the options that model the sources and the IMU."""

    noise: Noise | None
    estimate: Estimate | None
    robust: Robust | None
    adaptive: Adaptive | None
    ahrs: str | Filter | None


class RunOptions(SourceOptions, total=False):
    """The options of one run of one filter: `SourceOptions`, and the choice of kept results."""

    options: dict[str, Any] | None
    ahrs_rate: float
    every: int
    covariance: bool


class Option(NamedTuple):
    """An option of a run."""

    default: Any
    type: str  # as in the documentation
    meaning: str


OPTIONS: Final[dict[str, Option]] = {
    "imu": Option(
        None,
        "str, path, dict or ImuSpec",
        "Grade, file or description of the IMU; default: what the recording names.",
    ),
    "start": Option(
        None,
        "InitialState",
        "Initial position, velocity, attitude and biases, with their standard deviations; "
        "default: by alignment. `align` finds the parts that you leave out. Fixes at its time "
        "are part of it and are not used again.",
    ),
    "vehicle": Option(
        None,
        "str or Vehicle",
        "Vehicle whose limits the filter applies: it rejects fixes and samples beyond them; "
        "default: that of the recording, else any.",
    ),
    "notify": Option(
        None, "callable", "Function called with a line of text during steps that take seconds."
    ),
    "noise": Option(None, "Noise", "Noise densities that replace those of the IMU."),
    "estimate": Option(
        None,
        "str, list or dict",
        "Parameters of the installation that become states, such as "
        "['clock', 'lever-arm'], or {name: prior standard deviation}; default: what the recording "
        "names, else scale and misalignment of the IMU where its grade states them; [] for none.",
    ),
    "robust": Option(
        None,
        "bool, str or list",
        "Sources whose fixes have a heavy-tailed likelihood instead of a gate: True for all, or "
        "names or kinds; default: as the sources state.",
    ),
    "adaptive": Option(
        None,
        "float or dict",
        "Memory in s of the adaptive noise of sources: one for all, or {name or kind: s}; "
        "default: as the sources state.",
    ),
    "ahrs": Option(
        None,
        "str or Filter",
        "Attitude filter that runs first and provides the `attitude` source; default: "
        "attitude-mekf if the filter needs an attitude, the recording has none and one of its "
        "sources measures the heading.",
    ),
    "options": Option(None, "dict", "Options that belong to this filter, {name: value}."),
    "ahrs_rate": Option(AHRS_RATE, "float", "Output rate of the AHRS in Hz."),
    "every": Option(1, "int", "Keep every n-th row of the solution, and always the last one."),
    "covariance": Option(False, "bool", "Also keep the full covariance of these rows."),
}
"""Defaults and meanings by name, in the order of signatures."""


def run_options(**given: Unpack[RunOptions]) -> RunOptions:
    """Return all options of a run: those `given`, and the defaults of the others. Raises
    DataError."""
    asked = cast(RunOptions, {name: option.default for name, option in OPTIONS.items()} | given)
    check_number(asked["every"], "every", least=1, most=1e9, whole=True)
    check_flag(asked["covariance"], "covariance")
    own = asked["options"]
    if own is not None and not isinstance(own, Mapping):
        raise DataError(f"options is {own!r}; it must be a table of the filter's own options")
    asked["options"] = dict(own or {})
    return asked


def takes(record: type, options: Mapping[str, Option] = OPTIONS) -> Callable[[Call], Call]:
    """Return a decorator for a function, or the constructor of a class, whose last parameter is
    `**given: Unpack[record]`. It adds the options of `record`, a TypedDict, to signature and
    documentation, and refuses other options."""
    types = get_type_hints(record)
    table = {name: options[name] for name in options if name in types}
    shared = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=option.default, annotation=types[name])
        for name, option in table.items()
    ]

    def decorate(call: Call) -> Call:
        if isinstance(call, type):
            call.__init__ = _with_option_check(call.__init__, call.__name__, table, shared)  # type: ignore[misc]
            call.__doc__ = _option_doc(call, table)
            return call
        return cast(Call, _with_option_check(call, call.__name__, table, shared))

    return decorate


def _with_option_check(
    call: Callable[..., Any], name: str, table: Mapping[str, Option], shared: list[Parameter]
) -> Callable[..., Any]:
    """Return the function with a check that refuses unknown options."""
    own = list(signature(call).parameters.values())[:-1]
    known = {each.name for each in own} | set(table)

    @wraps(call)
    def call_checked(*args: Any, **given: Any) -> Any:
        if not given.keys() <= known:
            raise DataError(
                _unknown_option(name, next(each for each in given if each not in known), known)
            )
        return call(*args, **given)

    call_checked.__signature__ = signature(call).replace(parameters=[*own, *shared])  # type: ignore[attr-defined]
    if call.__name__ != "__init__":  # a class documents them itself
        call_checked.__doc__ = _option_doc(call, table)
    return call_checked


def _unknown_option(name: str, option: str, known: set[str]) -> str:
    if near := get_close_matches(option, known, 1, cutoff=0.8):
        return f"{name} has no option {option!r}; did you mean {near[0]!r}?"
    if "options" in known:
        remedy = f"one of the filter's own is given as options={{{option!r}: ...}}"
    else:
        remedy = f"there are: {', '.join(sorted(known - {'self'}))}"
    return f"{name} has no option {option!r}; {remedy}"


def _option_doc(what: object, table: Mapping[str, Option]) -> str:
    """Return the documentation of a function or class, followed by that of its options."""
    text, *rest = (getdoc(what) or "").partition("\nRaises\n")
    lines = [text.rstrip(), "", "Other Parameters", "----------------"]
    for name, option in table.items():
        given = "optional" if option.default is None else f"default {option.default!r}"
        lines.append(f"{name} : {option.type}, {given}")
        lines += wrap(option.meaning, 88, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines) + ("\n" + "".join(rest) if rest[0] else "")
