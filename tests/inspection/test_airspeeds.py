"""Airspeeds against speeds over ground: unit, sign, scale, clock, frozen values, what they read at rest."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection.air_data import check
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.any_sensor import Simulated

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
WIND = (5.0, -3.0)


def flown(seed, kind="true-airspeed"):
    pitot = Simulated(kind, 1.0, 5.0, states=WIND)
    return sd.simulate("demo", 400.0, "tactical", seed, sensors=[pitot])


@pytest.fixture(scope="module")
def flight():
    return flown(1)


def bent(recording, change):
    """What the check says of a changed airspeed."""
    *others, airspeed = recording.sources
    changed = replace(recording, sources=(*others, change(airspeed)))
    return check(InspectedRecording(changed))


@pytest.mark.parametrize("kind", ["true-airspeed", "indicated-airspeed"])
@pytest.mark.parametrize("seed", range(5))
def test_a_right_airspeed_is_a_fact_with_its_wind(kind, seed):
    """Five standard deviations: a false alarm below 1 in 10^5."""
    found = check(InspectedRecording(flown(seed, kind)))
    assert not found.reasons and not found.inconclusive
    (fact,) = found.facts
    factor, std = (float(word) for word in fact.split("factor ")[1].split(",")[0].split(" +- "))
    assert abs(factor - 1) < max(4 * std, 0.01)
    blows, out_of = (float(fact.split(word)[1].split()[0]) for word in ("wind of ", "out of "))
    assert abs(blows - np.hypot(*WIND)) < 0.5
    assert abs(out_of - np.degrees(np.arctan2(-WIND[1], -WIND[0])) % 360) < 6


@pytest.mark.parametrize(
    "factor, words, remedy",
    [
        (1 / 0.514444, "knots read as m/s", "unit"),
        (0.514444, "m/s read as knots", "unit"),
        (3.6, "km/h read as m/s", "unit"),
        (1.3, "it reads 1.3 +-", "set its `scale` to 0.7"),
        (-1.0, "less than zero", "exchange the tubes"),
    ],
)
def test_a_unit_a_scale_and_a_sign_are_named(flight, factor, words, remedy):
    (reason,) = bent(flight, lambda a: replace(a, y=factor * a.y)).reasons
    assert reason.cause == "unit" and reason.source == "true-airspeed" and reason.weight > 1
    assert words in reason.seen and remedy in reason.remedy


def test_a_scale_of_a_tenth_is_said_unless_the_filter_estimates_it(flight):
    """It is then a fact with its value."""
    tenth = lambda a: replace(a, y=1.1 * a.y)
    (reason,) = bent(flight, tenth).reasons
    assert reason.cause == "unit" and "it reads 1.1 +-" in reason.seen
    found = bent(flight, lambda a: replace(tenth(a), estimate={"scale": (0.05,)}))
    assert not found.reasons and "factor 1.1" in found.facts[0]


def test_a_blocked_pitot_is_named(flight):
    (reason,) = bent(flight, lambda a: replace(a, y=0 * a.y + 0.3)).reasons
    assert "it reads 0.3 m/s at" in reason.seen and "blocked" in reason.remedy


@pytest.mark.parametrize("late", [0.8, -0.8])
def test_a_late_airspeed_is_named(flight, late):
    """Of a flight whose speed changes, by gusts and climbs."""
    found = bent(flight, lambda a: replace(a, t=a.t + late))
    said = float(found.facts[0].split("later by ")[1].split(" +-")[0])
    std = float(found.facts[0].split("later by ")[1].split("+- ")[1].split(" s")[0])
    assert abs(said - late) < 4 * std + 0.05
    if abs(said) > 5 * std:
        assert found.reasons[0].cause == "clock"


def test_a_frozen_pitot_is_named_with_its_times(flight):
    def freeze(a):
        y = a.y.copy()
        y[(a.t > 100) & (a.t < 160)] = y[np.searchsorted(a.t, 100.0)]
        return replace(a, y=y)

    (reason,) = bent(flight, freeze).reasons
    assert reason.cause == "repeated" and "from 100.0 to 159.8 s" in reason.seen


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.between(0.0, 0.0),
        lambda a: a.between(100.0, 103.0),
        lambda a: replace(a, y=np.full_like(a.y, np.nan)),
        lambda a: replace(a, y=np.where(np.arange(len(a.t))[:, None] % 3, a.y, np.nan)),
        lambda a: replace(a, t=np.full_like(a.t, 100.0)),
    ],
    ids=["empty", "a few", "nan", "gaps", "one time"],
)
def test_strange_airspeeds_end_in_a_word(flight, change):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = bent(flight, change)
    assert not found.reasons and (found.facts or found.inconclusive)


def test_errors_that_last_are_told_with_their_time(flight):
    """Of an exponential correlation, until it has fallen to 1 / e; white ones are not."""
    assert "correlated" not in bent(flight, lambda a: a).facts[0]

    def gusts(a, tau=2.0, step=0.2):
        noise = np.random.default_rng(3).normal(0, 2.0, len(a.t))
        for k in range(1, len(noise)):
            share = np.exp(-step / tau)
            noise[k] = share * noise[k - 1] + np.sqrt(1 - share**2) * noise[k]
        return replace(a, y=a.y + noise[:, None])

    (fact,) = bent(flight, gusts).facts
    size, seconds = (
        float(fact.split(word)[1].split()[0]) for word in ("errors of ", "correlated over ")
    )
    assert abs(size - np.hypot(2.0, 1.0)) < 0.4 and 1.0 < seconds < 3.0


def test_without_turns_nothing_is_said_for_sure():
    pitot = Simulated("true-airspeed", 1.0, 5.0)
    recording = sd.simulate("straight", 200.0, "tactical", 1, sensors=[pitot])
    found = check(InspectedRecording(recording))
    assert not found.reasons and not found.facts
    assert "hardly turns" in found.inconclusive[0]


def test_a_recorded_flight(data_folder):
    """What its README says: about -1.2 m/s at rest; within 2 % in flight."""
    found = check(InspectedRecording(sd.read(EXAMPLES / "thor75-air.toml")))
    assert not found.reasons
    rest, against = found.facts
    assert rest.startswith("indicated-airspeed at rest: -1.1 m/s")
    assert "-5.9 m/s before its zero, for 4 s" in rest
    assert "of 1.3 m/s are correlated over 2.9 s, so 29" in against
    assert "factor 0.98" in against
