"""Ten runs with a fault that are kept, events and status included: `python tests/golden/faulted.py`
writes them anew after a wanted change of behaviour."""

import json
from pathlib import Path

import numpy as np

from strapdown.data.solution import STD_COLUMNS, STD_SCALE
from strapdown_reproductions.faults.catalogue import FAULTS
from strapdown_reproductions.faults.cells import CellTask, right
from strapdown_reproductions.faults.raw import raw
from strapdown_reproductions.faults.runs import FaultSubject, kinds_with, run
from strapdown_reproductions.faults.worlds import MOTIONS, ROWS

FOLDER = Path(__file__).resolve().parent
SAID = FOLDER / "faulted.json"
SEED, STEP = 1, 10.0
"""Of the simulation; seconds between the rows that are kept."""
STD = ("std_north", "std_down", "std_rotation_down")
FAULTED = {
    "jump": ("position jumps by 20 m for good", "gentle", FaultSubject("closed-loop")),
    "drift": ("position drifts by 0.1 m/s", "gentle", FaultSubject("closed-loop")),
    "frozen": ("IMU frozen for 10 s", "hard", FaultSubject("closed-loop")),
    "spike": ("accelerometer: one sample of 1e+06 m/s^2", "gentle", FaultSubject("mekf")),
    "no-fix": ("all positions 0, 0, 0 from 90 s", "gentle", FaultSubject("open-loop")),
    "gap": ("IMU missing for 5 s", "gentle", FaultSubject("closed-loop", "smoothed")),
    "late": ("fixes late by 0.5 s", "gentle", FaultSubject("closed-loop", "live")),
    "outage": ("no GNSS for 60 s", "gentle", FaultSubject("mekf", "live")),
    "magnet": ("magnet of 50 uT beside it for 30 s", "in a hand", FaultSubject("attitude-mekf")),
    "sign": ("gyro z sign flips at 90 s", "gentle", FaultSubject("nlo")),
}
"""{name of the files: (fault, motion, what runs)}."""


def replay(name):
    """(table every STEP seconds, {"status": [[t, status]] where it changes, "events": [[t, text]]})
    of a run with its fault."""
    fault, motion, subject = FAULTED[name]
    kinds = kinds_with(FAULTS[fault], subject)
    without = right(CellTask(motion, subject, SEED), kinds)
    data = raw(without.recording, kinds, SEED, fault)
    FAULTS[fault].change(data)
    done = run(subject, data, MOTIONS[motion], without.recording, without.start)
    table = done.trajectory.table()
    for column in STD:
        i = STD_COLUMNS.index(column)
        table[column] = done.trajectory.std[:, i] * STD_SCALE[i]
    changes = np.flatnonzero(np.diff(done.status, prepend=-1))
    said = {
        "status": [[round(float(done.trajectory.t[i]), 3), int(done.status[i])] for i in changes],
        "events": [[round(t, 3), text] for t, text in done.events],
    }
    return table.iloc[:: round(STEP * ROWS)].dropna(axis="columns", how="all").round(9), said


if __name__ == "__main__":
    said = {}
    for name in FAULTED:
        table, said[name] = replay(name)
        table.to_csv(FOLDER / f"faulted-{name}.csv")
        print(name, len(table), len(said[name]["events"]))
    SAID.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
