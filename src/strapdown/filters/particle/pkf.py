"""Particle Kalman filter: a mixture of Gaussians, each the closed loop of its own INS, weighted by
how well it predicts the fixes.

docs/particle.md has the equations; filters/particle/ins_mixture.py what belief and components have
to do with each other.
"""

import math
from collections.abc import Mapping

import numpy as np

from ...checks import check_number
from ...core.contract import (
    CORRECT,
    PREDICT,
    STATES,
    Belief,
    Filter,
    Noise,
    Observe,
    Start,
    first_event,
    kernel,
)
from ...core.earth import curvature
from ...core.embedded import as_numbers
from ...core.error_state import (
    DV,
    DX,
    HEIGHT,
    JACOBIAN,
    WORK,
    allocate,
    bias_free,
    decay_biases,
    linearised_step,
    observed,
    publish_rates,
    take_over,
)
from ...core.jit import flatten, inlined, matrix
from ...core.kalman import update, used_rows
from ...core.mechanization import mechanize
from ...core.rotation_vectors import exponentials
from ...typing import Array
from .ins_mixture import (
    COMPONENTS,
    COUNT,
    DEGENERATE,
    EFFECTIVE,
    KERNEL,
    LEAST,
    LEFT,
    RANDOM,
    REPAIRS,
    RESAMPLINGS,
    SLOTS,
    TAIL,
    Mixture,
    beside,
    carry,
    component,
    deviate,
    foresee,
    metres,
    places,
    put,
    recentre,
    same_rows,
    settle,
)
from .mixture import (
    accumulate,
    begin,
    clear,
    effective,
    kernel_width,
    resample,
    weigh,
)

LARGEST_NIS = 1e300  # of a NIS that is used: beyond it nothing is finite


def start(
    start: Start,
    noise: Noise,
    components: int = 500,
    kernel: float | None = None,
    resample: float = 0.5,
    seed: int = 0,
) -> Belief:
    """Belief at `start`, its components drawn from it with the random numbers of `seed`.

    kernel: h in (0, 1], the width of a component as a share of the mixture's, none given:
    kernel_width of filters/particle/mixture.py; resample: draw anew below this share of effective
    components. Refuses options outside their range.
    """
    n = len(start.sd)
    if kernel is None:  # of no component at all too, which `begin` refuses
        kernel = kernel_width(components, n)
    check_number(resample, "resample", least=0, most=1)
    belief = start.belief(np.empty(0))
    deviations, Phi, random = begin(belief.P, components, kernel, seed)
    N = len(deviations)
    logs, _, _, first, width = places(n, N)
    workspace = allocate(SLOTS, rest=first + N * width)
    workspace[EFFECTIVE] = workspace[COUNT] = N
    workspace[KERNEL], workspace[LEAST], workspace[RANDOM] = kernel, resample * N, random
    workspace[LEFT : LEFT + n * n] = belief.P.ravel()
    rest = workspace[COMPONENTS:]
    rest[:logs], own = 1 / N, rest[first:].reshape(N, width)
    belief = belief._replace(workspace=workspace)
    own[:] = np.concatenate([as_numbers(belief), belief.extra_states, Phi.ravel()])
    M, E = np.add(curvature(math.sin(belief.lla[0])), belief.lla[2])
    own[:, 0:3] += deviations[:, 0:3] / [M, E * np.cos(belief.lla[0]), -1]
    own[:, 1] -= 2 * np.pi * np.round(own[:, 1] / (2 * np.pi))
    own[:, 3:6] += deviations[:, 3:6]
    own[:, 6:15] = (exponentials(deviations[:, 6:9]) @ belief.C).reshape(N, 9)
    own[:, 15:21] += deviations[:, 9:15]
    own[:, TAIL : TAIL + n - STATES] += deviations[:, STATES:]
    return belief


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Every component by its own closed loop; the belief moves with the mean of its INS and
    takes up what they make of it."""
    m = beside(belief)
    carry(belief, m)
    r0, r1, r2, a0, a1, a2 = bias_free(u, belief.ba, belief.bg, dt)
    mechanize(
        belief.lla, belief.v, belief.C, r0, r1, r2, a0, a1, a2, dt, m.shared[DV], m.shared[HEIGHT]
    )
    publish_rates(belief, r0, r1, r2, a0, a1, a2, dt)
    decay_biases(belief.ba, belief.bg, dt, noise)
    clear(m.sums)
    north, east = metres(belief)
    for i in range(m.weights.size):
        if m.weights[i] > 0:  # without weight it counts nowhere any more
            own = component(m, i)
            r0, r1, r2, a0, a1, a2 = bias_free(u, own.ba, own.bg, dt)
            linearised_step(own, own.C, 1.0, u, dt, noise, False)
            mechanize(
                own.lla, own.v, own.C, r0, r1, r2, a0, a1, a2, dt, m.shared[DX], m.shared[HEIGHT]
            )
            deviate(own, belief, north, east, m.deviations[i])
            accumulate(m.weights[i], m.deviations[i], flatten(own.P), m.sums)
    settle(belief, m)


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
    """Gate by what the mixture foresees; correct each component, weigh it by its likelihood;
    draw anew where few are left that count."""
    m, workspace = beside(belief), belief.workspace
    carry(belief, m)
    nis = foresee(belief, m, y, sd, kind, observe, parameters, innovation)
    if not nis <= gate:
        return nis
    workspace[DEGENERATE] += _correct_each(m, y, sd, observe, parameters, innovation)
    workspace[EFFECTIVE] = effective(m.weights)
    recentre(belief, m)
    if workspace[EFFECTIVE] < workspace[LEAST]:
        _draw_anew(belief, m)
    return nis


@inlined
def _draw_anew(belief: Belief, m: Mixture) -> None:
    """Resample; `deviations` are about the belief, and belief and P stay."""
    workspace, first = belief.workspace, TAIL + m.mean.size - STATES
    workspace[REPAIRS] += resample(
        m.weights,
        m.deviations,
        m.components,
        first,
        belief.P,
        workspace[KERNEL],
        workspace[RANDOM],
        m.logs,
        m.drawn,
        m.Phi,
        m.work,
    )
    workspace[RESAMPLINGS] += 1
    for i in range(m.weights.size):
        own = component(m, i)
        put(own, belief, m.drawn[i])
        P, Phi = flatten(own.P), flatten(m.Phi)
        for k in range(Phi.size):
            P[k] = Phi[k]


@inlined
def _correct_each(
    m: Mixture, y: Array, sd: Array, observe: Observe, parameters: Array, innovation: Array
) -> int:
    """Correct every component that counts, and weigh. Returns 1 where no likelihood was finite,
    0 else."""
    n, shared = m.mean.size, m.shared
    H, mine, dx, work, used = (
        matrix(shared, JACOBIAN, 3, n),
        m.mean,
        shared[DX],
        shared[WORK],
        used_rows(n),
    )
    for k in range(m.weights.size):
        m.logs[k] = -math.inf
        if m.weights[k] > 0:
            own = component(m, k)
            rows = observed(own, y, observe, parameters, mine, H)
            if same_rows(innovation, mine):
                nis = update(own.P, H, mine, sd, rows, LARGEST_NIS, work, dx)
                if nis <= LARGEST_NIS:
                    take_over(own, dx)
                m.logs[k] = -0.5 * nis
                for i in range(int(work[used])):
                    m.logs[k] += math.log(work[used + 4 + i])
    return weigh(m.logs, m.weights)


def lost(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
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
    diagnose=lost,
)
