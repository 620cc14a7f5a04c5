"""The autopilot: a route of lines and arcs is followed, and roll, course, pitch, height, airspeed
and yaw are held, by successive loop closure.

Kernel helpers; what they fly by is whatever they are given, estimate or truth. The gains come from
`autopilot_gains.py`, the route from `plan.py`. Source: Beard & McLain (2012), "Small
Unmanned Aircraft", chapters 6 (autopilot) and 10 (straight lines and orbits).
"""

import math
from typing import Annotated, NamedTuple

from ..core.compile.jit import helper, inline
from ..core.compile.records import Table, rows_of
from ..core.compile.signatures import reals, record
from ..core.mathematics.rotation import wrap
from ..typing import Array

MIN_SPEED = 1.0  # m/s: below it speeds are taken as this where something is divided by them


class Gains(NamedTuple):
    """Gains of the loops, SI and radians; signs are those of the controls' effects."""

    roll_p: float  # aileron per rad of roll
    roll_d: float  # aileron per rad/s
    course_p: float  # rad/s of course per rad
    course_i: float  # 1/s^2
    pitch_p: float  # elevator per rad of pitch
    pitch_d: float  # elevator per rad/s
    height_p: float  # rad of climb per m
    height_i: float  # rad of climb per m s
    airspeed_p: float  # throttle per m/s
    airspeed_i: float  # throttle per m
    yaw_d: float  # rudder per rad/s beside the rate of a coordinated turn
    line: float  # 1/s: how fast a line is approached
    turn_pitch: float  # rad of pitch per (1 - cos roll)
    turn_elevator: float  # rad of elevator per (1/cos roll - 1)


class Pilot:
    """Constants of the autopilot: limits and trim of its aircraft, and the place."""

    max_roll: float  # rad
    max_pitch: float  # rad
    # errors beyond which the integrals are frozen, rad and m
    course_zone: float
    height_zone: float
    # metres per rad north and east of the route's origin, and its place, rad
    north_scale: float
    east_scale: float
    origin_lat: float
    origin_lon: float
    gravity: float  # m/s^2
    trim_pitch: float  # rad
    # elevator, aileron, rudder and throttle in trim, their least and their largest values
    trim: Annotated[Array, 4]
    low: Annotated[Array, 4]
    high: Annotated[Array, 4]


class AutopilotMemory:
    """The autopilot's own state between steps."""

    segment: int  # row of the route
    # integrals of errors, rad s, m s, m
    course_sum: float
    height_sum: float
    speed_sum: float
    # what it last asked for, rad, m and m/s
    course: float
    roll: float
    pitch: float
    height: float
    airspeed: float
    turn: float  # roll of the turn that the route itself makes, rad
    slope: float  # of the route, rise over run


class Segment:
    """A line or an arc of a route."""

    is_arc: int  # 1: an arc, 0: a line
    # where it begins, m of the origin; of an arc its centre
    north: float
    east: float
    height: float  # m above the ellipsoid, where it begins
    # its direction; of an arc the one at its end
    along_north: float
    along_east: float
    length: float  # m
    rise: float  # over run
    airspeed: float  # m/s
    radius: float  # of an arc, m, above zero clockwise
    # where it ends, m of the origin
    to_north: float
    to_east: float
    angle: float  # of an arc: direction from the centre to its begin, rad


class Steering(NamedTuple):
    """The autopilot on its route."""

    gains: Table[Gains]  # one row
    pilot: Table[Pilot]  # one row
    memory: Table[AutopilotMemory]  # one row
    route: Table[Segment]
    wind: Array  # (3,) m/s NED: the steady wind that it knows


STEERING = record(
    Steering,
    gains=rows_of(Gains, 1),
    pilot=rows_of(Pilot, 1),
    memory=rows_of(AutopilotMemory, 1),
    route=rows_of(Segment, "legs"),
    wind=reals(3),
)


@helper
def steer(
    steering: Steering, lla: Array, v: Array, C: Array, omega: Array, dt: float, commands: Array
) -> None:
    """commands[0:4] (elevator, aileron, rudder in rad, throttle) for a position (rad, rad, m),
    velocity (m/s, NED), attitude C_nb and body rates (rad/s), in the steady wind that the
    autopilot knows; its memory advances by dt (s)."""
    _track(steering, lla, v)
    hold(steering, lla[2], v, C, omega, dt, commands)


@inline
def metres(pilot: Pilot, lla: Array) -> tuple[float, float]:
    """(north, east) of the route's origin, m: the affine map with the radii there."""
    return (lla[0] - pilot.origin_lat) * pilot.north_scale, wrap(
        lla[1] - pilot.origin_lon
    ) * pilot.east_scale


@helper
def deviation(segment: Segment, north: float, east: float) -> tuple[float, float, float]:
    """(metres right of a segment of the route, metres along it, course of the route there in
    rad)."""
    n, e = north - segment.north, east - segment.east
    if segment.is_arc == 0:
        north, east = segment.along_north, segment.along_east
        return north * e - east * n, north * n + east * e, math.atan2(east, north)
    radius = segment.radius
    turn = math.copysign(1.0, radius)
    angle = math.atan2(e, n)
    return (
        turn * (abs(radius) - math.sqrt(n * n + e * e)),
        radius * wrap(angle - segment.angle),
        wrap(angle + turn * 0.5 * math.pi),
    )


@helper
def height_along(segment: Segment, along: float) -> float:
    """Height of a segment, m, at `along`, m, along it; level before and beyond."""
    return segment.height + segment.rise * min(max(along, 0.0), segment.length)


@helper
def _track(steering: Steering, lla: Array, v: Array) -> None:
    """Course, height, airspeed and roll of the turn that the route asks for here; goes on to the
    next segment at the end of one."""
    memory, route, pilot = steering.memory[0], steering.route, steering.pilot[0]
    north, east = metres(pilot, lla)
    while memory.segment < len(route) - 1:
        segment = route[memory.segment]
        n, e = segment.to_north - north, segment.to_east - east
        if segment.along_north * n + segment.along_east * e > 0:
            break
        memory.segment += 1
    segment = route[memory.segment]
    right, along, course = deviation(segment, north, east)
    speed = max(math.sqrt(v[0] * v[0] + v[1] * v[1]), MIN_SPEED)
    memory.turn = 0.0
    memory.course = course - math.atan(steering.gains[0].line / speed * right)
    if segment.is_arc == 1:
        memory.turn = math.atan(speed * speed / (pilot.gravity * segment.radius))
    memory.height, memory.airspeed = height_along(segment, along), segment.airspeed
    memory.slope = segment.rise if 0 < along < segment.length else 0.0


@helper
def hold(
    steering: Steering, height: float, v: Array, C: Array, omega: Array, dt: float, commands: Array
) -> None:
    """commands[0:4] that bring course, height and airspeed to those of the memory."""
    gains, pilot, memory = steering.gains[0], steering.pilot[0], steering.memory[0]
    roll, pitch = math.atan2(C[2, 1], C[2, 2]), math.asin(min(1.0, max(-1.0, -C[2, 0])))
    n, e, d = v[0] - steering.wind[0], v[1] - steering.wind[1], v[2] - steering.wind[2]
    airspeed, ground = math.sqrt(n * n + e * e + d * d), math.sqrt(v[0] * v[0] + v[1] * v[1])
    error, most = wrap(memory.course - math.atan2(v[1], v[0])), pilot.max_roll
    # the course turns by g/V rad/s per rad of roll
    scale = max(ground, MIN_SPEED) / pilot.gravity
    asked = memory.turn + scale * (gains.course_p * error + gains.course_i * memory.course_sum)
    if abs(error) < pilot.course_zone:
        memory.course_sum = _integrate_error(memory.course_sum, error, asked, -most, most, dt)
    memory.roll = min(max(asked, -most), most)
    error, most = memory.height - height, pilot.max_pitch
    near = min(max(error, -pilot.height_zone), pilot.height_zone)
    asked = (
        math.atan(memory.slope * ground / max(airspeed, MIN_SPEED))
        + gains.height_p * near
        + gains.height_i * memory.height_sum
    )
    if near == error:
        memory.height_sum = _integrate_error(memory.height_sum, error, asked, -most, most, dt)
    memory.pitch = min(max(asked, -most), most)
    _surfaces(steering, roll, pitch, omega, max(airspeed, MIN_SPEED), commands)
    error, low, high = memory.airspeed - airspeed, pilot.low[3], pilot.high[3]
    asked = pilot.trim[3] + gains.airspeed_p * error + gains.airspeed_i * memory.speed_sum
    memory.speed_sum = _integrate_error(memory.speed_sum, error, asked, low, high, dt)
    commands[3] = min(max(asked, low), high)


@helper
def _integrate_error(
    total: float, error: float, asked: float, low: float, high: float, dt: float
) -> float:
    """The integral `total` of an error after dt: it stands still where the error would drive
    `asked` further beyond a limit."""
    if asked > high and error > 0 or asked < low and error < 0:
        return total
    return total + error * dt


@helper
def _surfaces(
    steering: Steering, roll: float, pitch: float, omega: Array, airspeed: float, commands: Array
) -> None:
    """Elevator, aileron and rudder for roll and pitch of the memory; rates are damped about those
    of a coordinated turn at this roll."""
    gains, pilot, memory = steering.gains[0], steering.pilot[0], steering.memory[0]
    bank = min(max(roll, -pilot.max_roll), pilot.max_roll)
    sine, cosine = math.sin(bank), math.cos(bank)
    turn = pilot.gravity * sine / airspeed
    load = 1 / cosine - 1
    commands[0] = (
        pilot.trim[0]
        + gains.pitch_p
        * (pilot.trim_pitch + memory.pitch + gains.turn_pitch * (1 - cosine) - pitch)
        - gains.pitch_d * (omega[1] - turn * sine / cosine)
        + gains.turn_elevator * load
    )
    commands[1] = pilot.trim[1] + gains.roll_p * (memory.roll - roll) - gains.roll_d * omega[0]
    commands[2] = pilot.trim[2] - gains.yaw_d * (omega[2] - turn)
    for i in range(3):
        commands[i] = min(max(commands[i], pilot.low[i]), pilot.high[i])
