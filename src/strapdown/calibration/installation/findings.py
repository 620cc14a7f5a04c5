"""What `calibrate_installation` found: each parameter with its standard deviation and status, what
changes in recording.toml, and the change itself."""

import datetime
import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...checks import DataError
from ...diagnosis.findings import (
    CONSISTENT,
    FOUND,
    NOT_OBSERVABLE,
    UNITS,
    Setting,
    section,
    settings,
)
from ...diagnosis.installation import ARM, CLOCK, MOUNTING, SCALE
from ...diagnosis.settling import NOTABLE
from ...io.description.complaints import load
from ...io.description.installed import difference, installed
from ...io.description.rewriting import (
    LEVER_ARM,
    MOUNTING as MOUNTING_KEY,
    SCALE as SCALE_KEY,
    TIME,
    Edit,
    check_sections,
    rewrite,
    rewritten,
    told,
)
from ...opening import settings_text
from ...recording import Recording
from ...typing import File
from .confirming import ESTIMABLE, Asking

if TYPE_CHECKING:
    from ...reports.shell import Page

NOT_CONFIRMED, IMPLAUSIBLE = "not confirmed", "not plausible"
NOT_CONSTANT = "not constant"
UNSURE = (NOT_CONFIRMED, IMPLAUSIBLE, NOT_CONSTANT)
MINUTES = 180.0
"""s: from a shorter recording a constant is hardly told from what varies."""
KEYS = {CLOCK: TIME, ARM: LEVER_ARM, MOUNTING: MOUNTING_KEY, SCALE: SCALE_KEY}
"""{kind: key of recording.toml}."""
MARK = "calibrate installation"
"""Behind the date in the comments that it writes."""


class Parameter(NamedTuple):
    """A parameter of the installation. Numbers are in `unit`: s, m, deg, or none for a scale."""

    name: str  # such as "clock of gnss", "lever arm forward"
    cause: str  # a key of verdict.CAUSES
    sources: tuple[str, ...]  # names of those that it concerns
    axis: int  # 0, 1, 2 of a lever arm or a mounting
    unit: str
    status: str  # FOUND, CONSISTENT, NOT_OBSERVABLE or one of UNSURE
    # as the recording has it; of a clock and of a mounting 0, of a scale 1
    given: float
    change: float  # to be added to it; NaN where nothing can be said
    sd: float  # of the change: the larger of the two estimates'
    by_states: float  # the other estimate of the change
    states_sd: float  # and its standard deviation
    motion: str  # what would show it, or show it better
    # change and sd by the first and by the second half of the time
    halves: tuple[tuple[float, float], ...] = ((np.nan, np.nan),) * 2

    @property
    def value(self) -> float:
        """What it is, as estimated."""
        return self.given + self.change

    @property
    def seen(self) -> str:
        """The change with its standard deviation and unit."""
        return _interval(self.change, self.sd, self.unit)

    @property
    def second(self) -> str:
        """The other estimate of the change, the same way."""
        return _interval(self.by_states, self.states_sd, self.unit)

    @property
    def by_halves(self) -> list[str]:
        """The change by the first and by the second half of the time, the same way."""
        return [_interval(change, sd, self.unit) for change, sd in self.halves]

    def __str__(self) -> str:
        if self.status == NOT_OBSERVABLE:
            return f"{self.name}: not observable; to show it, {self.motion}"
        if self.status == NOT_CONFIRMED:
            return (
                f"{self.name}: not confirmed, so not written: {self.seen} by the innovations, {self.second} as a "
                f"state; to show it better, {self.motion}"
            )
        if self.status == NOT_CONSTANT:
            first, second = self.by_halves
            return (
                f"{self.name}: not constant, so not written: {first} by the first half of the time, "
                f"{second} by the second"
            )
        if self.status == IMPLAUSIBLE:
            most = ESTIMABLE[self.cause].most * UNITS[self.cause][1]
            return (
                f"{self.name}: {self.seen}, more than the {most:.3g} {self.unit}".rstrip()
                + " that an installation is off, so not written: look for its cause (such as leap "
                "seconds, or a wrong unit), and change it by hand"
            )
        if self.status == CONSISTENT:
            if abs(self.change) < NOTABLE * self.sd:
                return f"{self.name}: consistent with what was given ({self.seen})"
            return f"{self.name}: not surely, or not by much, off what was given ({self.seen})"
        return f"{self.name}: found to be off by {self.seen} (as a state: {self.second})"


def _listed(parameters: Iterable[Parameter]) -> str:
    return " and ".join(each.name for each in parameters)


def _interval(value: float, sd: float, unit: str) -> str:
    digits = 3 if unit else 5
    return f"{value:+.{digits}f} +- {sd:.{digits}f} {unit}".rstrip()


@dataclass(frozen=True)
class Installation:
    """What `calibrate_installation` found."""

    parameters: tuple[Parameter, ...]
    recording: Recording  # set up as found
    given: Recording  # as it was
    runs: int  # of `diagnose`
    misfit: float  # mean of min(NIS, 30) as found, over that of a right set-up: about 1
    notes: tuple[str, ...]  # one line each
    imu_clock: bool  # whether a shared offset is written to the IMU
    asking: Asking = field(repr=False)  # how the filter was run
    # {file that has it: copy of the old one}: offsets and factors are on top of what that said
    written: dict[Path, Path] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def found(self) -> tuple[Parameter, ...]:
        """The parameters that are wrong as given."""
        return tuple(each for each in self.parameters if each.status == FOUND)

    @property
    def unsure(self) -> tuple[Parameter, ...]:
        """Those that forbid to write anything, since all others were estimated beside them."""
        return tuple(each for each in self.parameters if each.status in UNSURE)

    @property
    def settings(self) -> list[Setting]:
        """What recording.toml must say; nothing where something is `unsure`."""
        if self.unsure:
            return []
        names = [a.name or a.kind for a in self.given.aidings]
        made = settings(
            self.given,
            [
                (
                    each.cause,
                    tuple(i for i, name in enumerate(names) if name in each.sources),
                    each.axis,
                    each.change / UNITS[each.cause][1],
                )
                for each in self.found
            ],
        )
        if not self.imu_clock:
            return made
        # sources that are late beside the IMU: the IMU is early beside them
        clocks = [Setting(CLOCK, None, -each.value) for each in made if each.kind == CLOCK]
        return [*clocks[:1], *(each for each in made if each.kind != CLOCK)]

    @property
    def edits(self) -> list[Edit]:
        """The same with standard deviations, as keys of the file."""
        return [
            Edit(each.source, KEYS[each.kind], tuple(map(float, each.value)), self._sd(each))
            for each in self.settings
        ]

    def _sd(self, setting: Setting) -> tuple[float, ...]:
        """By component, SI; 0 of one that was not found."""
        sd = np.zeros(len(setting.value))
        aidings = self.given.aidings
        for each in self.found:
            of_source = setting.source is None or (
                (aidings[setting.source].name or aidings[setting.source].kind) in each.sources
            )
            if each.cause == setting.kind and of_source:
                sd[each.axis] = each.sd / UNITS[each.cause][1]
        if setting.kind == SCALE:
            sd *= setting.value  # of a factor by its own size
        return tuple(map(float, sd))

    @property
    def changes(self) -> tuple[str, ...]:
        """What to write into recording.toml, a line each, with the digits of the file."""
        return tuple(
            f"{'[imu]' if e.source is None else section(self.given.aidings, e.source)} {told(e)}"
            for e in self.edits
        )

    @property
    def lines(self) -> list[str]:
        """For people: every parameter, then what must be known beside."""
        unsure, found = self.unsure, self.found
        together = []
        if unsure and found:
            together = [
                f"nothing is written: {_listed(found)} was estimated together with "
                f"{_listed(unsure)}, and half a correction may be worse than none"
            ]
        turned = []
        if np.any(self.given.meta.get("imu_mounting", 0.0)) and any(
            each.kind == MOUNTING for each in self.settings
        ):
            turned = [
                "mounting: the change turns what was given, so that all three angles are written anew"
            ]
        return [*map(str, self.parameters), *together, *turned, *self.notes, self.used]

    @property
    def used(self) -> str:
        """The time that was used, for people."""
        first, last = self.given.span
        short = "; use several minutes, to tell a constant from what varies"
        return f"used: {first:.1f} to {last:.1f} s, {last - first:.0f} s" + (
            short if last - first < MINUTES else ""
        )

    def __str__(self) -> str:
        return "\n".join([*self.lines, *self.changes])

    def __repr__(self) -> str:
        return f"Installation({_listed(self.found) or 'nothing to change'}; {self.runs} runs)"

    def _repr_html_(self) -> str:
        from ...notebook.cards import card, lines

        return card("Installation", {}, lines([*self.lines, *self.changes]))

    def diff(self, path: File) -> list[str]:
        """The lines of a recording.toml that change, with their numbers: - as they are, + as they
        would be. Raises DataError where it is another file, or cannot be changed."""
        if not self.edits:
            return []
        self._check_same(path)
        new = rewritten(path, self.edits, self._kinds, self._mark).splitlines()
        old = settings_text(path).splitlines()
        lines = []
        matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
        for step, i, j, k, m in matcher.get_opcodes():
            if step != "equal":
                lines += [f"{row + 1:4d} - {old[row]}" for row in range(i, j)]
                lines += [f"{row + 1:4d} + {new[row]}" for row in range(k, m)]
        return lines

    def write(self, path: File) -> Path | None:
        """Write what was found into the recording.toml that the recording was read from, with
        comments that have standard deviations and date; the path of the copy of the old one that is
        kept beside it, or None where nothing changes.

        Raises DataError where something is `unsure`, where it was written there before, and
        where the file is another one or cannot be changed; then nothing is.
        """
        if self.unsure:
            raise DataError(f"{path}: left as it is; {self.unsure[0]}")
        if not self.edits:
            return None
        target = Path(path).resolve()
        if target in self.written:
            raise DataError(f"{path}: has this already; read it and calibrate anew to change it")
        self._check_same(path)
        kept = rewrite(path, self.edits, self._kinds, self._mark)
        self.written[target] = kept
        return kept

    def page(self) -> "Page":
        """The page, with runs as given and as found, and some around each parameter."""
        from .page import page

        return page(self)

    def _check_same(self, path: File) -> None:
        """Refuse a file that has other values than those the edits start from. Raises DataError."""
        check_sections(path, self._kinds)
        read = self.given.meta.get("installed")
        differs = (
            "the recording was not read as a recording.toml has it"
            if read is None
            else difference(installed(load(path)), read)
        )
        if differs:
            raise DataError(f"{path}: {differs}; read that file and calibrate it")

    @property
    def _kinds(self) -> list[str]:
        return [a.kind for a in self.given.aidings]

    @property
    def _mark(self) -> str:
        return f"{datetime.date.today().isoformat()}, {MARK}"
