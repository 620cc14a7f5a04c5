"""Missions for advice: a kind of flight, a built-in scenario or a scenario file, repeated for the
requested duration."""

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from ...alignment.initial import align
from ...checks import DataError, did_you_mean
from ...fileio.files import find_shipped, read_toml
from ...sensor_models.imu import ImuSpec
from ...sim.scenario import Scenario, scenario, scenarios
from ...sim.scenario_file import from_table
from ...sim.synthesis import simulate
from ...typing import File
from ...units.wording import duration_text

DURATION_UNITS = {"s": 1.0, "sec": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}
"""Units of a duration, in seconds."""
MIN_MISSION, MAX_MISSION = 10.0, 24 * 3600.0
"""Limits of the duration of a mission, s."""
MISSION_RATE = 20.0
"""Largest IMU rate of a mission, Hz: vibration is not simulated, and the computing time grows with
the rate."""
ALIGNING = 120.0
"""s at the beginning of a mission in which an alignment in motion must find the heading."""
UNKNOWN_HEADING = np.radians(90.0)
"""Standard deviation above which a heading counts as not found."""
CIRCUIT: dict[str, Any] = {
    "name": "dynamic",
    "about": "circuits of a light aircraft: climbs, descents, coordinated turns, changes of speed, "
    "light turbulence",
    "motion": {
        "kind": "flight",
        "start": {"latitude_deg": 47.6, "longitude_deg": 9.3, "height_m": 900},
        "course_deg": 60,
        "speed_m_s": 40,
        "legs": [
            {"duration_s": 40, "climb_m_s": 2.5},
            {"turn_deg": -90, "bank_deg": 22},
            {"duration_s": 30, "speed_m_s": 46},
            {"turn_deg": -90, "bank_deg": 25},
            {"duration_s": 60},
            {"turn_deg": 270, "bank_deg": 28, "speed_m_s": 42},
            {"duration_s": 25},
            {"turn_deg": -180, "bank_deg": 20},
            {"duration_s": 40, "climb_m_s": -2.5, "speed_m_s": 40},
            {"turn_deg": -270, "bank_deg": 25},
        ],
    },
}
"""A scenario file's content: the kind "dynamic". Climb and descent cancel."""


def seconds(text: str | float) -> float:
    """Seconds of a number (s) or a text like "90min", "1.5 h", "1h30min", "600". Raises
    DataError where it is none, or not above 0."""
    if isinstance(text, str):
        parts = re.findall(r"([0-9.]+(?:e[+-]?\d+)?)\s*([a-z]*)\s*", text.strip().lower())
        whole = "".join(text.lower().split())
        try:
            if (
                not parts
                or "".join(number + unit for number, unit in parts) != whole
                or (len(parts) > 1 and not all(unit for _, unit in parts))
            ):
                raise ValueError
            value = sum(float(number) * DURATION_UNITS[unit or "s"] for number, unit in parts)
        except (ValueError, KeyError):
            raise DataError(
                f"duration {text!r}: write a number with its unit above 0, as 600s, 90min, 2h or "
                f"1h30min"
            ) from None
    elif isinstance(text, bool) or not isinstance(text, (int, float)):
        raise DataError(f"duration {text!r}: write seconds as a number, or a text as 90min")
    else:
        value = float(text)
    if not MIN_MISSION <= value <= MAX_MISSION:
        raise DataError(
            f"duration {text!r} is {value:g} s; advice is on {MIN_MISSION:g} s to "
            f"{MAX_MISSION / 3600:g} h"
        )
    return value


def kinds() -> list[str]:
    """Return the names that `mission` takes beside scenario files: "dynamic" and the built-in
    scenarios."""
    return sorted({CIRCUIT["name"], *scenarios()})


def mission(flight: File | Scenario, duration: float, rate: float = MISSION_RATE) -> Scenario:
    """The Scenario of a `flight` of `duration` s: one of `kinds()`, a scenario file's path, or a
    Scenario. Raises DataError.

    Legs and waypoints repeat for the duration. The IMU has `rate` samples per second, or the
    scenario's if lower.
    """
    if isinstance(flight, Scenario):
        made = _with_duration(flight, duration)
    else:
        table, path = _table(flight)
        made = _with_duration(_again(table, path, duration), duration)
    ending = f"-{duration:g}s"
    return made.replace(
        name=made.name.removesuffix(ending) + ending, rate=min(max(rate, _fastest(made)), made.rate)
    )


def aligned_in_motion(made: Scenario, spec: ImuSpec) -> Scenario:
    """Return the Scenario with the initial attitude std that `align` claims for its first seconds,
    simulated once with this IMU. Raises DataError where alignment finds no heading."""
    beginning = made.replace(duration=min(made.duration, ALIGNING))
    start = align(simulate(beginning, imu=spec, seed=0), spec)
    if start.std[8] > UNKNOWN_HEADING:
        raise DataError(
            f"an alignment in motion finds no heading in the first {beginning.duration:g} s of "
            f"{made.name!r} ({start.note}): choose a flight that moves, or leave out "
            f"--alignment moving"
        )
    return made.replace(start_std=(*made.start_std[:6], *start.std[6:9], *made.start_std[9:]))


def _table(flight: File) -> tuple[dict[str, Any], Path]:
    """(table, path) of the scenario file behind a name or path."""
    flight = str(flight)
    if flight == CIRCUIT["name"]:
        return CIRCUIT, Path(flight)
    if resource := find_shipped("scenarios", "strapdown.sim", flight):
        return tomllib.loads(resource.read_text(encoding="utf-8")), Path(flight)
    if flight.endswith(".toml") or len(Path(flight).parts) > 1:
        scenario(flight)  # raises for an invalid file
        return read_toml(flight, "check the path"), Path(flight)
    raise DataError(
        f"unknown flight {flight!r}{did_you_mean(flight, kinds())}; flights: {', '.join(kinds())}; "
        "or give the path of a scenario file (.toml)"
    )


def _again(table: dict[str, Any], path: Path, duration: float) -> Scenario:
    """The scenario with its legs or waypoints as often as the duration needs."""
    motion = table.get("motion", {})
    key = next((key for key in ("legs", "waypoints") if key in motion), None)
    if key is None:
        return from_table(table | {"duration_s": duration}, path)
    once = from_table(
        {name: value for name, value in table.items() if name != "duration_s"}, path
    ).motion.end
    times = math.ceil(duration / once)
    while times < 5000:
        made = from_table(
            {
                **table,
                "motion": motion | {key: _times(key, motion[key], times)},
                "duration_s": min(duration, once),
            },
            path,
        )
        if made.motion.end >= duration:
            return made
        times += 1
    raise DataError(
        f"{path}: its motion of {once:g} s would be flown {times} times in {duration_text(duration)}; "
        f"choose a longer one"
    )


def _times(key: str, items: list[dict[str, Any]], times: int) -> list[dict[str, Any]]:
    if times == 1:
        return items
    if key == "legs":
        return [{"repeat": times, "legs": items}]
    loop = items[:-1] if items[0] == items[-1] else items
    return [*loop * times, loop[0]]


def _fastest(made: Scenario) -> float:
    """Fixes per second of the fastest sensor: the IMU's samples may not be fewer."""
    others = [
        sensor.rate or 0.0
        for sensor in (made.magnetometer, made.barometer, made.attitude)
        if sensor is not None
    ]
    return max([0.0 if np.ndim(made.gnss.interval) else 1 / float(made.gnss.interval), *others])


def _with_duration(made: Scenario, duration: float) -> Scenario:
    if made.motion.end < duration:
        raise DataError(
            f"scenario {made.name!r}: its motion ends at {made.motion.end:g} s; plan {duration:g} "
            f"s, or give a scenario file, "
            "whose legs are flown again"
        )
    try:
        return made.replace(duration=float(duration))
    except DataError as error:
        raise DataError(
            f"{error}; a flight of {duration_text(duration)} needs another motion or start"
        ) from None
