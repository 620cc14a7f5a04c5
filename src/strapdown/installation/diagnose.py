"""`diagnose`: what of an installation is wrong, from runs of the filter itself: clock offsets, lever
arms, mounting and odometer scale, each found, consistent with what was given, or not observable.
"""

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from .. import filters
from ..checks import DataError
from ..core.loop.contract import Filter
from ..data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE, CalibrationParameter
from ..data.recording import Recording, check_recording
from ..engine.finish import solution
from ..engine.installation import as_given
from ..engine.options import RunOptions, SetUpOptions, run_options, takes
from ..engine.prepare import Run
from ..engine.sensitivity import begin_sensitive, check_sensitive, fit, sums
from ..inspection.motion import InspectedRecording
from ..progress import listener, with_bar
from ..typing import Array, Mask, Progress
from .coarse_clocks import check_axes, coarse_clocks
from .findings import (
    CONSISTENT,
    FOUND,
    MIN_GAIN,
    MIN_Z,
    MISFIT,
    NOT_OBSERVABLE,
    Diagnosed,
    Diagnosis,
    edits,
    line,
    reasons,
    unknown_name,
)
from .iteration import (
    MAX_RUNS,
    Estimated,
    Settling,
    Trial,
    Unknown,
    estimate_unknowns,
    full_theta,
    receiver_clocks,
    split_clocks,
    unknowns,
)
from .model import SHOWN_BY, InstallationModel, apply_constants, constants

MIN_CLOCK_ALONE = 0.5
"""s: a smaller offset of a clock is not reported where no source measures velocity."""
COARSE_GAIN = 0.8
"""A coarse step is believed where it takes the mean NIS, 30 at most each, below this share."""


@takes(SetUpOptions)
@with_bar("diagnose")
def diagnose(
    recording: Recording,
    filter: str | Filter = "closed-loop",
    *,
    options: dict[str, Any] | None = None,
    progress: Progress | bool | None = None,
    **set_up: Unpack[SetUpOptions],
) -> Diagnosis:
    """Find errors in the installation of a recording: clock offsets of the GNSS and of an odometer,
    lever arm of the antenna, mounting of the IMU, scale of odometer, Doppler log, airspeed or ranges.

    Each parameter is estimated from the innovations of the filter (separate bias estimation,
    Friedland 1969) and applied; then the filter runs again until nothing changes:
    `iteration.MAX_RUNS` runs at most. The states that the recording asks for are not estimated
    here. Without a source of velocity only a clock offset beyond 0.5 s is reported.

    Parameters
    ----------
    recording : Recording
        With a source of position.
    filter : str or Filter
        The closed loop or another filter of the closed-loop family.
    options : dict
        Options that belong to this filter, {name: value}.
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Returns
    -------
    Diagnosis
        Every parameter with its estimate, and what to change in recording.toml.

    Raises
    ------
    DataError
        Without a source of position, and as of `fuse`.

    References
    ----------
    Friedland (1969), "Treatment of bias in recursive filtering", IEEE Transactions on Automatic Control
    14(4).
    """
    asked = run_options(options=options, estimate=(), **set_up)
    return _Runs(recording, filter, asked, listener(progress)).diagnosis()


class _Runs:
    """The runs of one `diagnose`."""

    def __init__(
        self,
        recording: Recording,
        filter: str | Filter,
        asked: RunOptions,
        progress: Progress,
    ) -> None:
        check_recording(recording)
        self.recording, self.filter, self.asked = recording, filters.find(filter), asked
        check_sensitive(self.filter)
        self.kinds = [a.kind for a in recording.sources if len(a.t)]
        if "position" not in self.kinds:
            raise DataError(
                "the installation cannot be diagnosed without a source of position: add one"
            )
        self.constants = constants(recording.sources)
        self.progress = progress
        self.way = Settling(self.run, np.zeros(len(self.constants)))

    def run(self, theta: Array) -> Trial:
        """The filter over the recording with its set-up changed by theta."""
        before, run = self.way.runs - 1, self.begin(theta)
        model = InstallationModel(run, self.constants, self.asked["start"] is None)
        found = sums(
            run,
            model.derivatives,
            model.start,
            lambda part: self.progress((before + part) / MAX_RUNS),
        )
        return Trial(theta, fit(run), found, run)

    def begin(self, theta: Array) -> Run:
        """A Run with the set-up changed by theta, before its first sample."""
        recording = apply_constants(self.recording, self.constants, theta)
        return begin_sensitive(recording, self.filter, self.asked)

    def diagnosis(self) -> Diagnosis:
        """All runs, and what they say."""
        first = self.way.run_trial(np.zeros(len(self.constants)))
        last = self.roughly(first)
        if last.made.cursor.state[0].fault:
            raise DataError(
                f"{self.filter.name} stops before the end of the recording: run `fuse` to see why"
            )
        of_receivers = self.way.centre[receiver_clocks(self.constants)]
        split = bool(np.ptp(of_receivers) > 0)
        clocks = [each for each in unknowns(self.constants, split) if each.of is CLOCK]
        last = self.way.iterate(last, clocks)
        if "velocity" not in self.kinds:
            return self.make_diagnosis(first, last, clocks)
        split = split or self.clocks_differ(last)
        last = self.way.iterate(last, unknowns(self.constants, split))
        if not split and self.clocks_differ(last):
            last = self.way.iterate(last, unknowns(self.constants, split=True))
        return self.make_diagnosis(first, last, unknowns(self.constants, self.clocks_differ(last)))

    def roughly(self, first: Trial) -> Trial:
        """The trial to settle from: with the clocks that the motion itself shows, where `first`
        fits badly and they improve it. Raises DataError where something else is wrong."""
        subject = InspectedRecording(self.recording)
        check_axes(subject)
        if first.fit.misfit <= MISFIT:
            return first
        for theta in coarse_clocks(subject, self.constants):
            new = self.way.run_trial(theta)
            if new.fit.cost < COARSE_GAIN * first.fit.cost:
                self.way.centre = theta
                return new
        return first

    def clocks_differ(self, trial: Trial) -> bool:
        """Return True where the clocks of the GNSS sources differ from each other."""
        together = unknowns(self.constants)
        others = split_clocks(self.constants)[
            1:
        ]  # beside what is common to all: by how much they differ from the first
        found = estimate_unknowns(trial, [*others, *together], self.way.centre)
        return any(self.wrong(each, found, i) for i, each in enumerate(others))

    def with_room_for_clocks(self, last: Trial, sought: Sequence[Unknown]) -> Estimated:
        """The unknowns by the last trial. The standard deviation of a clock that several sources share
        has room for the clock of each, which may differ by too little to be reported."""
        final = estimate_unknowns(last, sought, self.way.centre)
        shared = [i for i, each in enumerate(sought) if each.of is CLOCK and len(each.sources) > 1]
        if not shared:
            return final
        small = CLOCK._replace(given_std=CLOCK.min_reported)
        others = [each._replace(of=small) for each in split_clocks(self.constants)[1:]]
        found = estimate_unknowns(last, [*others, *sought], self.way.centre)
        place = shared[0]
        values = found.value[len(others) + place] + np.r_[0.0, found.value[: len(others)]]
        std = final.std.copy()
        std[place] = np.hypot(std[place], np.abs(values - final.value[place]).max())
        return final._replace(std=std)

    def make_diagnosis(self, first: Trial, last: Trial, sought: Sequence[Unknown]) -> Diagnosis:
        """Return the diagnosis of the sought parameters by the last trial."""
        final = self.with_room_for_clocks(last, sought)
        wrong = self.surely(last, sought, final)
        value, theta, best = final.value, first.theta, first.made
        if wrong.any():
            some = [each for each, one in zip(sought, wrong) if one]
            theta = full_theta(some, value[wrong])
            best = self.begin(theta)
            best.complete()
            self.way.runs += 1
        gain = (first.fit.cost - fit(best).cost) * first.fit.fixes
        if gain <= MIN_GAIN:
            wrong, gain = np.zeros(len(sought), bool), 0.0
            theta, best = first.theta, first.made
        shares = (value / final.model_std) ** 2 * wrong
        shares *= gain / max(shares.sum(), 1e-300)
        estimates = [
            self.estimate(each, final, i, float(value[i]), bool(wrong[i]), float(shares[i]))
            for i, each in enumerate(sought)
        ]
        found = [
            (each.of, each.sources, each.axis, float(x), float(std))
            for each, x, std, one in zip(sought, value, final.std, wrong)
            if one
        ]
        lines: dict[str, list[str]] = {}
        for edit in edits(self.recording, found):
            lines.setdefault(edit.of.cause, []).append(line(self.recording.sources, edit))
        self.progress(1.0)
        return Diagnosis(
            tuple(estimates + self.never(sought)),
            apply_constants(self.recording, self.constants, theta),
            solution(best),
            self.way.runs,
            gain,
            fit(best).misfit,
            reasons(estimates, lines),
            tuple(text for own in lines.values() for text in own),
        )

    def wrong(self, unknown: Unknown, final: Estimated, i: int) -> bool:
        """Return True where the i-th estimate is large and significant enough to report."""
        least = unknown.of.min_reported
        if "velocity" not in self.kinds:
            least = MIN_CLOCK_ALONE if unknown.of is CLOCK else np.inf
        return bool(abs(final.value[i]) > least and final.z[i] > MIN_Z)

    def alone(self, last: Trial, some: Sequence[Unknown], value: Array) -> Estimated:
        """The unknowns `some` with all others as given."""
        theta = full_theta(some, value)
        there = last._replace(theta=theta, sums=last.sums.shift(theta - last.theta))
        return estimate_unknowns(there, some, self.way.centre)

    def surely(self, last: Trial, sought: Sequence[Unknown], final: Estimated) -> Mask:
        """Which of those sought are wrong (q,), also with all others as given."""
        wrong = np.array([self.wrong(each, final, i) for i, each in enumerate(sought)])
        while wrong.any():
            some = [each for each, one in zip(sought, wrong) if one]
            alone = self.alone(last, some, final.value[wrong])
            sure = np.array([self.wrong(each, alone, k) for k, each in enumerate(some)])
            if sure.all():
                break
            wrong[np.flatnonzero(wrong)[~sure]] = False
        return wrong

    def estimate(
        self, unknown: Unknown, final: Estimated, i: int, value: float, wrong: bool, gain: float
    ) -> Diagnosed:
        """The i-th estimate in the terms of recording.toml."""
        of, axis, std = unknown.of, unknown.axis, float(final.std[i])
        sources = [self.recording.sources[k] for k in unknown.sources]
        names = tuple(a.name or a.kind for a in sources)
        status = FOUND if wrong else NOT_OBSERVABLE if std > of.known_std else CONSISTENT
        motion = of.motions[axis]
        if "velocity" not in self.kinds and status == CONSISTENT:
            status = NOT_OBSERVABLE
            motion = (
                f"add a source of velocity: positions alone show only {MIN_CLOCK_ALONE:g} s and "
                "more"
            )
        antennas = sum(each.of is LEVER_ARM for each in self.constants) // 3
        return Diagnosed(
            of,
            axis,
            unknown_name(unknown, names, antennas),
            names,
            status,
            0.0 if of is MOUNTING else as_given(self.recording, of, axis, unknown.sources),
            value * of.factor,
            std * of.factor,
            motion,
            gain,
            tuple((float(x * of.factor), float(s * of.factor)) for x, s in final.halves[i]),
        )

    def never(self, sought: Sequence[Unknown]) -> list[Diagnosed]:
        """Return the parameters that no motion can show with these sources, and what is missing."""
        known = {(each.of, each.axis) for each in sought}
        never = [
            each
            for each in (
                *((LEVER_ARM, axis) for axis in range(3)),
                *((MOUNTING, axis) for axis in SHOWN_BY),
                (SCALE, 0),
            )
            if each not in known
        ]
        return [
            Diagnosed(
                of,
                axis,
                unknown_name(Unknown(of, (), axis, np.zeros(0)), (), 1),
                (),
                NOT_OBSERVABLE,
                *(np.nan, np.nan, np.nan),
                self.missing_source(of, axis),
            )
            for of, axis in never
        ]

    def missing_source(self, of: CalibrationParameter, axis: int) -> str:
        """The source without which no motion shows a component."""
        if of is MOUNTING:
            return f"on a road vehicle, add the constraint {SHOWN_BY[axis]}"
        if of is SCALE:
            return "add an odometer (kind speed), a Doppler log or an airspeed"
        return "add a source of velocity"
