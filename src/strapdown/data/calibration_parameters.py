"""The parameters of an installation, one table for all who estimate them: with the states of a filter,
from its innovations (`diagnose`), or both (`calibrate_installation`)."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from ..checks import DataError, brief, check_choice, check_number

KNOWN = 0.5
"""Share of its prior standard deviation: a parameter that is known no better is not observable. The
noise of a gyro at rest alone brings an arm from 1 m to 0.4 m, though nothing shows it."""


class CalibrationParameter(NamedTuple):
    """A parameter of one or more components, each of which becomes a state where its prior standard
    deviation is above zero. A state is true - given, as errors are. Numbers are in SI."""

    name: str  # as `estimate` has it
    components: tuple[str, ...]  # "" of the only one
    unit: str  # of tables; "" for none
    factor: float  # from SI to it
    std: tuple[float, ...]  # prior by component; 0: no state
    most: float  # what is further off than this is no error of an installation
    cause: str  # a key of verdict.CAUSES: what is wrong where it is off
    motions: tuple[str, ...]  # what would show it, or show it better, by component
    min_reported: float = 0.0  # a smaller error is not reported
    # of those that `diagnose` estimates too:
    min_doubted: float = 0.0  # a smaller error that the quick look finds is no reason for doubt
    # standard deviation of what was given: one that is hardly seen would else gather false
    # information, because its derivatives are noisy
    given_std: float = 0.0
    # prior of the second estimate, of what the first left; a clock's is no larger because its fixes
    # wait three of them
    left_std: float = 0.0
    key: str = ""  # of recording.toml
    digits: int = 0  # behind the point that are always written there
    place: str = ""  # field of a SourceRow that has the index of its state, or of its components'
    increments: int = -1  # of the axes of a sensor: the first component of its increments

    @property
    def si(self) -> str:
        """Its SI unit."""
        return "rad" if self.unit == "deg" else self.unit

    @property
    def known_std(self) -> float:
        """The standard deviation from which a component is not observable where nobody gave a
        prior."""
        return KNOWN * max(self.std)

    def component(self, axis: int) -> str:
        """A component in words, such as "lever arm forward"."""
        return f"{self.name.replace('-', ' ')} {self.components[axis]}".rstrip()

    def size(self, value: float) -> str:
        """The size of a value, as text in its unit."""
        return f"{value * self.factor:.2g} {self.unit}".rstrip()


AXES, ANGLES = ("forward", "right", "down"), ("roll", "pitch", "heading")
MISALIGNED = ("xy", "xz", "yz", "yx", "zx", "zy")
"""Pairs of the axes x, y, z, for the share of the second that gets into the first; the first three
are those of a triad that defines the axes itself, to which all attitude refers then."""
TURNS = "turn about all axes, by more than 90 deg and to both sides"
TILTS = "tilt it to all sides, or accelerate along all axes"

CLOCK = CalibrationParameter(
    name="clock",
    components=("",),
    unit="s",
    factor=1.0,
    std=(0.1,),
    most=2.0,
    cause="clock",
    motions=("accelerate, brake or turn",),
    min_reported=0.02,
    min_doubted=0.02,
    given_std=10.0,
    left_std=0.1,
    key="time",
    digits=3,
    place="clock_state",
)
"""s to add to the time stamps of a source."""
LEVER_ARM = CalibrationParameter(
    name="lever-arm",
    components=AXES,
    unit="m",
    factor=1.0,
    std=(0.5,) * 3,
    most=20.0,
    cause="lever arm",
    motions=(*("turn, to both sides",) * 2, "roll and pitch, as in banked turns"),
    min_reported=0.1,
    min_doubted=0.3,
    given_std=1.0,
    left_std=1.0,
    key="lever_arm",
    digits=2,
    place="arm_state",
)
MOUNTING = CalibrationParameter(
    name="mounting",
    components=ANGLES,
    unit="deg",
    factor=math.degrees(1),
    std=(0.0, *[math.radians(2.0)] * 2),
    most=math.radians(45),
    cause="mounting",
    motions=("drive faster, on slopes", "drive faster", "drive faster"),
    min_reported=math.radians(0.5),
    min_doubted=math.radians(1.0),
    given_std=math.radians(20.0),
    left_std=math.radians(6.0),
    key="mounting",
    digits=3,
    place="mounting_state",
)
"""Rotation vector exp(mu x) from the body axes as described to those of the vehicle. Forward motion
shows pitch and heading; roll is a state where its prior is given."""
SCALE = CalibrationParameter(
    name="scale",
    components=("",),
    unit="",
    factor=1.0,
    std=(0.02,),
    most=0.3,
    cause="scale",
    motions=("drive faster",),
    min_reported=0.003,
    min_doubted=0.005,
    given_std=0.05,
    left_std=0.04,
    key="scale",
    digits=4,
    place="scale_state",
)
"""By which an odometer, another sensor of speed or a range reads too much."""
GYRO_SCALE = CalibrationParameter(
    name="gyro-scale",
    components=AXES,
    unit="",
    factor=1.0,
    std=(0.01,) * 3,
    most=0.1,
    cause="gyro",
    motions=(TURNS,) * 3,
    increments=0,
)
ACCEL_SCALE = GYRO_SCALE._replace(
    name="accel-scale", cause="accelerometer", motions=(TILTS,) * 3, increments=3
)
"""By which a sensor reads too much."""
GYRO_MISALIGNMENT = CalibrationParameter(
    name="gyro-misalignment",
    components=MISALIGNED,
    unit="deg",
    factor=math.degrees(1),
    std=(0.01,) * 6,
    most=math.radians(10),
    cause="gyro",
    motions=(TURNS,) * 6,
    increments=0,
)
ACCEL_MISALIGNMENT = GYRO_MISALIGNMENT._replace(
    name="accel-misalignment",
    std=(*[0.01] * 3, *[0.0] * 3),
    cause="accelerometer",
    motions=(TILTS,) * 6,
    increments=3,
)
"""The accelerometers define the axes, but where all six have a prior: then attitude is that of the
axes of the case, and uncertain by as much."""
ANY_TURN = "turn about two axes, by more than 90 deg"
HARD_IRON = CalibrationParameter(
    name="hard-iron",
    components=AXES,
    unit="uT",
    factor=1e6,
    std=(50e-6,) * 3,
    most=500e-6,
    cause="calibration",
    motions=(ANY_TURN,) * 3,
    min_reported=0.5e-6,
    place="iron_state",
)
"""The field of magnets and currents of the vehicle, in its axes. The prior is a field like the Earth's, as
beside an engine or a motor's wires."""
SOFT_IRON = CalibrationParameter(
    name="soft-iron",
    components=("xx", "yy", "zz", "xy", "xz", "yz"),
    unit="",
    factor=1.0,
    std=(0.05,) * 6,
    most=0.5,
    cause="calibration",
    motions=(TILTS,) * 6,
    min_reported=0.01,
    place="soft_state",
)
"""By which iron and the scales of the sensor strengthen the field along the axes, and turn it from one to
another: a symmetric matrix, since a rotation is the mounting's."""
FIELD = CalibrationParameter(
    name="field",
    components=("north", "east", "down"),
    unit="uT",
    factor=1e6,
    std=(0.5e-6,) * 3,
    most=100e-6,
    cause="calibration",
    motions=(ANY_TURN,) * 3,
    min_reported=0.1e-6,
    place="field_state",
)
"""The Earth's field less its model. The prior is for open ground, where models err by 0.1 to 0.2 uT and
rocks add to that."""
DECLINATION = CalibrationParameter(
    name="declination",
    components=("",),
    unit="deg",
    factor=math.degrees(1),
    std=(math.radians(2.0),),
    most=math.radians(180),
    cause="calibration",
    motions=("accelerate, brake or turn",),
    min_reported=math.radians(0.5),
    place="declination_state",
)
"""The same about the vertical alone, for a field whose strength and dip are right."""
VERTICAL_WIND = CalibrationParameter(
    name="vertical-wind",
    components=("",),
    unit="m/s",
    factor=1.0,
    std=(1.0,),
    most=20.0,
    cause="unknown",
    motions=("record an angle of attack, or pitch by many degrees",),
    min_reported=0.1,
)
"""Downwards: no parameter of the installation, but a third state of the wind that its sources share. The prior
is for level ground; beside mountains and in thermals give more."""

OF_SOURCE = {
    each.name: each
    for each in (
        CLOCK,
        LEVER_ARM,
        SCALE,
        HARD_IRON,
        SOFT_IRON,
        FIELD,
        DECLINATION,
        VERTICAL_WIND,
    )
}
OF_IMU = {
    each.name: each
    for each in (MOUNTING, GYRO_SCALE, ACCEL_SCALE, GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT)
}

Known: TypeAlias = Mapping[str, Sequence[CalibrationParameter]]
"""{name as a user writes it: what it stands for}."""
ASKED_OF_IMU: Known = {name: (each,) for name, each in OF_IMU.items()} | {
    "scale": (GYRO_SCALE, ACCEL_SCALE),
    "misalignment": (GYRO_MISALIGNMENT, ACCEL_MISALIGNMENT),
}
"""Parameters that can be asked for at the IMU, where a short name stands for both sensors."""


def asked_at(names: Sequence[str]) -> Known:
    """Return the parameters that can be asked for at a source, of those with these names."""
    return {name: (OF_SOURCE[name],) for name in names if name in OF_SOURCE}


def requested_priors(value: Any, known: Known) -> dict[str, tuple[float, ...]]:
    """{name: prior standard deviations, SI} of what a file asks for: a list of names, or a table of
    names with their prior in `CalibrationParameter.unit`, one number or one per component. Raises
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
    for name, std in names.items():
        if name in OF_IMU and name not in known:
            raise DataError(f"{name} is of the IMU; name it in the estimate of [imu]")
        check_choice(name, "a name", known)
        found |= {what.name: prior(what, std, in_tables=True) for what in known[name]}
    return found


def prior(what: CalibrationParameter, std: Any, in_tables: bool = False) -> tuple[float, ...]:
    """Prior standard deviations by component, SI, from one number for all or one each, SI or
    `in_tables` in the unit of these; for None its own. Raises DataError."""
    if std is None:
        return what.std
    unit, factor = (what.unit, what.factor) if in_tables else (what.si, 1.0)
    many = len(what.components)
    one = isinstance(std, str | dict) or not hasattr(std, "__iter__")
    values: tuple[Any, ...] = (std,) * many if one else tuple(std)
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
