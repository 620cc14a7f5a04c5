"""The page of a Tuning, and what its figures draw."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tuned import tuning

from strapdown.tuning import figures
from strapdown.tuning.figures import spectrum


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_a_spectrum_is_that_of_the_closed_form(phi):
    """White noise has 1 everywhere; what is correlated over a lag (1 - phi^2) / |1 - phi z|^2."""
    draws = np.random.default_rng(5).normal(size=(40_000, 3))
    rows = lfilter([np.sqrt(1 - phi**2)], [1, -phi], draws, axis=0)
    f, density = spectrum(np.arange(len(rows)) / 5.0, rows)
    z = np.exp(-2j * np.pi * f / 5.0)
    np.testing.assert_allclose(density, (1 - phi**2) / np.abs(1 - phi * z) ** 2, rtol=0.25)
    assert 2.4 < f[-1] < 2.5


def test_the_page_has_verdict_numbers_and_figures():
    found = tuning()
    page = found.page().html
    for text in (found.summary, *found.undecided, *found.notes, found.used):
        assert text in page
    for heading in (
        "Likelihood of each number",
        "Spectra of the whitened innovations",
        "Autocorrelation of the whitened innovations",
        "NIS over time",
        "Rejected fixes",
    ):
        assert f"<h3>{heading}</h3>" in page
    assert "GNSS position correlation time" in page and "at least 12" in page


def test_every_axis_has_a_unit():
    found = tuning()
    sources = figures.drawn_sources(found.before, found.after)
    assert len(sources) == 2
    for drawn in (
        figures.profiles_figure(found.parameters),
        figures.spectra_figure(found, sources),
        figures.autocorrelation_figure(found, sources),
        figures.nis_figure(found, sources),
    ):
        titles = [
            drawn.layout[name].title.text
            for name in drawn.layout
            if name.startswith("xaxis")
            and any(t.xaxis == name.replace("axis", "") for t in drawn.data)
        ]
        assert titles and all(title.endswith("]") for title in titles)


def test_the_curves_of_before_show_deviations_that_are_half():
    found = tuning()
    sources = figures.drawn_sources(found.before, found.after)
    by_label = {}
    for trace in figures.nis_figure(found, sources).data:
        by_label.setdefault(trace.name, []).append(np.nanmedian(np.array(trace.y, float)))
    assert all(2.5 < each < 6 for each in by_label["before"])
    assert all(0.6 < each < 1.6 for each in by_label["after"])


def test_a_tuning_without_scans_or_rejections_is_drawn_too():
    found = tuning()
    empty = (np.empty(0), np.empty(0))
    bare = replace(
        found,
        parameters=tuple(replace(each, scan=empty) for each in found.parameters),
        directions=(),
        fits=(),
        before=found.after,
    )
    page = bare.page().html
    assert "Likelihood of each number" not in page and "NIS over time" in page
