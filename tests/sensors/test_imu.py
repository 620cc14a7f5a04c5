"""The IMU error model: units against hand-made conversions, errors against the laws they obey, files against every way to write them wrong."""
from dataclasses import replace

import numpy as np
import pytest

from strapdown.core.contract import Imu
from strapdown.data import DataError
from strapdown.sensors.imu import UNITS, ImuSpec, Triad, grade, grades

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
    assert mine.gyro.noise == pytest.approx(4.3633e-5, rel=1e-5)            # 0.15 deg/sqrt(h)
    assert mine.gyro.turn_on_bias == pytest.approx(np.radians(0.01))
    assert mine.gyro.bias_walk == pytest.approx(np.radians(3 / 3600) / 60)
    assert (mine.accel.noise, mine.accel.gauss_markov, mine.accel.time_constant) == pytest.approx((9.80665e-4, 0.0196133, 300.0))
    assert mine.accel.turn_on_bias == mine.accel.bias_walk == 0.0


@pytest.mark.parametrize("one, factor, other", [
    ("deg/s/sqrt(Hz)", 60, "deg/sqrt(h)"), ("deg/h/sqrt(Hz)", 1 / 60, "deg/sqrt(h)"), ("rad/sqrt(s)", 180 / np.pi * 60, "deg/sqrt(h)"),
    ("mg/sqrt(Hz)", 1000, "ug/sqrt(Hz)"), ("ug/sqrt(Hz)", 9.80665e-6 * 60, "m/s/sqrt(h)"), ("m/s^2/sqrt(Hz)", 60, "m/s/sqrt(h)"),
    ("deg/s", 3600, "deg/h"), ("g", 1000, "mg"), ("mg", 1000, "ug"), ("m/s^2", 1 / 9.80665, "g"), ("mdps/sqrt(Hz)", 1e-3, "deg/s/sqrt(Hz)"),
    ("deg/s/sqrt(s)", 3600 * 60, "deg/h/sqrt(h)"), ("deg/s/sqrt(h)", 1 / 60, "deg/s/sqrt(s)"), ("deg/h/sqrt(s)", 60, "deg/h/sqrt(h)"),
    ("mg/sqrt(s)", 60, "mg/sqrt(h)"), ("ug/sqrt(h)", 1e-3, "mg/sqrt(h)"), ("m/s^2/sqrt(h)", 1 / 60, "m/s^2/sqrt(s)"),
    ("ug/sqrt(s)", 9.80665e-6, "m/s^3/sqrt(Hz)"), ("h", 60, "min")])
def test_units_of_one_quantity_agree(one, factor, other):
    table = next(units for units in UNITS.values() if one in units)
    assert table[one] == pytest.approx(factor * table[other], rel=1e-12)


def test_a_written_file_reads_back_equal(tmp_path):
    specs = [grade(name) for name in grades()] + [ImuSpec('odd "name" \\ with\nlines', Triad(noise=0.1), Triad(), "")]
    for made in specs:
        made.to_toml(tmp_path / "copy.toml")
        assert ImuSpec.from_toml(tmp_path / "copy.toml") == made
    assert [entry.name for entry in tmp_path.iterdir()] == ["copy.toml"]


@pytest.mark.parametrize("old, new, words", [
    ("noise = { value = 0.15", "nosie = { value = 0.15", r"imu.toml, \[gyro\]: unknown key 'nosie' \(did you mean 'noise'\?\)"),
    ("[accel]", "[acel]", r"unknown key 'acel' \(did you mean 'accel'\?\)"),
    ("[accel]", "[gyro.accel]", r"\[gyro\]: unknown key 'accel'"),
    ('unit = "deg/sqrt(h)"', 'unit = "deg/sqrt(hr)"', r"gyro.noise: unknown unit 'deg/sqrt\(hr\)' \(did you mean 'deg/sqrt\(h\)'\?\)"),
    ('unit = "deg/sqrt(h)"', 'unit = "ug/sqrt(Hz)"', "gyro.noise: unknown unit"),
    (', unit = "deg/sqrt(h)"', "", "gyro.noise: unit is missing"),
    ('{ value = 0.15, unit = "deg/sqrt(h)" }', "0.15", r"gyro.noise: 0.15 has no unit; write { value = 0.15, unit = "),
    ('{ value = 0.15, unit = "deg/sqrt(h)" }', '{ value = 0.15, units = "deg/sqrt(h)" }', r"unknown key 'units' \(did you mean 'unit'\?\)"),
    ("value = 0.15", "value = -0.15", "gyro.noise is -0.15; it must be"),
    ("value = 0.15", "value = nan", "gyro.noise is nan; it must be"),
    ("value = 0.15", "value = true", "gyro.noise is True; it must be"),
    ("value = 0.15", 'value = "0.15"', "gyro.noise is '0.15'; it must be"),
    ('noise = { value = 0.15, unit = "deg/sqrt(h)" }', "", r"\[gyro\]: noise is missing"),
    ('time_constant = { value = 5, unit = "min" }', "", r"\[accel\]: gauss_markov is given without time_constant"),
    ('gauss_markov = { value = 2, unit = "mg" }', "", r"\[accel\]: time_constant is given without gauss_markov"),
    ('name = "mine"', "name = 3", "name must be text"),
    ('name = "mine"', "name = ", "not valid TOML"),
    ('unit = "min"', "unit = [1]", r"accel.time_constant: unknown unit \[1\]"),
])
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
    with pytest.raises(DataError, match="not a UTF-8"):
        ImuSpec.from_toml(tmp_path / "binary.toml")
    for path in (tmp_path / "no" / "imu.toml", tmp_path):
        with pytest.raises(DataError, match="cannot be written"):
            grade("tactical").to_toml(path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["binary.toml"]


def test_grades_by_name_by_path_and_by_value(tmp_path):
    assert {"consumer", "industrial", "tactical", "navigation", "paper1-consumer", "paper1-tactical", "paper1-navigation"} <= set(grades())
    assert all(grade(name).name == name and grade(name).source for name in grades())
    tactical = grade("tactical")
    assert grade(tactical) is tactical
    tactical.to_toml(tmp_path / "own.toml")
    assert grade(tmp_path / "own.toml") == tactical
    with pytest.raises(DataError, match=r"unknown IMU grade 'tactcal' \(did you mean 'tactical'\?\); grades: consumer, industrial"):
        grade("tactcal")
    with pytest.raises(DataError, match="absent.toml: cannot be read"):
        grade("absent.toml")


def test_better_grades_have_better_gyros_and_turn_on_biases():
    ladder = [grade(name).datasheet() for name in ("consumer", "industrial", "tactical", "navigation")]
    for term in ("gyro noise, deg/sqrt(h)", "gyro turn-on bias, deg/h", "gyro gauss markov, deg/h", "accel turn-on bias, mg"):
        values = [row[term] for row in ladder]
        assert values == sorted(values, reverse=True) and values[-1] < 0.05 * values[0], term


def test_the_grades_of_table_iii():
    rows = {"consumer": (1.31e-2, 1.15e-1, 300, 2.30e-3, 9.81e-3, 300), "tactical": (3.3e-4, 9.81e-3, 3600, 3.6361e-5, 4.8481e-6, 3600),
            "navigation": (1e-12, 1e-5, 3600, 1e-7, 1e-8, 3600)}
    for name, (vrw, sd_a, tau_a, arw, sd_g, tau_g) in rows.items():
        paper = grade("paper1-" + name)
        assert paper.bias_sd() == (sd_a, sd_g)
        expected = (arw, vrw, sd_g * np.sqrt(2 / tau_g), sd_a * np.sqrt(2 / tau_a), 1 / tau_g, 1 / tau_a)
        np.testing.assert_allclose(paper.noise(), expected, rtol=1e-14)


def test_one_bias_state_stands_for_several_terms():
    noise = lambda **terms: spec(**terms).noise()[3::2]
    assert noise(bias_walk=0.3) == (0.3, 0.0)
    assert noise(gauss_markov=0.2, time_constant=50.0) == (pytest.approx(0.04), 0.02)
    assert noise(gauss_markov=0.2, time_constant=50.0, bias_walk=0.03) == (pytest.approx(0.05), 0.0)
    assert noise(gauss_markov=0.2, time_constant=50.0, turn_on_bias=1.0) == (pytest.approx(0.04), 0.0)      # a constant must not be forgotten
    assert spec(gauss_markov=0.3, time_constant=50.0, turn_on_bias=0.4).bias_sd() == (pytest.approx(0.5), 0.0)


def test_representations_are_in_datasheet_units():
    assert repr(grade("tactical")) == "ImuSpec(tactical: gyro 0.15 deg/sqrt(h), bias 4.03 deg/h; accel 0.07 m/s/sqrt(h), bias 0.752 mg)"
    sheet = grade("tactical").datasheet()
    assert sheet["gyro gauss markov, deg/h"] == pytest.approx(0.5) and sheet["accel time constant, s"] == 3600 and len(sheet) == 10


@pytest.mark.parametrize("terms, words", [({"noise": -1.0}, "noise is -1.0"), ({"turn_on_bias": np.inf}, "turn_on_bias is inf"),
                                          ({"gauss_markov": 1.0}, "without time_constant"), ({"noise": "x"}, "noise is 'x'")])
def test_impossible_triads_are_refused(terms, words):
    with pytest.raises(DataError, match=words):
        Triad(**terms)


T = np.arange(400_001) * 0.01


def test_white_noise_has_the_density_asked_for():
    made, b_a, b_g = spec(noise=0.5).corrupt(still(T), np.random.default_rng(1))
    for samples in (1, 100):       # variance of a sum grows with its time
        sums = np.add.reduceat(made.dv, np.arange(0, len(made.dv), samples), axis=0)
        assert sums.std(axis=0) == pytest.approx(0.5 * np.sqrt(0.01 * samples), rel=4 / np.sqrt(2 * len(sums)))
    assert not made.dtheta.any() and not b_a.any() and not b_g.any()


def test_bias_walk_grows_with_the_root_of_time():
    draws = np.concatenate([spec(bias_walk=2.0).corrupt(still(T[::1000]), np.random.default_rng(seed))[1].T for seed in range(300)])
    for row in (1, 10, 399):
        assert draws[:, row].std() == pytest.approx(2.0 * np.sqrt(10.0 * row), rel=4 / np.sqrt(2 * 900))
    assert not draws[:, 0].any()


@pytest.mark.parametrize("uneven", [False, True], ids=["even", "uneven"])
def test_gauss_markov_is_stationary_and_forgets_exponentially(uneven):
    t = np.cumsum(np.random.default_rng(3).uniform(0.2, 5.0, 400)) if uneven else T[::250][:400]
    draws = np.concatenate([spec(gauss_markov=0.7, time_constant=20.0).corrupt(still(t), np.random.default_rng(seed))[1].T for seed in range(700)])
    assert draws.std(axis=0) == pytest.approx(0.7, rel=0.09)            # every epoch, the first as the last: 4 sigma of 2100 draws is 6 %
    for first, second in ((0, 1), (0, 5), (100, 110), (390, 398)):
        lag = t[1:][second] - t[1:][first]
        covariance = (draws[:, first] * draws[:, second]).mean()
        assert covariance == pytest.approx(0.49 * np.exp(-lag / 20), abs=0.06)


def test_turn_on_bias_is_constant_and_fresh_for_every_run():
    runs = [spec(turn_on_bias=0.2).corrupt(still(T[:200]), np.random.default_rng(seed)) for seed in range(300)]
    assert all(np.ptp(b_a, axis=0).max() == 0 for _, b_a, _ in runs)
    assert np.concatenate([b_a[0] for _, b_a, _ in runs]).std() == pytest.approx(0.2, rel=4 / np.sqrt(1800))
    made, b_a, _ = runs[0]
    np.testing.assert_allclose(made.dv, b_a * made.dt[:, None], rtol=1e-14)


def test_chance_comes_from_the_generator_alone_and_terms_do_not_share_it():
    run = lambda which, seed=5: which.corrupt(still(T[:100]), np.random.default_rng(seed))
    full, only = spec(noise=0.1, turn_on_bias=1.0, gauss_markov=1.0, time_constant=9.0, bias_walk=0.1), spec(noise=0.1)
    np.testing.assert_array_equal(run(full)[0].dv, run(full)[0].dv)
    assert not np.array_equal(run(full)[0].dv, run(full, 6)[0].dv)
    np.testing.assert_allclose(run(full)[0].dv - run(full)[1] * 0.01, run(only)[0].dv, rtol=0, atol=1e-15)
    twice = ImuSpec("test", Triad(), replace(only.accel, noise=0.2))
    np.testing.assert_allclose(run(twice)[0].dv, 2 * run(only)[0].dv, rtol=1e-15)
