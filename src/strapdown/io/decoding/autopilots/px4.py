"""The topics of a PX4 log that make a recording, as sections of a description.

The IMU is `vehicle_imu` where the log has it at full rate, else `sensor_combined`. Both hold what
the autopilot integrated from the raw samples of its sensors, over 4 to 5 ms, calibrated and rotated
to the body. Divided by the integration time they are mean rates, which stay correct where the
logger lost a message. `sensor_gyro` and `sensor_accel` are raw, neither calibrated nor rotated, and
are used only where the log has nothing better.

Delay and antenna of a receiver are in EKF2_GPS_DELAY and EKF2_GPS_POS_*; since 2026 each receiver
has its own parameters, SENS_GPS0_* and SENS_GPS1_*.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....preprocessing.plausible import is_temperature
from ....units.time_scales import rate_of
from ...reader import GUESS, Section
from ..antenna_pair import baseline_section
from ..carrier_classes import by_class
from . import autopilot
from .ulog import ULog

Columns = dict[str, NDArray[Any]]
GYRO = [f"gyro_rad[{k}]" for k in range(3)]
ACCEL = [f"accelerometer_m_s2[{k}]" for k in range(3)]
Q = [f"q[{k}]" for k in range(4)]
FIX_3D = (3, 4, 5, 6)  # fix_type of fixes with a height; 8 is extrapolated
CARRIER = {"fixed": (6,), "float": (5,), "single": (3, 4)}
"""Carrier solutions by fix_type."""
SINCE_2001, UNTIL_2128 = 10**15, 5 * 10**15
"""us: a clock that starts between these counts from 1970, as in a simulator, not from power-on."""
SLOW = 20.0  # Hz: where averaged samples are slower, raw ones are considered
NEARLY = 0.8
"""A topic is preferred to another one with the same samples if it has this share of its rate."""
FASTER = (
    "set SDLOG_PROFILE to 3 (default and estimator replay), which logs the IMU at its full rate"
)
STD = {
    "EKF2_GPS_P_NOISE": 0.5,
    "EKF2_GPS_V_NOISE": 0.3,
    "EKF2_MAG_NOISE": 0.05,
    "EKF2_BARO_NOISE": 3.5,
    "EKF2_EAS_NOISE": 1.4,
}
"""PX4's own standard deviations where neither the receiver nor a parameter of the log states one:
m, m/s, gauss, m, m/s."""
TRIPLE = ("[0]", "[1]", "[2]")
FIX = {"fix_type", "time_utc_usec", "eph", "epv", "s_variance_m_s", "vel_ned_valid"}
VELOCITY = {f"vel_{axis}_m_s" for axis in "ned"}
FIX |= VELOCITY
OLD = FIX | {"lat", "lon", "alt", "alt_ellipsoid"}
NEW = FIX | {"latitude_deg", "longitude_deg", "altitude_msl_m", "altitude_ellipsoid_m"}
INTEGRALS = {f"delta_{of}{k}" for of in ("angle", "velocity") for k in TRIPLE}
VECTOR, VECTOR_STD = ([f"{name}{k}" for k in TRIPLE] for name in ("position", "position_accuracy"))
RELATIVE = ("gnss_fix_ok", "relative_position_valid", "moving_base_mode")
"""Flags of a vector between two antennas of the vehicle that is right; then its carrier solution counts."""
CARRIER_FLAGS = ("carrier_solution_fixed", "carrier_solution_floating")
NEEDED: dict[str, list[set[str]]] = {
    "vehicle_imu": [INTEGRALS | {"delta_angle_dt", "delta_velocity_dt"}],
    "sensor_combined": [{*GYRO, *ACCEL}],
    "sensor_gyro": [{"x", "y", "z"}],
    "sensor_accel": [{"x", "y", "z"}],
    "sensor_gps": [OLD, NEW],
    "vehicle_gps_position": [OLD, NEW],
    "vehicle_magnetometer": [{f"magnetometer_ga{k}" for k in TRIPLE}],
    "vehicle_air_data": [{"baro_pressure_pa"}],
    "airspeed": [{"true_airspeed_m_s"}],
    "airspeed_validated": [{"true_airspeed_m_s", "selected_airspeed_index"}],
    "sensor_gnss_relative": [{*VECTOR, *VECTOR_STD, *RELATIVE, *CARRIER_FLAGS}],
}
"""Fields that a topic must have, with the alternatives."""
EQUAL = (
    "heights above the ellipsoid and mean sea level are equal in all rows, as simulators write them: "
    "taken as above mean sea level"
)


def topic_columns(log: ULog, name: str, instance: int) -> tuple[Columns, NDArray[np.int64]]:
    """(columns, their rows in the log) of a topic, with times as signed numbers. A receiver keeps
    only fixes with a height, a pair of antennas only vectors with a carrier solution, an airspeed only rows
    of a sensor, not those of ground speed and wind; increments get mean rates as well."""
    found = {
        key: values.astype(np.int64) if key.startswith("timestamp") else values
        for key, values in log.columns(name, instance).items()
    }
    rows = np.arange(len(found.get("timestamp", ())))  # a damaged topic may have no columns
    if "selected_airspeed_index" in found:
        rows = np.flatnonzero(found["selected_airspeed_index"] > 0)
        found = {key: values[rows] for key, values in found.items()}
    if found.keys() >= {*RELATIVE, *CARRIER_FLAGS}:
        good = np.all([found[flag] for flag in RELATIVE], axis=0)
        rows = np.flatnonzero(good & np.any([found[flag] for flag in CARRIER_FLAGS], axis=0))
        found = {key: values[rows] for key, values in found.items()}
    if "fix_type" in found:
        rows = np.flatnonzero(np.isin(found["fix_type"], FIX_3D))
        found = {key: values[rows] for key, values in found.items()}
        _usable(found)
    if found.keys() >= {*INTEGRALS, "delta_angle_dt", "delta_velocity_dt"}:
        for names, of in ((GYRO, "delta_angle"), (ACCEL, "delta_velocity")):
            seconds = found[f"{of}_dt"] * 1e-6
            seconds[seconds <= 0] = np.nan
            found |= {label: found[f"{of}[{k}]"] / seconds for k, label in enumerate(names)}
    return found, rows


def _usable(fixes: Columns) -> None:
    """Standard deviations and velocities that the receiver does not give become missing."""
    for std in ("eph", "epv", "s_variance_m_s"):
        if std in fixes and (fixes[std] > 0).any():
            fixes[std] = np.where(fixes[std] > 0, fixes[std], np.nan)
    valid = fixes.get("vel_ned_valid")
    if valid is not None and valid.any():
        for key in VELOCITY & fixes.keys():
            fixes[key] = np.where(valid, fixes[key], np.nan)


def is_unix(log: ULog) -> bool:
    """Return True where the clock of a log counts from 1970."""
    return SINCE_2001 < log.start < UNTIL_2128


def time_of(log: ULog, columns: Mapping[str, Any], offset: float = 0.0) -> dict[str, Any]:
    """Return the key `time` of a section: the sampling time where the topic has it."""
    sampled = columns.get("timestamp_sample")
    column = "timestamp" if sampled is None or not np.all(sampled > 0) else "timestamp_sample"
    return (
        {"column": column, "unit": "us"}
        | ({"offset": offset} if offset else {})
        | ({"clock": "unix"} if is_unix(log) else {})
    )


def instances(log: ULog, name: str) -> dict[int, float]:
    """{instance: rate in Hz} of a topic, for instances with the necessary fields."""
    rates = {}
    for topic, instance in log.topics:
        columns = log.columns(name, instance) if topic == name else {}
        if any(needed | {"timestamp"} <= set(columns) for needed in NEEDED[name]):
            rates[instance] = rate_of(columns["timestamp"], 1e-6)
    return rates


def missing_field_lines(log: ULog, name: str) -> list[str]:
    """Return lines on the instances of a topic that lack a necessary field."""
    lines = []
    for topic, instance in log.topics:
        columns = log.columns(name, instance) if topic == name else {}
        missing = min((needed - columns.keys() for needed in NEEDED[name]), key=len)
        if columns and missing:
            lines.append(
                f"{name} {instance}: it has no {', '.join(sorted(missing))}; it is not taken"
            )
    return lines


def imus(log: ULog) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left out) of the IMUs."""
    every = {name: instances(log, name) for name in ("vehicle_imu", "sensor_combined")}
    gyros, accels = (instances(log, name) for name in ("sensor_gyro", "sensor_accel"))
    every["sensor_gyro"] = {each: gyros[each] for each in gyros if each in accels}
    rates = {name: max(found.values(), default=0.0) for name, found in every.items()}
    best = max(rates["vehicle_imu"], rates["sensor_combined"])
    name = "vehicle_imu" if rates["vehicle_imu"] >= NEARLY * best else "sensor_combined"
    if best < SLOW and rates["sensor_gyro"] > best:
        name = "sensor_gyro"
    make = _raw_imu if name == "sensor_gyro" else _imu
    sections = [make(log, name, each, hz) for each, hz in sorted(every[name].items())]
    left = [
        f"{topic} {', '.join(map(str, sorted(found)))}, {rates[topic]:.3g} Hz: "
        + ("of the same sensors as" if rates[topic] > SLOW else "too slow beside")
        + f" {name}"
        for topic, found in every.items()
        if found and topic != name
    ]
    return sections, left


def _is_selected(log: ULog, columns: Columns) -> bool:
    """Return True where PX4 used this IMU at the end of the log."""
    chosen = log.columns("sensor_selection")
    return all(
        len(chosen.get(key, ())) and key in columns and columns[key][-1] == chosen[key][-1]
        for key in ("gyro_device_id", "accel_device_id")
    )


def _imu(log: ULog, name: str, instance: int, hz: float) -> Section:
    columns = log.columns(name, instance)
    keys: dict[str, Any] = {
        "table": f"{name} {instance}",
        "time": time_of(log, columns),
        "gyro": {"columns": GYRO, "unit": "rad/s"},
        "accel": {"columns": ACCEL, "unit": "m/s^2"},
        **_temperature(log, name, instance),
    }
    title = f"{name} {instance}, {hz:.3g} Hz, mean rates"
    title += ", the one that PX4 selected" if _is_selected(log, columns) else ""
    return _of_imu(log, instance, title, keys, {})


def _temperature(log: ULog, name: str, instance: int) -> dict[str, Any]:
    """The key `temperature` of the section, where the log has that of this IMU."""
    for topic, column in (
        ("vehicle_imu_status", "temperature_accel"),
        ("sensor_accel", "temperature"),
    ):
        there = [each for known, each in log.topics if known == topic]
        # a `sensor_combined` does not say which IMU its samples come from
        own = there if name != "sensor_combined" or len(there) == 1 else []
        of = instance if instance in own else own[0] if len(own) == 1 else None
        columns = {} if of is None else log.columns(topic, of)
        if is_temperature(columns.get(column, ())):
            key = {"column": column, "table": f"{topic} {of}", "time": time_of(log, columns)}
            return {"temperature": key}
    return {}


def _raw_imu(log: ULog, name: str, instance: int, hz: float) -> Section:
    accel = log.columns("sensor_accel", instance)
    keys: dict[str, Any] = {
        "table": f"{name} {instance}",
        "time": time_of(log, log.columns(name, instance)),
        "axes": f"FRD{GUESS}",
        "gyro": {"columns": ["x", "y", "z"], "unit": "rad/s"},
        "accel": {
            "columns": ["x", "y", "z"],
            "unit": "m/s^2",
            "table": f"sensor_accel {instance}",
            "time": time_of(log, accel),
        },
        **_temperature(log, name, instance),
    }
    why = "raw sensors: neither their calibration nor SENS_BOARD_ROT is applied"
    title = f"sensor_gyro and sensor_accel {instance}, {hz:.3g} Hz, raw"
    return _of_imu(log, instance, title, keys, {"axes": why})


def _of_imu(
    log: ULog, instance: int, title: str, keys: dict[str, Any], assumed: dict[str, str]
) -> Section:
    arm = "EKF2_IMU_POS_"
    return autopilot.imu_section(log.parameters, arm, keys, instance, title, assumed, FASTER)


def same_heights(columns: Mapping[str, Any], ellipsoid: str, sea_level: str) -> bool:
    """Return True where both heights are equal in every row: the one above the ellipsoid was then
    never computed."""
    return np.array_equal(columns[ellipsoid], columns[sea_level])


def setting(log: ULog, parameter: str) -> autopilot.Deviation:
    """Return the std that the autopilot's own filter used for a sensor."""
    return autopilot.setting(log.parameters, parameter, STD[parameter])


def others(log: ULog, dated: bool) -> list[Section]:
    """Magnetometers, barometers and airspeeds: those of the sensors, else that which PX4 validated."""
    sections = []
    airspeed = "airspeed" if instances(log, "airspeed") else "airspeed_validated"
    for role, topic, columns, parameter in (
        (
            "magnetometer",
            "vehicle_magnetometer",
            [f"magnetometer_ga[{k}]" for k in range(3)],
            "EKF2_MAG_NOISE",
        ),
        ("barometer", "vehicle_air_data", ["baro_pressure_pa"], "EKF2_BARO_NOISE"),
        ("airspeed", airspeed, ["true_airspeed_m_s"], "EKF2_EAS_NOISE"),
    ):
        own = setting(log, parameter)
        for instance, hz in sorted(instances(log, topic).items()):
            if not len(topic_columns(log, topic, instance)[1]):
                continue  # no airspeed of a sensor
            table = f"{topic} {instance}"
            keys = {"time": time_of(log, log.columns(topic, instance)), "columns": columns}
            sections.append(autopilot.other_section(role, table, keys, own, instance, hz, dated))
    return sections


def trajectories(log: ULog) -> list[tuple[Columns, Section]]:
    """The simulator's truth, and the estimate of the autopilot's own filter."""
    found = []
    title = "vehicle_global_position, vehicle_attitude, vehicle_local_position"
    for instance, suffix, table, named, left in (
        (0, "_groundtruth", "groundtruth", "the simulator's truth", ""),
        (1, "", "estimate", title, autopilot.ESTIMATE),
    ):
        position = log.columns(f"vehicle_global_position{suffix}")
        attitude = log.columns(f"vehicle_attitude{suffix}")
        local = log.columns(f"vehicle_local_position{suffix}")
        if not {"lat", "lon", "alt"} <= set(position) or not set(Q) <= set(attitude):
            continue
        heights = [key for key in ("alt_ellipsoid", "alt") if np.any(position.get(key, 0.0))]
        if not heights:
            left = left or "all its heights are 0"
        if len(heights) == 2 and same_heights(position, "alt_ellipsoid", "alt"):
            heights, named = ["alt"], f"{named}; {EQUAL}"
        height = position[(heights or ["alt"])[0]]
        place = position["timestamp"], position["lat"], position["lon"], height
        q = np.stack([attitude[key] for key in Q], axis=1)
        has_velocity = {"vx", "vy", "vz"} <= set(local)
        v = np.stack([local[f"v{axis}"] for axis in "xyz"], axis=1) if has_velocity else None
        columns = autopilot.trajectory(
            place,
            (attitude["timestamp"], q),
            None if v is None else (local["timestamp"], v),
        )
        clock = {"clock": "unix"} if is_unix(log) else {}
        geoid = heights[:1] == ["alt"]
        found.append(autopilot.reference(columns, table, instance, named, left, geoid, **clock))
    return found


# ---- receivers

OLD_DELAY = "EKF2_GPS_DELAY"
DELAYS = (OLD_DELAY, "SENS_GPS0_DELAY", "SENS_GPS1_DELAY")  # ms
NO_DELAY = "the log has no delay of the receiver: 0 s, but PX4's usual default is 110 ms; check it"
TAKEN_OFF = "PX4 has taken the receiver's delay off timestamp_sample"


def receivers(log: ULog) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left out) of the receivers. In a newer log,
    `vehicle_gps_position` repeats one `sensor_gps`, or blends several."""
    own, chosen = (instances(log, name) for name in ("sensor_gps", "vehicle_gps_position"))
    fast, slow = (max(each.values(), default=0.0) for each in (own, chosen))
    name, other = "vehicle_gps_position", "sensor_gps"
    if fast and fast >= NEARLY * slow:
        name, other, own, chosen, fast, slow = other, name, chosen, own, slow, fast
    sections, left = [], [f"{other}, {fast:.3g} Hz: of the same receiver as {name}"] if own else []
    left += missing_field_lines(log, other) + missing_field_lines(log, name)
    for instance in sorted(chosen):
        fixes, rows = topic_columns(log, name, instance)
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
    names = (f"SENS_GPS{slot}_OFF", "EKF2_GPS_POS_")
    autopilot.add_arm(common, assumed, parameters, names)
    title = f"{name} {instance}, {rate_of(fixes['timestamp'], 1e-6):.3g} Hz"
    position, of_position = _position(fixes)
    moved = {"columns": [f"vel_{axis}_m_s" for axis in "ned"], "unit": "m/s"}
    left = "" if fixes["vel_ned_valid"].any() else "vel_ned_valid is 0 in all of them"
    std, std_of_velocity = (
        autopilot.deviation(fixes, columns, setting(log, own))
        for columns, own in (
            (["eph", "eph", "epv"], "EKF2_GPS_P_NOISE"),
            (["s_variance_m_s"], "EKF2_GPS_V_NOISE"),
        )
    )
    remarks = autopilot.UNSURE if why == NO_DELAY else ()
    of_position_alone, of_velocity = autopilot.receiver_sections(
        Section("source", "gnss", common, instance, title, assumed, remarks=remarks),
        ({**position, **std.key}, {**std.assumed, **of_position}),
        ({**moved, **std_of_velocity.key}, std_of_velocity.assumed),
        left,
    )
    classes = by_class(
        of_position_alone,
        fixes["fix_type"],
        "fix_type",
        CARRIER,
        "satellites_used" if "satellites_used" in fixes else "",
    )
    return [*classes, of_velocity]


def baselines(log: ULog) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left out) of the vectors between two antennas of the vehicle."""
    name, sections = "sensor_gnss_relative", []
    left = missing_field_lines(log, name)
    for instance in sorted(instances(log, name)):
        found, rows = topic_columns(log, name, instance)
        table, every = f"{name} {instance}", len(log.columns(name, instance)["timestamp"])
        if every > len(rows):
            left.append(
                f"{table}: {every - len(rows)} of {every} rows without a carrier solution to an antenna "
                "that moves along"
            )
        if not len(rows):
            continue
        time, why = _time(log, found, _slot(log.parameters, found, instance))
        keys = {"table": table, "time": time, "columns": VECTOR, "std": VECTOR_STD}
        vectors = np.stack([found[column] for column in VECTOR], axis=1)
        section = baseline_section(keys, vectors, table, instance)
        assumed = {**section.assumed, **({"time": why} if why else {})}
        sections.append(section._replace(assumed=assumed))
    return sections, left


def _slot(parameters: Mapping[str, float], fixes: Columns, instance: int) -> int:
    """Return the number of a receiver in the parameters SENS_GPS0_* and SENS_GPS1_*: that with its
    device id, else its instance."""
    devices, many = np.unique(fixes.get("device_id", np.zeros(1)), return_counts=True)
    device = float(devices[np.argmax(many)])
    for slot in (0, 1):
        # the parameter is signed, the id is not
        if device and parameters.get(f"SENS_GPS{slot}_ID", 0.0) % 2**32 == device:
            return slot
    return instance


def _time(log: ULog, fixes: Columns, slot: int) -> tuple[dict[str, Any], str]:
    """(the key `time` of a receiver, the source of its delay). Since 2026 `timestamp_sample` is the
    time of the fix as PX4's VehicleGPSPosition computes it, where it is before `timestamp`; earlier
    versions use `timestamp` alone."""
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


def _position(fixes: Columns) -> tuple[dict[str, Any], dict[str, str]]:
    """(keys, the assumed ones among them) of the positions of a receiver."""
    new = "latitude_deg" in fixes
    heights = ["altitude_ellipsoid_m", "altitude_msl_m"] if new else ["alt_ellipsoid", "alt"]
    same = same_heights(fixes, *heights)
    height = heights[0] if np.any(fixes[heights[0]] != 0) and not same else heights[1]
    columns = ["latitude_deg", "longitude_deg", height] if new else ["lat", "lon", height]
    keys: dict[str, Any] = {"columns": columns, "unit": ["deg", "deg", "m"]}
    if not new:
        keys["scale"] = [1e-7, 1e-7, 1e-3]
    if height != heights[1]:
        return keys, {}
    return keys | {"geoid": "EGM96"}, {"geoid": EQUAL} if same else {}
