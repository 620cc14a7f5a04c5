"""Bars of long calls: who is told, that a bar goes whatever happens, and what is refused."""

import sys
import types

import pytest

import strapdown as sd
from strapdown import progress
from strapdown.progress import bar_html, listener, with_bar
from strapdown.sim.trajectory import demo_flight

pytestmark = pytest.mark.short


@pytest.fixture
def cells(monkeypatch):
    """What a notebook's cells show, as IPython would be asked to show it."""
    shown = []

    class Handle:
        def update(self, html):
            shown.append(html)

    def display(html, display_id):
        assert display_id is True
        shown.append(html)
        return Handle()

    shell = types.SimpleNamespace(kernel=True)
    ipython = types.ModuleType("IPython")
    ipython.get_ipython = lambda: shell
    ipython.display = types.ModuleType("IPython.display")
    ipython.display.display, ipython.display.HTML = display, str
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", ipython.display)
    monkeypatch.setattr(progress, "STEP", 0.0)
    return shown


def test_a_function_given_is_told_and_nothing_else_is():
    done = []
    listener(done.append)(0.5)
    listener(None)(0.5)
    listener(False)(0.5)
    assert done == [0.5]
    with pytest.raises(sd.DataError, match="progress is 'yes'; it must be True, or a function"):
        listener("yes")


def test_a_cell_shows_how_far_a_run_is_and_is_empty_at_the_end(cells):
    recording = sd.simulate(demo_flight(), 8.0, "tactical", seed=1, rate=50.0)
    sd.fuse(recording, progress=True)
    assert cells[0].startswith("<progress max=1 value=0.000>") and "fuse: 0 %" in cells[0]
    assert "fuse: 100 %, 0:00 min left" in cells[-2] and cells[-1] == ""


def test_a_bar_goes_where_the_call_fails(cells):
    @with_bar("doomed")
    def doomed(first, *, progress=None):
        listener(progress)(0.5)
        raise ValueError(first)

    with pytest.raises(ValueError, match="x"):
        doomed("x", progress=True)
    assert "doomed: 50 %" in cells[-2] and cells[-1] == ""
    with pytest.raises(ValueError):
        doomed(True)  # which is no progress
    assert len(cells) == 3


def test_nothing_is_shown_where_there_is_neither_notebook_nor_terminal(capsys):
    with progress.bar("quiet") as tell:
        tell(0.5)
    assert capsys.readouterr() == ("", "")


def test_the_time_left_is_by_the_time_of_what_is_done():
    assert bar_html("study", 0.25, 30.0).endswith("study: 25 %, 1:30 min left")
    assert bar_html("study", 0.001, 30.0).endswith("study: 0 %")
