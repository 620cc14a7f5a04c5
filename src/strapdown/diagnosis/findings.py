"""What is said of the constants of an installation: each with its value in the terms of
recording.toml, its status, and what to change."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.mathematics.rotation import matrix_to_euler
from ..data import Aiding, Solution
from ..operations import operation
from ..preprocessing.axes import rotation_matrix
from ..recording import Recording
from ..typing import Array
from ..verdict import Reason
from .installation import ARM, CLOCK, MOUNTING, SCALE, rotation
from .settling import NOTABLE, Unknown

FOUND, CONSISTENT, NOT_OBSERVABLE = "found", "consistent", "not observable"
UNITS = {CLOCK: ("s", 1.0), ARM: ("m", 1.0), MOUNTING: ("deg", 180 / np.pi), SCALE: ("", 1.0)}
"""{kind: (unit, factor to it from SI)}."""
AXES = {ARM: ("forward", "right", "down"), MOUNTING: ("roll", "pitch", "heading")}
LEAST_Z = 5.0
"""Standard deviations from which a change is reported."""
LEAST_GAIN = 25.0
"""Of all changes together, in the sum of min(NIS, 30)."""

MISFIT = 1.5
"""Times the expected NIS from which a fit is bad: an offset may be beyond what a linear estimate can
find, or something else is wrong."""


class Estimate(NamedTuple):
    """A constant of the installation. Numbers are in `unit`: s, m, deg, or none for a scale."""

    name: str  # such as "clock of gnss", "lever arm forward"
    cause: str  # a key of verdict.CAUSES
    sources: tuple[str, ...]  # names of those that it concerns
    unit: str
    status: str  # FOUND, CONSISTENT or NOT_OBSERVABLE
    # as the recording has it; of a clock and of a mounting 0, of a scale 1
    given: float
    change: float  # to be added to it; NaN where nothing can be said
    sd: float  # of the change
    gain: float = 0.0  # of FOUND: its share of what the solution gains, in the sum of min(NIS, 30)
    motion: str = ""  # what would show it, or show it better
    axis: int = 0  # 0, 1, 2 of a lever arm or a mounting
    # change and standard deviation by the first and by the second half of the time, all others as
    # estimated; NaN where that half shows nothing
    halves: tuple[tuple[float, float], ...] = ((np.nan, np.nan),) * 2

    @property
    def value(self) -> float:
        """What it is, as estimated."""
        return self.given + self.change

    @property
    def seen(self) -> str:
        """The change with its standard deviation and unit."""
        return f"{self.change:+.3f} +- {self.sd:.3f} {self.unit}".rstrip()

    def __str__(self) -> str:
        if self.status == NOT_OBSERVABLE:
            return f"{self.name}: not observable; to show it, {self.motion}"
        if self.status == CONSISTENT:
            if abs(self.change) < NOTABLE * self.sd:
                return f"{self.name}: consistent with what was given ({self.seen})"
            return f"{self.name}: not surely, or not by much, off what was given ({self.seen})"
        return f"{self.name}: found to be off by {self.seen}; the fit gains {self.gain:.0f}"


class Setting(NamedTuple):
    """What a section of recording.toml must say."""

    kind: str
    source: int | None  # of the aidings; None: of the IMU
    value: Array  # clock: s to add; arm: m (3,); mounting: roll, pitch, heading, rad; scale: factor


@dataclass(frozen=True)
class Diagnosis:
    """What `diagnose` found."""

    parameters: tuple[Estimate, ...]
    recording: Recording  # set up as found
    solution: Solution  # of the last run: of that recording
    runs: int  # of the filter
    gain: float  # sum of min(NIS, 30) of all fixes, as given less as found
    misfit: float  # mean of min(NIS, 30) as found, over that of a right set-up: about 1
    reasons: tuple[Reason, ...]  # the weightiest first
    changes: tuple[str, ...]  # what to write into recording.toml, a line each

    @property
    def found(self) -> tuple[Estimate, ...]:
        """The parameters that are wrong as given."""
        return tuple(each for each in self.parameters if each.status == FOUND)

    @property
    def lines(self) -> list[str]:
        """For people: every parameter, then what to change."""
        lines = [str(each) for each in self.parameters]
        if self.misfit > MISFIT:
            lines.append(
                f"the fixes still fit badly: their NIS is {self.misfit:.1f} times what is expected, "
                f"so something else is wrong, and what stands above may be too"
            )
        if not self.found:
            return [*lines, f"nothing to change in recording.toml ({counted(self.runs)})"]
        return [
            *lines,
            f"to change in recording.toml ({counted(self.runs)}):",
            *(f"  {change}" for change in self.changes),
        ]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def __repr__(self) -> str:
        found = ", ".join(each.name for each in self.found) or "nothing to change"
        return f"Diagnosis({found}; {counted(self.runs)})"

    def _repr_html_(self) -> str:
        return str(operation("card")(self))


def counted(runs: int) -> str:
    """How often the filter ran, in words."""
    return f"{runs} run{'s' * (runs > 1)} of the filter"


def named(unknown: Unknown, names: Sequence[str], antennas: int) -> str:
    """The name of an unknown, with its sources where there may be others like it."""
    if unknown.kind == CLOCK:
        return f"clock of {' and '.join(names)}"
    own = f" of {' and '.join(names)}" if unknown.kind == ARM and antennas > 1 else ""
    axis = AXES.get(unknown.kind)
    return f"{unknown.kind} {axis[unknown.axis]}{own}" if axis else unknown.kind


def changes(recording: Recording, needed: Iterable[Setting]) -> dict[str, list[str]]:
    """{kind: lines of recording.toml} of settings."""
    lines: dict[str, list[str]] = {}
    for kind, source, new in needed:
        where = "[imu]" if source is None else section(recording.aidings, source)
        if kind == MOUNTING:
            roll, pitch, heading = np.degrees(new)
            text = (
                f"mounting = {{ roll = {roll:.2f}, pitch = {pitch:.2f}, heading = {heading:.2f}, "
                f'unit = "deg" }}'
            )
        else:
            text = {
                CLOCK: "time: add {0[0]:+.3f} s to offset",
                ARM: "lever_arm = [{0[0]:.2f}, {0[1]:.2f}, {0[2]:.2f}]",
                SCALE: "scale: multiply by {0[0]:.4f}",
            }[kind].format(new)
        lines.setdefault(kind, []).append(f"{where} {text}")
    return lines


def settings(
    recording: Recording, found: Iterable[tuple[str, Sequence[int], int, float]]
) -> list[Setting]:
    """What recording.toml must say for (kind, sources, axis, change in SI) of what was found."""
    made: list[Setting] = []
    arms: dict[tuple[int, ...], Array] = {}
    turn = np.zeros(3)
    for kind, sources, axis, change in found:
        if kind == CLOCK:
            made += [Setting(CLOCK, i, np.array([change])) for i in sources]
        elif kind == SCALE:
            made += [Setting(SCALE, i, np.array([1 / (1 + change)])) for i in sources]
        elif kind == ARM:
            arms.setdefault(tuple(sources), np.zeros(3))[axis] = change
        else:
            turn[axis] = change
    of_imu = np.array(recording.meta.get("imu_lever_arm", [0.0] * 3))
    for sources, arm in arms.items():
        for i in sources:
            given = np.array((*recording.aidings[i].parameters, 0.0, 0.0, 0.0)[:3])
            made.append(Setting(ARM, i, of_imu + given + arm))
    if turn.any():
        C = rotation(turn) @ rotation_matrix(*recording.meta.get("imu_mounting", (0.0, 0.0, 0.0)))
        made.append(Setting(MOUNTING, None, np.array(matrix_to_euler(C))))
    return made


def section(aidings: Sequence[Aiding], i: int) -> str:
    """Where recording.toml has a source."""
    return f"[[aiding]] {i + 1} ({aidings[i].name or aidings[i].kind})"


def reasons(
    estimates: Sequence[Estimate], lines: dict[str, list[str]], falls: str
) -> tuple[Reason, ...]:
    """A Reason for each kind of constant that was found wrong, with its lines as the remedy, the
    weightiest first; `falls` is the verb of what the fit gains."""
    made = []
    for kind, remedy in lines.items():
        own = [each for each in estimates if each.cause == kind and each.status == FOUND]
        gain = sum(each.gain for each in own)
        z = max(abs(each.change) / each.sd for each in own)
        seen = ", ".join(f"{each.name} off by {each.seen}" for each in own)
        alone = len(own) == 1 == len(own[0].sources)
        made.append(
            Reason(
                kind,
                f"{seen}; the sum of min(NIS, 30) {falls} by {gain:.0f} with it",
                "; ".join(remedy),
                own[0].sources[0] if alone else "",
                max(1.0, min(z / LEAST_Z, float(np.sqrt(gain / LEAST_GAIN)))),
            )
        )
    return tuple(sorted(made, key=lambda reason: -reason.weight))
