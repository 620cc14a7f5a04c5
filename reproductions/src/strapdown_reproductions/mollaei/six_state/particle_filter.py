"""The particle Kalman filter of the six states, equations (33)-(36) of Mollaei et al. read as Hoteit, Luo & Pham (2012) wrote them.

A mixture of Gaussians: each predicted as an extended Kalman filter does, corrected by its own gain, weighted by the likelihood of its innovation, and
resampled by filters/particle/mixture.py, which keeps mean and covariance, once few of them carry the weight. Without fixes the weights stay and the components
go their own ways.
"""
import math

from strapdown.core.jit import helper, matrix, plain
from strapdown.core.contract import CORRECT, PREDICT, kernel
from strapdown.filters.particle.threefry import STREAM
from strapdown.filters.particle.mixture import accumulate, clear, effective, kernel_width, moments, moments_size, resample, resample_size, weigh
from strapdown.filters.particle.mixture import begin as begin_mixture
from .model import OWN, TRIAL, X, begin, changed, copy, correct_gaussian, keep, linearised, publish, seen, turn

EFFECTIVE, RESAMPLINGS, REPAIRS, DEGENERATE = range(4)      # output columns, as of filters/particle/pkf.py
N, KERNEL, THRESHOLD, RANDOM = OWN, OWN + 1, OWN + 2, OWN + 3      # components; kernel width; effective ones below which it resamples; stream
MEAN = RANDOM + STREAM
LEFT = MEAN + 6                         # the covariance as the filter left it
PHI = LEFT + 36
SUMS = PHI + 36
WORK = SUMS + plain(moments_size)(6)
COMPONENTS = WORK + plain(resample_size)(6)     # N x (state, covariance); then N weights, log-likelihoods, ancestors, deviations, new deviations
WIDTH, EACH = 42, 42 + 3 + 12


def start(start, noise, components=500, kernel=None, resample=0.5, seed=0, model=0.1, q=0.0, r=0.0, rate=100.0, aircraft="aerosonde",
          earth="flat"):
    """Belief at `start`. components; kernel: their width as a fraction of the mixture's (None: core.mixture.kernel_width); resample: when fewer than
    this fraction of them are effective; seed of the draws; the others as of EKF6.
    """
    if not 0 <= resample <= 1:
        raise ValueError(f"resample is {resample}; it must be a fraction of the components, 0 to 1")
    width = kernel_width(components, 6) if kernel is None else kernel
    deviations, phi, stream = begin_mixture(start.belief(None).P[:6, :6], components, width, seed)
    size = len(deviations)
    belief = begin(start, COMPONENTS - OWN + size * EACH, model, q, r, rate, aircraft, earth)
    aux = belief.aux
    aux[N], aux[KERNEL], aux[THRESHOLD], aux[RANDOM:RANDOM + STREAM], aux[EFFECTIVE] = size, width, resample * size, stream, size
    each = aux[COMPONENTS:COMPONENTS + size * WIDTH].reshape(size, WIDTH)
    each[:, :6], each[:, 6:] = aux[X:X + 6] + deviations, phi.ravel()
    aux[COMPONENTS + size * WIDTH:COMPONENTS + size * (WIDTH + 1)] = 1 / size
    keep(belief.P, aux[LEFT:LEFT + 36].reshape(6, 6))
    return belief


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """Attitude by the gyros; each component as an extended Kalman filter predicts it."""
    turn(belief, u, dt)
    aux = belief.aux
    count = int(aux[N])
    _follow(belief, count)
    sums, weights = aux[SUMS:WORK], aux[COMPONENTS + WIDTH * count:COMPONENTS + (WIDTH + 1) * count]
    clear(sums)
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        if weights[k] > 0:
            linearised(belief, aux[at:at + 6], matrix(aux, at + 6, 6, 6), dt, noise)
            _add(aux, weights[k], at, sums)
    _leave(belief)


@helper
def _follow(belief, count):
    """What somebody else added to the covariance of the mixture, as where a gate was lifted, each component gets."""
    aux, P, left = belief.aux, belief.P, matrix(belief.aux, LEFT, 6, 6)
    if changed(P, left):
        for k in range(count):
            own = matrix(aux, COMPONENTS + WIDTH * k + 6, 6, 6)
            for i in range(6):
                for j in range(6):
                    own[i, j] += P[i, j] - left[i, j]
        keep(P, left)


@helper
def _add(aux, weight, at, sums):
    """A component to the sums, as its deviation from the last mean."""
    off = aux[TRIAL:TRIAL + 6]
    for i in range(6):
        off[i] = aux[at + i] - aux[X + i]
    accumulate(weight, off, aux[at + 6:at + WIDTH], sums)


@helper
def _leave(belief):
    """Mean and covariance of the mixture become those of the belief."""
    aux = belief.aux
    mean, left = aux[MEAN:MEAN + 6], matrix(aux, LEFT, 6, 6)
    moments(aux[SUMS:WORK], mean, left)
    for i in range(6):
        aux[X + i] += mean[i]
    keep(left, belief.P)
    publish(belief)


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """Weight and correct each component by a fix within the gate, which is that of the mixture's own moments; resample where few carry the weight."""
    aux = belief.aux
    count = int(aux[N])
    _follow(belief, count)
    trial, spread = aux[TRIAL:TRIAL + 6], matrix(aux, TRIAL + 6, 6, 6)
    copy(aux[X:X + 6], belief.P, trial, spread)
    first = seen(aux, y, kind, trial, innovation)
    nis, _ = correct_gaussian(aux, trial, spread, first, innovation, sd)
    if not nis <= gate:
        return nis
    e0, e1, e2 = innovation[0], innovation[1], innovation[2]
    after = COMPONENTS + WIDTH * count
    weights, logs, sums = aux[after:after + count], aux[after + count:after + 2 * count], aux[SUMS:WORK]
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        if weights[k] > 0:
            x, P = aux[at:at + 6], matrix(aux, at + 6, 6, 6)
            copy(x, P, trial, spread)
            seen(aux, y, kind, x, innovation)
            own, spread_of_own = correct_gaussian(aux, trial, spread, first, innovation, sd)
            logs[k] = -0.5 * (own + spread_of_own)
            if math.isfinite(logs[k]):
                copy(trial, spread, x, P)
    innovation[0], innovation[1], innovation[2] = e0, e1, e2
    aux[DEGENERATE] += weigh(logs, weights)
    clear(sums)
    for k in range(count):
        if weights[k] > 0:
            _add(aux, weights[k], COMPONENTS + WIDTH * k, sums)
    _leave(belief)
    aux[EFFECTIVE] = effective(weights)
    if aux[EFFECTIVE] < aux[THRESHOLD]:
        _renew(belief, count)
    return nis


@helper
def _renew(belief, count):
    """Resample: all components weigh the same afterwards and have the same covariance, and the mixture has the moments it had."""
    aux = belief.aux
    after = COMPONENTS + WIDTH * count
    old, new = matrix(aux, after + 3 * count, count, 6), matrix(aux, after + 9 * count, count, 6)
    for k in range(count):
        for i in range(6):
            old[k, i] = aux[COMPONENTS + WIDTH * k + i] - aux[X + i]
    aux[REPAIRS] += resample(aux[after:after + count], old, matrix(aux, COMPONENTS, count, WIDTH), 6, matrix(aux, LEFT, 6, 6), aux[KERNEL],
                             aux[RANDOM:RANDOM + STREAM], aux[after + 2 * count:after + 3 * count], new, matrix(aux, PHI, 6, 6),
                             aux[WORK:COMPONENTS])
    for k in range(count):
        at = COMPONENTS + WIDTH * k
        for i in range(6):
            aux[at + i] = aux[X + i] + new[k, i]
        for i in range(36):
            aux[at + 6 + i] = aux[PHI + i]
    aux[RESAMPLINGS] += 1
