"""The case studies of Fossen's chapter 14: signals and truth against independent code, weights,
one run in numbers, errata, and a small study."""

import json

import numpy as np
import pandas as pd
import pytest
from ins_equations import derivatives

from strapdown.checks import DataError
from strapdown.core.loop.contract import BA, BG, Noise
from strapdown.data.recording import Recording
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors
from strapdown_reproductions.common.pages import COLOURS
from strapdown_reproductions.common.reproduction import Asked
from strapdown_reproductions.fossen import (
    cases as fossen_cases,
    main,
    runs as fossen_runs,
    signals,
)
from strapdown_reproductions.fossen.cases import (
    AHRS,
    CASES,
    CHAPTER,
    EULER,
    FADING,
    FAST,
    MEKF,
    RIGHT,
    CaseRun,
    FilterCase,
)

BY_NAME = {case.name: case for case in CASES}
SHORT = 20.0


def published(name, t):
    """(acceleration, rate) of the published generator, written out."""
    s, c = np.sin, np.cos
    if name == "signal 1":
        return (0.1 * s(0.1 * t), 0.01 * c(0.1 * t), 0.05 * s(0.05 * t)), (
            0.03 * c(0.2 * t),
            -0.02 * s(0.1 * t),
            0.01 * s(0.05 * t),
        )
    return (
        (
            0.2 * s(0.07 * t + 0.5) + 0.05 * s(0.2 * t),
            0.1 * c(0.1 * t) + 0.02 * c(0.3 * t + 0.3),
            0.15 * s(0.05 * t + 1.0) + 0.03 * c(0.2 * t),
        ),
        (
            0.05 * s(0.3 * t) + 0.01 * c(0.1 * t + 0.7),
            0.04 * c(0.2 * t + 1.2),
            0.03 * s(0.15 * t + 0.4),
        ),
    )


@pytest.mark.short
@pytest.mark.parametrize("name", signals.SIGNALS)
def test_signals_are_the_published_ones(name):
    for t in (0.0, 0.37, 12.0, 250.0):
        acceleration, rate = published(name, t)
        np.testing.assert_allclose(signals.acceleration(name, t), acceleration, atol=1e-15)
        np.testing.assert_allclose(signals.rate(name, t), rate, atol=1e-15)
    t = np.linspace(0.0, 5.0, 100001)
    trapezium = (
        0.5 * (t[1] - t[0]) * (signals.rate(name, t)[1:] + signals.rate(name, t)[:-1]).sum(axis=0)
    )
    np.testing.assert_allclose(signals._angles(name, t[[0, -1]])[1], trapezium, atol=1e-11)


@pytest.mark.short
def test_constants_are_the_published_ones():
    assert (
        np.degrees(signals.TRONDHEIM[:2]) == pytest.approx([63.4305, 10.3951])
        and signals.TRONDHEIM[2] == 0
    )
    assert [round(part * 1e9) for part in signals.FIELD] == [13559, 921, 50209]
    assert (
        signals.ACCEL_BIAS == (0.1, 0.3, -0.1)
        and signals.GYRO_BIAS == (0.05, 0.1, -0.05)
        and signals.SAMPLE_NOISE == 0.005
    )
    assert (
        signals.BIAS_STD == pytest.approx((1.962e-4, 3.8785e-5), rel=1e-4)
        and signals.BIAS_TIME == 300
    )
    assert (
        signals.POSITION_STD,
        signals.VELOCITY_STD,
        1 / signals.POSITION_INTERVAL,
        signals.FIELD_RATE,
    ) == (0.05, 0.01, 5.0, 100.0)


@pytest.mark.short
@pytest.mark.parametrize("name", signals.SIGNALS)
def test_the_truth_solves_the_strapdown_equations(name):
    """Fixed-step Runge-Kutta on the test's own equations, gravity and radii; the specific force
    is the acceleration less the gravity of the place."""
    t, dt = np.linspace(0.0, 40.0, 401), 0.1
    lla, v, C = np.array(signals.TRONDHEIM), np.zeros(3), np.eye(3)

    def slope(lla, v, C, t):
        acceleration, rate = map(np.array, published(name, t))
        gravity = derivatives(lla, np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))[1]
        return derivatives(lla, v, C, rate, acceleration - C.T @ gravity)

    for k in range(400):
        state, begin = (lla, v, C), t[k]
        k1 = slope(*state, begin)
        k2 = slope(*(x + 0.5 * dt * d for x, d in zip(state, k1)), begin + 0.5 * dt)
        k3 = slope(*(x + 0.5 * dt * d for x, d in zip(state, k2)), begin + 0.5 * dt)
        k4 = slope(*(x + dt * d for x, d in zip(state, k3)), begin + dt)
        lla, v, C = (
            x + dt / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4)
        )
    truth = signals.integrate_signal(name, t).truth
    assert np.abs((truth.lla[-1] - lla) * [6.4e6, 2.9e6, 1.0]).max() < 1e-5
    np.testing.assert_allclose(truth.v_n[-1], v, atol=1e-7)
    np.testing.assert_allclose(truth.rotation[-1].as_matrix(), C, atol=1e-8)


@pytest.mark.parametrize("name", signals.SIGNALS)
def test_the_librarys_mechanization_stays_on_the_truth(name):
    truth, imu = signals.ideal(name, 100.0, 60.0)
    begin = fossen_cases.start(Recording(imu, (), truth), CHAPTER, 0)
    e = errors(
        fuse(Recording(imu, (), truth), "closed-loop", start=begin, noise=Noise(*[0.0] * 6)), truth
    )
    assert (
        np.abs(e.position).max() < 2e-5
        and np.abs(e.velocity).max() < 1e-6
        and np.abs(e.attitude).max() < 1e-9
    )


@pytest.mark.short
def test_a_body_at_rest_feels_gravity_and_the_turning_earth():
    imu = signals.ideal("at rest", 100.0, 5.0).imu
    earth = 7.292115e-5 * np.array(
        [np.cos(signals.TRONDHEIM[0]), 0.0, -np.sin(signals.TRONDHEIM[0])]
    )
    np.testing.assert_allclose(imu.dtheta / imu.dt[:, None], np.tile(earth, (500, 1)), atol=1e-12)
    np.testing.assert_allclose(imu.dv[-1] / imu.dt[-1], [0, 0, -9.8215], atol=1e-3)
    with pytest.raises(DataError, match="no excitation 'dancing'; there is: signal 1"):
        signals.ideal("dancing", 100.0, 5.0)


@pytest.mark.short
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_samples_have_the_published_noise_at_any_rate(rate):
    n = 1500
    recording, ideal = (
        signals.recording("signal 1", 1, rate, n / rate),
        signals.ideal("signal 1", rate, n / rate).imu,
    )
    noise = np.stack(
        [
            (recording.imu.dv - ideal.dv) * rate - signals.ACCEL_BIAS,
            (recording.imu.dtheta - ideal.dtheta) * rate - signals.GYRO_BIAS,
        ]
    )
    np.testing.assert_allclose(noise.std(axis=1), 0.005, rtol=0.12)  # 6 sigma of 1500 samples
    assert np.abs(noise.mean(axis=1)).max() < 5 * 0.005 / np.sqrt(n)


@pytest.mark.short
def test_varying_biases_begin_at_the_constant_ones_and_follow_their_law():
    b_a, b_g = signals.biases(True, 60_000, 30.0, np.random.default_rng(1))
    # after 300 s
    np.testing.assert_allclose(
        b_a[9], np.exp(-1.0) * np.array(signals.ACCEL_BIAS), atol=5 * signals.BIAS_STD[0]
    )
    # 4 sigma: 9000 independent values
    assert [part[100:].std() for part in (b_a, b_g)] == pytest.approx(signals.BIAS_STD, rel=0.05)
    begun = signals.biases(True, 10, 1e-3, np.random.default_rng(1))
    np.testing.assert_allclose(
        [part[0] for part in begun], [signals.ACCEL_BIAS, signals.GYRO_BIAS], atol=1e-5
    )
    assert np.ptp(signals.biases(False, 50, 0.1, np.random.default_rng(1))[0], axis=0).max() == 0


def test_a_recording_repeats_and_its_fixes_have_their_noise():
    first, again = (signals.recording("signal 2", 5, duration=60.0) for _ in range(2))
    assert all(
        np.array_equal(a.y, b.y) for a, b in zip(first.sources, again.sources)
    ) and np.array_equal(first.imu.dv, again.imu.dv)
    assert not np.array_equal(first.imu.dv, signals.recording("signal 2", 6, duration=60.0).imu.dv)
    of = {a.kind: a for a in first.sources}
    assert {kind: len(a.t) for kind, a in of.items()} == {
        "position": 300,
        "velocity": 300,
        "magnetic-field": 6000,
        "heading": 6000,
        "attitude": 600,
        "gravity": 300,
    }
    truth = first.reference
    rows = {kind: np.searchsorted(truth.t, a.t - 1e-9) for kind, a in of.items()}
    assert (of["velocity"].y - truth.v_n[rows["velocity"]]).std() == pytest.approx(0.01, rel=0.12)
    assert ((of["position"].y - truth.lla[rows["position"]])[:, 2]).std() == pytest.approx(
        0.05, rel=0.2
    )
    unit = of["magnetic-field"].y / np.linalg.norm(signals.FIELD)
    expected = (
        truth.rotation[rows["magnetic-field"]]
        .inv()
        .apply(np.array(signals.FIELD) / np.linalg.norm(signals.FIELD))
    )
    assert (unit - expected).std() == pytest.approx(0.005, rel=0.05)
    turned = (of["heading"].y[:, 0] - truth.rph[rows["heading"], 2] + np.pi) % (2 * np.pi) - np.pi
    assert turned.std() == pytest.approx(0.005, rel=0.05)


@pytest.mark.short
def test_published_weights_and_what_they_mean():
    assert (
        MEKF.Q == (0.01, 0.01, 0.1, 0.001)
        and MEKF.times == (500, 500)
        and MEKF.R["position"] == 1
        and MEKF.R["velocity"] == 0.1
    )
    assert (
        MEKF.R["magnetic-field"] == MEKF.R["heading"] == 0.01
        and EULER.R["heading"] == 0.001
        and AHRS.Q[2] == 10
        and AHRS.times == (1000, 500)
    )
    case = BY_NAME["mekf, position + field"]
    assert fossen_cases.deviation(case, CHAPTER, "magnetic-field") == pytest.approx(
        0.1 * 52015e-9, rel=1e-3
    )
    assert fossen_cases.deviation(case, RIGHT, "position") == 0.05
    with pytest.raises(DataError, match="no weight of 'attitude' is published"):
        fossen_cases.deviation(case, CHAPTER, "attitude")
    told = fossen_cases.noise(case, RIGHT, "signal 2")
    assert (told.accel, told.gyro) == pytest.approx(
        (5e-4, 5e-4)
    ) and told.gyro_decay == told.accel_decay == 1 / 300
    assert fossen_cases.noise(case._replace(rate=1000.0), RIGHT, "signal 1")[:2] == pytest.approx(
        (0.005 / 1000**0.5,) * 2
    )
    assert (
        fossen_cases.noise(case, RIGHT, "signal 1").accel_decay == 0
        and fossen_cases.noise(case, CHAPTER, "signal 1").accel_decay == 1 / 500
    )
    direct = BY_NAME["direct-ahrs"]
    assert (
        fossen_cases.noise(direct, CHAPTER, "signal 2").accel_decay == 0
        and fossen_cases.noise(direct, RIGHT, "signal 2").accel_decay == 1 / 300
    )


def grown(weights, step, rate):
    """Variances of velocity, attitude and biases after a second without fixes: as the published
    code adds them, and as the library does from densities."""
    code = np.array(weights.Q)[[0, 2, 1, 3]] * step**2 * round(1 / step)
    truth, imu = signals.ideal("at rest", rate, 2.0)
    case = FilterCase("", "closed-loop", (), weights)
    begin = fossen_cases.start(Recording(imu, (), truth), CHAPTER, 0)._replace(std=(0.0,) * 15)
    solution = fuse(
        Recording(imu, (), truth),
        "closed-loop",
        start=begin,
        noise=fossen_cases.noise(case, CHAPTER, "at rest"),
    )
    return code, solution.trajectory.std[round(rate) - 1] ** 2


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_published_weights_belong_to_their_step_and_densities_do_not(rate):
    """h^2 Q in each step: at 1 ms the sums are what the densities q = h Q give at any rate; the
    same Q at 10 ms would be ten times that."""
    code, library = grown(MEKF, 1e-3, rate)
    # velocity, heading, biases; gravity tilts and bias drives add to the first two
    kept = library[[3, 8, 9, 12]]
    np.testing.assert_allclose(kept[2:], code[2:], rtol=0.01)
    assert code[1] == pytest.approx(1e-4) and kept[1] == pytest.approx(code[1] + 1e-6 / 3, rel=0.01)
    assert kept[0] == pytest.approx(code[0] + 1e-5 / 3 + 9.82**2 * (1e-4 / 3 + 1e-6 / 20), rel=0.01)
    np.testing.assert_allclose(grown(MEKF, 1e-2, rate)[0], 10 * code)


def test_every_fix_is_used_when_it_comes_and_that_tells_more():
    """The published code computes fields between positions and drops them; here all 100 a second
    count."""
    case, recording = (
        BY_NAME["mekf, position + field"],
        signals.recording("signal 1", 1, duration=SHORT),
    )
    used = fossen_cases.select_sources(recording, case, RIGHT)
    dropped = Recording(
        used.imu,
        tuple(
            a if a.kind == "position" else a._where(np.isin(a.t, used.sources[0].t))
            for a in used.sources
        ),
        used.reference,
    )
    begin, noise = (
        fossen_cases.start(recording, RIGHT, 1),
        fossen_cases.noise(case, RIGHT, "signal 1"),
    )
    made = [fuse(each, case.filter, start=begin, noise=noise) for each in (used, dropped)]
    assert made[0].counts() == {"GNSS position": (100, 0), "magnetometer": (2000, 0)} and made[
        1
    ].counts()["magnetometer"] == (100, 0)
    across = [solution.trajectory.std[-1, 7] for solution in made]  # about east, across the field
    assert across[1] > 1.5 * across[0]


@pytest.mark.short
def test_growth_is_that_of_the_last_part_against_the_one_before():
    """An error that grows with the square of the time has 2.6 in 300 s, a constant one 1."""
    t = np.arange(1, 3001) / 10
    error = np.zeros((3000, 15))
    error[:, 0] = 0.03
    run = CaseRun(t, error, np.ones((3000, 15)), np.zeros((3000, 6)), "", np.nan, 0.15 * t**2)
    found = fossen_cases.numbers(run, 300.0)
    assert found["growth"] == pytest.approx(1.0)
    assert found["ins_growth"] == pytest.approx(np.sqrt((3**5 - 2**5) / (2**5 - 1)), rel=0.01)
    short = fossen_cases.numbers(run._replace(t=t / 20), 15.0)
    assert np.isnan(short["growth"])


@pytest.mark.short
def test_constant_biases_of_signal_2_are_on_the_same_motion():
    assert signals.ideal(signals.CONSTANT, 100.0, 5.0) is signals.ideal("signal 2", 100.0, 5.0)
    meta = signals.recording(signals.CONSTANT, 1, duration=5.0).meta
    np.testing.assert_array_equal(meta["b_a"], np.tile(signals.ACCEL_BIAS, (500, 1)))
    assert np.ptp(signals.recording("signal 2", 1, duration=5.0).meta["b_a"], axis=0).min() > 0
    case = BY_NAME["mekf, position + field"]
    assert fossen_cases.noise(case, RIGHT, signals.CONSTANT).accel_decay == 0


@pytest.mark.short
def test_as_printed_only_fixes_with_a_position_are_used():
    recording = signals.recording("signal 1", 1, duration=5.0)
    used = fossen_cases.select_sources(
        recording, BY_NAME["mekf as printed, position + gravity + field"], CHAPTER
    )
    assert {a.kind: len(a.t) for a in used.sources} == {
        "position": 25,
        "magnetic-field": 25,
        "gravity": 25,
    }
    every = fossen_cases.select_sources(recording, BY_NAME["mekf, position + field"], CHAPTER)
    assert [len(a.t) for a in every.sources] == [25, 500]


@pytest.mark.short
def test_times_of_convergence():
    t = np.arange(1.0, 7.0)
    settled = fossen_cases.settling_time
    assert settled(t, np.array([5, 5, 0.1, 0.1, 0.1, 0.1]), 1.0) == 3.0
    assert (
        settled(t, np.array([5, 0.1, 5, 0.1, 0.1, 0.1]), 1.0) == 4.0
        and settled(t, np.full(6, 0.1), 1.0) == 0.0
    )
    assert (
        settled(t, np.array([0.1, 0.1, 0.1, 0.1, 0.1, 2.0]), 1.0) == np.inf
        and settled(np.empty(0), np.empty(0), 1.0) == np.inf
    )
    assert settled(t, np.array([5, np.nan, 0.1, 0.1, 0.1, 0.1]), 1.0) == 3.0 and np.isnan(
        settled(t, np.full(6, np.nan), 1.0)
    )


@pytest.mark.short
def test_a_run_in_numbers():
    t, error = np.arange(1, 3001) / 10, np.zeros((3000, 15))
    error[:, 0] = 0.03
    error[:, BA], error[t < 80, 9] = 0.001, 1.0
    error[:, BG], error[t < 4, 12] = 0.001, 1.0
    std = np.linspace(1.0, 0.1, 3000)[:, None] * np.ones(15)
    run = CaseRun(t, error, std, np.zeros((3000, 6)), "", np.nan, np.full(3000, 7.0))
    found = fossen_cases.numbers(run, 300.0)
    assert (
        found["accel_s"],
        found["gyro_s"],
        found["position_m"],
        found["ins_m"],
        found["stopped"],
    ) == (80.0, 4.0, pytest.approx(0.03), 7.0, False)
    assert (
        found["accel_left_x"] == pytest.approx(0.1)
        and found["accel_m_s2"] == pytest.approx(0.001 * 3**0.5)
        and found["accel_first_s"] == 80.0
    )
    broken = fossen_cases.numbers(run._replace(stopped="at 5 s"), 300.0)
    assert broken["stopped"] and broken["accel_s"] == np.inf and np.isnan(broken["position_m"])
    assert fossen_cases.numbers(
        CaseRun(t[:0], error[:0], std[:0], error[:0, :6], "no start", np.nan, t[:0]), 300.0
    )["stopped"]


@pytest.mark.short
def test_the_whole_study():
    wanted = fossen_runs.tasks(list(range(50)))
    assert len(wanted) == 50 * len(signals.EXCITATIONS)
    names = lambda seed, excitation: [
        case.name for s, e, cases in wanted if (s, e) == (seed, excitation) for case in cases
    ]
    assert names(0, "signal 1") == [case.name for case in CASES + FAST] and names(
        30, "signal 2"
    ) == [case.name for case in CASES]
    assert names(0, "steep") == list(fossen_runs.STEEP) and names(7, "at rest") == [
        case.name for case in CASES
    ]
    assert {case.filter for case in CASES} == {
        "mekf",
        "direct-euler",
        "euler-direct",
        "euler-indirect",
        "ahrs-direct",
        "ahrs-indirect",
        "mekf-printed",
        "force-observer",
        "direct-ahrs",
        "indirect-ahrs-closed",
        "indirect-ahrs-open",
        "fixed-gain",
    }


STUDIED = tuple(
    BY_NAME[name]
    for name in (
        "mekf, position + field, 1 Hz",
        "mekf, position + compass",
        "direct-euler, position + compass",
        "euler-direct as printed, position + compass",
        "indirect-ahrs-open",
        "fixed-gain",
    )
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(folder, claims) of a small study."""
    out, shares = tmp_path_factory.mktemp("fossen"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fossen_runs, "DROPOUT", (10.0, SHORT))
        patch.setattr("strapdown_reproductions.fossen.intro.OUTAGE", (10.0, 15.0))
        patch.setattr(
            "strapdown_reproductions.fossen.intro.simulate",
            lambda *a, f=main.fossen_intro.simulate: f(*a, duration=SHORT),
        )
        asked = Asked(runs=2, seed=9, threads=2, progress=shares.append)
        claims = main.make_outputs(out, asked, STUDIED, SHORT)
    assert shares == sorted(shares) and shares[-1] == 1.0
    return out, claims


def test_the_study_writes_page_tables_and_claims(made):
    out, claims = made
    assert json.loads((out / "claims.json").read_text()) == claims and {
        c["verdict"] for c in claims
    } <= set(COLOURS)
    html = (out / "index.html").read_text()
    for number in ("1a", "1b", "2a", "3b", "4", "5a", "5d", "6a", "6b", "7", "8"):
        assert f"<h3>Figure {number}:" in html, number
    assert (
        html.count("<tr id=claim") == len(claims) == 21 and "What the chapter leaves open" in html
    )
    runs = pd.read_csv(out / "runs.csv")
    assert (
        len(runs) == 2 * (6 * (3 + 3 + 2 + 2 + 3 + 1) + 3 + 2 + 2)
        and set(runs["seed"]) == {9000, 9001}
        and not runs["stopped"].any()
    )
    fixed = runs[runs["case"] == "fixed-gain"]
    # of a start that is off by a metre
    assert fixed["gyro_s"].isna().all() and fixed["position_m"].max() < 3.0
    assert (
        runs[runs["case"] == "indirect-ahrs-open"]["ins_m"].min() > 10
        and runs[runs["case"] != "indirect-ahrs-open"]["ins_m"].isna().all()
    )
    dropouts = pd.read_csv(out / "dropouts-runs.csv")
    assert set(dropouts["case"]) == {"indirect-ahrs-open"} and len(dropouts) == 2 * 3 * 3
    left = lambda tuning: dropouts[dropouts["tuning"] == tuning]["accel_left"].to_numpy()
    assert left(FADING) == pytest.approx(np.exp(-10.0 / 1000), abs=2e-3)
    assert left(CHAPTER) == pytest.approx(1.0, abs=2e-3)


def test_threads_change_nothing(made):
    runs = fossen_runs.run_all([9000, 9001], STUDIED[-1:], SHORT, threads=1).runs
    stored = pd.read_csv(made[0] / "runs.csv")
    np.testing.assert_allclose(
        runs["position_m"], stored[stored["case"] == "fixed-gain"]["position_m"], rtol=1e-5
    )


def test_markdown_goes_between_its_marks(made, goes_into_its_page):
    text = (made[0] / "findings.md").read_text()
    assert (
        text.count("| **") == 21
        and "Signal 1:" in text
        and "Signal 2, constant biases:" in text
        and "Concordance of the chapter:" in text
        and "The claims in every reading:" in text
        and "At rest:" in text
        and "| fixed-gain | true noises |" in text
    )
    goes_into_its_page("fossen", text)


def test_the_command(command, tmp_path, monkeypatch):
    given = []

    def reproduce(out, quick=False, runs=None, seed=2, progress=None):
        given.append((out, quick, runs, seed))
        return [{"verdict": "partly", "claim": "it converges"}]

    monkeypatch.setattr(main, "reproduce", reproduce)
    code, out, err = command("reproduce", "fossen", "--quick", "--seed", 4, "--out", tmp_path / "x")
    assert (
        code == 0
        and given[0] == (tmp_path / "x", True, None, 4)
        and "it converges" in out
        and not err
    )
    monkeypatch.undo()
    for words, text in (
        (("--runs", "0"), "runs is 0"),
        (("--recordings", "."), "reproduce fossen has no option --recordings"),
        (("--runs", "1", "--seed", "-1"), "seed is -1"),
    ):
        code, _, err = command("reproduce", "fossen", *words, "--out", tmp_path / "y")
        assert code == 2 and text in err[-1] and len(err) == 1


@pytest.mark.parametrize("name", signals.SIGNALS)
def test_a_plain_fuse_of_a_recording_knows_its_biases(name):
    made = signals.recording(name, 1, duration=120.0)
    found = fuse(made, "mekf")
    e = errors(found, made.reference)
    late, true = e.t > 60.0, np.r_[made.meta["b_a"][-1], made.meta["b_g"][-1]]
    assert (
        np.abs(e.position[late]).max() < 0.05 and np.degrees(np.abs(e.attitude[late]).max()) < 0.3
    )
    assert (
        np.abs(true - np.r_[found.b_a[-1], found.b_g[-1]]) < 4 * found.trajectory.std[-1, 9:]
    ).all()  # 1 in 2600 for all six, normal


def test_held_estimates_are_what_the_chapters_filter_has():
    """Beside an independent run of the chapter's filter (signal 1, its weights, position and field;
    medians of 6 seeds): held, accelerometer biases settle after 20.9 s, attitude 0.093 deg, 183 m
    after 120 s without fixes (5 seeds); decaying never, 1.24 deg, 22.5 km."""
    case, rows = BY_NAME["mekf, position + field"], []
    for seed in range(900, 905):
        recording = signals.recording("signal 1", seed)
        for tuning in (CHAPTER, FADING):
            run = fossen_cases.run(recording, case, tuning, "signal 1", seed)
            found = fossen_cases.numbers(run, 300.0)
            found |= fossen_runs._dropout(recording, case, tuning, "signal 1", seed)
            rows.append(found | {"tuning": tuning})
    median = pd.DataFrame(rows).groupby("tuning").median(numeric_only=True).T
    held, decaying = median[CHAPTER], median[FADING]
    assert 15 < held["accel_s"] < 30 and np.degrees(held["attitude_rad"]) < 0.15
    assert held["accel_m_s2"] < 0.0015 and held["position_after_m"] < 1000
    assert decaying["accel_s"] == np.inf and 1.0 < np.degrees(decaying["attitude_rad"]) < 1.5
    assert decaying["accel_m_s2"] > 0.03 and 15e3 < decaying["position_after_m"] < 30e3
    assert held["accel_left"] == pytest.approx(1.0, abs=1e-9)
