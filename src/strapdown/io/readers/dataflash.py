"""ArduPilot's DataFlash logs: `decoding/ardupilot.py` says which of their messages make a
recording."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...units.time_scales import WEEK
from ..decoding.autopilots import autopilot
from ..decoding.autopilots.ardupilot import Columns, imus, others, receivers, trajectories
from ..decoding.autopilots.dataflash import HEAD, DataFlash
from ..decoding.record_walk import Tables
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable, head_of, packed_suffixes, read_bytes

MAGIC = HEAD + b"\x80"
"""First bytes of a log: those of the record of the format of formats."""
BY_VERSION = {"ArduCopter": "multicopter", "ArduPlane": "aircraft", "ArduRover": "car"}
"""Vehicles by the first word of the version that the autopilot writes."""
BY_PARAMETER = {"LAND_SPEED": "multicopter", "TRIM_ARSPD_CM": "aircraft", "CRUISE_SPEED": "car"}
"""By a parameter that one of them alone has."""
BOAT = 2  # FRAME_CLASS of a rover
LEFT = {
    "ACC": "raw samples with times of their own; IMU is taken",
    "GYR": "raw samples with times of their own; IMU is taken",
    "ISBD": "batches of raw samples with pauses between them; IMU is taken",
}


def _head(log: DataFlash, found: list[tuple[Columns, list[Section]]]) -> dict[str, Any]:
    head: dict[str, Any] = {}
    if found:
        fixes, sections = found[0]
        gps = fixes["GWk"] * float(WEEK) + fixes["GMS"] * 1e-3
        offset = sections[0].keys["time"].get("offset", 0.0)
        gps = np.where(fixes["GWk"] > 0, gps, np.nan)
        head = autopilot.zero_of_clock(gps, fixes["SampleUS"] * 1e-6 + offset)
    words = [text.split()[0] for text in log.texts() if text.split()]
    vehicle = next((BY_VERSION[word] for word in words if word in BY_VERSION), None)
    if vehicle is None:
        vehicle = next((BY_PARAMETER[key] for key in BY_PARAMETER if key in log.parameters), None)
    if vehicle == "car" and log.parameters.get("FRAME_CLASS") == BOAT:
        vehicle = "ship"
    return head | ({"vehicle": vehicle} if vehicle else {})


def open_dataflash(path: Path) -> Log:
    """Raises DataError."""
    log = DataFlash(read_bytes(path))
    of_receivers, left = receivers(log)
    head = _head(log, [(columns, sections) for columns, _, sections in of_receivers.values()])
    makers: dict[str, Callable[[], FileTable]] = {}
    sections: list[Section] = []
    of_imus, more = imus(log)
    left += more
    for name, (columns, section) in {**of_imus, **others(log, "date" in head)}.items():
        makers[name] = partial(FileTable.of, f"{path} [{name}]", columns)
        sections.append(section)
    for name, (columns, rows, of_receiver) in of_receivers.items():
        makers[name] = partial(FileTable.of, f"{path} [{name}]", columns, rows)
        sections += of_receiver
    for columns, section in trajectories(log):
        name = section.keys["table"]
        makers[name] = partial(FileTable.of, f"{path} [{name}]", columns)
        sections.append(section)
    left += [f"{name}: {why}" for name, why in LEFT.items() if name in log.counts]
    left += log.remarks
    version = next((text for text in log.texts() if text.startswith("Ardu")), "")
    facts = (f"DataFlash log{version and f' of {version}'}, {len(log.counts)} kinds of messages",)
    return Log(Tables(makers), tuple(sections), facts, tuple(left), (), head)


def _is_dataflash(path: Path) -> bool:
    return head_of(path, len(MAGIC)) == MAGIC


READER = Reader(
    "dataflash",
    packed_suffixes(".bin"),
    "ArduPilot log",
    sniff=_is_dataflash,
    open=open_dataflash,
    begins=(MAGIC,),
)
