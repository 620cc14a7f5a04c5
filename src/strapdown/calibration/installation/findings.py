"""Result of `calibrate_installation`: each parameter with its standard deviation and status, what
changes in recording.toml, and the change itself."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...checks import DataError
from ...data.calibration_parameters import CLOCK, MOUNTING
from ...data.recording import Recording
from ...data.value import Value
from ...installation.findings import FOUND, Diagnosed, edits, interval, line
from ...io.description.edits import Edit
from ...io.description.found import Change
from ...typing import File
from .as_states import Asking

if TYPE_CHECKING:
    from ...pages.shell import Page

NOT_CONFIRMED, IMPLAUSIBLE = "not confirmed", "not plausible"
NOT_CONSTANT = "not constant"
UNSURE = (NOT_CONFIRMED, IMPLAUSIBLE, NOT_CONSTANT)
MINUTES = 180.0
"""s: from a shorter recording a constant is hardly told from what varies."""
COMMAND = "calibrate installation"


@dataclass(frozen=True)
class CalibratedParameter(Diagnosed):
    """An estimate that was confirmed, or not, by a second one. Its standard deviation is the larger of
    the two; its status may be one of UNSURE too."""

    by_states: float = np.nan  # the other estimate of the change
    states_std: float = np.nan  # and its standard deviation

    @property
    def second(self) -> str:
        """The other estimate of the change, with its standard deviation and unit."""
        return interval(self.by_states, self.states_std, self.unit)

    @property
    def by_halves(self) -> list[str]:
        """The change by the first and by the second half of the time, the same way."""
        return [interval(change, std, self.unit) for change, std in self.halves]

    @property
    def told(self) -> str:
        """Its status, with the numbers that belong to it."""
        if self.status == NOT_CONFIRMED:
            return (
                f"not confirmed, so not written: {self.seen} by the innovations, {self.second} as a "
                f"state; to show it better, {self.motion}"
            )
        if self.status == NOT_CONSTANT:
            first, second = self.by_halves
            return (
                f"not constant, so not written: {first} by the first half of the time, {second} by "
                f"the second"
            )
        if self.status == IMPLAUSIBLE:
            most = self.of.most * self.of.factor
            return (
                f"{self.seen}, more than the {most:.3g} {self.unit}".rstrip()
                + " by which an installation can differ, so not written: find the cause (such "
                "as leap seconds, or a wrong unit), and change it by hand"
            )
        if self.status == FOUND:
            return f"differs from the given value by {self.seen} (as a state: {self.second})"
        return super().told


def _join_names(parameters: Iterable[CalibratedParameter]) -> str:
    return " and ".join(each.name for each in parameters)


@dataclass(frozen=True, eq=False)
class Installation(Value):
    """Result of `calibrate_installation`.

    Attributes
    ----------
    parameters : tuple of CalibratedParameter
        Each parameter as given and as found.
    recording : Recording
        The recording, set up as found.
    given : Recording
        The recording as it was.
    runs : int
        How often `diagnose` ran the filter.
    misfit : float
        Mean of min(NIS, 30) as found, over that of a correct set-up: about 1.
    notes : tuple of str
        One line each.
    imu_clock : bool
        True: a shared offset is written to the IMU.
    asking : Asking
        How the filter was run.
    written : dict[Path, Path]
        {file that has it: copy of the old one}: offsets and factors are relative to the old file.
    """

    parameters: tuple[CalibratedParameter, ...]
    recording: Recording
    given: Recording
    runs: int
    misfit: float
    notes: tuple[str, ...]
    imu_clock: bool
    asking: Asking = field(repr=False)
    written: dict[Path, Path] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def found(self) -> tuple[CalibratedParameter, ...]:
        """The parameters that are wrong as given."""
        return tuple(each for each in self.parameters if each.status == FOUND)

    @property
    def unsure(self) -> tuple[CalibratedParameter, ...]:
        """Those that forbid to write anything, since all others were estimated beside them."""
        return tuple(each for each in self.parameters if each.status in UNSURE)

    @property
    def edits(self) -> list[Edit]:
        """Edits of recording.toml, with standard deviations; none where something is `unsure`."""
        if self.unsure:
            return []
        names = [a.name or a.kind for a in self.given.sources]
        made = edits(
            self.given,
            [
                (
                    each.of,
                    [i for i, name in enumerate(names) if name in each.sources],
                    each.axis,
                    each.change / each.of.factor,
                    each.std / each.of.factor,
                )
                for each in self.found
            ],
        )
        if not self.imu_clock:
            return made
        # sources that are late beside the IMU: the IMU is early beside them
        clocks = [
            Edit(None, CLOCK, (-each.value[0],), each.std) for each in made if each.of is CLOCK
        ]
        return [*clocks[:1], *(each for each in made if each.of is not CLOCK)]

    @property
    def changes(self) -> tuple[str, ...]:
        """Changes to write into recording.toml, a line each, with the digits of the file."""
        return tuple(line(self.given.sources, each) for each in self.edits)

    @property
    def lines(self) -> list[str]:
        """For people: every parameter, then what must be known beside."""
        unsure, found = self.unsure, self.found
        together = []
        if unsure and found:
            together = [
                f"nothing is written: {_join_names(found)} was estimated together with "
                f"{_join_names(unsure)}, and one correction without the other may be worse than "
                "none"
            ]
        turned = []
        if np.any(self.given.meta.get("imu_mounting", 0.0)) and any(
            each.of is MOUNTING for each in self.edits
        ):
            turned = [
                "mounting: the change rotates the given mounting, so all three angles are written "
                "anew"
            ]
        return [*map(str, self.parameters), *together, *turned, *self.notes, self.used]

    @property
    def used(self) -> str:
        """The time that was used, for people."""
        first, last = self.given.span
        short = "; use several minutes, to separate constant from varying parameters"
        return f"used: {first:.1f} to {last:.1f} s, {last - first:.0f} s" + (
            short if last - first < MINUTES else ""
        )

    def __str__(self) -> str:
        return "\n".join([*self.lines, *self.changes])

    def __repr__(self) -> str:
        return f"Installation({_join_names(self.found) or 'nothing to change'}; {self.runs} runs)"

    def _repr_html_(self) -> str:
        from ...pages.notebook.cards import card, lines

        return card("Installation", {}, lines([*self.lines, *self.changes]))

    def diff(self, path: File) -> list[str]:
        """The lines of a recording.toml that change, with their numbers: - as they are, + as they
        would be. Raises DataError where it is another file, or cannot be changed."""
        if not self.edits:
            return []
        change = Change(self.given, COMMAND)
        change.check(path)
        return change.lines(path, self.edits)

    def write(self, path: File) -> Path | None:
        """Write what was found into the recording.toml that the recording was read from, with
        comments that have standard deviations and date; the path of the copy of the old one that is
        kept beside it, or None where nothing changes.

        Raises DataError where something is `unsure`, where it was written there before, and
        where the file is another one or cannot be changed; then nothing is.
        """
        if self.unsure:
            raise DataError(f"{path}: unchanged; {self.unsure[0]}")
        if not self.edits:
            return None
        target = Path(path).resolve()
        if target in self.written:
            raise DataError(
                f"{path}: already has this change; read the file and calibrate again to change it"
            )
        change = Change(self.given, COMMAND)
        change.check(path)
        kept = change.write(path, self.edits)
        self.written[target] = kept
        return kept

    def page(self) -> "Page":
        """The page, with runs as given and as found, and some around each parameter."""
        from .page import page

        return page(self)
