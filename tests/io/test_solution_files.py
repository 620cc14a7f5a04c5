"""Solutions written and read back: what each format keeps, atomic writing, refusals in one line."""

import json
import os
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import h5netcdf
import numpy as np
import pandas as pd
import pytest
from structured_mutators import sealed
from synthetic import DOUBTFUL, TRUSTED, WRONG, flight, solution

from strapdown.checks import DataError
from strapdown.data.solution import UNITS, Separation
from strapdown.data.verdict import NOT_JUDGED
from strapdown.io.solution import read_solution, write_solution

pytestmark = pytest.mark.short
DATED = {"epoch": "2012-10-10T12:00:00Z"}
KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(scope="module")
def made():
    made = solution(flight(30, rate=5.0), start={"t": np.float64(0.0), "std": (1.0, np.inf)})
    unclaimed = np.r_[np.ones(14), np.nan]  # a state of which the filter claims nothing
    path = made.trajectory
    return replace(
        made,
        trajectory=replace(path, std=path.std * unclaimed),
        columns={"heave [m]": np.arange(150.0)},
        covariance=np.random.default_rng(1).random((150, 15, 15)),
    )


def same_state(a, b, angle=0.0):
    assert np.allclose(a.t, b.t, rtol=0, atol=1e-9)
    assert np.allclose(
        a.trajectory.lla,
        b.trajectory.lla,
        rtol=1e-15,
        atol=[2e-12, 2e-12, 1e-10] if angle else 1e-15,
    )
    for left, right in (
        (a.trajectory.v_n, b.trajectory.v_n),
        (a.trajectory.std, b.trajectory.std),
        (a.b_a, b.b_a),
        (a.b_g, b.b_g),
    ):
        assert np.allclose(left, right, rtol=1e-14, atol=1e-10 if angle else 0, equal_nan=True)
    assert (a.trajectory.rotation * b.trajectory.rotation.inv()).magnitude().max() <= angle
    assert np.array_equal(a.status, b.status)


def test_netcdf_holds_everything(made, tmp_path):
    write_solution(made, tmp_path / "a.nc")
    back = read_solution(tmp_path / "a.nc")
    same_state(made, back)
    for name in ("t", "source", "innovation", "nis", "accepted"):
        assert np.array_equal(
            getattr(made.innovations, name), getattr(back.innovations, name), equal_nan=True
        ), name
    assert (back.innovations.names, back.innovations.gates, back.events) == (
        made.innovations.names,
        made.innovations.gates,
        made.events,
    )
    assert np.array_equal(back.covariance, made.covariance) and np.array_equal(
        back.columns["heave [m]"], made.columns["heave [m]"]
    )
    assert back.meta["notes"] == made.meta["notes"] and back.meta["start"] == {
        "t": 0.0,
        "std": [1.0, np.inf],
    }
    assert back.counts() == made.counts()


def test_netcdf_holds_the_separation_of_a_smoother(made, tmp_path):
    parts = np.random.default_rng(2).random((2, 150, 3)).astype(np.float32)
    parts[:, 7] = np.nan
    write_solution(replace(made, separation=Separation(*parts)), tmp_path / "a.nc")
    back = read_solution(tmp_path / "a.nc").separation
    assert np.array_equal(back, parts, equal_nan=True)
    write_solution(made, tmp_path / "b.nc")
    assert read_solution(tmp_path / "b.nc").separation is None
    with h5netcdf.File(tmp_path / "b.nc", "a") as file:
        file.dimensions["part"] = 3
        file.create_variable("separation", ("time", "part"), data=parts[0])
    (tmp_path / "b.nc").write_bytes(sealed((tmp_path / "b.nc").read_bytes()))
    with pytest.raises(DataError, match="separation and separation_std belong together"):
        read_solution(tmp_path / "b.nc")


def test_netcdf_says_its_units_to_any_reader(made, tmp_path):
    import h5netcdf

    write_solution(made, tmp_path / "a.nc")
    with h5netcdf.File(tmp_path / "a.nc") as file:
        assert all(
            "units" in file[name].attrs or "long_name" in file[name].attrs
            for name in file.variables
        )
        assert file["lat"].attrs["units"] == "degrees_north" and file["lat"][0] == pytest.approx(
            np.degrees(made.trajectory.lla[0, 0]), abs=1e-12
        )


def test_netcdf_takes_texts_beyond_the_limit_of_attributes(made, tmp_path):
    many = replace(
        made,
        events=tuple((float(i), "a text of some length " * 5) for i in range(2000)),
        covariance=None,
    )
    write_solution(many, tmp_path / "a.nc")
    assert read_solution(tmp_path / "a.nc").events == many.events


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "csv.xz"])
def test_csv_holds_the_table(made, tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    write_solution(made, path)
    back = read_solution(path)
    same_state(made, back, angle=1e-7)
    assert np.allclose(back.columns["heave [m]"], made.columns["heave [m]"])
    assert len(back.innovations.t) == 0 and "without innovations" in back.meta["notes"][0]


def test_a_solution_without_fixes_goes_through_both_formats(made, tmp_path):
    write_solution(made, tmp_path / "a.csv")
    write_solution(read_solution(tmp_path / "a.csv"), tmp_path / "b.nc")
    back = read_solution(tmp_path / "b.nc")
    same_state(made, back, angle=1e-7)
    assert (
        back.innovations.innovation.shape == (0, 3)
        and back.counts() == {}
        and back.covariance is None
    )


def test_csv_header_has_a_name_and_a_unit_per_column(made, tmp_path):
    write_solution(made, tmp_path / "a.csv")
    columns = list(pd.read_csv(tmp_path / "a.csv").columns)
    assert columns[:4] == ["t [s]", "lat [deg]", "lon [deg]", "alt [m]"] and columns[-2:] == [
        "heave [m]",
        "status",
    ]
    assert set(columns[:-2]) == {f"{name} [{unit}]" for name, unit in UNITS.items()}


def test_large_times_keep_their_fractions(made, tmp_path):
    late = replace(made, trajectory=replace(made.trajectory, t=made.t + 1.7e9))
    for ending in ("csv", "nc"):
        write_solution(late, tmp_path / f"a.{ending}")
        assert np.abs(read_solution(tmp_path / f"a.{ending}").t - late.t).max() < 1e-6


def test_kml_is_well_formed_and_says_which_height_it_means(made, tmp_path):
    named = replace(made, meta={**made.meta, "recording": "a <b> & \x00c", **DATED})
    write_solution(named, tmp_path / "a.kml")
    document = ElementTree.parse(tmp_path / "a.kml").getroot().find(f"{KML}Document")
    assert document.find(f"{KML}name").text == "a <b> & ?c closed-loop"
    assert (
        "ellipsoid" in document.find(f"{KML}description").text
        and "mean sea level" in document.find(f"{KML}description").text
    )
    line = document.find(f".//{KML}LineString")
    assert line.find(f"{KML}altitudeMode").text == "absolute"
    track = np.array(
        [
            [float(value) for value in point.split(",")]
            for point in line.find(f"{KML}coordinates").text.split()
        ]
    )
    assert np.allclose(
        track,
        np.c_[np.degrees(made.trajectory.lla[:, [1, 0]]), made.trajectory.lla[:, 2]],
        atol=1e-3,
    )
    stamps = [element.text for element in document.iter(f"{KML}when")]
    assert (
        stamps[0] == "2012-10-10T12:00:00.000Z"
        and stamps[-1] == "2012-10-10T12:00:29.800Z"
        and len(stamps) == 150
    )


def test_kml_of_a_long_run_is_thinned_and_cut_at_the_antimeridian(tmp_path):
    truth = flight(1500, rate=20.0, lon=179.9985)
    write_solution(solution(truth), tmp_path / "a.kml")
    root = ElementTree.parse(tmp_path / "a.kml").getroot()
    lines = [
        np.array([float(point.split(",")[0]) for point in element.text.split()])
        for element in root.iter(f"{KML}coordinates")
    ][:-500]
    assert len(lines) > 2 and all(np.abs(np.diff(line)).max(initial=0) < 1 for line in lines)
    assert sum(map(len, lines)) <= 10000 and len(list(root.iter(f"{KML}Point"))) <= 500


def test_kml_without_an_absolute_clock_has_no_stamps_and_says_so(made, tmp_path):
    write_solution(replace(made, meta={**made.meta, "date": "2012-10-10"}), tmp_path / "a.kml")
    root = ElementTree.parse(tmp_path / "a.kml").getroot()
    assert not list(root.iter(f"{KML}when"))
    assert "no time stamps" in root.find(f"{KML}Document/{KML}description").text


REFUSED = {
    "missing": (None, "no such file"),
    "empty.csv": (b"", "is empty"),
    "text.nc": (b"not netcdf", "is not a whole NetCDF solution"),
    "no_column.csv": (b"t [s],lat [deg]\n0,1\n", "column 'lon [deg]' is missing"),
    "wrong_unit.csv": (b"t [s],lat [rad]\n0,1\n", "is in 'rad'"),
    "cut.csv.gz": (b"\x1f\x8b\x08\x00", "damaged"),
    "cut.csv.xz": (b"\xfd7zXZ\x00\x00\x04\xe6", "damaged"),
    "a.kml": (b"", "use .nc"),
    "a.txt": (b"", "use .nc"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_solution_is_refused_in_one_line(name, tmp_path):
    content, reason = REFUSED[name]
    path = tmp_path / (name if content is not None else "missing.nc")
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError, match=".") as refusal:
        read_solution(path)
    assert (
        reason in str(refusal.value)
        and str(path) in str(refusal.value)
        and "\n" not in str(refusal.value)
    )


def test_damaged_files_are_refused(made, tmp_path):
    for ending in ("nc", "csv.gz", "csv.xz"):
        path = tmp_path / f"a.{ending}"
        write_solution(made, path)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(DataError, match="damaged|not a solution"):
            read_solution(path)


def test_a_cell_that_is_no_number_is_named_by_row_and_column(made, tmp_path):
    path = tmp_path / "a.csv"
    write_solution(made, path)
    lines = path.read_text().splitlines()
    lines[7] = lines[7].replace(lines[7].split(",")[1], "x7", 1)
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"line 8, column 'lat \[deg\]': 'x7' is not a number"):
        read_solution(path)


def test_another_netcdf_is_refused(tmp_path):
    import xarray as xr

    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(DataError, match="is not a solution"):
        read_solution(tmp_path / "a.nc")


@pytest.mark.parametrize("ending", ["nc", "csv", "kml"])
def test_an_unwritable_path_is_refused_in_one_line(made, tmp_path, ending):
    (tmp_path / "file").write_text("")
    (tmp_path / f"folder.{ending}").mkdir()
    for path in (
        tmp_path / "absent" / f"a.{ending}",
        tmp_path / "file" / f"a.{ending}",
        tmp_path / f"folder.{ending}",
    ):
        with pytest.raises(DataError, match="cannot be written") as refusal:
            write_solution(made, path)
        assert "\n" not in str(refusal.value)
    assert sorted(os.listdir(tmp_path)) == ["file", f"folder.{ending}"]


@pytest.mark.skipif(os.name != "posix", reason="limits of file size are POSIX")
@pytest.mark.parametrize("ending", ["nc", "csv.xz", "csv", "kml"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    path.write_text("old")
    program = textwrap.dedent(f"""
        import resource, signal, sys
        sys.path.insert(0, {str(Path(__file__).parents[1] / "support")!r})
        from synthetic import DOUBTFUL, TRUSTED, WRONG, flight, solution
        from strapdown.checks import DataError
        from strapdown.io.solution import write_solution
        made = solution(flight(60, rate=20.0))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000))
        try:
            write_solution(made, {str(path)!r})
        except DataError as error:
            print(error)
    """)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120
    )
    assert "cannot be written" in done.stdout and done.stdout.count("\n") == 1, done.stderr
    assert os.listdir(tmp_path) == [path.name] and path.read_text() == "old"


def test_new_files_have_ordinary_permissions(made, tmp_path):
    write_solution(made, tmp_path / "a.kml")
    umask = os.umask(0)
    os.umask(umask)
    assert (tmp_path / "a.kml").stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize("name", ["a.nc", "a.csv"])
@pytest.mark.parametrize("unknown", [["q_nb"], ["q_nb", "v_n"]])
def test_what_a_solution_does_not_know_is_left_out(made, tmp_path, name, unknown):
    bare = replace(made, trajectory=replace(made.trajectory, **dict.fromkeys(unknown)))
    write_solution(bare, tmp_path / name)
    back = read_solution(tmp_path / name).trajectory
    assert back.q_nb is None and np.allclose(back.lla, made.trajectory.lla, rtol=0, atol=1e-9)
    assert np.isnan(back.v_n).all() == ("v_n" in unknown)


def judged(made, verdict):
    return replace(made, meta=made.meta | {"verdict": verdict.as_dict()})


@pytest.mark.parametrize("ending", ["nc", "csv", "csv.gz", "csv.xz"])
@pytest.mark.parametrize("verdict", [TRUSTED, WRONG], ids=lambda verdict: verdict.word)
def test_the_verdict_comes_back_from_every_file(made, tmp_path, ending, verdict):
    path = tmp_path / f"a.{ending}"
    write_solution(judged(made, verdict), path)
    back = read_solution(path)
    assert back.verdict == verdict
    write_solution(back, path)
    assert read_solution(path).verdict == verdict


def test_a_verdict_is_read_without_strapdown(made, tmp_path):
    for ending in ("nc", "csv"):
        write_solution(judged(made, DOUBTFUL), tmp_path / f"a.{ending}")
    with h5netcdf.File(tmp_path / "a.nc", "r") as file:
        assert file.attrs["verdict"] == "doubtful"
        said = json.loads(file["verdict"][...].item())
    assert said["reasons"][0]["cause"] == "imu noise" and said["untested"]
    first = (tmp_path / "a.csv").read_text().splitlines()[0]
    assert first.startswith("# verdict: doubtful {") and json.loads(first[20:]) == said | {
        "rows": 150
    }
    table = pd.read_csv(tmp_path / "a.csv", comment="#")
    assert table.columns[0] == "t [s]" and len(table) == len(made.t)


@pytest.mark.parametrize("ending", ["nc", "csv"])
def test_a_file_without_a_verdict_is_not_judged_and_stays_so(made, tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    write_solution(made, path)
    back = read_solution(path)
    assert back.verdict.word == NOT_JUDGED and not back.verdict.trusted
    assert "fuse the recording again" in back.verdict.line and "verdict" not in back.meta
    assert b"verdict" not in path.read_bytes()


@pytest.mark.parametrize("line", ["nonsense", "good {}", "good {]", 'good {"word": "good"}'])
def test_a_damaged_verdict_is_refused_in_one_line(made, tmp_path, line):
    write_solution(made, tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text()
    (tmp_path / "a.csv").write_text(f"# verdict: {line}\n{text}")
    with pytest.raises(DataError, match="line 1: .* it is damaged") as refused:
        read_solution(tmp_path / "a.csv")
    assert "\n" not in str(refused.value)


def test_kml_says_the_verdict(made, tmp_path):
    write_solution(judged(made, WRONG), tmp_path / "a.kml")
    document = ElementTree.parse(tmp_path / "a.kml").getroot()[0]
    assert document[0].text.endswith("(not to be trusted)")
    assert document[1].text.startswith("Verdict: not to be trusted: axes of the IMU: the course")
    write_solution(judged(made, TRUSTED), tmp_path / "a.kml")
    document = ElementTree.parse(tmp_path / "a.kml").getroot()[0]
    assert "(" not in document[0].text and "Verdict: trusted" in document[1].text
