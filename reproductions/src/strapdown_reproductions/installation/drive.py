"""drive0708 with a wrong installation: what each method finds, and what is left in outages."""

from pathlib import Path
from typing import Any

import numpy as np

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.engine.installation import StateParameter
from strapdown.experiments.monte_carlo.wrong_installation import installed_wrong, parameters_of

from .methods import METHODS, Calibrated, set_up

WINDOWS = ",".join(f"{start}:{start + 15}" for start in (60, *range(110, 461, 50)))
WANTED = {"clock": None, "lever-arm": None, "mounting": None}
ALONE, CONSTRAINED = "drive0708", "drive0708-vehicle"
"""Descriptions: GNSS alone, and with the constraints of a car, on which is calibrated."""
RIGHT, EVERYTHING = "as given", "all three"
NOTHING = "nothing"
TWO_DEG = float(np.radians(2.0))
WRONG = {
    RIGHT: {},
    "arm, 1 m": {"lever-arm forward": -1.0},
    "mounting, 2 deg": {"mounting pitch": -TWO_DEG},
    "clock, 0.2 s": {"clock ": 0.2},
}
WRONG[EVERYTHING] = {key: value for part in WRONG.values() for key, value in part.items()}
"""{what is wrong: {parameter: true - given}}, SI."""


def parameter_name(parameter: StateParameter) -> str:
    """Name and component."""
    return f"{parameter.of.name} {parameter.of.components[parameter.component]}"


def horizontal(recording: Recording) -> float:
    """Median over WINDOWS of the largest horizontal error of the closed loop, m."""
    found = sd.compare(recording, "closed-loop", outages=WINDOWS)
    return float(found.scores["horizontal_max_m"].median())


def rows(folder: Path, wrong: str, methods: tuple[str, ...] | None = None) -> list[dict[str, Any]]:
    """A row per method and parameter of drive0708 with something wrong: what was done, what is found,
    and the errors in outages, alone and with constraints."""
    own, constrained = (sd.read(folder / f"{name}.toml") for name in (ALONE, CONSTRAINED))
    parameters = parameters_of(constrained, WANTED)
    done = np.array([WRONG[wrong].get(parameter_name(p), 0.0) for p in parameters])
    alone, given = (installed_wrong(r, parameters, done).recording for r in (own, constrained))
    nothing = Calibrated(given, 0 * done, 0 * done, np.full(len(done), np.nan))
    found = {NOTHING: nothing} | {
        name: METHODS[name](given, WANTED) for name in (METHODS if methods is None else methods)
    }
    made = []
    for name, of in found.items():
        left = {
            "alone_m": horizontal(set_up(alone, parameters, of.change)),
            "constrained_m": horizontal(set_up(given, parameters, of.change)),
        }
        for k, parameter in enumerate(parameters):
            factor = parameter.of.factor
            numbers = {
                "done": done[k],
                "estimated": of.estimate[k],
                "std": of.std[k],
                "applied": of.change[k],
            }
            made.append(
                {
                    "wrong": wrong,
                    "method": name,
                    "parameter": parameter_name(parameter).strip(),
                    "unit": parameter.of.unit,
                    **{key: value * factor for key, value in numbers.items()},
                    **left,
                }
            )
    return made
