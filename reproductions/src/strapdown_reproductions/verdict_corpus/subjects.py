"""The recordings of the corpus: simulated motions, what a receiver or a log may do to them while the set-up
is right, and recorded data."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strapdown.data.recording import Recording
from strapdown.data.solution import Correlated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer

from ..common.motions import HEIGHT, ON_MAST, RECEIVER, StudyMotion
from ..wrong_setups.cases import BEGINS, MOTIONS, SetUpCase, case_of, recorded_cases

CHOSEN, COUNTED = "thresholds", "figures"
"""Halves of the corpus: on which thresholds are chosen, and of which figures are made."""
CLOSED_LOOP, ATTITUDE = "closed-loop", "attitude-mekf"


class Subject(NamedTuple):
    """A vehicle in motion, simulated with the errors of a seed or recorded."""

    name: str
    vehicle: str
    half: str
    make: Callable[[int], SetUpCase]
    motion: StudyMotion | None = None  # None: recorded
    begin: float | None = None  # s from which a simulated recording is taken


PLAIN = "plain"
"""Name of the variant in which nothing is added."""
NEAR = RECEIVER._replace(lever_arm=(0.0, 0.05, -0.1))
WALKING = Gnss(0.2, (0.5, 0.5, 0.8), (0.05, 0.05, 0.08), (0.2, 0.0, -0.6))
FIELD = (21e-6, 1.6e-6, 43.9e-6)
"""T: magnetic field where there is none in the scenario."""
SIMULATED: Mapping[str, tuple[str, str, StudyMotion]] = {
    "car": ("car", CHOSEN, MOTIONS["car"]),
    "car with odometer": ("car", CHOSEN, MOTIONS["car with odometer"]),
    "ship": ("ship", CHOSEN, MOTIONS["ship"]),
    "hand-held": ("hand", CHOSEN, MOTIONS["hand-held"]),
    "straight flight": ("aircraft", CHOSEN, StudyMotion("straight", 300.0, ON_MAST)),
    "flight": ("aircraft", COUNTED, MOTIONS["flight"]),
    "moored ship": ("ship", COUNTED, StudyMotion("ship-heave", 300.0, ON_MAST)),
    "robot": ("robot", COUNTED, StudyMotion("robot", 240.0, WALKING)),
    "robot, consumer": ("robot", COUNTED, StudyMotion("robot", 240.0, WALKING, "consumer")),
    "multicopter": ("multicopter", COUNTED, StudyMotion("multicopter", 200.0, NEAR)),
    "hovering multicopter": ("multicopter", COUNTED, StudyMotion("hover", 200.0, NEAR)),
}
"""{name: (vehicle, half, motion)}."""
OF_RECORDED = {
    "drive0708": ("car", CHOSEN),
    "drive0708-vehicle": ("car", CHOSEN),
    "BROAD 02": ("hand", CHOSEN),
    "BROAD 15": ("hand", CHOSEN),
    "BROAD 21": ("hand", CHOSEN),
    "thor75": ("aircraft", COUNTED),
    "swisslog": ("aircraft", COUNTED),
}
"""{name: (vehicle, half)} of recorded cases."""


def simulated_subjects() -> dict[str, Subject]:
    """{name: Subject} of the simulated motions."""
    return {name: _simulated_subject(name, *of, BEGINS.get(name)) for name, of in SIMULATED.items()}


def _simulated_subject(
    name: str, vehicle: str, half: str, motion: StudyMotion, begin: float | None
) -> Subject:
    make = partial(case_of, name, motion, begin=begin)
    return Subject(name, vehicle, half, make, motion, begin)


def recorded_subjects(folder: Path) -> dict[str, Subject]:
    """{name: Subject} of the recorded cases of the descriptions in `folder`."""
    return {
        name: Subject(name, *OF_RECORDED[name], lambda _, read=read: read())
        for name, read in recorded_cases(folder).items()
    }


# ---- variants: what a receiver or a log may do while the set-up is right


def with_lasting(seconds: float, motion: StudyMotion) -> StudyMotion:
    """A receiver that filters its fixes: their errors last `seconds`, and are stated as white."""
    gnss = motion.gnss
    assert gnss.position_std is not None and gnss.velocity_std is not None
    position, velocity = (
        np.broadcast_to(gnss.position_std, 3),
        np.broadcast_to(gnss.velocity_std, 3),
    )
    return motion._replace(
        gnss=gnss._replace(
            position_std=tuple(0.1 * position),
            velocity_std=tuple(0.1 * velocity),
            position_correlated=Correlated(tuple(position), seconds),
            velocity_correlated=Correlated(tuple(velocity), seconds),
            stated=False,
        )
    )


def with_wandering(motion: StudyMotion) -> StudyMotion:
    """A receiver whose positions wander by their standard deviation within a minute, beside the white
    part, stated as white."""
    std = tuple(np.broadcast_to(motion.gnss.position_std, 3).astype(float))
    return motion._replace(
        gnss=motion.gnss._replace(position_correlated=Correlated(std, 60.0), stated=False)
    )


def with_outages(motion: StudyMotion) -> StudyMotion:
    """Two windows of 30 s without a fix."""
    windows = tuple((share * motion.stop, share * motion.stop + 30.0) for share in (0.55, 0.8))
    return motion._replace(gnss=motion.gnss._replace(outages=windows))


def with_dead_reckoning(motion: StudyMotion) -> StudyMotion:
    """No fix in the last minute."""
    end = ((motion.stop - 60.0, motion.stop + 1.0),)
    return motion._replace(gnss=motion.gnss._replace(outages=end))


def with_heights(motion: StudyMotion) -> StudyMotion:
    """A second source of height."""
    return motion._replace(sensors=(*(s for s in motion.sensors if s not in HEIGHT), *HEIGHT))


def with_attitude_alone(motion: StudyMotion) -> StudyMotion:
    """A magnetometer and no GNSS."""
    none = motion.gnss._replace(position_std=None, velocity_std=None)
    compass = motion.magnetometer or Magnetometer(rate=10.0, field=FIELD)
    return motion._replace(gnss=none, sensors=(), magnetometer=compass, constrained=False)


def without_samples(seconds: float, recording: Recording) -> Recording:
    """The recording of a log that lost samples of `seconds` in the middle."""
    imu, middle = recording.imu, float(np.mean(recording.span))
    kept = (imu.t < middle) | (imu.t > middle + seconds)
    return replace(recording, imu=type(imu)(*(column[kept] for column in imu)))


def with_guessed_axes(recording: Recording) -> Recording:
    """The recording of a reader that guessed the axes, rightly."""
    return replace(recording, meta=recording.meta | {"guessed_axes": "forward right down"})


class CorpusVariant(NamedTuple):
    """A change of a simulated motion whose set-up stays right."""

    of_motion: Callable[[StudyMotion], StudyMotion] = lambda motion: motion
    of_recording: Callable[[Recording], Recording] = lambda recording: recording
    filter: str = CLOSED_LOOP
    with_mistakes: bool = False


VARIANTS: Mapping[str, CorpusVariant] = {
    PLAIN: CorpusVariant(with_mistakes=True),
    **{
        f"fixes filtered over {seconds:g} s": CorpusVariant(partial(with_lasting, seconds))
        for seconds in (1.0, 3.0, 5.0)
    },
    "position wanders within a minute": CorpusVariant(with_wandering),
    "two outages": CorpusVariant(with_outages),
    "dead reckoning": CorpusVariant(with_dead_reckoning),
    "two heights": CorpusVariant(with_heights, with_mistakes=True),
    "attitude alone": CorpusVariant(with_attitude_alone, filter=ATTITUDE, with_mistakes=True),
    **{
        f"{seconds:g} s of samples missing": CorpusVariant(
            of_recording=partial(without_samples, seconds)
        )
        for seconds in (1.1, 4.0, 15.0)
    },
    "axes guessed": CorpusVariant(of_recording=with_guessed_axes),
}
"""{name: CorpusVariant}."""


def with_variant(subject: Subject, variant: CorpusVariant, seed: int) -> SetUpCase:
    """The SetUpCase of a simulated subject with a variant."""
    assert subject.motion is not None
    case = case_of(subject.name, variant.of_motion(subject.motion), seed, subject.begin)
    return case._replace(recording=variant.of_recording(case.recording))
