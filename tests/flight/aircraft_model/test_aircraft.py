"""The aircraft against another implementation's numbers, textbook equations integrated by scipy,
conservation laws and the library's own mechanization."""

import math
import pickle

import numpy as np
import pymap3d
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from textbook_aircraft import actuators, forces, motion

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.compile.records import rows
from strapdown.core.loop.contract import InitialState, Noise
from strapdown.data.recording import Recording
from strapdown.data.solution import Trajectory
from strapdown.flight.aircraft_model.dynamics import Loads, evaluate, respond
from strapdown.flight.aircraft_model.parameters import NAMES, PARAMETERS, SECTIONS, flat_metres
from strapdown.sim.trajectory import normal_gravity

AEROSONDE = sd.flight.aircraft("aerosonde")
RHO = AEROSONDE["density"]
ORIGIN = (0.82, 0.16, 400.0)
CALM = np.zeros(9)


def told(aircraft, state, wind=CALM, earth="flat"):
    """(rates (19,), Loads) of the compiled model at a state."""
    rates, (loads,) = np.zeros(19), rows(Loads, 1)
    evaluate(
        aircraft.parameters(earth, ORIGIN),
        np.array(state, float),
        np.array(wind, float),
        rates,
        loads,
    )
    return rates, loads


def at(velocity, euler=(0, 0, 0), omega=(0, 0, 0), controls=(0, 0, 0, 0)):
    """A state at ORIGIN from body velocity, Euler angles, rates and controls."""
    turn = Rotation.from_euler("ZYX", euler[::-1])
    x, y, z, w = turn.as_quat()
    sign = 1 if w >= 0 else -1
    return np.r_[ORIGIN, turn.apply(velocity), sign * np.array([w, x, y, z]), omega, controls]


def manoeuvres(seconds, dt=0.01):
    """Commands (n, 4) about level flight that reach a rate limit and an end stop: doublets, a
    banked turn, a climb and a throttle cut."""
    t = np.arange(round(seconds / dt)) * dt
    commands = np.tile(
        sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, earth="flat").commands, (len(t), 1)
    )
    for column, start, stop, change in (
        (0, 1, 2, -0.06),
        (0, 2, 3, 0.04),
        (1, 4, 4.5, 0.25),
        (1, 6, 6.5, -0.3),
        (2, 8, 9, 0.15),
        (3, 10, 14, 0.5),
        (0, 10, 14, -0.02),
        (1, 15, 15.4, -0.9),
        (3, 16, 18, -0.6),
    ):
        commands[(t >= start - 1e-9) & (t < stop - 1e-9), column] += change
    return commands


@pytest.mark.short
def test_forces_are_those_of_the_set_s_own_simulator():
    """Numbers that mavsim_public prints (chap4_check.py), which belong to the state of the set
    before it had parasite drag. Exact to what is printed."""
    old = AEROSONDE.replace(C_D_p=0.0)
    _, out = told(old, at((25, 0, 0), controls=(-0.2, 0, 0.005, 0.5)))
    weight = old["mass"] * 9.81
    assert [*out.force[:2], *out.moment] == pytest.approx(
        [
            -12.109717001006562,
            0.20707328125,
            0.5063701133123779,
            8.75643373378125,
            -0.21774997963125,
        ],
        rel=1e-9,
    )
    assert out.force[2] + weight == pytest.approx(63.44373750624077, rel=1e-9)
    assert [out.thrust, out.torque] == pytest.approx(
        [-12.43072534597213, -0.49879620097737787], rel=1e-9
    )
    q = np.array([0.938688796, 0.247421558, 0.0656821468, 0.230936730])
    state = np.r_[
        ORIGIN,
        Rotation.from_quat(np.roll(q, -1)).apply([27.3465947, 0.619628233, 1.42257772]),
        q,
        4.98772167e-3,
        0.168736005,
        0.171797313,
        -0.15705144,
        0.01788999,
        0.01084654,
        1.0,
    ]
    rates, out = told(old, state, [0, 0, 0, -0.00165177, -0.00475441, -0.01717199, 0, 0, 0])
    assert [out.airspeed, out.alpha] == pytest.approx(
        [27.39323489287441, 0.05259649205640062], rel=1e-7
    )
    assert [out.thrust, out.torque] == pytest.approx(
        [31.31315544701058, 1.58778287798956], rel=1e-7
    )
    more = 0.022801214339060967 - out.beta  # it takes asin(v / sqrt(u^2 + w^2)) for the sideslip
    assert math.sin(0.022801214339060967) == pytest.approx(math.tan(out.beta), rel=1e-7)
    aside = (
        more
        * 0.5
        * RHO
        * out.airspeed**2
        * old["area"]
        * np.array([old["C_Y_beta"], old["span"] * old["C_l_beta"], old["span"] * old["C_n_beta"]])
    )
    down = Rotation.from_quat(np.roll(q, -1)).inv().apply([0, 0, weight])
    assert out.force + down + [0, aside[0], 0] == pytest.approx(
        [36.22803069, 48.44092504, -39.39246597], rel=1e-7
    )
    assert out.moment + [aside[1], 0, aside[2]] == pytest.approx(
        [0.10867448074, 0.12496233353, -0.09481002421], rel=1e-6
    )
    assert rates[11] == pytest.approx(0.11393277484, rel=1e-6)


@pytest.mark.short
def test_forces_are_those_of_the_textbook_anywhere():
    rng = np.random.default_rng(4)
    for _ in range(50):
        velocity, omega = rng.normal([22, 0, 2], [6, 5, 5]), rng.normal(0, 1, 3)
        controls = np.r_[rng.uniform(-0.4, 0.4, 3), rng.uniform(0.2, 1)]
        gusts, turning = rng.normal(0, 2, 3), rng.normal(0, 0.2, 3)
        _, out = told(
            AEROSONDE,
            at(velocity, rng.normal(0, 0.5, 3), omega, controls),
            np.r_[np.zeros(3), gusts, turning],
        )
        force, moment = forces(AEROSONDE, velocity - gusts, omega - turning, controls, RHO)
        assert out.force == pytest.approx(
            force, rel=1e-10, abs=1e-9
        ) and out.moment == pytest.approx(moment, rel=1e-10, abs=1e-9)


@pytest.mark.short
def test_air_and_propeller_at_rest_and_in_thin_air():
    _, out = told(AEROSONDE, at((0, 0, 0)))
    # without voltage the propeller stands still
    assert out == rows(Loads, 1)[0]
    _, out = told(AEROSONDE, at((0, 0, 0), controls=(0, 0, 0, 1)))
    # static thrust; its reaction rolls to the left
    assert out.thrust > 30 and out.moment[0] == -out.torque < 0
    for height, density in ((0.0, 1.225), (1000.0, 1.1117), (10000.0, 0.4135)):  # ISO 2533
        high = at((25, 0, 1))
        high[2] = height
        thin, same = (
            told(AEROSONDE.replace(density=kept, diameter=0.01), high)[1] for kept in (0.0, density)
        )
        assert thin.force[[0, 2]] == pytest.approx(same.force[[0, 2]], rel=2e-4)
        assert thin.moment[1] == pytest.approx(same.moment[1], rel=2e-4)


def flown(seconds, dt, earth="flat", **wind):
    start = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, course=0.6, earth=earth).state
    return respond(
        AEROSONDE,
        start,
        np.repeat(manoeuvres(seconds), round(0.01 / dt), axis=0),
        dt,
        earth,
        **wind,
    )


def reference(seconds, wind):
    """The same manoeuvres integrated by DOP853 from the textbook's equations, restarted where a
    command changes."""
    start = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, course=0.6, earth="flat")
    C = Rotation.from_quat(np.roll(start.state[6:10], -1))
    g = AEROSONDE.parameters("flat", ORIGIN).gravity
    x = np.r_[
        0,
        0,
        0,
        C.inv().apply(start.state[3:6].copy()),
        C.as_euler("ZYX")[::-1],
        start.state[10:13],
        start.commands,
    ]
    commands = manoeuvres(seconds)
    changes = np.r_[
        0, np.flatnonzero(np.any(np.diff(commands, axis=0) != 0, axis=1)) + 1, len(commands)
    ]
    for first, last in zip(changes[:-1], changes[1:]):
        both = lambda t, x: np.r_[
            motion(AEROSONDE, x[:12], x[12:], g, RHO, wind),
            actuators(AEROSONDE, x[12:], commands[first]),
        ]
        x = solve_ivp(both, (first * 0.01, last * 0.01), x, "DOP853", rtol=1e-8, atol=1e-10).y[
            :, -1
        ]
    return x


def test_flight_is_that_of_the_textbook_s_equations_and_converges_to_it():
    """20 s of manoeuvres in wind: 10 ms steps to 2e-7 of the way flown, 2.5 ms steps 5 times
    closer and more (rate limits have kinks)."""
    wind = np.array([3.0, -2.0, 0.5])
    want = reference(20.0, wind)
    errors = []
    for dt in (0.01, 0.0025):
        states, _ = flown(20.0, dt, wind=np.r_[wind, np.zeros(6)])
        end = states[-1]
        C = Rotation.from_quat(np.roll(end[6:10], -1))
        metres = flat_metres(AEROSONDE.parameters("flat", ORIGIN), ORIGIN, end[:3])
        apart = (C.inv() * Rotation.from_euler("ZYX", want[8:5:-1])).magnitude()
        errors.append(
            np.r_[
                np.abs(metres - want[:3]).max(),
                np.abs(C.inv().apply(end[3:6]) - want[3:6]).max(),
                apart,
                np.abs(end[10:13] - want[9:12]).max(),
            ]
        )
        assert end[13:] == pytest.approx(want[12:], abs=1e-8)
    assert np.all(errors[0] < [1e-4, 1e-6, 1e-6, 1e-6]) and np.all(
        errors[1] * 5 < np.maximum(errors[0], 5e-6)
    ), errors


@pytest.mark.parametrize("inertia", [{}, {"J_xz": -0.2}])
def test_without_air_a_tumbling_body_keeps_angular_momentum_and_energy(inertia):
    """20 s of free fall from a tumble, air thinned away: nothing but RK4's 5e-9 is lost."""
    body = AEROSONDE.replace(density=1e-300, **inertia)
    states, _ = respond(
        body, at((20, 3, -5), (0.3, 0.2, 1), (1.0, 0.7, -1.2)), np.zeros((2000, 4)), 0.01, "flat"
    )
    J = np.array(
        [[body["J_x"], 0, -body["J_xz"]], [0, body["J_y"], 0], [-body["J_xz"], 0, body["J_z"]]]
    )
    turn, omega = Rotation.from_quat(np.roll(states[:, 6:10], -1, axis=1)), states[:, 10:13]
    h = turn.apply(omega @ J)
    assert np.abs(h - h[0]).max() < 2e-8 * np.linalg.norm(h[0])
    rotation = np.einsum("ki,ij,kj->k", omega, J, omega)
    assert np.abs(rotation / rotation[0] - 1).max() < 2e-8
    parameters = body.parameters("flat", ORIGIN)
    energy = 0.5 * (states[:, 3:6] ** 2).sum(1) + parameters.gravity * (states[:, 2] - ORIGIN[2])
    assert np.abs(energy / energy[0] - 1).max() < 1e-10  # a parabola is exact; this is rounding
    assert np.ptp(omega, axis=0).min() > 0.2  # it does tumble


def test_energy_changes_by_the_work_of_the_forces():
    """Kinetic and potential energy over the manoeuvres against the integral of power, and a
    glide that only loses."""
    states, _ = flown(20.0, 0.01)
    told_all = [told(AEROSONDE, state)[1] for state in states]
    turn = Rotation.from_quat(np.roll(states[:, 6:10], -1, axis=1))
    body, force, moment = (
        turn.inv().apply(states[:, 3:6]),
        np.array([out.force for out in told_all]),
        np.array([out.moment for out in told_all]),
    )
    omega, a = states[:, 10:13], AEROSONDE
    J = np.array([[a["J_x"], 0, -a["J_xz"]], [0, a["J_y"], 0], [-a["J_xz"], 0, a["J_z"]]])
    g = a.parameters("flat", ORIGIN).gravity
    energy = (
        0.5 * a["mass"] * (body**2).sum(1)
        + a["mass"] * g * states[:, 2]
        + 0.5 * np.einsum("ki,ij,kj->k", omega, J, omega)
    )
    power = (force * body).sum(1) + (moment * omega).sum(1)
    parts = power[:-1:2] + 4 * power[1::2] + power[2::2]
    gained = energy[-1] - energy[0]
    assert gained == pytest.approx(parts.sum() * 0.01 / 3, abs=1e-3 * np.ptp(energy))
    lift_and_drag = force - np.array([out.thrust for out in told_all])[:, None] * [1, 0, 0]
    assert np.all((lift_and_drag * body).sum(1) < 0)  # the air takes energy at every instant


def test_increments_mechanize_back_to_the_flight():
    """60 s on the rotating ellipsoid through `fuse` without a fix: 10 ms increments of the
    manoeuvres bring back the truth to millimetres."""
    start = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, course=0.6)
    commands = np.tile(manoeuvres(20.0), (3, 1))
    states, imu = respond(AEROSONDE, start.state, commands, 0.01)
    noise = Noise(1e-9, 1e-9, 1e-12, 1e-12, 0.0, 0.0)
    begun = InitialState(
        0.0, states[0, :3], states[0, 3:6], np.zeros(3), np.zeros(3), np.zeros(3), np.full(15, 1e-6)
    ).towards(states[0, 6:10])
    made = sd.fuse(Recording(imu, meta={"name": "flight"}), "closed-loop", start=begun, noise=noise)
    off = sd.errors(made, Trajectory(imu.t, states[1:, :3], states[1:, 3:6], states[1:, 6:10]))
    assert np.ptp(states[:, 2]) > 20 and np.abs(imu.dtheta).max() > 0.005
    assert (
        np.abs(off.position).max() < 4e-3
        and np.abs(off.velocity).max() < 1.5e-4
        and np.abs(off.attitude).max() < 1e-6
    )


def test_flight_over_the_ellipsoid_is_that_of_newton_s_law_in_ecef():
    """10 s of manoeuvres against DOP853 in ECEF axes: attitude to the Earth, its rate,
    centrifugal and Coriolis acceleration, the simulator's gravity."""
    start = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, course=0.6).state
    commands = manoeuvres(10.0)
    earth = np.array([0, 0, 7.292115e-5])
    axes = lambda lat, lon: np.array(
        [
            [-math.sin(lat) * math.cos(lon), -math.sin(lon), -math.cos(lat) * math.cos(lon)],
            [-math.sin(lat) * math.sin(lon), math.cos(lon), -math.cos(lat) * math.sin(lon)],
            [math.cos(lat), 0, -math.sin(lat)],
        ]
    )
    C_en = axes(*ORIGIN[:2])
    C = Rotation.from_matrix(C_en) * Rotation.from_quat(np.roll(start[6:10], -1))
    begin = np.array(pymap3d.geodetic2ecef(*ORIGIN, deg=False))
    x = np.r_[np.zeros(3), C_en @ start[3:6], C.as_quat(), start[10:13], start[13:]]
    inertia = np.array(
        [
            [AEROSONDE["J_x"], 0, -AEROSONDE["J_xz"]],
            [0, AEROSONDE["J_y"], 0],
            [-AEROSONDE["J_xz"], 0, AEROSONDE["J_z"]],
        ]
    )

    def rates(t, x, command):
        C, omega = Rotation.from_quat(x[6:10]).as_matrix(), x[10:13]
        turning = omega - C.T @ earth
        lat, lon, height = pymap3d.ecef2geodetic(*(begin + x[:3]), deg=False)
        force, moment = forces(AEROSONDE, C.T @ x[3:6], turning, x[13:], RHO)
        gravity_north, gravity_down = normal_gravity(lat, height)
        north, _, down = axes(lat, lon).T
        b, c, d, a = x[6:10]
        p, q, r = turning
        return np.r_[
            x[3:6],
            C @ force / AEROSONDE["mass"]
            + gravity_north * north
            + gravity_down * down
            - 2 * np.cross(earth, x[3:6]),
            0.5
            * np.array(
                [
                    a * p + c * r - d * q,
                    a * q + d * p - b * r,
                    a * r + b * q - c * p,
                    -b * p - c * q - d * r,
                ]
            ),
            np.linalg.solve(inertia, moment - np.cross(omega, inertia @ omega)),
            actuators(AEROSONDE, x[13:], command),
        ]

    changes = np.r_[
        0, np.flatnonzero(np.any(np.diff(commands, axis=0) != 0, axis=1)) + 1, len(commands)
    ]
    for first, last in zip(changes[:-1], changes[1:]):
        x = solve_ivp(
            rates,
            (first * 0.01, last * 0.01),
            x,
            "DOP853",
            rtol=1e-8,
            atol=1e-9,
            args=(commands[first],),
        ).y[:, -1]
    end = respond(AEROSONDE, start, np.repeat(commands, 4, axis=0), 0.0025)[0][-1]
    n, e, d = pymap3d.ecef2ned(*(begin + x[:3]), *end[:3], deg=False)
    turn = Rotation.from_matrix(axes(*end[:2])) * Rotation.from_quat(np.roll(end[6:10], -1))
    assert (
        np.abs([n, e, d]).max() < 3e-6 and np.abs(axes(*end[:2]) @ end[3:6] - x[3:6]).max() < 5e-7
    )
    assert (turn.inv() * Rotation.from_quat(x[6:10])).magnitude() < 5e-8 and np.abs(
        end[10:13] - x[10:13]
    ).max() < 1e-7


@pytest.mark.short
def test_actuators_lag_are_slow_and_stop():
    still = at((0, 0, 0))
    states, _ = respond(AEROSONDE, still, np.tile([-1.0, 0.02, 0, 0.7], (60, 1)), 0.005, "flat")
    t = 0.005 * np.arange(61)
    rate, lag, stop = (
        AEROSONDE["elevator_rate"],
        AEROSONDE["elevator_lag"],
        AEROSONDE["elevator_min"],
    )
    leaves = (-stop - rate * lag) / rate
    want = np.where(
        t < leaves, -rate * t, stop + rate * lag * np.exp(-np.maximum(t - leaves, 0) / lag)
    )
    assert states[:, 13] == pytest.approx(want, abs=1e-12)
    assert states[:, 14] == pytest.approx(
        0.02 * (1 - np.exp(-t / AEROSONDE["aileron_lag"])), abs=1e-12
    )
    ideal = AEROSONDE.replace(elevator_lag=0.0, elevator_rate=1e4)
    assert respond(ideal, still, np.tile([0.1, 0, 0, 0.0], (1, 1)), 0.005, "flat")[0][-1, 13] == 0.1


def test_a_long_step_is_made_of_short_ones():
    start = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN).state
    long, imu = respond(AEROSONDE, start, np.tile(start[13:] + [0.05, 0.1, 0, 0], (5, 1)), 0.04)
    short, parts = respond(
        "aerosonde", start, np.tile(start[13:] + [0.05, 0.1, 0, 0], (20, 1)), 0.01
    )
    # the quaternion is made a unit one at the end only
    np.testing.assert_allclose(long, short[::4], rtol=0, atol=2e-9)
    np.testing.assert_allclose(imu.dv, parts.dv.reshape(5, 4, 3).sum(1), rtol=0, atol=2e-9)


@pytest.mark.short
def test_kernels_read_every_parameter_by_its_name():
    fields = [name for name, *_ in PARAMETERS.fields]
    assert fields[: len(NAMES)] == list(NAMES)
    row = AEROSONDE.parameters()
    assert {name: getattr(row, name) for name in NAMES} == dict(AEROSONDE.values)


@pytest.mark.short
def test_the_flat_earth_is_an_affine_image_and_longitude_wraps():
    origin = (0.5, math.pi - 1e-6, 100.0)
    parameters = AEROSONDE.parameters("flat", origin)
    assert flat_metres(parameters, origin, origin) == pytest.approx([0, 0, 0])
    east = pymap3d.geodetic2ned(0.5 + 1e-5, origin[1] - 1e-5, 90.0, *origin, deg=False)
    assert flat_metres(parameters, origin, (0.5 + 1e-5, origin[1] - 1e-5, 90.0)) == pytest.approx(
        east, abs=2e-3
    )
    state = at((25, 0, 0), (0, 0, math.pi / 2))
    state[:3] = origin
    end = respond(AEROSONDE, state, np.zeros((50, 4)), 0.01)[0][-1]
    assert -math.pi < end[1] < -math.pi + 1e-5


@pytest.mark.short
def test_an_aircraft_and_its_trim_are_read_only_hashable_and_can_be_pickled():
    values = dict(AEROSONDE.values)
    mine = sd.flight.Aircraft("mine", values)
    values["mass"] = -1.0
    assert (
        mine["mass"] == 11.0
        and len({mine, sd.flight.Aircraft("mine", AEROSONDE.values), mine.replace(mass=12.0)}) == 2
    )
    with pytest.raises(TypeError):
        mine.values["mass"] = -1.0
    trim = sd.flight.trim(mine, 25)
    for each in (mine, trim):
        again = pickle.loads(pickle.dumps(each))
        assert again == each and hash(again) == hash(each)
    with pytest.raises(DataError, match="values are None; give a number for each name"):
        sd.flight.Aircraft("mine", None)


BAD = [
    (
        {"mass": -1.0},
        "mass is -1.0 .SI.; it must be a finite number, 0.001 or more and at most 1e[+]06",
    ),
    ({"mass": math.nan}, "mass is nan"),
    ({"mass": "11"}, "mass is '11'"),
    ({"masss": 1.0}, "unknown key 'masss' .did you mean 'mass'?"),
    ({"J_xz": 1.3}, "not positive definite"),
    ({"J_z": 5.0}, "exceeds the sum of the others"),
    ({"elevator_min": 0.5}, "elevator_min .0.5. is not below elevator_max"),
    ({"throttle_max": 1.2}, "keep it between 0 and 1"),
    ({"C_L_alpha": -5.0}, "C_L_alpha is -5.0"),
    ({"elevator_lag": -1.0}, "elevator_lag is -1.0"),
]


@pytest.mark.short
@pytest.mark.parametrize("change, complaint", BAD)
def test_parameters_that_no_aircraft_has_are_named(change, complaint):
    with pytest.raises(DataError, match="aircraft 'aerosonde': .*" + complaint):
        AEROSONDE.replace(**change)


@pytest.mark.short
def test_aircraft_files(tmp_path):
    file = tmp_path / "mine.toml"
    lines = []
    for section, terms in SECTIONS.items():
        lines.append(f"[{section}]")
        for name, unit, *_ in terms:
            value = AEROSONDE[name] * (180 / math.pi if unit.startswith("deg") else 1)
            lines.append(f"{name}{'_' * bool(unit)}{unit} = {value!r}")
    file.write_text("\n".join(lines))
    mine = sd.flight.aircraft(file)
    assert (
        mine.name == "mine"
        and mine.values == pytest.approx(AEROSONDE.values, rel=1e-15)
        and sd.flight.aircraft(mine) is mine
    )
    assert (
        "13.5 kg" in AEROSONDE.source
        and AEROSONDE.table()["elevator_max, deg"] == pytest.approx(25)
        and len(NAMES) == len(AEROSONDE.table())
    )
    for text, complaint in (
        ("\n".join(lines).replace("mass_kg = 11.0\n", ""), "mass is missing"),
        ("[body]\nmass = 1", "unknown key 'mass' .did you mean 'mass_kg'"),
        (
            "\n".join(lines).replace("mass_kg = 11.0", "mass_kg = '11'"),
            "mass_kg is '11'; it must be a finite number",
        ),
        ("body = 1", "write a section"),
        ("[wings]", "unknown key 'wings' .did you mean 'wing'"),
        ("name = 1", "name is 1; it must be text"),
        ("[body", "is not TOML"),
    ):
        file.write_text(text)
        with pytest.raises(DataError, match=complaint):
            sd.flight.aircraft(file)
    with pytest.raises(DataError, match="cannot be read"):
        sd.flight.aircraft(tmp_path / "none.toml")
    with pytest.raises(DataError, match="unknown aircraft 'aerosond' .did you mean 'aerosonde'"):
        sd.flight.aircraft("aerosond")


@pytest.mark.short
@pytest.mark.parametrize(
    "call, complaint",
    [
        (lambda: AEROSONDE["span_m"], "unknown key 'span_m'"),
        (
            lambda: AEROSONDE.parameters("round"),
            "earth is 'round'; it must be one of geodetic, flat",
        ),
        (lambda: AEROSONDE.parameters("flat", (1.6, 0, 0)), "latitude goes to 89 deg"),
        (lambda: AEROSONDE.parameters("flat", (1, 0)), "3 finite numbers: latitude and longitude"),
        (
            lambda: respond(AEROSONDE, at((25, 0, 0)), np.zeros((5, 3)), 0.01),
            r"commands is array.*; it must be n x 4",
        ),
        (
            lambda: respond(AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), 0.0),
            "dt is 0.0 s; it must be a finite number above 0",
        ),
        (
            lambda: respond(AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), 1e6),
            "dt is 1000000.0 s; it must be a finite number above 0 and at most 1",
        ),
        (lambda: respond(AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), "a"), "dt is 'a' s"),
        (
            lambda: respond("aerosond", at((25, 0, 0)), np.zeros((5, 4)), 0.01),
            "did you mean 'aerosonde'",
        ),
        (
            lambda: respond(AEROSONDE, at((25, 0, 0)), [["a"] * 4], 0.01),
            "commands is .*; it must be n x 4 finite numbers",
        ),
        (
            lambda: respond(AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), 0.01, wind=(1, 2, 3)),
            r"wind is .1, 2, 3.; it must be 9",
        ),
        (
            lambda: respond(
                AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), 0.01, wind=np.zeros((4, 9))
            ),
            r"wind is of shape .4, 9.; it must be 5 x 9",
        ),
        (
            lambda: respond(
                AEROSONDE, at((25, 0, 0)), np.zeros((5, 4)), 0.01, wind=[0, math.nan] + 7 * [0]
            ),
            r"wind is .0, nan, .*; it must be 9 finite",
        ),
        (
            lambda: respond(AEROSONDE, np.r_[ORIGIN, 25, np.zeros(13)], np.zeros((5, 4)), 0.01),
            "quaternion of the state, numbers 6 to 9, has length 0",
        ),
        (
            lambda: respond(AEROSONDE, np.zeros(16), np.zeros((5, 4)), 0.01),
            r"state is .*; it must be 17 finite",
        ),
    ],
)
def test_what_cannot_be_flown_is_said(call, complaint):
    with pytest.raises(DataError, match=complaint):
        call()


def test_a_motion_that_does_not_stay_finite_is_said():
    speck = AEROSONDE.replace(J_x=1e-7, J_y=1e-7, J_z=1.5e-7, J_xz=0.0)
    with pytest.raises(
        DataError,
        match="'aerosonde' does not stay finite after 0.* s; take shorter steps or smaller commands",
    ):
        respond(speck, at((25, 0, 2), omega=(1, 1, 1)), np.zeros((50, 4)), 0.01)
