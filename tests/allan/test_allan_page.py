"""The Allan page: what it writes, which stretch it takes, and what it says of records that move
or hold more than noise."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pages import own

import strapdown as sd
from strapdown.allan.page import analyse, figure, longest
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.pages.shell import Page
from strapdown.sensor_models.imu import imu as imu_spec


def recording(n=6000, dt=0.05, spec="consumer", seed=1, force=(0.0, 0.0, -9.8)):
    imu = Imu(
        dt * np.arange(1, n + 1),
        np.full(n, dt),
        np.zeros((n, 3)),
        np.tile(np.array(force) * dt, (n, 1)),
    )
    return Recording(
        imu_spec(spec).corrupt(imu, np.random.default_rng(seed))[0], meta={"name": "<bench>"}
    )


def test_three_files_are_written_and_agree(tmp_path):
    found = analyse(recording())
    found.write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "allan.csv",
        "allan-imu.toml",
        "allan.html",
    }
    table = pd.read_csv(tmp_path / "allan.csv", index_col=0)
    np.testing.assert_allclose(
        table["gyro_x [deg/h]"], np.degrees(found.result.gyro.axes[0].deviation) * 3600, rtol=1e-5
    )
    assert imu_spec(tmp_path / "allan-imu.toml") == found.suggestion.spec
    html = own(Page((tmp_path / "allan.html").read_text(encoding="utf-8")))
    assert (
        "<bench>" not in html
        and "&lt;bench&gt;" in html
        and "nearest grade</dt><dd>consumer" in html
    )
    assert re.search(r"default-src 'none'", html) and not re.search(
        r"<(script|link|img)[^>]+(src|href)=.http", html
    )
    data = re.findall(
        r"<script type='application/json' id=data-p\d>(.*?)</script>", html, re.DOTALL
    )
    assert len(data) == 2
    layout = json.loads(data[0])["layout"]
    assert (
        layout["xaxis"]["type"] == layout["yaxis"]["type"] == "log"
        and layout["yaxis"]["title"]["text"] == "Allan deviation [deg/h]"
    )


def test_rows_are_in_units_of_datasheets_and_absent_ones_have_a_limit():
    rows = {
        row[:2]: dict(zip(analyse(recording()).header, row)) for row in analyse(recording()).rows
    }
    white = rows["gyro", "white noise"]
    assert (
        float(white["triad"]) == pytest.approx(0.9, rel=0.03)
        and white["unit"] == "deg/sqrt(h)"
        and white["slope"] == "-1/2"
    )
    assert (
        rows["accel", "quantisation"]["triad"].startswith("< ")
        and rows["accel", "quantisation"]["std"] == ""
    )


def test_figure_has_axes_bands_fits_and_the_grade():
    found = analyse(recording())
    names = [
        trace.name
        for trace in figure(found.result.gyro, ("consumer", imu_spec("consumer").gyro)).data
    ]
    assert {"x (forward)", "y (right)", "z (down)", "x fitted", "grade consumer"} <= set(names)


def test_the_longest_stretch_without_a_gap_is_used_and_said():
    whole = recording()
    keep = (np.arange(6000) < 1000) | (np.arange(6000) > 1100) & (np.arange(6000) != 5500)
    found, notes = longest(Imu(*(column[keep] for column in whole.imu)))
    assert len(found.t) == 5500 - 1101 and found.t[0] == pytest.approx(0.05 * 1102)
    assert notes == ["2 gaps: the longest stretch without one is used, 55.05 to 275.00 s"]
    assert longest(whole.imu) == (whole.imu, [])


def test_a_part_is_chosen_by_time():
    found = analyse(recording(), 50.0, 250.0)
    assert (
        found.recording.span == pytest.approx((50.0, 250.0))
        and "50.0 to 250.0 s" in found.suggestion.spec.source
    )
    with pytest.raises(DataError, match="no IMU samples between"):
        analyse(recording(), 5000.0)


def turning(still, rows, turns, axis=2):
    """The recording with these turns, rad, about an axis in these samples."""
    dtheta = still.imu.dtheta.copy()
    dtheta[rows, axis] += turns
    return replace(still, imu=still.imu._replace(dtheta=dtheta))


def test_a_record_that_moves_is_noted_or_refused():
    moving = turning(recording(), slice(1000, 2000), 0.05 * 0.5)
    with_note = analyse(moving).notes[0]
    assert re.match(
        r"the IMU moves for 1[67] % of the time; its longest rest is 100\.\d to 300\.0 s", with_note
    )
    moving = turning(moving, slice(1000, 5500), 0.05 * 0.5)
    with pytest.raises(
        DataError, match="moves for 7[56] % of the time.*choose a stretch with --from and --to"
    ):
        analyse(moving)


@pytest.mark.parametrize(
    "name, duration", [("car", 300), ("ship", 300), ("straight", 300), ("demo", 300)]
)
def test_a_smooth_drive_is_no_rest(name, duration):
    """Each second of it alone is as still as a rest is."""
    with pytest.raises(
        DataError,
        match="^the IMU .* an Allan deviation needs an IMU at rest; choose a stretch with --from and --to",
    ):
        analyse(sd.simulate(name, duration, rate=20.0))


def test_what_the_model_does_not_know_is_said():
    still = recording()
    swings = 2e-3 * np.diff(np.sin(0.8 * np.r_[0, still.imu.t]))
    rocking = turning(still, slice(None), swings, axis=0)
    (note,) = [text for text in analyse(rocking).notes if "miss the estimates" in text]
    assert note.startswith("gyro: ") and "(x " in note and "at most x" in note and "y " not in note
    assert (
        "may be better" in analyse(rocking).verdict
        and "may be better" not in analyse(recording()).verdict
    )


def test_the_ring_laser_record_has_its_page(data_folder, tmp_path):
    allantools = pytest.importorskip("allantools")
    record = sd.read(data_folder / "lasergyro" / "lasergyro.imu.xz")
    found = analyse(record)
    found.write(tmp_path)
    curve = found.result.gyro.axes[2]
    sizes = np.round(curve.tau / 0.01)
    _, peer, _, _ = allantools.oadev(
        record.imu.dtheta[:, 2] / 0.01, rate=100.0, data_type="freq", taus=sizes * 0.01
    )
    np.testing.assert_allclose(curve.deviation, peer, rtol=1e-9)
    assert any(text.startswith("gyro: ") and "vibration or rocking" in text for text in found.notes)
