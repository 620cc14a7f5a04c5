"""What the constants of an installation do to measurements, differentiated numerically; and recordings
with them changed."""

from dataclasses import replace

import numpy as np
import pytest
from installed import car, turned_case
from recordings import flight
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE
from strapdown.data.solution import Source
from strapdown.engine.options import run_options
from strapdown.engine.sensitivity import Corrections, begin_sensitive
from strapdown.geometry.geodesy import displacement
from strapdown.installation.findings import edits
from strapdown.installation.model import InstallationModel, apply_constants, constants, rotation
from strapdown.preprocessing.axes import rotation_matrix

STEP = 1e-6
BEAM = np.array([0.6, 0.0, 0.8])


@pytest.fixture(scope="module")
def model():
    recording = car(1040, 20.0)
    heading = Source("heading", *map(np.array, ([5.0], [[0.0]], [[0.1]])))
    t, one = np.array([5.0]), np.array([[0.1]])
    log = Source("body-velocity", t, np.zeros((1, 3)), one * np.ones(3), (0.5, 0.2, 0.1))
    beam = Source("beam-velocity", t, 0 * one, one, (0.5, 0.2, 0.1, *BEAM))
    recording = replace(recording, sources=(*recording.sources, heading, log, beam))
    run = begin_sensitive(recording, filters.find("closed-loop"), run_options())
    return InstallationModel(run, constants(run.recording.sources), True)


@pytest.fixture(scope="module")
def at():
    """One correction by each of the eight sources, at one turning belief."""
    rng, count = np.random.default_rng(5), 8
    tile = lambda values: np.tile(values, (count, *[1] * np.ndim(values)))
    return Corrections(
        np.zeros(count),
        np.arange(count),
        tile(rng.normal(0, 10, 3)),
        tile(rotation(rng.normal(0, 1, 3))),
        tile(rng.normal(0, 1, 3)),
        tile(rng.normal(0, 5, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
    )


def measured(model, at, source, arm, turn, scale):
    """The measurement of a source whose IMU must be turned, whose arm is given in vehicle axes."""
    C, omega = at.C[0] @ rotation(turn).T, rotation(turn) @ at.omega[0]
    swing = np.cross(omega, arm)
    if model.kinds[source] == "position":
        return C @ arm
    if model.kinds[source] == "velocity":
        return at.v[0] + C @ swing
    if model.kinds[source] == "heading":
        return np.array([np.arctan2(C[1, 0], C[0, 0]), 0.0, 0.0])
    body = (C.T @ at.v[0] + swing) * (1 + scale)
    if model.kinds[source] == "body-velocity":
        return body
    if model.kinds[source] == "beam-velocity":
        return np.array([BEAM @ body, 0.0, 0.0])
    axis = ["speed", "zero-lateral-velocity", "zero-vertical-velocity"].index(model.kinds[source])
    return np.array([body[axis], 0.0, 0.0])


@pytest.mark.parametrize("source", range(8))
def test_derivatives_are_those_of_the_measurements(model, at, source):
    h, arm = model.derivatives(at), model.arms[source]
    for j, one in enumerate(model.found):
        change = np.zeros(3)
        change[one.axis] = STEP
        given = {
            "lever arm": (arm + change * (source in one.sources), np.zeros(3), 0.0),
            "mounting": (arm, change, 0.0),
            "scale": (arm, np.zeros(3), STEP * (source in one.sources)),
        }.get(one.of.cause)
        if given is None:
            continue
        as_given = measured(model, at, source, arm, np.zeros(3), 0.0)
        numeric = (measured(model, at, source, *given) - as_given) / STEP
        np.testing.assert_allclose(h[source, :, j], numeric, atol=2e-4)


def test_clocks_move_the_antenna_along_its_way(model, at):
    h, arm = model.derivatives(at), model.arms[0]
    C, omega = at.C[0], at.omega[0]
    swing = np.cross(omega, arm)
    np.testing.assert_allclose(h[0, :, 0], at.v[0] + C @ swing)
    force = C @ (at.f[0] + np.cross(omega, swing))
    np.testing.assert_allclose(h[1, :, 1], force + [0, 0, 9.8], atol=0.03)
    assert not h[1, :, 0].any() and not h[0, :, 1].any() and not h[2:, :, :2].any()


def test_a_start_made_of_fixes_errs_with_them():
    """By aligning anew with another arm."""
    recording = car(1040, 60.0)
    found, step = constants(recording.sources), 0.01
    begun = lambda theta: begin_sensitive(
        apply_constants(recording, found, theta), filters.find("closed-loop"), run_options()
    )
    run = begun(np.zeros(len(found)))
    V = InstallationModel(run, found, True).start
    assert not InstallationModel(run, found, False).start.any()
    for j, one in enumerate(found):
        if one.of is not LEVER_ARM:
            continue
        theta = step * np.eye(len(found))[j]
        there, back = begun(theta).start, begun(-theta).start
        moved = displacement(np.array(there.lla), np.array(back.lla)) / (2 * step)
        np.testing.assert_allclose(V[0:3, j], moved, atol=0.01)
        change = (np.array(there.v_n) - np.array(back.v_n)) / (2 * step)
        np.testing.assert_allclose(V[3:6, j], change, atol=0.01)
    # the clocks: what was true then is true later
    assert V[0:3, 0] == pytest.approx(-np.array(run.start.v_n))
    assert not V[0:3, 1].any() and V[3:6, 1].any() and not V[3:6, 0].any()


def test_what_is_applied_is_what_the_constants_say():
    recording = car(1040, 20.0)
    found = constants(recording.sources)
    theta = np.zeros(len(found))
    theta[[j for j, one in enumerate(found) if one.of is CLOCK]] = 0.3
    theta[[one.of is LEVER_ARM and one.axis == 2 for one in found].index(True)] = 0.4
    theta[[one.of is MOUNTING and one.axis == 2 for one in found].index(True)] = np.pi / 2
    theta[[one.of is SCALE for one in found].index(True)] = 0.25
    made = apply_constants(recording, found, theta)
    position, _, speed = made.sources[:3]
    np.testing.assert_allclose(position.t, recording.sources[0].t + 0.3)
    np.testing.assert_allclose(position.parameters, (0.5, 0.2, -0.6))
    np.testing.assert_allclose(speed.y, recording.sources[2].y / 1.25)
    # its x axis points to the right of the vehicle
    np.testing.assert_allclose(made.imu.dv[:, 1], recording.imu.dv[:, 0], atol=1e-12)
    assert apply_constants(recording, found, 0 * theta).imu is recording.imu


@pytest.mark.short
def test_rates_that_the_gyro_measured_turn_with_it():
    recording = car(1040, 20.0)
    rates = Source(
        "zero-angular-rate", *map(np.array, ([1.0], [[0.01, 0.02, 0.03]], [[0.005] * 3]))
    )
    recording = replace(recording, sources=(*recording.sources, rates))
    found = constants(recording.sources)
    theta = np.array([np.pi / 2 * (one[::2] == (MOUNTING, 2)) for one in found])
    made = apply_constants(recording, found, theta)
    np.testing.assert_allclose(made.sources[-1].y, [[-0.02, 0.01, 0.03]], atol=1e-15)


@pytest.mark.short
def test_a_magnetometer_and_an_ahrs_turn_with_their_imu():
    """They see the same field and the same attitude of the turned axes."""
    recording = car(1040, 20.0)
    t, C = recording.reference.t[100:104], recording.reference.rotation[100:104]
    field, ones = np.array([2e-5, 1e-6, 4e-5]), np.ones((4, 3))
    rph = C.as_euler("ZYX")[:, ::-1]
    sources = (
        Source("magnetic-field", t, C.inv().apply(field), ones * 1e-7, tuple(field)),
        Source("attitude", t, rph, ones * 0.01, ()),
    )
    recording = replace(recording, sources=(*recording.sources, *sources))
    found = constants(recording.sources)
    theta = np.array([0.3 * (one[::2] == (MOUNTING, 2)) for one in found])
    *others, magnetic, attitude = apply_constants(recording, found, theta).sources
    assert all((made.y == given.y).all() for made, given in zip(others, recording.sources))
    own = C * Rotation.from_rotvec([0, 0, 0.3]).inv()
    np.testing.assert_allclose(own.apply(magnetic.y.copy()), np.tile(field, (4, 1)), atol=1e-12)
    same = Rotation.from_euler("ZYX", attitude.y[:, ::-1]) * own.inv()
    np.testing.assert_allclose(same.magnitude(), 0, atol=1e-9)


def test_a_mounting_is_found_beside_a_magnetometer_in_the_same_case():
    """Turning the IMU without it made the two contradict each other: +7.5 +- 0.6 deg for 2.9."""
    made = sd.diagnose(turned_case(1040, 120.0, 0.05))
    (mounting,) = made.found
    assert mounting.name == "mounting heading"
    assert mounting.change == pytest.approx(np.degrees(0.05), abs=0.1)


def test_each_antenna_has_an_arm_of_its_own():
    recording = flight()
    position, velocity = recording.sources
    other = replace(position, parameters=(2.0, 0.0, 0.0), name="second")
    found = constants((position, velocity, other))
    arms = {one.sources for one in found if one.of is LEVER_ARM}
    assert arms == {(0, 1), (2,)} and sum(one.of is CLOCK for one in found) == 3


@pytest.mark.short
def test_what_the_description_must_say_gives_the_recording_as_found():
    given, recording = (0.3, -0.2, 3.0), car(1041, 20.0)
    raw = recording.imu.dv @ rotation_matrix(*given)  # C' on each row
    recording = replace(
        recording, meta={**recording.meta, "imu_mounting": given, "imu_lever_arm": [0.0, 0.1, -0.5]}
    )
    found = [
        (MOUNTING, (0, 1), 1, 0.05, 0.01),
        (MOUNTING, (0, 1), 2, -0.1, 0.02),
        (LEVER_ARM, (0, 1), 0, 1.5, 0.2),
        (SCALE, (2,), 0, 0.02, 0.001),
    ]
    known = constants(recording.sources)
    theta = np.array(
        [sum(x for of, _, axis, x, _ in found if one[::2] == (of, axis)) for one in known]
    )
    wanted = apply_constants(recording, known, theta)
    made = {(each.of, each.source): each for each in edits(recording, found)}
    said = {key: np.array(each.value) for key, each in made.items()}
    assert made[MOUNTING, None].std == (0.0, 0.01, 0.02) and made[LEVER_ARM, 1].std == (0.2, 0, 0)
    assert made[SCALE, 2].std == pytest.approx((0.001 / 1.02,))
    mounted = raw @ rotation_matrix(*said[MOUNTING, None]).T
    np.testing.assert_allclose(mounted, wanted.imu.dv, atol=1e-12)
    for i in (0, 1):
        arm = said[LEVER_ARM, i] - recording.meta["imu_lever_arm"]
        np.testing.assert_allclose(arm, wanted.sources[i].parameters)
    speed = recording.sources[2].y * said[SCALE, 2]
    np.testing.assert_allclose(speed, wanted.sources[2].y)
