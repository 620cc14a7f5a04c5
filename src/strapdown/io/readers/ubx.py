"""Logs of u-blox receivers: UBX messages, alone or mixed with NMEA, RTCM and text.

Positions and velocities are those of NAV-PVT, with the digits of NAV-HPPOSLLH where it is there, or
of the NAV-POSLLH, NAV-VELNED and NAV-SOL of older receivers; where there is none of them, those of
the NMEA in the same file. The IMU is that of ESF-RAW or ESF-MEAS. Fixes that the receiver fused with
inertial sensors (types 1 and 4) are no independent aiding. Sources: the interface descriptions of
u-blox 6, M8 and F9.
"""

from pathlib import Path

import numpy as np

from ...checks import DataError
from ...units.time_scales import gps_from_unix
from ..decoding.antenna_pair import baseline_section
from ..decoding.carrier_classes import by_class
from ..decoding.receivers.cyclic_times import CyclicClock
from ..decoding.receivers.nmea_fixes import nmea_log
from ..decoding.receivers.nmea_sentences import Sentences, epochs, find_sentences
from ..decoding.receivers.ubx_fixes import (
    Columns,
    baselines,
    solutions,
    untimed_message_lines,
    usable,
    vehicle,
)
from ..decoding.receivers.ubx_frames import UbxFrames, UbxMessage, clock, find_frames
from ..decoding.receivers.ubx_imu import ImuEpochs, imu_sections
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable, head_of, packed_suffixes, read_bytes

START = 1 << 18
"""Bytes in which a log must show a frame to be known by its content."""
FUSED = (
    "made with the receiver's own inertial sensors (fix types 1 and 4), no independent aiding; --take "
    "gnss={} takes it all the same"
)
CARRIER = {"fixed": (2,), "float": (1,), "single": (0,)}
"""Carrier solutions of NAV-PVT."""
LEFT_OUT = {
    0x1015: "ESF-INS: free of gravity, so no accelerometer",
    0x2802: "HNR-INS: compensated by the receiver's own fusion",
    0x2800: "HNR-PVT: made by the receiver's own fusion",
    0x0105: "NAV-ATT: made by the receiver's own fusion",
}


def open_ubx(path: Path) -> Log:
    """The Log of a file. Raises DataError where it holds no UBX message."""
    return ubx_log(path, read_bytes(path))


def ubx_log(path: Path, data: bytes) -> Log:
    """The Log of the bytes of a file. Raises DataError where they hold no UBX message."""
    frames = find_frames(data)
    if not len(frames.start):
        raise DataError(f"{path}: holds no whole UBX message; is it the log of a u-blox receiver?")
    time = clock(frames)
    tables: dict[str, FileTable] = {}
    name, found = solutions(frames, time)
    said, sections = _fixes(path, name, found, time, tables)
    left = untimed_message_lines(frames) + said
    sentences = find_sentences(b"" if name else data)
    if not name:
        nmea = nmea_log(path, sentences)
        tables |= nmea.tables
        fused = frames.count(UbxMessage.NAV_PVAT) > 0
        sections += [
            each._replace(left=FUSED.format(0)) if fused else each for each in nmea.sections
        ]
        left += nmea.left
    elif b"GGA," in data or b"RMC," in data:
        left.append("NMEA of the same receiver: the UBX messages say the same with more digits")
    sections += _vehicle(path, frames, time, tables)
    sections += _baseline(path, frames, time, tables, left)
    sections += imu_sections(path, frames, _epochs(found, time, sentences), tables, left)
    left += [f"{why} ({many})" for key, why in LEFT_OUT.items() if (many := frames.count(key))]
    left += _damage(frames)
    facts = [f"{path}: {len(frames.start)} UBX messages{_kinds(frames)}"]
    return Log(tables, tuple(sections), tuple(facts), tuple(left))


def _kinds(frames: UbxFrames) -> str:
    known = {each.value: each.title for each in UbxMessage}
    keys, many = np.unique(frames.key, return_counts=True)
    shown = [f"{known[key]} {n}" for key, n in zip(keys.tolist(), many) if key in known]
    return f": {', '.join(shown)}" if shown else ""


def _damage(frames: UbxFrames) -> list[str]:
    lines = []
    if frames.rejected:
        lines.append(f"{frames.rejected} UBX frames fail their checksum")
    if frames.cut:
        lines.append(f"{frames.cut} UBX frames are cut short")
    return lines


def _table(path: Path, name: str, columns: Columns, time: CyclicClock) -> FileTable:
    values = {key: each for key, each in columns.items() if key not in ("t", "row", "place", "ok")}
    first = {time.column: columns["t"]}
    return FileTable.of(f"{path} [{name}]", first | values, columns["row"], "message")


def _fixes(
    path: Path, name: str, found: Columns, time: CyclicClock, tables: dict[str, FileTable]
) -> tuple[list[str], list[Section]]:
    """(lines on what is left, sections) of positions and velocities."""
    left: list[str] = []
    sections: list[Section] = []
    if not name:
        return left, sections
    if not time.absolute and len(found["t"]):
        left.append(
            "dates: no message says a valid one; the week is that of another file that tells it"
        )
    for instance, kinds, why in ((0, (2, 3), ""), (1, (1, 4), FUSED.format(1))):
        columns, late, twice = usable(found, kinds)
        many = len(columns["t"])
        if not many:
            continue
        table = name if not instance else f"{name} fused"
        tables[table] = _table(path, table, columns, time)
        flat = int(np.count_nonzero(columns["fixType"] == 2))
        title = f"{name}, {many} fixes" + (f", {flat} of them without height" if flat else "")
        moving = bool(np.isfinite(columns["velN"]).any())
        pair = _pair(table, moving, time, instance, title, why)
        if "carrSoln" in columns:
            pair[:1] = by_class(pair[0], columns["carrSoln"], "carrSoln", CARRIER, "numSV")
        sections += pair
        if late or twice:
            left.append(
                f"{table}: {late} messages out of order, which are sorted, {twice} repeated"
            )
    none = len(found["t"]) - sum(len(tables[each].lines) for each in tables)
    if none > 0:
        left.append(f"{none} epochs of {name} without a fix that the receiver stands by")
    return left, sections


def _pair(
    table: str, moving: bool, time: CyclicClock, instance: int, title: str, why: str
) -> list[Section]:
    """Sections of position and velocity of one table."""
    common = {"table": table, "time": time.time}
    position = {
        "kind": "position",
        **common,
        "columns": ["lat", "lon", "height"],
        "unit": ["deg", "deg", "m"],
        "std": ["hAcc", "hAcc", "vAcc"],
    }
    velocity = {
        "kind": "velocity",
        **common,
        "columns": ["velN", "velE", "velD"],
        "unit": "m/s",
        "std": "sAcc",
    }
    every = [position, velocity] if moving else [position]
    return [Section("source", "gnss", keys, instance, title, left=why) for keys in every]


def _vehicle(
    path: Path, frames: UbxFrames, time: CyclicClock, tables: dict[str, FileTable]
) -> list[Section]:
    """The receiver's own fusion as a reference, left until it is asked for."""
    if not frames.count(UbxMessage.NAV_PVAT):
        return []
    columns, _, _ = usable(vehicle(frames, time), (2, 3, 4))
    if not len(columns["t"]):
        return []
    tables["NAV-PVAT"] = _table(path, "NAV-PVAT", columns, time)
    keys = {
        "table": "NAV-PVAT",
        "time": time.time,
        "position": {"columns": ["lat", "lon", "height"], "unit": ["deg", "deg", "m"]},
        "velocity": {"columns": ["velN", "velE", "velD"], "unit": "m/s", "axes": "NED"},
        "attitude": {"columns": ["vehRoll", "vehPitch", "vehHeading"], "unit": "deg"},
    }
    title = f"NAV-PVAT, {len(columns['t'])} rows"
    why = "made by the receiver's own fusion; --take reference=0 scores against it"
    return [Section("reference", "reference", keys, 0, title, left=why)]


def _baseline(
    path: Path,
    frames: UbxFrames,
    time: CyclicClock,
    tables: dict[str, FileTable],
    left: list[str],
) -> list[Section]:
    """The vector between two antennas, left until it is asked for."""
    told = frames.count(UbxMessage.NAV_RELPOSNED)
    columns = baselines(frames, time)
    many = len(columns["t"])
    if told > many:
        left.append(
            f"{told - many} NAV-RELPOSNED without a carrier solution to an antenna that moves along "
            "(one at a fixed base shows no attitude)"
        )
    if not many:
        return []
    name = UbxMessage.NAV_RELPOSNED.title
    tables[name] = _table(path, name, columns, time)
    keys = {
        "table": name,
        "time": time.time,
        "columns": ["relPosN", "relPosE", "relPosD"],
        "std": ["accN", "accE", "accD"],
    }
    vectors = np.stack([columns[column] for column in keys["columns"]], axis=1)
    return [baseline_section(keys, vectors, name)]


def _epochs(found: Columns, time: CyclicClock, sentences: Sentences) -> ImuEpochs:
    """Return the epochs of the UBX messages, or else of the NMEA in the file."""
    if found:
        return ImuEpochs(found["place"], found["t"] / 1e3, time.absolute)
    place, ms, absolute = epochs(sentences)
    return ImuEpochs(place, gps_from_unix(ms / 1e3) if absolute else ms / 1e3, absolute)


def sniff(path: Path) -> bool:
    """Return True where the file holds UBX frames near its beginning."""
    return len(find_frames(head_of(path, START)).start) > 0


READER = Reader(
    "ubx",
    packed_suffixes(".ubx", ".log", ".txt"),
    "log of a u-blox receiver",
    sniff=sniff,
    open=open_ubx,
)
