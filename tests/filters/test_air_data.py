"""Airspeed, vanes and the constraint of a fixed wing with every filter that has a position: the wind
that all of them share, its walk, its consistency, streams, smoothing and lanes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import strapdown as sd
from strapdown import aiding
from strapdown.aiding.air_data import TRUE, WIND
from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES
from strapdown.data.solution import Source
from strapdown.engine.prepare import augmented_states, merge
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.evaluation.consistency import nees_of
from strapdown.geometry.rotations import Rotation
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import flight
from strapdown.sim.scenario import Scenario
from strapdown.sim.synthesis import Simulator
from strapdown.sim.trajectory import DEG

POSITIONED = (
    "closed-loop",
    "mekf",
    "closed-loop-error-bias",
    "open-loop",
    "periodic-reset",
    "ukf",
    "ckf",
)
NAMES = ["wind north [m/s]", "wind east [m/s]"]
RATE, DURATION, SPEED = 25.0, 120.0, 60.0
STDS = {"true-airspeed": 1.0, "side-slip": 0.02, "angle-of-attack": 0.02, "zero-side-slip": 1.0}


def circling():
    """A light aircraft that turns to both sides."""
    return flight(
        (48 * DEG, 11 * DEG, 800.0),
        course=30 * DEG,
        speed=SPEED,
        legs=[
            {"duration": 20.0},
            {"duration": 30.0, "turn": 150 * DEG},
            {"duration": 20.0},
            {"duration": 30.0, "turn": -120 * DEG},
            {"duration": 20.0},
        ],
    )


SCENARIO = Scenario("circling", circling(), DURATION, RATE, Gnss(velocity_std=None), "industrial")


@pytest.fixture(scope="module")
def simulator():
    return Simulator(SCENARIO)


def walking_wind(t, rng):
    """(n, 2) m/s: the wind that a filter takes it to be."""
    steps = (
        rng.normal(0, WIND["state_walk"], (len(t), 2)) * np.sqrt(np.diff(t, prepend=0.0))[:, None]
    )
    return rng.normal(0, WIND["state_std"], 2) + np.cumsum(steps, axis=0)


def air_sources(truth, rng, kinds=tuple(STDS), every=5):
    """(sources that see one wind, that wind at the times of the truth), in plain numpy."""
    wind = walking_wind(truth.t, rng)
    air = truth.v_n - np.c_[wind, np.zeros(len(wind))]
    u, v, w = Rotation.from_wxyz(truth.q_nb).inv().apply(air).T
    true = {
        "true-airspeed": np.linalg.norm(air, axis=1),
        "side-slip": np.arctan2(v, u),
        "angle-of-attack": np.arctan2(w, u),
        "zero-side-slip": v,
    }
    rows = slice(every, None, every)
    made = []
    for kind in kinds:
        y = true[kind][rows, None]
        std = np.full(y.shape, STDS[kind])
        y = y + std * rng.standard_normal(y.shape)
        made.append(Source(kind, truth.t[rows], y, std, gate=np.inf, name=kind))
    return tuple(made), wind


def flown(simulator, seed, kinds=tuple(STDS)):
    """(recording with its own and air data sources, start, wind)."""
    recording, start = simulator.run("industrial", seed)
    sources, wind = air_sources(recording.reference, np.random.default_rng([seed, 7]), kinds)
    return replace(recording, sources=recording.sources + sources), start, wind


@pytest.mark.parametrize("name", POSITIONED)
def test_the_wind_is_found(simulator, name):
    recording, start, wind = flown(simulator, 3)
    solution = sd.fuse(recording, name, start=start)
    assert [each for each in solution.columns if "wind" in each] == [
        *NAMES,
        *(f"std of {each}" for each in NAMES),
    ]
    for k, each in enumerate(NAMES):
        std = solution.columns[f"std of {each}"]
        assert std[0] > 5.0 and std[-1] < 1.0
        assert abs(solution.columns[each][-1] - wind[-1, k]) < 4 * std[-1]


def test_errors_with_the_wind_are_as_large_as_they_are_said_to_be(simulator):
    """NEES of 17 states over 12 seeds: in the band of 0.1 % to 99.9 % at 90 % of the epochs after
    the first turn."""
    values = []
    for seed in range(12):
        recording, start, wind = flown(simulator, seed)
        solution = sd.fuse(recording, start=start, covariance=True, every=25)
        rows = np.searchsorted(recording.reference.t, solution.t - 1e-6)
        truth = {name: wind[rows, k] for k, name in enumerate(NAMES)}
        values.append(nees_of(solution, recording, truth))
    sums = np.sum(values, axis=0)[solution.t > 50.0]
    low, high = chi2(12 * (STATES + 2)).ppf([0.001, 0.999])
    assert np.mean((sums > low) & (sums < high)) > 0.9


def test_the_wind_walks_once_for_all_its_sources(simulator):
    """Measurements that say nothing leave prior and walk: sigma^2 + q^2 T, whatever their
    number."""
    recording, start = simulator.run("industrial", 1)
    blind = tuple(
        replace(a, std=np.full_like(a.std, 1e9))
        for a in air_sources(recording.reference, np.random.default_rng(1))[0]
    )
    last = blind[0].t[-1]
    expected = np.sqrt(WIND["state_std"] ** 2 + WIND["state_walk"] ** 2 * last)
    for sources in (blind[:1], blind, blind + tuple(replace(a, name="again") for a in blind)):
        solution = sd.fuse(replace(recording, sources=recording.sources + sources), start=start)
        for each in NAMES:
            assert abs(solution.columns[f"std of {each}"][-1] - expected) < 1e-6


def test_the_wind_walks_once_past_readings_that_are_left_out(simulator):
    """As above of a reading that is frozen from 40 s on, which no filter is asked of."""
    recording, start = simulator.run("industrial", 1)
    (airspeed,), _ = air_sources(recording.reference, np.random.default_rng(1), ("true-airspeed",))
    still = replace(frozen(airspeed), std=np.full_like(airspeed.std, 1e9), gate=None)
    expected = np.sqrt(WIND["state_std"] ** 2 + WIND["state_walk"] ** 2 * airspeed.t[-1])
    solution = sd.fuse(replace(recording, sources=(*recording.sources, still)), start=start)
    assert any("frozen at one value" in text for _, text in solution.events)
    for each in NAMES:
        assert abs(solution.columns[f"std of {each}"][-1] - expected) < 1e-6


def test_states_of_others_stand_before_and_behind_the_wind(simulator):
    """Two airspeeds with a barometer between them, one with a scale: the wind stands once."""
    (speed, slip), _ = air_sources(
        simulator.truth, np.random.default_rng(1), ("true-airspeed", "side-slip")
    )
    t = speed.t
    baro = Source("pressure", t, np.full((len(t), 1), 9e4), np.full((len(t), 1), 5.0))
    sources = (baro, replace(speed, estimate={"scale": (0.05,)}), baro, slip)
    assert [each.name for each in augmented_states(sources)] == [
        "pressure bias [m]",
        *NAMES,
        "pressure bias [m]",
        "scale error of true-airspeed",
    ]
    table = merge(sources).sources
    assert table["first_state"].tolist() == [STATES, STATES + 1, STATES + 3, STATES + 1]
    assert table["scale_state"].tolist() == [0, STATES + 4, 0, 0]


def test_kinds_that_share_states_and_differ_are_refused(monkeypatch, simulator):
    (speed, slip), _ = air_sources(
        simulator.truth, np.random.default_rng(1), ("true-airspeed", "side-slip")
    )
    find, other = aiding.find, TRUE._replace(state_walk=0.5)
    monkeypatch.setattr(aiding, "find", lambda name: other if name == TRUE.name else find(name))
    with pytest.raises(DataError, match="true-airspeed and side-slip share the states 'wind'"):
        augmented_states((speed, slip))


@pytest.mark.parametrize("name", ["closed-loop", "open-loop"])
def test_a_stream_is_the_batch_bit_for_bit(simulator, name):
    recording, start, _ = flown(simulator, 5)
    recording = recording.between(0.0, 20.0)
    solution = sd.fuse(recording, name, start=start, imu="industrial", covariance=True)
    stream = Stream(name, start=start, imu="industrial", sources=recording.sources)
    events = [
        Sample(t, dt, tuple(a), tuple(b))
        for t, dt, a, b in zip(*(column.tolist() for column in recording.imu))
    ]
    events += [
        Measurement(t, k, tuple(y), tuple(d))
        for k, a in enumerate(recording.sources)
        for t, y, d in zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
    ]
    for event in sorted(events, key=lambda event: (event.t, type(event) is Sample)):
        stream.step(event)
    last = stream.finish()
    assert np.array_equal(last.P, solution.covariance[-1])
    assert last.augmented.tolist() == [solution.columns[each][-1] for each in NAMES]


def test_smoothing_knows_the_wind_better(simulator):
    recording, start, wind = flown(simulator, 4)
    filtered = sd.fuse(recording, start=start)
    smoothed = sd.smooth(recording, start=start)
    early = smoothed.t < 40.0
    for k, each in enumerate(NAMES):
        std = smoothed.columns[f"std of {each}"]
        assert std[early].max() < 0.5 * filtered.columns[f"std of {each}"][early].max()
        rows = np.searchsorted(recording.reference.t, smoothed.t - 1e-6)
        assert np.mean(np.abs(smoothed.columns[each] - wind[rows, k]) < 3 * std) > 0.9


def test_air_data_hold_the_position_without_gnss(simulator):
    """30 s without, six flights of a consumer IMU: the wind is known, so that airspeed and heading
    are a velocity."""
    worst = np.empty((2, 6))
    for seed in range(6):
        recording, start = simulator.run("consumer", seed)
        recording = replace(recording, sources=(recording.sources[0].without([(85.0, 115.0)]),))
        air, _ = air_sources(
            recording.reference, np.random.default_rng(seed), ("true-airspeed", "zero-side-slip")
        )
        for k, sources in enumerate(((), air)):
            solution = sd.fuse(replace(recording, sources=recording.sources + sources), start=start)
            e = sd.errors(solution, recording.reference)
            worst[k, seed] = np.hypot(*e.position[e.t < 115.0, :2].T).max()
    without, with_air = np.median(worst, axis=1)
    assert with_air < 0.5 * without


def frozen(airspeed):
    """From 40 s on."""
    y = airspeed.y.copy()
    y[airspeed.t > 40.0] = y[np.searchsorted(airspeed.t, 40.0)]
    return replace(airspeed, y=y)


FAULTS = {
    "scale": lambda a: replace(a, y=1.1 * a.y),
    "late": lambda a: replace(a, t=a.t + 0.2),
    "frozen": frozen,
    "sign": lambda a: replace(a, y=-a.y),
    "knots": lambda a: replace(a, y=a.y / 0.514444),
    "blocked": lambda a: replace(a, y=0.0 * a.y),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_airspeed_bends_little_but_the_wind(simulator, fault):
    """Its gate is opened for the wind alone: position and heading stay within 1.5 times those
    without air data, in three flights of a consumer IMU."""
    squares = np.zeros((2, 2))
    for seed in range(3):
        recording, start = simulator.run("consumer", seed)
        (airspeed, slip), _ = air_sources(
            recording.reference, np.random.default_rng(seed), ("true-airspeed", "zero-side-slip")
        )
        wrong = tuple(replace(a, gate=None) for a in (FAULTS[fault](airspeed), slip))
        for k, sources in enumerate(((), wrong)):
            solution = sd.fuse(replace(recording, sources=recording.sources + sources), start=start)
            e = sd.errors(solution, recording.reference)
            late = e.t > 20.0
            squares[k] += np.mean(e.position[late, :2] ** 2), np.mean(e.rph[late, 2] ** 2)
    assert (squares[1] < 1.5**2 * squares[0]).all()


OUT = (85.0, 115.0)


def outage(simulator, change, seed, estimate):
    """(largest horizontal error with GPS alone and with a changed airspeed and the constraint, m; events),
    30 s without GPS."""
    recording, start = simulator.run("consumer", seed)
    kinds = ("true-airspeed", "zero-side-slip")
    (airspeed, slip), _ = air_sources(recording.reference, np.random.default_rng(seed), kinds)
    hidden = tuple(a.without([OUT]) for a in recording.sources)
    changed = replace(change(airspeed), gate=None, estimate=estimate)
    worst = []
    for sources in (hidden, (*hidden, changed, replace(slip, gate=None))):
        solution = sd.fuse(replace(recording, sources=sources), start=start)
        e = sd.errors(solution, recording.reference)
        out = (e.t > OUT[0]) & (e.t < OUT[1])
        worst.append(np.hypot(*e.position[out, :2].T).max())
    return *worst, [text for _, text in solution.events]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_airspeed_is_not_the_only_aid(simulator, fault):
    """In an outage nothing contradicts it: what did before, or is frozen, is left out. Rms of the largest
    errors of four flights, the scale of the airspeed a state."""
    found = [outage(simulator, FAULTS[fault], seed, {"scale": (0.05,)}) for seed in range(4)]
    without, wrong = np.sqrt(np.mean(np.square([each[:2] for each in found]), axis=0))
    assert wrong < 1.5 * without
    said = {"frozen": "frozen at one value", "knots": "contradicts position"}
    assert any(said.get(fault, "") in text for *_, events in found for text in [*events, ""])


def test_a_wrong_scale_that_is_no_state_is_left_out_before_an_outage_and_said():
    """While velocities are there they show it. Rms of the largest errors of four flights; it was 2.4 times
    as long as what it had done to attitude and biases was left."""
    with_velocities = Simulator(replace(SCENARIO, gnss=Gnss()))
    found = [outage(with_velocities, FAULTS["scale"], seed, {}) for seed in range(4)]
    without, wrong = np.sqrt(np.mean(np.square([each[:2] for each in found]), axis=0))
    assert wrong < 2.0 * without
    for *_, events in found:
        assert any("true-airspeed: left out from here" in text for text in events)


def test_a_right_airspeed_is_used_in_an_outage(simulator):
    """Nothing is left out, and it is worth it."""
    for seed in range(4):
        without, right, events = outage(simulator, lambda a: a, seed, {})
        assert not any("left out" in text for text in events)
        assert right < 1.2 * without


def test_it_is_tried_again_and_the_wind_learned_anew(simulator):
    """An airspeed that is right again after 20 s: it is left out until 60 s after it contradicted, and the
    wind is then as unknown as at the start."""
    recording, start, wind = flown(simulator, 0, ("true-airspeed",))
    airspeed = recording.sources[-1]
    doubled = np.where(airspeed.t[:, None] < 20.0, 2.0, 1.0) * airspeed.y
    wrong = replace(airspeed, y=doubled, gate=None)
    solution = sd.fuse(replace(recording, sources=(*recording.sources[:-1], wrong)), start=start)
    (text,) = (text for _, text in solution.events if "true-airspeed: left out" in text)
    until = float(text.split("until ")[1].split(" s")[0])
    assert 60.0 < until < 80.0
    std = np.max([solution.columns[f"std of {each}"] for each in NAMES], axis=0)
    again = np.searchsorted(solution.t, until + 0.3)
    assert 5.0 < std[again] < 11.0 and std[-1] < 2.0
    for k, each in enumerate(NAMES):
        last = solution.columns[f"std of {each}"][-1]
        assert abs(solution.columns[each][-1] - wind[-1, k]) < 4 * last


def test_a_constraint_holds_its_value_and_is_not_frozen(simulator):
    recording, start = simulator.run("consumer", 1)
    t = np.arange(1.0, 119.0, 0.2)
    still = Source("zero-side-slip", t, np.zeros((len(t), 1)), np.full((len(t), 1), 30.0))
    sources = (*recording.sources, still)
    solution = sd.fuse(replace(recording, sources=sources), start=start)
    assert not any("frozen" in text for _, text in solution.events)


def test_a_scenario_blows_its_wind():
    """A simulated sensor of each kind sees the states that the scenario gives."""
    wind = (6.0, -4.0)
    sensors = [
        Simulated(kind, 0.01, 5.0, states=wind)
        for kind in ("true-airspeed", "indicated-airspeed", "side-slip", "angle-of-attack")
    ]
    recording = sd.simulate(SCENARIO, sensors=sensors, seed=2)
    truth, (speed, *_) = recording.reference, recording.sources[1:]
    rows = np.searchsorted(truth.t, speed.t - 1e-6)
    expected = np.linalg.norm(truth.v_n[rows] - [*wind, 0], axis=1)
    assert np.abs(speed.y[:, 0] - expected).max() < 0.06
    solution = sd.fuse(recording)
    for each, blown in zip(NAMES, wind):
        assert abs(solution.columns[each][-1] - blown) < 1.0
    with pytest.raises(DataError, match="1 states; kind true-airspeed brings north .m/s., east"):
        Simulated("true-airspeed", 0.01, states=(1.0,))


def test_a_wind_that_is_learned_anew_is_smoothed(simulator):
    """Back to the instant at which it was forgotten, and position and velocity across it."""
    recording, start, wind = flown(simulator, 0, ("true-airspeed",))
    airspeed = recording.sources[-1]
    doubled = np.where(airspeed.t[:, None] < 20.0, 2.0, 1.0) * airspeed.y
    wrong = replace(airspeed, y=doubled, gate=None)
    recording = replace(recording, sources=(*recording.sources[:-1], wrong))
    filtered, smoothed = (run(recording, start=start) for run in (sd.fuse, sd.smooth))
    rows = np.searchsorted(recording.reference.t, smoothed.t - 1e-6)
    again = smoothed.t > 64.0
    for k, each in enumerate(NAMES):
        std = smoothed.columns[f"std of {each}"]
        assert (std[again] <= filtered.columns[f"std of {each}"][again] * 1.001).all()
        off = np.abs(smoothed.columns[each] - wind[rows, k])
        assert (off < 4 * std)[again].all()
    across = (smoothed.t > 55.0) & (smoothed.t < 70.0)
    e = sd.errors(smoothed, recording.reference).velocity[across]
    assert (np.abs(e) < 4 * smoothed.trajectory.std[across, 3:6]).all()


def test_a_vertical_wind_is_found_and_smoothed_where_it_is_asked_for(simulator):
    """By an airspeed and an angle of attack, in air that sinks by 2 m/s; without the state the error is in
    the angle, of 2 deg. One state of both, whoever asks."""
    recording, start = simulator.run("industrial", 3)
    truth, rng = recording.reference, np.random.default_rng(3)
    air = Rotation.from_wxyz(truth.q_nb).inv().apply(truth.v_n - [3.0, -2.0, 2.0])
    rows = slice(5, None, 5)
    made = []
    for kind, y, std in (
        ("true-airspeed", np.linalg.norm(air, axis=1), 1.0),
        ("angle-of-attack", np.arctan2(air[:, 2], air[:, 0]), 0.01),
    ):
        y = y[rows, None] + std * rng.standard_normal((len(truth.t[rows]), 1))
        made.append(Source(kind, truth.t[rows], y, np.full(y.shape, std), gate=np.inf))
    asked = [made[0], replace(made[1], estimate={"vertical-wind": (3.0,)})]
    every = replace(recording, sources=(*recording.sources, *asked))
    assert [each.name for each in augmented_states(asked)] == [*NAMES, "wind down [m/s]"]
    assert merge(asked).sources["states"].tolist() == [3, 3]
    assert merge(made).sources["states"].tolist() == [2, 2]
    for run in (sd.fuse, sd.smooth):
        solution = run(every, start=start)
        std = solution.columns["std of wind down [m/s]"][-1]
        assert std < 0.6 and abs(solution.columns["wind down [m/s]"][-1] - 2.0) < 4 * std
    assert (
        "wind down [m/s]"
        not in sd.fuse(replace(every, sources=(*recording.sources, *made)), start=start).columns
    )
