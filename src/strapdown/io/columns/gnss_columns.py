"""Sections for the fixes of a table: position, velocity, speed and course, with their accuracy,
from the names, magnitudes and content of its columns. Only rows with a newly arrived fix that is
not zero count."""

import re
from typing import Any, NamedTuple

import numpy as np

from ...core.mathematics.earth import A
from ...typing import Array, Mask
from ...units.conversion import UNITS
from ..description.schema_base import KeyCondition
from ..description.source_files import holds
from ..reader import Section
from .column_names import (
    DEVIATIONS,
    ECEF,
    ECEF_VELOCITY,
    FIX,
    POSITION,
    VELOCITY,
    ColumnNames,
    plain,
)
from .track_units import angles_of, unit_of_velocity, units_of_course

POSITION_STD, VELOCITY_STD = (2.0, 2.0, 4.0), (0.2, 0.2, 0.3)
"""m and m/s, for a receiver that states no standard deviation."""
SPREADS = (("m", "mm", "cm", "km", "ft"), ("rad", "deg"), tuple(UNITS["speed"]))
"""Units of standard deviations, by quantity."""
NO_STD = "the table states no accuracy; this is a typical one of a receiver"
ARM = (
    "# lever_arm = [0.0, 0.0, 0.0]    # m, forward-right-down, from the vehicle's reference point to "
    "the antenna",
)


class GnssColumns(NamedTuple):
    """Sections drafted from the table of a GNSS receiver, with facts and open questions."""

    sections: list[Section]
    facts: list[str]
    # columns (n,) in degrees, converted from degrees and minutes, by name
    made: dict[str, Array]
    # the columns that these were converted from
    sources: list[str]
    asked: list[str]


class Keys(NamedTuple):
    """Keys of a section, and the reason for each value that the table does not state."""

    values: dict[str, Any]
    assumed: dict[str, str]

    def with_more(self, more: "Keys") -> "Keys":
        """Return these keys, then the others."""
        return Keys(self.values | more.values, self.assumed | more.assumed)


def fix_sections(
    columns: ColumnNames, time: dict[str, Any], t: Array, is_imu: bool = False
) -> GnssColumns:
    """Return the GnssColumns of a table with the times `time`, t (n,) s. Beside an IMU, rows may
    repeat the fix before."""
    found = GnssColumns([], [], {}, [], [])
    told = conditions(columns, is_imu)
    shared = Keys({"time": time}, {})
    if told:
        shared.values["where"] = told[0][0] if len(told) == 1 else [where for where, _ in told]
        shared.assumed["where"] = "; ".join(why for _, why in told)
    track = _position(columns, shared, found)
    _velocity(columns, shared, found, t, track)
    return found


def _add(found: GnssColumns, kind: str, told: Keys) -> None:
    keys = told.values
    section = Section("source", "gnss", {"kind": kind, **keys}, assumed=told.assumed, remarks=ARM)
    found.sections.append(section)
    names, units = keys["columns"], keys["unit"]
    shown = units if isinstance(units, str) else ", ".join(units)
    extra = {key: keys[key] for key in ("axes", "form") if key in keys}
    more = "".join(f", {each}" for each in extra.values())
    found.facts.append(f"{kind}: {', '.join(names)} in {shown}{more}")


def _position(columns: ColumnNames, shared: Keys, found: GnssColumns) -> Array | None:
    """Add the position, and return latitude and longitude (n, 2), rad, or None."""
    names = {key: columns.find(pattern) for key, pattern in POSITION.items()}
    lat, lon = names["latitude"], names["longitude"]
    if not lat or not lon:
        _ecef(columns, shared, found)
        return None
    keys, why = dict(shared.values), dict(shared.assumed)
    angles = angles_of(columns, lat, lon)
    angle, scale, track = angles.unit, angles.scale, angles.track
    if angles.made:
        keys["table"] = columns.table.name
        lat, lon = angles.names
        found.made.update(angles.made)
        found.sources.extend(angles.sources)
        why["columns"] = angles.why
    height = names["ellipsoidal"] or names["sea"] or names["height"]
    if height is None:
        others = ", ".join(columns.without([*angles.sources, *angles.names]).names[:20])
        found.asked.append(
            f"{names['latitude']} and {names['longitude']} are there, but no column is recognised as "
            f"the height, which a position needs: rename it to height, in m (the other columns are {others})"
        )
        return track
    length, size = _length(columns, height)
    keys |= {"columns": [lat, lon, height], "unit": [angle, angle, length]}
    if scale != 1 or size != 1:
        keys["scale"], why["scale"] = [scale, scale, size], "from the magnitude of the numbers"
    if height != names["ellipsoidal"]:
        keys |= _geoid(columns, names, height, why)
    keys["std"], told = _position_std(columns, "mm" if size != 1 else "m")
    why |= {"std": told} if told else {}
    _add(found, "position", Keys(keys, why))
    return track


def _geoid(
    columns: ColumnNames, names: dict[str, str | None], height: str, why: dict[str, str]
) -> dict[str, Any]:
    """Return the key `geoid` of a height whose name does not say that it is ellipsoidal."""
    if names["separation"]:
        unit, _ = _length(columns, names["separation"])
        return {"geoid": {"column": names["separation"], "unit": unit}}
    if height == names["sea"]:
        why["geoid"] = f"the name {height!r} means a height above mean sea level"
        return {"geoid": "EGM96"}
    why["columns"] = "; ".join(
        filter(
            None,
            [
                why.get("columns"),
                'heights above the ellipsoid; if above mean sea level, add geoid = "EGM96"',
            ],
        )
    )
    return {}


def _length(columns: ColumnNames, name: str) -> tuple[str, float]:
    """(unit, scale) of a height."""
    named = columns.unit(name, ("m", "mm", "cm", "km", "ft"))
    values = columns.numbers(name)
    typical = float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else 0.0
    return ("m", 0.001) if named is None and typical > 2e4 else (named or "m", 1.0)


def _position_std(columns: ColumnNames, unit: str) -> tuple[Any, str]:
    """(std, why it is assumed); `unit` applies to columns that name none."""
    named = {key: columns.find(pattern) for key, pattern in DEVIATIONS.items()}
    if all(named[key] for key in ("north", "east", "down")):
        return [_deviation(columns, str(named[key]), unit) for key in ("north", "east", "down")], ""
    level = named["horizontal"] or named["all"]
    if not level:
        return list(POSITION_STD), NO_STD
    across = _deviation(columns, level, unit)
    if named["vertical"]:
        return [across, across, _deviation(columns, named["vertical"], unit)], ""
    up = dict(across, scale=2.0)
    return [across, across, up], "std of the height: twice the horizontal one"


def _deviation(columns: ColumnNames, name: str, unit: str) -> dict[str, Any]:
    """Return the entry of `std` of a column, in the unit of its name or else in `unit`."""
    alike = next(units for units in SPREADS if unit in units)
    return {"column": name, "unit": columns.unit(name, alike) or unit}


def _ecef(columns: ColumnNames, shared: Keys, found: GnssColumns) -> None:
    """Add a position and a velocity in ECEF, recognised by the magnitude of the numbers."""
    names = [name for pattern in ECEF.values() if (name := columns.find(pattern))]
    if len(names) < 3:
        return
    values = np.stack([columns.numbers(name) for name in names], axis=1)
    radius = np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1)
    unit = next(
        (
            each
            for each, size in (("m", 1.0), ("km", 1e3), ("cm", 0.01), ("mm", 0.001))
            if len(radius) and abs(np.median(radius) * size / A - 1) < 0.02
        ),
        None,
    )
    if unit is None:
        return
    told = _ecef_keys(names, unit, _covariance(columns, "", "m^2"), 2.0)
    _add(found, "position", shared.with_more(told))
    fast = [name for pattern in ECEF_VELOCITY.values() if (name := columns.find(pattern))]
    if len(fast) == 3:
        speed = columns.unit(fast[0], tuple(UNITS["speed"])) or f"{unit}/s"
        told = _ecef_keys(fast, speed, _covariance(columns, "v", "(m/s)^2"), 0.2)
        _add(found, "velocity", shared.with_more(told))


def _ecef_keys(names: list[str], unit: str, covariance: Any, usual_std: float) -> Keys:
    """Return the keys of x, y and z; without a covariance, their std is `usual_std`."""
    keys = {"columns": names, "axes": "ECEF", "unit": unit}
    if covariance is None:
        return Keys({**keys, "std": usual_std}, {"std": NO_STD})
    return Keys({**keys, "std": covariance}, {})


def _covariance(columns: ColumnNames, of: str, unit: str) -> list[dict[str, Any]] | None:
    """Return six columns of variances and covariances of x, y, z, xy, yz, zx; None where one is
    missing."""
    sign = r"(σ²|σ\^?2|var(iance)?|cov(ariance)?|p)_?"
    found = []
    for pair in ("xx|x", "yy|y", "zz|z", "xy|yx", "yz|zy", "zx|xz"):
        name = columns.find(rf"{sign}{of}_?({pair})")
        if name is None:
            return None
        found.append({"column": name, "unit": unit})
    return found


def _velocity(
    columns: ColumnNames, shared: Keys, found: GnssColumns, t: Array, track: Array | None
) -> None:
    """Add a velocity: north, east and vertical, or speed and course."""
    if any(section.keys["kind"] == "velocity" for section in found.sections):
        return
    names = {key: columns.find(pattern) for key, pattern in VELOCITY.items()}
    vertical = names["down"] or names["up"]
    if names["north"] and names["east"] and vertical:
        told = _by_components(columns, names, t, track)
    elif names["speed"] and names["course"]:
        told = _by_course(columns, names, t, track)
    else:
        return
    _add(found, "velocity", shared.with_more(told))


def _by_components(
    columns: ColumnNames, names: dict[str, str | None], t: Array, track: Array | None
) -> Keys:
    """Keys of a velocity that has columns for north, east and the vertical."""
    north, east = str(names["north"]), str(names["east"])
    unit, told = unit_of_velocity(columns, north, east, t, track)
    down = names["down"]
    keys: dict[str, Any] = {
        "columns": [north, east, down] if down else [east, north, names["up"]],
        "unit": unit,
        "axes": "NED" if down else "ENU",
    }
    why = {"unit": told} if told else {}
    std = {key: columns.find(DEVIATIONS[key]) for key in ("vn", "ve", "vd", "speed")}
    if all(std[key] for key in ("vn", "ve", "vd")):
        order = ("vn", "ve", "vd") if down else ("ve", "vn", "vd")
        keys["std"] = [_deviation(columns, str(std[key]), unit) for key in order]
    elif std["speed"]:
        keys["std"] = [_deviation(columns, std["speed"], unit)] * 3
    else:
        keys["std"], why["std"] = [_of(each, unit) for each in VELOCITY_STD], NO_STD
    return Keys(keys, why)


def _by_course(
    columns: ColumnNames, names: dict[str, str | None], t: Array, track: Array | None
) -> Keys:
    """Keys of a velocity that has columns of speed and course, and perhaps of the vertical."""
    speed, course, vertical = (
        str(names["speed"]),
        str(names["course"]),
        names["down"] or names["up"],
    )
    units, told = units_of_course(columns, speed, course, t, track)
    in_order, form = [speed, course], "speed, course"
    if vertical:
        in_order.append(vertical)
        form += ", down" if names["down"] else ", up"
        units.append(columns.unit(vertical, tuple(UNITS["speed"])) or "m/s")
    std, of_std = _course_std(columns, units)
    why = ({"unit": told} if told else {}) | ({"std": of_std} if of_std else {})
    return Keys({"form": form, "columns": in_order, "unit": units, "std": std}, why)


def _course_std(columns: ColumnNames, units: list[str]) -> tuple[Any, str]:
    """(std, why it is assumed) of speed, course and, where `units` has three, the vertical."""
    of_speed, of_course = (columns.find(DEVIATIONS[key]) for key in ("speed", "course"))
    across = _deviation(columns, of_speed, "m/s") if of_speed else _of(VELOCITY_STD[0], units[0])
    if not of_course:
        return across, f"{'std of the velocity' if of_speed else f'{NO_STD},'} in all directions"
    down = [_of(VELOCITY_STD[2], unit) for unit in units[2:]]
    told = "" if of_speed and not down else NO_STD
    return [across, _deviation(columns, of_course, units[1]), *down], told


def _of(speed: float, unit: str) -> float:
    """Convert a speed in m/s to another unit, rounded."""
    return float(f"{speed / UNITS['speed'][unit]:.2g}")


# ---- rows with a fix

NO_FIX = re.compile(r"no(ne|[ _-]?fix|t .*)?|invalid|v|false|0|2d?|time.*", re.IGNORECASE)
"""Words that mark a row without a three-dimensional fix."""


def conditions(columns: ColumnNames, is_imu: bool) -> list[tuple[dict[str, Any], str]]:
    """[(condition of the key `where`, why)]; beside an IMU, rows may repeat the fix before."""
    fix = _where(columns)
    found = [fix, _zeros(columns, fix[0]), _arrival_condition(columns) if is_imu else (None, "")]
    return [(where, why) for where, why in found if where]


def _where(columns: ColumnNames) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows that are fixes, or None; why)."""
    name = columns.find(FIX)
    if name is None:
        return None, ""
    cells = columns.table.cells(name)[columns.table.cells_filled(name)]
    if columns.table.content[name].dtype.kind in "iuf":
        values = np.unique(cells.astype(float))
        if (
            not len(values)
            or np.any(values != np.round(values))
            or values.min() < 0
            or values.max() > 60
        ):
            return None, ""
        type_of_fix = re.search("type|mode", plain(name)) is not None
        least = (
            3 if type_of_fix and values.max() >= 3 else 2 if type_of_fix and values.max() > 1 else 1
        )
        unused = int((cells < least).sum())
        return {"column": name, "least": least}, f"{unused} rows of {len(cells)} have no fix"
    texts = sorted({str(cell) for cell in cells})
    good = [text for text in texts if not NO_FIX.fullmatch(text.strip())]
    if not good or len(texts) > 12:
        return None, ""
    unused = sum(str(cell) not in good for cell in cells)
    return {"column": name, "equals": good}, f"{unused} rows of {len(cells)} have no fix"


def _zeros(columns: ColumnNames, where: dict[str, Any] | None) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows that are fixes, or None; why), for a receiver that writes zeros where
    it has no fix; only the rows that satisfy `where` count."""
    names = [columns.find(POSITION["latitude"]), columns.find(POSITION["longitude"])]
    if not all(names):
        names = [columns.find(pattern) for pattern in ECEF.values()]
    some = [name for name in names if name]
    if len(some) < len(names):
        return None, ""
    zero = np.stack([columns.numbers(name) == 0 for name in some], axis=1)
    if where:
        zero = zero[holds(columns.table, KeyCondition.model_validate(where))]
    count = int(zero.all(axis=1).sum())
    alone = [name for name, each in zip(some, zero.T) if each.sum() == count]
    if not 0 < count < len(zero) or not alone:
        return None, ""
    return {"column": alone[0], "unequal": 0}, f"{count} rows of {len(zero)} are zero: no fix"


def _arrival_condition(columns: ColumnNames) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows where a fix arrived, or None; why), where most rows repeat a fix."""
    patterns = [*POSITION.values(), *VELOCITY.values()]
    if not columns.find(POSITION["latitude"]):
        patterns = [*ECEF.values(), *ECEF_VELOCITY.values()]
    names = list(dict.fromkeys(filter(None, map(columns.find, patterns))))
    if not names:
        return None, ""
    values = np.stack([columns.numbers(name) for name in names], axis=1)
    known: Mask = np.asarray(np.isfinite(values).any(axis=1))
    changed = np.not_equal(values[1:], values[:-1]) & np.isfinite(values[1:])
    repeats = int((known[1:] & known[:-1] & ~changed.any(axis=1)).sum())
    if 2 * repeats <= known.sum() or not changed.any():
        return None, ""
    name = names[int(np.argmax(changed.sum(axis=0)))]
    why = f"{repeats} rows of {known.sum()} repeat the fix of the row before"
    return {"column": name, "changes": True}, why
