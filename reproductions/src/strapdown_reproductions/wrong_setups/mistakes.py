"""The mistakes: what each makes of a right recording, and what its cause is called."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.typing import Array

from .cases import SWISSLOG_LAG, SetUpCase

GNSS = ("position", "velocity")
UNDULATION = 47.0
"""m by which the geoid lies above the ellipsoid."""
DRIFT = 0.1
"""m/s to the north."""
REPEATS = 4
"""Number of times that a receiver which repeats its fixes gives each."""


class Mistake(NamedTuple):
    """A mistake of a set-up."""

    name: str
    group: str
    # names of causes (strapdown.data.verdict.CAUSES) that count as the true one; the first is the plain
    # one
    causes: tuple[str, ...]
    make: Callable[[SetUpCase], Recording | None]  # None: it cannot be made with this recording
    size: float = 0.0  # s of a clock, m of an arm


def _on(
    kinds: tuple[str, ...], change: Callable[[Source], Source]
) -> Callable[[SetUpCase], Recording | None]:
    """A change of every source of these kinds."""

    def make(case: SetUpCase) -> Recording | None:
        found = case.recording.sources
        if not any(a.kind in kinds for a in found):
            return None
        changed = tuple(change(a) if a.kind in kinds else a for a in found)
        return replace(case.recording, sources=changed)

    return make


def clock(kinds: tuple[str, ...], seconds: float) -> Callable[[SetUpCase], Recording | None]:
    """Stamps of these sources that are too late by `seconds`."""

    def make(case: SetUpCase) -> Recording | None:
        present = {a.kind for a in case.recording.sources} & set(GNSS)
        if len(present) < 2 and kinds != GNSS:
            return None  # one source alone is all of them
        made = _on(kinds, lambda a: replace(a, t=a.t + seconds))(case)
        if made is None:
            return None
        inside = tuple(
            a.between(made.span[0], np.nextafter(made.span[1], 0.0)) for a in made.sources
        )
        return replace(made, sources=inside)

    return make


def turn_imu(axis: str, degrees: float) -> Callable[[SetUpCase], Recording]:
    """Axes of gyros and accelerometers that are turned by an angle about a body axis."""
    C = _turn(axis, degrees)
    return _samples(lambda dtheta, dv: (dtheta @ C, dv @ C))


def mount_turned(axis: str, degrees: float) -> Callable[[SetUpCase], Recording]:
    """A box that is mounted turned by an angle: the IMU and the magnetometer in it."""
    turn = turn_imu(axis, degrees)
    field = _on(("magnetic-field",), lambda a: replace(a, y=a.y @ _turn(axis, degrees)))

    def make(case: SetUpCase) -> Recording:
        made = turn(case)
        return field(case._replace(recording=made)) or made

    return make


def _turn(axis: str, degrees: float) -> Array:
    """(3, 3) C_bs, from the axes of the sensors to those of the body."""
    return Rotation.from_euler(axis, degrees, degrees=True).as_matrix()


def _samples(
    change: Callable[[Array, Array], tuple[Array, Array]],
) -> Callable[[SetUpCase], Recording]:
    """A change of the rotation and velocity increments."""

    def make(case: SetUpCase) -> Recording:
        imu = case.recording.imu
        dtheta, dv = change(imu.dtheta, imu.dv)
        return replace(case.recording, imu=imu._replace(dtheta=dtheta, dv=dv))

    return make


MIRROR = np.array([1.0, -1.0, 1.0])
"""Signs of the axes where the sign of y is misread, for both sensors."""


def scale_velocity(factor: float) -> Callable[[SetUpCase], Recording | None]:
    """Velocities in another unit."""
    return _on(("velocity",), lambda a: replace(a, y=a.y * factor))


def east_first(a: Source) -> Source:
    """East, north, up taken for north, east, down."""
    return replace(a, y=a.y[:, [1, 0, 2]] * [1.0, 1.0, -1.0])


def radians_as_degrees(a: Source) -> Source:
    """Velocity made of a speed and a course whose radians, 0 to 2 pi, are taken for degrees."""
    north, east, down = a.y.T
    course = np.radians(np.arctan2(east, north) % (2 * np.pi))
    speed = np.hypot(north, east)
    return replace(a, y=np.c_[speed * np.cos(course), speed * np.sin(course), down])


def longer(arm: tuple[float, float, float]) -> Callable[[SetUpCase], Recording | None]:
    """An antenna said to be further off by `arm` (forward, right, down, m) than it is."""

    def change(a: Source) -> Source:
        given = np.array(a.parameters or (0.0, 0.0, 0.0))
        return replace(a, parameters=tuple((given + arm).tolist()))

    return _on(GNSS, change)


def below_geoid(a: Source) -> Source:
    """Heights above the geoid taken for ellipsoidal ones."""
    return replace(a, y=a.y - [0.0, 0.0, UNDULATION])


def state_std(factor: float) -> Callable[[SetUpCase], Recording | None]:
    """Standard deviations of position and velocity stated `factor` times as large."""
    return _on(GNSS, lambda a: replace(a, std=a.std * factor))


def two_grades_better(case: SetUpCase) -> Recording:
    """The IMU described as one two grades better."""
    return replace(case.recording, meta=case.recording.meta | {"grade": case.better})


def add_accelerometer_bias(case: SetUpCase) -> Recording:
    """An accelerometer x whose bias is 10 standard deviations of its description."""
    spec = imu_spec(case.recording.meta["grade"])
    imu = case.recording.imu
    bias = np.array([10 * spec.bias_std()[0], 0.0, 0.0])
    return replace(case.recording, imu=imu._replace(dv=imu.dv + bias * imu.dt[:, None]))


def repeat_fixes(a: Source) -> Source:
    """Each fix given REPEATS times until the next one comes, with stamps of their own."""
    step = float(np.median(np.diff(a.t))) / REPEATS
    t = (a.t[:, None] + step * np.arange(REPEATS)).ravel()
    late = np.flatnonzero(t <= a.t[-1] + 1e-9)
    late = late[np.r_[True, np.diff(t[late]) > 0]] if len(late) else late
    rows = late // REPEATS
    return replace(a, t=t[late], y=a.y[rows], std=a.std[rows])


def drift_north(a: Source) -> Source:
    """Positions that drift to the north."""
    away = np.zeros((len(a.t), 3))
    away[:, 0] = DRIFT * (a.t - a.t[0])
    return replace(a, y=displace_lla(a.y, away))


def as_logged(case: SetUpCase) -> Recording | None:
    """swisslog as its columns are named: the course in degrees, no lag."""
    if case.name != "swisslog":
        return None
    wrong = tuple(
        replace(radians_as_degrees(a) if a.kind == "velocity" else a, t=a.t + SWISSLOG_LAG)
        for a in case.recording.sources
    )
    return replace(case.recording, sources=wrong)


SECONDS = (0.1, 0.25, 1.0, 18.0)
MISTAKES: tuple[Mistake, ...] = (
    *(
        Mistake(
            f"clock of {whose} {sign * seconds:+g} s",
            f"clock of {whose}",
            ("clock",),
            clock(kinds, sign * seconds),
            seconds,
        )
        for whose, kinds in (("GNSS", GNSS), ("position", GNSS[:1]), ("velocity", GNSS[1:]))
        for seconds in SECONDS
        for sign in (1, -1)
    ),
    *(
        Mistake(f"axes turned {angle} deg", "axes", ("axes", "mounting"), turn_imu("z", angle))
        for angle in (90, 180, 270)
    ),
    Mistake("axes mirrored", "axes", ("axes",), _samples(lambda w, f: (w * MIRROR, f * MIRROR))),
    Mistake("ENU taken for NED", "frame", ("frame",), _on(("velocity",), east_first)),
    *(
        Mistake(f"{unit} taken for m/s", "unit", ("unit",), scale_velocity(factor))
        for unit, factor in (("km/h", 3.6), ("knots", 3600 / 1852), ("mm/s", 1000.0))
    ),
    Mistake(
        "course in rad taken for deg", "unit", ("unit",), _on(("velocity",), radians_as_degrees)
    ),
    *(
        Mistake(
            f"antenna arm {size:g} m off, {where}",
            f"antenna arm, {where}",
            ("lever arm",),
            longer(tuple(size * np.array(way))),
            size,
        )
        for where, way in (("forward", (1.0, 0.0, 0.0)), ("up", (0.0, 0.0, -1.0)))
        for size in (1.0, 3.0)
    ),
    *(
        Mistake(
            f"mounting {angle} deg off in {name}",
            "mounting",
            ("mounting", "axes"),
            mount_turned(axis, angle),
        )
        for name, axis in (("pitch", "y"), ("heading", "z"))
        for angle in (2, 5, 10)
    ),
    Mistake("height above the geoid", "height", ("height",), _on(("position",), below_geoid)),
    Mistake("stated std 5 times too small", "fix noise", ("fix noise",), state_std(0.2)),
    Mistake("stated std 5 times too large", "fix noise", ("fix noise",), state_std(5.0)),
    Mistake(
        "IMU two grades too good", "IMU", ("imu noise", "accelerometer", "gyro"), two_grades_better
    ),
    Mistake(
        "accelerometer bias of 10 std",
        "IMU",
        ("accelerometer", "imu noise"),
        add_accelerometer_bias,
    ),
    Mistake(
        "odometer 2 % off",
        "odometer",
        ("scale",),
        _on(("speed",), lambda a: replace(a, y=a.y * 1.02)),
    ),
    Mistake(
        "accelerometers 2 % off",
        "scale",
        ("accelerometer", "imu noise"),
        _samples(lambda w, f: (w, 1.02 * f)),
    ),
    Mistake("gyros 2 % off", "scale", ("gyro", "imu noise"), _samples(lambda w, f: (1.02 * w, f))),
    Mistake("each fix four times", "repeated", ("repeated", "fix noise"), _on(GNSS, repeat_fixes)),
    Mistake(
        "position drifts by 0.1 m/s", "drift", ("lasting errors",), _on(("position",), drift_north)
    ),
    Mistake("as logged", "as logged", ("unit", "clock"), as_logged),
)
"""Every mistake of the study."""
