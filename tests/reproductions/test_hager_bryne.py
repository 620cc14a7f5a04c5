"""The study end to end on two short flights, the numbers of its cells against hand-made ones,
and the page in a browser."""

import json
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from browser import CHROMIUM, needs_chromium
from pages import own
from test_hager_bryne_claims import world

from strapdown.engine.batch import fuse
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.scoring import ERROR_GROUPS
from strapdown.experiments.monte_carlo.study import SCALARS, parse_label, seeds, simulator
from strapdown.pages.shell import Page
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import Scenario
from strapdown.sim.trajectory import demo_flight
from strapdown_reproductions.common import pages, write_docs
from strapdown_reproductions.common.pages import COLOURS, Finding, write_page
from strapdown_reproductions.common.reproduction import Asked
from strapdown_reproductions.common.targets import claim
from strapdown_reproductions.hager_bryne import (
    ablations,
    claims as hager_bryne_claims,
    drift as hager_bryne_drift,
    main,
)
from strapdown_reproductions.hager_bryne.cells import (
    RESOLVED,
    CellRows,
    censored_mean_square,
    compare_filters,
    onsets,
    resolution_time,
    stack_parts,
)
from strapdown_reproductions.hager_bryne.figures import (
    errors_of_a_run,
    frame_of_biases,
    frame_of_errors,
)

GNSS = Gnss(interval=0.05, position_std=(1.0, 1.0, 1.0), velocity_std=None)
FLIGHTS = tuple(
    Scenario(f"paper1-{number}", demo_flight(), seconds, rate=20.0, gnss=GNSS, gate=np.inf)
    for number, seconds in (("01", 140.0), ("07", 150.0))
)
IMUS = ("paper1-consumer", "paper1-tactical")
OWN = main.Flown(FLIGHTS, FLIGHTS, IMUS)
T = np.arange(5.0, 305.0, 5.0)
RNG = np.random.default_rng(3)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def claims(out):
    wanted = main.studies(Asked(quick=True, runs=2), OWN)
    wanted |= {
        f"ablation-{name}": study for name, study in ablations.studies(FLIGHTS[:1], 2, 1).items()
    }
    said, shares = [], []
    found = main.make_outputs(
        out, wanted, Asked(threads=2, notify=said.append, progress=shares.append)
    )
    assert (
        "million filter steps in 7 studies" in said[0]
        and shares == sorted(shares)
        and shares[-1] == pytest.approx(1.0)
    )
    return found


def test_the_full_study_is_the_papers():
    wanted = main.studies(Asked(ablations=True))
    cross = {each.name: (75 if each.start == "chosen" else 25, 24) for each in main.worlds()}
    assert {name: (len(study.cells), study.runs) for name, study in wanted.items()} == {
        "flights": (33, 50),
        "offset": (21, 50),
        "initial": (21, 50),
        **cross,
        "ablation-filters": (3, 50),
        "ablation-gravity": (3, 50),
        "ablation-wide": (3, 50),
    }
    assert wanted["flights"].filters[:3] == wanted["offset"].filters
    assert [label.rpartition("=")[2] for label in wanted["flights"].filters[2:]] == [
        "without-prior",
        "zero-prediction",
    ]
    assert wanted["flights"].steps() == 50 * 4 * 3 * 20 * sum(
        cell.scenario.duration for cell in wanted["flights"].cells[::3]
    )
    assert all(
        cell.scenario.accel_offset == (0.5, 0.5, 0.5) and cell.scenario.name.endswith("-offset")
        for cell in wanted["offset"].cells
    )
    assert {cell.scenario.gravity for cell in wanted["ablation-gravity"].cells} == {"latitude"}
    wide = wanted["ablation-wide"].cells[0].scenario
    assert (
        wide.start_std[9:12] == wide.accel_offset == (0.5, 0.5, 0.5)
        and wide.start_std[:9] == wanted["offset"].cells[0].scenario.start_std[:9]
    )
    assert (
        main.studies(Asked(quick=True))["flights"].runs == 5
        and main.studies(Asked(runs=7, quick=True))["offset"].runs == 7
    )


def test_the_study_writes_page_tables_and_claims(out, claims):
    assert (
        json.loads((out / "claims.json").read_text()) == claims
        and len(claims) == 22
        and {c["verdict"] for c in claims} <= set(COLOURS)
    )
    html = (out / "index.html").read_text()
    for number in ("1a", "1b", "1c", "2", "4", "5a", "5b", "5c", "6a", "6b", "7", "8a", "8b", "9"):
        assert f"<h3>Figure {number}:" in html
    for name in (
        "flights",
        "offset",
        "initial",
        "bound",
        "worlds",
        "cells-std-alike-drawn-chosen-prior",
        "cells-density-alike-zero-chosen-printed",
        "turns",
        "offset-all",
        "initial-all",
        "drift",
        "drift-runs",
        *(f"ablation-{name}" for name in (*ablations.PAIRS, "gravity", "wide")),
    ):
        assert len(pd.read_csv(out / f"{name}.csv")), name
    assert "What the paper leaves open" in html and html.count("<tr id=claim") == 22


def test_cells_agree_with_the_campaigns_own_summary(out, claims):
    cells = pd.read_csv(out / "cells-std-alike-drawn-chosen-prior.csv")
    summary = pd.read_csv(out / "campaign" / "flights" / "summary.csv")
    for loop, name in (
        ("open", "open-loop:kinematics=geodetic"),
        ("closed", "closed-loop-error-bias"),
    ):
        own = summary[summary["filter"] == name].reset_index()
        np.testing.assert_allclose(
            cells[f"{loop}_censored_m"], own["censored_position_m"], rtol=1e-4
        )
        np.testing.assert_allclose(cells[f"{loop}_survived"], own["survived"])


def test_nothing_runs_twice(out, claims, monkeypatch):
    monkeypatch.setattr(
        "strapdown.experiments.monte_carlo.campaign.run_chunk", lambda *_: pytest.fail("ran again")
    )
    for name, study in main.studies(Asked(quick=True, runs=2), OWN).items():
        rows = 2 * len(study.scenarios) * len(study.filters) * len(study.imus)
        assert len(study.run(out / "campaign" / name, threads=1).runs) == rows


def figures_of(out):
    """[(heading, figure as plotly reads it)] of the page."""
    html = own(Page((out / "index.html").read_text(encoding="utf-8")))
    data = re.findall(r"<script type='application/json' id=data-p\d+>(.*?)</script>", html)
    headings = re.findall(r"<h3>(Figure .*?)</h3>", html)
    assert len(data) == len(headings) > 10
    return list(zip(headings, map(json.loads, data)))


def legend(drawn):
    return [each["name"] for each in drawn["data"] if each.get("showlegend") is not False]


def test_each_entry_of_a_legend_stands_there_once(out, claims):
    campaign = Campaign.open(out / "campaign" / "flights")
    errors = errors_of_a_run(campaign, campaign.cells[0])
    assert len(errors) == 2
    for heading, drawn in [*figures_of(out), *(("Figure 3", each.to_dict()) for each in errors)]:
        found = legend(drawn)
        assert len(set(found)) == len(found) or len(drawn["data"]) == 1, heading


@pytest.mark.short
def test_three_sigma_are_to_be_seen_where_errors_leave_them():
    stated = np.where(T < 20.0, 30.0, 1.0)
    limit, largest = frame_of_errors(T, np.exp(T / 40.0), stated)
    assert limit == pytest.approx(8.0) and largest == pytest.approx(np.exp(T[-1] / 40.0))
    small, _ = frame_of_errors(T, np.sin(T), stated)
    assert 1.0 <= small < 4.0


def test_the_flights_stand_in_three_dimensions(out, claims):
    """Each dynamic flight has a scene of its own; the straight one has none."""
    ((_, drawn),) = [each for each in figures_of(out) if each[0].startswith("Figure 1a")]
    assert [(each["type"], each["name"]) for each in drawn["data"]] == [("scatter3d", "01")]
    low, high = drawn["layout"]["scene"]["zaxis"]["range"]
    assert high - low >= 100.0


NO_VERDICT = re.compile("reproduced|partly|depends on the reading|not decidable", re.IGNORECASE)


def test_a_quick_page_has_no_word_of_a_verdict(out, claims):
    for name in ("index.html", "findings.md"):
        found = NO_VERDICT.findall((out / name).read_text(encoding="utf-8"))
        assert not found, (name, found)


def test_worlds_stand_side_by_side(out, claims):
    """A row per grade and world; the printed loop is worse than the corrected one."""
    table = pd.read_csv(out / "worlds.csv", dtype=str)
    assert len(table) == 2 * len(IMUS)
    cells = pd.read_csv(out / "cells-std-alike-drawn-chosen-prior.csv", dtype={"flight": str})
    row = table[(table["grade"] == "tactical") & table["sigma of Table III"].str.startswith("stat")]
    open_, closed, printed = map(float, row["position RMSE, m"].item().split(" / "))
    own = cells[cells["grade"] == "tactical"].median(numeric_only=True)
    assert open_ == pytest.approx(own["open_censored_500_m"], rel=5e-3)
    assert closed == pytest.approx(own["closed_censored_500_m"], rel=5e-3)
    assert printed > 1.2 * closed


def test_drift_is_that_of_an_ins_without_any_fix():
    """The open loop's own estimate of it agrees to a metre, the attitude to the start's error."""
    flown = main.Flown(FLIGHTS, FLIGHTS, ("paper1-tactical",))
    study = main.studies(Asked(runs=1), flown)["flights"]
    t, drift, turn = hager_bryne_drift.drift(study, 0, 0)
    cell = study.cells[0]
    recording, start = simulator(cell).run(cell.imu, seeds(study, cell, 0))
    label, options, _ = parse_label(study.filters[0])
    noise = cell.imu.noise()
    solution = fuse(recording, label, start=start, noise=noise, every=20, options=options)
    names = [f"ins_error_{axis} [m]" for axis in ("north", "east", "down")]
    estimated = np.sqrt(sum(np.square(solution.columns[name]) for name in names))
    assert drift[-1] > 10 and np.abs(estimated - np.interp(solution.t, t, drift))[-20:].max() < 1.5
    assert 0.01 < turn[0] < 1.0 and len(turn) == len(t)


def made_up(scale):
    """(numbers, Rows) of two filters, ten runs: the errors of the second are those of the first
    times `scale`."""
    error = RNG.standard_normal((1, 10, len(T), 15)) * np.array([1.0, scale])[:, None, None, None]
    distance = np.linalg.norm(error[..., :3], axis=-1)
    numbers = {name: np.ones((2, 10)) for name in SCALARS} | {
        "reason": np.zeros((2, 10)),
        "lasted": np.full((2, 10), 305.0),
        "left_model": np.full((2, 10), np.nan),
    }
    numbers |= {
        "censored": (distance**2).mean(axis=-1),
        "mean_square": np.ones((2, 10, len(ERROR_GROUPS))),
        "nees": np.full((2, 10), 15.0),
    }
    everywhere = np.ones(distance.shape, bool)
    return numbers, CellRows(
        T,
        error,
        np.ones_like(error),
        np.full(distance.shape, 15.0),
        np.zeros((10, len(T), 6)),
        distance,
        everywhere,
        everywhere,
    )


@pytest.mark.short
def test_ratios_of_made_up_errors():
    found = compare_filters(*made_up(2.0))
    for name in ("position_both", "position_500", "tilt_500", "heading_until", "gyro_bias_500"):
        assert (
            found[name] == pytest.approx(0.5)
            and found[f"{name}_low"] == pytest.approx(0.5)
            and found[f"{name}_count"] == 10
        )
    assert (
        found["open_survived"] == 1.0
        and found["open_anees"] == pytest.approx(1.0)
        and found["closed_diverged"] < 1.0
    )
    numbers, rows = made_up(3.0)
    assert compare_filters(*stack_parts((numbers, rows, 1), (numbers, rows, 0)))[
        "tilt_500"
    ] == pytest.approx(3.0)


@pytest.mark.short
def test_after_the_loss_every_epoch_counts_500_m():
    numbers, rows = made_up(1.0)
    within = rows.within.copy()
    within[0, :, len(T) // 2 :] = False
    distance = np.full_like(rows.distance, 3.0)
    found = censored_mean_square(rows._replace(within=within, distance=distance))
    np.testing.assert_allclose(found[0], (9 + 250_000) / 2)
    np.testing.assert_allclose(found[1], 9.0)


@pytest.mark.short
def test_onset_and_resolution_times():
    distance = np.array([[[1.0, 11.0, 2.0], [1.0, 2.0, np.inf], [1.0, 1.0, 1.0]]])
    np.testing.assert_array_equal(
        onsets(SimpleNamespace(t=T[:3], distance=distance), 0), [10.0, 15.0, np.inf]
    )
    big, small = 2 * RESOLVED, RESOLVED / 2
    np.testing.assert_array_equal(
        resolution_time(
            np.array(
                [
                    [big, small, small],
                    [small, big, small],
                    [small, small, big],
                    [small] * 3,
                    [np.nan] * 3,
                ]
            ),
            T[:3],
        ),
        [10, 15, 15, 5, 15],
    )


@pytest.mark.short
def test_a_page_of_findings_escapes_and_counts(tmp_path):
    one = Finding("a <claim>", "V", "", "a rule", "", "1 < 2", "", "figure 1", "")
    page = pages.ReproductionPage(
        "A <title>",
        ["text & more"],
        [one._replace(verdict=verdict)._asdict() for verdict in COLOURS],
        {
            "t": ("a table", pd.DataFrame({"x": [1.0, np.nan]})),
            "hidden": (None, pd.DataFrame({"y": [1]})),
        },
        notes=[("Choices", pd.DataFrame({"what": ["<b>"]}))],
    )
    write_page(tmp_path / "new", page)
    html = (tmp_path / "new" / "index.html").read_text()
    assert (
        "a &lt;claim&gt;" in html
        and "&lt;b&gt;" in html
        and "6 claims: 1 reproduced, 1 partly, 1 depends on the reading, 1 not reproduced, 1 not"
        in html
    )
    assert (
        "hidden.csv" not in html
        and (tmp_path / "new" / "hidden.csv").exists()
        and "Plotly" not in html
    )


@pytest.mark.short
def test_the_documentation_lists_the_claims_as_the_code_has_them():
    page = (
        Path(__file__).resolve().parents[2]
        / "docs"
        / "reference"
        / "evidence"
        / "open-or-closed-loop.md"
    ).read_text(encoding="utf-8")
    listed = re.findall(
        r"^\| (\d+) \| (.*?) \| \*\*(.*?)\*\* \|",
        page.partition(write_docs.mark("hager-bryne"))[2].partition("<!-- end")[0],
        re.MULTILINE,
    )
    known = [c["claim"] for c in hager_bryne_claims.claims(world(True))[0]]
    assert [text for _, text, _ in listed] == known[: len(listed)]
    assert {v for _, _, v in listed} <= set(COLOURS)
    # one that is newer than the study says so
    for number, text in enumerate(known[len(listed) :], len(listed) + 1):
        [row] = [line for line in page.splitlines() if line.startswith(f"| claim {number},")]
        assert text in row and "not yet run" in row


def test_findings_as_markdown_go_between_the_marks(out, claims, goes_into_its_page):
    text = (out / "findings.md").read_text()
    assert (
        text.startswith("This page: 2 runs")
        and len(re.findall(r"^\| \d+ \| .* \| \*\*", text, re.MULTILINE)) == 22
        and text.count("| tactical | 07 |") == 3
    )
    goes_into_its_page("hager-bryne", text)


@pytest.mark.short
def test_a_page_of_bounds_links_its_reports(tmp_path):
    page = pages.ReproductionPage(
        "Recordings",
        ["a `command` & <b>"],
        [claim("heading", 1.5, 2.0, "deg"), claim("roll", 0.5, 0.4, "deg")],
        {"t": ("a table", pd.DataFrame({"x": [1.0]}))},
        [("a flight", "flight.html")],
    )
    write_page(tmp_path, page)
    html = (tmp_path / "index.html").read_text()
    assert (
        "<td class='yes'>holds</td>" in html
        and "<td class='no'>does not hold</td>" in html
        and "&lt;= 2 deg" in html
        and "<a href='flight.html'>a flight</a>" in html
    )
    assert "<p>a <code>command</code> &amp; &lt;b&gt;</p>" in html


@pytest.mark.short
def test_a_wild_open_loop_does_not_flatten_the_biases():
    quiet = np.zeros(len(T))
    (low, high), left = frame_of_biases(T, quiet, 1e6 * T, quiet, quiet + 1)
    assert left and -10 < low < -1 and 1 < high < 10


@needs_chromium
def test_a_browser_without_network_draws_every_figure(out, claims, tmp_path):
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--no-first-run",
        "--disable-background-networking",
        "--virtual-time-budget=60000",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--enable-logging=stderr",
        "--log-level=0",
        f"--user-data-dir={tmp_path}",
    ]
    done = subprocess.run(
        [CHROMIUM, *flags, "--dump-dom", f"file://{out / 'index.html'}"],
        capture_output=True,
        timeout=180,
    )
    said = [
        line
        for line in done.stderr.decode(errors="replace").splitlines()
        # what the browser itself remarks on three dimensions without a graphics card
        if ":CONSOLE" in line and "WebGL" not in line and "Canvas2D" not in line
    ]
    count = (out / "index.html").read_text().count("class=plot ")
    assert (
        done.returncode == 0
        and not said
        and re.search(f'data-drawn="{count}"', done.stdout.decode(errors="replace"))
    ), said
