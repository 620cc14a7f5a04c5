"""The causes of runs of rejections: from innovations of a scalar filter written out here, from
simulated recordings with a fault, and none where the gate rejects by chance."""

import numpy as np
import pytest
from refused_fixes import FAULTS, cause, simulated, solved

import strapdown as sd
from strapdown.engine.rejections import causes

SPREAD, GATE = 1.0, 16.266


def filtered(error, seed=1, noise=SPREAD):
    """Windows of a filter that believes position fixes of white noise with an `error` (m, 3): three
    scalar Kalman filters of a random walk, whose rows are rejected together."""
    rng, x, P = np.random.default_rng(seed), np.zeros(3), 0.2
    rows, used = [], []
    for d in error:
        P += 0.01
        S = P + SPREAD**2
        e = d + noise * rng.standard_normal(3) - x
        rows.append((e, S))
        used.append(bool(e @ e / S <= GATE))
        if used[-1]:
            x, P = x + P / S * e, P * (1 - P / S)
    innovation, S = (np.array(part) for part in zip(*rows))
    used, m = np.array(used), len(error)
    bad = np.flatnonzero(~used)
    return causes.Window(
        np.arange(m) * 0.2,
        innovation,
        np.sqrt(S)[:, None, None] * np.eye(3),
        np.full((m, 3), SPREAD),
        used,
        used,
        moving(m),
        np.gradient(moving(m), 0.2, axis=0),
        "position",
        ((int(bad[0]), int(bad[-1])),),
    )


def moving(m):
    """(m, 3) m/s: to and fro."""
    t = 0.2 * np.arange(m)
    return np.column_stack([20 * np.cos(t / 5), 15 * np.sin(t / 7), 0 * t])


TIME = 0.2 * np.arange(400)
ERRORS = {
    causes.JUMP: np.where(TIME[:, None] >= 50, [8.0, -6.0, 0.0], 0.0),
    causes.DRIFT: np.maximum(TIME - 40, 0.0)[:, None] * [0.0, 1.2, 0.0],
    causes.CLOCK: np.where(TIME[:, None] >= 50, 0.5 * moving(400), 0.0),
}
SIZES = {causes.JUMP: [8.0, -6.0, 0.0], causes.DRIFT: [0.0, 1.2, 0.0], causes.CLOCK: [0.5]}


@pytest.mark.parametrize("shape", ERRORS)
def test_the_size_of_an_error_that_a_filter_follows_is_found(shape):
    found = causes.find(filtered(ERRORS[shape]))
    assert found.shape == shape and found.gain > causes.MARGIN
    assert found.size == pytest.approx(SIZES[shape], abs=0.15 * np.linalg.norm(SIZES[shape]))
    assert 0.8 < found.spread < 1.2


def test_a_jump_that_returns_lasts_as_long_as_it_did():
    error = np.where((TIME[:, None] >= 50) & (TIME[:, None] < 56), [20.0, 0.0, 5.0], 0.0)
    found = causes.find(filtered(error))
    assert found.shape == causes.JUMP
    assert found.since == pytest.approx(50.0) and found.until == pytest.approx(55.8)


def test_noise_and_single_outliers_are_no_shape():
    assert causes.find(filtered(np.zeros((400, 3)), noise=3.0)).shape == causes.NOISE
    wild = np.zeros((400, 3))
    wild[::40] = [30.0, -10.0, 5.0]
    assert causes.find(filtered(wild)).shape == causes.OUTLIERS


def test_whitening_is_the_inverse_of_the_root():
    rng = np.random.default_rng(3)
    root = np.tril(rng.standard_normal((5, 3, 3))) + 3 * np.eye(3)
    values = rng.standard_normal((5, 3, 4))
    assert np.allclose(causes.whitened_values(root, values), np.linalg.solve(root, values))


@pytest.mark.parametrize(
    "motion, fault",
    [
        ("car", "jump that stays"),
        ("flight", "jump that returns"),
        ("flight", "drift"),
        ("car", "clock that steps"),
        ("flight", "std of velocity small"),
        ("car with odometer", "odometer scale"),
        ("flight", "velocity bias"),
        ("flight", "2 % outliers"),
    ],
)
def test_the_cause_of_a_fault(motion, fault):
    _, sources, right = FAULTS[fault]
    solution = solved(motion, fault, seed=1)
    assert cause(solution, sources) == right
    for run in solution.rejected:
        assert (run.start, str(run)) in solution.events
        assert 0 < run.number <= run.of and run.start <= run.stop


def test_what_a_gate_rejects_by_chance_is_no_event():
    rejected = 0
    for seed in range(5):
        solution = sd.fuse(simulated("car", seed))
        rejected += sum(bad for _, bad in solution.counts().values())
        assert not solution.rejected and not any("rejected" in text for _, text in solution.events)
    assert rejected > 3
