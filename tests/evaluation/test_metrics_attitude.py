"""Errors where only attitude (or height beside it) is known: angles of the attitude error, parts
that are None, what the console prints of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic import attitude_only, flight, solution

from strapdown.checks import DataError
from strapdown.cli import console
from strapdown.data.solution import Trajectory
from strapdown.evaluation import metrics

pytestmark = pytest.mark.short
TRUTH = flight(600, rate=2.0)
FULL = solution(TRUTH, start={"note": "given"}, fixes_outside=0)
ATTITUDE, VRU = attitude_only(FULL), attitude_only(FULL, heave=True, name="vru")
UNPLACED = replace(TRUTH, lla=np.full_like(TRUTH.lla, np.nan), v_n=None)


def errors_of_attitude(vectors):
    unknown = np.full_like(vectors, np.nan)
    return metrics.Errors(
        np.arange(len(vectors)), unknown, unknown, vectors, unknown, None, slice(None)
    )


def angles_of(rotation):
    """AttitudeAngles of scipy Rotations."""
    vectors = rotation.as_rotvec()
    return metrics.attitude_angles(errors_of_attitude(vectors))


def test_angles_agree_with_those_of_rotation_matrices():
    rotation = Rotation.random(2000, random_state=1)
    C, found = rotation.as_matrix(), angles_of(rotation)
    assert found.total == pytest.approx(
        np.arccos(np.clip((np.trace(C, axis1=1, axis2=2) - 1) / 2, -1, 1)), abs=1e-7
    )
    assert found.inclination == pytest.approx(
        np.arctan2(np.hypot(C[:, 0, 2], C[:, 1, 2]), C[:, 2, 2]), abs=1e-9
    )
    assert found.heading == pytest.approx(
        np.abs(np.arctan2(C[:, 1, 0] - C[:, 0, 1], C[:, 0, 0] + C[:, 1, 1])), abs=1e-9
    )
    assert np.cos(found.total / 2) == pytest.approx(
        np.cos(found.inclination / 2) * np.cos(found.heading / 2), abs=1e-12
    )


def test_heading_is_the_turn_left_when_the_verticals_agree():
    heading, tilt = np.radians([10.0, -170, 180, 90]), np.radians([0.0, 5, 60, 170])
    azimuth = np.array([0.3, 2.0, -1.0, 3.0])
    lean = Rotation.from_rotvec(
        tilt[:, None] * np.c_[np.cos(azimuth), np.sin(azimuth), np.zeros(4)]
    )
    found = angles_of(lean * Rotation.from_euler("Z", heading[:, None]))
    assert found.inclination == pytest.approx(tilt, abs=1e-9) and found.heading == pytest.approx(
        np.abs(heading), abs=1e-9
    )


def test_small_and_unknown_errors_keep_their_digits():
    e = errors_of_attitude(np.array([[3e-9, -4e-9, 12e-9], [np.nan] * 3, [0, 0, 0]]))
    found = metrics.attitude_angles(e)
    assert np.array(found)[:, 0] == pytest.approx([13e-9, 5e-9, 12e-9], rel=1e-9)
    assert np.isnan(np.array(found)[:, 1]).all() and (np.array(found)[:, 2] == 0).all()
    unknown = replace(e, attitude=np.full((3, 3), np.nan))
    assert np.isnan(metrics.attitude_angles(unknown)).all()
    assert np.isnan(metrics.rms(unknown).angles).all()


def nothing_known(*parts):
    return all(len(part) and np.isnan(part).all() for part in parts)


def test_a_solution_of_attitude_is_scored_on_attitude_alone():
    e, full = metrics.errors(ATTITUDE, TRUTH), metrics.errors(FULL, TRUTH)
    assert nothing_known(e.position, e.velocity, e.horizontal[:, None])
    assert np.array_equal(e.attitude, full.attitude) and np.array_equal(e.rph, full.rph)
    r = metrics.rms(e, (100, 500))
    assert np.isnan([r.position, r.velocity]).all()
    assert np.array_equal(r.rph, metrics.rms(full, (100, 500)).rph)
    inside = (e.t >= 100) & (e.t <= 500)
    assert r.angles == pytest.approx(
        [np.sqrt(np.mean(part[inside] ** 2)) for part in metrics.attitude_angles(e)]
    )
    assert not ATTITUDE.has_position and FULL.has_position


def test_heave_is_scored_alone():
    e, full = metrics.errors(VRU, TRUTH), metrics.errors(FULL, TRUTH)
    for part in ("position", "velocity"):
        found, known = getattr(e, part), getattr(full, part)
        assert np.isnan(found[:, :2]).all() and found[:, 2] == pytest.approx(known[:, 2], abs=1e-12)
    assert np.isnan(e.horizontal).all() and not VRU.has_position
    r = metrics.rms(e)
    assert np.isnan(r.position[:2]).all() and r.position[2] == pytest.approx(
        metrics.rms(full).position[2]
    )


def test_a_reference_of_attitude_alone():
    for estimate in (FULL, ATTITUDE, VRU):
        e = metrics.errors(estimate, UNPLACED)
        assert nothing_known(e.position, e.velocity) and np.isfinite(e.rph).all()
    blank = replace(
        TRUTH, v_n=np.full_like(TRUTH.v_n, np.nan), q_nb=np.full_like(TRUTH.q_nb, np.nan)
    )
    e = metrics.errors(ATTITUDE, blank)
    assert nothing_known(e.position, e.velocity, e.attitude)


def test_a_reference_of_height_and_attitude():
    lla = TRUTH.lla.copy()
    lla[:, :2] = np.nan
    lla[300:400, 2] = np.nan
    for v_n in (None, TRUTH.v_n):
        e = metrics.errors(VRU, replace(TRUTH, lla=lla, v_n=v_n))
        assert np.isnan(e.position[:, :2]).all() and np.array_equal(
            np.isnan(e.position[:, 2]), (np.arange(1200) >= 300) & (np.arange(1200) < 400)
        )
        assert e.position[:300, 2] == pytest.approx(
            metrics.errors(VRU, TRUTH).position[:300, 2], abs=1e-9
        )


def test_a_gap_of_the_reference_over_all_of_the_solution_is_no_lack_of_knowledge():
    rows = (TRUTH.t < 10) | (TRUTH.t > 590)
    gap = Trajectory(*(part[rows] for part in (TRUTH.t, TRUTH.lla, TRUTH.v_n, TRUTH.q_nb)))
    middle = (TRUTH.t > 100) & (TRUTH.t < 200)
    e = metrics.errors(
        Trajectory(*(part[middle] for part in (TRUTH.t, TRUTH.lla, TRUTH.v_n, TRUTH.q_nb))), gap
    )
    assert (
        np.isnan(e.position).all()
        and np.isnan(e.attitude).all()
        and np.isnan(metrics.rms(e).angles).all()
    )


def test_what_needs_a_position_or_a_speed_is_refused_in_one_line():
    with pytest.raises(DataError, match="outages are scored by position") as refusal:
        metrics.outages(VRU, TRUTH, [(100, 130)])
    assert "\n" not in str(refusal.value)
    with pytest.raises(DataError, match="no velocity"):
        metrics.moving_windows(UNPLACED, 3, 10, 20, 5, 1.0)


@pytest.mark.parametrize(
    "made, said",
    [
        (
            FULL,
            "at the end: position std 1 1 1.5 m NED, velocity std 0.05 0.05 0.05 m/s, attitude std 0.1 0.1 0.5 deg\n",
        ),
        (ATTITUDE, "at the end: attitude std 0.1 0.1 0.5 deg, gyro bias std 20 20 20 deg/h\n"),
        (
            VRU,
            "at the end: position std - - 1.5 m NED, velocity std - - 0.05 m/s, attitude std 0.1 0.1 0.5 deg, gyro bias std 20 20 20 deg/h\n",
        ),
        (
            replace(
                ATTITUDE, trajectory=replace(ATTITUDE.trajectory, std=np.full((1200, 15), np.nan))
            ),
            "at the end: no uncertainty claimed\n",
        ),
    ],
    ids=["position", "attitude", "heave", "nothing"],
)
def test_the_console_tells_what_is_claimed(made, said, capsys):
    console.summarise(made)
    out = capsys.readouterr().out
    assert out.endswith(said) and "nan" not in out


def test_numbers_and_nouns_of_the_console():
    assert [
        console.number(value) for value in (1234.5, 999.7, 99.96, 0.01234, 3e8, np.nan, None, 4)
    ] == ["1234", "1000", "100", "0.0123", "3e+08", "-", "-", "4"]
    assert (
        console.count_text(1, "fix", "es") == "1 fix"
        and console.count_text(0, "fix", "es") == "0 fixes"
    )


def test_the_table_of_errors_has_dashes_and_the_angles(capsys):
    console.print_errors({"closed-loop": FULL, "attitude-mekf": ATTITUDE, "vru": VRU}, TRUTH)
    lines = capsys.readouterr().out.splitlines()
    row = lambda name: [
        cell.strip()
        for cell in next(line for line in lines if line.startswith(name)).split("  ")
        if cell
    ]
    assert (
        "angle total inclination heading, deg" in lines[1]
        and row("attitude-mekf")[1:3] == ["-", "-"]
        and row("vru")[1].startswith("- - ")
    )
    angles = np.degrees(metrics.rms(metrics.errors(ATTITUDE, TRUTH)).angles)
    assert [float(text) for text in row("attitude-mekf")[-1].split()] == pytest.approx(
        angles, rel=0.01
    )
    # its heading runs free
    assert row("vru")[3].endswith(" -") and [text == "-" for text in row("vru")[-1].split()] == [
        True,
        False,
        True,
    ]
    console.print_errors({"closed-loop": FULL}, TRUTH)
    console.print_outages(ATTITUDE, TRUTH, [(100, 120)])
    out = capsys.readouterr().out
    assert (
        "angle" not in out
        and "not scored: outages are scored by position" in out
        and "nan" not in out
    )
