"""When an estimate should decay: the closed form against integration and its limits, the intervals, and
a small study."""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from strapdown_reproductions.bias_decay import law, main
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.common.write_docs import DOCS, mark


@pytest.mark.short
@pytest.mark.parametrize("time", [0.5, 3.0, 40.0, 1e5, np.inf])
@pytest.mark.parametrize("length", [0.01, 1.0, 30.0])
def test_the_displacement_is_the_double_integral(time, length):
    inner = lambda t: quad(lambda s: np.exp(-s / time), 0, t, limit=200)[0]
    assert law.displacement(time, length) == pytest.approx(
        quad(inner, 0, length, limit=200)[0], rel=1e-6
    )


@pytest.mark.short
def test_the_boundary_is_twice_the_assumed_time_and_then_four_tenths_of_the_outage():
    assert law.boundary(1e-3) == pytest.approx(2.0, abs=1e-3)
    assert law.boundary(1e4) / 1e4 == pytest.approx(0.392, abs=1e-3)
    for length in (0.1, 1.0, 5.0, 100.0):
        edge = law.boundary(length)
        assert law.held_is_better(1.01 * edge, 1.0, length)
        assert not law.held_is_better(0.99 * edge, 1.0, length)
        assert not law.held_is_better(1.0, 1.0, length) and law.held_is_better(np.inf, 1.0, length)


@pytest.mark.short
def test_intervals_hold_the_ratio_and_few_seeds_have_none():
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(100):
        squares = rng.standard_normal((60, 2)) ** 2 * [1.0, 0.25]
        low, high = main.interval(squares)
        inside += low < 0.5 < high
    assert inside > 87
    assert np.isnan(main.interval(np.ones((main.FEWEST - 1, 2)))).all()


@pytest.mark.short
@pytest.mark.parametrize("right, agree, wrong", [(True, 1.0, 0.0), (False, 0.0, 4.0)])
def test_figures_of_worlds_that_obey_and_that_do_not(right, agree, wrong):
    cells = [(*true, length) for true in main.TRUE for length in main.LENGTHS]
    rows = []
    for time, size, length in cells:
        held = law.held_is_better(time, main.ASSUMED, length) == right
        for seed in range(main.FEWEST):
            found = {"true_s": time, "size": size, "outage_s": length, "seed": seed}
            rows.append(
                found | {"decaying_m": 2.0 if held else 1.0, "held_m": 1.0 if held else 2.0}
            )
    found = main.figures(StudyTables(runs=pd.DataFrame(rows)))
    assert found == {"agree": agree, "right": wrong}


def test_biases_much_larger_than_assumed_are_held_and_short_ones_are_not():
    table = lambda *cell: main.table(pd.DataFrame(main.rows(cell, range(900, 904))))
    large, short = table(np.inf, main.LARGE, 30.0), table(25.0, 1.0, 30.0)
    assert large["ratio"].item() < 0.4 and short["ratio"].item() > 1.02


def test_the_study_writes_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(main, "TRUE", main.TRUE[2:3])
    monkeypatch.setattr(main, "LENGTHS", (10.0,))
    assert main.reproduce(tmp_path, runs=2, seed=9, workers=1) == []  # two seeds decide nothing
    runs = pd.read_csv(tmp_path / "runs.csv")
    assert set(runs["seed"]) == {9000, 9001} and (runs["held_m"] != runs["decaying_m"]).all()
    assert "| 1 |" in (tmp_path / "table.md").read_text()
    assert mark("bias-decay") in (DOCS / "bias-decay.md").read_text(encoding="utf-8")
