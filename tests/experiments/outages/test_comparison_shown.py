"""A comparison in a notebook: what it shows, its figures by name, its scores as tables and arrays."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.experiments.outages.result import unit
from strapdown.sim.trajectory import demo_flight


@pytest.fixture(scope="module")
def comparison():
    recording = sd.simulate(demo_flight(), 100.0, "tactical", seed=1, rate=20.0)
    return sd.compare(recording, ["closed-loop", "mekf"], outages=[(60, 70), (80, 95)])


def test_it_shows_answer_summary_and_verdicts(comparison):
    shown = comparison._repr_html_()
    assert "Comparison demo flight" in shown and "RMSE horizontal, median [m]" in shown
    assert "closed-loop, mekf" in shown  # verdicts that agree stand together
    assert "<script" not in shown


@pytest.mark.parametrize("name", ["growth", "outages", "paired", "course", "coverage", "track"])
def test_its_figures_stand_alone(comparison, name):
    assert len(comparison.plot(name).data) and comparison.plot(name).layout.title.text


def test_a_figure_that_is_not_there_is_told(comparison):
    with pytest.raises(sd.DataError, match=r"figure is 'grow' \(did you mean 'growth'\?\)"):
        comparison.plot("grow")
    with pytest.raises(sd.DataError, match="length is 7; the outages are 15 s long"):
        comparison.plot("growth", length=7)
    with pytest.raises(sd.DataError, match="outage is 3"):
        comparison.plot("course", outage=3)
    assert "outage 2" in comparison.plot("course", outage=2).layout.title.text


def test_scores_are_a_table_and_arrays_with_units(comparison):
    pytest.importorskip("xarray")
    frame, made = comparison.to_pandas(), comparison.to_xarray()
    assert made.sizes == {"filter": 2, "outage": 2}
    assert list(made["filter"].values) == ["closed-loop", "mekf"]
    assert made["drift_percent"].attrs["units"] == "percent"
    value = made["horizontal_end_m"].sel(filter="mekf", outage=2)
    assert float(value) == frame["horizontal_end_m"]["mekf", 2] and np.isfinite(value)
    assert [unit(name) for name in ("a_m_s", "a_m", "a_s", "coverage_1")] == ["m/s", "m", "s", "1"]
