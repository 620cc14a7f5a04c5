"""JSBSim (the extra `jsbsim`) as a source of truth: one of its aircraft, flown by its autopilot, as
a Motion for `simulate`."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_array, check_number, did_you_mean, is_number, locate_errors
from ..data.solution import Trajectory
from ..extras import optional_import, remedy
from ..geometry.rotations import Rotation
from ..typing import Array
from .splined import spline_motion
from .trajectory import DEG, Motion

FOOT = 0.3048
"""m."""
STEP_RATE = 200.0
"""Steps of JSBSim per second, 1/s."""
ROW_SPACING = 0.02
"""Interval of the rows of its flights, s: the pieces of the splines."""
MAX_STEP_RATE, MAX_STEPS = 1e5, 1e9
"""Largest number of JSBSim steps per second, 1/s, and per flight; JSBSim itself checks neither."""
HOLDS = {
    "heading": ("ap/heading_hold", "ap/heading_setpoint", 1 / DEG),
    "height": ("ap/altitude_hold", "ap/altitude_setpoint", 1 / FOOT),
}
"""Properties of a JsbsimTarget: JSBSim's switch, its set point, and the set point's unit."""
TRIM_FULL = 1
STATE_PROPERTIES = (
    "position/lat-geod-rad",
    "position/long-gc-rad",
    "position/geod-alt-ft",
    "velocities/v-north-fps",
    "velocities/v-east-fps",
    "velocities/v-down-fps",
    "attitude/phi-rad",
    "attitude/theta-rad",
    "attitude/psi-rad",
)
_ONE = RLock()
STATE_UNITS = np.array([1.0, 1.0, FOOT, FOOT, FOOT, FOOT, 1.0, 1.0, 1.0])


class JsbsimTarget(NamedTuple):
    """Targets that the autopilot holds from a time on; None keeps the earlier one."""

    at: float = 0.0  # s
    heading: float | None = None  # rad, of the nose, clockwise from true north
    height: float | None = None  # m above the ellipsoid
    throttle: float | None = None  # 0 to 1


def jsbsim_motion(
    start: Sequence[float],
    heading: float,
    speed: float,
    duration: float,
    aircraft: str = "c172x",
    targets: Iterable[JsbsimTarget] = (),
    properties: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Motion:
    """Return the Motion of an aircraft that comes with JSBSim, flown by its autopilot: splines
    through the rows of `flown_by_jsbsim`."""
    flown = flown_by_jsbsim(start, heading, speed, duration, aircraft, targets, properties)
    return spline_motion(flown, name or f"{aircraft} of JSBSim")


def flown_by_jsbsim(
    start: Sequence[float],
    heading: float,
    speed: float,
    duration: float,
    aircraft: str = "c172x",
    targets: Iterable[JsbsimTarget] = (),
    properties: Mapping[str, float] | None = None,
    rate: float = STEP_RATE,
    row: float = ROW_SPACING,
) -> Trajectory:
    """Return position, velocity and attitude of a JSBSim flight, every `row` s (whole steps), as
    data.Trajectory.

    It begins in trimmed level flight with the engine running: `start` (latitude rad, longitude rad,
    ellipsoidal height m), `heading` rad, true airspeed `speed` m/s. `targets`: Targets; without one
    heading and height of the start are held. `properties`: JSBSim properties, by name in its own
    units, that are set once before it flies ({"atmosphere/wind-north-fps": 20.0}). `rate`: steps
    per second. The ground is the ellipsoid. Raises DataError: JSBSim missing, unknown aircraft or
    property, no autopilot, no trim, a crash.
    """
    start, targets = (
        _checked_start(start),
        _check_targets(heading, speed, duration, rate, row, targets),
    )
    properties = _checked_properties(properties)
    with session(rate) as (executive, _):
        _load(executive, aircraft)
        missing = [switch for switch, _, _ in HOLDS.values() if not _has(executive, switch)]
        if missing:
            raise DataError(
                f"JSBSim's {aircraft} has no autopilot for heading and height ({missing[0]}); c172x "
                f"and global5000 have one"
            )
        _trim(executive, aircraft, start, heading, speed)
        for key, value in properties.items():
            if not _has(executive, key):
                raise DataError(
                    f"JSBSim's {aircraft} has no property {key!r}; names end in their unit, as in "
                    f"atmosphere/wind-north-fps"
                )
            executive[key] = value
        every = max(1, round(row * rate))
        return _fly(
            executive,
            aircraft,
            [JsbsimTarget(0.0, heading, start[2]), *targets],
            int(np.ceil(duration * rate / every - 1e-9)),
            every,
        )


@contextmanager
def session(rate: float = STEP_RATE) -> Iterator[tuple[Any, list[str]]]:
    """(FGFDMExec, list of JSBSim's messages), without output; `rate` steps per second. Raises
    DataError where JSBSim is not installed.

    The process has one listener to JSBSim, so a thread waits until the session of another one has
    ended.
    """
    engine = load_jsbsim()
    if not is_number(rate) or not 0 < rate <= MAX_STEP_RATE:
        raise DataError(
            f"JSBSim's rate is {rate!r} steps per second; it must be above 0 and at most "
            f"{MAX_STEP_RATE:g}"
        )
    with _ONE:
        yield from _listen_session(engine, rate)


def _listen_session(engine: Any, rate: float) -> Iterator[tuple[Any, list[str]]]:
    """Yield the (executive, its messages) of a session, and restore the earlier listener at the
    end."""

    class Listener(engine.FGLogger):  # type: ignore[misc]  # no types
        """Keeps the messages that JSBSim would print."""

        def message(self, text: str) -> None:
            said.append(text)

    said: list[str] = []
    before = engine.get_logger()
    engine.set_logger(Listener())
    try:
        # properties of its own: two may be alive at a time
        executive = engine.FGFDMExec(None, engine.FGPropertyManager())
        executive.set_debug_level(0)
        executive.set_dt(1.0 / rate)
        # some aircraft would write logs into the working folder
        with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            executive.set_output_path(folder)
            yield executive, said
    finally:
        engine.set_logger(before)


def load_jsbsim() -> Any:
    """Return the module jsbsim. Raises DataError naming the extra where it is missing or too
    old."""
    with optional_import():
        import jsbsim
    if not hasattr(jsbsim, "set_logger"):
        raise DataError(
            f"JSBSim {jsbsim.__version__} is too old (1.3 is needed); {remedy('jsbsim')}"
        )
    return jsbsim


def _checked_start(start: object) -> tuple[float, ...]:
    """(latitude rad, longitude rad, height m) as floats. Raises DataError."""
    what = (
        "numbers: latitude (rad, within 89 deg = 1.553), longitude (rad) and ellipsoidal height (m)"
    )
    numbers = check_array(start, "start", (3,), what=what)
    if np.any(np.abs(numbers[:2]) > [89 * DEG, 360 * DEG]):
        raise DataError(f"start is {start!r}; it must be {what}")
    return tuple(numbers.tolist())


def _check_targets(
    heading: object, speed: float, duration: float, rate: float, row: float, targets: object
) -> list[JsbsimTarget]:
    """Return the targets in time order. Raises DataError for impossible numbers and for other
    objects."""
    with locate_errors("a flight of JSBSim"):
        check_number(speed, "speed", "m/s", above=0)
        check_number(duration, "duration", "s", above=0)
        check_number(rate, "rate", "steps per second", above=0)
        check_number(row, "row", "s", above=0)
        check_number(heading, "heading", "rad")
    if row > duration or duration * rate > MAX_STEPS:
        raise DataError(
            f"a flight of {duration:g} s cannot have rows of {row:g} s at {rate:g} steps per "
            f"second; rows are no longer than the flight, "
            f"and {MAX_STEPS:g} steps are the most"
        )
    targets = (
        list(targets)
        if isinstance(targets, Iterable) and not isinstance(targets, JsbsimTarget)
        else targets
    )
    if not isinstance(targets, list) or not all(
        isinstance(target, JsbsimTarget) for target in targets
    ):
        raise DataError(
            f"targets must be a list of strapdown.sim.jsbsim.JsbsimTarget, not {targets!r}"
        )
    for target in targets:
        with locate_errors(target):
            check_number(target.at, "its time", "s", least=0, most=duration)
            for name, value in target._asdict().items():
                if value is not None:
                    check_number(value, name)
            if target.throttle is not None:
                check_number(target.throttle, "throttle", least=0, most=1)
    return sorted(targets, key=lambda target: target.at)


def _checked_properties(properties: object) -> dict[str, float]:
    """Return {name: float}. Raises DataError naming a value that is not a number."""
    if not isinstance(properties, Mapping | None):
        raise DataError(f"properties are {properties!r}; give a number for each name of JSBSim's")
    for key, value in (properties or {}).items():
        if not isinstance(key, str):
            raise DataError(f"property {key!r} of JSBSim is not a text; give a name of JSBSim's")
        check_number(value, f"property {key!r} of JSBSim, in the unit that its name ends in,")
    return {key: float(value) for key, value in (properties or {}).items()}


def _load(executive: Any, aircraft: str) -> None:
    """Load an aircraft that comes with JSBSim. Raises DataError."""
    folder = Path(executive.get_aircraft_path())
    # JSBSim itself would leave an incomplete model
    if not isinstance(aircraft, str) or not (folder / aircraft / f"{aircraft}.xml").is_file():
        known = sorted(entry.name for entry in folder.iterdir() if entry.is_dir())
        raise DataError(
            f"JSBSim has no aircraft {aircraft!r}{did_you_mean(aircraft, known)}; it has "
            f"{', '.join(known)}"
        )
    executive.load_model(aircraft)


def begin(executive: Any, lla: Sequence[float] | Array, values: Mapping[str, float]) -> None:
    """Start at `lla` (rad, rad, ellipsoidal height m) with further initial conditions, {name below
    ic/: value in JSBSim's unit}.

    JSBSim measures heights along the radius, 7 mm off at 1000 m; this is corrected with the
    ellipsoidal height that it reports afterwards.
    """
    executive["ic/h-sl-ft"] = lla[2] / FOOT
    for _ in range(3):
        for key, value in {"lat-geod-rad": lla[0], "long-gc-rad": lla[1], **values}.items():
            executive[f"ic/{key}"] = float(value)
        executive.run_ic()
        executive["ic/h-sl-ft"] += lla[2] / FOOT - executive["position/geod-alt-ft"]
    executive.run_ic()


def _has(executive: Any, key: str) -> bool:
    try:
        executive[key]
    except KeyError:
        return False
    return True


def _trim(
    executive: Any, aircraft: str, start: Sequence[float], heading: float, speed: float
) -> None:
    """Trim for level flight. Raises DataError where JSBSim finds no trim."""
    # set before they are held, otherwise the autopilot begins with a transient
    _order(executive, JsbsimTarget(0.0, heading, start[2]), hold=False)
    begin(executive, start, {"vt-fps": speed / FOOT, "psi-true-rad": heading, "gamma-rad": 0.0})
    for key in ("fcs/mixture-cmd-norm", "propulsion/magneto_cmd"):
        if _has(executive, key):
            executive[key] = 1.0 if "mixture" in key else 3.0
    executive["propulsion/set-running"] = -1
    try:
        executive.do_trim(TRIM_FULL)
    except RuntimeError:
        raise DataError(
            f"JSBSim cannot trim {aircraft} in level flight at {speed:g} m/s and {start[2]:g} m; "
            "give another speed or a lower height"
        ) from None


def _fly(
    executive: Any,
    aircraft: str,
    targets: Iterable[JsbsimTarget],
    rows: int,
    every: int,
    watch: Callable[[], object] | None = None,
) -> Trajectory:
    """Return the Trajectory of rows + 1 rows of `every` steps; `watch` is called at each of them.

    Raises DataError where the flight hits the ground or its numbers become invalid.
    """
    flown, orders = np.empty((rows + 1, len(STATE_PROPERTIES))), list(targets)
    step = executive.get_delta_t()
    for row in range(rows + 1):
        flown[row] = [executive[key] for key in STATE_PROPERTIES]
        if not np.isfinite(flown[row]).all() or flown[row, 2] <= 0 or executive["gear/wow"]:
            raise DataError(
                f"{aircraft} of JSBSim hit the ground (the ellipsoid) or diverged after "
                f"{row * every * step:.2f} s; "
                "begin higher, or give gentler targets"
            )
        if watch is not None:
            watch()
        for i in range(every if row < rows else 0):
            while orders and orders[0].at <= (row * every + i) * step + 1e-9:
                _order(executive, orders.pop(0))
            executive.run()
    flown *= STATE_UNITS
    lla, v_n = (np.ascontiguousarray(flown[:, first : first + 3]) for first in (0, 3))
    return Trajectory(np.arange(rows + 1) * every * step, lla, v_n, quaternions(flown[:, 6:]))


def quaternions(angles: Array) -> Array:
    """q_nb (n, 4), scalar first and not negative, of roll, pitch and heading (n, 3), rad."""
    q = Rotation.from_rph(angles).as_wxyz()
    return q * np.where(q[:, :1] < 0, -1.0, 1.0)


def _order(executive: Any, target: JsbsimTarget, hold: bool = True) -> None:
    """Set the set points of a target and, except for the trim, switch their holds on."""
    for name, (switch, point, unit) in HOLDS.items():
        value = getattr(target, name)
        if value is not None:
            executive[switch] = float(hold)
            executive[point] = (value % (2 * np.pi) if name == "heading" else value) * unit
    if target.throttle is not None:
        executive["fcs/throttle-cmd-norm"] = target.throttle
