"""Where the faults happen: simulated motions, gentle and hard, and worlds without any fault in
which a filter may go wrong all the same."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

from strapdown.data.recording import Recording
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim import motions
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import simulate
from strapdown.sim.trajectory import DEG, Motion, demo_flight

DURATION, RATE = 210.0, 50.0
DATE = "2025-06-01"
ROWS = 5.0
"""Rows a second that are kept of a solution."""
NAVIGATION, ATTITUDE, HEAVE = "navigation", "attitude", "heave"
"""Families of filters."""
GENTLE, HARD, IN_HAND, AFLOAT = "gentle", "hard", "in a hand", "afloat"
WALKING, HOVERING, MOORED = "at walking speed", "hovering", "moored"
SEEDS, FEW_SEEDS = 5, 1
"""Seeds of a motion, and of those that come beside the two flights."""


class FaultWorld(NamedTuple):
    """A motion with its sensors."""

    name: str
    motion: Callable[[], Motion]
    families: tuple[str, ...]  # of filters that run there
    imu: str = "tactical"
    rate: float = RATE  # Hz
    duration: float = DURATION  # s
    gnss: Gnss = Gnss()
    seeds: int = SEEDS

    @property
    def every(self) -> int:
        """Which rows of a solution are kept."""
        return max(1, round(self.rate / ROWS))


def hard_flight() -> Motion:
    """Turns with 60 deg of bank one after the other, fast climbs and dives, changes of speed, in
    rough air."""
    legs = [
        {"duration": 25.0},
        {
            "repeat": 12,
            "legs": [
                {"turn": 150 * DEG, "bank": 60 * DEG, "climb": 5.0},
                {"duration": 6.0, "speed": 65.0, "climb": -8.0},
                {"turn": -170 * DEG, "bank": 60 * DEG},
                {"duration": 6.0, "speed": 45.0, "climb": 6.0},
            ],
        },
    ]
    start = (47 * DEG, 8 * DEG, 1500.0)
    return motions.flight(start, 40 * DEG, 50.0, legs, roughness=2.0, name="hard turns")


def in_hand() -> Motion:
    """Ten seconds at rest, then turned and moved in a hand."""
    return motions.hand_held((48 * DEG, 11 * DEG, 500.0), 70 * DEG, rest=10.0)


def walk() -> Motion:
    """Ten seconds at rest, then at 1.4 m/s around corners."""
    legs = [
        {"duration": 10.0},
        {"duration": 3.0, "speed": 1.4},
        {"repeat": 12, "legs": [{"duration": 14.0}, {"duration": 3.0, "turn": 90 * DEG}]},
    ]
    return motions.car((48 * DEG, 11 * DEG, 500.0), 30 * DEG, legs, name="walk")


def elsewhere(
    lat: float | None = None, lon: float | None = None, height: float | None = None
) -> Callable[[], Motion]:
    """The gentle flight, begun at another latitude, longitude (deg) or height (m)."""

    def motion() -> Motion:
        flight = demo_flight()
        there = [
            old if new is None else new
            for old, new in zip(
                flight.lla,
                (lat if lat is None else lat * DEG, lon if lon is None else lon * DEG, height),
            )
        ]
        return flight._replace(lla=tuple(there))

    return motion


def motion_of(name: str) -> Motion:
    """The motion of a scenario."""
    return scenario(name).motion


MOTIONS = {
    world.name: world
    for world in (
        FaultWorld(GENTLE, demo_flight, (NAVIGATION, ATTITUDE)),
        FaultWorld(HARD, hard_flight, (NAVIGATION, ATTITUDE)),
        FaultWorld(IN_HAND, in_hand, (ATTITUDE,), "consumer"),
        FaultWorld(
            AFLOAT,
            lambda: motions.moored_vessel((60 * DEG, 5 * DEG, 45.0), 215 * DEG),
            (HEAVE,),
            "industrial",
        ),
        *(
            FaultWorld(name, partial(motion_of, own), (NAVIGATION,), "industrial", seeds=FEW_SEEDS)
            for name, own in ((WALKING, "robot"), (HOVERING, "hover"), (MOORED, "ship-heave"))
        ),
    )
}
"""The worlds in which every fault happens."""
CENTIMETRES = Gnss(0.2, (0.02, 0.02, 0.03), (0.02, 0.02, 0.03))
FLYING = (NAVIGATION, ATTITUDE)
WORLDS = {
    world.name: world
    for world in (
        FaultWorld("across the antimeridian", elsewhere(lon=179.995), FLYING),
        FaultWorld("latitude 88.9 deg", elsewhere(lat=88.9), FLYING),
        FaultWorld("latitude 88.95 deg, towards 89", elsewhere(lat=88.95), FLYING),
        FaultWorld("latitude -85 deg", elsewhere(lat=-85.0), FLYING),
        FaultWorld("across the equator", elsewhere(lat=0.0), FLYING),
        FaultWorld("height -500 m", elsewhere(height=-500.0), FLYING),
        FaultWorld("height 50 km", elsewhere(height=50e3), FLYING),
        FaultWorld("IMU at 5 Hz", demo_flight, FLYING, rate=5.0),
        FaultWorld("IMU at 1 Hz", demo_flight, FLYING, rate=1.0),
        FaultWorld("IMU at 1 kHz", demo_flight, FLYING, rate=1000.0, duration=100.0),
        FaultWorld("walking, fixes of 1 m", walk, FLYING, "industrial"),
        FaultWorld("walking, fixes of 2 cm", walk, FLYING, "industrial", gnss=CENTIMETRES),
    )
}
"""Where there is no fault."""


@lru_cache(maxsize=20)
def simulate_world(world: FaultWorld, seed: int) -> Recording:
    """The right recording of a world, with every source that a filter may ask for."""
    return simulate(
        world.motion(),
        world.duration,
        world.imu,
        seed,
        rate=world.rate,
        gnss=world.gnss,
        magnetometer=Magnetometer(rate=min(10.0, world.rate)),
        attitude=Ahrs(rate=1.0),
        sensors=(Simulated("altitude", 2.0, 1.0),),
        date=DATE,
    )
