"""The loops as printed against the printed recursion with dense matrices, what their options refuse,
and the cells that an independent filter gave."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from dense_loops import NOISE, State, after, fix_at, gain, increments, transition
from recordings import flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.experiments.monte_carlo import study
from strapdown.experiments.monte_carlo.study import Study
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import scenario
from strapdown_reproductions.hager_bryne import main, printed_updates
from strapdown_reproductions.hager_bryne.cells import tables
from strapdown_reproductions.hager_bryne.printed_updates import WITHOUT_PRIOR, ZERO_PREDICTION


@pytest.fixture(autouse=True)
def known():
    printed_updates.make_known()


def printed_closed_loop(reading, recording, begin):
    """Equations (6)-(10), (12)-(16), (19) and (24)-(26), line by line: what (15) gives is the whole
    error state; its nine kinematic numbers go into the INS and are zero again."""
    ins = State(begin.lla, begin.v_n, Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix())
    error, P = np.r_[np.zeros(9), begin.b_a, begin.b_g], np.diag(np.square(begin.std))
    for t, (rotation, force, dt) in zip(recording.imu.t, increments(recording.imu)):
        Phi, Q = transition(ins, error[9:], rotation, force, dt)
        error = Phi @ error if reading == WITHOUT_PRIOR else np.zeros(15)  # (19)
        P = Phi @ P @ Phi.T + Q
        ins.step(rotation, force, dt)
        ins, error = ins.plus(error[:9]), np.r_[np.zeros(9), error[9:]]
        row = fix_at(recording, t)
        if row is not None:
            W, P = gain(P, recording.sources[0].std[row])
            error = W @ displacement(recording.sources[0].y[row], ins.lla)  # (15)
            ins, P = ins.plus(error[:9]), after(P, error)
            error[:9] = 0.0
        yield ins.lla.copy(), ins.v.copy(), ins.C.copy(), error[9:], P


def printed_open_loop(recording, begin):
    """Equations (19)-(23) with (15): the error beside the INS is what the last fix gave, and what
    (19) makes of it until the next."""
    ins = State(begin.lla, begin.v_n, Rotation.from_euler("ZYX", begin.rph[::-1]).as_matrix())
    error, P, own = np.zeros(15), np.diag(np.square(begin.std)), np.r_[begin.b_a, begin.b_g]
    fade = np.r_[[NOISE.accel_decay] * 3, [NOISE.gyro_decay] * 3]
    for t, (rotation, force, dt) in zip(recording.imu.t, increments(recording.imu)):
        Phi, Q = transition(ins.plus(error), own + error[9:], rotation, force, dt)
        error, P = Phi @ error, Phi @ P @ Phi.T + Q
        ins.step(rotation - own[3:] * dt, force - own[:3] * dt, dt)
        own = own * np.exp(-fade * dt)
        row = fix_at(recording, t)
        if row is not None:
            W, P = gain(P, recording.sources[0].std[row])
            error = W @ displacement(recording.sources[0].y[row], ins.plus(error).lla)  # (15)
            P = after(P, error)
        belief = ins.plus(error)
        yield belief.lla, belief.v, belief.C, own + error[9:], P


@pytest.mark.short
@pytest.mark.parametrize(
    ("name", "options", "twin"),
    [
        *(
            ("closed-loop-as-printed", {"reading": one}, partial(printed_closed_loop, one))
            for one in (WITHOUT_PRIOR, ZERO_PREDICTION)
        ),
        ("open-loop-as-printed", {"kinematics": "metres"}, printed_open_loop),
    ],
)
def test_a_loop_is_the_printed_one(name, options, twin):
    """Each of 50 samples at 20 Hz, a position twice a second, biases that matter."""
    recording = flight(2.5, 20.0, gnss=Gnss(0.5, velocity_std=None))
    recording = replace(recording, sources=(replace(recording.sources[0], gate=np.inf),))
    begin = start(recording)._replace(b_a=(0.05, -0.03, 0.04), b_g=(1e-3, -2e-3, 1e-3))
    solution = sd.fuse(recording, name, start=begin, noise=NOISE, covariance=True, options=options)
    lla, v, C, b, P = (np.array(part) for part in zip(*twin(recording, begin)))
    assert np.abs(displacement(solution.trajectory.lla, lla)).max() < 1e-4
    assert np.abs(solution.trajectory.v_n - v).max() < 5e-5
    assert (solution.trajectory.rotation * Rotation.from_matrix(C).inv()).magnitude().max() < 1e-6
    scale = np.sqrt(np.einsum("kii->ki", P))
    assert np.abs((np.c_[solution.b_a, solution.b_g] - b) / scale[:, 9:]).max() < 1e-4
    assert np.abs((solution.covariance - P) / (scale[:, :, None] * scale[:, None, :])).max() < 1e-4


@pytest.mark.short
def test_a_rejected_fix_leaves_the_biases():
    """The gate of 0 rejects every fix: the printed update has nothing to forget them for."""
    recording = flight(1.0, 20.0, gnss=Gnss(0.1, velocity_std=None))
    recording = replace(recording, sources=(replace(recording.sources[0], gate=1e-9),))
    begin = start(recording)._replace(b_a=(0.05, -0.03, 0.04))
    solution = sd.fuse(recording, "closed-loop-as-printed", start=begin, noise=NOISE)
    kept = np.exp(-NOISE.accel_decay * (solution.t - begin.t))
    np.testing.assert_allclose(solution.b_a, kept[:, None] * np.array(begin.b_a), rtol=1e-9)


@pytest.mark.short
@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("closed-loop-as-printed:reading=literal", "reading is 'literal'"),
        ("open-loop-as-printed:reading=zero-prediction", "an open loop has none"),
        ("closed-loop-error-bias:reading=without-prior", "has no option 'reading'"),
    ],
)
def test_a_reading_that_there_is_not_is_refused(label, said):
    with pytest.raises(sd.DataError, match=said) as caught:
        Study(("paper1-01",), (label,))
    assert "\n" not in str(caught.value)


PUBLISHED = {
    ("consumer", "open"): (2.61, 2.61),
    ("consumer", "closed"): (0.40, 0.40),
    ("consumer", WITHOUT_PRIOR): (0.67, 0.67),
    ("consumer", ZERO_PREDICTION): (0.67, 0.67),
    ("tactical", "open"): (0.208, 0.208),
    ("tactical", "closed"): (0.20, 0.20),
    ("tactical", WITHOUT_PRIOR): (0.47, 0.55),
    ("tactical", ZERO_PREDICTION): (0.48, 0.48),
    ("navigation", "open"): (0.16, 0.16),
    ("navigation", "closed"): (0.16, 0.16),
    ("navigation", WITHOUT_PRIOR): (5.8, 5.8),
    ("navigation", ZERO_PREDICTION): (5.9, 5.9),
}
"""Position RMSE, m, on flight 01 of filters that were written independently of these."""


@pytest.mark.deep
def test_cells_are_those_of_an_independent_filter():
    """24 runs of flight 01. The independent figures, of about ten runs each, have an error of their
    own, which is taken as 1.6 times that of these."""
    labels = (*main.FILTERS, main.AS_PRINTED, main.ZERO)
    ran = Study(("paper1-01",), labels, main.IMUS, 24, 907).run(threads=2)
    found = dict(zip(("closed", WITHOUT_PRIOR, ZERO_PREDICTION), tables(ran)))
    for (grade, loop), (low, high) in PUBLISHED.items():
        row = found["closed" if loop == "open" else loop].set_index("grade").loc[grade]
        name = f"{'open' if loop == 'open' else 'closed'}_censored_500_m"
        half = 0.5 * np.hypot(1, 1.6) * (row[f"{name}_high"] - row[f"{name}_low"])
        assert low - half < row[name] < high + half, (grade, loop, row[name], half)
    tactical = found[WITHOUT_PRIOR].set_index("grade").loc["tactical"]
    assert tactical["closed_heading_500_deg"] == pytest.approx(0.15, rel=0.25)
    assert tactical["open_heading_500_deg"] == pytest.approx(0.04, rel=0.25)


def test_lanes_say_what_runs_alone_say(monkeypatch):
    """Also where of eight runs some reject a fix: the gate rejects two in five."""
    labels = (main.AS_PRINTED, main.ZERO, printed_updates.OPEN_LOOP.name)
    short = scenario("paper1-01").replace(duration=20.0, gate=3.0)
    wanted = Study((short,), labels, ("paper1-tactical",), 8, 907)
    found = []
    for least in (0, np.inf):
        monkeypatch.setattr(study, "MANY_STEPS", least)
        found.append(study.run_chunk(wanted, study.Chunk(0, 0, 8)))
    assert found[0].keys() == found[1].keys() and found[0]["rejected"].min() > 50
    for name, each in found[0].items():
        np.testing.assert_allclose(each, found[1][name], rtol=1e-5, atol=1e-7, err_msg=name)
