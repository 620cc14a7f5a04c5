"""An installation that is wrong in a known way: found, confirmed, written, and right after that;
what is not sure is not written."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from described import CONSTRAINTS, SPEED, TOML, described
from installed import car, turned_case, wrong

import strapdown as sd
from strapdown.calibration.installation import calibrate as module, iterated
from strapdown.calibration.installation.findings import (
    IMPLAUSIBLE,
    NOT_CONFIRMED,
    NOT_CONSTANT,
    CalibratedParameter,
)
from strapdown.calibration.installation.iterated import Settled, theta_of
from strapdown.checks import DataError
from strapdown.data.calibration_parameters import CLOCK
from strapdown.installation.findings import CONSISTENT, FOUND, NOT_OBSERVABLE
from strapdown.installation.model import apply_constants, constants

DEG = np.pi / 180
TRUE = {"clock": 0.2, "lever arm forward": 1.0, "mounting pitch": -2.0, "scale": 0.01}


def all_wrong(seed=1070, seconds=200.0):
    made = wrong(car(seed, seconds), "clock", 0.2)
    made = wrong(made, "lever arm", 1.0, 0)
    return wrong(wrong(made, "mounting", -2 * DEG, 1), "scale", 0.01)


@cache
def calibrated():
    return sd.calibrate_installation(all_wrong())


@pytest.fixture(scope="module")
def found():
    return calibrated()


def of(found, name):
    """The parameter whose name begins so."""
    return next(each for each in found.parameters if each.name.startswith(name))


def test_what_turns_with_the_imu_is_told():
    """`mounting` of [imu] does not turn a magnetometer of the description."""
    made = sd.calibrate_installation(turned_case(1040, 120.0, 0.05))
    assert [each.name for each in made.found] == ["mounting heading"]
    assert any(
        note.startswith("mag was assumed to be in the case of the IMU and rotated with it")
        for note in made.notes
    )


def test_what_is_wrong_is_found_within_its_interval(found):
    assert {each.cause for each in found.found} == {
        "clock",
        "lever arm",
        "mounting",
        "scale",
    }
    for name, value in TRUE.items():
        one = of(found, name)
        assert one.status == FOUND and abs(one.change - value) < 3 * one.std
        assert abs(one.by_states - one.change) < 3 * np.hypot(one.std, one.states_std)
        assert one.std >= one.states_std
    assert of(found, "clock").std < 0.01 and of(found, "mounting pitch").std < 0.05
    # in the terms of recording.toml: what was given, of which 1 m lacks, and what is found
    assert of(found, "lever arm forward").given == pytest.approx(-0.5)
    assert of(found, "lever arm right").status == CONSISTENT


def test_the_recording_as_found_is_the_right_one_and_has_nothing_to_change(found):
    known = constants(found.given.sources)
    again = apply_constants(found.given, known, theta_of(known, found.given, found.found))
    for a, b in zip(found.recording.sources, again.sources):
        np.testing.assert_array_equal(a.t, b.t)
    right = car(1070)
    np.testing.assert_allclose(found.recording.sources[0].t, right.sources[0].t, atol=0.012)
    second = sd.calibrate_installation(found.recording)
    assert not second.found and not second.edits and not second.changes
    assert {each.status for each in second.parameters} == {CONSISTENT}


def test_straight_at_one_speed_nothing_shows_and_it_is_said():
    recording = wrong(sd.simulate("straight", 120.0, "tactical", 1071), "lever arm", 1.0, 0)
    with pytest.raises(DataError, match="this motion shows nothing of the installation; to sh"):
        sd.calibrate_installation(recording)


def test_without_motion_or_velocity_it_is_refused():
    right = car(1072, 60.0)
    alone = replace(right, sources=right.sources[:1])
    with pytest.raises(DataError, match="has no source of velocity, and positions alone do not"):
        sd.calibrate_installation(alone)
    still = sd.simulate("static", 60.0, "tactical", 1072)
    with pytest.raises(DataError, match="nothing of the installation; to show the clock: acc"):
        sd.calibrate_installation(still)


def test_a_velocity_source_without_fixes_is_none():
    recording = wrong(car(1072, 60.0), "clock", 0.2).hidden([(0.0, 1000.0)], ("velocity",))
    with pytest.raises(DataError, match="has no source of velocity, and positions alone do not"):
        sd.calibrate_installation(recording)
    assert {each.status for each in sd.diagnose(recording).parameters} == {NOT_OBSERVABLE}


def test_what_is_no_recording_is_refused():
    for function in (sd.calibrate_installation, sd.diagnose):
        with pytest.raises(DataError, match="^recording is 'a.toml'; it must be a Recording: read"):
            function("a.toml")


def test_more_parameters_than_states_are_refused_before_the_first_run(monkeypatch):
    right = car(1072, 60.0)
    others = [
        replace(a, name=f"{a.name} {k}", parameters=(float(k), 0.0, 0.0))
        for k in range(2, 8)
        for a in right.sources[:2]
    ]
    monkeypatch.setattr(module, "settle", None)
    with pytest.raises(
        DataError, match="there are 32 states in addition to the filter's own.*at most 30"
    ):
        sd.calibrate_installation(replace(right, sources=(*right.sources, *others)))


def changing(first, second):
    """A drive whose GNSS is stamped too early by so many s in each half."""
    right = car(1077)
    late = [
        replace(a, t=a.t - np.where(a.t < 100.0, first, second))
        if a.kind in ("position", "velocity")
        else a
        for a in right.sources
    ]
    return sd.calibrate_installation(replace(right, sources=tuple(late)))


def test_a_change_that_harms_half_of_the_recording_is_not_constant():
    made = changing(0.35, 0.08)
    clock = of(made, "clock")
    assert clock.status in (NOT_CONSTANT, CONSISTENT) and clock not in made.found
    (first, _), (second, _) = clock.halves
    assert (first, second) == pytest.approx((0.35, 0.08), abs=0.03)
    assert any(f"not constant: {first:+.3f} +- " in line for line in made.lines)
    unsure = replace(clock, status=NOT_CONSTANT)
    assert f"not constant, so not written: {first:+.3f} +- " in str(unsure)
    assert not module._helps_both(0.21, clock.halves) and module._helps_both(0.1, [(0.1, 1)] * 2)
    assert made.used == "used: 0.0 to 200.0 s, 200 s"


def test_a_change_that_helps_both_halves_is_found_and_said_to_be_a_mean():
    made = changing(0.25, 0.15)
    (note,) = [note for note in made.notes if "is not constant: +0.2" in note]
    assert of(made, "clock").status == FOUND and note.endswith("the value reported is the average")


def test_nothing_is_written_beside_what_is_not_sure(found, drive):
    text = drive.read_text()
    clock = of(found, "clock")
    for status in (NOT_CONFIRMED, NOT_CONSTANT):
        unsure = tuple(
            replace(each, status=status) if each is clock else each for each in found.parameters
        )
        made = replace(found, parameters=unsure)
        assert made.found and not made.edits and not made.changes
        (line,) = [line for line in made.lines if line.startswith("nothing is written: ")]
        assert "lever arm forward and mounting pitch" in line and f"with {clock.name}, and" in line
        with pytest.raises(DataError, match=f"unchanged; clock of .*: {status}"):
            made.write(drive)
    assert drive.read_text() == text


def test_two_estimates_that_contradict_each_other_are_not_confirmed(monkeypatch):
    def far(recording, sought, asking):
        return {each: SimpleNamespace(change=away * each.std, std=each.std) for each in sought}

    monkeypatch.setattr(module, "as_states", far)
    away = 5
    made = sd.calibrate_installation(wrong(car(1073, 100.0), "clock", 0.2))
    clock = of(made, "clock")
    assert clock.status == FOUND  # with an interval that holds both
    assert abs(clock.change - clock.by_states) <= 1.97 * clock.std
    away = 40
    made = sd.calibrate_installation(wrong(car(1073, 100.0), "clock", 0.2))
    clock = of(made, "clock")
    assert clock.status == NOT_CONFIRMED and not made.edits
    assert "clock of GNSS position and GNSS velocity: not confirmed, so not written" in str(clock)
    assert str(clock).endswith("as a state; to show it better, accelerate, brake or turn")


def test_a_clock_by_leap_seconds_is_not_plausible_and_nothing_is_written(tmp_path):
    made = sd.calibrate_installation(wrong(car(1074, 120.0), "clock", 18.0))
    (one,) = made.unsure
    assert one.status == IMPLAUSIBLE and one.change == pytest.approx(18.0, abs=0.05)
    assert "more than the 2 s by which an installation can differ, so not written" in str(one)
    assert not made.changes
    path = described(car(1074, 120.0), tmp_path)
    with pytest.raises(DataError, match="unchanged; clock of GNSS position and GNSS velocity"):
        made.write(path)
    assert path.read_text() == TOML


def test_clocks_that_differ_are_told_apart():
    made = sd.calibrate_installation(wrong(car(1075), "clock", 0.15, of="velocity"))
    clock = of(made, "clock of GNSS velocity")
    assert clock.status == FOUND and abs(clock.change - 0.15) < 3 * clock.std
    assert of(made, "clock of GNSS position").status == CONSISTENT
    assert [edit.source for edit in made.edits] == [1]
    with pytest.raises(DataError, match="--imu-clock: the sources do not share one offset"):
        sd.calibrate_installation(made.given, imu_clock=True)


def test_the_clock_of_the_imu_is_the_other_way_round():
    recording = wrong(car(1076, 150.0, vehicle=False), "clock", 0.2)
    made = sd.calibrate_installation(recording, imu_clock=True)
    ((source, what, (value,), (deviation,)),) = made.edits
    assert source is None and what is CLOCK and value == pytest.approx(-0.2, abs=0.02)
    assert deviation == of(made, "clock").std
    assert made.changes == (f"[imu] time: add {value:+.3f} s to offset",)
    late = wrong(car(1070), "clock", 0.2)
    with pytest.raises(DataError, match="--imu-clock: the sources do not share one offset"):
        sd.calibrate_installation(late, imu_clock=True)
    made = sd.calibrate_installation(wrong(late, "clock", 0.2, of="speed"), imu_clock=True)
    (source, _, (value,), _) = made.edits[0]
    assert len(made.edits) == 1 and source is None and value == pytest.approx(-0.2, abs=0.02)


def test_two_clocks_that_trade_off_are_said():
    recording = car(1072, 60.0)
    diagnosis = sd.diagnose(recording)
    clock = next(each for each in diagnosis.parameters if each.cause == "clock")
    clocks = tuple(
        CalibratedParameter(
            **vars(clock)
            | {"name": f"clock of {name}", "sources": (name,), "change": change}
            | {"status": NOT_OBSERVABLE}
        )
        for name, change in (("a", 0.5), ("b", 0.1))
    )
    nothing = np.zeros(len(constants(recording.sources)))
    settled = Settled((), nothing, nothing, diagnosis, (), 1)
    assert module._notes(settled, recording, clocks, False) == (
        "clock of a and clock of b trade off: they differ by +0.400 s, but the motion shows "
        "neither; calibrate writes neither",
    )


def test_what_does_not_settle_is_not_written(monkeypatch):
    recording = wrong(car(1073, 100.0), "clock", 0.2)
    monkeypatch.setattr(iterated, "MAX_TURNS", 1)
    made = sd.calibrate_installation(recording)
    assert of(made, "clock").status == NOT_CONFIRMED and not made.edits
    assert made.notes[-1].startswith("the estimates do not converge, so none is written")


@pytest.fixture
def drive(tmp_path):
    """A recording.toml of a drive, right but for 0.2 s, 1 m, 2 deg and 1 %."""
    return described(all_wrong(), tmp_path, TOML + SPEED + CONSTRAINTS)


def test_what_was_written_is_right_and_settles(drive):
    text = drive.read_text()
    text = text.replace("lever_arm = [0.5, 0.2, -1.5]", "lever_arm = [-0.5, 0.2, -1.5]")
    drive.write_text(text)
    first = sd.calibrate_installation(sd.read(drive))
    assert {each.cause for each in first.found} == {
        "clock",
        "lever arm",
        "mounting",
        "scale",
    }
    assert first.write(drive).read_text() == text
    changed = drive.read_text()
    with pytest.raises(
        DataError, match="already has this change; read the file and calibrate again"
    ):
        first.write(drive)
    assert drive.read_text() == changed
    lines = drive.read_text().splitlines()
    assert lines[0] == "# A drive, with comments that must stay." and "# of the vehicle" in lines
    assert [line for line in lines if "by tape" in line][0].startswith("lever_arm = [0.")
    assert sum("calibrate installation" in line for line in lines) == 6
    found = sd.read(drive)
    assert found.sources[0].parameters == pytest.approx((0.5, 0.2, -1.0), abs=0.12)
    assert found.sources[1].parameters == found.sources[0].parameters
    assert np.degrees(found.meta["imu_mounting"]) == pytest.approx([0, -2, 0], abs=0.15)
    second = sd.calibrate_installation(found)
    assert not second.edits and second.write(drive) is None
    assert len(list(drive.parent.glob("*.before*"))) == 1


def test_only_the_file_that_was_read_is_changed(drive, tmp_path):
    read = replace(all_wrong(), meta=sd.read(drive).meta)
    made = replace(calibrated(), given=read)
    text = drive.read_text()
    for old, new, said in (
        ("offset = 0.0", "offset = 0.5", "time offset is 0.5, but the recording was read with 0"),
        (
            "[0.5, 0.2, -1.5]      #",
            "[0.0, 0.2, -1.5]      #",
            r"lever_arm is \[0, 0.2, -1.5\], but the recording was read with \[0.5,",
        ),
        (
            "pitch = 0.0",
            "pitch = 90.0",
            r"\[imu\] mounting is \[0, 1.570796327, 0\], but the recording was read with \[0, 0, 0",
        ),
    ):
        drive.write_text(text.replace(old, new))
        for change in (made.write, made.diff):
            with pytest.raises(DataError, match=said + ".*; read that file and calibrate it$"):
                change(drive)
    drive.write_text(text)
    assert made.diff(drive)
    for name, said in (("no.toml", "cannot be read"), ("a.nc", "only a recording.toml can be")):
        with pytest.raises(DataError, match=said):
            made.diff(tmp_path / name)
    # what was changed after reading, and what was read otherwise
    known = constants(read.sources)
    for other in (apply_constants(read, known, np.full(len(known), 0.01)), replace(read, meta={})):
        with pytest.raises(
            DataError, match="was not read from a recording.toml, or was changed since; read that"
        ):
            replace(made, given=other).write(drive)
    assert drive.read_text() == text


def test_the_page_has_the_table_and_every_figure(found):
    page = found.page().html
    for text in ("Whitened innovations", "NIS", "Misfit: lever arm forward", "consistent"):
        assert text in page
    assert page.count("<div class=plot") == 2 + len(found.found)
    for each in found.parameters:
        assert each.name in page
    assert "change of what was given [deg]" in page and "time [s]" in page
