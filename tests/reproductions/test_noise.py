"""Noise, told by the data: what is simulated and hidden, how the tables count, and the files of a
run."""

import json

import numpy as np
import pandas as pd
import pytest

from strapdown.engine.batch import fuse
from strapdown.geometry.geodesy import displacement
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.noise import correlated, coverage, main, misstated, outliers, summary
from strapdown_reproductions.noise.worlds import (
    CAR,
    WORLDS,
    fixes_stated,
    imu_stated,
    nis_over_expected,
    record_world,
    score,
)


@pytest.fixture(scope="module")
def short_car():
    """The car for two and a half minutes."""
    whole = WORLDS[CAR]
    WORLDS[CAR] = whole._replace(duration=150.0)
    yield record_world(CAR, 1001)
    WORLDS[CAR] = whole


@pytest.mark.short
def test_a_tenth_of_the_fixes_is_off_by_twenty_standard_deviations(short_car):
    whole = record_world(CAR, 1002)
    off = outliers.spoil_recording(whole, 1002)
    for a, b in zip(whole.sources, off.sources):
        moved = displacement(b.y, a.y) if a.kind == "position" else b.y - a.y
        changed = np.abs(moved[:, 0]) > 1e-6
        assert not changed[a.t < a.t[0] + outliers.BEGUN].any()
        # 400 fixes: five standard deviations of a share and of a root mean square
        assert changed.mean() == pytest.approx(outliers.SHARE * 0.8, abs=0.075)
        sizes = np.sqrt(np.mean((moved[changed] / a.std[changed]) ** 2))
        assert sizes == pytest.approx(outliers.SIZE, rel=0.45)


@pytest.mark.short
def test_what_is_stated_wrongly_is_the_noise_alone():
    stated = imu_stated(CAR, 5.0).noise()
    right = imu_stated(CAR, 1.0).noise()
    np.testing.assert_allclose(np.array(stated[:4]) / right[:4], 5.0)
    assert stated[4:] == right[4:]
    assert imu_stated(CAR, 5.0).gyro.turn_on_bias == imu_stated(CAR, 1.0).gyro.turn_on_bias


def test_fixes_stated_too_good_show_in_error_and_nis(short_car):
    right, wrong = fuse(short_car), fuse(fixes_stated(short_car, 0.2))
    assert 0.7 < np.median(nis_over_expected(right)) < 1.4
    assert np.median(nis_over_expected(wrong)) > 5
    of_right, of_wrong = score(right, short_car), score(wrong, short_car)
    assert of_right.rows == of_wrong.rows > 0
    assert of_wrong.error / of_wrong.claimed > 4 * of_right.error / of_right.claimed


def test_hidden_fixes_are_predicted_as_without_them(short_car):
    """The prediction at a hidden fix against a run that does not have it."""
    way = coverage.CoverageWay("", short_car, None, (30.0, 80.0))
    windows = [(40.0, 50.0), (60.0, 70.0)]
    rows = pd.DataFrame(coverage.errors_in_windows(way, windows))
    assert len(rows) == 2 * 2 * 50 and (rows["since"] < 10).all()
    withheld = fuse(short_car.hidden(windows, ("position", "velocity")))
    place = next(a for a in short_car.sources if a.kind == "position")
    last = rows[(rows["t"] > 49.7) & (rows["t"] < 50)]
    for axis, column in (("north", 0), ("east", 1)):
        own = last[last["axis"] == axis].iloc[-1]
        k = np.searchsorted(place.t, own["t"] - 1e-6)
        row = np.searchsorted(withheld.t, place.t[k] - 1e-6)
        error = displacement(place.y[k], withheld.trajectory.lla[row])[column]
        assert own["error"] == pytest.approx(error, abs=2e-3)
        std = np.hypot(withheld.trajectory.std[row, column], place.std[k, column])
        assert own["std"] == pytest.approx(std, rel=2e-3)


def table_of(way, values, **own):
    return pd.DataFrame(
        [
            {"world": CAR, "way": way, "seed": k, "rows": 100, "error": e, "claimed": 100.0} | own
            for k, e in enumerate(values)
        ]
    )


@pytest.mark.short
def test_figures_are_those_of_the_worst_cell():
    white = pd.concat(
        [
            table_of("as white", [100.0, 100.0], time=0.0),
            table_of("tuned", [100.0, 108.08], time=0.0),
            table_of("states", [100.0, 62.0], time=30.0),
            table_of("tuned", [121.0, 121.0], time=30.0),
        ]
    )
    stated = pd.concat(
        [
            table_of(way, errors, mistake="GNSS stated too good", nis=nis)
            for way, errors, nis in (("right", [100.0, 100.0], 1.0), ("tuned", [144.0, 144.0], 1.1))
        ]
    )
    gross = pd.concat(
        [
            table_of(way, [100.0 * x**2], fixes=fixes)
            for fixes, way, x in (
                ("clean", "gate", 1.0),
                ("clean", "robust", 1.01),
                ("clean", "adaptive", 1.03),
                ("outliers", "robust", 1.06),
            )
        ]
    )
    hidden = pd.DataFrame(
        {
            "recording": "thor75",
            "length": 10.0,
            "way": "tuned",
            "error": [0.5] * 60 + [2.0] * 36 + [4.0] * 4,
            "std": 1.0,
        }
    )
    evidence = StudyTables(correlated=white, misstated=stated, outliers=gross, coverage=hidden)
    found = summary.figures(evidence)
    assert found["correlated low, states"] == pytest.approx(0.9)
    assert found["correlated high, tuned"] == pytest.approx(1.1)
    assert found["white, tuned"] == pytest.approx(1.02)
    assert found["misstated rms"] == pytest.approx(1.2)
    assert found["misstated NIS high"] == pytest.approx(1.1)
    assert found["robust outliers"] == pytest.approx(1.06)
    assert found["robust clean"] == pytest.approx(1.01)
    assert found["adaptive clean"] == pytest.approx(1.03)
    assert found["coverage 1"] == pytest.approx(8.3)
    assert found["coverage 3"] == pytest.approx(3.7)
    holds = {c["claim"]: c["holds"] for c in summary.STUDY.claims(evidence)}
    assert not holds[summary.TARGETS["adaptive clean"].text]
    assert holds[summary.TARGETS["robust clean"].text]


def test_the_quick_run_writes_its_files(tmp_path, short_car):
    claims = main.reproduce(tmp_path, quick=True, runs=1, workers=1)
    assert {"claims.json", "index.html", "table.md", "correlated.csv", "outliers.csv"} <= {
        file.name for file in tmp_path.iterdir()
    }
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    assert summary.TARGETS["robust outliers"].text in {c["claim"] for c in claims}
    assert "### Time-correlated position errors" in (tmp_path / "table.md").read_text()


@pytest.mark.short
def test_a_receiver_of_white_errors_has_their_whole_size():
    for time in correlated.TIMES:
        gnss = correlated.receiver(CAR, time)
        lasting = gnss.position_correlated
        assert (lasting is None) == (time == 0)
        assert gnss.position_std == (correlated.WHITE if time else correlated.SIZE)
    assert set(misstated.WRONG.values()) == {(5.0, 1.0), (0.2, 1.0), (1.0, 5.0), (1.0, 0.2)}
