"""The aircraft of this package against JSBSim: the same forces at any state, the same trajectory
for the same controls, and each difference's cause."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.compile.records import rows
from strapdown.flight.aircraft_model.dynamics import Loads, evaluate, step
from strapdown.flight.aircraft_model.forces import density
from strapdown.flight.aircraft_model.parameters import aircraft
from strapdown.flight.jsbsim_craft import INTEGRATORS, _place, fly_jsbsim
from strapdown.flight.jsbsim_definition import POUND, jsbsim_definition
from strapdown.geometry.geodesy import displacement
from strapdown.sim.jsbsim import FOOT, session
from strapdown.sim.trajectory import (
    DEG,
    EARTH_RATE,
    ECCENTRICITY2,
    GM,
    SEMI_MAJOR,
    normal_gravity,
    radii,
)

pytest.importorskip("jsbsim")
PLACE, DT, J2 = (47.6 * DEG, 9.3 * DEG, 1000.0), 0.01, 1.08262982e-3
AEROSONDE = aircraft()
NOTHING = np.zeros(9)


def state_of(
    speed,
    roll,
    pitch,
    heading,
    alpha=0.0,
    beta=0.0,
    rates=(0.0, 0.0, 0.0),
    controls=(-0.12, 0.0, 0.0, 0.5),
):
    attitude = Rotation.from_euler("ZYX", [heading, pitch, roll])
    body = speed * np.array(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )
    return np.concatenate(
        [PLACE, attitude.apply(body), attitude.as_quat()[[3, 0, 1, 2]], rates, controls]
    )


def commands(t):
    """Pushes and pulls, rolls and skids, without coming to rest."""
    return np.array(
        [
            -0.12 + 0.06 * np.sin(1.3 * t),
            0.02 * np.sin(0.9 * t),
            0.05 * np.sin(2.1 * t + 1),
            0.5 + 0.3 * np.sin(0.4 * t),
        ]
    )


def flown(craft, duration=20.0, dt=DT, wind=(0.0, 0.0)):
    """States of `step` on the geodetic Earth, (n, 17), commands held for DT."""
    go, parameters, state, increments = (
        step,
        craft.parameters("geodetic"),
        state_of(25.0, 0.0, 0.05, 0.5, 0.05),
        np.zeros(6),
    )
    blowing = np.r_[wind, np.zeros(7)]
    states = [state.copy()]
    for row in range(round(duration / dt)):
        go(parameters, state, commands(DT * (row // round(DT / dt))), blowing, dt, increments)
        states.append(state.copy())
    return np.array(states)


def apart(one, other):
    """Largest distance m, velocity m/s, angle rad and rate rad/s between two flights."""
    turn = (
        Rotation.from_quat(one[:, [7, 8, 9, 6]]) * Rotation.from_quat(other[:, [7, 8, 9, 6]]).inv()
    )
    differences = (
        displacement(one[:, :3], other[:, :3]),
        one[:, 3:6] - other[:, 3:6],
        turn.as_rotvec(),
        one[:, 10:13] - other[:, 10:13],
    )
    return np.array([np.linalg.norm(each, axis=1).max() for each in differences])


@pytest.fixture(scope="module")
def ours():
    return flown(AEROSONDE)


TOLERANCE = np.array([0.02, 5e-3, 3e-4, 1e-3])
"""m, m/s, rad, rad/s, within 20 s."""


@pytest.mark.short
def test_the_same_controls_fly_the_same_trajectory(ours):
    made = fly_jsbsim(AEROSONDE, ours[0], ours[:, 13:], DT, substeps=4)
    assert made.shape == ours.shape and np.array_equal(made[:, 13:], ours[:, 13:])
    assert np.linalg.norm(displacement(ours[-1, :3], ours[0, :3])) > 300  # it went somewhere,
    # and turned
    assert (
        np.ptp(np.unwrap(Rotation.from_quat(ours[:, [7, 8, 9, 6]]).as_euler("ZYX")[:, 0]))
        > 30 * DEG
    )
    assert np.all(apart(made, ours) < TOLERANCE)


@pytest.mark.short
@pytest.mark.parametrize(
    "change",
    [
        {"density": 0.0},
        {"J_xz": -0.1204, "C_n_0": 0.002},
        {"C_L_q": 0.0, "C_D_q": 0.1, "oswald": 0.8},
    ],
)
def test_other_aircraft_in_wind_too(change):
    craft, wind = AEROSONDE.replace(**change), (4.0, -3.0)
    there = flown(craft, 8.0, wind=wind)
    made = fly_jsbsim(craft, there[0], there[:, 13:], DT, wind=wind, substeps=4)
    assert np.all(apart(made, there) < TOLERANCE)


@pytest.mark.short
def test_a_wrong_sign_or_a_missing_derivative_would_show(ours):
    for change in ({"J_xz": -0.1204}, {"C_l_r": 0.0}, {"C_D_elevator": 0.0}, {"C_Q_1": 0.0}):
        made = fly_jsbsim(AEROSONDE.replace(**change), ours[0], ours[:, 13:], DT, substeps=2)
        assert apart(made, ours)[0] > 10 * TOLERANCE[0], change


def test_half_of_the_difference_is_of_the_controls_between_rows():
    """Straight lines between recorded positions, where the actuators curve: that part falls with
    the square of the interval."""
    fine = flown(AEROSONDE, 8.0, dt=DT / 5)
    coarse = fine[::5]
    one, other = (
        apart(fly_jsbsim(AEROSONDE, each[0], each[:, 13:], dt, substeps=n), each)
        for each, dt, n in ((coarse, DT, 10), (fine, DT / 5, 2))
    )
    assert other[3] < one[3] / 10  # of the rates, which hardly feel gravity


@pytest.mark.short
def test_the_integrators_matter_as_their_order_says(ours):
    errors = {}
    for order, integrator in ((1, 1), (3, 4)):
        errors[order] = [
            apart(
                fly_jsbsim(
                    AEROSONDE,
                    ours[0],
                    ours[:601, 13:],
                    DT,
                    substeps=n,
                    integrators={key: integrator for key in INTEGRATORS},
                ),
                fly_jsbsim(AEROSONDE, ours[0], ours[:601, 13:], DT, substeps=16),
            )[2]
            for n in (2, 4)
        ]
    assert 1.7 < errors[1][0] / errors[1][1] < 2.3 and errors[3][0] / errors[3][1] > 3.5
    assert errors[3][1] < errors[1][1] / 100


@pytest.mark.short
def test_forces_moments_and_accelerations_agree_at_any_state(tmp_path):
    """At 40 states, stalled, sideslipping, in a dive: forces to rounding; and the acceleration
    but for gravity, which is that of J2 in JSBSim."""
    rng, parameters, rates, (loads,) = (
        np.random.default_rng(5),
        AEROSONDE.parameters("geodetic"),
        np.zeros(19),
        rows(Loads, 1),
    )
    path, go = jsbsim_definition(AEROSONDE, tmp_path), evaluate
    with session() as (executive, _):
        executive.set_aircraft_path(str(tmp_path))
        assert executive.load_model(path.stem)
        told = lambda scale, *keys: np.array([executive[key] for key in keys]) * scale
        for _ in range(40):
            roll, pitch, heading, alpha, beta = rng.uniform(
                [-3, -1.4, 0, -0.8, -0.6], [3, 1.4, 6.28, 1.2, 0.6]
            )
            controls = rng.uniform([-0.4, -0.4, -0.4, 0], [0.4, 0.4, 0.4, 1])
            state = state_of(
                rng.uniform(8, 45),
                roll,
                pitch,
                heading,
                alpha,
                beta,
                rng.uniform(-1, 1, 3),
                controls,
            )
            _place(executive, state, state[13:], (0.0, 0.0), INTEGRATORS)
            go(parameters, state, NOTHING, rates, loads)
            assert np.allclose(
                told(POUND, *(f"forces/fb{axis}-total-lbs" for axis in "xyz")),
                loads.force,
                rtol=1e-9,
                atol=1e-8,
            )
            assert np.allclose(
                told(POUND * FOOT, *(f"moments/{axis}-total-lbsft" for axis in "lmn")),
                loads.moment,
                rtol=1e-9,
                atol=1e-8,
            )
            assert np.allclose(
                told(1.0, *(f"accelerations/{axis}idot-rad_sec2" for axis in "pqr")),
                rates[10:13],
                rtol=1e-9,
                atol=1e-8,
            )
            assert executive["craft/turns"] * 2 * np.pi == pytest.approx(
                loads.propeller, rel=1e-9, abs=1e-9
            )
            theirs = told(FOOT, *(f"accelerations/{axis}dot-ft_sec2" for axis in "uvw"))
            assert np.allclose(
                theirs, in_body(state, rates[3:6] + j2_less_normal(state)), atol=2e-8
            )


@pytest.mark.short
@pytest.mark.parametrize("height", [0.0, 500.0, 3000.0, 8000.0, 15000.0])
def test_the_standard_atmosphere_is_that_of_the_aircraft(height, tmp_path):
    craft, state = AEROSONDE.replace(density=0.0), state_of(25.0, 0.1, 0.05, 0.5, 0.05)
    state[2] = height
    path, (loads,) = jsbsim_definition(craft, tmp_path), rows(Loads, 1)
    with session() as (executive, _):
        executive.set_aircraft_path(str(tmp_path))
        assert executive.load_model(path.stem)
        _place(executive, state, state[13:], (0.0, 0.0), INTEGRATORS)
        evaluate(craft.parameters("geodetic"), state, NOTHING, np.zeros(19), loads)
        assert executive["craft/rho"] == pytest.approx(
            density(craft.parameters(), height), rel=1e-9
        )
        force = [executive[f"forces/fb{axis}-total-lbs"] * POUND for axis in "xyz"]
        assert np.allclose(force, loads.force, rtol=1e-8, atol=1e-8)


def in_body(state, rate):
    """The rate of the velocity's components in body axes, of its rate in those of the navigation
    frame, both against the Earth."""
    (lat, _, height), velocity, to_n = (
        state[:3],
        state[3:6],
        Rotation.from_quat(state[[7, 8, 9, 6]]),
    )
    meridian, normal = radii(lat)
    transport = [
        velocity[1] / (normal + height),
        -velocity[0] / (meridian + height),
        -velocity[1] * np.tan(lat) / (normal + height),
    ]
    turning = state[10:13] - to_n.inv().apply(
        EARTH_RATE * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    )
    return to_n.inv().apply(rate + np.cross(transport, velocity)) - np.cross(
        turning, to_n.inv().apply(velocity)
    )


def centrifugal(state):
    """NED, m/s^2."""
    lat, _, height = state[:3]
    distance = (SEMI_MAJOR / np.sqrt(1 - ECCENTRICITY2 * np.sin(lat) ** 2) + height) * np.cos(lat)
    return EARTH_RATE**2 * distance * np.array([-np.sin(lat), 0.0, -np.cos(lat)])


def j2_less_normal(state):
    """Gravity of a point mass with J2 on the rotating Earth less normal gravity, NED, m/s^2."""
    lat, _, height = state[:3]
    normal = SEMI_MAJOR / np.sqrt(1 - ECCENTRICITY2 * np.sin(lat) ** 2)
    x, z = (normal + height) * np.cos(lat), (normal * (1 - ECCENTRICITY2) + height) * np.sin(lat)
    r, k = np.hypot(x, z), 1.5 * J2 * (SEMI_MAJOR / np.hypot(x, z)) ** 2
    outward, polar = (
        -GM / r**3 * part * (1 + k * (n - 5 * (z / r) ** 2)) for part, n in ((x, 1), (z, 3))
    )
    there = np.array(
        [
            np.cos(lat) * polar - np.sin(lat) * outward,
            0.0,
            -np.cos(lat) * outward - np.sin(lat) * polar,
        ]
    )
    north, down = normal_gravity(lat, height)
    return there + centrifugal(state) - [north, 0.0, down]


@pytest.mark.short
def test_what_cannot_be_flown_is_refused_in_one_line(ours, tmp_path, capfd):
    controls = ours[:50, 13:]
    for arguments, words in (
        ((ours[0, :16], controls, DT), r"state is of shape .16,.; it must be 17"),
        ((ours[0], controls[:1], DT), "times of the controls is 1; .* 2 or more"),
        ((ours[0], np.where(controls < 0, np.nan, controls), DT), "finite"),
        ((ours[0], controls, DT, (1.0, 2.0, 3.0)), "to north and east"),
        ((np.zeros(17), controls, DT), "quaternion .* length 0"),
        ((ours[0], controls, DT, (0.0, 0.0), 1.5), "substeps is 1.5; it must be a whole number"),
        ((ours[0], controls, "a"), "dt is .a. s; it must be a finite number above 0"),
        ((ours[0], controls, 1e-9), "at most 100000"),
        ((ours[0], [["a"] * 4] * 2, DT), "controls is .*; it must be n x 4 finite"),
        ((ours[0], controls, DT, (0.0, 0.0), 2, {"rates": 1}), "integrators: unknown key .rates."),
    ):
        with pytest.raises(DataError, match=words):
            fly_jsbsim("aerosonde", *arguments)
    with pytest.raises(DataError, match="did you mean 'aerosonde'"):
        fly_jsbsim("aerosond", ours[0], controls, DT)
    (tmp_path / "aerosonde").write_text("a file where the folder should be")
    with pytest.raises(DataError, match="cannot be made"):
        jsbsim_definition(AEROSONDE, tmp_path)
    assert capfd.readouterr() == ("", "")
