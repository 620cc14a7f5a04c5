"""Worth of sensors in an outage: the table by hand, the runs, and the page."""

import numpy as np
import pandas as pd
import pytest

from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.common.write_docs import DOCS, mark
from strapdown_reproductions.worth import main, sensors


@pytest.mark.short
def test_the_table_is_the_medians_and_their_ratios():
    rows = pd.DataFrame(
        [
            {"motion": motion, "sensor": sensor, "outage": outage, "seed": seed, "error": error}
            for motion, scale in (("car", 1.0), ("ship", 10.0))
            for sensor, share in ((main.NONE, 1.0), ("odometer", 0.25))
            for outage in (30.0, 120.0)
            for seed, error in enumerate(scale * share * outage * np.array([0.5, 1.0, 9.0]))
        ]
    )
    table = main.worth_table(rows).set_index(["motion", "sensor"])
    assert table.loc[("ship", "odometer"), "120 s, m"] == 300.0
    assert table.loc[("car", main.NONE), "30 s, m"] == 30.0
    assert (table.xs("odometer", level="sensor").filter(like="over none") == 0.25).all(axis=None)
    assert main.figures(StudyTables(runs=rows)) == {"worst": 0.25}


def test_a_doppler_log_keeps_a_ship_and_hidden_fixes_are_hidden():
    rows = pd.DataFrame(sensors.rows("ship", [5])).set_index(["sensor", "outage"])["error"]
    assert rows["Doppler log", 120.0] < 0.1 * rows[main.NONE, 120.0]
    assert rows[main.NONE, 120.0] > 3 * rows[main.NONE, 30.0] > 3.0


def test_the_study_writes_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(main, "MOTIONS", {"car": sensors.MOTIONS["car"]})
    [claim] = main.reproduce(tmp_path, runs=1, workers=1)
    table = pd.read_csv(tmp_path / "worth.csv").set_index("sensor").filter(like="over none")
    assert claim["value"] == pytest.approx(table.drop(main.NONE).max(axis=None), rel=1e-5)
    assert "odometer, road vehicle" in (tmp_path / "table.md").read_text()
    assert mark("worth") in (DOCS / "sensor-worth.md").read_text(encoding="utf-8")
