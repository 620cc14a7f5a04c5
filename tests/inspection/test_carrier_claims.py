"""Claims of float solutions, on a recorded walk and on a simulated drive."""

from dataclasses import replace

import classed
import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import Correlated
from strapdown.inspection import carrier_claims
from strapdown.inspection.all import check
from strapdown.inspection.motion import InspectedRecording
from strapdown.io.description.logs import join, open_logs

IMU = """
vehicle = "pedestrian"

[imu]
file = "{}"
time = {{ column = 1, unit = "s", clock = "gps", offset = -315964800.0 }}
gyro = {{ columns = [5, 6, 7], unit = "rad/s" }}
accel = {{ columns = [2, 3, 4], unit = "g" }}
axes = "-y -x -z"
lever_arm = [0.0, 0.05, 0.0]
grade = "consumer"

"""


@pytest.fixture
def walk(data_folder, tmp_path):
    """Function of whether float fixes have correlated errors -> the recorded walk."""

    def read(correlated):
        own = data_folder / "walk0827"
        pos = own / "gnss_1730_sf.pos.xz"
        text = join(open_logs([pos])).text(tmp_path).partition("\n\n")[2]
        if not correlated:
            lines = text.splitlines()
            text = "\n".join(line for line in lines if not line.startswith("correlated"))
        path = tmp_path / "walk.toml"
        path.write_text(IMU.format(own / "imu_1730_sf.csv.xz") + text)
        return sd.read(path)

    return read


def test_the_walk_claims_centimetres_for_float_fixes(walk):
    recording = walk(correlated=False)
    (reason,) = (each for each in check(recording).reasons if each.source.endswith("float"))
    assert reason.cause == "fix noise" and "it states 0.010 m horizontally" in reason.seen
    assert "GNSS position fixed 0.010 m" in reason.seen and "correlated" in reason.remedy
    found = sd.fuse(recording, "closed-loop").verdict
    assert any(each.seen == reason.seen for each in found.reasons) and not found.trusted


def test_with_lasting_errors_the_walk_is_a_fact_and_its_end_inside_them(walk):
    """At the final rest float fixes lie 0.19 m off the start; the solution knows that it may be so."""
    recording = walk(correlated=True)
    (fact,) = (line for line in check(recording).facts if line.startswith("GNSS position float"))
    assert "correlated errors of 0.2 m are counted beside" in fact
    std = {}
    for lasting in (False, True):
        path = sd.fuse(walk(correlated=lasting), "closed-loop").trajectory
        std[lasting] = float(np.hypot(*path.std[-1, :2]))
    assert 3 * std[False] < 0.19 < 3 * std[True]


@pytest.mark.parametrize(
    "std, lasting, reasons, facts",
    [(0.01, 0.0, 1, 0), (0.03, 0.0, 1, 0), (0.01, 0.1, 0, 1), (0.1, 0.0, 0, 0)],
)
def test_only_claims_beyond_float_solutions_are_said(std, lasting, reasons, facts):
    drive = sd.simulate("car", duration=30.0, seed=2)
    drive = replace(drive, sources=tuple(replace(a, std=0 * a.std + std) for a in drive.sources))
    errors = Correlated((lasting,) * 3, 300.0) if lasting else None
    classes = classed.alternating(len(drive.sources[0].t))
    recording = classed.split(drive, classes, float={"correlated": errors})
    found = carrier_claims.check(InspectedRecording(recording))
    assert (len(found.reasons), len(found.facts)) == (reasons, facts)
