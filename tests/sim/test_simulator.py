"""Simulated runs: what is shared, what a seed decides, offsets, other gravity; and that a filter
makes sense of them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.scenario import Scenario, scenario
from strapdown.sim.synthesis import Simulator, simulate
from strapdown.sim.trajectory import DEG, demo_flight, gravity, increments, records, sample, static

SHORT = Scenario(
    "short", demo_flight(), 20.0, 50.0, Gnss(0.5, lever_arm=(1.0, 0.0, -1.0)), "tactical"
)
SHARED = Simulator(SHORT)


def assert_same(one, other):
    for a, b in zip(one.imu, other.imu):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(one.sources, other.sources, strict=True):
        np.testing.assert_array_equal(a.y, b.y)
        np.testing.assert_array_equal(a.t, b.t)
    for key in ("b_a", "b_g"):
        np.testing.assert_array_equal(one.meta[key], other.meta[key])


def test_truth_and_ideal_imu_are_those_of_the_motion():
    t = np.arange(1001) / 50
    np.testing.assert_array_equal(SHARED.truth.lla, sample(SHORT.motion, t).lla)
    np.testing.assert_array_equal(SHARED.ideal.dv, increments(SHORT.motion, t).dv)


def test_records_made_in_blocks_are_the_same(monkeypatch):
    from strapdown.sim import trajectory

    t = np.arange(801) / 20
    truth, imu = records(demo_flight(), t)
    monkeypatch.setattr(trajectory, "_BLOCK", 700)  # pieces, three to a sample: blocks of 233 rows
    again, other = records(demo_flight(), t)
    for name, atol in (("lla", 1e-9), ("v_n", 0), ("q_nb", 0)):
        np.testing.assert_allclose(getattr(again, name), getattr(truth, name), rtol=0, atol=atol)
    for one, two in zip(imu, other, strict=True):
        np.testing.assert_allclose(two, one, rtol=0, atol=1e-14)
    with pytest.raises(DataError, match="must begin at 0 s"):
        records(demo_flight(), t[1:])


def test_a_simulator_and_simulate_make_the_same_recording():
    one = SHARED.recording("tactical", 5)
    assert_same(one, simulate(SHORT.motion, 20.0, "tactical", 5, 50.0, SHORT.gnss))
    assert_same(one, simulate(SHORT, seed=5))
    run, start = SHARED.run("tactical", np.random.SeedSequence(5))
    assert_same(one, run)
    assert start.t == 0 and start.b_a == start.b_g == (0.0, 0.0, 0.0)


def test_a_seed_sequence_repeats_however_often_it_was_used():
    seeds = np.random.SeedSequence(7, spawn_key=(3, 1))
    (one, start), (two, again) = SHARED.run("consumer", seeds), SHARED.run("consumer", seeds)
    assert_same(one, two)
    assert start == again
    assert SHARED.run("consumer", np.random.SeedSequence(7, spawn_key=(3, 2)))[1] != start


def test_threads_may_share_a_simulator():
    run = lambda seed: SHARED.run("tactical", np.random.SeedSequence(seed))[0]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(run, range(8)))
    for seed, made in enumerate(together):
        assert_same(made, run(seed))


def test_a_hidden_offset_is_felt_and_reported():
    plain, offset = Simulator(SHORT), Simulator(SHORT.replace(accel_offset=(0.5, 0.0, -0.2)))
    one, two = (
        simulator.recording("tactical", np.random.default_rng(1)) for simulator in (plain, offset)
    )
    np.testing.assert_allclose(
        two.imu.dv - one.imu.dv, np.outer(one.imu.dt, (0.5, 0.0, -0.2)), atol=1e-14
    )
    np.testing.assert_allclose(
        two.meta["b_a"] - one.meta["b_a"], np.tile((0.5, 0.0, -0.2), (1000, 1)), atol=1e-14
    )
    np.testing.assert_array_equal(two.imu.dtheta, one.imu.dtheta)
    np.testing.assert_array_equal(offset.ideal.dv, plain.ideal.dv)


def test_starts_scatter_by_their_standard_deviations():
    spec = imu_spec("paper1-tactical")
    std = SHORT.start_deviations(spec)
    assert std[9:] == pytest.approx(np.repeat(spec.bias_std(), 3)) and std[:3].tolist() == [
        1.0,
        1.0,
        1.5,
    ]
    starts = [SHARED.start(rng, spec, None) for rng in np.random.default_rng(2).spawn(400)]
    errors = np.array(
        [np.r_[SHARED.truth.v_n[0] - start.v_n, start.b_a, start.b_g] for start in starts]
    )
    # 4 sigma of 400 draws
    assert (
        errors[:, :3].std(axis=0) == pytest.approx(std[3:6], rel=0.15) and not errors[:, 3:].any()
    )
    assert all(start.std == tuple(std) for start in starts)
    exact = SHARED.exact_start(spec)
    assert (
        exact.std == tuple(std)
        and exact.lla == pytest.approx(SHARED.truth.lla[0], abs=1e-15)
        and exact.v_n == tuple(SHARED.truth.v_n[0])
    )
    assert exact.rph == pytest.approx(SHARED.truth.rph[0], abs=1e-12)


def test_known_biases_are_started_from():
    known = Simulator(
        SHORT.replace(biases_known=True, start_std=(*SHORT.start_std[:9], *[1e-3] * 3, *[1e-6] * 3))
    )
    recording, start = known.run("consumer", np.random.SeedSequence(3))
    errors = np.r_[
        recording.meta["b_a"][0] - start.b_a, recording.meta["b_g"][0] - start.b_g
    ] / np.repeat([1e-3, 1e-6], 3)
    assert 0 < np.abs(errors).max() < 4 and np.abs(recording.meta["b_a"][0]).max() > 0.01


def test_the_ideal_recording_has_no_errors():
    made = SHARED.ideal_recording()
    np.testing.assert_array_equal(made.imu.dv, SHARED.ideal.dv)
    exact = Gnss(0.5, (1e-12,) * 3, (1e-12,) * 3, (1.0, 0.0, -1.0)).fixes(
        SHARED.truth, np.random.default_rng(1)
    )
    for mine, other, deviations in zip(
        made.sources, exact, ((1, 1, 1.5), (0.1, 0.1, 0.1)), strict=True
    ):
        np.testing.assert_allclose(mine.y, other.y, rtol=0, atol=1e-10)
        assert mine.std.tolist() == [list(deviations)] * 40


def test_gravity_without_height_is_that_of_the_ellipsoid():
    high = Scenario("high", static((50 * DEG, 8 * DEG, 10_000.0)), 1.0, 10.0)
    force = {
        name: -Simulator(high.replace(gravity=name)).ideal.dv[0] / 0.1
        for name in ("height", "latitude")
    }
    felt = {name: value[2] for name, value in force.items()}
    assert abs(force["latitude"][0]) < 1e-9 < abs(force["height"][0] + 8e-5) < 1e-6
    assert felt["latitude"] == pytest.approx(gravity(50 * DEG, 0.0), abs=1e-12) and felt[
        "height"
    ] == pytest.approx(gravity(50 * DEG, 1e4), abs=1e-12)
    assert felt["latitude"] - felt["height"] == pytest.approx(0.0308, rel=0.01)


def test_a_motion_needs_duration_and_imu():
    with pytest.raises(DataError, match="give its duration"):
        simulate(demo_flight(), imu="tactical")


@pytest.mark.parametrize("name", [pytest.param("paper1-02", marks=pytest.mark.short), "car"])
def test_a_filter_makes_sense_of_a_run(name):
    """After 20 s errors are within five of the standard deviations claimed, of 5 states x 3 axes
    at one time: 1e-5 of right filters fail."""
    short = scenario(name).replace(duration=40.0)
    recording, start = Simulator(short).run(short.imu, np.random.SeedSequence(11))
    solution = sd.fuse(recording, start=start, imu=short.imu)
    errors = sd.errors(solution, recording.reference)
    row = -1
    assert np.linalg.norm(errors.position[row]) < 3 and np.linalg.norm(errors.velocity[row]) < 0.5
    assert np.all(np.abs(errors.position[row]) < 5 * solution.trajectory.std[row, :3])
    assert np.all(np.abs(errors.velocity[row]) < 5 * solution.trajectory.std[row, 3:6])


def test_a_written_simulation_is_read_back_and_fused(tmp_path):
    made = simulate("car", 30.0, "industrial", seed=4)
    sd.write_recording(made, tmp_path / "car.nc")
    back = sd.read(tmp_path / "car.nc")
    assert_same(made, back)
    np.testing.assert_array_equal(made.reference.q_nb, back.reference.q_nb)
    assert (
        back.meta["grade"] == "industrial" and back.meta["seed"] == 4 and back.meta["name"] == "car"
    )
    assert sd.fuse(back).t[-1] == 30.0


def test_an_offset_may_be_the_initial_value_of_the_gauss_markov_bias():
    """It then decays with the IMU's time constant, in the samples as in the true bias that goes
    with them; a grade without one keeps it."""
    offset = (0.5, 0.0, -0.2)
    plain, decaying = (
        Simulator(SHORT.replace(**change))
        for change in ({}, {"accel_offset": offset, "offset_decays": True})
    )
    a, b = (
        made.recording("paper1-consumer", np.random.default_rng(3)) for made in (plain, decaying)
    )
    expected = np.outer(np.exp(-(a.imu.t - a.imu.t[0]) / 300.0), offset)
    np.testing.assert_allclose(b.meta["b_a"] - a.meta["b_a"], expected, atol=1e-12)
    np.testing.assert_allclose((b.imu.dv - a.imu.dv) / a.imu.dt[:, None], expected, atol=1e-9)
