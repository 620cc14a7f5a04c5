"""Costs of the filters of Alam et al.: seconds of one core for the same samples and fixes.

Only the observer's equations are timed: the library's `nlo` also computes a covariance, unlike the
paper's.
"""

import time
from typing import Any

import numpy as np
import pandas as pd

from strapdown.alignment.initial import align
from strapdown.core.loop.contract import (
    CORRECT,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceRow,
    kernel,
)
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.filters.observer import gains, nlo
from strapdown.filters.observer.equations import OBSERVER, advance, inject
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator
from strapdown.typing import Array

from .readings import EKF, NLO, VARIANTS, XKF
from .xkf_as_printed import make_known

SECONDS, REPEATED = 240.0, 7
"""s of the flight that are run, and how many times."""


@gains.takes_options
def start(start: InitialState, noise: Noise, **options: Any) -> FilterState:
    """The filter state at `start`; options of `nlo`."""
    belief = start.belief(OBSERVER.zeros())
    gains.begin(belief.workspace, start, noise, **options)
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """One IMU sample."""
    advance(belief, u, dt, noise)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """One fix, without a gate."""
    inject(belief, y, std, kind, observe, source, innovation)
    return 0.0


EQUATIONS = Filter(
    "nlo-equations",
    "Alam, Whidborne & Millidere (2023) section 2.1, without a covariance",
    start,
    predict,
    correct,
    slots=OBSERVER,
    uses=nlo.NLO.uses,
    configure=gains.configure,
)


def measure_costs(seconds: float = SECONDS, repeated: int = REPEATED) -> pd.DataFrame:
    """DataFrame with a row per filter and repetition: filter, repetition, seconds; the filters take
    turns."""
    make_known()
    world = scenario("alam").replace(duration=seconds)
    recording = Simulator(world).recording(world.imu, np.random.default_rng(0))
    given = align(recording, imu_spec(recording.meta["grade"]))
    filters = {NLO: EQUATIONS, EKF: VARIANTS[EKF].filter, XKF: VARIANTS[XKF].filter}
    rows = []
    for repetition in range(-1, repeated):  # the first one compiles
        for label, filter in filters.items():
            asked = run_options(start=given, options=VARIANTS[label].options, estimate=[])
            run = begin(recording, filter, asked)
            before = time.perf_counter()
            run.advance(len(recording.imu.t))
            rows.append((label, repetition, time.perf_counter() - before))
    found = pd.DataFrame(rows, columns=["filter", "repetition", "seconds"])
    return found[found["repetition"] >= 0].reset_index(drop=True)
