"""Parameters of an installation as states of a filter: which ones are estimated, which sources
share them, and their indices after the augmented states of the sources."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from .. import aiding, filters
from ..checks import DataError, brief, check_choice, locate_errors
from ..core.compile.records import rows
from ..core.loop.contract import (
    POS,
    STATES,
    VEL,
    Filter,
    InitialState,
    SourceRow,
)
from ..core.mathematics.coupling import Coupling
from ..core.mathematics.error_dynamics import cross_matrix
from ..data import calibration_parameters
from ..data.calibration_parameters import (
    AXES,
    CLOCK,
    FIELD,
    LEVER_ARM,
    MOUNTING,
    SCALE,
    SOFT_IRON,
    CalibrationParameter,
)
from ..data.recording import Recording
from ..data.solution import SolutionMeta, Source
from ..preprocessing.axes import rotation_matrix
from ..preprocessing.lever_arm import lever_arm_of
from ..sensor_models.imu import ImuSpec
from ..typing import Array

IMU = "imu"
"""Name of the IMU in place of that of a source."""
WAIT, MAX_WAIT = 3.0, 1.0
"""A fix whose clock error is a state waits WAIT prior standard deviations, at most MAX_WAIT s, so
that its true time has passed for any probable offset."""

Prior: TypeAlias = float | Sequence[float] | None
Estimate: TypeAlias = str | Iterable[str] | Mapping[str, Prior]
"""Parameters to estimate: names, "clock" of all sources that have one, "position clock" of the
source of that name or kind, "imu gyro-scale", "imu scale" of both sensors; or {name: prior standard
deviation, SI, one or one per component}."""
OfImu: TypeAlias = Mapping[str, tuple[float, ...]]
"""{parameter of the IMU that is estimated: prior standard deviations}, as `Recording.meta` has it
under "estimate"."""


class StateParameter(NamedTuple):
    """A component of a parameter that is a state."""

    of: CalibrationParameter
    component: int
    sources: tuple[int, ...]  # indices of its sources; for the IMU, of all that observe it
    std: float  # prior, SI
    owner: str  # name of the first source, or "imu"

    @property
    def name(self) -> str:
        """Name of its column in a Solution: the error true - given, with its unit."""
        unit = f" [{self.of.unit}]" if self.of.unit else ""
        return f"{self.of.component(self.component)} error of {self.owner}{unit}"


def with_estimates(recording: Recording, estimate: Estimate | None) -> Recording:
    """Return the recording with the parameters to estimate set at its sources and its IMU, in place
    of its own; unchanged for None. Raises DataError."""
    if estimate is None:
        return recording
    sources, of_imu = asked_of(recording.sources, estimate)
    asked = replace(recording, sources=sources).without_meta("estimate")
    # a request for sources leaves the IMU's parameters to its grade
    return asked.with_meta(estimate=of_imu) if of_imu or not estimate else asked


def of_grade(filter: Filter, spec: ImuSpec | None) -> tuple[OfImu, list[str]]:
    """Return the scale and misalignment errors that the grade of an IMU states, as states, and
    notes on them. Used where no parameter of the IMU was requested or excluded: a filter without
    them is overconfident."""
    axes = {} if spec is None else spec.axes_std()
    if not axes:
        return {}, []
    stated = ", ".join(name.replace("-", " ") for name in axes)
    if not filter.installation:
        return {}, [
            f"{filter.name} does not model {stated} of the IMU: errors of biases and attitude exceed "
            "their claimed std"
        ]
    return axes, [
        f"{stated} of the IMU are states, with the std of its grade; estimate=[] leaves them out"
    ]


def without_estimates(sources: Iterable[Source]) -> tuple[Source, ...]:
    """These sources with nothing to estimate."""
    return tuple(replace(a, estimate={}) for a in sources)


def asked_of(sources: Iterable[Source], estimate: Estimate) -> tuple[tuple[Source, ...], OfImu]:
    """(sources with their parameters to estimate, those of the IMU). Raises DataError."""
    marked = list(without_estimates(sources))
    of_imu: dict[str, tuple[float, ...]] = {}
    known = dict.fromkeys([*calibration_parameters.OF_SOURCE, *calibration_parameters.ASKED_OF_IMU])
    for words, std in _requested_priors(estimate).items():
        *owner, name = words.split()
        check_choice(name, "estimate", known)
        whose = " ".join(owner)
        of_it = whose.lower() == IMU
        if name not in calibration_parameters.OF_SOURCE and whose and not of_it:
            raise DataError(f"estimate: {name} belongs to the IMU, not to {whose!r}")
        if name not in calibration_parameters.OF_SOURCE or (
            of_it and name in calibration_parameters.ASKED_OF_IMU
        ):
            of_imu |= {
                what.name: _prior(what, std) for what in calibration_parameters.ASKED_OF_IMU[name]
            }
            continue
        prior = _prior(calibration_parameters.OF_SOURCE[name], std)
        for i in _asked_at(marked, name, whose):
            marked[i] = replace(marked[i], estimate={**marked[i].estimate, name: prior})
    return tuple(marked), of_imu


def _asked_at(sources: Sequence[Source], name: str, whose: str) -> list[int]:
    """Return the sources that have the parameter `name`: all, or those with the name `whose`, or
    without any, those of that kind; case does not matter. Raises DataError."""
    having = [
        i for i, a in enumerate(sources) if name in aiding.find(a.kind).calibration_parameters
    ]
    if not having:
        raise DataError(f"estimate: no source of the recording has a {name} to estimate")
    if not whose:
        return having
    named = [i for i in having if (sources[i].name or "").lower() == whose.lower()]
    found = named or [i for i in having if sources[i].kind == whose.lower()]
    if not found:
        names = ", ".join(sources[i].name or sources[i].kind for i in having)
        raise DataError(f"estimate: {whose} has no {name} to estimate; these have: {names}")
    return found


def _requested_priors(estimate: Estimate) -> dict[str, Prior]:
    """Return {name, possibly with its owner: prior or None}. Raises DataError."""
    if isinstance(estimate, str):
        estimate = [part.strip() for part in estimate.split(",")]
    try:
        names: list[Any] = list(estimate)
    except TypeError:
        names = [None]
    if not all(isinstance(name, str) and name.split() for name in names):
        raise DataError(
            f"estimate is {brief(estimate)}; it must be names, such as ['clock', 'lever-arm']"
        )
    return dict(estimate) if isinstance(estimate, Mapping) else dict.fromkeys(names)


def _prior(what: CalibrationParameter, std: Prior) -> tuple[float, ...]:
    with locate_errors("estimate"):
        return calibration_parameters.prior(what, std)


def parameters(
    sources: Sequence[Source], of_imu: Mapping[str, tuple[float, ...]]
) -> list[StateParameter]:
    """Return the parameters that are states, in order. Sources of position and velocity with the
    same lever arm are one antenna and share the states that both request."""
    found: list[StateParameter] = []
    for name, what in calibration_parameters.OF_SOURCE.items():
        done: set[int] = set()
        if not what.place:  # a state of its sources
            continue
        for i, a in enumerate(sources):
            if name not in a.estimate or i in done:
                continue
            together = [
                j
                for j, other in enumerate(sources)
                if j == i or (name in other.estimate and _same_antenna(a, other))
            ]
            done |= set(together)
            found += _components(what, a.estimate[name], tuple(together), a.name or a.kind)
    for name, what in calibration_parameters.OF_IMU.items():
        if name in of_imu:
            seeing = tuple(
                i
                for i, a in enumerate(sources)
                if name in aiding.find(a.kind).calibration_parameters
            )
            found += _components(what, of_imu[name], seeing, IMU)
    return found


def _components(
    what: CalibrationParameter, std: Sequence[float], sources: tuple[int, ...], owner: str
) -> list[StateParameter]:
    return [
        StateParameter(what, k, sources, value, owner) for k, value in enumerate(std) if value > 0
    ]


def _same_antenna(a: Source, b: Source) -> bool:
    gnss = ("position", "velocity")
    return a.kind in gnss and b.kind in gnss and tuple(a.parameters) == tuple(b.parameters)


def parameter_meta(recording: Recording, P: Array) -> SolutionMeta:
    """Return the metadata of the parameters that were states, as plain values: each as given and
    its prior, SI, and their correlations by the last covariance P. {} without any."""
    found = parameters(recording.sources, recording.meta.get("estimate") or {})
    if not found:
        return {}
    names = [a.name or a.kind for a in recording.sources]
    block = P[-len(found) :, -len(found) :]
    std = np.sqrt(np.maximum(np.diag(block), 1e-300))
    return {
        "installation": {
            "parameters": [
                {
                    "name": each.of.name,
                    "component": each.component,
                    "column": each.name,
                    "sources": [names[s] for s in each.sources],
                    "of_imu": each.owner == IMU,
                    "given": as_given(recording, each.of, each.component, each.sources),
                    "prior": float(each.std),
                    "beside": [names[i] for i in _of_right_clock(recording.sources, each)],
                }
                for each in found
            ],
            # in a simulation this is the truth
            "reference": recording.reference is not None and "b_g" not in recording.meta,
            "mounting": recording.meta.get("imu_mounting", [0.0] * 3),  # roll, pitch, heading
            "correlation": np.nan_to_num(block / np.outer(std, std)).tolist(),
        }
    }


def _of_right_clock(sources: Sequence[Source], parameter: StateParameter) -> list[int]:
    """Return the sources at the antenna of an estimated clock whose own clock is not estimated."""
    if parameter.of is not CLOCK:
        return []
    own = sources[parameter.sources[0]]
    return [
        i for i, a in enumerate(sources) if _same_antenna(own, a) and CLOCK.name not in a.estimate
    ]


def as_given(
    recording: Recording, of: CalibrationParameter, component: int, sources: Sequence[int]
) -> float:
    """Return a component as given in the recording, SI: 0 for a clock, 1 for a scale, a lever arm
    of sources from the reference point of the vehicle, a mounting as roll, pitch, heading."""
    if of is LEVER_ARM:
        of_imu = recording.meta.get("imu_lever_arm", [0.0] * 3)
        return float(lever_arm_of(recording.sources[sources[0]])[component] + of_imu[component])
    if of is MOUNTING:
        return float(recording.meta.get("imu_mounting", [0.0] * 3)[component])
    return 1.0 if of is SCALE else 0.0


def check_estimates(filter: Filter, found: Sequence[StateParameter]) -> None:
    """Refuse a filter that cannot estimate an installation, and parameters that the data cannot separate.
    Raises DataError."""
    _check_separable(found)
    if found and not filter.installation:
        able = [name for name in filters.names() if filters.find(name).installation]
        raise DataError(
            f"{filter.name} cannot estimate {found[0].of.name}; these can: {', '.join(able)}; "
            "estimate=[] (--estimate none) estimates nothing"
        )


def _check_separable(found: Sequence[StateParameter]) -> None:
    """Refuse soft iron and the field together at one magnetometer. Raises DataError."""
    of_field = {each.owner for each in found if each.of is FIELD}
    for each in found:
        if each.of is SOFT_IRON and each.owner in of_field:
            raise DataError(
                f"{each.owner}: soft-iron and field cannot be estimated together, because the strength "
                "of the field and a common scale of the axes are one to the data; estimate soft-iron "
                "with declination, or field without soft-iron"
            )


def delays(sources: Sequence[Source], of_imu: OfImu) -> list[float]:
    """s that a fix of each source waits before it is used."""
    table = rows(SourceRow, len(sources))
    place(table, parameters(sources, of_imu), STATES)
    return list(table["delay"].tolist())


def coupling_rows(found: Sequence[StateParameter], first: int) -> Any:
    """Return the rows of `Cursor.coupled` for the states that are scales and misalignments of the
    IMU; the states begin at `first`."""
    listed = [
        (first + k, parameter.of.increments + into, parameter.of.increments + of)
        for k, parameter in enumerate(found)
        if parameter.of.increments >= 0
        for into, of in [_axes(parameter.of.components[parameter.component])]
    ]
    table = rows(Coupling, len(listed))
    table[:] = listed
    return table


def _axes(component: str) -> tuple[int, int]:
    """(axis with the error, axis that it is proportional to)."""
    if component in AXES:
        return AXES.index(component), AXES.index(component)
    into, of = ("xyz".index(letter) for letter in component)
    return into, of


def errors_of_start(v: Array, C: Array, omega: Array, acceleration: Array) -> tuple[Array, Array]:
    """Return the derivatives of the position and velocity error of a start from fixes: by their
    clock (6,), and by their lever arm (6, 3). `omega` in rad/s, body; the others in n, with
    velocity and acceleration of the antenna."""
    return np.r_[-v, -acceleration], -np.vstack([C, C @ cross_matrix(omega)])


def correlate(
    P: Array, start: InitialState, found: Sequence[StateParameter], kinds: Sequence[str]
) -> None:
    """Add to the initial P the errors of the first fixes from the parameters `found`, which are the
    last states; `kinds` of all sources."""
    if not start.motion:
        return
    position = kinds.index("position") if "position" in kinds else -1
    velocity = kinds.index("velocity") if "velocity" in kinds else position
    by_clock, by_arm = errors_of_start(
        np.asarray(start.motion[3:6]),
        rotation_matrix(*start.rph),
        np.asarray(start.motion[:3]),
        np.asarray(start.motion[6:]),
    )
    V = np.zeros((len(P), len(found)))
    for k, parameter in enumerate(found):
        if parameter.of in (CLOCK, LEVER_ARM):
            by = by_clock if parameter.of is CLOCK else by_arm[:, parameter.component]
            V[POS, k] = by[:3] * (position in parameter.sources)
            V[VEL, k] = by[3:] * (velocity in parameter.sources)
    first = len(P) - len(found)
    together = V * np.diagonal(P)[first:]
    P[:, first:] += together
    P[first:, :] += together.T
    P += together @ V.T


def place(sources: Any, found: Sequence[StateParameter], first: int) -> None:
    """Write into the sources, a table of SourceRow, where their states are, which begin with the
    state `first`."""
    for k, parameter in enumerate(found):
        if not parameter.of.place:
            continue
        for s in parameter.sources:
            states = sources[parameter.of.place][s : s + 1].reshape(-1)  # a view
            states[parameter.component] = first + k
            sources[s].estimated = 1
            if parameter.of is CLOCK:
                sources[s].delay = min(WAIT * parameter.std, MAX_WAIT)
    sources["turn"] = np.eye(3)
