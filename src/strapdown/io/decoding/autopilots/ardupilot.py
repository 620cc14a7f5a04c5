"""The messages of an ArduPilot log that make a recording, as sections of a description.

The IMU is `IMU`, the input of the autopilot's own filter, one point sample per row. The batches of
raw samples (`ISBD`) have pauses between them; `ACC` and `GYR` are raw samples in separate tables at
different rates.
"""

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....preprocessing.plausible import is_temperature
from ....units.time_scales import rate_of
from ...reader import Section
from ..carrier_classes import by_class
from . import autopilot
from .dataflash import DataFlash

Columns = dict[str, NDArray[Any]]
FIX_3D = 3  # Status from which a fix has a height
CARRIER = {"fixed": (6,), "float": (5,), "single": (3, 4)}
"""Carrier solutions by Status."""
FASTER = (
    "set IMU_FAST (of ArduCopter bit 18) in LOG_BITMASK, which logs the IMU at the rate of the "
    "main loop"
)
DELAY = 0.2
"""s: delay that ArduPilot assumes for a receiver where neither a parameter nor the driver states
one (AP_GPS_Backend::get_lag); drivers state 0.05 to 0.22 s."""
HARDWARE = re.compile(r"u-blox (\d+) HW: (\w{4})")
"""The text that names the model of a u-blox receiver."""
U_BLOX = dict.fromkeys(("0007", "0008", "0019", "000A"), 0.12)
"""s: delay in the driver of u-blox 7, M8, F9 with M9, and M10 (AP_GPS_UBLOX::get_lag)."""
STD = {
    "POSNE_M_NSE": 0.5,
    "VELNE_M_NSE": 0.3,
    "MAG_M_NSE": 0.05,
    "ALT_M_NSE": 2.0,
    "EAS_M_NSE": 1.4,
}
"""ArduPilot's own standard deviations where neither the receiver nor a parameter of the log states
one: m, m/s, gauss, m, m/s."""
MESSAGES = {
    "imu": ("IMU", "IMU2", "IMU3"),
    "gnss": ("GPS", "GPS2"),
    "magnetometer": ("MAG", "MAG2", "MAG3"),
    "barometer": ("BARO", "BAR2", "BAR3"),
    "airspeed": ("ARSP", "ASP2"),
}
"""Messages of old logs by instance; in newer logs the first one has a column for the instance."""
NEEDED = {
    "imu": {f"{sensor}{axis}" for sensor in ("Gyr", "Acc") for axis in "XYZ"},
    "gnss": {"Status", "GMS", "GWk", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ"},
    "magnetometer": {"MagX", "MagY", "MagZ"},
    "barometer": {"Press"},
    "airspeed": {"Airspeed"},
}
"""Columns without which a message is left out."""
HEALTH = {"Health", "H"}
"""Columns of a sensor that are 0 where it is in bad health."""


def _since_boot(columns: Columns) -> Columns:
    """Return the columns under their current names. Logs of 2013 to 2015 have ms since boot: in T
    for a receiver, whose TimeMS is the time of week, and in TimeMS for all others."""
    if "TimeUS" in columns or "TimeMS" not in columns:
        return columns
    ms = columns["TimeMS"]
    if "Status" in columns:
        if not {"Week", "T"} <= set(columns):
            return columns
        columns = {**columns, "GMS": ms, "GWk": columns["Week"]}
        ms = columns["T"]
    return {**columns, "TimeUS": ms.astype(np.int64) * 1000}


def _of(log: DataFlash, name: str, instance: int) -> Columns:
    """Return the columns of one instance, from message NAME by its column I, or from NAME2 of an
    old log, with times as signed numbers; {} where there is none."""
    found = log.columns(name)
    if "I" in found:
        here = found["I"] == instance
        found = {key: values[here] for key, values in found.items()}
    elif instance:
        found = log.columns(f"{name[:3]}{instance + 1}")
    found = _since_boot(found)
    if "TimeUS" not in found or not len(found["TimeUS"]):
        return {}
    return found | {"TimeUS": found["TimeUS"].astype(np.int64)}


def _instances(log: DataFlash, role: str) -> dict[int, Columns]:
    """{instance: columns} of the messages of a role."""
    first = MESSAGES[role][0]
    numbered = log.columns(first).get("I")
    several = range(len(MESSAGES[role])) if numbered is None else np.unique(numbered).tolist()
    found = {instance: _of(log, first, instance) for instance in several}
    needed = NEEDED[role]
    return {instance: columns for instance, columns in found.items() if needed <= set(columns)}


def _healthy(columns: Columns) -> tuple[Columns, int]:
    """Return the columns of an IMU without the samples of a sensor in bad health (GH, AH), and the
    number of rows with such samples."""
    bad = np.zeros(len(columns["TimeUS"]), bool)
    found = dict(columns)
    for health, names in (("GH", "Gyr"), ("AH", "Acc")):
        if health not in columns:
            continue
        ill = columns[health] == 0
        bad |= ill
        found |= {
            f"{names}{axis}": np.where(ill, np.nan, columns[f"{names}{axis}"]) for axis in "XYZ"
        }
    return found, int(np.count_nonzero(bad))


def imus(log: DataFlash) -> tuple[dict[str, tuple[Columns, Section]], list[str]]:
    """({table: (its columns, section)} of the IMUs, lines on what is left out)."""
    made, left = {}, []
    trim = [np.degrees(log.parameters.get(f"AHRS_TRIM_{axis}", 0.0)) for axis in "XY"]
    for instance, columns in _instances(log, "imu").items():
        table, hz = f"IMU {instance}", rate_of(columns["TimeUS"], 1e-6)
        columns, bad = _healthy(columns)
        if bad:
            left.append(
                f"{table}: {bad} of {len(columns['TimeUS'])} rows with a gyro or accelerometer in bad "
                f"health (GH, AH)"
            )
        if bad == len(columns["TimeUS"]):
            continue
        keys: dict[str, Any] = {
            "table": table,
            "time": {"column": "TimeUS", "unit": "us"},
            "gyro": {"columns": ["GyrX", "GyrY", "GyrZ"], "unit": "rad/s"},
            "accel": {"columns": ["AccX", "AccY", "AccZ"], "unit": "m/s^2"},
        }
        if is_temperature(columns.get("T", ())):
            keys["temperature"] = {"column": "T"}
        assumed = {}
        if any(trim):
            keys["mounting"] = {
                "roll": round(trim[0], 4),
                "pitch": round(trim[1], 4),
                "heading": 0.0,
                "unit": "deg",
            }
            assumed["mounting"] = "AHRS_TRIM_X and AHRS_TRIM_Y of the log"
        arm, title = f"INS_POS{instance + 1}_", f"{table}, {hz:.3g} Hz, point samples"
        section = autopilot.imu_section(log.parameters, arm, keys, instance, title, assumed, FASTER)
        made[table] = columns, section
    return made, left


def _fixes(log: DataFlash, instance: int, columns: Columns) -> tuple[Columns, Any]:
    """(columns of the fixes with a height, their rows), with the accuracies and times of GPA,
    velocities north and east, and the height above the ellipsoid where the log has the
    undulation."""
    rows = np.flatnonzero(columns["Status"] >= FIX_3D)
    found = {key: values[rows] for key, values in columns.items()}
    of = _of(log, "GPA", instance)
    of = of if {"HAcc", "VAcc", "SAcc"} <= set(of) else {}
    found["SampleUS"] = found["TimeUS"]
    if of and len(rows):
        at = np.minimum(np.searchsorted(of["TimeUS"], found["TimeUS"]), len(of["TimeUS"]) - 1)
        same = of["TimeUS"][at] == found["TimeUS"]
        for key in ("HAcc", "VAcc", "SAcc"):
            values = of[key][at].astype(float)
            found[key] = np.where(same & (values > 0), values, np.nan)
        if "SMS" in of:
            sampled = of["SMS"][at].astype(np.int64) * 1000
            found["SampleUS"] = np.where(same & (sampled > 0), sampled, found["TimeUS"])
        if "Und" in of and np.any(of["Und"] != 0):
            found["Height"] = found["Alt"] - of["Und"][at]
        if "VV" in of:
            found["VZ"] = np.where(same & (of["VV"][at] == 0), np.nan, found["VZ"])
    course = np.radians(found["GCrs"])
    return found | {"VN": found["Spd"] * np.cos(course), "VE": found["Spd"] * np.sin(course)}, rows


def _delay(log: DataFlash, instance: int) -> tuple[float, str]:
    """(delay of a receiver in s, its source)."""
    names = [f"GPS{instance + 1}_DELAY_MS", "GPS_DELAY_MS" + ("" if not instance else "2")]
    if log.parameters.get("AHRS_EKF_TYPE") == 2:
        names.append("EK2_GPS_DELAY")
    for name in names:
        if log.parameters.get(name, 0.0) > 0:
            return 1e-3 * log.parameters[name], f"{name} of the log"
    for text in log.texts():
        match = HARDWARE.match(text)
        if match and int(match[1]) == instance + 1 and match[2].upper() in U_BLOX:
            why = (
                f"{names[1]} of the log names none; ArduPilot's own value for u-blox HW {match[2]}"
            )
            return U_BLOX[match[2].upper()], why
    return DELAY, f"{names[1]} of the log names none; this is ArduPilot's default"


def _setting(log: DataFlash, name: str) -> autopilot.Deviation:
    """Return the std that the autopilot's own filter used for a sensor."""
    filter_in_use = 2 if log.parameters.get("AHRS_EKF_TYPE", 3.0) == 2 else 3
    return autopilot.setting(log.parameters, f"EK{filter_in_use}_{name}", STD[name])


def receivers(log: DataFlash) -> tuple[dict[str, tuple[Columns, Any, list[Section]]], list[str]]:
    """({table: (columns, rows, sections)} of the receivers, lines on what is left out)."""
    made: dict[str, tuple[Columns, Any, list[Section]]] = {}
    left = []
    for instance, columns in _instances(log, "gnss").items():
        fixes, rows = _fixes(log, instance, columns)
        lost = len(columns["TimeUS"]) - len(rows)
        if lost:
            left.append(f"GPS {instance}: {lost} of {lost + len(rows)} rows without a 3D fix")
        if len(rows):
            made[f"GPS {instance}"] = fixes, rows, _gnss(log, instance, fixes)
    return made, left


def _gnss(log: DataFlash, instance: int, fixes: Columns) -> list[Section]:
    delay, why = _delay(log, instance)
    time = {"column": "SampleUS", "unit": "us", "offset": -delay}
    common: dict[str, Any] = {"table": f"GPS {instance}", "time": time}
    assumed = {"time": why}
    names = (f"GPS_POS{instance + 1}_", f"GPS{instance + 1}_POS_")
    autopilot.add_arm(common, assumed, log.parameters, names)
    title = f"GPS {instance}, {rate_of(fixes['TimeUS'], 1e-6):.3g} Hz"
    height = "Height" if "Height" in fixes else "Alt"
    columns = {"columns": ["Lat", "Lng", height], "unit": ["deg", "deg", "m"]}
    geoid = {"geoid": "EGM96"} if height == "Alt" else {}
    velocity = {"columns": ["VN", "VE", "VZ"], "unit": "m/s"}
    std, std_of_velocity = (
        autopilot.deviation(fixes, names, _setting(log, own))
        for names, own in ((["HAcc", "HAcc", "VAcc"], "POSNE_M_NSE"), (["SAcc"], "VELNE_M_NSE"))
    )
    remarks = autopilot.UNSURE if "log names none" in why else ()
    position, of_velocity = autopilot.receiver_sections(
        Section("source", "gnss", common, instance, title, assumed, remarks=remarks),
        ({**columns, **std.key, **geoid}, std.assumed),
        ({**velocity, **std_of_velocity.key}, std_of_velocity.assumed),
    )
    satellites = "NSats" if "NSats" in fixes else ""
    return [*by_class(position, fixes["Status"], "Status", CARRIER, satellites), of_velocity]


def others(log: DataFlash, dated: bool) -> dict[str, tuple[Columns, Section]]:
    """{table: (its columns, section)} of magnetometers, barometers and airspeeds."""
    made = {}
    time = {"column": "TimeUS", "unit": "us"}
    in_thousandths: dict[str, Any] = {"scale": 1e-3}
    indicated: dict[str, Any] = {"kind": "indicated-airspeed"}
    for role, columns, setting, more in (
        ("magnetometer", ["MagX", "MagY", "MagZ"], "MAG_M_NSE", in_thousandths),
        ("barometer", ["Press"], "ALT_M_NSE", {}),
        ("airspeed", ["Airspeed"], "EAS_M_NSE", indicated),
    ):
        own = _setting(log, setting)
        for instance, values in _instances(log, role).items():
            for health in HEALTH & values.keys():
                good = values[health] != 0
                values = {key: each[good] for key, each in values.items()}
            if not len(values["TimeUS"]):
                continue
            table, hz = f"{MESSAGES[role][0]} {instance}", rate_of(values["TimeUS"], 1e-6)
            keys = {"time": time, "columns": columns}
            section = autopilot.other_section(role, table, keys, own, instance, hz, dated, **more)
            made[table] = values, section
    return made


def trajectories(log: DataFlash) -> list[tuple[Columns, Section]]:
    """The simulator's truth, and the estimate of the autopilot's own filter."""
    true, own, attitude = (_of(log, name, 0) for name in ("SIM", "POS", "ATT"))
    found = []
    if {"Lat", "Lng", "Alt", "Q1", "Q2", "Q3", "Q4"} <= set(true):
        q = np.stack([true[f"Q{k}"] for k in (1, 2, 3, 4)], axis=1)
        velocity = _of(log, "SIM2", 0)
        columns = autopilot.trajectory(_place(true), (true["TimeUS"], q), _velocity(velocity))
        title = "SIM, the simulator's truth"
        found.append(autopilot.reference(columns, "truth", 0, title, "", geoid=True))
    if {"Lat", "Lng", "Alt"} <= set(own) and {"Roll", "Pitch", "Yaw"} <= set(attitude):
        q = autopilot.quaternions_of(
            *(attitude[angle].astype(float) for angle in ("Roll", "Pitch", "Yaw"))
        )
        name = "NKF1" if log.parameters.get("AHRS_EKF_TYPE") == 2 else "XKF1"
        velocity = _of(log, name, 0)
        if "C" in velocity:
            velocity = {key: each[velocity["C"] == 0] for key, each in velocity.items()}
        columns = autopilot.trajectory(_place(own), (attitude["TimeUS"], q), _velocity(velocity))
        title = f"POS, ATT and {name}"
        found.append(
            autopilot.reference(columns, "estimate", 1, title, autopilot.ESTIMATE, geoid=True)
        )
    return [each for each in found if len(each[0]["t"]) > 1]


def _place(columns: Columns) -> tuple[Any, ...]:
    return tuple(columns[key] for key in ("TimeUS", "Lat", "Lng", "Alt"))


def _velocity(columns: Columns) -> tuple[Any, Any] | None:
    if not {"TimeUS", "VN", "VE", "VD"} <= set(columns):
        return None
    return columns["TimeUS"], np.stack([columns[key] for key in ("VN", "VE", "VD")], axis=1)
