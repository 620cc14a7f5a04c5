"""An Aircraft flown by JSBSim: an independent engine for the same body, with given positions of
the controls."""

from collections.abc import Iterable, Mapping, Sequence
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..checks import DataError, check_keys, check_number
from ..geometry.rotations import Rotation
from ..sim.jsbsim import FOOT, STATE_PROPERTIES, STATE_UNITS, begin, quaternions, session
from ..sim.trajectory import EARTH_RATE
from ..typing import Array, ArrayLike, File
from .aircraft_model.dynamics import checked_state
from .aircraft_model.parameters import Aircraft, aircraft as find, checked_array
from .jsbsim_definition import CONTROLS, jsbsim_definition

INTEGRATORS = {
    "rate/rotational": 4,
    "rate/translational": 4,
    "position/rotational": 4,
    "position/translational": 4,
}
"""Adams-Bashforth of third order for all; as it comes, JSBSim integrates rotation by the
first-order rectangle rule."""
MAX_FLIGHT = 100e3
"""m: beyond, a flight is lost."""
SUBSTEPS = 10
"""Steps of JSBSim per interval of the controls."""
RATE_PROPERTIES = ("velocities/pi-rad_sec", "velocities/qi-rad_sec", "velocities/ri-rad_sec")
"""Rates in JSBSim: those against inertial space."""


def fly_jsbsim(
    aircraft: Aircraft | File,
    state: ArrayLike,
    controls: ArrayLike,
    dt: float,
    wind: ArrayLike = (0.0, 0.0),
    substeps: int = SUBSTEPS,
    integrators: Mapping[str, int] | None = None,
) -> Array:
    """The motion of an Aircraft (or that of a name) in JSBSim, its controls moved as recorded: (n,
    17) states as in flight.aircraft_model.dynamics, at 0, dt, ... s.

    `state` (17,): where it begins. `controls` (n, 4): positions of elevator, aileron, rudder (rad)
    and throttle at those times, straight lines between them. `wind` (2,): steady, to north and
    east, m/s. JSBSim takes `substeps` steps per dt, by its `integrators` (default INTEGRATORS), on
    its own Earth: rotating WGS-84 with J2 gravity. Raises DataError: JSBSim missing, bad arrays, a
    flight that is lost.
    """
    aircraft, state, controls = (
        find(aircraft),
        checked_state(state, "fly_jsbsim"),
        checked_array(controls, (None, 4), "fly_jsbsim: controls"),
    )
    wind = checked_array(wind, (2,), "fly_jsbsim: wind to north and east")
    check_number(len(controls), "fly_jsbsim: number of times of the controls", least=2)
    check_number(dt, "fly_jsbsim: dt", "s", above=0)
    check_number(substeps, "fly_jsbsim: substeps", least=1, whole=True)
    check_keys(integrators or {}, INTEGRATORS, "fly_jsbsim: integrators")
    with session(substeps / dt) as (executive, said), TemporaryDirectory() as folder:
        path = jsbsim_definition(aircraft, folder)
        executive.set_aircraft_path(str(folder))
        if not executive.load_model(path.stem):
            raise DataError(
                f"JSBSim does not take the definition of {aircraft.name}: "
                f"{''.join(said).strip()[-200:]}"
            )
        _place(
            executive, state, controls[0], wind, INTEGRATORS if integrators is None else integrators
        )
        told = np.empty((len(controls), len(STATE_PROPERTIES) + len(RATE_PROPERTIES)))
        for row in range(len(controls)):
            # a run moves on, then computes accelerations there: it takes the controls there
            for i in range(1, substeps + 1 if row else 0):
                _set_properties(
                    executive,
                    CONTROLS,
                    controls[row - 1] + i / substeps * (controls[row] - controls[row - 1]),
                )
                executive.run()
            told[row] = [executive[key] for key in STATE_PROPERTIES + RATE_PROPERTIES]
            if not np.isfinite(told[row]).all() or abs(told[row, 2]) > MAX_FLIGHT / FOOT:
                raise DataError(f"JSBSim lost {aircraft.name} after {row * dt:.2f} s")
    told[:, :9] *= STATE_UNITS
    return np.hstack([told[:, :6], quaternions(told[:, 6:9]), told[:, 9:], controls])


def _set_properties(executive: Any, keys: Sequence[str], values: Iterable[float]) -> None:
    for key, value in zip(keys, values):
        executive[key] = float(value)


def _place(
    executive: Any, state: Array, controls: Array, wind: Array, integrators: Mapping[str, int]
) -> None:
    """Begin at a state of ours; JSBSim counts the rates that it is given against the rotating
    Earth."""
    attitude = Rotation.from_wxyz(state[6:10])
    roll, pitch, heading = attitude.as_rph()
    rates = state[10:13] - attitude.inv().apply(
        EARTH_RATE * np.array([np.cos(state[0]), 0.0, -np.sin(state[0])])
    )
    for key, value in integrators.items():
        executive[f"simulation/integrator/{key}"] = value
    _set_properties(executive, CONTROLS, controls)
    begin(
        executive,
        state[:3],
        {
            "vw-dir-deg": np.degrees(np.arctan2(wind[1], wind[0])),
            "vw-mag-fps": np.hypot(*wind) / FOOT,  # where it blows to
            "phi-rad": roll,
            "theta-rad": pitch,
            "psi-true-rad": heading,
            "vn-fps": state[3] / FOOT,
            "ve-fps": state[4] / FOOT,
            "vd-fps": state[5] / FOOT,
            "p-rad_sec": rates[0],
            "q-rad_sec": rates[1],
            "r-rad_sec": rates[2],
        },
    )
