"""Wrong sensors beside GNSS: the figures by hand, and what the mistakes make of readings."""

import numpy as np
import pandas as pd
import pytest

from strapdown.data.solution import Source
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.common.write_docs import DOCS, mark
from strapdown_reproductions.worth import wrong_main
from strapdown_reproductions.worth.mistakes import MISTAKES

pytestmark = pytest.mark.short


def row(mistake, seed, said, named, worse, in_outage):
    return {
        "motion": "car",
        "sensor": "speed",
        "mistake": mistake,
        "seed": seed,
        "said": said,
        "named": named,
        "worse": worse,
        "worse_in_outage": in_outage,
        "shown": 5.0,
    }


def test_figures_are_shares_of_runs_and_of_medians():
    rows = pd.DataFrame(
        [
            row(wrong_main.RIGHT, 1, False, False, 0.9, 0.5),
            row(wrong_main.RIGHT, 2, True, False, 0.9, 0.5),
            row("stuck", 1, True, True, 1.0, 9.0),
            row("stuck", 2, True, False, 1.2, 1.0),
            row("stuck", 3, False, False, 1.4, 2.0),
            row("knots", 1, True, True, np.nan, np.nan),
        ]
    )
    assert wrong_main.figures(StudyTables(runs=rows)) == {
        "right": 50.0,
        "said": 75.0,
        "named": pytest.approx(200 / 3),
        "with GNSS": 100.0,
        "in the outage": 0.0,
    }


def test_every_mistake_changes_its_readings():
    t = np.arange(0.0, 100.0, 0.5)
    for kind, mistakes in MISTAKES.items():
        y = np.sin(t)[:, None] * np.ones(3) + 2.0
        a = Source(kind, t, y, np.ones_like(y), (0.0, 0.0, 0.0, 0.5, 0.2, 10.0))
        for each in mistakes:
            made = each.make(a)
            same = np.array_equal(made.y, y) and np.array_equal(made.t, t)
            assert not same or made.parameters != a.parameters, each.name


def test_the_page_has_its_place():
    page = (DOCS / wrong_main_page()).read_text(encoding="utf-8")
    assert mark("wrong-sensors") in page


def wrong_main_page():
    from strapdown_reproductions.common.write_docs import PAGES

    return PAGES["wrong-sensors"][1]
