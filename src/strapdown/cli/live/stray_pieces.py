"""Bytes between the messages of a receiver that are no message: UBX, NMEA and RTCM 3 have frames."""

import re
from functools import reduce
from operator import xor

from ...io.decoding.receivers.ubx_frames import find_frames

SENTENCE = re.compile(rb"[$!]([^$!*\r\n]{1,120})\*([0-9A-Fa-f]{2})")
"""NMEA 0183."""
RTCM = 0xD3
"""First byte of a frame of RTCM 3; 10 bits of length follow, and 3 bytes of checksum at the end."""
ENDS = b"\r\n"
WIDEST = 1 << 14
"""Bytes without a message, after which they count at once."""


class StrayPieces:
    """Counts pieces of no message between messages; the first bytes may be the rest of one."""

    def __init__(self) -> None:
        self._rest, self._begun = b"", False  # bytes since the last message

    def count(self, data: bytes) -> int:
        """Take the next bytes and return the number of pieces that end with them."""
        data = self._rest + data
        frames = find_frames(data)
        starts = (frames.start - 6).tolist()
        found = [(at, at + size + 8) for at, size in zip(starts, frames.length.tolist())]
        found += [each.span() for each in SENTENCE.finditer(data) if _is_whole(each)]
        pieces, end = 0, 0
        for start, stop in sorted(found):
            pieces += self._begun and start > end and _is_stray(data[end:start])
            end, self._begun = max(end, stop), True
        self._rest = data[end:]
        if len(self._rest) > WIDEST:
            self._rest, pieces = b"", pieces + 1
        return pieces


def _is_whole(sentence: re.Match[bytes]) -> bool:
    return reduce(xor, sentence[1]) == int(sentence[2], 16)


def _is_stray(piece: bytes) -> bool:
    """Return True for bytes that are neither ends of lines nor frames of RTCM."""
    piece = piece.lstrip(ENDS)
    while len(piece) > 2 and piece[0] == RTCM:
        piece = piece[((piece[1] & 3) << 8 | piece[2]) + 6 :].lstrip(ENDS)
    return bool(piece)
