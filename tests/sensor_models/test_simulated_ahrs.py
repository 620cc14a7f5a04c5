"""The AHRS: white rotations on the true attitude, of the standard deviations stated, in steep
attitudes too; its place in scenarios and files."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState
from strapdown.core.mathematics.source import new_source
from strapdown.data.solution import Trajectory
from strapdown.io import read
from strapdown.io.readers.netcdf import write_recording
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import hand_held
from strapdown.sim.scenario import Scenario, scenario
from strapdown.sim.synthesis import Simulator, simulate
from strapdown.sim.trajectory import DEG, demo_flight

STD = (0.02, 0.03, 0.05)  # rad
PLACE = (48 * DEG, 11 * DEG, 500.0)
FLIGHT = Scenario("flight", demo_flight(), 20.0, 50.0)
OTHERS = {
    "magnetometer": Magnetometer(rate=20.0, field=(21e-6, 1e-6, 43e-6)),
    "barometer": Barometer(rate=5.0, drift=100.0),
}
pytestmark = pytest.mark.short


def truth(n=2000, seed=1):
    """A trajectory whose attitude is anything, also upside down and steep."""
    t = 0.1 * np.arange(n)
    turn = Rotation.random(n, np.random.default_rng(seed))
    return Trajectory(t, np.tile(PLACE, (n, 1)), np.zeros((n, 3)), turn.as_quat()[:, [3, 0, 1, 2]])


def errors(fixes, path):
    """(m, 3) rotation vectors from the true to the measured attitude, about horizontal forward
    and right and down, by scipy alone."""
    there = Rotation.from_quat(path.q_nb[np.searchsorted(path.t, fixes.t - 1e-9)][:, [1, 2, 3, 0]])
    in_n = (Rotation.from_euler("ZYX", fixes.y[:, ::-1]) * there.inv()).as_rotvec()
    x, y = there.as_matrix()[:, :2, 0].T
    return Rotation.from_euler("Z", np.arctan2(y, x)[:, None]).inv().apply(in_n)


def test_errors_are_white_independent_and_of_the_std_stated():
    """Mean, variance, correlation between axes and between fixes: each within its 99.99 % band
    (all: 0.2 % false alarms)."""
    path = truth()
    fixes = Ahrs(rate=None, std=STD).measure(path, np.random.default_rng(2))
    whitened, n = errors(fixes, path) / STD, len(fixes.t)
    assert fixes.kind == "attitude" and n == len(path.t) - 1 and (fixes.std == STD).all()
    low, high = chi2.ppf([5e-5, 1 - 5e-5], n) / n
    assert ((whitened**2).mean(axis=0) > low).all() and ((whitened**2).mean(axis=0) < high).all()
    bound = norm.ppf(1 - 5e-5) / np.sqrt(n)
    products = [
        *whitened.mean(axis=0),
        *(whitened[:, i] @ np.roll(whitened, 1, axis=1)[:, i] / n for i in range(3)),
        *(whitened[1:] * whitened[:-1]).mean(axis=0),
    ]
    assert np.abs(products).max() < bound


def test_at_the_truth_the_innovation_is_the_error_that_was_drawn():
    """Through the observer of the source: NIS is chi-square of three degrees of freedom per fix,
    in a 99.9 % band. Forward is by the measured heading."""
    path, std = truth(600, 3), (0.02, 0.02, 0.05)
    fixes = Ahrs(rate=None, std=std).measure(path, np.random.default_rng(4))
    observe, belief = (
        aiding.find("attitude").observe.py_func,
        InitialState(
            0.0, PLACE, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
        ).belief(np.zeros(1)),
    )
    innovations = np.zeros((len(fixes.t), 3))
    for row, y in enumerate(fixes.y):
        belief.C_nb[:] = path.rotation[row + 1].as_matrix()
        assert observe(belief, y, new_source(), innovations[row], np.zeros((3, 15))) == 3
    drawn, level = errors(fixes, path), np.abs(path.rph[1:, 1]) < 1.0
    np.testing.assert_allclose(np.hypot(*innovations.T[:2]), np.hypot(*drawn.T[:2]), atol=1e-9)
    np.testing.assert_allclose(innovations[:, 2], drawn[:, 2], atol=1e-9)
    # the error of the heading times that of the tilt
    np.testing.assert_allclose(innovations[level], drawn[level], atol=0.02)
    low, high = chi2.ppf([0.0005, 0.9995], innovations.size)
    assert low < np.sum((innovations / std) ** 2) < high


def test_without_errors_it_is_the_truth_also_between_its_rows():
    path = simulate(hand_held(PLACE), 10.0, "navigation").reference
    exact = Ahrs(rate=10.0, std=STD).plan(path).exact()
    np.testing.assert_allclose(exact.y, path.rph[10::10], atol=1e-12)
    between = Ahrs(rate=30.0, std=STD).plan(path).exact()
    turn = Rotation.from_euler("ZYX", between.y[:, ::-1])
    wanted = Rotation.from_quat(path.q_nb[:, [1, 2, 3, 0]])
    nearest = np.rint(between.t * 100).astype(int)
    assert (
        turn * wanted[nearest].inv()
    ).magnitude().max() < 3.5 * 0.005 * 1.01  # rad/s of the hand, half a sample


def test_an_ahrs_changes_no_draw_of_the_others():
    runs = [
        Simulator(FLIGHT.replace(**change)).run("consumer", np.random.SeedSequence(4))
        for change in (OTHERS, OTHERS | {"attitude": Ahrs(5.0)}, {"attitude": Ahrs(5.0)})
    ]
    (bare, start), (whole, same), (alone, _) = runs
    assert start == same and [a.kind for a in whole.sources] == [
        "position",
        "velocity",
        "magnetic-field",
        "pressure",
        "attitude",
    ]
    for one, other in [
        *zip(bare.imu, whole.imu),
        *((a.y, b.y) for a, b in zip(bare.sources, whole.sources)),
    ]:
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(alone.sources[2].y, whole.sources[4].y)


def test_a_recording_with_it_is_written_and_read(tmp_path):
    made = simulate("demo", duration=10.0, seed=2, attitude=Ahrs(4.0, STD))
    write_recording(made, tmp_path / "a.nc")
    fixes, again = made.sources[-1], read(tmp_path / "a.nc").sources[-1]
    assert (again.kind, again.name, len(again.t)) == ("attitude", "AHRS", 40)
    np.testing.assert_array_equal(
        np.c_[fixes.t, fixes.y, fixes.std], np.c_[again.t, again.y, again.std]
    )
    assert (
        Simulator(FLIGHT.replace(attitude=Ahrs(), gate=np.inf)).ideal_recording().sources[-1].gate
        == np.inf
    )


def test_a_rate_that_leaves_no_fix_is_noted():
    made = simulate("demo", duration=5.0, seed=2, attitude=Ahrs(0.1))
    assert made.sources[-1].y.shape == (0, 3) and made.meta["notes"] == [
        "AHRS: not one fix falls into the recording; its rate is too low"
    ]


FILE = """
[motion]
kind = "static"
start = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }

[attitude]
rate_hz = 5
std_deg = [0.2, 0.2, 1.5]
"""


def written(folder, text):
    path = folder / "mine.toml"
    path.write_text("duration_s = 10\n" + text)
    return path


def test_a_scenario_file_with_it(tmp_path):
    made = scenario(written(tmp_path, FILE))
    assert made.attitude == Ahrs(5.0, tuple(np.radians([0.2, 0.2, 1.5])))
    described = made.describe()
    assert (
        json.loads(json.dumps(described, allow_nan=False)) == described
        and described["attitude"]["rate"] == 5
    )
    assert (
        "attitude" not in FLIGHT.describe()
        and described["fingerprint"] != made.replace(attitude=None).describe()["fingerprint"]
    )
    assert len(Simulator(made).recording(made.imu, np.random.default_rng(1)).sources[-1].t) == 50
    assert scenario(
        written(tmp_path, FILE.replace("[0.2, 0.2, 1.5]", "0.5"))
    ).attitude.std == pytest.approx((0.5 * DEG,) * 3)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("std_deg", "std_rad", r"\[attitude\]: unknown key 'std_rad' .did you mean 'std_deg'"),
        (
            "rate_hz = 5",
            "rate_hz = 0",
            "attitude: rate is 0.0 Hz; it must be a finite number above 0",
        ),
        (
            "rate_hz = 5",
            "rate_hz = 101",
            "attitude: 101 a second come faster than the IMU's samples, 100",
        ),
        ("[0.2, 0.2, 1.5]", "[0.2, 1.5]", r"\[attitude\] std_deg has 2 numbers"),
        ("[0.2, 0.2, 1.5]", '"low"', "must be a finite number"),
        ("[0.2, 0.2, 1.5]", "[0.2, 0.0, 1.5]", "3 finite numbers.* above 0"),
        ("[0.2, 0.2, 1.5]", "[0.2, 45, 1.5]", "at most 0.523599"),
        ("[attitude]", "[[attitude]]", r"write a section \[attitude\]"),
    ],
)
def test_mistakes_in_a_file_are_refused_in_one_line(tmp_path, old, new, words):
    assert old in FILE
    with pytest.raises(DataError, match=words) as error:
        scenario(written(tmp_path, FILE.replace(old, new)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"rate": -1}, "rate is -1"),
        ({"rate": "10"}, "rate is '10'"),
        ({"std": (0.1, 0.1)}, "3 finite numbers.* above 0"),
        ({"std": None}, "3 finite numbers"),
        ({"std": (0.1, np.nan, 0.1)}, "3 finite numbers"),
        ({"std": 2.0}, "heading, rad, each above 0 and at most 0.523599"),
    ],
)
def test_what_no_ahrs_is_is_refused(change, words):
    with pytest.raises(DataError, match=words):
        Ahrs(**change)
    with pytest.raises(DataError, match="attitude must be a Ahrs or None"):
        FLIGHT.replace(attitude=3)
    with pytest.raises(DataError, match="the trajectory has no attitude"):
        Ahrs().plan(Trajectory(np.arange(3.0), np.zeros((3, 3))))
