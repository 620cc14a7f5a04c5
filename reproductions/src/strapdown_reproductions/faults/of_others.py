"""Faults of a magnetometer, of an AHRS and of a second source of height."""

import numpy as np

from .fault import (
    AHRS,
    HEIGHT,
    KINDS,
    MAGNETOMETER,
    MISSING,
    NEGATED,
    Change,
    Fault,
    FaultColumns,
    add_drift,
    every,
    hold_first,
    on,
    over,
    plus,
    rows_of_fault,
    sources,
    swap_axes,
    times,
    without,
)
from .raw import Raw

DEG = np.pi / 180
OF_FIELD, OF_ATTITUDE, OF_HEIGHT = (
    sources(*KINDS[sensor]) for sensor in (MAGNETOMETER, AHRS, HEIGHT)
)
FIELD, FIELD_STAMPS, FIELD_STD = (FaultColumns(OF_FIELD, (name,)) for name in ("y", "t", "std"))
ATTITUDE, ATTITUDE_STAMPS, ATTITUDE_STD = (
    FaultColumns(OF_ATTITUDE, (name,)) for name in ("y", "t", "std")
)
ALTITUDE = FaultColumns(OF_HEIGHT, ("y",))
ROLL, PITCH, HEADING = range(3)


def turn_reference_field(raw: Raw) -> None:
    """A reference field that is turned by 10 deg."""
    for source in OF_FIELD(raw):
        north, east, down = source.parameters
        c, s = np.cos(10 * DEG), np.sin(10 * DEG)
        source.parameters = (c * north - s * east, s * north + c * east, down)


def spikes(raw: Raw) -> None:
    """100 uT in 5 % of the readings."""
    for source in OF_FIELD(raw):
        rows = raw.rng.random(len(source.t)) < 0.05
        source.y[rows] += raw.rng.normal(0, 100e-6, (rows.sum(), 3))


OF_MAGNETOMETER: tuple[tuple[str, Change], ...] = (
    ("magnet of 50 uT beside it for 30 s", on(FIELD, plus((0, 50e-6, 0)), rows_of_fault(30))),
    ("hard iron of 10 uT from 90 s", on(FIELD, plus((0, 10e-6, 0)), rows_of_fault())),
    ("hard iron of 22 uT throughout", on(FIELD, plus((0, 20e-6, 10e-6)))),
    ("magnetometer stuck", on(FIELD, hold_first, rows_of_fault())),
    ("magnetometer sign wrong", on(FIELD, NEGATED)),
    ("magnetometer z sign wrong", on(FIELD.at(2), NEGATED)),
    ("magnetometer x and y swapped", on(FIELD, swap_axes)),
    ("magnetic field in gauss", on(FIELD, times(1e4))),
    ("magnetic field in uT", on(FIELD, times(1e6))),
    ("magnetometer scale 1.5", on(FIELD, times(1.5))),
    ("magnetometer lost at 90 s", without(OF_FIELD, rows_of_fault())),
    ("declination 10 deg off", turn_reference_field),
    ("a fifth of the magnetometer NaN", on(FIELD, MISSING, every(5))),
    ("magnetometer std stated a tenth", on(FIELD_STD, over(10))),
    ("magnetometer late by 0.5 s", on(FIELD_STAMPS, plus(0.5))),
    ("magnetometer spikes of 100 uT in 5 %", spikes),
)
OF_AHRS: tuple[tuple[str, Change], ...] = (
    ("AHRS heading 10 deg off", on(ATTITUDE.at(HEADING), plus(10 * DEG))),
    (
        "AHRS heading 10 deg off from 90 s",
        on(ATTITUDE.at(HEADING), plus(10 * DEG), rows_of_fault()),
    ),
    ("AHRS roll 5 deg off from 90 s", on(ATTITUDE.at(ROLL), plus(5 * DEG), rows_of_fault())),
    ("AHRS stuck", on(ATTITUDE, hold_first, rows_of_fault())),
    ("AHRS heading stuck", on(ATTITUDE.at(HEADING), hold_first, rows_of_fault())),
    ("AHRS lost at 90 s", without(OF_ATTITUDE, rows_of_fault())),
    ("AHRS in deg", on(ATTITUDE, over(DEG))),
    ("AHRS pitch sign wrong", on(ATTITUDE.at(PITCH), NEGATED)),
    ("AHRS late by 0.5 s", on(ATTITUDE_STAMPS, plus(0.5))),
    ("AHRS std stated a tenth", on(ATTITUDE_STD, over(10))),
)
OF_SECOND_HEIGHT: tuple[tuple[str, Change], ...] = (
    ("second height drifts by 0.2 m/s", add_drift(ALTITUDE.at(0), 0.2)),
    ("second height steps by 20 m", on(ALTITUDE, plus(20), rows_of_fault())),
    ("second height stuck", on(ALTITUDE, hold_first, rows_of_fault())),
    ("second height in feet", on(ALTITUDE, over(0.3048))),
    ("second height above the geoid", on(ALTITUDE, plus(-47))),
)
FAULTS = tuple(
    Fault(name, sensor, change)
    for sensor, own in (
        (MAGNETOMETER, OF_MAGNETOMETER),
        (AHRS, OF_AHRS),
        (HEIGHT, OF_SECOND_HEIGHT),
    )
    for name, change in own
)
