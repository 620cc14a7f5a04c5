"""Sensitivity of the innovations to constants that a filter does not estimate: separate bias
estimation, from the record of its calls.

theta (m,) are such constants, 0 where the set-up is correct, h the derivative of a measurement by
them. The error of the filter is that of one that knows theta, plus V theta, V (n, m):

    V <- Phi V                                    a prediction
    J  = L^-1 (H V + h),  U = L^-1 H P            a correction, S = L L'
    V <- A (V - U' J)                             where it was used; A as of `error_state.turn_half`

So the whitened innovations of one run are J theta plus white noise. Source: Friedland (1969), IEEE
Trans. Automatic Control 14(4).
"""

from ...typing import Array
from ..compile.jit import helper, inline, kernel, matrix
from ..compile.signatures import WHOLE, reals, signature
from ..compile.workspace import MAX_STATES
from .adjoint import (
    DECAY_A,
    DECAY_G,
    DT,
    HALF_FORCE,
    HELD,
    C,
    F,
    U,
    W,
    kept_rows,
    save_step_rows,
)
from .belief import FilterState
from .error_state import DX, PREDICTED, WORK
from .kalman import decay, transition, used_rows, whiten_rows
from .tape import SAVE_STEP
from .time_correlated import FADED

RUN_SENSITIVITY = signature(
    "run_sensitivity",
    n=WHOLE,
    record=reals("calls", "width"),
    h=reals("fixes", 3, "lanes"),
    V=reals("columns"),
    J=reals("fixes", 3, "lanes"),
)

REJECTED = 10.0
"""The first number of the record of a fix that was measured and not used: REJECTED + rows."""
BEHIND = 27
"""Numbers that a record has beyond `adjoint.width`: v (3), C (9), omega (3), accelerometer bias
(3), all before the fix, and L^-1 (9); INVERSE is where L^-1 begins among them."""
INVERSE = 18
LANES = 16
"""Columns that V has room for."""
MOVED = LANES * MAX_STATES
"""Where, behind the rows of V, the moved ones of a prediction stand for a moment."""
V_SIZE = MOVED + 9 * LANES
"""Numbers of V with its workspace: row i of V is [LANES i, LANES (i + 1))."""


@kernel(SAVE_STEP)
def save_step(belief: FilterState, record: Array) -> None:
    """Save the last step for the smoother; of measurements, used or not, also the state and
    L^-1."""
    save_step_rows(belief, record)
    if record[0] == PREDICTED:
        return
    workspace, n = belief.workspace, belief.P.shape[0]
    used = used_rows(n)
    rows = int(workspace[WORK.start + used])
    if rows == 0:
        return
    share = 1.0
    if record[0] == 0.0:
        kept_rows(belief, record, rows)
        record[0], share = REJECTED + rows, 0.0
    # from after the fix back to before it: with its own innovation inside, J' e has a mean
    dx, at = workspace[DX], record.size - BEHIND
    x, y, z = -share * dx[6], -share * dx[7], -share * dx[8]
    for i in range(3):
        record[at + i], record[at + 12 + i] = belief.v_n[i] - share * dx[3 + i], belief.omega[i]
        record[at + 15 + i] = belief.b_a[i] - share * dx[9 + i]
        for j in range(3):
            record[at + INVERSE + 3 * i + j] = 1.0 if i == j else 0.0
    for j in range(3):
        a, b, c = belief.C_nb[0, j], belief.C_nb[1, j], belief.C_nb[2, j]
        record[at + 3 + j] = a + y * c - z * b
        record[at + 6 + j] = b + z * a - x * c
        record[at + 9 + j] = c + x * b - y * a
    whiten_rows(matrix(record, at + INVERSE, 3, 3), workspace[WORK], used)


_moved = transition("_moved", 0, LANES, MOVED, LANES, (0, 8), 8)


@helper
def _predict_sensitivity(V: Array, step: Array) -> None:
    """V <- Phi V; states beyond the fifteenth stand still."""
    dt = step[DT]
    transport = step[W], step[W + 1], step[W + 2]
    _moved(V, step[F:C], matrix(step, C, 3, 3), step[HALF_FORCE : HALF_FORCE + 3], transport, dt)
    decaying = 1 - step[HELD]  # V is of errors of estimates
    keep_a, keep_g = decay(decaying * step[DECAY_A] * dt), decay(decaying * step[DECAY_G] * dt)
    for j in range(9 * LANES):
        V[j] = V[MOVED + j]
    for j in range(3 * LANES):
        V[9 * LANES + j] *= keep_a
        V[12 * LANES + j] *= keep_g


@helper
def _fade_correlated(V: Array, call: Array) -> None:
    """V <- Phi V where correlated errors of a source have faded."""
    for i in range(3):
        k = int(call[2 + i])
        for j in range(LANES if k > 0 else 0):
            V[LANES * k + j] *= call[1]


@inline
def _correct_sensitivity(n: int, V: Array, call: Array, h: Array, J: Array) -> None:
    """J = L^-1 (H V + h) of a fix and, where it was used, V <- A (V - U' J), A as of
    `error_state.turn_half`."""
    was_used = call[0] < REJECTED
    rows = int(call[0] if was_used else call[0] - REJECTED)
    _whiten_rows(n, rows, V, call, h, J)
    if was_used:
        for i in range(rows):
            for k in range(n):
                factor = call[U + n * i + k]
                for j in range(LANES):
                    V[LANES * k + j] -= factor * J[i, j]
        _turn_attitude(n, V, call)


@inline
def _whiten_rows(n: int, rows: int, V: Array, call: Array, h: Array, J: Array) -> None:
    """J = L^-1 h + (L^-1 H) V of the rows of a fix."""
    H, inverse = U + 3 * n, call.size - BEHIND + INVERSE
    for i in range(rows):
        for j in range(LANES):
            J[i, j] = 0.0
        for k in range(3):
            factor = call[inverse + 3 * i + k]
            for j in range(LANES):
                J[i, j] += factor * h[k, j]
        for k in range(n):
            factor = call[H + n * i + k]
            if factor != 0.0:
                for j in range(LANES):
                    J[i, j] += factor * V[LANES * k + j]


@inline
def _turn_attitude(n: int, V: Array, call: Array) -> None:
    """Half of the correction theta turns the attitude errors: v <- v + theta x v / 2."""
    first = U + 6 * n
    x, y, z = 0.5 * call[first], 0.5 * call[first + 1], 0.5 * call[first + 2]
    for j in range(LANES):
        a, b, c = V[LANES * 6 + j], V[LANES * 7 + j], V[LANES * 8 + j]
        V[LANES * 6 + j] = a + y * c - z * b
        V[LANES * 7 + j] = b + z * a - x * c
        V[LANES * 8 + j] = c + x * b - y * a


@kernel(RUN_SENSITIVITY)
def run_sensitivity(n: int, record: Array, h: Array, V: Array, J: Array) -> None:
    """V over a piece of a record of `save_step`, n states, and J (k, 3, LANES) of its k fixes.

    h (k, 3, LANES) are the derivatives of the measurements themselves, before whitening. A fix
    whose first number is 0 does not count. J arrives zeroed; rows that were not measured stay so.
    """
    fix = 0
    for c in range(record.shape[0]):
        call = record[c]
        if call[0] == PREDICTED:
            _predict_sensitivity(V, call)
        elif call[0] == FADED:
            _fade_correlated(V, call)
        else:
            if call[0] > 0:
                _correct_sensitivity(n, V, call, h[fix], J[fix])
            fix += 1
