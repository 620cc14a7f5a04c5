"""A simulated run with a wrong installation: what `diagnose` and `calibrate installation` estimate from
their own alignment, with the intervals that they claim."""

from collections.abc import Iterable, Iterator
from typing import Any

from strapdown.experiments.monte_carlo.wrong_installation import parameters_of
from strapdown.units.constants import NORMAL_95

from .cases import ALIGNED, case
from .methods import METHODS

COMMANDS = ("diagnose", "calibrate installation")
"""Those of METHODS whose intervals are judged."""


def rows(name: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, command and parameter that the command knows."""
    for seed in seeds:
        made = case(name, seed, ALIGNED)
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
