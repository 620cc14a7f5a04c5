"""Every filter on every recording: figures against errors worked out by hand, what is said where
there are none, windows, pages; the recorded data."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from recordings import flight, position

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.core.mathematics.earth import RATE
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown_reproductions.common.targets import claim
from strapdown_reproductions.recordings import (
    cases,
    drift,
    main,
    table as recordings_table,
)
from strapdown_reproductions.recordings.cases import RecordingCase
from strapdown_reproductions.recordings.table import COUNTS, FIGURES

WINDOW = (8.0, 18.0)


def case(recording=None, windows=(WINDOW,), **more):
    return RecordingCase("sim", "flight", recording or flight(), windows, **more)


def row(**more):
    """One row of `scores` as `cell` gets it."""
    return {
        "group": "g",
        "recording": "r",
        "held": False,
        "filter": "f",
        **dict.fromkeys(FIGURES, np.nan),
        **dict.fromkeys(COUNTS, 0),
        "said": "",
        **more,
    }


@pytest.mark.short
def test_figures_are_those_worked_out_by_hand():
    """Truth and estimate at the same times: latitude and longitude by the Earth's radii at 47
    deg, angles by differences."""
    made = recordings_table.scores([case()], ["closed-loop"]).iloc[0]
    solution, truth = sd.fuse(flight(), "closed-loop"), flight().reference
    path = solution.trajectory
    rows = np.flatnonzero((path.t >= WINDOW[0] - 1e-9) & (path.t <= WINDOW[1] + 1e-9))
    true = np.searchsorted(truth.t, path.t[rows] - 1e-6)
    np.testing.assert_allclose(truth.t[true], path.t[rows], atol=1e-6)
    dlat, dlon, dh = (truth.lla[true] - path.lla[rows]).T
    lat, e2, a = truth.lla[true, 0], 6.69437999014e-3, 6378137.0
    W = np.sqrt(1 - e2 * np.sin(lat) ** 2)
    north, east = dlat * (a * (1 - e2) / W**3 + 500), dlon * (a / W + 500) * np.cos(lat)
    size = lambda *parts: np.sqrt(np.mean(np.sum(np.square(parts), axis=0)))
    assert made["horizontal, m"] == pytest.approx(size(north, east), rel=1e-3)
    assert made["vertical, m"] == pytest.approx(size(dh), rel=1e-3)
    assert made["velocity, m/s"] == pytest.approx(
        size(*(truth.v_n[true] - path.v_n[rows]).T), rel=1e-6
    )
    off = (truth.rph[true] - path.rph[rows] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(
        made[list(FIGURES[3:6])].astype(float),
        np.degrees(np.sqrt(np.mean(off**2, axis=0))),
        rtol=1e-6,
    )
    good, bad = np.sum([pair for pair in solution.counts().values()], axis=0)
    assert made[list(COUNTS[:4])].tolist() == [good, bad, 0, 0] and made["said"] == ""


@pytest.mark.short
def test_only_the_windows_count_and_in_a_hand_only_rows_of_the_reference():
    made = case(windows=((2.0, 3.0), (5.0, 5.0)))
    t = np.array([1.9, 2.0, 2.5, 3.0, 4.0, 5.0])
    assert made.inside(t).tolist() == [False, True, True, True, False, True]
    known = replace(flight().reference, t=flight().reference.t + 0.01)
    assert (
        not case(replace(flight(), reference=known), held=True).inside(flight().reference.t).any()
    )


def test_every_filter_of_the_list_is_in_the_table():
    """Also those that no one has thought of here: all of `filters.names()`, and a word where
    there are no figures."""
    table = recordings_table.scores([case()])
    assert table["filter"].tolist() == filters.names()
    nothing = table[list(FIGURES)].isna().all(axis=1)
    assert (table.loc[nothing, "said"] != "").all() and (table.loc[~nothing, "said"] == "").all()
    wide = recordings_table.wide(table)
    assert wide["filter"].tolist() == filters.names() and wide["sim"].str.len().min() > 0


@pytest.mark.short
def test_what_cannot_run_says_why():
    table = recordings_table.scores([case(replace(flight(), sources=()))], ["closed-loop"])
    assert table["said"].tolist() == ["no position fix to start from"]
    assert recordings_table.wide(table)["sim"].tolist() == ["no position fix to start from"]


@pytest.mark.short
def test_what_stops_is_said_with_its_time_and_has_no_figures():
    """A position beyond the latitude at which results end, 12 s after the start, that no gate
    keeps out."""
    pole = position(12.0, (np.radians(89.5), 0.1, 500.0), 1e-3)
    polar = replace(flight(), sources=(*flight().sources, pole))
    found = recordings_table.scores([case(polar)], ["closed-loop"]).iloc[0]
    assert (
        re.fullmatch(r"stopped at \d+\.\d\d s", found["said"])
        and found[list(FIGURES)].isna().all()
        and found["fixes accepted"] > 0
    )
    apart = drift.together(polar, "closed-loop", [(4.0, 6.0), (17.0, 19.0)])
    assert (
        apart[0][2] > 0
        and apart[0][5] == ""
        and np.isnan(apart[1][2])
        and apart[1][5].startswith("stopped at ")
    )
    summary = drift.summary(
        pd.DataFrame([("polar", "closed-loop", *each) for each in apart], columns=drift.EACH)
    ).iloc[0]
    assert summary["polar largest, m"] == np.inf and summary["said"].startswith(
        "polar: 1 of 2: stopped at "
    )


@pytest.mark.short
def test_lost_is_what_is_100_standard_deviations_of_the_fixes_away():
    recording, deviation = (
        flight(),
        float(next(a for a in flight().sources if a.kind == "position").std[0, 0]),
    )
    for part, said in ((0.9, ""), (1.1, f"lost: beyond {100 * deviation:g} m")):
        moved = replace(
            recording.reference,
            lla=recording.reference.lla + [part * 100 * deviation / 6371e3, 0, 0],
        )
        assert recordings_table.scores(
            [case(replace(recording, reference=moved))], ["closed-loop"]
        )["said"].tolist() == [said]


@pytest.mark.short
def test_a_heading_that_runs_free_is_not_scored():
    free, known = (
        recordings_table.scores([case()], [name]).iloc[0] for name in ("vru", "attitude-mekf")
    )
    assert (
        np.isnan(free["heading, deg"])
        and np.isnan(free["heading about the vertical, deg"])
        and np.isfinite(known["heading, deg"])
    )
    assert (
        np.isfinite(free["roll, deg"])
        and np.isnan(free["horizontal, m"])
        and np.isfinite(free["vertical, m"])
    )


@pytest.mark.short
def test_nothing_to_score_by():
    bare = replace(flight(), reference=replace(flight().reference, q_nb=None))
    assert recordings_table.scores([case(bare)], ["attitude-mekf"])["said"].tolist() == [
        "runs; the recording has nothing to score it by"
    ]


@pytest.mark.short
def test_a_cell_has_a_line_per_quantity():
    figures = dict(zip(FIGURES, (0.451, 1.02, np.nan, 0.7, 0.04, 156.4, 3.0, 4.0)))
    text = recordings_table.cell(
        pd.DataFrame([row(**figures, **dict(zip(COUNTS, (5, 1, 0, 0, 0))))])
    ).replace("\xa0", " ")
    assert text.split("\n") == ["0.45 / 1.02 m", "0.70 / 0.04 / 156 deg", "fixes 5 + 1"]


@pytest.mark.short
def test_of_several_runs_the_median_counts_and_a_stop_as_infinite():
    runs = [
        row(
            held=True,
            **{"horizontal, m": h, "inclination, deg": h, "said": said, "others accepted": 2},
        )
        for h, said in (
            (1.0, ""),
            (np.nan, "stopped at 3.00 s"),
            (np.nan, "stopped at 4.50 s"),
            (7.0, "lost: beyond 5 m"),
            (2.0, ""),
        )
    ]
    text = recordings_table.cell(pd.DataFrame(runs)).replace("\xa0", " ")
    assert text.split("\n") == [
        "7.00 / – m",
        "7.00 / – deg",
        "others 10",
        "2 of 5: stopped at 3.00, 4.50 s",
        "1 of 5: lost: beyond 5 m",
    ]


@pytest.mark.short
@pytest.mark.parametrize(
    "text, short",
    [
        (
            "filter 'f': needs attitude aiding, and the recording has none; give ahrs=",
            "needs attitude aiding, and the recording has none",
        ),
        ("f stopped at 2.00 s: it diverged", "stopped at 2.00 s"),
        ("x" * 200, "x" * 159 + "…"),
    ],
)
def test_messages_are_shortened_to_their_first_clause(text, short):
    assert recordings_table.shorten(text, "f") == short


@pytest.mark.short
def test_outages_are_those_of_the_same_fixes_withheld_by_hand():
    windows = [(8.0, 11.0), (14.0, 17.0)]
    heading = Source("heading", np.arange(1.0, 20.0), np.zeros((19, 1)), np.full((19, 1), 100.0))
    recording = replace(flight(), sources=(*flight().sources, heading))
    made = drift.together(recording, "closed-loop", windows)
    thinned = replace(
        recording,
        sources=tuple(a if a.kind == "heading" else a.without(windows) for a in recording.sources),
    )
    e = sd.errors(sd.fuse(thinned, "closed-loop"), recording.reference)
    for (start, stop), (_, _, most, end, down, said) in zip(windows, made):
        inside = (e.t >= start) & (e.t <= stop)
        assert (most, end, down, said) == (
            e.horizontal[inside].max(),
            e.horizontal[inside][-1],
            abs(e.position[inside, 2]).max(),
            "",
        )
    assert drift.consecutive(240.0, 575.0, 30.0) == [
        (240.0 + 30 * k, 270.0 + 30 * k) for k in range(11)
    ]


@pytest.mark.short
def test_summary_of_outages():
    rows = [
        ("a", "f", 0, 1, 3.0, 2.0, 1.0, ""),
        ("a", "f", 1, 2, 5.0, 4.0, 0.5, ""),
        ("a", "f", 2, 3, 9.0, 1.0, 0.1, ""),
        ("a", "g", 0, 1, *[np.nan] * 3, "no attitude"),
        ("a", "g", 1, 2, *[np.nan] * 3, "no attitude"),
    ]
    made = drift.summary(pd.DataFrame(rows, columns=drift.EACH)).set_index("filter")
    assert made.loc["f"].tolist() == [5.0, 9.0, 2.0, 0.5, ""]
    assert made.loc["g"].isna().sum() == 4 and made.loc["g", "said"] == "a: no attitude"
    assert drift.text_table(made.reset_index()).iloc[0].tolist() == [
        "f",
        "5.00",
        "9.00",
        "2.00",
        "0.50",
        "",
    ]


def standing_imu(rph, latitude, seconds=30.0, rate=20.0):
    """Imu of a body that stands, without errors, in FRD."""
    from scipy.spatial.transform import Rotation

    n, dt = round(seconds * rate), 1 / rate
    turn = Rotation.from_euler("ZYX", rph[::-1]).inv()
    omega, force = (
        turn.apply([RATE * np.cos(latitude), 0, -RATE * np.sin(latitude)]),
        turn.apply([0, 0, -9.8]),
    )
    return Imu(
        dt * np.arange(1, n + 1),
        np.full(n, dt),
        np.tile(omega * dt, (n, 1)),
        np.tile(force * dt, (n, 1)),
    )


@pytest.mark.short
def test_the_parked_vehicle_has_the_attitude_of_gravity_and_the_earths_rate():
    rph, lla = (0.006, -0.016, 1.5), (0.6, 1.9, 380.0)
    header = Source(
        "position", np.zeros(1), np.array([lla]), np.full((1, 3), 10.0), name="header position"
    )
    made = cases.parked_case(
        Recording(standing_imu(rph, lla[0]), (header,), meta={"name": "parked"})
    )
    truth = made.recording.reference
    np.testing.assert_allclose(truth.rph, np.tile(rph, (len(truth), 1)), atol=1e-9)
    assert (
        np.all(truth.lla == lla) and not truth.v_n.any() and truth.t[0] == 0 and truth.t[-1] >= 29.0
    )
    kinds = {a.kind: a for a in made.recording.sources[1:]}
    assert (
        set(kinds) == {"position", "zero-velocity"}
        and np.all(kinds["position"].std == 10.0)
        and len(kinds["position"].t) == 29
    )


@pytest.mark.short
def test_errors_of_motion():
    """A body that swings with 2 rad/s rms about one axis: 1 % of a third of its square, for 0.3
    s; a magnetometer of 25 Hz has 5 times its deviation."""
    t = 0.01 * np.arange(1, 1001)
    swing = 2 * np.sqrt(2) * np.sin(2 * np.pi * t)
    imu = Imu(
        t,
        np.full(1000, 0.01),
        0.01 * np.c_[swing, 0 * t, 0 * t],
        0.01 * np.tile([0, 0, -9.8], (1000, 1)),
    )
    field = Source(
        "magnetic-field", 0.04 * np.arange(1, 200), np.zeros((199, 3)), np.full((199, 3), 1e-6)
    )
    spec = sd.imu("consumer")
    made = cases.in_motion(Recording(imu, (field, position(1.0)), meta={"grade": spec}))
    grade = made.meta["grade"]
    assert grade.gyro.noise**2 - spec.gyro.noise**2 == pytest.approx(
        (0.01 * 2) ** 2 / 3 * 0.6, rel=1e-6
    )
    assert grade.accel.noise**2 - spec.accel.noise**2 == pytest.approx(
        (0.01 * 9.8) ** 2 / 3 * 0.6, rel=1e-6
    )
    np.testing.assert_allclose(made.sources[0].std, 5e-6, rtol=1e-6)
    assert np.all(made.sources[1].std == 1.0) and grade.gyro.turn_on_bias == spec.gyro.turn_on_bias


@pytest.mark.short
def test_markdown(goes_into_its_page):
    text = main.in_docs(
        [("Heading", pd.DataFrame([("a|b*", "1.0\n2.0")], columns=["filter", "x"]))]
    )
    assert text == "### Heading\n\n| filter | x |\n| --- | --- |\n| a/b\\* | 1.0<br>2.0 |\n"
    goes_into_its_page("recordings", text)


@pytest.mark.short
def test_the_page_and_what_stands_in_the_documentation(tmp_path, monkeypatch):
    frame = pd.DataFrame([("f", "1 m\n2 deg")], columns=["filter", "thor75"])
    monkeypatch.setattr(main, "_flight", lambda *_: (frame, [claim("it flies", 1.0, 2.0, "m")], []))
    monkeypatch.setattr(main, "_drive", lambda *_: (frame, frame, [], []))
    monkeypatch.setattr(main, "_laser", lambda *_: (None, []))
    monkeypatch.setattr(main.calibrated_compass, "magnetometer", lambda *_: ({}, []))
    monkeypatch.setattr(
        main,
        "every_filter",
        lambda *_: ({"every-filter": (None, frame)}, [("Every filter", frame)]),
    )
    assert [each["holds"] for each in main.reproduce(tmp_path)] == [True]
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert (
        "<h2>Every filter</h2>" in html
        and "<td>1 m<br>2 deg</td>" in html
        and recordings_table.LEGEND in html
    )
    assert (
        (tmp_path / "table.md")
        .read_text(encoding="utf-8")
        .startswith("### Every filter\n\n| filter | thor75 |\n")
    )
    assert (tmp_path / "every-filter.csv").exists()


def test_the_recorded_data(data_folder, monkeypatch):
    """All recordings with two filters, from reading to the page's tables."""
    monkeypatch.setattr(filters, "names", lambda: ["attitude-mekf", "closed-loop"])
    every, shown = main.every_filter(main.DESCRIPTIONS, None)
    scores = every["every-filter"][1].set_index(["recording", "filter"])
    groups = every["every-filter"][1]["group"]
    assert list(dict.fromkeys(groups)) == [
        "thor75",
        "drive0708",
        "BROAD, as read",
        "BROAD, errors of motion",
        "ring laser",
    ]
    flown = scores.loc[("thor75", "closed-loop")]
    assert (
        flown["said"] == ""
        and flown["horizontal, m"] < 1.0
        and flown["roll, deg"] < 1.0
        and flown["heading, deg"] < 3.0
    )
    # 15 % of the magnetometer's samples contradict positions and velocities, and are left out
    assert flown["others accepted"] > 55000 and flown["fixes rejected"] < 20
    assert (
        scores.loc[("drive0708", "attitude-mekf"), "said"]
        == "runs; the recording has nothing to score it by"
    )
    apart = every["dead-reckoning"][1].set_index("filter")
    assert (
        list(apart.index) == ["closed-loop"]
        and apart.loc["closed-loop", "drive0708 median, m"] < 8.0
    )
    assert [heading for heading, _ in shown] == [
        recordings_table.EVERY,
        drift.HEADING,
        recordings_table.TRIALS,
    ]


def test_the_calibration_in_the_description_is_the_one_that_it_names(data_folder):
    """What the comment of thor75-full.toml quotes is thor75-magnetometer.toml, and its
    magnetometer has no more left than that calibration's misfit."""
    folder = main.DESCRIPTIONS
    numbers = lambda text: [float(each) for each in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]
    quoted = (
        (folder / "thor75-full.toml")
        .read_text(encoding="utf-8")
        .partition("bias = ")[2]
        .partition("as thor75-magnetometer.toml")[0]
    )
    named = (
        (folder / "thor75-magnetometer.toml").read_text(encoding="utf-8").partition("bias = ")[2]
    )
    assert numbers(quoted) == numbers(named) and len(numbers(named)) == 12
    flown = sd.read(folder / "thor75-full.toml")
    assert [a.kind for a in flown.sources] == ["position", "velocity", "magnetic-field", "pressure"]
    again = sd.calibrate(flown, "magnetometer", *cases.FLIGHT)
    assert np.abs(again.bias).max() < 1e-7 and np.abs(again.matrix - np.eye(3)).max() < 1e-3


def test_a_folder_without_the_descriptions_is_refused(tmp_path):
    (tmp_path / "thor75.toml").write_text("", encoding="utf-8")
    with pytest.raises(DataError, match="thor75"):
        main.reproduce(tmp_path / "out", tmp_path)
