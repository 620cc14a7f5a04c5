"""The page: self-contained, honest about what it was given, and really drawn by a browser that
has no network."""

import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest
from browser import browse, needs_chromium
from pages import own, plotly
from synthetic import flight, solution

from strapdown import report
from strapdown.checks import DataError
from strapdown.core.loop.contract import BRIDGED, INVALID, VALID
from strapdown.evaluation import metrics
from strapdown.pages.drawing import WITHHELD

pytestmark = pytest.mark.short
TRUTH = flight(600, rate=2.0)
SOLUTION = solution(TRUTH)
OPEN = solution(TRUTH, seed=2, drift=0.02, name="open-loop")


@pytest.fixture(scope="module")
def page():
    return report([SOLUTION, OPEN], TRUTH, title="Flight <1> & more")


def cells(html, label):
    """The cells of the first table row that begins with `label`."""
    return re.findall(
        r">([^<]*)</td>", re.search(rf"<tr><td>{re.escape(label)}</td>(.*?)</tr>", html)[1]
    )


def test_nothing_is_fetched(page):
    assert "default-src 'none'" in page.html and plotly(page).count("plotly.js v") == 1
    assert not re.search(
        r"(src|href|url|action)\s*[=(]\s*['\"]?\s*(https?:)?//", own(page)
    ) and "@import" not in own(page)
    assert len(page.html) < 2e6


def test_the_summary_tells_the_errors(page):
    e = metrics.rms(metrics.errors(SOLUTION, TRUTH))
    north, heading = cells(page.html, "north position [m]"), cells(page.html, "heading [deg]")
    assert float(north[0]) == pytest.approx(e.position[0], rel=0.01) and float(
        heading[0]
    ) == pytest.approx(np.degrees(e.rph[2]), rel=0.01)
    assert float(north[3]) == pytest.approx(
        metrics.rms(metrics.errors(OPEN, TRUTH)).position[0], rel=0.01
    )
    assert [int(text) for text in cells(page.html, "closed-loop: gnss")[:2]] == list(
        SOLUTION.counts()["gnss"]
    )
    assert (
        cells(page.html, "time not valid [s]")[0] == "11.5"
        and cells(page.html, "gaps bridged")[0] == "1"
    )


def test_a_window_is_scored_and_said():
    html = report(SOLUTION, TRUTH, window=(100, 500)).html
    assert float(cells(html, "down position [m]")[0]) == pytest.approx(
        metrics.rms(metrics.errors(SOLUTION, TRUTH), (100, 500)).position[2], rel=0.01
    )
    assert "100 to 500 s" in html


def test_texts_of_the_user_are_escaped(page):
    evil = "</script><script>alert(1)</script><b>"
    html = own(
        report(
            replace(
                SOLUTION,
                meta={
                    **SOLUTION.meta,
                    "recording": evil,
                    "notes": [evil],
                    "filter": evil,
                    "imu": evil,
                },
                events=((1.0, evil),),
                innovations=replace(SOLUTION.innovations, names=(evil, "velocity")),
                columns={evil: TRUTH.t},
            ),
            TRUTH,
        )
    )
    assert (
        "alert(1)" in html
        and "<script>alert" not in html
        and "<b>" not in html.replace("<b style", "")
    )
    assert "Flight &lt;1&gt; &amp; more" in page.html


def test_figures_are_json_with_unique_names(page):
    blocks = re.findall(
        r"<script type='application/json' id=(data-p\d+)>(.*?)</script>", own(page), re.DOTALL
    )
    assert len(blocks) == len({name for name, _ in blocks}) == page.html.count("class=plot ") > 15
    assert all(json.loads(text)["data"] for _, text in blocks)


def test_an_absolute_clock_and_what_was_read_are_shown():
    dated = {"epoch": "2024-05-01T12:00:00Z", "read": ["left: imu 1 of <a>.ulg"]}
    html = own(report(replace(SOLUTION, meta=SOLUTION.meta | dated)))
    assert "2024-05-01 12:00:00.0 to 12:09:59.5 UTC" in html
    assert "<li>left: imu 1 of &lt;a&gt;.ulg</li>" in html
    assert "from 2024-05-01 12:00:00 UTC on" in html and '"clock": 1714564800000' in html
    assert ">200.00 s (12:03:20.0 UTC): gap of" in html
    plain = own(report(SOLUTION))
    assert "Read from the files" not in plain and '"clock": 1' not in plain


def test_without_reference_the_estimates_are_shown():
    html = report(SOLUTION).html
    assert (
        "<h2>Estimates</h2>" in html
        and "<h2>Errors</h2>" not in html
        and "true − estimate</th>" not in html
    )


def test_a_reference_elsewhere_in_time_is_told_not_fatal():
    assert "Not scored: the reference" in report(SOLUTION, replace(TRUTH, t=TRUTH.t + 1e4)).html


def test_a_reference_of_position_only_is_enough():
    html = report(SOLUTION, replace(TRUTH, v_n=None, q_nb=None)).html
    assert (
        "Position error" in html and "Velocity error" not in html and "north velocity" not in html
    )


def test_equal_names_are_numbered_and_own_names_kept():
    assert "closed-loop 2" in report([SOLUTION, SOLUTION]).html
    assert "mine: gnss" in report({"mine": SOLUTION, "yours": OPEN}).html


def test_saving_is_whole_or_not_at_all(page, tmp_path):
    page.save(tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text(encoding="utf-8") == page.html
    with pytest.raises(DataError, match="cannot be written"):
        page.save(tmp_path / "absent" / "a.html")
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


@needs_chromium
def test_a_browser_without_network_draws_every_figure(tmp_path):
    dated = replace(SOLUTION, meta=SOLUTION.meta | {"epoch": "2024-05-01T12:00:00Z"})
    page = report([dated, OPEN], TRUTH)
    page.save(tmp_path / "a.html")
    dom = browse(tmp_path, "--dump-dom")
    count = page.html.count("class=plot ")
    assert (
        f'data-drawn="{count}"' in dom
        and len(re.findall(r'class="main-svg"[^>]*>\s*<defs', dom)) >= count
    )
    assert ">12:04:00</tspan>" in dom  # below the ticks of an absolute clock
    browse(tmp_path, f"--screenshot={tmp_path / 'a.png'}")
    assert ink((tmp_path / "a.png").read_bytes()) > 20_000


def ink(png):
    """Bytes of a PNG's filtered rows that are not zero: hardly any where nothing was drawn."""
    data, at = b"", 8
    while at < len(png):
        size, kind = int.from_bytes(png[at : at + 4], "big"), png[at + 4 : at + 8]
        data += png[at + 8 : at + 8 + size] if kind == b"IDAT" else b""
        at += 12 + size
    return len(rows := zlib.decompress(data)) - rows.count(0)


def test_the_key_says_how_many_events_are_marked():
    many = replace(SOLUTION, events=tuple((float(k), f"event {k}") for k in range(57)))
    assert (
        "the first 20 of 57 events are marked" in report(many, TRUTH).html
        and "are marked" not in report(SOLUTION, TRUTH).html
    )
    assert "57 events of a are marked" in report({"a": many, "b": SOLUTION}, TRUTH).html


def test_the_key_has_the_shades_that_there_are():
    made = solution(flight(60, rate=2.0))
    words = ("gap bridged", "doubtful", "not valid", "event, numbered")
    for events in (made.events, ()):
        for status, shade in ((VALID, ""), (BRIDGED, words[0]), (INVALID, words[2])):
            shown = replace(made, status=np.full_like(made.status, status), events=events)
            key = report(shown).html.partition("caption key")[2].partition("</p>")[0]
            assert {word for word in words if word in key} == {
                *([shade] if shade else []),
                *([words[3]] if events else []),
            }


def test_no_solution_is_refused():
    for none in ({}, [], ()):
        with pytest.raises(DataError, match="a report needs a solution; none is given"):
            report(none)


def test_no_claim_is_asked_for_where_none_is_drawn():
    silent = replace(
        SOLUTION,
        trajectory=replace(SOLUTION.trajectory, std=np.full_like(SOLUTION.trajectory.std, np.nan)),
    )
    assert (
        "It should stay below" in report(SOLUTION, TRUTH).html
        and "It should stay below" not in report(silent, TRUTH).html
    )


def test_withheld_windows_are_listed_shaded_and_scored():
    windows = [(100.0, 130.0), (5000.0, np.inf)]
    hidden = replace(SOLUTION, meta=SOLUTION.meta | {"withheld": windows})
    html = own(report(hidden, TRUTH))
    (outage,) = metrics.outages(SOLUTION, TRUTH, windows[:1])
    assert [float(text) for text in cells(html, "100 to 130")] == pytest.approx(
        [outage.horizontal_max, outage.horizontal_end, outage.down_max], rel=0.01
    )
    assert cells(html, "5000 to inf") == ["–"] * 3 and "</b>fixes withheld<" in html
    # all but two of the track and two of the statistics of fixes
    assert html.count(f'"fillcolor": "{WITHHELD}"') == html.count("class=plot") - 4
    alone = report(hidden).html
    assert cells(alone, "100 to 130") == [] and "at the end [m]" not in alone
    assert "fixes withheld" not in report(SOLUTION, TRUTH).html


def test_only_a_page_with_a_map_may_ask_the_network_and_says_so(page):
    mapped = report([SOLUTION, OPEN], TRUTH, map=True)
    (policy,) = re.findall('Content-Security-Policy" content="([^"]*)"', mapped.html)
    assert set(re.findall("https?://[^ ;]*", policy)) == {"https://tile.openstreetmap.org"}
    assert "comes from the network" in mapped.html and "maplibre-gl" in plotly(mapped)
    figure = json.loads(
        re.search("id=data-p[0-9]+>({[^\n]*scattermap.*?)</script>", own(mapped))[1]
    )
    assert figure["layout"]["map"]["style"] == "open-street-map" and len(figure["data"]) == 3
    north = np.degrees(SOLUTION.trajectory.lla[:, 0])
    assert figure["data"][-1]["lat"] == pytest.approx(north, abs=1e-6)
    assert (
        "https:" not in re.search("Policy.*?>", page.html)[0]
        and "comes from the network" not in page.html
    )
    assert "maplibre-gl-worker" not in plotly(page)


def test_eight_filters_have_a_page_that_tells_them_apart():
    made = {f"filter {i}": solution(TRUTH, seed=i) for i in range(8)}
    page = report(made, TRUTH)
    assert not page.notes and len(page.html) < 6e6
    figure = next(
        figure
        for text in re.findall(
            r"<script type='application/json' id=data-p\d+>(.*?)</script>", own(page)
        )
        if "east [m]" in text and (figure := json.loads(text))
    )
    looks = {
        (trace["line"]["color"], trace["line"].get("dash"))
        for trace in figure["data"]
        if trace["name"].startswith("filter")
    }
    assert len(looks) == 8
    widths = [
        trace["line"]["width"] for trace in figure["data"] if trace["name"].startswith("filter")
    ]
    assert widths == sorted(widths, reverse=True)  # those below show at the edges


def test_a_page_of_a_day_is_no_larger_than_one_of_minutes():
    day = flight(86400, rate=5.0)
    page = report(solution(day), day)
    assert not page.notes and len(page.html) < 2.5e6


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_a_solution_of_hardly_any_rows_has_a_page(rows):
    part = slice(0, rows)
    old = SOLUTION.trajectory
    short = replace(
        SOLUTION,
        trajectory=type(old)(
            *(values[part] for values in (old.t, old.lla, old.v_n, old.q_nb, old.std))
        ),
        b_a=SOLUTION.b_a[part],
        b_g=SOLUTION.b_g[part],
        status=SOLUTION.status[part],
    )
    page = report(short)
    assert not page.notes, page.notes
    assert ("nothing</p>" in page.html) == (rows == 0)
    assert ("id=playback " in page.html) == (rows == 2)
    assert not re.search(r"\bnan\b", re.sub("<script.*?</script>", "", page.html, flags=re.DOTALL))
