"""Sensors beside GNSS against what the solution expects of them: unit, sign, scale, clock, a beacon at a
wrong place, values that are held, a disturbed field.

    y = k h(t - lag) + b

h is the expected value, of a filter that leaves out what contradicts GNSS
(core/loop/stages/contradicting.py); b is a constant only of those whose filter estimates one, such as
hard iron. k, lag and b are fitted while GNSS is used.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..aiding.depth import SEAWATER
from ..aiding.pressure import P_0
from ..core.loop.contract import ATT
from ..core.loop.integrity import BARRED, HEARD
from ..data.solution import GNSS, Innovations, Solution, Source
from ..data.verdict import Reason
from ..geometry.geodesy import displacement
from ..geometry.rotations import Rotation
from ..inspection.finding import clustered_least_squares, label
from ..inspection.position_velocity import FACTORS
from ..typing import Array, Ints, Mask
from ..units.constants import FROZEN_ROWS, FROZEN_TIME, STANDARD_GRAVITY

LENGTHS = {1 / 0.3048: "feet read as m", 0.3048: "m read as feet"}
FIELDS = {
    1e-2: "gauss read as uT",
    1e2: "uT read as gauss",
    1e3: "nT read as uT",
    1e1: "mG read as uT",
}
UNITS: dict[str, dict[float, str]] = {
    "speed": FACTORS,
    "body-velocity": FACTORS,
    "beam-velocity": FACTORS,
    "magnetic-field": FIELDS,
    "baseline": LENGTHS,
    "depth": LENGTHS,
    "water-pressure": LENGTHS,
    "range": LENGTHS,
}
"""{kind that is compared: factors by which it may be read in a wrong unit}."""
BIASED = ("magnetic-field", "depth", "water-pressure", "range")
"""Kinds with a constant that a filter estimates."""
MIN_ROWS, BLOCK = 50, 10.0
"""Measurements that are needed, and s within which their errors hang together."""
SURE, MAX_SCALE, MAX_LAG, NEAR_UNIT = 6.0, 0.05, 0.08, 0.03
"""Standard deviations, share and s from which a scale and a clock are reasons; the share within which a
factor is that of a unit."""
WITHIN = 3.0
"""Prior standard deviations within which a scale or a clock that the filter estimates is no reason."""
EXPLAINED = 0.3
"""Share of the squares of what is off that a scale or a place must explain, and a clock that comes before
other causes: of a precise sensor a clock explains little, and other mistakes look like one."""
HELD_CHANGE = 5.0
"""Standard deviations by which a value should change while it is held FROZEN_TIME and FROZEN_ROWS."""
MAX_FIELD, PART = 0.1, 0.1
"""Share of the strength by which a field may be off, and the share of time in which it may be more."""
FAR = 10.0
"""m by which a beacon must be off."""
OF_SET_UP = ("unit", "scale", "clock")
"""Causes that are there from the beginning."""
KNOWN_HEADING = np.radians(3.0)
"""rad: standard deviation of a heading from which no field is compared."""


SLOW = ("depth", "water-pressure")
"""Kinds whose bias, a state, follows their slow changes and so what a clock does to them: of these a clock
must explain its share, as other causes must."""
AGREED = 0.9
"""Share of readings that a filter uses of a sensor that agrees with GNSS."""


class ExpectedReadings(NamedTuple):
    """Readings of a source while GNSS was used, and what the solution expects of them."""

    source: Source
    t: Array  # (n,) s
    y: Array  # (n, k)
    h: Array  # (n, k)
    std: Array  # (n, k) of y - h, as stated
    towards: Array  # (n, 3) of a range: by what it grows with each metre of the beacon's place, NED
    until: float  # s, until when the filter used it, where it agreed for some time before; else inf

    def before(self) -> "ExpectedReadings":
        """Those of the time when it agreed."""
        return self.where(self.t < self.until)

    def where(self, some: Mask) -> "ExpectedReadings":
        """Some of them."""
        return self._replace(
            t=self.t[some],
            y=self.y[some],
            h=self.h[some],
            std=self.std[some],
            towards=self.towards[some],
        )


class ReadingFit(NamedTuple):
    """Scale and clock of a source."""

    scale: float
    scale_std: float
    lag: float  # s that it is late
    lag_std: float
    explained: float  # share of the squares of y - h


def reasons(solution: Solution) -> Iterator[Reason]:
    """A Reason against each sensor beside GNSS, where one is to be said."""
    recording, every = solution.recording, solution.innovations
    assert recording is not None
    for s, source in enumerate(recording.sources):
        if source.kind not in UNITS:
            continue
        each = _expected_readings(solution, every, s, source)
        if each is not None:
            yield from _reasons(each)


def _reasons(each: ExpectedReadings) -> Iterator[Reason]:
    held = _held_value(each)
    if held is not None:
        yield held
        return
    fit = _fit(each)
    found = _of_fit(each, fit) if fit is not None else None
    place = _place(each) if each.source.kind == "range" else None
    if place is not None and (fit is None or place[1] > fit.explained):
        found = place[0]
    if found is None and each.source.kind == "magnetic-field":
        found = _disturbance(each)
    if found is None and each.source.kind == "range":
        found = _far_off(each)
    if found is None and fit is not None and each.source.kind not in SLOW:
        found = _of_clock(each, fit)
    if (found is None or found.cause in OF_SET_UP) and _has_changed(each):
        found = _change(each)
    if found is not None:
        yield found


def _has_changed(each: ExpectedReadings) -> bool:
    """True where a sensor agreed for some time, without what its readings show later."""
    if not np.isfinite(each.until):
        return False
    early = each.before()
    fit = _fit(early) if len(early.t) >= MIN_ROWS else None
    return fit is None or (_of_fit(early, fit) or _of_clock(early, fit)) is None


def _change(each: ExpectedReadings) -> Reason:
    """A Reason of a sensor or GNSS that has become wrong, in place of one of a constant."""
    seconds, left = each.until - each.t[0], each.t[-1] - each.until
    seen = (
        f"it agreed with position and velocity for {seconds:.0f} s and contradicts them from "
        f"{each.until:.1f} s on: either has become wrong"
    )
    remedy = (
        "compare both with a third source, and leave out the one that errs: GNSS may be spoofed"
    )
    return Reason("outliers", seen, remedy, label(each.source), min(left / BARRED, 10.0))


def _agreed_until(t: Array, accepted: Mask) -> float:
    """s until when a filter used a sensor that it left out later for BARRED s or more, and that agreed as
    long before; inf of others."""
    first = np.flatnonzero(accepted)
    if not len(first):
        return np.inf
    ends = np.flatnonzero(np.diff(np.r_[t[accepted], t[-1]]) >= BARRED)
    if not len(ends):
        return np.inf
    last = first[ends[0]]
    agreed = t[last] - t[0] >= BARRED and np.mean(accepted[: last + 1]) >= AGREED
    return float(t[last]) if agreed else np.inf


# ---- what is expected


def _expected_readings(
    solution: Solution, every: Innovations, s: int, source: Source
) -> ExpectedReadings | None:
    """The ExpectedReadings of source `s`; None where there are too few."""
    gnss = [i for i, a in enumerate(_sources(solution)) if a.kind in GNSS]
    own = np.flatnonzero((every.source == s) & np.isfinite(every.innovation[:, 0]))
    times = every.t[np.isin(every.source, gnss) & every.accepted]
    if not len(times):
        return None
    own = own[_since(times, every.t[own]) <= HEARD]
    if source.kind == "magnetic-field":  # those that were left out too
        own_t = source.t[_since(times, source.t) <= HEARD]
    else:
        own_t = every.t[own]
    if len(own_t) < MIN_ROWS:
        return None
    row = np.minimum(np.searchsorted(source.t, own_t), len(source.t) - 1)
    y, std = source.y[row], source.std[row]
    if source.kind == "water-pressure":
        y = (y - P_0) / (SEAWATER * STANDARD_GRAVITY)
    h, towards = _predict_readings(solution, source, own_t)
    if h is None:
        h = y - every.innovation[own, : y.shape[1]]
    whole: Mask = np.isfinite(np.c_[y, h]).all(axis=1)
    if whole.sum() < MIN_ROWS:
        return None
    until = _agreed_until(every.t[own], every.accepted[own])
    return ExpectedReadings(source, own_t, y, h, std, towards, until).where(whole)


def _sources(solution: Solution) -> tuple[Source, ...]:
    assert solution.recording is not None
    return tuple(solution.recording.sources)


def _since(times: Array, t: Array) -> Array:
    """(n,) s since the last of some times, inf before the first."""
    last = np.searchsorted(times, t, side="right") - 1
    return np.where(last >= 0, t - times[np.maximum(last, 0)], np.inf)


def _predict_readings(solution: Solution, source: Source, t: Array) -> tuple[Array | None, Array]:
    """((n, k) what a source with a constant of its own should read at times `t`, but for that constant,
    (n, 3) towards as of ExpectedReadings); None for the others."""
    made, none = solution.trajectory, np.zeros((len(t), 3))
    if source.kind not in BIASED or made.q_nb is None:
        return None, none
    after = np.searchsorted(made.t, t)
    near: Ints = np.unique(np.clip(np.r_[after - 1, after], 0, len(made.t) - 1))
    some = made.take(near)
    assert some.q_nb is not None
    turn = Rotation.from_wxyz(some.q_nb)

    def at(values: Array) -> Array:
        return np.stack([np.interp(t, some.t, column) for column in values.T], axis=1)

    if source.kind == "magnetic-field":
        if some.std is not None:  # an unknown heading expects any field
            unsure = np.interp(t, some.t, np.nan_to_num(some.std[:, ATT.stop - 1])) > KNOWN_HEADING
            none = np.where(unsure[:, None], np.nan, none)
        return none + at(turn.inv().apply(np.array(source.parameters[:3]))), np.zeros((len(t), 3))
    arm = np.array([*source.parameters, 0.0, 0.0, 0.0][:3])
    point = turn.apply(np.broadcast_to(arm, (len(some.t), 3)))
    if source.kind == "range":
        away = displacement(some.lla, np.array(source.parameters[3:6])) + point
        size = np.maximum(np.linalg.norm(away, axis=1), 1.0)[:, None]
        return at(size), at(-away / size)
    down = (point[:, 2] - some.lla[:, 2])[:, None]
    return at(down), none


# ---- what is said


def _held_value(each: ExpectedReadings) -> Reason | None:
    """A Reason where a value is held while it should change."""
    new = np.flatnonzero(np.r_[True, (each.y[1:] != each.y[:-1]).any(axis=1)])
    last = np.r_[new[1:], len(each.t)] - 1
    long = np.flatnonzero((each.t[last] - each.t[new] > FROZEN_TIME) & (last - new >= FROZEN_ROWS))
    should = np.array(
        [
            float((np.ptp(each.h[a : b + 1], axis=0) / each.std[a]).max())
            + float((np.abs(np.median(each.y[a] - each.h[a : b + 1], axis=0)) / each.std[a]).max())
            for a, b in zip(new[long], last[long])
        ]
    )
    wrong = long[should > HELD_CHANGE] if len(long) else long
    if not len(wrong):
        return None
    seconds = each.t[last[wrong]] - each.t[new[wrong]]
    k = int(wrong[np.argmax(seconds)])
    times = f" (in all {len(wrong)} times)" if len(wrong) > 1 else ""
    seen = (
        f"it reads one value from {each.t[new[k]]:.1f} to {each.t[last[k]]:.1f} s, which the motion "
        f"contradicts{times}"
    )
    remedy = "leave those rows out, or their cells empty: the sensor is stuck, or sees nothing then"
    weight = min(float(seconds.max()) / FROZEN_TIME, 10.0)
    return Reason("repeated", seen, remedy, label(each.source), weight)


def _fit(each: ExpectedReadings) -> ReadingFit | None:
    """Scale and clock by least squares, without what is far off; None where the motion does not show
    them."""
    count, k = each.y.shape
    # backwards: what comes after has the correction by this reading in it
    slope = np.diff(each.h, axis=0, prepend=each.h[:1]) / np.diff(each.t, prepend=-np.inf)[:, None]
    w = 1 / each.std
    constants = np.zeros((count, k, k))
    constants[:, range(k), range(k)] = 1.0
    columns = [each.h[..., None], -slope[..., None]]
    columns += [constants] if each.source.kind in BIASED else []
    A = np.concatenate(columns, axis=2) * w[..., None]
    y = (each.y - each.h) * w
    block = np.unique(np.floor(each.t / BLOCK), return_inverse=True)[1]
    use: Mask = np.ones(count, bool)
    for _ in range(3):
        rows = np.repeat(block[use], k)
        x, std, left = clustered_least_squares(
            A[use].reshape(-1, A.shape[2]), y[use].ravel(), np.unique(rows, return_inverse=True)[1]
        )
        if not np.isfinite(std).all():
            return None
        size = np.linalg.norm(y - A @ x, axis=1)
        use = size <= 6 * np.median(size[use])
    fixed = A.shape[2] > 2
    base = y[use] - np.mean(y[use], axis=0) if fixed else y[use]
    explained = 1 - float((left**2).sum() / max((base**2).sum(), 1e-12))
    scale = 1 + float(x[0])
    return ReadingFit(
        scale, float(std[0]), float(x[1] / scale), float(std[1] / abs(scale)), explained
    )


def _known_prior(each: ExpectedReadings, name: str, least: float) -> float:
    return (
        max(least, WITHIN * each.source.estimate[name][0])
        if name in each.source.estimate
        else least
    )


def _of_fit(each: ExpectedReadings, fit: ReadingFit) -> Reason | None:
    """A Reason of a wrong sign, unit, scale or clock."""
    off = abs(fit.scale - 1)
    least = max(_known_prior(each, "scale", MAX_SCALE), SURE * fit.scale_std)
    if fit.explained < EXPLAINED:
        return None
    if off > least:
        return _of_scale(each, fit, min(off / least, 10.0))
    return _of_clock(each, fit)


def _of_clock(each: ExpectedReadings, fit: ReadingFit) -> Reason | None:
    """A Reason of a wrong clock."""
    name = label(each.source)
    least = max(_known_prior(each, "clock", MAX_LAG), SURE * fit.lag_std)
    if abs(fit.lag) > least:
        seen = f"it is {fit.lag:+.2f} +- {fit.lag_std:.2f} s late against the solution"
        remedy = f"add {-fit.lag:+.2f} s to `offset` of its `time`"
        return Reason("clock", seen, remedy, name, min(abs(fit.lag) / least, 10.0))
    return None


def _of_scale(each: ExpectedReadings, fit: ReadingFit, weight: float) -> Reason:
    units = UNITS[each.source.kind]
    near = min(units, key=lambda known: abs(np.log(abs(fit.scale) / known)))
    of_unit = abs(np.log(max(abs(fit.scale), 1e-9) / near)) < NEAR_UNIT
    seen = f"it reads {fit.scale:.3g} +- {fit.scale_std:.1g} times what the solution expects"
    if fit.scale < 0:
        remedy = "correct the sign of its `axes`, or give it `scale = -1`"
        return Reason("unit", f"{seen}: the opposite sign", remedy, label(each.source), weight)
    if of_unit:
        seen = f"{seen}: {units[near]}"
        return Reason("unit", seen, "correct its `unit`", label(each.source), weight)
    remedy = f"set its `scale` to {1 / fit.scale:.3g}, or let the filter estimate it"
    return Reason("scale", seen, remedy, label(each.source), weight)


def _place(each: ExpectedReadings) -> tuple[Reason, float] | None:
    """A Reason of a beacon at a wrong place, and the share of the squares that this explains."""
    w = 1 / each.std[:, 0]
    A = np.c_[each.towards[:, :2], np.ones(len(each.t))] * w[:, None]
    y = (each.y - each.h)[:, 0] * w
    block = np.unique(np.floor(each.t / BLOCK), return_inverse=True)[1]
    x, std, left = clustered_least_squares(A, y, block)
    if not np.isfinite(std).all():
        return None
    off, sure = float(np.hypot(*x[:2])), float(np.hypot(*std[:2]))
    if off < max(FAR, SURE * sure):
        return None
    explained = 1 - float((left**2).sum() / max(((y - y.mean()) ** 2).sum(), 1e-12))
    if explained < EXPLAINED:
        return None
    seen = (
        f"its ranges fit a beacon {x[0]:+.0f} m north and {x[1]:+.0f} m east of the given place "
        f"(+- {sure:.1g} m)"
    )
    remedy = "correct `beacon` in the recording, or leave it out"
    return Reason("beacon", seen, remedy, label(each.source), min(off / FAR, 10.0)), explained


def _far_off(each: ExpectedReadings) -> Reason | None:
    """A Reason of ranges that are off by a constant that no sound speed explains."""
    off = float(np.median(each.y - each.h))
    if abs(off) < FAR:
        return None
    seen = f"its ranges are {off:+.0f} m off in the median, and its direction changes too little to tell where"
    remedy = "check `beacon` in the recording, or leave it out"
    return Reason("beacon", seen, remedy, label(each.source), min(abs(off) / FAR, 10.0))


def _disturbance(each: ExpectedReadings) -> Reason | None:
    """A Reason of a field that iron or a current adds to for part of the time."""
    strength = float(np.linalg.norm(each.source.parameters[:3]))
    off = each.y - each.h
    size = np.linalg.norm(off - np.median(off, axis=0), axis=1) / strength
    share = float(np.mean(size > MAX_FIELD))
    if share < PART:
        return None
    seen = (
        f"{100 * share:.0f} % of the time it is more than {100 * MAX_FIELD:.0f} % of its strength off "
        "what attitude and hard iron explain"
    )
    remedy = "mount it away from motors, their wires and iron that moves, or leave it out"
    return Reason("disturbed field", seen, remedy, label(each.source), min(share / PART, 10.0))
