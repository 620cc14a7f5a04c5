"""Figures of made-up solutions: what they show, in which units, and that long or odd runs stay
readable."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import flight, solution

from strapdown.data.solution import Innovations
from strapdown.evaluation import metrics
from strapdown.geometry.geodesy import displacement
from strapdown.pages import drawing, figures, fix_figures

pytestmark = pytest.mark.short
TRUTH = flight(600, rate=2.0)
SOLUTION = solution(TRUTH)


def titles(figure):
    return [
        figure.layout[name].title.text
        for name in figure.to_dict()["layout"]
        if name.startswith("yaxis")
    ]


def trace(figure, name, axis="y"):
    return next(t for t in figure.data if t.name == name and (t.yaxis or "y") == axis)


def everything(made, reference):
    """Every figure of a page."""
    alone = [
        figures.track({"a": made}, reference),
        figures.height({"a": made}, reference),
        figures.position(made, None),
        figures.velocity(made, None, compare=reference),
        figures.attitude(made, None, compare=reference),
        figures.sigma(made),
        figures.accel_bias(made),
        figures.gyro_bias(made),
        fix_figures.innovations(made),
        fix_figures.nis(made),
    ]
    scored = [
        figures.horizontal({"a": made}, reference),
        *(f(made, reference) for f in (figures.position, figures.velocity, figures.attitude)),
    ]
    return [figure for figure in alone + scored if figure is not None]


def test_every_axis_says_its_unit():
    for figure in everything(SOLUTION, TRUTH):
        bottom = [
            axis
            for name in figure.to_dict()["layout"]
            if name.startswith("xaxis") and (axis := figure.layout[name]).title.text
        ]
        assert bottom and all("[" in axis.title.text for axis in bottom)
        assert all(
            "[" in title for title in titles(figure) if title not in SOLUTION.innovations.names
        ), titles(figure)


def test_error_figures_show_true_minus_estimate_and_three_sigma():
    figure = figures.position(SOLUTION, TRUTH)
    e = metrics.errors(SOLUTION, TRUTH)
    assert np.allclose(
        trace(figure, "error (true - estimate)").y, e.position[:, 0], rtol=1e-4, atol=1e-4
    )
    assert np.nanmax(trace(figure, "±3σ", "y3").y) == pytest.approx(
        3 * SOLUTION.trajectory.std[:, 2].max(), rel=1e-5
    )
    assert titles(figure) == ["north [m]", "east [m]", "down [m]"]
    assert titles(figures.attitude(SOLUTION, TRUTH)) == [
        "roll [deg]",
        "pitch [deg]",
        "heading [deg]",
    ]
    assert np.allclose(
        trace(figures.attitude(SOLUTION, TRUTH), "error (true - estimate)", "y3").y,
        np.degrees(e.rph[:, 2]),
        rtol=1e-4,
        atol=1e-4,
    )


def test_a_track_counts_from_the_first_position_that_is_known():
    lla = SOLUTION.trajectory.lla.copy()
    lla[:3] = np.nan
    late = replace(SOLUTION, trajectory=replace(SOLUTION.trajectory, lla=lla))
    north = np.asarray(trace(figures.position(late), "estimate").y)
    whole = np.asarray(trace(figures.position(SOLUTION), "estimate").y)
    assert len(north) == len(whole) and north[3] == 0.0 and np.isfinite(north[3:]).all()
    assert np.allclose(north[3:], whole[3:] - whole[3], atol=0.01)


def test_thinning_keeps_the_extremes_and_the_breaks():
    y = np.sin(np.linspace(0, 60, 100_000))
    y[[41_234, 77_777]] = 9.0, -8.0
    y[60_000:60_010] = np.nan
    keep = drawing.thin(y)
    assert (
        len(keep) <= drawing.MAX_POINTS + 2
        and np.all(np.diff(keep) > 0)
        and keep[0] == 0
        and keep[-1] == 99_999
    )
    assert np.nanmax(y[keep]) == 9.0 and np.nanmin(y[keep]) == -8.0 and np.isnan(y[keep]).any()
    assert np.array_equal(drawing.thin(y[:50]), np.arange(50))
    assert len(drawing.thin(np.full(5000, np.nan))) <= drawing.MAX_POINTS


def test_no_trace_of_a_long_run_is_long():
    truth = flight(3600, rate=20.0)
    made = solution(truth)
    for figure in everything(made, truth):
        # a band is a polygon, there and back
        assert max(len(t.x) for t in figure.data) <= 2 * drawing.MAX_POINTS + 10


def test_the_initial_convergence_does_not_flatten_the_rest_but_is_told():
    figure = figures.attitude(SOLUTION, TRUTH)
    std = SOLUTION.trajectory.std
    top = figure.layout.yaxis3.range[1]
    assert 3 * np.degrees(std[-1, 8]) < top < 10 < 3 * np.degrees(std[0, 8])
    assert (
        "heading up to" in figure.layout.meta["notes"][0]
        and "Double-click" in figure.layout.meta["notes"][0]
    )


def test_an_outage_is_never_beyond_the_frame():
    lla = SOLUTION.trajectory.lla.copy()
    lla[700:720, 2] += 500.0
    limit, largest = drawing.frame(
        TRUTH.t, TRUTH.lla[:, 2] - lla[:, 2], 3 * SOLUTION.trajectory.std[:, 2]
    )
    assert limit > largest > 490


def test_a_solution_far_off_leaves_the_frame_with_a_remark():
    far = solution(TRUTH, seed=2, drift=0.05)
    figure = figures.track({"near": SOLUTION, "far": far}, TRUTH)
    assert (
        np.ptp(figure.layout.yaxis.range) < 2500
        and "far leaves the frame by up to" in figure.layout.meta["notes"][0]
    )
    assert "km" in figure.layout.meta["notes"][0]
    assert np.ptp(figures.track({"near": SOLUTION}).layout.yaxis.range) < 2500


def test_fixes_on_the_track_lie_at_estimate_plus_innovation():
    figure = figures.track({"a": SOLUTION}, TRUTH)
    rejected = trace(figure, "gnss fixes, rejected")
    fix = SOLUTION.innovations
    far = np.flatnonzero(fix.innovation[:, 0] == 50.0)[0]
    row = np.searchsorted(TRUTH.t, fix.t[far])
    expected = displacement(SOLUTION.trajectory.lla[row], TRUTH.lla[0]) + fix.innovation[far]
    assert np.hypot(rejected.x - expected[1], rejected.y - expected[0]).min() < 0.01


def test_innovations_are_split_by_source_and_rejected_ones_marked():
    figure = fix_figures.innovations(SOLUTION)
    counts = SOLUTION.counts()
    assert titles(figure) == ["gnss [m]", "velocity [m/s]"]
    for axis, source in (("y", "gnss"), ("y2", "velocity")):
        crosses = sum(
            len(t.x) for t in figure.data if t.name == "rejected" and (t.yaxis or "y") == axis
        )
        dots = sum(len(t.x) for t in figure.data if t.name == "north" and (t.yaxis or "y") == axis)
        assert (dots, crosses) == (counts[source][0], 3 * counts[source][1])
    assert figure.layout.yaxis.range[1] < 10 and "up to 50 m" in figure.layout.meta["notes"][0]


def test_nis_has_the_gate_of_each_source():
    figure = fix_figures.nis(
        replace(SOLUTION, innovations=replace(SOLUTION.innovations, gates=(16.3, np.inf)))
    )
    assert list(trace(figure, "gate").y) == [16.3, 16.3] and [
        t.yaxis for t in figure.data if t.name == "gate"
    ] == ["y"]
    assert figure.layout.yaxis.range[1] > np.log10(1200)


def test_angles_and_single_components_have_their_unit():
    one = Innovations(
        np.arange(5.0),
        np.zeros(5, int),
        np.c_[np.full(5, np.radians(2.0)), np.full((5, 2), np.nan)],
        np.ones(5),
        np.ones(5, bool),
        ("heading",),
        (None,),
    )
    figure = fix_figures.innovations(replace(SOLUTION, innovations=one))
    assert titles(figure) == ["heading [deg]"] and [t.name for t in figure.data] == [
        "single component"
    ]
    assert np.allclose(figure.data[0].y, 2.0)


def test_gaps_are_shaded_and_events_numbered():
    layout = figures.sigma(SOLUTION).layout
    shaded = sorted((shape.x0, shape.x1) for shape in layout.shapes if shape.type == "rect")
    assert shaded == [(200.0, 200.5), (400.0, 411.5)]
    assert [(note.text, note.x) for note in layout.annotations] == [
        ("1", 200.0),
        ("2", 400.0),
        ("3", 412.0),
    ]


def test_what_a_filter_does_not_claim_is_left_out():
    silent = replace(
        SOLUTION,
        trajectory=replace(SOLUTION.trajectory, std=np.full((len(TRUTH), 15), np.nan)),
        b_a=np.zeros((len(TRUTH), 3)),
    )
    assert (
        figures.sigma(silent) is None
        and figures.accel_bias(silent) is None
        and figures.extra(silent) is None
    )
    assert "±3σ" not in [t.name for t in figures.position(silent, TRUTH).data]
    nothing = Innovations(
        np.empty(0), np.empty(0, int), np.empty((0, 3)), np.empty(0), np.empty(0, bool)
    )
    assert (
        fix_figures.innovations(replace(SOLUTION, innovations=nothing)) is None
        and fix_figures.nis(replace(SOLUTION, innovations=nothing)) is None
    )


def test_units_of_biases_follow_their_size():
    assert (
        titles(figures.accel_bias(SOLUTION))[0] == "x [mg]"
        and titles(figures.gyro_bias(SOLUTION))[0] == "x [deg/h]"
    )
    assert titles(figures.accel_bias(replace(SOLUTION, b_a=SOLUTION.b_a * 1e-4)))[0] == "x [ug]"
    assert titles(figures.gyro_bias(replace(SOLUTION, b_g=SOLUTION.b_g * 1000)))[0] == "x [deg/s]"
    assert np.nanmedian(trace(figures.accel_bias(SOLUTION), "estimate").y) == pytest.approx(
        0.05 / 9.80665e-3, rel=0.1
    )


def test_euler_std_agrees_with_sampling():
    rng = np.random.default_rng(5)
    from scipy.spatial.transform import Rotation

    rph, std = np.array([[0.3, -0.6, 1.1]]), np.array([[0.001, 0.002, 0.004]])
    estimate = Rotation.from_euler("ZYX", rph[:, ::-1])
    angles = (Rotation.from_rotvec(rng.standard_normal((40_000, 3)) * std) * estimate).as_euler(
        "ZYX"
    )[:, ::-1]
    assert figures.euler_std(rph, std)[0] == pytest.approx(angles.std(axis=0), rel=0.02)


def test_headings_are_cut_where_they_wrap():
    assert np.isnan(figures.cut_wraps([350.0, 359.0, 1.0, 5.0])).tolist() == [
        False,
        False,
        True,
        False,
    ]
    heading = trace(figures.attitude(SOLUTION), "estimate", "y3").y
    assert np.nanmax(np.abs(np.diff(heading))) < 180 and np.isnan(heading).any()


def test_runs_with_unknown_rows_and_clock_times_are_drawn():
    part = SOLUTION.trajectory
    blank = lambda values: np.where(np.arange(len(TRUTH))[:, None] > 1000, np.nan, values)
    lost = replace(
        SOLUTION,
        trajectory=replace(
            part, t=part.t + 1.7e9, lla=blank(part.lla), v_n=blank(part.v_n), q_nb=blank(part.q_nb)
        ),
        innovations=replace(SOLUTION.innovations, t=SOLUTION.innovations.t + 1.7e9),
    )
    for figure in everything(lost, replace(TRUTH, t=TRUTH.t + 1.7e9)):
        assert np.all(
            np.isfinite(
                np.array([axis.range for axis in (figure.layout.xaxis, figure.layout.yaxis)], float)
            )
        )
    assert figures.sigma(lost).layout.xaxis6.title.text == "time since 1700000000 s [s]"


@pytest.mark.parametrize(
    "low, high, labels",
    [
        (0.02, 0.3, ["0.02", "0.05", "0.1", "0.2"]),
        (30.0, 200.0, ["50", "100", "200"]),
        (1.0, 2.0, ["1", "2"]),
        (3e-9, 8e-9, ["5e-09", "1e-08"]),
        (3.0, 3.2, ["2.5", "3", "4"]),
    ],
)
def test_a_short_logarithmic_axis_has_whole_numbers(low, high, labels):
    figure = drawing.panels(["x [m]"], log=True)
    drawing.log_range(figure, low, high)
    axis = figure.layout.yaxis
    assert [float(text) for text in axis.ticktext] == pytest.approx(axis.tickvals) and list(
        axis.ticktext
    ) == labels
    assert all(axis.range[0] <= np.log10(value) <= axis.range[1] for value in axis.tickvals)


def test_a_long_logarithmic_axis_has_decades():
    figure = drawing.panels(["x [m]"], log=True)
    drawing.log_range(figure, 1e-3, 1e3)
    assert figure.layout.yaxis.dtick == 1 and figure.layout.yaxis.tickvals is None
