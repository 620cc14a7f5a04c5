"""The autopilot: gains place poles, routes are continuous, and each loop settles on what it is
asked for, flown on the truth."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.compile.records import rows
from strapdown.flight import Loop, World, autopilot as p, fly, linearise, trim
from strapdown.flight.aircraft_model.dynamics import step
from strapdown.flight.aircraft_model.parameters import aircraft
from strapdown.flight.autopilot_gains import gains, make_steering
from strapdown.flight.plan import (
    DEFAULT_PLACE,
    RAD_PER_DEG as DEG,
    FlightPlan,
    flight_plan,
    route,
    straight,
    turning,
)

G = 9.81
CALM = (0.0, 0.0, 0.0)


def parts(airspeed=25.0):
    craft = aircraft("aerosonde")
    steady = trim(craft, airspeed, origin=DEFAULT_PLACE, earth="flat")
    return (
        craft,
        steady,
        linearise(craft, steady),
        gains(craft, steady, linearise(craft, steady), G),
    )


def steered(craft, steady, k, gravity=G):
    """The Steering of an aircraft in trim, without a route, in calm air."""
    parameters = craft.parameters("flat", DEFAULT_PLACE)
    parameters.gravity = gravity
    return make_steering(k, steady, parameters, rows(p.Segment, 0), CALM)


def feedback(craft, steady, k):
    """(4, 8): commands = -K (u v w p q r roll pitch) about a trim, by differences of `hold`
    itself; its turn with the roll is left out."""
    commands = np.zeros(4)

    def answer(rates, pitch, roll, u):
        own = steered(craft, steady, k)
        C = Rotation.from_euler("ZYX", [0.0, steady.pitch + pitch, roll]).as_matrix()
        own.memory[0].height, own.memory[0].airspeed = 500.0, 25.0
        p.hold(own, 500.0, np.array([25.0 + u, 0.0, 0.0]), C, np.array(rates), 0.0, commands)
        return commands.copy()

    steps = [
        (3, ((1e-4, 0, 0), 0, 0, 0)),
        (4, ((0, 1e-4, 0), 0, 0, 0)),
        (5, ((0, 0, 1e-4), 0, 0, 0)),
        (7, ((0, 0, 0), 1e-4, 0, 0)),
        (0, ((0, 0, 0), 0, 0, 1e-4)),
        (6, ((0, 0, 0), 0, 1e-4, 0)),
    ]
    K, still = np.zeros((4, 8)), answer((0, 0, 0), 0.0, 0.0, 0.0)
    for column, change in steps:
        K[:, column] = (still - answer(*change)) / 1e-4
    K[2, 6] = 0.0
    return K


@pytest.mark.short
@pytest.mark.parametrize("airspeed", [20.0, 25.0, 32.0])
def test_inner_loops_damp_every_mode(airspeed):
    """Attitude, yaw and speed loops closed over the eight-state model with the actuators' lags:
    all poles decay, and oscillations are damped by 0.35 or more, what MIL-F-8785C asks of a
    short period (level 1)."""
    craft, steady, modes, k = parts(airspeed)
    K = feedback(craft, steady, k)
    lags = np.diag(
        [1 / craft[f"{control}_lag"] for control in ("elevator", "aileron", "rudder", "throttle")]
    )
    closed = np.block([[modes.A, modes.B], [-lags @ K, -lags]])
    poles = np.linalg.eigvals(closed)
    assert poles.real.max() < -1e-3
    damping = -poles.real / np.abs(poles)
    assert damping[np.abs(poles) > 1.0].min() > 0.35
    # open, something is slower or grows
    assert np.sort(np.linalg.eigvals(modes.A).real)[-1] > poles.real.max()


@pytest.mark.short
@pytest.mark.parametrize("roll", [-45, -15, 30])
def test_turns_are_fed_forward_to_their_trim(roll):
    """At the roll and the rates of a coordinated turn, pitch and elevator of the autopilot are
    those of the full model trimmed in that turn, to 8 %."""
    craft, steady, _, k = parts()
    turned = trim(
        craft, 25.0, radius=25.0**2 / G / math.tan(roll * DEG), origin=DEFAULT_PLACE, earth="flat"
    )
    own, commands = steered(craft, steady, k), np.zeros(4)
    own.memory[0].roll = turned.roll
    p._surfaces(own, turned.roll, turned.pitch, turned.state[10:13], 25.0, commands)
    assert (
        abs(turned.commands[0] - steady.commands[0]) > 0.01 and turned.pitch - steady.pitch > 1e-3
    )
    assert commands[0] - steady.commands[0] == pytest.approx(
        turned.commands[0] - steady.commands[0], rel=0.08
    )
    assert k.turn_pitch * (1 - math.cos(turned.roll)) == pytest.approx(
        turned.pitch - steady.pitch, rel=0.08
    )
    assert commands[2] == pytest.approx(steady.commands[2], abs=5e-3)


@pytest.mark.short
def test_roll_gain_places_the_pole_of_the_textbook():
    """Beard & McLain (2012), eqs. 5.23, 5.24 from the coefficients: roll'' = -a1 roll' + a2
    aileron."""
    craft, steady, _, k = parts()
    determinant = craft["J_x"] * craft["J_z"] - craft["J_xz"] ** 2
    primed = lambda term: (
        (craft["J_z"] * craft[f"C_l_{term}"] + craft["J_xz"] * craft[f"C_n_{term}"]) / determinant
    )
    pressure = 0.5 * craft["density"] * 25.0**2 * craft["area"] * craft["span"]
    a1, a2 = -pressure * primed("p") * craft["span"] / 50.0, pressure * primed("aileron")
    slow = max(np.roots([1.0, a1 + a2 * k.roll_d, a2 * k.roll_p]).real)
    assert k.course_p == pytest.approx(-slow / 5, rel=1e-3)
    assert k.roll_p == pytest.approx(
        min(craft["aileron_max"] - steady.commands[1], steady.commands[1] - craft["aileron_min"])
        / (45 * DEG)
    )


@pytest.mark.short
def test_an_aircraft_without_elevator_is_refused():
    craft, steady, modes, _ = parts()
    B = modes.B.copy()
    B[:, 0] = 0.0
    with pytest.raises(DataError, match="elevator has no effect in trim at 25 m/s"):
        gains(craft, steady, type(modes)(modes.A, B, modes.modes), G)


@pytest.mark.short
def test_an_aileron_at_its_stop_is_refused():
    craft, steady, modes, _ = parts()
    stuck = craft.replace(aileron_max=float(steady.commands[1]))
    with pytest.raises(DataError, match="in trim at 25 m/s the aileron stands at its stop"):
        gains(stuck, steady, modes, G)


@pytest.mark.short
@pytest.mark.parametrize("asked", [30 * DEG, -45 * DEG])
def test_roll_follows_a_step(asked):
    """Surfaces alone, in the compiled aircraft: 90 % within two time constants and the
    actuator's lag, at most 5 % over, steady error below 2 deg (there is no integral here)."""
    craft, steady, _, k = parts()
    parameters = craft.parameters("flat", DEFAULT_PLACE)
    own = steered(craft, steady, k, parameters.gravity)
    state, commands, u = steady.state.copy(), steady.commands.copy(), np.zeros(6)
    advance, surfaces, rolls = step, p._surfaces, []
    own.memory[0].roll = asked
    for _ in range(300):
        a, b, c, d = state[6:10]
        roll, pitch = (
            math.atan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c)),
            math.asin(2 * (a * c - b * d)),
        )
        surfaces(own, roll, pitch, state[10:13], 25.0, commands)
        advance(parameters, state, commands, np.zeros(9), 0.01, u)
        rolls.append(roll / asked)
    rise = 0.01 * np.argmax(np.array(rolls) > 0.9)
    assert 0.3 < rise < 2.3 / (5 * k.course_p) + 0.3
    assert max(rolls) < 1.05 and abs(rolls[-1] - 1) * abs(asked) < 2 * DEG


def settled(flight, column, target, tolerance):
    """s after which a column of the log stays within `tolerance` of `target`."""
    outside = np.flatnonzero(np.abs(flight.log[column] - target) > tolerance)
    return 0.0 if not len(outside) else float(flight.log["t, s"][outside[-1]])


def test_height_follows_a_step():
    flight = fly(straight(higher=10.0, faster=0.0), duration=30.0, loop=Loop(feedback="truth"))
    assert settled(flight, "above route, m", 0.0, 0.5) < 10.0
    assert flight.log["above route, m"].max() < 1.5 and abs(flight.log["above route, m"][-1]) < 0.1


def test_integral_does_not_wind_up_over_a_long_climb():
    flight = fly(straight(higher=60.0, faster=0.0), duration=45.0, loop=Loop(feedback="truth"))
    assert flight.log["above route, m"].max() < 2.5
    assert settled(flight, "above route, m", 0.0, 1.0) < 32.0
    climb = np.diff(flight.log["above route, m"][300:1500]).mean() * 100
    # the climb that the saturated zone allows
    assert climb == pytest.approx(25.0 * math.sin(8 * DEG), rel=0.2)


@pytest.mark.parametrize("faster", [2.0, -3.0])
def test_airspeed_follows_a_step(faster):
    flight = fly(straight(higher=0.0, faster=faster), duration=20.0, loop=Loop(feedback="truth"))
    assert settled(flight, "airspeed, m/s", 25.0 + faster, 0.05 * abs(faster)) < 8.0
    error = (flight.log["airspeed, m/s"] - 25.0 - faster) / faster
    assert error.max() < 0.1 and abs(error[-1]) < 0.02
    assert np.abs(flight.log["above route, m"]).max() < 3.0


def test_course_and_line_follow_a_step_aside():
    flight = fly(
        FlightPlan("aside", ((0.0, 50.0, 0.0), (1e4, 50.0, 0.0))),
        duration=30.0,
        loop=Loop(feedback="truth"),
    )
    right = flight.log["right of route, m"]
    assert right[0] == pytest.approx(-50.0, abs=0.5) and right.max() < 1.0 and abs(right[-1]) < 2.5
    assert settled(flight, "right of route, m", 0.0, 5.0) < 12.0
    assert np.abs(flight.log["commanded roll, rad"]).max() <= 45 * DEG + 1e-12


@pytest.mark.parametrize(
    "wind, track, height", [(CALM, 3.0, 3.5), ((6.0, -4.0, 0.0), 4.0, 5.0)], ids=["calm", "wind"]
)
def test_waypoints_are_passed(wind, track, height):
    """On the truth the aircraft stays within `track` of its route, and so passes each waypoint
    at the arc's distance from the corner."""
    flight = fly("turning", duration=200.0, world=World(wind=wind), loop=Loop(feedback="truth"))
    assert (
        np.abs(flight.log["right of route, m"]).max() < track
        and np.abs(flight.log["above route, m"]).max() < height
    )
    assert np.abs(flight.log["sideslip, rad"]).max() < 3 * DEG
    north, east = places(flight).T
    waypoints, segment = np.array(flight.plan.waypoints)[:, :2], np.r_[0, flight.log["segment"]]
    legs = np.diff(waypoints, axis=0)
    corners = waypoints[1:-1][np.abs(legs[1:] - legs[:-1]).max(axis=1) > 1.0]
    arcs = np.flatnonzero(flight.route.is_arc)
    assert len(arcs) == len(corners) and segment.max() > 12
    for row, (n, e) in list(zip(arcs, corners))[:6]:
        cut = abs(flight.route[row].radius) * (math.sqrt(2) - 1)  # of a right angle
        assert abs(np.hypot(north - n, east - e)[segment == row].min() - cut) < track
    stops = 25 * DEG
    for column in ("elevator command, rad", "aileron command, rad", "rudder command, rad"):
        assert np.abs(flight.log[column]).max() <= stops + 1e-12
    assert flight.log["throttle command"].min() >= 0 and flight.log["throttle command"].max() <= 1


def places(flight):
    """(n, 2) true metres north and east of the plan's place, by radii of the ellipsoid written
    out here."""
    lat, lon, h = DEFAULT_PLACE
    x = 1 - 0.0066943799901413165 * math.sin(lat) ** 2
    R_N = 6378137.0 / math.sqrt(x)
    R_M = R_N * (1 - 0.0066943799901413165) / x
    lla = flight.recording.reference.lla
    return np.c_[(lla[:, 0] - lat) * (R_M + h), (lla[:, 1] - lon) * (R_N + h) * math.cos(lat)]


@pytest.mark.short
@pytest.mark.parametrize(
    "plan",
    [
        turning(),
        FlightPlan(
            "bent",
            ((0, 0, 0), (500, 40, 20), (900, 700, 60), (300, 1400, 0), (-400, 900, 30)),
            (22.0, 25, 28, 24),
        ),
    ],
    ids=lambda plan: plan.name,
)
def test_routes_are_continuous(plan):
    """Where a segment ends the next one begins: same place, course and height; arcs have the
    radius that bank and ground speed give."""
    table, seconds = route(plan, (3.0, 4.0, 0.0), G)
    deviation, height_along = p.deviation, p.height_along
    for row, after in zip(table, table[1:]):
        end = row.to_north, row.to_east
        right, along, course = deviation(row, *end)
        begin, start, next_course = deviation(after, *end)
        assert (
            abs(right) < 1e-9
            and abs(begin) < 1e-9
            and abs(start) < 1e-9
            and along == pytest.approx(row.length)
        )
        assert math.remainder(course - next_course, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
        assert height_along(row, along) == pytest.approx(height_along(after, 0.0))
    arcs, before = table[table.is_arc == 1], table[np.flatnonzero(table.is_arc) - 1]
    speeds = np.maximum(arcs.airspeed, before.airspeed) + 5.0
    assert np.abs(arcs.radius) == pytest.approx(speeds**2 / (G * math.tan(30 * DEG)))
    assert seconds == pytest.approx((table.length / table.airspeed).sum())
    first, last = table[0], table[-1]
    for (n, e, up), row in zip(
        plan.waypoints[:1] + plan.waypoints[-1:],
        (
            [first.north, first.east, first.height],
            [last.to_north, last.to_east, height_along(last, 1e9)],
        ),
    ):
        assert np.allclose(row, (n, e, up + DEFAULT_PLACE[2]))


@pytest.mark.short
def test_deviation_has_the_signs_of_right_and_along():
    line, arc = rows(p.Segment, 2)
    line.along_north, line.length = 1.0, 100.0
    assert p.deviation(line, 30.0, 5.0) == pytest.approx((5.0, 30.0, 0.0))
    # clockwise from the origin, northwards
    arc.is_arc, arc.east, arc.radius, arc.angle, arc.length = 1, 50.0, 50.0, -math.pi / 2, 100.0
    assert p.deviation(arc, 0.0, 2.0) == pytest.approx((2.0, 0.0, 0.0))
    right, along, course = p.deviation(arc, 53.0, 50.0)
    assert (right, along, course) == pytest.approx((-3.0, 25 * math.pi, math.pi / 2))


BAD_PLANS = {
    "waypoints must be two or more": dict(waypoints=((0, 0, 0),)),
    "must be n x 3 finite numbers": dict(waypoints=((0, 0, 0), (1, "x", 0))),
    "waypoints 1 and 2 are at one place": dict(waypoints=((0, 0, 0), (500, 0, 0), (500, 0, 10))),
    "3 airspeeds for 1 legs": dict(airspeed=(20, 21, 22)),
    "airspeed is -1.0 m/s": dict(airspeed=-1.0),
    "bank, 5 to 60 deg, is 1.39": dict(bank=80 * DEG),
    "up to 89 deg north or south": dict(place=(1.57, 0.0, 0.0)),
    "duration is -3 s": dict(duration=-3),
}


@pytest.mark.short
@pytest.mark.parametrize("text", BAD_PLANS)
def test_bad_plans_are_refused(text):
    with pytest.raises(DataError, match=text):
        FlightPlan("bad", **{"waypoints": ((0, 0, 0), (500, 0, 0))} | BAD_PLANS[text])


@pytest.mark.short
@pytest.mark.parametrize(
    "text, plan, wind",
    [
        (
            "the course turns by 180 deg",
            FlightPlan("back", ((0, 0, 0), (500, 0, 0), (0, 0, 0))),
            CALM,
        ),
        (
            "waypoint 1 to 2 is 100 m long, and its turns need",
            FlightPlan("short", ((0, 0, 0), (500, 0, 0), (500, 100, 0), (900, 100, 0))),
            CALM,
        ),
        ("leaves an airspeed of 25 m/s no way against it", straight(faster=0.0), (0.0, 24.0, 0.0)),
    ],
)
def test_routes_that_cannot_be_flown_are_refused(text, plan, wind):
    with pytest.raises(DataError, match=text):
        route(plan, wind, G)


@pytest.mark.short
def test_unknown_plans_are_refused():
    with pytest.raises(DataError, match="unknown plan 'strait' .did you mean 'straight'.*turning"):
        flight_plan("strait")
