"""What of an installation can be estimated with the states of a filter, and how far from what was
given it may be."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from .checks import DataError, brief, check_choice, check_number


class Estimable(NamedTuple):
    """A parameter of one or more components, each of which becomes a state where its prior standard
    deviation is above zero. A state is true - given, as errors are."""

    name: str  # as `estimate` has it
    components: tuple[str, ...]  # "" of the only one
    unit: str  # of tables; "" for none
    factor: float  # from SI to it
    sd: tuple[float, ...]  # prior, SI, by component; 0: no state
    most: float  # SI: what is further off than this is no error of an installation

    @property
    def si(self) -> str:
        """Its SI unit."""
        return "rad" if self.unit == "deg" else self.unit


AXES, ANGLES = ("forward", "right", "down"), ("roll", "pitch", "heading")
MISALIGNED = ("xy", "xz", "yz", "yx", "zx", "zy")
"""Of axes x, y, z: how much of the second gets into the first; the first three are those of a
triad that defines the axes itself, to which all attitude refers then."""

CLOCK = Estimable("clock", ("",), "s", 1.0, (0.1,), 2.0)
"""s to add to the time stamps of a source."""
LEVER_ARM = Estimable("lever-arm", AXES, "m", 1.0, (0.5,) * 3, 20.0)
MOUNTING = Estimable(
    "mounting", ANGLES, "deg", math.degrees(1), (0.0, *[math.radians(2.0)] * 2), math.radians(45)
)
"""Rotation vector exp(mu x) from the body axes as described to those of the vehicle. Forward motion
shows pitch and heading; roll is a state where its prior is given."""
SCALE = Estimable("scale", ("",), "", 1.0, (0.02,), 0.3)
"""By which an odometer reads too much."""
GYRO_SCALE = Estimable("gyro-scale", AXES, "", 1.0, (0.01,) * 3, 0.1)
ACCEL_SCALE = Estimable("accel-scale", AXES, "", 1.0, (0.01,) * 3, 0.1)
"""By which a sensor reads too much."""
GYRO_MISALIGNMENT = Estimable(
    "gyro-misalignment", MISALIGNED, "deg", math.degrees(1), (0.01,) * 6, math.radians(10)
)
ACCEL_MISALIGNMENT = Estimable(
    "accel-misalignment",
    MISALIGNED,
    "deg",
    math.degrees(1),
    (*[0.01] * 3, *[0.0] * 3),
    math.radians(10),
)
"""The accelerometers define the axes, but where all six have a prior: then attitude is that of the
axes of the case, and uncertain by as much."""

OF_SOURCE = {each.name: each for each in (CLOCK, LEVER_ARM, SCALE)}
OF_IMU = {
    each.name: each
    for each in (MOUNTING, GYRO_SCALE, ACCEL_SCALE, GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT)
}

Known: TypeAlias = Mapping[str, Sequence[Estimable]]
"""{name as a user writes it: what it stands for}."""
ASKED_OF_IMU: Known = {name: (each,) for name, each in OF_IMU.items()} | {
    "scale": (GYRO_SCALE, ACCEL_SCALE),
    "misalignment": (GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT),
}
"""What can be asked for at the IMU, where a short name stands for both sensors."""


def asked_at(names: Sequence[str]) -> Known:
    """What can be asked for at a source that knows these names."""
    return {name: (OF_SOURCE[name],) for name in names if name in OF_SOURCE}


def asked(value: Any, known: Known) -> dict[str, tuple[float, ...]]:
    """{name: prior standard deviations, SI} of what a file asks for: a list of names, or a table of
    names with their prior in `Estimable.unit`, one number or one per component. Raises
    DataError."""
    if not known:
        raise DataError("nothing of this source can be estimated; leave it out")
    names = value if isinstance(value, dict) else None
    if isinstance(value, list) and all(isinstance(name, str) for name in value):
        names = dict.fromkeys(value)
    if names is None:
        raise DataError(
            f'{brief(value)}; write a list of names, such as ["{next(iter(known))}"], or a table of '
            f"names with their prior standard deviations"
        )
    found: dict[str, tuple[float, ...]] = {}
    for name, sd in names.items():
        if name in OF_IMU and name not in known:
            raise DataError(f"{name} is of the IMU; name it in the estimate of [imu]")
        check_choice(name, "a name", known)
        found |= {what.name: prior(what, sd, in_tables=True) for what in known[name]}
    return found


def prior(what: Estimable, sd: Any, in_tables: bool = False) -> tuple[float, ...]:
    """Prior standard deviations by component, SI, from one number for all or one each, SI or
    `in_tables` in the unit of these; for None its own. Raises DataError."""
    if sd is None:
        return what.sd
    unit, factor = (what.unit, what.factor) if in_tables else (what.si, 1.0)
    many = len(what.components)
    one = isinstance(sd, str | dict) or not hasattr(sd, "__iter__")
    values: tuple[Any, ...] = (sd,) * many if one else tuple(sd)
    if len(values) != many:
        parts = f"components ({', '.join(what.components)})" if many > 1 else "component"
        raise DataError(
            f"{what.name} has {many} {parts}, and {len(values)} standard deviations are given"
        )
    for value in values:
        most = round(what.most * factor, 6)
        check_number(value, f"standard deviation of {what.name}", unit, least=0, most=most)
    if not any(values):
        raise DataError(f"all standard deviations of {what.name} are 0; leave it out")
    return tuple(float(value) / factor for value in values)
