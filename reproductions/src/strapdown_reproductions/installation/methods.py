"""Ways to find what of an installation is wrong: each takes a recording and gives it back with what
it found, so that one can stand in another's place."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.engine.installation import StateParameter
from strapdown.experiments.monte_carlo.wrong_installation import installed_wrong, parameters_of
from strapdown.installation.findings import FOUND
from strapdown.typing import Array

PASSES = 3
"""Passes of the states: the estimate of one pass is where the next begins."""


class Calibrated(NamedTuple):
    """A recording set up as found, by how much it was changed, and what was estimated."""

    recording: Recording
    change: Array  # (m,) of the parameters asked for, SI
    estimate: Array  # (m,) the same also where it was too small or too unsure to be applied
    std: Array  # (m,) of the estimate, SI


Method = Callable[[Recording, Mapping[str, None]], Calibrated]
"""A method: called with a recording and the names of the parameters."""


def set_up(
    recording: Recording, parameters: tuple[StateParameter, ...], change: Array
) -> Recording:
    """The recording with its parameters changed: what errs by `change`, true - given, is right
    then."""
    return installed_wrong(recording, parameters, -np.asarray(change)).recording


def by_states(recording: Recording, wanted: Mapping[str, None], passes: int = 1) -> Calibrated:
    """The states at the end of the closed loop's run, where filter and smoother are one."""
    parameters = parameters_of(recording, wanted)
    change, made = np.zeros(len(parameters)), recording
    for _ in range(passes):
        solution = sd.fuse(made, estimate=wanted)
        columns = solution.columns
        change += [columns[p.name][-1] / p.of.factor for p in parameters]
        made = set_up(recording, parameters, change)
    stds = [columns[f"std of {p.name}"][-1] / p.of.factor for p in parameters]
    return Calibrated(made, change, change, np.array(stds))


def by_states_again(recording: Recording, wanted: Mapping[str, None]) -> Calibrated:
    """The same PASSES times, each from what the one before found."""
    return by_states(recording, wanted, PASSES)


def by_diagnosis(recording: Recording, wanted: Mapping[str, None]) -> Calibrated:
    """Return the Calibrated with the parameters that `diagnose` finds wrong; those that it calls
    consistent, or not observable, keep the given value."""
    return state_calibration(sd.diagnose(recording), recording, wanted)


def by_calibration(recording: Recording, wanted: Mapping[str, None]) -> Calibrated:
    """Return the Calibrated with the parameters that `calibrate_installation` would write: found,
    and confirmed by states and smoother."""
    return state_calibration(sd.calibrate_installation(recording), recording, wanted)


def state_calibration(found: Any, recording: Recording, wanted: Mapping[str, None]) -> Calibrated:
    """Return the Calibrated of a Diagnosis or a result like it, with name, cause, status, change
    and std of each of its `parameters`, and the recording set up as found."""
    parameters = parameters_of(recording, wanted)
    own = [_estimate_of(p, recording, found.parameters) for p in parameters]
    factors = np.array([p.of.factor for p in parameters])
    estimate = np.array([each.change for each in own]) / factors
    return Calibrated(
        found.recording,
        np.where([each.status == FOUND for each in own], estimate, 0.0),
        estimate,
        np.array([each.std for each in own]) / factors,
    )


def _estimate_of(parameter: StateParameter, recording: Recording, estimates: Any) -> Any:
    """That of the estimates which is of this parameter: of several clocks that of its source."""
    of, axis = parameter.of, parameter.component
    names = {recording.sources[i].name or recording.sources[i].kind for i in parameter.sources}
    own = [each for each in estimates if (each.of, each.axis) == (of, axis)]
    return next((each for each in own if names & {*each.sources}), own[0])


METHODS: dict[str, Method] = {
    "states": by_states,
    "states, three passes": by_states_again,
    "diagnose": by_diagnosis,
    "calibrate installation": by_calibration,
}
"""By name."""
