"""The two-stage filter against its twin with dense matrices; what it does without fixes, at
rest, near the vertical, with bad options."""

from dataclasses import replace

import numpy as np
import pytest
from plain_ins import increments, wrap
from recordings import flight, start
from two_stage_twin import State, Twin

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.data.solution import Source
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)


def ungated(recording):
    return replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))


@pytest.mark.short
def test_it_is_the_textbook_filter():
    recording = ungated(flight(12.0, 20.0))
    solution = sd.fuse(
        recording,
        "two-stage-ekf",
        start=start(recording),
        noise=NOISE,
        covariance=True,
        options={"covariance": "published"},
    )
    twin = Twin(start(recording), NOISE)
    for k, (t, dt, u) in enumerate(increments(recording.imu)):
        twin.predict(u, dt)
        for source in recording.sources:
            for row in np.flatnonzero(np.abs(source.t - t) < 1e-6):
                if source.kind == "position":
                    twin.position(source.y[row], source.std[row], source.parameters)
                else:
                    twin.velocity(source.y[row], source.std[row], source.parameters)
        path, C = solution.trajectory, twin.at.C
        e = State(
            path.lla[k], C @ twin.at.v, twin.at.angles, solution.b_a[k], solution.b_g[k]
        ).minus(twin.at)
        scale = np.sqrt(np.diag(twin.covariance()))
        assert np.abs(e[:3]).max() < 1e-6 and np.abs(path.v_n[k] - C @ twin.at.v).max() < 1e-7
        assert np.abs(wrap(path.rotation[k].as_euler("ZYX")[::-1] - twin.at.angles)).max() < 1e-8
        assert (np.abs(e[9:]) / scale[9:]).max() < 1e-6
        assert (
            np.abs((solution.covariance[k] - twin.covariance()) / np.outer(scale, scale)).max()
            < 1e-6
        )


def resting(seconds=60.0):
    """A body that rolls at 8 m/s for 20 s, brakes and stands: no course."""
    north = lambda t: np.clip(8 - 2 * (t - 20), 0, 8)
    motion = Motion(
        "braking",
        (DEG * 47.0, DEG * 8.0, 500.0),
        lambda t: (north(t), 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, 0 * t),
    )
    return sd.simulate(motion, seconds, "tactical", 5, 20.0, Gnss())


@pytest.mark.short
def test_without_a_course_the_heading_is_held_and_its_deviation_grows():
    solution = sd.fuse(resting(), "two-stage-ekf", start=start(resting()))
    seconds = solution.columns["course_held [s]"]
    assert (
        seconds[-1] == pytest.approx(37.5, abs=2)
        and seconds[np.searchsorted(solution.t, 20.0)] == 0
    )
    heading, std_heading = np.unwrap(solution.trajectory.rph[:, 2]), solution.trajectory.std[:, 8]
    assert abs(heading[-1] - heading[600]) < 0.01 and std_heading[-1] > std_heading[400]


@pytest.mark.short
def test_in_an_outage_stage_1_is_still_levelled():
    """Attitude stays level by the specific force less omega x v_b while the position drifts;
    heading becomes uncertain, roll and pitch do not."""
    recording = flight(60.0, 20.0)
    solution, alone = (
        sd.fuse(
            recording.hidden([(20.0, 60.0)]),
            "two-stage-ekf",
            start=start(recording),
            noise=NOISE._replace(gyro=2e-3),
            options=options,
        )
        for options in ({}, {"acceleration": 1e4})
    )
    tilt = lambda s: np.degrees(s.trajectory.std[-1, 6:8]).max()
    assert (
        tilt(solution) < 0.8 * tilt(alone)
        and solution.trajectory.std[-1, 8] > 1.1 * solution.trajectory.std[390, 8]
    )
    e = sd.errors(solution, recording.reference)
    assert np.degrees(np.abs(e.rph[-1, :2])).max() < 1.0


@pytest.mark.short
def test_a_rejected_fix_leaves_the_belief_and_a_heading_corrects_stage_1_alone():
    recording, t = flight(), np.array([5.0])
    heading = Source(
        "heading",
        t,
        np.array([[recording.reference.rph[100, 2] + 0.02]]),
        np.array([[0.01]]),
        name="compass",
    )
    far = Source(
        "velocity", t, np.array([[300.0, 0, 0]]), np.full((1, 3), 0.1), np.zeros(3), name="far"
    )
    later = replace(far, t=t + 50)
    base, wrong, turned = (
        sd.fuse(
            replace(recording, sources=more),
            "two-stage-ekf",
            start=start(recording),
            covariance=True,
        )
        for more in ((later,), (far,), (heading,))
    )
    row = np.searchsorted(base.t, 5.0 + 1e-6) - 1
    assert wrong.counts() == {"far": (0, 1)} and np.array_equal(
        wrong.covariance[row], base.covariance[row]
    )
    assert np.array_equal(wrong.trajectory.v_n, base.trajectory.v_n)
    np.testing.assert_allclose(
        turned.trajectory.lla[row], base.trajectory.lla[row], rtol=0, atol=1e-12
    )
    assert turned.trajectory.std[row, 8] < 0.6 * base.trajectory.std[row, 8]
    assert np.linalg.norm(turned.trajectory.v_n[row]) == pytest.approx(
        np.linalg.norm(base.trajectory.v_n[row]), rel=1e-12
    )
    v_b = [
        s.trajectory.rotation[row].inv().apply(s.trajectory.v_n[row].copy()) for s in (turned, base)
    ]
    np.testing.assert_allclose(*v_b, atol=1e-12)


@pytest.mark.short
def test_what_it_cannot_run_on_and_bad_options():
    recording = flight()
    run = lambda recording=recording, **options: sd.fuse(
        recording, "two-stage-ekf", start=start(recording), options=options
    )
    for options, said in (
        (dict(velocity="up"), "full, down"),
        (dict(course="tilt"), "gnss, none"),
        (dict(level="no"), "bias-free, raw"),
        (dict(min_speed=-1.0), "min_speed"),
        (dict(max_bank=0.0), "max_bank"),
        (dict(crab=np.inf), "crab"),
        (dict(correlation=-1.0), "correlation"),
        (dict(window=0.0), "window"),
        (dict(acceleration=-1.0), "acceleration"),
    ):
        with pytest.raises(DataError, match=said):
            run(**options)
    with pytest.raises(
        DataError, match="nothing gives a heading: add velocity, heading or magnetic-field"
    ):
        run(replace(recording, sources=recording.sources[:1]))
    assert "two-stage-ekf" in run(course="none").meta["filter"] and any(
        "drifts" in note for note in run(course="none").meta["notes"]
    )


def test_errors_are_bounded_and_mostly_inside_their_standard_deviations():
    """Five flights, no NEES mark, which the model does not allow; the share inside two sigma is
    wide, since the two stages neglect each other."""
    inside, worst = [], []
    for seed in range(5):
        recording = flight(90.0, 20.0, seed)
        solution = sd.fuse(recording, "two-stage-ekf", start=start(recording))
        e = sd.errors(solution, recording.reference)
        late = e.t > 30
        every = np.c_[e.position, e.velocity, e.attitude][late]
        inside.append((np.abs(every) < 2 * solution.trajectory.std[e.rows][late][:, :9]).mean())
        worst.append(
            [
                np.abs(e.position[late]).max(),
                np.abs(e.velocity[late]).max(),
                np.degrees(np.abs(e.rph[late])).max(),
            ]
        )
    assert (np.max(worst, axis=0) < [4.0, 0.8, 4.0]).all() and 0.8 < np.mean(inside) <= 1
