"""The loops as Hager & Bryne write them, with dense matrices, against the compiled ones; and
what sets them apart over minutes."""

from dataclasses import replace

import numpy as np
import pytest
from dense_loops import NOISE, State, after, fix_at, gain, increments, transition
from recordings import flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import demo_flight


def open_loop(recording, begin):
    """The INS runs alone; its error beside it keeps its prior: equations (19)-(23)."""
    ins = State(begin.lla, begin.v_n, Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix())
    x, P, b_ins = np.zeros(15), np.diag(np.square(begin.std)), np.r_[begin.b_a, begin.b_g]
    fade = np.r_[[NOISE.accel_decay] * 3, [NOISE.gyro_decay] * 3]
    for t, (rotation, force, dt) in zip(recording.imu.t, increments(recording.imu)):
        Phi, Q = transition(ins.plus(x), b_ins + x[9:], rotation, force, dt)
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
        ins.step(rotation - b_ins[3:] * dt, force - b_ins[:3] * dt, dt)
        b_ins = b_ins * np.exp(-fade * dt)
        row = fix_at(recording, t)
        if row is not None:
            K, P = gain(P, recording.sources[0].std[row])
            dx = K @ displacement(recording.sources[0].y[row], ins.plus(x).lla)
            x, P = x + dx, after(P, dx)
        belief = ins.plus(x)
        yield belief.lla, belief.v, belief.C, b_ins + x[9:], P, x[:3]


def closed_loop_error_bias(recording, begin):
    """The INS runs on the raw IMU; errors are reset but for the biases, whose effect is injected
    at each step: equations (24)-(26)."""
    ins = State(begin.lla, begin.v_n, Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix())
    b, P = np.r_[begin.b_a, begin.b_g], np.diag(np.square(begin.std))
    for t, (rotation, force, dt) in zip(recording.imu.t, increments(recording.imu)):
        Phi, Q = transition(ins, b, rotation, force, dt)
        predicted, P = Phi @ np.r_[np.zeros(9), b], Phi @ P @ Phi.T + Q
        ins.step(rotation, force, dt)
        ins, b = ins.plus(predicted[:9]), predicted[9:]
        row = fix_at(recording, t)
        if row is not None:
            K, P = gain(P, recording.sources[0].std[row])
            dx = K @ displacement(recording.sources[0].y[row], ins.lla)
            P = after(P, dx)
            ins, b = ins.plus(dx[:9]), b + dx[9:]
        yield ins.lla.copy(), ins.v.copy(), ins.C.copy(), b, P, np.zeros(3)


@pytest.mark.short
@pytest.mark.parametrize(
    "name, twin", [("open-loop", open_loop), ("closed-loop-error-bias", closed_loop_error_bias)]
)
def test_a_loop_is_the_one_of_the_paper(name, twin):
    """50 samples at 20 Hz, a position twice a second, biases that matter."""
    recording = flight(2.5, 20.0, gnss=Gnss(0.5, velocity_std=None))
    recording = replace(recording, sources=(replace(recording.sources[0], gate=np.inf),))
    begin = start(recording)._replace(b_a=(0.05, -0.03, 0.04), b_g=(1e-3, -2e-3, 1e-3))
    solution = sd.fuse(recording, name, start=begin, noise=NOISE, covariance=True)
    lla, v, C, b, P, x = (np.array(part) for part in zip(*twin(recording, begin)))
    assert (
        np.abs(displacement(solution.trajectory.lla, lla)).max() < 1e-4
        and np.abs(solution.trajectory.v_n - v).max() < 5e-5
    )
    assert (solution.trajectory.rotation * Rotation.from_matrix(C).inv()).magnitude().max() < 1e-6
    scale = np.sqrt(np.einsum("kii->ki", P))
    assert np.abs((np.c_[solution.b_a, solution.b_g] - b) / scale[:, 9:]).max() < 1e-4
    assert np.abs((solution.covariance - P) / (scale[:, :, None] * scale[:, None, :])).max() < 1e-4
    if name == "open-loop":
        assert np.abs(np.stack(list(solution.columns.values()), axis=1) - x).max() < 2e-5


@pytest.mark.short
def test_the_columns_of_the_open_loop_are_truth_less_raw_ins():
    """With perfect fixes the error beside the INS is, after each of them, the distance of the
    raw INS from the truth."""
    recording = flight(8.0, 20.0, gnss=Gnss(0.5, position_std=(1e-3,) * 3, velocity_std=None))
    recording = replace(recording, sources=(replace(recording.sources[0], gate=np.inf),))
    begin = start(recording)._replace(b_g=(0.003, -0.002, 0.001))
    solution = sd.fuse(recording, "open-loop", start=begin, noise=NOISE)
    raw = sd.fuse(replace(recording, sources=()), "open-loop", start=begin, noise=NOISE)
    at = np.isin(np.round(solution.t, 6), np.round(recording.sources[0].t, 6))
    truth = np.isin(np.round(recording.reference.t, 6), np.round(solution.t[at], 6))
    shift = np.stack(
        [solution.columns[f"ins_error_{axis} [m]"] for axis in ("north", "east", "down")], axis=1
    )[at]
    np.testing.assert_allclose(
        shift,
        displacement(recording.reference.lla[truth], raw.trajectory.lla[at]),
        atol=0.005 + 1e-3 * np.abs(shift).max(),
    )
    assert np.abs(shift).max() > 1


@pytest.fixture(scope="module")
def ten_minutes():
    return sd.simulate(demo_flight(), 600.0, "paper1-tactical", 4, 50.0)


def scores(recording, name, **options):
    solution = sd.fuse(recording, name, options=options)
    return sd.rms(sd.errors(solution, recording.reference), (120.0, recording.span[1]))


def test_over_two_minutes_of_a_tactical_imu_the_loops_are_one(ten_minutes):
    recording = ten_minutes.between(0.0, 120.0)
    begin = sd.align(
        recording,
        sd.imu("paper1-tactical"),
        heading=float(recording.reference.rph[50, 2]),
        heading_std=0.01,
    )
    closed, *others = (
        sd.fuse(recording, name, start=begin)
        for name in ("closed-loop", "closed-loop-error-bias", "open-loop", "periodic-reset")
    )
    # what second order makes of the start, whose level is known to 5 deg
    for solution, bound in zip(others, (1e-4, 0.06, 0.06)):
        late = slice(3000, None)
        assert (
            np.abs(displacement(closed.trajectory.lla, solution.trajectory.lla))[late].max() < bound
        )
        assert (closed.trajectory.rotation * solution.trajectory.rotation.inv()).magnitude()[
            late
        ].max() < 0.1 * bound
        np.testing.assert_allclose(
            solution.trajectory.std[-1], closed.trajectory.std[-1], rtol=0.01
        )


def test_the_printed_error_model_shows_in_the_open_loop_alone(ten_minutes):
    for name, least, most in (("closed-loop", 0.0, 0.01), ("open-loop", 0.02, np.inf)):
        right, literal = scores(ten_minutes, name), scores(ten_minutes, name, error_model="literal")
        change = max(
            np.abs(literal.position / right.position - 1).max(),
            abs(literal.rph[2] / right.rph[2] - 1),
        )
        assert least <= change < most, name
