"""Recordings with a wrong installation: what `apply_constants` of the diagnosis undoes, with the truth that
belongs to it; and studies that draw one."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from structured_mutators import sealed

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.simulation import print_summary
from strapdown.data.solution import Source
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.experiments.monte_carlo.wrong_installation import (
    draw_installation,
    installed_wrong,
    parameters_of,
    start_of,
)
from strapdown.installation.model import apply_constants, constants
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.synthesis import Simulator

CAR = sd.scenario("car").replace(
    duration=90.0,
    rate=50.0,
    gnss=Gnss(0.5, (0.5,) * 3, (0.05,) * 3, (0.5, 0.2, -1.0)),
    sensors=(Simulated("speed", 0.05, 5.0),),
)
WRONG = {"clock": 0.1, "lever-arm": 0.5, "mounting": (0.0, 0.03, 0.03), "scale": 0.02}
LABEL = "closed-loop:estimate=" + "+".join(["clock", "lever-arm", "scale"])


@pytest.fixture(scope="module")
def right():
    return Simulator(CAR).run("industrial", np.random.SeedSequence(3))


@pytest.mark.short
def test_what_the_diagnosis_applies_undoes_a_wrong_installation(right):
    recording, start = right
    found = parameters_of(recording, WRONG)
    assert [p.of.name for p in found] == [
        "clock",
        "clock",
        "lever-arm",
        "lever-arm",
        "lever-arm",
        "scale",
        "mounting",
        "mounting",
    ]
    error = np.array([0.1, 0.1, 0.4, -0.3, 0.2, 0.015, 0.02, -0.03])
    wrong = installed_wrong(recording, found, error).recording
    # the order of `constants`: clocks of position and velocity, arm, clock and scale of the odometer
    known = constants(wrong.sources)
    theta = np.array([0.1, 0.1, 0.4, -0.3, 0.2, 0.1, 0.015])
    back = apply_constants(wrong, known, theta)
    for a, b in zip(recording.sources, back.sources):
        inside = a.between(*(np.array(wrong.span) + [0.2, 0.0]))
        rows = np.searchsorted(b.t, inside.t - 1e-6)
        np.testing.assert_allclose(b.t[rows], inside.t)
        np.testing.assert_allclose(b.y[rows], inside.y)
        np.testing.assert_allclose(a.parameters, b.parameters, atol=1e-12)
    turn = Rotation.from_rotvec([0.0, 0.02, -0.03])
    np.testing.assert_allclose(turn.apply(wrong.imu.dv.copy()), recording.imu.dv, atol=1e-12)
    # the truth of the axes as described: the same forces in the navigation frame
    in_n = lambda r: r.reference.rotation[1:].apply(r.imu.dv.copy())
    np.testing.assert_allclose(in_n(wrong), in_n(recording), atol=1e-12)
    bias = lambda r: r.reference.rotation[1:].apply(r.meta["b_g"].copy())
    np.testing.assert_allclose(bias(wrong), bias(recording), atol=1e-14)
    # a start errs by the same rotation in the navigation frame
    own = start_of(installed_wrong(recording, found, error), start)
    at = lambda s: Rotation.from_euler("ZYX", s.rph[::-1])
    errors = [
        (at(s) * r.reference.rotation[0].inv()).as_rotvec()
        for s, r in ((start, recording), (own, wrong))
    ]
    np.testing.assert_allclose(*errors, atol=1e-12)


@pytest.mark.short
def test_sources_in_the_axes_of_the_imu_turn_with_a_mounting(right):
    """The field, the rates at rest and the attitude that the turned IMU sees are the same in n."""
    recording, _ = right
    t = recording.reference.t[100:104]
    C = recording.reference.rotation[100:104]
    field, rate = np.array([2e-5, 1e-6, 4e-5]), np.array([0.0, 0.0, 1e-4])
    rph = C.as_euler("ZYX")[:, ::-1]
    level = rph.copy()
    level[:, 2] = np.nan
    ones = np.ones((4, 3))
    sources = (
        Source("magnetic-field", t, C.inv().apply(field), ones * 1e-7, tuple(field)),
        Source("zero-angular-rate", t, C.inv().apply(rate), ones * 1e-4, ()),
        Source("attitude", t, rph, ones * 0.01, ()),
        Source("attitude", t, level, ones * 0.01, (), name="level"),
    )
    recording = replace(recording, sources=(*recording.sources, *sources))
    found = parameters_of(recording, {"mounting": (0.01, 0.1, 0.1)})
    wrong = installed_wrong(recording, found, np.array([0.02, 0.1, -0.2])).recording
    own = wrong.reference.rotation[100:104]
    magnetic, rates, attitude, level = wrong.sources[-4:]
    np.testing.assert_allclose(own.apply(magnetic.y.copy()), np.tile(field, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(own.apply(rates.y.copy()), np.tile(rate, (4, 1)), atol=1e-12)
    same = Rotation.from_euler("ZYX", attitude.y[:, ::-1]) * own.inv()
    np.testing.assert_allclose(same.magnitude(), 0, atol=1e-9)
    np.testing.assert_allclose(level.y[:, :2], attitude.y[:, :2], atol=1e-12)
    assert np.isnan(level.y[:, 2]).all()


@pytest.mark.short
def test_scale_and_misalignment_of_the_imu_change_its_samples(right):
    recording, _ = right
    found = parameters_of(recording, {"gyro-scale": 0.01, "accel-misalignment": 0.01})
    wrong = installed_wrong(recording, found, np.array([0.01, 0, 0, 0.02, 0, 0])).recording
    np.testing.assert_allclose(wrong.imu.dtheta[:, 0], 1.01 * recording.imu.dtheta[:, 0])
    np.testing.assert_array_equal(wrong.imu.dtheta[:, 1:], recording.imu.dtheta[:, 1:])
    dv = recording.imu.dv
    np.testing.assert_allclose(wrong.imu.dv, np.c_[dv[:, 0] + 0.02 * dv[:, 1], dv[:, 1:]])


@pytest.mark.short
def test_drawn_errors_have_their_standard_deviations(right):
    recording, _ = right
    errors = [
        draw_installation(recording, WRONG, np.random.default_rng(k)).error for k in range(300)
    ]
    stds = [p.std for p in parameters_of(recording, WRONG)]
    np.testing.assert_allclose(np.std(errors, axis=0), stds, rtol=0.15)


def study(**changes):
    given = {"filters": ("closed-loop", LABEL), "runs": 6, "installation": WRONG, "keep": 1000}
    return Study(CAR, **{**given, **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return study().run(tmp_path_factory.mktemp("wrong"), threads=1)


def test_a_study_scores_the_parameters(finished):
    rows = finished.summary.set_index("filter")
    arm = "lever arm right error of GNSS position [m]"
    clock = "clock error of GNSS position [s]"
    assert rows.loc[LABEL, f"rmse {clock}"] < 0.3 * rows.loc["closed-loop", f"rmse {clock}"]
    assert np.isnan(rows.loc["closed-loop", f"within 95 % {arm}"])
    assert 0.4 <= rows.loc[LABEL, f"within 95 % {arm}"] <= 1
    assert rows.loc[LABEL, "anees_all"] < 3 and np.isnan(rows.loc["closed-loop", "anees_all"])
    # the mounting is drawn, and no state of this label
    runs = finished.runs.set_index("filter")
    mounting = "mounting pitch error of imu [deg]"
    assert runs.loc[LABEL, f"std of {mounting}"].isna().all()
    np.testing.assert_array_equal(runs.loc[LABEL, mounting], runs.loc["closed-loop", mounting])


def test_what_a_study_prints_counts_errors_and_not_the_limit(finished, capsys):
    """Runs that are given up as inconsistent are metres off, and not the limit's 500 m."""
    print_summary(finished.summary)
    rows = {line.split()[2]: line for line in capsys.readouterr().out.splitlines()[2:]}
    table = finished.summary.set_index("filter")
    for name, row in rows.items():
        assert f" {table.loc[name, 'until_abort_position_m']:.3g} " in row
        given_up = int(table.loc[name, "inconsistent"])
        assert (f"{given_up} inconsistent" in row) == (given_up > 0)
    assert table.loc["closed-loop", "inconsistent"] and "500" not in rows["closed-loop"]


def test_a_run_is_that_of_fuse_on_what_was_drawn(finished):
    from strapdown.experiments.monte_carlo.chunks import seeds, wrongly_installed

    made = study()
    recording, start = Simulator(CAR).run("industrial", seeds(made, made.cells[0], 2))
    installed = wrongly_installed(made, made.cells[0], 2, recording)
    solution = sd.fuse(
        installed.recording,
        start=start_of(installed, start),
        noise=sd.imu("industrial").noise(),
        estimate={name: WRONG[name] for name in ("clock", "lever-arm", "scale")},
    )
    runs = finished.runs[finished.runs["filter"] == LABEL].set_index("run")
    for name in solution.columns:
        if not name.startswith("std of "):
            assert runs.loc[2, name] == pytest.approx(
                installed.true[name] - solution.columns[name][-1]
            )
    cell = finished.cells[0]
    assert finished.parameters(cell) == list(installed.true)


def test_what_is_drawn_is_part_of_the_study(finished, tmp_path):
    manifest = json.loads((finished.folder / "manifest.json").read_text())
    assert manifest["installation"]["mounting"] == [0.0, 0.03, 0.03]
    with pytest.raises(DataError, match="installation is"):
        study(installation=WRONG | {"clock": 0.2}).run(finished.folder)
    # filters and IMUs share what is drawn; without it nothing is
    alone = study(filters=(LABEL,), runs=2).run(tmp_path / "alone", threads=1)
    columns = list(alone.parameters(alone.cells[0]))
    both = finished.runs[(finished.runs["filter"] == LABEL) & (finished.runs["run"] < 2)]
    np.testing.assert_array_equal(alone.runs[columns], both[columns])
    plain = replace(study(), installation={}, filters=("closed-loop",), runs=1)
    assert not [c for c in plain.run(tmp_path / "plain", threads=1).runs if " error of " in c]


@pytest.mark.short
@pytest.mark.parametrize(
    ("installation", "said"),
    [
        ("clock", "it must be {name: standard deviation}"),
        ({"clok": 0.1}, "did you mean 'clock'"),
        ({"lever-arm": (0.1, 0.2)}, "has 3 components .forward, right, down., and 2"),
        ({"clock": -1}, "standard deviation of clock"),
        ({"clock": 100.0}, "standard deviation of clock"),
    ],
)
def test_bad_standard_deviations_are_refused(installation, said):
    with pytest.raises(DataError, match=said):
        study(installation=installation)


def damaged(folder, name, change):
    """Change a variable of every chunk file, each with a new checksum; None: it goes."""
    for path in sorted(folder.rglob("*.nc")):
        with h5py.File(path, "a") as file:
            values = None if change is None else change(file[name][()])
            del file[name]
            if values is not None:
                file[name] = values
        path.write_bytes(sealed(path.read_bytes()))


def one_number(values):
    """A single number, without an axis."""
    return 1.0


def whole_text(values):
    """One text."""
    return "clock"


def fewer(values):
    """One less along the last axis."""
    return values[..., :-1]


@pytest.mark.parametrize("change", [None, one_number, whole_text, fewer])
@pytest.mark.parametrize(
    "name", ["parameter", "parameter_error", "parameter_std", "nees_all", "nees_parameters", "t"]
)
def test_a_damaged_chunk_file_is_one_line(finished, tmp_path, name, change):
    folder = tmp_path / "copy"
    shutil.copytree(finished.folder, folder)
    damaged(folder, name, change)
    campaign = Campaign.open(folder)
    for table in ("summary", "runs")[: 1 + (name != "t")]:  # runs have no times
        with pytest.raises(
            DataError, match=r"\.nc: cannot be read .*run the study again"
        ) as caught:
            getattr(campaign, table)
        assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(DataError):
        campaign.parameters(campaign.cells[0])
        campaign.numbers(campaign.cells[0])
        campaign.curves(campaign.cells[0])


def test_chunks_of_which_one_alone_has_more_are_read_as_the_manifest_says(tmp_path):
    plain = study(installation={}, filters=("closed-loop",), runs=2, chunk_steps=1)
    made = plain.run(tmp_path / "plain", threads=1)
    first = sorted(made.folder.rglob("*.nc"))[0]
    with h5py.File(first, "a") as file:
        file["parameter_error"] = np.zeros((1, 1, 1))
    first.write_bytes(sealed(first.read_bytes()))
    assert len(Campaign.open(made.folder).runs) == 2
