"""One description from the files of devices: the sections that a recording takes, as a Recording or
as the text of a `recording.toml`."""

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from ...checks import DataError, check_choice, printable
from ...data.recording import Recording
from ...typing import File
from ...units.conversion import factor
from ...units.time_scales import rate_of
from ..reader import GUESS, ROLES, Log, Section
from ..registry import ask, looker
from ..tables.table_file import FileTable
from .clocks import OneClock, one_clock
from .imu_grade import CLASSES, nearest_grade
from .messages import load
from .read import read_imu, recording_of
from .source_files import Files, times_of

HEAD = """# Drafted from {names}. Check every line marked "check".
"""
OPTIONAL = {
    "date": '# date = "2024-01-31"            # of the first sample, UTC; only the magnetic field needs it',
    "vehicle": '# vehicle = "car"               # any, pedestrian, car, ship, multicopter or aircraft; values beyond its speed and heights are rejected',
}
"""Optional keys at the top of a draft, where the files do not set them."""
COMMENT = 33
"""Column at which comments of a draft begin, if there is room."""
OTHER_PIECE = {
    "gyro": ("accelerometer", "Accelerometer.csv"),
    "accel": ("gyroscope", "Gyroscope.csv"),
}
"""The missing part of an IMU with gyro or accel alone: its name, and an example of a file with
it."""
Take = Mapping[str, int | None]
"""{role: instance} that the user chooses; None leaves the role out."""


class Taken(NamedTuple):
    """A section and its file."""

    path: Path
    section: Section

    @property
    def name(self) -> str:
        """`imu 1 of flight.ulg`."""
        return f"{self.section.role} {self.section.instance} of {self.path.name}"


class Joined(NamedTuple):
    """One recording joined from several files: its sections, and those left out with the reason."""

    paths: tuple[Path, ...]
    logs: Mapping[Path, Log]
    head: Mapping[str, Any]
    taken: tuple[Taken, ...]
    # sections left out, with the reason
    left: tuple[tuple[Taken, str], ...]
    clock: OneClock

    @property
    def asked(self) -> list[str]:
        """Questions to answer before the files can be read."""
        lines = [f"{path}: {line}" for path in self.paths for line in self.logs[path].asked]
        lines += self.clock.asked
        if not lines:
            lines += self.without_imu
        return lines + [line for line, refused in self._slow() if refused]

    @property
    def without_imu(self) -> list[str]:
        """Return the line on the missing part of an IMU; nothing for a complete one."""
        there = {_piece(each.section): each for each in self.taken if each.section.of == "imu"}
        names = ", ".join(map(str, self.paths))
        if len(there) == 1 and "" not in there:  # gyro or accel
            piece, each = next(iter(there.items()))
            missing, as_in = OTHER_PIECE[piece]
            return [
                f"{names}: no {missing} in {each.path.name}; name the file that has it too, as in "
                f"strapdown fuse {each.path.name} {as_in}"
            ]
        unusable = [why for each, why in self.left if each.section.of == "imu"]
        if there or unusable:
            return [] if there else [f"{names}: {unusable[0]}"]
        return [
            f"{names}: no IMU in {'it' if len(self.paths) == 1 else 'them'}; name its file "
            f"too, as in strapdown fuse imu.csv {self.paths[0].name}"
        ]

    def _slow(self) -> Iterator[tuple[str, bool]]:
        """(line on a slow IMU, whether it is refused), for logs of devices; a bare table may have
        any content."""
        for each in self.taken:
            log = self.logs[each.path]
            found = slow(each.section, log.tables) if log.reader != "table" else None
            if found:
                yield f"{each.name}: {found[0]}", found[1]

    @property
    def told(self) -> list[str]:
        """Lines on what is taken, assumed and left out."""
        taken = [
            f"taken: {each.name}{each.section.title and f': {each.section.title}'}"
            for each in self.taken
        ]
        assumed = [
            f"assumed: {_role_name(each.section)} {key} = {_value(each.section.keys[key])}: {why}"
            for each in self.taken
            for key, why in each.section.assumed.items()
        ]
        assumed += [f"assumed: {line}" for line in self.clock.assumed]
        left = [f"left: {each.name}: {why}" for each, why in self.left]
        left += [
            f"left: {path.name}: {line}" for path in self.paths for line in self.logs[path].left
        ]
        notes = [f"note: {line}" for line, refused in self._slow() if not refused]
        return list(dict.fromkeys([*taken, *assumed, *notes, *left]))

    def with_grade(self, grade: str | None = None) -> "Joined":
        """Return a copy with the grade of its IMU: `grade`, else the grade that the log states,
        else the one that fits the samples, marked as assumed."""
        of_imu = [each for each in self.taken if each.section.of == "imu"]
        if grade is None and any("grade" in each.section.keys for each in of_imu):
            return self
        name, why = (grade, "") if grade else self._fitting_grade()

        def set_grade(each: Taken) -> Taken:
            if each not in of_imu:
                return each
            keys, assumed = dict(each.section.keys), dict(each.section.assumed)
            keys["grade"], assumed["grade"] = name, why
            told = {key: text for key, text in assumed.items() if text}
            return each._replace(section=each.section._replace(keys=keys, assumed=told))

        return self._replace(taken=tuple(map(set_grade, self.taken)))

    def _fitting_grade(self) -> tuple[str, str]:
        """(grade that fits the samples, why); the worst one where they cannot be read."""
        label = Path(", ".join(map(str, self.paths)))
        try:
            description = load(label, self.content("."))
            files = Files(label, description.epoch, ".", dict(self.logs))
            return nearest_grade(read_imu(description.imu, files)[0])
        except DataError:  # reading or inspection reports it
            return CLASSES[-1], "the samples cannot be read yet, so the worst one"

    def content(self, folder: File) -> dict[str, Any]:
        """Return the description in the form of a `recording.toml` in `folder`."""
        content: dict[str, Any] = dict(self.head)
        for each in _join_imus(self.taken, folder):
            keys = _keys(each, folder)
            if each.section.of == "source":
                content.setdefault("source", []).append(keys)
            else:
                content[each.section.of] = keys
        return content

    def text(self, folder: File) -> str:
        """Return the text of that file, with the assumptions as comments."""
        parts = [HEAD.format(names=", ".join(printable(path.name) for path in self.paths))]
        parts[0] += "".join(f"{key} = {_value(value)}\n" for key, value in self.head.items())
        parts[0] += "".join(f"{line}\n" for key, line in OPTIONAL.items() if key not in self.head)
        parts += [_text(each, folder) for each in _join_imus(self.taken, folder)]
        for each, why in self.left:
            if each.section.left and each.section.of == "source":
                lines = [f"left out: {why}", *_text(each, folder).splitlines()]
                parts.append("".join(f"# {printable(line)}".rstrip() + "\n" for line in lines))
        return "\n".join(parts)

    @property
    def name(self) -> str:
        """The name of the recording: that of the first file, without endings."""
        return self.paths[0].name.partition(".")[0] or self.paths[0].name


def open_logs(paths: Iterable[File]) -> dict[Path, Log]:
    """Return {path: Log} of files that may make one recording together. Raises DataError."""
    logs: dict[Path, Log] = {}
    for path in map(Path, paths):
        reader = looker(path)
        if reader.open is None:
            raise DataError(
                f"{path}: is a complete recording and is read alone; leave the other files out"
            )
        if path in logs:
            raise DataError(f"{path}: is named twice; name it once")
        logs[path] = ask(reader, "open", path)._replace(reader=reader.name)
    return logs


def join(logs: Mapping[Path, Log], take: Take | None = None) -> Joined:
    """Join one recording from these files. Each role comes from the last file that has it, with its
    first instance or the one that `take` names. Raises DataError."""
    take = dict(take or {})
    for role in take:
        check_choice(role, "instance of", ROLES)
    every = [Taken(path, section) for path, log in logs.items() for section in log.sections]
    taken: list[Taken] = []
    left: list[tuple[Taken, str]] = []
    for role in ROLES:
        of_role = [each for each in every if each.section.role == role]
        chosen = _choose_sections(role, of_role, take)
        taken += [each for each in of_role if each in chosen]
        left += [(each, _why(each, role, take)) for each in of_role if each not in chosen]
    head: dict[str, Any] = {}
    of_imu = [each.path for each in taken if each.section.of == "imu"]
    for path in [*of_imu, *logs]:
        head |= {key: value for key, value in logs[path].head.items() if key not in head}
    clock = one_clock([(each.path, each.section) for each in taken], logs, head)

    def complete(each: Taken) -> Taken:
        return each._replace(section=clock.complete(each.path, each.section))

    return Joined(
        tuple(logs),
        logs,
        head,
        tuple(map(complete, taken)),
        tuple((complete(each), why) for each, why in left),
        clock,
    )


def _choose_sections(role: str, of_role: Sequence[Taken], take: Take) -> list[Taken]:
    """Return the sections of one role that are taken."""
    wanted = take.get(role)
    if role in take and wanted is None:
        return []
    if wanted is not None:
        found = [each for each in of_role if each.section.instance == wanted]
        if not found:
            there = sorted({each.section.instance for each in of_role})
            raise DataError(
                f"there is no {ROLES[role]} {wanted}; "
                + (f"of them there is {', '.join(map(str, there))}" if there else "none was found")
            )
    else:
        found = [each for each in of_role if not each.section.left]
    pieces = {_piece(each.section) for each in found}
    chosen = []
    for piece in sorted(pieces):  # gyro and accel of an IMU may come from different files
        of_piece = [each for each in found if _piece(each.section) == piece]
        last = [each for each in of_piece if each.path == of_piece[-1].path]
        first = min(each.section.instance for each in last)
        chosen += [each for each in last if each.section.instance == first]
    return chosen


def _piece(section: Section) -> str:
    """Return "gyro" or "accel" for an IMU section that has only that, else ""."""
    alone = [key for key in ("gyro", "accel") if key in section.keys]
    return alone[0] if section.of == "imu" and len(alone) == 1 else ""


def _why(each: Taken, role: str, take: Take) -> str:
    if role in take and take[role] is None:
        return "not wanted"
    if not each.section.keys:  # an empty section cannot be taken
        return each.section.left
    number = each.section.instance
    how = f"--imu {number}" if role == "imu" else f"--take {role}={number}"
    why = each.section.left or f"one {ROLES[role]} is taken"
    return why if how in why else f"{why}; {how} takes it"


def _role_name(section: Section) -> str:
    """Return the role; for a receiver, with the kind of its fixes."""
    return f"gnss {section.keys['kind']}" if section.role == "gnss" else section.role


def _join_imus(taken: Iterable[Taken], folder: File) -> list[Taken]:
    """Return the sections in the order of a description, with an IMU of two pieces as one
    section."""
    found = sorted(taken, key=lambda each: ["imu", "source", "reference"].index(each.section.of))
    pieces = {_piece(each.section): each for each in found if each.section.of == "imu"}
    if set(pieces) < {"gyro", "accel"} or "" in pieces:
        return found
    gyro, accel = pieces["gyro"], pieces["accel"]
    own = {
        key: value
        for key, value in _keys(accel, folder).items()
        if key in ("file", "table", "time")
    }
    signal = {**accel.section.keys["accel"], **own}
    keys = {**accel.section.keys, **gyro.section.keys, "accel": signal}
    assumed = {**accel.section.assumed, **gyro.section.assumed}
    whole = Taken(gyro.path, gyro.section._replace(keys=keys, assumed=assumed))
    return [whole, *(each for each in found if each.section.of != "imu")]


def _keys(each: Taken, folder: File) -> dict[str, Any]:
    file = Path(os.path.relpath(each.path, folder)).as_posix()
    of_file = (
        {} if each.section.keys.get("rate") and "time" not in each.section.keys else {"file": file}
    )
    kind = {"kind": each.section.keys["kind"]} if "kind" in each.section.keys else {}
    return {**kind, **of_file, **each.section.keys}


def _text(each: Taken, folder: File) -> str:
    """Return a section as text."""
    of, keys = each.section.of, _keys(each, folder)
    lines = ["[[source]]" if of == "source" else f"[{of}]"]
    for key, value in keys.items():
        line, why = f"{key} = {_value(value)}", each.section.assumed.get(key, "")
        lines.append(f"{line:{COMMENT - 1}} # check: {printable(why)}" if why else line)
    guessed = [key for key in keys if each.section.assumed.get(key)]
    if str(keys.get("axes", "")).endswith(GUESS):  # marks itself
        guessed.remove("axes")
    if of == "imu" and guessed:
        line = f"assumed = {_value(guessed)}"
        lines.append(f"{line:{COMMENT - 1}} # take a key out once you have checked its line")
    return "\n".join([*lines, *map(printable, each.section.remarks)]) + "\n"


def _value(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return tomlkit.item(value).as_string()


def read_logs(paths: Sequence[File], take: Take | None = None) -> Recording:
    """Return the Recording that files of devices make together. Raises a one-line DataError."""
    joined = join(open_logs(paths), take)
    if joined.asked:
        raise DataError(joined.asked[0])
    joined = joined.with_grade()
    label = Path(", ".join(map(str, paths)))
    description = load(label, joined.content("."))
    recording = recording_of(description, Files(label, description.epoch, ".", dict(joined.logs)))
    return recording.with_meta(name=joined.name, read=joined.told)


# ---- minimum rate

MIN_RATES = {"rate": (20.0, 100.0), "increment": (10.0, 20.0)}
"""Hz, by kind of sample: a log below the first rate is refused, below the second one noted. Point
samples lose the motion and vibration between them, which no filter can recover; increments contain
all motion. docs/how-to/flight-controllers.md has measurements."""
ROUNDED = 0.98
"""Ratio above which two rates count as equal: 99 Hz may stand for 100 Hz."""


def slow(section: Section, tables: Mapping[str, FileTable]) -> tuple[str, bool] | None:
    """(line on a slow IMU, whether it is refused); None where it is fast enough, or not the IMU of
    a log."""
    if section.of != "imu":
        return None
    hz, kind = _rate(section, tables), section.keys.get("kind", "rate")
    least, safe = MIN_RATES.get(kind, (0.0, 0.0))
    if hz >= safe * ROUNDED:
        return None
    samples = "increments" if kind == "increment" else "samples"
    refused = hz < least * ROUNDED
    line = (
        f"{hz:.3g} Hz is {'too ' if refused else ''}slow for {samples} of an IMU: at least {least:g} Hz "
        f"are needed, {safe:g} Hz are safe"
    )
    remedy = section.faster or "set the logger to a higher rate"
    return f"{line}; {remedy}", refused


def _rate(section: Section, tables: Mapping[str, FileTable]) -> float:
    """Return the rate of the slower of gyro and accelerometer, Hz: 1 / the median interval;
    infinite where the samples have no times in a log."""
    keys, found = section.keys, {}
    for signal in (keys.get(each, {}) for each in ("gyro", "accel")):
        time, name = signal.get("time", keys.get("time")), signal.get("table", keys.get("table"))
        if time is not None and name in tables and isinstance(time["column"], str):
            found[name, time["column"]] = time
    rates = (_of(tables[name], time) for (name, _), time in found.items())
    return min((hz or math.inf for hz in rates), default=math.inf)


def _of(table: FileTable, time: Mapping[str, Any]) -> float:
    """Return the rate of one table, Hz. Numbers are used without their clock, whose lookup takes
    time."""
    if "format" in time:
        return rate_of(times_of(table, time))
    size = factor(time["unit"], "time") * time.get("scale", 1.0)
    return rate_of(table.numbers(time["column"]), size)
