"""Messages of a u-blox receiver among whatever else came over the same port: NMEA, RTCM, text.

A frame is B5 62, class, identifier, length of the payload (2 bytes, little-endian), payload, and
two bytes of Fletcher's checksum over all but the first two (u-blox M8 and F9 interface
descriptions, "UBX frame structure").
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....typing import Ints
from ..records import Bytes, structured


class Frames(NamedTuple):
    """Frames in the order of the file, whose checksums are right and which do not overlap."""

    content: Bytes
    start: Ints  # of the payloads
    length: Ints  # of the payloads
    key: Ints  # 256 times class plus identifier
    rejected: int  # places that begin like a frame and fail the checksum
    cut: int  # frames that would go on beyond the end

    def count(self, key: int) -> int:
        """How many frames are of this kind."""
        return int(np.count_nonzero(self.key == key))

    def records(self, key: int, layout: np.dtype[Any]) -> tuple[Ints, NDArray[Any]]:
        """(start (n,), records (n,)) of the frames of one kind that are long enough."""
        start = self.start[(self.key == key) & (self.length >= layout.itemsize)]
        return start, structured(self.content, start, layout)


def find_frames(data: bytes) -> Frames:
    """The frames in these bytes."""
    content = np.frombuffer(data, np.uint8)
    sync = np.flatnonzero((content[:-1] == 0xB5) & (content[1:] == 0x62))
    whole = sync[sync + 8 <= len(content)]
    length = content[whole + 4].astype(int) + 256 * content[whole + 5].astype(int)
    inside = whole + 8 + length <= len(content)
    cut, whole, length = whole[~inside], whole[inside], length[inside]
    right = _checksums_right(content, whole, length)
    start, size = whole[right], length[right]
    apart = _without_overlap(start, start + 8 + size)
    start, size = start[apart], size[apart]
    wrong = np.r_[whole[~right], cut, sync[sync + 8 > len(content)]]
    # a payload may hold the first two bytes of a frame by chance
    before = np.searchsorted(start, wrong, side="right") - 1
    ends = np.r_[0, start + 8 + size]
    free = wrong >= ends[before + 1]
    beyond = np.arange(len(wrong)) >= np.count_nonzero(~right)
    key = 256 * content[start + 2].astype(int) + content[start + 3]
    return Frames(
        content,
        start + 6,
        size,
        key,
        int(np.count_nonzero(free & ~beyond)),
        int(np.count_nonzero(free & beyond)),
    )


def _checksums_right(content: Bytes, start: Ints, length: Ints) -> NDArray[np.bool_]:
    """Whether the checksums of candidates are right (n,), from running sums of all bytes: that of
    the sums themselves gives the second byte."""
    if not len(start):
        return np.zeros(0, bool)
    once = np.cumsum(content, dtype=np.uint8)
    twice = np.cumsum(once, dtype=np.uint8)
    first, last = start + 1, start + 5 + length
    many = (length + 4).astype(np.uint8)
    a = once[last] - once[first]
    b = twice[last] - twice[first] - many * once[first]
    return (a == content[last + 1]) & (b == content[last + 2])


def _without_overlap(start: Ints, end: Ints) -> NDArray[np.bool_]:
    """Which of the frames (n,) do not begin inside one before them that counts."""
    keep = np.ones(len(start), bool)
    if (start[1:] >= end[:-1]).all():
        return keep
    free = 0
    for i, (begin, stop) in enumerate(zip(start.tolist(), end.tolist())):
        keep[i] = begin >= free
        free = max(free, stop) if keep[i] else free
    return keep
