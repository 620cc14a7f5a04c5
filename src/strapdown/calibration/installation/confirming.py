"""The constants of an installation as states of the filter, beside what separate bias estimation
found: a second estimate of the same numbers, in one run."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from ... import estimable
from ...core.contract import Filter, Start
from ...diagnosis.findings import Estimate
from ...diagnosis.installation import ARM, CLOCK, MOUNTING, SCALE
from ...engine.installation import parameters, with_estimates
from ...engine.prepare import GivenImu
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
ROWS = 1000
"""IMU samples of which one row is kept: constants need only the last."""


class Seen(NamedTuple):
    """A constant as a state, in the unit of its Estimate: what is left of it, and how sure."""

    left: float  # true less what the recording has
    sd: float


class Asking(NamedTuple):
    """How to run the filter: arguments of `smooth`."""

    filter: str | Filter
    imu: GivenImu | None
    vehicle: GivenVehicle | None
    start: Start | None
    say: Say | None
    progress: Progress | None
    options: dict[str, Any]


def as_states(
    recording: Recording, sought: Sequence[Estimate], asking: Asking
) -> dict[Estimate, Seen]:
    """What the smoother makes of constants that are states around the values that the recording
    has. Clocks that differ between sources take a run each, since sources with one antenna share
    what is a state."""
    seen: dict[Estimate, Seen] = {}
    for wanted in _runs(sought):
        asked = with_estimates(recording, dict.fromkeys(_names(wanted)))
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
        states = parameters(asked.aidings, asked.meta["estimate"])
        names = [a.name or a.kind for a in recording.aidings]
        for each in wanted:
            own = {i for i, name in enumerate(names) if name in each.sources}
            for state in states:
                if (
                    state.of is ESTIMABLE[each.cause]
                    and state.component == each.axis
                    and own & set(state.sources)
                ):
                    values = (solution.columns[f"{sd}{state.name}"][-1] for sd in ("", "sd of "))
                    seen.setdefault(each, Seen(*map(float, values)))
    return seen


def _runs(sought: Sequence[Estimate]) -> Iterator[list[Estimate]]:
    """What is estimated together: all, but one clock at a time."""
    clocks = [each for each in sought if each.cause == CLOCK]
    others = [each for each in sought if each.cause != CLOCK]
    for clock in clocks or [None]:
        if wanted := [*filter(None, [clock]), *others]:
            yield wanted


def _names(wanted: Sequence[Estimate]) -> Iterator[str]:
    """As `estimate` takes them."""
    for each in wanted:
        name = ESTIMABLE[each.cause].name
        if each.cause == MOUNTING:
            yield name
        else:
            yield from (f"{source} {name}" for source in each.sources)
