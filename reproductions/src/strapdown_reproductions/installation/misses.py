"""The three figures of the README that are missed on recorded data, with what is found of the
installation."""

from pathlib import Path
from typing import Any

import numpy as np

import strapdown as sd
from strapdown.evaluation.metrics import errors, outages, rms
from strapdown.experiments.monte_carlo.wrong_installation import parameters_of
from strapdown.recording import Recording

from ..common.example_recordings import FLIGHT, windows_of
from .drive import NOTHING, WANTED
from .methods import METHODS, set_up

FLYING = {"clock": None, "lever-arm": None}
STATES = "as states of the run"
BOUNDS = {"thor75 roll": 0.4, "thor75 position D": 0.5, "drive0708 alone": 5.5}
UNITS = {"thor75 roll": "deg", "thor75 position D": "m", "drive0708 alone": "m"}


def rows(folder: Path) -> list[dict[str, Any]]:
    """A row per recording and method: the figures, and what was found."""
    flight, drive = sd.read(folder / "thor75.toml"), sd.read(folder / "drive0708.toml")
    vehicle = sd.read(folder / "drive0708-vehicle.toml")
    found = [_flown(flight, NOTHING), _flown(flight, STATES, estimate=list(FLYING))]
    driven = [_driven(drive, NOTHING), _driven(drive, STATES, estimate=list(FLYING))]
    for name, method in METHODS.items():
        in_flight = method(flight, FLYING)
        found.append(_flown(in_flight.recording, name) | _said(flight, FLYING, in_flight.change))
        on_road = method(vehicle, WANTED)
        parameters = parameters_of(vehicle, WANTED)
        driven.append(
            _driven(set_up(drive, parameters, on_road.change), name)
            | _said(vehicle, WANTED, on_road.change)
        )
    return found + driven


def _said(recording: Recording, wanted: dict[str, None], change: Any) -> dict[str, str]:
    parts = [
        f"{p.of.name} {p.of.components[p.component]}".strip()
        + f" {value * p.of.factor:+.3f} {p.of.unit}"
        for p, value in zip(parameters_of(recording, wanted), change)
        if value
    ]
    return {"found": ", ".join(parts)}


def _flown(recording: Recording, method: str, **more: Any) -> dict[str, Any]:
    solution = sd.fuse(recording, **more)
    r = rms(errors(solution, recording.reference), FLIGHT)
    found = {
        f"{name.split(' error')[0]} {values[-1]:+.3f}"
        for name, values in solution.columns.items()
        if " error of " in name and not name.startswith("sd of")
    }
    return {
        "recording": "thor75",
        "method": method,
        "thor75 roll": float(np.degrees(r.rph[0])),
        "thor75 position D": float(r.position[2]),
        "found": ", ".join(sorted(found)),
    }


def _driven(recording: Recording, method: str, **more: Any) -> dict[str, Any]:
    windows = windows_of(recording)
    solution = sd.fuse(recording.hidden(windows), **more)
    found = outages(solution, recording.reference, windows)
    return {
        "recording": "drive0708",
        "method": method,
        "drive0708 alone": float(np.median([each.horizontal_max for each in found])),
        "found": "",
    }
