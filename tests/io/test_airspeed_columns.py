"""Airspeeds in bare tables: names, units, and what `inspect --write` drafts of them."""

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.io.inspection import draft

pytestmark = pytest.mark.short


@pytest.fixture(scope="module")
def flight():
    return sd.simulate("demo", 20.0, "tactical", 1, rate=20.0)


def table(recording, tmp_path, **columns):
    """The paths of a table of the IMU with more columns and of its fixes."""
    imu = recording.imu
    rates = np.c_[imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]]
    names = ["t_s", *(f"g{a}_rad_s" for a in "xyz"), *(f"a{a}_m_s2" for a in "xyz")]
    frame = pd.DataFrame(np.c_[imu.t, rates], columns=names).assign(**columns)
    frame.to_csv(tmp_path / "imu.csv", index=False)
    position = recording.sources[0]
    fixes = np.c_[position.t, np.degrees(position.y[:, :2]), position.y[:, 2]]
    named = pd.DataFrame(fixes, columns=["t_s", "lat", "lon", "height"])
    named.to_csv(tmp_path / "gnss.csv", index=False)
    return [tmp_path / "imu.csv", tmp_path / "gnss.csv"]


@pytest.mark.parametrize(
    "name, factor, kind",
    [
        ("airspeed", 1.0, "indicated-airspeed"),
        ("ias_kt", 0.514444, "indicated-airspeed"),
        ("Airspeed [km/h]", 1 / 3.6, "indicated-airspeed"),
        ("true_airspeed_m_s", 1.0, "true-airspeed"),
        ("TAS", 1.0, "true-airspeed"),
    ],
)
def test_an_airspeed_is_read_and_drafted_in_its_unit(flight, tmp_path, name, factor, kind):
    measured = np.linspace(15.0, 30.0, len(flight.imu.t))
    paths = table(flight, tmp_path, **{name: measured / factor})
    (tmp_path / "recording.toml").write_text(draft(paths, {}, tmp_path))
    for recording in (sd.read(*paths), sd.read(tmp_path / "recording.toml")):
        (source,) = (a for a in recording.sources if "airspeed" in a.kind)
        assert source.kind == kind
        np.testing.assert_allclose(source.y[:, 0], measured, rtol=1e-5)
        # 20 rows a second have the weight of 5
        np.testing.assert_allclose(source.std, 2.8, rtol=0.02)


def test_one_airspeed_of_a_table_is_taken(flight, tmp_path):
    """The true one, and no speed over ground is one."""
    some = np.full(len(flight.imu.t), 20.0)
    paths = table(flight, tmp_path, ias=some, tas=some + 1, ground_speed=some)
    (source,) = (a for a in sd.read(*paths).sources if "airspeed" in a.kind)
    assert source.kind == "true-airspeed" and (source.y == 21).all()
    speed = table(flight, tmp_path, ground_speed=some)
    assert all("airspeed" not in a.kind for a in sd.read(*speed).sources)
