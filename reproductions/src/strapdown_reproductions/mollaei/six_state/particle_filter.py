"""The particle Kalman filter of the six states, equations (33)-(36) of Mollaei et al. read as
Hoteit, Luo & Pham (2012) wrote them.

A mixture of Gaussians: each predicted as an extended Kalman filter does, corrected by its own gain,
weighted by the likelihood of its innovation, and resampled by filters/particle/mixture.py, which
keeps mean and covariance, once few of them carry the weight. Without fixes the weights stay and the
components go their own ways.
"""

import math

from strapdown.checks import check_number
from strapdown.core.contract import CORRECT, PREDICT, Belief, Noise, Observe, Start, kernel
from strapdown.core.jit import helper, matrix, plain
from strapdown.filters.particle.mixture import (
    accumulate,
    begin as begin_mixture,
    clear,
    effective,
    kernel_width,
    moments,
    moments_size,
    resample,
    resample_size,
    weigh,
)
from strapdown.filters.particle.threefry import STREAM
from strapdown.flight.aircraft.parameters import Aircraft
from strapdown.typing import Array, File

from .model import (
    OWN,
    TRIAL,
    X,
    begin,
    changed,
    copy,
    correct_gaussian,
    keep,
    linearised,
    publish,
    seen,
    turn,
)

# output columns, as of filters/particle/pkf.py
EFFECTIVE, RESAMPLINGS, REPAIRS, DEGENERATE = range(4)
# components; kernel width; effective ones below which it resamples; stream
N, KERNEL, THRESHOLD, RANDOM = (
    OWN,
    OWN + 1,
    OWN + 2,
    OWN + 3,
)
MEAN = RANDOM + STREAM
LEFT = MEAN + 6  # the covariance as the filter left it
PHI = LEFT + 36
SUMS = PHI + 36
WORK = SUMS + plain(moments_size)(6)
# N x (state, covariance); then N weights, log-likelihoods, ancestors, deviations, new deviations
COMPONENTS = WORK + plain(resample_size)(6)
WIDTH, EACH = 42, 42 + 3 + 12


def start(
    start: Start,
    noise: Noise,
    components: int = 500,
    kernel: float | None = None,
    resample: float = 0.5,
    seed: int = 0,
    model: float = 0.1,
    q: float = 0.0,
    r: float = 0.0,
    rate: float = 100.0,
    aircraft: File | Aircraft = "aerosonde",
    earth: str = "flat",
) -> Belief:
    """Belief at `start`. components; kernel: their width as a fraction of the mixture's (None:
    mixture.kernel_width); resample: when fewer than this fraction of them are effective; seed
    of the draws; the others as of EKF6.
    """
    check_number(resample, "resample", least=0, most=1)
    width = kernel_width(components, 6) if kernel is None else kernel
    deviations, phi, stream = begin_mixture(start.belief(None).P[:6, :6], components, width, seed)
    size = len(deviations)
    numbers = COMPONENTS - OWN + size * EACH
    belief = begin(start, numbers, model, q, r, rate, aircraft, earth)
    workspace = belief.workspace
    (
        workspace[N],
        workspace[KERNEL],
        workspace[THRESHOLD],
        workspace[RANDOM : RANDOM + STREAM],
        workspace[EFFECTIVE],
    ) = size, width, resample * size, stream, size
    each = workspace[COMPONENTS : COMPONENTS + size * WIDTH].reshape(size, WIDTH)
    each[:, :6], each[:, 6:] = workspace[X : X + 6] + deviations, phi.ravel()
    workspace[COMPONENTS + size * WIDTH : COMPONENTS + size * (WIDTH + 1)] = 1 / size
    keep(belief.P, workspace[LEFT : LEFT + 36].reshape(6, 6))
    return belief


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Attitude by the gyros; each component as an extended Kalman filter predicts it."""
    turn(belief, u, dt)
    workspace = belief.workspace
    count = int(workspace[N])
    _follow(belief, count)
    sums, weights = (
        workspace[SUMS:WORK],
        workspace[COMPONENTS + WIDTH * count : COMPONENTS + (WIDTH + 1) * count],
    )
    clear(sums)
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        if weights[k] > 0:
            linearised(belief, workspace[at : at + 6], matrix(workspace, at + 6, 6, 6), dt, noise)
            _add(workspace, weights[k], at, sums)
    _leave(belief)


@helper
def _follow(belief: Belief, count: int) -> None:
    """What somebody else added to the covariance of the mixture, as where a gate was lifted,
    each component gets."""
    workspace, P, left = belief.workspace, belief.P, matrix(belief.workspace, LEFT, 6, 6)
    if changed(P, left):
        for k in range(count):
            own = matrix(workspace, COMPONENTS + WIDTH * k + 6, 6, 6)
            for i in range(6):
                for j in range(6):
                    own[i, j] += P[i, j] - left[i, j]
        keep(P, left)


@helper
def _add(workspace: Array, weight: float, at: int, sums: Array) -> None:
    """A component to the sums, as its deviation from the last mean."""
    off = workspace[TRIAL : TRIAL + 6]
    for i in range(6):
        off[i] = workspace[at + i] - workspace[X + i]
    accumulate(weight, off, workspace[at + 6 : at + WIDTH], sums)


@helper
def _leave(belief: Belief) -> None:
    """Mean and covariance of the mixture become those of the belief."""
    workspace = belief.workspace
    mean, left = workspace[MEAN : MEAN + 6], matrix(workspace, LEFT, 6, 6)
    moments(workspace[SUMS:WORK], mean, left)
    for i in range(6):
        workspace[X + i] += mean[i]
    keep(left, belief.P)
    publish(belief)


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Weight and correct each component by a fix within the gate, which is that of the mixture's
    own moments; resample where few carry the weight."""
    workspace = belief.workspace
    count = int(workspace[N])
    _follow(belief, count)
    trial, spread = workspace[TRIAL : TRIAL + 6], matrix(workspace, TRIAL + 6, 6, 6)
    copy(workspace[X : X + 6], belief.P, trial, spread)
    first = seen(workspace, y, kind, trial, innovation)
    nis, _ = correct_gaussian(workspace, trial, spread, first, innovation, sd)
    if not nis <= gate:
        return nis
    e0, e1, e2 = innovation[0], innovation[1], innovation[2]
    after = COMPONENTS + WIDTH * count
    weights, logs, sums = (
        workspace[after : after + count],
        workspace[after + count : after + 2 * count],
        workspace[SUMS:WORK],
    )
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        if weights[k] > 0:
            x, P = workspace[at : at + 6], matrix(workspace, at + 6, 6, 6)
            copy(x, P, trial, spread)
            seen(workspace, y, kind, x, innovation)
            own, spread_of_own = correct_gaussian(workspace, trial, spread, first, innovation, sd)
            logs[k] = -0.5 * (own + spread_of_own)
            if math.isfinite(logs[k]):
                copy(trial, spread, x, P)
    innovation[0], innovation[1], innovation[2] = e0, e1, e2
    workspace[DEGENERATE] += weigh(logs, weights)
    clear(sums)
    for k in range(count):
        if weights[k] > 0:
            _add(workspace, weights[k], COMPONENTS + WIDTH * k, sums)
    _leave(belief)
    workspace[EFFECTIVE] = effective(weights)
    if workspace[EFFECTIVE] < workspace[THRESHOLD]:
        _renew(belief, count)
    return nis


@helper
def _renew(belief: Belief, count: int) -> None:
    """Resample: all components weigh the same afterwards and have the same covariance, and the
    mixture has the moments it had."""
    workspace = belief.workspace
    after = COMPONENTS + WIDTH * count
    old, new = (
        matrix(workspace, after + 3 * count, count, 6),
        matrix(workspace, after + 9 * count, count, 6),
    )
    for k in range(count):
        for i in range(6):
            old[k, i] = workspace[COMPONENTS + WIDTH * k + i] - workspace[X + i]
    workspace[REPAIRS] += resample(
        workspace[after : after + count],
        old,
        matrix(workspace, COMPONENTS, count, WIDTH),
        6,
        matrix(workspace, LEFT, 6, 6),
        workspace[KERNEL],
        workspace[RANDOM : RANDOM + STREAM],
        workspace[after + 2 * count : after + 3 * count],
        new,
        matrix(workspace, PHI, 6, 6),
        workspace[WORK:COMPONENTS],
    )
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        for i in range(6):
            workspace[at + i] = workspace[X + i] + new[k, i]
        for i in range(36):
            workspace[at + 6 + i] = workspace[PHI + i]
    workspace[RESAMPLINGS] += 1
