"""Faults of a GNSS receiver, and of the start that a filter is given."""

import numpy as np

from strapdown.core.loop.contract import InitialState

from .fault import (
    GNSS,
    KINDS,
    MISSING,
    NEGATED,
    START,
    ZERO,
    Change,
    Fault,
    FaultColumns,
    Rows,
    every,
    hold_first,
    on,
    over,
    plus,
    round_to_step,
    rows_of_fault,
    set_to,
    some,
    sources,
    swap_axes,
    times,
    without,
)
from .raw import BEGINS, Raw, RawFixes

FOOT, KNOT = 0.3048, 1852 / 3600
UNDULATION = 47.0
"""m by which the geoid lies above the ellipsoid."""
WEEK = 604800
OF_POSITION, OF_VELOCITY = sources("position"), sources("velocity")
OF_BOTH = sources(*KINDS[GNSS])
FIXES, STAMPS, STD = (FaultColumns(OF_BOTH, (name,)) for name in ("y", "t", "std"))
POSITION, POSITION_STD = (FaultColumns(OF_POSITION, (name,)) for name in ("y", "std"))
VELOCITY, VELOCITY_STAMPS = (FaultColumns(OF_VELOCITY, (name,)) for name in ("y", "t"))
NORTH, EAST, VERTICAL = range(3)


def move_north(metres: float, rows: Rows) -> Change:
    """Positions that are off to the north."""

    def change(raw: Raw) -> None:
        position = raw.sources["position"]
        position.move((metres, 0, 0), rows(raw, position))

    return change


def drift(speed: float, consistent: bool) -> Change:
    """Positions that drift to the north, and where it is `consistent` the velocity that goes with
    it."""

    def change(raw: Raw) -> None:
        position, velocity = raw.gnss
        away = np.zeros((len(position.t), 3))
        away[:, 0] = speed * np.clip(position.t - BEGINS, 0, None)
        position.move(away)
        if consistent:
            velocity.y[velocity.from_fault(), 0] += speed

    return change


def spoof(acceleration: float) -> Change:
    """Positions and velocities that agree with each other and move away to the north with an
    acceleration in m/s^2: those of a spoofer that takes the receiver over gently."""

    def change(raw: Raw) -> None:
        position, velocity = raw.gnss
        away = np.zeros((len(position.t), 3))
        away[:, 0] = 0.5 * acceleration * np.clip(position.t - BEGINS, 0, None) ** 2
        position.move(away)
        velocity.y[:, 0] += acceleration * np.clip(velocity.t - BEGINS, 0, None)

    return change


def stamp_fault_name(seconds: float) -> str:
    """The name of the fault whose stamps are off by so much."""
    return f"fixes late by {seconds:g} s" if seconds > 0 else f"fixes early by {-seconds:g} s"


def four_swapped(raw: Raw) -> None:
    """Four fixes of each source in the wrong order."""
    for source in raw.gnss:
        rows = np.arange(len(source.t))
        rows[100:104] = rows[100:104][::-1]
        arrival = source.arrival.copy()
        source.take(rows)
        source.arrival = arrival


def again(source: RawFixes, count: int) -> None:
    """Each fix so often."""
    source.take(np.repeat(np.arange(len(source.t)), count))


def twice(raw: Raw) -> None:
    """Each fix twice."""
    for source in raw.gnss:
        again(source, 2)


def ten_times(raw: Raw) -> None:
    """Each fix ten times until the next one, with stamps of their own."""
    for source in raw.gnss:
        step = np.median(np.diff(source.t)) / 10
        later = np.tile(np.arange(10) * step, len(source.t))
        again(source, 10)
        source.t = source.t + later
        source.arrival = source.arrival + later


def come_and_go(raw: Raw) -> None:
    """Noisy positions stated as good ones; seven tenths of all fixes missing."""
    position = raw.sources["position"]
    position.move(2 * position.std * raw.rng.standard_normal(position.y.shape))
    position.std *= 0.1
    for source in raw.gnss:
        source.take((source.t < BEGINS) | (raw.rng.random(len(source.t)) < 0.3))


def not_there(*kinds: str) -> Change:
    """Leaves out whole sources."""

    def change(raw: Raw) -> None:
        raw.sources = {kind: own for kind, own in raw.sources.items() if kind not in kinds}

    return change


def longer_arm(raw: Raw) -> None:
    """An antenna that is said to be 2 m further forward."""
    for source in raw.gnss:
        forward, *others = source.parameters or (0.0, 0.0, 0.0)
        source.parameters = (forward + 2, *others)


def noisy(raw: Raw) -> None:
    """10 times the noise for 60 s."""
    position = raw.sources["position"]
    rows = position.from_fault(60)
    position.move(10 * position.std[rows] * raw.rng.standard_normal((rows.sum(), 3)), rows)


def add_wander(raw: Raw) -> None:
    """5 m, correlated over 60 s."""
    position = raw.sources["position"]
    steps = np.exp(-np.diff(position.t) / 60)
    away = np.zeros((len(position.t), 3))
    for i, a in enumerate(steps, 1):
        away[i] = a * away[i - 1] + raw.rng.normal(0, 5 * np.sqrt(1 - a * a), 3)
    position.move(away)


def begins_off(
    lla: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rph: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Change:
    """A start that is off by these."""

    def start(right: InitialState) -> InitialState:
        added = lambda own, off: tuple(a + b for a, b in zip(own, off))
        return right._replace(lla=added(right.lla, lla), rph=added(right.rph, rph))

    def change(raw: Raw) -> None:
        raw.start = start

    return change


OF_RECEIVER: tuple[tuple[str, Change], ...] = (
    ("20 % of the fixes NaN", on(FIXES, MISSING, some(0.2))),
    ("some longitudes inf", on(POSITION.at(EAST), set_to(np.inf), every(13))),
    ("10 % of the positions 0, 0, 0", on(POSITION, ZERO, every(10, 5))),
    ("all positions 0, 0, 0 from 90 s", on(POSITION, ZERO, rows_of_fault())),
    # jumps, drifts, what is stuck
    *(
        (f"one position {metres:g} m off", move_north(metres, rows_of_fault(1)))
        for metres in (10, 50)
    ),
    *(
        (f"position jumps by {metres:g} m for good", move_north(metres, rows_of_fault()))
        for metres in (5, 10, 20, 50, 1000)
    ),
    ("height jumps by 50 m for good", on(POSITION.at(VERTICAL), plus(50), rows_of_fault())),
    *((f"position drifts by {speed:g} m/s", drift(speed, False)) for speed in (0.1, 1.0)),
    *(
        (f"position and velocity drift by {speed:g} m/s", drift(speed, True))
        for speed in (0.1, 2.0)
    ),
    *(
        (f"spoofed: position and velocity accelerate by {size:g} m/s^2", spoof(size))
        for size in (0.02, 0.05, 0.1, 0.2, 0.5)
    ),
    ("position and velocity stuck", on(FIXES, hold_first, rows_of_fault())),
    ("position stuck, velocity right", on(POSITION, hold_first, rows_of_fault())),
    ("velocity stuck, position right", on(VELOCITY, hold_first, rows_of_fault())),
    ("velocity north stuck", on(VELOCITY.at(NORTH), hold_first, rows_of_fault())),
    ("velocity is 0 from 90 s", on(VELOCITY, ZERO, rows_of_fault())),
    ("velocity 1 m/s off in north from 90 s", on(VELOCITY.at(NORTH), plus(1), rows_of_fault())),
    ("fixes alternate between antennas 1 m apart", move_north(1, every(2))),
    ("position rounded to 1e-4 deg", on(POSITION.at(slice(2)), round_to_step(np.radians(1e-4)))),
    # units, signs, frames
    ("longitude sign wrong", on(POSITION.at(EAST), NEGATED)),
    ("latitude and longitude swapped", on(POSITION, swap_axes)),
    ("latitude and longitude in deg", on(POSITION.at(slice(2)), np.degrees)),
    ("velocity up taken for down", on(VELOCITY.at(VERTICAL), NEGATED)),
    ("velocity north and east swapped", on(VELOCITY, swap_axes)),
    ("velocity in km/h", on(VELOCITY, times(3.6))),
    ("velocity in knots", on(VELOCITY, over(KNOT))),
    ("height in feet", on(POSITION.at(VERTICAL), over(FOOT))),
    ("height is a depth", on(POSITION.at(VERTICAL), NEGATED)),
    ("height above the geoid", on(POSITION.at(VERTICAL), plus(-UNDULATION))),
    # time stamps
    *((stamp_fault_name(s), on(STAMPS, plus(s))) for s in (0.1, 0.5, 2, -18, WEEK)),
    ("velocity late by 0.5 s, position not", on(VELOCITY_STAMPS, plus(0.5))),
    ("fixes a week later from 90 s", on(STAMPS, plus(WEEK), rows_of_fault())),
    ("fix stamps stand still from 90 s", on(STAMPS, lambda t: np.minimum(t, BEGINS))),
    ("four fixes in the wrong order", four_swapped),
    ("each fix twice", twice),
    ("each fix ten times, with new stamps", ten_times),
    # stated standard deviations
    *(
        (f"std stated {factor:g} times as large", on(STD, times(factor)))
        for factor in (0.1, 0.3, 10.0)
    ),
    ("std 1e-9", on(STD, set_to(1e-9))),
    ("std 0 in one row", on(POSITION_STD, ZERO, lambda raw, holder: slice(50, 51))),
    ("std NaN in a third", on(POSITION_STD, MISSING, every(3))),
    ("std inf in a third", on(POSITION_STD, set_to(np.inf), every(3))),
    ("std negative", on(POSITION_STD, NEGATED)),
    ("fixes come and go, with a tenth of their std and twice their noise", come_and_go),
    # what is not there, or not there where it is said to be
    ("no GNSS for 60 s", without(OF_BOTH, rows_of_fault(60))),
    ("no GNSS from 60 s on", without(OF_BOTH, lambda raw, holder: holder.t >= 60)),
    ("no velocity from 90 s on", without(OF_VELOCITY, rows_of_fault())),
    ("no GNSS at all", not_there(*KINDS[GNSS])),
    ("no velocity at all", not_there("velocity")),
    ("antenna arm 2 m off", longer_arm),
    ("multipath: 10 times the noise for 60 s", noisy),
    ("multipath: 5 m, correlated over 60 s", add_wander),
)
STARTS: tuple[tuple[str, Change], ...] = (
    ("start 180 deg off in heading", begins_off(rph=(0.0, 0.0, np.pi))),
    ("start 1 km off", begins_off(lla=(1000 / 6371e3, 0.0, 0.0))),
    ("start 30 deg off in roll", begins_off(rph=(np.radians(30), 0.0, 0.0))),
)
FAULTS = (
    *(Fault(name, GNSS, change) for name, change in OF_RECEIVER),
    *(Fault(name, START, change) for name, change in STARTS),
)
