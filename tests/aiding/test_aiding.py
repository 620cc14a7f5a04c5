"""Every sensor against a plain model of what it measures, and its Jacobian against central
differences.

A new sensor needs one line here: its entry in SENSORS.
"""

import math

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown import aiding
from strapdown.core.loop.contract import FilterState, Kind, compile_kernel
from strapdown.core.mathematics.source import new_source

pytestmark = pytest.mark.short
DEG = np.pi / 180
ARM = (1.2, -0.7, 2.5)  # m, body

BEACON = (46.9 * DEG, 8.1 * DEG, -300.0)  # rad, rad, m
BEAM = np.array([0.48, -0.6, 0.64])  # unit vector, body


def antenna(b, arm):
    """Geodetic position of a point of the body."""
    return np.array(pymap3d.ned2geodetic(*(b.C_nb @ arm), *b.lla, deg=False))


def velocity(b, arm):
    """Its velocity in n; what turns the Earth under it (7e-5 rad/s) is left out."""
    return b.v_n + b.C_nb @ np.cross(b.omega, arm)


def heading(b):
    return Rotation.from_matrix(b.C_nb).as_euler("ZYX")[0]


def earth_rate(b):
    """North, east, down, rad/s (IERS)."""
    return 7.292115e-5 * np.array([math.cos(b.lla[0]), 0, -math.sin(b.lla[0])])


FIELD = np.array([20.3, 1.2, 45.0])  # NED, in uT, so that the tolerances of metres fit


def atmosphere(h):
    """Pressure at geopotential height h, Pa: hydrostatic integral of the ICAO lapse rate."""
    return 101325 * (1 - 0.0065 * h / 288.15) ** (9.80665 / (287.05287 * 0.0065))


def distance(b):
    """From the point to the beacon, m."""
    there, here = (
        np.array(pymap3d.geodetic2ecef(*p, deg=False)) for p in (BEACON, antenna(b, ARM))
    )
    return math.sqrt(((there - here) ** 2).sum())


def normal_gravity(b, h=None):
    """Somigliana at the ellipsoid with the free-air gradient, m/s^2: to 1e-4 below 10 km."""
    h = b.lla[2] if h is None else h
    square = math.sin(b.lla[0]) ** 2
    return (
        9.7803253359 * (1 + 0.00193185265241 * square) / math.sqrt(1 - 0.00669437999014 * square)
        - 3.0877e-6 * h
        + 7.2e-13 * h**2
    )


def leaning(b):
    """North component of gravity above the ellipsoid, m/s^2: Groves (2013) 2.140, to 1 %."""
    return -8.08e-9 * b.lla[2] * math.sin(2 * b.lla[0])


AIR = (95e3, 290.0, 300.0)  # Pa, K, m: the air that a weather station tells
MEAN_GAS = 287.05287


def through_air(b, arm=ARM):
    """Velocity of a point through the air in the body; the wind is the first two augmented states."""
    return b.C_nb.T @ (b.v_n - np.r_[b.augmented[:2], 0]) + np.cross(b.omega, arm)


DRAG = (0.3, 0.4, 0.0)  # 1/s


def rotor_drag(b):
    """Specific force across the axis of the rotors that an accelerometer with its bias reads."""
    return b.b_a[:2] - DRAG[:2] * through_air(b, (0.0, 0.0, 0.0))[:2]


def thinned(b):
    """Root of the air density over 1.225 kg/m^3, hydrostatic with the ICAO lapse rate."""
    p, T, height = AIR
    now = T - 0.0065 * (b.lla[2] - height)
    pressure = p * (now / T) ** (9.80665 / (MEAN_GAS * 0.0065))
    return math.sqrt(pressure / (MEAN_GAS * now) / 1.225)


# name: parameters, and what the sensor would measure without error where the body is in the state
# b; of a constraint, what must vanish
SENSORS = {
    "position": (ARM, lambda b: antenna(b, ARM)),
    "velocity": (ARM, lambda b: velocity(b, ARM)),
    "heading": ((), lambda b: heading(b)),
    "course": (ARM, lambda b: math.atan2(velocity(b, ARM)[1], velocity(b, ARM)[0])),
    "altitude": (ARM, lambda b: antenna(b, ARM)[2]),
    "speed": (ARM, lambda b: (b.C_nb.T @ velocity(b, ARM))[0]),
    "body-velocity": (ARM, lambda b: b.C_nb.T @ velocity(b, ARM)),
    "beam-velocity": ((*ARM, *BEAM), lambda b: BEAM @ b.C_nb.T @ velocity(b, ARM)),
    "zero-lateral-velocity": (ARM, lambda b: (b.C_nb.T @ velocity(b, ARM))[1]),
    "zero-vertical-velocity": (ARM, lambda b: (b.C_nb.T @ velocity(b, ARM))[2]),
    "zero-velocity": ((), lambda b: b.v_n),
    "zero-angular-rate": ((), lambda b: b.b_g + b.C_nb.T @ earth_rate(b)),
    "gravity": ((), lambda b: b.C_nb @ b.f + [leaning(b), 0, normal_gravity(b)]),
    "magnetic-field": (FIELD, lambda b: b.C_nb.T @ FIELD),
    "pressure": (
        ARM,
        lambda b: atmosphere(antenna(b, ARM)[2] + b.augmented[0]),
    ),
    "pressure-altitude": (ARM, lambda b: antenna(b, ARM)[2] + b.augmented[0]),
    "true-airspeed": (ARM, lambda b: np.linalg.norm(through_air(b))),
    "indicated-airspeed": ((*ARM, *AIR), lambda b: thinned(b) * np.linalg.norm(through_air(b))),
    "side-slip": (ARM, lambda b: math.atan2(through_air(b)[1], through_air(b)[0])),
    "angle-of-attack": (ARM, lambda b: math.atan2(through_air(b)[2], through_air(b)[0])),
    "zero-side-slip": (ARM, lambda b: through_air(b)[1]),
    "rotor-drag": (DRAG, rotor_drag),
    "zero-sea-level": (ARM, lambda b: antenna(b, ARM)[2]),
    "depth": (ARM, lambda b: b.augmented[0] - antenna(b, ARM)[2]),
    "water-pressure": (
        ARM,
        lambda b: 101325 + 1025 * normal_gravity(b, 0.0) * (b.augmented[0] - antenna(b, ARM)[2]),
    ),
    "range": ((*ARM, *BEACON), lambda b: distance(b) + b.augmented[0]),
    "attitude": ((), lambda b: Rotation.from_matrix(b.C_nb).as_euler("ZYX")[::-1]),
    "baseline": (ARM, lambda b: b.C_nb @ ARM),
}
TOGETHER = {"attitude": (0, 1)}  # components that are measured together or not at all

# latitude, longitude (deg), height; velocity; roll, pitch, heading (deg); angular rate (rad/s)
BELIEFS = {
    "level, north": ((47.0, 8.0, 400.0), (12.0, 0.1, -0.2), (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)),
    "banked, east": (
        (-35.0, 150.0, 9000.0),
        (10.0, 200.0, 3.0),
        (-60.0, 3.0, 90.0),
        (0.5, -0.2, 0.3),
    ),
    "south": ((10.0, -70.0, -20.0), (-30.0, 2.0, 1.0), (2.0, -3.0, 180.0), (0.1, 0.2, -2.0)),
    "steep climb, west": (
        (60.0, 25.0, 5000.0),
        (-10.0, -40.0, -150.0),
        (10.0, 85.0, -90.0),
        (1.0, 0.0, 3.0),
    ),
    "steep dive": (
        (-20.0, -45.0, 3000.0),
        (30.0, -18.0, 80.0),
        (170.0, -80.0, 225.0),
        (-3.0, 1.0, 0.2),
    ),
    "lat 85": ((85.0, 10.0, 2000.0), (150.0, 130.0, 5.0), (20.0, 10.0, 135.0), (0.2, 0.1, 0.0)),
    "lat -88, antimeridian": (
        (-88.0, 180.0, 2000.0),
        (5.0, 5.0, 0.0),
        (0.0, 20.0, 300.0),
        (0.0, -1.0, 0.0),
    ),
    "antimeridian": ((52.0, -180.0, 10.0), (0.0, 8.0, 0.0), (5.0, 0.0, 45.0), (0.0, 0.0, 0.5)),
}
STEPS = np.r_[np.repeat([1.0, 0.1, 1e-4, 0.1, 1e-2], 3), 1.0, 1.0]  # m, m/s, rad, m/s^2, rad/s, m
# constraints that say so of the belief itself, and look at no y
VANISHING = (
    "zero-velocity",
    "gravity",
)
STATES = 17  # two more than the library's: a sensor leaves those of others alone


def belief_at(name):
    lla, v, rph, omega = BELIEFS[name]
    C = Rotation.from_euler("ZYX", rph[::-1], degrees=True).as_matrix()
    b_a, b_g = np.array([0.1, -0.2, 0.05]), np.array([0.01, 0.02, -0.005])
    f = np.array([0.3, -1.0, -9.7])
    return FilterState(
        np.array(lla) * [DEG, DEG, 1],
        np.array(v),
        C,
        b_a,
        b_g,
        np.eye(STATES),
        np.array(omega),
        f,
        np.zeros(5),
        np.array([3.0, -7.0]),
    )


def belief_of(name, at):
    """The belief at which a kind is tried: an aircraft flies forwards through the air."""
    b = belief_at(at)
    if aiding.find(name).shared != "wind":
        return b
    return b._replace(v_n=b.C_nb @ [40.0, 3.0, 2.0] + np.r_[b.augmented, 0])


def steps_of(name):
    """Steps of the states: those of a wind are small, as an airspeed is not linear in it."""
    return STEPS * np.where(
        (aiding.find(name).shared == "wind") & (np.arange(STATES) >= 15), 0.05, 1.0
    )


def moved(b, error):
    """b (+) error: metres NED, m/s, rad in n, biases; rate and force are the measured ones less
    the biases."""
    p, dv, theta, b_a, b_g = error[:15].reshape(5, 3)
    lla = np.array(pymap3d.ned2geodetic(*p, *b.lla, deg=False))
    C = Rotation.from_rotvec(theta).as_matrix() @ b.C_nb
    return b._replace(
        lla=lla,
        v_n=b.v_n + dv,
        C_nb=C,
        b_a=b.b_a + b_a,
        b_g=b.b_g + b_g,
        omega=b.omega - b_g,
        f=b.f - b_a,
        augmented=b.augmented + error[15:],
    )


def observe(name, b, y):
    """(rows, innovation, H) of the sensor's kernel."""
    kernel = aiding.find(name).observe
    compile_kernel(kernel)
    innovation, H, source = np.full(3, 7e7), np.zeros((3, STATES)), new_source(first_state=15)
    source.parameters[: len(SENSORS[name][0])] = SENSORS[name][0]
    measured = np.full(3, np.nan)
    measured[: np.size(y)] = y
    b = FilterState(*(np.ascontiguousarray(part) for part in b))
    before = [part.copy() for part in b]
    rows = kernel(b, measured, source, innovation, H)
    assert all(np.array_equal(part, was) for part, was in zip(b, before)), (
        "a sensor changed the belief"
    )
    return rows, innovation, H


def test_every_sensor_has_its_line():
    assert set(SENSORS) == set(aiding.names())


@pytest.mark.parametrize("at", BELIEFS)
@pytest.mark.parametrize("name", SENSORS)
def test_innovation_is_measured_minus_expected(name, at):
    """Zero for what the body would measure; and where the truth is elsewhere, the part of its
    error that the sensor sees."""
    b, model = belief_of(name, at), SENSORS[name][1]
    rows, innovation, H = observe(name, b, model(b))
    assert rows == len(aiding.find(name).quantities)  # the default gate counts on it
    if name in VANISHING:
        vanishing = np.asarray(model(b))
        np.testing.assert_allclose(innovation[:rows], -vanishing, atol=3e-4)
        # in the level to 1 % of gravity's north component
        np.testing.assert_allclose(innovation[:2], -vanishing[:2], atol=1e-6)
        return
    np.testing.assert_allclose(innovation[:rows], 0, atol=2e-5)
    error = 0.1 * steps_of(name) * np.sin(np.arange(1, STATES + 1))
    _, innovation, H = observe(name, b, model(moved(b, error)))
    np.testing.assert_allclose(innovation[:rows], H[:rows] @ error, atol=5e-5)


@pytest.mark.parametrize("at", BELIEFS)
@pytest.mark.parametrize("name", SENSORS)
def test_jacobian_is_the_derivative(name, at):
    b = belief_of(name, at)
    y = SENSORS[name][1](b)
    rows, _, H = observe(name, b, y)
    assert (
        1 <= rows <= 3 and not H[rows:].any() and H[:, 15:].any() == bool(aiding.find(name).states)
    )
    for state, step in enumerate(steps_of(name)):
        error = np.zeros(STATES)
        error[state] = step
        ahead, behind = (observe(name, moved(b, sign * error), y)[1][:rows] for sign in (1, -1))
        np.testing.assert_allclose(
            H[:rows, state], (behind - ahead) / (2 * step), rtol=1e-5, atol=2e-5
        )


AIR_DATA = [name for name in SENSORS if aiding.find(name).shared == "wind"]
FIXED_WING = [name for name in AIR_DATA if name != "rotor-drag"]


@pytest.mark.parametrize("name", AIR_DATA)
def test_a_vertical_wind_is_a_third_state(name):
    """The same as air that comes from above: as a velocity of the vehicle downwards, less."""
    b, kernel = belief_of(name, "banked, east"), aiding.find(name).observe
    compile_kernel(kernel)
    source = new_source(first_state=15, states=3)
    source.parameters[: len(SENSORS[name][0])] = SENSORS[name][0]
    found = []
    for sinks, blows in ((0.0, 0.0), (-2.5, 0.0), (0.0, 2.5)):
        v = b.v_n + [0.0, 0.0, sinks]
        belief = b._replace(P=np.eye(18), v_n=v, augmented=np.r_[b.augmented, blows])
        innovation, H = np.full(3, np.nan), np.zeros((3, 18))
        rows = kernel(belief, np.full(3, 0.3), source, innovation, H)
        found.append((innovation[:rows], H[:rows].copy()))
    assert np.abs(found[1][0] - found[0][0]).max() > 1e-3
    np.testing.assert_allclose(found[2][0], found[1][0], rtol=1e-12)
    np.testing.assert_allclose(found[0][1][:, 17], -found[0][1][:, 5])


@pytest.mark.parametrize("name", FIXED_WING)
@pytest.mark.parametrize("ahead", [4.9, 0.0, -40.0])
def test_a_slow_vehicle_or_air_from_behind_measures_nothing(name, ahead):
    b = belief_at("banked, east")
    swing = np.cross(b.omega, ARM)
    b = b._replace(v_n=b.C_nb @ ([ahead, 1.0, 0.5] - swing) + np.r_[b.augmented, 0])
    rows, innovation, _ = observe(name, b, SENSORS[name][1](b))
    assert rows == 1 and math.isnan(innovation[0])


def test_without_a_station_the_air_is_that_of_icao():
    """Densities of Doc 7488 at geopotential heights of 0, 5, 11 and 15 km, kg/m^3."""
    kernel = aiding.find("indicated-airspeed").observe
    compile_kernel(kernel)
    for height, density in ((0, 1.2250), (5000, 0.73612), (11000, 0.36392), (15000, 0.19367)):
        b = belief_of("indicated-airspeed", "banked, east")
        b.lla[2] = height
        b = FilterState(*(np.ascontiguousarray(part) for part in b))
        innovation, H = np.full(3, np.nan), np.zeros((3, STATES))
        kernel(b, np.zeros(3), new_source(first_state=15), innovation, H)
        indicated = np.linalg.norm(through_air(b, np.zeros(3))) * math.sqrt(density / 1.225)
        assert abs(innovation[0] + indicated) < 2e-4 * indicated


@pytest.mark.parametrize("name", ["true-airspeed", "indicated-airspeed"])
def test_the_scale_of_an_airspeed_is_a_state(name):
    b, kernel = belief_of(name, "banked, east"), aiding.find(name).observe
    compile_kernel(kernel)
    source, found = new_source(first_state=15, scale_state=17), []
    source.parameters[: len(SENSORS[name][0])] = SENSORS[name][0]
    for scale in (0.04, 0.0, 0.08):
        belief = b._replace(P=np.eye(18), augmented=np.r_[b.augmented, scale])
        innovation, H = np.full(3, np.nan), np.zeros((3, 18))
        kernel(belief, np.full(3, 30.0), source, innovation, H)
        found.append((innovation[0], H[0].copy()))
    (at, row), (below, _), (above, _) = found
    assert abs(row[17] - (below - above) / 0.08) < 1e-6
    assert abs(at - (30.0 - 1.04 * SENSORS[name][1](b))) < 1e-5
    np.testing.assert_allclose(row[3:5], -row[15:17])


@pytest.mark.parametrize("at", BELIEFS)
def test_the_earths_rate_tells_the_attitude(at):
    """It is below the tolerances above: the same at its own size."""
    b = belief_at(at)
    _, _, H = observe("zero-angular-rate", b, np.zeros(3))
    for state in range(6, 9):
        error = 1e-3 * (np.arange(STATES) == state)
        ahead, behind = (b.C_nb.T @ earth_rate(b) for b in (moved(b, error), moved(b, -error)))
        np.testing.assert_allclose(H[:, state], (ahead - behind) / 2e-3, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in SENSORS if aiding.find(name).recorded])
def test_a_missing_component_is_a_nan_and_spares_the_others(name):
    b = belief_of(name, "banked, east")
    y = np.atleast_1d(SENSORS[name][1](b))
    whole = observe(name, b, y)[1]
    for missing in set(range(len(y))) - set(TOGETHER.get(name, ())):
        rows, innovation, _ = observe(name, b, np.where(np.arange(len(y)) == missing, np.nan, y))
        assert math.isnan(innovation[missing])
        others = np.arange(rows) != missing
        np.testing.assert_allclose(
            innovation[:rows][others], whole[:rows][others], rtol=1e-12, atol=1e-14
        )


@pytest.mark.parametrize(
    "name", [name for name in SENSORS if "angle" in aiding.find(name).quantities]
)
@pytest.mark.parametrize("turns", [-2, -1, 1])
@pytest.mark.parametrize("at", BELIEFS)
def test_an_angle_is_wrapped(name, at, turns):
    b = belief_of(name, at)
    near, (rows, innovation, _) = (
        observe(name, b, SENSORS[name][1](b) + 0.01 + k * 2 * math.pi) for k in (0, turns)
    )
    np.testing.assert_allclose(innovation[:rows], near[1][:rows], atol=1e-9)
    assert 0 < np.abs(innovation[:rows]).max() < 0.03


@pytest.mark.parametrize("at", [name for name in BELIEFS if "antimeridian" in name])
@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_longitude_is_wrapped(at, turns):
    b = belief_at(at)
    _, innovation, _ = observe(
        "position", b, SENSORS["position"][1](b) + [0, turns * 2 * math.pi, 0]
    )
    np.testing.assert_allclose(innovation, 0, atol=2e-5)


def test_at_vertical_pitch_heading_is_finite():
    b = belief_at("level, north")._replace(
        C_nb=Rotation.from_euler("ZYX", [30, 90, 0], degrees=True).as_matrix()
    )
    rows, innovation, H = observe("heading", b, 1.0)
    assert np.all(np.isfinite(innovation[:rows])) and np.all(np.isfinite(H))


def test_kinds_are_numbered_from_zero_and_found_by_name():
    assert [aiding.number(name) for name in aiding.measurements()] == list(range(len(SENSORS)))
    assert aiding.own_names()[: len(Kind)] == [aiding.name_of(kind) for kind in Kind]
    with pytest.raises(ValueError, match="did you mean 'velocity'"):
        aiding.find("velocty")
