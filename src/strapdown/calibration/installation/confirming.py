"""The constants of an installation as states of the filter, beside what separate bias estimation
found: a second estimate of the same numbers, in one run."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ... import estimable
from ...core.loop.contract import Filter, Start
from ...diagnosis.findings import Estimate
from ...diagnosis.installation import ARM, CLOCK, MOUNTING, SCALE, constants
from ...diagnosis.settling import unknowns
from ...engine.installation import parameters, with_estimates
from ...engine.prepare import GivenImu, brought
from ...engine.smoothing import smooth
from ...recording import Recording
from ...typing import Progress, Say
from ...vehicle import GivenVehicle

ESTIMABLE = {
    CLOCK: estimable.CLOCK,
    ARM: estimable.LEVER_ARM,
    MOUNTING: estimable.MOUNTING,
    SCALE: estimable.SCALE,
}
"""{kind of constant: what it is as a state}."""
PRIOR = {CLOCK: 0.1, ARM: 1.0, MOUNTING: np.radians(6.0), SCALE: 0.04}
"""s, m, rad: standard deviation of what is left, before the run. A clock's is no larger because
its fixes wait three of them."""
KNOWN = {CLOCK: 0.05, ARM: 0.25, MOUNTING: np.radians(1.5), SCALE: 0.01}
"""s, m, rad: standard deviations from which the data show too little. The noise of a gyro at rest
alone brings an arm from 1 m to 0.4 m, though nothing shows it."""
ROWS = 1000
"""IMU samples of which one row is kept: constants need only the last."""


class Seen(NamedTuple):
    """A constant as a state, in the unit of its Estimate: what is left of it, and how sure."""

    left: float  # true less what the recording has
    sd: float
    known: bool  # whether the data, and not the prior, say so


class Asking(NamedTuple):
    """How to run the filter: arguments of `smooth`."""

    filter: str | Filter
    imu: GivenImu | None
    vehicle: GivenVehicle | None
    start: Start | None
    say: Say | None
    progress: Progress
    options: dict[str, Any]

    def within(self, first: float, last: float) -> "Asking":
        """The same, reporting its progress as this part of the whole."""
        return self._replace(progress=lambda done: self.progress(first + done * (last - first)))


def as_states(
    recording: Recording, sought: Sequence[Estimate], asking: Asking
) -> dict[Estimate, Seen]:
    """What the smoother makes of constants that are states around the values that the recording
    has. Clocks that differ between sources take a run each, since sources with one antenna share
    what is a state."""
    seen: dict[Estimate, Seen] = {}
    for wanted in _runs(sought):
        priors = _priors((each.cause, each.sources, each.axis) for each in wanted)
        asked = with_estimates(recording, priors)
        solution = smooth(
            asked,
            asking.filter,
            imu=asking.imu,
            start=asking.start,
            every=ROWS,
            say=asking.say,
            progress=asking.progress,
            vehicle=asking.vehicle,
            **asking.options,
        )
        states = parameters(asked.aidings, asked.meta.get("estimate", {}))
        names = [a.name or a.kind for a in recording.aidings]
        for each in wanted:
            own = {i for i, name in enumerate(names) if name in each.sources}
            for state in states:
                if (
                    state.of is ESTIMABLE[each.cause]
                    and state.component == each.axis
                    and own & set(state.sources)
                ):
                    left, sd = (
                        float(solution.columns[name][-1])
                        for name in (state.name, f"sd of {state.name}")
                    )
                    known = sd < KNOWN[each.cause] * state.of.factor
                    seen.setdefault(each, Seen(left, sd, known))
    return seen


def _runs(sought: Sequence[Estimate]) -> Iterator[list[Estimate]]:
    """What is estimated together: all, but one clock at a time."""
    clocks = [each for each in sought if each.cause == CLOCK]
    others = [each for each in sought if each.cause != CLOCK]
    yield [*clocks[:1], *others]
    for clock in clocks[1:]:
        yield [clock, *others]


def check_states(recording: Recording) -> None:
    """Refuse a recording with more parameters than can be states. Raises DataError."""
    names = [a.name or a.kind for a in recording.aidings]
    wanted = unknowns(constants(recording.aidings))
    priors = _priors((each.kind, [names[i] for i in each.sources], each.axis) for each in wanted)
    asked = with_estimates(recording, priors)
    brought(asked.aidings, asked.meta.get("estimate", {}))


def _priors(wanted: Iterable[tuple[str, Sequence[str], int]]) -> dict[str, tuple[float, ...]]:
    """As `estimate` takes them, of (kind, names of sources, axis): {name: prior standard deviation
    by component}."""
    priors: dict[str, list[float]] = {}
    for kind, sources, axis in wanted:
        what = ESTIMABLE[kind]
        for source in sources if kind != MOUNTING else [""]:
            sd = priors.setdefault(f"{source} {what.name}", [0.0] * len(what.components))
            sd[axis] = PRIOR[kind]
    return {name: tuple(sd) for name, sd in priors.items()}
