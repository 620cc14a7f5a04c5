"""Make a Recording from a description: columns become signals, units SI, sensor axes body axes;
fixes are checked against the IMU."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...alignment.location import place_of
from ...checks import DataError, locate_errors
from ...core.loop.contract import Imu
from ...data.recording import Recording, RecordingMeta
from ...data.solution import ATTITUDE_COLUMNS, NAV_COLUMNS, Source, Trajectory
from ...preprocessing.attitude_checks import sound_attitude
from ...preprocessing.attitude_record import angles, quaternions
from ...preprocessing.axes import permute_axes, rotate_rows
from ...preprocessing.fixes import clean, clean_reference, little_overlap, overlap
from ...preprocessing.imu_samples import increments
from ...preprocessing.joined_imu import join_imu
from ...preprocessing.origin import Origin
from ...preprocessing.other_forms import attitudes
from ...preprocessing.vehicle_rest import WINDOW, vehicle_at_rest
from ...preprocessing.wheel_slip import without_slip
from ...typing import Array, File
from ...units.conversion import DEG, factor
from ...units.time_scales import iso, utc
from ..magnetic_record import sound_samples
from ..reader import Made
from ..tables.table_file import FileTable
from ..unfelt_tilt import accusation, decide_accusation
from .calibrations import calibrate_imu, frames, kept_temperatures
from .fix_columns import FixColumns, Whereabouts, read_columns, read_fixes
from .installed import installation_numbers
from .magnetic_sources import calibrate_field, with_field
from .messages import load
from .schema import Description, ImuPart, ReferencePart, Vector
from .schema_base import Signal
from .schema_source import SourcePart
from .source_files import Files

OF_LOGS = (
    " in the draft of `strapdown inspect ... --write recording.toml`; `--take magnetometer=none` leaves "
    "it out"
)
"""Place for keys that logs lack."""
MAX_PER_SAMPLE = 10
"""Largest number of fixes of a constraint per IMU sample; more add no information and use
memory."""
FAR_LEVEL = 10
"""Difference of the mean sea level from the height of the place, in standard deviations, that
causes a note."""


def read_description(path: File) -> Recording:
    """Return the Recording that a `recording.toml` describes. Raises a one-line DataError."""
    description = load(Path(path))
    recording = recording_of(description, Files(path, description.epoch))
    told = assumption_notes(description.imu)
    return recording.with_meta(read=told) if told else recording


def assumption_notes(part: ImuPart) -> list[str]:
    """Return lines on the keys of its IMU that a description marks as assumed."""
    remedies = {key: "remove it from [imu] assumed" for key in part.assumed}
    if part.guessed_axes:
        remedies["axes"] = "remove its question mark"
    return [
        f"assumed: imu {key}{f' = {value}' if isinstance(value := getattr(part, key), str) else ''}: "
        f"the description marks it; check it, then {remedy}"
        for key, remedy in remedies.items()
    ]


def recording_of(description: Description, files: Files) -> Recording:
    """Return the Recording of a description and the files that it names. Raises a one-line
    DataError."""
    path = files.path
    parts = [*description.source, description.reference]
    files.later = {part.file for part in parts if part is not None and part.file is not None}
    imu, notes = read_imu(description.imu, files)
    accused = accusation(imu, description.imu.kind, description.vehicle, str(path))
    sources: list[Source] = []
    found, more = read_sources(description, imu, files, _surely)
    notes += more
    for number, source in sorted(found.items()):
        others = [other.name for other in sources]
        sources.append(source if source.name not in others else _number_source(source, number))
    meta = read_meta(description, files, float(imu.t[0]))
    notes += level_notes(sources, meta)
    for k, part in enumerate(description.source):
        sources[k], more = read_field(part, k + 1, sources[k], sources, imu, meta, path)
        notes += more
    reference = None
    if description.reference is not None:
        whereabouts = Whereabouts(sources, description.lla)
        reference, more = read_reference(description.reference, imu, files, whereabouts)
        notes += more
    notes = [*files.notes, *notes]
    recording = Recording(imu, tuple(sources), reference, meta)
    recording = recording.with_meta(**kept_temperatures(description.imu, files))
    if sensors := frames(description, files, sources):
        recording = recording.with_meta(sensors=sensors)
    recording = recording.with_meta(installed=installation_numbers(description), notes=notes)
    return decide_accusation(recording, accused)


def _surely(function: Callable[..., Made], *arguments: Any) -> Made | None:
    return function(*arguments)


def read_sources(
    description: Description, imu: Imu, files: Files, attempt: Callable[..., Any]
) -> tuple[dict[int, Source], list[str]]:
    """({number of its [[source]]: Source} in the order of reading, notes); `attempt` calls the
    function that reads a source, and returns None for one that is left out."""
    found: dict[int, Source] = {}
    notes: list[str] = []
    for number, part in in_order(description):
        where = (files, list(found.values()), description.lla)
        read = attempt(read_source, part, number, description.imu.lever_arm, imu, *where)
        if read is not None:
            found[number], more = read
            notes += more
    return found, notes


def in_order(description: Description) -> list[tuple[int, SourcePart]]:
    """(number, section) of every [[source]] in the order of reading: ECEF vectors need the
    positions before them, and constraints at rest need the sensors that show a rest."""
    parts = enumerate(description.source, 1)
    return sorted(parts, key=lambda each: (not each[1].sensor.recorded, each[1].needs_place))


def _number_source(source: Source, number: int) -> Source:
    return replace(source, name=f"{source.name} {number}")


def read_meta(description: Description, files: Files, first: float) -> RecordingMeta:
    """Return the metadata of a Recording that its description gives: name, epoch, date (that of the
    sample at `first` s, where only an absolute clock has it), place, grade, vehicle, guessed axes,
    point, mounting (roll, pitch, heading, rad) and lever arm of the IMU, and its estimated
    parameters. Raises DataError."""
    grade = description.imu.grade
    if grade and grade.endswith(".toml"):
        grade = str(files.locate(grade))
    epoch = None if files.epoch is None else iso(files.epoch)
    mounting = description.imu.mounting
    found = {
        "name": files.path.stem,
        "epoch": epoch,
        "date": description.date or (None if epoch is None else str(utc(epoch, first))[:10]),
        "place": description.lla,
        "grade": grade,
        "vehicle": description.vehicle,
        "estimate": description.imu.estimate or None,
        "height_columns": _height_columns(description.source) or None,
        "guessed_axes": description.imu.guessed_axes,
        "imu_mounting": mounting and mounting.angles,
        "point": description.point,
        "imu_lever_arm": list(description.imu.lever_arm),
    }
    known = {key: value for key, value in found.items() if value is not None}
    return cast(RecordingMeta, known)


def _height_columns(parts: Iterable[SourcePart]) -> dict[str, str]:
    """{column of heights above the ellipsoid: source that uses it}."""
    of_heights = [part for part in parts if part.sensor.name in ("position", "altitude")]
    return {
        column: part.name or part.kind for part in of_heights if (column := height_column(part))
    }


def height_column(part: SourcePart | Vector) -> str:
    """Return the column of a height above the ellipsoid; "" where it has no name or is above the
    geoid."""
    column = (part.columns or [""])[-1] if part.geoid is None else ""
    return column if isinstance(column, str) else ""


def level_notes(sources: Iterable[Source], meta: RecordingMeta) -> list[str]:
    """Return notes on a mean sea level far from the height of the `place` in the metadata."""
    found = [
        (source, float(source.y[0, 0]), float(source.std[0, 0]))
        for source in sources
        if source.kind == "zero-sea-level" and len(source.t)
    ]
    height = meta["place"][2] if "place" in meta else None
    return [
        f"{source.name}: its level is {level:g} m, but the height of place is {height:g} m, "
        f"{abs(level - height) / std:.0f} standard "
        "deviations apart: check both; they are m above the ellipsoid"
        for source, level, std in found
        if height is not None and abs(level - height) > FAR_LEVEL * std
    ]


def read_imu(part: ImuPart, files: Files) -> tuple[Imu, list[str]]:
    """(Imu in body FRD, notes) of the section [imu], not yet checked for mistaken units."""
    (origin, t, gyro, notes), (own, t_accel, accel, left_out) = (
        _signal(part, signal, dimension, files)
        for signal, dimension in zip((part.gyro, part.accel), part.dimensions)
    )
    if part.temperature is None:
        files.forget(part.file)
    if np.array_equal(t, t_accel, equal_nan=True):
        imu, more = increments(t, gyro, accel, part.kind, origin)
    else:
        of_gyro, more = increments(t, gyro, gyro, part.kind, origin)
        of_accel, of_its_own = increments(t_accel, accel, accel, part.kind, own)
        with locate_errors(f"{files.path}: [imu]"):
            imu, joining = join_imu(of_gyro, of_accel)
        more += of_its_own + [f"imu: {note}" for note in joining]
    notes += [note for note in left_out if note not in notes] + more
    gyro, accel, more = calibrate_imu(part, files, imu)
    C = part.matrix
    turn = permute_axes if part.mounting is None else rotate_rows
    return Imu(imu.t, imu.dt, turn(gyro, C), turn(accel, C)), notes + more


def _signal(
    part: ImuPart, signal: Signal, dimension: str, files: Files
) -> tuple[Origin, Array, Array, list[str]]:
    """(origin, t in s, (n, 3) in SI, notes) of gyro or accel, in the axes of the columns."""
    own = signal.file is not None or signal.table is not None
    table, t, columns, notes = files.columns(
        signal.file or part.file,
        signal.time or part.time,
        signal.columns,
        signal.table if own else part.table,
        () if own else part.where,
    )
    values, scale = np.empty((len(t), 3)), signal.scale * factor(signal.unit, dimension)
    for k, cells in enumerate(columns):
        np.multiply(cells, scale, out=values[:, k])
    return table.origin, t, values, notes


def read_source(
    part: SourcePart,
    number: int,
    imu_lever_arm: list[float],
    imu: Imu,
    files: Files,
    others: Collection[Source] = (),
    place: Sequence[float] | None = None,
) -> tuple[Source, list[str]]:
    """(Source, notes) of one section [[source]]. The speeds of `others` exclude rests; their
    positions, or else the `place` of the recording, give the position of the vehicle. Raises
    DataError."""
    where = f"{files.path}: [[source]] {number} ({part.kind})"
    if not part.sensor.recorded:
        t, y, std, notes = _constraint(part, imu, others, where)
        return _make_source(part, imu_lever_arm, t, y, std), notes
    if part.receiver and _class_is_missing(part, files):
        t, rows = np.empty(0), np.empty((0, len(part.sensor.quantities)))
        note = f"{part.name or part.kind}: the log has no fix of this class"
        return _make_source(part, imu_lever_arm, t, rows, rows), [note]
    fixes = _of_the_body(part, imu, files, Whereabouts(others, place), where)
    made = _make_source(part, imu_lever_arm, fixes.t, fixes.y, fixes.std)
    source, more = clean(made, part.sensor, fixes.origin)
    overlap(imu, source.t, where, files.epoch)
    notes = [*fixes.notes, *more, *(each.line for each in little_overlap(imu, source))]
    if part.slip_test and part.kind == "speed":
        source, slipped = without_slip(source, imu)
        notes += slipped
    return source, notes


def _class_is_missing(part: SourcePart, files: Files) -> bool:
    """True where a log has no fix of this class of its receiver."""
    assert part.file is not None and part.columns is not None  # the schema asks for both
    return bool(part.where) and not files.has_rows(part.file, part.columns, part.table, part.where)


def _make_source(
    part: SourcePart, imu_lever_arm: list[float], t: Array, y: Array, std: Array
) -> Source:
    """Return the Source of these rows with the other keys of its section."""
    own: Iterable[float] = part.parameters
    if part.sensor.parameters in ("antenna", "reference"):
        own = np.array(part.lever_arm or [0.0] * 3) - imu_lever_arm
    return Source(
        part.kind,
        t,
        y,
        std,
        (*map(float, own), *part.more_parameters),
        part.gate,
        part.name or part.kind,
        part.estimated,
        part.slip,
        part.correlated_errors,
        part.robust,
        part.adaptive,
        part.receiver or "",
    )


def _of_the_body(
    part: SourcePart, imu: Imu, files: Files, whereabouts: Whereabouts, where: str
) -> FixColumns:
    """Return the rows of a recorded source in the axes of its kind, without stuck or saturated
    samples."""
    fixes = read_fixes(part, files, whereabouts, where)
    if part.sensor.name == "attitude":
        fixes = _attitude(part, fixes, imu, whereabouts, where)
    if part.sensor.parameters == "field":
        fixes = _field(part, fixes, imu, files)
    matrix = part.matrix
    if matrix is None:
        return fixes
    return fixes._replace(
        y=permute_axes(fixes.y, matrix), std=permute_axes(fixes.std, np.abs(matrix))
    )


def _attitude(
    part: SourcePart, fixes: FixColumns, imu: Imu, whereabouts: Whereabouts, where: str
) -> FixColumns:
    """Return roll, pitch and heading of the body, rad, from the columns of an attitude, without
    stuck fixes."""
    t, y, std, origin, _ = fixes
    if part.ecef:
        q = quaternions(y, part.quaternion, part.axes, origin)
        with locate_errors(where):
            q = attitudes(q, whereabouts.at(t))
        y = Trajectory(t, np.empty((0, 3)), q_nb=q).rph
    else:
        y = angles(y, part.quaternion, part.axes, origin)
    std = np.c_[std, np.full((len(std), 3 - std.shape[1]), np.nan)]
    keep, notes = sound_attitude(t, y, imu, part.name or part.kind, where)
    return fixes._replace(y=y, std=std).keep_rows(keep, notes)


def _field(part: SourcePart, fixes: FixColumns, imu: Imu, files: Files) -> FixColumns:
    """Return the calibrated samples of a magnetometer, without stuck and saturated ones."""
    name = part.name or part.kind
    keep, notes = sound_samples(fixes.t, fixes.y, imu, name, fixes.origin, part.vector_matrix)
    fixes = fixes.keep_rows(keep, notes)
    return fixes._replace(y=calibrate_field(part, files, fixes.y))


def read_field(
    part: SourcePart,
    number: int,
    source: Source,
    sources: Sequence[Source],
    imu: Imu,
    meta: RecordingMeta,
    path: File,
) -> tuple[Source, list[str]]:
    """(Source, notes): a magnetometer with the Earth's field at `place_of` as parameters; other
    sources unchanged."""
    if part.sensor.parameters != "field":
        return source, []
    place = place_of(meta, sources)
    try:
        return with_field(part, source, imu, meta.get("date"), place and place.lla)
    except DataError as error:
        lacks = part.field is None and (place is None or meta.get("date") is None)
        of_logs = lacks and Path(path).suffix.lower() != ".toml"
        raise DataError(
            f"{path}: [[source]] {number} ({part.kind}) {error}{OF_LOGS if of_logs else ''}"
        ) from None


def _constraint(
    part: SourcePart, imu: Imu, others: Iterable[Source], where: str
) -> tuple[Array, Array, Array, list[str]]:
    """(t, y, std, notes) of a constraint. Raises DataError."""
    t, notes = _constraint_times(part, imu, others, where)
    shape = (len(t), len(part.sensor.quantities))
    std = np.broadcast_to(np.array(part.std, float), shape).copy()
    if not part.sensor.mean_of:
        return t, np.full(shape, part.level or 0.0), std, notes
    y, std, scatter = _imu_means(part, t, std, imu)
    return t, y, std, notes + scatter


def _constraint_times(
    part: SourcePart, imu: Imu, others: Iterable[Source], where: str
) -> tuple[Array, list[str]]:
    """(Times at the rate of a constraint, s, within IMU samples and, for kinds that need it, at
    rest; notes). Raises DataError."""
    assert part.rate is not None  # the schema requires one of every constraint
    start, most = float(imu.t[0] - imu.dt[0]), MAX_PER_SAMPLE / float(np.median(imu.dt))
    if part.rate > most * (1 + 1e-6):
        raise DataError(
            f"{where} rate: {part.rate:g} Hz is more than {MAX_PER_SAMPLE} times the rate of the IMU; "
            f"give {most:.4g} Hz or less"
        )
    t = start + np.arange(1, int((imu.t[-1] - start) * part.rate + 1e-9) + 1) / part.rate
    sample = np.minimum(np.searchsorted(imu.t, t - 1e-9), len(imu.t) - 1)
    use = t > imu.t[sample] - imu.dt[sample] - 1e-9
    if not part.sensor.when:
        return t[use], []
    rests = vehicle_at_rest(imu, others)[sample]
    if part.sensor.when == "moving":
        return t[use & ~rests], []
    t = t[use & rests]
    return t, [
        f"{part.kind}: "
        f"{f'at rest for {len(t) / part.rate:.1f} s' if len(t) else 'no rest was found, so it never applies'}"
    ]


def _imu_means(part: SourcePart, t: Array, std: Array, imu: Imu) -> tuple[Array, Array, list[str]]:
    """(y, std, notes): the mean reading of the IMU over the step before each of the times t. At rest, of at
    least 1 s, no std is below the scatter of these means from step to step."""
    assert part.rate is not None
    edges, step = np.r_[imu.t[0] - imu.dt[0], imu.t], 1.0 / part.rate
    over_time = min(step, WINDOW)
    increments = imu.dtheta if part.sensor.mean_of == "gyro" else imu.dv
    sums = np.vstack([np.zeros(4), np.cumsum(np.c_[increments, imu.dt], axis=0)])
    over = np.stack(
        [np.interp(t, edges, each) - np.interp(t - over_time, edges, each) for each in sums.T],
        axis=1,
    )
    y = (over[:, :3] / over[:, 3:])[:, : std.shape[1]]
    neighbours = np.diff(t) < 1.5 * step
    if part.sensor.when != "at rest" or not neighbours.any():
        return y, std, []
    # half, because the difference of two means has twice the variance of one
    scatter = np.sqrt(0.5 * np.mean(np.diff(y, axis=0)[neighbours] ** 2, axis=0))
    if np.all(scatter <= std[0]):
        return y, std, []
    return (
        y,
        np.maximum(std, scatter),
        [
            f"{part.kind}: its means scatter by {scatter.max():.2g} rad/s, more than std = "
            f"{std[0, scatter.argmax()]:.2g}; the scatter is used"
        ],
    )


def read_reference(
    part: ReferencePart, imu: Imu, files: Files, whereabouts: Whereabouts
) -> tuple[Trajectory, list[str]]:
    """(Trajectory, notes) of the section [reference]. Raises DataError."""
    notes: list[str] = []
    if part.parts:
        t, lla, v_n, q_nb, origin, notes = read_columns(part, files, whereabouts)
    else:
        table = files.table(part.file, table=part.table)
        t, lla, v_n, q_nb, origin = _own_table(table, files)
    reference, more = clean_reference(t, lla, v_n, q_nb, origin)
    overlap(imu, reference.t, f"{files.path}: [reference]", files.epoch)
    return reference, notes + more


def _own_table(
    table: FileTable, files: Files
) -> tuple[Array, Array, Array | None, Array | None, Origin]:
    """Read a table of this library: t in s, then columns of `Trajectory.table`, in degrees, m and
    m/s; units may follow the names in brackets."""
    known = {str(name).partition(" [")[0]: name for name in table.names}

    def has(names: list[str]) -> bool:
        return all(name in known for name in names)

    def three(names: list[str]) -> Array:
        return np.stack([table.numbers(known[name]) for name in names], axis=1)

    if not has(["t", *NAV_COLUMNS[:3]]):
        raise DataError(
            f"{files.path}: [reference] time: is missing; {table.name} has no columns t, lat, lon, "
            f"alt, "
            "so time and position must be given"
        )
    v_n = three(NAV_COLUMNS[3:6]) if has(NAV_COLUMNS[3:6]) else None
    rph = three(ATTITUDE_COLUMNS) if has(ATTITUDE_COLUMNS) else None
    q_nb = None if rph is None else quaternions(rph * DEG, None, None, table.origin)
    return (
        table.numbers(known["t"]),
        three(NAV_COLUMNS[:3]) * [DEG, DEG, 1.0],
        v_n,
        q_nb,
        table.origin,
    )
