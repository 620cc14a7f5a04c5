"""The IMU error model: units against hand-made conversions, errors against the laws they obey,
files against every way to write them wrong."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.sensor_models.errors import WarmUp
from strapdown.sensor_models.imu import (
    SERIES,
    ImuSpec,
    Triad,
    imu as imu_spec,
    imu_parts,
    imus,
    saturation_notes,
)
from strapdown.sensor_models.noise import FLICKER_FLOOR, gauss_markov_variance
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.synthesis import simulate
from strapdown.units.conversion import UNITS

FILE = """
name = "mine"
source = "a datasheet"
[gyro]
noise = { value = 0.15, unit = "deg/sqrt(h)" }
turn_on_bias = { value = 36, unit = "deg/h" }
bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }
[accel]
noise = { value = 100, unit = "ug/sqrt(Hz)" }
gauss_markov = { value = 2, unit = "mg" }
time_constant = { value = 5, unit = "min" }
"""


def write(folder, text):
    path = folder / "imu.toml"
    path.write_text(text, encoding="utf-8")
    return path


def still(t):
    """An error-free IMU that feels nothing."""
    n = len(t) - 1
    return Imu(t[1:], np.diff(t), np.zeros((n, 3)), np.zeros((n, 3)))


def spec(**terms):
    return ImuSpec("test", Triad(), Triad(**terms))


def test_a_file_is_read_in_the_units_it_names(tmp_path):
    mine = ImuSpec.from_toml(write(tmp_path, FILE))
    assert mine.name == "mine" and mine.source == "a datasheet"
    assert mine.gyro.noise == pytest.approx(4.3633e-5, rel=1e-5)  # 0.15 deg/sqrt(h)
    assert mine.gyro.turn_on_bias == pytest.approx(np.radians(0.01))
    assert mine.gyro.bias_walk == pytest.approx(np.radians(3 / 3600) / 60)
    assert (mine.accel.noise, mine.accel.gauss_markov, mine.accel.time_constant) == pytest.approx(
        (9.80665e-4, 0.0196133, 300.0)
    )
    assert mine.accel.turn_on_bias == mine.accel.bias_walk == 0.0


@pytest.mark.parametrize(
    "one, factor, other",
    [
        ("deg/s/sqrt(Hz)", 60, "deg/sqrt(h)"),
        ("deg/h/sqrt(Hz)", 1 / 60, "deg/sqrt(h)"),
        ("rad/sqrt(s)", 180 / np.pi * 60, "deg/sqrt(h)"),
        ("mg/sqrt(Hz)", 1000, "ug/sqrt(Hz)"),
        ("ug/sqrt(Hz)", 9.80665e-6 * 60, "m/s/sqrt(h)"),
        ("m/s^2/sqrt(Hz)", 60, "m/s/sqrt(h)"),
        ("deg/s", 3600, "deg/h"),
        ("g", 1000, "mg"),
        ("mg", 1000, "ug"),
        ("m/s^2", 1 / 9.80665, "g"),
        ("mdps/sqrt(Hz)", 1e-3, "deg/s/sqrt(Hz)"),
        ("deg/s/sqrt(s)", 3600 * 60, "deg/h/sqrt(h)"),
        ("deg/s/sqrt(h)", 1 / 60, "deg/s/sqrt(s)"),
        ("deg/h/sqrt(s)", 60, "deg/h/sqrt(h)"),
        ("mg/sqrt(s)", 60, "mg/sqrt(h)"),
        ("ug/sqrt(h)", 1e-3, "mg/sqrt(h)"),
        ("m/s^2/sqrt(h)", 1 / 60, "m/s^2/sqrt(s)"),
        ("ug/sqrt(s)", 9.80665e-6, "m/s^3/sqrt(Hz)"),
        ("h", 60, "min"),
        ("%", 1e4, "ppm"),
        ("mrad", 1000, "urad"),
        ("deg", 3600, "arcsec"),
        ("ug*s", 9.80665e-3, "mm/s"),
        ("deg/s/g", 3600, "deg/h/g"),
        ("rad/s/(m/s^2)", 9.80665 * 180 / np.pi, "deg/s/g"),
    ],
)
def test_units_of_one_quantity_agree(one, factor, other):
    table = next(units for units in UNITS.values() if one in units)
    assert table[one] == pytest.approx(factor * table[other], rel=1e-12)


def test_a_written_file_reads_back_equal(tmp_path):
    everything = Triad(
        0.1,
        0.2,
        0.3,
        0.4,
        5.0,
        0.6,
        7e-4,
        8e-4,
        0.0,
        1e-3,
        11.0,
        ((-20, 1, 2, 3), (30.5, -4, 5, 6.25)),
    )
    specs = [imu_spec(name) for name in imus()] + [
        ImuSpec(
            "full",
            replace(everything, g_sensitivity=1e-5),
            everything,
            "all",
            WarmUp(-5.0, 30.0, 600.0),
        )
    ]
    specs += [ImuSpec('odd "name" \\ with\nlines', Triad(noise=0.1), Triad(), "")]
    for made in specs:
        made.to_toml(tmp_path / "copy.toml")
        assert ImuSpec.from_toml(tmp_path / "copy.toml") == made
        # as it is stored with a recording
        assert imu_spec(json.loads(json.dumps(asdict(made)))) == made
    assert [entry.name for entry in tmp_path.iterdir()] == ["copy.toml"]


@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            "noise = { value = 0.15",
            "nosie = { value = 0.15",
            r"imu.toml: \[gyro\]: unknown key 'nosie' \(did you mean 'noise'\?\)",
        ),
        ("[accel]", "[acel]", r"unknown key 'acel' \(did you mean 'accel'\?\)"),
        ("[accel]", "[gyro.accel]", r"\[gyro\]: unknown key 'accel'"),
        (
            'unit = "deg/sqrt(h)"',
            'unit = "deg/sqrt(hr)"',
            r"\[gyro\] noise: unknown unit 'deg/sqrt\(hr\)' \(did you mean 'deg/sqrt\(h\)'\?\)",
        ),
        (
            'unit = "deg/sqrt(h)"',
            'unit = "ug/sqrt(Hz)"',
            r"\[gyro\] noise: unit .* is one of velocity random walk",
        ),
        (', unit = "deg/sqrt(h)"', "", r"\[gyro\] noise: unit is missing"),
        (
            '{ value = 0.15, unit = "deg/sqrt(h)" }',
            "0.15",
            r"\[gyro\] noise: 0.15 has no unit; write { value = 0.15, unit = ",
        ),
        (
            '{ value = 0.15, unit = "deg/sqrt(h)" }',
            '{ value = 0.15, units = "deg/sqrt(h)" }',
            r"unknown key 'units' \(did you mean 'unit'\?\)",
        ),
        ("value = 0.15", "value = -0.15", "\\[gyro\\] noise is -0.15; it must be"),
        ("value = 0.15", "value = nan", "\\[gyro\\] noise is nan; it must be"),
        ("value = 0.15", "value = true", "\\[gyro\\] noise is True; it must be"),
        ("value = 0.15", 'value = "0.15"', "\\[gyro\\] noise is '0.15'; it must be"),
        (
            'noise = { value = 0.15, unit = "deg/sqrt(h)" }',
            "",
            r"\[gyro\] noise is missing; write noise = ",
        ),
        (
            'time_constant = { value = 5, unit = "min" }',
            "",
            r"\[accel\]: gauss_markov is given without time_constant",
        ),
        (
            'gauss_markov = { value = 2, unit = "mg" }',
            "",
            r"\[accel\]: time_constant is given without gauss_markov",
        ),
        ('name = "mine"', "name = 3", "name is 3; it must be text"),
        ('name = "mine"', "name = ", "is not TOML"),
        ('unit = "min"', "unit = [1]", r"\[accel\] time_constant: unknown unit \[1\]"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, old, new, words):
    assert old in FILE
    with pytest.raises(DataError, match=words) as caught:
        ImuSpec.from_toml(write(tmp_path, FILE.replace(old, new, 1)))
    assert "imu.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_unreadable_and_unwritable_paths_are_refused(tmp_path):
    for path in (tmp_path / "absent.toml", tmp_path):
        with pytest.raises(DataError, match="cannot be read"):
            ImuSpec.from_toml(path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="is not UTF-8"):
        ImuSpec.from_toml(tmp_path / "binary.toml")
    for path in (tmp_path / "no" / "imu.toml", tmp_path):
        with pytest.raises(DataError, match="cannot be written"):
            imu_spec("tactical").to_toml(path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["binary.toml"]


def test_grades_by_name_by_path_and_by_value(tmp_path):
    assert {
        "consumer",
        "industrial",
        "tactical",
        "navigation",
        "paper1-consumer",
        "paper1-tactical",
        "paper1-navigation",
    } <= set(imus())
    assert all(imu_spec(name).name == name and imu_spec(name).source for name in imus())
    tactical = imu_spec("tactical")
    assert imu_spec(tactical) is tactical
    tactical.to_toml(tmp_path / "own.toml")
    assert imu_spec(tmp_path / "own.toml") == tactical
    with pytest.raises(
        DataError,
        match=r"unknown IMU 'tactcal' \(did you mean 'tactical'\?\); grades: consumer, dmu10, industrial",
    ):
        imu_spec("tactcal")
    with pytest.raises(DataError, match="absent.toml: cannot be read"):
        imu_spec("absent.toml")


@pytest.mark.parametrize(
    "name, grade",
    [
        ("MPU9999", "consumer"),
        ("icm-42688-p", "consumer"),
        ("ADIS16505", "industrial"),
        ("Epson", None),
        ("HG4930", "tactical"),
        ("hg9900", "navigation"),
    ],
)
def test_an_unknown_part_gets_the_grade_of_its_kind(name, grade):
    with pytest.raises(DataError) as refused:
        imu_spec(name)
    text = str(refused.value)
    assert ("a part like it is of the grade" in text) == (grade is not None)
    assert grade is None or (f"the grade {grade!r}" in text and "did you mean" not in text)


def test_every_series_has_a_grade():
    assert set(SERIES) <= set(imus())


def test_better_grades_have_better_gyros_and_turn_on_biases():
    ladder = [
        imu_spec(name).datasheet() for name in ("consumer", "industrial", "tactical", "navigation")
    ]
    for term in (
        "gyro noise, deg/sqrt(h)",
        "gyro turn-on bias, deg/h",
        "gyro gauss markov, deg/h",
        "accel turn-on bias, mg",
    ):
        values = [row[term] for row in ladder]
        assert values == sorted(values, reverse=True) and values[-1] < 0.05 * values[0], term


def test_the_grades_of_table_iii():
    rows = {
        "consumer": (1.31e-2, 1.15e-1, 300, 2.30e-3, 9.81e-3, 300),
        "tactical": (3.3e-4, 9.81e-3, 3600, 3.6361e-5, 4.8481e-6, 3600),
        "navigation": (1e-12, 1e-5, 3600, 1e-7, 1e-8, 3600),
    }
    for name, (vrw, std_a, tau_a, arw, std_g, tau_g) in rows.items():
        paper = imu_spec("paper1-" + name)
        assert paper.bias_std() == (std_a, std_g)
        expected = (
            arw,
            vrw,
            std_g * np.sqrt(2 / tau_g),
            std_a * np.sqrt(2 / tau_a),
            1 / tau_g,
            1 / tau_a,
        )
        np.testing.assert_allclose(paper.noise(), (*expected, 0.0), rtol=1e-14)


def test_one_bias_state_stands_for_several_terms():
    noise = lambda **terms: spec(**terms).noise()[3::2]
    assert noise(bias_walk=0.3) == (0.3, 0.0)
    assert noise(gauss_markov=0.2, time_constant=50.0) == (pytest.approx(0.04), 0.02)
    assert noise(gauss_markov=0.2, time_constant=50.0, bias_walk=0.03) == (pytest.approx(0.05), 0.0)
    # a constant must not be forgotten
    assert noise(gauss_markov=0.2, time_constant=50.0, turn_on_bias=1.0) == (
        pytest.approx(0.04),
        0.0,
    )
    assert spec(gauss_markov=0.3, time_constant=50.0, turn_on_bias=0.4).bias_std() == (
        pytest.approx(0.5),
        0.0,
    )


def test_representations_are_in_datasheet_units():
    assert (
        repr(imu_spec("tactical"))
        == "ImuSpec(tactical: gyro 0.15 deg/sqrt(h), bias 4.03 deg/h; accel 0.07 m/s/sqrt(h), bias 0.752 mg)"
    )
    sheet = imu_spec("tactical").datasheet()
    assert (
        sheet["gyro gauss markov, deg/h"] == pytest.approx(0.5)
        and sheet["accel time constant, s"] == 3600
    )
    assert sum(1 for value in sheet.values() if value) == 8


@pytest.mark.parametrize(
    "terms, words",
    [
        ({"noise": -1.0}, "noise is -1.0"),
        ({"turn_on_bias": np.inf}, "turn_on_bias is inf"),
        ({"gauss_markov": 1.0}, "without time_constant"),
        ({"noise": "x"}, "noise is 'x'"),
    ],
)
def test_impossible_triads_are_refused(terms, words):
    with pytest.raises(DataError, match=words):
        Triad(**terms)


T = np.arange(400_001) * 0.01


def test_white_noise_has_the_density_asked_for():
    made, b_a, b_g = spec(noise=0.5).corrupt(still(T), np.random.default_rng(1))
    for samples in (1, 100):  # variance of a sum grows with its time
        sums = np.add.reduceat(made.dv, np.arange(0, len(made.dv), samples), axis=0)
        assert sums.std(axis=0) == pytest.approx(
            0.5 * np.sqrt(0.01 * samples), rel=4 / np.sqrt(2 * len(sums))
        )
    assert not made.dtheta.any() and not b_a.any() and not b_g.any()


def test_bias_walk_grows_with_the_root_of_time():
    draws = np.concatenate(
        [
            spec(bias_walk=2.0).corrupt(still(T[::1000]), np.random.default_rng(seed))[1].T
            for seed in range(300)
        ]
    )
    for row in (1, 10, 399):
        assert draws[:, row].std() == pytest.approx(
            2.0 * np.sqrt(10.0 * row), rel=4 / np.sqrt(2 * 900)
        )
    assert not draws[:, 0].any()


@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
def test_gauss_markov_is_stationary_and_forgets_exponentially(uneven):
    t = np.cumsum(np.random.default_rng(3).uniform(0.2, 5.0, 400)) if uneven else T[::250][:400]
    draws = np.concatenate(
        [
            spec(gauss_markov=0.7, time_constant=20.0)
            .corrupt(still(t), np.random.default_rng(seed))[1]
            .T
            for seed in range(700)
        ]
    )
    # every epoch, the first as the last: 4 sigma of 2100 draws is 6 %
    assert draws.std(axis=0) == pytest.approx(0.7, rel=0.09)
    for first, second in ((0, 1), (0, 5), (100, 110), (390, 398)):
        lag = t[1:][second] - t[1:][first]
        covariance = (draws[:, first] * draws[:, second]).mean()
        assert covariance == pytest.approx(0.49 * np.exp(-lag / 20), abs=0.06)


def test_turn_on_bias_is_constant_and_fresh_for_every_run():
    runs = [
        spec(turn_on_bias=0.2).corrupt(still(T[:200]), np.random.default_rng(seed))
        for seed in range(300)
    ]
    assert all(np.ptp(b_a, axis=0).max() == 0 for _, b_a, _ in runs)
    assert np.concatenate([b_a[0] for _, b_a, _ in runs]).std() == pytest.approx(
        0.2, rel=4 / np.sqrt(1800)
    )
    made, b_a, _ = runs[0]
    np.testing.assert_allclose(made.dv, b_a * made.dt[:, None], rtol=1e-14)


def test_chance_comes_from_the_generator_alone_and_terms_do_not_share_it():
    run = lambda which, seed=5: which.corrupt(still(T[:100]), np.random.default_rng(seed))
    full, only = (
        spec(noise=0.1, turn_on_bias=1.0, gauss_markov=1.0, time_constant=9.0, bias_walk=0.1),
        spec(noise=0.1),
    )
    np.testing.assert_array_equal(run(full)[0].dv, run(full)[0].dv)
    assert not np.array_equal(run(full)[0].dv, run(full, 6)[0].dv)
    np.testing.assert_allclose(
        run(full)[0].dv - run(full)[1] * 0.01, run(only)[0].dv, rtol=0, atol=1e-15
    )
    twice = ImuSpec("test", Triad(), replace(only.accel, noise=0.2))
    np.testing.assert_allclose(run(twice)[0].dv, 2 * run(only)[0].dv, rtol=1e-15)


def moving(t, rate=(0.1, -0.2, 0.3), force=(1.0, 2.0, -9.8)):
    """An error-free IMU with a constant rate (rad/s) and force (m/s^2)."""
    dt = np.diff(t)
    return Imu(t[1:], dt, dt[:, None] * np.array(rate), dt[:, None] * np.array(force))


def drawn(field, triads, seeds=300):
    """(seeds, 3, 3) mean errors of rate (or force) that the one term `triads` = (gyro, accel)
    makes, one matrix column per driven axis."""
    made = np.empty((seeds, 3, 3))
    for axis in range(3):
        unit = moving(
            T[:3],
            *(np.eye(3)[axis] if name == field else np.zeros(3) for name in ("rate", "force")),
        )
        for seed in range(seeds):
            bad, _, _ = ImuSpec("test", *triads).corrupt(unit, np.random.default_rng(seed))
            measured, true = (
                (bad.dtheta, unit.dtheta) if triads[0] != Triad() else (bad.dv, unit.dv)
            )
            made[seed, :, axis] = (measured - true)[0] / unit.dt[0]
    return made


@pytest.mark.deep
def test_scale_factor_misalignment_and_g_sensitivity_are_fresh_matrices_of_their_size():
    within, off = (
        lambda values, std: values.std() == pytest.approx(std, rel=4 / np.sqrt(2 * values.size)),
        ~np.eye(3, dtype=bool),
    )
    scale = drawn("force", (Triad(), Triad(scale_factor=1e-3)))
    assert within(scale[:, ~off], 1e-3) and np.abs(scale[:, off]).max() < 1e-12
    turned = drawn("rate", (Triad(misalignment=2e-3), Triad()))
    assert within(turned[:, off], 2e-3) and np.abs(turned[:, ~off]).max() < 1e-12
    assert within(drawn("force", (Triad(g_sensitivity=1e-4), Triad())), 1e-4)
    assert not drawn("rate", (Triad(g_sensitivity=1e-4), Triad()), 3).any()


def test_quantised_increments_are_whole_steps_and_lose_nothing():
    true = moving(T[:2000])
    made, _, _ = ImuSpec("test", Triad(quantisation=3e-4), Triad(noise=0.01)).corrupt(
        true, np.random.default_rng(1)
    )
    steps = made.dtheta / 3e-4
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    assert np.abs(np.cumsum(made.dtheta - true.dtheta, axis=0)).max() <= 3e-4 * (1 + 1e-9)


def test_saturated_samples_are_clipped_and_counted():
    true = moving(T[:101])
    true.dtheta[10:30, 1] *= 4
    true.dv[5, 2] *= -3
    full = ImuSpec("test", Triad(saturation=0.5), Triad(saturation=20.0))
    made, _, _ = full.corrupt(true, np.random.default_rng(1))
    assert np.abs(made.dtheta).max() == pytest.approx(0.5 * 0.01) and np.abs(
        made.dv
    ).max() == pytest.approx(20 * 0.01)
    assert np.sign(made.dtheta[10, 1]) == np.sign(true.dtheta[10, 1]) and made.dv[5, 2] > 0
    np.testing.assert_array_equal(made.dtheta[:10], true.dtheta[:10])
    assert saturation_notes(full, made) == [
        "gyro: 20 of 100 samples saturated at 28.65 deg/s",
        "accelerometer: 1 of 100 samples saturated at 2.039 g",
    ]
    assert (
        saturation_notes(full, moving(T[:101]))
        == []
        == saturation_notes(imu_spec("tactical"), made)
    )


def test_a_simulated_recording_has_the_temperature_of_its_warm_up():
    table = ((0, 0, 0, 0), (50, 1, 0, 0))
    warm = ImuSpec("test", Triad(), Triad(temperature=table), warm_up=WarmUp(10.0, 40.0, 20.0))
    made = simulate("car", 60.0, warm, seed=1)
    t, degrees = made.meta["temperature"].T
    assert degrees == pytest.approx(40 - 30 * np.exp(-(t - made.span[0]) / 20))
    assert (t[0], t[-1]) == made.span and len(t) == 61
    assert "temperature" not in simulate("car", 60.0, "consumer", seed=1).meta


def test_temperature_bias_follows_the_table_along_the_warm_up():
    table = ((0, 0, 1, 0), (20, 2, 1, 0), (40, 2, 1, -4))
    warm = ImuSpec("test", Triad(), Triad(temperature=table), warm_up=WarmUp(10.0, 40.0, 50.0))
    made, b_a, _ = warm.corrupt(still(T[:30_000:10] + 1000.0), np.random.default_rng(1))
    temperature = 40 - 30 * np.exp(-(made.t - 1000.0) / 50)
    np.testing.assert_allclose(b_a[:, 0], np.minimum(temperature / 10, 2), rtol=1e-9)
    np.testing.assert_allclose(
        b_a[:, 2], -np.maximum(temperature - 20, 0) / 5, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(made.dv, b_a * made.dt[:, None], rtol=1e-12)
    assert warm.bias_std()[0] == pytest.approx(np.sqrt((1 + 1 + 0) / 3))
    assert warm.noise()[3] == pytest.approx(np.sqrt((1 + 0 + 16) / 3 / 50))
    drift = np.sqrt(np.mean((b_a - b_a[0]) ** 2, axis=1))
    q, decay = warm.accel.bias_model(warm.warm_up)
    assert decay == 0 and (drift <= 1.5 * q * np.sqrt(made.t - made.t[0]) + 1e-12).all()


def test_flicker_has_the_flat_allan_deviation_of_its_bias_instability():
    allantools = pytest.importorskip("allantools")
    taus = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
    found = np.array(
        [
            allantools.oadev(axis, rate=10.0, data_type="freq", taus=taus)[1]
            for seed in range(4)
            for axis in spec(flicker=1.0).corrupt(still(T[:400_001:10]), seed)[1].T
        ]
    )
    mean = np.sqrt((found**2).mean(axis=0))
    np.testing.assert_allclose(mean[:4], FLICKER_FLOOR, rtol=0.05)
    # 12 records with some 400 and 130 clusters: 4 sigma
    np.testing.assert_allclose(mean[4:], FLICKER_FLOOR, rtol=0.15)


def test_flicker_is_flat_within_two_percent_over_five_decades():
    from strapdown.sensor_models.noise import FLICKER_TIMES, FLICKER_VARIANCE

    tau = np.geomspace(1, 3e4, 200)
    variance = FLICKER_VARIANCE * sum(gauss_markov_variance(tau, time) for time in FLICKER_TIMES)
    np.testing.assert_allclose(np.sqrt(variance), 0.664, rtol=0.05)
    inner = (tau > 3) & (tau < 1e4)
    np.testing.assert_allclose(np.sqrt(variance[inner]), np.sqrt(2 * np.log(2) / np.pi), rtol=0.02)


def test_a_filter_takes_flicker_for_a_walk_that_meets_the_floor_where_the_white_noise_does():
    q, decay = Triad(noise=1e-3, flicker=1e-4).bias_model()
    tau = (1e-3 / (FLICKER_FLOOR * 1e-4)) ** 2
    assert decay == 0 and q * np.sqrt(tau / 3) == pytest.approx(
        FLICKER_FLOOR * 1e-4
    ) == pytest.approx(1e-3 / np.sqrt(tau))
    starts = np.array(
        [
            spec(flicker=0.3).corrupt(still(T[:3]), np.random.default_rng(seed))[1][0]
            for seed in range(300)
        ]
    )
    assert starts.std() == pytest.approx(spec(flicker=0.3).bias_std()[0], rel=4 / np.sqrt(1800))


def test_new_terms_leave_the_draws_of_the_old_ones_alone():
    old = Triad(noise=0.1, turn_on_bias=1.0, gauss_markov=1.0, time_constant=9.0, bias_walk=0.1)
    new = replace(old, flicker=0.2, scale_factor=0.0, quantisation=0.0)
    run = lambda triad: ImuSpec("test", Triad(), triad).corrupt(still(T[:100]), 5)
    (plain, bias, _), (flickering, both, _) = run(old), run(new)
    # the streams of two terms, by hand
    of = RandomStream.of(5).child("accel").child
    expected = of("turn_on_bias").standard_normal(3) + of("gauss_markov").standard_normal(3)
    np.testing.assert_allclose(bias[0], expected, rtol=1e-14)
    np.testing.assert_allclose(
        flickering.dv - both * 0.01, plain.dv - bias * 0.01, rtol=0, atol=1e-14
    )


@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            "temperature = 3",
            '\\[gyro\\] temperature: write { unit = "deg/h", rows = ',
        ),
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            'temperature = { unit = "deg", rows = [] }',
            r"\[gyro\] temperature: unit 'deg' is one of angle",
        ),
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            'temperature = { unit = "deg/h", rows = [[1, 2, 3]] }',
            r"row \[1, 2, 3\] is not",
        ),
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            'temperature = { unit = "deg/h", rows = [[1, 2, 3, 4]] }',
            "has one row",
        ),
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            'temperature = { unit = "deg/h", rows = [[2, 2, 3, 4], [1, 2, 3, 4]] }',
            "do not rise",
        ),
        (
            'bias_walk = { value = 3, unit = "deg/h/sqrt(h)" }',
            'temperature = { unit = "deg/h", rows = [[2, 2, 3, 4], [4, 2, 3, 4]] }',
            "needs warm_up",
        ),
        (
            "[accel]",
            "[warm_up]\nstart = 3\n[accel]",
            r"\[warm_up\] start: 3 has no unit",
        ),
        (
            "[accel]",
            '[warm_up]\nstart = { value = 3, unit = "K" }\nend = 3\ntime_constant = 3\n[accel]',
            "\\[warm_up\\] start: unknown unit 'K'",
        ),
        (
            "[accel]",
            '[accel]\nsaturation = { value = 0, unit = "g" }',
            "\\[accel\\] saturation: the full scale is 0",
        ),
        (
            "[accel]",
            '[accel]\nscale_factor = { value = 101, unit = "%" }',
            r"\[accel\]: scale_factor is 1.01; it must be at most 1 .100 %.",
        ),
        (
            "[accel]",
            '[accel]\nmisalignment = { value = 46, unit = "deg" }',
            r"\[accel\]: misalignment is 0.802851; it must be at most 0.785 rad .45 deg.",
        ),
        (
            "[accel]",
            '[accel]\nbias_walk = { value = 1e200, unit = "m/s^2/sqrt(s)" }',
            r"\[accel\]: bias_walk is 1e\+200; it must be a finite number, 0 or more and at most",
        ),
        (
            "[accel]",
            '[accel]\ng_sensitivity = { value = 1, unit = "deg/h/g" }',
            "unknown key 'g_sensitivity'",
        ),
    ],
)
def test_what_is_wrong_with_newer_terms_is_named(tmp_path, old, new, words):
    assert old in FILE
    with pytest.raises(DataError, match=words) as caught:
        ImuSpec.from_toml(write(tmp_path, FILE.replace(old, new, 1)))
    assert "imu.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_impossible_specs_are_refused():
    rows = ((0, 1, 1, 1), (20, 1, 1, 1))
    for words, make in (
        (
            "beyond the temperature table of gyro, which covers 0 to 20",
            lambda: ImuSpec("test", Triad(temperature=rows), Triad(), warm_up=WarmUp(10, 30, 60)),
        ),
        (
            "without a temperature table",
            lambda: ImuSpec("test", Triad(), Triad(), warm_up=WarmUp(10, 30, 60)),
        ),
        (
            "g_sensitivity is an error of gyros",
            lambda: ImuSpec("test", Triad(), Triad(g_sensitivity=1.0)),
        ),
        ("time_constant is 0", lambda: WarmUp(10, 30, 0)),
    ):
        with pytest.raises(DataError, match=words):
            make()


def test_parts_of_the_market_are_found_however_they_are_written():
    assert imu_spec("MPU6050") == imu_spec("mpu-6050") == imu_spec("MPU 6050")
    assert imu_spec("stim300") == imu_spec("tactical")
    for part, own in imu_parts().items():
        spec = imu_spec(part)
        assert own in (*imus(), spec.name.lower()) and spec.source
    sheet = imu_spec("MPU-6050").datasheet()
    assert sheet["gyro noise, deg/sqrt(h)"] == pytest.approx(0.005 * 60)
    with pytest.raises(DataError, match="take consumer for a chip"):
        imu_spec("no such part")
