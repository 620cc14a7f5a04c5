"""The clock of heights of a heave filter."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.verdict import evidence, height_clock


@pytest.fixture(scope="module")
def ship():
    heights = Simulated("altitude", 0.3, 2.0)
    made = sd.simulate("ship-heave", 150.0, "industrial", seed=3, sensors=(heights,))
    own = tuple(a for a in made.sources if a.kind == "altitude")
    return replace(made, sources=own)


def clock(recording):
    solution = sd.fuse(recording, "vru")
    (source,) = evidence.by_source(solution)
    return solution, height_clock.estimate_clock(solution, source)


def test_heights_that_are_late_are_named(ship):
    right, found = clock(ship)
    assert abs(found.late) < 4 * found.std and height_clock.reason(found) == []
    late = replace(ship, imu=ship.imu._replace(t=ship.imu.t + 0.4))
    _, other = clock(late)
    assert other.late == pytest.approx(0.4, abs=4 * other.std + 0.1)
    (reason,) = height_clock.reason(other)
    assert reason.cause == "clock" and "later than these heights" in reason.seen


def test_what_would_not_show_is_in_the_verdict(ship):
    solution, found = clock(ship)
    assert f"below {found.bound:.2g} s" in str(solution.verdict)
    assert found.bound > 5 * found.std
    assert any(bound.cause == "clock" for bound in solution.verdict.bounds)


def test_a_filter_of_position_has_none(ship):
    flight = sd.simulate("demo", 60.0, seed=1, sensors=(Simulated("altitude", 0.3, 2.0),))
    solution = sd.fuse(flight)
    assert all(
        height_clock.estimate_clock(solution, s) is None for s in evidence.by_source(solution)
    )
    assert np.isfinite(solution.std[-1, 2])
