"""Particle Kalman filter: a mixture of Gaussians, each the closed loop of its own INS, weighted by
how well it predicts the fixes.

docs/explanation/particle.md has the equations; filters/particle/ins_mixture.py what belief and components have
to do with each other.
"""

import math
from collections.abc import Mapping

import numpy as np

from ...checks import check_number
from ...core.compile.jit import flatten, helper, inline, lanes_of, sides
from ...core.compile.selection import any_of, where
from ...core.compile.signatures import LANES
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    STATES,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceRow,
    first_event,
    kernel,
)
from ...core.mathematics.earth import curvature
from ...core.mathematics.elementary import logarithm
from ...core.mathematics.embedded import as_numbers
from ...core.mathematics.error_state import (
    DV,
    DX,
    HEIGHT,
    MODEL,
    WORK,
    allocate,
    bias_free,
    decay_biases,
    inject_and_reset,
    linearised_step,
    publish_rates,
)
from ...core.mathematics.kalman import decay, of_estimates, update, used_rows
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation_vectors import exponentials
from ...core.mathematics.threefry import normal_rows
from ...typing import Array
from .ins_mixture import (
    COMPONENTS,
    COUNT,
    DEGENERATE,
    EFFECTIVE,
    KERNEL,
    LEFT,
    RANDOM,
    REPAIRS,
    RESAMPLE_AT,
    RESAMPLINGS,
    SHARED,
    SLOTS,
    TAIL,
    ComponentGroup,
    Mixture,
    begin_sums,
    beside,
    carry,
    component_width,
    counts,
    deviate,
    foresee,
    group,
    metres,
    places,
    recentre,
    set_component,
    settle,
    take_in,
)
from .mixture import (
    begin,
    effective,
    kernel_width,
    resample,
    update_weights,
)

MAX_NIS = 1e300  # of a NIS that is used: beyond it nothing is finite


def start(
    start: InitialState,
    noise: Noise,
    components: int = 500,
    kernel: float | None = None,
    resample: float = 0.5,
    seed: int = 0,
) -> FilterState:
    """The filter state at `start`, its components drawn from it with the random numbers of `seed`.

    kernel: h in (0, 1], the width of a component as a share of the mixture's, none given:
    kernel_width of filters/particle/mixture.py; resample: resample below this share of effective
    components. Refuses options outside their range.
    """
    n = len(start.std)
    if kernel is None:  # of no component at all too, which `begin` refuses
        kernel = kernel_width(components, n)
    check_number(resample, "resample", least=0, most=1)
    belief = start.belief(np.empty(0))
    deviations, Phi, random = begin(belief.P, components, kernel, seed)
    N = len(deviations)
    logs, _, _, first, end, groups = places(n, N)
    workspace = allocate(SLOTS, rest=end)
    workspace[EFFECTIVE] = workspace[COUNT] = N
    workspace[KERNEL], workspace[RESAMPLE_AT], workspace[RANDOM] = kernel, resample * N, random
    workspace[LEFT : LEFT + n * n] = belief.P.ravel()
    for slot in MODEL, HEIGHT:
        workspace[SHARED][LANES * slot : LANES * slot + LANES] = workspace[slot]
    rest = workspace[COMPONENTS:]
    rest[:N] = 1 / N
    belief = belief._replace(workspace=workspace)
    numbers = np.concatenate([as_numbers(belief), belief.augmented, Phi.ravel()])
    own = np.zeros((LANES * groups, component_width(n)))
    own[:, : len(numbers)] = numbers
    M, E = np.add(curvature(math.sin(belief.lla[0])), belief.lla[2])
    own[:N, 0:3] += deviations[:, 0:3] / [M, E * np.cos(belief.lla[0]), -1]
    own[:, 1] -= 2 * np.pi * np.round(own[:, 1] / (2 * np.pi))
    own[:N, 3:6] += deviations[:, 3:6]
    own[:N, 6:15] = (exponentials(deviations[:, 6:9]) @ belief.C_nb).reshape(N, 9)
    own[:N, 15:21] += deviations[:, 9:15]
    own[:N, TAIL : TAIL + n - STATES] += deviations[:, STATES:]
    rest[first:end] = own.reshape(groups, LANES, -1).transpose(0, 2, 1).ravel()
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Every component by its own closed loop; the belief moves with the mean of its INS and
    takes up what they make of it."""
    m = beside(belief)
    carry(belief, m)
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    mechanize(
        belief.lla,
        belief.v_n,
        belief.C_nb,
        r,
        a,
        dt,
        m.workspace[DV],
        m.workspace[HEIGHT],
    )
    publish_rates(belief, r, a, dt)
    # in a component an estimate decays as its distance from the mean of all does; where that mean
    # is held, every one gains what it would have lost
    own = of_estimates(noise)
    gain_a = decay(own.accel_decay * dt) - decay(noise.accel_decay * dt)
    gain_g = decay(own.gyro_decay * dt) - decay(noise.gyro_decay * dt)
    a0, a1, a2 = gain_a * belief.b_a[0], gain_a * belief.b_a[1], gain_a * belief.b_a[2]
    g0, g1, g2 = gain_g * belief.b_g[0], gain_g * belief.b_g[1], gain_g * belief.b_g[2]
    decay_biases(belief.b_a, belief.b_g, dt, noise)
    decaying = Noise(
        noise.gyro,
        noise.accel,
        noise.gyro_bias,
        noise.accel_bias,
        noise.gyro_decay,
        noise.accel_decay,
        0.0,
    )
    begin_sums(m)
    north, east = metres(belief)
    for g in range(m.groups):
        if counts(m, g):
            for side in sides():
                of = group(m, g, side)
                _advance(m, of, belief, u, dt, decaying, (a0, a1, a2), (g0, g1, g2), north, east)
                take_in(m, of, side)
    settle(belief, m)


@inline
def _advance(
    m: Mixture,
    of: ComponentGroup,
    belief: FilterState,
    u: Array,
    dt: float,
    noise: Noise,
    gained_a: tuple[float, float, float],
    gained_g: tuple[float, float, float],
    north: float,
    east: float,
) -> None:
    """Eight components by their own closed loops; their biases gain so much."""
    own = of.own
    r, a = bias_free(u, own.b_a, own.b_g, dt)
    linearised_step(own, own.C_nb, 1.0, u, dt, noise, False)
    for i in range(3):
        own.b_a[i] += gained_a[i]
        own.b_g[i] += gained_g[i]
    height = m.workspace[HEIGHT]
    mechanize(own.lla, own.v_n, own.C_nb, r, a, dt, own.workspace[DX], height)
    deviate(own, belief, north, east, of.x)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Gate by what the mixture foresees; correct each component, weigh it by its likelihood;
    draw anew where few are left that count."""
    m, workspace = beside(belief), belief.workspace
    carry(belief, m)
    nis = foresee(belief, m, y, std, kind, observe, source, innovation)
    if not nis <= gate:
        return nis
    workspace[DEGENERATE] += _correct_each(m, std, innovation)
    workspace[EFFECTIVE] = effective(m.weights)
    recentre(belief, m)
    if workspace[EFFECTIVE] < workspace[RESAMPLE_AT]:
        _draw_anew(belief, m)
    return nis


@inline
def _draw_anew(belief: FilterState, m: Mixture) -> None:
    """Resample, about the belief; belief and P stay."""
    workspace, n = belief.workspace, m.mean.size
    width, first = component_width(n), TAIL + n - STATES
    N = m.deviations.shape[0]
    for i in range(N):
        numbers = m.components[LANES * width * (i // LANES) + i % LANES :]
        for j in range(n):
            m.deviations[i, j] = numbers[LANES * (first + n * n + j)] - m.mean[j]
    workspace[REPAIRS] += resample(
        m.weights[:N],
        m.deviations,
        m.components,
        width,
        first,
        LANES,
        belief.P,
        workspace[KERNEL],
        workspace[RANDOM],
        m.logs[:N],
        m.drawn,
        m.Phi,
        m.work,
    )
    workspace[RESAMPLINGS] += 1
    for g in range(m.groups):
        numbers = m.components[LANES * width * g :]
        for k in range(LANES):
            i = min(LANES * g + k, N - 1)
            for j in range(n):
                numbers[LANES * (first + n * n + j) + k] = m.drawn[i, j]
        for side in sides():
            of = group(m, g, side)
            set_component(of.own, belief, of.x)
            P, Phi = flatten(of.own.P), flatten(m.Phi)
            for k in range(Phi.size):
                P[k] = Phi[k]


@inline
def _correct_each(m: Mixture, std: Array, innovation: Array) -> int:
    """Correct every component that counts by what `foresee` left beside it, and weigh. Returns 1
    where no likelihood was finite, 0 else."""
    used, rows = used_rows(m.mean.size), 0
    for i in range(3):
        rows += not math.isnan(innovation[i])
    for g in range(m.groups):
        for k in range(LANES * g, LANES * g + LANES):
            m.logs[k] = -math.inf
        if counts(m, g):
            for side in sides():
                of = group(m, g, side)
                own, log = of.own, lanes_of(m.logs, LANES * g, 1, side)
                work, dx = own.workspace[WORK], own.workspace[DX]
                nis = update(own.P, of.H, of.seen, std, 3, MAX_NIS, work, dx)
                if any_of(nis <= MAX_NIS):  # of the others the correction is nothing
                    inject_and_reset(own, dx)
                likelihood = -0.5 * nis
                for i in range(rows):
                    likelihood += logarithm(work[used + 4 + i])
                log[0] = where(of.counted[0] > 0, likelihood, -math.inf)
    degenerate = update_weights(m.logs, m.weights)
    _replace_lost(m)
    return degenerate


@helper
def _replace_lost(m: Mixture) -> None:
    """A component without weight, whatever became of it, has the numbers of the heaviest one: it
    goes on beside others."""
    width, heaviest = component_width(m.mean.size), 0
    for k in range(m.weights.size):
        if m.weights[k] > m.weights[heaviest]:
            heaviest = k
    from_ = LANES * width * (heaviest // LANES) + heaviest % LANES
    for k in range(m.weights.size):
        if not m.weights[k] > 0:
            to = LANES * width * (k // LANES) + k % LANES
            for i in range(width):
                m.components[to + LANES * i] = m.components[from_ + LANES * i]


def mixture_events(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where components had to be drawn together or a covariance mended, and where a
    fix told them nothing."""
    texts = {
        "repairs": "resamplings with too few components for their states, which were drawn "
        "together, or of no covariance, which was mended",
        "degenerate": "fixes under which no component has a finite likelihood: the weights were "
        "kept",
    }
    return [
        event
        for name, text in texts.items()
        for event in first_event(
            t, columns[name] > 0, f"{columns[name][-1:].sum():.0f} {text}; the first here"
        )
    ]


PKF = Filter(
    "pkf",
    "Hoteit, Luo & Pham (2012), MWR 140(2); Mollaei, Shafieirad & Moradi, section 3.3, corrected",
    start,
    predict,
    correct,
    slots=SLOTS,
    diagnose=mixture_events,
    start_kernels=(normal_rows,),
    bias=DECAYING,
    good_for="multimodal problems: unknown heading, beacons",
    poor_for="daily use: it costs 500 closed loops for the result of one",
)
