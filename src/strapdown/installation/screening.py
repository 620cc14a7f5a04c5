"""A quick look for what of the installation may be wrong, at a small part of the cost of a run: the
closed loop over a thinned recording, and by how much each constant of the installation would have
made its innovations smaller (separate bias estimation, as `diagnose`, but one step of it)."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import filters
from ..core.loop.contract import POS, STATES, VEL, InitialState, Noise
from ..core.mathematics.rotation import matrix_to_euler
from ..data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE, CalibrationParameter
from ..data.recording import Recording
from ..data.solution import GNSS, Solution, Source
from ..data.verdict import HEADING, HEIGHT, POSITION, TILT, VELOCITY, Reason, SetUpBound, Untested
from ..engine.options import run_options
from ..engine.sensitivity import begin_sensitive, fit, sums
from ..preprocessing.axes import rotation_matrix
from ..preprocessing.unbroken import sum_samples
from ..typing import Array
from .diagnose import MIN_CLOCK_ALONE
from .findings import MIN_GAIN, MIN_Z
from .iteration import Trial, Unknown, estimate_unknowns, groups, nis_decrease
from .model import OF_BODY, InstallationModel, apply_constants, constants, rotation
from .states import estimated_installation

STEP, PACE = 0.5, 1.0
"""s: of the thinned samples, and between the fixes of a source that are used."""
ROWS = 5000  # of a solution, in which motion is looked for
WINDOW = 1000.0
"""s that are looked at: of a longer recording those with the most motion."""
HARMFUL = 3.0
"""Claimed standard deviations that an error must not exceed."""
ARM_SHARE = 0.5
"""Share of what a lever arm explains: its three numbers take up most of a clock's error too, but a clock
takes up less than a fifth of an arm's."""
PART_OF_EXCESS = 0.3
"""Share of the excess of the innovations: what explains less is a consequence and no cause."""


DETECTED = 1.64
"""Standard deviations beyond a threshold at which an error is seen in 95 of 100 recordings."""


class Suspect(NamedTuple):
    """A group of unknowns that would explain innovations, estimated with all else as given."""

    unknowns: tuple[Unknown, ...]  # of one parameter
    value: Array  # (q,) s, m, rad
    std: Array  # (q,) of the value
    explained: float  # of the sum of squared whitened innovations
    excess: float  # of that sum over its expectation

    @property
    def of(self) -> CalibrationParameter:
        """The parameter."""
        return self.unknowns[0].of

    @property
    def z(self) -> Array:
        """(q,) the values in standard deviations."""
        return np.abs(self.value) / self.std

    @property
    def likely(self) -> float:
        """The score for comparison with others: what it explains, less for a lever arm."""
        return self.explained * (ARM_SHARE if self.of is LEVER_ARM else 1.0)


def window(solution: Solution) -> tuple[Recording, InitialState]:
    """The part of the recording to look at, and the InitialState that the solution has there."""
    assert solution.recording is not None
    recording, start = solution.recording, InitialState(**solution.meta["start"])
    made, seconds = solution.trajectory, recording.span[1] - start.t
    if seconds <= WINDOW or made.v_n is None or made.std is None:
        return recording, start
    some = made.take(slice(None, None, max(1, len(made.t) // ROWS)))
    assert some.v_n is not None
    change = np.nan_to_num(np.abs(np.diff(some.v_n, axis=0)).sum(axis=1))
    motion = np.r_[0.0, np.cumsum(change)]
    last = np.searchsorted(some.t, some.t + WINDOW)
    best = int(np.argmax(motion[np.minimum(last, len(motion) - 1)] - motion))
    end = float(some.t[best]) + WINDOW
    if best == 0:
        return recording.between(stop=start.t + WINDOW), start
    there = start_at_row(solution, int(np.searchsorted(made.t, some.t[best])))
    return recording.between(there.t, end), there


def start_at_row(solution: Solution, row: int) -> InitialState:
    """An InitialState at a row of a solution of all states, from what it says there."""
    start, made = InitialState(**solution.meta["start"]), solution.trajectory
    assert made.v_n is not None and made.std is not None
    return start._replace(
        t=float(made.t[row]),
        lla=tuple(made.lla[row].tolist()),
        v_n=tuple(made.v_n[row].tolist()),
        rph=tuple(made.rph[row].tolist()),
        b_a=tuple(np.nan_to_num(solution.b_a[row]).tolist()),
        b_g=tuple(np.nan_to_num(solution.b_g[row]).tolist()),
        std=tuple(np.where(np.isfinite(made.std[row]), made.std[row], start.std[:STATES]).tolist()),
    )


def as_found(
    solution: Solution, recording: Recording, start: InitialState
) -> tuple[Recording, InitialState]:
    """A recording and a start of it, set up as the filter of the solution estimated; as they are
    where it estimated nothing of the installation."""
    known, names = (
        constants(recording.sources),
        [a.name or a.kind for a in recording.sources],
    )
    theta, turn = np.zeros(len(known)), np.zeros(3)
    for each in estimated_installation(solution).parameters:
        for k, (of, sources, axis) in enumerate(known):
            if (of, axis) == (each.of, each.axis) and names[sources[0]] in each.sources:
                theta[k] = each.change / of.factor
                turn[axis] += theta[k] if of is MOUNTING else 0.0
    if turn.any():  # the body turns, and what is known of it
        R = rotation(turn)
        C = rotation_matrix(*start.rph) @ R.T
        start = start._replace(
            rph=tuple(matrix_to_euler(C)),
            b_a=tuple((R @ start.b_a).tolist()),
            b_g=tuple((R @ start.b_g).tolist()),
        )
    return apply_constants(recording, known, theta), start


def thin_recording(recording: Recording) -> Recording:
    """The recording with a fix of each source every `PACE` s or more, of sources that say something
    of the installation, and with samples of `STEP` s, but whole ones at these fixes, because a lever
    arm needs the angular rate of that moment. Nothing is summed across a gap."""
    imu = recording.imu
    sources = tuple(map(_thin_fixes, of_installation(recording.sources)))
    part = np.floor((imu.t - recording.span[0]) / STEP - 1e-6)
    begins = np.r_[True, part[1:] != part[:-1]]
    at = np.concatenate([np.searchsorted(imu.t, a.t) for a in sources] or [np.empty(0, int)])
    begins[at[at < len(begins)]] = True
    begins[at[at + 1 < len(begins)] + 1] = True
    return Recording(sum_samples(imu, begins), sources)


def _thin_fixes(source: Source) -> Source:
    number = np.floor(source.t / PACE + 1e-6)
    return source._where(np.r_[True, number[1:] != number[:-1]])


def suspects(solution: Solution) -> list[Suspect]:
    """Return the parameters that would explain the innovations of a solution, the likeliest first;
    [] where its sources have none. Raises DataError."""
    part, start = as_found(solution, *window(solution))
    recording, noise = thin_recording(part), Noise(**solution.meta["noise"])
    known = constants(recording.sources)
    run = begin_sensitive(
        recording, filters.find("closed-loop"), run_options(start=start, noise=noise, estimate=())
    )
    model = InstallationModel(run, known, True)
    found = sums(run, model.derivatives, model.start)
    fixes = run.out.fix[: run.cursor.state[0].fix]
    measured = np.isfinite(fixes["innovation"]).sum()
    excess = float(np.nansum(fixes["nis"]) - measured)
    trial = Trial(np.zeros(len(known)), fit(run), found, run)
    each = [_suspect(trial, group, excess) for group in groups(known)]
    return sorted(each, key=lambda suspect: -suspect.likely)


def _suspect(trial: Trial, group: Sequence[Unknown], excess: float) -> Suspect:
    one = estimate_unknowns(trial, group, np.zeros_like(trial.theta))
    gain = nis_decrease(trial, group, one.step)
    return Suspect(tuple(group), one.value, one.std, gain, excess)


class Looked(NamedTuple):
    """Findings of a quick look at the installation."""

    reasons: list[Reason]  # to doubt it
    unknown: list[Untested]  # what of it the motion does not show
    bounds: list[SetUpBound]  # what of it would have shown


NOTHING = Looked([], [], [])


def look(solution: Solution) -> Looked:
    """Look at the installation of a solution: reasons to doubt it, and what of it its motion does and does
    not show. Raises DataError."""
    found = [each for each in suspects(solution) if not _is_estimated(solution, each)]
    alone = not _has(solution, "velocity")
    likely = [each for each in found if _matters(each, alone)]
    reasons = [_reason(solution, each) for each in likely[:1]]
    if alone:
        return Looked(reasons, [], [])
    unknown = [one for each in found for one in _note_unknown(solution, each)]
    # of clocks one line is enough: that of all, which is known best
    clocks = [one for one in unknown if one.cause == CLOCK.cause]
    bounds = [bound for each in found for bound in _bounds(solution, each)]
    return Looked(reasons, [one for one in unknown if one not in clocks[1:]], bounds)


def _bounds(solution: Solution, suspect: Suspect) -> Iterator[SetUpBound]:
    """The smallest error of each component that would have been a reason in 95 of 100 recordings like
    this, where it is shown at all."""
    of = suspect.of
    what = f"{of.cause} of {_source_names(solution, suspect)}"
    for std, unknown in zip(suspect.std, suspect.unknowns):
        if std <= of.known_std:
            size = max(MIN_Z * std, of.min_doubted) + DETECTED * std
            yield SetUpBound(
                of.cause, what, float(size * of.factor), of.unit, of.components[unknown.axis]
            )


def _is_estimated(solution: Solution, suspect: Suspect) -> bool:
    """Return True where the suspect's parameters were states of the filter, which reports on them
    itself."""
    assert solution.recording is not None
    names = [a.name or a.kind for a in of_installation(solution.recording.sources)]
    own = {
        name
        for each in estimated_installation(solution).parameters
        if each.of is suspect.of
        for name in each.sources
    }
    return all(names[i] in own for i in suspect.unknowns[0].sources)


def _has(solution: Solution, kind: str) -> bool:
    assert solution.recording is not None
    return any(a.kind == kind for a in solution.recording.sources)


def _note_unknown(solution: Solution, suspect: Suspect) -> Iterator[Untested]:
    of, worse = suspect.of, [i for i, std in enumerate(suspect.std) if std > suspect.of.known_std]
    if not worse:
        return
    axes = [suspect.unknowns[i].axis for i in worse]
    named = [f"{of.cause} of {_source_names(solution, suspect)}"]
    named += [of.components[axis] for axis in axes if of.components[axis]]
    shows = dict.fromkeys(of.motions[axis] for axis in axes)
    rests = dict.fromkeys(quantity for axis in axes for quantity in _quantities_of(of, axis))
    yield Untested(
        ", ".join(named),
        f"known only to +-{of.size(suspect.std[worse].max())}",
        f"to show it, {' and '.join(shows)}",
        tuple(rests),
        of.cause,
    )


def _quantities_of(of: CalibrationParameter, axis: int) -> tuple[str, ...]:
    """Quantities of a solution that a component of a parameter sets off."""
    if of is LEVER_ARM:
        return (HEIGHT,) if axis == 2 else (POSITION,)
    if of is MOUNTING:
        return (HEADING,) if axis == 2 else (TILT,)
    return (POSITION, VELOCITY)


def _source_names(solution: Solution, suspect: Suspect) -> str:
    """Names of the sources that it concerns."""
    assert solution.recording is not None
    names = [a.name or a.kind for a in of_installation(solution.recording.sources)]
    if suspect.of is MOUNTING:
        return "the IMU"
    return " and ".join(names[i] for i in suspect.unknowns[0].sources)


def harm(solution: Solution, suspect: Suspect) -> float:
    """The error that it brings, over the standard deviation that the solution claims: of
    position, or of velocity where only that is concerned."""
    assert solution.recording is not None
    made, of, size = solution.trajectory, suspect.of, np.abs(suspect.value).max()
    rows = slice(None, None, max(1, len(made.t) // 500))
    v, std = made.v_n, made.std
    assert v is not None and std is not None
    if not np.isfinite(std[rows, :6]).all(axis=0).any():
        return HARMFUL  # the filter claims nothing
    of_position, of_velocity = (np.nanmedian(std[rows, each].max(axis=1)) for each in (POS, VEL))
    speed = np.sqrt(np.nanmean((v[rows] ** 2).sum(axis=1)))
    if of is LEVER_ARM:
        return float(size / of_position)
    kinds = [a.kind for a in of_installation(solution.recording.sources)]
    if of is CLOCK and "position" in (kinds[i] for i in suspect.unknowns[0].sources):
        return float(size * speed / of_position)
    if of is CLOCK:
        change = np.abs(np.diff(v[rows], axis=0)).sum(axis=1) / np.diff(made.t[rows])
        speed = np.sqrt(np.nanmean(change**2))
    return float(size * speed / of_velocity)


def of_installation(sources: Sequence[Source]) -> list[Source]:
    """Those that say something of the installation."""
    return [a for a in sources if a.kind in (*GNSS, *OF_BODY)]


def _matters(suspect: Suspect, alone: bool) -> bool:
    """Return True where the suspect is a reason; of positions `alone`, without velocities, only a
    clock is."""
    of = suspect.of
    least = MIN_CLOCK_ALONE if alone else of.min_doubted
    clear = (suspect.z > MIN_Z) & (np.abs(suspect.value) > least) & (not alone or of is CLOCK)
    explains = suspect.explained > max(MIN_GAIN, PART_OF_EXCESS * suspect.excess)
    return bool(clear.any() and explains)


def _reason(solution: Solution, suspect: Suspect) -> Reason:
    of = suspect.of
    sources = "" if of is MOUNTING else _source_names(solution, suspect)
    values = ", ".join(
        f"{value * of.factor:+.2g} {of.unit} {of.components[unknown.axis]}".rstrip()
        for value, unknown, z in zip(suspect.value, suspect.unknowns, suspect.z)
        if z > MIN_Z
    )
    what = {
        CLOCK: f"the innovations fit better with {values} added to the time stamps",
        LEVER_ARM: f"the innovations fit better with the antenna moved by {values}",
        MOUNTING: f"the constraints fit better with the IMU rotated by {values}",
        SCALE: f"the speeds are too large by a factor of {1 + suspect.value[0]:.3f}",
    }[of]
    times = harm(solution, suspect)
    return Reason(
        of.cause,
        f"{what}, {suspect.z.max():.0f} standard deviations ({MIN_Z:.0f} at most); it causes "
        f"errors of about {times:.0f} claimed standard deviations",
        "run `strapdown diagnose` for the value and its effect",
        sources,
        max(1.0, times / HARMFUL),
    )
