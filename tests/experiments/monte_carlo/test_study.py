"""Studies: what is scored, that nothing but the study decides a result, and what an
interruption, another study or a broken folder does."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from killed import killed

import strapdown as sd
from strapdown.core.compile.jit import COMPILED
from strapdown.core.loop.contract import compile_kernel
from strapdown.evaluation import consistency
from strapdown.evaluation.consistency import LossLimits
from strapdown.evaluation.nees import normalised_rows
from strapdown.experiments.monte_carlo import summaries
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.figures import NAMED
from strapdown.experiments.monte_carlo.scoring import (
    ERROR_STATE_NAMES,
    RUN_REASONS,
    epochs,
    score,
)
from strapdown.experiments.monte_carlo.study import Study, run_chunk, seeds
from strapdown.fileio.locks import PART
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.scenario import Scenario
from strapdown.sim.synthesis import Simulator
from strapdown.sim.trajectory import demo_flight

FLIGHT = Scenario(
    "a minute",
    demo_flight(),
    60.0,
    rate=20.0,
    gnss=Gnss(interval=0.05, position_std=(1.0, 1.0, 1.0), velocity_std=None),
    gate=np.inf,
    start_std=(1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 2e-3, 2e-3, 3e-3, *[None] * 6),
)
LOOPS = ("open-loop", "closed-loop")
TABLES = ("summary.csv", "runs.csv")


def study(**changes):
    """20 runs of two filters over a minute, in chunks of 5 runs."""
    return Study(
        **{
            "scenarios": FLIGHT,
            "filters": LOOPS,
            "imus": "paper1-tactical",
            "runs": 20,
            "chunk_steps": 12_000,
            **changes,
        }
    )


def tables(folder):
    return [(Path(folder) / name).read_bytes() for name in TABLES]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The study run on one thread."""
    return study().run(tmp_path_factory.mktemp("finished"), threads=1)


# What is scored


@pytest.mark.short
def test_normalised_rows_are_those_of_consistency_and_nan_where_p_is_none():
    rng = np.random.default_rng(3)
    size, root = 10.0 ** rng.uniform(-8, 3, 15), rng.standard_normal((40, 15, 15))
    P = np.ascontiguousarray(
        (root @ root.transpose(0, 2, 1) + 0.1 * np.eye(15)) * size[:, None] * size
    )
    e, found = rng.standard_normal((40, 15)) * size, np.empty(40)
    P[7, 3, 3] = -1.0
    P[8] = np.nan
    compile_kernel(normalised_rows)
    normalised_rows(e, P, np.zeros((17, 15)), found)
    assert np.isnan(found[7:9]).all()
    good = np.delete(np.arange(40), [7, 8])
    np.testing.assert_allclose(found[good], consistency.nees(e, P)[good], rtol=1e-9)


def test_a_run_is_scored_as_the_metrics_score_it():
    """One run by hand: errors, NEES and numbers of `score` against metrics.errors and
    consistency on the same solution."""
    made = Simulator(FLIGHT)
    imu = sd.imu("paper1-tactical")
    recording, start = made.run(imu, np.random.SeedSequence(5))
    solution = sd.fuse(recording, "closed-loop", start=start, every=20, covariance=True)
    at = epochs(made.truth, 20)
    b_a, b_g = recording.meta["b_a"][at.rows], recording.meta["b_g"][at.rows]
    found = score(solution, at, b_a, b_g, LossLimits())
    np.testing.assert_array_equal(at.truth.t, solution.t)
    e = sd.errors(solution, recording.reference)
    np.testing.assert_allclose(
        found.error[:, :9], np.c_[e.position, e.velocity, e.attitude], atol=1e-9
    )
    np.testing.assert_allclose(found.error[:, 9:], np.c_[b_a - solution.b_a, b_g - solution.b_g])
    np.testing.assert_allclose(
        found.nees, consistency.nees(found.error, solution.covariance), rtol=1e-6
    )
    assert (
        found.rows == 60 and found.numbers["reason"] == 0 and np.isnan(found.numbers["left_model"])
    )
    assert (
        found.numbers["mean_square"][0]
        == pytest.approx((e.position**2).sum(axis=1).mean())
        == pytest.approx(found.numbers["censored"])
    )
    np.testing.assert_allclose(
        found.numbers["mean_square"][3:6], (e.rph**2).mean(axis=0), rtol=1e-6
    )
    assert found.numbers["nis"] == pytest.approx(np.nanmean(solution.innovations.nis) / 3)


def test_an_abort_ends_a_run_and_is_censored_at_the_limit():
    """An open loop whose raw INS is 9 m/s^2 off is lost before the end; its numbers count what
    comes before, its censored error the rest too."""
    fallen = FLIGHT.replace(name="fallen", accel_offset=(0.0, 0.0, 9.0), gnss=Gnss(interval=1e3))
    campaign = study(scenarios=fallen, filters="open-loop", runs=2).run()
    numbers = campaign.numbers(campaign.cells[0])
    assert [RUN_REASONS[int(code)] for code in numbers["reason"][0]] == ["lost", "lost"]
    lasted = numbers["lasted"][0]
    assert np.all((lasted > np.sqrt(2 * 400 / 9.0)) & (lasted < 25))
    expected = (
        numbers["mean_square"][0, :, 0] * numbers["rows"][0] + 500.0**2 * (60 - numbers["rows"][0])
    ) / 60
    np.testing.assert_allclose(numbers["censored"][0], expected)
    row = campaign.summary.iloc[0]
    assert (
        row.lost == 2
        and row.survived == 0
        and np.isnan(row.rmse_position_m)
        and row.until_abort_position_m < 500 > row.censored_position_m
    )


def test_the_summary_of_a_consistent_filter_is_consistent(finished):
    """20 runs of a minute, NEES of 15 states. The band is that of 20 independent runs at one
    epoch: 0.1 % false alarms for their mean over time."""
    row = finished.summary.set_index("filter").loc["closed-loop"]
    low, high = consistency.band(15, 20, probability=0.999)
    assert low < 15 * row.anees < high and 0.9 < row.nees_inside <= 1
    assert row.survived == 1 and row.survived_low == pytest.approx(0.839, abs=1e-3)
    assert row.rmse_position_m_low < row.rmse_position_m < row.rmse_position_m_high
    assert row.nis == pytest.approx(1, abs=0.02) and abs(row.innovation_correlation) < 0.02
    assert row.within_1_sigma == pytest.approx(0.683, abs=0.06) and row.within_3_sigma > 0.98
    shown = finished._repr_html_()
    assert "Study" in shown and "closed-loop" in shown and "<script" not in shown


@pytest.mark.parametrize("what", NAMED)
def test_a_campaign_draws_its_curves(finished, what):
    (cell,) = finished.cells
    curves, filters = finished.curves(cell), finished.manifest["filters"]
    figure = finished.plot(what)
    assert figure == finished.plot(what, cell) and cell in figure.layout.title.text
    drawn = {}
    for trace in figure.data:
        drawn.setdefault(trace.name, []).append(np.asarray(trace.y))
    assert set(drawn) - {"Cramer-Rao bound"} == set(filters)
    lines = {"nees": 1, "survival": 1}.get(what, 2)
    assert all(len(drawn[name]) == lines for name in filters)
    first = drawn[filters[0]][0]
    if what == "position":
        expected = np.linalg.norm(curves["rmse"][0][:, :3], axis=1)
        np.testing.assert_allclose(first, expected, rtol=1e-6)
        assert len(drawn["Cramer-Rao bound"]) == 1
    if what == "survival":
        np.testing.assert_allclose(first, 100 * curves["alive"][0] / finished.manifest["runs"])


def test_figures_and_cells_that_there_are_not_are_refused_in_a_line(finished):
    with pytest.raises(sd.DataError, match="figure is 'positoin' .did you mean 'position'"):
        finished.plot("positoin")
    with pytest.raises(sd.DataError, match="cell is 'moon'"):
        finished.plot(cell="moon")


def test_tables_and_curves_of_a_campaign_are_never_stale(finished):
    (cell,) = finished.cells
    before, path = finished.summary, next(finished.folder.glob("chunks/*/*.nc"))
    own = finished.summary
    own["runs"] = 0
    assert finished.summary.equals(before) and finished.runs.equals(finished.runs)
    with pytest.raises(ValueError, match="read-only"):
        finished.curves(cell)["rmse"][0] = 0.0
    content = path.read_bytes()
    path.unlink()
    try:
        if any(finished.folder.glob("chunks/*/*.nc")):
            assert len(finished.runs) < len(before) * finished.manifest["runs"]
        else:
            with pytest.raises(sd.DataError, match="no finished runs"):
                finished.summary
    finally:
        path.write_bytes(content)
    assert finished.summary.equals(before)


def test_curves_are_sums_of_what_the_files_hold_and_the_bound_is_below(finished):
    (cell,) = finished.cells
    arrays, curves = finished.arrays(cell), finished.curves(cell)
    assert arrays.error.dims == ("filter", "run", "t", "state") and arrays.error.shape == (
        2,
        20,
        12,
        15,
    )
    assert arrays.error.chunks is not None and list(arrays.state.values) == list(ERROR_STATE_NAMES)
    np.testing.assert_allclose(
        np.sqrt((arrays.error.astype(float) ** 2).mean("run")), curves["rmse"], rtol=1e-5
    )
    assert arrays.t.values[-1] == 60 and np.all(curves["alive"] == 20)
    ratio = curves["rmse"][:, :, :3].mean(axis=(1, 2)) / curves["bound"][:, :3].mean()
    assert np.all((ratio > 0.85) & (ratio < 1.15))


def test_labelled_arrays_are_what_the_files_hold(finished):
    """Also where the scales of the dimensions are damaged, at which HDF5 may end the process."""
    (cell,) = finished.cells
    with finished.arrays(cell) as arrays:
        for name in ("error", "std", "nees_rows", "bias", "lasted", "coverage"):
            axis = arrays[name].dims.index("run")
            whole = np.concatenate([part[name] for part in finished.read(cell, [name])], axis)
            assert np.array_equal(arrays[name].values, whole, equal_nan=True), name
        assert list(arrays.run.values) == list(range(20)) and arrays.error.long_name.startswith(
            "true"
        )
        assert list(arrays["filter"].values) == list(LOOPS) and arrays.bound.dims == ("t", "state")
        assert not {"squares", "alive"} & set(arrays)


def test_paired_comparison_uses_the_same_runs(finished):
    found = summaries.compare(finished, finished.cells[0], *LOOPS)
    # a minute is too short for the two to differ
    assert found.count == 20 and abs(found.difference) < 0.01
    with pytest.raises(sd.DataError, match="'mekf'; it must be one of open-loop, closed-loop"):
        summaries.compare(finished, finished.cells[0], "mekf", "open-loop")


def test_fixes_and_start_of_a_run_are_the_same_for_every_imu_and_differ_from_run_to_run():
    one = study(imus=("paper1-tactical", "paper1-consumer"))
    made = Simulator(FLIGHT)
    (a, start_a), (b, start_b) = (made.run(cell.imu, seeds(one, cell, 3)) for cell in one.cells)
    np.testing.assert_array_equal(a.sources[0].y, b.sources[0].y)
    assert start_a.lla == start_b.lla
    assert not np.array_equal(
        a.sources[0].y, made.run(one.cells[0].imu, seeds(one, one.cells[0], 4))[0].sources[0].y
    )


# Nothing but the study decides a result


@pytest.mark.parametrize(
    "how",
    [
        {"threads": 2},
        pytest.param({"workers": 1}, marks=pytest.mark.deep),
        pytest.param({"workers": 2}, marks=pytest.mark.deep),
    ],
)
def test_tables_are_identical_to_the_byte_however_it_is_run(finished, tmp_path, how):
    assert tables(study().run(tmp_path, **how).folder) == tables(finished.folder)


def test_runs_do_not_depend_on_how_they_are_cut_into_chunks(finished):
    whole = study(chunk_steps=10_000_000).run()
    assert len(whole._files(whole.cells[0])) == 1 and len(finished._files(finished.cells[0])) == 4
    np.testing.assert_array_equal(
        whole.numbers(whole.cells[0])["mean_square"],
        finished.numbers(finished.cells[0])["mean_square"],
    )


def test_a_campaign_goes_on_where_it_was_interrupted(finished, tmp_path):
    campaign = study().run(tmp_path, threads=1)
    files = campaign._files(campaign.cells[0])
    kept = files[0].stat().st_mtime_ns
    for path in files[1:3]:
        path.unlink()
    (tmp_path / "summary.csv").unlink()
    assert len(campaign.missing_chunks()) == 2
    assert (
        tables(study().run(tmp_path).folder) == tables(finished.folder)
        and files[0].stat().st_mtime_ns == kept
    )


@pytest.mark.deep
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.skipif(not COMPILED, reason="a study without the compiler is too slow")
def test_thirty_kills_lose_chunks_in_work_only_and_the_rest_goes_on_to_the_same_result(tmp_path):
    """Each tenth kill falls soon after a further chunk was finished, the others before one can be,
    however loaded the machine is."""
    begin = time.perf_counter()
    whole = study(runs=400).run(tmp_path / "whole", threads=2)
    expected = [path.read_bytes() for path in whole._files(whole.cells[0])]
    soon = (time.perf_counter() - begin) / len(expected) / 4
    finished, chunks = {}, tmp_path / "killed" / "chunks"
    work = lambda: study(runs=400).run(tmp_path / "killed", threads=2)
    there = lambda: {path.name: path.stat().st_mtime_ns for path in chunks.glob("*/[0-9]*.nc")}
    for kill in range(30):
        begun = (lambda: len(there()) > len(finished)) if kill % 10 == 9 else None
        list(killed(work, 1, soon, kill, begun))
        now = there()
        assert now.items() >= finished.items(), "a finished chunk was lost or written again"
        finished = now
    assert 3 <= len(finished) < len(expected), "it must be killed half-way"
    resumed = work()
    assert tables(resumed.folder) == tables(whole.folder)
    assert [path.read_bytes() for path in resumed._files(resumed.cells[0])] == expected
    assert not [path for path in (tmp_path / "killed").rglob("*") if path.name.endswith(PART)]


# Folders that are not this study's


@pytest.mark.parametrize(
    "change, words",
    [
        ({"seed": 1}, "seed is 0 there and 1 here"),
        ({"runs": 21}, "runs is 20 there and 21 here"),
        ({"filters": "closed-loop"}, "filters is"),
        ({"imus": "paper1-consumer"}, "cell 'a-minute--paper1-consumer' differs"),
        ({"scenarios": FLIGHT.replace(duration=59.0)}, "cell 'a-minute--paper1-tactical' differs"),
        (
            {"scenarios": (FLIGHT, FLIGHT.replace(name="two"))},
            "cell 'two--paper1-tactical' differs",
        ),
        ({"limits": LossLimits(100.0)}, "limits is"),
    ],
)
def test_another_study_is_refused_in_a_folder(finished, change, words):
    before = tables(finished.folder)
    with pytest.raises(sd.DataError, match=words) as error:
        study(**change).run(finished.folder)
    assert "\n" not in str(error.value) and tables(finished.folder) == before


@pytest.mark.parametrize(
    "edit, words",
    [
        (lambda m: m["versions"].update(strapdown="0.0.1"), "was begun with strapdown 0.0.1"),
        (lambda m: m.update(format=7), "format 7, but this version reads 1"),
        (lambda m: m.pop("format"), "not the manifest of a study"),
    ],
)
def test_a_manifest_of_another_version_is_refused(tmp_path, edit, words):
    campaign = study(runs=5).run(tmp_path)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    edit(manifest)
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(sd.DataError, match=words):
        study(runs=5).run(tmp_path)
    assert len(campaign._files(campaign.cells[0])) == 1


def test_folders_that_hold_no_study_or_half_of_one(tmp_path, finished):
    with pytest.raises(
        sd.DataError, match="manifest.json: cannot be read .*give the folder of a study"
    ):
        Campaign.open(tmp_path / "nowhere")
    (tmp_path / "chunks" / "cell").mkdir(parents=True)
    (tmp_path / "chunks" / "cell" / "000000-000005.nc").write_bytes(b"")
    with pytest.raises(sd.DataError, match="chunks of a study but no manifest"):
        Campaign.begin(study(), tmp_path)
    (tmp_path / "a-file").write_text("")
    with pytest.raises(sd.DataError, match="cannot be made|cannot be read"):
        Campaign.begin(study(), tmp_path / "a-file" / "below")
    with pytest.raises(
        sd.DataError, match="no finished runs of 'another'; it has a-minute--paper1-tactical"
    ):
        Campaign.open(finished.folder).curves("another")


def test_a_damaged_chunk_is_named(tmp_path):
    campaign = study(runs=5).run(tmp_path)
    (path,) = campaign._files(campaign.cells[0])
    whole = path.read_bytes()
    middle = len(whole) // 2
    for damaged in (
        b"no NetCDF",
        whole[:middle],
        whole[:middle] + bytes(4000) + whole[middle + 4000 :],
    ):
        path.write_bytes(damaged)
        with pytest.raises(
            sd.DataError,
            match="000000-000005.nc: cannot be read .*remove it and run the study again",
        ):
            (
                campaign.numbers(campaign.cells[0]),
                campaign.read(campaign.cells[0], ("error", "std", "bias", "squares")),
            )


@pytest.mark.parametrize("copy", ["000020-000025.nc", "000000-000005.nc"])
def test_a_chunk_of_another_place_is_refused(tmp_path, finished, copy):
    """Copied within a campaign to runs that it does not have, or from another study: neither may
    enter the tables."""
    campaign = study(seed=5).run(tmp_path) if copy.startswith("000000") else study().run(tmp_path)
    first = finished._files(finished.cells[0])[0]
    (tmp_path / "chunks" / campaign.cells[0] / copy).write_bytes(first.read_bytes())
    with pytest.raises(
        sd.DataError,
        match=f"{copy}: cannot be read .it is the file of another study, cell or chunk, or manifest.json was changed.; remove it",
    ):
        Campaign.open(tmp_path).summary


def test_a_refused_study_leaves_its_folder_free(tmp_path):
    with pytest.raises(sd.DataError, match="error_model is 'banana'"):
        study(filters="open-loop:error_model=banana").run(tmp_path)
    Campaign.begin(study(seed=9), tmp_path)  # a manifest without a chunk binds nobody
    assert len(study(runs=5).run(tmp_path).runs) == 10


def test_two_studies_that_begin_at_once_do_not_mix(tmp_path):
    """The second takes the folder between the first's manifest and its work: the first notices."""
    first = Campaign.begin(study(runs=5), tmp_path)
    Campaign.begin(study(runs=5, seed=8), tmp_path)
    with first.lock(), pytest.raises(sd.DataError, match="seed is 8 there and 0 here"):
        first.check()


def test_two_processes_do_not_work_in_one_folder(tmp_path):
    campaign = Campaign.begin(study(), tmp_path)
    with (
        campaign.lock(),
        pytest.raises(sd.DataError, match="another process is running this campaign"),
    ):
        study().run(tmp_path)


FULL = """
import resource, sys
sys.path[:] = {path!r}
from test_study import study, sd
first = study(runs=5)
first.run()
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))     # a chunk has more, as on a disk that is full
try:
    first.run({out!r})
except sd.DataError as error:
    print(error)
"""


@pytest.mark.deep
@pytest.mark.skipif(not COMPILED, reason="a process without the compiler is too slow")
def test_a_full_disk_is_one_line_and_leaves_no_half_chunk(tmp_path):
    code = FULL.format(path=sys.path, out=str(tmp_path / "full"))
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (
        run.returncode == 0
        and run.stderr == ""
        and "000000-000005.nc: cannot be written (File too large)" in run.stdout
    )
    assert not [path for path in (tmp_path / "full" / "chunks").rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    "change, words",
    [
        ({"runs": 0}, "runs is 0; it must be a whole number, 1 or more"),
        ({"seed": -1}, "seed is -1"),
        ({"runs": 2.5}, "runs is 2.5"),
        ({"epoch": 0.0}, "epoch is 0.0 s"),
        ({"filters": ()}, "needs at least a scenario and a filter"),
        ({"filters": "closd-loop"}, "did you mean 'closed-loop'"),
        ({"filters": "periodic-reset:intervall=3"}, "has no option 'intervall'"),
        ({"filters": "periodic-reset:interval"}, "'interval' is not an option with a value"),
        ({"filters": ("open-loop", "open-loop")}, "two filters have the name 'open-loop'"),
        ({"scenarios": (FLIGHT, FLIGHT)}, "two cells"),
        ({"scenarios": "demmo"}, "demo"),
        ({"imus": "tactcal"}, "tactical"),
    ],
)
def test_impossible_studies_are_refused_in_one_line(change, words):
    with pytest.raises(sd.DataError, match=words) as error:
        study(**change)
    assert "\n" not in str(error.value)


@pytest.mark.short
@pytest.mark.parametrize("name", ["direct-ahrs", "fixed-gain"])
def test_a_filter_that_needs_attitude_is_refused_before_anything_is_written(
    tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    box, field = (
        FLIGHT.replace(attitude=Ahrs()),
        FLIGHT.replace(name="field", magnetometer=Magnetometer(), date="2024-05-01"),
    )
    for scenarios in (FLIGHT, (box, FLIGHT.replace(name="bare"))):
        with pytest.raises(
            sd.DataError,
            match=rf"^study: {name} needs attitude aiding, but the scenario '(a minute|bare)' has none: .*\[attitude\]",
        ) as error:
            study(scenarios=scenarios, filters=("closed-loop", name)).run("out")
        assert (
            "--ahrs" not in str(error.value)
            and "\n" not in str(error.value)
            and not list(tmp_path.iterdir())
        )
    assert study(scenarios=(box, field), filters=name).steps()


@pytest.mark.short
def test_a_chunk_skips_what_is_quarantined():
    tiny = study(scenarios=FLIGHT.replace(duration=4.0), filters="closed-loop", runs=3)
    arrays = run_chunk(tiny, tiny.chunks()[0], skip=(1,))
    assert [RUN_REASONS[int(code)] for code in arrays["reason"][0]] == [
        "survived",
        "quarantined",
        "survived",
    ]
    assert (
        np.isnan(arrays["error"][0, 1]).all()
        and np.isfinite(arrays["error"][0, 2]).all()
        and np.all(arrays["alive"] == 2)
    )
