"""Several solutions on the same axes: a line each in its colour, one scale, and what diverged said,
not hidden; the time and the track that a page links figures by."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from synthetic import flight, solution

from strapdown import report
from strapdown.evaluation import metrics
from strapdown.pages import drawing, figures, fix_figures, separation_figures

pytestmark = pytest.mark.short
TRUTH = flight(300, rate=2.0)
ONE, OTHER, FAR = (
    solution(TRUTH),
    solution(TRUTH, seed=2, name="open-loop"),
    solution(TRUTH, seed=3, drift=0.05),
)
BOTH = {"one": ONE, "other": OTHER}
FIGURES = (
    lambda all: figures.position(all, TRUTH),
    lambda all: figures.velocity(all, TRUTH),
    lambda all: figures.attitude(all, TRUTH),
    lambda all: figures.attitude_angles(all, TRUTH),
    lambda all: figures.horizontal(all, TRUTH),
    figures.position,
    figures.velocity,
    figures.attitude,
    figures.height,
    figures.sigma,
    figures.accel_bias,
    figures.gyro_bias,
)


def lines(figure, name):
    return [t for t in figure.data if t.name == name and t.line.dash == "solid"]


@pytest.mark.parametrize("draw", FIGURES)
def test_every_solution_has_a_line_in_its_colour_in_every_panel(draw):
    figure = draw(BOTH)
    panels = sum(name.startswith("yaxis") for name in figure.to_dict()["layout"])
    for name, colour in zip(BOTH, drawing.COLOURS):
        drawn = lines(figure, name)
        assert len(drawn) == panels and {t.line.color for t in drawn} == {colour}
        assert [t.showlegend for t in drawn].count(True) == 1
        # whatever else is of this solution goes with its entry of the legend
        own = [t for t in figure.data if t.line.color == colour and t.mode == "lines"]
        assert {t.legendgroup for t in own} == {name}
    assert figure.layout.meta["time"] == 0.0 and figure.layout.xaxis.range == (0.0, 299.5)


def test_bands_are_shaded_of_two_and_dotted_of_three():
    bands = lambda all: [t for t in figures.velocity(all, TRUTH).data if "±3σ" in t.name]
    assert {t.fill for t in bands(BOTH)} == {"toself"}
    assert {(t.fill, t.line.dash) for t in bands(BOTH | {"third": FAR})} == {(None, "dot")}
    half = bands(BOTH)[0]
    assert np.nanmax(half.y) == pytest.approx(3 * OTHER.trajectory.std[:, 3].max(), rel=0.01)


def test_one_that_diverges_leaves_the_scale_to_the_other_and_is_named():
    alone = figures.position({"one": ONE}, TRUTH).layout.yaxis.range
    figure = figures.position({"far": FAR, "one": ONE}, TRUTH)
    assert figure.layout.yaxis.range == alone and lines(figure, "far")
    (said,) = [text for text in figure.layout.meta["notes"] if "leaves the frame" in text]
    largest = np.abs(metrics.errors(FAR, TRUTH).position[:, 0]).max()
    assert said.startswith(f"far leaves the frame: north up to {largest:.3g} m")


def test_an_outage_of_one_widens_the_scale_of_all():
    lla = OTHER.trajectory.lla.copy()
    lla[300:340, 2] += 80.0
    lost = replace(OTHER, trajectory=replace(OTHER.trajectory, lla=lla))
    figure = figures.position({"one": ONE, "lost": lost}, TRUTH)
    assert figure.layout.yaxis3.range[1] > 80
    assert not any("leaves" in text for text in figure.layout.meta["notes"])


def test_one_that_diverges_does_not_hide_the_other_on_logarithmic_axes():
    figure = figures.horizontal({"far": solution(TRUTH, drift=5.0), "one": ONE}, TRUTH)
    low, top = figure.layout.yaxis.range
    error = metrics.errors(ONE, TRUTH).horizontal
    assert low < np.log10(np.median(error)) < top
    assert "far leaves the frame by up to" in figure.layout.meta["notes"][0]


def test_a_reference_and_fixes_stand_beside_the_estimates():
    figure = figures.velocity(BOTH, compare=TRUTH)
    below = [t for t in figure.data if t.name == "reference"]
    assert len(below) == 3 and figure.data[0].name == "reference"  # the others lie on it
    assert all(t.line.width > max(u.line.width for u in lines(figure, "one")) for t in below)
    marked = [t for t in figures.position(BOTH).data if t.mode == "markers"]
    assert {t.name for t in marked} == {"gnss fixes, accepted", "gnss fixes, rejected"}
    assert len(marked) == 6 and not [
        t for t in figures.position(BOTH, TRUTH).data if t.mode == "markers"
    ]


def test_the_pointer_shows_value_unit_and_standard_deviation():
    (north, *_) = lines(figures.velocity(BOTH, TRUTH), "one")
    assert north.hovertemplate == "%{y:.4g} ± %{customdata:.2g} m/s"
    std = ONE.trajectory.std[:, 3]
    assert np.allclose(north.customdata, std, rtol=0.01) and len(north.customdata) == len(north.x)
    assert figures.velocity(BOTH).layout.xaxis.unifiedhovertitle.text == "%{x:.2f} s"


@pytest.mark.parametrize("draw, axes", [(figures.track, "xy"), (figures.space, "xyz")])
def test_a_track_carries_its_times(draw, axes):
    shifted = lambda made: replace(made, t=made.t + 1.7e9)
    made = replace(ONE, trajectory=shifted(ONE.trajectory))
    figure = draw({"one": made, "other": made}, shifted(TRUTH))
    assert figure.layout.meta["track"] is True
    for trace in [t for t in figure.data if t.mode == "lines"]:
        assert all(len(trace[axis]) == len(trace.customdata) == 600 for axis in axes)
        assert np.allclose(trace.customdata, TRUTH.t + 1.7e9, atol=0.01)
    t = made.t[[100]]
    assert figures.height(made).layout.meta["time"] == np.floor(made.t[0]) < t


def test_three_dimensions_have_one_scale():
    scene = figures.space(BOTH, TRUTH).layout.scene
    spans = [np.ptp(scene[f"{axis}axis"].range) for axis in "xyz"]
    ratio = [scene.aspectratio[axis] for axis in "xyz"]
    assert np.allclose(np.divide(ratio, spans), ratio[0] / spans[0])
    assert (
        figures.space(
            replace(ONE, trajectory=replace(ONE.trajectory, lla=np.full_like(TRUTH.lla, np.nan)))
        )
        is None
    )


def test_stretches_without_an_accepted_position_fix_are_shaded_everywhere():
    fixes = ONE.innovations
    lost = (fixes.t > 100) & (fixes.t < 140) & (fixes.source == 0)
    blind = replace(ONE, innovations=replace(fixes, accepted=fixes.accepted & ~lost))
    ((start, stop),) = drawing.outages(blind)
    assert start <= 100.0 and 140.0 <= stop and stop - start < 43
    assert drawing.outages(ONE) == []
    for draw in FIGURES:
        shades = [
            s
            for s in draw({"one": ONE, "blind": blind}).layout.shapes
            if s.fillcolor == drawing.OUTAGE
        ]
        assert [(s.x0, s.x1) for s in shades] == [(start, stop)]
    hidden = replace(blind, meta=blind.meta | {"withheld": [(95.0, 145.0)]})
    assert drawing.OUTAGE not in {s.fillcolor for s in figures.height(hidden).layout.shapes}
    assert "no position fix" in report(blind).html and "no position fix" not in report(ONE).html


def test_events_of_all_are_marked_in_the_colour_of_whose_they_are():
    late = replace(OTHER, events=((50.0, "late"),))
    notes = figures.sigma({"one": ONE, "late": late}).layout.annotations
    assert [(n.text, n.x) for n in notes if n.font.color == drawing.COLOURS[1]] == [("1", 50.0)]
    assert [n.text for n in notes if n.font.color == drawing.COLOURS[0]] == ["1", "2", "3"]
    assert {n.font.color for n in figures.sigma(BOTH).layout.annotations} == {drawing.GREY}


def test_innovations_side_by_side_have_one_height():
    innovation = OTHER.innovations.innovation * 3
    loud = replace(OTHER, innovations=replace(OTHER.innovations, innovation=innovation))
    both = {"one": ONE, "loud": loud}
    for draw in (fix_figures.innovations, fix_figures.nis):
        first, second = (draw(made, both).layout.yaxis.range for made in both.values())
        assert first == second
    assert fix_figures.innovations(ONE).layout.yaxis.range[1] < first[1] * 100


def test_expected_bounds_are_those_of_the_covariance():
    fixes = ONE.innovations
    root = np.tile([3.0, 1.0, 2.0, 0.0, 3.0, 4.0], (len(fixes.t), 1))
    figure = fix_figures.innovations(replace(ONE, innovations=replace(fixes, root=root)))
    bounds = [t for t in figure.data if t.name == "±2σ" and t.yaxis == "y"]
    assert [np.nanmax(t.y) for t in bounds] == pytest.approx([6.0, 2 * 5**0.5, 10.0], rel=1e-3)
    alike = replace(fixes, root=np.tile([2.0, 0, 2, 0, 0, 2], (len(fixes.t), 1)))
    figure = fix_figures.innovations(replace(ONE, innovations=alike))
    assert [t.line.color for t in figure.data if t.name == "±2σ" and t.yaxis == "y"] == [
        drawing.GREY
    ]


@pytest.mark.parametrize("freedom", range(1, 7))
def test_quantiles_of_chi_square_are_those_of_scipy(freedom):
    chance = np.array([1e-3, 0.01, 0.1, 0.5, 0.9, 0.99, 0.9999])
    found = fix_figures._chi_square(freedom, chance)
    np.testing.assert_allclose(found, chi2.ppf(chance, freedom), rtol=1e-5)


def test_whiteness_tells_a_walk_from_noise_and_quantiles_what_is_claimed():
    rng, fixes = np.random.default_rng(1), ONE.innovations
    white = rng.standard_normal(fixes.innovation.shape)
    made = lambda rows: replace(
        ONE,
        innovations=replace(
            fixes, whitened=rows, nis=(rows**2).sum(axis=1), accepted=np.ones(len(fixes.t), bool)
        ),
    )
    both = {"noise": made(white), "walk": made(np.cumsum(white, axis=0) / 10)}
    figure = fix_figures.whiteness(both)
    bound = max(t.y[0] for t in figure.data if t.name.startswith("95 %"))
    (noise, *_), (walk, *_) = ([t for t in figure.data if t.name == name] for name in both)
    assert (np.abs(noise.y) < bound).mean() > 0.85 and walk.y[0] > 0.8 > 5 * bound
    m = int((fixes.source == 0).sum())
    assert bound == pytest.approx(1.96 / np.sqrt(3 * m), rel=0.01)
    quantiles = fix_figures.nis_quantiles(both)
    (noise, *_) = (t for t in quantiles.data if t.name == "noise")
    middle = slice(len(noise.x) // 4, -len(noise.x) // 4)
    assert np.allclose(noise.y[middle], noise.x[middle], rtol=0.2)


def test_causes_of_rejection_have_marks_of_their_own():
    assert len({colour for colour, _ in fix_figures.CAUSES.values()}) == len(fix_figures.CAUSES)
    assert len({symbol for _, symbol in fix_figures.CAUSES.values()}) == len(fix_figures.CAUSES)
    for cause in fix_figures.CAUSES:
        figure = drawing.panels(["x [m]"])
        drawing.marks(figure, np.arange(3.0), np.arange(3.0), *fix_figures._rejected_style(cause))


def test_the_separation_of_a_smoother_is_what_it_was_from_the_filter():
    from recordings import flight as recorded, start

    import strapdown as sd

    filtered = sd.fuse(recorded(), start=start(recorded()))
    made = sd.smooth(recorded(), start=start(recorded()))
    size = np.linalg.norm(made.trajectory.v_n - filtered.trajectory.v_n, axis=1)
    seen = np.isfinite(made.separation.std[:, 1])
    assert len(seen) == len(made.t) and seen.any()
    # of the components that can be compared
    assert (made.separation.size[seen, 1] <= size[seen] * 1.001 + 1e-9).all()
    figure = separation_figures.separation(made)
    assert {t.name for t in figure.data} == {"separation", "3σ"}
    assert separation_figures.separation(filtered) is None
    middle, late = 0.5 * (made.t[0] + made.t[-1]), made.t[-1]
    part = made.between(middle, late)
    np.testing.assert_array_equal(part.separation.size, made.separation.size[made.t >= middle])
    assert separation_figures.separation(part).data


# Machado, Oliveira & Fernandes (2009), severity 1
DEUTERANOPIA = [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]]
PROTANOPIA = [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]]


def linear(colour):
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    x = to_xyz @ np.clip(rgb, 0, 1) / [0.9505, 1, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("seen", [np.eye(3), DEUTERANOPIA, PROTANOPIA])
def test_colours_are_told_apart_by_the_colour_blind(seen):
    for a, b in itertools.combinations(drawing.COLOURS, 2):
        assert np.linalg.norm(lab(seen @ linear(a)) - lab(seen @ linear(b))) > 15, (a, b)


@pytest.mark.parametrize("ground", ["#f7f9fb", "#1b2128"])
def test_colours_are_readable_on_light_and_dark(ground):
    light = lambda colour: [0.2126, 0.7152, 0.0722] @ linear(colour) + 0.05
    for colour in drawing.COLOURS:
        a, b = sorted((light(colour), light(ground)))
        assert b / a > 2.1, colour


def test_what_goes_into_the_page_keeps_what_can_be_seen():
    values = np.r_[1234.5678 + np.linspace(0, 10, 1000), np.nan]
    kept = drawing.column(values)
    assert kept.dtype == np.float32 and np.nanmax(np.abs(kept - values)) < 1e-4
    small = np.geomspace(1e-6, 1e3, 1000)
    assert np.allclose(drawing.column(small), small, rtol=2e-4)
    assert drawing.column(np.zeros(3)).tolist() == [0, 0, 0]
    assert drawing.column(np.array([1.7e9, 1.7e9 + 1])).dtype == float


def test_a_solution_without_rows_is_left_out():
    rows = slice(0, 0)
    empty = replace(ONE, trajectory=ONE.trajectory.take(rows))
    assert figures.sigma({"empty": empty}) is None and figures.track(empty) is None
    assert (
        lines(figures.sigma({"empty": empty, "one": ONE}), "one")[0].line.color
        == drawing.COLOURS[1]
    )
