"""Correlated errors of a receiver: their law against that of a Gauss-Markov process, and what the
fixes say of them."""

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.data.solution import Correlated, Trajectory
from strapdown.flight.sensor_errors import fix_errors
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.scenario import scenario
from strapdown.sim.scenario_file import read
from strapdown.sim.synthesis import Simulator

STD, TIME, RUNS = (1.5, 2.0, 3.0), 30.0, 1500
TIMES = np.array([1.0, 2.0, 2.0, 7.5, 31.0, 150.0])  # irregular; two at once; an outage
LASTING = Correlated(STD, TIME)
# correlated errors alone: white ones a million times smaller
ALONE = Gnss(
    TIMES,
    1e-6,
    1e-6,
    position_correlated=LASTING,
    velocity_correlated=Correlated((0.1,) * 3, 5.0),
)


def still(seconds=200.0):
    t = np.arange(0.0, seconds + 0.5)
    lla = np.tile([0.8, 0.2, 400.0], (len(t), 1))
    return Trajectory(t, lla, np.zeros((len(t), 3)), np.tile([1.0, 0, 0, 0], (len(t), 1)))


def drawn(receiver, runs=RUNS):
    """Errors of position and velocity, (runs, fixes, axes) each, m and m/s."""
    plan = receiver.plan(still())
    exact = plan.exact()
    made = [plan.fixes(np.random.default_rng(seed)) for seed in range(runs)]
    position, velocity = (np.stack([run[k].y for run in made]) - exact[k].y for k in (0, 1))
    return position * plan.position.metres, velocity


def test_errors_have_the_correlation_and_variance_of_the_process():
    for errors, (std, time, _) in zip(
        drawn(ALONE), (ALONE.position_correlated, ALONE.velocity_correlated)
    ):
        unit = errors / std
        law = np.exp(-np.abs(TIMES[:, None] - TIMES) / time)
        found = np.einsum("rif,rjf->ij", unit, unit) / (3 * RUNS)
        # the product of two unit normals of correlation r has the variance 1 + r^2
        assert (np.abs(found - law) < 4 * np.sqrt((1 + law**2) / (3 * RUNS))).all()
        across = np.einsum("rif,rig->fg", unit[:, [0, -1]], unit[:, [0, -1]]) / (2 * RUNS)
        assert np.abs(across[np.triu_indices(3, 1)]).max() < 4 / np.sqrt(2 * RUNS)


def test_steps_between_fixes_are_exact_whatever_their_length():
    """Innovations of the process by its own law are white and of unit variance: chi-square."""
    unit = drawn(ALONE)[0] / STD
    keep = np.exp(-np.diff(TIMES) / TIME)
    moved = TIMES[1:] != TIMES[:-1]
    step = (unit[:, 1:] - keep[:, None] * unit[:, :-1])[:, moved]
    np.testing.assert_allclose(unit[:, 1], unit[:, 2], atol=1e-5)  # two fixes at one instant
    white = step / np.sqrt(1 - keep[moved] ** 2)[:, None]
    each = np.square(white).sum(axis=(0, 2))
    assert (np.abs(each - 3 * RUNS) < 4 * np.sqrt(2 * 3 * RUNS)).all()


def test_a_regular_receiver_has_the_same_law():
    receiver = ALONE._replace(interval=2.0)
    unit = drawn(receiver, 100)[0] / STD
    for lag in (0, 1, 5, 15, 40):
        found = (unit[:, lag:] * unit[:, : unit.shape[1] - lag]).mean()
        # 300 records of some 6 independent pieces each
        assert found == pytest.approx(np.exp(-2.0 * lag / TIME), abs=4 * np.sqrt(2 / 1800))


def test_white_noise_is_the_same_with_and_without():
    white = Gnss(0.5, lever_arm=(1.0, 0.0, -1.0))
    once = white._replace(
        position_correlated=LASTING, velocity_correlated=Correlated((0.2,) * 3, 5.0)
    )
    twice = white._replace(
        position_correlated=Correlated(tuple(2 * np.array(STD)), TIME),
        velocity_correlated=Correlated((0.4,) * 3, 5.0),
    )
    none, one, two = (r.fixes(still(), np.random.default_rng(3)) for r in (white, once, twice))
    for a, b, c in zip(none, one, two, strict=True):
        assert np.abs(b.y - a.y).max() > 0
        np.testing.assert_allclose(c.y - b.y, b.y - a.y, rtol=0, atol=1e-12)


def test_outages_and_latency_leave_the_other_errors_as_they_were():
    whole = ALONE._replace(interval=1.0)
    holed = whole._replace(outages=((20.0, 90.0),), latency=0.3)
    for one, other in zip(
        whole.fixes(still(), np.random.default_rng(5)),
        holed.fixes(still(), np.random.default_rng(5)),
        strict=True,
    ):
        keep = ((one.t < 20) | (one.t >= 90)) & (one.t < 199.9)
        np.testing.assert_array_equal(other.y, one.y[keep])
        assert len(other.std) == len(other.t) == keep.sum()


def test_fixes_state_their_errors_unless_told_not_to():
    receiver = Gnss(1.0, (0.5, 0.5, 1.0), 0.1, position_correlated=LASTING)
    position, velocity = receiver.fixes(still(), np.random.default_rng(1))
    assert position.correlated == LASTING and velocity.correlated is None
    np.testing.assert_array_equal(position.std, np.tile([0.5, 0.5, 1.0], (200, 1)))
    plan = receiver._replace(stated=False).plan(still())
    unstated, _ = plan.fixes(np.random.default_rng(1))
    assert unstated.correlated is None
    np.testing.assert_allclose(unstated.std, np.tile(np.hypot((0.5, 0.5, 1.0), STD), (200, 1)))
    np.testing.assert_array_equal(unstated.y, position.y)
    # a bound is of what is true
    assert plan.exact()[0].correlated == LASTING
    np.testing.assert_array_equal(plan.exact()[0].std, position.std)


def test_a_flight_has_the_same_errors():
    receiver = ALONE._replace(interval=1.0, stated=False)
    made = fix_errors(receiver, np.arange(1.0, 201.0), RandomStream.of(4))
    expected = receiver.plan(still()).fixes(4)
    np.testing.assert_allclose(made.errors[1], expected[1].y, atol=1e-12)
    for source, other in zip(made.sources, expected, strict=True):
        assert source.correlated is None
        np.testing.assert_array_equal(source.std, other.std)


def test_a_scenario_file_has_them(tmp_path):
    file = tmp_path / "mine.toml"
    text = (
        'duration_s = 20\n[motion]\nkind = "static"\n'
        "start = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }\n[gnss]\n"
        "position_std_m = 0.5\nposition_correlated = { std_m = [1.5, 2, 3], time_s = 30 }\n"
    )
    file.write_text(text)
    flown = read(file)
    assert flown.gnss.position_correlated == LASTING and flown.gnss.stated
    (fixes,) = Simulator(flown).recording("consumer", np.random.default_rng(1)).sources
    assert fixes.correlated == LASTING
    file.write_text(text.replace("time_s = 30", "time_s = 30, states = false") + "stated = false")
    assert read(file).gnss.position_correlated == LASTING._replace(states=False)
    assert not read(file).gnss.stated
    for change, words in (
        (("time_s = 30", "time = 30"), "time_s"),
        (("time_s = 30", "time_s = 0"), "correlated errors, time .* above 0"),
        (("std_m = [1.5, 2, 3]", "std_m = 0"), "all standard deviations are 0"),
        (("position_std_m = 0.5\n", ""), "measures nothing: give position_std_m"),
    ):
        file.write_text(text.replace(*change))
        with pytest.raises(DataError, match=words) as refused:
            read(file)
        assert "mine" in str(refused.value) and "\n" not in str(refused.value)


def test_scenarios_of_before_keep_their_fingerprints():
    car = scenario("car")
    assert "position_correlated" not in car.describe()["gnss"]
    lasting = car.replace(gnss=car.gnss._replace(position_correlated=LASTING))
    assert lasting.describe()["gnss"]["position_correlated"] == [list(STD), TIME, True]
    assert lasting.describe()["fingerprint"] != car.describe()["fingerprint"]


@pytest.mark.parametrize(
    "change, words",
    [
        ({"position_correlated": (1.5, 30.0)}, "write Correlated"),
        ({"position_correlated": Correlated((1.0, 1.0), 30.0)}, "3 finite numbers"),
        ({"position_correlated": Correlated((1.0, -1.0, 1.0), 30.0)}, "each 0 or more"),
        ({"position_correlated": Correlated((1.0,) * 3, np.nan)}, "time"),
        ({"velocity_correlated": Correlated((1.0,) * 3, -5.0)}, "GNSS velocity: correlated"),
        ({"position_correlated": LASTING, "position_std": None}, "no white noise"),
        ({"stated": "no"}, "it must be True or False"),
        ({"position_correlated": LASTING, "interval": np.array([9.0, 3.0])}, "in order of time"),
    ],
)
def test_impossible_errors_are_refused(change, words):
    with pytest.raises(DataError, match=words):
        Gnss()._replace(**change).plan(still())
