"""Times and places of the files of a solution, as other packages read them."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pymap3d
import pyproj
import pytest
from scipy.spatial.transform import Rotation
from synthetic import flight, solution

from strapdown.checks import DataError
from strapdown.io.solution import read_origin, read_solution, write_solution
from strapdown.io.solutions.number_text import lines

pytestmark = pytest.mark.short
EPOCH = "2024-05-01T00:00:00Z"
NOON = 43200.0


@pytest.fixture(scope="module")
def made():
    """30 s from noon on, of an absolute clock."""
    truth = flight(30, rate=5.0)
    dated = solution(replace(truth, t=truth.t + NOON), recording="flight")
    return replace(dated, meta={**dated.meta, "epoch": EPOCH})


@pytest.fixture(scope="module")
def undated(made):
    return replace(made, meta={key: made.meta[key] for key in made.meta if key != "epoch"})


def utc(k=0):
    return np.datetime64("2024-05-01T12:00:00", "ns") + np.timedelta64(200, "ms") * k


def test_utc_of_a_solution(made, undated):
    assert undated.utc is None
    assert made.utc.dtype == "M8[ns]" and made.utc[0] == utc()
    assert np.abs(made.utc - utc(np.arange(150))).max() <= np.timedelta64(1, "us")


@pytest.mark.parametrize("epoch", [EPOCH, "1980-01-06T00:00:00Z", "2024-05-01T00:00:00.123456Z"])
def test_xarray_shows_dates(made, tmp_path, epoch):
    """Also where leap seconds lie between the epoch and the first row."""
    import xarray as xr

    shift = pd.Timestamp(EPOCH).timestamp() - pd.Timestamp(epoch).timestamp()
    shift += 18 if epoch.startswith("1980") else 0
    late = replace(made, trajectory=replace(made.trajectory, t=made.t + shift))
    late = replace(late, meta=late.meta | {"epoch": epoch})
    write_solution(late, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as found:
        assert found.time.dtype.kind == "M" and found.fix_time.dtype.kind == "M"
        off = found.time.values - utc(np.arange(150))
        assert np.abs(off).max() <= np.timedelta64(2, "us")
        assert found.sel(time="2024-05-01T12:00:10").time.size >= 1
        np.testing.assert_allclose(found.lat, np.degrees(made.trajectory.lla[:, 0]), rtol=1e-15)
        assert found.attrs["Conventions"].startswith("CF-1.")
    back = read_solution(tmp_path / "a.nc")
    assert np.array_equal(back.t, late.t) and back.meta["epoch"] == epoch
    assert np.array_equal(back.utc, late.utc)


def test_without_an_absolute_clock_times_are_seconds(undated, tmp_path):
    import h5netcdf

    write_solution(undated, tmp_path / "a.nc")
    with h5netcdf.File(tmp_path / "a.nc") as file:
        assert file["time"].attrs["units"] == "s" and "calendar" not in file["time"].attrs
    assert "epoch" not in read_solution(tmp_path / "a.nc").meta


UDUNITS = set("1 s m degrees_north degrees_east degree m/s m/s^2 degree/hour".split())
"""Of udunits2-base.xml, -derived.xml and -accepted.xml, with its operators."""


def test_units_are_those_of_udunits(made, tmp_path):
    import h5netcdf

    extra = replace(
        made, columns={"heave [m]": made.t, "count": made.t}, covariance=np.ones((150, 2, 2))
    )
    write_solution(extra, tmp_path / "a.nc")
    with h5netcdf.File(tmp_path / "a.nc") as file:
        units = {name: file[name].attrs.get("units") for name in file.variables}
        names = {file[name].attrs.get("standard_name") for name in file.variables}
    dates = {units.pop("time"), units.pop("fix_time")}
    assert dates == {"seconds since 2024-05-01 00:00:00"}
    assert set(filter(None, units.values())) <= UDUNITS and units["extra_0"] == "m"
    assert {"time", "latitude", "longitude", "height_above_reference_ellipsoid"} <= names


def test_csv_with_a_column_of_utc(made, undated, tmp_path):
    for name in ("a.csv", "a.csv.gz"):
        write_solution(made, tmp_path / name, utc=True)
        table = pd.read_csv(tmp_path / name, parse_dates=["utc"])
        assert list(table.columns[:3]) == ["t [s]", "utc", "lat [deg]"]
        off = table.utc.dt.tz_localize(None).to_numpy() - utc(np.arange(150))
        assert np.abs(off).max() <= np.timedelta64(1, "us")
        back = read_solution(tmp_path / name)
        assert back.meta["epoch"] == EPOCH and "utc" not in back.columns
    with pytest.raises(DataError, match="no absolute clock"):
        write_solution(undated, tmp_path / "b.csv", utc=True)


def test_gpx_as_gpxpy_reads_it(made, undated, tmp_path):
    import gpxpy

    lla = made.trajectory.lla.copy()
    lla[70:80] = np.nan
    write_solution(replace(made, trajectory=replace(made.trajectory, lla=lla)), tmp_path / "a.gpx")
    found = gpxpy.parse((tmp_path / "a.gpx").read_text())
    segments = found.tracks[0].segments
    assert [len(each.points) for each in segments] == [70, 70] and found.version == "1.1"
    points = [point for each in segments for point in each.points]
    read = np.array(
        [[np.radians(p.latitude), np.radians(p.longitude), p.elevation] for p in points]
    )
    assert np.abs(read - lla[np.isfinite(lla[:, 0])]).max(axis=0) == pytest.approx(0, abs=6e-4)
    assert np.abs(read - lla[np.isfinite(lla[:, 0])])[:, :2].max() < 2e-11
    stamp = points[1].time
    assert stamp.isoformat() == "2024-05-01T12:00:00.200000+00:00"
    write_solution(undated, tmp_path / "b.gpx")
    text = (tmp_path / "b.gpx").read_text()
    assert "<time>" not in text and "no time stamps" in gpxpy.parse(text).description


@pytest.mark.parametrize("lon", [8.0, 179.9985])
def test_geojson_keeps_to_its_rfc(tmp_path, lon):
    truth = flight(120, rate=5.0, lon=lon)
    made = solution(truth)
    made = replace(made, meta=made.meta | {"epoch": EPOCH})
    write_solution(made, tmp_path / "a.geojson")
    import geojson

    text = (tmp_path / "a.geojson").read_text()
    assert geojson.loads(text).is_valid
    found = json.loads(text)
    assert found["type"] == "FeatureCollection" and "crs" not in found
    (feature,) = found["features"]
    assert feature["type"] == "Feature" and set(feature) == {"type", "geometry", "properties"}
    kind, lines = feature["geometry"]["type"], feature["geometry"]["coordinates"]
    stamps, times = (feature["properties"][key] for key in ("coordTimes", "t"))
    assert kind == ("LineString" if lon < 9 else "MultiLineString")
    if kind == "LineString":
        lines, stamps, times = [lines], [stamps], [times]
    for line in map(np.array, lines):
        assert len(line) >= 2 and line.shape[1] == 3 and (np.abs(line[:, 0]) <= 180).all()
        assert np.abs(np.diff(line[:, 0])).max() < 1  # 3.1.9: no part crosses the antimeridian
    assert [len(each) for each in stamps] == [len(each) for each in lines]
    flat = np.array([point for line in lines for point in line])
    expected = np.c_[np.degrees(made.trajectory.lla[:, [1, 0]]), made.trajectory.lla[:, 2]]
    assert sum(map(len, times)) == len(flat) >= len(expected)
    if lon < 9:
        np.testing.assert_allclose(flat, expected, rtol=0, atol=6e-4)
        assert stamps[0][5] == "2024-05-01T00:00:01.000Z"


@pytest.mark.parametrize("dated", [True, False])
def test_tum_as_evo_reads_it(made, undated, tmp_path, dated):
    """Places by pymap3d, attitudes by pyproj's idea of ECEF: both know nothing of this package."""
    from evo.tools import file_interface

    chosen = made if dated else undated
    write_solution(chosen, tmp_path / "a.tum")
    found = file_interface.read_tum_trajectory_file(str(tmp_path / "a.tum"))
    assert found.check()[0]
    start = (utc() - np.datetime64("1970-01-01")) / np.timedelta64(1, "s") if dated else NOON
    np.testing.assert_allclose(found.timestamps, start + 0.2 * np.arange(150), rtol=0, atol=1e-6)
    lat, lon, alt = (
        np.degrees(chosen.trajectory.lla[:, 0]),
        np.degrees(chosen.trajectory.lla[:, 1]),
        chosen.trajectory.lla[:, 2],
    )
    enu = np.column_stack(pymap3d.geodetic2enu(lat, lon, alt, lat[0], lon[0], alt[0]))
    np.testing.assert_allclose(found.positions_xyz, enu, rtol=0, atol=2e-6)

    # where the nose points: one metre ahead, by ECEF of a point 1 m along each body axis
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    row = 140
    place = np.array(to_ecef.transform(lon[row], lat[row], alt[row]))
    step = 1e-5
    east = np.array(to_ecef.transform(lon[row] + step, lat[row], alt[row])) - place
    north = np.array(to_ecef.transform(lon[row], lat[row] + step, alt[row])) - place
    up = np.array(to_ecef.transform(lon[row], lat[row], alt[row] + 1)) - place
    ned = np.column_stack([north / np.linalg.norm(north), east / np.linalg.norm(east), -up])
    q = chosen.trajectory.q_nb[row]
    ahead = ned @ Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix()[:, 0]
    moved = pymap3d.ecef2enu(*(place + ahead), lat[0], lon[0], alt[0])
    read = Rotation.from_quat(found.orientations_quat_wxyz[row][[1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(read[:, 0], np.array(moved) - enu[row], rtol=0, atol=1e-6)
    assert read[2, 2] > 0.9  # its third axis is up


def test_tum_needs_an_attitude(made, tmp_path):
    bare = replace(made, trajectory=replace(made.trajectory, q_nb=None))
    with pytest.raises(DataError, match="TUM needs an attitude"):
        write_solution(bare, tmp_path / "a.tum")


def test_numbers_as_python_writes_them():
    rng = np.random.default_rng(2)
    values = rng.standard_normal(6000) * 10.0 ** rng.uniform(-12, 20, 6000)
    values[::7] = np.round(values[::7], 3)
    odd = [0.0, -0.0, 1.0, -1.0, 0.1, 5e-11, -1e-12, 1e-4, 99999.99999999999, 1e5, 1e16, 1e300]
    values = np.r_[values, odd, np.inf, -np.inf, np.nan]
    small, whole = values[np.abs(values) < 1e4], rng.integers(-(2**40), 2**40, len(values))
    text = lines([values, whole, np.arange(len(values), dtype=np.int8) % 4]).decode().splitlines()
    large = np.abs(values) > 1e16  # whole numbers
    rounded = np.where(large, values, np.round(np.where(large, 0, values), 10)).tolist()
    expected = ["" if each != each else repr(each) for each in rounded]
    rest = (f"{a},{b}" for a, b in zip(whole, np.arange(len(values)) % 4))
    assert text == [f"{a},{b}" for a, b in zip(expected, rest)]
    assert lines([small]).decode().split() == [repr(each) for each in np.round(small, 10).tolist()]
    assert lines([np.array([np.nan]), np.array([1.5])]) == b",1.5\n"


def test_tum_from_a_stated_origin(made, tmp_path):
    """By pymap3d: places from the origin, and attitudes in its axes; two files share the frame."""
    origin = np.radians(47.63), np.radians(9.35), 400.0
    made.save(tmp_path / "a.tum", origin=origin)
    assert read_origin(tmp_path / "a.tum") == pytest.approx(origin, rel=0, abs=1e-12)
    rows = np.loadtxt(tmp_path / "a.tum")
    lat, lon = np.degrees(made.trajectory.lla[:, :2]).T
    enu = pymap3d.geodetic2enu(lat, lon, made.trajectory.lla[:, 2], 47.63, 9.35, 400.0)
    np.testing.assert_allclose(rows[:, 1:4], np.column_stack(enu), rtol=0, atol=2e-6)
    made.save(tmp_path / "own.tum")
    own = read_origin(tmp_path / "own.tum")
    np.testing.assert_allclose(own, made.trajectory.lla[0], rtol=0, atol=1e-6)
    made.save(tmp_path / "again.tum", origin=own)
    np.testing.assert_allclose(
        np.loadtxt(tmp_path / "again.tum"), np.loadtxt(tmp_path / "own.tum"), rtol=0, atol=2e-6
    )
    turn = Rotation.from_quat(np.loadtxt(tmp_path / "own.tum")[:, 4:]).inv() * Rotation.from_quat(
        rows[:, 4:]
    )
    assert np.ptp(turn.magnitude()) < 1e-6 < turn.magnitude()[0]  # one turn between the two frames


@pytest.mark.parametrize(
    ("name", "origin", "said"),
    [
        ("a.kml", (0.8, 0.1, 0.0), "origin: positions in .kml are geodetic; leave origin out, or"),
        ("a.csv", (0.8, 0.1, 0.0), "origin: positions in .csv are geodetic"),
        (
            "a.tum",
            (47.6, 9.3, 400.0),
            "the limit of the latitude is 1.571 rad .90 deg.: is it in deg",
        ),
        ("a.tum", (0.8, 0.1), "origin"),
        ("a.tum", (0.8, np.nan, 0.0), "origin"),
        ("a.tum", "here", "origin"),
    ],
)
def test_an_origin_that_fits_no_file_is_refused_in_a_line(made, tmp_path, name, origin, said):
    with pytest.raises(DataError, match=f"{name}: .*{said}") as refused:
        write_solution(made, tmp_path / name, origin=origin)
    assert "\n" not in str(refused.value) and not list(tmp_path.iterdir())


def test_the_origin_of_other_files_is_refused_in_a_line(tmp_path):
    (tmp_path / "other.tum").write_text("0.0 0 0 0 0 0 0 1\n")
    with pytest.raises(DataError, match="other.tum: no line has its origin"):
        read_origin(tmp_path / "other.tum")
    with pytest.raises(DataError, match="none.tum: cannot be read"):
        read_origin(tmp_path / "none.tum")
