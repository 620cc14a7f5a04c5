"""A mixture of Gaussians on the states of an INS: components in the workspace of a belief, their
errors about it, its moments, what they foresee of a fix.

The belief is the mean on the manifold and the covariance of the mixture.
filters/particle/mixture.py has what does not depend on the states.
"""

import math
from typing import NamedTuple

from ...core.contract import COURSE_KIND, HEADING_KIND, MOST_STATES, STATES, Belief, Observe, Slots
from ...core.earth import place
from ...core.embedded import NAVIGATION, navigation, take_over
from ...core.error_state import DX, ERROR_STATE, JACOBIAN, inject_all, observed
from ...core.jit import flatten, helper, inlined, matrix
from ...core.kalman import LEAST_NOISE
from ...core.rotation import rotation_between, wrap
from ...core.threefry import STREAM
from ...typing import Array
from .mixture import accumulate, clear, moments, moments_size, resample_size

TAIL = NAVIGATION.size  # where a component's states that aidings brought along begin
SLOTS = Slots(after=ERROR_STATE)
"""The components take turns with the slots of the error state."""
EFFECTIVE = SLOTS.output("effective_components")
RESAMPLINGS = SLOTS.output("resamplings")
REPAIRS = SLOTS.output("repairs")
DEGENERATE = SLOTS.output("degenerate")
# how many components there are, h, and below how many effective ones they are drawn anew
COUNT, KERNEL, LEAST = SLOTS.numbers("COUNT", "KERNEL", "LEAST")
RANDOM = SLOTS.array("RANDOM", STREAM)  # see core/threefry.py
# of a fix: covariance of the innovation (3 x 3), its mean, variances without correlations
FORESEEN = SLOTS.array("FORESEEN", 15)
LEFT = SLOTS.matrix("LEFT", MOST_STATES, MOST_STATES)  # (n, n) covariance as the last call left it
SUMS = SLOTS.array("SUMS", moments_size(MOST_STATES))  # see there
MEAN = SLOTS.array("MEAN", MOST_STATES)  # n numbers
PHI = SLOTS.matrix("PHI", MOST_STATES, MOST_STATES)  # (n, n)
DRAWING = SLOTS.array("DRAWING", resample_size(MOST_STATES))  # see there
COMPONENTS = SLOTS.rest("COMPONENTS")  # what `places` says


class Mixture(NamedTuple):
    """What there is beside the belief, as views of its workspace."""

    shared: Array  # workspace, of which the components use the slots of the error state
    left: Array  # (n, n) covariance as the last call left it
    sums: Array  # see moments_size of filters/particle/mixture.py
    mean: Array  # (n,)
    weights: Array  # (N,)
    logs: Array  # (N,)
    deviations: Array  # (N, n) errors of the components about the belief
    drawn: Array  # (N, n)
    Phi: Array  # (n, n)
    work: Array  # see resample_size there
    components: Array  # (N, width): state, extra states, P


@inlined
def places(n: int, N: int) -> tuple[int, int, int, int, int]:
    """Where the logs of N components with n states begin in their part of workspace, after the
    weights; deviations, new deviations, the components themselves; numbers of one of these."""
    return N, 2 * N, 2 * N + N * n, 2 * N + 2 * N * n, TAIL + n - STATES + n * n


@inlined
def beside(belief: Belief) -> Mixture:
    """The Mixture of a belief."""
    workspace, n, N = belief.workspace, belief.P.shape[0], int(belief.workspace[COUNT])
    own = workspace[COMPONENTS:]
    logs, deviations, drawn, components, width = places(n, N)
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
        matrix(own, components, N, width),
    )


@inlined
def component(m: Mixture, i: int) -> Belief:
    """Component i as a Belief of its own."""
    x, n = m.components[i], m.mean.size
    return navigation(x, matrix(x, TAIL + n - STATES, n, n), m.shared, x[TAIL : TAIL + n - STATES])


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
    take_over(own, belief)
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
    H, mine, x = matrix(shared, JACOBIAN, 3, n), shared[DX], m.work
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
                if kind == HEADING_KIND or kind == COURSE_KIND:
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
                if innovation.size > 6:
                    innovation[6 + i * (i + 1) // 2 + r] = 0.0
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
                if innovation.size > 3:
                    innovation[3 + i] = s[12 + i]
            if innovation.size > 6:
                innovation[6 + i * (i + 1) // 2 + r] = s[3 * i + r]
    return nis if any else math.nan
