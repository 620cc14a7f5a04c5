"""Pages of solutions without position: what is not known leaves no figure, no panel and no row
behind, beside others or alone."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from pages import own
from synthetic import attitude_only, flight, solution

from strapdown import report
from strapdown.data.solution import Innovations
from strapdown.evaluation import metrics
from strapdown.pages import drawing, figures, fix_figures, summary

pytestmark = pytest.mark.short
TRUTH = flight(600, rate=2.0)
FULL = solution(TRUTH)
ATTITUDE, VRU = attitude_only(FULL), attitude_only(solution(TRUTH, seed=3), heave=True, name="vru")
UNPLACED = replace(TRUTH, lla=np.full_like(TRUTH.lla, np.nan), v_n=None)


def headings(page):
    return re.findall(r"<figure><h3>([^<]*)", own(page))


def drawn(page):
    """The figures of a page as JSON."""
    return [
        json.loads(text)
        for text in re.findall(
            r"<script type='application/json' id=data-p\d+>(.*?)</script>", own(page), re.DOTALL
        )
    ]


def titles(figure):
    layout = figure.to_dict()["layout"] if hasattr(figure, "to_dict") else figure["layout"]
    return [axis["title"]["text"] for name, axis in layout.items() if name.startswith("yaxis")]


def numbers(values):
    """An array of a figure's JSON, packed or plain."""
    if isinstance(values, dict):
        import base64

        return np.frombuffer(base64.b64decode(values["bdata"]), values["dtype"]).astype(float)
    return np.array([np.nan if value is None else value for value in values], float)


PAGES = {
    "attitude": lambda: report(ATTITUDE, UNPLACED),
    "attitude against a whole reference": lambda: report(ATTITUDE, TRUTH),
    "no reference": lambda: report(ATTITUDE),
    "heave": lambda: report(VRU, TRUTH),
    "heave, no reference": lambda: report(VRU),
    "side by side": lambda: report([ATTITUDE, FULL, VRU], TRUTH),
    "side by side, no reference": lambda: report([ATTITUDE, FULL, VRU]),
    "position beside a reference of attitude": lambda: report([FULL, ATTITUDE], UNPLACED),
}


@pytest.mark.parametrize("name", PAGES)
def test_no_figure_is_empty_and_nothing_says_nan(name):
    page = PAGES[name]()
    for figure in drawn(page):
        panels = {
            trace.get("yaxis", "y")
            for trace in figure["data"]
            if np.isfinite(numbers(trace["y"])).any()
        }
        assert panels == {
            axis.replace("yaxis", "y") for axis in figure["layout"] if axis.startswith("yaxis")
        }, titles(figure)
        assert all(np.isfinite(numbers(trace["y"])).any() for trace in figure["data"])
        assert all(
            np.isfinite(np.array(axis["range"], float)).all()
            for key, axis in figure["layout"].items()
            if key[1:5] == "axis" and "range" in axis
        )
    visible = re.sub(
        r"<(script|style)\b.*?</\1>|<details>.*?</details>", "", own(page), flags=re.DOTALL
    )
    assert not re.search(r"\bnan\b", visible, re.IGNORECASE)
    assert visible.count("class='caption key'") == 1


def test_a_page_of_attitude_shows_attitude_bias_and_fixes():
    page = PAGES["attitude"]()
    assert headings(page) == [
        "Attitude error",
        "Angle of the attitude error",
        "Attitude",
        "3σ of attitude",
        "Gyro bias",
        "Innovations",
        "Normalised innovation squared",
        "Autocorrelation of innovations",
        "NIS over chi-square",
    ]
    html = page.html
    assert (
        "position [m]" not in own(page)
        and "Position, velocity" not in own(page)
        and "inclination angle [deg]" in html
        and "horizontal std" not in html
    )
    row = re.findall(
        r">([^<]*)</td>", re.search(r"<tr><td>total angle \[deg\]</td>(.*?)</tr>", html)[1]
    )
    angle = np.degrees(metrics.attitude_angles(metrics.errors(ATTITUDE, TRUTH)).total)
    assert [float(text) for text in row] == pytest.approx(
        [np.sqrt(np.mean(angle**2)), angle.max(), angle[-1]], rel=0.01
    )


def test_a_page_of_heave_shows_it_and_what_moves_vertically():
    page = PAGES["heave"]()
    assert headings(page)[:6] == [
        "Position error",
        "Velocity error",
        "Attitude error",
        "Angle of the attitude error",
        "Heave",
        "Velocity",
    ]
    by_heading = dict(zip(headings(page), drawn(page)))
    shown = {
        heading: titles(by_heading[heading]) for heading in ("Position error", "Velocity", "Heave")
    }
    assert shown == {
        "Position error": ["down [m]"],
        "Velocity": ["down [m/s]"],
        "Heave": ["heave about its mean [m]"],
    }
    heave = figures.heave(VRU, compare=TRUTH)
    line = next(trace for trace in heave.data if trace.name == "estimate")
    assert np.allclose(
        line.y, VRU.trajectory.lla[:, 2] - VRU.trajectory.lla[:, 2].mean(), atol=1e-3
    ) and "reference" in [trace.name for trace in heave.data]
    assert (
        "down position [m]" in page.html
        and "north position [m]" not in page.html
        and figures.heave(FULL) is None
    )
    assert "3σ of height, velocity, attitude" in headings(page)


def test_a_heave_without_a_place_lies_on_the_reference():
    low = replace(VRU, trajectory=replace(VRU.trajectory, lla=VRU.trajectory.lla - [0, 0, 5000.0]))
    shown, beside = (
        next(trace.y for trace in figures.heave(low, compare=TRUTH).data if trace.name == name)
        for name in ("estimate", "reference")
    )
    assert (
        abs(np.mean(shown)) < 0.01 and abs(np.mean(beside)) < 0.01 and np.std(shown - beside) < 10
    )


def test_a_heading_that_runs_free_is_not_scored():
    page = own(PAGES["heave"]())
    assert "inclination angle [deg]" in page and not re.search(
        r"<td>(heading|heading angle|total angle) \[deg\]</td>", page
    )
    row = re.findall(
        r">([^<]*)</td>",
        re.search(r"<tr><td>total angle \[deg\]</td>(.*?)</tr>", own(PAGES["side by side"]()))[1],
    )
    assert [text == "–" for text in row] == [False] * 6 + [True] * 3


def test_no_band_is_promised_where_none_is_claimed():
    unsure = replace(
        ATTITUDE,
        trajectory=replace(ATTITUDE.trajectory, std=np.full_like(ATTITUDE.trajectory.std, np.nan)),
    )
    captions = lambda page: " ".join(re.findall("<figcaption>(.*?)</figcaption>", own(page)))
    for against in (None, TRUTH):
        assert "σ" in captions(report(ATTITUDE, against)) and "σ" not in captions(
            report(unsure, against)
        )
    assert "clockwise from north" in captions(report(unsure)) and "true north" not in own(
        report(unsure)
    )


def test_errors_beyond_the_claim_are_told():
    e = metrics.errors(ATTITUDE, TRUTH)
    assert summary.contradictions({"a": e}) == {}
    sure = replace(e, std=e.std / 100)
    share = (np.abs(e.attitude) > 0.03 * e.std[:, 6:9]).any(axis=1)
    (said,) = summary.contradictions({"a": sure})["a"]
    assert said.startswith(
        f"attitude error beyond 3σ of what the filter claims at {100 * share.mean():.0f} % of the"
    )
    inside = (e.t >= 100) & (e.t <= 110)
    assert f"at {100 * share[inside].mean():.0f} %" in str(
        summary.contradictions({"a": sure}, (100, 110))
    )
    for unknown in (None, np.full_like(e.std, np.nan)):
        assert summary.contradictions({"a": replace(e, std=unknown)}) == {}


@pytest.mark.parametrize(
    "steady, suspect", [(True, "of the reference first"), (False, "solution first")]
)
def test_what_of_the_two_to_suspect_is_told(steady, suspect):
    """Errors of 9 deg of roll against a claim of 1 deg: all along, or as a sine."""
    e = metrics.errors(ATTITUDE, TRUTH)
    error = np.radians(9.0) * (np.ones(len(e.t)) if steady else np.sin(e.t))
    off = replace(
        e,
        attitude=np.c_[error, 0 * error, 0 * error],
        std=np.full_like(e.std, np.radians(1.0)),
    )
    (said,) = summary.contradictions({"a": off})["a"]
    assert suspect in said and ("median 9.00" in said) == steady


def test_a_field_that_counts_little_is_explained():
    fixes_of = lambda nis: summary.fix_table(
        {"a": replace(ATTITUDE, innovations=replace(ATTITUDE.innovations, nis=nis))}
    )
    nis = ATTITUDE.innovations.nis
    assert "taken as lasting" not in fixes_of(nis) and "taken as lasting" in fixes_of(nis / 100)


def test_side_by_side_each_keeps_its_colour_and_only_what_is_known():
    page = PAGES["side by side"]()
    assert (
        headings(page).count("Position error") == 1
        and headings(page).count("Attitude error") == 1
        and headings(page).count("Heave") == 1
    )
    track = figures.track({"a": ATTITUDE, "b": FULL}, TRUTH)
    assert [trace.name for trace in track.data if trace.mode == "lines"] == ["reference", "b"]
    colour = lambda figure: next(trace.line.color for trace in figure.data if trace.name == "b")
    assert (
        colour(track)
        == colour(figures.height({"a": ATTITUDE, "b": FULL}))
        == colour(figures.horizontal({"a": ATTITUDE, "b": FULL}, TRUTH))
        == colour(figures.track({"a": FULL, "b": FULL}))
        == drawing.COLOURS[1]
    )
    row = re.findall(
        r">([^<]*)</td>", re.search(r"<tr><td>north position \[m\]</td>(.*?)</tr>", page.html)[1]
    )
    assert [text == "–" for text in row] == [True] * 3 + [False] * 3 + [True] * 3


def test_pages_of_positions_alone_stay_without_angles():
    page = report(FULL, TRUTH)
    assert (
        "total angle" not in own(page)
        and "Angle of the attitude error" not in headings(page)
        and "Heave" not in headings(page)
    )


def test_figures_of_what_is_not_there_are_none():
    e = metrics.errors(ATTITUDE, TRUTH)
    for figure in (
        figures.track({"a": ATTITUDE}, TRUTH),
        figures.height({"a": VRU}),
        figures.horizontal({"a": VRU}, TRUTH),
        figures.position(ATTITUDE),
        figures.velocity(ATTITUDE),
        figures.accel_bias(ATTITUDE),
        figures.heave(ATTITUDE),
        figures.attitude_angles(FULL, replace(e, attitude=np.full_like(e.attitude, np.nan))),
    ):
        assert figure is None


def test_angles_of_the_error_start_at_zero_and_are_framed():
    figure = figures.attitude_angles(ATTITUDE, TRUTH)
    assert titles(figure) == ["total [deg]", "inclination [deg]", "heading [deg]"]
    found = np.degrees(metrics.attitude_angles(metrics.errors(ATTITUDE, TRUTH)))
    for i, trace in enumerate(figure.data):
        assert np.allclose(trace.y, found[i], rtol=1e-4, atol=1e-4)
    assert (
        figure.layout.yaxis.range[0] == 0
        and figure.layout.yaxis.range[1] < found[0].max()
        and "total up to" in figure.layout.meta["notes"][0]
    )


def test_a_reference_that_knows_nothing_in_common_is_told():
    blank = replace(TRUTH, q_nb=None)
    html = own(report(ATTITUDE, blank))
    assert (
        "Not scored: the reference knows nothing of what was estimated" in html
        and "<h2>Errors</h2>" not in html
        and "true − estimate</th>" not in html
    )


def test_a_first_row_without_position_does_not_lose_the_track():
    lla = FULL.trajectory.lla.copy()
    lla[:5] = np.nan
    late = replace(FULL, trajectory=replace(FULL.trajectory, lla=lla))
    path = next(trace for trace in figures.track({"a": late}).data if trace.name == "estimate")
    assert np.isfinite(path.x).sum() == len(TRUTH) - 5


def innovating(kind, values):
    """A solution with one source, "own name", of a kind."""
    m = len(values)
    rows = np.c_[values, np.full((m, 3 - values.shape[1]), np.nan)]
    made = Innovations(
        np.arange(1.0, m + 1),
        np.zeros(m, int),
        rows,
        np.ones(m),
        np.ones(m, bool),
        ("own name",),
        (10.8,),
    )
    return replace(ATTITUDE, innovations=made, meta=ATTITUDE.meta | {"kinds": {"own name": kind}})


@pytest.mark.parametrize(
    "kind, columns, unit, factor, rows",
    [
        ("magnetic-field", 3, "uT", 1e6, ["x", "y", "z"]),
        ("magnetic-field", 1, "deg", np.degrees(1), ["single component"]),
        ("gravity", 3, "m/s^2", 1.0, ["north", "east", "down"]),
        ("pressure", 1, "m", 1.0, ["single component"]),
        ("pressure-altitude", 1, "m", 1.0, ["single component"]),
        ("zero-sea-level", 1, "m", 1.0, ["single component"]),
    ],
)
def test_innovations_have_the_unit_of_their_kind(kind, columns, unit, factor, rows):
    values = np.random.default_rng(2).normal(0, 1e-6, (20, columns))
    figure = fix_figures.innovations(innovating(kind, values))
    assert (
        titles(figure) == [f"own name [{unit}]"] and [trace.name for trace in figure.data] == rows
    )
    assert np.allclose(figure.data[0].y, values[:, 0] * factor, rtol=1e-4)


def test_every_kind_of_aiding_has_a_unit():
    from strapdown import aiding

    for kind, sensor in aiding.measurements().items():
        unit, factor, rows = fix_figures.unit(innovating(kind, np.ones((4, 3))), "own name")
        assert "or" not in unit and factor > 0 and len(rows) == 3, sensor


@pytest.fixture(scope="module")
def turning():
    """20 s of a level body that turns at 10 deg/s, with its magnetic field, and a reference of
    attitude alone."""
    from scipy.spatial.transform import Rotation

    from strapdown.data.recording import Recording
    from strapdown.data.solution import Source, Trajectory

    rng, t, rate, field = (
        np.random.default_rng(8),
        np.arange(0, 1001) / 50,
        np.radians(10),
        np.array([20e-6, 1e-6, 40e-6]),
    )
    attitude = Rotation.from_euler("Z", rate * t[:, None])
    gyro = rng.normal(0, 1e-3, (1000, 3)) + [0, 0, rate]
    accel = rng.normal(0, 0.02, (1000, 3)) - [0, 0, 9.81]
    y = attitude.inv().apply(field) + rng.normal(0, 2e-7, (1001, 3))
    magnetometer = Source(
        "magnetic-field", t, y, np.full((1001, 3), 2e-7), tuple(field), name="magnetometer"
    )
    reference = Trajectory(t, np.full((1001, 3), np.nan), None, attitude.as_quat()[:, [3, 0, 1, 2]])
    return Recording.from_arrays(
        t[1:], gyro, accel, [magnetometer], reference, grade="consumer", place=[0.9, 0.2, 70.0]
    )


@pytest.mark.parametrize("filter", ["attitude-mekf", "mahony"])
def test_what_the_filters_publish_is_shown(turning, filter, capsys):
    import strapdown as sd
    from strapdown.cli import console

    made = sd.fuse(turning, filter)
    page = report(made, turning.reference)
    nis = ["Normalised innovation squared", "Autocorrelation of innovations", "NIS over chi-square"]
    sensors = ["Specific force and angular rate", "Vibration", "Intervals"]
    assert [heading for heading in headings(page) if heading != "Columns of the filter"] == [
        "Attitude error",
        "Angle of the attitude error",
        "Attitude",
        "3σ of attitude",
        "Gyro bias",
        "Innovations",
        *(nis if filter == "attitude-mekf" else nis[1:2]),
        *sensors,
    ]
    assert titles(dict(zip(headings(page), drawn(page)))["Innovations"]) == ["magnetometer [deg]"]
    assert not re.search(r"\bnan\b", re.sub(r"<script.*?</script>", "", own(page)))
    e = metrics.errors(made, turning.reference)
    assert np.isnan(e.position).all() and np.degrees(metrics.rms(e, (10, 20)).angles).max() < 2
    console.summarise(made)
    assert capsys.readouterr().out.endswith("deg/h\n")
