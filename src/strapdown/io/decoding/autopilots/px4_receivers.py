"""The receivers of a PX4 log, as sections of a description.

Delay and antenna are in EKF2_GPS_DELAY and EKF2_GPS_POS_*; since 2026 in parameters of each
receiver, SENS_GPS0_* and SENS_GPS1_*.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...contract import Section
from . import autopilot
from .px4 import (
    EQUAL,
    NEARLY,
    Columns,
    instances,
    lacking,
    prepared,
    same_heights,
    setting,
    time_of,
)
from .ulog import ULog

OLD_DELAY = "EKF2_GPS_DELAY"
DELAYS = (OLD_DELAY, "SENS_GPS0_DELAY", "SENS_GPS1_DELAY")  # ms
NO_DELAY = "the log has no delay of the receiver: 0 s, but PX4's usual default is 110 ms; check it"
TAKEN_OFF = "PX4 has taken the receiver's delay off timestamp_sample"


def receivers(log: ULog) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left) of the receivers. `vehicle_gps_position` of a newer log
    repeats what one of `sensor_gps` says, or a mixture of several."""
    own, chosen = (instances(log, name) for name in ("sensor_gps", "vehicle_gps_position"))
    fast, slow = (max(each.values(), default=0.0) for each in (own, chosen))
    name, other = "vehicle_gps_position", "sensor_gps"
    if fast and fast >= NEARLY * slow:
        name, other, own, chosen, fast, slow = other, name, chosen, own, slow, fast
    sections, left = [], [f"{other}, {fast:.3g} Hz: of the same receiver as {name}"] if own else []
    left += lacking(log, other) + lacking(log, name)
    for instance in sorted(chosen):
        fixes, rows = prepared(log, name, instance)
        lost = len(log.columns(name, instance)["timestamp"]) - len(rows)
        if lost:
            left.append(f"{name} {instance}: {lost} of {lost + len(rows)} rows without a 3D fix")
        if len(rows):
            sections += _gnss(log, name, instance, fixes)
    return sections, left


def _gnss(log: ULog, name: str, instance: int, fixes: Columns) -> list[Section]:
    """The sections of one receiver."""
    parameters = log.parameters
    slot = _slot(parameters, fixes, instance)
    time, why = _time(log, fixes, slot)
    common: dict[str, Any] = {"table": f"{name} {instance}", "time": time}
    assumed = {"time": why} if why else {}
    for parameter in (f"SENS_GPS{slot}_OFF", "EKF2_GPS_POS_"):
        antenna = autopilot.arm(parameters, parameter)
        if any(antenna) and "lever_arm" not in common:
            common["lever_arm"] = antenna
            assumed["lever_arm"] = f"{parameter.rstrip('_')} of the log"
    title = f"{name} {instance}, {autopilot.rate(fixes['timestamp']):.3g} Hz"
    position, of_position = _position(log, fixes)
    velocity, of_velocity = _deviation(log, fixes, ["s_variance_m_s"], "EKF2_GPS_V_NOISE")
    velocity |= {"columns": [f"vel_{axis}_m_s" for axis in "ned"], "unit": "m/s"}
    left = "" if fixes["vel_ned_valid"].any() else "the log says vel_ned_valid = 0 of all of them"
    where = ("aiding", "gnss")
    remarks = autopilot.UNSURE if why == NO_DELAY else ()
    return [
        Section(
            *where,
            {"kind": "position", **common, **position},
            instance,
            f"{title}, position",
            assumed | of_position,
            remarks=remarks,
        ),
        Section(
            *where,
            {"kind": "velocity", **common, **velocity},
            instance,
            f"{title}, velocity",
            assumed | of_velocity,
            left,
            remarks,
        ),
    ]


def _slot(parameters: Mapping[str, float], fixes: Columns, instance: int) -> int:
    """The number of a receiver in the parameters SENS_GPS0_* and SENS_GPS1_*: of the one with its
    device id, else its instance."""
    devices, many = np.unique(fixes.get("device_id", np.zeros(1)), return_counts=True)
    device = float(devices[np.argmax(many)])
    for slot in (0, 1):
        # the parameter is signed, the id is not
        if device and parameters.get(f"SENS_GPS{slot}_ID", 0.0) % 2**32 == device:
            return slot
    return instance


def _time(log: ULog, fixes: Columns, slot: int) -> tuple[dict[str, Any], str]:
    """(the key `time` of a receiver, where its delay comes from). Since 2026 `timestamp_sample` is
    the moment of the fix, as PX4's VehicleGPSPosition works it out, where it is before
    `timestamp`; earlier versions go by `timestamp` alone."""
    sampled = fixes.get("timestamp_sample", np.zeros(1))
    if OLD_DELAY not in log.parameters and np.all((sampled > 0) & (sampled < fixes["timestamp"])):
        return time_of(log, fixes), TAKEN_OFF
    name = f"SENS_GPS{slot}_DELAY"
    name = name if name in log.parameters else OLD_DELAY
    if name not in log.parameters:
        return time_of(log, {}), NO_DELAY
    delay = log.parameters[name]
    if not delay:
        return time_of(log, {}), ""
    return time_of(log, {}, -1e-3 * delay), f"{name} of the log is {delay:g} ms"


def _position(log: ULog, fixes: Columns) -> tuple[dict[str, Any], dict[str, str]]:
    """(keys, those of them that are assumed) of the positions of a receiver."""
    new = "latitude_deg" in fixes
    heights = ["altitude_ellipsoid_m", "altitude_msl_m"] if new else ["alt_ellipsoid", "alt"]
    same = same_heights(fixes, *heights)
    height = heights[0] if np.any(fixes[heights[0]] != 0) and not same else heights[1]
    sd, assumed = _deviation(log, fixes, ["eph", "eph", "epv"], "EKF2_GPS_P_NOISE")
    columns = ["latitude_deg", "longitude_deg", height] if new else ["lat", "lon", height]
    keys: dict[str, Any] = {"columns": columns, "unit": ["deg", "deg", "m"]}
    if not new:
        keys["scale"] = [1e-7, 1e-7, 1e-3]
    if height == heights[1]:
        keys["geoid"] = "EGM96"
        assumed |= {"geoid": EQUAL} if same else {}
    return keys | sd, assumed


def _deviation(
    log: ULog, fixes: Columns, names: list[str], parameter: str
) -> tuple[dict[str, Any], dict[str, str]]:
    """(the key sd, why where it is assumed): what the receiver says, else PX4's own setting."""
    if all(name in fixes and np.any(fixes[name] > 0) for name in names):
        return {"sd": names[0] if len(names) == 1 else names}, {}
    sd, why = setting(log, parameter)
    return {"sd": sd}, {"sd": f"the receiver says none; {why}"}
