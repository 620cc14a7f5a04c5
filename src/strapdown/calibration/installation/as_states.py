"""The constants of an installation as states of the filter, beside what separate bias estimation
found: a second estimate of the same numbers, in one run."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from ...core.loop.contract import Filter
from ...data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, CalibrationParameter
from ...data.recording import Recording
from ...engine.installation import with_estimates
from ...engine.options import SetUpOptions
from ...engine.prepare import augmented_states
from ...engine.smoothing import smooth
from ...installation.findings import Diagnosed
from ...installation.iteration import unknowns
from ...installation.model import constants
from ...installation.states import EstimatedParameter, estimated_installation
from ...typing import Progress

ROWS = 1000
"""IMU samples of which one row is kept: constants need only the last."""


class Asking(NamedTuple):
    """Options by which the filter is run, as `diagnose` takes it."""

    filter: str | Filter
    options: dict[str, Any] | None
    set_up: SetUpOptions
    progress: Progress

    def within(self, first: float, last: float) -> "Asking":
        """The same, reporting its progress as this part of the whole."""
        return self._replace(progress=lambda done: self.progress(first + done * (last - first)))


def as_states(
    recording: Recording, sought: Sequence[Diagnosed], asking: Asking
) -> dict[Diagnosed, EstimatedParameter]:
    """Return the smoother's estimates of constants, as states around the values in the recording.
    Clocks that differ between sources take a run each, since sources with one antenna share what is
    a state."""
    seen: dict[Diagnosed, EstimatedParameter] = {}
    for wanted in _runs(sought):
        priors = _priors((each.of, each.sources, each.axis) for each in wanted)
        solution = smooth(
            with_estimates(recording, priors),
            asking.filter,
            options=asking.options,
            every=ROWS,
            progress=asking.progress,
            **asking.set_up,
        )
        states = estimated_installation(solution).parameters
        for each in wanted:
            own = [s for s in states if (s.of, s.axis) == (each.of, each.axis)]
            for state in own:
                if {*state.sources} & {*each.sources}:
                    seen.setdefault(each, state)
    return seen


def _runs(sought: Sequence[Diagnosed]) -> Iterator[list[Diagnosed]]:
    """Yield the parameters of each run: all together, but one clock of a receiver at a time."""
    antennas = {name for each in sought if each.of is LEVER_ARM for name in each.sources}
    clocks = [each for each in sought if each.of is CLOCK and antennas.issuperset(each.sources)]
    others = [each for each in sought if each not in clocks]
    yield [*clocks[:1], *others]
    for clock in clocks[1:]:
        yield [clock, *others]


def check_states(recording: Recording) -> None:
    """Refuse a recording with more parameters than can be states. Raises DataError."""
    names = [a.name or a.kind for a in recording.sources]
    wanted = unknowns(constants(recording.sources))
    priors = _priors((each.of, [names[i] for i in each.sources], each.axis) for each in wanted)
    asked = with_estimates(recording, priors)
    augmented_states(asked.sources, asked.meta.get("estimate", {}))


def _priors(
    wanted: Iterable[tuple[CalibrationParameter, Sequence[str], int]],
) -> dict[str, tuple[float, ...]]:
    """As `estimate` takes them, of (parameter, names of sources, axis): {name: prior standard deviation
    by component}."""
    priors: dict[str, list[float]] = {}
    for of, sources, axis in wanted:
        for source in sources if of is not MOUNTING else [""]:
            std = priors.setdefault(f"{source} {of.name}", [0.0] * len(of.components))
            std[axis] = of.left_std
    return {name: tuple(std) for name, std in priors.items()}
