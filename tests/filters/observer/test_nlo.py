"""The nonlinear observer as a filter: from far away, through outages, without a course, with
either heading source, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import flight, start, turning, without_samples
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.data.solution import VALID, Source
from strapdown.filters.observer.gains import configure
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.trajectory import DEG, Motion

NOISE = Noise(3e-4, 3e-3, 2e-5, 2e-4, 0.0, 0.0)


def attitude_error(solution, recording):
    """Total attitude error at each row, deg."""
    return np.degrees(np.linalg.norm(sd.errors(solution, recording.reference).attitude, axis=1))


def far(recording, seed, degrees=170.0, bias=0.05):
    """(the recording with a gyro bias in a random direction put on it, an InitialState that far off
    about a random axis and says so)."""
    rng = np.random.default_rng(seed)
    axis, drift = (row / np.linalg.norm(row) for row in rng.standard_normal((2, 3)))
    imu = recording.imu
    attitude = Rotation.from_rotvec(np.radians(degrees) * axis) * recording.reference.rotation[0]
    begin = start(recording)._replace(rph=tuple(attitude.as_euler("ZYX")[::-1]))
    begin = begin._replace(std=(*begin.std[:6], *[1.7] * 3, *begin.std[9:12], *[0.03] * 3))
    return replace(
        recording, imu=imu._replace(dtheta=imu.dtheta + bias * drift * imu.dt[:, None])
    ), begin


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
@pytest.mark.parametrize("source", ["course", "magnetic-field"])
def test_it_comes_back_from_170_deg_and_a_large_gyro_bias(seed, source):
    kept = "velocity" if source == "course" else source
    made = sd.simulate(
        turning(),
        60.0,
        "industrial",
        seed,
        50.0,
        Gnss(),
        magnetometer=Magnetometer(rate=10.0),
        date="2024-07-01",
    )
    recording, begin = far(
        replace(made, sources=tuple(a for a in made.sources if a.kind in ("position", kept))), seed
    )
    solution = sd.fuse(recording, "nlo", start=begin)
    error = attitude_error(solution, recording)
    assert error[0] > 100 and error[-1] < 3 and error[-500:].max() < 5


@pytest.mark.short
def test_it_claims_standard_deviations_and_publishes_its_columns():
    solution = sd.fuse(flight(), "nlo", start=start(flight()), noise=NOISE)
    assert (solution.trajectory.std > 0).all() and np.isfinite(solution.innovations.nis).all()
    assert list(solution.columns) == [
        "excitation",
        "course_held [s]",
        "xi_north [m/s^2]",
        "xi_east [m/s^2]",
        "xi_down [m/s^2]",
    ]
    notes = solution.meta["notes"]
    assert len(notes) == 2 and all("spectral radius 0." in note for note in notes)
    rms = sd.rms(sd.errors(solution, flight().reference), window=(5.0, 20.0))
    assert (
        np.linalg.norm(rms.position) < 3
        and np.linalg.norm(rms.velocity) < 0.5
        and np.degrees(np.abs(rms.rph)).max() < 2
    )


@pytest.mark.short
def test_biases_are_held_in_an_outage_and_the_first_fix_after_it_kicks_nothing():
    recording, window = flight(60.0), (20.0, 50.0)
    solution = sd.fuse(recording.hidden([window]), "nlo", start=start(recording), noise=NOISE)
    t, xi = (
        solution.trajectory.t,
        np.stack(
            [solution.columns[f"xi_{axis} [m/s^2]"] for axis in ("north", "east", "down")], axis=1
        ),
    )
    held = (t > window[0] + 3.2) & (t < window[1] - 0.2)
    for values in (solution.b_a, solution.b_g):
        assert (values[held] == values[held][0]).all()
    assert np.abs(xi[held] - xi[held][0]).max() < 1e-4
    error = np.linalg.norm(sd.errors(solution, recording.reference).position, axis=1)
    assert error[held].max() > 5 * error[t > window[1] + 3].max()
    after, before = (np.searchsorted(t, window[1] + offset) for offset in (0.02, -0.1))
    assert np.linalg.norm(xi[after] - xi[before]) < 1.0
    assert (
        solution.trajectory.rotation[before].inv() * solution.trajectory.rotation[after + 40]
    ).magnitude() < 0.3


def with_field_and_heading(recording, kind):
    """The recording with true magnetic fields, or headings, 5 a second."""
    truth = recording.reference
    row = np.searchsorted(truth.t, np.arange(0.2, truth.t[-1], 0.2) - 1e-9)
    field, y = np.array([21e-6, 1e-6, 43e-6]), truth.rph[row, 2:3]
    if kind == "magnetic-field":
        y = truth.rotation[row].inv().apply(field)
    more = {"parameters": tuple(field)} if kind == "magnetic-field" else {}
    return replace(
        recording,
        sources=(*recording.sources, Source(kind, truth.t[row], y, np.full(y.shape, 1e-6), **more)),
    )


@pytest.mark.short
@pytest.mark.parametrize("kind", ["heading", "magnetic-field"])
def test_in_an_outage_heading_and_field_change_nothing_and_go_on_after_it(kind):
    """The start is off in heading and biases, so that both have much to correct: without them
    (hidden too) the outage is the same bit for bit."""
    recording, window = with_field_and_heading(flight(60.0), kind), (8.0, 38.0)
    begin = start(recording)._replace(
        rph=(0.3, 0.1, start(recording).rph[2] + 0.6), b_g=(2e-3, -1e-3, 3e-3)
    )
    solution = sd.fuse(
        recording.hidden([window], kinds=("position", "velocity")), "nlo", start=begin, noise=NOISE
    )
    t = solution.trajectory.t
    held = (t > window[0] + 2.3) & (t < window[1] - 0.2)
    for values in (solution.b_a, solution.b_g):
        assert (values[held] == values[held][0]).all()
    xi = np.stack(
        [solution.columns[f"xi_{axis} [m/s^2]"] for axis in ("north", "east", "down")], axis=1
    )
    # m/s^2: the axes of n turn over the 1 km flown
    assert np.abs(xi[held] - xi[held][0]).max() < 1e-4
    without = recording.hidden([window], kinds=("position", "velocity")).hidden(
        [(window[0] + 2.3, window[1] - 0.2)], kinds=(kind,)
    )
    coasted = sd.fuse(without, "nlo", start=begin, noise=NOISE).trajectory
    for ours, other in zip(
        (solution.trajectory.lla, solution.trajectory.v_n, solution.trajectory.q_nb),
        (coasted.lla, coasted.v_n, coasted.q_nb),
    ):
        assert np.array_equal(ours[held], other[held])
    after = t > window[1] + 1.2
    assert (
        not (solution.b_g[after] == solution.b_g[held][0]).all()
        and not (xi[after] == xi[held][-1]).all()
    )
    assert attitude_error(solution, recording)[-1] < 5


@pytest.mark.short
def test_after_an_outage_the_course_does_not_take_the_place_of_a_heading_that_was_there():
    recording = flight(60.0)
    truth = recording.reference
    row = np.searchsorted(truth.t, np.arange(0.1, 60.0, 0.2) - 1e-9)
    heading = Source(
        "heading", truth.t[row], truth.rph[row, 2:3] + 0.5, np.full((len(row), 1), 0.01)
    )
    away = replace(recording, sources=(*recording.sources, heading)).hidden(
        [(8.0, 38.0)], kinds=("position", "velocity")
    )
    solution = sd.fuse(away, "nlo", start=start(recording), noise=NOISE)
    turned = np.unwrap(solution.trajectory.rph[:, 2]) - np.unwrap(
        np.interp(solution.trajectory.t, truth.t, np.unwrap(truth.rph[:, 2]))
    )
    first = np.searchsorted(solution.trajectory.t, 38.0 + 1e-6)
    # rad; the course, 0.5 off from it, would pull by more than half of that
    assert abs(turned[first] - turned[first - 4]) < 0.05


@pytest.mark.short
def test_frozen_course_goes_on_through_an_outage_and_is_wrong_in_a_turn():
    recording, window = flight(60.0), (10.0, 60.0)
    solutions = {
        course: sd.fuse(
            recording.hidden([window]),
            "nlo",
            start=start(recording),
            noise=NOISE,
            options={"course": course},
        )
        for course in ("tilt-compensated", "frozen")
    }
    error = {
        course: attitude_error(solution, recording)[-1] for course, solution in solutions.items()
    }
    assert error["tilt-compensated"] < 5 and error["frozen"] > 60
    t = solutions["frozen"].trajectory.t
    held = (t > window[0] + 3.2) & (t < window[1] - 0.2)
    for values in (solutions["frozen"].b_a, solutions["frozen"].b_g):
        assert (values[held] == values[held][0]).all()


@pytest.mark.short
def test_near_standstill_the_course_is_held_and_that_is_said():
    def slow(t):
        return np.where(t < 15, 0.5, 0.5 + 0.4 * (t - 15))

    motion = Motion(
        "slow",
        (DEG * 47, DEG * 8, 500.0),
        lambda t: (slow(t), 0 * t, 0 * t),
        lambda t: (0 * t, 0 * t, 0 * t),
    )
    recording = sd.simulate(motion, 30.0, "tactical", 3, 20.0)
    solution = sd.fuse(recording, "nlo", start=start(recording), noise=NOISE)
    held = solution.columns["course_held [s]"]
    # the fixes' 0.1 m/s are 5 deg of course at 1.15 m/s
    assert 15 <= held[-1] <= 18.1 and held[0] == 0
    heading = solution.trajectory.std[:, 8]
    assert (np.diff(heading[20:300:40]) > 0).all()
    eager = sd.fuse(
        recording, "nlo", start=start(recording), noise=NOISE, options={"min_speed": 1e-3}
    )
    assert eager.columns["course_held [s]"][-1] == 0
    assert (
        attitude_error(solution, recording)[200:300].max()
        < attitude_error(eager, recording)[200:300].max()
    )


@pytest.mark.short
def test_a_heading_takes_the_place_of_the_course():
    recording = flight(30.0)
    truth = recording.reference
    row = np.searchsorted(truth.t, np.arange(1.0, 30.0) - 1e-9)
    heading = Source(
        "heading", truth.t[row], truth.rph[row, 2:3] + 0.5, np.full((len(row), 1), 0.3)
    )
    solution = sd.fuse(
        replace(recording, sources=(*recording.sources, heading)),
        "nlo",
        start=start(recording),
        noise=NOISE,
    )
    difference = np.degrees(solution.trajectory.rph[-1, 2] - truth.rph[-1, 2])
    # it follows the heading that is 29 deg off, not the course
    assert 20 < (difference + 180) % 360 - 180 < 35


@pytest.mark.short
def test_altitudes_and_positions_alone_serve_the_height():
    recording = flight(30.0)
    position, velocity = recording.sources
    level = replace(position, y=position.y + [0, 0, 0])
    height = Source(
        "altitude",
        level.t,
        level.y[:, 2:3] + 40.0,
        np.full((len(level.t), 1), 0.01),
        parameters=level.parameters,
        gate=np.inf,
    )
    solution = sd.fuse(
        replace(recording, sources=(position, velocity, height)),
        "nlo",
        start=start(recording),
        noise=NOISE,
    )
    assert abs(solution.trajectory.lla[-1, 2] - recording.reference.lla[-1, 2] - 40) < 3


@pytest.mark.short
@pytest.mark.parametrize(
    "options",
    [
        dict(design="poles"),
        dict(design="poles", poles="-0.3 -0.4+0.3j -0.4-0.3j"),
        dict(theta=1.5),
        dict(kpp=0.3, kvp=0.03, kxp=0.003, kpv=0.05, kvv=0.4, kxv=0.1),
        dict(course="printed"),
        dict(adaptation=0.0, ki=0.0),
    ],
)
def test_every_design_follows_the_flight(options):
    recording = flight(40.0)
    solution = sd.fuse(recording, "nlo", start=start(recording), noise=NOISE, options=options)
    rms = sd.rms(sd.errors(solution, recording.reference), window=(20.0, 40.0))
    assert np.linalg.norm(rms.position) < 4 and np.linalg.norm(rms.velocity) < 1


@pytest.mark.short
def test_gains_as_given_are_said_and_act_and_are_refused_where_not_stable():
    gains = dict(kpp=0.3, kvp=0.03, kxp=0.003, kpv=0.05, kvv=0.4, kxv=0.1)
    solution = sd.fuse(flight(), "nlo", start=start(flight()), noise=NOISE, options=gains)
    note, other = solution.meta["notes"]
    assert (
        "observer gains, given," in note
        and "by 0.3, 0.03, 0.003; a velocity corrects position, velocity and force by 0.05, 0.4, 0.1"
        in note
    )
    harder = sd.fuse(
        flight(), "nlo", start=start(flight()), noise=NOISE, options=gains | dict(kpp=0.6)
    )
    assert np.abs(harder.trajectory.lla - solution.trajectory.lla).max() > 1e-9
    for gain in gains:  # each alone too large, the others as they are
        with pytest.raises(DataError, match="not stable at fixes every 1 s: spectral radius"):
            sd.fuse(
                flight(), "nlo", start=start(flight()), noise=NOISE, options=gains | {gain: 9.0}
            )


@pytest.mark.short
def test_hiding_fixes_changes_no_option_however_the_time_stamps_jitter():
    rng, recording = np.random.default_rng(5), flight(60.0)
    jittered = tuple(
        replace(a, t=a.t + rng.uniform(-4e-4, 4e-4, len(a.t))) for a in recording.sources
    )
    whole = replace(recording, sources=jittered)
    hidden = whole.hidden([(20.0, 45.0)])
    assert (
        configure({}, whole.sources)[0] == configure({}, hidden.sources)[0] == {"outage_after": 3.0}
    )
    told = [
        sd.fuse(r, "nlo", start=start(recording), noise=NOISE).meta["notes"]
        for r in (whole, hidden)
    ]
    assert told[0] == told[1] and len(told[0]) == 2


@pytest.mark.short
def test_a_gap_in_the_samples_widens_the_design_and_is_recovered():
    recording = without_samples(flight(60.0), (20.0, 30.0))
    solution = sd.fuse(recording, "nlo", start=start(recording), noise=NOISE)
    error = np.linalg.norm(sd.errors(solution, recording.reference).position, axis=1)
    assert np.isfinite(solution.trajectory.lla).all() and error[-100:].max() < 10


@pytest.mark.short
@pytest.mark.parametrize("name", ["nlo", "xkf"])
@pytest.mark.parametrize(
    "kinds, options, said",
    [
        (
            ("position",),
            {},
            "nothing measures heading or course: add a source of velocity, heading or magnetic-field",
        ),
        (("velocity",), {}, "nothing measures the position"),
        (("position", "velocity"), dict(kpp=3.0), "not stable at fixes every 1 s"),
        (("position", "velocity"), dict(k1=0.0), "k1 is 0"),
        (("position", "velocity"), dict(gyro_bound=1e-9), "beyond gyro_bound"),
    ],
)
def test_what_it_cannot_run_on_is_refused_in_one_line(name, kinds, options, said):
    recording = replace(flight(), sources=tuple(a for a in flight().sources if a.kind in kinds))
    with pytest.raises(DataError, match=said) as refused:
        sd.fuse(
            recording,
            name,
            start=start(recording)._replace(b_g=(1e-4, 0.0, 0.0)),
            noise=NOISE,
            options=options,
        )
    assert "\n" not in str(refused.value)


@pytest.mark.short
def test_positions_are_all_that_the_list_of_filters_says_it_needs(command):
    """And rightly: without a course it runs on them alone."""
    lines = [line.split() for line in command("filters")[1].splitlines()]
    needs = [line[-1] for line in lines if line[:1] in (["nlo"], ["xkf"])]
    assert needs == ["position", "position"]
    alone = replace(flight(), sources=flight().sources[:1])
    for name in ("nlo", "xkf"):
        assert np.isfinite(
            sd.fuse(
                alone, name, start=start(flight()), noise=NOISE, options={"course": "none"}
            ).trajectory.lla
        ).all()


@pytest.mark.parametrize("name", ["nlo", "xkf"])
def test_a_bias_that_nothing_excites_is_said_live_as_in_batch(name):
    even, begin = flight(75.0), start(flight(75.0))  # a steady turn
    solution = sd.fuse(even, name, start=begin, noise=NOISE)
    ((t, text),) = [event for event in solution.events if "not excited" in event[1]]
    assert t == pytest.approx(60.0, abs=0.1) and "calibrate the accelerometer" in text
    assert (solution.status == VALID).all() and solution.columns["excitation"].max() < 1e-3
    stream = sd.Stream(name, start=begin, noise=NOISE, sources=even.sources)
    events = [sd.Sample(*row) for row in zip(*even.imu)]
    for k, a in enumerate(even.sources):
        events += [sd.Measurement(t, k, y, deviations) for t, y, deviations in zip(a.t, a.y, a.std)]
    for event in sorted(events, key=lambda event: (event.t, type(event) is sd.Sample)):
        stream.step(event)
    assert tuple(stream.events) == solution.events
