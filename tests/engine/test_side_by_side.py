"""Runs side by side against the same runs alone, to the bit; and what must leave the lanes."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.compile.c_calls import aligned_zeros
from strapdown.core.compile.jit import COMPILED
from strapdown.core.compile.signatures import LANES
from strapdown.core.loop import lane_loop
from strapdown.core.loop.contract import kernel
from strapdown.core.loop.lane_loop import KEEP, KEEP_LANES
from strapdown.core.mathematics import solution_row
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.engine.run_batch import Keeper, RunBatch, why_alone
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sim.scenario import scenarios
from strapdown.sim.synthesis import Simulator

pytestmark = pytest.mark.skipif(not COMPILED, reason="lanes are compiled")
FILTERS = [name for name in filters.own_names() if filters.find(name).lanes]
KEPT = 21 + 15


@kernel(KEEP)
def keep_state(belief, k, true, biases, work, kept):
    """All that a belief holds of the vehicle."""
    row = kept[k]
    for i in range(3):
        row[i], row[3 + i], row[6 + i], row[9 + i] = (
            belief.lla[i],
            belief.v_n[i],
            belief.b_a[i],
            belief.b_g[i],
        )
        for j in range(3):
            row[12 + 3 * i + j] = belief.C_nb[i, j]
    for i in range(15):
        row[21 + i] = belief.P[i, i]


class Both:
    """Eight runs of a scenario, side by side and alone."""

    def __init__(self, scenario, filter, every=10, spoil=None, options=None, seeds=range(LANES)):
        made = Simulator(sd.scenario(scenario) if isinstance(scenario, str) else scenario)
        spec = made.scenario.imu
        drawn = [made.run(spec, seed) for seed in seeds]
        self.recordings = [r for r, _ in drawn]
        if spoil:
            self.recordings = [spoil(lane, r) for lane, r in enumerate(self.recordings)]
        self.runs = [
            begin(
                r,
                filter,
                run_options(
                    options=options or {}, imu=spec, start=start, every=every, covariance=True
                ),
            )
            for r, (_, start) in zip(self.recordings, drawn)
        ]
        self.starts = [start for _, start in drawn]
        first = begin(
            self.recordings[0],
            filter,
            run_options(options=options or {}, imu=spec, start=self.starts[0], every=every),
        )
        self.why = why_alone(first)
        if self.why:
            return
        rows = len(self.runs[0].out.nav)
        self.lanes = RunBatch(
            first,
            self.starts,
            self.recordings,
            Keeper(
                keep_state.for_runs(KEEP_LANES),
                np.zeros((rows, 1)),
                aligned_zeros(rows, 6, LANES),
                1,
                KEPT,
            ),
        )
        count = len(first.samples.t)
        increments = aligned_zeros(count, 6, LANES)
        for lane, recording in enumerate(self.recordings):
            increments[:, :3, lane] = recording.imu.dtheta
            increments[:, 3:, lane] = recording.imu.dv
        advance, block = self.lanes.calls(increments[:700]), increments[:700]
        whole = increments.copy()
        for begins in range(first.first, count, 700):
            stop = min(begins + 700, count)
            block[: stop - begins] = whole[begins:stop]
            advance(begins, stop)
        for run in self.runs:
            run.complete()

    def alone(self, lane):
        """(rows, KEPT) what `keep_state` would have kept."""
        run = self.runs[lane]
        nav, P = run.out.nav, run.out.covariance
        C = np.empty((len(nav), 3, 3))
        return np.c_[
            nav[:, solution_row.LLA : solution_row.Q],
            nav[:, solution_row.BIASES : solution_row.STD],
            C.reshape(-1, 9),
            np.einsum("kii->ki", P[:, :15, :15]),
        ]


NOT_ATTITUDE = np.r_[0:12, 21:KEPT]  # a solution has quaternions


QUICK = {("closed-loop", "demo"), ("open-loop", "car"), ("periodic-reset", "demo")}
CASES = [
    pytest.param(scenario, filter, marks=() if (filter, scenario) in QUICK else pytest.mark.deep)
    for scenario in scenarios()
    for filter in FILTERS
]


@pytest.mark.parametrize("scenario, filter", CASES)
def test_a_lane_has_the_bits_of_the_run_alone(scenario, filter):
    whole = sd.scenario(scenario)
    try:
        both = Both(whole.replace(duration=min(40.0, whole.duration)), filter)
    except sd.DataError as error:  # a filter that cannot run on this recording
        pytest.skip(str(error))
    if both.why:
        pytest.skip(both.why)
    assert compared_rows(both) > 100


def test_a_lane_has_velocities_of_the_body_as_the_run_alone_has_them():
    sensors = [
        Simulated("body-velocity", 0.1, 2.0, (0.5, 0.1, 0.2)),
        Simulated("beam-velocity", 0.1, 2.0, (0.5, 0.1, 0.2, 0.6, 0.0, 0.8)),
    ]
    both = Both(sd.scenario("demo").replace(duration=30.0, sensors=sensors), "closed-loop")
    assert not both.why
    assert compared_rows(both) > 100


def compared_rows(both):
    """Rows of lanes that have the bits of the runs alone, as all that are not left have."""
    kept, fix = both.lanes.out.kept, both.lanes.out.fix
    compared = 0
    for lane, left in enumerate(both.lanes.left):  # a lane is right until it must go alone
        run, alone = both.runs[lane], both.alone(lane)
        own = run.out.nav[:, solution_row.T] < left
        compared += int(own.sum())
        np.testing.assert_array_equal(kept[own][:, NOT_ATTITUDE, lane], alone[own][:, NOT_ATTITUDE])
        rows = run.out.fix[: run.cursor.state[0].fix]
        rows = rows[rows["t"] < left]
        np.testing.assert_array_equal(fix[: len(rows), lane_loop.NIS, lane], rows["nis"])
        np.testing.assert_array_equal(fix[: len(rows), lane_loop.USED, lane] > 0, rows["use"] > 0)
    return compared


def test_most_filters_and_sensors_have_lanes():
    assert {
        "open-loop",
        "closed-loop",
        "closed-loop-error-bias",
        "periodic-reset",
        "mekf",
        "ekf",
        "xkf",
    } <= set(FILTERS)
    wanted = "position", "velocity", "altitude", "heading", "speed", "zero-velocity"
    assert all(aiding.find(kind).lanes for kind in wanted)


def spoiled_sample(value):
    """One number of one lane's samples replaced."""

    def spoil(lane, recording):
        if lane != 3:
            return recording
        dtheta = recording.imu.dtheta.copy()
        dtheta[1000, 1] = value
        return replace(recording, imu=recording.imu._replace(dtheta=dtheta))

    return spoil


@pytest.mark.parametrize("value", [np.nan, np.inf, -5.0, 1e300])
def test_a_lost_run_leaves_and_the_others_keep_every_bit(value):
    short = sd.scenario("demo").replace(duration=40.0)
    sound, spoiled = (
        Both(short, "closed-loop"),
        Both(short, "closed-loop", spoil=spoiled_sample(value)),
    )
    t = spoiled.runs[0].samples.t[1000]
    assert spoiled.lanes.left[3] == t and np.isinf(np.delete(spoiled.lanes.left, 3)).all()
    others = np.delete(np.arange(LANES), 3)
    np.testing.assert_array_equal(
        sound.lanes.out.kept[..., others], spoiled.lanes.out.kept[..., others]
    )
    before = slice(0, 99)
    np.testing.assert_array_equal(
        sound.lanes.out.kept[before, :, 3], spoiled.lanes.out.kept[before, :, 3]
    )


def rejections(both):
    """(LANES,) fixes of the first source that were not used."""
    own = both.lanes.fixes.source == 0
    return (both.lanes.out.fix[own, lane_loop.USED] == 0).sum(axis=0)


def test_other_standard_deviations_are_refused():
    def wider(lane, recording):
        gnss = recording.sources[0]
        changed = replace(gnss, std=gnss.std * (1 + (lane == 2)))
        return replace(recording, sources=(changed, *recording.sources[1:]))

    with pytest.raises(ValueError, match="same times and deviations"):
        Both(sd.scenario("demo").replace(duration=20.0), "closed-loop", spoil=wider)


def test_a_run_whose_gate_is_to_be_lifted_leaves():
    def moved(lane, recording):
        if lane != 5:
            return recording
        gnss = recording.sources[0]
        y = gnss.y.copy()
        y[gnss.t > 20, 2] += 500.0
        return replace(recording, sources=(replace(gnss, y=y), *recording.sources[1:]))

    both = Both(sd.scenario("demo").replace(duration=40.0), "closed-loop", spoil=moved)
    assert 20 < both.lanes.left[5] < 40 and np.isinf(np.delete(both.lanes.left, 5)).all()
    assert rejections(both)[5] >= 5


def test_rejected_fixes_stay_in_the_lanes():
    def wild(lane, recording):
        gnss = recording.sources[0]
        y = gnss.y.copy()
        y[5 + lane, 2] += 300.0
        return replace(recording, sources=(replace(gnss, y=y), *recording.sources[1:]))

    both = Both(sd.scenario("demo").replace(duration=40.0), "closed-loop", spoil=wild)
    assert np.isinf(both.lanes.left).all()
    assert (rejections(both) >= 1).all()
    for lane in range(LANES):
        np.testing.assert_array_equal(
            both.lanes.out.kept[:, NOT_ATTITUDE, lane], both.alone(lane)[:, NOT_ATTITUDE]
        )


@pytest.mark.parametrize(
    "change, estimate, why",
    [
        (lambda t: np.r_[t[:500], t[500:] + 1], None, "gaps"),
        (lambda t: t, ["clock"], "installation"),
    ],
)
def test_what_lanes_do_not_know_is_said(change, estimate, why):
    made = Simulator(sd.scenario("demo").replace(duration=20.0))
    recording, start = made.run(made.scenario.imu, 1)
    changed = replace(recording, imu=recording.imu._replace(t=change(recording.imu.t)))
    asked = run_options(imu=made.scenario.imu, start=start, estimate=estimate)
    assert why in why_alone(begin(changed, "closed-loop", asked))


def test_a_filter_without_lanes_goes_alone():
    made = Simulator(sd.scenario("demo").replace(duration=20.0))
    recording, start = made.run(made.scenario.imu, 1)
    assert "no lanes" in why_alone(
        begin(recording, "ukf", run_options(imu=made.scenario.imu, start=start))
    )
