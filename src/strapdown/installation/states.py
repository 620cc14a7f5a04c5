"""Parameters of the installation that were states of a finished Solution's filter: each in the
terms of recording.toml, found, consistent with the given value or not observable, and the reasons
to doubt it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import DataError, brief
from ..core.mathematics.rotation import matrix_to_euler
from ..data import calibration_parameters
from ..data.calibration_parameters import (
    CLOCK,
    KNOWN,
    LEVER_ARM,
    MOUNTING,
    SCALE,
    CalibrationParameter,
)
from ..data.operations import operation
from ..data.solution import GNSS, Solution
from ..data.value import Value
from ..data.verdict import Reason
from ..preprocessing.axes import rotation_matrix
from ..typing import Array
from ..units.constants import REST_SPEED
from .findings import CONSISTENT, FOUND, MIN_Z, NOT_OBSERVABLE, Estimate
from .iteration import NOTABLE
from .model import CONSTRAINED, SHOWN_BY, rotation

TIGHT = 0.1
"""Default prior std; a posterior this tight carries as much information as the data."""
PLAUSIBLE = 3.0
"""Prior standard deviations from which the data contradict the prior: one right prior in 370 does."""
ALIKE = 0.95
"""Correlation from which two parameters cannot be told apart."""
OF_BODY = ("attitude", "magnetic-field", "gravity")
"""Kinds of measurement in the axes of the IMU, also where its mounting is a state."""


@dataclass(frozen=True)
class EstimatedParameter(Estimate):
    """A parameter of the installation by the last estimate of a filter with states for it. The
    change is the state: of a mounting about the axis of the vehicle; of a scale the share by which
    the odometer reads too much."""

    value: float  # what belongs there; of a scale what the scale in recording.toml is to be times
    prior: float  # standard deviation of the change before
    column: str  # of the solution's: the change over time

    @property
    def parameter(self) -> str:
        """Its name in `calibration_parameters`: "clock"."""
        return self.of.name

    @property
    def component(self) -> str:
        """Such as "forward"; "" of the only one."""
        return self.of.components[self.axis]

    @property
    def std_column(self) -> str:
        """That of its standard deviation."""
        return f"std of {self.column}"

    @property
    def advice(self) -> str:
        """The remedy where it is not observable; no motion helps where the prior is tight."""
        if self.motion:
            return f"to show it, {self.motion}"
        return "the prior is as tight as the data"

    @property
    def told(self) -> str:
        """Its status, with the numbers that belong to it."""
        if self.status == NOT_OBSERVABLE:
            known = f"std {_size(self.std, self.unit)}, prior {_size(self.prior, self.unit)}"
            return f"not observable ({known}); {self.advice}"
        if self.status == CONSISTENT:
            return super().told
        if self.of is SCALE:
            many = "much" if self.change > 0 else "little"
            return (
                f"found: it reads {100 * abs(self.change):.1f} % too {many}, a difference of "
                f"{self.seen} from the given value; multiply its scale by {self.value:.4f}"
            )
        new = f": {self.value:.3f} {self.unit}" if self.of in (LEVER_ARM, MOUNTING) else ""
        return f"found{new}, {self.seen} from the given value"


@dataclass(frozen=True, eq=False)
class EstimatedInstallation(Value):
    """Result of `installation`.

    Attributes
    ----------
    parameters : tuple of EstimatedParameter
        Each parameter as given and as the run ended with it.
    reasons : tuple of Reason
        Reasons to doubt them; the verdict has them too.
    remarks : tuple of str
        Inseparable parameters, parameters that no motion shows, and assumptions.
    of_reference : str
        The remark on the time stamps of the reference, where there is one.
    """

    parameters: tuple[EstimatedParameter, ...]
    reasons: tuple[Reason, ...]
    remarks: tuple[str, ...]
    of_reference: str = ""

    @property
    def lines(self) -> list[str]:
        """For people: every parameter, then what must be known beside."""
        return [*map(str, self.parameters), *map(str, self.reasons), *self.remarks]

    @property
    def told(self) -> list[str]:
        """The same without the reasons, for whoever shows the verdict too."""
        return [*map(str, self.parameters), *self.remarks]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def _repr_html_(self) -> str:
        return str(operation("card")(self))


def estimated_installation(solution: Solution) -> EstimatedInstallation:
    """Return the final estimates of the parameters that were states (`estimate`) in a Solution of
    `fuse`, `smooth` or a Stream; empty where none was. Raises DataError."""
    if not isinstance(solution, Solution):
        raise DataError(
            f"solution is {brief(solution)}; it must be a Solution, as fuse, smooth and "
            "read_solution return it"
        )
    known: dict[str, Any] = solution.meta.get("installation", {"parameters": [], "correlation": []})
    values = _values(solution, known["parameters"])
    parameters = tuple(
        _parameter(solution, facts, value) for facts, value in zip(known["parameters"], values)
    )
    remarks = [
        *_correlated_pairs(parameters, np.array(known["correlation"])),
        *_why_nothing(solution, parameters),
        *_trusted_facts(solution, parameters, known["parameters"]),
    ]
    stamps = _of_reference(solution, parameters)
    remarks += [stamps] if stamps else []
    reasons = [reason for each in parameters for reason in _doubts(each)]
    return EstimatedInstallation(parameters, tuple(reasons), tuple(remarks), stamps)


def _values(solution: Solution, known: list[dict[str, Any]]) -> list[float]:
    """Return the values for recording.toml, SI: the given one plus the error; for a mounting the
    angles of the IMU rotated by all its errors, for a scale 1 / (1 + error)."""
    turn = np.zeros(3)
    errors = [_last(solution, facts) for facts in known]
    for facts, error in zip(known, errors):
        if facts["name"] == "mounting":
            turn[facts["component"]] = error
    C = rotation_matrix(*solution.meta["installation"]["mounting"]) if known else np.eye(3)
    angles = matrix_to_euler(rotation(turn) @ C)

    def value(facts: dict[str, Any], error: float) -> float:
        if facts["name"] == "mounting":
            return float(angles[facts["component"]])
        return 1 / (1 + error) if facts["name"] == "scale" else facts["given"] + error

    return [value(facts, error) for facts, error in zip(known, errors)]


def _last(solution: Solution, facts: dict[str, Any], prefix: str = "") -> float:
    """Return the last estimate of the error, or with "std of " its standard deviation, SI."""
    return float(solution.columns[prefix + facts["column"]][-1]) / _of(facts).factor


def _of(facts: dict[str, Any]) -> CalibrationParameter:
    return (calibration_parameters.OF_IMU if facts["of_imu"] else calibration_parameters.OF_SOURCE)[
        facts["name"]
    ]


def _parameter(solution: Solution, facts: dict[str, Any], value: float) -> EstimatedParameter:
    of, axis, sources = _of(facts), facts["component"], tuple(facts["sources"])
    change, std = (_last(solution, facts, prefix) for prefix in ("", "std of "))
    status = CONSISTENT
    if not std < KNOWN * facts["prior"]:
        status = NOT_OBSERVABLE
    elif abs(change) > max(MIN_Z * std, of.min_reported):
        status = FOUND
    name = of.component(axis)
    return EstimatedParameter(
        of,
        axis,
        name if facts["of_imu"] else f"{name} of {' and '.join(sources)}",
        sources,
        status,
        facts["given"] * of.factor,
        change * of.factor,
        std * of.factor,
        "" if facts["prior"] <= TIGHT * max(of.std) else _motion(solution, of, axis),
        value * of.factor,
        facts["prior"] * of.factor,
        facts["column"],
    )


def _motion(solution: Solution, of: CalibrationParameter, axis: int) -> str:
    """Return the motion or the constraint that would show the parameter."""
    kinds = set(solution.meta["kinds"].values())
    if of is MOUNTING and axis in SHOWN_BY and SHOWN_BY[axis] not in kinds:
        return f"on a road vehicle, add the constraint {SHOWN_BY[axis]}"
    return of.motions[axis]


def _doubts(each: EstimatedParameter) -> Iterator[Reason]:
    """Why an estimate, or its prior, cannot be right."""
    source = each.sources[0] if len(each.sources) == 1 and " of " in each.name else ""
    size, most = abs(each.change), each.of.most * each.of.factor
    if size > most:
        yield Reason(
            each.cause,
            f"the estimate of {each.name} differs by {each.seen} from the given value, and at "
            f"most {_size(most, each.unit)} is plausible",
            "find the cause, such as a wrong unit, and correct the given value before you "
            "estimate it",
            source,
            3.0 * size / most,
        )
    elif each.status != NOT_OBSERVABLE and size > PLAUSIBLE * each.prior:
        yield Reason(
            each.cause,
            f"the estimate of {each.name} differs by {each.seen} from the given value, and its "
            f"prior is {_size(each.prior, each.unit)}: the prior contradicts the data",
            f"correct the given value, or set a prior of {_size(size, each.unit)} or more",
            source,
            size / each.prior / PLAUSIBLE,
        )


def _correlated_pairs(
    parameters: tuple[EstimatedParameter, ...], correlation: Array
) -> Iterator[str]:
    """Pairs that the data cannot tell apart."""
    for i, a in enumerate(parameters):
        for j in range(i + 1, len(parameters)):
            b, r = parameters[j], float(correlation[i, j])
            if abs(r) > ALIKE:
                unseen = [each for each in (a, b) if each.status == NOT_OBSERVABLE] or (a, b)
                shows = [each.motion for each in unseen if each.motion]
                yield (
                    f"the data cannot separate {a.name} and {b.name} (correlation {r:+.3f}): "
                    + ", or ".join(
                        ["estimate one of them", " and ".join(dict.fromkeys(shows))][
                            : 1 + bool(shows)
                        ]
                    )
                )


def _why_nothing(solution: Solution, parameters: tuple[EstimatedParameter, ...]) -> Iterator[str]:
    """Why nothing of them can be seen, where it is so."""
    if not parameters or any(
        each.status != NOT_OBSERVABLE or not each.motion for each in parameters
    ):
        return
    kinds = set(solution.meta["kinds"].values())
    why = "the motion does not show them"
    if not kinds & {*GNSS, *CONSTRAINED}:
        why = "the recording has no source of position or velocity"
    elif not in_motion(solution):
        why = f"the vehicle hardly moves, at most {REST_SPEED:g} m/s"
    elif not kinds & {"velocity", "speed"}:
        why = "the recording has no source of velocity; add one"
    yield f"none of the requested parameters of the installation is observable: {why}"


def _trusted_facts(
    solution: Solution,
    parameters: tuple[EstimatedParameter, ...],
    known: list[dict[str, Any]],
) -> Iterator[str]:
    """Yield the assumptions behind the estimates."""
    for each, facts in zip(parameters, known):
        if beside := facts.get("beside"):
            them = " and ".join(beside)
            yield (
                f"{each.name}: {them} of the same antenna {'are' if len(beside) > 1 else 'is'} "
                "assumed to have correct times; where one receiver stamps both, estimate the "
                "clocks of both"
            )
    kinds = solution.meta["kinds"].items()
    own = [name for name, kind in kinds if kind in OF_BODY]
    if own and any(each.of is MOUNTING for each in parameters):
        yield (
            f"the mounting is estimated with {' and '.join(own)} assumed to be in the IMU's own "
            "axes"
        )


def _of_reference(solution: Solution, parameters: tuple[EstimatedParameter, ...]) -> str:
    """Return the consequence of a clock offset for the reference; "" without one."""
    kinds = solution.meta["kinds"]
    for each in parameters:
        off = each.status != NOT_OBSERVABLE and abs(each.change) > NOTABLE * each.std
        positions = [name for name in each.sources if kinds.get(name) == "position"]
        if each.of is CLOCK and off and positions:
            if solution.meta["installation"].get("reference"):
                return (
                    "the reference keeps its time stamps: where it comes from the receiver of "
                    f"{positions[0]}, they are also off by {each.seen}, which makes errors "
                    "against it larger"
                )
    return ""


def _size(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip()


def in_motion(solution: Solution) -> bool:
    """Return True where a solution is ever faster than what hardly moves."""
    v = solution.trajectory.v_n
    if v is None:
        return False
    return bool((np.abs(v[:: max(1, len(v) // 2000), :2]) > REST_SPEED).any())
