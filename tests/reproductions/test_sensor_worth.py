"""Worth of sensors in an outage: the table by hand, the runs, and the page."""

import numpy as np
import pandas as pd
import pytest

from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.common.write_docs import DOCS, mark
from strapdown_reproductions.worth import main, own_states, sensors


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
    assert main.figures(StudyTables(runs=rows, states=nees_rows()))["worst"] == 0.25


def nees_rows():
    """Ten runs whose NEES is 2 at every other second, which is in the band of two states, and 0."""
    of = {"motion": "car", "states": own_states.OF_ALL, "dof": 2}
    seconds = [*range(20), *range(100, 110)]
    return pd.DataFrame(
        [of | {"seed": k, "t": float(t), "nees": 2.0 * (t % 2)} for k in range(10) for t in seconds]
    )


@pytest.mark.short
def test_the_share_in_the_band_leaves_out_what_has_not_settled():
    (row,) = own_states.nees_table(nees_rows()).to_dict("records")
    assert row["in_band_%"] == 50.0 and row["nees/dof"] == 0.5 and row["runs"] == 10
    names = ["wind north [m/s]", "wind east [m/s]", "hard iron right error of mag [uT]"]
    found = own_states.groups(names)
    assert found["wind"] == [15, 16] and found["hard iron of mag"] == [17]


@pytest.mark.short
def test_the_states_of_a_run_are_drawn_and_walk():
    sensor = own_states.MOTIONS["flight"].sensors[0]
    ends = np.array(
        [
            own_states.drawn_walk(sensor, 100.0, np.random.default_rng(k))(np.array([0.0, 100.0]))
            for k in range(400)
        ]
    )
    kind = sensor.measurement
    np.testing.assert_allclose(ends[:, 0].std(axis=0), kind.state_std, rtol=0.15)
    walked = (ends[:, 1] - ends[:, 0]).std(axis=0)
    np.testing.assert_allclose(walked, kind.state_walk * 10.0, rtol=0.15)


def test_own_states_are_as_sure_as_they_say():
    rows = pd.DataFrame(own_states.rows("flight", [6]))
    late = rows[rows["t"] >= own_states.SETTLED].groupby("states")["nees"].mean()
    assert 8.0 < late[own_states.OF_ALL] < 50.0 and late["wind"] < 10.0


def test_a_doppler_log_keeps_a_ship_and_hidden_fixes_are_hidden():
    rows = pd.DataFrame(sensors.rows("ship", [5])).set_index(["sensor", "outage"])["error"]
    assert rows["Doppler log", 120.0] < 0.1 * rows[main.NONE, 120.0]
    assert rows[main.NONE, 120.0] > 3 * rows[main.NONE, 30.0] > 3.0


def test_the_study_writes_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(main, "MOTIONS", {"car": sensors.MOTIONS["car"]})
    monkeypatch.setattr(own_states, "MOTIONS", {"car": own_states.MOTIONS["car"]})
    [claim] = main.reproduce(tmp_path, runs=1, workers=1)
    table = pd.read_csv(tmp_path / "worth.csv").set_index("sensor").filter(like="over none")
    assert claim["value"] == pytest.approx(table.drop(main.NONE).max(axis=None), rel=1e-5)
    assert "odometer, road vehicle" in (tmp_path / "table.md").read_text()
    assert mark("worth") in (DOCS / "sensor-worth.md").read_text(encoding="utf-8")
