"""Formats of other devices that are recognised by content but not read. A file is refused with the
name of its format, the reason and a tool that converts it to tables."""

import re
import zlib
from binascii import crc_hqx
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...checks import DataError
from ..decoding.receivers.nmea_sentences import PATTERN
from ..decoding.receivers.ubx_frames import find_frames
from ..reader import Log, Reader
from ..tables.table_file import head_of, packed_suffixes

START = 1 << 16
"""Number of bytes by which a file is recognised."""
CAN_LINE = re.compile(
    rb"^(?:\(\d+\.\d+\) \S+ [0-9A-F]{8}#[0-9A-F]*"  # candump -L
    rb"|\d{4}-\d\d-\d\d[T-][\d:.]+Z?,\d,\d{4,6},\d{1,3},\d{1,3},\d{1,3}(?:,[0-9a-fA-F]{2})+)\s*$",  # canboat
    re.MULTILINE,
)
MIP_SETS = {*range(1, 16), *range(0x7F, 0xB0)}
"""Descriptor sets of MIP, by their numbers: commands, system and data."""
TABLES = "`strapdown inspect FILE.csv --write recording.toml` drafts the description of its tables"


class Format(NamedTuple):
    """A format that is not read."""

    name: str
    is_it: Callable[[bytes], bool]  # by the first START bytes
    why: str  # reason why it is not read
    remedy: str


class Packet(NamedTuple):
    """Framing of a device's data: packets with a length and a checksum at the end."""

    mark: bytes  # first bytes
    head: int  # bytes of the header with the length
    size: Callable[[bytes], int]  # bytes before the checksum, from the header; 0 for other bytes
    checksum: Callable[[bytes], bytes]  # of these bytes

    def stands_in(self, data: bytes) -> bool:
        """Return True where the data contain a complete packet."""
        for at in _places(data, self.mark):
            head = data[at : at + self.head]
            size = self.size(head) if len(head) == self.head else 0
            if size and at + size < len(data):
                told = self.checksum(data[at : at + size])
                if data.startswith(told, at + size):
                    return True
        return False


def _fletcher(data: bytes) -> bytes:
    a = b = 0
    for byte in data:
        a = (a + byte) & 255
        b = (b + a) & 255
    return bytes((a, b))


def _crc24(data: bytes) -> bytes:
    """The cyclic redundancy check 24Q, highest bit first."""
    crc = 0
    for byte in data:
        crc ^= byte << 16
        for _ in range(8):
            crc = ((crc << 1) ^ 0x864CFB if crc & 0x800000 else crc << 1) & 0xFFFFFF
    return crc.to_bytes(3, "big")


def _of_rtcm(head: bytes) -> int:
    payload = int.from_bytes(head[1:], "big")
    return 3 + payload if 3 <= payload < 1024 else 0


# 75 65, descriptor set, length, payload, Fletcher's checksum of all (MicroStrain MIP protocol)
MIP = Packet(
    b"ue",
    4,
    lambda head: 4 + head[3] if head[2] in MIP_SETS else 0,
    _fletcher,
)
# 55 55, two letters or digits, length, payload, CRC 16 (Aceinna OpenIMU serial protocol)
OPENIMU = Packet(
    b"UU",
    5,
    lambda head: 5 + head[4] if head[2:4].isalnum() else 0,
    lambda data: crc_hqx(data[2:], 0x1D0F).to_bytes(2, "big"),
)
# AA 44 12 with a long head, AA 44 13 with a short one, CRC 32 (OEM7 commands and logs reference)
NOVATEL = Packet(
    b"\xaaD",
    12,
    lambda head: {
        0x12: head[3] + int.from_bytes(head[8:10], "little"),
        0x13: 12 + head[3],
    }.get(head[2], 0),
    lambda data: (zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF).to_bytes(4, "little"),
)
# D3, six zero bits, length, payload, CRC 24Q
RTCM = Packet(b"\xd3", 3, _of_rtcm, _crc24)


def has_mavlink(data: bytes) -> bool:
    """Return True where the data begin with five consecutive MAVLink packets, each after an 8-byte
    time as in a telemetry log, or without times."""
    for gap in (8, 0):
        at = 0
        for _ in range(5):
            at += gap
            if at + 3 > len(data) or data[at] not in (0xFD, 0xFE):
                break
            signed = 13 * (data[at] == 0xFD and data[at + 2] & 1)
            at += data[at + 1] + (12 if data[at] == 0xFD else 8) + signed
        else:
            return True
    return False


def is_sbet(data: bytes) -> bool:
    """Return True where the data are records of 17 floats as in an SBET: time of the week,
    latitude, longitude in rad, height, ..."""
    count = len(data) // 136
    if count < 1 or (len(data) < START and len(data) % 136):
        return False
    records = np.frombuffer(data[: 136 * count], "<f8").reshape(count, 17)
    with np.errstate(invalid="ignore"):
        bounds = np.array([6048e2, np.pi / 2, np.pi, 2e4, 1e3, 1e3, 1e3, 4, 4, 7, 7])
        fits = (np.abs(records[:, :11]) <= bounds).all()
        moving = np.all(np.diff(records[:, 0]) > 0) and records[0, 0] > 0
    return bool(fits and moving and np.abs(records[:, 1:3]).min() > 1e-6)


def _places(data: bytes, mark: bytes, most: int = 200) -> list[int]:
    """The first places of a mark."""
    found: list[int] = []
    at = data.find(mark)
    while at >= 0 and len(found) < most:
        found.append(at)
        at = data.find(mark, at + 1)
    return found


FORMATS = (
    Format(
        "an MP4 or MOV video",
        lambda data: data[4:8] == b"ftyp",
        "a GoPro video contains telemetry (GPMF), but no time per sample",
        f"gopro-telemetry or exiftool write tables of it; {TABLES}",
    ),
    Format(
        "GoPro telemetry (GPMF)",
        lambda data: data[:4] == b"DEVC",
        "it has no time per sample and its axes depend on the camera",
        f"gopro-telemetry writes tables of it; {TABLES}",
    ),
    Format(
        "a log of NMEA 2000 (CAN bus)",
        lambda data: len(CAN_LINE.findall(data)) >= 2,
        "several devices send the same quantity, and you must choose by their addresses",
        f"canboat's `analyzer -json` decodes it; write tables of the chosen devices; {TABLES}",
    ),
    Format(
        "a capture of network packets (pcap)",
        lambda data: (
            data[:4] in (b"\n\r\r\n", b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1")
        ),
        "it holds the device's data inside network packets",
        "save them with Wireshark (Follow TCP Stream, as Raw) and name that file",
    ),
    Format(
        "a MicroStrain log (MIP)",
        MIP.stands_in,
        "its messages are not decoded here",
        f"SensorConnect or MSCL export tables of it (accelerations in g); {TABLES}",
    ),
    Format(
        "a NovAtel OEM log",
        NOVATEL.stands_in,
        "its corrected IMU messages (CORRIMU) hold increments without gravity, which no filter here "
        "can use",
        f"NovAtel Convert or novatel_edie write tables of BESTPOS, BESTVEL and RAWIMU; {TABLES}",
    ),
    Format(
        "MAVLink telemetry (.tlog)",
        has_mavlink,
        "a radio link transmits too few IMU samples",
        "use the onboard log of the vehicle, .ulg of PX4 or .BIN of ArduPilot",
    ),
    Format(
        "a Betaflight blackbox log",
        lambda data: b"H Product:Blackbox flight data recorder" in data[:4096],
        "its frames are not decoded here",
        f"blackbox_decode of blackbox-tools converts it to tables; {TABLES}",
    ),
    Format(
        "a log of an Aceinna OpenIMU",
        OPENIMU.stands_in,
        "its packets are not decoded here",
        f"Aceinna's python-openimu writes tables of it (gyro in deg/s, time in us); {TABLES}",
    ),
    Format(
        "RINEX",
        lambda data: b"RINEX VERSION / TYPE" in data[:200] or b"CRINEX VERS" in data[:200],
        "it holds observations of satellites and no positions",
        "RTKLIB's rnx2rtkp makes a .pos of them, which is read",
    ),
    Format(
        "RTCM 3",
        RTCM.stands_in,
        "it holds observations of satellites and no positions",
        "RTKLIB's convbin and rnx2rtkp make a .pos of them, which is read",
    ),
    Format(
        "a solution of Applanix POSPac (SBET)",
        is_sbet,
        "it is already a solution, 17 floats per record, angles in rad",
        f"PDAL (readers.sbet) writes tables of it, as a reference to score against; {TABLES}",
    ),
)


def unsupported_format(path: Path) -> Format | None:
    """Return the format of a file by its first bytes; None for other files, and for a supported
    format that only contains parts of these."""
    data = head_of(path, START)
    found = next((each for each in FORMATS if each.is_it(data)), None)
    if found is None or len(find_frames(data).start) or PATTERN.search(data):
        return None
    return found


def open_unread(path: Path) -> Log:
    """Raise DataError with the name of the format, the reason and the remedy."""
    found = unsupported_format(path)
    if found is None:
        raise DataError(f"{path}: its format is unknown")
    raise DataError(f"{path}: is {found.name}, which cannot be read: {found.why}; {found.remedy}")


def sniff(path: Path) -> bool:
    """Return True where the file has one of these formats."""
    return unsupported_format(path) is not None


READER = Reader(
    "unread",
    packed_suffixes(".tlog", ".bbl", ".sbet", ".pcapng", ".mp4", ".rtcm3", ".rnx"),
    "",
    sniff=sniff,
    open=open_unread,
)
