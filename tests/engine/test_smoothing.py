"""Smoothing: against textbook smoothers over a short log, honest over 100 seeds, the same in any
chunks, and through every rule of the loop."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from recordings import said, without_samples
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from smoothed_attitude import least_squares, log_of, rauch_tung_striebel

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import PREDICT, kernel
from strapdown.data.recording import Recording
from strapdown.engine import prepare as preparation, smoothing
from strapdown.filters.attitude.attitude_error_state import SIX
from strapdown.filters.attitude.attitude_mekf import ATTITUDE_MEKF, predict_attitude
from strapdown.io.solution import read_solution, write_solution
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import hand_held
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import demo_flight, increments, sample

WHITE = dict(
    low_pass=0.0, acceleration=0.0, rate_error=0.0, heading=0.0, timing=0.0, disturbance=0.0
)
"""Options with which the filter's model is that of the simulator: white noise, and a body that
does not accelerate."""
SPEC = ImuSpec(
    "walking MEMS", Triad(noise=2e-3, turn_on_bias=5e-3, bias_walk=1e-3), Triad(noise=1e-2)
)
START_STD = np.r_[[1.0] * 3, [0.1] * 3, np.radians([0.5, 0.5, 2.0]), [0.0] * 3, [5e-3] * 3]
BLOCK = np.ix_(SIX, SIX)
APART = "filter and smoother are up to"
"""Words of the event that only the smoother has."""


class Turning:
    """An IMU turned in a hand but held in its place, with a magnetometer; runs of it are drawn
    by seed."""

    def __init__(self, samples, rate):
        self.t, motion = (
            np.arange(samples + 1) / rate,
            hand_held((0.8, 0.2, 500.0), heading=1.0, travel=0.0),
        )
        self.truth, self.ideal = sample(motion, self.t), increments(motion, self.t)

    def drawn(self, seed, gate=np.inf, start_std=START_STD):
        """(recording, {start, noise}, true gyro bias at the ends of the samples)."""
        of_imu, of_start, of_field = np.random.default_rng(seed).spawn(3)
        imu, _, b_g = SPEC.corrupt(self.ideal, of_imu)
        field = Magnetometer(rate=10, std=0.5e-6, field=(21e-6, 1.6e-6, 43.9e-6)).measure(
            self.truth, of_field
        )
        recording = Recording(imu, (replace(field, gate=gate),), self.truth, {"name": "turning"})
        return (
            recording,
            dict(start=draw_start(self.truth, start_std, of_start), noise=SPEC.noise()),
            b_g,
        )


@pytest.fixture(scope="module")
def short():
    return Turning(200, 50)


@pytest.fixture(scope="module")
def longer():
    """20 s at 50 Hz."""
    return Turning(1000, 50)


def attitude(solution):
    return Rotation.from_quat(solution.trajectory.q_nb[:, [1, 2, 3, 0]])


def apart(solution, attitudes, biases):
    """(n, 6): from a solution to other attitudes and gyro biases, in standard deviations of the
    solution."""
    return (
        np.hstack([(attitudes * attitude(solution).inv()).as_rotvec(), biases - solution.b_g])
        / solution.trajectory.std[:, SIX]
    )


def equal(first, second, tolerance=1e-9):
    """Assert that two solutions of attitude and gyro bias are alike to so many standard
    deviations and fractions of them."""
    assert np.array_equal(first.t, second.t) and first.events == second.events
    assert np.abs(apart(first, attitude(second), second.b_g)).max() < tolerance
    np.testing.assert_allclose(
        first.trajectory.std[:, SIX], second.trajectory.std[:, SIX], rtol=tolerance
    )


# against other smoothers


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.short
def test_as_rauch_tung_and_striebel(short, seed):
    """To first order: the filter takes attitude for constant over a sample in its transition,
    and the start is off by 2 deg."""
    recording, given, _ = short.drawn(seed)
    smoothed, filtered = (
        run(recording, "attitude-mekf", covariance=True, **given, options=WHITE)
        for run in (sd.smooth, sd.fuse)
    )
    C, b, P = rauch_tung_striebel(log_of(recording, **given))
    off = apart(smoothed, C, b)
    assert (
        np.sqrt((off**2).mean(axis=0)).max() < 0.05
        and np.abs(off).max() < 0.3
        and np.abs(off[10:]).max() < 0.1
    )
    stds = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    np.testing.assert_allclose(smoothed.trajectory.std[:, SIX], stds, rtol=0.01)
    correlations = (smoothed.covariance[(slice(None), *BLOCK)] - P) / (
        stds[:, :, None] * stds[:, None, :]
    )
    assert np.abs(correlations).max() < 0.03
    assert np.abs(apart(filtered, C, b)).max() > 1.5  # the comparison can tell


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.deep
def test_as_least_squares_over_the_whole_log(short, seed):
    """The nonlinear one; it also knows that the gyro bias turns the specific force within a
    sample, which the filter leaves out."""
    recording, given, _ = short.drawn(seed)
    log = log_of(recording, **given)
    C, b, _ = rauch_tung_striebel(log)
    first = log.first()
    C, b, P, last = least_squares(
        log, Rotation.concatenate([first[0], C]), np.vstack([first[1], b])
    )
    assert last < 1e-6
    smoothed = sd.smooth(recording, "attitude-mekf", **given, options=WHITE)
    off = apart(smoothed, C, b)
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.08 and np.abs(off).max() < 0.3
    np.testing.assert_allclose(
        smoothed.trajectory.std[:, SIX], np.sqrt(np.diagonal(P, axis1=1, axis2=2)), rtol=0.015
    )


BAND = chi2.ppf([0.025, 0.975], 600) / 600
"""Of the mean of NEES/6 over 100 runs: 0.890, 1.116. With 3000 other seeds the mean was 0.995,
and 1 in 25 sets of 100 seeds had less than 90 % of its epochs inside: those of a run are
correlated."""


def nees(flight, seed):
    recording, given, b_g = flight.drawn(seed)
    solution = sd.smooth(
        recording, "attitude-mekf", covariance=True, every=50, **given, options=WHITE
    )
    rows = np.searchsorted(recording.imu.t, solution.t - 1e-6)
    truth = Rotation.from_quat(flight.truth.q_nb[rows + 1][:, [1, 2, 3, 0]])
    error = np.hstack([(truth * attitude(solution).inv()).as_rotvec(), b_g[rows] - solution.b_g])
    return (
        np.einsum(
            "ij,ij->i",
            error,
            np.linalg.solve(solution.covariance[(slice(None), *BLOCK)], error[:, :, None])[:, :, 0],
        )
        / 6
    )


@pytest.mark.deep
def test_smoothed_covariances_are_honest():
    flight = Turning(3000, 50)
    with ThreadPoolExecutor(2) as pool:
        mean = np.mean(list(pool.map(lambda seed: nees(flight, seed), range(100))), axis=0)
    assert ((mean > BAND[0]) & (mean < BAND[1])).mean() >= 0.9


# the same whatever the way


@pytest.mark.parametrize("chunk", (1, 7, 64, 499))
@pytest.mark.short
def test_chunks_do_not_matter(short, monkeypatch, chunk):
    recording, given, _ = short.drawn(4, gate=None)
    whole = sd.smooth(recording, "attitude-mekf", covariance=True, **given)
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", chunk)
    parts = sd.smooth(recording, "attitude-mekf", covariance=True, **given)
    equal(whole, parts)
    scale = whole.trajectory.std[:, SIX]
    off = (whole.covariance - parts.covariance)[(slice(None), *BLOCK)] / (
        scale[:, :, None] * scale[:, None, :]
    )
    assert np.abs(off).max() < 1e-9


@pytest.mark.parametrize("every", (2, 7, 90, 1000))
@pytest.mark.short
def test_kept_rows_are_those_of_all(short, monkeypatch, every):
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", 40)  # some chunks keep no row
    recording, given, _ = short.drawn(5)
    whole, some = (
        sd.smooth(recording, "attitude-mekf", every=kept, **given) for kept in (1, every)
    )
    rows = np.searchsorted(whole.t, some.t)
    assert len(rows) == -(-200 // every) and some.t[-1] == whole.t[-1]
    np.testing.assert_allclose(some.trajectory.q_nb, whole.trajectory.q_nb[rows], atol=1e-12)
    np.testing.assert_allclose(
        some.trajectory.std[:, SIX], whole.trajectory.std[rows][:, SIX], rtol=1e-9
    )


@pytest.mark.short
def test_all_but_the_estimates_is_the_filters(short):
    recording, given, _ = short.drawn(6)
    smoothed, filtered = (
        run(recording, "attitude-mekf", covariance=True, **given) for run in (sd.smooth, sd.fuse)
    )
    assert np.array_equal(
        smoothed.innovations.innovation, filtered.innovations.innovation, equal_nan=True
    )
    assert np.array_equal(smoothed.innovations.nis, filtered.innovations.nis) and np.array_equal(
        smoothed.status, filtered.status
    )
    assert (
        np.isnan(smoothed.trajectory.lla).all()
        and np.isnan(smoothed.trajectory.std[:, :6]).all()
        and np.isnan(smoothed.b_a).all()
    )
    assert smoothed.meta == filtered.meta | {"smoothed": True}
    ordered(smoothed, filtered)
    plain = sd.smooth(recording, "attitude-mekf", **given)
    assert plain.covariance is None
    equal(plain, smoothed)


@pytest.mark.parametrize("chunk", (200, 512))
def test_the_second_pass_is_the_first_with_accelerometer_biases_too(monkeypatch, chunk):
    """Biases that no state holds widen gates and the bound on dips. Part of the fields is turned
    so far that these decide which are measured."""
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", chunk)
    flight = sd.simulate(
        demo_flight(), 60.0, "consumer", seed=3, magnetometer=Magnetometer(), date="2024-01-01"
    )
    (field,) = (a for a in flight.sources if a.kind == "magnetic-field")
    rng = np.random.default_rng(0)
    angle = rng.normal(0, np.radians(20.0), len(field.t)) * (rng.random(len(field.t)) < 0.3)
    y = Rotation.from_rotvec(angle[:, None] * [0.6, 0.0, 0.8]).apply(field.y.copy())
    bent = replace(flight, sources=(replace(field, y=y),))
    smoothed, filtered = (run(bent, "attitude-mekf") for run in (sd.smooth, sd.fuse))
    for part in ("innovation", "nis", "accepted"):
        found, expected = (getattr(each.innovations, part) for each in (smoothed, filtered))
        assert np.array_equal(found, expected, equal_nan=True)
    assert 0 < np.isnan(filtered.innovations.nis).mean() < 0.5  # some fields are refused
    assert np.array_equal(smoothed.status, filtered.status)


def ordered(smoothed, filtered):
    """Assert that a smoother is nowhere less sure than its filter, and that they agree at the
    end."""
    loss = filtered.covariance[(slice(None), *BLOCK)] - smoothed.covariance[(slice(None), *BLOCK)]
    scale = filtered.trajectory.std[:, SIX]
    assert np.linalg.eigvalsh(loss / (scale[:, :, None] * scale[:, None, :])).min() > -1e-9
    assert (smoothed.trajectory.std[:, SIX] <= filtered.trajectory.std[:, SIX] * (1 + 1e-12)).all()
    np.testing.assert_allclose(
        smoothed.trajectory.q_nb[-1], filtered.trajectory.q_nb[-1], atol=1e-14
    )
    np.testing.assert_allclose(
        smoothed.trajectory.std[-1, SIX], filtered.trajectory.std[-1, SIX], rtol=1e-12
    )
    np.testing.assert_allclose(smoothed.b_g[-1], filtered.b_g[-1], atol=1e-15)


# the rules of the loop


def both(recording, given, **options):
    """(smoothed, filtered), of which is checked what holds for every recording, also in small
    chunks."""
    smoothed, filtered = (
        run(recording, "attitude-mekf", covariance=True, **given, options=options)
        for run in (sd.smooth, sd.fuse)
    )
    ordered(smoothed, filtered)
    assert tuple(event for event in smoothed.events if APART not in event[1]) == filtered.events
    assert smoothed.counts() == filtered.counts()
    before, smoothing.RECORDED_ROWS = smoothing.RECORDED_ROWS, 60
    try:
        equal(smoothed, sd.smooth(recording, "attitude-mekf", **given, options=options))
    finally:
        smoothing.RECORDED_ROWS = before
    return smoothed, filtered


def error(solution, truth):
    """Angle of the attitude error, rad."""
    rows = np.searchsorted(truth.t, solution.t - 1e-6)
    return (
        Rotation.from_quat(truth.q_nb[rows][:, [1, 2, 3, 0]]) * attitude(solution).inv()
    ).magnitude()


@pytest.mark.parametrize("window, rule", [((8.0, 8.5), "bridged"), ((8.0, 13.0), "attitude held")])
def test_gaps(longer, window, rule):
    """The filter comes out of a gap unsure, the smoother knows what follows; in the longer one
    the body turns by 36 deg, too much to be linear."""
    recording, given, _ = longer.drawn(7)
    recording = without_samples(recording, window)
    smoothed, filtered = both(recording, given, **WHITE)
    assert [t for t, _ in said(smoothed, rule)] == [pytest.approx(window[0])]
    after = int(np.searchsorted(smoothed.t, window[1] + 0.01))
    assert smoothed.t[after] - smoothed.t[after - 1] > 0.4
    at = slice(after, after + 3)
    assert (
        smoothed.trajectory.std[at][:, SIX[:3]] < 0.75 * filtered.trajectory.std[at][:, SIX[:3]]
    ).all()
    here, before = (
        error(smoothed, recording.reference)[at],
        error(filtered, recording.reference)[at],
    )
    bounds = (
        4 * np.linalg.norm(smoothed.trajectory.std[at, 6:9], axis=1)
        if rule == "bridged"
        else 0.5 * before
    )
    assert (here < bounds).all() and (here < before).all()


def test_the_last_part_without_a_magnetometer(longer):
    recording, given, _ = longer.drawn(8)
    field = recording.sources[0]
    keep = field.t < 10
    recording = replace(
        recording, sources=(replace(field, t=field.t[keep], y=field.y[keep], std=field.std[keep]),)
    )
    smoothed, filtered = both(recording, given, **WHITE)
    heading = smoothed.trajectory.std[:, 8]
    assert heading[-1] > 2 * heading[400] and filtered.trajectory.std[-1, 8] == pytest.approx(
        heading[-1]
    )


def test_without_any_fix_the_vertical_still_smooths(longer):
    recording, given, _ = longer.drawn(8)
    smoothed, filtered = both(replace(recording, sources=()), given, **WHITE)
    assert smoothed.trajectory.std[500, 6] < 0.8 * filtered.trajectory.std[500, 6]


def test_rejected_and_missing_fixes_say_nothing(longer):
    """Smoothing with fixes that the gate rejects is smoothing without them."""
    recording, given, _ = longer.drawn(9)
    field = recording.sources[0]
    bad, lost = (
        np.isin(np.arange(len(field.t)), (50, 90, 91)),
        np.isin(np.arange(len(field.t)), (70, 120)),
    )
    y = np.where(
        bad[:, None], field.y @ Rotation.from_euler("z", 170, degrees=True).as_matrix(), field.y
    )
    y[lost, 1] = np.nan
    marred = replace(recording, sources=(replace(field, y=y, gate=50.0),))
    without = replace(
        recording,
        sources=(
            replace(
                field,
                t=field.t[~(bad | lost)],
                y=field.y[~(bad | lost)],
                std=field.std[~(bad | lost)],
            ),
        ),
    )
    smoothed, filtered = both(marred, given, **WHITE)
    assert (smoothed.innovations.nis > 50).sum() == 3 and smoothed.counts()["magnetometer"][1] == 3
    assert np.isnan(smoothed.innovations.nis).sum() == 2
    # a split of samples at fixes apart
    assert said(smoothed, "magnetometer") == list(smoothed.events)
    told = replace(smoothed, events=())
    equal(told, sd.smooth(without, "attitude-mekf", **given, options=WHITE), tolerance=1e-6)


def test_a_lifted_gate(longer):
    """From 8 s on the surroundings turn the field by 40 deg: rejected for 3 s, then believed,
    with P made larger, which the way back counts as noise."""
    recording, given, _ = longer.drawn(10, gate=10.828)
    field = recording.sources[0]
    north, east, down = field.parameters
    turned = Rotation.from_euler("z", 40, degrees=True)
    rows = np.searchsorted(recording.reference.t, field.t - 1e-6)
    body = Rotation.from_quat(recording.reference.q_nb[rows][:, [1, 2, 3, 0]])
    y = np.where(
        (field.t > 8)[:, None], (body.inv() * turned * body).apply(field.y.copy()), field.y
    )
    smoothed, filtered = both(replace(recording, sources=(replace(field, y=y),)), given, **WHITE)
    assert [t for t, _ in said(smoothed, "gate opened")] == [pytest.approx(11.1, abs=0.11)]
    assert (
        np.isfinite(smoothed.trajectory.q_nb).all() and (smoothed.trajectory.std[:, SIX] > 0).all()
    )
    assert smoothed.trajectory.std[450, 8] < filtered.trajectory.std[450, 8]


@kernel(PREDICT)
def leaving(belief, u, dt, noise):
    """As the filter's, until 3 s have gone: then it leaves the latitudes where results hold."""
    predict_attitude(belief, u, dt, noise)
    belief.b_a[0] += dt
    if belief.b_a[0] > 3:
        belief.lla[0] = 2.0


@pytest.mark.parametrize("chunk", (40, 1000))
@pytest.mark.short
def test_a_filter_that_stops_early(short, monkeypatch, chunk):
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", chunk)
    recording, given, _ = short.drawn(11)
    stopped = sd.smooth(recording, ATTITUDE_MEKF._replace(predict=leaving), **given)
    assert "stopped at" in stopped.meta["stopped"] and stopped.t[-1] == pytest.approx(3.0, abs=0.03)
    cut = recording.between(-np.inf, stopped.t[-1] + 1e-6)
    whole = sd.smooth(cut, "attitude-mekf", **given)
    assert len(whole.t) == len(stopped.t)
    assert np.abs(apart(whole, attitude(stopped), stopped.b_g)).max() < 1e-9


# what a user meets


@pytest.mark.short
def test_refusals(short):
    recording, given, _ = short.drawn(12)
    with pytest.raises(
        DataError, match=r"^mahony cannot be smoothed; these can: attitude-mekf[\w, -]*$"
    ):
        sd.smooth(recording, "mahony", **given)
    with pytest.raises(
        DataError, match="no filter is called 'attitude-mek' .did you mean 'attitude-mekf'"
    ):
        sd.smooth(recording, "attitude-mek", **given)
    with pytest.raises(DataError, match="has no option 'low'"):
        sd.smooth(recording, "attitude-mekf", options={"low": 3}, **given)
    with pytest.raises(DataError, match="every is 0"):
        sd.smooth(recording, "attitude-mekf", every=0, **given)


@pytest.mark.short
def test_progress_goes_to_one(short, monkeypatch):
    monkeypatch.setattr(smoothing, "RECORDED_ROWS", 50)
    recording, given, _ = short.drawn(13)
    seen = []
    sd.smooth(recording, "attitude-mekf", progress=seen.append, **given)
    assert seen == sorted(seen) and len(seen) == 8 and seen[3] == 0.5 and seen[-1] == 1.0


@pytest.mark.short
def test_it_begins_on_its_own(short):
    """Start and IMU as of `fuse`, from the recording itself."""
    recording = short.drawn(14)[0]
    recording = replace(recording, meta=recording.meta | {"grade": "consumer"})
    smoothed, filtered = sd.smooth(recording, "attitude-mekf"), sd.fuse(recording, "attitude-mekf")
    assert smoothed.meta["start"] == filtered.meta["start"]


def test_files_and_pages_say_so(short, tmp_path):
    recording, given, _ = short.drawn(15)
    smoothed, filtered = (run(recording, "attitude-mekf", **given) for run in (sd.smooth, sd.fuse))
    write_solution(smoothed, tmp_path / "solution.nc")
    assert read_solution(tmp_path / "solution.nc").meta["smoothed"] is True
    page = sd.report([filtered, smoothed], recording.reference).html
    assert "attitude-mekf, smoothed" in page and "attitude-mekf 2" not in page


def test_memory_is_that_of_a_chunk(longer, monkeypatch):
    """The record's room does not grow with the recording."""
    sizes = []
    monkeypatch.setattr(
        smoothing,
        "new_output",
        lambda *given: sizes.append(preparation.new_output(*given)) or sizes[-1],
    )
    for samples in (400, 1000):
        monkeypatch.setattr(smoothing, "RECORDED_ROWS", 100)
        recording, given, _ = longer.drawn(16)
        sd.smooth(recording.between(-np.inf, samples / 50), "attitude-mekf", **given)
    first, second = ([part.shape for part in room if part.size] for room in sizes)
    assert first == second and sizes[0].record.shape[0] < 130
