"""The autopilot: a route of lines and arcs is followed, and roll, course, pitch, height, airspeed
and yaw are held, by successive loop closure.

Kernel helpers; what they fly by is whatever they are given, estimate or truth. The gains come from
`autopilot_gains.py`, the route from `flight_plan.py`. Source: Beard & McLain (2012), "Small
Unmanned Aircraft", chapters 6 (autopilot) and 10 (straight lines and orbits).
"""

import math

from ..core.compile.jit import helper, inlined
from ..core.mathematics.rotation import wrap
from ..typing import Array

(
    ROLL_P,
    ROLL_D,
    COURSE_P,
    COURSE_I,
    COURSE_ZONE,
    PITCH_P,
    PITCH_D,
    HEIGHT_P,
    HEIGHT_I,
    HEIGHT_ZONE,
    SPEED_P,
    SPEED_I,
    YAW_D,
    TURN_PITCH,
    TURN_ELEVATOR,
    ROLL_MOST,
    PITCH_MOST,
    LINE,
    NORTH_SCALE,
    EAST_SCALE,
    ORIGIN_LAT,
    ORIGIN_LON,
    GRAVITY,
    TRIM_PITCH,
    TRIM,
    LOW,
    HIGH,
) = (*range(25), 28, 32)
"""Numbers of the autopilot: gains and limits (SI, rad), metres per rad north and east of the
route's origin and its place (rad), gravity, the trim's pitch, then the trim's elevator, aileron,
rudder and throttle, their least and their largest values, four each."""
PILOT_SIZE = 36
(
    SEGMENT,
    COURSE_SUM,
    HEIGHT_SUM,
    SPEED_SUM,
    COURSE,
    ROLL,
    PITCH,
    HEIGHT,
    AIRSPEED,
    TURN,
    SLOPE,
    MEMORY_SIZE,
) = range(12)
"""What it remembers: row of the route, three integrals (rad s, m s, m); and what it last asked
for: course, roll and pitch (rad), height (m), airspeed (m/s), roll of the turn that the route
itself makes (rad), slope of the route (rise over run)."""
(
    KIND,
    FROM_N,
    FROM_E,
    FROM_H,
    ALONG_N,
    ALONG_E,
    LENGTH,
    RISE,
    SPEED,
    RADIUS,
    TO_N,
    TO_E,
    ANGLE,
    ROUTE_WIDTH,
) = range(14)
"""Columns of a route, a row per segment: kind; where it begins (north, east in m of the origin,
height in m above the ellipsoid); of an arc its centre and the height where it begins; its
direction (of an arc the one at its end); length, m; rise over run; airspeed, m/s; of an arc:
radius, m, above zero clockwise, where it ends, and the direction from the centre to its begin,
rad."""
LINE_KIND, ARC_KIND = 0.0, 1.0
LEAST_SPEED = 1.0  # m/s: below it speeds are taken as this where something is divided by them


@helper
def steer(
    pilot: Array,
    memory: Array,
    route: Array,
    lla: Array,
    v: Array,
    C: Array,
    omega: Array,
    wind: Array,
    dt: float,
    commands: Array,
) -> None:
    """commands[0:4] (elevator, aileron, rudder in rad, throttle) for a position (rad, rad, m),
    velocity (m/s, NED), attitude C_nb and body rates (rad/s), in the steady wind (m/s, NED) that
    the autopilot is told; `memory` goes on by dt (s)."""
    north, east = metres(pilot, lla)
    _track(pilot, memory, route, north, east, v)
    hold(pilot, memory, lla[2], v, C, omega, wind, dt, commands)


@inlined
def metres(pilot: Array, lla: Array) -> tuple[float, float]:
    """(north, east) of the route's origin, m: the affine map with the radii there."""
    return (lla[0] - pilot[ORIGIN_LAT]) * pilot[NORTH_SCALE], wrap(
        lla[1] - pilot[ORIGIN_LON]
    ) * pilot[EAST_SCALE]


@helper
def deviation(segment: Array, north: float, east: float) -> tuple[float, float, float]:
    """(metres right of a segment of the route, metres along it, course of the route there in
    rad)."""
    n, e = north - segment[FROM_N], east - segment[FROM_E]
    if segment[KIND] == LINE_KIND:
        north, east = segment[ALONG_N], segment[ALONG_E]
        return north * e - east * n, north * n + east * e, math.atan2(east, north)
    radius = segment[RADIUS]
    turn = math.copysign(1.0, radius)
    angle = math.atan2(e, n)
    return (
        turn * (abs(radius) - math.sqrt(n * n + e * e)),
        radius * wrap(angle - segment[ANGLE]),
        wrap(angle + turn * 0.5 * math.pi),
    )


@helper
def height_along(segment: Array, along: float) -> float:
    """Height of a segment, m, so many metres along it; level before and beyond."""
    return segment[FROM_H] + segment[RISE] * min(max(along, 0.0), segment[LENGTH])


@helper
def _track(pilot: Array, memory: Array, route: Array, north: float, east: float, v: Array) -> None:
    """Course, height, airspeed and roll of the turn that the route asks for here; goes on to the
    next segment at the end of one."""
    row = int(memory[SEGMENT])
    while row < route.shape[0] - 1:
        segment = route[row]
        n, e = segment[TO_N] - north, segment[TO_E] - east
        if segment[ALONG_N] * n + segment[ALONG_E] * e > 0:
            break
        row += 1
    memory[SEGMENT] = row
    segment = route[row]
    right, along, course = deviation(segment, north, east)
    speed = max(math.sqrt(v[0] * v[0] + v[1] * v[1]), LEAST_SPEED)
    memory[TURN] = 0.0
    memory[COURSE] = course - math.atan(pilot[LINE] / speed * right)
    if segment[KIND] != LINE_KIND:
        memory[TURN] = math.atan(speed * speed / (pilot[GRAVITY] * segment[RADIUS]))
    memory[HEIGHT], memory[AIRSPEED] = height_along(segment, along), segment[SPEED]
    memory[SLOPE] = segment[RISE] if 0 < along < segment[LENGTH] else 0.0


@helper
def hold(
    pilot: Array,
    memory: Array,
    height: float,
    v: Array,
    C: Array,
    omega: Array,
    wind: Array,
    dt: float,
    commands: Array,
) -> None:
    """commands[0:4] that bring course, height and airspeed to memory[COURSE], [HEIGHT] and
    [AIRSPEED]."""
    roll, pitch = math.atan2(C[2, 1], C[2, 2]), math.asin(min(1.0, max(-1.0, -C[2, 0])))
    n, e, d = v[0] - wind[0], v[1] - wind[1], v[2] - wind[2]
    airspeed, ground = math.sqrt(n * n + e * e + d * d), math.sqrt(v[0] * v[0] + v[1] * v[1])
    error = wrap(memory[COURSE] - math.atan2(v[1], v[0]))
    # the course turns by g/V rad/s per rad of roll
    scale = max(ground, LEAST_SPEED) / pilot[GRAVITY]
    asked = memory[TURN] + scale * (pilot[COURSE_P] * error + pilot[COURSE_I] * memory[COURSE_SUM])
    memory[ROLL] = _limited(
        memory,
        COURSE_SUM,
        asked,
        error,
        abs(error) < pilot[COURSE_ZONE],
        -pilot[ROLL_MOST],
        pilot[ROLL_MOST],
        dt,
    )
    wrong = memory[HEIGHT] - height
    near = min(max(wrong, -pilot[HEIGHT_ZONE]), pilot[HEIGHT_ZONE])
    asked = (
        math.atan(memory[SLOPE] * ground / max(airspeed, LEAST_SPEED))
        + pilot[HEIGHT_P] * near
        + pilot[HEIGHT_I] * memory[HEIGHT_SUM]
    )
    memory[PITCH] = _limited(
        memory, HEIGHT_SUM, asked, wrong, near == wrong, -pilot[PITCH_MOST], pilot[PITCH_MOST], dt
    )
    _surfaces(pilot, memory, roll, pitch, omega, max(airspeed, LEAST_SPEED), commands)
    slow = memory[AIRSPEED] - airspeed
    asked = pilot[TRIM + 3] + pilot[SPEED_P] * slow + pilot[SPEED_I] * memory[SPEED_SUM]
    commands[3] = _limited(
        memory, SPEED_SUM, asked, slow, True, pilot[LOW + 3], pilot[HIGH + 3], dt
    )


@helper
def _limited(
    memory: Array,
    i: int,
    asked: float,
    error: float,
    near: bool,
    low: float,
    high: float,
    dt: float,
) -> float:
    """`asked` within its limits; the integral goes on unless the error is far, or would drive
    `asked` further beyond a limit."""
    if near and not (asked > high and error > 0 or asked < low and error < 0):
        memory[i] += error * dt
    return min(max(asked, low), high)


@helper
def _surfaces(
    pilot: Array,
    memory: Array,
    roll: float,
    pitch: float,
    omega: Array,
    airspeed: float,
    commands: Array,
) -> None:
    """Elevator, aileron and rudder for memory[ROLL] and [PITCH]; rates are damped about those of
    a coordinated turn at this roll."""
    bank = min(max(roll, -pilot[ROLL_MOST]), pilot[ROLL_MOST])
    sine, cosine = math.sin(bank), math.cos(bank)
    turn = pilot[GRAVITY] * sine / airspeed
    load = 1 / cosine - 1
    commands[0] = (
        pilot[TRIM]
        + pilot[PITCH_P]
        * (pilot[TRIM_PITCH] + memory[PITCH] + pilot[TURN_PITCH] * (1 - cosine) - pitch)
        - pilot[PITCH_D] * (omega[1] - turn * sine / cosine)
        + pilot[TURN_ELEVATOR] * load
    )
    commands[1] = pilot[TRIM + 1] + pilot[ROLL_P] * (memory[ROLL] - roll) - pilot[ROLL_D] * omega[0]
    commands[2] = pilot[TRIM + 2] - pilot[YAW_D] * (omega[2] - turn)
    for i in range(3):
        commands[i] = min(max(commands[i], pilot[LOW + i]), pilot[HIGH + i])
