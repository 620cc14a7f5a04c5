"""PX4's ULog: `decoding/px4.py` says which of its topics make a recording, and why."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...units.time_scales import gps_from_unix, iso
from ..decoding.autopilots import autopilot
from ..decoding.autopilots.px4 import (
    DELAYS,
    SINCE_2001,
    baselines,
    imus,
    is_unix,
    others,
    receivers,
    topic_columns,
    trajectories,
)
from ..decoding.autopilots.ulog import MAGIC, ULog
from ..decoding.record_walk import Tables
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable, packed_suffixes, read_bytes


def _table(path: Path, log: ULog, name: str, instance: int) -> FileTable:
    columns, rows = topic_columns(log, name, instance)
    return FileTable.of(f"{path} [{name} {instance}]", columns, rows)


def _head(log: ULog, sections: list[Section]) -> dict[str, Any]:
    """Epoch, date and vehicle, as far as the log says them."""
    head: dict[str, Any] = {}
    fixes = [each for each in sections if each.role == "gnss"]
    if is_unix(log):
        head["date"] = iso(float(gps_from_unix(log.start * 1e-6)))[:10]
    elif fixes:
        name, _, instance = fixes[0].keys["table"].rpartition(" ")
        columns, _ = topic_columns(log, name, int(instance))
        utc = columns["time_utc_usec"].astype(np.int64)
        gps = np.where(utc > SINCE_2001, gps_from_unix(utc * 1e-6), np.nan)
        time = fixes[0].keys["time"]
        t = columns[time["column"]] * 1e-6 + time.get("offset", 0.0)
        head = autopilot.zero_of_clock(gps, t)
    vehicle = autopilot.VEHICLES.get(log.parameters.get("MAV_TYPE", 0))
    return head | ({"vehicle": vehicle} if vehicle else {})


def open_ulog(path: Path) -> Log:
    """Raises DataError."""
    log = ULog(read_bytes(path))
    makers: dict[str, Callable[[], FileTable]] = {
        f"{name} {instance}": partial(_table, path, log, name, instance)
        for name, instance in log.topics
    }
    sections, left = imus(log)
    of_receivers, more = receivers(log)
    of_antennas, vectors_left = baselines(log)
    left += more + vectors_left
    head = _head(log, of_receivers)
    sections += of_receivers + of_antennas + others(log, "date" in head)
    for columns, section in trajectories(log):
        table = section.keys["table"]
        makers[table] = partial(FileTable.of, f"{path} [{table}]", columns)
        sections.append(section)
    left += log.remarks
    left += autopilot.changes(log.parameters, log.changed, DELAYS)
    version = " ".join(log.info.get(key, "") for key in ("sys_name", "ver_hw")).strip()
    facts = (f"PX4 ULog{version and f' of {version}'}, {len(log.topics)} topics",)
    return Log(Tables(makers), tuple(sections), facts, tuple(left), (), head)


READER = Reader("ulog", packed_suffixes(".ulg"), "PX4 log", open=open_ulog, begins=(MAGIC,))
