"""Figures by name: those of the report and those of a recording, alone and with their headings."""

from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from synthetic import flight, solution

import strapdown as sd
from strapdown.checks import DataError
from strapdown.pages.figure_list import figures_of_page
from strapdown.pages.notebook import plots
from strapdown.pages.notebook.recording_figures import FIGURES
from strapdown.sim.trajectory import demo_flight

pytestmark = pytest.mark.short
TRUTH = flight(60, rate=2.0)
SOLUTION = solution(TRUTH)
DRAWN = [
    "track",
    "height",
    "horizontal-error",
    "position-error",
    "velocity-error",
    "attitude-error",
]


@pytest.fixture(scope="module")
def recording():
    made = sd.simulate(demo_flight(), 20.0, "tactical", seed=1, rate=50.0)
    warmth = np.array([[0.0, 20.0], [20.0, 21.0]])
    return replace(made, meta=made.meta | {"temperature": warmth})


@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_of_the_report_stands_alone_with_its_heading(name):
    made = SOLUTION.plot(name, TRUTH)
    title = next(figure.title for figure in figures_of_page() if figure.name == name)
    assert isinstance(made, go.Figure) and len(made.data)
    assert made.layout.title.text.startswith(title)
    assert made.update_layout(height=300).layout.height == 300


def test_the_track_is_drawn_by_default_and_errors_stand_for_those_there_are():
    assert SOLUTION.plot().layout.title.text == "Seen from above"
    assert SOLUTION.plot("errors", TRUTH).layout.title.text.startswith("Position error")
    still = replace(TRUTH, lla=np.full_like(TRUTH.lla, np.nan), v_n=None)
    only = replace(SOLUTION, trajectory=replace(SOLUTION.trajectory, lla=still.lla))
    assert only.plot().layout.title.text.startswith("Attitude")
    assert only.plot("errors", still).layout.title.text.startswith("Attitude error")


def test_the_reference_is_that_of_the_recording_where_none_is_given(recording):
    made = sd.fuse(recording)
    assert made.plot("errors").layout.title.text.startswith("Position error")
    assert made.plot("position").layout.title.text == "Position"  # which no reference goes with


def test_what_the_page_says_below_a_figure_stands_above_it():
    note = "one leaves the frame " * 10
    figure = go.Figure().update_layout(meta={"notes": [note]}, height=200)
    alone = plots.add_title(figure, "A & B")
    assert alone.layout.title.text.startswith("A &amp; B<br><sub>one leaves")
    assert alone.layout.title.text.count("<br>") == 2 and alone.layout.height > 200


def test_what_cannot_be_drawn_is_told_in_a_line(recording):
    with pytest.raises(DataError, match=r"figure is 'trak' \(did you mean 'track'\?\)"):
        SOLUTION.plot("trak")
    with pytest.raises(DataError, match=r"figure is 'spectre' \(did you mean 'spectra'\?\)"):
        recording.plot("spectre")
    with pytest.raises(DataError, match="nothing to draw there without a reference: give"):
        SOLUTION.plot("errors")
    with pytest.raises(DataError, match="this recording has nothing to draw there"):
        replace(recording, sources=(), reference=None).plot("track")
    none = replace(SOLUTION, trajectory=SOLUTION.trajectory.take(slice(0, 0)))
    with pytest.raises(DataError, match="the solution has no rows, so there is nothing to draw"):
        none.plot()


@pytest.mark.parametrize("name", ["track", "height", "attitude", "velocity", "gyro-bias", "sigma"])
def test_one_row_is_drawn(name):
    one = slice(0, 1)
    made = replace(
        SOLUTION,
        trajectory=SOLUTION.trajectory.take(one),
        b_a=SOLUTION.b_a[one],
        b_g=SOLUTION.b_g[one],
        status=SOLUTION.status[one],
    )
    assert len(made.plot(name).data)


@pytest.mark.parametrize("name", FIGURES)
def test_figures_of_a_recording(recording, name):
    made = recording.plot(name)
    assert made.layout.title.text == FIGURES[name][0]
    assert len(made.data) >= (1 if name == "temperature" else 2)
    dated = replace(recording, meta=recording.meta | {"epoch": "2024-05-01T12:00:00Z"}).plot(name)
    labels = [axis.title.text or "" for axis in dated.select_xaxes()]
    dates = any("from 2024-05-01 12:00:00 UTC on" in label for label in labels)
    assert dates == (name not in ("track", "spectra"))


def test_fixes_are_drawn_when_they_were_and_where(recording):
    marks = recording.plot("sources").data
    assert list(marks[1].x) == pytest.approx(recording.sources[0].t)
    fixes, reference = recording.plot("track").data
    assert (fixes.x[0], fixes.y[0]) == (0, 0) and len(fixes.x) == 20
    assert np.hypot(reference.x[0], reference.y[0]) == pytest.approx(
        45.0, abs=10
    )  # a second before
