"""The search for the maximum of the likelihood over a recording, in steps that `tune` takes."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace

import numpy as np

from ..aiding import find
from ..checks import DataError
from ..core.loop.contract import Filter, InitialState
from ..data.recording import Recording
from ..data.solution import Solution, Source
from ..engine.batch import begin, fuse
from ..engine.options import RunOptions
from ..engine.prepare import Run
from ..evaluation.fix_statistics import correlation, counts, lasts
from ..sensor_models.imu import ImuSpec
from ..typing import Array, Mask
from .fisher_scoring import LikelihoodProfile, Top, climb, profile
from .likelihood import Likelihood
from .numbers import IMU, TIME, WHITE
from .outliers import rough, run_at, used_masks
from .part import check_length, part, smoothed_start
from .time_correlation import with_lasting
from .unknowns import (
    APART,
    NoiseUnknown,
    imu_with,
    noise_with,
    of_imu,
    of_source,
    sources_with,
)

MIN_OF_SOURCE = 20
"""Fixes: of a source with fewer nothing is sought."""
AGAIN = 0.005
"""Share of the fixes that must change sides between outliers and others for another search."""
MAX_CLIMBS = 3  # from a better place that a profile met
SMOOTHED = 2  # times that the start is taken from a smoother
CORRELATED_FROM = 0.1
"""Correlation one fix apart from which correlated errors are tried in sources of any kind."""


class Search:
    """The state of the search: `likelihood` and its maximum `top`."""

    def __init__(
        self,
        recording: Recording,
        filter: Filter,
        spec: ImuSpec,
        asked: RunOptions,
        seconds: tuple[float | None, float | None],
    ) -> None:
        self.recording, self.filter, self.spec, self.asked = recording, filter, spec, asked
        self.before = self.fuse(recording, spec)
        self.run = self._begin_run(*part(self.before, *seconds))
        self.seconds = (self.run.start.t, self.run.recording.span[1])
        sources = self.run.recording.sources
        self.given = [_index(a, recording.sources) for a in sources]
        recorded = [s for s, a in enumerate(sources) if find(a.kind).recorded]
        self.counted = np.array([s for s in recorded if self.given[s] >= 0])
        fixes = {int(s): int((sources[s].t > self.run.start.t).sum()) for s in self.counted}
        self._check(sum(fixes.values()))
        self.unknowns = of_imu(self.run.noise)
        for s, many in fixes.items():
            if many >= MIN_OF_SOURCE:
                self.unknowns += of_source(sources[s], s)
        self._runs = 0  # of likelihoods that are left
        self.lasting: set[int] = set()  # sources whose innovations stay correlated
        self._least: Array  # (p,) below which no logarithm is made then
        self.likelihood: Likelihood
        self.top: Top

    def fuse(self, recording: Recording, spec: ImuSpec) -> Solution:
        """A Solution, as it was asked for."""
        asked: RunOptions = {**self.asked, "imu": spec}
        return fuse(recording, self.filter, **asked)

    def _begin_run(self, recording: Recording, start: InitialState) -> Run:
        return begin(recording, self.filter, {**self.asked, "start": start})

    def _check(self, fixes: int) -> None:
        """Refuse what is too short, and a filter without a likelihood. Raises DataError."""
        check_length(self.run.recording, self.run.start, fixes)
        root = self.before.innovations.root
        if root is None or not np.isfinite(root).any():
            raise DataError(
                f"{self.filter.name} gives no covariance of its innovations, and so no "
                "likelihood; use closed-loop"
            )

    @property
    def runs(self) -> int:
        """Number of runs of the filter."""
        return self._runs + self.likelihood.runs

    @property
    def theta(self) -> Array:
        """(p,) the logarithms found so far."""
        return self.top.point.theta

    def first(self) -> None:
        """Rough factors and a maximum; then the start anew with the noise found, and the maximum
        of the fixes that are no outliers by it."""
        begun = rough(self.run, self.asked, self.unknowns)
        self._climb(begun.theta, begun.kept)
        solution = self.fuse(*self.tuned_setup(self.theta))
        _, start = part(solution, *self.seconds)
        self.run = self._begin_run(self.run.recording, start)
        self._climb(self.theta, self._used_masks())
        for _ in range(SMOOTHED if self.filter.smoother else 0):
            self._smooth_start()

    def _smooth_start(self) -> None:
        """Begin where the smoother says, as uncertain as before, if that is likelier: from far off,
        the filter would keep wrong covariances for minutes."""
        before, theta = self.run, self.theta
        start = smoothed_start(self.likelihood.ready(theta), self.asked)
        self.run = self._begin_run(before.recording, start)
        likelihood = Likelihood(
            self.run, self.asked, self.unknowns, self.counted, self.likelihood.kept
        )
        self._runs += 1
        if likelihood.at(theta).mean > self.top.point.mean:
            self._climb(theta, self._used_masks())
        else:
            self.run = before

    def explain(self) -> None:
        """Where the innovations of a source stay correlated, the model lacks something: correlated
        errors that were found do not explain it and are left out, and neither its noise nor that of
        the IMU is made smaller."""
        self.lasting = self._unexplained_sources()
        if not self.lasting:
            return
        stays = [
            j
            for j, each in enumerate(self.unknowns)
            if each.place not in self.lasting or each.what is WHITE or each.given
        ]
        theta, self.unknowns = self.theta[stays], [self.unknowns[j] for j in stays]
        self._least = np.array(
            [
                np.log(each.given) if each.given and self._of_lasting(each) else -np.inf
                for each in self.unknowns
            ]
        )
        self._climb(np.maximum(theta, self._least), self.likelihood.kept)

    def _of_lasting(self, each: NoiseUnknown) -> bool:
        return each.source == IMU or (each.place in self.lasting and each.what is not TIME)

    def _unexplained_sources(self) -> set[int]:
        """The sources whose whitened innovations stay correlated, among the fixes that count or
        among all that the filter uses."""
        solution, found = self.fuse(*self.tuned_setup(self.theta)), set[int]()
        for s in map(int, self.counted):
            a = self.likelihood.sources[s]
            _, used, _ = counts(solution.innovations, a.name or a.kind, *self.seconds)
            counted = correlation(self.top.point.seen.whitened[self._of(s)])
            if lasts(counted) or lasts(used):
                found.add(s)
        return found

    def held_unknowns(self, theta: Array) -> list[int]:
        """Unknowns that would be smaller, but stay as given."""
        if not self.lasting:
            return []
        return [int(j) for j in np.flatnonzero(theta <= self._least + 1e-9)]

    def _used_masks(self) -> list[Mask]:
        return used_masks(run_at(self.run, self.asked, self.unknowns, self.theta))

    def _climb(self, theta: Array, kept: Sequence[Mask]) -> None:
        self._go_on(Likelihood(self.run, self.asked, self.unknowns, self.counted, kept))
        if self.lasting:
            self.likelihood.low = np.maximum(self.likelihood.low, self._least)
        self.top = climb(self.likelihood, theta, np.arange(len(self.unknowns)))

    def _go_on(self, likelihood: Likelihood) -> None:
        self._runs += self.likelihood.runs if hasattr(self, "likelihood") else 0
        self.likelihood = likelihood

    def correlate(self) -> list[str]:
        """Give sources correlated errors where the likelihood pays for them. Returns notes."""
        notes, tried = [], []
        if not self.filter.installation:
            return [
                f"{self.filter.name} has no states of time-correlated errors: tuning did not look "
                "for any"
            ]
        for s in self.counted:
            a = self.likelihood.sources[s]
            known = any(each.place == s for each in self.unknowns)
            lasts = abs(correlation(self.top.point.seen.whitened[self._of(s)])) > CORRELATED_FROM
            if known and a.correlated is None and (a.kind in APART or lasts):
                tried.append(s)
        for s in tried:
            found = with_lasting(self.likelihood, self.top, s)
            if found.pays:
                self._go_on(found.likelihood)
                self.top, self.unknowns = found.top, list(found.likelihood.unknowns)
            else:
                self._runs += found.likelihood.runs
                a = self.likelihood.sources[s]
                notes.append(f"{a.name or a.kind}: the data show no time-correlated errors")
        kept = self._used_masks()
        changed = sum(int((k != b).sum()) for k, b in zip(kept, self.likelihood.kept))
        if changed > AGAIN * sum(len(k) for k in kept):
            self._climb(self.theta, kept)
        return notes

    def _of(self, s: int) -> Mask:
        return self.top.point.seen.source == s

    def profiles(self, tell: Callable[[float], None]) -> list[LikelihoodProfile]:
        """The LikelihoodProfile of each unknown; where one meets a better place, from there again."""
        free = np.arange(len(self.unknowns))
        for climbs in range(MAX_CLIMBS):
            found = []
            for j in free:
                found.append(profile(self.likelihood, self.top, int(j)))
                tell((j + 1) / len(free))
                if (better := found[-1].better) and climbs < MAX_CLIMBS - 1:
                    self.top = climb(self.likelihood, better.theta, free, point=better)
                    break
            else:
                break
        return found

    def tuned_setup(self, theta: Array) -> tuple[Recording, ImuSpec]:
        """The recording and the IMU with these logarithms, the recording naming this IMU."""
        unknowns = [
            replace(each, place=self.given[each.place]) if each.place >= 0 else each
            for each in self.unknowns
        ]
        sources = sources_with(self.recording.sources, unknowns, theta)
        noise = noise_with(self.spec.noise(), unknowns, theta)
        said = f"noise tuned on {self.recording.meta.get('name', 'a recording')}"
        spec = imu_with(self.spec, noise, said)
        return replace(self.recording, sources=sources).with_meta(grade=asdict(spec)), spec

    def left_out(self) -> int:
        """Fixes that do not count."""
        return sum(int((~self.likelihood.kept[s]).sum()) for s in self.counted)


def _index(a: Source, sources: Sequence[Source]) -> int:
    """Where a source of a run stands in a recording; -1 where it was made on the way."""
    same = [i for i, b in enumerate(sources) if (a.kind, a.name) == (b.kind, b.name)]
    return same[0] if same else -1
