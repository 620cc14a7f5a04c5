"""Positions, velocities and headings of NMEA 0183 as tables and sections of a description.

The sentences do not state everything. Assumed are the standard deviations without GST, and always
those of speed and heading.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....typing import Ints
from ...reader import Log, Section
from ...tables.table_file import FileTable
from ..carrier_classes import by_class
from .cyclic_times import CyclicClock, in_order, same_time
from .nmea_sentences import TIME_FIELD, SentenceKind, Sentences, clock as clock_of

ERRORS = {1: 4.0, 2: 1.5, 3: 1.5, 4: 0.02, 5: 0.5, 9: 1.5}
"""Horizontal std, m, by quality of the fix (1 autonomous, 2 and 9 with corrections, 3 PPS, 4 RTK
fixed, 5 RTK float), to be multiplied by HDOP where that is above 1. 4 m and 0.02 m come from ROS'
nmea_navsat_driver; 1.5 m is gpsd's 3.75 m (95 %) as a standard deviation of one axis; 0.5 m lies
between."""
CARRIER = {"fixed": (4,), "float": (5,), "single": (1, 2, 3, 9)}
"""Carrier solutions by quality of the fix."""
VERTICAL = 2.0
"""Ratio of the vertical standard deviation to the horizontal one."""
SPEED_STD = 0.6
"""Std of each component of a velocity, knots (0.3 m/s). Receivers state 0.05 m/s, but filter."""
HEADING_STD = 2.0
"""deg"""
MIN_STD, MIN_STD_RTK = 0.1, 0.01
"""m: smallest std of a fix; the second is for quality 4 (RTK fixed). Some receivers write 0 in
GST."""
QUALITY_OF_MODE = {b"A": 1, b"D": 2, b"P": 3, b"R": 4, b"F": 5, b"": 1}
"""Modes of RMC, GLL, GNS and VTG; E (estimated), M (manual), S (simulated) and N (none) are not
used."""
GNSS = (b"GP", b"GN", b"GL", b"GA", b"GB", b"BD", b"GQ", b"QZ", b"GI")
"""Talkers that one multi-constellation receiver uses."""
UNTOLD = (
    "NMEA does not say whether a receiver used inertial sensors of its own (as u-blox F9K, F9R, M8U "
    "and others do); fixes of such a receiver are not independent of the IMU"
)


class Sorting(NamedTuple):
    """Sentences of a file and the tables made of them."""

    path: Path
    sentences: Sentences
    clock: CyclicClock
    tables: dict[str, FileTable]  # made so far
    left: list[str]  # lines on what is left out

    @property
    def kinds(self) -> dict[str, SentenceKind]:
        """{name: sentences of that name}."""
        return self.sentences.kinds

    def table(
        self,
        name: str,
        kind: SentenceKind,
        t: Ints,
        good: NDArray[np.bool_],
        columns: dict[str, NDArray[Any]],
    ) -> FileTable:
        """Return the good rows in time order, each time once."""
        rows = np.flatnonzero(good)
        moment = self.clock.ms(kind.place[rows], t[rows])
        order, late, twice = in_order(moment)
        rows = rows[order]
        if late:
            self.left.append(f"{late} {name} out of order: sorted")
        if twice:
            self.left.append(f"{twice} {name} that repeat a time")
        values = {self.clock.column: moment[order]}
        values |= {key: each[rows] for key, each in columns.items()}
        return FileTable.of(f"{self.path} [{name}]", values, rows, "sentence")


def nmea_log(path: Path, sentences: Sentences) -> Log:
    """The Log of the sentences of a file."""
    clock = clock_of(sentences)
    left: list[str] = []
    found = Sorting(path, _of_one_source(sentences, left), clock, {}, left)
    sections = [*_positions(found), *_velocities(found), *_headings(found)]
    if sections and not clock.absolute:
        left.append(
            "dates: no RMC or ZDA has one, so times are s of the day, UTC; join them only with files that "
            "have such times too"
        )
    if sentences.rejected:
        left.append(f"{sentences.rejected} NMEA sentences fail their checksum")
    if sentences.bare:
        left.append(f"{sentences.bare} NMEA sentences without a checksum, or cut short")
    shown = ", ".join(f"{name} {len(kind.place)}" for name, kind in found.kinds.items())
    facts = [f"{path}: NMEA sentences {shown}"] if shown else []
    return Log(
        found.tables, tuple(sections), (*facts, *([UNTOLD] if sections else [])), tuple(left)
    )


def _of_one_source(sentences: Sentences, left: list[str]) -> Sentences:
    """Keep the sentences of one talker for each type, the most frequent one: besides the GNSS
    receiver, other devices, for example on a ship, may send the same type. `left` gets a line on
    the others."""
    kinds = {}
    for name, kind in sentences.kinds.items():
        gnss = np.array([talker in GNSS for talker in kind.talkers])
        most = gnss if 2 * np.count_nonzero(gnss) >= len(gnss) else ~gnss
        kinds[name] = kind if most.all() else kind.rows(np.flatnonzero(most))
        if not most.all():
            others = sorted({talker.decode() for talker, its in zip(kind.talkers, most) if not its})
            left.append(f"{np.count_nonzero(~most)} {name} of other devices ({', '.join(others)})")
    return sentences._replace(kinds=kinds)


def _positions(found: Sorting) -> list[Section]:
    """Return the sections of the positions from the first of GGA, GNS, RMC and GLL with a fix."""
    for name in ("GGA", "GNS", "RMC", "GLL"):
        if name not in found.kinds:
            continue
        kind = found.kinds[name]
        quality, t = _quality(name, kind), kind.time_of_day(TIME_FIELD[name])
        columns = _place_columns(name, kind)
        good = np.isin(quality, list(ERRORS)) & (t >= 0) & np.isfinite(columns["lat"])
        good &= np.isfinite(columns["lon"])
        columns |= {"quality": quality}
        columns["altitude"] = np.where(_flat(found.sentences, t), np.nan, columns["altitude"])
        table = found.table(name, kind, t, good, columns)
        if (bad := int(np.count_nonzero(~good))) > 0:
            found.left.append(
                f"{bad} {name} without a fix, or with an estimated, manual or simulated one"
            )
        if not len(table.lines):
            continue
        found.tables[name], why = _with_deviations(table, found.sentences, found.clock)
        heights, geoid = _heights(found.tables[name], found.left)
        keys = {
            "kind": "position",
            "table": name,
            "time": found.clock.time,
            "columns": ["lat", "lon", "altitude"],
            "unit": ["deg", "deg", "m"],
            **geoid,
            "std": ["std_n", "std_e", "std_d"],
        }
        assumed = {"std": why} if why else {}
        if geoid.get("geoid") == "EGM96":
            assumed["geoid"] = "the sentences do not state its separation"
        title = f"{name}, {len(table.lines)} fixes" + ("" if heights else ", no heights")
        section = Section("source", "gnss", keys, 0, title, assumed)
        return by_class(
            section,
            table.cells("quality"),
            "quality",
            CARRIER,
            "satellites" if name in ("GGA", "GNS") else "",
        )
    return []


def _flat(sentences: Sentences, t: Ints) -> NDArray[np.bool_]:
    """Return True for the two-dimensional fixes at times of day t (n,), by GSA; the receiver held
    their heights."""
    if "GSA" not in sentences.kinds:
        return np.zeros(len(t), bool)
    kind = sentences.kinds["GSA"]
    mode, there = kind.numbers(2), sentences.time_beside(kind)
    return np.isin(t, there[mode == 2]) & ~np.isin(t, there[mode == 3])


def _heights(table: FileTable, left: list[str]) -> tuple[bool, dict[str, Any]]:
    """(whether there are heights, the key `geoid` with its separation from the ellipsoid)."""
    known = np.isfinite(table.numbers("altitude"))
    if not known.any():
        return False, {}
    told = np.isfinite(table.numbers("separation"))
    if not (told & known).any():
        return True, {"geoid": "EGM96"}
    if many := int(np.count_nonzero(known & ~told)):
        left.append(f"{many} heights without the geoid separation that the others have")
    return True, {"geoid": {"column": "separation", "unit": "m"}}


def _quality(name: str, kind: SentenceKind) -> Ints:
    """Return the quality of each fix (n,) in the numbers of GGA; 0 for an unused one."""
    if name == "GGA":
        return np.nan_to_num(kind.numbers(6)).astype(int)
    states = (
        kind.text({"RMC": 2, "GLL": 6}.get(name, 0)) if name != "GNS" else [b"A"] * len(kind.place)
    )
    modes = kind.text({"RMC": 12, "GLL": 7, "GNS": 6}[name])
    best = [
        # GNS has a letter for each system, N without a fix
        max((QUALITY_OF_MODE.get(mode[i : i + 1], 0) for i in range(max(len(mode), 1))), default=0)
        for mode in modes
    ]
    return np.array([each if state == b"A" else 0 for each, state in zip(best, states)], int)


def _place_columns(name: str, kind: SentenceKind) -> dict[str, NDArray[Any]]:
    at = {"GGA": 2, "GNS": 2, "RMC": 3, "GLL": 1}[name]
    found = {"lat": kind.degrees(at), "lon": kind.degrees(at + 2)}
    nothing = np.full(len(kind.place), np.nan)
    if name in ("GGA", "GNS"):
        separation = kind.numbers(11 if name == "GGA" else 10)
        return found | {
            "altitude": kind.numbers(9),
            "separation": separation,
            "hdop": kind.numbers(8),
            "satellites": kind.numbers(7),
            "age": kind.numbers(13 if name == "GGA" else 11),
        }
    return found | {"altitude": nothing, "separation": nothing, "hdop": nothing}


def _with_deviations(
    table: FileTable, sentences: Sentences, clock: CyclicClock
) -> tuple[FileTable, str]:
    """(the table with standard deviations from GST, or assumed ones; the reason)."""
    quality, hdop = table.cells("quality"), table.numbers("hdop")
    assumed = np.array([ERRORS[each] for each in quality.tolist()]) * np.fmax(hdop, 1.0)
    assumed = np.where(np.isfinite(assumed), assumed, 10.0)
    std = np.stack([assumed, assumed, VERTICAL * assumed], axis=1)
    told, raised = np.zeros(std.shape, bool), False
    least = np.where(quality == 4, MIN_STD_RTK, MIN_STD)[:, None]
    if "GST" in sentences.kinds:
        gst = sentences.kinds["GST"]
        t = gst.time_of_day(1)
        there = np.where(t >= 0, clock.ms(gst.place, t), -1)
        every = [same_time(table.cells(clock.column), there, gst.numbers(k)) for k in (6, 7, 8)]
        own = np.stack(every, axis=1)
        told = np.isfinite(own) & (own > 0)
        raised = bool((told & (own < least)).any())
        std = np.where(told, np.maximum(own, least), std)
    table = table.with_columns(dict(zip(("std_n", "std_e", "std_d"), std.T)))
    assumptions = []
    if not told.all():
        kinds = np.unique(quality[~told.all(axis=1)]).tolist()
        used = ", ".join(f"{ERRORS[each]:g} m for quality {each}" for each in kinds)
        where = "where GST has none: " if told.any() else ""
        assumptions.append(f"{where}{used}, times HDOP where above 1; twice as much for the height")
    if raised:
        assumptions.append(
            f"the std of GST, at least {MIN_STD_RTK:g} m for quality 4, else {MIN_STD:g} m"
        )
    return table, "; ".join(assumptions)


def _velocities(found: Sorting) -> list[Section]:
    """Return the section of the velocity over ground from RMC, else VTG; without a vertical
    part."""
    for name in ("RMC", "VTG"):
        if name not in found.kinds:
            continue
        kind = found.kinds[name]
        if name == "RMC":
            speed, course, t = kind.numbers(7), kind.numbers(8), kind.time_of_day(1)
            used = _quality(name, kind) > 0
        else:
            speed, course, t = kind.numbers(5), kind.numbers(1), found.sentences.time_beside(kind)
            speed = np.where(np.isfinite(speed), speed, kind.numbers(7) / 1.852)
            used = np.array([each in QUALITY_OF_MODE for each in kind.text(9)], bool)
        columns = {"speed": speed, "course": course}
        good = used & (t >= 0) & np.isfinite(speed)
        if not good.any():
            continue
        beside = name in found.tables  # the lines on the positions already count these rows
        table = f"{name} velocity" if beside else name
        notifier = found._replace(left=[]) if beside else found
        found.tables[table] = notifier.table(table, kind, t, good, columns)
        keys = {
            "kind": "velocity",
            "table": table,
            "time": found.clock.time,
            "form": "speed, course",
            "columns": ["speed", "course"],
            "unit": ["knot", "deg"],
            "std": SPEED_STD,
        }
        why = "the sentences state none; receivers state 0.05 m/s, but filter"
        title = f"{name}, speed and course, {len(found.tables[table].lines)} fixes"
        return [Section("source", "gnss", keys, 0, title, {"std": why})]
    return []


def _headings(found: Sorting) -> list[Section]:
    """Return the section of the true heading from THS, else HDT."""
    for name in ("THS", "HDT"):
        if name not in found.kinds:
            continue
        kind = found.kinds[name]
        heading, t = kind.numbers(1), found.sentences.time_beside(kind)
        good = np.isfinite(heading) & (t >= 0)
        if name == "THS":
            good &= np.array([each == b"A" for each in kind.text(2)], bool)
        if not good.any():
            found.left.append(f"{len(heading)} {name} without a heading")
            continue
        found.tables[name] = found.table(name, kind, t, good, {"heading": heading})
        keys = {
            "kind": "heading",
            "table": name,
            "time": found.clock.time,
            "columns": ["heading"],
            "unit": "deg",
            "std": HEADING_STD,
        }
        title = f"{name}, {len(found.tables[name].lines)} headings"
        return [Section("source", "heading", keys, 0, title, {"std": f"{name} states none"})]
    return []
