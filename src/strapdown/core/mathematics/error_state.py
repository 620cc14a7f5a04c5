"""Functions shared by the error-state filters: their workspace array, the linearised step, the
measurement, the injection of an error into the estimate."""

import math

from ...checks import check_choice
from ...typing import Array
from ..compile.jit import flatten, helper, inline, matrix
from ..compile.selection import any_of, where
from ..compile.workspace import MAX_STATES, Slots
from .belief import ATT, BA, BG, POS, STATES, VEL, FilterState, Noise
from .earth import displace
from .error_dynamics import BLOCKS, LATITUDE_GRAVITY, MODELS, kinematic_blocks
from .kalman import (
    WORKSPACE,
    decay,
    of_estimates,
    propagate,
    propagate_error,
    update,
    used_rows,
)
from .rotation import (
    NineNumbers,
    Three,
    orthonormalise,
    rotate_left,
    rotation_terms,
    turned_by,
    turned_on,
)
from .source import Observe, SourceRow
from .time_correlated import see

PREDICTED = -1.0  # the last call was a prediction
ERROR_STATE = Slots(room=16)
# error state kept apart from the belief; zero where it is injected at once
X = ERROR_STATE.array("X", STATES)
MODEL = ERROR_STATE.number("MODEL")  # which error model; see error_dynamics
HEIGHT = ERROR_STATE.number("HEIGHT")  # gravity at this times the height: 1 or 0
CALL = ERROR_STATE.number("CALL")  # of the last call: rows used, or PREDICTED; a smoother keeps
DT = ERROR_STATE.number("DT")  # s; all from CALL to DV
TRANSPORT = ERROR_STATE.array("TRANSPORT", 3)  # rotation of n over it, rad
DECAY_A, DECAY_G = ERROR_STATE.numbers("DECAY_A", "DECAY_G")  # of the biases, 1/s
HELD = ERROR_STATE.number("HELD")  # Noise.held
BLOCK = ERROR_STATE.array("BLOCK", BLOCKS)  # blocks of F
MID = ERROR_STATE.matrix("MID", 3, 3)  # C_nb at mid-interval
DV = ERROR_STATE.array("DV", 3)  # specific-force velocity increment in n, bias-free, m/s
DX = ERROR_STATE.array("DX", MAX_STATES)  # the correction that `measure` found, n numbers
WORK = ERROR_STATE.array("WORK", WORKSPACE)  # of core.mathematics.kalman
JACOBIAN = ERROR_STATE.matrix("JACOBIAN", 3, MAX_STATES)  # H (3, n) of a fix


def allocate(slots: Slots, error_model: str = "corrected", rest: int = 0) -> Array:
    """A workspace with the slots of an error-state filter, which continue ERROR_STATE, and so
    many numbers in their part at the end; refuses an unknown error model."""
    check_choice(error_model, "error_model", MODELS)
    workspace = slots.zeros(rest)
    workspace[MODEL] = MODELS[error_model]
    workspace[HEIGHT] = MODELS[error_model] != LATITUDE_GRAVITY
    return workspace


@inline
def linearised_step(
    belief: FilterState, C: Array, coupling: float, u: Array, dt: float, noise: Noise, beside: bool
) -> None:
    """Propagate P, and the error state where one is kept `beside` the belief, over dt (s), linearised
    at the belief with the increments u (rad, m/s; body).

        r = u[0:3] - b_g dt,  a = u[3:6] - b_a dt            bias-free, see `bias_free`
        C_mid = C (I + S(r / 2)),  dv_n = C_mid a            at mid-interval
        P <- Phi P Phi' + Q_d,  x <- Phi x                   `propagate`, with F of `kinematic_blocks`
        omega_ib_b = r / dt,  f_ib_b = a / dt,  b <- exp(-dt / T) b

    Hager & Bryne (18) and (19). State and attitude stay. C (3, 3) is the attitude of body-fixed errors in n: the belief's, or
    one known from elsewhere. `coupling` is 1, or 0 where the attitude error does not reach the
    velocity, because that is computed with the known one. Also publishes the bias-free rate and
    specific force, decays the biases, and leaves in workspace what a smoother needs.
    """
    workspace, mid, dv_n, b_a, b_g = (
        belief.workspace,
        matrix(belief.workspace, MID, 3, 3),
        belief.workspace[DV],
        belief.b_a,
        belief.b_g,
    )
    r0, r1, r2 = 0.5 * (u[0] - b_g[0] * dt), 0.5 * (u[1] - b_g[1] * dt), 0.5 * (u[2] - b_g[2] * dt)
    a0, a1, a2 = u[3] - b_a[0] * dt, u[4] - b_a[1] * dt, u[5] - b_a[2] * dt
    turned_on(C, (r0, r1, r2), mid)
    for i in range(3):
        dv_n[i] = coupling * (mid[i, 0] * a0 + mid[i, 1] * a1 + mid[i, 2] * a2)
    blocks, transport = workspace[BLOCK], workspace[TRANSPORT]
    w0, w1, w2 = kinematic_blocks(belief.lla, belief.v_n, int(workspace[MODEL]), blocks)
    w = w0 * dt, w1 * dt, w2 * dt
    workspace[CALL], workspace[DT] = PREDICTED, dt
    transport[0], transport[1], transport[2] = w
    workspace[DECAY_A], workspace[DECAY_G] = noise.accel_decay, noise.gyro_decay
    workspace[HELD] = noise.held
    propagate(belief.P, blocks, mid, dv_n, w, dt, noise, workspace[WORK])
    if beside:
        own = of_estimates(noise)
        propagate_error(workspace[X], blocks, mid, dv_n, w, dt, own, workspace[WORK])
    publish_rates(belief, (2 * r0, 2 * r1, 2 * r2), (a0, a1, a2), dt)
    decay_biases(b_a, b_g, dt, noise)


@inline
def bias_free(u: Array, b_a: Array, b_g: Array, dt: float) -> tuple[Three, Three]:
    """Increments u of one sample without the biases, body: rotation vector r = u[0:3] - b_g dt
    (rad) and velocity a = u[3:6] - b_a dt (m/s)."""
    return (
        (u[0] - b_g[0] * dt, u[1] - b_g[1] * dt, u[2] - b_g[2] * dt),
        (u[3] - b_a[0] * dt, u[4] - b_a[1] * dt, u[5] - b_a[2] * dt),
    )


@inline
def publish_rates(belief: FilterState, r: Three, a: Three, dt: float) -> None:
    """The bias-free rate omega_ib_b = r / dt (rad/s) and specific force f_ib_b = a / dt (m/s^2) of
    a sample, from its increments of `bias_free`."""
    if dt > 0:
        belief.omega[0], belief.omega[1], belief.omega[2] = r[0] / dt, r[1] / dt, r[2] / dt
        belief.f[0], belief.f[1], belief.f[2] = a[0] / dt, a[1] / dt, a[2] / dt


@helper
def decay_biases(b_a: Array, b_g: Array, dt: float, noise: Noise) -> None:
    """The estimate of a Gauss-Markov bias over dt, unless it is held; a random walk (decay 0) keeps
    it."""
    own = of_estimates(noise)
    keep_a, keep_g = decay(own.accel_decay * dt), decay(own.gyro_decay * dt)
    for i in range(3):
        b_a[i] *= keep_a
        b_g[i] *= keep_g


@inline
def measure(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P by one fix y of standard deviations std, of what `observe` expects of it, and leave
    the correction dx of the states in workspace[DX]; equations of `kalman.update`. Returns the NIS.

    Unless NIS <= gate, P is left as it was and the correction must not be used.
    """
    n = belief.P.shape[0]
    H = matrix(belief.workspace, JACOBIAN, 3, n)
    rows = observe_innovation(belief, y, observe, source, innovation, H)
    nis = update(
        belief.P, H, innovation, std, rows, gate, belief.workspace[WORK], belief.workspace[DX]
    )
    used = belief.workspace[WORK.start + used_rows(n)]
    belief.workspace[CALL] = where(nis <= gate, used, 0.0)
    return nis


@inline
def observe_innovation(
    belief: FilterState, y: Array, observe: Observe, source: SourceRow, innovation: Array, H: Array
) -> int:
    """Compute by `observe` the innovation and H of a measurement, both cleared before, with the
    time-correlated errors of its source. Returns the rows."""
    for i in range(innovation.size):
        innovation[i] = math.nan
    for i in range(3):
        for j in range(H.shape[1]):
            H[i, j] = 0.0
    rows = observe(belief, y, source, innovation, H)
    if source.correlation_time > 0:
        see(belief.augmented, source, innovation, H)
    return rows


@inline
def inject_and_reset(belief: FilterState, dx: Array) -> None:
    """Compose the whole correction into the belief; P becomes that of the errors about it."""
    inject_all(belief, dx)
    theta = dx[ATT]
    turn_half(belief.P, theta[0], theta[1], theta[2])


@helper
def turn_half(P: Array, x: float, y: float, z: float) -> None:
    """P of the attitude error that is left once a correction (x, y, z), a rotation vector in n
    (rad), was injected: P <- A P A' with A = diag(I, I, R, I, ...), R the rotation by half of it.
    Symmetric to the last bit.

    exp(theta) = exp(left) exp(c), so that left = theta - c + c x theta / 2 to second order. Without
    this, what is known of roll and pitch and their errors' correlations stands askew by half of each
    correction. Source: Mueller, Hehn & D'Andrea (2017), J. Guidance 40(9); Sola (2017),
    arXiv:1711.02508, section 6.3.
    """
    R = rotation_terms(0.5 * x, 0.5 * y, 0.5 * z)
    if P.shape[0] == 15:  # the same code with constant lengths
        _turn(15, flatten(P), R)
    else:
        _turn(P.shape[0], flatten(P), R)


@inline
def _turn(n: int, P: Array, R: NineNumbers) -> None:
    """P <- A P A' of `turn_half`, of the numbers of P."""
    x, y, z = 6 * n, 7 * n, 8 * n
    for j in range(n):
        P[x + j], P[y + j], P[z + j] = turned_by(R, P[x + j], P[y + j], P[z + j])
    for i in (x + 6, y + 6, z + 6):
        P[i], P[i + 1], P[i + 2] = turned_by(R, P[i], P[i + 1], P[i + 2])
    for i in range(3):
        for j in range(n):
            P[n * j + 6 + i] = P[x + n * i + j]


@inline
def inject_all(belief: FilterState, dx: Array) -> None:
    """Inject the whole correction: position, velocity, attitude, biases and augmented states."""
    inject(belief.lla, belief.v_n, belief.C_nb, dx)
    inject_biases(belief, dx)


@inline
def inject(lla: Array, v: Array, C: Array, dx: Array) -> None:
    """Compose position (m, NED), velocity (m/s) and attitude errors (rad, n) into a state that
    is kept: true = estimate (+) error, Hager & Bryne (20) to (26).

        lla <- lla + (p_N / M, p_E / (N cos L), -p_D),  v <- v + dv,  C <- exp(S(theta)) C
    """
    add_error(lla, v, C, dx)
    theta = dx[ATT]
    turned = (theta[0] != 0) | (theta[1] != 0) | (theta[2] != 0)
    if any_of(turned):  # a run whose fix was rejected keeps every bit
        orthonormalise(C, turned)


@inline
def add_error(lla: Array, v: Array, C: Array, dx: Array) -> None:
    """`inject` into a state that is made anew each time, where rounding cannot add up."""
    p, dv, theta = dx[POS], dx[VEL], dx[ATT]
    displace(lla, p[0], p[1], p[2])
    v[0] += dv[0]
    v[1] += dv[1]
    v[2] += dv[2]
    rotate_left(theta[0], theta[1], theta[2], C)


@inline
def inject_biases(belief: FilterState, dx: Array) -> None:
    """Add bias errors to the estimated biases, and the errors of the states that sources brought
    along to those."""
    a, g = dx[BA], dx[BG]
    for i in range(3):
        belief.b_a[i] += a[i]
        belief.b_g[i] += g[i]
    inject_tail(belief, dx)


@inline
def inject_tail(belief: FilterState, dx: Array) -> None:
    """Inject the errors of the augmented states."""
    for i in range(belief.augmented.size):
        belief.augmented[i] += dx[STATES + i]
