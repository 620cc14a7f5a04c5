"""Sensors that need no calibration run: their worth on recordings."""

import tomllib
from dataclasses import replace

import numpy as np

IRON = [
    "magnetometer without a file, heading",
    "magnetometer without a file, heading over none",
    "magnetometer without a file, outages over none",
    "magnetometer without a file, iron against the file",
]
TO_BODY = np.array([1.0, -1.0, -1.0])
"""From the columns of the magnetometer: axes = "+x -y -z"."""
THOR = "30@240:575/5"
BEGIN, END = 240.0, 575.0


def heading_rms(solution):
    """deg, against the solution on board, in the air."""
    from strapdown.geometry.geodesy import wrap

    truth = solution.recording.reference
    here = (solution.t >= BEGIN) & (solution.t <= END)
    at = np.interp(solution.t[here], truth.t, np.unwrap(truth.rph[:, 2]))
    return float(np.degrees(np.sqrt(np.mean(wrap(solution.trajectory.rph[here, 2] - at) ** 2))))


def iron():
    """[(figure, note)] for IRON: hard iron as states of the closed loop on thor75."""
    import strapdown as sd
    from strapdown_reproductions.common.example_recordings import DESCRIPTIONS

    raw = sd.read(DESCRIPTIONS / "thor75-iron.toml")
    gnss = tuple(a for a in raw.sources if a.kind in ("position", "velocity"))
    without = replace(raw, sources=gnss)
    solution, alone = sd.fuse(raw), heading_rms(sd.fuse(without))
    heading = heading_rms(solution)
    drift = [
        float(made.scores["horizontal_rmse_m"].median())
        for made in (sd.compare(each, ["closed-loop"], outages=THOR) for each in (raw, without))
    ]
    file = tomllib.loads((DESCRIPTIONS / "thor75-magnetometer.toml").read_text())
    of_file = 1e6 * TO_BODY * file["magnetometer"]["bias"]
    states = [each for each in solution.installation.parameters if each.parameter == "hard-iron"]
    off = [abs(each.change - given) / each.std for each, given in zip(states, of_file)]
    seen = ", ".join(f"{each.change:.2f} ± {each.std:.2f}" for each in states)
    return [
        (heading, f"{heading:.3g} deg; by GPS alone {alone:.3g} deg"),
        (heading / alone, f"{heading:.3g} against {alone:.3g} deg"),
        (drift[0] / drift[1], f"median of 62 outages {drift[0]:.3g} against {drift[1]:.3g} m"),
        (max(off), f"{seen} uT; the file has {of_file.round(2).tolist()}"),
    ]
