"""Error model of a GNSS receiver: fixes of position and velocity at the antenna with white
noise, errors that last, outages and latency, as Source.

    y = h(truth) + c + w

w is white; c, where there is one, is a stationary first-order Gauss-Markov process of each axis,
drawn exactly over whatever time is between two fixes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_array, check_flag, check_number
from ..data.solution import Correlated, Source, Trajectory
from ..geometry.geodesy import radii, wrap
from ..typing import Array, Ints
from ..units.constants import MAX_TIME_CONSTANT
from .noise import gauss_markov
from .sampling import (
    arm_in_navigation,
    as_triple,
    check_interval,
    check_lever_arm,
    check_rate,
    fix_times,
    interpolate_trajectory,
)
from .streams import RandomStream, SeedLike


class Kept(NamedTuple):
    """Which fixes of a plan are measured, how they are stamped and gated, and what they state."""

    rows: Ints | None = None  # None: all
    latency: float = 0.0  # s, as of Gnss
    gate: float | None = None  # as of Source
    stated: bool = True  # as of Gnss


_ALL = Kept()
RECEIVER = "GNSS"
"""Name of the device that the classes share."""


class Spell(NamedTuple):
    """A time in which a receiver is in another state than its usual one: positions of another class, with
    the errors of that, or of the usual class and off by a constant, as a wrongly fixed ambiguity makes them."""

    start: float  # s
    stop: float  # s; itself outside
    name: str = ""  # of the class; "": the usual one
    position_std: tuple[float, ...] | float | None = None  # m; as of Gnss, of another class
    position_correlated: Correlated | None = None
    off: tuple[float, ...] = (0.0, 0.0, 0.0)  # m NED


class Gnss(NamedTuple):
    """A receiver: time between fixes, and standard deviations north, east, down; None means that
    it does not measure this."""

    interval: float | Array = 1.0  # s, or the times of the fixes themselves
    position_std: tuple[float, ...] | float | None = (1.0, 1.0, 1.5)  # m
    velocity_std: tuple[float, ...] | float | None = (0.1, 0.1, 0.1)  # m/s
    lever_arm: tuple[float, ...] = (0.0, 0.0, 0.0)  # from the IMU to the antenna, m, body
    # (start, stop) of windows in which no fix is measured, s; the stop itself is outside
    outages: tuple[tuple[float, ...], ...] = ()
    latency: float = 0.0  # s: each fix is stamped that much later than the instant it was measured
    # errors that last beside the white ones, standard deviations north, east, down; None: none
    position_correlated: Correlated | None = None  # m
    velocity_correlated: Correlated | None = None  # m/s
    # times in which it is in another state, and the name of its usual one; a source for each class
    spells: tuple[Spell, ...] = ()
    usual: str = "fixed"
    # whether the fixes state them as such; else their `std` is that of both parts together, as if
    # all were white
    stated: bool = True

    def fixes(self, trajectory: Trajectory, seed: SeedLike) -> tuple[Source, ...]:
        """The sources of a flight, position and velocity each from a random stream of its own;
        `seed` as of `ImuSpec.corrupt`. Raises DataError."""
        return self.plan(trajectory).fixes(seed)

    def plan(self, trajectory: Trajectory, gate: float | None = None) -> "Plan":
        """Return the Plan that all runs over one trajectory share; `gate` is that of its sources.
        Raises DataError."""
        self.check()
        rows = self._measured_rows(fix_times(trajectory, self.interval), trajectory.t[-1])
        kept = Kept(rows, self.latency, gate, self.stated)
        position = velocity = None
        classes: list[PositionPlan] = []
        if self.position_std is not None:
            position, *classes = self._positions(trajectory, kept)
        if self.velocity_std is not None:
            velocity = VelocityPlan.of(
                trajectory,
                self.interval,
                self.velocity_std,
                self.lever_arm,
                kept=kept,
                correlated=self.velocity_correlated,
            )
        return Plan(position, velocity, tuple(classes))

    def _positions(self, trajectory: Trajectory, kept: Kept) -> "list[PositionPlan]":
        """The plan of the positions of the usual class, and those of the other classes."""
        t = fix_times(trajectory, self.interval)
        state = np.full(len(t), self.usual, object)
        off, models = np.zeros((len(t), 3)), {self.usual: self.position_std}
        lasting = {self.usual: self.position_correlated}
        for spell in self.spells:
            within = (t >= spell.start) & (t < spell.stop)
            state[within] = name = spell.name or self.usual
            off[within] = spell.off
            if spell.name:
                models[name], lasting[name] = spell.position_std, spell.position_correlated
        measured = np.arange(len(t)) if kept.rows is None else kept.rows
        made = []
        for name, std in models.items():
            assert std is not None  # `check` has seen to it
            own = kept._replace(rows=measured[state[measured] == name]) if self.spells else kept
            plan = PositionPlan.of(
                trajectory, t, std, self.lever_arm, kept=own, correlated=lasting[name]
            )
            made.append(plan.of_class(name, off) if self.spells else plan)
        return made

    def check(self, rate: float = np.inf) -> None:
        """Raise DataError, in one line, where no receiver can be like that, beside an IMU of
        `rate` (Hz)."""
        if np.ndim(self.interval):
            check_array(self.interval, "times of the fixes", (None,), what="numbers, s")
        else:
            check_rate(1 / check_interval(self.interval), rate, "fixes")
        for std, correlated, name in (
            (self.position_std, self.position_correlated, "GNSS position"),
            (self.velocity_std, self.velocity_correlated, "GNSS velocity"),
        ):
            if std is not None:
                _deviations(std, name)
            _check_correlated(correlated, name, std is not None)
        for spell in self.spells:
            _check_spell(spell)
        check_flag(self.stated, "stated (whether GNSS fixes state their correlated errors)")
        check_lever_arm(self.lever_arm, "GNSS")
        check_number(self.latency, "latency of the fixes", "s", least=0)
        for window in self.outages:
            start, stop = check_array(
                window, "outage", (2,), finite=False, what="times (start, stop) in s"
            ).tolist()
            if not start < stop:
                raise DataError(
                    f"outage {window!r}: write (start, stop) in s, the start before the stop"
                )

    def describe(self) -> dict[str, Any]:
        """{field: value} for a manifest; without those of correlated errors where there are none,
        so that a receiver of before is described as before."""
        values = self._asdict()
        later = ("position_correlated", "velocity_correlated", "stated", "spells", "usual")
        return {
            name: value
            for name, value in values.items()
            if name not in later or value != self._field_defaults[name]
        }

    def _measured_rows(self, t: Array, end: float) -> Ints | None:
        """Rows of the fixes that are measured and, with their latency, come before the end; None
        where that is all of them."""
        keep = t + self.latency <= end + 1e-9 if self.latency else np.ones(len(t), bool)
        for start, stop in self.outages:
            keep &= (t < start) | (t >= stop)
        return None if keep.all() else np.flatnonzero(keep)


class Plan(NamedTuple):
    """Noise-free measurements of a receiver; each run adds its own noise. None: not measured."""

    position: "PositionPlan | None"
    velocity: "VelocityPlan | None"
    classes: "tuple[PositionPlan, ...]" = ()  # the positions of other classes of the receiver

    @property
    def parts(self) -> "dict[str, PositionPlan | VelocityPlan]":
        """{name of its random stream: plan} of what is measured."""
        own = {"position": self.position, "velocity": self.velocity}
        measured = {name: part for name, part in own.items() if part is not None}
        return measured | {part.source.name: part for part in self.classes}

    def fixes(self, seed: SeedLike) -> tuple[Source, ...]:
        """The sources of one run: position and velocity each from a random stream of its own."""
        stream = RandomStream.of(seed)
        return tuple(part.fixes(stream.child(name)) for name, part in self.parts.items())

    def exact(self) -> tuple[Source, ...]:
        """The sources with the noise left out but its standard deviations stated, and its
        correlated part as states whatever the noisy ones say of it: what a bound needs."""
        return tuple(part.fixes(None) for part in self.parts.values())


class Lasting(NamedTuple):
    """The correlated errors of a plan, which go on while no fix is measured."""

    correlated: Correlated
    step: Array  # (n - 1,) correlation times from fix to fix

    def draw(self, stream: RandomStream) -> Array:
        """Those of one run, (n, 3)."""
        return gauss_markov(self.step, stream) * self.correlated.std


class PositionPlan(NamedTuple):
    """Noise-free positions of an antenna and what a displacement in metres does to them."""

    source: Source  # all but its y
    lla: Array  # (n, 3) of the IMU, rad, rad, m
    antenna: Array  # (n, 3) lever arm, m NED
    metres: Array  # (n, 3) per rad north, per rad east, per metre up
    std: Array  # (3,) m
    keep: Ints | None  # rows that become fixes; None: all
    lasting: Lasting | None = None
    off: Array | float = 0.0  # (n, 3) m NED, by which wrong fixes are off

    @classmethod
    def of(
        cls,
        trajectory: Trajectory,
        times: float | Array,
        std: float | Sequence[float] | Array,
        lever_arm: Sequence[float] | Array = (0.0, 0.0, 0.0),
        name: str = "GNSS position",
        kept: Kept = _ALL,
        correlated: Correlated | None = None,
    ) -> "PositionPlan":
        """For a trajectory; arguments as in `position_fixes`, `correlated` as of Gnss."""
        t, std = fix_times(trajectory, times), _deviations(std, name)
        antenna, lla = (
            arm_in_navigation(trajectory, t, lever_arm, name),
            interpolate_trajectory(trajectory, t).lla,
        )
        R_M, R_N = radii(lla[:, 0])
        metres = np.stack(
            [R_M + lla[:, 2], (R_N + lla[:, 2]) * np.cos(lla[:, 0]), -np.ones(len(t))], axis=1
        )
        lasting = _correlated_errors(correlated, t, name)
        source = _without_values("position", t, std, lever_arm, name, kept)
        return cls(
            _with_correlated(source, lasting, kept.stated),
            lla,
            antenna,
            metres,
            std,
            kept.rows,
            lasting,
        )

    def of_class(self, name: str, off: Array) -> "PositionPlan":
        """The plan of a class of a receiver, whose fixes are `off` (n, 3) m NED."""
        source = replace(self.source, name=f"{RECEIVER} position {name}", receiver=RECEIVER)
        return self._replace(source=source, off=off)

    def fixes(self, seed: SeedLike | None) -> Source:
        """Source of the antenna's position, errors added; without `seed` the exact one."""
        offset = self.antenna
        if seed is not None:
            offset = _errors(self, RandomStream.of(seed)) + self.antenna + self.off
        y = offset / self.metres
        y += self.lla
        y[:, 1] = wrap(y[:, 1])
        return _with_values(self, y, seed is None)


class VelocityPlan(NamedTuple):
    """Noise-free velocities of an antenna."""

    source: Source  # all but its y
    v_n: Array  # (n, 3) m/s NED
    std: Array  # (3,) m/s
    keep: Ints | None  # rows that become fixes; None: all
    lasting: Lasting | None = None

    @classmethod
    def of(
        cls,
        trajectory: Trajectory,
        times: float | Array,
        std: float | Sequence[float] | Array,
        lever_arm: Sequence[float] | Array = (0.0, 0.0, 0.0),
        name: str = "GNSS velocity",
        kept: Kept = _ALL,
        correlated: Correlated | None = None,
    ) -> "VelocityPlan":
        """For a trajectory; arguments as in `velocity_fixes`, `correlated` as of Gnss."""
        if trajectory.v_n is None:
            raise DataError(f"{name}: the trajectory has no velocity")
        t, std = fix_times(trajectory, times), _deviations(std, name)
        velocity = interpolate_trajectory(trajectory, t).v_n
        assert velocity is not None  # as that of the trajectory
        if np.any(lever_arm):
            half = 0.5 * float(np.median(np.diff(trajectory.t)))
            early, late = np.clip([t - half, t + half], trajectory.t[0], trajectory.t[-1])
            moved = arm_in_navigation(trajectory, late, lever_arm, name) - arm_in_navigation(
                trajectory, early, lever_arm, name
            )
            velocity = velocity + moved / (late - early)[:, None]
        lasting = _correlated_errors(correlated, t, name)
        source = _without_values("velocity", t, std, lever_arm, name, kept)
        return cls(
            _with_correlated(source, lasting, kept.stated), velocity, std, kept.rows, lasting
        )

    def fixes(self, seed: SeedLike | None) -> Source:
        """Source of the antenna's velocity, errors added; without `seed` the exact one."""
        y = self.v_n.copy() if seed is None else _errors(self, RandomStream.of(seed)) + self.v_n
        return _with_values(self, y, seed is None)


def position_fixes(
    trajectory: Trajectory,
    times: float | Array,
    std: float | Sequence[float] | Array,
    seed: SeedLike,
    lever_arm: Sequence[float] | Array = (0.0, 0.0, 0.0),
    name: str = "GNSS position",
) -> Source:
    """Source of antenna positions (latitude rad, longitude rad, height m) with white noise of `std`
    (3,) m north, east, down.

    `times` is the interval between fixes in s (the first one interval after the start) or the times
    themselves; `seed` as of `ImuSpec.corrupt`. The antenna is at p + C_nb lever_arm. Raises DataError.
    """
    return PositionPlan.of(trajectory, times, std, lever_arm, name).fixes(seed)


def velocity_fixes(
    trajectory: Trajectory,
    times: float | Array,
    std: float | Sequence[float] | Array,
    seed: SeedLike,
    lever_arm: Sequence[float] | Array = (0.0, 0.0, 0.0),
    name: str = "GNSS velocity",
) -> Source:
    """Source of antenna velocities (m/s, NED) with white noise of `std` (3,) m/s; arguments as in
    `position_fixes`.

    The antenna moves with v + C_nb (omega_nb_b x lever_arm); the rate comes from the change of
    attitude between neighbouring samples (the turning of the navigation frame, v/R, stays below
    2e-5 m/s per metre of lever arm at 100 m/s and is left out).
    """
    return VelocityPlan.of(trajectory, times, std, lever_arm, name).fixes(seed)


def _without_values(
    kind: str,
    t: Array,
    std: Array,
    lever_arm: Sequence[float] | Array,
    name: str,
    kept: Kept,
) -> Source:
    """The Source of a plan with everything that no noise touches."""
    t = (t if kept.rows is None else t[kept.rows]) + kept.latency
    return Source(
        kind,
        t,
        np.empty((0, 3)),
        np.tile(std, (len(t), 1)),
        tuple(map(float, lever_arm)),
        kept.gate,
        name,
    )


def _with_values(plan: PositionPlan | VelocityPlan, y: Array, exact: bool) -> Source:
    source, keep = plan.source, plan.keep
    if exact and plan.lasting is not None:
        told = plan.lasting.correlated._replace(states=True)
        source = replace(source, std=np.tile(plan.std, (len(source.t), 1)), correlated=told)
    return replace(source, y=y if keep is None else y[keep])


def _errors(plan: PositionPlan | VelocityPlan, stream: RandomStream) -> Array:
    """Errors of the fixes of a plan, (n, 3) m or m/s NED. The correlated ones have a stream of
    their own, so that the white ones do not depend on them."""
    errors = stream.standard_normal(
        plan.lla.shape if isinstance(plan, PositionPlan) else plan.v_n.shape
    )
    errors *= plan.std
    if plan.lasting is not None and len(errors):
        errors += plan.lasting.draw(stream.child("correlated"))
    return errors


def _correlated_errors(correlated: Correlated | None, t: Array, name: str) -> Lasting | None:
    """The correlated errors of fixes at times t (n,) s. Raises DataError."""
    _check_correlated(correlated, name)
    if correlated is None:
        return None
    between = np.diff(t)
    if np.any(between < 0):
        raise DataError(f"{name}: correlated errors need fixes in order of time; sort their times")
    std = tuple(np.asarray(as_triple(correlated.std), float).tolist())
    return Lasting(correlated._replace(std=std), between / correlated.time)


def _with_correlated(source: Source, lasting: Lasting | None, stated: bool) -> Source:
    """A source of white noise with the correlated errors beside it: told as such or, not `stated`,
    as so much more white noise."""
    if lasting is None or stated:
        return replace(source, correlated=lasting.correlated) if lasting else source
    return replace(source, std=np.hypot(source.std, lasting.correlated.std))


def without_fixes(sources: Iterable[Source]) -> list[str]:
    """Sentences for the notes of a recording: the receiver's measurements of which not one falls
    into it; none where all are there."""
    return [
        f"{source.name or source.kind}: not one fix falls into the recording; outages, interval and "
        f"latency leave none"
        for source in sources
        if not len(source.t)
    ]


def _deviations(std: float | Sequence[float] | Array, name: str) -> Array:
    return check_array(
        as_triple(std),
        f"{name}: standard deviations",
        (3,),
        what="numbers: north, east, down, or one for all",
        above=0,
    )


def _check_spell(spell: Spell) -> None:
    """Raise DataError for a state of a receiver that cannot be."""
    what = f"state of the receiver from {spell.start} s"
    check_number(spell.start, what)
    check_number(spell.stop, f"{what}, its end", "s", above=spell.start)
    check_array(spell.off, f"{what}, off", (3,), what="numbers: north, east, down, m")
    if spell.name and spell.position_std is None:
        raise DataError(f"{what}: class {spell.name!r} has no position_std")
    if not spell.name and (spell.position_std is not None or not np.any(spell.off)):
        raise DataError(f"{what}: give it the name of a class, or how far its fixes are off")
    if spell.position_std is not None:
        _deviations(spell.position_std, what)
        _check_correlated(spell.position_correlated, what)


def _check_correlated(correlated: Correlated | None, name: str, measured: bool = True) -> None:
    """Raise DataError for correlated errors that no receiver has."""
    if correlated is None:
        return
    what = f"{name}: correlated errors"
    if not isinstance(correlated, Correlated):
        raise DataError(f"{what} are {correlated!r}; write Correlated((north, east, down), time)")
    if not measured:
        raise DataError(f"{what} are given, and no white noise; give both, or neither")
    check_number(correlated.time, f"{what}, time", "s", above=0, most=MAX_TIME_CONSTANT)
    check_flag(correlated.states, f"{what}, states")
    std = check_array(
        as_triple(correlated.std),
        f"{what}, standard deviations",
        (3,),
        what="numbers: north, east, down, or one for all",
        least=0,
    )
    if not std.any():
        raise DataError(f"{what}: all standard deviations are 0; leave them out")
