"""A simulated run with a wrong installation: what `diagnose` and `calibrate installation` estimate from
their own alignment, with the intervals that they claim."""

from collections.abc import Iterable, Iterator
from typing import Any

from strapdown.experiments.monte_carlo.wrong_installation import Installation, parameters_of
from strapdown.units.constants import NORMAL_95

from .cases import ALIGNED, CLOCK, OF_CAR, WITH_ODOMETER, case, simulation
from .methods import METHODS

COMMANDS = ("diagnose", "calibrate installation")
"""Those of METHODS whose intervals are judged."""
OF_GNSS_CLOCK: Installation = {
    "GNSS position clock": CLOCK,
    **{name: std for name, std in OF_CAR.items() if name != "clock"},
}
"""Priors of the parameters that both commands seek in a car with an odometer, whose clock they take as right."""


def rows(name: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, command and parameter that the command knows."""
    priors = OF_GNSS_CLOCK if simulation(name).motion is WITH_ODOMETER else None
    for seed in seeds:
        made = case(name, seed, ALIGNED, priors)
        sought = parameters_of(made.recording, made.priors)
        for command in COMMANDS:
            found = METHODS[command](made.recording, made.priors)
            for parameter, value, std in zip(sought, found.estimate, found.std):
                error = made.true[parameter.name] / parameter.of.factor - value
                if std <= parameter.of.known_std:
                    yield {
                        "motion": name,
                        "command": command,
                        "seed": seed,
                        "parameter": parameter.name,
                        "error": error * parameter.of.factor,
                        "std": std * parameter.of.factor,
                        "inside": bool(abs(error) <= NORMAL_95 * std),
                    }
