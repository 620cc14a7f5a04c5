"""The receivers of a PX4 log, as sections of a description."""

from typing import Any

import numpy as np

from ...contract import Section
from . import autopilot
from .px4 import EQUAL, NEARLY, Columns, instances, prepared, same_heights, setting, time_of
from .ulog import ULog


def receivers(log: ULog) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left) of the receivers. `vehicle_gps_position` of a newer log
    repeats what one of `sensor_gps` says, or a mixture of several."""
    own, chosen = (instances(log, name) for name in ("sensor_gps", "vehicle_gps_position"))
    fast, slow = (max(each.values(), default=0.0) for each in (own, chosen))
    name, other = "vehicle_gps_position", "sensor_gps"
    if fast and fast >= NEARLY * slow:
        name, other, own, chosen, fast, slow = other, name, chosen, own, slow, fast
    sections, left = [], [f"{other}, {fast:.3g} Hz: of the same receiver as {name}"] if own else []
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
    delay, antenna = parameters.get("EKF2_GPS_DELAY"), autopilot.arm(parameters, "EKF2_GPS_POS_")
    common: dict[str, Any] = {
        "table": f"{name} {instance}",
        "time": time_of(log, {}, -1e-3 * delay if delay else 0.0),
    }
    assumed = {"time": f"EKF2_GPS_DELAY of the log is {delay:g} ms"} if delay else {}
    if any(antenna):
        common["lever_arm"], assumed["lever_arm"] = antenna, "EKF2_GPS_POS of the log"
    title = f"{name} {instance}, {autopilot.rate(fixes['timestamp']):.3g} Hz"
    position, of_position = _position(log, fixes)
    velocity, of_velocity = _deviation(log, fixes, ["s_variance_m_s"], "EKF2_GPS_V_NOISE")
    velocity |= {"columns": [f"vel_{axis}_m_s" for axis in "ned"], "unit": "m/s"}
    left = "" if fixes["vel_ned_valid"].any() else "the log says vel_ned_valid = 0 of all of them"
    where = ("aiding", "gnss")
    return [
        Section(
            *where,
            {"kind": "position", **common, **position},
            instance,
            f"{title}, position",
            assumed | of_position,
        ),
        Section(
            *where,
            {"kind": "velocity", **common, **velocity},
            instance,
            f"{title}, velocity",
            assumed | of_velocity,
            left,
        ),
    ]


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
