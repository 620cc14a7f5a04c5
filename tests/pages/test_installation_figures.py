"""Figures and table of what of the installation was estimated: the columns of the solution, the
bands of their standard deviations, and the words of `installation`."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import flight, start

import strapdown as sd
from strapdown.pages import figures
from strapdown.pages.installation_figures import estimates, installation_table

pytestmark = pytest.mark.short
ARM = "lever arm {} error of GNSS position [m]"


@pytest.fixture(scope="module")
def solution():
    return sd.fuse(
        flight(), start=start(flight()), estimate={"clock": 0.1, "lever-arm": (0.5, 0.5, 5.0)}
    )


def traces(figure, name, row):
    axis = "y" if row == 1 else f"y{row}"
    return [trace for trace in figure.data if trace.name == name and trace.yaxis == axis]


def test_each_component_has_a_panel_with_its_column_and_both_bands(solution):
    figure = estimates(solution, "lever-arm")
    assert [figure.layout[f"yaxis{k}"].title.text for k in ("", 2, 3)] == [
        "forward [m]",
        "right [m]",
        "down [m]",
    ]
    for row, axis in enumerate(("forward", "right", "down"), 1):
        values = solution.columns[ARM.format(axis)]
        (drawn,), (band,) = traces(figure, "estimate", row), traces(figure, "±2σ", row)
        np.testing.assert_allclose(drawn.y, values, rtol=1e-4, atol=1e-6)
        half = 2 * solution.columns["std of " + ARM.format(axis)]
        n = len(values)
        np.testing.assert_allclose(band.y[:n], values + half, rtol=1e-4, atol=1e-4)
        lower, upper = traces(figure, "prior", row)
        prior = 10.0 if axis == "down" else 1.0
        assert list(lower.y) == [-prior] * 2 and list(upper.y) == [prior] * 2


def test_a_prior_that_would_flatten_the_rest_is_said(solution):
    columns = dict(solution.columns)
    for name in (ARM.format("down"), "std of " + ARM.format("down")):
        columns[name] = columns[name] * 0.01
    figure = estimates(replace(solution, columns=columns), "lever-arm")
    assert figure.layout.meta["notes"] == ["Priors beyond the frame: down ±10.0 m."]
    assert figure.layout.yaxis3.range[1] < 1


def test_nothing_is_drawn_of_what_was_not_estimated(solution):
    assert estimates(solution, "mounting") is None
    plain = sd.fuse(flight(), start=start(flight()))
    assert estimates(plain, "clock") is None and installation_table({"a": plain}) == ""
    assert figures.extra(solution) is None  # they have a section of their own


def test_the_page_has_a_section_with_the_table_and_a_figure_per_kind(solution, tmp_path):
    page = sd.report(solution, flight().reference)
    page.save(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert page.notes == () and text.index("<h2>Installation</h2>") < text.index("<h2>Fixes</h2>")
    for each in solution.installation.parameters:
        assert f"<td>{each.name} [{each.unit}]</td><td>{each.given:.3f}</td>" in text
        assert f"<td>{each.value:.3f}</td>" in text
    assert "<td>not observable; to show it, turn, to both sides</td>" in text
    assert "True − given, with ±2σ; dashed: ±2σ of the prior." in text


def test_several_solutions_are_named_in_the_table(solution):
    text = installation_table({"one": solution, "two": solution})
    assert "<td>one: clock of GNSS position and GNSS velocity [s]</td>" in text
    assert "<td>two: clock of GNSS position and GNSS velocity [s]</td>" in text
