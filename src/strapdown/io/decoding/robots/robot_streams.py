"""The messages of a robot's log on one clock, that of their headers."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ....checks import DataError
from ....typing import Ints
from ....units.time_scales import rate_of
from .ros_messages import Columns, Decoded, Messages, RosTopic
from .ros_transforms import plain

SECOND = 1_000_000_000
"""ns"""
YEAR_2000 = 946_684_800 * SECOND
"""ns of POSIX time: an earlier clock counts from another zero."""


class TopicStream(NamedTuple):
    """The messages of one topic."""

    topic: str
    type: str
    frame: str  # frame_id, without a slash before it
    stamp: Ints  # (n,) ns, time of measurement
    record: Ints  # (n,) ns, time of recording
    columns: Columns
    remark: str = ""  # on its times
    absolute: bool = False  # whether `stamp` is POSIX time

    @property
    def time(self) -> dict[str, Any]:
        """`time` of its sections, whose tables have the column "stamp"."""
        clock = {"clock": "unix"} if self.absolute else {}
        return {"column": "stamp", "unit": "ns", **clock}

    @property
    def rate(self) -> float:
        """Hz."""
        return rate_of(self.stamp, 1 / SECOND)

    @property
    def fact(self) -> str:
        """A line on its content."""
        frame = f", frame {self.frame}" if self.frame else ""
        late = float(np.median(self.record - self.stamp)) / SECOND
        recorded = f", recorded {late:.3f} s after its stamp" if abs(late) > 5e-4 else ""
        return (
            f"{self.topic}: {self.type}, {len(self.stamp)} messages, {self.rate:.4g} Hz{frame}"
            f"{recorded}{self.remark and f'; {self.remark}'}"
        )

    def text(self, column: str) -> str:
        """Return the most frequent text in a column."""
        return _commonest(self.columns[column])


def streams_of(messages: Messages) -> tuple[list[TopicStream], list[str]]:
    """Return the streams of a log on one clock by topic name, and lines on what is left out.

    The clock is absolute where one of them has an absolute clock. Raises DataError where a log has
    nothing that can be used.
    """
    found, left = [], []
    for topic, decoded in messages.decode():
        stream, lines = _stream(topic, decoded)
        found += [stream] if stream is not None else []
        left += lines
    absolute = any(_is_absolute(each.stamp) for each in found)
    on_clock = []
    for each in found:
        if _is_absolute(each.stamp) == absolute:
            on_clock.append(each._replace(absolute=absolute))
        elif absolute and _is_absolute(each.record):
            behind = int(np.median(each.record - each.stamp))
            remark = "its stamps are on a clock of their own, set by the median recording time"
            on_clock.append(each._replace(stamp=each.stamp + behind, absolute=True, remark=remark))
        else:
            left.append(f"{each.topic}: its clock differs from that of the other topics")
    if not on_clock:
        there = sorted({topic.type for topic in messages.topics.values()})
        raise DataError(
            f"holds no IMU, fixes or odometry of a supported type; it has "
            f"{', '.join(there[:10]) or 'no topics'}"
        )
    return on_clock, left


def _stream(topic: RosTopic, decoded: Decoded) -> tuple[TopicStream | None, list[str]]:
    """Return the TopicStream of a topic on its own clock, and lines on what is not used."""
    columns, record, left = decoded.columns, decoded.record, []
    many = len(record) + decoded.wrong
    if decoded.wrong:
        left.append(
            f"{decoded.wrong} of {many} messages of {topic.name} do not fit their definition"
        )
    if not len(record):
        return None, left
    frame, remark, stamp = "", "", record
    if "sec" in columns:
        stamp = columns["sec"].astype(np.int64) * SECOND + columns["nanosec"]
        frame = plain(_commonest(columns["frame_id"]))
    if "sec" not in columns or not stamp.any():
        what = "no stamps" if "sec" not in columns else "stamps of zero"
        stamp, remark = record, f"it has {what}: the times are those of recording, which are later"
    stamped = stamp != 0
    if not stamped.all():
        left.append(f"{np.sum(~stamped)} of {many} messages of {topic.name} have no stamp")
        stamp, record = stamp[stamped], record[stamped]
        columns = {name: each[stamped] for name, each in columns.items()}
    return TopicStream(topic.name, topic.type, frame, stamp, record, columns, remark), left


def _is_absolute(times: Ints) -> bool:
    return float(np.median(times)) >= YEAR_2000


def _commonest(texts: "np.ndarray[Any, Any]") -> str:
    alike = texts == texts[0]
    if not alike.all():
        names, counts = np.unique(texts, return_counts=True)
        return _text(names[np.argmax(counts)])
    return _text(texts[0])


def _text(raw: bytes) -> str:
    return bytes(raw).rstrip(b"\0").decode("utf-8", "replace")


def unread(topics: Iterable[RosTopic]) -> list[str]:
    """Return lines on the topics that are not read, one for each type."""
    by_type: dict[tuple[str, str], list[str]] = {}
    for topic in topics:
        if topic.why_left and "TFMessage" not in topic.type and "tfMessage" not in topic.type:
            by_type.setdefault((topic.type, topic.why_left), []).append(topic.name)
    return [
        f"{kind or 'messages'} on {_some(sorted(set(names)))}: {why}"
        for (kind, why), names in sorted(by_type.items())
    ]


def _some(names: list[str]) -> str:
    more = len(names) - 4
    return ", ".join(names[:4]) + (f" and {more} more" if more > 0 else "")
