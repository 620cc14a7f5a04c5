"""A mixture of Gaussians on the states of an INS: components in the workspace of a belief, their
errors about it, its moments, what they foresee of a fix.

The belief is the mean on the manifold and the covariance of the mixture.
filters/particle/mixture.py has what does not depend on the states.
"""

import math
from typing import NamedTuple

from ...core.contract import HEADING_KIND, STATES, Belief, Observe
from ...core.earth import place
from ...core.error_state import DX, WORK, inject_all, observed
from ...core.jit import flatten, helper, inlined, matrix
from ...core.kalman import LEAST_NOISE, WORKSPACE, used_rows
from ...core.rotation import rotation_between, wrap
from ...typing import Array
from .mixture import accumulate, clear, moments, moments_size, resample_size
from .threefry import STREAM

EFFECTIVE, RESAMPLINGS, REPAIRS, DEGENERATE, COUNT, KERNEL, LEAST = range(7)
"""Of workspace: the output columns; how many components there are, h, and below how many
effective ones they are drawn anew."""
RANDOM = slice(7, 7 + STREAM)
# of a fix: covariance of the innovation (3 x 3), its mean, variances without correlations
FORESEEN = slice(10, 25)
# the workspace array of core.error_state that the components take turns with, then what Mixture
# names
SHARED = 25
TAIL = 27  # of a component's numbers: lla, v, C, ba, bg, omega, f before it, P behind it


class Mixture(NamedTuple):
    """What there is beside the belief, as views of its workspace."""

    shared: Array  # workspace array of core.error_state
    left: Array  # (n, n) covariance as the last call left it
    sums: Array  # see moments_size of filters/particle/mixture.py
    mean: Array  # (n,)
    weights: Array  # (N,)
    logs: Array  # (N,)
    deviations: Array  # (N, n) errors of the components about the belief
    drawn: Array  # (N, n)
    Phi: Array  # (n, n)
    work: Array  # see resample_size there
    components: Array  # (N, width)


@inlined
def shared_size(n: int) -> int:
    """Numbers of the workspace array of an error-state filter with n states."""
    return WORK + max(WORKSPACE, used_rows(n) + 13) + 3 * n


@inlined
def width(n: int) -> int:
    """Numbers of a component."""
    return TAIL + n - STATES + n * n


@inlined
def beside(belief: Belief) -> Mixture:
    """The Mixture of a belief."""
    workspace, n, N = belief.workspace, belief.P.shape[0], int(belief.workspace[COUNT])
    left = SHARED + shared_size(n)
    sums = left + n * n
    mean = sums + moments_size(n)
    weights = mean + n
    logs = weights + N
    deviations = logs + N
    drawn = deviations + N * n
    Phi = drawn + N * n
    work = Phi + n * n
    components = work + resample_size(n)
    return Mixture(
        workspace[SHARED:left],
        matrix(workspace, left, n, n),
        workspace[sums:mean],
        workspace[mean:weights],
        workspace[weights:logs],
        workspace[logs:deviations],
        matrix(workspace, deviations, N, n),
        matrix(workspace, drawn, N, n),
        matrix(workspace, Phi, n, n),
        workspace[work:components],
        matrix(workspace, components, N, width(n)),
    )


@inlined
def component(m: Mixture, i: int) -> Belief:
    """Component i as a Belief of its own."""
    x, n = m.components[i], m.mean.size
    return Belief(
        x[0:3],
        x[3:6],
        matrix(x, 6, 3, 3),
        x[15:18],
        x[18:21],
        matrix(x, TAIL + n - STATES, n, n),
        x[21:24],
        x[24:27],
        m.shared,
        x[TAIL : TAIL + n - STATES],
    )


@helper
def metres(belief: Belief) -> tuple[float, float]:
    """Metres per radian of latitude and of longitude at a belief, those of `displace`."""
    sine, cosine, M, N = place(belief.lla[0], belief.lla[2])
    return M, N * cosine


@inlined
def deviate(own: Belief, belief: Belief, north: float, east: float, x: Array) -> None:
    """x = own (-) belief, the error that `inject` would have to add to the belief; metres per
    radian from `metres`."""
    turn = own.lla[1] - belief.lla[1]
    x[0], x[1], x[2] = (
        (own.lla[0] - belief.lla[0]) * north,
        (wrap(turn) if abs(turn) > 3 else turn) * east,
        belief.lla[2] - own.lla[2],
    )
    C = own.C
    x[6], x[7], x[8] = rotation_between(
        belief.C, (C[0, 0], C[0, 1], C[0, 2], C[1, 0], C[1, 1], C[1, 2], C[2, 0], C[2, 1], C[2, 2])
    )
    for i in range(3):
        x[3 + i], x[9 + i], x[12 + i] = (
            own.v[i] - belief.v[i],
            own.ba[i] - belief.ba[i],
            own.bg[i] - belief.bg[i],
        )
    for i in range(own.extra_states.size):
        x[STATES + i] = own.extra_states[i] - belief.extra_states[i]


@inlined
def settle(belief: Belief, m: Mixture) -> None:
    """Belief and P from the sums of all deviations; what P is now is remembered."""
    moments(m.sums, m.mean, belief.P)
    inject_all(belief, m.mean)
    now, left = flatten(belief.P), flatten(m.left)
    for k in range(now.size):
        left[k] = now[k]


@inlined
def recentre(belief: Belief, m: Mixture) -> None:
    """Belief and P from all components, wherever they are: first their mean, then the moments
    about it. `deviations` are about the belief then."""
    n = m.mean.size
    for j in range(n):
        m.sums[j] = 0.0
    north, east = metres(belief)
    for i in range(m.weights.size):
        if m.weights[i] > 0:
            deviate(component(m, i), belief, north, east, m.deviations[i])
            for j in range(n):
                m.sums[j] += m.weights[i] * m.deviations[i, j]
    inject_all(belief, m.sums)
    clear(m.sums)
    north, east = metres(belief)
    for i in range(m.weights.size):
        if m.weights[i] > 0:
            own = component(m, i)
            deviate(own, belief, north, east, m.deviations[i])
            accumulate(m.weights[i], m.deviations[i], flatten(own.P), m.sums)
    settle(belief, m)
    for i in range(m.weights.size):
        for j in range(n):
            m.deviations[i, j] -= m.mean[j]


@inlined
def carry(belief: Belief, m: Mixture) -> None:
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
    for k in range(m.weights.size):
        own, x = component(m, k), m.deviations[k]
        if factor != 1:
            deviate(own, belief, north, east, x)
            for i in range(n):
                x[i] *= math.sqrt(factor)
            put(own, belief, x)
        for i in range(n):
            for j in range(n):
                own.P[i, j] = factor * own.P[i, j] + (now[i, j] - factor * left[i, j])
    for i in range(n):
        for j in range(n):
            left[i, j] = now[i, j]


@inlined
def put(own: Belief, belief: Belief, x: Array) -> None:
    """The component whose error about the belief is x."""
    for i in range(3):
        own.lla[i], own.v[i], own.ba[i], own.bg[i] = (
            belief.lla[i],
            belief.v[i],
            belief.ba[i],
            belief.bg[i],
        )
        for j in range(3):
            own.C[i, j] = belief.C[i, j]
    for i in range(own.extra_states.size):
        own.extra_states[i] = belief.extra_states[i]
    inject_all(own, x)


@inlined
def foresee(
    belief: Belief,
    m: Mixture,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    innovation: Array,
) -> float:
    """NIS of a fix by the mixture's own moments; its mean innovation goes into `innovation`. NaN
    where nothing is measured. Nothing else changes.

    Which rows are measured is seen at the belief.
    """
    n, s, shared = m.mean.size, belief.workspace[FORESEEN], m.shared
    H, mine, x = matrix(shared, shared.size - 3 * n, 3, n), shared[DX], shared[WORK:]
    observed(belief, y, observe, parameters, innovation, H)
    total = 0.0
    for i in range(s.size):
        s[i] = 0.0
    for k in range(m.weights.size):
        if m.weights[k] > 0:
            own, w = component(m, k), m.weights[k]
            observed(own, y, observe, parameters, mine, H)
            if same_rows(innovation, mine):
                total += w
                if kind == HEADING_KIND:
                    mine[0] = innovation[0] + wrap(mine[0] - innovation[0])
                _foresee_one(own.P, H, w, innovation, mine, s, x)
    return _surprise(s, total, sd, innovation)


@helper
def same_rows(innovation: Array, mine: Array) -> bool:
    """Whether a component measures what is measured at the belief; others of its rows become
    none."""
    for i in range(3):
        if math.isnan(innovation[i]):
            mine[i] = math.nan
        elif math.isnan(mine[i]):
            return False
    return True


@helper
def _foresee_one(
    P: Array, H: Array, w: float, innovation: Array, mine: Array, s: Array, x: Array
) -> None:
    """Add a component to the moments of the innovation, about that at the belief; x is n numbers
    of workspace."""
    n = P.shape[0]
    for i in range(3):
        if math.isnan(innovation[i]):
            continue
        d = mine[i] - innovation[i]
        s[9 + i] += w * d
        for j in range(n):
            x[j] = 0.0
        for k in range(n):
            if H[i, k] != 0:
                s[12 + i] += w * H[i, k] * H[i, k] * P[k, k]
                for j in range(n):
                    x[j] += H[i, k] * P[k, j]
        for r in range(i + 1):
            if math.isnan(innovation[r]):
                continue
            sum = d * (mine[r] - innovation[r])
            for j in range(n):
                sum += x[j] * H[r, j]
            s[3 * i + r] += w * sum


@helper
def _surprise(s: Array, total: float, sd: Array, innovation: Array) -> float:
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
                continue
            value = s[3 * i + r] / total - s[9 + i] * s[9 + r]
            for k in range(r):
                if not math.isnan(innovation[k]):
                    value -= s[3 * i + k] * s[3 * r + k]
            if r < i:
                s[3 * i + r] = value / s[3 * r + r]
                e -= s[3 * i + r] * s[12 + r]
            else:
                value += max(sd[i] * sd[i], LEAST_NOISE * s[12 + i] / total)
                if not value > 0:
                    return math.inf
                s[3 * i + i] = math.sqrt(value)
                s[12 + i] = e / s[3 * i + i]
                nis += s[12 + i] * s[12 + i]
    return nis if any else math.nan
