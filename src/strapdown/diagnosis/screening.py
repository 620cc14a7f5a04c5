"""A quick look for what of the installation may be wrong, at a small part of the cost of a run: the
closed loop over a thinned recording, and by how much each constant of the installation would have
made its innovations smaller (separate bias estimation, as `diagnose`, but one step of it)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import filters
from ..core import loop
from ..core.contract import POS, VEL, Imu, Noise, Start
from ..data import Aiding, Solution
from ..engine.prepare import Asked
from ..engine.sensitivity import begin_sensitive, fit, sums
from ..recording import Recording
from ..typing import Array
from ..verdict import Reason
from .findings import AXES, LEAST_Z, UNITS
from .installation import ARM, CLOCK, CONSTRAINED, GNSS, MOUNTING, SCALE, Model, constants
from .settling import Trial, Unknown, estimated, explained, groups

STEP, PACE, MOST = 0.5, 1.0, 1000
"""s: of the thinned samples, and between the fixes of a source that are used; and how many of them
are."""
LEAST = {CLOCK: 0.02, ARM: 0.3, MOUNTING: np.radians(1.0), SCALE: 0.005}
"""s, m, rad: smaller ones are no reason for doubt."""
HARMFUL = 3.0
"""Claimed standard deviations that an error must not exceed."""
EXPLAINED = 25.0
"""Of the sum of squared innovations: less is no reason for doubt."""
ARM_SHARE = 0.5
"""Of what a lever arm explains: its three numbers take up most of a clock's error too, but a clock
takes up less than a fifth of an arm's."""
PART_OF_EXCESS = 0.3
"""Of what the innovations are too large by; what explains less is a consequence and no cause."""


class Suspect(NamedTuple):
    """A group of unknowns that would explain innovations, estimated with all else as given."""

    unknowns: tuple[Unknown, ...]
    value: Array  # (q,) s, m, rad
    z: Array  # (q,) in standard deviations
    explained: float  # of the sum of squared whitened innovations
    excess: float  # of that sum over its expectation

    @property
    def likely(self) -> float:
        """What it explains, for comparison with others."""
        return self.explained * (ARM_SHARE if self.unknowns[0].kind == ARM else 1.0)


def thinned(recording: Recording) -> Recording:
    """The recording with a fix of each source every `PACE` s or more, of sources that say something of the
    installation, and with samples of `STEP` s, but whole ones at these fixes: a lever arm needs
    the angular rate of that moment."""
    imu, (begin, end) = recording.imu, recording.span
    pace = max(PACE, (end - begin) / MOST)
    aidings = tuple(_paced(a, pace) for a in thinned_sources(recording.aidings))
    part = np.floor((imu.t - begin) / max(STEP, pace / 2) - 1e-6)
    begins = np.r_[True, part[1:] != part[:-1]]
    at = np.concatenate([np.searchsorted(imu.t, a.t) for a in aidings] or [np.empty(0, int)])
    begins[at[at < len(begins)]] = True
    begins[at[at + 1 < len(begins)] + 1] = True
    first = np.flatnonzero(begins)
    last = np.r_[first[1:], len(part)] - 1
    samples = Imu(imu.t[last], *(np.add.reduceat(column, first) for column in imu[1:]))
    return Recording(samples, aidings)


def _paced(aiding: Aiding, pace: float) -> Aiding:
    number = np.floor(aiding.t / pace + 1e-6)
    return aiding._where(np.r_[True, number[1:] != number[:-1]])


def suspects(solution: Solution) -> list[Suspect]:
    """What would explain the innovations of a solution, the likeliest first; [] where nothing
    tells. Raises DataError."""
    assert solution.recording is not None
    recording = thinned(solution.recording)
    known = constants(recording.aidings)
    start, noise = Start(**solution.meta["start"]), Noise(**solution.meta["noise"])
    run = begin_sensitive(
        recording, filters.find("closed-loop"), Asked({}, start=start, noise=noise)
    )
    model = Model(run, known, True)
    found = sums(run, model.derivatives, model.start)
    fixes = run.out.fix[: run.cursor.at[loop.FIX]]
    measured = np.isfinite(fixes[:, loop.F_INNOVATION : loop.F_NIS]).sum()
    excess = float(np.nansum(fixes[:, loop.F_NIS]) - measured)
    trial = Trial(np.zeros(len(known)), fit(run), found, run)
    each = [_suspect(trial, group, excess) for group in groups(known)]
    return sorted(each, key=lambda suspect: -suspect.likely)


def _suspect(trial: Trial, group: Sequence[Unknown], excess: float) -> Suspect:
    one = estimated(trial, group, np.zeros_like(trial.theta))
    gain = explained(trial, group, one.step)
    return Suspect(tuple(group), one.value, one.z, gain, excess)


def reasons(solution: Solution) -> list[Reason]:
    """Reasons to doubt the installation of a solution, the likeliest first."""
    found = [each for each in suspects(solution) if _matters(each)]
    return [_reason(solution, each) for each in found[:1]]


def harm(solution: Solution, suspect: Suspect) -> float:
    """The error that it brings, over the standard deviation that the solution claims: of
    position, or of velocity where only that is concerned."""
    assert solution.recording is not None
    made, kind, size = solution.trajectory, suspect.unknowns[0].kind, np.abs(suspect.value).max()
    rows = slice(None, None, max(1, len(made.t) // 500))
    v, sd = made.v_n, made.sd
    assert v is not None and sd is not None
    of_position, of_velocity = (np.nanmedian(sd[rows, each].max(axis=1)) for each in (POS, VEL))
    speed = np.sqrt(np.nanmean((v[rows] ** 2).sum(axis=1)))
    if kind == ARM:
        return float(size / of_position)
    kinds = [a.kind for a in thinned_sources(solution.recording.aidings)]
    if kind == CLOCK and "position" in (kinds[i] for i in suspect.unknowns[0].sources):
        return float(size * speed / of_position)
    if kind == CLOCK:
        change = np.abs(np.diff(v[rows], axis=0)).sum(axis=1) / np.diff(made.t[rows])
        speed = np.sqrt(np.nanmean(change**2))
    return float(size * speed / of_velocity)


def thinned_sources(aidings: Sequence[Aiding]) -> list[Aiding]:
    """Those that say something of the installation."""
    return [a for a in aidings if a.kind in (*GNSS, *CONSTRAINED)]


def _matters(suspect: Suspect) -> bool:
    kind = suspect.unknowns[0].kind
    clear = (suspect.z > LEAST_Z) & (np.abs(suspect.value) > LEAST[kind])
    explains = suspect.explained > max(EXPLAINED, PART_OF_EXCESS * suspect.excess)
    return bool(clear.any() and explains)


def _reason(solution: Solution, suspect: Suspect) -> Reason:
    kind, recording = suspect.unknowns[0].kind, solution.recording
    assert recording is not None
    names = [a.name or a.kind for a in thinned_sources(recording.aidings)]
    sources = " and ".join(names[i] for i in suspect.unknowns[0].sources if kind != MOUNTING)
    unit, factor = UNITS[kind]
    clear = [i for i, z in enumerate(suspect.z) if z > LEAST_Z]
    values = ", ".join(
        f"{suspect.value[i] * factor:+.2g} {unit}"
        + (f" {AXES[kind][suspect.unknowns[i].axis]}" if kind in AXES else "")
        for i in clear
    )
    what = {
        CLOCK: f"its innovations ask for {values} on its time stamps",
        ARM: f"its innovations ask for an antenna {values} of where it is said to be",
        MOUNTING: f"the constraints ask for an IMU turned by {values}",
        SCALE: f"its speeds are too large by a factor of {1 + suspect.value[0]:.3f}",
    }[kind]
    return Reason(
        kind,
        f"{what}, {suspect.z.max():.0f} standard deviations ({LEAST_Z:.0f} at most)",
        "run `strapdown diagnose` for the value and what it changes",
        sources,
        max(1.0, harm(solution, suspect) / HARMFUL),
    )
