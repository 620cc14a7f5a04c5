"""Files that version 0.1 wrote still read, with the values that it found in them (facts.json):
recordings, solutions, campaigns, TOML."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown.io.calibration_file import read_calibration
from strapdown.sim.synthesis import Simulator

FILES = Path(__file__).resolve().parent / "files_of_0.1"
FACTS = json.loads((FILES / "facts.json").read_text())
SD = (2.0, 2.0, 2.0, 0.2, 0.2, 0.2, 0.005, 0.005, 0.02, 0.01, 0.01, 0.01, 3e-5, 3e-5, 3e-5)


def is_as_before(solution, facts):
    """To a few hundredths of the standard deviations: since 0.1 the covariance turns after a
    correction of the attitude."""
    sd_m = np.asarray(facts["sd"])
    off = (solution.trajectory.lla[-1] - facts["lla"]) * [6.4e6, 6.4e6, 1.0]
    return (abs(off) < 0.03 * sd_m[:3]).all() and np.allclose(
        solution.trajectory.sd[-1], sd_m, rtol=0.05
    )


def test_a_recording_reads_and_gives_its_solution():
    recording = sd.read(FILES / "recording.nc")
    facts = FACTS["recording"]
    assert (
        len(recording.imu.t) == facts["samples"]
        and [source.kind for source in recording.aidings] == facts["aidings"]
    )
    assert np.abs(recording.imu.dv).sum() == pytest.approx(facts["dv"], rel=1e-12)
    # from the start of then: how one is found has changed since
    start = sd.Start(**sd.read_solution(FILES / "solution.nc").meta["start"])
    solution = sd.fuse(recording, "closed-loop", start=start, every=10)
    assert is_as_before(solution, FACTS["solution"])


def test_a_solution_reads():
    solution = sd.read_solution(FILES / "solution.nc")
    assert len(solution.trajectory.t) == FACTS["solution"]["rows"]
    for name, values in (("lla", solution.trajectory.lla), ("sd", solution.trajectory.sd)):
        assert values[-1].tolist() == pytest.approx(FACTS["solution"][name], rel=1e-15)


def test_a_solution_is_written_as_before(tmp_path):
    """A table byte for byte, so that what people read these files with goes on working; a track
    with the same places, but without the time stamps of 1970 that were made up then."""
    for suffix in ("csv", "kml"):
        sd.write_solution(sd.read_solution(FILES / "solution.nc"), tmp_path / f"solution.{suffix}")
    assert (tmp_path / "solution.csv").read_bytes() == (FILES / "solution.csv").read_bytes()
    now, then = (
        re.findall("<coordinates>.*</coordinates>", (folder / "solution.kml").read_text())
        for folder in (tmp_path, FILES)
    )
    assert now == then and "<when>" not in (tmp_path / "solution.kml").read_text()


def test_a_description_reads_with_its_grade():
    truth = sd.read(FILES / "recording.nc").reference
    start = sd.Start(
        float(truth.t[0]),
        tuple(truth.lla[0]),
        tuple(truth.v_n[0]),
        tuple(truth.rph[0]),
        (0.0,) * 3,
        (0.0,) * 3,
        SD,
    )
    assert is_as_before(
        sd.fuse(sd.read(FILES / "recording.toml"), "closed-loop", start=start), FACTS["description"]
    )


def test_a_grade_and_a_calibration_read():
    assert sd.grade(FILES / "imu.toml").name == "lasergyro-allan"
    bias, matrix = read_calibration(FILES / "calibration.toml")["magnetometer"]
    assert np.shape(bias) == (3,) and np.shape(matrix) == (3, 3)


def test_a_scenario_gives_the_same_motion():
    """Its random numbers are others than those of 0.1: over seeds they change the sum by 1e-3."""
    scenario = sd.scenario(FILES / "scenario.toml")
    recording = sd.simulate(scenario, seed=3)
    assert len(recording.imu.t) == FACTS["scenario"]["samples"]
    assert np.abs(recording.imu.dv).sum() == pytest.approx(FACTS["scenario"]["dv"], rel=5e-3)
    assert np.abs(Simulator(scenario).ideal.dv).sum() == pytest.approx(239.2743358, rel=1e-9)


def test_a_campaign_opens():
    campaign = sd.Campaign.open(FILES / "campaign")
    assert campaign.summary["rmse_position_m"].tolist() == pytest.approx(
        FACTS["campaign"]["rmse_position_m"], rel=1e-12
    )
    assert campaign.curves(campaign.cells[0])["rmse"].shape[0] == 2


def test_a_campaign_of_another_version_is_not_gone_on_with(tmp_path):
    """Its kernels were others: what is missing would not be what it was begun with."""
    shutil.copytree(FILES / "campaign", tmp_path / "campaign")
    next((tmp_path / "campaign").rglob("*.nc")).unlink()
    (tmp_path / "campaign/chunks/short--tactical/000000-000001.nc").touch()
    study = sd.Study(
        scenarios=str(FILES / "scenario.toml"),
        filters=("closed-loop", "open-loop"),
        imus=("tactical",),
        runs=2,
        seed=7,
    )
    with pytest.raises(sd.DataError, match="choose another folder|another version"):
        study.run(tmp_path / "campaign")
