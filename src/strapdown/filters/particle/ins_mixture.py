"""A mixture of Gaussians on the states of an INS: components in the workspace of a belief, their
errors about it, its moments, what they foresee of a fix.

The belief is the mean on the manifold and the covariance of the mixture.
filters/particle/mixture.py has what does not depend on the states.
"""

import math
from typing import NamedTuple

from ...core.compile.jit import flatten, helper, inline, lanes_of, matrix, sides
from ...core.compile.selection import any_of, where
from ...core.compile.signatures import LANES
from ...core.loop.contract import MAX_STATES, STATES, FilterState, Kind, Observe, Slots, SourceRow
from ...core.mathematics.earth import place
from ...core.mathematics.embedded import NAVIGATION, copy_motion, navigation
from ...core.mathematics.error_state import (
    DX,
    ERROR_STATE,
    JACOBIAN,
    inject_all,
    observe_innovation,
)
from ...core.mathematics.kalman import MIN_NOISE
from ...core.mathematics.rotation import rotation_between, wrap
from ...core.mathematics.threefry import STREAM
from ...typing import Array
from .mixture import accumulate, clear, moments, moments_size, resample_size

TAIL = NAVIGATION.size  # where the augmented states of a component begin
SLOTS = Slots(after=ERROR_STATE)
EFFECTIVE = SLOTS.output("effective_components")
RESAMPLINGS = SLOTS.output("resamplings")
REPAIRS = SLOTS.output("repairs")
DEGENERATE = SLOTS.output("degenerate")
# how many components there are, h, and below how many effective ones they are drawn anew
COUNT, KERNEL, RESAMPLE_AT = SLOTS.numbers("COUNT", "KERNEL", "RESAMPLE_AT")
RANDOM = SLOTS.array("RANDOM", STREAM)  # see core/mathematics/threefry.py
# of a fix: covariance of the innovation (3 x 3), its mean, variances without correlations
FORESEEN = SLOTS.array("FORESEEN", 15)
LEFT = SLOTS.matrix("LEFT", MAX_STATES, MAX_STATES)  # (n, n) covariance as the last call left it
SUMS = SLOTS.array("SUMS", moments_size(MAX_STATES))  # see there
MEAN = SLOTS.array("MEAN", MAX_STATES)  # n numbers
PHI = SLOTS.matrix("PHI", MAX_STATES, MAX_STATES)  # (n, n)
DRAWING = SLOTS.array("DRAWING", resample_size(MAX_STATES))  # see there
ONE = SLOTS.part("ONE", NAVIGATION)  # a component that is observed, its extra states and P
ONE_EXTRA = SLOTS.array("ONE_EXTRA", MAX_STATES - STATES)
ONE_P = SLOTS.matrix("ONE_P", MAX_STATES, MAX_STATES)
OF_GROUP = ERROR_STATE.size
SHARED = SLOTS.array("SHARED", LANES * OF_GROUP)
"""The slots of the error state side by side, which groups of eight components take turns with."""
FORESEEN_LANES = SLOTS.array("FORESEEN_LANES", LANES * 15)
SUMS_LANES = SLOTS.array("SUMS_LANES", LANES * moments_size(MAX_STATES))
COMPONENTS = SLOTS.rest("COMPONENTS")  # what `places` says


class Mixture(NamedTuple):
    """The mixture beside the filter state, as views of its workspace."""

    workspace: Array
    left: Array  # (n, n) covariance as the last call left it
    sums: Array  # see moments_size of filters/particle/mixture.py
    mean: Array  # (n,)
    weights: Array  # (8 groups,), 0 of the components that only fill the last group
    logs: Array  # as many
    deviations: Array  # (N, n) errors of the components about the belief
    drawn: Array  # (N, n)
    Phi: Array  # (n, n)
    work: Array  # see resample_size there
    components: Array  # groups of eight, each eight times `component_width` numbers
    groups: int


class ComponentGroup(NamedTuple):
    """Eight components: numbers are lanes."""

    own: FilterState
    weight: float
    x: Array  # (n,) error about the belief
    counted: Array  # (1,) weight, or 0 where a fix is not measured
    seen: Array  # (3,) innovation
    H: Array  # (3, n)


@inline
def component_width(n: int) -> int:
    """Numbers of a component: its state, extra states, P, and what a fix is to it."""
    return TAIL + n - STATES + n * n + n + 4 + 3 * n


@inline
def places(n: int, N: int) -> tuple[int, int, int, int, int, int]:
    """Where the logs of N components with n states begin in their part of workspace, after the
    weights; deviations, new deviations, the components themselves; where these end; how many groups
    of eight they are."""
    groups = (N + LANES - 1) // LANES
    many = LANES * groups
    deviations, drawn, components = 2 * many, 2 * many + N * n, 2 * many + 2 * N * n
    return many, deviations, drawn, components, components + many * component_width(n), groups


@inline
def beside(belief: FilterState) -> Mixture:
    """The Mixture of a belief."""
    workspace, n, N = belief.workspace, belief.P.shape[0], int(belief.workspace[COUNT])
    own = workspace[COMPONENTS:]
    logs, deviations, drawn, components, end, groups = places(n, N)
    return Mixture(
        workspace,
        matrix(workspace, LEFT, n, n),
        workspace[SUMS][: moments_size(n)],
        workspace[MEAN][:n],
        own[:logs],
        own[logs:deviations],
        matrix(own, deviations, N, n),
        matrix(own, drawn, N, n),
        matrix(workspace, PHI, n, n),
        workspace[DRAWING],
        own[components:end],
        groups,
    )


@inline
def group(m: Mixture, g: int, side: int) -> ComponentGroup:
    """Group g of the components, below `for side in sides()`."""
    n = m.mean.size
    width, P = component_width(n), TAIL + n - STATES
    numbers = lanes_of(m.components, LANES * width * g, width, side)
    shared = lanes_of(m.workspace, SHARED.start, OF_GROUP, side)
    x, counted = P + n * n, P + n * n + n
    return ComponentGroup(
        navigation(numbers, matrix(numbers, P, n, n), shared, numbers[TAIL:P]),
        lanes_of(m.weights, LANES * g, 1, side)[0],
        numbers[x:counted],
        numbers[counted : counted + 1],
        numbers[counted + 1 : counted + 4],
        matrix(numbers, counted + 4, 3, n),
    )


@helper
def counts(m: Mixture, g: int) -> bool:
    """True where any component of a group has weight; a group without weight is used nowhere any
    more."""
    some = False
    for k in range(LANES * g, LANES * g + LANES):
        some |= m.weights[k] > 0
    return some


@helper
def added_up(eight: Array, sums: Array) -> None:
    """Sums over components from those of the eight sides of all groups."""
    for k in range(sums.size):
        a, b, c, d = eight[8 * k], eight[8 * k + 1], eight[8 * k + 2], eight[8 * k + 3]
        e, f, g, h = eight[8 * k + 4], eight[8 * k + 5], eight[8 * k + 6], eight[8 * k + 7]
        sums[k] = ((a + b) + (c + d)) + ((e + f) + (g + h))


@helper
def metres(belief: FilterState) -> tuple[float, float]:
    """Metres per radian of latitude and of longitude at a belief, those of `displace`."""
    sine, cosine, M, N = place(belief.lla[0], belief.lla[2])
    return M, N * cosine


@inline
def deviate(own: FilterState, belief: FilterState, north: float, east: float, x: Array) -> None:
    """x = own (-) belief, the error that `inject` would have to add to the belief; metres per
    radian from `metres`."""
    turn = own.lla[1] - belief.lla[1]
    x[0], x[1], x[2] = (
        (own.lla[0] - belief.lla[0]) * north,
        where(abs(turn) > 3, wrap(turn), turn) * east,
        belief.lla[2] - own.lla[2],
    )
    C = own.C_nb
    x[6], x[7], x[8] = rotation_between(
        belief.C_nb,
        (C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2]),
    )
    for i in range(3):
        x[3 + i], x[9 + i], x[12 + i] = (
            own.v_n[i] - belief.v_n[i],
            own.b_a[i] - belief.b_a[i],
            own.b_g[i] - belief.b_g[i],
        )
    for i in range(own.augmented.size):
        x[STATES + i] = own.augmented[i] - belief.augmented[i]


@inline
def settle(belief: FilterState, m: Mixture) -> None:
    """Belief and P from the sums of all groups; what P is now is remembered."""
    added_up(m.workspace[SUMS_LANES], m.sums)
    moments(m.sums, m.mean, belief.P)
    inject_all(belief, m.mean)
    now, left = flatten(belief.P), flatten(m.left)
    for k in range(now.size):
        left[k] = now[k]


@inline
def recentre(belief: FilterState, m: Mixture) -> None:
    """Belief and P from all components, wherever they are: first their mean, then the moments
    about it."""
    n = m.mean.size
    eight = m.workspace[SUMS_LANES]
    clear(eight[: LANES * n])
    north, east = metres(belief)
    for g in range(m.groups):
        if counts(m, g):
            for side in sides():
                of, sums = group(m, g, side), lanes_of(eight, 0, n, side)
                deviate(of.own, belief, north, east, of.x)
                for j in range(n):
                    sums[j] += of.weight * of.x[j]
    added_up(eight, m.mean)
    inject_all(belief, m.mean)
    begin_sums(m)
    north, east = metres(belief)
    for g in range(m.groups):
        if counts(m, g):
            for side in sides():
                of = group(m, g, side)
                deviate(of.own, belief, north, east, of.x)
                take_in(m, of, side)
    settle(belief, m)


@inline
def begin_sums(m: Mixture) -> None:
    """Before the first group."""
    clear(m.workspace[SUMS_LANES][: LANES * m.sums.size])


@inline
def take_in(m: Mixture, of: ComponentGroup, side: int) -> None:
    """Add a group to the moments."""
    sums = lanes_of(m.workspace, SUMS_LANES.start, m.sums.size, side)
    accumulate(of.weight, of.x, flatten(of.own.P), sums)


@inline
def carry(belief: FilterState, m: Mixture) -> None:
    """Hand on to the components what the loop did to P since the last call: more of everything, or
    more variance of single states.

    What all variances have grown by draws the components apart and widens each; the rest widens
    each.
    """
    now, left, n = belief.P, m.left, m.mean.size
    changed, factor = False, math.inf
    for i in range(n):
        for j in range(n):
            changed |= now[i, j] != left[i, j]
        if left[i, i] > 0:
            factor = min(factor, now[i, i] / left[i, i])
    if not changed:
        return
    factor = factor if 0 < factor < math.inf else 1.0
    north, east = metres(belief)
    for g in range(m.groups):
        for side in sides():
            of = group(m, g, side)
            own, x = of.own, of.x
            if factor != 1:
                deviate(own, belief, north, east, x)
                for i in range(n):
                    x[i] *= math.sqrt(factor)
                set_component(own, belief, x)
            for i in range(n):
                for j in range(n):
                    own.P[i, j] = factor * own.P[i, j] + (now[i, j] - factor * left[i, j])
    for i in range(n):
        for j in range(n):
            left[i, j] = now[i, j]


@inline
def set_component(own: FilterState, belief: FilterState, x: Array) -> None:
    """The component whose error about the belief is x."""
    copy_motion(own, belief)
    for i in range(own.augmented.size):
        own.augmented[i] = belief.augmented[i]
    inject_all(own, x)


@inline
def foresee(
    belief: FilterState,
    m: Mixture,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
) -> float:
    """NIS of a fix by the mixture's own moments; its mean innovation goes into `innovation`. NaN
    where nothing is measured. What the fix is to each component is kept beside it.

    Which rows are measured is seen at the belief.
    """
    n, s, workspace = m.mean.size, belief.workspace[FORESEEN], m.workspace
    H, eight, total = matrix(workspace, JACOBIAN, 3, n), workspace[FORESEEN_LANES], 0.0
    observe_innovation(belief, y, observe, source, innovation, H)
    wrapped = kind == Kind.HEADING or kind == Kind.COURSE
    clear(eight)
    for g in range(m.groups):
        if counts(m, g):
            for k in range(LANES):
                total += _observed_one(belief, m, g, k, y, observe, source, innovation, H)
            for side in sides():
                _foresee_eight(
                    group(m, g, side), innovation, wrapped, lanes_of(eight, 0, 15, side), m, side
                )
    added_up(eight, s)
    return _surprise(s, total, std, innovation)


@inline
def _observed_one(
    belief: FilterState,
    m: Mixture,
    g: int,
    k: int,
    y: Array,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
    H: Array,
) -> float:
    """Innovation and H of component k of a group, kept beside it, and its weight where it measures
    what is measured at the belief, else 0; H is workspace."""
    n, workspace, weight = m.mean.size, m.workspace, m.weights[LANES * g + k]
    width, P = component_width(n), TAIL + n - STATES
    numbers, mine = m.components[LANES * width * g :], workspace[DX]
    if weight > 0:
        one, extra = workspace[ONE], workspace[ONE_EXTRA][: n - STATES]
        own = matrix(workspace, ONE_P, n, n)
        flat = flatten(own)
        for i in range(TAIL):
            one[i] = numbers[LANES * i + k]
        for i in range(n - STATES):
            extra[i] = numbers[LANES * (TAIL + i) + k]
        for i in range(n * n):
            flat[i] = numbers[LANES * (P + i) + k]
        observe_innovation(navigation(one, own, workspace, extra), y, observe, source, mine, H)
        if not same_rows(innovation, mine):
            weight = 0.0
    counted = P + n * n + n
    numbers[LANES * counted + k] = weight
    for i in range(3):
        numbers[LANES * (counted + 1 + i) + k] = mine[i] if weight > 0 else math.nan
        for j in range(n):
            numbers[LANES * (counted + 4 + n * i + j) + k] = H[i, j] if weight > 0 else 0.0
    return weight


@helper
def same_rows(innovation: Array, mine: Array) -> bool:
    """True where a component measures all that is measured at the estimate; its other rows become
    NaN."""
    for i in range(3):
        if math.isnan(innovation[i]):
            mine[i] = math.nan
        elif math.isnan(mine[i]):
            return False
    return True


@inline
def _foresee_eight(
    of: ComponentGroup, innovation: Array, wrapped: bool, s: Array, m: Mixture, side: int
) -> None:
    """Add a group to the moments of the innovation, about that at the belief."""
    n, P, H, w = m.mean.size, of.own.P, of.H, of.counted[0]
    x, d = of.x, lanes_of(m.workspace, SHARED.start, 3, side)
    for i in range(3):
        d[i] = where(w > 0, of.seen[i] - innovation[i], 0.0)
    if wrapped:
        d[0] = wrap(d[0])
    for i in range(3):
        if math.isnan(innovation[i]):
            continue
        s[9 + i] += w * d[i]
        for j in range(n):
            x[j] = 0.0
        for k in range(n):
            h = H[i, k]
            if any_of(h != 0):
                s[12 + i] += w * h * h * P[k, k]
                for j in range(n):
                    x[j] += h * P[k, j]
        for r in range(i + 1):
            if math.isnan(innovation[r]):
                continue
            sum = d[i] * d[r]
            for j in range(n):
                sum += x[j] * H[r, j]
            s[3 * i + r] += w * sum


@helper
def _remaining_covariance(s: Array, i: int, r: int, total: float, innovation: Array) -> float:
    """Covariance of the innovations i and r, less what the factors of the rows before r tell of it."""
    value = s[3 * i + r] / total - s[9 + i] * s[9 + r]
    for k in range(r):
        if not math.isnan(innovation[k]):
            value -= s[3 * i + k] * s[3 * r + k]
    return value


@helper
def _surprise(s: Array, total: float, std: Array, innovation: Array) -> float:
    """NIS from these moments, whose weights add up to `total`; adds the mean to the innovation.
    Infinite where they are no covariance."""
    nis, any = 0.0, False
    for i in range(3):
        if math.isnan(innovation[i]):
            continue
        if not total > 0:
            return math.inf
        any = True
        s[9 + i] /= total
        innovation[i] += s[9 + i]
        e = innovation[i]
        for r in range(i + 1):
            if math.isnan(innovation[r]):
                if innovation.size > 6:
                    innovation[6 + i * (i + 1) // 2 + r] = 0.0
                continue
            value = _remaining_covariance(s, i, r, total, innovation)
            if r < i:
                s[3 * i + r] = value / s[3 * r + r]
                e -= s[3 * i + r] * s[12 + r]
            else:
                value += max(std[i] * std[i], MIN_NOISE * s[12 + i] / total)
                if not value > 0:
                    return math.inf
                s[3 * i + i] = math.sqrt(value)
                s[12 + i] = e / s[3 * i + i]
                nis += s[12 + i] * s[12 + i]
                if innovation.size > 3:
                    innovation[3 + i] = s[12 + i]
            if innovation.size > 6:
                innovation[6 + i * (i + 1) // 2 + r] = s[3 * i + r]
    return nis if any else math.nan
