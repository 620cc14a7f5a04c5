"""`diagnose` run on what it found until that has nothing wrong, and changes of a recording by
parameters."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...data.calibration_parameters import CLOCK
from ...data.recording import Recording
from ...installation.diagnose import diagnose
from ...installation.findings import Diagnosed, Diagnosis
from ...installation.iteration import MAX_RUNS
from ...installation.model import Constant, apply_constants, constants
from ...typing import Array
from .as_states import Asking

MAX_TURNS = 3
"""So often `diagnose` is run, on what it found before."""


class Settled(NamedTuple):
    """Result of `diagnose`, iterated on its own findings."""

    known: tuple[Constant, ...]
    before: Array  # (m,) change of what was given, SI, in the last recording that was diagnosed
    theta: Array  # (m,) and with what was found in that
    last: Diagnosis
    sought: tuple[Diagnosed, ...]  # its parameters that some source shows, clocks that differ apart
    runs: int  # of the filter, in all

    @property
    def sure(self) -> bool:
        """True where the last diagnosis found nothing and the runs were not used up."""
        return not self.last.found and self.last.runs < MAX_RUNS

    def of(self, each: Diagnosed) -> int:
        """The constant that an estimate is of: the first, of several that share it."""
        return which(self.known, self.last.recording, each)[0]


def settle(recording: Recording, asking: Asking) -> Settled:
    """`diagnose` on the recording, and on what it found, until that has nothing wrong."""
    known = constants(recording.sources)
    theta, runs = np.zeros(len(known)), 0
    for turn in range(MAX_TURNS):
        before = theta.copy()
        part = asking.within(0.7 * turn / MAX_TURNS, 0.7 * (turn + 1) / MAX_TURNS)
        found = diagnose(
            apply_constants(recording, known, theta),
            part.filter,
            options=part.options,
            progress=part.progress,
            **part.set_up,
        )
        runs += found.runs
        sought = [each for each in found.parameters if each.sources]
        theta += theta_of(known, recording, found.found)
        if not found.found:
            break
    apart = [part for each in sought for part in _split_clock(each, known, recording, theta)]
    return Settled(known, before, theta, found, tuple(apart), runs)


def which(known: Sequence[Constant], recording: Recording, each: Diagnosed) -> list[int]:
    """The constants that an estimate is of."""
    names = [a.name or a.kind for a in recording.sources]
    return [
        j
        for j, constant in enumerate(known)
        if (constant.of, constant.axis) == (each.of, each.axis)
        and {names[i] for i in constant.sources} <= set(each.sources)
    ]


def _split_clock(
    each: Diagnosed, known: Sequence[Constant], recording: Recording, theta: Array
) -> list[Diagnosed]:
    """A clock of several sources that were changed by different offsets as one of each."""
    own = which(known, recording, each)
    if each.of is not CLOCK or not np.ptp(theta[own]):
        return [each]
    names = [a.name or a.kind for a in recording.sources]
    owners = [names[known[j].sources[0]] for j in own]
    return [replace(each, name=f"clock of {name}", sources=(name,)) for name in owners]


def theta_of(known: Sequence[Constant], recording: Recording, found: Iterable[Diagnosed]) -> Array:
    """(m,) the changes of constants that estimates come to, SI."""
    theta = np.zeros(len(known))
    for each in found:
        theta[which(known, recording, each)] = each.change / each.of.factor
    return theta
