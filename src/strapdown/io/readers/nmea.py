"""Logs of NMEA 0183: GGA, GNS, RMC, GLL, VTG, GST, ZDA, HDT and THS of any talker, plain or among
other text. Positions are above the ellipsoid: altitude plus the separation of the geoid."""

import re
from pathlib import Path

from ...checks import DataError
from ..decoding.receivers.nmea_fixes import nmea_log
from ..decoding.receivers.nmea_sentences import find_sentences
from ..decoding.receivers.ubx_frames import find_frames
from ..reader import Log, Reader
from ..tables.table_file import head_of, packed_suffixes, read_bytes

START = 1 << 18
"""Bytes in which a log must show a sentence to be known by its content."""
SENTENCE = re.compile(rb"[$!][A-Z]{2}[A-Z]{3},[^$*\r\n]{0,120}\*[0-9A-Fa-f]{2}")
ANDROID = b"NMEA,$"
"""First bytes of sentences that logs of Android's GnssLogger quote; they have a reader of their own."""


def open_nmea(path: Path) -> Log:
    """The Log of a file. Raises DataError where it has no position, velocity or heading."""
    return log_of_bytes(path, read_bytes(path))


def log_of_bytes(path: Path, data: bytes) -> Log:
    """The Log of the bytes of a file. Raises DataError as `open_nmea`."""
    sentences = find_sentences(data)
    log = nmea_log(path, sentences)
    if log.sections:
        return log
    what = "; ".join(log.left) or "it has no GGA, GNS, RMC, GLL, VTG, HDT or THS"
    raise DataError(f"{path}: NMEA without a usable position, velocity or heading: {what}")


def sniff(path: Path) -> bool:
    """Return True where the file holds NMEA sentences near its beginning and is no log of u-blox
    messages."""
    data = head_of(path, START)
    found = SENTENCE.search(data) is not None and ANDROID not in data
    return found and not len(find_frames(data).start)


READER = Reader(
    "nmea", packed_suffixes(".nmea", ".log", ".txt"), "NMEA 0183", sniff=sniff, open=open_nmea
)
