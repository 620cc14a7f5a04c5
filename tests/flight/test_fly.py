"""Flights in the loop: the filter is the house's own bit for bit, the sensors are the library's,
estimation error moves the aircraft."""

import copy
import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.filters import find
from strapdown.flight.aircraft_model.parameters import aircraft
from strapdown.flight.asked import DECIDED, Loop, Sensors, World, records
from strapdown.flight.plan import DEFAULT_PLACE, RAD_PER_DEG as DEG, FlightPlan, straight, turning
from strapdown.flight.run_flight import LOG, fly
from strapdown.flight.sensor_errors import barometer_errors, outage_windows
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sensor_models.streams import RandomStream

IDEAL = ImuSpec("ideal", Triad(), Triad())
EXACT = Gnss(interval=0.2, position_std=1e-4, velocity_std=1e-5)
SURE = (1e-4,) * 3 + (1e-5,) * 3 + (1e-6,) * 3 + (0.0,) * 6


def by_name(**given):
    """`fly` with fields of its records by their names."""
    fields = {name: value for name, value in given.items() if name in DECIDED}
    return fly(**{name: given[name] for name in given if name not in DECIDED} | records(**fields))


def same(one, other):
    """Whether two Solutions are equal, bit for bit."""
    parts = lambda s: (
        s.trajectory.t,
        s.trajectory.lla,
        s.trajectory.v_n,
        s.trajectory.q_nb,
        s.trajectory.std,
        s.b_a,
        s.b_g,
        s.status,
        s.innovations.t,
        s.innovations.source,
        s.innovations.innovation,
        s.innovations.nis,
        s.innovations.accepted,
        np.zeros(0) if s.covariance is None else s.covariance,
    )
    return all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
        for a, b in zip(parts(one), parts(other))
    )


def off_truth(flight):
    """(n, 3) m NED: truth - estimate at the rows of the solution."""
    n = len(flight.solution.t)
    return displacement(flight.recording.reference.lla[1 : n + 1], flight.solution.trajectory.lla)


@pytest.mark.short
def test_fuse_on_the_recording_gives_the_flights_solution():
    flight = fly("straight", duration=2.0)
    solution = sd.fuse(flight.recording, "closed-loop", start=flight.start)
    assert same(flight.solution, solution) and flight.solution.events == solution.events
    assert flight.solution.meta == solution.meta | {"filter_options": {}}
    assert len(flight.recording.reference) == 201 and [
        len(a.t) for a in flight.recording.sources
    ] == [10, 10]


@pytest.mark.parametrize("filter", ["closed-loop", "open-loop"])
def test_fuse_gives_it_with_everything_at_once(filter):
    """Fixes inside samples, late, from a lever arm; an outage, wind, gusts, the whole
    covariance."""
    gnss = Gnss(interval=0.333, lever_arm=(0.3, 0.1, -0.5), latency=0.055)
    flight = fly(
        "turning",
        filter,
        duration=30.0,
        seed=4,
        world=World(wind=(3, -2, 0), turbulence="light"),
        sensors=Sensors(outage=[(12, 18.5)], gnss=gnss),
        loop=Loop(covariance=True),
    )
    solution = sd.fuse(flight.recording, filter, start=flight.start, covariance=True)
    assert same(flight.solution, solution) and flight.solution.covariance.shape == (3000, 15, 15)
    taken = flight.recording.sources[0].t - 0.055
    assert not np.any((taken >= 12) & (taken < 18.5)) and np.any(taken > 18.5)


def test_a_filters_own_seed_comes_from_the_flights():
    """Each seed draws other components, and what was handed over repeats the flight bit for bit;
    sensors and air do not notice."""
    flights = [
        fly("straight", "pkf", duration=2.0, components=3, seed=seed, loop=Loop(feedback="truth"))
        for seed in (4, 5)
    ]
    plain = fly("straight", duration=2.0, seed=4, loop=Loop(feedback="truth"))
    assert (
        np.array_equal(flights[0].recording.imu.dv, plain.recording.imu.dv)
        and flights[0].start == plain.start
    )
    for flight in flights:
        given = flight.recording.meta["filter_options"]
        assert (
            set(given) == {"components", "seed"} and given == flight.solution.meta["filter_options"]
        )
        assert same(
            flight.solution, sd.fuse(flight.recording, "pkf", start=flight.start, options=given)
        )
    one, other = (flight.recording.meta["filter_options"]["seed"] for flight in flights)
    assert one != other and not same(
        flights[0].solution,
        sd.fuse(
            flights[0].recording,
            "pkf",
            start=flights[0].start,
            options={"components": 3, "seed": other},
        ),
    )


@pytest.mark.short
def test_a_filter_gets_what_is_flown():
    """Options called aircraft, rate and earth are the flight's; one bound beforehand stays, for
    a wrong model on purpose."""
    got, closed = [], find("closed-loop")

    def start(start, noise, gain=1.0, rate=1.0, aircraft="aerosonde", earth="geodetic"):
        got.append((gain, rate, aircraft, earth))
        return closed.start(start, noise)

    heavy = aircraft("aerosonde").replace("heavy", mass=12.0)
    flight = fly(
        "straight",
        closed._replace(start=start),
        duration=1.0,
        gain=2.0,
        world=World(aircraft=heavy, earth="flat"),
        sensors=Sensors(rate=50.0),
    )
    fly(
        "straight",
        closed._replace(start=partial(start, aircraft="aerosonde")),
        duration=1.0,
        world=World(aircraft=heavy),
    )
    sd.fuse(
        flight.recording,
        closed._replace(start=start),
        start=flight.start,
        options=flight.recording.meta["filter_options"],
    )
    assert got == [
        (2.0, 50.0, heavy, "flat"),
        (1.0, 100.0, "aerosonde", "geodetic"),
        (2.0, 50.0, heavy, "flat"),
    ]
    assert (
        "flat and still" in flight.solution.meta["notes"][-1] and not flight.recording.meta["notes"]
    )


@pytest.mark.short
@pytest.mark.parametrize("quantity, size", [("height", 0.01), ("pressure", 0.1)])
def test_a_barometer_is_the_librarys(quantity, size):
    """Against `Barometer` on the flown trajectory, without noise to speak of: m or Pa; beside
    late fixes; and `fuse` takes it the same way."""
    barometer = Barometer(
        rate=10.0, quantity=quantity, std=1e-5, bias=50.0, zero=40.0, lever_arm=(1.0, 0.0, -2.0)
    )
    plan = FlightPlan("up", ((0, 0, 40), (2000, 0, 40)))
    flight = fly(
        plan,
        duration=8.0,
        seed=3,
        sensors=Sensors(barometer=barometer, gnss=Gnss(interval=0.2, latency=0.055), outage="6:"),
    )
    own, expected = (
        flight.recording.sources[2],
        barometer.measure(flight.recording.reference, np.random.default_rng(0)),
    )
    assert (
        own.kind == expected.kind
        and np.array_equal(own.t, expected.t)
        and own.y.shape == expected.y.shape
        and own.t[-1] == 8.0
    )
    assert np.abs(own.y - expected.y).max() < size and np.ptp(own.y[:, 0]) > 100 * size
    assert np.array_equal(own.std, np.full_like(own.std, own.std[0])) and own.std[
        0
    ] == pytest.approx(expected.std[0], rel=1e-3)
    assert same(flight.solution, sd.fuse(flight.recording, start=flight.start))
    without, beside = (
        fly(
            plan,
            duration=2.0,
            sensors=Sensors(gnss=Gnss(interval=0.2, latency=0.055), barometer=b),
            loop=Loop(feedback="truth"),
        )
        for b in (None, barometer)
    )
    assert np.array_equal(without.recording.sources[0].y, beside.recording.sources[0].y)


def test_errors_of_a_barometer_are_as_stated():
    """White noise and weather: their standard deviations in Pa, within the bands of 4 of their
    own standard deviations."""
    wet, t = Barometer(rate=20.0, std=4.0, drift=100.0, drift_time=0.02), np.arange(1, 10_001) / 20
    both, white = (
        barometer_errors(b, t, 500.0, np.random.SeedSequence(1)).errors[0][:, 0]
        for b in (wet, replace(wet, drift=0.0))
    )
    assert (
        both.std() == pytest.approx(np.hypot(4.0, 100.0), rel=4 * 0.01)
        and abs(both.mean()) < 4 * 1.2
    )
    assert white.std() == pytest.approx(4.0, rel=4 / np.sqrt(2 * 10_000))


@pytest.mark.short
def test_a_seed_repeats_and_another_one_does_not():
    flights = [
        fly("straight", duration=2.0, seed=seed, world=World(turbulence="light"))
        for seed in (3, 3, 4)
    ]
    logs = [np.stack(list(flight.log.values())) for flight in flights]
    assert np.array_equal(logs[0], logs[1]) and same(flights[0].solution, flights[1].solution)
    assert not np.array_equal(logs[0], logs[2])
    assert (
        list(flights[0].log) == ["t, s", *LOG]
        and flights[0].start == flights[1].start != flights[2].start
    )


@pytest.mark.short
def test_filters_of_one_seed_meet_the_same_errors():
    """On the truth the aircraft flies alike for each filter, so IMU and fixes are equal; and
    their errors do not depend on the flight either."""
    one, other = (
        fly("straight", filter, duration=3.0, seed=5, loop=Loop(feedback="truth"))
        for filter in ("closed-loop", "open-loop")
    )
    assert np.array_equal(one.recording.imu.dv, other.recording.imu.dv) and np.array_equal(
        one.recording.sources[0].y, other.recording.sources[0].y
    )
    elsewhere = fly("turning", "open-loop", duration=3.0, seed=5)
    errors = [
        np.c_[
            displacement(a.y, f.recording.reference.lla[20::20]),
            b.y - f.recording.reference.v_n[20::20],
        ]
        for f in (one, elsewhere)
        for a, b in [f.recording.sources]
    ]
    assert np.abs(errors[0] - errors[1]).max() < 1e-6 and np.abs(errors[0]).max() > 0.5


@pytest.mark.short
def test_imu_errors_are_those_of_the_spec():
    """All terms at once against `ImuSpec.corrupt` of the ideal increments from the same stream."""
    gyro = Triad(1e-4, 1e-3, 1e-5, 1e-3, 50.0, 1e-4, 1e-2, 5e-3, 1e-4, 2e-5, 0.08)
    accel = Triad(1e-3, 0.05, 1e-4, 0.01, 50.0, 1e-3, 1e-2, 5e-3, 0.0, 1e-3, 10.5)
    bad = ImuSpec("bad", gyro, accel)
    plan = FlightPlan("bend", ((0, 0, 0), (120, 0, 20), (120, 300, 20)), 25.0, duration=5.0)
    ideal, flown = (
        fly(
            plan, seed=11, sensors=Sensors(imu=spec), loop=Loop(feedback="truth", start_std=SURE)
        ).recording
        for spec in (IDEAL, bad)
    )
    expected, b_a, b_g = bad.corrupt(ideal.imu, RandomStream.of(11).child("imu"))
    at_stop = np.isclose(np.abs(expected.dv), 10.5 * 0.01).sum()
    assert at_stop > 5 and "saturated" in " ".join(flown.meta["notes"])
    assert (
        np.abs(flown.imu.dtheta - expected.dtheta).max() < 1e-12
        and np.abs(flown.imu.dv - expected.dv).max() < 1e-12
    )
    assert np.array_equal(flown.meta["b_a"], b_a) and np.array_equal(flown.meta["b_g"], b_g)


def test_fixes_are_those_of_the_receiver():
    """Against `Gnss` on the flown trajectory from the same stream: at samples exact, between
    them to the curvature within a sample."""
    for gnss, metres, speeds in (
        (Gnss(interval=0.2), 1e-7, 1e-12),
        (Gnss(interval=0.333, lever_arm=(0.5, -0.3, -1.0), latency=0.055), 5e-4, 5e-3),
    ):
        recording = fly(
            "turning", duration=20.0, seed=2, sensors=Sensors(gnss=gnss, outage="15:17")
        ).recording
        expected = gnss._replace(outages=((15, 17),)).fixes(
            recording.reference, RandomStream.of(2).child("gnss")
        )
        for mine, theirs in zip(recording.sources, expected):
            assert (
                np.array_equal(mine.t, theirs.t)
                and np.array_equal(mine.std, theirs.std)
                and mine.parameters == theirs.parameters
            )
        assert np.abs(displacement(recording.sources[0].y, expected[0].y)).max() < metres
        assert np.abs(recording.sources[1].y - expected[1].y).max() < speeds


def test_ideal_sensors_and_their_ins_agree_with_the_truth():
    """An INS without errors and without fixes stays on the flown truth: the increments belong to
    it."""
    flight = fly(
        "turning",
        duration=30.0,
        sensors=Sensors(imu=IDEAL, outage="0.1:"),
        loop=Loop(start_std=(0.0,) * 15),
    )
    assert np.abs(off_truth(flight)).max() < 5e-3
    turned = (
        Rotation.from_quat(flight.solution.trajectory.q_nb[:, [1, 2, 3, 0]]).inv()
        * flight.recording.reference.rotation[1:]
    )
    assert turned.magnitude().max() < 1e-5


def test_estimates_move_the_aircraft():
    """With perfect sensors flights on estimate and truth agree; with real ones they part; and in
    an outage the aircraft's error is its estimate's."""
    on_truth = fly("turning", duration=20.0, loop=Loop(feedback="truth"))
    perfect = fly(
        "turning", duration=20.0, sensors=Sensors(imu=IDEAL, gnss=EXACT), loop=Loop(start_std=SURE)
    )
    real = fly("turning", duration=20.0)
    apart = lambda flight: np.abs(
        displacement(flight.recording.reference.lla, on_truth.recording.reference.lla)
    ).max()
    assert apart(perfect) < 0.02 and apart(real) > 0.3
    lost = fly(
        straight(higher=0.0, faster=0.0), duration=60.0, seed=1, sensors=Sensors(outage="15:")
    )
    error = off_truth(lost)  # of 16 seeds 35 m rms, and of 11 above 10 m
    assert np.abs(error[-1, 1]) > 10.0  # the course is north
    assert (
        abs(lost.log["right of route, m"][-1] - error[-1, 1]) < 2.0
        and abs(-lost.log["above route, m"][-1] - error[-1, 2]) < 2.0
    )


def test_log_is_consistent_with_the_truth():
    """Newton along the body axes and the flow angles, from the columns of the log, on the flat
    Earth."""
    flight = fly(
        "turning",
        duration=20.0,
        world=World(earth="flat", wind=(2.0, 1.0, 0.0), turbulence="light"),
        loop=Loop(feedback="truth"),
    )
    log, truth, craft = flight.log, flight.recording.reference, aircraft("aerosonde")
    column = lambda *names: np.stack([log[name] for name in names], axis=1)
    force = truth.rotation[1:].apply(column("Fx, N", "Fy, N", "Fz, N")) / craft["mass"]
    acceleration = (truth.v_n[2:] - truth.v_n[:-2]) / 0.02
    apart = acceleration - force[:-1] - [0, 0, 9.807]
    # gusts step from sample to sample
    assert np.abs(apart[:, :2]).max() < 1.0 and np.abs(np.mean(apart, axis=0)).max() < 0.02
    air = (
        truth.rotation[1:]
        .inv()
        .apply(truth.v_n[1:] - column("wind north, m/s", "wind east, m/s", "wind down, m/s"))
    )
    assert log["airspeed, m/s"] == pytest.approx(np.linalg.norm(air, axis=1))
    assert log["angle of attack, rad"] == pytest.approx(np.arctan2(air[:, 2], air[:, 0]))
    over_ground = truth.rotation[1:].inv().apply(truth.v_n[1:].copy())
    assert column("u, m/s", "v, m/s", "w, m/s") == pytest.approx(over_ground)


@pytest.mark.short
@pytest.mark.parametrize(
    "name, cause, arguments",
    [
        (
            "ground",
            "hit the ground",
            dict(
                plan=FlightPlan("low", ((0, 0, -20), (900, 0, -20)), clearance=5.0),
                duration=8.0,
                feedback="truth",
            ),
        ),
        (
            "stall",
            "was stalled for 1 s",
            dict(
                plan=straight(0.0, 0.0),
                told_wind=(-14.0, 0.0, 0.0),
                duration=12.0,
                feedback="truth",
                aircraft=aircraft("aerosonde").replace(stall_alpha=0.12),
            ),
        ),
        (
            "filter",
            "the filter diverged or left",
            dict(plan=straight(place=(88.9998 * DEG, 0.2, 500.0)), duration=4.0, feedback="truth"),
        ),
    ],
)
def test_flights_that_diverge_stop_with_state_and_cause(name, cause, arguments):
    flight = by_name(**arguments)
    assert (
        cause in flight.stopped.cause
        and flight.stopped.state.shape == (17,)
        and cause in str(flight)
    )
    assert 0.1 < flight.stopped.t < arguments["duration"]
    rows = round(100 * flight.stopped.t)
    assert (
        len(flight.recording.imu.t) == len(flight.log["t, s"]) == rows
        and len(flight.recording.reference) == rows + 1
    )
    assert flight.stopped.t == flight.recording.imu.t[-1] and np.allclose(
        flight.stopped.state[0:3], flight.recording.reference.lla[-1]
    )
    assert flight.solution.meta["stopped"] and any(
        cause in text for _, text in flight.solution.events
    )
    assert any(cause in note for note in flight.recording.meta["notes"])
    assert len(flight.solution.t) == rows - (name == "filter")
    assert same(flight.solution, sd.fuse(flight.recording, start=flight.start))


@pytest.mark.short
def test_a_wrong_attitude_loses_the_aircraft():
    start = fly("straight", duration=0.1, sensors=Sensors(imu="industrial")).start
    flight = fly("straight", duration=5.0, loop=Loop(start=start._replace(rph=(2.0, 0.0, 0.0))))
    assert "upside down" in flight.stopped.cause and flight.start.rph[0] == 2.0


def test_the_model_predicts_while_the_receiver_is_cut():
    """Calm air, ideal sensors, exact start: the pseudo-increments are the aircraft's own to the
    error of the belief; the filter is told their noise."""
    common = dict(
        plan=turning(), duration=16.0, sensors=Sensors(outage="11:", imu=IDEAL, gnss=EXACT)
    )
    imu, model = (
        fly(loop=Loop(start_std=SURE, prediction=by), **common) for by in ("imu", "model")
    )
    cut = model.log["model predicts"] == 1
    assert (
        cut.sum() == 500
        and not imu.log["model predicts"].any()
        and model.log["t, s"][cut][0] == pytest.approx(11.01)
    )
    assert "500 IMU samples are those of the aircraft's model" in model.recording.meta["notes"][0]
    # in a turn
    assert (
        np.array_equal(imu.recording.imu.dv[~cut], model.recording.imu.dv[~cut])
        and abs(model.log["r, rad/s"][1100]) > 0.15
    )
    assert np.abs(imu.recording.imu.dtheta[cut] - model.recording.imu.dtheta[cut]).max() < 1e-4
    assert (
        np.abs(imu.recording.imu.dv[cut] - model.recording.imu.dv[cut]).max() < 2e-3
        and np.abs(off_truth(model)).max() < 0.5
    )
    sure = fly(
        loop=Loop(
            start_std=SURE, prediction="model", model_noise=Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        ),
        **common,
    )
    assert model.solution.trajectory.std[-1, 3] > 0.1 > sure.solution.trajectory.std[-1, 3]


@pytest.mark.short
def test_the_beliefs_biases_are_in_the_models_increments():
    """A filter that is sure of wrong biases takes them off again: what is left of the
    pseudo-increments is the aircraft's force and rate."""
    start = fly(
        "straight", duration=0.1, sensors=Sensors(imu=IDEAL), loop=Loop(start_std=(0.0,) * 15)
    ).start._replace(b_a=(0.3, -0.2, 0.1), b_g=(2e-3, -1e-3, 1e-3))
    flight = fly(
        straight(higher=0.0, faster=0.0),
        duration=3.0,
        world=World(earth="flat"),
        sensors=Sensors(outage="0:", imu=IDEAL),
        loop=Loop(start=start, prediction="model"),
    )
    cut, log, imu = flight.log["model predicts"] == 1, flight.log, flight.recording.imu
    force = (
        np.stack([log[name] for name in ("Fx, N", "Fy, N", "Fz, N")], axis=1)
        / aircraft("aerosonde")["mass"]
    )
    rates = np.stack([log[name] for name in ("p, rad/s", "q, rad/s", "r, rad/s")], axis=1)
    assert cut.all() and (imu.dv / 0.01 - force).mean(axis=0) == pytest.approx(start.b_a, abs=2e-3)
    assert (imu.dtheta / 0.01 - rates).mean(axis=0) == pytest.approx(start.b_g, abs=1e-4)


@pytest.mark.short
def test_a_filter_can_be_told_the_controls():
    """workspace[inputs : inputs + 9] of a filter whose workspace has nine numbers more; its
    samples stay the IMU's."""
    held, closed = [], find("closed-loop")

    def start(start, noise):
        belief = closed.start(start, noise)
        belief = belief._replace(workspace=np.zeros(belief.workspace.size + 9))
        belief.workspace[: closed.start(start, noise).workspace.size] = closed.start(
            start, noise
        ).workspace
        held.append(belief)
        return belief

    first = closed.slots.size
    cut = dict(duration=3.0, sensors=Sensors(outage="2:"), world=World(wind=(1.0, 2.0, 0.0)))
    flight = fly(
        "straight",
        closed._replace(name="told", start=start),
        loop=Loop(prediction="model", inputs=first),
        **cut,
    )
    workspace, log = held[0].workspace[first : first + 9], flight.log
    middle = [
        0.5 * (log[name][-1] + log[name][-2])
        for name in ("elevator, rad", "aileron, rad", "rudder, rad", "throttle")
    ]
    assert workspace == pytest.approx([1.0, *middle, 1.0, 2.0, 0.0, 0.01])
    plain = fly("straight", **cut)
    assert np.array_equal(plain.recording.imu.dv, flight.recording.imu.dv) and same(
        plain.solution, flight.solution
    )


@pytest.mark.short
def test_flights_on_the_flat_earth_and_with_a_start_of_ones_own():
    flight = fly(
        "straight",
        duration=2.0,
        world=World(earth="flat"),
        loop=Loop(feedback="truth", start_std=(0.0,) * 15),
    )
    assert flight.start.lla == pytest.approx(DEFAULT_PLACE) and flight.start.std == (0.0,) * 15
    rate = (
        np.linalg.norm(
            flight.recording.imu.dtheta - flight.recording.meta["b_g"] * 0.01, axis=1
        ).mean()
        / 0.01
    )
    assert flight.recording.meta["earth"] == "flat" and rate < 0.2
    assert (
        fly("straight", duration=2.0, seed=8, loop=Loop(start=flight.start)).start == flight.start
    )


@pytest.mark.parametrize("rate", [20.0, 10.0])
def test_a_slower_filter_is_that_filter_fed_the_summed_increments(rate):
    """Steered by the truth the aircraft flies the same at its own step, measured by the same
    sensors; the filter gets the sums of the samples."""
    truth = Loop(feedback="truth")
    common = dict(
        duration=8.0, seed=5, sensors=Sensors(outage="6:"), world=World(turbulence="light")
    )
    fast, slow = (
        fly("turning", loop=truth._replace(filter_rate=each), **common) for each in (None, rate)
    )
    n = round(100 / rate)
    truth = fast.recording.reference
    assert np.abs(displacement(slow.recording.reference.lla, truth.lla[::n])).max() < 1e-7
    assert np.abs(slow.log["aileron, rad"] - fast.log["aileron, rad"][n - 1 :: n]).max() < 1e-9
    sums = [
        each.reshape(-1, n, 3).sum(axis=1)
        for each in (fast.recording.imu.dtheta, fast.recording.imu.dv)
    ]
    assert np.allclose(slow.recording.imu.dtheta, sums[0], rtol=0, atol=1e-12)
    assert np.allclose(slow.recording.imu.dv, sums[1], rtol=0, atol=1e-10)
    assert all(
        np.allclose(a.y, b.y, rtol=1e-13, atol=1e-9) and np.array_equal(a.t, b.t)
        for a, b in zip(slow.recording.sources, fast.recording.sources)
    )
    assert np.array_equal(slow.recording.meta["b_g"], fast.recording.meta["b_g"][n - 1 :: n])
    t = fast.recording.imu.t[n - 1 :: n]
    fed = replace(slow.recording, imu=sd.Imu(t, np.diff(np.r_[0.0, t]), *sums))
    alone = sd.fuse(fed, "closed-loop", start=slow.start).trajectory
    mine = slow.solution.trajectory
    assert np.abs(alone.v_n - mine.v_n).max() < 1e-8
    assert np.abs(displacement(alone.lla, mine.lla)).max() < 1e-7
    repeated = sd.fuse(slow.recording, "closed-loop", start=slow.start)
    assert same(repeated, slow.solution)


def test_the_autopilot_flies_by_the_last_estimate_of_a_slow_filter():
    """At its own step: a turning flight on ten estimates a second is nearly that on a hundred."""
    fast, slow = (
        fly("turning", duration=60.0, seed=3, loop=Loop(filter_rate=rate)) for rate in (None, 10.0)
    )
    assert fast.stopped is slow.stopped is None
    apart = displacement(slow.recording.reference.lla, fast.recording.reference.lla[::10])
    assert np.linalg.norm(apart, axis=1).max() < 1.0


@pytest.mark.short
def test_a_filter_that_has_the_option_rate_gets_that_of_its_samples():
    told = {}

    def start(start, noise, rate=100.0):
        told["rate"] = rate
        return find("closed-loop").start(start, noise)

    fly(
        "straight",
        find("closed-loop")._replace(name="told", start=start),
        duration=0.3,
        loop=Loop(filter_rate=20.0),
    )
    assert told == {"rate": 20.0}


def test_the_model_may_predict_between_fixes():
    """From the beginning, and the fixes are used; its increments stand in the recording."""
    common = dict(duration=4.0, seed=6)
    flight, other = (
        fly("straight", loop=Loop("truth", by), **common) for by in ("model-always", "imu")
    )
    assert (flight.log["model predicts"] == 1).all() and (other.log["model predicts"] == 0).all()
    assert "400 IMU samples are those of the aircraft's model" in str(
        flight.recording.meta["notes"]
    )
    assert flight.solution.counts() == {
        "GNSS position": (20, 0),
        "GNSS velocity": (20, 0),
    }
    assert not np.array_equal(flight.recording.imu.dv, other.recording.imu.dv)
    cut = fly(
        "straight", sensors=Sensors(outage="2:"), loop=Loop("truth", "model-always"), **common
    )
    assert len(cut.recording.sources[0].t) < 10 and (cut.log["model predicts"] == 1).all()


BAD = {
    "filter_rate is 30 Hz; it must be the rate of the flight, 100 Hz, divided by a whole": dict(
        filter_rate=30.0
    ),
    "filter_rate is 200 Hz; .* such as 100 Hz": dict(filter_rate=200.0),
    "filter_rate is nan Hz; it must be a finite number above 0": dict(filter_rate=np.nan),
    "must be one of imu, model, model-always": dict(prediction="model always"),
    "cannot fly 30000.0 s at 100 Hz": dict(filter_rate=10.0, duration=30000.0),
    "outage is '15-20'; write": dict(outage="15-20"),
    "outage 30:35 s is not a window of the flight, which lasts 10 s": dict(outage="30:35"),
    "windows overlap": dict(outage=[(2, 5), (4, 6)]),
    "unknown plan 'strange'": dict(plan="strange"),
    "unknown aircraft 'aerosond'.*did you mean": dict(aircraft="aerosond"),
    "feedback is 'guess'; it must be one of estimate, truth": dict(feedback="guess"),
    "prediction is 'magic'": dict(prediction="magic"),
    "and it never is; give an outage": dict(prediction="model"),
    "a time step of 0.5 s is too long": dict(rate=2.0, gnss=Gnss(interval=1.0)),
    "come faster than the IMU's samples": dict(rate=20.0, gnss=Gnss(interval=0.01)),
    "a leg that rises by 0.5 m per m at 25 m/s cannot be flown": dict(
        plan=FlightPlan("steep", ((0, 0, 0), (100, 0, 50)))
    ),
    "cannot be trimmed at 8 m/s": dict(plan=straight(airspeed=8.0)),
    "turbulence is 'heavy'; it must be one of none": dict(turbulence="heavy"),
    "earth is 'round'": dict(earth="round"),
    "leaves an airspeed of 27 m/s no way against it": dict(wind=(0, 30.0, 0)),
    "a wind of 24 m/s is too fast": dict(wind=(0, 24.0, 0), told_wind=(0, 0, 0)),
    "seed is -1": dict(seed=-1),
    "the start is at 3 s; a flight begins at 0 s": dict(
        start=sd.InitialState(3.0, DEFAULT_PLACE, (0,) * 3, (0,) * 3, (0,) * 3, (0,) * 3, (1,) * 15)
    ),
    "cannot fly 0.001 s at 100 Hz": dict(duration=0.001),
    "estimates no position, and the autopilot flies by one": dict(filter="attitude-mekf"),
    "inputs 1000000 to 1000008 do not fit": dict(
        inputs=1_000_000, filter=find("closed-loop")._replace(name="told")
    ),
    "pkf does not compute with controls; leave inputs out": dict(inputs=0, filter="pkf"),
    "prediction='model' takes over while the receiver is cut": dict(prediction="model", outage=[]),
    "wind is .'a', 0, 0.; it must be 3": dict(wind=("a", 0, 0)),
    "told_wind is .None, 0, 0.": dict(told_wind=(None, 0, 0)),
    "or give a FlightPlan or the path": dict(plan=[(0, 0, 0), (900, 0, 0)]),
    "turbulence is .'light'. .*; it must be one of none": dict(turbulence=["light"]),
    "earth is .'flat'. .*; it must be": dict(earth=["flat"]),
    "gate is -1.0; it must be": dict(gate=-1.0),
    "gate is 'x'": dict(gate="x"),
    "start_std is .*; it must be 15 finite numbers": dict(start_std=["a"] * 15),
    "barometer is True; it must be a Barometer": dict(barometer=True),
    "barometer: 500 a second come faster": dict(barometer=Barometer(rate=500.0)),
    "receiver is None; it must be a Gnss": dict(gnss=None),
    "model_noise is": dict(model_noise=3.0),
    "no filter is called": dict(filter="closed"),
}


@pytest.mark.short
@pytest.mark.parametrize("text", BAD)
def test_what_cannot_be_flown_is_refused_in_one_line(text):
    with pytest.raises(DataError, match=text) as refused:
        by_name(**dict(duration=10.0) | BAD[text])
    assert "\n" not in str(refused.value)


@pytest.mark.short
def test_what_a_flight_decides_is_no_option_of_its_filter():
    with pytest.raises(DataError, match="no option 'outage' of its own; give sensors=Sensors"):
        fly(duration=10.0, outage="15:")
    with pytest.raises(DataError, match="sensors is '15:'; it must be a Sensors"):
        fly(duration=10.0, sensors="15:")


@pytest.mark.short
def test_a_flight_cannot_be_written_to_and_the_next_is_the_same():
    one = fly("straight", duration=0.5)
    for array in (one.trim.state, one.trim.commands, one.route.length, one.log["t, s"]):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    other = fly("straight", duration=0.5)
    assert other == one and other.trim == one.trim and other.trim.state[2] == 500.0
    assert copy.deepcopy(one) == one and pickle.loads(pickle.dumps(one)) == one


@pytest.mark.short
def test_outage_windows():
    assert outage_windows("15:", 25.0) == ((15.0, np.inf),)
    assert outage_windows("3:4,1:2", 25.0) == ((1.0, 2.0), (3.0, 4.0))
    assert outage_windows([(3, 40)], 25.0) == ((3.0, np.inf),)
    assert outage_windows(None, 25.0) == ()


def test_threads_may_fly_at_once():
    from concurrent.futures import ThreadPoolExecutor

    go = lambda seed: fly("turning", duration=5.0, seed=seed, world=World(turbulence="light"))
    with ThreadPoolExecutor(3) as pool:
        for seed, flight in enumerate(pool.map(go, range(3))):
            assert same(flight.solution, go(seed).solution)
