"""The quick look at an installation: what is thinned, which cause comes first, and silence where
nothing is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from installed import car, flown, wrong
from recordings import without_samples

import strapdown as sd
from strapdown.installation import screening
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import demo_flight

DEG = np.pi / 180
FAULTS = {
    "clock 0.1 s": ("clock", 0.1),
    "clock of the velocity 0.1 s": ("clock", 0.1, 0, "velocity"),
    "clock of the position 0.25 s": ("clock", 0.25, 0, "position"),
    "lever arm forward 1 m": ("lever arm", 1.0, 0),
    "lever arm down -3 m": ("lever arm", -3.0, 2),
    "mounting pitch 2 deg": ("mounting", 2 * DEG, 1),
    "mounting heading -5 deg": ("mounting", -5 * DEG, 2),
    "scale 0.01": ("scale", 0.01),
}


def test_thinned_samples_keep_all_motion_the_gaps_and_the_moment_of_a_fix():
    recording = without_samples(car(1040, 20.0), (5.0, 6.0))
    made = screening.thin_recording(recording)
    assert len(made.imu.t) < len(recording.imu.t) / 10
    for fast, slow in zip(recording.imu[1:], made.imu[1:]):
        np.testing.assert_allclose(slow.sum(axis=0), fast.sum(axis=0))
    pauses = made.imu.t[1:] - made.imu.dt[1:] - made.imu.t[:-1]
    assert pauses.max() == pytest.approx(1.0) and (pauses > 1e-6).sum() == 1
    for source in made.sources:
        assert np.diff(source.t).min() > 0.7
    gnss = next(a for a in made.sources if a.kind == "position")
    # a fix 0.2 s or more from its neighbours lies in a sample as short as the recording's
    row = np.searchsorted(made.imu.t, gnss.t)
    np.testing.assert_allclose(made.imu.dt[row[:-1]], np.median(recording.imu.dt), rtol=1e-6)


@pytest.mark.parametrize("name", FAULTS)
def test_the_first_cause_is_the_true_one(name):
    fault = FAULTS[name]
    reasons = screening.look(sd.fuse(wrong(car(1012), *fault))).reasons
    assert reasons[0].cause == fault[0] and reasons[0].weight >= 1


def test_a_right_one_has_no_cause():
    for recording in (car(1013), flown(1013)):
        assert screening.look(sd.fuse(recording)).reasons == []


def test_what_the_motion_does_not_show_is_named():
    ship = sd.simulate("ship", duration=200.0, imu="tactical", seed=1041)
    unknown = list(map(str, screening.look(sd.fuse(ship)).unknown))
    assert any(text.startswith("clock of GNSS") and "turn" in text for text in unknown)
    assert any(text.startswith("lever arm of GNSS") for text in unknown)


def test_positions_alone_say_no_more_than_a_large_clock():
    drive = car(1014)
    alone = replace(drive, sources=tuple(a for a in drive.sources if a.kind == "position"))
    assert screening.look(sd.fuse(alone)) == ([], [], [])
    for seconds, named in ((0.25, False), (1.0, True)):
        reasons = screening.look(sd.fuse(wrong(alone, "clock", seconds))).reasons
        assert [reason.cause for reason in reasons] == ["clock"] * named


@pytest.mark.deep
def test_right_ones_are_left_alone():
    """60 seeds: not one cause."""
    for seed in range(1200, 1220):
        for recording in (car(seed), car(seed, 300.0, "industrial", False), flown(seed)):
            assert screening.look(sd.fuse(recording)).reasons == []


def test_a_long_recording_is_looked_at_where_it_moves_most():
    flight = sd.simulate(demo_flight(), 2400.0, "tactical", 1042, 20.0, Gnss(interval=1.0))
    late = replace(
        flight, sources=tuple(replace(a, parameters=(3.0, 0.0, 0.0)) for a in flight.sources)
    )
    solution = sd.fuse(late, every=10)
    part, start = screening.window(solution)
    assert part.span[1] - part.span[0] == pytest.approx(screening.WINDOW, abs=1.0)
    assert part.span[0] == pytest.approx(start.t, abs=0.1)
    (reason,) = screening.look(solution).reasons
    assert reason.cause == "lever arm" and reason.weight > 1
