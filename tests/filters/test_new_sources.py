"""Gravity, magnetic field, barometers and mean sea level with every filter that has a position:
what they are worth, their own states, streams and chunks."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES, Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine import prepare as preparation
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.sensor_models.atmosphere import standard_pressure
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import moored_vessel
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion, increments, sample, static

PLACE = (48 * DEG, 11 * DEG, 500.0)
FIELD = (21e-6, 1.5e-6, 43e-6)  # T, NED
POSITIONED = (
    "closed-loop",
    "mekf",
    "iekf",
    "eqf",
    "closed-loop-error-bias",
    "open-loop",
    "periodic-reset",
)
SPEC = ImuSpec(
    "white MEMS", Triad(noise=3e-4, turn_on_bias=1e-4), Triad(noise=3e-3, turn_on_bias=5e-3)
)
RATE, DURATION = 20, 60
DEVIATION = np.r_[[1.0] * 3, [0.2] * 3, np.radians([0.5, 0.5, 5.0]), [5e-3] * 3, [1e-4] * 3]


def hover(heading=0.7):
    """In one place, but for slow metres to and fro."""
    sway = lambda t, period: 0.3 * np.sin(2 * np.pi * t / period)
    return Motion(
        "hover",
        PLACE,
        lambda t: (sway(t, 11.0), sway(t, 17.0), sway(t, 13.0)),
        lambda t: (0.02 * np.sin(t), 0.03 * np.cos(t), heading + 0 * t),
    )


class Flight:
    """A motion with its ideal IMU, and drawn runs of it."""

    def __init__(self, motion, duration=DURATION):
        self.t = np.arange(duration * RATE + 1) / RATE
        self.truth, self.ideal = sample(motion, self.t), increments(motion, self.t)

    def drawn(self, seed, *sources, deviation=DEVIATION, gnss=Gnss(velocity_std=None)):
        """(recording, start, true accelerometer bias) with the sources made by functions of
        (truth, rng)."""
        of_imu, of_start, of_gnss, *of_others = np.random.default_rng(seed).spawn(3 + len(sources))
        imu, b_a, _ = SPEC.corrupt(self.ideal, of_imu)
        sources = (
            *(gnss.fixes(self.truth, of_gnss) if gnss else ()),
            *(make(self.truth, rng) for make, rng in zip(sources, of_others)),
        )
        return (
            Recording(
                imu,
                tuple(replace(a, gate=np.inf) for a in sources),
                self.truth,
                {"grade": "consumer"},
            ),
            draw_start(self.truth, deviation, of_start),
            b_a,
        )


@pytest.fixture(scope="module")
def flight():
    return Flight(hover())


def barometer(bias=80.0, rate=5.0, quantity="pressure", walk=0.1, name="pressure", **more):
    """A barometer whose zero is off by `bias` m and walks by `walk` m/sqrt(s), as the filters
    take it to."""

    def make(truth, rng):
        made = Barometer(rate=rate, quantity="height", std=6.0, **more).measure(truth, rng)
        make.bias = bias + np.cumsum(rng.normal(0, walk / np.sqrt(rate), len(made.t)))  # true, m
        y = made.y + make.bias[:, None]
        return replace(
            made,
            name=name,
            **{"y": y} if quantity == "height" else {"kind": "pressure", "y": standard_pressure(y)},
        )

    return make


def compass(truth, rng):
    return Magnetometer(rate=10.0, std=0.5e-6, field=FIELD).measure(truth, rng)


def constraint(kind, rate, deviation, level=0.0):
    """A constraint at a rate, m or m/s^2."""
    rows = 3 if kind == "gravity" else 1

    def make(truth, rng):
        t = np.arange(1, truth.t[-1] * rate + 0.5) / rate
        return Source(kind, t, np.full((len(t), rows), level), np.full((len(t), rows), deviation))

    return make


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("name", POSITIONED)
def test_the_bias_of_a_barometer_is_found(flight, name):
    recording, start, _ = flight.drawn(1, barometer(bias=80.0))
    solution = sd.fuse(recording, name, start=start, noise=SPEC.noise())
    assert list(solution.columns)[-2:] == ["pressure bias [m]", "std of pressure bias [m]"]
    found, deviation = (
        solution.columns["pressure bias [m]"],
        solution.columns["std of pressure bias [m]"],
    )
    assert deviation[0] > 50 and deviation[-1] < 1.0
    assert abs(found[-1] - 80.0) < 3 * np.hypot(deviation[-1], 0.1 * np.sqrt(DURATION))
    with_it, without = (
        rms(sd.errors(s, flight.truth).position[400:, 2])
        for s in (
            solution,
            sd.fuse(
                replace(recording, sources=recording.sources[:1]),
                name,
                start=start,
                noise=SPEC.noise(),
            ),
        )
    )
    assert with_it < 1.05 * without
    assert solution.covariance is None and solution.trajectory.std.shape[1] == STATES


@pytest.mark.deep
@pytest.mark.parametrize("name", ["closed-loop", "open-loop"])
@pytest.mark.parametrize("quantity", ["pressure", "height"])
def test_the_sixteenth_state_errs_as_its_variance_says(flight, name, quantity):
    """50 seeds; the normalised squared error of the bias at the end is chi-square of 50: outside
    the band once in 1000 times."""
    nees, label = [], "pressure bias [m]"
    for seed in range(50):
        source = barometer(bias=np.random.default_rng(seed).normal(0, 150.0), quantity=quantity)
        recording, start, _ = flight.drawn(seed, source)
        solution = sd.fuse(recording, name, start=start, noise=SPEC.noise(), every=RATE)
        nees.append(
            (
                (source.bias[-1] - solution.columns[label][-1])
                / solution.columns[f"std of {label}"][-1]
            )
            ** 2
        )
    low, high = chi2(50).ppf([0.0005, 0.9995])
    assert low < np.sum(nees) < high


@pytest.mark.parametrize("name", POSITIONED)
def test_a_magnetic_field_gives_a_hovering_vehicle_its_heading(flight, name):
    recording, start, _ = flight.drawn(2, compass)
    with_field, without = (
        sd.fuse(replace(recording, sources=a), name, start=start, noise=SPEC.noise())
        for a in (recording.sources, recording.sources[:1])
    )
    e = sd.errors(with_field, flight.truth)
    late = e.t > 20
    assert (
        rms(e.rph[late, 2]) < 0.6 * DEG
        and e.std[late, 8].max() < 0.6 * DEG
        and (np.abs(e.attitude[late]) < 5 * e.std[late, 6:9]).all()
    )
    assert without.trajectory.std[-1, 8] > 1.0 * DEG and rms(
        sd.errors(without, flight.truth).rph[late, 2]
    ) > 2 * rms(e.rph[late, 2])


@pytest.mark.parametrize("name", POSITIONED)
def test_gravity_levels_at_rest(name):
    rest = Flight(static(PLACE, rph=(0.02, -0.03, 0.4)), 30)
    coarse = DEVIATION * np.r_[np.ones(6), 6, 6, np.ones(7)]
    recording, start, _ = rest.drawn(3, constraint("gravity", 10.0, 0.02), deviation=coarse)
    solution = sd.fuse(recording, name, start=start, noise=SPEC.noise())
    e = sd.errors(solution, rest.truth)
    assert np.abs(e.attitude[-1, :2]).max() < 3e-3 and np.abs(e.attitude[0, :2]).max() > 5e-3
    assert (np.abs(e.attitude[-1]) < 4 * e.std[-1, 6:9]).all()


@pytest.mark.parametrize("name", POSITIONED)
def test_mean_sea_level_holds_the_height(name):
    """Without any vertical position: the height stays about the level, within the deviation that
    it was given."""
    vessel = Flight(moored_vessel(PLACE, heave=0.5, roll=1 * DEG, pitch=1 * DEG), 120)
    recording, start, _ = vessel.drawn(4, constraint("zero-sea-level", 1.0, 1.5, level=500.0))
    gnss, *others = recording.sources
    recording = replace(recording, sources=(replace(gnss, y=gnss.y * [1, 1, np.nan]), *others))
    solution, free = (
        sd.fuse(replace(recording, sources=a), name, start=start, noise=SPEC.noise())
        for a in (recording.sources, recording.sources[:1])
    )
    e = sd.errors(solution, vessel.truth)
    assert (
        rms(e.position[1200:, 2]) < 0.5
        and (np.abs(e.position[1200:, 2]) < 4 * e.std[1200:, 2]).all()
    )
    assert free.trajectory.std[-1, 2] > 3 * solution.trajectory.std[-1, 2]


def everything(flight, seed=5, seconds=10):
    """A short recording with all that is new, two barometers among it."""
    recording, start, _ = flight.drawn(
        seed,
        barometer(name="left"),
        barometer(bias=-30.0, quantity="height", name="right", lever_arm=(1.0, 2.0, 0.5)),
        compass,
        constraint("gravity", 4.0, 0.5),
        constraint("zero-sea-level", 1.0, 5.0, level=500.0),
    )
    imu = Imu(*(column[: seconds * RATE] for column in recording.imu))
    return replace(
        recording, imu=imu, sources=tuple(a.between(0.0, float(seconds)) for a in recording.sources)
    ), start


@pytest.mark.parametrize("name", POSITIONED)
def test_a_stream_with_states_of_its_own_is_the_batch_bit_for_bit(flight, name):
    recording, start = everything(flight)
    solution = sd.fuse(recording, name, start=start, noise=SPEC.noise(), covariance=True)
    assert solution.covariance.shape[1:] == (17, 17)
    names = ["left bias [m]", "right bias [m]"]
    assert list(solution.columns)[-4:] == [*names, *(f"std of {each}" for each in names)]
    stream = Stream(name, start=start, noise=SPEC.noise(), sources=recording.sources)
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
    last, path = stream.finish(), solution.trajectory
    for part, row in zip(
        (last.lla, last.v_n, last.b_a, last.b_g), (path.lla, path.v_n, solution.b_a, solution.b_g)
    ):
        assert np.array_equal(part, row[-1])
    assert np.array_equal(last.P, solution.covariance[-1]) and last.augmented.tolist() == [
        solution.columns[each][-1] for each in names
    ]


@pytest.mark.parametrize("name", POSITIONED)
def test_a_run_in_chunks_is_one_run(flight, name, monkeypatch):
    recording, start = everything(flight)
    whole = sd.fuse(recording, name, start=start, noise=SPEC.noise(), covariance=True)
    monkeypatch.setattr(preparation, "ROWS_AT_ONCE", 17)
    parts = sd.fuse(recording, name, start=start, noise=SPEC.noise(), covariance=True)
    assert np.array_equal(whole.covariance, parts.covariance) and all(
        np.array_equal(whole.columns[each], parts.columns[each]) for each in whole.columns
    )
    assert np.array_equal(whole.innovations.nis, parts.innovations.nis)


def test_two_barometers_agree_on_the_height(flight):
    """Each has a bias of its own, and its own walk."""
    recording, start, _ = flight.drawn(
        6, barometer(bias=60.0, name="left"), barometer(bias=-90.0, quantity="height", name="right")
    )
    solution = sd.fuse(recording, start=start, noise=SPEC.noise())
    for name, bias in (("left", 60.0), ("right", -90.0)):
        label = f"{name} bias [m]"
        assert abs(solution.columns[label][-1] - bias) < 3 * np.hypot(
            solution.columns[f"std of {label}"][-1], 0.1 * np.sqrt(DURATION)
        )


def test_thirty_states_beyond_are_the_most(flight):
    def several(count):
        recording, start, _ = flight.drawn(
            7, *(barometer(name=f"baro {k}", rate=1.0) for k in range(count))
        )
        return sd.fuse(recording, start=start, noise=SPEC.noise(), every=RATE)

    solution = several(30)
    assert (
        sum(name.startswith("baro") for name in solution.columns) == 30
        and np.isfinite(solution.trajectory.lla).all()
    )
    with pytest.raises(
        DataError,
        match="there are 31 states in addition to the filter's own, the last is 'baro 30 bias .m.'; at most 30",
    ) as error:
        several(31)
    assert "\n" not in str(error.value)
