"""The simulated motions, their sensors, and the runs: GNSS and one more sensor, with an outage."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import outages
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.scenario import scenario

from ..common.motions import ON_MAST, ON_WING, StudyMotion, constraints, simulator

NONE = "none"
GNSS = ("position", "velocity")
ON_BUOY = ON_MAST._replace(lever_arm=(0.0, 0.0, -0.5))
HARD_IRON = (15e-6, -10e-6, 20e-6)
"""T: of the simulated magnetometer, which the filter estimates from a prior of 50 uT."""
COMPASS = Magnetometer(rate=10.0, std=0.5e-6, hard_iron=HARD_IRON, field=(21e-6, 1.5e-6, 43e-6))
WIND = (4.0, -3.0)  # m/s, north and east
BODY = Simulated("body-velocity", 0.05, 5.0)
BEAM = Simulated("beam-velocity", 0.05, 5.0, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0))
BASELINE = Simulated("baseline", 0.01, 5.0, (1.0, 0.0, 0.0))
BEACONS = ((900.0, 200.0, 40.0), (-300.0, 800.0, 60.0), (-500.0, -700.0, 50.0))
"""m NED from the start."""


def beacons(name: str) -> tuple[Simulated, ...]:
    """Ranges to BEACONS about the start of a scenario."""
    start = np.array(scenario(name).motion.lla)
    return tuple(
        Simulated(
            "range", 0.5, 1.0, (0.0, 0.0, 0.0, *displace_lla(start, np.array(ned))), f"beacon {k}"
        )
        for k, ned in enumerate(BEACONS, 1)
    )


class SensorMotion(NamedTuple):
    """A motion, and the second at which GNSS is lost."""

    motion: StudyMotion
    lost: float  # s
    # {name of a row: kinds that are used}
    uses: dict[str, tuple[str, ...]]


ALL = {NONE: (), "magnetometer": ("magnetic-field",), "two antennas": ("baseline",)}
ON_ROAD = {
    "odometer": ("speed",),
    "road vehicle": ("zero-lateral-velocity", "zero-vertical-velocity"),
    "odometer, road vehicle": ("speed", "zero-lateral-velocity", "zero-vertical-velocity"),
}
IN_AIR = {
    "airspeed": ("true-airspeed",),
    "airspeed, vane": ("true-airspeed", "side-slip"),
    "barometer": ("pressure-altitude",),
}
AT_SEA = {"Doppler log": ("body-velocity",), "one beam of it": ("beam-velocity",)}
UNDER_WATER = AT_SEA | {"depth": ("depth",), "ranges": ("range",)}
MOTIONS = {
    "car": SensorMotion(
        StudyMotion(
            "car",
            310.0,
            sensors=(Simulated("speed", 0.1, 10.0), BASELINE),
            magnetometer=COMPASS,
            constrained=True,
        ),
        170.0,
        ALL | ON_ROAD,
    ),
    "flight": SensorMotion(
        StudyMotion(
            "demo",
            360.0,
            ON_WING,
            sensors=(
                Simulated("true-airspeed", 1.0, 5.0, states=WIND),
                Simulated("side-slip", float(np.radians(2.0)), 5.0, states=WIND),
                Simulated("pressure-altitude", 1.0, 5.0),
                BASELINE,
            ),
            magnetometer=COMPASS,
        ),
        220.0,
        ALL | IN_AIR,
    ),
    "ship": SensorMotion(
        StudyMotion(
            "ship",
            560.0,
            ON_MAST,
            sensors=(
                BODY,
                BEAM,
                BASELINE,
            ),
            magnetometer=COMPASS,
        ),
        400.0,
        ALL | AT_SEA,
    ),
}
"""By name."""
WITH_DIVE = MOTIONS | {
    "underwater": SensorMotion(
        StudyMotion(
            "underwater",
            420.0,
            ON_BUOY,
            sensors=(
                BODY,
                BEAM,
                Simulated("depth", 0.1, 5.0),
                Simulated("water-pressure", 0.1, 5.0),
                *beacons("underwater"),
            ),
            magnetometer=COMPASS,
        ),
        250.0,
        {NONE: (), "magnetometer": ("magnetic-field",)} | UNDER_WATER,
    ),
}
"""The same with an underwater vehicle, whose fixes come from a buoy above it."""
OUTAGES = (30.0, 120.0)
"""s."""


def rows(name: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, sensor and outage: how far off the horizontal position is at most, m."""
    case = MOTIONS[name]
    for seed in seeds:
        whole = record_motion(case, seed)
        for sensor, kinds in case.uses.items():
            for seconds in OUTAGES:
                window = [(case.lost, case.lost + seconds)]
                solution = fuse(with_kinds(whole, kinds).hidden(window, GNSS))
                found = outages(solution, whole.reference, window)[0]
                yield {
                    "motion": name,
                    "sensor": sensor,
                    "outage": seconds,
                    "seed": seed,
                    "error": found.horizontal_max,
                }


def record_motion(case: SensorMotion, seed: int) -> Recording:
    """A run of the motion with all its sensors."""
    made, _ = simulator(case.motion).run(case.motion.imu, np.random.SeedSequence(seed))
    if case.motion.constrained:
        rng = np.random.default_rng([seed, 1])
        made = replace(made, sources=(*made.sources, *constraints(made, rng)))
    return replace(made, sources=tuple(map(_with_estimates, made.sources)))


def _with_estimates(a: Source) -> Source:
    """The source with what a user would estimate of it."""
    estimate = {"magnetic-field": {"hard-iron": (50e-6,) * 3}, "speed": {"scale": (0.02,)}}
    return replace(a, estimate=estimate.get(a.kind, {}))


def with_kinds(whole: Recording, kinds: tuple[str, ...]) -> Recording:
    """The recording with GNSS and these kinds."""
    return replace(whole, sources=tuple(a for a in whole.sources if a.kind in (*GNSS, *kinds)))
