"""Velocities in axes of the body: against python-ins on one run, and what beams say together."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pyins import filters, inertial_sensor, measurements, strapdown, util

import strapdown as sd
from strapdown.core.loop.contract import InitialState
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.imu import imu as imu_spec

pytestmark = pytest.mark.short
DEG = np.pi / 180
ARM = (0.8, -0.3, 0.5)
STD = [2.0] * 3 + [0.2] * 3 + [0.5 * DEG] * 2 + [0.5 * DEG] + [0.02] * 3 + [30 * DEG / 3600] * 3
LOG = 0.05  # m/s
SLANT = np.radians(60)
BEAMS = [
    (np.cos(SLANT) * np.cos(a), np.cos(SLANT) * np.sin(a), np.sin(SLANT))
    for a in np.radians([45, 135, 225, 315])
]


def drive(*sensors, seconds=20.0):
    return sd.simulate("car", seconds, "tactical", seed=3, rate=20.0, sensors=sensors)


def start(recording):
    """Off the truth by some standard deviations."""
    truth = recording.reference
    lla = truth.lla[0] + np.array([1.5, -1.0, 2.0]) / (6.37e6, 4.4e6, 1.0)
    rph = truth.rph[0] + np.array([0.3, -0.4, 1.5]) * DEG
    v = truth.v_n[0] + (0.1, -0.2, 0.1)
    return InitialState(
        float(truth.t[0]), tuple(lla), tuple(v), tuple(rph), (0.0,) * 3, (0.0,) * 3, tuple(STD)
    )


def python_ins(recording, begin):
    """(trajectory, standard deviations) of its closed loop, degrees as there."""
    noise, positions, log = imu_spec("tactical").noise(), *recording.sources
    degrees = np.array([1 / DEG, 1 / DEG, 1.0])
    first = np.r_[np.array(begin.lla) * degrees, begin.v_n, np.array(begin.rph) / DEG]
    names = util.LLA_COLS + util.VEL_COLS + util.RPH_COLS
    state = pd.Series(first, index=names, name=begin.t)
    imu = recording.imu
    samples = frame(np.c_[imu.dtheta, imu.dv], imu.t, util.GYRO_COLS + util.ACCEL_COLS)
    samples.loc[begin.t] = 0.0
    found = filters.run_feedback_filter(
        state,
        2.0,
        0.2,
        0.5,
        0.5,
        strapdown.compute_increments_from_imu(samples.sort_index(), "increment"),
        inertial_sensor.EstimationModel(STD[12], noise.gyro, noise.gyro_bias),
        inertial_sensor.EstimationModel(STD[9], noise.accel, noise.accel_bias),
        [
            measurements.Position(frame(positions.y * degrees, positions.t, util.LLA_COLS), 1.0),
            measurements.BodyVelocity(frame(log.y, log.t, ["VX", "VY", "VZ"]), LOG),
        ],
        0.05,
    )
    return found.trajectory, found.trajectory_sd


def frame(values, t, names):
    return pd.DataFrame(values, index=t, columns=names)


@pytest.mark.filterwarnings("ignore:The copy keyword")
def test_errors_and_deviations_agree_with_python_ins():
    """0.1 s after a fix, so that nobody has just used one: positions and velocities, of which both
    have the same axes, and the heading."""
    made = drive(Simulated("body-velocity", LOG, 5.0))
    positions = replace(made.sources[0], parameters=(), std=np.ones_like(made.sources[0].std))
    sources = [
        replace(a, t=made.imu.t[np.searchsorted(made.imu.t, a.t - 1e-6)], gate=np.inf)
        for a in (positions, made.sources[-1])
    ]
    recording = replace(made, sources=tuple(sources))
    begin = start(recording)
    ours = sd.fuse(
        recording,
        imu="tactical",
        start=begin,
        filter="closed-loop",
        options={"bias": "random-walk"},
    )
    theirs, deviations = python_ins(recording, begin)
    t = np.arange(5.1, 20.0, 1.0)
    at, rows = np.searchsorted(ours.t, t - 1e-6), np.searchsorted(theirs.index, t - 1e-6)
    truth = recording.reference
    true = np.searchsorted(truth.t, t - 1e-6)
    v, heading = theirs[util.VEL_COLS].to_numpy()[rows], theirs["heading"].to_numpy()[rows] * DEG
    for mine, other, right in (
        (ours.v_n[at], v, truth.v_n[true]),
        (ours.rph[at, 2], heading, truth.rph[true, 2]),
    ):
        errors = [(each - right + np.pi) % (2 * np.pi) - np.pi for each in (mine, other)]
        assert np.abs(errors[0]).max() > 0.02  # there is something to agree on
        assert rms(errors[0]) == pytest.approx(rms(errors[1]), rel=0.01)
        assert rms(errors[0] - errors[1]) < 0.03 * rms(errors[0])
    names = [*util.NED_COLS, *util.VEL_COLS, "heading"]
    claimed = np.c_[ours.std[at, :6], ours.std[at, 8] / DEG]
    index = np.searchsorted(deviations.index, t - 1e-6)
    np.testing.assert_allclose(deviations[names].to_numpy()[index], claimed, rtol=0.01)


def rms(errors):
    return np.sqrt((errors**2).mean())


def test_four_beams_say_what_their_vector_says():
    """Least squares of four beams is the vector, with its own standard deviations."""
    beams = np.array(BEAMS)
    sensors = [
        Simulated("beam-velocity", LOG, 5.0, (*ARM, *beam), f"beam {k}")
        for k, beam in enumerate(BEAMS)
    ]
    made = drive(*sensors)
    fixes, y = made.sources[:-4], np.concatenate([a.y for a in made.sources[-4:]], axis=1)
    std = LOG * np.sqrt(np.diag(np.linalg.inv(beams.T @ beams)))
    log = made.sources[-1]
    vector = sd.Source(
        "body-velocity", log.t, y @ np.linalg.pinv(beams).T, np.tile(std, (len(y), 1)), ARM
    )
    apart, together = (
        sd.fuse(replace(made, sources=(*fixes, *own)), imu="tactical", start=start(made))
        for own in (ungated(made.sources[-4:]), ungated((vector,)))
    )
    np.testing.assert_allclose(apart.std, together.std, rtol=3e-3)
    np.testing.assert_allclose(apart.v_n, together.v_n, atol=1e-3)


def ungated(sources):
    return tuple(replace(a, gate=np.inf) for a in sources)


def test_without_a_component_the_others_count():
    """As where the bottom is lost: a vector without its last component is two beams."""
    made = drive(Simulated("body-velocity", LOG, 5.0, ARM))
    *fixes, log = made.sources
    two = [
        sd.Source("beam-velocity", log.t, log.y[:, [k]], log.std[:, [k]], (*ARM, *np.eye(3)[k]))
        for k in (0, 1)
    ]
    lost = replace(log, y=np.where(np.arange(3) == 2, np.nan, log.y))
    apart, together = (
        sd.fuse(replace(made, sources=(*fixes, *own)), imu="tactical", start=start(made))
        for own in (ungated(two), ungated((lost,)))
    )
    np.testing.assert_allclose(apart.std, together.std, rtol=3e-3)
    np.testing.assert_allclose(apart.v_n, together.v_n, atol=1e-3)


@pytest.mark.parametrize("parameters", [(), ARM, (*ARM, 0.0, 0.0, 0.0), (*ARM, 1.0, 1.0, 0.0)])
def test_a_beam_without_a_direction_is_refused(parameters):
    made = drive(Simulated("speed", LOG, 5.0))
    beam = replace(made.sources[-1], kind="beam-velocity", parameters=parameters)
    recording = replace(made, sources=(*made.sources[:-1], beam))
    for refused in (
        lambda: sd.fuse(recording, imu="tactical", start=start(made)),
        lambda: Simulated("beam-velocity", LOG, 5.0, parameters),
    ):
        with pytest.raises(sd.DataError, match="unit vector"):
            refused()
