"""What filters assume of an IMU, beside its records at rest: simulated records whose noise is
known, and the page on the recorded ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.imu import ImuSpec
from strapdown_reproductions.common import markdown
from strapdown_reproductions.noise import allan_records
from strapdown_reproductions.noise.allan_records import RESTS, Rest, even_stamps, frame, rows

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "evidence" / "noise.md"
WALKING = ImuSpec(
    "walking",
    gyro=Triad(1e-4, turn_on_bias=1e-3, bias_walk=4e-5),
    accel=Triad(1e-3, turn_on_bias=1e-2, bias_walk=4e-4),
)


def at_rest(spec, seconds=120.0, rate=10.0, seed=3):
    n = int(seconds * rate)
    dt = np.full(n, 1 / rate)
    ideal = Imu(
        np.arange(1, n + 1) / rate,
        dt,
        np.zeros((n, 3)),
        np.outer(dt, (0.0, 0.0, -9.8)),
    )
    return spec.corrupt(ideal, np.random.default_rng(seed))[0]


def found(monkeypatch, imu, told):
    recording = Recording(imu, (), None, {"grade": told})
    monkeypatch.setattr(allan_records, "_read", lambda *_: recording)
    return {(row.sensor, row.quantity.split()[0]): row for row in rows((Rest("made", ""),), Path())}


@pytest.mark.short
def test_a_grade_that_is_right_has_ratios_of_one(monkeypatch):
    made = found(monkeypatch, at_rest(WALKING), WALKING)
    for sensor in ("gyro", "accel"):
        white, slow = made[sensor, "white"], made[sensor, "deviation"]
        assert white.quantity == "white noise" and white.ratio == pytest.approx(1, abs=0.1)
        assert slow.low < slow.measured < slow.high and slow.ratio == pytest.approx(1, abs=0.4)
        assert (white.grade, white.seconds) == ("walking", pytest.approx(120.0))
    assert made["gyro", "white"].assumed == pytest.approx(np.degrees(1e-4) * 60)
    assert made["accel", "deviation"].unit == "mg"


@pytest.mark.short
def test_a_grade_that_is_wrong_shows_by_how_much(monkeypatch):
    quiet = replace(
        WALKING, gyro=replace(WALKING.gyro, noise=2e-5), accel=replace(WALKING.accel, bias_walk=0.0)
    )
    made = found(monkeypatch, at_rest(WALKING), quiet)
    assert made["gyro", "white"].ratio == pytest.approx(5, rel=0.1)
    assert made["accel", "white"].ratio == pytest.approx(1, rel=0.1)
    slow = made["accel", "deviation"]
    tau = float(slow.quantity.split()[2])
    # the walk that the grade does not have
    assert slow.ratio == pytest.approx(np.hypot(1, 4e-4 / 1e-3 * tau / np.sqrt(3)), rel=0.3)


@pytest.mark.short
def test_what_shakes_gives_no_white_noise_but_a_bound(monkeypatch):
    imu = at_rest(WALKING)
    shaken = imu._replace(dv=imu.dv + 2e-4 * np.sin(2 * np.pi * 1.3 * imu.t)[:, None])
    made = found(monkeypatch, shaken, WALKING)["accel", "white"]
    assert made.quantity == "white noise, at most" and made.measured > 0.9 * made.assumed


@pytest.mark.short
def test_stamps_that_jitter_do_not_matter():
    imu = at_rest(WALKING)
    dt = imu.dt * np.random.default_rng(1).uniform(0.9, 1.1, len(imu.dt))
    jittered = Imu(np.cumsum(dt), dt, imu.dtheta * (dt / imu.dt)[:, None], imu.dv)
    even = even_stamps(jittered)
    assert np.ptp(even.dt) == 0 and even.t[-1] == pytest.approx(jittered.t[-1])
    np.testing.assert_allclose(even.dtheta, imu.dtheta * (even.dt / imu.dt)[:, None], rtol=1e-12)


def test_the_page_has_the_figures_of_the_recorded_data(data_folder):
    """Deep: half an hour of a ring laser among them."""
    text = DOCS.read_text(encoding="utf-8")
    assert markdown.table(frame(rows(RESTS)), markdown.cell) in text


@pytest.mark.short
def test_the_rests_and_grades_are_those_of_the_examples():
    for rest in RESTS:
        if rest.grade:
            assert rest.grade in sd.imus()
        if rest.file.endswith(".toml"):
            assert (allan_records.DESCRIPTIONS / rest.file).exists()
