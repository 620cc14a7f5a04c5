"""Figures and table of the sensors: made-up samples whose rates, gaps, spectra and full scale are
known."""

import numpy as np
import pytest
from scipy.signal import welch
from synthetic import solution

from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.pages import drawing, sensor_figures
from strapdown.pages.spectra import power_spectrum, segments

pytestmark = pytest.mark.short
RATE, N = 100.0, 20_000


def recording(force=None, t=None, **meta):
    """200 s of white noise of 0.1 m/s^2/sqrt(Hz), with 1 m/s^2 at 20 Hz along z."""
    t = np.arange(1, N + 1) / RATE if t is None else t
    rng = np.random.default_rng(3)
    made = 0.1 * np.sqrt(RATE) * rng.standard_normal((N, 3))
    made[:, 2] += np.sin(2 * np.pi * 20 * t) - 9.8
    force = made if force is None else force
    rates = 0.01 * rng.standard_normal((N, 3))
    fixes = Source(
        "position", t[::100], np.zeros((N // 100, 3)), np.ones((N // 100, 3)), name="gnss"
    )
    held = Source("zero-lateral-velocity", t[::10], np.zeros((N // 10, 1)), np.ones((N // 10, 1)))
    dt = np.full(N, 1 / RATE)
    return Recording(
        Imu(t, dt, rates * dt[:, None], force * dt[:, None]), (fixes, held), None, meta
    )


def cells(html, sensor):
    return (
        html.partition(f"<td>{sensor}</td>")[2]
        .partition("</tr>")[0]
        .replace("</td>", "")
        .split("<td>")[1:]
    )


@pytest.mark.parametrize("segment", [64, 65])
def test_spectra_are_those_of_scipy(segment):
    walk = np.random.default_rng(0).normal(size=(1003, 3)).cumsum(axis=0)
    parts = segments(walk, segment)
    for detrend, made in ((False, parts), ("constant", parts - parts.mean(axis=2, keepdims=True))):
        f, density = power_spectrum(made, 50.0)
        expected = welch(walk, 50.0, nperseg=segment, axis=0, detrend=detrend)
        np.testing.assert_allclose(f, expected[0])
        np.testing.assert_allclose(density, expected[1], rtol=1e-9)


def test_the_table_has_rates_jitter_and_gaps():
    t = np.arange(1, N + 1) / RATE
    t[N // 2 :] += 3.0
    html = sensor_figures.sensor_table(recording(t=t))
    assert cells(html, "gyro")[:6] == ["20000", "100", "0.00", "1", "3.00", "3.01"]
    assert cells(html, "gnss")[:2] == ["200", "1.00"] and "zero-lateral-velocity" not in html
    assert cells(html, "gyro")[6:] == ["0", "0"]
    assert sensor_figures.sensor_table(None) == ""


def test_samples_at_the_end_of_the_range_and_repeated_ones_are_counted():
    force = np.random.default_rng(1).normal(0, 5, (N, 3))
    force[:, 0] = np.clip(force[:, 0], -1e9, 6.0)
    share = 100 * (force[:, 0] == 6.0).mean()
    force[101:301] = force[100]
    html = sensor_figures.sensor_table(recording(force))
    # the gyro moves on: it repeats nothing
    assert float(cells(html, "accelerometer")[7]) == pytest.approx(share, abs=1)
    assert float(cells(html, "accelerometer")[6]) == pytest.approx(1.0, abs=0.01)
    assert cells(html, "gyro")[6:] == ["0", "0"]


def test_the_spectrum_has_the_level_of_the_noise_and_the_line_of_the_vibration():
    figure = sensor_figures.spectra(recording())
    assert figure.layout.yaxis2.title.text == "specific force [(m/s²)²/Hz]"
    x, z = (t for t in figure.data if t.yaxis == "y2" and t.name in "xz")
    assert np.median(x.y) == pytest.approx(2 * 0.1**2, rel=0.1) and len(x.x) <= 500
    assert z.x[np.argmax(z.y)] == pytest.approx(20, rel=0.02) and z.y.max() > 20 * np.median(z.y)
    assert "time" not in figure.layout.meta
    assert "white noise" not in {t.name for t in figure.data}
    described = sensor_figures.spectra(recording(grade="consumer"))
    assert [t.name for t in described.data].count("white noise") == 2


def test_a_spectrum_is_of_the_longest_stretch_without_a_gap():
    t = np.arange(1, N + 1) / RATE
    t[N // 4 :] += 3.0
    (said,) = sensor_figures.spectra(recording(t=t)).layout.meta["notes"]
    assert said == f"Of {t[N // 4]:.1f} to {t[-1]:.1f} s, which has no gap."
    few = recording()
    assert sensor_figures.spectra(few.between(0, 2)) is None


def test_readings_and_intervals_share_the_time_of_the_solutions():
    made = recording()
    t = made.imu.t
    truth = Trajectory(
        t, np.tile([0.8, 0.1, 400.0], (N, 1)), np.zeros((N, 3)), np.tile([1.0, 0, 0, 0], (N, 1))
    )
    fused = solution(truth)
    for draw in (sensor_figures.readings, sensor_figures.intervals):
        figure, alone = draw(made, {"a": fused}), draw(made)
        assert figure.layout.meta["time"] == alone.layout.meta["time"] == 0
        assert figure.layout.xaxis.range == (t[0], t[-1]) and alone.layout.xaxis.range == (0, t[-1])
        assert len(figure.layout.annotations) == 3 and not alone.layout.annotations
        assert max(len(trace.x) for trace in figure.data) <= drawing.MAX_POINTS
        assert draw(None) is None
    assert [figure.layout[name].title.text for name in ("yaxis", "yaxis2")] == [
        "IMU [ms]",
        "gnss [s]",
    ]
    force = [t for t in sensor_figures.readings(made).data if t.yaxis == "y2"]
    assert [t.name for t in force] == ["x", "y", "z"] and np.mean(force[2].y) < -5


def test_the_temperature_is_drawn_where_there_is_one():
    warm = np.c_[np.arange(0.0, 200.0), np.linspace(20, 35, 200)]
    figure = sensor_figures.temperature(recording(temperature=warm))
    (trace,) = figure.data
    assert trace.y[[0, -1]].tolist() == [20, 35] and "±" not in trace.hovertemplate
    assert figure.layout.yaxis.title.text == "temperature of the IMU [°C]"
    assert sensor_figures.temperature(recording()) is None
