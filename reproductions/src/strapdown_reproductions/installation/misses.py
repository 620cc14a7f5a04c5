"""The three figures of the README that are missed on recorded data, with what is found of the
installation."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.evaluation.metrics import errors, outages, rms
from strapdown.experiments.monte_carlo.wrong_installation import parameters_of

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
    found = [_score_flight(flight, NOTHING), _score_flight(flight, STATES, estimate=list(FLYING))]
    driven = [_score_drive(drive, NOTHING), _score_drive(drive, STATES, estimate=list(FLYING))]
    for name, method in METHODS.items():
        in_flight = method(flight, FLYING)
        clock = float(in_flight.change[0])
        found.append(
            _score_flight(in_flight.recording, name, clock)
            | _found_text(flight, FLYING, in_flight.change)
        )
        on_road = method(vehicle, WANTED)
        parameters = parameters_of(vehicle, WANTED)
        driven.append(
            _score_drive(set_up(drive, parameters, on_road.change), name)
            | _found_text(vehicle, WANTED, on_road.change)
        )
    return found + driven


def _found_text(recording: Recording, wanted: dict[str, None], change: Any) -> dict[str, str]:
    parts = [
        f"{p.of.name} {p.of.components[p.component]}".strip()
        + f" {value * p.of.factor:+.3f} {p.of.unit}"
        for p, value in zip(parameters_of(recording, wanted), change)
        if value
    ]
    return {"found": ", ".join(parts)}


def _score_flight(
    recording: Recording, method: str, clock: float = 0.0, **more: Any
) -> dict[str, Any]:
    """The row of a solution of thor75. Beside its horizontal difference from the solution on board
    stands that from the same taken `clock` s later: as far as that one shares a latency."""
    solution = sd.fuse(recording, **more)
    columns = solution.columns
    found = {
        name.split(" error of")[0]: float(columns[name][-1])
        for name in columns
        if " error of " in name and not name.startswith("std of")
    }
    clock = found.get("clock", clock)
    reference = recording.reference
    assert reference is not None
    late = replace(reference, t=reference.t + clock)
    r, of_late = (rms(errors(solution, each), FLIGHT) for each in (reference, late))
    return {
        "recording": "thor75",
        "method": method,
        "thor75 roll": float(np.degrees(r.rph[0])),
        "thor75 position D": float(r.position[2]),
        "thor75 horizontal": float(np.hypot(*r.position[:2])),
        "the same, reference as late": float(np.hypot(*of_late.position[:2])),
        "found": ", ".join(f"{name} {value:+.3f}" for name, value in found.items()),
    }


def _score_drive(recording: Recording, method: str, **more: Any) -> dict[str, Any]:
    windows = windows_of(recording)
    solution = sd.fuse(recording.hidden(windows), **more)
    found = outages(solution, recording.reference, windows)
    return {
        "recording": "drive0708",
        "method": method,
        "drive0708 alone": float(np.median([each.horizontal_max for each in found])),
        "found": "",
    }
