"""Findings on the parameters of an installation: each estimate with its status, in the terms of
recording.toml, and what to change there."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.mathematics.rotation import matrix_to_euler
from ..data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE, CalibrationParameter
from ..data.operations import operation
from ..data.recording import Recording
from ..data.solution import Solution, Source
from ..data.value import Value
from ..data.verdict import Reason, rank_reasons
from ..io.description.edits import Edit, edit_text
from ..preprocessing.axes import rotation_matrix
from ..preprocessing.lever_arm import lever_arm_of
from ..typing import Array
from .iteration import NOTABLE, Unknown
from .model import rotation

FOUND, CONSISTENT, NOT_OBSERVABLE = "found", "consistent", "not observable"
MIN_Z = 5.0
"""Standard deviations from which a change is reported."""
MIN_GAIN = MIN_Z**2
"""By which the sum of squared innovations must fall with what is reported."""

MISFIT = 1.5
"""Times the expected NIS from which a fit is bad: an offset may be beyond what a linear estimate can
find, or something else is wrong."""


def interval(value: float, std: float, unit: str) -> str:
    """A value with its standard deviation and unit, as text."""
    digits = 3 if unit else 4
    return f"{value:+.{digits}f} +- {std:.{digits}f} {unit}".rstrip()


@dataclass(frozen=True)
class Estimate:
    """An estimate of a component of a parameter. Numbers are in `unit`: s, m, deg, or none."""

    of: CalibrationParameter
    axis: int  # of its components
    name: str  # such as "clock of gnss", "lever arm forward"
    sources: tuple[str, ...]  # names of those that it concerns
    status: str  # FOUND, CONSISTENT or NOT_OBSERVABLE
    given: float  # as the recording has it; of a clock 0, of a scale 1
    change: float  # to be added to it, true less given; NaN where nothing can be said
    std: float  # of the change
    motion: str  # what would show it, or show it better

    @property
    def cause(self) -> str:
        """A key of verdict.CAUSES."""
        return self.of.cause

    @property
    def unit(self) -> str:
        """The unit of its numbers."""
        return self.of.unit

    @property
    def seen(self) -> str:
        """The change with its standard deviation and unit."""
        return interval(self.change, self.std, self.unit)

    @property
    def told(self) -> str:
        """Its status, with the numbers that belong to it."""
        if self.status == NOT_OBSERVABLE:
            return f"not observable; to show it, {self.motion}"
        if self.status == FOUND:
            return f"differs from the given value by {self.seen}"
        if abs(self.change) < NOTABLE * self.std:
            return f"consistent with the given value ({self.seen})"
        return f"no significant difference from the given value ({self.seen})"

    def __str__(self) -> str:
        return f"{self.name}: {self.told}"


@dataclass(frozen=True)
class Diagnosed(Estimate):
    """An estimate by the innovations of runs. Of a mounting, 0 counts as given."""

    gain: float = 0.0  # of FOUND: its share of what the solution gains, in the sum of min(NIS, 30)
    # change and standard deviation by the first and by the second half of the time, all others as
    # estimated; NaN where that half shows nothing
    halves: tuple[tuple[float, float], ...] = ((np.nan, np.nan),) * 2

    @property
    def value(self) -> float:
        """The estimated value."""
        return self.given + self.change

    @property
    def told(self) -> str:
        """Its status, with the numbers that belong to it."""
        gains = f"; the fit gains {self.gain:.0f}" if self.status == FOUND else ""
        return super().told + gains


@dataclass(frozen=True, eq=False)
class Diagnosis(Value):
    """Result of `diagnose`.

    Attributes
    ----------
    parameters : tuple of Diagnosed
        Each parameter as given and as found.
    recording : Recording
        The recording, set up as found.
    solution : Solution
        Solution of the last run, of that recording.
    runs : int
        How often the filter ran.
    gain : float
        Sum of min(NIS, 30) of all fixes, as given minus as found.
    misfit : float
        Mean of min(NIS, 30) as found, over that of a correct set-up: about 1.
    reasons : tuple of Reason
        The weightiest first.
    changes : tuple of str
        Changes to make in recording.toml, a line each.
    """

    parameters: tuple[Diagnosed, ...]
    recording: Recording
    solution: Solution
    runs: int
    gain: float
    misfit: float
    reasons: tuple[Reason, ...]
    changes: tuple[str, ...]

    @property
    def found(self) -> tuple[Diagnosed, ...]:
        """The parameters that are wrong as given."""
        return tuple(each for each in self.parameters if each.status == FOUND)

    @property
    def lines(self) -> list[str]:
        """For people: every parameter, then what to change."""
        lines = [str(each) for each in self.parameters]
        if self.misfit > MISFIT:
            lines.append(
                f"the NIS of the fixes is still {self.misfit:.1f} times its expectation, so "
                "something else is wrong and may have changed the values above"
            )
        if not self.found:
            return [*lines, f"nothing to change in recording.toml ({run_count_text(self.runs)})"]
        return [
            *lines,
            f"to change in recording.toml ({run_count_text(self.runs)}):",
            *(f"  {change}" for change in self.changes),
        ]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def __repr__(self) -> str:
        found = ", ".join(each.name for each in self.found) or "nothing to change"
        return f"Diagnosis({found}; {run_count_text(self.runs)})"

    def _repr_html_(self) -> str:
        return str(operation("card")(self))


def run_count_text(runs: int) -> str:
    """Number of runs of the filter, in words."""
    return f"{runs} run{'s' * (runs > 1)} of the filter"


def unknown_name(unknown: Unknown, names: Sequence[str], antennas: int) -> str:
    """The name of an unknown, with its sources where there may be others like it."""
    words = f"{unknown.of.cause} {unknown.of.components[unknown.axis]}".rstrip()
    several = unknown.of in (CLOCK, SCALE) or (unknown.of is LEVER_ARM and antennas > 1)
    return f"{words} of {' and '.join(names)}" if several and names else words


def edits(
    recording: Recording,
    found: Iterable[tuple[CalibrationParameter, Sequence[int], int, float, float]],
) -> list[Edit]:
    """The edits of recording.toml for (parameter, sources, axis, change, its standard deviation),
    SI, of what was found."""
    made: list[Edit] = []
    arms: dict[tuple[int, ...], Array] = {}
    turn = np.zeros((2, 3))
    for of, sources, axis, change, std in found:
        if of is CLOCK:
            made += [Edit(i, CLOCK, (change,), (std,)) for i in sources]
        elif of is SCALE:
            by = 1 / (1 + change)
            made += [Edit(i, SCALE, (by,), (by * std,)) for i in sources]
        elif of is LEVER_ARM:
            arms.setdefault(tuple(sources), np.zeros((2, 3)))[:, axis] = change, std
        else:
            turn[:, axis] = change, std
    of_imu = np.array(recording.meta.get("imu_lever_arm", [0.0] * 3))
    for sources, (change_of_arm, std_of_arm) in arms.items():
        for i in sources:
            arm = of_imu + lever_arm_of(recording.sources[i]) + change_of_arm
            made.append(Edit(i, LEVER_ARM, tuple(arm.tolist()), tuple(std_of_arm.tolist())))
    if turn[0].any():
        given = rotation_matrix(*recording.meta.get("imu_mounting", (0.0, 0.0, 0.0)))
        angles = matrix_to_euler(rotation(turn[0]) @ given)
        made.append(Edit(None, MOUNTING, tuple(map(float, angles)), tuple(turn[1].tolist())))
    return made


def line(sources: Sequence[Source], edit: Edit) -> str:
    """A line for people: the section of recording.toml, and what to change there."""
    if edit.source is None:
        return f"[imu] {edit_text(edit)}"
    source = sources[edit.source]
    return f"[[source]] {edit.source + 1} ({source.name or source.kind}) {edit_text(edit)}"


def reasons(estimates: Sequence[Diagnosed], lines: dict[str, list[str]]) -> tuple[Reason, ...]:
    """A Reason for each cause of which something was found wrong, with its lines as the remedy, the
    weightiest first."""
    made = []
    for cause, remedy in lines.items():
        own = [each for each in estimates if each.cause == cause and each.status == FOUND]
        gain = sum(each.gain for each in own)
        z = max(abs(each.change) / each.std for each in own)
        seen = ", ".join(f"{each.name} off by {each.seen}" for each in own)
        alone = len(own) == 1 == len(own[0].sources)
        made.append(
            Reason(
                cause,
                f"{seen}; this change lowers the sum of min(NIS, 30) by {gain:.0f}",
                "; ".join(remedy),
                own[0].sources[0] if alone else "",
                max(1.0, min(z / MIN_Z, float(np.sqrt(gain / MIN_GAIN)))),
            )
        )
    return tuple(rank_reasons(made))
