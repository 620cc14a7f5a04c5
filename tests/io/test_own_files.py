"""Files that strapdown writes and reads again: a changed bit is noticed, and what contradicts their
format is one line that names the field."""

import json

import h5py
import numpy as np
import pytest
from synthetic import DOUBTFUL, flight, solution

import strapdown as sd
from strapdown.checks import DataError
from strapdown.experiments.monte_carlo.campaign import Campaign, describe
from strapdown.experiments.monte_carlo.study import Study
from strapdown.fileio.checksum import LENGTH, has_checksum
from strapdown.io.solution import read_solution, write_solution


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A recording and a solution as NetCDF."""
    folder = tmp_path_factory.mktemp("own")
    sd.write_recording(sd.simulate("static", duration=4, rate=20.0), folder / "recording.nc")
    write_solution(solution(flight(10, rate=5.0)), folder / "solution.nc")
    return folder


READ = {"recording.nc": sd.read, "solution.nc": read_solution}


@pytest.mark.parametrize("name", READ)
def test_any_changed_bit_is_noticed(made, tmp_path, name):
    whole, rng = (made / name).read_bytes(), np.random.default_rng(1)
    assert has_checksum(made / name)
    for at in rng.integers(len(whole), size=60):
        bent = bytearray(whole)
        bent[at] ^= 1 << int(rng.integers(8))
        (tmp_path / name).write_bytes(bent)
        with pytest.raises(DataError, match="damaged|take") as refused:
            READ[name](tmp_path / name)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", READ)
def test_a_file_that_lost_its_checksum_is_noticed(made, tmp_path, name):
    (tmp_path / name).write_bytes((made / name).read_bytes()[:-LENGTH])
    with pytest.raises(DataError, match="the line with its checksum is missing"):
        READ[name](tmp_path / name)


def test_other_readers_of_netcdf_pass_over_the_checksum(made):
    import xarray as xr

    with xr.open_dataset(made / "solution.nc", engine="h5netcdf") as found:
        assert len(found["lat"]) == 50


def edited(whole, path, edit):
    """A file with something changed in it by another tool, which took the checksum out."""
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        del file.attrs["checksum"]
        edit(file)


@pytest.mark.parametrize("name", READ)
def test_a_file_of_another_version_says_so_and_how_to_make_it_again(made, tmp_path, name):
    what = name.removesuffix(".nc")

    def other(file):
        file.attrs["format"] = f"strapdown {what} 2"

    edited(made / name, tmp_path / name, other)
    with pytest.raises(DataError) as refused:
        READ[name](tmp_path / name)
    again = {
        "recording": "read the original files, and write it again with write_recording",
        "solution": "fuse the recording again, and write its solution with write_solution",
    }
    assert str(refused.value) == (
        f"{tmp_path / name}: is a {what} of another version of strapdown (its format attribute is "
        f"'strapdown {what} 2', but this version reads 'strapdown {what} 1'); {again[what]}"
    )


def put(name, at, value):
    def edit(file):
        file[name][at] = value

    return edit


def remove(name):
    def edit(file):
        del file[name]

    return edit


def notify(name, key, value):
    def edit(file):
        file[name].attrs[key] = value

    return edit


def text(name, value):
    def edit(file):
        file[name][()] = value

    return edit


def link(file):
    file["source_3"] = h5py.ExternalLink("/etc/other.nc", "/")


def huge(file):
    del file["imu/t"]
    file.create_dataset("imu/t", (10**12,), "f8", chunks=(1000,))


RECORDING = {
    "imu: t must increase": put("imu/t", 5, 0.0),
    "imu: dt is 0 at": put("imu/dt", 5, 0.0),
    "imu: dv is nan at": put("imu/dv", (5, 1), np.nan),
    "imu: dtheta is missing": remove("imu/dtheta"),
    "imu: dv is in 'g'": notify("imu/dv", "units", "g"),
    "reference: q_nb has the norm": put("reference/q_nb", 7, [1.0, 1.0, 0.0, 0.0]),
    "source_1: std is -1 at": put("source_1/std", (3, 0), -1.0),
    "source_1: gate: input should be greater": notify("source_1", "gate", -1.0),
    "source_1: no aiding is of kind": notify("source_1", "kind", "nothing"),
    "source_1: name: string should have at most": notify("source_1", "name", "x" * 2000),
    "source_1: y is missing": remove("source_1/y"),
    "meta: is not JSON": text("meta", '{"name": '),
    "meta: input should be a valid dictionary": text("meta", "[]"),
    "meta: epoch: .* is no time": text("meta", '{"epoch": "yesterday"}'),
    "meta: notes: input should be a valid list": text("meta", '{"notes": "one"}'),
    "'source_3' is a link to another place or file": link,
    "has 8e.03 GB, and 64 GB are read at most": huge,
}


@pytest.mark.parametrize("words", RECORDING)
def test_a_recording_that_contradicts_its_format_is_refused(made, tmp_path, words):
    edited(made / "recording.nc", tmp_path / "a.nc", RECORDING[words])
    with pytest.raises(DataError, match=words) as refused:
        sd.read(tmp_path / "a.nc")
    assert "\n" not in str(refused.value) and "a.nc" in str(refused.value)


SOLUTION = {
    "time must increase": put("time", 3, 0.0),
    "lat is 91 at": put("lat", 3, 91.0),
    "std_VN is -1 at": put("std_VN", 3, -1.0),
    "status is 9 at": put("status", 3, 9),
    "quaternion has the norm": put("q_w", 3, 2.0),
    "q_x is missing": remove("q_x"),
    "roll is in 'rad'": notify("roll", "units", "rad"),
    "but a fix of source 5": put("fix_source", 17, 5),
    "gates: 0: input should be": text("gates", '["a", 1.0]'),
    "sources: input should be a valid list": text("sources", '{"a": 1}'),
    "events: 0": text("events", "[[1.0]]"),
    "meta: start.t": text("meta", '{"start": {"t": "now", "std": []}}'),
    "meta: is not JSON": text("meta", "[" * 100_000),
}


@pytest.mark.parametrize("words", SOLUTION)
def test_a_solution_that_contradicts_its_format_is_refused(made, tmp_path, words):
    edited(made / "solution.nc", tmp_path / "a.nc", SOLUTION[words])
    with pytest.raises(DataError, match=words) as refused:
        read_solution(tmp_path / "a.nc")
    assert "\n" not in str(refused.value) and "a.nc" in str(refused.value)


CSV = {
    "line 7: is not a row of a solution": lambda lines: [*lines[:6], "# note", *lines[6:]],
    "line 6: t .s. is 0, which is impossible": lambda lines: [
        *lines[:5],
        "0," + lines[5].partition(",")[2],
        *lines[6:],
    ],
    "has 40 rows, but its first line states 50": lambda lines: lines[:42],
    "line 52: status is nan": lambda lines: [*lines[:51], lines[51][: len(lines[51]) // 2]],
    "line 1: rows: ": lambda lines: [lines[0].replace('"rows": 50', '"rows": -1'), *lines[1:]],
}


@pytest.mark.parametrize("words", CSV)
def test_a_table_that_is_cut_or_damaged_is_refused_with_the_line(tmp_path, words):
    path, judged = tmp_path / "a.csv", solution(flight(10, rate=5.0))
    judged.meta["verdict"] = DOUBTFUL.as_dict()
    write_solution(judged, path)
    path.write_text("\n".join(CSV[words](path.read_text().splitlines())))
    with pytest.raises(DataError, match=words):
        read_solution(path)


MANIFEST = {
    "cells.0.name": lambda m: m["cells"][0].update(name="../../elsewhere"),
    "cells: list should have": lambda m: m.update(cells=[]),
    "filters.0: input should be a valid string": lambda m: m.update(filters=[1]),
    "runs: input should be a valid integer": lambda m: m.update(runs="many"),
    "limits.distance: field required": lambda m: m["limits"].pop("distance"),
    "versions: input should be a valid dictionary": lambda m: m.update(versions=None),
}


@pytest.mark.parametrize("words", MANIFEST)
def test_a_manifest_that_contradicts_its_format_is_refused(tmp_path, words):
    manifest = describe(Study(scenarios="static", filters=("closed-loop",), imus=("tactical",)))
    MANIFEST[words](manifest)
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(DataError, match=f"manifest.json: {words}"):
        Campaign.open(tmp_path)
