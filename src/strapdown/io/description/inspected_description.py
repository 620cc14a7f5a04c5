"""Findings on a `recording.toml`, part by part: an unreadable part does not hide the others."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from ...core.loop.contract import Imu
from ...data.recording import Recording, RecordingMeta
from ...data.solution import Source
from ...data.verdict import Reason
from ...inspection.height_differences import above_sea_level
from ...preprocessing.plausible import NO_GRAVITY, UNFELT, doubts, mistakes
from ..facts import (
    clock_facts,
    gyro_bias_std,
    imu_facts,
    source_facts,
    temperature_facts,
    unusual_imu,
)
from ..locate import locate
from ..magnetic_record import facts_and_reasons
from ..reader import Findings
from ..unfelt_tilt import fixes_confirm
from .calibrations import kept_temperatures
from .fix_columns import Whereabouts
from .logs import Take, join, open_logs
from .messages import complaints, parse
from .read import (
    assumption_notes,
    height_column,
    level_notes,
    read_field,
    read_imu,
    read_meta,
    read_reference,
    read_sources,
)
from .schema import Description
from .schema_source import SourcePart
from .source_files import Files


def inspect_description(path: Path) -> Findings:
    """Return the findings on a description and the files that it names. Raises DataError for a file
    that is not TOML."""
    found, description = Findings.of(), complaints(path)
    if isinstance(description, Description):
        found.add(assumption_notes(description.imu))
        notes = _parts(path, description, found, Files(path, description.epoch))
        found.add(f"note: {note}" for note in notes if note not in found.problems)
        return found
    found.add(problems=description)
    part = parse(path).get("imu")
    file = part.get("file") if isinstance(part, dict) else None
    table = found.attempt(locate, file, path.parent) if isinstance(file, str) else None
    if table is not None:
        found.add(*(found.attempt(inspect_logs, [table], {}) or ()))
    return found


def inspect_logs(paths: Sequence[Path], take: Take) -> Findings:
    """Return the findings on device files that should make one recording, even where they do not.
    Raises DataError where one of them cannot be read."""
    joined = join(open_logs(paths), take).with_grade()
    found = Findings.of(fact for path in paths for fact in joined.logs[path].facts)
    found.add(joined.told, joined.asked)
    if joined.without_imu:
        return found
    label = Path(", ".join(map(str, paths)))
    description = complaints(label, joined.content("."))
    if isinstance(description, Description):
        files = Files(label, description.epoch, ".", dict(joined.logs))
        notes = _parts(label, description, found, files)
        found.add(f"note: {note}" for note in notes if note not in found.problems)
    else:
        found.add(problems=description)
    return found


def _parts(path: Path, description: Description, found: Findings, files: Files) -> list[str]:
    """Return the notes; everything else goes into `found`."""
    imu, notes = found.attempt(read_imu, description.imu, files) or (None, [])
    if imu is None:
        return [*files.notes, *notes]
    meta = found.attempt(read_meta, description, files, float(imu.t[0])) or {}
    meta |= found.attempt(kept_temperatures, description.imu, files) or {}
    wrong = mistakes(imu, description.imu.kind, description.vehicle)
    texts = [*found.problems, *(text for _, text in wrong)]
    without_gravity = any(NO_GRAVITY in text for text in texts)
    unusual = doubts(imu, gyro_bias_std(meta))
    if without_gravity:  # its direction has no information
        unusual = [each for each in unusual if each.cause != "axes"]
    _add_imu(path, imu, meta, wrong, unusual, found)
    sources, more = _sources(path, description, imu, meta, files, found)
    notes += more + _reference(description, imu, sources, files, found)
    recording = Recording(imu, tuple(sources), None, meta)
    _hear_fixes(recording, unusual, found)
    of_fixes = source_facts(imu, sources, meta)
    # without gravity, a comparison with fixes has no meaning
    found.add(*(of_fixes[:1] if without_gravity else of_fixes))
    return [*files.notes, *notes]


def _add_imu(
    path: Path,
    imu: Imu,
    meta: RecordingMeta,
    wrong: Iterable[tuple[str, str]],
    unusual: Iterable[Reason],
    found: Findings,
) -> None:
    """Add facts on the samples, their mistakes (by key of [imu]) and unusual features."""
    if any(NO_GRAVITY in line for line in found.problems):  # which name the columns
        wrong = [(key, text) for key, text in wrong if NO_GRAVITY not in text]
    lines = [*(f"{key}: {text}" for key, text in wrong), *(each.line for each in unusual)]
    found.add(clock_facts(imu, meta.get("epoch")))
    found.add(imu_facts(imu), (f"{path}: [imu] {line}" for line in lines))
    found.add(temperature_facts(meta))


def _sources(
    path: Path,
    description: Description,
    imu: Imu,
    meta: RecordingMeta,
    files: Files,
    found: Findings,
) -> tuple[list[Source], list[str]]:
    """(the readable sources, notes)."""
    read, notes = read_sources(description, imu, files, found.attempt)
    sources, parts = list(read.values()), [(description.source[n - 1], n) for n in read]
    notes = [*notes, *level_notes(sources, meta)]
    return sources, notes + _magnetometers(path, parts, sources, imu, meta, found)


def _reference(
    description: Description, imu: Imu, sources: list[Source], files: Files, found: Findings
) -> list[str]:
    """Notes on the reference, where one is described."""
    if description.reference is None:
        return []
    if description.reference.position is not None:
        column = height_column(description.reference.position)
        found.take([], above_sea_level("reference", column), [])
    whereabouts = Whereabouts(sources, description.lla)
    reference, notes = found.attempt(
        read_reference, description.reference, imu, files, whereabouts
    ) or (None, [])
    found.add([f"reference: {reference!r}"] if reference is not None else [])
    return notes


def _hear_fixes(recording: Recording, unusual: Iterable[Reason], found: Findings) -> None:
    """Withdraw findings on the IMU alone that the fixes contradict: some of the `unusual`, and a
    gyro that tilts without a change of the specific force."""
    kept = unusual_imu(recording, gyro_bias_std(recording.meta))
    denied = tuple(each.line for each in unusual if each not in kept)
    found.problems[:] = [line for line in found.problems if not line.endswith(denied)]
    if any(UNFELT in line for line in found.problems) and fixes_confirm(recording):
        found.problems[:] = [line for line in found.problems if UNFELT not in line]
        found.add(
            [f"tilting {UNFELT}, as on a multicopter: the fixes confirm the unit of the gyro"]
        )


def _magnetometers(
    path: Path,
    parts: Iterable[tuple[SourcePart, int]],
    sources: list[Source],
    imu: Imu,
    meta: RecordingMeta,
    found: Findings,
) -> list[str]:
    """Return notes; each magnetometer among the sources, from the (SourcePart, number) in `parts`,
    gets the Earth's field in place."""
    notes: list[str] = []
    for k, (part, number) in enumerate(parts):
        with_field, more = found.attempt(
            read_field, part, number, sources[k], sources, imu, meta, path
        ) or (None, [])
        if with_field is not None and part.sensor.parameters == "field":
            sources[k] = with_field
            facts, reasons = facts_and_reasons(
                with_field,
                imu,
                part.vector_matrix,
                part.field != "record",
                part.calibration is not None,
            )
            wrong = [each.line for each in reasons]
            found.add(facts, (f"{path}: [[source]] {number} {text}" for text in wrong))
            more = [note for note in more if note not in wrong]
        notes += more
    return notes
