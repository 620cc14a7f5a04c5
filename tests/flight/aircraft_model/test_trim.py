"""Steady flight and small deviations from it, against the textbook's equations, the flown flight
and closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from textbook_aircraft import CONTROLS, motion

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.compile.records import rows
from strapdown.flight.aircraft_model.dynamics import Loads, evaluate, respond
from strapdown.flight.aircraft_model.modes import (
    MODEL_STATES,
    Mode,
    _name_modes,
    check_step,
    deviation_point,
)
from strapdown.flight.aircraft_model.parameters import flat_metres

AEROSONDE = sd.flight.aircraft("aerosonde")
ORIGIN = (0.7, -1.2, 250.0)
G = AEROSONDE.parameters("flat", ORIGIN).gravity
STEADY = [
    dict(airspeed=25),
    dict(airspeed=25, climb=0.1),
    dict(airspeed=28, climb=-0.12),
    dict(airspeed=25, radius=150.0),
    dict(airspeed=30, radius=-120.0, climb=0.03),
    dict(airspeed=18),
]


def textbook(trim, change=np.zeros(8), controls=np.zeros(4)):
    """x' (u, v, w, p, q, r, roll, pitch) of the textbook's equations at a trim, deviated."""
    x, c = deviation_point(trim)
    u, v, w, p, q, r, roll, pitch = x + change
    rates = motion(
        AEROSONDE,
        np.array([0, 0, 0, u, v, w, roll, pitch, 0, p, q, r]),
        c + controls,
        G,
        AEROSONDE["density"],
    )
    return rates[[3, 4, 5, 9, 10, 11, 6, 7]]


@pytest.mark.short
@pytest.mark.parametrize("asked", STEADY)
def test_a_trim_is_an_equilibrium_of_the_textbook_s_equations(asked):
    trim = sd.flight.trim(AEROSONDE, origin=ORIGIN, earth="flat", **asked)
    assert np.abs(textbook(trim)).max() < 1e-9 and trim.residual < 1e-9
    x, _ = deviation_point(trim)
    roll, pitch, heading = (lambda e: (e[2], e[1], e[0]))(
        Rotation.from_quat(np.roll(trim.state[6:10], -1)).as_euler("ZYX")
    )
    assert (roll, pitch) == pytest.approx((trim.roll, trim.pitch), abs=1e-12)
    body = Rotation.from_quat(np.roll(trim.state[6:10], -1)).inv().apply(trim.state[3:6].copy())
    # no sideslip
    assert body == pytest.approx(x[:3], abs=1e-12) and body[1] == pytest.approx(0, abs=1e-12)
    climb = asked.get("climb", 0.0)
    assert trim.state[3:6] == pytest.approx(
        asked["airspeed"] * np.array([math.cos(climb), 0, -math.sin(climb)]), abs=1e-12
    )


@pytest.mark.short
@pytest.mark.parametrize("asked", STEADY)
def test_on_the_rotating_earth_the_attitude_turns_as_on_the_flat_one(asked):
    turning = []
    for earth in ("flat", "geodetic"):
        rates = np.zeros(19)
        state = sd.flight.trim(AEROSONDE, origin=ORIGIN, course=1.0, earth=earth, **asked).state
        evaluate(AEROSONDE.parameters(earth, ORIGIN), state, np.zeros(9), rates, rows(Loads, 1)[0])
        turning.append(rates[6:10])
    np.testing.assert_allclose(*turning, rtol=0, atol=1e-15)


@pytest.mark.short
def test_level_flight_carries_its_weight_and_a_turn_banks_for_its_radius():
    level, turn = (
        sd.flight.trim("aerosonde", 25, origin=ORIGIN),
        sd.flight.trim("aerosonde", 25, radius=150.0, origin=ORIGIN),
    )
    assert -level.loads.force[2] * math.cos(level.pitch) - level.loads.force[0] * math.sin(
        -level.pitch
    ) == pytest.approx(AEROSONDE["mass"] * G, rel=2e-3)
    # coordinated, but for the side force of the surfaces
    assert math.tan(turn.roll) == pytest.approx(25**2 / (G * 150), rel=0.05)
    assert turn.turn_rate == pytest.approx(25 / 150) and sd.flight.trim(
        "aerosonde", 25, radius=-150.0, origin=ORIGIN
    ).roll == pytest.approx(-turn.roll, abs=0.01)
    assert turn.table()["roll, deg"] == math.degrees(turn.roll) and "turning at 150 m" in repr(turn)


@pytest.mark.parametrize(
    "earth, wind", [("flat", (0, 0, 0)), ("flat", (4.0, -3.0, 0.0)), ("geodetic", (4.0, -3.0, 0.0))]
)
@pytest.mark.parametrize("asked", [STEADY[1], STEADY[3], STEADY[4]])
def test_flown_from_its_trim_an_aircraft_climbs_and_turns_as_asked(asked, earth, wind):
    """20 s. On the flat Earth the flight is steady to 1e-6; over the rotating one Coriolis
    acceleration (4e-3 m/s^2) is not in the balance."""
    trim = sd.flight.trim(AEROSONDE, origin=ORIGIN, course=0.5, wind=wind, earth=earth, **asked)
    states, _ = respond(
        AEROSONDE,
        trim.state,
        np.tile(trim.commands, (2000, 1)),
        0.01,
        earth,
        np.r_[wind, np.zeros(6)],
    )
    t = 0.01 * np.arange(2001)
    through = states[:, 3:6] - wind
    climb, radius, loose = (
        asked.get("climb", 0.0),
        asked.get("radius", math.inf),
        earth == "geodetic",
    )
    course = 0.5 + asked["airspeed"] * math.cos(climb) / radius * t
    want = (
        asked["airspeed"]
        * np.c_[
            math.cos(climb) * np.cos(course),
            math.cos(climb) * np.sin(course),
            np.full(2001, -math.sin(climb)),
        ]
    )
    assert np.abs(through - want).max() < (0.15 if loose else 1e-6)
    if not loose:
        metres = flat_metres(
            AEROSONDE.parameters("flat", ORIGIN), ORIGIN, states[:, :3]
        ) - np.outer(t, wind)
        assert -metres[-1, 2] == pytest.approx(asked["airspeed"] * math.sin(climb) * 20, abs=1e-5)
        if math.isfinite(radius):
            centre = radius * np.array([-math.sin(0.5), math.cos(0.5)])
            assert np.abs(np.hypot(*(metres[:, :2] - centre).T) - abs(radius)).max() < 1e-5


@pytest.mark.short
@pytest.mark.parametrize("asked", STEADY)
def test_the_linear_model_is_the_jacobian_of_the_textbook_s_equations(asked):
    trim = sd.flight.trim(AEROSONDE, origin=ORIGIN, **asked)
    modes = sd.flight.linearise(AEROSONDE, trim)
    A = np.stack(
        [(textbook(trim, h) - textbook(trim, -h)) / 2e-5 for h in 1e-5 * np.eye(8)], axis=1
    )
    B = np.stack(
        [
            (textbook(trim, controls=h) - textbook(trim, controls=-h)) / 2e-5
            for h in 1e-5 * np.eye(4)
        ],
        axis=1,
    )
    assert modes.A == pytest.approx(A, rel=1e-6, abs=2e-5) and modes.B == pytest.approx(
        B, rel=1e-6, abs=2e-5
    )
    assert sorted(
        abs(value) for mode in modes.modes for value in mode.eigenvalues
    ) == pytest.approx(sorted(abs(np.linalg.eigvals(modes.A))))


@pytest.mark.short
def test_modes_are_those_of_a_small_aircraft():
    """Roll subsidence and short period against their approximations (Beard & McLain, 5.6), the
    phugoid against Lanchester's within its crudeness."""
    trim = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN)
    modes = sd.flight.linearise(AEROSONDE, trim)
    assert [mode.name for mode in modes.modes] == [
        "roll",
        "short period",
        "Dutch roll",
        "phugoid",
        "spiral",
    ]
    pressure = 0.5 * AEROSONDE["density"] * 25**2 * AEROSONDE["area"]
    rolling = (
        pressure
        * AEROSONDE["span"] ** 2
        * AEROSONDE["C_l_p"]
        / 50
        * AEROSONDE["J_z"]
        / (AEROSONDE["J_x"] * AEROSONDE["J_z"] - AEROSONDE["J_xz"] ** 2)
    )
    assert modes["roll"].time_constant == pytest.approx(-1 / rolling, rel=0.05)
    A = modes.A[np.ix_([2, 4], [2, 4])]
    assert modes["short period"].frequency == pytest.approx(math.sqrt(np.linalg.det(A)), rel=0.02)
    assert modes["short period"].damping == pytest.approx(
        -np.trace(A) / 2 / math.sqrt(np.linalg.det(A)), rel=0.02
    )
    assert (
        modes["phugoid"].frequency == pytest.approx(math.sqrt(2) * G / 25, rel=0.25)
        and 0 < modes["phugoid"].damping < 0.5
    )
    # a slowly growing spiral
    assert modes["spiral"].time_constant < -5 and modes["Dutch roll"].eigenvalues[0].imag > 0
    assert modes.table()[0]["time constant, s"] == modes["roll"].time_constant
    with pytest.raises(DataError, match="no mode 'spin'; modes: roll, short period"):
        modes["spin"]


@pytest.mark.short
def test_the_modes_of_any_turn_are_all_eigenvalues_in_whole_pairs():
    """Along and across mix in a steep turn, where the half of a pair was once on either side."""
    flown = 0
    for airspeed in (22, 25, 29):
        for radius in (60.0, -70.0, 150.0, math.inf):
            for climb in (-0.05, 0.0, 0.05):
                try:
                    trim = sd.flight.trim(AEROSONDE, airspeed, radius=radius, climb=climb)
                except DataError:
                    continue
                flown += 1
                all_eigenvalues_in_whole_pairs(sd.flight.linearise(AEROSONDE, trim).A)
    assert flown > 20
    assert [
        mode.name
        for mode in sd.flight.linearise(AEROSONDE, sd.flight.trim(AEROSONDE, 29, radius=60)).modes
    ][:2] == ["roll", "short period"]


@pytest.mark.short
@pytest.mark.parametrize("pairs", range(5))
def test_whatever_the_system_its_modes_are_all_eigenvalues_in_whole_pairs(pairs):
    rng = np.random.default_rng(pairs)
    for _ in range(20):
        blocks = np.zeros((8, 8))
        for i in range(8):
            blocks[i, i] = rng.normal(-1, 2)
        for i in range(0, 2 * pairs, 2):
            blocks[i + 1, i + 1], turning = blocks[i, i], rng.uniform(0.1, 5)
            blocks[i, i + 1], blocks[i + 1, i] = turning, -turning
        mixing = rng.normal(size=(8, 8))
        all_eigenvalues_in_whole_pairs(mixing @ blocks @ np.linalg.inv(mixing))


def all_eigenvalues_in_whole_pairs(A):
    modes = _name_modes(A)
    told = np.sort_complex([value for mode in modes for value in mode.eigenvalues])
    np.testing.assert_array_equal(told, np.sort_complex(np.linalg.eigvals(A)).astype(complex))
    assert len({mode.name for mode in modes}) == len(modes)
    for mode in modes:
        first, last = mode.eigenvalues[0], mode.eigenvalues[-1]
        assert first == last.conjugate() and (len(mode.eigenvalues) == 2) == (first.imag != 0)


@pytest.mark.short
def test_a_mode_that_stays_as_it_is_has_no_time_constant():
    still, ringing = Mode("still", (0j,)), Mode("ringing", (2j, -2j))
    assert (still.frequency, still.damping, still.time_constant) == (0, 0, math.inf)
    assert (ringing.frequency, ringing.damping, ringing.time_constant) == (2, 0, math.inf)


@pytest.mark.parametrize(
    "name, seconds",
    [
        ("roll", 0.1),
        ("short period", 0.5),
        ("Dutch roll", 2.0),
        ("phugoid", 12.0),
        ("spiral", 10.0),
    ],
)
def test_a_mode_is_flown_as_its_eigenvalue_says(name, seconds):
    """Deviated along an eigenvector by some 1e-3 of the flight, the flown aircraft follows
    exp(eigenvalue t) within 1 % of the deviation."""
    trim = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, earth="flat")
    modes = sd.flight.linearise(AEROSONDE, trim)
    values, vectors = np.linalg.eig(modes.A)
    value = modes[name].eigenvalues[0]
    vector = vectors[:, np.argmin(abs(values - value))]
    scale = 1e-3 / np.abs(vector / np.r_[25, 25, 25, np.ones(5)]).max()
    x, _ = deviation_point(trim)
    deviated = lambda t: x + scale * np.real(vector * np.exp(value * t))
    begin = deviated(0.0)
    turn = Rotation.from_euler("ZYX", [0, begin[7], begin[6]])
    state = np.r_[
        ORIGIN, turn.apply(begin[:3]), np.roll(turn.as_quat(), 1), begin[3:6], trim.commands
    ]
    end = respond(
        AEROSONDE, state, np.tile(trim.commands, (round(seconds / 0.01), 1)), 0.01, "flat"
    )[0][-1]
    C = Rotation.from_quat(np.roll(end[6:10], -1))
    flown = np.r_[C.inv().apply(end[3:6]), end[10:13], C.as_euler("ZYX")[[2, 1]]]
    assert np.abs((flown - deviated(seconds)) / np.r_[25, 25, 25, np.ones(5)]).max() < 1e-5
    assert np.abs(begin - x).max() > 1e-4


@pytest.mark.short
def test_the_linear_model_answers_a_control_as_the_flight_does():
    trim = sd.flight.trim(AEROSONDE, 25, origin=ORIGIN, earth="flat")
    modes = sd.flight.linearise(AEROSONDE, trim)
    quick = AEROSONDE.replace(
        **{f"{name}_lag": 0.0 for name in CONTROLS}, **{f"{name}_rate": 1e4 for name in CONTROLS}
    )
    change = np.array([-2e-4, 3e-4, 2e-4, 1e-3])
    end = respond(quick, trim.state, np.tile(trim.commands + change, (50, 1)), 0.01, "flat")[0][-1]
    C = Rotation.from_quat(np.roll(end[6:10], -1))
    flown = (
        np.r_[C.inv().apply(end[3:6]), end[10:13], C.as_euler("ZYX")[[2, 1]]]
        - deviation_point(trim)[0]
    )
    block = np.zeros((12, 12))
    block[:8, :8], block[:8, 8:] = modes.A, modes.B
    linear = (expm(0.5 * block) @ np.r_[np.zeros(8), change])[:8]
    assert (
        flown == pytest.approx(linear, rel=0.02, abs=1e-6)
        and MODEL_STATES[3] == "p"
        and flown[3] > 1e-4
        and flown[4] > 1e-4
    )


@pytest.mark.short
def test_the_tables_of_the_page_are_those_of_the_model():
    page = (Path(__file__).resolve().parents[3] / "docs" / "explanation" / "aircraft.md").read_text(
        encoding="utf-8"
    )
    for airspeed in (18, 25, 30):
        told = sd.flight.trim(AEROSONDE, airspeed, origin=(0.8, 0.1, 0.0)).table()
        assert (
            f"| {airspeed} | {told['alpha, deg']:.2f} | {told['elevator, deg']:.2f} | {told['throttle']:.3f} | {told['thrust, N']:.2f} "
            f"| {told['propeller, rpm']:.0f} |"
        ) in page
    # the ends that the page names
    for flies, beyond, control in (
        (17, 16.5, "elevator"),
        (32, 32.5, "throttle"),
    ):
        sd.flight.trim(AEROSONDE, flies, origin=(0.8, 0.1, 0.0))
        with pytest.raises(DataError, match=f"needs {control} .* beyond its stop"):
            sd.flight.trim(AEROSONDE, beyond, origin=(0.8, 0.1, 0.0))
    for row in sd.flight.linearise(
        AEROSONDE, sd.flight.trim(AEROSONDE, 25, origin=(0.8, 0.1, 0.0))
    ).table():
        assert (
            f"| {row['mode']} | {row['frequency, rad/s']:.3f} | {row['damping']:.3f} | {row['time constant, s']:.3f} |"
            in page
        )


@pytest.mark.short
def test_a_step_too_long_for_the_fastest_mode_is_refused():
    trim = sd.flight.trim("aerosonde", 25, origin=ORIGIN)
    check_step(trim, 0.01)
    with pytest.raises(
        DataError,
        match="a time step of 0.05 s is too long .* time constant of 0.0446 s; take 0.0223 s at most",
    ):
        check_step(trim, 0.05)
    for dt in (math.nan, "0.01", None):
        with pytest.raises(
            DataError, match="time step of the aircraft is .* s; it must be a finite number above 0"
        ):
            check_step(trim, dt)
    for call in (lambda: check_step(None, 0.01), lambda: sd.flight.linearise("aerosonde", None)):
        with pytest.raises(DataError, match="None is no Trim; the function trim makes one"):
            call()


@pytest.mark.short
@pytest.mark.parametrize(
    "asked, complaint",
    [
        (
            dict(airspeed=8),
            "cannot be trimmed at 8 m/s, climb 0 deg: at an angle of attack of .* are left over; fly faster",
        ),
        (dict(airspeed=14), "it needs elevator -.* deg, beyond its stop at -25.0 deg; fly faster"),
        (dict(airspeed=45), "it needs throttle 1.* fly slower, climb less"),
        (dict(airspeed=25, climb=0.5), "needs throttle"),
        (dict(airspeed=25, radius=25.0), "climb 0 deg, radius 25 m: .*; fly faster or turn wider"),
        (dict(airspeed=25, climb=-0.9), "descend less steeply"),
        (dict(airspeed=-3), "airspeed is -3 m/s; it must be a finite number above 0"),
        (dict(airspeed=math.nan), "must be a finite number"),
        (dict(airspeed=25, climb=5), "a flight-path angle within 57 deg, is 5 rad"),
        (
            dict(airspeed=0.1),
            "it needs an angle of attack of .* deg, beyond the stall at 26.9 deg; fly faster",
        ),
        (dict(airspeed=25, radius=1), "it needs an angle of attack of .* deg, beyond the stall"),
        (dict(airspeed="fast"), "must be a finite number"),
        (dict(airspeed=25, radius="a"), "radius is .* m; it must be a number"),
        (dict(airspeed=25, climb=None), "must be a finite number"),
        (dict(airspeed=25, radius=math.nan), "radius is .* m; it must be a number"),
        (dict(airspeed=25, wind="abc"), "wind is .*; it must be 3 finite numbers"),
        (dict(airspeed=25, wind=1.0), "wind"),
        (dict(airspeed=25, radius=0), "radius is 0 m; give 1 m or more"),
        (dict(airspeed=25, wind=(1, 2)), "wind is .*; it must be 3 finite numbers"),
        (dict(airspeed=25, origin=(100, 0, 0)), "latitude goes to 89 deg"),
        (dict(airspeed=25, earth="hollow"), "earth is 'hollow'"),
    ],
)
def test_flights_that_cannot_be_are_refused_with_what_stands_against_them(asked, complaint):
    with pytest.raises(DataError, match=complaint):
        sd.flight.trim("aerosonde", **asked)


@pytest.mark.short
def test_without_a_working_motor_that_is_the_cause():
    dead = AEROSONDE.replace(name="dead", voltage=0)
    with pytest.raises(
        DataError, match="at full throttle its propeller gives -.* N, no thrust; check voltage"
    ):
        sd.flight.trim(dead, 25)
