"""What constants of the installation would change in the innovations of a filter, against whole runs
on recordings that are set up otherwise; and in any pieces, through every rule of the loop."""

from dataclasses import replace

import numpy as np
import pytest
from installed import car
from lasting import told
from recordings import flight, without_samples

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Use
from strapdown.core.mathematics import solution_row
from strapdown.data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE
from strapdown.engine import sensitivity
from strapdown.engine.options import run_options
from strapdown.engine.prepare import Run
from strapdown.installation.model import InstallationModel, apply_constants, constants
from strapdown.sensor_models.gnss import Gnss


def sensitive(recording, filter="closed-loop", **asked):
    """(Run at its end, Corrections of it joined, J)."""
    run = sensitivity.begin_sensitive(recording, filters.find(filter), run_options(**asked))
    model = InstallationModel(run, constants(run.recording.sources), "start" not in asked)
    found = list(sensitivity.pieces(run, model.derivatives, model.start))
    joined = [np.concatenate(parts) for parts in zip(*(corrections for corrections, _ in found))]
    return run, sensitivity.Corrections(*joined), np.concatenate([J for _, J in found])


def without_gates(recording):
    return replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))


def slopes(recording, direction, step, filter="closed-loop", skip=50):
    """{source: (slope of the change of its innovations over that expected, its size)} when the
    constants change by `step` along `direction`, over whole runs that are aligned anew."""
    found = constants(recording.sources)
    _, before, J = sensitive(recording, filter)
    there, back = (
        sensitive(apply_constants(recording, found, sign * step * direction), filter)[1]
        for sign in (1, -1)
    )
    made = {}
    for source in range(len(recording.sources)):
        rows = [np.flatnonzero(run.source == source) for run in (before, there, back)]
        count = min(map(len, rows)) - skip
        first, second, third = (row[-count:] for row in rows)
        expected = (J[first] @ direction).ravel()
        change = (back.innovation[third] - there.innovation[second]).ravel() / (2 * step)
        made[source] = change @ expected / (expected @ expected), np.sqrt(np.mean(expected**2))
    return made


STEPS = {LEVER_ARM: 0.01, MOUNTING: 1e-3, SCALE: 1e-3}


@pytest.mark.parametrize("filter", ["closed-loop", "mekf"])
def test_arms_mounting_and_scale_change_innovations_as_said(filter):
    """Each source by itself; constants that hardly show in one are left out there."""
    recording = without_gates(car(1001, seconds=120.0))
    found = constants(recording.sources)
    seen = 0
    for j, constant in enumerate(found):
        if constant.of is CLOCK:
            continue
        made = slopes(recording, np.eye(len(found))[j], STEPS[constant.of], filter)
        largest = max(size for _, size in made.values())
        for slope, size in made.values():
            if size > 0.4 * largest:
                assert slope == pytest.approx(1.0, abs=0.03)
                seen += 1
    assert seen >= 8


def test_lever_arms_change_innovations_as_said_beside_correlated_errors():
    """Of the positions, which have these errors; the vertical arm hardly shows in them."""
    recording = told(without_gates(car(1001, seconds=120.0)), (1.0, 1.0, 2.0), 20.0)
    arm = [one.of is LEVER_ARM for one in constants(recording.sources)]
    directions = np.eye(len(arm))[arm]
    made = [slopes(recording, direction, STEPS[LEVER_ARM])[0] for direction in directions]
    largest = max(size for _, size in made)
    shown = [slope for slope, size in made if size > 0.4 * largest]
    assert shown == pytest.approx([1.0, 1.0], abs=0.01)


def test_the_clock_changes_innovations_as_said():
    """Of fixes without noise, which the step would else draw anew."""
    gnss = Gnss(interval=0.2, lever_arm=(0.5, 0.2, -1.0))
    recording = sd.simulate("demo", 120.0, "navigation", seed=1001, gnss=gnss)
    exact = gnss.plan(recording.reference).exact()
    recording = without_gates(replace(recording, sources=tuple(exact)))
    together = np.array([one.of is CLOCK for one in constants(recording.sources)], float)
    for slope, _ in slopes(recording, together, 0.02).values():
        assert slope == pytest.approx(1.0, abs=0.03)


@pytest.fixture(scope="module")
def troubled():
    """A short flight with gaps, with fixes inside them, positions that err for long, and velocities
    that are rejected until their gate is opened."""
    gnss = Gnss(interval=0.43, lever_arm=(0.3, -0.2, -0.5))  # fixes split samples
    made = without_samples(flight(gnss=gnss), (5.0, 5.4), (9.0, 12.5))
    made = told(made, (1.0, 1.0, 2.0), 20.0)
    wrong = made.sources[1]
    y = wrong.y.copy()
    y[(wrong.t > 13.5)] += 60.0
    return replace(made, sources=(made.sources[0], replace(wrong, y=y)))


@pytest.mark.short
def test_pieces_of_any_length_say_the_same(troubled, monkeypatch):
    found = []
    for rows in (4096, 37):
        monkeypatch.setattr(sensitivity, "RECORDED_ROWS", rows)
        run, corrections, J = sensitive(troubled)
        found.append((corrections, J))
    assert (run.out.fix["use"] == Use.REACQUIRED).any()
    for one, other in zip((*found[0][0], found[0][1]), (*found[1][0], found[1][1])):
        np.testing.assert_array_equal(one, other)


@pytest.mark.short
def test_a_record_has_room_for_every_call(troubled, monkeypatch):
    """Compiled code would write beyond its end."""
    monkeypatch.setattr(sensitivity, "RECORDED_ROWS", 37)
    rooms, used, advance = [], [], Run.advance

    def advancing(run, stop, *more):
        rooms.append(sensitivity.most_calls(run, stop))
        advance(run, stop, *more)
        used.append(int(run.cursor.state[0].recorded))

    monkeypatch.setattr(Run, "advance", advancing)
    sensitive(troubled)
    assert len(used) > 5 and all(0 < calls <= room for calls, room in zip(used, rooms))


@pytest.mark.short
def test_of_the_two_calls_of_a_lifted_fix_the_first_does_not_count(troubled):
    run, corrections, J = sensitive(troubled)
    use = run.out.fix["use"]
    first = np.flatnonzero(use == Use.REACQUIRED) + np.arange((use == Use.REACQUIRED).sum())
    assert len(corrections.t) == len(use) + len(first) and len(first) > 0
    assert not J[first].any() and not corrections.innovation[first].any()
    assert J[first + 1].any() and corrections.innovation[first + 1].any()
    rejected = np.flatnonzero(use == Use.REJECTED)
    assert len(rejected) > 3 and J[rejected[0]].any()  # which show the constants all the same


@pytest.mark.short
def test_the_run_is_that_of_fuse(troubled):
    """Recording changes nothing in what the filter does."""
    run, _, _ = sensitive(troubled)
    fused = sd.fuse(troubled)
    np.testing.assert_array_equal(
        run.out.nav[:, solution_row.LLA : solution_row.V], fused.trajectory.lla
    )


@pytest.mark.short
def test_sums_add_up_over_blocks(troubled):
    run, corrections, J = sensitive(troubled)
    again = sensitivity.begin_sensitive(troubled, filters.find("closed-loop"), run_options())
    model = InstallationModel(again, constants(troubled.sources), True)
    found = sensitivity.sums(again, model.derivatives, model.start)
    np.testing.assert_allclose(
        found.information.sum(axis=0), np.einsum("kim,kin->mn", J, J), rtol=1e-9
    )
    np.testing.assert_allclose(
        found.score.sum(axis=0), np.einsum("kim,ki->m", J, corrections.innovation), rtol=1e-6
    )
    assert (np.abs(found.score).sum(axis=1) > 0).sum() > 10


@pytest.mark.short
def test_a_filter_that_cannot_be_followed_is_refused():
    with pytest.raises(DataError, match=r"^ekf cannot .* these can: closed-loop, "):
        sensitivity.check_sensitive(filters.find("ekf"))
