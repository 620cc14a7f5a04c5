"""The grade that a table's IMU gets where nothing states one."""

from dataclasses import replace

import given_files
import numpy as np
import pytest

import strapdown as sd
from strapdown.core.loop.contract import Imu
from strapdown.io.description.imu_grade import CLASSES, nearest_grade
from strapdown.io.description.rewriting import rewrite_text
from strapdown.io.description.rewriting_noise import GRADE, NoiseEdit, change_noise
from strapdown.io.inspection import draft

pytestmark = pytest.mark.short


@pytest.mark.parametrize("scenario", ["static", "car", "ship"])
@pytest.mark.parametrize("name", CLASSES)
def test_a_simulated_imu_gets_its_own_grade(name, scenario):
    for seed in (101, 102):
        made = sd.simulate(scenario, 60.0, name, seed)
        assert nearest_grade(made.imu)[0] == name


@pytest.mark.parametrize("name", ["tactical", "industrial", "consumer"])
def test_motion_makes_no_imu_better(name):
    found = nearest_grade(sd.simulate("demo", 60.0, name, 103).imu)[0]
    assert CLASSES.index(found) >= CLASSES.index(name)


def changed(imu, change):
    """The same with rates and forces changed."""
    dt = imu.dt[:, None]
    return imu._replace(dtheta=change(imu.dtheta / dt) * dt, dv=change(imu.dv / dt) * dt)


def rounded(values):
    """Rounded to far more than the noise, so that most samples are alike."""
    return np.round(values / 0.05) * 0.05


def smoothed(values):
    """Through a low-pass filter, as devices have one."""
    return np.stack([np.convolve(column, np.full(4, 0.25), "same") for column in values.T], axis=1)


def test_neither_rounding_nor_filtering_makes_an_imu_better():
    imu = sd.simulate("static", 60.0, "tactical", 104).imu
    assert nearest_grade(changed(imu, rounded))[0] == "consumer"
    worse = sd.simulate("static", 60.0, "consumer", 105).imu
    assert nearest_grade(changed(worse, smoothed))[0] == "consumer"


def test_a_bias_at_rest_counts_as_noise_does():
    imu = sd.simulate("static", 60.0, "navigation", 106).imu
    turning = imu._replace(dtheta=imu.dtheta + np.radians(0.4) * imu.dt[:, None])
    assert nearest_grade(turning)[0] == "industrial"
    leaning = imu._replace(dv=imu.dv * 1.05)
    assert nearest_grade(leaning)[0] == "consumer"


def test_what_is_too_short_or_stuck_is_of_the_worst_grade():
    imu = sd.simulate("static", 60.0, "tactical", 107).imu
    assert nearest_grade(Imu(*(column[:40] for column in imu)))[0] == "consumer"
    assert nearest_grade(changed(imu, lambda values: 0 * values + 1.0))[0] == "consumer"


@pytest.fixture
def pair(tmp_path):
    """Paths of two tables of a drive with an industrial IMU."""
    for name in ("imu.csv", "gnss.csv"):
        given_files.GIVEN[name](tmp_path / name)
    return [tmp_path / "imu.csv", tmp_path / "gnss.csv"]


def test_a_draft_holds_a_grade_and_says_that_it_is_assumed(pair, tmp_path):
    path = tmp_path / "recording.toml"
    path.write_text(draft(pair, {}, tmp_path))
    (line,) = [each for each in path.read_text().splitlines() if each.startswith("grade")]
    assert line.startswith('grade = "industrial" ') and "# check: estimated from" in line
    assert 'assumed = ["grade"]' in path.read_text()  # axes that are a guess mark themselves
    recording = sd.read(path)
    assert recording.meta["grade"] == "industrial"
    said = "assumed: imu grade = industrial: the description marks it; check it"
    assert any(each.startswith(said) for each in recording.meta["read"])
    path.write_text(
        path.read_text().replace('assumed = ["grade"]', "assumed = []").replace('?"', '"')
    )
    assert "read" not in sd.read(path).meta


def test_tables_that_are_read_alone_get_the_same_grade(pair):
    recording = sd.read(*pair)
    assert recording.meta["grade"] == "industrial"
    assert any('assumed: imu grade = "industrial": est' in line for line in recording.meta["read"])


def test_a_table_of_the_imu_alone_and_two_of_its_triads(tmp_path):
    made = replace(given_files.car(), sources=())
    given_files.imu_table(made.imu, tmp_path / "imu.csv")
    rows = (tmp_path / "imu.csv").read_text().splitlines()
    for name, columns in (("gyro.csv", (0, 1, 2, 3)), ("accel.csv", (0, 4, 5, 6))):
        cells = (row.split(",") for row in rows)
        text = "\n".join(",".join(row[k] for k in columns) for row in cells)
        (tmp_path / name).write_text(text + "\n")
    alone = sd.read(tmp_path / "imu.csv")
    both = sd.read(tmp_path / "gyro.csv", tmp_path / "accel.csv")
    assert alone.meta["grade"] == both.meta["grade"] == "industrial"


def test_a_draft_of_what_cannot_be_read_yet_has_the_worst_grade(pair, tmp_path):
    pair[0].write_text(pair[0].read_text().replace("\n", "\n0,0,0,0,0,0,9.8\n", 3))
    text = draft(pair, {}, tmp_path)
    assert 'grade = "consumer"' in text and "# check: the samples cannot be read yet" in text


def test_a_mark_of_no_key_is_refused_and_a_grade_that_is_tuned_loses_its_mark(pair, tmp_path):
    path = tmp_path / "recording.toml"
    path.write_text(draft(pair, {}, tmp_path))
    edit = NoiseEdit(None, GRADE, ('"tuned.toml"',), "95 %")
    text = rewrite_text(path, [edit], ["position", "velocity"], "today", change_noise)
    assert 'grade = "tuned.toml"' in text and "assumed = []" in text
    path.write_text(path.read_text().replace('assumed = ["grade"', 'assumed = ["mounting"'))
    with pytest.raises(sd.DataError, match="'mounting' is not a key of this section; remove it"):
        sd.read(path)
