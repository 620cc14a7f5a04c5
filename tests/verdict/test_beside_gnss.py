"""What is wrong with a sensor beside GNSS: the verdict names it, and a right one is trusted."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.verdict import beside_gnss

FIELD = (21e-6, 1.5e-6, 43e-6)
SECONDS = 180.0


@pytest.fixture(scope="module")
def drive():
    place = sd.simulate("car", 2.0, "tactical", seed=1).reference.lla[0]
    beacon = displace_lla(place, np.array([400.0, -300.0, 30.0]))
    sensors = [
        Simulated("body-velocity", 0.05, 5.0),
        Simulated("range", 0.5, 2.0, (0.0, 0.0, 0.0, *beacon)),
    ]
    compass = Magnetometer(rate=10.0, std=0.5e-6, field=FIELD)
    made = sd.simulate("car", SECONDS, "tactical", seed=1, sensors=sensors, magnetometer=compass)
    ironed = [
        replace(a, estimate={"hard-iron": (50e-6,) * 3}) if a.kind == "magnetic-field" else a
        for a in made.sources
    ]
    return replace(made, sources=tuple(ironed))


def only(recording, kind, change=lambda a: a):
    """GNSS and the source of that kind, changed."""
    own = [a for a in recording.sources if a.kind in ("position", "velocity")]
    (sensor,) = [a for a in recording.sources if a.kind == kind]
    sensor = change(sensor).between(0.0, SECONDS - 0.3)
    return replace(recording, sources=(*own, sensor))


def stuck(a):
    y = a.y.copy()
    y[a.t > 90] = y[np.argmax(a.t > 90)]
    return replace(a, y=y)


def place_off(a):
    there = displace_lla(np.array(a.parameters[3:]), np.array([100.0, 0.0, 0.0]))
    return replace(a, parameters=(*a.parameters[:3], *there))


def beside_motor(a):
    on = (a.t % 40 > 20)[:, None]
    return replace(a, y=a.y + np.where(on, [8e-6, -5e-6, 6e-6], 0.0))


CASES = {
    "body velocity, scale": ("body-velocity", lambda a: replace(a, y=1.1 * a.y), "scale"),
    "body velocity, sign": ("body-velocity", lambda a: replace(a, y=-a.y), "unit"),
    "body velocity, knots": ("body-velocity", lambda a: replace(a, y=a.y * 3600 / 1852), "unit"),
    "body velocity, late": ("body-velocity", lambda a: replace(a, t=a.t + 0.2), "clock"),
    "body velocity, stuck": ("body-velocity", stuck, "repeated"),
    "range, feet": ("range", lambda a: replace(a, y=a.y / 0.3048), "unit"),
    "range, beacon": ("range", place_off, "beacon"),
    "magnetometer, sign": ("magnetic-field", lambda a: replace(a, y=-a.y), "unit"),
    "magnetometer, gauss": ("magnetic-field", lambda a: replace(a, y=a.y / 100), "unit"),
    "magnetometer, late": ("magnetic-field", lambda a: replace(a, t=a.t + 0.2), "clock"),
    "magnetometer, motor": ("magnetic-field", beside_motor, "disturbed field"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_is_named(drive, name):
    kind, change, cause = CASES[name]
    verdict = sd.fuse(only(drive, kind, change)).verdict
    assert verdict.word != "trusted"
    said = verdict.reasons[0]
    assert said.cause == cause and said.source in (kind, "magnetometer"), str(verdict)


@pytest.mark.parametrize("kind", ["body-velocity", "range", "magnetic-field"])
def test_a_right_one_is_trusted(drive, kind):
    verdict = sd.fuse(only(drive, kind)).verdict
    assert verdict.word == "trusted", str(verdict)


def test_the_beacon_is_said_to_be_where_it_is(drive):
    (reason, *_) = sd.fuse(only(drive, "range", place_off)).verdict.reasons
    north, east = (
        float(word) for word in reason.seen.split() if word[0] in "+-" and word[1:].isdigit()
    )
    # to a few metres: the ranges have pulled the solution by as much
    assert abs(north + 100) < 30 and abs(east) < 30, reason.seen


def spoofed(recording, begin, acceleration):
    """Positions and velocities that accelerate together to the north from then on, for 20 s."""
    made = []
    for a in recording.sources:
        seconds = np.clip(a.t - begin, 0.0, None)
        gained = acceleration * np.minimum(seconds, 20.0)
        way = gained * (seconds - 0.5 * np.minimum(seconds, 20.0))
        if a.kind == "position":
            moved = [displace_lla(y, np.array([north, 0.0, 0.0])) for y, north in zip(a.y, way)]
            a = replace(a, y=np.array(moved))
        elif a.kind == "velocity":
            a = replace(a, y=a.y + np.outer(gained, [1.0, 0.0, 0.0]))
        made.append(a)
    return replace(recording, sources=tuple(made))


def test_a_right_sensor_is_not_blamed_alone_where_gnss_is_spoofed(drive):
    """It is left out, because it contradicts; no constant of its own would begin then."""
    solution = sd.fuse(spoofed(only(drive, "body-velocity"), 100.0, 0.5))
    assert any("body-velocity: left out" in text for _, text in solution.events)
    reasons = [each for each in solution.verdict.reasons if each.source == "body-velocity"]
    assert any("either has become wrong" in each.seen for each in reasons)
    assert not any(each.cause in ("scale", "unit", "clock") for each in reasons)
    assert solution.verdict.word != "trusted"


def test_a_precise_sensor_that_hardly_changes_is_not_late():
    """The slope of what is expected of it must not have its own correction in it: with that a right beam of
    a ship was 1.0 s early, 11 standard deviations."""
    sensors = [Simulated("beam-velocity", 0.05, 5.0, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0))]
    made = sd.simulate("ship", 300.0, "industrial", seed=31, sensors=sensors)
    solution = sd.fuse(made)
    each = beside_gnss._expected_readings(solution, solution.innovations, 2, made.sources[2])
    fit = beside_gnss._fit(each)
    assert abs(fit.lag) < 4 * fit.lag_std < 0.4


def test_a_reading_that_contradicts_from_the_start_has_not_changed():
    t = np.arange(0.0, 300.0, 1.0)
    assert beside_gnss._agreed_until(t, t < 150.0) == 149.0
    assert beside_gnss._agreed_until(t, t < 30.0) == np.inf
    assert beside_gnss._agreed_until(t, t < 280.0) == np.inf
    assert beside_gnss._agreed_until(t, np.zeros(len(t), bool)) == np.inf
