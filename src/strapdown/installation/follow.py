"""Follow the advice of `diagnose` as far as the data decide, and say what that changed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Unpack, cast

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Filter
from ..data.calibration_parameters import MOUNTING
from ..data.recording import Recording
from ..data.solution import Solution
from ..data.value import Value
from ..data.verdict import SEVERITY, Verdict
from ..engine.batch import fuse
from ..engine.options import RunOptions, SetUpOptions, takes
from ..geometry.geodesy import displacement, wrap
from .diagnose import diagnose
from .findings import MISFIT, Diagnosis
from .iteration import NOTABLE


@dataclass(frozen=True, eq=False)
class Followed(Value):
    """Result of `follow`.

    Attributes
    ----------
    before, after : Solution
        Solution as given, and with the findings applied; the same if nothing was applied.
    diagnosis : Diagnosis or None
        None where the recording could not be diagnosed.
    stopped : str
        Why nothing was applied; empty where something was.
    """

    before: Solution
    after: Solution
    diagnosis: Diagnosis | None
    stopped: str = ""

    @property
    def applied(self) -> tuple[str, ...]:
        """The changes, as lines of recording.toml."""
        return () if self.stopped or self.diagnosis is None else self.diagnosis.changes

    @property
    def left(self) -> tuple[str, ...]:
        """Remedies that the verdict still asks for."""
        return tuple(reason.line for reason in self.after.verdict.reasons)

    @property
    def lines(self) -> list[str]:
        """For people: what was applied, or why nothing was, what it changed, what is left to do."""
        left = [f"left to you: {line}" for line in self.left]
        if self.stopped:
            return [f"nothing applied: {self.stopped}", *left]
        return [
            *(f"applied: {change}" for change in self.applied),
            f"this moves {_difference(self.before, self.after)}",
            f"verdict before: {self.before.verdict.word}; now: {self.after.verdict.word}",
            *left,
        ]

    def __str__(self) -> str:
        return "\n".join(self.lines)


@takes(RunOptions)
def follow(
    recording: Recording, filter: str | Filter = "closed-loop", **asked: Unpack[RunOptions]
) -> Followed:
    """Fuse a recording, apply what `diagnose` finds wrong of its installation, and fuse it again.

    Nothing is applied if the fixes still fit badly with the change, if the two halves of the
    recording give different values, or if the verdict does not improve. So each remedy is tested
    before it is applied.

    Parameters
    ----------
    recording : Recording
        With a source of position.
    filter : str or Filter
        Whose solutions are returned; the closed loop diagnoses.

    Returns
    -------
    Followed
        Both solutions, the diagnosis, what was applied or why nothing was.

    Raises
    ------
    DataError
        As of `fuse`.

    Examples
    --------
    >>> import strapdown as sd
    >>> print(sd.follow(sd.simulate("car", 120.0, seed=1)).stopped)
    the diagnosis found nothing wrong with the installation
    """
    return follow_with(recording, lambda part, run: fuse(part, filter, **run), **asked)


def follow_with(
    recording: Recording,
    make: Callable[[Recording, RunOptions], Solution],
    **asked: Unpack[RunOptions],
) -> Followed:
    """The same with solutions that `make` makes of a recording and the options of a run. Raises
    DataError."""
    before = make(recording, asked)
    keys = SetUpOptions.__optional_keys__
    set_up = cast(SetUpOptions, {key: value for key, value in asked.items() if key in keys})
    try:
        found = diagnose(recording, **set_up)
    except DataError as error:
        return Followed(before, before, None, str(error))
    if why := _reason_against(found):
        return Followed(before, before, found, why)
    turned = any(each.of is MOUNTING for each in found.found)
    run: RunOptions = {**asked, "start": None} if turned else asked
    after = make(found.recording, run)
    if not _is_better(after.verdict, before.verdict):
        why = f"the verdict is no better with {'; '.join(found.changes)} ({after.verdict.line})"
        return Followed(before, before, found, why)
    return Followed(before, after, found)


def _reason_against(found: Diagnosis) -> str:
    """Why the data do not decide what to apply; empty where they do."""
    if not found.found:
        return "the diagnosis found nothing wrong with the installation"
    if found.misfit > MISFIT:
        return (
            f"the NIS of the fixes is still {found.misfit:.1f} times its expectation with "
            f"{'; '.join(found.changes)}"
        )
    for each in found.found:
        (first, std), (second, other) = each.halves
        apart = abs(first - second)
        if np.isfinite(apart) and apart > NOTABLE * np.hypot(std, other):
            return (
                f"the two halves of the recording disagree on {each.name}: {first:+.3g} and "
                f"{second:+.3g} {each.unit}".rstrip()
            )
    return ""


def _is_better(after: Verdict, before: Verdict) -> bool:
    """True where a verdict is better than another, by its word, or by the weight of its reasons."""
    severity = [SEVERITY.index(each.word) for each in (after, before)]
    if severity[0] != severity[1]:
        return severity[0] > severity[1]
    weights = [sum(reason.weight for reason in each.reasons) for each in (after, before)]
    return weights[0] <= weights[1]


def _difference(before: Solution, after: Solution) -> str:
    """By how much two solutions of a recording differ at most, once both have begun."""
    a, b = before.trajectory, after.trajectory
    rows = np.flatnonzero((b.t >= a.t[0]) & (b.t <= a.t[-1]))
    b, a = b.take(rows), a.take(np.searchsorted(a.t, b.t[rows]))
    moved = displacement(b.lla, a.lla)
    parts = [f"the position by up to {np.nanmax(np.hypot(moved[:, 0], moved[:, 1])):.2g} m"]
    parts.append(f"the height by {np.nanmax(np.abs(moved[:, 2])):.2g} m")
    if a.v_n is not None and b.v_n is not None:
        parts.append(f"the velocity by {np.nanmax(np.linalg.norm(b.v_n - a.v_n, axis=1)):.2g} m/s")
    turned = np.degrees(np.nanmax(np.abs(wrap(b.rph[:, 2] - a.rph[:, 2]))))
    return ", ".join([*parts, f"the heading by {turned:.2g} deg"])
