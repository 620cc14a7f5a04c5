"""Speeds in the body, depths and ranges in all that runs a filter: a scenario, a batch, its smoother
and a stream."""

from dataclasses import replace

import numpy as np
import pytest
from body_speeds import SENSORS, recording
from recordings import events_of, start as near

import strapdown as sd
from strapdown.engine.stream import Stream

pytestmark = pytest.mark.short


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return recording(tmp_path_factory.mktemp("scenario"))


@pytest.fixture(scope="module")
def solution(made):
    return sd.fuse(made, start=near(made), covariance=True)


def test_a_scenario_makes_them_and_a_filter_accepts_them(made, solution):
    assert [a.kind for a in made.sources][-5:] == list(SENSORS)
    for name, (accepted, rejected) in solution.counts().items():
        assert rejected <= 0.05 * accepted and accepted > 20, name
    errors = sd.errors(solution, made.reference)
    assert np.abs(errors.velocity[-1]).max() < 4 * solution.std[-1, 3:6].max()
    biases = [name for name in solution.columns if name.endswith("bias [m]")]
    assert {name.split()[0] for name in biases} >= {"depth", "water-pressure", "range"}


def test_each_is_worth_something(made, solution):
    """Without the source, standard deviations of the end are larger."""
    for kind in ("body-velocity", "range"):
        less = replace(made, sources=tuple(a for a in made.sources if a.kind != kind))
        std = sd.fuse(less, start=near(made)).std[-1]
        assert (std[:6] > solution.std[-1, :6] * 0.999).all() and std[:6].sum() > 1.0001 * (
            solution.std[-1, :6].sum()
        )


def test_the_smoother_and_a_stream_have_them_too(made, solution):
    smooth = sd.smooth(made, start=near(made))
    assert (smooth.std[500, :9] <= solution.std[500, :9] * 1.001).all()
    stream = Stream("closed-loop", imu="tactical", sources=made.sources, start=near(made))
    for event in events_of(made):
        stream.step(event)
    belief = stream.finish()
    assert np.array_equal(belief.P, solution.covariance[-1])
    assert np.array_equal(belief.v_n, solution.v_n[-1])
    assert stream.counts() == list(solution.counts().values())


def test_a_stream_refuses_a_beam_without_direction(made):
    (beam,) = (a for a in made.sources if a.kind == "beam-velocity")
    with pytest.raises(sd.DataError, match="unit vector"):
        Stream("closed-loop", imu="tactical", sources=[replace(beam, parameters=(0.0,) * 3)])
