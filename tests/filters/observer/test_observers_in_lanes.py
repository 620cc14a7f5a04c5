"""Observers side by side whose runs are in different states: what one of them turns, rejects, holds
or lacks must not reach the others, to the bit."""

import numpy as np
import pytest
from recordings import flight, start
from test_xkf import NOISE, world

from strapdown import aiding
from strapdown.core.compile.jit import COMPILED
from strapdown.core.compile.signatures import LANES
from strapdown.core.loop.contract import FilterState, side_by_side
from strapdown.core.mathematics.source import new_source
from strapdown.engine.run_batch import alongside
from strapdown.filters.observer import xkf
from strapdown.filters.observer.equations import FADE, SINCE_COURSE, SINCE_FIX, SLOW
from strapdown.filters.observer.nlo import NLO
from strapdown.filters.observer.own_estimate import DOUBT, TURN
from strapdown.filters.observer.xkf import XKF
from strapdown.sim.trajectory import DEG

pytestmark = [
    pytest.mark.skipif(not COMPILED, reason="lanes are compiled"),
    pytest.mark.deep,  # half a minute to compile
]
FIELD = np.array([21e-6, 1.6e-6, 43.9e-6])
STD = {
    "position": np.array([1.5, 1.5, 3.0]),
    "velocity": np.array([0.1, 0.1, 0.2]),
    "heading": np.full(3, 2 * DEG),
    "magnetic-field": np.full(3, 5e-7),
    "altitude": np.full(3, 2.0),
}
STEPS, GATE = 60, 20.0
OPTIONS = [
    (XKF, {}),
    (XKF, {"jacobian": "observer"}),
    (XKF, {"near": 0.0, "course": "frozen", "field": "vector"}),
    (XKF, {"course": "printed", "design": "poles", "poles": "-0.5 -0.3+0.3j -0.3-0.3j"}),
    (NLO, {}),
    (NLO, {"course": "frozen", "field": "vector", "design": "poles"}),
]


def begun(filter, options):
    """A belief of each run: attitudes that the observer does not agree with, headings that are
    uncertain, an outage that lasts, a course that was missed for long."""
    beliefs, rng = [filter.start(start(flight()), NOISE, **options) for _ in range(LANES)], None
    for lane, belief in enumerate(beliefs):
        rng = np.random.default_rng([5, lane])
        own = belief.workspace[xkf.INSIDE] if filter is XKF else belief.workspace
        block = own[xkf.BLOCK] if filter is XKF else own
        belief.v_n[:] += rng.standard_normal(3)
        block[FADE] = (3.0, 0.0, 0.5, 0.0)[lane % 4]  # what is learnt fades in with the start
        if lane in (2, 3, 6):
            block[SINCE_COURSE] = 0.0
            belief.P[8, 8] = (30 * DEG) ** 2
        if lane == 4:
            block[SINCE_FIX] = 1e3
        if lane == 5:
            block[SLOW] = 100.0
        if filter is XKF:
            own[0:2] += 1e-7 * rng.standard_normal(2)
            mine = belief.workspace[xkf.MINE]
            if lane in (3, 6):
                mine[TURN] = 0.1 * lane
            if lane in (1, 7):
                belief.workspace[xkf.CLOSE] = 0.0
                mine[DOUBT] = 1.5
    return beliefs


def fixes(k):
    """[(kind, y of each run)] after that step; some lack numbers, some are far off."""
    _, _, truth, given = world()
    rng, state = np.random.default_rng([7, k]), truth[k]
    heading = np.arctan2(state.C_nb[1, 0], state.C_nb[0, 0])
    found = [(kind, np.tile(y, (LANES, 1))) for kind, y in given.get(k, [])]
    if k % 4 == 0:
        found += [
            ("heading", np.tile([heading, 0, 0], (LANES, 1))),
            ("magnetic-field", np.tile(state.C_nb.T @ FIELD, (LANES, 1))),
            ("altitude", np.tile([state.lla[2], 0, 0], (LANES, 1))),
        ]
    for kind, y in found:
        y += (
            rng.standard_normal(y.shape)
            * STD[kind]
            * ([1e-7, 1e-7, 1] if kind == "position" else 1)
        )
        y[rng.integers(LANES)] *= 1.5
        y[rng.integers(LANES), rng.integers(3)] = np.nan
        y[rng.integers(LANES)] = np.nan
    return found


def numbers(belief):
    """All that a filter may read again, as numbers of each run."""
    return {name: np.array(getattr(belief, name)) for name in FilterState._fields[:8]}


@pytest.mark.parametrize("filter, options", OPTIONS)
def test_runs_in_different_states_do_not_reach_each_other(filter, options):
    beliefs, (u, dt, _, _) = begun(filter, options), world()
    wide = FilterState(*(alongside(parts) for parts in zip(*beliefs)))
    predict, correct = side_by_side(filter.predict), side_by_side(filter.correct)
    innovation, rejected, measured = np.zeros((12, LANES)), 0, 0
    for k, row in enumerate(u[:STEPS], 1):
        predict(wide, np.tile(row[:, None], LANES), dt, NOISE)
        for belief in beliefs:
            filter.predict(belief, row, dt, NOISE)
        for kind, y in fixes(k):
            observe, number = aiding.find(kind).observe, aiding.number(kind)
            source = new_source()
            source.parameters[:3] = FIELD if kind == "magnetic-field" else (0.3, -0.2, -0.5)
            rest = STD[kind], number, observe, source, GATE
            given = np.ascontiguousarray(y.T)
            std, number, _, source, gate = rest
            nis = correct(wide, given, std, number, side_by_side(observe), source, gate, innovation)
            alone = [
                filter.correct(belief, y[lane], *rest, np.zeros(12))
                for lane, belief in enumerate(beliefs)
            ]
            np.testing.assert_array_equal(nis, alone)
            rejected, measured = rejected + (nis > GATE).sum(), measured + np.isfinite(nis).sum()
        for lane, belief in enumerate(beliefs):
            for name, own in numbers(belief).items():
                np.testing.assert_array_equal(
                    getattr(wide, name)[..., lane], own, err_msg=f"step {k} lane {lane} {name}"
                )
    assert 0 < rejected < measured / 2
