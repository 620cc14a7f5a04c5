"""When the geometry of a filter pays: starts, counts of starts that come home, and a small study."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import ATT
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.common.write_docs import DOCS, mark
from strapdown_reproductions.consistency import refused
from strapdown_reproductions.geometry import main, runs, worlds


@pytest.mark.short
@pytest.mark.parametrize("motion", ["flight", "road"])
def test_starts_are_off_as_far_as_they_say(motion):
    setting = worlds.FarSetting(motion, "tactical", 5.0)
    recording = worlds.record(setting, 3)
    true, found = worlds.true_attitude(recording), list(worlds.starts(recording, "tactical", 3))
    assert len(found) == 27
    for heading, tilt, start in found:
        attitude = Rotation.from_euler("ZYX", start.rph[::-1])
        down = (attitude * true.inv()).as_matrix()[2, 2]
        assert np.degrees(np.arccos(min(1.0, down))) == pytest.approx(tilt, abs=1e-5)
        if tilt == 0:
            off = np.degrees((attitude * true.inv()).magnitude())
            assert off == pytest.approx(heading, abs=1e-6)
        assert np.degrees(start.std[ATT][2]) == pytest.approx(heading)


def made(ends, claims=1.0):
    """A table of starts with these attitude errors at the end, deg, by filter."""
    setting = main.SETTINGS[0]._asdict()
    rows = [
        {**setting, "seed": seed, "filter": name, "end_deg": end, "claims": claims}
        for name, values in ends.items()
        for seed in (1, 2)
        for end in values
    ]
    return pd.DataFrame(rows)


@pytest.mark.short
def test_starts_that_come_home_are_counted_of_27():
    ends = {"closed-loop": [1.0, 1.9, 2.1], "iekf": [0.1, 0.2, 1.0]}
    (row,) = main.home(made(ends)).to_dict("records")
    assert row["closed-loop"] == pytest.approx(18) and row["iekf"] == pytest.approx(27)


@pytest.mark.short
@pytest.mark.parametrize("claims, sure", [(4.9, 0), (5.1, 2)])
def test_starts_that_are_lost_and_sure(claims, sure):
    table = main.wrong_and_sure(made({"iekf": [0.1, 50.0]}, claims)).set_index("filter")
    assert table.loc["iekf"].tolist() == [4, 2, sure]


@pytest.mark.short
def test_figures_are_of_the_worst_setting_and_flight():
    flown = pd.DataFrame(
        [
            ("02", "closed-loop", 1.0),
            ("02", "iekf", 0.9),
            ("07", "closed-loop", 2.0),
            ("07", "iekf", 2.2),
        ],
        columns=["flight", "filter", "anees"],
    )
    ends = {"closed-loop": [1.0, 3.0], "iekf": [1.0, 1.0]}
    cells = pd.DataFrame(
        [
            ("car", "consumer", 0.9, 0.01),
            ("ship", "tactical", 1.08, 0.03),
            ("car", "dmu10", 1.0, 0),
        ],
        columns=["scenario", "grade", "ratio", "std"],
    )
    found = main.figures(StudyTables(starts=made(ends), flights=flown, cells=cells))
    wanted = {"home": 27.0, "beside": 13.5, "flights": 1.1, "refused": 0.9, "cells": 1.02}
    assert found == pytest.approx(wanted)


@pytest.mark.short
def test_refused_cells_are_those_of_the_table_of_consistency():
    of_loop = {cell[1:] for cell in refused.REFUSED if cell.filter == "closed-loop"}
    assert set(main.REFUSED) == of_loop


def test_a_cell_compares_runs_with_the_same_random_numbers():
    (row,) = runs.cell("hand-held", "tactical", 4, 3)
    assert row["survived, closed-loop"] == row["survived, iekf"] == row["runs"] == 4
    assert 0.5 < row["ANEES, closed-loop"] < 2 and abs(row["ratio"] - 1) < 0.1
    assert 0 < row["std"] < 0.05


def test_at_rest_each_filter_has_a_claim(monkeypatch):
    monkeypatch.setattr(runs, "RESTING", 20.0)
    rows = pd.DataFrame(runs.at_rest("tactical", 5))
    assert list(rows["filter"]) == list(runs.AT_REST)
    assert rows["claim_deg"].between(1, 31).all() and rows["error_deg"].abs().max() < 180


def test_the_study_writes_its_page(tmp_path, monkeypatch):
    setting = worlds.FarSetting("flight", "tactical", 15.0)
    monkeypatch.setattr(main, "SETTINGS", (setting,) * 3)
    monkeypatch.setattr(runs, "RESTING", 20.0)
    monkeypatch.setattr(main, "QUICK_REST_RUNS", 1)
    claims = main.reproduce(tmp_path, quick=True, workers=1)
    assert {claim["claim"] for claim in claims} == {target.text for target in main.TARGETS.values()}
    assert "Starts far off" in (tmp_path / "table.md").read_text()
    assert mark("geometry") in (DOCS / "geometry.md").read_text(encoding="utf-8")
