"""Parameters of the installation as states, in every filter that can have them: found, alike,
smoothed; and a clock that runs away."""

from dataclasses import replace

import numpy as np
import pytest
from flat_flight import NOISE, flight
from installed import car, wrong
from recordings import ahrs
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.data.solution import DOUBTFUL
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options

ABLE = [name for name in filters.names() if filters.find(name).installation]
OWN_GAINS = ["two-stage-ekf", "xkf-two-stage"]
"""Filters whose gains are not those of least variance: what they find is not what the closed loop
finds. `nlo` is another, but does not use the constraints here."""
WRONG = {
    "clock error of GNSS position [s]": 0.08,
    "lever arm forward error of GNSS position [m]": 0.5,
    "mounting heading error of imu [deg]": 1.5,
    "scale error of speed": 0.01,
    "gyro scale down error of imu": 0.01,
}
"""{column of the solution: what must be found}."""
ESTIMATE = {
    "clock": None,
    "lever-arm": None,
    "mounting": None,
    "scale": None,
    "gyro-scale": (0.0, 0.0, 0.01),
}


@pytest.fixture(scope="module")
def recording():
    """A car of two minutes with all of it wrong."""
    made = car(1001, 120.0, "tactical")
    made = wrong(wrong(made, "clock", 0.08), "lever arm", 0.5, 0)
    made = wrong(wrong(made, "mounting", np.radians(1.5), 2), "scale", 0.01)
    dtheta = made.imu.dtheta.copy()
    dtheta[:, 2] *= 1.01
    return replace(made, imu=made.imu._replace(dtheta=dtheta))


@pytest.fixture(scope="module")
def closed(recording):
    return sd.fuse(recording, "closed-loop", estimate=ESTIMATE)


def test_names_of_the_columns(closed):
    assert {*WRONG} <= {*closed.columns}, list(closed.columns)


@pytest.mark.parametrize("name", [name for name in ABLE if name != "nlo"])
def test_every_filter_finds_what_is_wrong(name, recording, closed):
    if "attitude" in filters.find(name).needs:
        truth = recording.reference
        made = ahrs(truth, 10.0, (0.1, 0.1, 0.2))
        # as the axes of the IMU are described, which are turned by what is wrong
        turn = Rotation.from_euler("z", np.radians(1.5))
        y = (Rotation.from_euler("ZYX", made.y[:, ::-1]) * turn).as_euler("ZYX")[:, ::-1]
        recording = replace(recording, sources=(*recording.sources, replace(made, y=y)))
    solution = closed if name == "closed-loop" else sd.fuse(recording, name, estimate=ESTIMATE)
    for column, truth in WRONG.items():
        found, std_of = solution.columns[column][-1], solution.columns[f"std of {column}"][-1]
        assert abs(found - truth) < 4 * std_of, column
        most = 0.8 if name in OWN_GAINS else 0.5
        assert std_of < most * solution.columns[f"std of {column}"][0], column
        # and as the closed loop finds it, beyond which only a known attitude says something
        alike = abs(found - closed.columns[column][-1]) < 1.0 * std_of
        assert alike or name in OWN_GAINS or "attitude" in filters.find(name).needs, column


SMOOTHED = [name for name in ABLE if filters.find(name).smoother]


@pytest.mark.parametrize("name", SMOOTHED)
def test_what_stands_still_is_smoothed_to_its_last_estimate(name, recording, closed):
    """A constant is known at all times as well as at the end."""
    if name != "closed-loop":
        closed = sd.fuse(recording, name, estimate=ESTIMATE)
    smoothed = sd.smooth(recording, name, estimate=ESTIMATE)
    for column in WRONG:
        last, std_of = closed.columns[column][-1], closed.columns[f"std of {column}"][-1]
        np.testing.assert_allclose(smoothed.columns[column], last, atol=0.3 * std_of)
        np.testing.assert_allclose(smoothed.columns[f"std of {column}"], std_of, rtol=0.02)


def true_fix(recording, t, tau):
    """Position and velocity fixes stamped t, exact at t + tau (Aidings)."""
    truth = recording.reference
    lla, v = (
        np.stack([np.interp(t + tau, truth.t, x) for x in part.T], axis=1)
        for part in (truth.lla, truth.v_n)
    )
    one = np.full((len(t), 3), 1.0)
    return (
        sd.Source("position", t, lla, one, gate=np.inf, estimate={"clock": (0.1,)}),
        sd.Source("velocity", t, v, 0.1 * one, gate=np.inf, estimate={"clock": (0.1,)}),
    )


@pytest.mark.short
@pytest.mark.parametrize("tau", [-0.2, 0.0, 0.2])
def test_a_right_fix_is_compared_with_the_truth(tau):
    """On an exact INS with the right estimate of the clock there is no innovation."""
    made, _, truth = flight(4.0, 100.0, noisy=False)
    at = made.reference
    start = sd.InitialState(
        0.0,
        tuple(at.lla[0]),
        tuple(at.v_n[0]),
        tuple(at.rotation[0].as_euler("ZYX")[::-1]),
        (0.0,) * 3,
        (0.0,) * 3,
        (1e-6,) * 15,
    )
    stamps = np.array([0.5, 1.1, 1.9, 2.603, 3.2])
    made = replace(made, sources=true_fix(made, stamps, tau))
    noise = NOISE._replace(gyro=0.0, accel=0.0)
    run = begin(made, "closed-loop", run_options(start=start, noise=noise))
    run.belief.augmented[0] = tau
    run.belief.P[15, 15] = 1e-12
    run.complete()
    innovation = run.out.fix.innovation
    assert run.out.fix.t.tolist() == pytest.approx(np.repeat(stamps, 2).tolist())  # their own
    # what the flat motion leaves out of Coriolis, 3e-3 m/s^2, and interpolates at 603 ms
    np.testing.assert_allclose(innovation[0::2], 0.0, atol=0.03)
    np.testing.assert_allclose(innovation[1::2], 0.0, atol=0.02)


@pytest.mark.short
@pytest.mark.parametrize("tau", [9.0, -9.0, 1e6])
def test_a_clock_that_runs_away_is_said(tau):
    made, start, _ = flight(6.0, 20.0)
    made = replace(
        made, sources=tuple(replace(a, estimate={"clock": (0.1,)}) for a in made.sources)
    )
    run = begin(made, "closed-loop", run_options(start=start, noise=NOISE))
    run.belief.augmented[:] = tau
    run.belief.P[15, 15] = 1e-6
    run.complete()
    assert np.isfinite(run.out.nav).all() and np.isfinite(run.out.fix.innovation).all()
    said = [text for _, text in run.events.all]
    assert any(
        text.startswith("the clock error of position is estimated as ")
        and " s, which exceeds the filter's buffer of past states, until " in text
        and text.endswith("set time.offset")
        for text in said
    ), said
    assert (run.out.nav[:, 32] == DOUBTFUL).any()


STATED = replace(
    sd.imu("tactical"),
    name="stated",
    gyro=replace(sd.imu("tactical").gyro, scale_factor=1e-3, misalignment=2e-3),
    accel=replace(sd.imu("tactical").accel, scale_factor=1e-3, misalignment=1e-3),
)
"""A grade that states scale and misalignment."""


@pytest.mark.short
def test_what_a_grade_states_of_its_axes_are_states():
    made, start, _ = flight(2.0, 10.0)
    solution = sd.fuse(made, imu=STATED, start=start, covariance=True)
    assert solution.covariance.shape[1] == 15 + 18
    stds = [
        solution.columns[f"std of {column}"][0]
        for column in (
            "gyro scale forward error of imu",
            "accel misalignment zy error of imu [deg]",
        )
    ]
    np.testing.assert_allclose(stds, [1e-3, np.degrees(1e-3)], rtol=0.01)
    assert any("with the std of its grade" in note for note in solution.meta["notes"])


@pytest.mark.short
def test_who_asks_of_the_imu_gets_what_is_asked_and_of_sources_both():
    made, start, _ = flight(2.0, 10.0)
    states = lambda imu, estimate: len(
        sd.fuse(made, imu=imu, start=start, covariance=True, estimate=estimate).covariance[0]
    )
    assert states("tactical", None) == 15 == states(STATED, [])
    assert states(STATED, ["gyro-scale"]) == 18
    assert states(STATED, ["position clock"]) == 15 + 1 + 18


@pytest.mark.short
def test_a_filter_that_leaves_the_axes_out_says_so():
    made, start, _ = flight(2.0, 10.0)
    solution = sd.fuse(made, "pkf", imu=STATED, start=start)
    assert any("pkf does not model gyro scale" in note for note in solution.meta["notes"])
