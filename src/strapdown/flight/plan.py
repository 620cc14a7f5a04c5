"""Flight plans: waypoints with heights and airspeeds, and the route of lines and arcs that an
aircraft can follow through them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import DataError, check_array, check_number, did_you_mean, locate_errors
from ..core.compile.records import Table, rows
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..fileio.files import read_toml
from ..fileio.toml_keys import Key, in_unit, list_of, number, read_table, table_reader, text
from ..geometry.geodesy import wrap
from ..typing import Array, File
from .autopilot import Segment

RAD_PER_DEG = math.pi / 180
DEFAULT_PLACE = (47.63 * RAD_PER_DEG, 9.35 * RAD_PER_DEG, 500.0)
"""Where the flights begin that name no place: over Lake Constance, 100 m above the water."""
STRAIGHT_ON = 1 * RAD_PER_DEG  # corners below it need no arc
SHARPEST = 170 * RAD_PER_DEG  # corners above it would need arcs of no end


@dataclass(frozen=True)
class FlightPlan:
    """Waypoints and airspeeds. The aircraft begins at `place`, trimmed level at `start_airspeed`
    along the first leg; the legs' heights and speeds are commanded from the first instant, so a
    first waypoint above the start or another airspeed is a step. SI and radians. Raises
    DataError.

    Attributes
    ----------
    name : str
        Name of the plan.
    waypoints : tuple[tuple[float, float, float], ...]
        ((north, east, up), ...) m from `place`, two or more; the first is where the first
        leg begins.
    airspeed : float or tuple of float
        Airspeed of all legs, or one per leg, m/s.
    start_airspeed : float or None
        Airspeed at the start, m/s; None: that of the first leg.
    place : tuple[float, float, float]
        Latitude rad, longitude rad, ellipsoidal height m, at 0 s.
    clearance : float
        Height of the start above ground, m; a flight that gets there ends.
    bank : float
        Bank of the arcs between legs, rad.
    duration : float or None
        Length, s; None: until the last waypoint. Beyond it the last leg goes on.
    """

    name: str
    waypoints: tuple[tuple[float, float, float], ...]
    airspeed: float | tuple[float, ...] = 25.0
    start_airspeed: float | None = None
    place: tuple[float, float, float] = DEFAULT_PLACE
    clearance: float = 100.0
    bank: float = 30 * RAD_PER_DEG
    duration: float | None = None

    def __post_init__(self) -> None:
        with locate_errors(f"plan {self.name!r}"):
            self._check()

    def _check(self) -> None:
        """Raise DataError for what cannot be flown; settle the types of what can."""
        points = check_array(
            self.waypoints, "waypoints", (None, 3), what="numbers: north, east, up in m"
        )
        if len(points) < 2:
            raise DataError(f"waypoints must be two or more, not {len(points)}")
        lengths = np.hypot(*np.diff(points[:, :2], axis=0).T)
        if not np.all(lengths > 1.0):
            at = int(np.argmin(lengths))
            raise DataError(f"waypoints {at} and {at + 1} are at one place; leave one out")
        if np.ndim(self.airspeed):
            speeds = check_array(self.airspeed, "airspeed", (None,))
            if len(speeds) != len(points) - 1:
                raise DataError(
                    f"{len(speeds)} airspeeds for {len(points) - 1} legs; give one, or one per leg"
                )
            object.__setattr__(self, "airspeed", tuple(speeds.tolist()))
        for value in np.atleast_1d(self.airspeed).tolist():
            check_number(value, "airspeed", "m/s", above=0, below=1000)
        for name, unit, most in (
            ("start_airspeed", "m/s", 1000.0),
            ("clearance", "m", 1000.0),
            ("duration", "s", math.inf),
        ):
            if getattr(self, name) is not None or name == "clearance":
                check_number(getattr(self, name), name, unit, above=0, below=most)
        check_number(
            self.bank, "bank, 5 to 60 deg,", "rad", least=5 * RAD_PER_DEG, most=60 * RAD_PER_DEG
        )
        place = check_array(
            self.place, "place", (3,), what="numbers: latitude and longitude (rad) and height (m)"
        )
        check_number(
            float(place[0]),
            "latitude of the place, up to 89 deg north or south,",
            "rad",
            least=-LATITUDE_LIMIT,
            most=LATITUDE_LIMIT,
        )
        object.__setattr__(self, "waypoints", tuple(map(tuple, points.tolist())))
        object.__setattr__(self, "place", tuple(place.tolist()))

    @property
    def begin_airspeed(self) -> float:
        """Airspeed at 0 s, m/s."""
        return float(
            self.start_airspeed
            if self.start_airspeed is not None
            else np.atleast_1d(self.airspeed)[0]
        )

    @property
    def course(self) -> float:
        """Course of the first leg, rad."""
        (n0, e0, _), (n1, e1, _) = self.waypoints[:2]
        return math.atan2(e1 - e0, n1 - n0)

    def replace(self, **changes: Any) -> "FlightPlan":
        """The same plan with some fields changed."""
        return replace(self, **changes)


def straight(
    higher: float = 10.0,
    faster: float = 2.0,
    airspeed: float = 25.0,
    course: float = 0.0,
    length: float = 10_000.0,
    **fields: Any,
) -> FlightPlan:
    """A level straight flight (course in rad) of an aircraft trimmed at `airspeed` (m/s), asked
    at 0 s to be `higher` (m) and `faster` (m/s)."""
    end = (length * math.cos(course), length * math.sin(course), higher)
    return FlightPlan("straight", ((0.0, 0.0, higher), end), airspeed + faster, airspeed, **fields)


def turning(airspeed: float = 25.0, **fields: Any) -> FlightPlan:
    """Right angles left and right, climbs and descents, for 5 minutes: the first turn after 10
    s."""
    waypoints, up = (
        [(0.0, 0.0, 0.0), (340.0, 0.0, 0.0)],
        (30.0, 30.0, 0.0, 20.0, -20.0, 0.0, 0.0, 40.0),
    )
    for k in range(21):
        north, east, _ = waypoints[-1]
        along = ((0, 1), (1, 0), (0, 1), (-1, 0), (0, -1), (0, -1), (1, 0), (0, -1), (1, 0))[k % 9]
        waypoints.append((north + 450.0 * along[0], east + 450.0 * along[1], up[k % 8]))
    return FlightPlan("turning", tuple(waypoints), airspeed, **fields)


PLANS: dict[str, Callable[[], FlightPlan]] = {"straight": straight, "turning": turning}
"""Plans that ship with the package."""


def _numbers(value: Any, where: str) -> Any:
    """A number, or a list of them or of lists."""
    return list_of(_numbers)(value, where) if isinstance(value, list) else number(value, where)


PLACE_KEYS = {
    "latitude_deg": Key("latitude", in_unit(RAD_PER_DEG), ""),
    "longitude_deg": Key("longitude", in_unit(RAD_PER_DEG), ""),
    "height_m": Key("height", number, ""),
}
KEYS = {
    "name": Key("name", text),
    "place": Key("place", table_reader(lambda **place: tuple(place.values()), PLACE_KEYS)),
    "waypoints_m": Key("waypoints", _numbers, "write [[north, east, up], ...], m from the place"),
    "airspeed_m_s": Key("airspeed", _numbers),
    "start_airspeed_m_s": Key("start_airspeed", number),
    "clearance_m": Key("clearance", number),
    "bank_deg": Key("bank", in_unit(RAD_PER_DEG)),
    "duration_s": Key("duration", number),
}
"""Keys of a plan's file, each with the field that it sets and how it is read."""


def flight_plan(plan: FlightPlan | File) -> FlightPlan:
    """The FlightPlan of a name (`PLANS`) or of a file (ends in .toml or contains a folder); a
    FlightPlan is returned as it is. Raises DataError."""
    if isinstance(plan, FlightPlan):
        return plan
    if isinstance(plan, str) and plan in PLANS:
        return PLANS[plan]()
    if (
        isinstance(plan, Path)
        or isinstance(plan, str)
        and (plan.endswith(".toml") or len(Path(plan).parts) > 1)
    ):
        return read_plan(plan)
    raise DataError(
        f"unknown plan {plan!r}{did_you_mean(str(plan), PLANS)}; there are: {', '.join(PLANS)}; or give "
        f"a FlightPlan or "
        "the path of a .toml file"
    )


def read_plan(path: File) -> FlightPlan:
    """The FlightPlan of a TOML file. Raises DataError naming file, key and remedy."""
    table = read_toml(path, f"give the path of a plan's .toml file, or one of {', '.join(PLANS)}")
    with locate_errors(path):
        return FlightPlan(**{"name": Path(path).stem} | read_table(table, KEYS))


def route(
    plan: FlightPlan, wind: Sequence[float] | Array, gravity: float
) -> tuple[Table[Segment], float]:
    """(Segments of the plan as autopilot.steer takes them; seconds from end to end at the legs'
    airspeeds, wind left out).

    Between legs the aircraft flies an arc that both touch, at the plan's bank at the largest ground
    speed the wind (m/s, NED) allows. Raises DataError where two arcs do not fit on a leg, or where
    the wind is as fast as the aircraft.
    """
    points = np.array(plan.waypoints, float)
    legs = np.diff(points, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    along, speeds = (
        legs[:, :2] / lengths[:, None],
        np.broadcast_to(np.asarray(plan.airspeed, float), len(legs)),
    )
    breeze = math.hypot(*wind[:2])
    if breeze >= 0.9 * min(*speeds, plan.begin_airspeed):
        raise DataError(
            f"plan {plan.name!r}: a wind of {breeze:.3g} m/s leaves an airspeed of "
            f"{min(speeds):.3g} m/s no way against it; "
            "give a faster airspeed or less wind"
        )
    corners = [_corner(plan, i, along, speeds, breeze, gravity) for i in range(len(legs) - 1)]
    cuts = np.array(
        [0.0, *(abs(radius) * math.tan(abs(angle) / 2) for angle, radius in corners), 0.0]
    )
    _check_cuts(plan, lengths, cuts)
    rise, heights, found = legs[:, 2] / lengths, points[:, 2] + plan.place[2], []
    for i in range(len(legs)):
        begin, end = points[i, :2] + cuts[i] * along[i], points[i + 1, :2] - cuts[i + 1] * along[i]
        leg = _segment(
            north=begin[0],
            east=begin[1],
            height=heights[i] + rise[i] * cuts[i],
            along_north=along[i, 0],
            along_east=along[i, 1],
            length=lengths[i] - cuts[i] - cuts[i + 1],
            rise=rise[i],
            airspeed=speeds[i],
            to_north=end[0],
            to_east=end[1],
        )
        found.append(leg)
        if i < len(corners) and cuts[i + 1] > 0:
            arc = _arc(*corners[i], end, along[i])
            low = heights[i + 1] - rise[i] * cuts[i + 1]
            high = heights[i + 1] + rise[i + 1] * cuts[i + 1]
            arc.height, arc.rise, arc.airspeed = low, (high - low) / arc.length, speeds[i + 1]
            arc.along_north, arc.along_east = along[i + 1]
            arc.to_north, arc.to_east = points[i + 1, :2] + cuts[i + 1] * along[i + 1]
            found.append(arc)
    table = rows(Segment, len(found))
    for row, segment in enumerate(found):
        table[row] = segment
    return table, float((table.length / table.airspeed).sum())


def _check_cuts(plan: FlightPlan, lengths: Array, cuts: Array) -> None:
    """Raise DataError where turns need more of a leg than it has."""
    short = lengths - cuts[:-1] - cuts[1:]
    if np.any(short < 0):
        i = int(np.argmin(short))
        raise DataError(
            f"plan {plan.name!r}: the leg from waypoint {i} to {i + 1} is {lengths[i]:.0f} m long, "
            f"and its turns need "
            f"{cuts[i] + cuts[i + 1]:.0f} m; set the waypoints further apart, or give less airspeed "
            f"or more bank"
        )


def _corner(
    plan: FlightPlan, i: int, along: Array, speeds: Array, breeze: float, gravity: float
) -> tuple[float, float]:
    """(angle in rad, clockwise above zero; signed radius in m) of the arc at the end of leg i;
    (0, 0) where it needs none."""
    angle = float(wrap(math.atan2(*along[i + 1, ::-1]) - math.atan2(*along[i, ::-1])))
    if abs(angle) > SHARPEST:
        raise DataError(
            f"plan {plan.name!r}: at waypoint {i + 1} the course turns by "
            f"{abs(angle) / RAD_PER_DEG:.0f} deg; {SHARPEST / RAD_PER_DEG:.0f} are the most: "
            "set a waypoint beside it"
        )
    if abs(angle) < STRAIGHT_ON:
        return 0.0, 0.0
    return angle, math.copysign(
        (max(speeds[i], speeds[i + 1]) + breeze) ** 2 / (gravity * math.tan(plan.bank)), angle
    )


def _segment(**fields: float) -> Segment:
    """A Segment with these fields, the others 0."""
    made: Segment
    (made,) = rows(Segment, 1)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def _arc(angle: float, radius: float, begin: Array, before: Array) -> Segment:
    """The arc from `begin`, where the course is along `before`, but for where it leads and how
    it climbs."""
    centre = begin + radius * np.array([-before[1], before[0]])
    outward = begin - centre
    arc = _segment(is_arc=1, length=abs(angle * radius), radius=radius)
    arc.north, arc.east = centre
    arc.angle = math.atan2(outward[1], outward[0])
    return arc
