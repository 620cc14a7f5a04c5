"""Why the fixes of a run were rejected: its innovations against what each cause makes of them.

The error d(t) of a fix does not appear fully in the innovation: the filter follows it with its gain
K, so a constant error becomes nearly invisible. With x the part already followed, by rows of the
innovation,

    e = d - x + noise,      x <- x + K (d - x) where the fix was used,      K = 1 - R / S

R from the stated standard deviation, S from the innovation's covariance L L'. Least squares fits an
error of a shape (a step, a ramp, velocity times a clock offset, ...) to e, whitened by L. The
residual of N normal rows has the deviance N ln(chi2 / N) + N, with separate free variances for the
rows that passed the gate and the others; p parameters cost p ln N (Schwarz 1978). The shape that
lowers the deviance most wins if it lowers it by at least MARGIN.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...typing import Array, Mask

JUMP, DRIFT, CLOCK, NOISE = "jump", "drift", "clock", "noise too small"
DISAGREE, OUTLIERS, UNKNOWN = "other sources disagree", "single outliers", "not known"
MARGIN = 10.0
"""Smallest reduction of the deviance by a shape: "very strong" evidence by Kass and Raftery
(1995)."""
PARTS = {JUMP: 0.5, CLOCK: 0.1}
PART_OF_LASTING = 0.2
"""Part of the excess chi-square of rejected fixes that a shape must explain. A lasting error
disturbs the filter each time that a gate is opened, which no shape models."""
MIN_SPREAD = 0.25  # of the claimed variance: rows with a common filter error scatter less
SPREAD = 1.8
"""Ratio of the variance of accepted innovations to the claimed one above which the stated noise is
too small: with a std half the true one, the ratio is 4, of which the gate leaves 2.4."""
BLOCK = 32  # rows
IN_A_ROW = 5  # consecutive rejections that are not single outliers
MAX_STEPS = 12  # parts of a run that may each begin with a jump
ONSETS = (
    0.0,
    2.0,
    5.0,
    10.0,
    20.0,
    40.0,
)  # s before the first rejection at which a drift may begin
OFFSET, SCALE, ALWAYS = "offset", "scale", "drift from the beginning"
"""Shapes of a source that contradicts others for its whole duration."""
START = "start"
"""No shape: the filter may be inconsistent."""
LASTING = (DRIFT, CLOCK, OFFSET, SCALE)
"""Shapes that explain rejections with good fixes between them."""


class Window(NamedTuple):
    """The m fixes of a source around a run of rejections, in time order."""

    t: Array  # (m,) s
    innovation: Array  # (m, 3); NaN where not measured
    root: Array  # (m, 3, 3) L, unit diagonal where not measured
    std: Array  # (m, 3) stated
    used: Mask  # (m,)
    passed: Mask  # (m,) passed the gate, not only used because it was opened
    velocity: Array  # (m, 3) of the filter, NED, m/s
    acceleration: Array  # (m, 3) of it, m/s^2
    kind: str  # of the source
    parts: tuple[tuple[int, int], ...]  # (first, last) rejected fix of each part of the run


class CauseFound(NamedTuple):
    """A shape and its fit."""

    shape: str  # a cause, or OFFSET or SCALE
    size: Array  # (3,) of a jump, an offset, a drift per s; (1,) of a clock (s) or a scale
    since: float  # s
    until: float  # s; inf: it stayed
    spread: float  # std of the residual over the claimed one
    gain: float  # reduction of the deviance compared with free spread alone


class _Shape(NamedTuple):
    name: str
    since: float
    until: float
    basis: Array  # (m, 3, p) errors of the fixes, by parameter
    followed: bool  # whether the filter follows it
    more: int = 1  # parameters beside those of the basis: its onset, its end


def find(window: Window) -> CauseFound:
    """Return the shape that explains a run best, or NOISE, OUTLIERS or UNKNOWN without one."""
    measured = np.isfinite(window.innovation)
    e = whitened_values(window.root, np.where(measured, window.innovation, 0.0)[:, :, None])[
        :, :, 0
    ]
    passed, e = np.broadcast_to(window.passed[:, None], e.shape)[measured], e[measured]
    shapes = list(_shapes(window))
    basis = _whitened_errors(window, shapes)[measured]
    sums = [_Sums.of(e[part], basis[part]) for part in (passed, ~passed)]
    count, plain = len(e), _deviance(sums)
    found, last = [_without(window, e, passed)], 0
    for shape in shapes:
        own = slice(last, last + shape.basis.shape[2])
        last = own.stop
        size = _fit(sums, own)
        left = [each.less(own, size) for each in sums]
        gain = plain - _deviance(left) - (len(size) + shape.more) * np.log(count)
        spread = sum(each.squares for each in left)
        least = PARTS.get(shape.name, PART_OF_LASTING)
        refused = (sums[1].squares - left[1].squares) / max(sums[1].squares - sums[1].rows, 1.0)
        if gain > MARGIN and refused > least:
            spread = float(np.sqrt(spread / count))
            found.append(CauseFound(shape.name, size, shape.since, shape.until, spread, gain))
    return max(found, key=lambda each: each.gain)


def whitened_values(root: Array, values: Array) -> Array:
    """L^-1 of (m, 3, p) values."""
    z = np.empty_like(values)
    for i in range(3):
        z[:, i] = values[:, i]
        for k in range(i):
            z[:, i] -= root[:, i, k, None] * z[:, k]
        z[:, i] /= root[:, i, i, None]
    return z


class _Sums(NamedTuple):
    """Sums over n whitened innovations e and the effect of p parameters on them, A: e'e, A'e and
    A'A."""

    rows: int
    squares: float
    right: Array  # (p,)
    normal: Array  # (p, p)

    @classmethod
    def of(cls, e: Array, A: Array) -> "_Sums":
        """Return their sums, BLOCK rows at a time: for so few rows no library starts threads, which
        would take longer than the sums."""
        blocks = np.zeros((-(-len(e) // BLOCK) * BLOCK, 1 + A.shape[1]))
        blocks[: len(e), 0], blocks[: len(e), 1:] = e, A
        blocks = blocks.reshape(-1, BLOCK, blocks.shape[1])
        total = (blocks.transpose(0, 2, 1) @ blocks).sum(axis=0)
        return cls(len(e), float(total[0, 0]), total[0, 1:], total[1:, 1:])

    def less(self, own: slice, size: Array) -> "_Sums":
        """Return the sums without the effect of these values of some of the parameters."""
        explained = 2 * size @ self.right[own] - size @ self.normal[own, own] @ size
        return self._replace(squares=self.squares - float(explained))


def _deviance(sums: Sequence[_Sums]) -> float:
    """Return the deviance of normal rows of free spread, one spread for each of the sums."""
    return sum(
        each.rows * (float(np.log(max(each.squares / each.rows, MIN_SPREAD))) + 1.0)
        for each in sums
        if each.rows
    )


def _fit(sums: Sequence[_Sums], own: slice) -> Array:
    """Return some of the parameters by least squares, 0 where they are not observable."""
    normal = sum((each.normal[own, own] for each in sums), np.zeros(()))
    right = sum((each.right[own] for each in sums), np.zeros(()))
    seen = np.diagonal(normal) > 1e-9
    size = np.zeros(len(normal))
    size[seen] = np.linalg.lstsq(normal[np.ix_(seen, seen)], right[seen], rcond=1e-10)[0]
    return size


def _without(window: Window, e: Array, passed: Mask) -> CauseFound:
    """Classify a run that no shape explains: noise, single outliers, or unknown."""
    spread, good = float(np.sqrt(np.mean(e**2))), e[passed]
    bad = ~window.passed
    if len(good) and np.mean(good**2) > SPREAD:
        shape = NOISE
    else:
        shape = OUTLIERS if _longest(bad) < IN_A_ROW and not bad.all() else UNKNOWN
    return CauseFound(shape, np.empty(0), window.t[window.parts[0][0]], np.inf, spread, 0.0)


def _longest(bad: Mask) -> int:
    """Return the longest run."""
    ends = np.flatnonzero(np.diff(np.r_[0, bad.astype(int), 0]))
    return int(np.diff(ends)[::2].max(initial=0))


def _each(values: Array) -> Array:
    """(m, 3, 3): a separate parameter for each row of the innovation."""
    return values[:, None, None] * np.eye(3)


def _shapes(window: Window) -> Iterator[_Shape]:
    t, first = window.t, window.parts[0][0]
    ones = np.ones(len(t))
    if len(window.parts) == 1:
        yield from _jumps(t, ~window.passed, *window.parts[0])
    else:
        onsets = [t[part[0]] for part in window.parts[:MAX_STEPS]]
        steps = np.concatenate([_each((t >= since) * ones) for since in onsets], axis=2)
        yield _Shape(JUMP, t[first], np.inf, steps, True, len(onsets))
    for back in ONSETS:
        if t[first] - back >= t[0]:
            ramp = np.maximum(t - t[first] + back, 0.0)
            yield _Shape(DRIFT, t[first] - back, np.inf, _each(ramp), True)
    follows = {"position": window.velocity, "velocity": window.acceleration}.get(window.kind)
    if follows is not None:
        yield _Shape(CLOCK, t[0], np.inf, follows[:, :, None], True, 0)
        late = np.where((t >= t[first])[:, None], follows, 0.0)
        yield _Shape(CLOCK, t[first], np.inf, late[:, :, None], True)
    if window.kind != "position":
        yield _Shape(OFFSET, t[0], np.inf, _each(ones), False, 0)
    if not np.isfinite(window.innovation[:, 1:]).any():
        speed = np.sqrt((window.velocity**2).sum(axis=1))
        yield _Shape(SCALE, t[0], np.inf, (speed[:, None] * [1.0, 0.0, 0.0])[:, :, None], False, 0)


def _jumps(t: Array, bad: Mask, first: int, last: int) -> Iterator[_Shape]:
    """Yield jumps that stay or return, from the first rejection or an earlier fix, because the gate
    may have accepted some."""
    again = first + np.flatnonzero(np.diff(bad[first : last + 1].astype(int)) > 0)
    ends = [t[last]] if last + 1 < len(t) else []
    ends += [t[again[-1]]] if len(again) else []  # rejected again when it returned
    for back in range(min(3, first) + 1):
        since = t[first - back]
        yield _Shape(JUMP, since, np.inf, _each((t >= since) * 1.0), True)
        for until in ends:
            inside = (t >= since) & (t <= until)
            yield _Shape(JUMP, since, until, _each(inside * 1.0), True, 2)


def _whitened_errors(window: Window, shapes: list[_Shape]) -> Array:
    """Return (m, 3, p), the whitened effect of all parameters of the shapes on the innovations,
    after the filter has followed the error so far."""
    variance = (window.root**2).sum(axis=2)
    gain = np.clip(1 - window.std**2 / variance, 0.0, 1.0)
    gain[~window.used] = 0.0
    errors = np.concatenate([shape.basis for shape in shapes], axis=2)
    widths = [shape.basis.shape[2] for shape in shapes]
    follow = np.repeat([float(shape.followed) for shape in shapes], widths)
    x = errors[0] * follow  # the filter has followed an error before the first of these fixes
    for d, k in zip(errors, gain[:, :, None] * follow):
        d -= x
        x += k * d
    return whitened_values(window.root, errors)
