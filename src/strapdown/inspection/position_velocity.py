"""Positions against velocities of the same receiver: units, axes, signs, latency, drift.

Positions are compared with the integral of the velocity, no IMU is needed. First roughly, over
windows of seconds: which axes and unit of the velocity explain the displacements. Where they are
right, then finely: p - (block's own offset) = c R(angle) W + lag v, W being the integral within
blocks of time. The offsets take up errors of the positions that last longer than a block, and the
standard deviations rest on how the blocks disagree (`clustered_least_squares`).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from ..geometry.geodesy import displacement
from ..typing import Array, Ints, Mask
from .finding import MIN_FIXES, Checked, clustered_least_squares, label
from .motion import InspectedRecording

WINDOW, BLOCK = 5.0, 20.0
"""Seconds of a displacement, and of a block of the fine comparison."""
MIN_WINDOWS, MIN_STEPS = 6, 8
"""Displacements that move, and steps from block to block that are needed."""
MAX_FIXES = 1500
"""Positions that are compared: more would add little."""
MOVING = 5.0
"""Claimed standard deviations from which a displacement is significant."""
WRONG, RIGHT = 0.3, 0.2
"""Median misfit of displacements, as a share of them: axes are wrong above WRONG, and others
explain them where they halve it and come below RIGHT."""
MAX_WEIGHT = 100.0
SURE = 5.0
"""Standard deviations from which a difference is no chance."""
SCALE, ANGLE, LAG, DRIFT = 0.015, np.radians(1.5), 0.08, 0.04
"""Differences up to these are not spoken of: ratio, rad, s, m/s."""
FARTHEST, SETTLED, MAX_STEPS = 60.0, 0.02, 5
"""The largest lag that is looked for, the last step of the search, both s, and the most steps."""
EQUATOR = np.radians(15.0)
"""Latitude and longitude up to which a degree of both is about as long."""
FACTORS = {
    3.6: "km/h read as m/s",
    1 / 3.6: "m/s read as km/h",
    1 / 0.514444: "knots read as m/s",
    0.514444: "m/s read as knots",
    1e3: "mm/s read as m/s",
    1e-3: "m/s read as mm/s",
    1e2: "cm/s read as m/s",
    1e-2: "m/s read as cm/s",
    10.0: "mm/s read as cm/s",
    0.1: "cm/s read as mm/s",
    1 / 0.3048: "ft/s read as m/s",
    0.3048: "m/s read as ft/s",
    1.852: "knots read as km/h",
    1 / 1.852: "km/h read as knots",
}
"""Factors that a mistaken unit makes in a speed, and what to say then."""


class Axes(NamedTuple):
    """One way to read a velocity wrongly: how to read it rightly, and what to say."""

    cause: str
    right: Callable[[Array], Array]  # (n, 2) north and east as read -> as they should be
    seen: str
    remedy: str


def _with_signs(
    first: int, second: int, north: float = 1.0, east: float = 1.0
) -> Callable[..., Array]:
    return lambda v: v[:, [first, second]] * [north, east]


def _course_in_degrees(v: Array) -> Array:
    """The velocity whose course was in rad and taken for deg."""
    course = np.degrees(np.arctan2(v[:, 1], v[:, 0]))
    return np.hypot(v[:, 0], v[:, 1])[:, None] * np.c_[np.cos(course), np.sin(course)]


AXES = (
    Axes("frame", _with_signs(0, 1), "", ""),
    Axes(
        "unit",
        _course_in_degrees,
        "the speed agrees with the positions, but the course stays near north: a course in rad "
        "read as deg",
        "convert the column of the course from rad to deg before you compute north and east from "
        "it",
    ),
    Axes(
        "frame",
        _with_signs(1, 0),
        "north and east are exchanged: ENU read as NED",
        'set its `axes` to "ENU", or exchange the columns',
    ),
    Axes(
        "frame",
        _with_signs(0, 1, 1, -1),
        "east has the wrong sign",
        "change the sign of east in its `axes`, or of the longitude by `scale`",
    ),
    Axes(
        "frame",
        _with_signs(0, 1, -1, 1),
        "north has the wrong sign",
        "change the sign of north in its `axes`",
    ),
    Axes(
        "frame",
        _with_signs(0, 1, -1, -1),
        "the velocity points backwards",
        "change the signs of north and east in its `axes`",
    ),
    Axes(
        "frame",
        _with_signs(1, 0, 1, -1),
        "the velocity is rotated by 90 deg: east, then -north",
        "correct its `axes`",
    ),
    Axes(
        "frame",
        _with_signs(1, 0, -1, 1),
        "the velocity is rotated by 90 deg: -east, then north",
        "correct its `axes`",
    ),
    Axes(
        "frame",
        _with_signs(1, 0, -1, -1),
        "north and east are exchanged and have the wrong sign",
        "correct its `axes`",
    ),
)
"""Ways to read north and east; the first is the right one."""


class Pair(NamedTuple):
    """Positions and velocities of one receiver."""

    position: str  # names
    velocity: str
    t: Array  # (n,) s, of the positions
    p: Array  # (n, 3) m NED from the first
    std: Array  # (n, 3) m, claimed
    t_v: Array  # (m,) s
    v: Array  # (m, 3) m/s NED; NaN where there is no vertical part
    pause: float  # s: a longer one ends what can be integrated
    has_height: bool  # whether the positions have heights

    def integral(self, v: Array, at: Array) -> Array:
        """The integral of the velocities `v` (m, k), straight between its fixes, to the times
        `at` (s); NaN outside."""
        steps = np.diff(self.t_v)
        total = np.vstack([0 * v[:1], np.cumsum((v[1:] + v[:-1]) / 2 * steps[:, None], axis=0)])
        k = np.clip(np.searchsorted(self.t_v, at, "right") - 1, 0, len(steps) - 1)
        since = (at - self.t_v[k])[:, None]
        slope = (v[k + 1] - v[k]) / steps[k, None]
        found: Array = total[k] + v[k] * since + slope * since**2 / 2
        found[(at < self.t_v[0]) | (at > self.t_v[-1])] = np.nan
        return found

    def pauses(self, at: Array) -> Ints:
        """(n,) how many pauses of either source lie before each time."""
        count = np.zeros(len(at), int)
        for t in (self.t, self.t_v):
            count += np.searchsorted(t[1:][np.diff(t) > self.pause], at, "right")
        return count


def check(subject: InspectedRecording) -> Checked:
    """Each velocity against the positions of its receiver."""
    found = Checked.empty()
    for position, velocity in pairs(subject.recording.sources):
        found.add(position_against_velocity(position, velocity))
    return found


def pairs(sources: tuple[Source, ...]) -> Iterator[tuple[Source, Source]]:
    """(position, velocity) of each receiver: in the order of the sources, or the first position
    for all."""
    positions = [source for source in sources if source.kind == "position"]
    velocities = [source for source in sources if source.kind == "velocity"]
    for k, velocity in enumerate(velocities):
        if positions:
            yield positions[k if len(positions) == len(velocities) else 0], velocity


def position_against_velocity(position: Source, velocity: Source) -> Checked:
    """Compare the positions and the velocities of one receiver."""
    what = f"{label(position)} against {label(velocity)}"
    pair = _pair(position, velocity)
    if pair is None:
        return Checked.with_unknown(what, "too few fixes of both at the same time")
    wrong = _gross(pair)
    if wrong is None:
        found = Checked.with_unknown(what, "the positions hardly move")
        found.reasons.extend(_drift(pair, _blocks(pair), 0.0))
        return found
    if wrong:
        return Checked([], _check_exchanged(position, velocity, wrong) or wrong, [])
    return _fine(pair, what)


def _check_exchanged(position: Source, velocity: Source, wrong: list[Reason]) -> list[Reason]:
    """The Reason where the positions agree with the velocity once latitude and longitude are
    exchanged, else none. Near the equator the same is seen where north and east of the velocity
    are."""
    y = position.y[:, [1, 0, 2]]
    largest = np.nanmax(np.abs(y[:, :2]))
    near_equator = largest < EQUATOR and len(wrong) == 1 and wrong[0].cause == "frame"
    if not np.nanmax(np.abs(y[:, 0])) <= np.pi / 2 or near_equator:
        return []
    pair = _pair(replace(position, y=y), velocity)
    if pair is None or _gross(pair) != [] or _fine(pair, "").reasons:
        return []
    seen = (
        "latitude and longitude are exchanged: only then do the positions agree with "
        f"{pair.velocity}"
    )
    return [Reason("frame", seen, "exchange the columns", pair.position, wrong[0].weight)]


def _pair(position: Source, velocity: Source) -> Pair | None:
    """The Pair; None where there are too few fixes of both at the same time."""
    t, y, std = _rows(position)
    t_v, v, _ = _rows(velocity)
    if min(len(t), len(t_v)) < MIN_FIXES:
        return None
    common = (t >= t_v[0]) & (t <= t_v[-1])
    if common.sum() < MIN_FIXES:
        return None
    some = np.flatnonzero(common)[:: max(1, int(common.sum()) // MAX_FIXES)]
    t, y, std = t[some], y[some], std[some]
    high = np.isfinite(y[:, 2])
    heights = np.interp(t, t[high], y[high, 2]) if high.any() else np.zeros(len(t))
    y = np.c_[y[:, :2], heights]
    p = np.vstack([np.zeros(3), np.cumsum(displacement(y[1:], y[:-1]), axis=0)])
    pause = 3 * max(float(np.median(np.diff(t))), float(np.median(np.diff(t_v)))) + 0.1
    return Pair(label(position), label(velocity), t, p, std, t_v, v, pause, high.mean() > 0.9)


def _rows(source: Source) -> tuple[Array, Array, Array]:
    """t, y, std of the fixes with both horizontal components, each time once."""
    t, first = np.unique(source.t, return_index=True)
    y, std = source.y[first], np.broadcast_to(source.std, source.y.shape)[first]
    use = np.isfinite(t) & np.isfinite(y[:, :2]).all(axis=1)
    return t[use], y[use], std[use]


def _gross(pair: Pair) -> list[Reason] | None:
    """Reasons against axes, unit and clock of the velocity as a whole; None where the positions
    move too little to tell."""
    step = max(1, round(WINDOW / float(np.median(np.diff(pair.t)))))
    rows = np.arange(0, len(pair.t), step)
    first, last = rows[:-1], rows[1:]
    d = (pair.p[last] - pair.p[first])[:, :2]
    size = np.linalg.norm(d, axis=1)
    noise = np.sqrt((pair.std[first, :2] ** 2 + pair.std[last, :2] ** 2).sum(axis=1))
    whole = np.diff(pair.pauses(pair.t[rows])) == 0
    use = whole & (size > MOVING * noise)

    def integrate(v: Array, shift: float = 0.0) -> Array:
        W = pair.integral(v, pair.t[rows] + shift)
        return W[1:] - W[:-1]

    def misfit(W: Array) -> float:
        off = np.linalg.norm(d - W, axis=1)[use] / size[use]
        return float(np.median(off[np.isfinite(off)])) if np.isfinite(off).any() else np.inf

    if use.sum() < MIN_WINDOWS:
        return _still(pair, d[whole], noise[whole], integrate(pair.v[:, :2])[whole])
    as_read = misfit(integrate(pair.v[:, :2]))
    if as_read < WRONG:
        return []
    tried = [(axes, integrate(axes.right(pair.v[:, :2]))) for axes in AXES]
    factors = [_factor(d[use], W[use]) for _, W in tried]
    fits = [(misfit(W / factor), factor, axes) for (axes, W), factor in zip(tried, factors)]
    # another reading must be clearly better than the axes as they are
    best = min(fits, key=lambda fit: fit[0])
    off, factor, axes = fits[0] if fits[0][0] < max(RIGHT, 2 * best[0]) else best
    weight = min(as_read / WRONG * SURE, MAX_WEIGHT)
    if off < min(RIGHT, as_read / 2):
        return _misread(pair, axes, factor, off, as_read, weight)
    lag, off = _coarse_lag(pair, misfit, integrate)
    known = off < min(RIGHT, as_read / 2)
    return [
        _late(pair, lag, off, as_read, weight) if known else _report_unknown(pair, as_read, weight)
    ]


def _late(pair: Pair, lag: float, off: float, as_read: float, weight: float) -> Reason:
    """The velocity fits with another clock."""
    seen = (
        f"the velocity fits {pair.position} with {-lag:+.1f} s added to its time ({100 * off:.0f} "
        f"% different instead of {100 * as_read:.0f} %)"
    )
    remedy = (
        f"add {-lag:+.1f} s to `offset` of its `time`, or find which of the two clocks is wrong"
    )
    return Reason("clock", seen, remedy, pair.velocity, weight)


def _report_unknown(pair: Pair, as_read: float, weight: float) -> Reason:
    """The velocity fits in no way."""
    seen = (
        f"over {WINDOW:g} s its integral differs by {100 * as_read:.0f} % from the displacements "
        f"of {pair.position}, and no other unit, axes or clock explain it"
    )
    remedy = "check columns, unit, scale, axes and time of both"
    return Reason("unknown", seen, remedy, pair.velocity, weight)


def _factor(d: Array, W: Array) -> float:
    """By how much too large the displacements W (n, 2) are against d (n, 2); 1 where that is
    close."""
    known = np.isfinite(W).all(axis=1)
    size = float(np.median(np.linalg.norm(d[known], axis=1))) if known.any() else 0.0
    factor = float(np.median(np.linalg.norm(W[known], axis=1))) / size if size else 0.0
    return factor if factor and not 0.9 < factor < 1.1 else 1.0


def _misread(
    pair: Pair, axes: Axes, factor: float, off: float, as_read: float, weight: float
) -> list[Reason]:
    """The Reasons of wrong axes and a wrong factor."""
    better = (
        f"(it differs by {100 * as_read:.0f} % from the displacements of {pair.position}; read "
        f"this way, by {100 * off:.0f} %)"
    )
    reasons = []
    if axes is not AXES[0]:
        reasons.append(
            Reason(axes.cause, f"{axes.seen} {better}", axes.remedy, pair.velocity, weight)
        )
    if factor != 1.0:
        reasons.append(_unit_reason(pair, factor, better, weight))
    return reasons


def _unit_reason(pair: Pair, factor: float, better: str, weight: float) -> Reason:
    """The Reason of a speed that is `factor` times too large."""
    near = min(FACTORS, key=lambda known: abs(np.log(factor / known)))
    likely = FACTORS[near] if abs(np.log(factor / near)) < 0.05 else "a wrong unit or scale"
    return Reason(
        "unit",
        f"the velocity is {factor:.4g} times the speed of {pair.position}: {likely} {better}",
        f"correct its `unit`, or set `scale` to {1 / factor:.4g} times its present value",
        pair.velocity,
        weight,
    )


def _still(pair: Pair, d: Array, noise: Array, W: Array) -> list[Reason] | None:
    """Where positions do not move: a velocity that does is wrong. Else None."""
    known = np.isfinite(W).all(axis=1)
    claimed = np.linalg.norm(W[known], axis=1)
    moves = claimed > MOVING * noise[known] + 5 * np.linalg.norm(d[known], axis=1) + 1.0
    if known.sum() < MIN_WINDOWS or moves.mean() < 0.5:
        return None
    return [
        Reason(
            "unit",
            f"its integral over {WINDOW:g} s is {np.median(claimed):.3g} m, while {pair.position} "
            f"moves by {np.median(np.linalg.norm(d[known], axis=1)):.2g} m",
            "check unit and scale of both",
            pair.velocity,
            2 * SURE,
        )
    ]


def _coarse_lag(
    pair: Pair, misfit: Callable[[Array], float], integrated: Callable[..., Array]
) -> tuple[float, float]:
    """(lag in s, misfit there) of the velocity behind the positions that fits best."""
    reach = min(FARTHEST, 0.4 * float(np.ptp(pair.t)))
    lags = np.arange(-reach, reach + 0.25, 0.5)
    v = pair.v[:, :2]
    near = min(((misfit(integrated(v, lag)), lag) for lag in lags), default=(np.inf, 0.0))
    fine = near[1] + np.arange(-0.5, 0.51, 0.1)
    off, lag = min((misfit(integrated(v, lag)), lag) for lag in fine)
    return float(lag), off


def _fine(pair: Pair, what: str) -> Checked:
    """Scale, rotation, latency, vertical and drift, where axes and unit are right."""
    found = Checked.empty()
    block = _blocks(pair)
    lag, x, std = 0.0, np.full(3, np.nan), np.full(3, np.nan)
    for _ in range(MAX_STEPS):
        x, std = _horizontal(pair, block, lag)
        if not np.isfinite(x).all():
            return Checked.with_unknown(what, "too little motion for scale and latency")
        lag += x[2]
        if abs(x[2]) < SETTLED or abs(lag) > FARTHEST:
            break
    if abs(x[2]) >= SETTLED:
        return Checked.with_unknown(what, "no latency makes the two agree")
    found.facts.append(
        f"{what}: the velocity is {1 / (1 + x[0]):.4f} +- {std[0]:.4f} of the change of position, "
        f"rotated by {np.degrees(-x[1]):+.2f} +- {np.degrees(std[1]):.2f} deg, later by "
        f"{lag:+.3f} +- {std[2]:.3f} s"
    )
    found.reasons.extend(_departures(pair, np.r_[x[:2], lag], std))
    found.add(_vertical(pair, block, lag, what))
    found.reasons.extend(_drift(pair, block, lag))
    for name, value, least in (("scale", std[0], SCALE), ("latency", std[2], LAG)):
        if not value * SURE < 3 * least:
            found.inconclusive.append(
                f"{name} of {what}: known only to +- {value:.2g}: too little motion"
            )
    return found


def _blocks(pair: Pair) -> Ints:
    """(n,) number of the stretch of BLOCK seconds without a pause that each position is in."""
    length = max(BLOCK, 12 * float(np.median(np.diff(pair.t))))
    pauses = pair.pauses(pair.t)
    return _run_numbers(np.floor((pair.t - pair.t[0]) / length) + 1e6 * pauses)


def _run_numbers(values: Array | Ints) -> Ints:
    """(n,) 0, 1, 2 ...: numbers of the runs of equal values."""
    return np.r_[0, np.cumsum(np.diff(values) != 0)][: len(values)]


def _within(columns: Array, block: Ints) -> Array:
    """Columns (n, k) less their means over each block."""
    count = np.bincount(block)
    means = np.stack([np.bincount(block, column) for column in columns.T], axis=1) / count[:, None]
    return columns - means[block]


def _without_outliers(rows: Array) -> Mask:
    """Rows (n, k) without NaN and without what is far off their scatter."""
    known: Mask = np.asarray(np.isfinite(rows).all(axis=1))
    size = np.linalg.norm(np.where(known[:, None], rows, 0), axis=1)
    most = 6 * float(np.median(size[known])) if known.any() else 0.0
    return np.asarray(known & (size <= most))


def _horizontal(pair: Pair, block: Ints, lag: float) -> tuple[Array, Array]:
    """(values, std), (3,) each: what the positions move by beyond the integral of the velocity at
    `lag`: as a share along it, as an angle across it (rad), and as a further lag (s)."""
    at = pair.t + lag
    W = pair.integral(pair.v[:, :2], at)
    v = np.stack([np.interp(at, pair.t_v, column) for column in pair.v[:, :2].T], axis=1)
    e = pair.p[:, :2] - W
    use: Mask = np.asarray(np.isfinite(e).all(axis=1))
    for _ in range(2):
        number = _run_numbers(block[use])
        columns = _within(np.c_[e[use], W[use], v[use]], number)
        ex, ey, wx, wy, vx, vy = columns.T
        A = np.c_[np.r_[wx, wy], np.r_[-wy, wx], np.r_[vx, vy]]
        x, std, residuals = clustered_least_squares(A, np.r_[ex, ey], np.r_[number, number])
        keep = _without_outliers(residuals.reshape(2, -1).T)
        if keep.all():
            break
        use[np.flatnonzero(use)[~keep]] = False
    return x, std


def _departures(pair: Pair, x: Array, std: Array) -> Iterator[Reason]:
    """Reasons from what `_horizontal` found."""
    scale, angle, lag = (np.abs(x) / np.maximum(SURE * std, [SCALE, ANGLE, LAG])).tolist()
    if scale > 1:
        factor = 1 / (1 + x[0])
        yield _unit_reason(pair, factor, f"(+- {std[0]:.2g})", scale)
    if angle > 1:
        yield Reason(
            "frame",
            f"the velocity is rotated by {np.degrees(-x[1]):+.1f} +- {np.degrees(std[1]):.1f} deg "
            f"from the displacements of {pair.position}",
            "refer north to true north: correct for the declination, or for grid north",
            pair.velocity,
            angle,
        )
    if lag > 1:
        yield Reason(
            "clock",
            f"the velocity is {abs(x[2]):.2f} +- {std[2]:.2f} s "
            f"{'later' if x[2] > 0 else 'earlier'} than the change of {pair.position}",
            f"add {-x[2]:+.2f} s to `offset` of its `time`, or {x[2]:+.2f} s to that of "
            f"{pair.position}; the IMU shows which",
            pair.velocity,
            lag,
        )


def _vertical(pair: Pair, block: Ints, lag: float, what: str) -> Checked:
    """Sign and scale of the vertical velocity."""
    known = np.isfinite(pair.v[:, 2])
    if known.mean() < 0.9 or not pair.has_height:
        return Checked.with_unknown(f"vertical of {what}", "one of the two has no vertical part")
    v = np.where(known, pair.v[:, 2], 0.0)[:, None]
    W = pair.integral(v, pair.t + lag)[:, 0]
    use = np.isfinite(W)
    number = _run_numbers(block[use])
    p, W = _within(np.c_[pair.p[use, 2], W[use]], number).T
    keep = _without_outliers((p - W)[:, None]) | _without_outliers((p + W)[:, None])
    number = _run_numbers(number[keep])
    x, std, _ = clustered_least_squares(W[keep, None], p[keep], number)
    if not v.any():
        return _no_vertical(pair, p)
    if not SURE * std[0] < 0.8:
        return Checked.with_unknown(f"vertical of {what}", "the height changes too little")
    if x[0] < -0.5:
        seen = f"its vertical part has the wrong sign ({x[0]:.2f} +- {std[0]:.2f} of the height's)"
        remedy = 'down must be positive: set its `axes` (such as "ENU", or "+1 +2 -3" signs)'
        return Checked([], [Reason("frame", seen, remedy, pair.velocity, 2 * SURE)], [])
    far = max(SURE * std[0], 0.25)
    if abs(x[0] - 1) <= far:
        return Checked.empty()
    # Noise of the velocity makes x small as well; where that is all, the velocity explains more of
    # the heights than they of it.
    back, back_std, _ = clustered_least_squares(p[keep, None], W[keep], number)
    if x[0] < 1 and not back[0] - 1 > max(SURE * back_std[0], 0.25):
        return Checked.with_unknown(f"vertical of {what}", "the height changes too little")
    seen = f"its vertical part is {1 / x[0]:.3g} times the change of height of {pair.position}"
    remedy = "check unit, scale and column of both verticals"
    weight = float(abs(x[0] - 1) / far)
    return Checked([], [Reason("unit", seen, remedy, pair.velocity, weight)], [])


def _no_vertical(pair: Pair, p: Array) -> Checked:
    """A vertical velocity of exactly zero, beside heights p (n,) less their means over blocks."""
    std = float(np.median(pair.std[:, 2]))
    if not float(p.std()) > 2 * std:
        return Checked.empty()
    return Checked(
        [],
        [
            Reason(
                "repeated",
                f"its vertical part is always 0, and the heights of {pair.position} change by "
                f"{p.std():.1f} m (rms over {BLOCK:g} s, claimed {std:.1f})",
                "leave its cells empty where the receiver gives none",
                pair.velocity,
                float(p.std()) / (2 * std),
            )
        ],
        [],
    )


def _drift(pair: Pair, block: Ints, lag: float) -> Iterator[Reason]:
    """Reasons for a mean of dp/dt - v that is not zero, over all blocks."""
    v = np.where(np.isfinite(pair.v), pair.v, 0.0)
    e = pair.p - pair.integral(v, pair.t + lag)
    use = np.isfinite(e).all(axis=1)
    number, count = _run_numbers(block[use]), np.bincount(block[use])
    count = count[count > 0]
    middle = np.bincount(number, pair.t[use]) / count
    same = np.diff(np.bincount(number, pair.pauses(pair.t)[use]) / count) == 0
    if same.sum() < MIN_STEPS:
        return
    for axis, name in enumerate(("north", "east", "down")):
        level = np.bincount(number, e[use, axis]) / count
        steps, seconds = np.diff(level)[same], np.diff(middle)[same]
        rate = steps.sum() / seconds.sum()
        scatter = (steps - rate * seconds).std() * np.sqrt(len(steps)) / seconds.sum()
        weight = float(abs(rate) / max(SURE * scatter, DRIFT))
        if weight > 1 and (axis < 2 or (pair.has_height and v[:, 2].any())):
            yield Reason(
                "lasting errors",
                f"its mean {name} rate differs by {rate:+.3f} +- {scatter:.3f} m/s from {pair.velocity}",
                "find which of the two drifts, and give it a larger `std`",
                pair.position,
                weight,
            )
