"""The page of a study says what its numbers say."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from strapdown.evaluation.consistency import paired_comparison
from strapdown.experiments.monte_carlo import page as study_page
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sim.scenario import Scenario
from strapdown.sim.trajectory import demo_flight

FLIGHT = Scenario("half a minute", demo_flight(), 30.0, rate=20.0)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    made = Study(FLIGHT, ("closed-loop", "open-loop"), ("tactical", "consumer"), runs=3, seed=1)
    return made.run(tmp_path_factory.mktemp("study"), threads=1)


def test_the_page_has_a_figure_of_each_kind_and_cell_and_the_numbers_of_the_table(campaign):
    html = campaign.page().html
    for cell in campaign.cells:
        for name in ("Position error", "Heading error", "NEES per state", "Runs alive"):
            assert f"<h3>{name}, {cell}</h3>" in html
    assert html.count("<div class=plot ") == 8
    rows = re.findall("<tr>((?:<td>[^<]*</td>)+)</tr>", html)
    assert len(rows) == 4
    for row, values in zip(rows, campaign.summary.to_dict("records")):
        _, imu, name, survived, rmse, *_ = re.findall("<td>([^<]*)</td>", row)
        assert (imu, name) == (values["imu"], values["filter"])
        lost = sum(values[why] for why in study_page.GIVEN_UP)
        assert survived == f"{3 - lost} of 3"
        if rmse[0] != "–":
            assert float(rmse.split()[0]) == pytest.approx(values["rmse_position_m"], rel=0.01)


def made_up(monkeypatch, *logs):
    """A Campaign of one cell whose filters a, b, ... have these logarithms of squared errors."""
    names = "abc"[: len(logs)]

    def compare(campaign, cell, first, second):
        return paired_comparison(
            np.array(logs[names.index(first)]), np.array(logs[names.index(second)])
        )

    monkeypatch.setattr(study_page, "compare", compare)
    return SimpleNamespace(manifest={"filters": list(names), "runs": len(logs[0])}, cells=["one"])


def test_it_names_the_best_only_where_the_runs_separate_it(monkeypatch):
    runs = np.random.default_rng(1).normal(size=12)
    clear = made_up(monkeypatch, runs + 2, runs, runs + 4 + 0.1 * runs)
    assert study_page.least(clear, "one") == ("b", [])
    assert study_page._of_cell(clear, "one") == (
        "b has the smallest position error, 0.368 times that of a (95 %: 0.368 to 0.368)"
    )
    other = np.random.default_rng(2).normal(size=12)
    alike = made_up(monkeypatch, runs, other)
    assert study_page._of_cell(alike, "one").startswith("12 runs cannot separate")
    partly = made_up(monkeypatch, runs, other, runs + 9)
    assert " have the smallest position errors" in study_page._of_cell(partly, "one")


def test_the_headline_counts_the_runs_that_were_given_up(campaign):
    said = study_page.headline(campaign)
    lost = campaign.summary.groupby("filter")[list(study_page.GIVEN_UP)].sum().sum(axis=1)
    if lost.any():
        assert all((f"of {name} w" in said) == (count > 0) for name, count in lost.items())
    else:
        assert said.endswith("all 6 runs of each filter survived.")
