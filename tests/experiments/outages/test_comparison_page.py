"""The page of a comparison: what it says follows from the numbers, what failed is named, and
every figure has its axes and units."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from browser import browse, needs_chromium
from compared import LIST, SWEEP, TRUTH, made
from pages import own

from strapdown.evaluation.metrics import NED_AXES
from strapdown.experiments.outages import figures
from strapdown.experiments.outages.page import page
from strapdown.experiments.outages.texts import (
    answers,
    failures,
    headline,
    rank_filters,
    ratio,
    sentences,
    told_alike,
    unlike,
)
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
EIGHT = {f"filter-{i}": 10.0 * 1.5**i for i in range(8)}
CLEAR = made({"worse": 20.0, "best": 10.0, "worst": 40.0})
ALIKE = made({"a": 10.0, "b": 10.1, "c": 9.9}, spread=0.3)
LOST = made(
    {"good": 10.0, "lost": 5.0, "never": 7.0},
    failed=[("lost", 2), *(("never", i) for i in (1, 2, 3, 4))],
    silent=("good",),
)
SWEPT = made(EIGHT, SWEEP, sweep=True, spread=0.3)
LENGTHS = made(
    {"a": 10.0, "b": 20.0},
    [(200.0 + 10 * k, 200.0 + 10 * k + length) for length in (10.0, 30.0) for k in range(20)],
    sweep=True,
)
ALL = {
    "clear": CLEAR,
    "alike": ALIKE,
    "lost": LOST,
    "sweep": SWEPT,
    "lengths": LENGTHS,
    "one filter": made({"alone": 3.0}),
    "one outage": made({"a": 1.0, "b": 2.0}, LIST[:1]),
}


def drawn(html):
    """{heading: figure as JSON}."""
    headings = re.findall(r"<figure><h3>([^<]*)", html)
    found = re.findall(
        r"<script type='application/json' id=data-p\d+>(.*?)</script>", html, re.DOTALL
    )
    return dict(zip(headings, map(json.loads, found), strict=True))


def numbers(values):
    """An array of a figure's JSON, packed or plain."""
    if isinstance(values, dict):
        import base64

        return np.frombuffer(base64.b64decode(values["bdata"]), values["dtype"]).astype(float)
    return np.array([np.nan if value is None else value for value in values], float)


@pytest.fixture(scope="module")
def pages():
    return {name: own(page(comparison)) for name, comparison in ALL.items()}


@pytest.mark.parametrize("name", ALL)
def test_every_axis_is_labelled_and_nothing_says_nan(pages, name):
    found = drawn(pages[name])
    for heading, figure in found.items():
        axes = {key: axis for key, axis in figure["layout"].items() if re.match("[xy]axis", key)}
        lowest = [
            axis for key, axis in axes.items() if key.startswith("x") and not axis.get("matches")
        ] or [axes["xaxis"]]
        titles = [axis.get("title", {}).get("text", "") for axis in axes.values()]
        assert any(titles) and all(
            re.search(r"\[(m|s|%|m/s|deg)\]|^outage$|^ratio of RMSE$", title)
            for title in titles
            if title
        ), (heading, titles)
        assert any(axis.get("title") for axis in lowest), heading
        assert all(
            np.isfinite(np.array(axis["range"], float)).all()
            for axis in axes.values()
            if "range" in axis
        )
    visible = re.sub(r"<(script|style)\b.*?</\1>", "", pages[name], flags=re.DOTALL)
    assert not re.search(r"\b(nan|inf|None)\b", visible), re.search(
        r".{50}\b(nan|inf|None)\b", visible
    )
    assert {"Summary", "Every outage", "Track and growth", "How it was done", "Notes"} <= set(
        re.findall("<h2>(.*?)</h2>", pages[name])
    )


def test_nothing_is_fetched_and_names_are_unique(pages):
    for html in pages.values():
        assert "default-src 'none'" in html and not re.search(
            r"(src|href|url)\s*[=(]\s*['\"]?\s*(https?:)?//", html
        )
        ids = re.findall(r"id=(data-p\d+)>", html)
        assert len(ids) == len(set(ids)) == html.count("<div class=plot ")


def test_the_best_is_named_with_its_lead():
    (text,) = answers(CLEAR)
    r = ratio(CLEAR, "worse", "best", 30.0)
    assert text == (
        f"best drifts least in 4 outages: best's horizontal RMSE is {1 / r.value:#.3g} times as large as worse's "
        f"(95 %: {1 / r.high:#.3g} to {1 / r.low:#.3g}), the next."
    )
    assert rank_filters(CLEAR, 30.0) == ["best", "worse", "worst"] and 0.4 < 1 / r.value < 0.6


def test_the_headline_names_the_best_or_says_that_there_is_none():
    assert headline(CLEAR) == "best drifts least in 4 outages."
    order = rank_filters(ALIKE, 30.0)
    assert headline(ALIKE) == f"4 outages cannot separate {order[0]}, {order[1]} and {order[2]}."
    partly = headline(made({"a": 10.0, "b": 10.1, "c": 40.0, "d": 50.0}, spread=0.1))
    assert partly.endswith(" drift least in 4 outages and cannot be separated; c and d drift more.")
    assert headline(LENGTHS).endswith("outages of 30 s.")
    assert headline(ALL["one filter"]).startswith("Only alone was scored")
    many = made({f"f{i}": 10.0 for i in range(8)}, spread=0.3)
    assert re.match(r"f\d, f\d, f\d and [34] others drift least|.* and 5 others\.$", headline(many))


def test_a_ratio_turns_round():
    there, back = (
        ratio(CLEAR, "worse", "best", 30.0, "east"),
        ratio(CLEAR, "best", "worse", 30.0, "east"),
    )
    assert [
        there.value * back.value,
        there.low * back.high,
        there.high * back.low,
    ] == pytest.approx([1, 1, 1])
    assert (there.wins, back.wins, there.count, there.blocks) == (
        0,
        4,
        4,
        4,
    ) and there.low < there.value < there.high
    logs = [
        np.log(CLEAR.scores[CLEAR.scores["filter"] == name]["east_rmse_m"].to_numpy())
        for name in ("worse", "best")
    ]
    assert there.value == pytest.approx(np.exp(np.mean(logs[0] - logs[1])))
    assert np.isnan(ratio(CLEAR, "worse", "nobody", 30.0).value)


def test_what_the_data_do_not_tell_is_said():
    assert (
        answers(ALIKE)[0].startswith("The data do not separate the filters: ")
        and "worst" not in answers(ALIKE)[0]
    )
    partly = made({"a": 10.0, "b": 10.1, "c": 40.0, "d": 50.0}, spread=0.1)
    words = r"but the data do not separate it from ([ab]): ([ab])'s horizontal RMSE is (0\.9\d+) times as large as \1's \(95 %: [\d.]+ to [\d.]+\); c and d drift more\.$"
    other, best, value = re.search(words, answers(partly)[0]).groups()
    assert other != best and float(value) == pytest.approx(
        ratio(partly, best, other, 30.0).value, rel=1e-2
    )
    assert (
        "but it is only one, so that it may be chance" in answers(ALL["one outage"])[0]
        and "95 %" not in answers(ALL["one outage"])[0]
    )
    assert answers(ALL["one filter"]) == [
        "Only alone was scored in 4 outages: there is nothing to compare it with."
    ]
    first, second = answers(LENGTHS)
    assert (
        "20 outages of 10 s" in first
        and "20 outages of 30 s (7 blocks of those that overlap)" in second
    )
    mixed = made(
        {"a": 10.0, "b": 20.0, "c": 30.0},
        [(200, 210), (220, 310), (320, 490), (500, 510)],
        failed=[(name, 4) for name in "abc"],
    )
    # in one run nothing overlaps
    assert "blocks" not in answers(mixed)[0] and "95 %" in answers(mixed)[0]


def test_sources_that_only_some_use_are_named():
    some = made({"a": 1.0, "b": 2.0, "c": 3.0, "lost": 4.0})
    sources = {
        "a": ["gnss", "baro", "mag"],
        "b": ["gnss", "mag"],
        "c": ["gnss", "baro"],
        "lost": [],
    }
    some.settings.update(sources=sources, kept={"baro": "pressure", "mag": "magnetic-field"})
    said = [
        "In the outages a and c also used baro, which b did not, so vertical errors do not compare.",
        "In the outages a and b also used mag, which c did not, so mind this where errors are compared.",
    ]
    assert unlike(some) == said == sentences(some)[1:] and all(
        own(page(some)).count(text) == 2 for text in said
    )
    assert unlike(CLEAR) == []


def test_who_failed_is_named_with_the_reason(pages):
    assert failures(LOST) == [
        "lost was not scored in 1 of 4 outages: stopped: lost & <gone>",
        "never was not scored in any of 4 outages: stopped: lost & <gone>",
    ]
    assert sentences(LOST)[1:] == failures(LOST) and rank_filters(LOST, 30.0) == ["good"]
    assert pages["lost"].count("stopped: lost &amp; &lt;gone&gt;") == 2
    assert "<gone>" not in re.sub("<script.*?</script>", "", pages["lost"], flags=re.DOTALL)
    for heading, figure in drawn(pages["lost"]).items():
        assert "never" not in {trace.get("name") for trace in figure["data"]}, heading
        for trace in figure["data"]:
            named = isinstance(trace["y"], list) and isinstance(trace["y"][0], str)
            assert len(trace["x"]) and (named or np.isfinite(numbers(trace["y"])).any()), heading
    second = drawn(pages["lost"])["Outage 2, 400 to 430 s"]
    assert second["layout"]["meta"]["notes"] == ["Not scored here: lost, never."]
    assert "Without a ratio, because no outage was scored for both: never." in pages["lost"]
    assert "No standard deviation is claimed, or nothing was scored: good, never." in pages["lost"]


def cells(html, row):
    """[(text, whether it is marked)] of a row of the table of outages."""
    found = re.search(rf"<tr><td( colspan=2)?>{row}</td>(.*?)</tr>", html)[2]
    return [
        (text, "best" in kind)
        for kind, text in re.findall(r"<td(?: class='?([^'>]*)'?)?>([^<]*)</td>", found)
        if not re.fullmatch(".+–.+", text)  # the time
    ]


def test_the_table_marks_the_smallest(pages):
    values = LOST.table().to_numpy()
    for i, row in enumerate(values, 1):
        shown = cells(pages["lost"], i)
        assert [text == "–" for text, _ in shown] == list(np.isnan(row))
        assert [float(text) for text, _ in shown if text != "–"] == pytest.approx(
            row[np.isfinite(row)], rel=0.01
        )
        for axis in range(3):
            part = row[3 * axis : 3 * axis + 3]
            best = LOST.filters[int(np.nanargmin(part))]
            others = [
                name for name, value in zip(LOST.filters, part) if name != best and value == value
            ]
            sure = bool(others) and not told_alike(LOST, best, others, 30.0, NED_AXES[axis])
            assert [mark for _, mark in shown[3 * axis : 3 * axis + 3]] == [
                sure and name == best for name in LOST.filters
            ]
    mean = cells(pages["lost"], "mean")
    assert [text for text, _ in mean][1::3] == ["–"] * 3 and float(mean[0][0]) == pytest.approx(
        values[:, 0].mean(), rel=0.01
    )
    # of lengths mixed they would say nothing
    assert "<td colspan=2>mean</td>" not in pages["lengths"]
    even = replace(CLEAR, scores=CLEAR.scores.assign(north_rmse_m=1.0))
    assert [mark for _, mark in cells(own(page(even)), 1)[:3]] == [False] * 3
    assert not any(mark for row in (1, 2, "mean") for _, mark in cells(pages["alike"], row))
    assert sum(mark for _, mark in cells(pages["clear"], "mean")) == 3


def summary_marks(html):
    """{(filter, length or ""): [whether each number of its row is marked]}."""
    body = re.search(r"<h2>Summary</h2>.*?<tbody>(.*?)</tbody>", html, re.DOTALL)[1]
    rows = [
        re.findall(r"<td([^>]*)>([^<]*)</td>", row)
        for row in re.findall("<tr(?: class=rule)?>(.*?)</tr>", body)
    ]
    first = next(i for i, (_, text) in enumerate(rows[0]) if " of " in text) + 1
    return {
        tuple(text for _, text in row[: first - 1]): ["best" in kind for kind, _ in row[first:]]
        for row in rows
    }


def test_the_summary_marks_what_can_be_compared(pages):
    marks = summary_marks(pages["clear"])
    assert (
        list(marks) == [("best",), ("worse",), ("worst",)]
        and [i for i, mark in enumerate(marks["best",]) if mark] == [0, 1, 2, 3]  # the RMSE tested
        and not any(marks["worse",])
        and not any(marks["worst",])
    )
    lost = summary_marks(pages["lost"])
    assert list(lost) == [("good",), ("lost",), ("never",)]
    # "lost" is smaller, over fewer outages
    assert not any(lost["good",]) and not any(lost["lost",])
    assert not any(map(any, summary_marks(pages["alike"]).values()))
    lengths = summary_marks(pages["lengths"])
    assert (
        list(lengths) == [("a", "10"), ("b", "10"), ("a", "30"), ("b", "30")]
        and all(lengths["a", "10"][:4])
        and all(lengths["a", "30"][:4])
    )


def test_the_figure_of_ratios_has_their_intervals():
    figure = figures.paired_ratios(ALIKE, "a", 30.0)
    assert len(figure.data) == 2 * 4
    for trace, (axis, name) in zip(
        figure.data,
        [(axis, name) for axis in ("horizontal", "north", "east", "down") for name in "bc"],
        strict=True,
    ):
        r = ratio(ALIKE, name, "a", 30.0, axis)
        assert (trace.x[0], trace.y[0]) == (r.value, name)
        assert [
            trace.x[0] - trace.error_x.arrayminus[0],
            trace.x[0] + trace.error_x.array[0],
        ] == pytest.approx([r.low, r.high])
        assert (trace.marker.color == "rgba(0,0,0,0)") == (r.low <= 1 <= r.high)
    low, high = 10 ** np.array(figure.layout.xaxis.range)
    assert all(
        low < trace.x[0] - trace.error_x.arrayminus[0]
        and trace.x[0] + trace.error_x.array[0] < high
        for trace in figure.data
    )
    assert figure.layout.xaxis.type == "log" and all(
        trace.marker.color != "rgba(0,0,0,0)"
        for trace in figures.paired_ratios(CLEAR, "best", 30.0).data
    )
    assert figures.paired_ratios(ALL["one filter"], "alone", 30.0) is None


def test_curves_and_points_are_the_tables():
    figure, rows = figures.growth(SWEPT, 30.0), SWEPT.growth[SWEPT.growth["filter"] == "filter-3"]
    medians = [trace for trace in figure.data if trace.name == "filter-3"]
    for trace, part in zip(medians, ("horizontal", "vertical"), strict=True):
        assert np.allclose(trace.x, rows["since_s"]) and np.allclose(
            trace.y, rows[f"{part}_median_m"], rtol=1e-5
        )
    bands = [
        trace for trace in figure.data if trace.fill == "toself" and trace.legendgroup == "filter-3"
    ]
    assert np.allclose(bands[0].y[:61], rows["horizontal_p90_m"], rtol=1e-5)
    assert np.allclose(bands[0].y[61:], rows["horizontal_p10_m"][::-1], rtol=1e-5)
    assert figures.growth(LENGTHS, 10.0).data[-1].x[-1] == 10.0
    for comparison, x in ((SWEPT, "start_s"), (CLEAR, "outage")):
        points = figures.outages(comparison, 30.0)
        for name in comparison.filters:
            rows = comparison.scores[comparison.scores["filter"] == name]
            trace = next(trace for trace in points.data if trace.name == name)
            assert np.allclose(trace.x, rows[x], atol=0.5 if x == "outage" else 0) and np.allclose(
                trace.y, rows["horizontal_rmse_m"]
            )
        assert [points.layout[f"yaxis{k}"].title.text for k in ("", 2, 3)] == [
            "horizontal RMSE [m]",
            "vertical RMSE [m]",
            "velocity RMSE [m/s]",
        ]
        assert "yaxis4" not in points.layout  # heading is nowhere known


def test_times_of_a_clock_are_readable():
    late = 1.6e9
    windows = [(start + late, stop + late) for start, stop in SWEEP]
    clock = replace(
        made({"a": 1.0, "b": 2.0}, windows, sweep=True),
        reference=replace(TRUTH, t=TRUTH.t + late),
        span=(late + 30, late + 900),
    )
    figure = figures.outages(clock, 30.0)
    assert (
        figure.layout.xaxis3.title.text == "start of the outage, since 1600000200 s [s]"
        and list(figure.data[0].x[:2]) == [0.0, 5.0]
    )
    html = own(page(clock))
    assert "<td>1600000200–1600000230</td>" in html and "1.6e+09" not in html


def test_coverage_beside_that_of_a_normal_error():
    figure = figures.coverage(LOST)
    one = next(trace for trace in figure.data if trace.name == "within 1σ")
    assert list(one.y) == ["lost"] and one.x[0] == pytest.approx(
        100 * LOST.scores[LOST.scores["filter"] == "lost"]["coverage_1"].mean()
    )
    assert [shape.x0 for shape in figure.layout.shapes] == pytest.approx([68.27, 95.45, 99.73] * 2)
    assert figures.coverage(made({"a": 1.0}, silent=("a",))) is None


def test_the_track_has_the_outages_and_what_filters_took_for_it():
    figure = figures.track(CLEAR)
    assert [text.text for text in figure.layout.annotations] == ["1", "2", "3", "4"]
    begun = TRUTH.lla[np.searchsorted(TRUTH.t, 30.0)]
    true = displacement(TRUTH.lla, np.broadcast_to(begun, TRUTH.lla.shape))
    begins = next(trace for trace in figure.data if trace.name == "an outage begins")
    rows = np.searchsorted(TRUTH.t, [start for start, _ in LIST])
    assert (
        np.allclose(np.c_[begins.y, begins.x], true[rows, :2], atol=0.01)
        and begins.text[1] == "outage 2, 400 to 430 s"
    )
    taken = next(trace for trace in figure.data if trace.name == "worst")
    end = CLEAR.tracks["worst"][0].error[-1]
    at = np.searchsorted(TRUTH.t, 230.0)
    assert np.allclose([taken.y[60], taken.x[60]], true[at, :2] - end[:2], atol=0.05)
    hidden = next(trace for trace in figure.data if trace.name == "fixes withheld")
    assert np.isnan(hidden.x).any() and np.isfinite(hidden.x).sum() == pytest.approx(4 * 151, abs=2)


def test_the_track_of_a_sweep_says_where_it_is_hard():
    figure = figures.track(SWEPT)
    marks = next(trace for trace in figure.data if trace.name == "an outage begins")
    best = SWEPT.scores[SWEPT.scores["filter"] == rank_filters(SWEPT, 30.0)[0]]
    assert np.allclose(10**marks.marker.color, best["horizontal_rmse_m"])
    assert "[m]" in marks.marker.colorbar.title.text and not figure.layout.annotations


def test_filters_can_be_told_apart():
    look = figures.styles([f"f{i}" for i in range(24)])
    assert (
        len(set(look.values())) == 24
        and len({style.colour for style in list(look.values())[:10]}) == 10
    )
    assert (
        figures.styles(SWEPT.filters)["filter-2"] == figures.styles(SWEPT.filters[:3])["filter-2"]
    )


def test_one_that_diverges_does_not_flatten_the_others(pages):
    far = made({"a": 10.0, "b": 12.0, "c": 11.0, "gone": 1e7})
    growth = figures.growth(far, 30.0)
    assert (
        growth.layout.yaxis.range[1] - growth.layout.yaxis.range[0] < 4.5
        and "more than the frame holds" in growth.layout.meta["notes"][0]
    )
    first = (far.scores["filter"] == "a") & (far.scores["outage"] == 1)
    near = far.scores.assign(
        horizontal_rmse_m=np.where(first, 1e-5, far.scores["horizontal_rmse_m"])
    )
    low, high = figures.outages(replace(far, scores=near), 30.0).layout.yaxis.range
    assert low < np.log10(4) < np.log10(9) < high < 4
    course = figures.course(far, 0)
    assert course.layout.yaxis.range[1] < 100 and course.layout.meta["notes"][0].startswith(
        "Beyond the frame north: gone up to "
    )
    assert not figures.course(CLEAR, 0).layout.meta["notes"]


def test_how_it_was_done_is_there(pages):
    for text in (
        "120 of gnss",
        "at 30.00 s",
        "made up",
        "made-up imu",
        "interval=60, model=true",
        "A Book (1999)",
        "gyro 0.344 deg/sqrt(h)",
        "heading 302.7 deg",
        "one note",
        "were offered the same fixes",
    ):
        assert text in pages["clear"], text
    assert "of other" not in pages["clear"]


def test_texts_are_escaped():
    evil = "</script><script>alert(1)</script><b>"
    html = own(page(made({evil: 1.0, "b": 2.0}, name=evil, notes=(evil,))))
    assert "alert(1)" in html and "<script>alert" not in html and "<b>" not in html


@needs_chromium
def test_a_browser_without_network_draws_every_figure(tmp_path):
    finished = page(LOST)
    finished.save(tmp_path / "a.html")
    count = finished.html.count("<div class=plot ")
    assert count > 8 and f'data-drawn="{count}"' in browse(tmp_path, "--dump-dom")
