"""What cells of a notebook show: few lines, without script, names from files inert; of solutions without
rows too."""

import html
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import Innovations, Solution, Source, Trajectory
from strapdown.data.verdict import Reason, Untested, Verdict
from strapdown.pages.notebook import cards
from strapdown.sim.trajectory import demo_flight

pytestmark = pytest.mark.short
MARKUP = "<script>alert(1)</script>&'\""


@pytest.fixture(scope="module")
def recording():
    return sd.simulate(demo_flight(), 8.0, "tactical", seed=1, rate=50.0)


@pytest.fixture(scope="module")
def solution(recording):
    return sd.fuse(recording)


def text(shown):
    """The words of HTML without its style."""
    return re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", shown.removeprefix(cards.STYLE))).strip()


def rows(solution, count):
    """The first rows of a solution; none at all too."""
    few = slice(0, count)
    fixes = solution.innovations
    none = Innovations(
        *(part[:0] for part in (fixes.t, fixes.source, fixes.innovation)),
        np.zeros(0),
        np.zeros(0, bool),
    )
    return replace(
        solution,
        trajectory=solution.trajectory.take(few),
        b_a=solution.b_a[few],
        b_g=solution.b_g[few],
        status=solution.status[few],
        innovations=none,
        meta={"filter": "closed-loop"},
        recording=None,
    )


def test_a_recording_says_what_was_measured(recording):
    shown = text(recording._repr_html_())
    assert "Recording demo flight time 0.0 to 8.0 s, 8 s" in shown
    assert "400 samples, 50 Hz, tactical" in shown
    assert "reference position, velocity and attitude, 0.0 to 8.0 s, 50 Hz" in shown
    assert "source kind fixes rate gaps GNSS position position 8 1 Hz none" in shown


def test_gaps_and_dates_and_notes_of_a_recording_are_said(recording):
    keep = recording.sources[0].t
    source = recording.sources[0]._where((keep < 2.5) | (keep > 6.5))
    meta = {"epoch": "2024-05-01T12:00:00Z", "notes": ["a spike was left out"] * 20}
    made = replace(recording, sources=(source,), meta=recording.meta | meta)
    shown = text(made._repr_html_())
    assert "date 2024-05-01 12:00:00.0 to 12:00:08.0 UTC" in shown
    assert "1, the longest 5 s" in shown
    assert shown.count("a spike was left out") == cards.MAX_LINES and "and 8 more" in shown


def test_a_solution_says_its_verdict_first_then_where_it_is_and_how_sure(solution):
    shown = text(solution._repr_html_())
    assert shown.startswith("Solution demo flight not judged")
    last = solution.table().iloc[-1]
    assert f"at the end {last.lat:.7f}, {last.lon:.7f} deg ± " in shown
    error = sd.rms(sd.errors(solution, solution.recording.reference))
    assert f"RMS error horizontal {np.hypot(*error.position[:2]):.3g} m" in shown
    assert "GNSS position 7 0" in shown and "rows 350 " in shown


def test_rows_that_are_not_valid_are_counted(solution):
    status = solution.status.copy()
    status[10:13], status[20:25] = 1, 2
    shown = text(replace(solution, status=status)._repr_html_())
    assert "rows 350, 3 bridged, 5 not valid" in shown


@pytest.mark.parametrize("count", [0, 1])
def test_solutions_of_no_row_and_of_one_row_show_themselves(solution, count):
    made = rows(solution, count)
    shown = text(made._repr_html_())
    assert "not judged" in shown and ("no rows" in shown) == (count == 0)
    assert text(made.trajectory._repr_html_()).startswith(f"Trajectory rows {count}")
    assert "\n" not in repr(made)


def test_names_with_markup_are_inert(recording, solution):
    sources = tuple(replace(a, name=MARKUP) for a in recording.sources)
    meta = {"name": MARKUP, "recording": MARKUP, "filter": MARKUP, "grade": {"name": MARKUP}}
    meta |= {"notes": [MARKUP]}
    made = replace(recording, sources=sources, meta=recording.meta | meta)
    reason = Reason("clock", MARKUP, MARKUP, MARKUP)
    verdict = Verdict("doubtful", (reason,), (Untested(MARKUP, MARKUP, MARKUP),))
    fixes = replace(solution.innovations, names=(MARKUP, MARKUP + "2"))
    judged = replace(
        solution, innovations=fixes, meta=solution.meta | meta | {"verdict": verdict.as_dict()}
    )
    labels = made.plot("sources").layout.yaxis.ticktext
    names = [trace.name for what in ("sources", "track") for trace in made.plot(what).data]
    assert MARKUP in str(made) and "<script" not in "".join([*labels, *names])
    for each in (made, made.sources[0], judged, verdict):
        assert "script&gt;alert" in each._repr_html_() and "<script" not in each._repr_html_()
    framed = replace(sd.report(solution), html=f"<p title=\"'x'\">{MARKUP}")._repr_html_()
    assert "<script" not in framed and framed.count('"') == 2


def test_a_page_is_a_frame_whose_scripts_reach_nothing_else(solution):
    page = sd.report(solution)
    shown = page._repr_html_()
    assert shown.startswith("<iframe sandbox='allow-scripts' ") and "allow-same-origin" not in shown
    assert html.unescape(re.search('srcdoc="([^"]*)"', shown)[1]) == page.html


def test_a_verdict_shows_its_reasons():
    verdict = Verdict("doubtful", (Reason("clock", "0.2 s late", "write offset = 0.2"),))
    assert text(verdict._repr_html_()) == f"doubtful {verdict.reasons[0]}"
    assert "class='word doubt'" in verdict._repr_html_()
    assert repr(verdict) == "Verdict(doubtful: time stamps: 0.2 s late; write offset = 0.2)"


def test_a_source_and_a_trajectory_that_know_little():
    empty = np.zeros(0)
    source = Source("position", empty, np.zeros((0, 3)), np.zeros((0, 3)))
    assert text(source._repr_html_()) == "Source position kind position fixes 0"
    nothing = Trajectory(np.arange(3.0), np.full((3, 3), np.nan))
    assert "known nothing, 0.0 to 2.0 s, 1 Hz" in text(nothing._repr_html_())


def test_no_reference_that_overlaps_is_said(solution):
    late = replace(solution.recording.reference, t=solution.recording.reference.t + 1000)
    made = replace(solution, recording=replace(solution.recording, reference=late))
    assert "RMS error not known: " in text(made._repr_html_())


def test_importing_the_library_imports_nothing_of_a_notebook(solution):
    assert isinstance(solution, Solution)
    code = "import sys, strapdown as sd; sd.Solution, sd.Recording; print([m for m in sys.modules if m.startswith(('plotly', 'xarray', 'pandas', 'IPython', 'strapdown.pages.notebook'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
