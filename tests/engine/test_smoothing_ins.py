"""Smoothing of the error-state filters: against textbook smoothers over a short log, the same in
any chunks, and through every rule of the loop."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from recordings import alike, position, said, without_samples
from scipy.spatial.transform import Rotation
from smoothed_ins import State, least_squares, log_of, rauch_tung_striebel

import strapdown as sd
from strapdown.aiding.pressure import BAROMETER_BIAS
from strapdown.core.loop.contract import Imu, Noise
from strapdown.core.loop.log import Code
from strapdown.core.mathematics import solution_row
from strapdown.data.recording import Recording
from strapdown.data.solution import DOUBTFUL, INVALID, VALID, Source
from strapdown.engine import prepare as preparation, smoothing
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.engine.smoothing import Differences
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion, demo_flight, increments, sample

MEMS = ImuSpec(
    "Gauss-Markov MEMS",
    Triad(noise=1e-3, gauss_markov=1e-3, time_constant=20.0),
    Triad(noise=1e-2, gauss_markov=0.05, time_constant=20.0),
)
NAVIGATION = ImuSpec(
    "navigation",
    Triad(noise=6e-7, turn_on_bias=2e-8, bias_walk=1e-9),
    Triad(noise=5e-5, turn_on_bias=2.5e-4, bias_walk=1e-5),
)
FORGETFUL = {
    MEMS: ImuSpec(
        "MEMS of 5 s",
        Triad(noise=1e-3, gauss_markov=2e-3, time_constant=5.0),
        Triad(noise=1e-2, gauss_markov=0.2, time_constant=5.0),
    ),
    NAVIGATION: ImuSpec(
        "navigation of 5 s",
        Triad(noise=6e-7, gauss_markov=1e-6, time_constant=5.0),
        Triad(noise=5e-5, gauss_markov=0.05, time_constant=5.0),
    ),
}
COARSE, FINE = np.radians([0.5, 0.5, 2.0]), np.radians([0.01, 0.01, 0.05])
# with a worse IMU, or a coarse start, its INS leaves the linear model
FILTERS = [
    ("closed-loop", {}, MEMS, COARSE),
    ("closed-loop-error-bias", {}, MEMS, COARSE),
    ("periodic-reset", {"interval": 4.0}, MEMS, COARSE),
    ("open-loop", {}, NAVIGATION, FINE),
]
"""Name, options, IMU, attitude at the start (rad). To test another filter, add a line."""
NAMES = [line[0] for line in FILTERS]
APART = "filter and smoother are up to"
"""Words of the event that only the smoother has."""
RATE = 20


def weaving():
    """At 40 m/s: turns of 40 deg to both sides every 12 s, banked."""
    wave = lambda t, period: np.sin(2 * np.pi * t / period)
    course, speed = lambda t: DEG * (30 + 40 * wave(t, 12.0)), lambda t: 40 + 5 * wave(t, 9.0)
    rate = lambda t: DEG * 40 * 2 * np.pi / 12 * np.cos(2 * np.pi * t / 12)
    return Motion(
        "weaving",
        (DEG * 47.0, DEG * 8.0, 800.0),
        lambda t: (speed(t) * np.cos(course(t)), speed(t) * np.sin(course(t)), 2 * wave(t, 10.0)),
        lambda t: (np.arctan(speed(t) * rate(t) / 9.81), DEG * (2 + 3 * wave(t, 7.0)), course(t)),
    )


class Flight:
    """A flight of so many seconds with a position a second; runs of it are drawn by seed."""

    def __init__(self, seconds):
        self.t = np.arange(seconds * RATE + 1) / RATE
        self.truth, self.ideal = sample(weaving(), self.t), increments(weaving(), self.t)

    def drawn(self, seed, spec=MEMS, attitude_std=COARSE, gate=np.inf, barometer=False):
        """(recording, {start, noise}, true State at all times)."""
        of_imu, of_fix, of_start = np.random.default_rng(seed).spawn(3)
        imu, b_a, b_g = spec.corrupt(self.ideal, of_imu)
        accel_std, gyro_std = spec.bias_std()
        start = draw_start(
            self.truth,
            np.r_[[2.0] * 3, [0.3] * 3, attitude_std, [accel_std] * 3, [gyro_std] * 3],
            of_start,
        )
        (fix,) = Gnss(
            position_std=(1.0, 1.0, 1.0), velocity_std=None, lever_arm=(0.5, -0.3, -1.0)
        ).fixes(self.truth, of_fix)
        sources = (replace(fix, gate=gate),)
        if barometer:
            rows = np.arange(10, len(self.t), 10)
            height = self.truth.lla[rows, 2] + 80.0 + 0.5 * of_fix.standard_normal(len(rows))
            sources += (
                Source(
                    "pressure-altitude",
                    self.t[rows],
                    height[:, None],
                    np.full((len(rows), 1), 0.5),
                    gate=np.inf,
                    name="barometer",
                ),
            )
        biases = np.hstack([b_a, b_g])
        truth = State(
            self.truth.lla,
            self.truth.v_n,
            Rotation.from_quat(self.truth.q_nb[:, [1, 2, 3, 0]]).as_matrix(),
            np.vstack([biases[:1], biases]),
        )
        return (
            Recording(imu, sources, self.truth, {"name": "weaving"}),
            dict(start=start, noise=spec.noise()),
            truth,
        )


@pytest.fixture(scope="module")
def flight():
    """20 s at 20 Hz."""
    return Flight(20)


def state(solution):
    own = [
        column[:, None]
        for name, column in solution.columns.items()
        if "bias" in name and "std of" not in name
    ]
    return State(
        solution.trajectory.lla,
        solution.trajectory.v_n,
        solution.trajectory.rotation.as_matrix(),
        np.hstack([solution.b_a, solution.b_g, *own]),
    )


def stds(covariance):
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def apart(solution, other):
    """(n, states): from a solution to another State, in standard deviations of the solution,
    which has its covariances."""
    return other.less(state(solution)) / stds(solution.covariance)


def equal(first, second, tolerance=1e-9):
    """Assert that two solutions are alike to so many standard deviations and fractions of them;
    positions at least to the 10 nm that doubles have."""
    assert np.array_equal(first.t, second.t) and first.events == second.events
    deviation, off = first.trajectory.std, np.abs(state(second).less(state(first)))
    assert (off[:, 3:15] / deviation[:, 3:] < tolerance).all() and (
        off[:, :3] < tolerance * deviation[:, :3] + 1e-8
    ).all()
    np.testing.assert_allclose(first.trajectory.std, second.trajectory.std, rtol=tolerance)


def ordered(smoothed, filtered):
    """Assert that a smoother is nowhere less sure than its filter, and that they agree at the
    end."""
    scale = stds(filtered.covariance)
    loss = (filtered.covariance - smoothed.covariance) / (scale[:, :, None] * scale[:, None, :])
    assert np.linalg.eigvalsh(loss).min() > -1e-9
    np.testing.assert_allclose(
        stds(smoothed.covariance)[:, :15], smoothed.trajectory.std, rtol=1e-9
    )
    np.testing.assert_allclose(smoothed.covariance[-1], filtered.covariance[-1], rtol=1e-12)
    np.testing.assert_allclose(np.abs(apart(smoothed, state(filtered))[-1]), 0, atol=1e-7)


def both(recording, given, name="closed-loop", **options):
    """(smoothed, filtered), of which is checked what holds for every recording, also in small
    chunks."""
    smoothed, filtered = (
        run(recording, name, covariance=True, **given, options=options)
        for run in (sd.smooth, sd.fuse)
    )
    ordered(smoothed, filtered)
    assert (
        tuple(event for event in smoothed.events if APART not in event[1]) == filtered.events
        and smoothed.counts() == filtered.counts()
    )
    added = smoothed.status != filtered.status
    assert (smoothed.status[added] == DOUBTFUL).all() and added.any() <= bool(said(smoothed, APART))
    assert np.array_equal(
        smoothed.innovations.innovation, filtered.innovations.innovation, equal_nan=True
    )
    assert smoothed.meta | filtered.meta == smoothed.meta and smoothed.meta["smoothed"]
    before, smoothing.RECORDED_ROWS = smoothing.RECORDED_ROWS, 60
    try:
        equal(smoothed, sd.smooth(recording, name, **given, options=options))
    finally:
        smoothing.RECORDED_ROWS = before
    return smoothed, filtered


# against other smoothers


@pytest.mark.parametrize("line", FILTERS, ids=NAMES)
@pytest.mark.parametrize("seed", range(2))
def test_as_rauch_tung_and_striebel(flight, line, seed):
    """To first order: the filter takes specific force and attitude for constant over a sample in
    its transition, and heading begins 2 deg off."""
    name, options, spec, attitude_std = line
    recording, given, _ = flight.drawn(seed, spec, attitude_std)
    smoothed, filtered = (
        run(recording, name, covariance=True, **given, options=options)
        for run in (sd.smooth, sd.fuse)
    )
    textbook, P = rauch_tung_striebel(log_of(recording, **given))
    off = apart(smoothed, textbook)
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.05 and np.abs(off).max() < 0.15
    deviation = stds(P)
    np.testing.assert_allclose(smoothed.trajectory.std, deviation, rtol=3e-4)
    assert (
        np.abs((smoothed.covariance - P) / (deviation[:, :, None] * deviation[:, None, :])).max()
        < 5e-4
    )
    assert np.abs(apart(filtered, textbook)).max() > 1.5  # the comparison can tell


@pytest.mark.parametrize("line", FILTERS, ids=NAMES)
def test_as_rauch_tung_and_striebel_where_biases_are_held(flight, line):
    """A held estimate is one whose decay an input that is known makes good for: the smoother's
    transition stays that of P."""
    name, options, spec, attitude_std = line
    recording, given, _ = flight.drawn(0, FORGETFUL[spec], attitude_std)
    given["noise"] = given["noise"]._replace(held=1.0)
    smoothed, decaying = (
        sd.smooth(
            recording,
            name,
            covariance=True,
            **given,
            options={**options, "bias": bias},
        )
        for bias in ("held", "decaying")
    )
    textbook, P = rauch_tung_striebel(log_of(recording, **given))
    assert np.abs(apart(smoothed, textbook)).max() < 0.05
    np.testing.assert_allclose(smoothed.trajectory.std, stds(P), rtol=3e-4)
    assert np.abs(apart(decaying, textbook)).max() > 0.2


@pytest.mark.parametrize("seed", range(2))
def test_as_least_squares_over_the_whole_log(flight, seed):
    """The nonlinear one, which begins at the truth: what linearising about the filter costs when
    its heading begins 2 deg off."""
    recording, given, truth = flight.drawn(seed)
    rows = [0, 100, 200, 399]
    best, P, last = least_squares(log_of(recording, **given), truth, rows)
    assert last < 1e-4
    smoothed = sd.smooth(recording, covariance=True, **given)
    off = apart(smoothed, best)
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.08 and np.abs(off).max() < 0.2
    deviation = stds(P)
    np.testing.assert_allclose(smoothed.trajectory.std[rows], deviation, rtol=0.02)
    assert (
        np.abs(
            (smoothed.covariance[rows] - P) / (deviation[:, :, None] * deviation[:, None, :])
        ).max()
        < 0.04
    )


def test_states_of_aidings_are_smoothed_too(flight):
    """A barometer's bias, a sixteenth state, against the textbook; also between its fixes, which
    come twice a second."""
    recording, given, _ = flight.drawn(2, barometer=True)
    smoothed, filtered = both(recording, given)
    log = log_of(recording, **given)._replace(
        baro=recording.sources[1],
        baro_std=BAROMETER_BIAS["state_std"],
        baro_walk=BAROMETER_BIAS["state_walk"],
    )
    textbook, P = rauch_tung_striebel(log)
    assert smoothed.covariance.shape[1:] == (16, 16)
    assert np.abs(apart(smoothed, textbook)).max() < 0.25
    deviation = stds(P)
    np.testing.assert_allclose(stds(smoothed.covariance), deviation, rtol=3e-3)
    assert (
        np.abs((smoothed.covariance - P) / (deviation[:, :, None] * deviation[:, None, :])).max()
        < 5e-3
    )
    np.testing.assert_allclose(
        smoothed.columns["std of barometer bias [m]"], deviation[:, 15], rtol=3e-3
    )
    assert filtered.columns["std of barometer bias [m]"][0] > 100 > 1 > deviation[0, 15]


# the same whatever the way


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("chunk", (7, 64, 399))
@pytest.mark.short
def test_chunks_do_not_matter(flight, monkeypatch, name, chunk):
    recording, given, _ = flight.drawn(4)
    whole = sd.smooth(recording, name, covariance=True, **given)
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", chunk)
    parts = sd.smooth(recording, name, covariance=True, **given)
    equal(whole, parts)
    scale = stds(whole.covariance)
    assert (
        np.abs(
            (whole.covariance - parts.covariance) / (scale[:, :, None] * scale[:, None, :])
        ).max()
        < 1e-9
    )


@pytest.mark.parametrize("every", (3, 90, 1000))
@pytest.mark.parametrize("covariance", (False, True))
@pytest.mark.short
def test_kept_rows_are_those_of_all(flight, monkeypatch, every, covariance):
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", 40)  # some chunks keep no row
    recording, given, _ = flight.drawn(5)
    whole, some = (
        sd.smooth(recording, every=kept, covariance=covariance, **given) for kept in (1, every)
    )
    rows = np.searchsorted(whole.t, some.t)
    assert (
        len(rows) == -(-400 // every)
        and some.t[-1] == whole.t[-1]
        and np.array_equal(some.t, whole.t[rows])
    )
    np.testing.assert_allclose(some.trajectory.lla, whole.trajectory.lla[rows], rtol=0, atol=1e-12)
    np.testing.assert_allclose(some.trajectory.std, whole.trajectory.std[rows], rtol=1e-9)
    assert (some.covariance is None) == (not covariance)


def test_a_fix_within_a_sample():
    """As with the sample split there by hand."""
    recording, start = alike()
    t = np.array([1.02, 3.333, 5.2, 5.21, 7.0, 9.99])
    noise = Noise(1e-3, 1e-2, 1e-4, 1e-3, 0.0, 0.01)
    fixes = position(
        t,
        deviation=2.0,
        lla=np.array([0.8, 0.2, 300.0]) + np.outer(t, [10 / 6.38e6, 5 / 6.39e6 / np.cos(0.8), 0.0]),
    )
    ends = np.union1d(np.round(recording.imu.t, 9), t)
    dt = np.diff(ends, prepend=0.0)
    split = Imu(
        ends,
        dt,
        *(column[:1] * (dt / recording.imu.dt[0])[:, None] for column in recording.imu[2:]),
    )
    one, other = (
        sd.smooth(
            replace(recording, imu=imu, sources=(fixes,)), start=start, noise=noise, covariance=True
        )
        for imu in (recording.imu, split)
    )
    assert len(split.t) == len(recording.imu.t) + 4
    rows = np.searchsorted(other.t, one.t - 1e-6)
    assert np.abs(apart(one, state(other).rows(rows))).max() < 1e-6
    np.testing.assert_allclose(one.trajectory.std, other.trajectory.std[rows], rtol=1e-6)


# the rules of the loop


@pytest.mark.parametrize("name", NAMES)
def test_an_outage_of_fixes_at_the_end(flight, name):
    """The last 8 s are dead reckoning for both; the smoother still knows better what biases and
    heading were."""
    recording, given, truth = flight.drawn(6)
    fix = recording.sources[0]
    keep = fix.t < 12
    recording = replace(
        recording, sources=(replace(fix, t=fix.t[keep], y=fix.y[keep], std=fix.std[keep]),)
    )
    smoothed, filtered = both(recording, given, name)
    assert (smoothed.trajectory.std[:100, 8] < 0.5 * filtered.trajectory.std[:100, 8]).any()
    # nothing comes after
    np.testing.assert_allclose(
        smoothed.trajectory.std[250:], filtered.trajectory.std[250:], rtol=1e-9
    )
    assert smoothed.trajectory.std[-1, 0] > 3 * smoothed.trajectory.std[200, 0]


@pytest.mark.parametrize(
    "window, rule",
    [((8.0, 8.6), "bridged"), ((8.0, 11.0), "velocity and attitude held"), ((18.0, 20.1), None)],
)
def test_gaps_of_samples(flight, window, rule):
    """The filter comes out of a gap unsure, the smoother knows what follows."""
    recording, given, truth = flight.drawn(7)
    smoothed, filtered = both(without_samples(recording, window), given)
    if rule is None:  # the recording ends before
        assert smoothed.t[-1] == 18.0 and not smoothed.events
        return
    assert [t for t, _ in said(smoothed, rule)] == [pytest.approx(window[0])]
    after = int(np.searchsorted(smoothed.t, window[1] + 0.01))
    assert smoothed.t[after] - smoothed.t[after - 1] > 0.5
    at = slice(after, after + 3)
    assert (smoothed.trajectory.std[at, 6:9] < 0.75 * filtered.trajectory.std[at, 6:9]).all()
    rows = np.rint(smoothed.t[at] * RATE).astype(int)
    if rule == "bridged":
        assert (
            np.abs(apart(smoothed, truth.rows(np.rint(smoothed.t * RATE).astype(int)))[at]).max()
            < 4
        )
    else:  # in 3 s the flight turns by 60 deg, too much to be linear
        error = [
            np.linalg.norm(truth.rows(rows).less(state(solution).rows(at))[:, 6:9], axis=1)
            for solution in (smoothed, filtered)
        ]
        assert (error[0] < error[1]).all()


def test_rejected_and_missing_fixes_say_nothing(flight):
    """Smoothing with fixes that the gate rejects is smoothing without them."""
    recording, given, _ = flight.drawn(9)
    fix = recording.sources[0]
    bad, lost = np.isin(np.arange(len(fix.t)), (5, 9, 10)), np.isin(np.arange(len(fix.t)), (7, 15))
    y = fix.y + bad[:, None] * np.array([1e-4, 0.0, 0.0])
    y[lost] = np.nan
    marred = replace(recording, sources=(replace(fix, y=y, gate=50.0),))
    kept = ~(bad | lost)
    without = replace(
        recording, sources=(replace(fix, t=fix.t[kept], y=fix.y[kept], std=fix.std[kept]),)
    )
    smoothed, _ = both(marred, given)
    assert (smoothed.innovations.nis > 50).sum() == 3 and np.isnan(
        smoothed.innovations.nis
    ).sum() == 2
    assert said(smoothed, "GNSS position") == list(smoothed.events)
    equal(replace(smoothed, events=()), sd.smooth(without, **given))


def test_a_lifted_gate(flight):
    """From 8 s on the fixes are 200 m off: rejected for 5 s, then believed, with P made larger,
    which the way back counts as noise."""
    recording, given, _ = flight.drawn(10)
    fix = recording.sources[0]
    y = fix.y + (fix.t > 8)[:, None] * np.array([200 / 6.38e6, 0.0, 0.0])
    smoothed, filtered = both(replace(recording, sources=(replace(fix, y=y, gate=None),)), given)
    assert [t for t, _ in said(smoothed, "gate opened")] == [pytest.approx(14.0)]
    assert np.isfinite(smoothed.trajectory.lla).all() and (smoothed.trajectory.std > 0).all()
    assert smoothed.trajectory.std[300, 0] < filtered.trajectory.std[300, 0]


def test_without_any_fix_it_is_the_filter(flight):
    recording, given, _ = flight.drawn(11)
    smoothed, filtered = both(replace(recording, sources=()), given)
    equal(smoothed, filtered)


def test_the_rest_is_the_filters(flight):
    recording, given, _ = flight.drawn(12, NAVIGATION, FINE)
    smoothed, filtered = both(recording, given, "open-loop")
    for name in filtered.columns:
        np.testing.assert_array_equal(smoothed.columns[name], filtered.columns[name])


@pytest.mark.short
def test_memory_is_that_of_a_chunk(flight, monkeypatch):
    """The record's room does not grow with the recording."""
    sizes = []
    monkeypatch.setattr(
        smoothing,
        "new_output",
        lambda *given: sizes.append(preparation.new_output(*given)) or sizes[-1],
    )
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", 50)
    recording, given, _ = flight.drawn(13)
    for until in (10.0, 20.0):
        sd.smooth(recording.between(-np.inf, until), **given)
    first, second = ([part.shape for part in room if part.size] for room in sizes)
    assert first == second and sizes[0].record.shape[0] < 60


def peak(rows, every):
    """Bytes that smoothing a standing IMU with a fix a second takes at most, beside the
    recording."""
    imu = Imu(
        0.01 * np.arange(1, rows + 1),
        np.full(rows, 0.01),
        np.zeros((rows, 3)),
        np.tile([0.0, 0.0, -0.0981], (rows, 1)),
    )
    fixes = position(np.arange(1.0, rows // 100))
    given = dict(start=alike()[1]._replace(v_n=(0.0, 0.0, 0.0)), noise=MEMS.noise(), every=every)
    recording = Recording(imu, (fixes,))  # with arrays of its own
    tracemalloc.start()
    try:
        assert len(sd.smooth(recording, **given).t) == -(-rows // every)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("every, bound", [(1, 350), (100, 50)])
def test_a_day_fits_into_four_gigabytes(every, bound):
    """By the growth from 10 to 30 minutes at 100 Hz, to a day of 8.64 million samples of 64
    bytes; 350 MB for Python, its packages and compiled code."""
    peak(1000, every)  # what is loaded once
    few, many = peak(60_000, every), peak(180_000, every)
    each = (many - few) / 120_000
    assert 10 < each < bound
    assert 8.64e6 * (64 + each) + 350e6 < 4e9


def wrong(solution, reference):
    """(n,) rows that are off by more than five of their standard deviations."""
    path, rows = solution.trajectory, np.searchsorted(reference.t, solution.t - 1e-6)
    truth = reference.take(rows)
    turn = (path.rotation * truth.rotation.inv()).as_rotvec()
    off = np.c_[displacement(path.lla, truth.lla), path.v_n - truth.v_n, turn]
    return (np.abs(off) > 5 * path.std[:, :9]).any(axis=1)


def drifting(recording):
    """Position fixes walk away by 0.5 m/s from 120 s on, which the velocities contradict."""
    fix, *others = recording.sources
    east = 0.5 * np.clip(fix.t - 120, 0, None)
    y = displace_lla(fix.y, np.c_[0 * east, east, 0 * east])
    return replace(recording, sources=(replace(fix, y=y), *others))


def stepping(recording):
    """The bias of the gyro steps by 1 deg/s at 120 s."""
    imu = recording.imu
    dtheta = imu.dtheta + np.outer((imu.t > 120) * imu.dt, [0.0, 0.0, DEG])
    return replace(recording, imu=imu._replace(dtheta=dtheta))


@pytest.mark.parametrize("spoil, reach", [(drifting, 90), (stepping, 70)])
def test_what_bends_the_rows_before_it_is_said(spoil, reach):
    """An error from 120 s on reaches the smoothed rows before it, of which the filter knew
    nothing."""
    recording = spoil(sd.simulate(demo_flight(), 200.0, "tactical", 1003, rate=50.0))
    smoothed, filtered = (run(recording, every=5) for run in (sd.smooth, sd.fuse))
    before = smoothed.t < 120
    assert (filtered.status[before] == VALID).all()
    assert wrong(smoothed, recording.reference)[before].any()
    assert not wrong(smoothed, recording.reference)[before & (smoothed.status == VALID)].any()
    doubted = smoothed.t[before & (smoothed.status == DOUBTFUL)]
    (first, text), *_ = said(smoothed, APART)
    assert first == doubted[0] and reach < first < 120
    assert (smoothed.status[(smoothed.t >= first) & before] == DOUBTFUL).all()
    assert text.endswith("later fixes contradict earlier ones")
    others = [event for event in smoothed.events if APART not in event[1]]
    assert others == list(filtered.events)


@pytest.mark.parametrize("status", [VALID, INVALID])
def test_rows_that_are_apart_are_doubtful_and_those_of_20_s_before(status):
    recording, given, _ = Flight(60).drawn(14)
    run = begin(recording, "closed-loop", run_options(every=20, **given))
    run.complete()
    nav = run.out.nav
    nav[:, solution_row.ROW_STATUS] = status
    nav[:, solution_row.STD : solution_row.STD + 9], smoothed = 1.0, nav.copy()
    smoothed[:, solution_row.STD : solution_row.STD + 9] = 0.6  # std of the difference: 0.8
    smoothed[30:32, solution_row.V + 2] += [4.1, -4.5]
    smoothed[50, solution_row.V + 2] += 3.9
    smoothed[45, solution_row.STD + 2] = 0.99  # nothing to compare
    smoothed[45, solution_row.LLA + 2] += 100.0
    differences = Differences()
    for rows in (slice(40, 60), slice(0, 40)):
        differences.add(nav[rows], smoothed[rows])
    differences.tell(run)
    marked = nav[:, solution_row.ROW_STATUS] != status
    if status == INVALID:  # what is said already
        assert not marked.any() and not run.events.rows
        return
    # rows are a second apart
    assert np.flatnonzero(marked).tolist() == list(range(10, 32))
    (row,) = run.events.rows
    assert row.tolist() == pytest.approx([11, 32, Code.APART, 0, 22, 4.5 / 0.8])


def test_an_attitude_that_is_apart_counts():
    filtered, smoothed = np.zeros((2, 3, solution_row.ROW_STATUS))
    (
        filtered[:, solution_row.STD : solution_row.STD + 9],
        smoothed[:, solution_row.STD : solution_row.STD + 9],
    ) = 0.01, 0.006
    turn = Rotation.from_rotvec([[0.0, 0.0, 0.02], [0.0, -0.045, 0.0], [0.0, 0.0, 0.0]])
    first = Rotation.from_euler("zyx", [2.0, 0.4, -0.3])
    filtered[:, solution_row.Q : solution_row.BIASES] = np.roll(first.as_quat(), 1)
    smoothed[:, solution_row.Q : solution_row.BIASES] = -np.roll(
        (turn * first).as_quat(), 1, axis=1
    )
    differences = Differences()
    differences.add(filtered, smoothed)
    np.testing.assert_allclose(differences._ratio[0], [2.5, 5.625, 0.0], rtol=1e-3)


def test_filter_and_smoother_differ_as_their_standard_deviations_allow():
    differences = Differences()
    rng = np.random.default_rng(5)
    filtered, smoothed = np.zeros((2, 4000, solution_row.ROW_STATUS))
    (
        filtered[:, solution_row.STD : solution_row.STD + 6],
        smoothed[:, solution_row.STD : solution_row.STD + 6],
    ) = 1.0, 0.6
    # var(filter) - var(smoother) = 0.64
    filtered[:, solution_row.V : solution_row.Q] = rng.normal(0, 0.8, (4000, 3))
    smoothed[:, solution_row.LLA + 2] = rng.normal(0, 1.6, 4000)
    differences.add(filtered, smoothed)
    found = differences.ratios()
    # mean of 12 000 squares: std 0.013; of the position only the height differs, twice too much
    assert found["velocity"] == pytest.approx(1.0, abs=0.05)
    assert found["position"] == pytest.approx(4 / 3, abs=0.13)
