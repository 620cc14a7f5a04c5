"""Binary DataFlash logs by `AP_Logger/LogStructure.h` of ArduPilot, written without the reader."""

import struct
from pathlib import Path

import numpy as np
from written_ulog import interleaved, microseconds

NUMPY = {
    "b": ("i1", 1),
    "B": ("u1", 1),
    "h": ("<i2", 1),
    "H": ("<u2", 1),
    "c": ("<i2", 100),
    "C": ("<u2", 100),
    "i": ("<i4", 1),
    "I": ("<u4", 1),
    "E": ("<u4", 100),
    "e": ("<i4", 100),
    "L": ("<i4", 1e7),
    "Q": ("<u8", 1),
    "f": ("<f4", 1),
    "d": ("<f8", 1),
    "N": ("S16", None),
    "Z": ("S64", None),
    "n": ("S4", None),
}
"""numpy type and counts per unit of each letter."""
FORMAT = "BBnNZ"
WEEK, DAY = 2300, 172800.0  # GPS week and seconds of it where the clock of the log is 0


def declaration(number, name, letters, columns):
    """The FMT record of a message."""
    size = 3 + sum(np.dtype(NUMPY[letter][0]).itemsize for letter in letters)
    texts = struct.pack("<4s16s64s", name.encode(), letters.encode(), ",".join(columns).encode())
    return b"\xa3\x95\x80" + bytes([number, size]) + texts


def records(number, letters, values):
    """(n, size) bytes of the records of a message."""
    parts = []
    for letter, column in zip(letters, values, strict=True):
        kind, counts = NUMPY[letter]
        column = np.asarray(column)
        if counts not in (None, 1):
            column = np.round(column * counts)
        column = np.ascontiguousarray(column.astype(kind))
        parts.append(column.view(np.uint8).reshape(len(column), -1))
    head = np.tile(np.frombuffer(b"\xa3\x95" + bytes([number]), np.uint8), (len(parts[0]), 1))
    return np.hstack([head, *parts])


def dataflash(messages, parameters=None, texts=("ArduCopter V4.5.0",)):
    """The bytes of a log of {name: (letters, {column: values})}, whose first column is TimeUS."""
    written = declaration(128, "FMT", FORMAT, ["Type", "Length", "Name", "Format", "Columns"])
    parameters = parameters or {}
    messages = {
        "PARM": (
            "QNf",
            {
                "TimeUS": np.zeros(len(parameters), np.int64),
                "Name": np.array(list(parameters), "S16"),
                "Value": np.array(list(parameters.values()), float),
            },
        ),
        "MSG": (
            "QZ",
            {"TimeUS": np.zeros(len(texts), np.int64), "Message": np.array(texts, "S64")},
        ),
        **messages,
    }
    blocks, times = [], []
    for number, (name, (letters, columns)) in enumerate(messages.items(), 1):
        written += declaration(number, name, letters, list(columns))
        if len(columns["TimeUS"]):
            blocks.append(records(number, letters, columns.values()))
            times.append(columns["TimeUS"])
    return written + interleaved(blocks, times)


def messages_of(recording, later=0.0, instances=1):
    """The messages of a recording: IMU, of so many instances one after the other, and where it has
    fixes GPS and GPA, stamped `later` s after they were measured."""
    imu = recording.imu
    rates = np.hstack([imu.dtheta, imu.dv]) / imu.dt[:, None]
    t = np.repeat(microseconds(imu.t), instances)
    which = np.tile(np.arange(instances), len(imu.t))
    rates = np.repeat(rates, instances, axis=0) * (1 + 0.1 * which)[:, None]
    names = ["GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"]
    messages = {
        "IMU": ("QBffffff", {"TimeUS": t, "I": which, **dict(zip(names, rates.T, strict=True))})
    }
    found = {each.kind: each for each in recording.sources}
    if {"position", "velocity"} <= set(found):
        messages |= fixes(found["position"], found["velocity"], later)
    return messages


def fixes(position, velocity, later):
    """GPS and GPA."""
    t = microseconds(position.t)
    north, east, down = velocity.y.T
    degrees, one = np.degrees(position.y[:, :2]), np.ones(len(t))
    stamps = t + round(later * 1e6)
    gps = {
        "TimeUS": stamps,
        "I": 0 * one,
        "Status": 3 * one,
        "GMS": np.round((DAY + position.t) * 1e3),
        "GWk": WEEK * one,
        "Lat": degrees[:, 0],
        "Lng": degrees[:, 1],
        "Alt": position.y[:, 2],
        "Spd": np.hypot(north, east),
        "GCrs": np.degrees(np.arctan2(east, north)) % 360,
        "VZ": down,
    }
    gpa = {
        "TimeUS": stamps,
        "I": 0 * one,
        "HAcc": position.std[:, 0],
        "VAcc": position.std[:, 2],
        "SAcc": velocity.std[:, 0],
        "VV": one,
        "SMS": stamps // 1000,
        "Delta": 100 * one,
    }
    return {"GPS": ("QBBIHLLefff", gps), "GPA": ("QBCCCBIH", gpa)}


def write(path, recording, parameters=None, later=0.0):
    """An ArduPilot log of a recording at `path`."""
    Path(path).write_bytes(dataflash(messages_of(recording, later), parameters))


def log_of_2014(recording, later=0.0, status=None, letters="Iffffff"):
    """The bytes of a log by `DataFlash.h` of 2013 to 2015: TimeMS of IMU and MAG is ms since boot, that
    of GPS ms of the week, and its T is ms since boot, `later` s after the fix was measured. `status`
    (n,) is that of the fixes: 0 no GPS, 1 no fix, 2 and 3 a fix in 2D and 3D."""
    imu = recording.imu
    rates = (np.hstack([imu.dtheta, imu.dv]) / imu.dt[:, None]).T
    boot = np.round(imu.t * 1e3)
    extra = [np.zeros(len(boot))] * (len(letters) - 7)
    position, velocity = (
        next(each for each in recording.sources if each.kind == kind)
        for kind in ("position", "velocity")
    )
    north, east, down = velocity.y.T
    one = np.ones(len(position.t))
    fixes = (
        3 * one if status is None else status,
        np.round((DAY + position.t) * 1e3),
        WEEK * one,
        9 * one,
        0.9 * one,
        *np.degrees(position.y[:, :2]).T,
        position.y[:, 2] - position.y[0, 2],
        position.y[:, 2],
        np.hypot(north, east),
        np.degrees(np.arctan2(east, north)) % 360,
        down,
        np.round((position.t + later) * 1e3),
    )
    columns = "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,ErrG,ErrA".split(",")[: len(letters)]
    of_gps = "Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T".split(",")
    parameters = np.array(["LAND_SPEED"], "S16"), np.array([50.0])
    written = declaration(128, "FMT", FORMAT, ["Type", "Length", "Name", "Format", "Columns"])
    written += declaration(129, "PARM", "Nf", ["Name", "Value"])
    written += declaration(130, "GPS", "BIHBcLLeeEefI", of_gps)
    written += declaration(131, "IMU", letters, columns)
    written += declaration(132, "MSG", "Z", ["Message"])
    written += records(129, "Nf", parameters).tobytes()
    written += records(132, "Z", [np.array(["ArduCopter V3.1.5 (3c57e771)"], "S64")]).tobytes()
    blocks = [
        records(131, letters, [boot, *rates, *extra]),
        records(130, "BIHBcLLeeEefI", fixes),
    ]
    return written + interleaved(blocks, [boot, fixes[-1]])
