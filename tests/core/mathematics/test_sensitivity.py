"""How the error of a filter carries the constants that it does not know: one call at a time against
dense matrices, with the transition and the gain of `test_adjoint`."""

import numpy as np
import pytest
from test_adjoint import NOISE, STATES, STD, belief, corrected, predict, transition

from strapdown.core.loop.contract import compile_kernel
from strapdown.core.mathematics.adjoint import width
from strapdown.core.mathematics.error_state import DX
from strapdown.core.mathematics.sensitivity import (
    BEHIND,
    INVERSE,
    LANES,
    MOVED,
    REJECTED,
    V_SIZE,
    run_sensitivity,
    save_step,
)

pytestmark = pytest.mark.short


def record(made):
    """What `save_step` leaves of the last call, in a record that held other things before."""
    compile_kernel(save_step)
    row = np.full(width(len(made.P)) + BEHIND, np.nan)
    save_step(made, row)
    return row


def carried(n, rows, V, h):
    """(V after these records, J of their fixes)."""
    compile_kernel(run_sensitivity)
    columns, J = np.full(V_SIZE, np.nan), np.zeros((len(h), 3, LANES))
    columns[:MOVED].reshape(-1, LANES)[:n] = V
    run_sensitivity(n, np.array(rows), h, columns, J)
    return columns[:MOVED].reshape(-1, LANES)[:n].copy(), J


def drawn(n, fixes=1):
    """V (n, LANES) of about the standard deviations, and h."""
    rng, std = np.random.default_rng(n), np.r_[STD, [2.0] * (n - 15)]
    return std[:, None] * rng.standard_normal((n, LANES)), rng.standard_normal((fixes, 3, LANES))


@pytest.mark.parametrize("n", STATES)
@pytest.mark.parametrize("dt", [0.01, 0.5])
def test_a_prediction_moves_the_columns_by_the_transition(n, dt):
    u = np.r_[np.array([0.2, -0.5, 0.8]) * dt, np.array([20.0, -15.0, -17.0]) * dt]
    Phi, made, (V, _) = transition(n, dt, u), belief(n), drawn(n)
    compile_kernel(predict)
    predict(made, u, dt, NOISE)
    found, _ = carried(n, [record(made)], V, np.zeros((0, 3, LANES)))
    scale = np.r_[STD, [2.0] * (n - 15)][:, None]
    np.testing.assert_allclose(found / scale, Phi @ V / scale, rtol=1e-10, atol=1e-10)


def test_the_columns_of_held_biases_do_not_decay():
    """They are of errors of estimates, true - estimate, and nothing decays that these make."""
    u, (V, _), dt = np.r_[np.zeros(5), -9.8] * 0.5, drawn(15), 0.5
    made = belief(15)
    compile_kernel(predict)
    predict(made, u, dt, NOISE._replace(held=1.0))
    found, _ = carried(15, [record(made)], V, np.zeros((0, 3, LANES)))
    np.testing.assert_array_equal(found[9:], V[9:])


@pytest.mark.parametrize("n", STATES)
@pytest.mark.parametrize("gate", [np.inf, 1e-6])
@pytest.mark.parametrize("y", [(1.0, -2.0, 3.0), (0.3, np.nan, 1.0), (np.nan, np.nan, -2.0)])
def test_a_fix_shows_the_constants_and_takes_up_what_it_uses(n, gate, y):
    """A rejected one shows them too, and leaves the columns."""
    made, (V, h) = belief(n), drawn(n)
    before, measured = made.P.copy(), ~np.isnan(y)
    _, H, R = corrected(made, y, gate)
    row = record(made)
    assert row[0] == measured.sum() + (0 if gate == np.inf else REJECTED)
    found, J = carried(n, [row], V, h)
    S = H @ before @ H.T + R
    inverse = np.linalg.inv(np.linalg.cholesky(S))
    expected = inverse @ (H @ V + h[0][measured])
    rows = measured.sum()
    np.testing.assert_allclose(J[0, :rows], expected, rtol=1e-9, atol=1e-9)
    assert not J[0, rows:].any()
    gain = before @ H.T @ np.linalg.inv(S) if gate == np.inf else np.zeros((n, rows))
    scale = np.r_[STD, [2.0] * (n - 15)][:, None]
    after = V - gain @ (H @ V + h[0][measured])
    if gate == np.inf:  # what is left of an attitude error turns by half of the correction
        after[6:9] += 0.5 * np.cross(made.workspace[DX][6:9], after[6:9], axisb=0, axisc=0)
    np.testing.assert_allclose(found / scale, after / scale, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("gate", [np.inf, 1e-6])
def test_the_belief_before_a_fix_stands_behind_it(gate):
    """Whether the fix was used or not: with its innovation inside, derivatives and innovations
    would have something in common."""
    made = belief(16)
    before = np.r_[made.v_n, made.C_nb.ravel(), made.omega, made.b_a]
    corrected(made, (0.01, -0.02, 0.03), gate)
    if gate == np.inf:  # `corrected` has injected it
        assert np.abs(made.v_n - before[:3]).max() > 1e-4
    kept = record(made)[width(16) :]
    np.testing.assert_allclose(kept[:INVERSE], before, atol=1e-6)


def test_what_was_not_measured_or_is_marked_does_not_count():
    made, (V, h) = belief(15), drawn(15, 2)
    corrected(made, (np.nan, np.nan, np.nan))
    nothing = record(made)
    corrected(made, (1.0, -2.0, 3.0))
    marked = record(made)
    marked[0] = 0.0
    found, J = carried(15, [nothing, marked], V, h)
    assert np.array_equal(found, V) and not J.any()
