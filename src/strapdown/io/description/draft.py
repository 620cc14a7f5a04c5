"""A bare CSV: guesses at what its columns are, and a `recording.toml` drafted from them, with a
comment wherever the user must decide."""

import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...checks import DataError
from ...core.contract import Imu
from ...preprocessing.axes import BODY_AXES, axes_matrix
from ...preprocessing.imu_samples import increments
from ...preprocessing.origin import Origin
from ...preprocessing.plausible import G, doubts, half_seconds, mistakes
from ...typing import Array, File
from ...units import UNITS
from ..contract import Findings
from ..facts import imu_facts
from ..table_file import Table, is_number
from ..table_text import read_table
from .magnetic_sources import EARTH_FIELD
from .schema_aiding import HEADING

TIME = r"(t|time|timestamp|time_?stamp|tow|seconds?|elapsed|gps_?time)"
GYRO = r"(g|gyr|gyro|gyroscope|w|omega|rate|rates|ang(ular)?_?(vel|velocity|rate))"
MAG = r"(m|mag|magn|magnet|magnetometer|magnetic|magnetic_?field|compass)"
ACCEL = r"(a|f|acc|accel|acceleration|accelerometer|lin(ear)?_?acc(el|eleration)?|specific_?force)"
FIX_COLUMNS = {
    "latitude": r"(lat|latitude)",
    "longitude": r"(lon|lng|long|longitude)",
    "height": r"(alt|altitude|h|hgt|height|h_?ell|ellipsoidal_?height)",
    "north": r"(vn|v_?n|vel_?n|v(el)?_?north|north_?vel(ocity)?)",
    "east": r"(ve|v_?e|vel_?e|v(el)?_?east|east_?vel(ocity)?)",
    "down": r"(vd|v_?d|vel_?d|v(el)?_?down|down_?vel(ocity)?)",
    "up": r"(vu|v_?u|vel_?u|v(el)?_?up|up_?vel(ocity)?)",
}
ANGLE_COLUMNS = {"roll": r"(roll|phi)", "pitch": r"(pitch|theta)", "heading": HEADING}
NO_ANGLE = r"(?!.*(rate|dot|sd|std|sigma|var|cov|err|bias|acc))"
"""No column of roll, pitch or heading has this in its name."""
UNIT = r"(?P<unit>([_ .,\[(].*)?)"
SPELLINGS = {
    "rad/s": r"rad.*s",
    "deg/s": r"(deg.*s|dps)",
    "m/s^2": r"(m.?/?s.?\^?2|m_s_?s|mps2)",
    "mg": r"mg",
    "g": r"g",
    "ns": r"ns(ec)?",
    "us": r"(us|µs|usec)",
    "ms": r"(ms|msec)",
    "s": r"s(ec(onds?)?)?",
    "rad": r"rad",
    "deg": r"deg",
    "T": r"(t|tesla)",
    "uT": r"(ut|µt|μt|microtesla)(_?raw)?",
    "nT": r"(nt|nanotesla)(_?raw)?",
    "gauss": r"(gauss|gs)(_?raw)?",
    "mgauss": r"(mgauss|milligauss|mg)(_?raw)?",
}


class Guess(NamedTuple):
    """What was made of a CSV: lines on it, mistakes found, the IMU by the guessed units and axes
    or None, and the text of the draft."""

    facts: list[str]
    problems: list[str]
    imu: Imu | None
    text: str


class Source(NamedTuple):
    """The table that all sections of a draft name, as they write it, and where lines on it go."""

    table: Table
    file: str  # in quotes, as seen from the folder of the draft
    time: str  # name of its column
    unit: str  # of the time
    facts: list[str]

    @property
    def keys(self) -> str:
        """The keys `file` and `time` of a section."""
        return f"""file = {self.file}
time = {{ column = {_text(self.time)}, unit = "{self.unit}" }}"""


def draft(path: File, folder: File | None = None) -> str:
    """Text of a `recording.toml` for a bare CSV, to stand in `folder` (default: beside the table).

    Raises DataError where the header line or the time is missing.
    """
    guessed = guess(path, folder)
    if not guessed.text:
        raise DataError(f"{path}: {'; '.join(guessed.problems)}")
    return guessed.text


def inspect_table(path: Path) -> Findings:
    """Findings on a bare table by what was guessed of it. Raises DataError where it cannot be
    read."""
    guessed = guess(path)
    found = Findings.of(guessed.facts, guessed.problems)
    if guessed.imu is not None:
        wrong = [text for _, text in mistakes(guessed.imu, "rate")]
        found.add(imu_facts(guessed.imu), wrong + doubts(guessed.imu))
    if guessed.text:
        found.facts.append(
            f"a table does not say its units and axes: `strapdown inspect {path} --write "
            f"recording.toml` drafts a description"
        )
    return found


def guess(path: File, folder: File | None = None) -> Guess:
    """The Guess of a CSV. Raises DataError where it cannot be read."""
    path = Path(path)
    table = read_table(path)
    names = [str(name) for name in table.frame.columns]
    if all(map(is_number, names)):
        return _without_header(read_table(path, header=False))
    facts = [f"table: {len(table.lines)} rows, columns {', '.join(names)}"]
    time = _find(names, TIME)
    if time is None:
        return Guess(
            facts,
            ["no column is named like a time: name it in `time` of a recording.toml"],
            None,
            "",
        )
    t = table.numbers(time)
    gyro, accel, fixes = (
        _triple(names, GYRO),
        _triple(names, ACCEL),
        {key: _find(names, pattern) for key, pattern in FIX_COLUMNS.items()},
    )
    unit = _time_unit(time, t, bool(gyro and accel))
    facts.append(f"time: {time!r} in {unit}")
    file = _text(Path(os.path.relpath(path, folder or path.parent)).as_posix())
    source = Source(table, file, time, unit, facts)
    parts = [HEAD.format(name=path.name)]
    imu, axes = None, "FRD"
    problems: list[str] = []
    if gyro and accel:
        imu, axes, text = _imu(source, t * UNITS["time"][unit], gyro, accel, problems)
        parts.append(text)
    else:
        problems.append("no gyro and accelerometer columns were recognised: name them in [imu]")
        parts.append(NO_IMU)
    parts += _aidings(source, fixes)
    if magnetic := _triple(names, MAG):
        parts.append(_magnetometer(source, magnetic, axes))
    tilt = {key: _find(names, NO_ANGLE + pattern) for key, pattern in ANGLE_COLUMNS.items()}
    if tilt["roll"] and tilt["pitch"]:
        parts.append(_attitude(source, [name for name in tilt.values() if name]))
    return Guess(facts, problems, imu, "\n".join(parts))


HEAD = """# Drafted from {name} by names and magnitudes of its columns. Check every line marked "check".
# date = "2024-01-31"            # check: of the first sample, UTC; only the magnetic field needs it
# vehicle = "car"               # check: any, pedestrian, car, ship, multicopter or aircraft; nothing beyond its speed and heights is believed
"""

NO_IMU = """[imu]                            # check: nothing here was recognised, so this section must be written
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
"""


def _without_header(table: Table) -> Guess:
    ranges = [
        f"column {name}: {np.nanmin(values):.6g} to {np.nanmax(values):.6g}, median "
        f"{np.nanmedian(values):.6g}"
        for name in table.frame.columns
        for values in [table.numbers(name)]
        if np.isfinite(values).any()
    ]
    return Guess(
        [f"table: {len(table.lines)} rows without a header line", *ranges],
        [
            "the table has no header line: name its columns by number in a recording.toml, the "
            "first is 1"
        ],
        None,
        "",
    )


def _find(names: Iterable[str], pattern: str) -> str | None:
    return next((name for name in names if re.fullmatch(pattern + UNIT, _plain(name))), None)


def _plain(name: str) -> str:
    return re.sub(r"^imu[_ .]", "", name.strip().lower())


def _triple(names: Iterable[str], pattern: str) -> list[str] | None:
    """Names of the x, y and z column, or None."""
    found = [
        next(
            (
                name
                for name in names
                if re.fullmatch(pattern + r"[_ .]?" + axis + UNIT, _plain(name))
            ),
            None,
        )
        for axis in "xyz"
    ]
    known = [name for name in found if name]
    return known if len(known) == 3 else None


def _named_unit(name: str, units: Iterable[str]) -> str | None:
    """The unit that the end of a column name spells, or None."""
    ends = [part for part in re.split(r"[\[(]|(?<=[^_ ])[_ ]", _plain(name), maxsplit=4)]
    for unit in units:
        if any(
            re.fullmatch(SPELLINGS[unit] + r"[\])]?", "_".join(ends[i:]))
            for i in range(1, len(ends))
        ):
            return unit
    return None


def _time_unit(name: str, t: Array, is_imu: bool) -> str:
    unit = _named_unit(name, ("ns", "us", "ms", "s"))
    if unit:
        return unit
    interval = float(np.median(np.diff(t[np.isfinite(t)]))) if np.isfinite(t).sum() > 1 else 0.01
    for unit, least in (
        ("ns", 1e6),
        ("us", 1e3 if is_imu else 1e4),
        ("ms", 1.0 if is_imu else 20.0),
    ):
        if interval >= least:
            return unit
    return "s"


def _imu(
    source: Source, t: Array, gyro: list[str], accel: list[str], problems: list[str]
) -> tuple[Imu | None, str, str]:
    """(Imu or None, axes, text of [imu]) with the units and axes that fit gravity best."""
    table = source.table
    raw = [np.stack([table.numbers(name) for name in three], axis=1) for three in (gyro, accel)]
    accel_unit, scale, accel_note = _accel_unit(accel[0], raw[1])
    named = _named_unit(gyro[0], ("rad/s", "deg/s"))
    candidates = [named] if named else ["rad/s", "deg/s"]
    imu = axes = None
    try:
        for gyro_unit in candidates:
            imu, _ = increments(
                t,
                raw[0] * UNITS["angular rate"][gyro_unit],
                raw[1] * (scale * UNITS["acceleration"][accel_unit]),
                "rate",
                Origin(table.name, table.lines, "line"),
            )
            axes = axes or _axes(np.median(half_seconds(imu)[1], axis=0))
            turn = axes_matrix(axes[0], BODY_AXES).T
            imu = imu._replace(dtheta=imu.dtheta @ turn, dv=imu.dv @ turn)
            if not any(field == "gyro.unit" for field, _ in mistakes(imu, "rate")):
                break
    except DataError as error:
        problems.append(str(error))
    axes = axes or ("FRD", "check: forward-right-down")
    gyro_note = (
        "      # check: the unit is not in the name"
        if gyro_unit == candidates[0]
        else "      # check: too large for rad/s"
    )
    gyro_note, sure = ("", "") if len(candidates) == 1 else (gyro_note, " (a guess)")
    source.facts.append(
        f"gyro: {', '.join(gyro)} in {gyro_unit}{sure}; accel: {', '.join(accel)} in {accel_unit}"
        + (f" times {scale:g}" if scale != 1 else "")
        + f"; axes {axes[0]} ({axes[1].removeprefix('check: ')})"
    )
    factor = f", scale = {scale:.6g}" if scale != 1 else ""
    return (
        imu,
        axes[0],
        f"""[imu]
{source.keys}
kind = "rate"                    # check: "increment" where the columns are rotation and velocity increments
axes = "{axes[0]}"                     # {axes[1]}
gyro  = {{ columns = [{", ".join(map(_text, gyro))}], unit = "{gyro_unit}" }}{gyro_note}
accel = {{ columns = [{", ".join(map(_text, accel))}], unit = "{accel_unit}"{factor} }}{accel_note}
# mounting = {{ roll = 0.0, pitch = 0.0, heading = 0.0, unit = "deg" }}    # sensor to body, where the IMU is not aligned with the vehicle
lever_arm = [0.0, 0.0, 0.0]      # check: m, forward-right-down, from the vehicle's reference point to the IMU
# grade = "consumer"             # check: a name from `strapdown imus`, or an ImuSpec file
""",
    )


def _accel_unit(name: str, raw: Array) -> tuple[str, float, str]:
    """(unit, scale, comment) of the accelerometer columns."""
    with np.errstate(invalid="ignore"):
        magnitude = float(np.nanmedian(np.linalg.norm(raw, axis=1)))
    unit = _named_unit(name, ("m/s^2", "mg", "g"))
    if unit is None:
        unit = next(
            (
                u
                for u, gravity in (("m/s^2", G), ("g", 1.0), ("mg", 1000.0))
                if 0.6 < magnitude / gravity < 1.7
            ),
            None,
        )
        return (
            (unit, 1.0, f"      # check: median magnitude is {magnitude:.4g}")
            if unit
            else (
                "m/s^2",
                G / magnitude if magnitude > 0 else 1.0,
                "      # check: counts? scale was set so that the median magnitude is gravity",
            )
        )
    return unit, 1.0, ""


def _axes(force: Array) -> tuple[str, str]:
    """(axes, comment) that turn the median specific force to -z."""
    main = int(np.argmax(np.abs(force)))
    up = force[main] > 0
    if main == 2:
        return (
            ("FLU", "check: z points up; RFU where x points right and y forward")
            if up
            else ("FRD", "z points down; check that x points forward")
        )
    forward, other = ("z", "y") if main == 0 else ("x", "z")
    down = ("-" if up else "+") + "xyz"[main]
    for sign in "+-":
        text = f"+{forward} {sign}{other} {down}"
        try:
            axes_matrix(text, BODY_AXES)
            return text, "check: gravity lies on " + "xyz"[main] + "; forward and right are a guess"
        except DataError:
            continue
    raise AssertionError("one of the two signs makes them right-handed")


def _aidings(source: Source, fixes: dict[str, str | None]) -> list[str]:
    """Texts of [[aiding]] for a position and a velocity found in the table."""
    parts: list[str] = []
    names = [name for key in ("latitude", "longitude", "height") if (name := fixes[key])]
    if len(names) == 3:
        angle, factor = _angle_unit(names[0], source.table.numbers(names[0]))
        scale = f"\nscale = [{factor}, {factor}, 1.0]           # check" if factor != 1 else ""
        parts.append(f"""[[aiding]]
kind = "position"
{source.keys}
columns = [{", ".join(map(_text, names))}]
unit = ["{angle}", "{angle}", "m"]    # check: height above the ellipsoid{scale}
sd = [2.0, 2.0, 4.0]             # check: m, or columns of the table
lever_arm = [0.0, 0.0, 0.0]      # check: m, forward-right-down, from the vehicle's reference point to the antenna
""")
        source.facts.append(f"position: {', '.join(names)} in {angle}, {angle}, m")
    vertical = fixes["down"] or fixes["up"]
    north, east = fixes["north"], fixes["east"]
    if north and east and vertical:
        names = [north, east, vertical] if fixes["down"] else [east, north, vertical]
        parts.append(f"""[[aiding]]
kind = "velocity"
{source.keys}
columns = [{", ".join(map(_text, names))}]
unit = "m/s"                     # check
axes = "{"NED" if fixes["down"] else "ENU"}"
sd = [0.2, 0.2, 0.3]             # check: m/s, or columns of the table
lever_arm = [0.0, 0.0, 0.0]      # check: the same antenna
""")
        source.facts.append(f"velocity: {', '.join(names)}")
    return parts


def _magnetometer(source: Source, names: list[str], axes: str) -> str:
    """Text of [[aiding]] for a magnetometer, its unit the one of its name or that gives about
    the Earth's field."""
    with np.errstate(invalid="ignore"):
        median = float(
            np.nanmedian(
                np.linalg.norm(
                    np.stack([source.table.numbers(name) for name in names], axis=1), axis=1
                )
            )
        )
    known, named = (
        UNITS["magnetic field"],
        _named_unit(names[0], ("uT", "nT", "mgauss", "gauss", "T")),
    )
    tesla = named or next(
        (each for each in known if 0.32 < median * known[each] / EARTH_FIELD < 3.2), None
    )
    scale = 1.0 if tesla or not median > 0 else EARTH_FIELD / known["uT"] / median
    tesla, sure = tesla or "uT", "" if named else " (a guess)"
    counts = "" if scale == 1 else "; counts? scale was set to the Earth's field"
    checked = "" if named else f"      # check: median strength is {median:.4g}{counts}"
    source.facts.append(
        f"magnetometer: {', '.join(names)} in "
        f"{tesla}{sure}{f' times {scale:g}' if scale != 1 else ''}; "
        "the draft has it as a magnetic-field: check its axes and calibrate it"
    )
    factor = f"scale = {scale:.6g}\n" if scale != 1 else ""
    return f"""[[aiding]]
kind = "magnetic-field"
{source.keys}
columns = [{", ".join(map(_text, names))}]
unit = "{tesla}"{checked}
{factor}axes = "{axes}"                     # check: those of the IMU; many magnetometers have others
sd = {1e-6 / known[tesla]:.3g}                         # check: in the unit above, here 1 uT
field = "record"                 # check: headings are from magnetic north; for true north give date and place at the top instead
# place = {{ latitude = 47.0, longitude = 8.0, height = 500.0, unit = "deg" }}    # this line belongs to the top, beside date
# calibration = "mag.toml"       # what `strapdown calibrate` wrote; few magnetometers are right without
"""


def _attitude(source: Source, names: list[str]) -> str:
    """Text of an [[aiding]] that is commented out: a logged attitude is most often another
    filter's, made of this same IMU."""
    named = _named_unit(names[0], ("rad", "deg"))
    largest = max(
        (
            float(np.nanmax(np.abs(values)))
            for name in names
            for values in [source.table.numbers(name)]
            if np.isfinite(values).any()
        ),
        default=0.0,
    )
    angle = named or ("rad" if 0 < largest < 6.3 else "deg")
    source.facts.append(
        f"attitude: {', '.join(names)} in {angle}{'' if named else ' (a guess)'}; the draft has it "
        f"commented out"
    )
    return f"""# An attitude beside the IMU is most often that of another filter, made of this same IMU: not independent of it.
# Take the marks off these lines where an AHRS's attitude shall aid a filter that is fed with one; to score against it,
# name it in [reference] with its positions.
# [[aiding]]
# kind = "attitude"
# file = {source.file}
# time = {{ column = {_text(source.time)}, unit = "{source.unit}" }}
# columns = [{", ".join(map(_text, names))}]
# unit = "{angle}"{"" if named else f"      # check: the largest is {largest:.4g}"}
# sd = {"1.0" if angle == "deg" else "0.02"}                       # check: in that unit, of roll, pitch and heading
# axes = "FRD to NED"            # check: or "FLU to ENU"
"""


def _angle_unit(name: str, values: Array) -> tuple[str, float]:
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if largest > 180:
        return "deg", 1e-7
    return _named_unit(name, ("rad", "deg")) or ("rad" if 0 < largest < np.pi / 2 else "deg"), 1


def _text(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
