"""The exogenous filter of the two-stage model: a linear Kalman filter about any trajectory, and
the observer beside it left alone."""

from dataclasses import replace

import numpy as np
import pytest
from plain_ins import increments, wrap
from recordings import flight, start
from scipy.spatial.transform import Rotation
from test_two_stage_ekf import ungated
from two_stage_twin import State, Twin

import strapdown as sd
from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.loop.contract import CORRECT, PREDICT, Kind, Noise, compile_kernel, kernel
from strapdown.core.mathematics.mechanization import stationary_increments
from strapdown.core.mathematics.source import new_source
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.filters.observer.equations import embedded_observer
from strapdown.filters.two_stage import xkf_two_stage
from strapdown.filters.two_stage.model import ERROR
from strapdown.filters.two_stage.xkf_two_stage import (
    INSIDE,
    XKF_TWO_STAGE,
    arrive,
    carry,
    compose,
    correct_around,
)
from strapdown.geometry.geodesy import displacement

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
euler = lambda rph: Rotation.from_euler("ZYX", rph[::-1]).as_matrix()
GIVEN = 21  # numbers at the end of workspace: the next state to linearise at


@kernel(PREDICT)
def along(belief, u, dt, noise):
    """`predict` with a trajectory from outside in place of the observer."""
    workspace, bar = belief.workspace, embedded_observer(belief, INSIDE.start)
    carry(belief, bar, u, dt, noise)
    first = workspace.size - GIVEN
    for i in range(3):
        bar.omega[i], bar.f[i] = u[i] / dt - bar.b_g[i], u[3 + i] / dt - bar.b_a[i]
        bar.lla[i], bar.v_n[i], bar.b_a[i], bar.b_g[i] = (
            workspace[first + i],
            workspace[first + 3 + i],
            workspace[first + 15 + i],
            workspace[first + 18 + i],
        )
        for j in range(3):
            bar.C_nb[i, j] = workspace[first + 6 + 3 * i + j]
    arrive(belief, bar, dt, noise)


@kernel(CORRECT)
def correct_along(belief, y, std, kind, observe, parameters, gate, innovation):
    """`correct` without an observer."""
    bar = embedded_observer(belief, INSIDE.start)
    nis = correct_around(belief, bar, y, std, kind, observe, parameters, gate, innovation)
    compose(belief, bar)
    return nis


def roomy(start, noise):
    belief = xkf_two_stage.start(start, noise)
    return belief._replace(workspace=np.r_[belief.workspace, np.zeros(GIVEN)])


ALONG = XKF_TWO_STAGE._replace(
    name="along", start=roomy, predict=along, correct=correct_along, configure=None
)


def trajectories():
    """The truth, and one that is far from any solution of the model: it jumps and wanders."""
    truth = flight(8.0, 20.0).reference
    rng = np.random.default_rng(4)
    wild = replace(
        truth,
        lla=truth.lla + rng.normal(0, 1e-8, truth.lla.shape) * [1, 1, 1e7],
        v_n=truth.v_n + rng.normal(0, 0.3, truth.v_n.shape),
        q_nb=(
            Rotation.from_rotvec(rng.normal(0, 0.03, truth.v_n.shape)) * truth.rotation
        ).as_quat()[:, [3, 0, 1, 2]],
    )
    return {
        "truth": (truth, np.zeros((len(truth), 6))),
        "wild": (wild, rng.normal(0, 1, (len(truth), 6)) * np.repeat([0.02, 1e-3], 3)),
    }


@pytest.mark.short
@pytest.mark.deep
@pytest.mark.parametrize("name", ["truth", "wild"])
def test_about_a_given_trajectory_it_is_the_linear_kalman_filter(name):
    """In particular when that is the truth, as Johansen & Fossen say. Of the same model and
    products; only rounding differs."""
    recording = ungated(flight(8.0, 20.0))
    given, biases = trajectories()[name]
    run = begin(recording, ALONG, run_options(start=start(recording), noise=NOISE, covariance=True))
    twin, belief = Twin(start(recording), NOISE), run.belief
    twin.bar = twin.at
    rows = np.searchsorted(given.t, recording.imu.t - 1e-6)
    first, worst = belief.workspace.size - GIVEN, np.zeros(4)
    for k, (t, dt, u) in enumerate(increments(recording.imu)):
        lla, v, C, bias = (
            given.lla[rows[k]],
            given.v_n[rows[k]],
            given.rotation[rows[k]].as_matrix(),
            biases[rows[k]],
        )
        belief.workspace[first : first + GIVEN] = *lla, *v, *C.ravel(), *bias
        run.advance(k + 1)
        twin.predict(
            u, dt, State(lla, v, given.rotation[rows[k]].as_euler("ZYX")[::-1], bias[:3], bias[3:])
        )
        for source in recording.sources:
            for row in np.flatnonzero(np.abs(source.t - t) < 1e-6):
                if source.kind == "position":
                    twin.position(source.y[row], source.std[row], source.parameters)
                else:
                    twin.velocity(source.y[row], source.std[row], source.parameters)
        got, scale = (
            State(belief.lla, belief.v_n, np.zeros(3), belief.b_a, belief.b_g),
            np.sqrt(np.diag(twin.covariance())),
        )
        angles = Rotation.from_matrix(belief.C_nb).as_euler("ZYX")[::-1]
        e = got.minus(twin.at)
        worst = np.maximum(
            worst,
            [
                np.abs(e[:3]).max(),
                np.abs(belief.v_n - twin.bar.C @ twin.at.v).max(),
                np.abs(wrap(angles - twin.at.angles)).max(),
                np.abs((belief.P - twin.covariance()) / np.outer(scale, scale)).max(),
            ],
        )
    # positions: metres by radii here, by the ellipsoid there
    assert worst[0] < 5e-6 and worst[1] < 3e-8 and worst[2] < 1e-12 and worst[3] < 1e-8


def test_the_observer_beside_it_is_the_observer_alone():
    recording = flight()
    both = sd.fuse(recording, "xkf-two-stage", start=start(recording))
    alone = sd.fuse(recording, "nlo", start=start(recording))
    shift = np.column_stack(
        [both.columns[f"observer_error_{axis} [m]"] for axis in ("north", "east", "down")]
    )
    assert np.abs(displacement(both.trajectory.lla, alone.trajectory.lla) - shift).max() < 1e-6
    # two kernels, compiled apart
    np.testing.assert_allclose(
        both.columns["xi_east [m/s^2]"], alone.columns["xi_east [m/s^2]"], rtol=0, atol=1e-12
    )
    assert np.abs(shift).max() > 0.01


@pytest.mark.parametrize("gate, lifted", [(16.0, False), (0.01, True)])
def test_the_observer_takes_fixes_of_two_sources_alike_and_once_where_a_gate_is_lifted(
    gate, lifted
):
    """Second sources measure the very same at the same times; the observer alone has no gate."""
    recording = flight()
    twice = replace(
        recording,
        sources=tuple(
            replace(a, gate=gate, name=f"{a.kind} {n}") for a in recording.sources for n in (1, 2)
        ),
    )
    ungated_twice = replace(twice, sources=tuple(replace(a, gate=np.inf) for a in twice.sources))
    both, alone = (
        sd.fuse(of, name, start=start(recording))
        for of, name in ((twice, "xkf-two-stage"), (ungated_twice, "nlo"))
    )
    for axis in ("north", "east", "down"):
        np.testing.assert_allclose(
            both.columns[f"xi_{axis} [m/s^2]"],
            alone.columns[f"xi_{axis} [m/s^2]"],
            rtol=0,
            atol=1e-10,
        )
    fixes = both.innovations
    assert (fixes.accepted & (fixes.nis > gate)).any() == lifted


def test_options_are_those_of_both():
    recording = flight()
    with pytest.raises(DataError, match="k1"):
        sd.fuse(recording, "xkf-two-stage", start=start(recording), options={"k1": -1.0})
    with pytest.raises(DataError, match="crab"):
        sd.fuse(recording, "xkf-two-stage", start=start(recording), options={"crab": -1.0})
    with pytest.raises(DataError, match="nothing gives a heading"):
        sd.fuse(
            replace(recording, sources=recording.sources[:1]),
            "xkf-two-stage",
            start=start(recording),
        )
    notes = sd.fuse(
        recording, "xkf-two-stage", start=start(recording), options={"course": "none"}
    ).meta["notes"]
    assert any("drifts" in note for note in notes)


ATTITUDE_ERROR = np.array([2e-3, -1e-3, 3e-3])


def driven(attitude, error):
    """Nine tenths of a second of a turn from an observer at an attitude, and an estimate that is turned by `error`
    (rad, n) from it; velocity of the estimate before and after, and after its attitude is corrected
    by a heading."""
    recording = flight()
    begun = start(recording)._replace(rph=(0.1, -0.05, 0.7))
    still = dict(k1=1e-9, k1_start=1e-9, k2_start=1e-9, ki=0.0, ki_start=0.0, bias_law="norm")
    belief = xkf_two_stage.start(begun, NOISE, attitude=attitude, outage_after=9.0, **still)
    compile_kernel(XKF_TWO_STAGE.predict), compile_kernel(XKF_TWO_STAGE.correct)
    belief.workspace[ERROR][6:9] = error
    before = belief.v_n.copy()
    for _ in range(45):  # before the specific force alone levels
        XKF_TWO_STAGE.predict(belief, np.r_[0.0, 0.002, 0.004, 0.02, 0.1, -0.2], 0.02, NOISE)
    after = belief.v_n.copy()
    observe = aiding.find("heading").observe
    compile_kernel(observe)
    turned = np.arctan2(belief.C_nb[1, 0], belief.C_nb[0, 0])
    y, deviation = np.r_[turned + 0.01, 0.0, 0.0], np.full(3, 0.01)
    rest = Kind.HEADING, observe, new_source(), np.inf, np.zeros(12)
    XKF_TWO_STAGE.correct(belief, y, deviation, *rest)
    turned = np.arctan2(belief.C_nb[1, 0], belief.C_nb[0, 0]) - turned
    return before, after, belief.v_n.copy(), turned


@pytest.mark.short
def test_which_attitude_drives_stage_2():
    """The specific force of an estimate beside the observer is turned by the attitude of stage 1
    or that of the observer, and the velocity in the body stays where stage 1 is corrected."""
    _, of_observer, corrected, turned = driven("observer", ATTITUDE_ERROR)
    _, exact, *_ = driven("observer", np.zeros(3))
    np.testing.assert_allclose(of_observer, exact, atol=1e-9)
    np.testing.assert_allclose(corrected, of_observer, atol=1e-9)
    before, own, corrected, turned = driven("stage-1", ATTITUDE_ERROR)
    force = exact - before - np.array([0.0, 0.0, 0.9 * 9.81])  # over that time, n
    difference = np.cross(ATTITUDE_ERROR, force)
    assert np.linalg.norm(own - exact - difference) < 0.03 * np.linalg.norm(difference)
    swung = turned * np.array([-own[1], own[0], 0.0])
    assert turned > 1e-3
    assert np.linalg.norm(corrected - own - swung) < 0.05 * np.linalg.norm(swung)


@pytest.mark.short
def test_an_attitude_of_its_own_is_levelled_by_its_own_bias():
    """Level and at rest without a fix for 8 s; the observer's accelerometer bias errs by 0.2 m/s^2,
    the estimate's does not. Levelled by the estimate's it stays level; by the observer's it leans by
    up to asin(0.2 / g) = 20 mrad."""
    tilt, bias, dt = {}, np.array([0.2, -0.2, 0.0]), 0.02
    for attitude in ("stage-1", "observer"):
        begun = start(flight())._replace(rph=(0.0, 0.0, 0.7), v_n=(0.0,) * 3, b_a=(0.0,) * 3)
        begun = begun._replace(std=(*begun.std[:9], *[1e-3] * 3, *[1e-6] * 3))
        still = dict(k1=1e-9, k1_start=1e-9, k2_start=1e-9, ki=0.0, ki_start=0.0, bias_law="norm")
        belief = xkf_two_stage.start(begun, NOISE, attitude=attitude, outage_after=9.0, **still)
        compile_kernel(XKF_TWO_STAGE.predict)
        belief.workspace[ERROR][9:12] = bias
        belief.b_a[:] = bias
        u = np.zeros(6)
        for _ in range(round(8.0 / dt)):
            stationary_increments(belief.lla, np.zeros(3), euler(begun.rph), dt, u)
            XKF_TWO_STAGE.predict(belief, u + dt * np.r_[np.zeros(3), bias], dt, NOISE)
        tilt[attitude] = np.hypot(*belief.C_nb[2, :2])
    assert tilt["stage-1"] < 1e-3 and tilt["observer"] > 5e-3


def test_an_attitude_that_is_not_there_is_refused():
    with pytest.raises(DataError, match="attitude is 'mine'; it must be one of observer, stage-1"):
        sd.fuse(flight(), "xkf-two-stage", start=start(flight()), options={"attitude": "mine"})
