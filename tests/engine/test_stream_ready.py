"""All kernels that a stream may need are compiled or loaded when its constructor returns: no sample
waits for them. They are counted, not timed."""

from functools import cache

import numpy as np
import pytest
from compile_all import kernels
from recordings import ahrs, events_of, flight, start
from test_heading_hypotheses import carried

import strapdown as sd
from strapdown import aiding, filters
from strapdown.aiding.more_parameters import placeholder
from strapdown.core.compile import jit
from strapdown.engine.stream import Stream
from strapdown.sensor_models.gnss import Gnss

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")


@pytest.fixture
def ready(monkeypatch):
    """Function that tells the kernels that are ready; none is at first."""
    declared = kernels((sd,))
    for kernel in declared:
        monkeypatch.setattr(kernel, "_address", 0)
    return lambda: {kernel.stem for kernel in declared if kernel._address}


@cache
def recording():
    made = flight()
    return made, (*made.sources, ahrs(made.reference, 2.0))


@pytest.mark.parametrize("given", [True, False], ids=["given start", "own start"])
@pytest.mark.parametrize("name", filters.own_names())
def test_no_step_makes_a_kernel_ready(ready, name, given):
    made, sources = recording()
    if not filters.find(name).needs:
        sources = made.sources
    begin = start(made) if given else None
    stream = Stream(name, start=begin, imu="tactical", sources=sources, align_within=2.0)
    before = ready()
    for event in events_of(made):
        stream.step(event)
    stream.finish()
    assert stream.started and before and ready() == before


def test_no_step_makes_the_kernels_of_tried_headings_ready(ready):
    """Another filter than the one with which headings are tried."""
    made = sd.simulate(carried(3.1), 40.0, "industrial", 4, 50.0, Gnss(0.2, 1.0, 0.1))
    stream = Stream("mekf", imu="industrial", sources=made.sources, align_within=30.0)
    before = ready()
    for event in events_of(made):
        stream.step(event)
    assert "trying 12 headings" in stream.start.note and ready() == before


def test_every_source_is_ready(ready):
    kinds = [aiding.find(name) for name in aiding.own_names()]
    sources = [
        sd.Source(
            kind.name,
            np.empty(0),
            *np.empty((2, 0, len(kind.quantities))),
            parameters=placeholder(kind),
        )
        for kind in kinds
    ]
    Stream("closed-loop", start=start(flight()), imu="tactical", sources=sources)
    assert {kind.observe.stem for kind in kinds} <= ready()
