"""The introductory example: its model against closed forms, its steady state against the Riccati
equation, its three forms against each other."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

from strapdown_reproductions.fossen import intro

pytestmark = pytest.mark.short
MODEL = intro.IntroModel()
QUIET = MODEL._replace(accel=1e-12, rate=1e-12, position_std=1e-9, angle_std=1e-9)


def covariance_after(model, dt, every, fixes):
    """Predicted P before the last of `fixes` corrections, `every` samples of dt apart, by the
    filter's own steps."""
    Phi, Q = intro.discretise(model, dt)
    P = np.diag(model.start_std) ** 2
    for _k in range(fixes):
        for _ in range(every):
            P = Phi @ P @ Phi.T + Q
        before = P
        _, P = intro.correct(np.zeros((1, 5)), P, np.zeros((1, 2)), model.R)
    return before


@pytest.mark.parametrize("every", [1, 10])
def test_the_steady_state_is_that_of_the_riccati_equation(every):
    model = MODEL._replace(rate_bias=1e-3)  # settles within the fixes of this test
    Phi, Q = intro.discretise(model, 0.1)
    whole, noise = np.linalg.matrix_power(Phi, every), np.zeros((5, 5))
    for k in range(every):
        part = np.linalg.matrix_power(Phi, k)
        noise += part @ Q @ part.T
    H = np.zeros((2, 5))
    H[0, 0] = H[1, 2] = 1.0
    R = np.diag([0.05**2, 0.01**2])
    np.testing.assert_allclose(
        covariance_after(model, 0.1, every, 2000 // every),
        solve_discrete_are(whole.T, H.T, noise, R),
        rtol=1e-6,
        atol=1e-14,
    )


def test_position_and_angle_tell_all_five_states_and_neither_alone_does():
    position, velocity, angle = np.eye(5)[[0, 1, 2]]
    assert intro.observable(np.array([position, angle])) == 5
    assert intro.observable(position) == 3 and intro.observable(angle) == 2
    # where it is, is not told by how fast it goes
    assert intro.observable(np.array([velocity, angle])) == 4
    assert intro.observable(np.array([position, angle]), MODEL.without_decay()) == 5


def test_transition_and_noise_have_their_closed_forms():
    dt, T = 0.7, MODEL.accel_time
    Phi, Q = intro.discretise(MODEL, dt)
    fade = np.exp(-dt / T)
    np.testing.assert_allclose(
        Phi[:2, 3], [-T * T * (fade - 1 + dt / T), -T * (1 - fade)], rtol=1e-8
    )
    np.testing.assert_allclose(
        [Phi[0, 1], Phi[3, 3], Phi[2, 4]],
        [dt, fade, -MODEL.rate_time * (1 - np.exp(-dt / MODEL.rate_time))],
        rtol=1e-10,
    )
    assert Phi[2, 0] == Phi[0, 2] == Phi[1, 4] == 0
    free = MODEL.without_decay()
    a, b = free.accel**2, free.accel_bias**2
    expected = np.array(
        [
            [a * dt**3 / 3 + b * dt**5 / 20, a * dt**2 / 2 + b * dt**4 / 8, -b * dt**3 / 6],
            [a * dt**2 / 2 + b * dt**4 / 8, a * dt + b * dt**3 / 3, -b * dt**2 / 2],
            [-b * dt**3 / 6, -b * dt**2 / 2, b * dt],
        ]
    )
    np.testing.assert_allclose(
        intro.discretise(free, dt)[1][np.ix_([0, 1, 3], [0, 1, 3])], expected, rtol=1e-7
    )


def test_without_decay_all_three_forms_are_one_filter():
    record = intro.simulate(np.random.default_rng(1), runs=2, duration=40.0)
    feedforward, feedback, direct = (
        intro.estimate(record, form, MODEL.without_decay()) for form in intro.FORMS
    )
    np.testing.assert_allclose(feedback.x, direct.x, atol=1e-9)
    np.testing.assert_allclose(feedforward.x, direct.x, atol=1e-8)
    np.testing.assert_allclose(feedforward.std, direct.std, rtol=1e-9)
    assert np.abs(feedforward.ins - feedback.ins).max() > 100


def test_the_raw_ins_drifts_as_a_constant_bias_says():
    record = intro.simulate(np.random.default_rng(2), duration=60.0, model=QUIET)
    ins = intro.estimate(record).ins[:, 0]
    b, r, t = *intro.BEGIN, record.t
    np.testing.assert_allclose(ins[:, 1] - record.true[:, 0, 1], b * t, atol=1e-6)
    # the acceleration within a sample
    np.testing.assert_allclose(ins[:, 0] - record.true[:, 0, 0], 0.5 * b * t * t, atol=0.02)
    np.testing.assert_allclose(ins[:, 2] - record.true[:, 0, 2], r * t, atol=1e-6)


def test_in_a_dropout_feedforward_lets_the_bias_decay_and_the_others_hold_it():
    record = intro.simulate(
        np.random.default_rng(3), duration=80.0, fixes=intro.IntroFixes(((50.0, 100.0),))
    )
    rows = [np.searchsorted(record.t, at - 1e-9) for at in (50.0, 80.0)]
    assert not record.fixed[rows[0] - 1 :].any() and record.fixed[: rows[0] - 1].sum() == 49
    kept = {
        form: np.divide(*intro.estimate(record, form).x[rows[::-1], 0, 3]) for form in intro.FORMS
    }
    assert kept["feedforward"] == pytest.approx(np.exp(-30.0 / MODEL.accel_time), rel=1e-9)
    assert kept["feedback"] == kept["direct"] == pytest.approx(1.0, abs=1e-12)


def test_the_filter_is_consistent_where_its_model_is_the_simulators():
    """False alarm 1e-4 per time; a filter that takes the fixes for half as noisy fails."""
    runs, model = 60, MODEL._replace(start_std=(1e-9, 1e-9, 1e-9, 0.3, 0.05))
    record = intro.simulate(np.random.default_rng(4), runs, "decaying", duration=60.0, model=model)
    inside = []
    for assumed in (model, model._replace(position_std=0.025, angle_std=0.005)):
        made = intro.estimate(record, model=assumed)
        error = (record.true - made.x)[-1]
        Phi, Q = intro.discretise(assumed, record.dt)
        P = np.diag(assumed.start_std) ** 2
        for fixed in record.fixed:
            P = Phi @ P @ Phi.T + Q
            if fixed:
                _, P = intro.correct(np.zeros((1, 5)), P, np.zeros((1, 2)), assumed.R)
        np.testing.assert_allclose(np.sqrt(np.diag(P)), made.std[-1])
        nees = np.einsum("ki,ij,kj->k", error, np.linalg.inv(P), error).sum()
        inside.append(chi2.ppf(5e-5, 5 * runs) < nees < chi2.isf(5e-5, 5 * runs))
    assert inside == [True, False]


def test_decaying_biases_follow_their_law():
    record = intro.simulate(np.random.default_rng(5), 400, "decaying", duration=150.0, rate=1.0)
    last, keep = record.true[-1, :, 3], np.exp(-150.0 / MODEL.accel_time)
    spread = MODEL.accel_bias * np.sqrt(MODEL.accel_time / 2 * (1 - keep**2))
    assert abs(last.mean() - 0.3 * keep) < 5 * spread / 20 and last.std() == pytest.approx(
        spread, rel=0.15
    )


def test_an_unknown_form_is_refused_by_name():
    with pytest.raises(
        ValueError, match="no form 'sideways'; there is: feedforward, feedback, direct"
    ):
        intro.estimate(intro.simulate(np.random.default_rng(0), duration=1.0), "sideways")
