"""The particle Kalman filter of the six states, equations (33)-(36) of Mollaei et al. read as
Hoteit, Luo & Pham (2012) wrote them.

A mixture of Gaussians: each predicted as an extended Kalman filter does, or by the sigma points
(37)-(39) that stand in the same section, corrected by its own gain,
weighted by the likelihood of its innovation, and resampled by filters/particle/mixture.py, which
keeps mean and covariance, once few of them carry the weight. Without fixes the weights stay and the
components go their own ways.
"""

import math
from typing import Any, NamedTuple

from strapdown.checks import check_choice, check_number
from strapdown.core.compile.jit import flatten, helper, inline, matrix
from strapdown.core.loop.contract import (
    CORRECT,
    PREDICT,
    FilterState,
    InitialState,
    Noise,
    Observe,
    Slots,
    kernel,
)
from strapdown.core.mathematics.threefry import STREAM
from strapdown.filters.particle import pkf
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
    update_weights,
)
from strapdown.filters.sigma_point.sigma_points import covariance, factor, symmetric
from strapdown.typing import Array

from .model import (
    SIX,
    TRIAL,
    TRIAL_P,
    Options,
    X,
    begin,
    copy,
    correct_gaussian,
    innovation_at,
    is_changed,
    keep,
    propagate_linearised,
    publish,
    takes_options,
    turn,
)
from .sigma_point_filters import LANES, LAYOUT, ROWS, through

SLOTS = Slots(after=SIX)
EFFECTIVE, RESAMPLINGS, REPAIRS, DEGENERATE = map(SLOTS.output, pkf.SLOTS.columns)
# components; kernel width; effective ones below which it resamples
N, KERNEL, THRESHOLD = SLOTS.numbers("N", "KERNEL", "THRESHOLD")
RANDOM = SLOTS.array("RANDOM", STREAM)  # stream
MEAN = SLOTS.array("MEAN", 6)
LEFT = SLOTS.matrix("LEFT", 6, 6)  # the covariance as the filter left it
PHI = SLOTS.matrix("PHI", 6, 6)
SUMS = SLOTS.array("SUMS", moments_size(6))
WORK = SLOTS.array("WORK", resample_size(6))
SETS = SLOTS.array("SETS", 3)  # of sigma points, see sigma_point_filters.through; 0: none
SQUARE_ROOT = SLOTS.array("SQUARE_ROOT", LANES * ROWS)  # of a component, and its points
ROOM = SLOTS.part("ROOM", LAYOUT)
COMPONENTS = SLOTS.rest("COMPONENTS")  # see `views`
WIDTH = 42  # of a component: state, covariance
EACH = WIDTH + 3 + 12


class Views(NamedTuple):
    """N components, as views of workspace."""

    components: Array  # (N, WIDTH)
    weights: Array  # (N,)
    logs: Array  # (N,) log-likelihoods
    ancestors: Array  # (N,)
    deviations: Array  # (N, 6)
    drawn: Array  # (N, 6): new deviations


@inline
def views(workspace: Array) -> Views:
    """The components and their associated arrays."""
    n, own = int(workspace[N]), workspace[COMPONENTS:]
    after = WIDTH * n
    return Views(
        matrix(own, 0, n, WIDTH),
        own[after : after + n],
        own[after + n : after + 2 * n],
        own[after + 2 * n : after + 3 * n],
        matrix(own, after + 3 * n, n, 6),
        matrix(own, after + 9 * n, n, 6),
    )


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    components: int = 500,
    kernel: float | None = None,
    resample: float = 0.5,
    seed: int = 0,
    transition: str = "linearised",
    **shared: Any,
) -> FilterState:
    """The filter state at `start`. components; kernel: their width as a fraction of the mixture's
    (None: mixture.kernel_width); resample: when fewer than this fraction of them are effective;
    seed of the draws; transition: of each component, "linearised" at its mean or by "sigma-points",
    the symmetric set (37)-(39); shared: Options.
    """
    check_number(resample, "resample", least=0, most=1)
    check_choice(transition, "transition", ("linearised", "sigma-points"))
    width = kernel_width(components, 6) if kernel is None else kernel
    deviations, phi, stream = begin_mixture(start.belief(None).P[:6, :6], components, width, seed)
    size = len(deviations)
    belief = begin(start, SLOTS, Options(**shared), rest=size * EACH)
    workspace = belief.workspace
    workspace[N], workspace[KERNEL], workspace[THRESHOLD] = size, width, resample * size
    workspace[RANDOM], workspace[EFFECTIVE] = stream, size
    if transition == "sigma-points":
        workspace[SETS] = *symmetric(12), 6.0
    own = workspace[COMPONENTS:]
    each = own[: size * WIDTH].reshape(size, WIDTH)
    each[:, :6], each[:, 6:] = workspace[X] + deviations, phi.ravel()
    own[size * WIDTH : size * (WIDTH + 1)] = 1 / size
    SLOTS.views(workspace)["LEFT"][:] = belief.P[:6, :6]
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Attitude by the gyros; each component as an extended Kalman filter predicts it, or by sigma
    points."""
    turn(belief, u, dt)
    workspace = belief.workspace
    m, sums, sets, S = views(workspace), workspace[SUMS], workspace[SETS], workspace[SQUARE_ROOT]
    _follow(belief)
    clear(sums)
    for k in range(m.weights.size):
        if m.weights[k] > 0:
            own = m.components[k]
            x, P = own[:6], matrix(own, 6, 6, 6)
            if sets[0] > 0:
                workspace[REPAIRS] += factor(P, 6, LANES, S)
                workspace[REPAIRS] += through(belief, x, S, sets, workspace[ROOM], noise, dt)
                covariance(S, 6, LANES, P)
            else:
                propagate_linearised(belief, x, P, dt, noise)
            _add(workspace, m.weights[k], own, sums)
    _leave(belief)


@helper
def _follow(belief: FilterState) -> None:
    """Add to each component any change that others made to the covariance of the mixture, as where
    a gate was opened."""
    components, P, left = (
        views(belief.workspace).components,
        belief.P,
        matrix(belief.workspace, LEFT, 6, 6),
    )
    if is_changed(P, left):
        for k in range(components.shape[0]):
            own = matrix(components[k], 6, 6, 6)
            for i in range(6):
                for j in range(6):
                    own[i, j] += P[i, j] - left[i, j]
        keep(P, left)


@helper
def _add(workspace: Array, weight: float, component: Array, sums: Array) -> None:
    """A component to the sums, as its deviation from the last mean."""
    off, x = workspace[TRIAL], workspace[X]
    for i in range(6):
        off[i] = component[i] - x[i]
    accumulate(weight, off, component[6:], sums)


@helper
def _leave(belief: FilterState) -> None:
    """Mean and covariance of the mixture become those of the belief."""
    workspace = belief.workspace
    mean, left, x = workspace[MEAN], matrix(workspace, LEFT, 6, 6), workspace[X]
    moments(workspace[SUMS], mean, left)
    for i in range(6):
        x[i] += mean[i]
    keep(left, belief.P)
    publish(belief)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Weight and correct each component by a fix within the gate, which is that of the mixture's
    own moments; resample where few carry the weight."""
    workspace, m, sums = belief.workspace, views(belief.workspace), belief.workspace[SUMS]
    _follow(belief)
    trial, spread = workspace[TRIAL], matrix(workspace, TRIAL_P, 6, 6)
    copy(workspace[X], belief.P, trial, spread)
    first = innovation_at(workspace, y, kind, trial, innovation)
    nis, _ = correct_gaussian(workspace, trial, spread, first, innovation, std)
    if not nis <= gate:
        return nis
    e0, e1, e2 = innovation[0], innovation[1], innovation[2]
    for k in range(m.weights.size):
        if m.weights[k] > 0:
            x, P = m.components[k][:6], matrix(m.components[k], 6, 6, 6)
            copy(x, P, trial, spread)
            innovation_at(workspace, y, kind, x, innovation)
            own, spread_of_own = correct_gaussian(workspace, trial, spread, first, innovation, std)
            m.logs[k] = -0.5 * (own + spread_of_own)
            if math.isfinite(m.logs[k]):
                copy(trial, spread, x, P)
    innovation[0], innovation[1], innovation[2] = e0, e1, e2
    workspace[DEGENERATE] += update_weights(m.logs, m.weights)
    clear(sums)
    for k in range(m.weights.size):
        if m.weights[k] > 0:
            _add(workspace, m.weights[k], m.components[k], sums)
    _leave(belief)
    workspace[EFFECTIVE] = effective(m.weights)
    if workspace[EFFECTIVE] < workspace[THRESHOLD]:
        _renew(belief)
    return nis


@helper
def _renew(belief: FilterState) -> None:
    """Resample: all components weigh the same afterwards and have the same covariance, and the
    mixture has the moments it had."""
    workspace, m, x = belief.workspace, views(belief.workspace), belief.workspace[X]
    phi = matrix(workspace, PHI, 6, 6)
    for k in range(m.weights.size):
        for i in range(6):
            m.deviations[k, i] = m.components[k, i] - x[i]
    workspace[REPAIRS] += resample(
        m.weights,
        m.deviations,
        flatten(m.components),
        WIDTH,
        6,
        1,
        matrix(workspace, LEFT, 6, 6),
        workspace[KERNEL],
        workspace[RANDOM],
        m.ancestors,
        m.drawn,
        phi,
        workspace[WORK],
    )
    for k in range(m.weights.size):
        for i in range(6):
            m.components[k, i] = x[i] + m.drawn[k, i]
            for j in range(6):
                m.components[k, 6 + 6 * i + j] = phi[i, j]
    workspace[RESAMPLINGS] += 1
