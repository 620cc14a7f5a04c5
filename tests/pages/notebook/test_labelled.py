"""Frames of pandas and arrays of xarray: names and units of CF, dates where the clock is absolute."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import BIAS_COLUMNS, NAV_COLUMNS, STD_COLUMNS
from strapdown.io.solutions.solution_netcdf import attributes
from strapdown.sim.trajectory import demo_flight

pytestmark = pytest.mark.short
EPOCH = {"epoch": "2024-05-01T12:00:00Z"}


@pytest.fixture(scope="module")
def recording():
    return sd.simulate(demo_flight(), 8.0, "tactical", seed=1, rate=50.0)


@pytest.fixture(scope="module")
def solution(recording):
    made = sd.fuse(recording, covariance=True)
    return replace(made, columns={"time held [s]": made.t * 0, "time held [m]": made.t})


def dated(made):
    return replace(made, meta=made.meta | EPOCH)


def test_a_frame_has_units_and_dates_where_the_clock_is_absolute(solution):
    frame = solution.to_pandas()
    assert frame.index.name == "t" and frame.attrs["units"]["lat"] == "degrees_north"
    assert frame.attrs["standard_names"]["alt"] == "height_above_reference_ellipsoid"
    assert frame.attrs["filter"] == "closed-loop"
    frame = dated(solution).to_pandas()
    assert str(frame.index[0]) == "2024-05-01 12:00:01.020000+00:00"
    assert (
        list(frame["t"]) == list(solution.t)
        and (frame["lat"] == solution.table()["lat"].values).all()
    )


def test_a_dataset_of_a_solution_is_as_its_file(solution, tmp_path):
    xarray = pytest.importorskip("xarray")
    made = dated(solution)
    sd.write_solution(made, tmp_path / "a.nc")
    ours = made.to_xarray()
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as theirs:
        for name in [*NAV_COLUMNS, *BIAS_COLUMNS, *STD_COLUMNS, "innovation", "covariance"]:
            assert np.array_equal(ours[name], theirs[name], equal_nan=True)
            assert ours[name].attrs == theirs[name].attrs
        off = np.abs(ours["time"].values - theirs["time"].values)
        assert off.max() <= np.timedelta64(1, "us")
    assert ours["lat"].attrs["ancillary_variables"] == "std_north"
    assert ours["std_north"].attrs == {
        "units": "m",
        "long_name": "standard deviation of position north",
    }
    assert ours["time_held"].attrs["units"] == "s" and ours["extra_1"].attrs["units"] == "m"
    assert ours["fix_source"].attrs["flag_meanings"] == "GNSS_position GNSS_velocity"
    assert ours.attrs["filter"] == "closed-loop" and ours.attrs["Conventions"].startswith("CF-")
    ends = np.array(["2024-05-01T12:00:03", "2024-05-01T12:00:04"], "M8[ns]")
    part = ours.sel(time=slice(*ends))
    assert part.sizes["time"] == len(solution.between(3, 4)) == 51


def test_a_dataset_without_a_clock_counts_seconds(solution):
    pytest.importorskip("xarray")
    made = solution.to_xarray()
    assert made["time"].dtype == float and made["time"].attrs["units"] == "s"
    assert made.sel(time=slice(3, 4)).sizes["time"] == 51


def test_every_column_has_a_long_name_and_its_standard_deviations():
    for name in NAV_COLUMNS + BIAS_COLUMNS:
        claims = attributes(name)["ancillary_variables"].split()
        assert attributes(name)["long_name"] and set(claims) <= set(STD_COLUMNS)
        assert len(claims) == (3 if name in ("roll", "pitch", "heading") else 1)


def test_the_frame_of_the_imu_is_what_from_frames_takes(recording):
    frame = recording.to_pandas()
    again = sd.Recording.from_frames(frame)
    assert np.allclose(again.imu.dtheta, recording.imu.dtheta, atol=1e-12)
    assert frame.attrs["units"]["gyro_x"] == "rad/s"
    assert dated(recording).to_pandas().index[0].isoformat() == "2024-05-01T12:00:00.020000+00:00"


@pytest.mark.parametrize("epoch", ["2024-05-01T12:00:00Z", "2016-12-31T23:59:50Z"])
def test_dates_go_and_come_back(recording, epoch):
    """Over a leap second too: POSIX dates show it twice, so there samples may be a second early."""
    frame = recording.with_meta(epoch=epoch).to_pandas()
    again = sd.Recording.from_frames(frame, epoch=epoch)
    before = again.imu.t < 9.0
    np.testing.assert_allclose(again.imu.t[before], recording.imu.t[before], atol=2e-6)
    own = sd.Recording.from_frames(frame)  # from the whole second of the first date
    assert own.meta["epoch"] == epoch and abs(own.imu.t[0] - recording.imu.t[0]) < 2e-6
    local = frame.tz_convert("Europe/Oslo")
    assert sd.Recording.from_frames(local, epoch=epoch).imu.t[0] == again.imu.t[0]
    naive = frame.tz_localize(None)
    assert sd.Recording.from_frames(naive).meta["epoch"] == epoch


def test_fixes_and_reference_are_frames_too(recording):
    frame = recording.to_pandas("GNSS position")
    assert list(frame.columns) == ["lat", "lon", "alt", "std_north", "std_east", "std_down"]
    assert np.allclose(frame["lat"], np.degrees(recording.sources[0].y[:, 0]))
    assert frame.attrs["units"]["std_north"] == "m" and frame.attrs["units"]["lat"] == "degree"
    reference = recording.to_pandas("reference")
    assert len(reference) == len(recording.reference) and "heading" in reference
    assert recording.reference.to_pandas().equals(recording.reference.table())
    with pytest.raises(DataError, match=r"part is 'GNSS positon' \(did you mean 'GNSS position'"):
        recording.to_pandas("GNSS positon")


def test_sources_of_one_name_and_of_few_components(recording):
    t = np.arange(1.0, 8.0)
    baro = sd.Source("altitude", t, np.full((7, 1), 900.0), np.ones((7, 1)), name="baro")
    field = sd.Source(
        "magnetic-field", t, np.full((7, 3), 3e-5), np.full((7, 3), 1e-6), name="baro"
    )
    made = replace(recording, sources=(baro, field))
    assert list(made.to_pandas("baro").columns) == ["alt", "std_altitude"]
    second = made.to_pandas("baro 2")
    assert second.attrs["units"]["magnetic_field_x"] == "uT"
    assert second["magnetic_field_x"].iloc[0] == pytest.approx(30.0)
    assert second["std_x"].iloc[0] == pytest.approx(1.0)


def test_a_dataset_of_a_recording_has_a_time_of_each_source(recording):
    pytest.importorskip("xarray")
    made = dated(recording).to_xarray()
    assert made.sizes == {
        "time": 400,
        "time_GNSS_position": 8,
        "time_GNSS_velocity": 8,
        "time_reference": 401,
    }
    assert made["GNSS_position_lat"].attrs["standard_name"] == "latitude"
    assert str(made["time_GNSS_position"].values[0]) == "2024-05-01T12:00:01.000000000"
    assert made["t_GNSS_position"].values[0] == 1.0
    alone = recording.reference.to_xarray()
    assert (
        set(NAV_COLUMNS) == set(alone.data_vars) and "ancillary_variables" not in alone["lat"].attrs
    )


@pytest.mark.parametrize("count", [0, 1])
def test_no_row_and_one_row(solution, count):
    pytest.importorskip("xarray")
    few = slice(0, count)
    made = replace(
        solution,
        trajectory=solution.trajectory.take(few),
        b_a=solution.b_a[few],
        b_g=solution.b_g[few],
        status=solution.status[few],
        columns={},
        covariance=None,
    )
    for each in (made, dated(made)):
        assert each.to_xarray().sizes["time"] == len(each.to_pandas()) == count


def test_without_xarray_the_remedy_is_told(solution, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(
        DataError, match=r'^to_xarray needs xarray: pip install "strapdown\[notebook\]"$'
    ):
        solution.to_xarray()
