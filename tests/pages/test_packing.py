"""Packing figures: numbers come back as finely as anybody can see, and scripts are cut to what
figures use, or not at all."""

import base64

import numpy as np
import plotly.graph_objects as go
import pytest
from pages import plotly, unpacked

from strapdown.pages import script
from strapdown.pages.packing import pack_json
from strapdown.pages.shell import Document, Page, figure_html, shell

pytestmark = pytest.mark.short
RNG = np.random.default_rng(1)


@pytest.mark.parametrize(
    "values",
    [
        1000 + RNG.standard_normal(500).cumsum(),
        np.exp(-np.arange(300) / 20.0),
        np.r_[np.nan, 1.0, np.nan, np.nan, 2.5, np.nan],
        np.arange(0, 86400, 43.2),
        np.zeros(5),
        np.array([-3.0]),
    ],
)
def test_numbers_come_back(values):
    back = np.array(unpacked(pack_json({"a": [{"y": values}]}))["a"][0]["y"], float)
    change = np.abs(np.diff(values[np.isfinite(values)]))
    usual = np.median(change[change > 0]) if change.any() else 1.0
    assert np.array_equal(np.isnan(back), np.isnan(values))
    assert np.nanmax(np.abs(back - values)) <= usual / 512 + 1e-12


@pytest.mark.parametrize(
    "values", [np.full(3, np.nan), np.array([1.0, np.inf]), np.array([1e-12, 1e9, 2e-12, 3e-12])]
)
def test_what_cannot_be_packed_stays(values):
    figure = go.Figure(go.Scatter(y=values))
    (trace,) = unpacked(pack_json(figure.to_plotly_json()))["data"]
    spec = trace["y"]
    assert np.array_equal(np.frombuffer(base64.b64decode(spec["bdata"])), values, equal_nan=True)


def page(*traces):
    sections = [("s", figure_html(1, go.Figure(traces), "Height"))]
    return Page(shell(Document("t", {}, "", "", sections=sections)))


def test_a_page_has_the_part_of_the_script_that_it_uses():
    line, space = page(go.Scatter(y=[1, 2])), page(go.Scatter3d(x=[1], y=[2], z=[3]))
    assert "alpha_shape:" not in plotly(line) and "alpha_shape:" in plotly(space)
    assert "maplibre-gl-worker" not in plotly(space)
    assert len(line.html) < 0.6e6 and len(space.html) < 0.8e6
    assert "Copyright 2012-" in plotly(line)  # the licence
    assert "id=plotly" not in shell(Document("t", {}, "", "", sections=[("s", "text")]))


def test_an_unknown_script_stays_whole(monkeypatch):
    from plotly import offline

    for text in ("/* plotly.js v9.0.0 */ var a=W(", "/* plotly.js v4.1.9 */ another build"):
        monkeypatch.setattr(offline, "get_plotlyjs", lambda text=text: text)
        script.plotly_script.cache_clear()
        assert script.plotly_script(frozenset({"scatter"})) == text
    script.plotly_script.cache_clear()


def test_figures_say_what_they_show_to_those_who_do_not_see_them():
    figure = go.Figure(go.Scatter(y=[1, 2], name="<b>up</b>"))
    figure.update_layout(yaxis={"title": "height [m]", "range": [1, 2]}, xaxis_title="time [s]")
    html = figure_html(1, figure, "Height of 'a' & b")
    assert (
        "aria-label='Height of &#x27;a&#x27; &amp; b. up: height [m] from 1 to 2. "
        "across: time [s]. shown:  up '" in html
    )
    assert "role=img tabindex=0" in html
