"""Tables of MATLAB and Parquet files hold what was saved, and are read as recordings."""

import sys

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.tables.matlab_file import variables
from strapdown.io.tables.table_arrays import tables_of

pytestmark = pytest.mark.short
T = np.arange(0, 20, 0.01)
RANDOM = np.random.default_rng(1)
GYRO = RANDOM.normal(0, 0.01, (len(T), 3))
ACCEL = RANDOM.normal([0, 0, -9.8], 0.01, (len(T), 3))
FIXES = {
    "t": np.arange(0.0, 20.0),
    "lat": np.full(20, 48.0),
    "lon": np.full(20, 9.0),
    "alt": np.linspace(500.0, 510.0, 20),
}


def write_73(path, content):
    """Structs of a file of version 7.3: arrays transposed, a text before the HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, struct in content.items():
            for key, value in struct.items():
                file[f"{name}/{key}"] = np.atleast_2d(value) if np.ndim(value) == 1 else value.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


@pytest.mark.parametrize("write", [savemat, write_73])
def test_structs_are_tables(tmp_path, write):
    path = tmp_path / "log.mat"
    write(path, {"imu": {"time": T, "gyro": GYRO, "acc": ACCEL}, "gnss": FIXES})
    tables = tables_of(path)
    assert set(tables) == {"imu", "gnss"}
    for k in range(3):
        np.testing.assert_array_equal(tables["imu"].numbers(f"gyro_{k + 1}"), GYRO[:, k])
    np.testing.assert_array_equal(tables["gnss"].numbers("alt"), FIXES["alt"])
    recording = sd.read(path)
    assert len(recording.imu.t) == len(T) and len(recording.sources[0].t) == 20
    description = tmp_path / "recording.toml"
    description.write_text(
        '[imu]\nfile = "log.mat"\ntable = "imu"\ntime = { column = "time", unit = "s" }\n'
        'gyro = { columns = ["gyro_1", "gyro_2", "gyro_3"], unit = "rad/s" }\n'
        'accel = { columns = ["acc_1", "acc_2", "acc_3"], unit = "m/s^2" }\n'
    )
    np.testing.assert_array_equal(sd.read(description).imu.dv, recording.imu.dv)


def test_arrays_of_one_length_are_a_table(tmp_path):
    path = tmp_path / "log.mat"
    savemat(
        path, {"t": T, "gyro": GYRO, "acc": ACCEL, "rate": 100.0, "name": "x", "utc": FIXES["t"]}
    )
    found = tables_of(path)
    assert list(found) == ["log.t", "log.utc"] or list(found) == ["t", "utc"]
    names = [f"{name}_{k}" for name in ("gyro", "acc") for k in (1, 2, 3)]
    assert sorted(next(iter(found.values())).frame.columns) == sorted(["t", *names])


@pytest.mark.parametrize("version", ["4", "5"])
def test_arrays_of_matlab_are_what_scipy_reads(tmp_path, version):
    """What is real numbers of more than one row, of any type."""
    path = tmp_path / "log.mat"
    kept = {"t": T, "gyro": GYRO, "raw": np.arange(9, dtype="i2"), "row": np.ones((1, 7), "u1")}
    left = {"text": "x", "phase": T * 1j, "one": 1.0}
    savemat(path, kept | left, format=version)
    found, expected = variables(path), loadmat(path, squeeze_me=True)
    assert set(found) - {"one"} == set(kept)
    for name in kept:
        assert found[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(found[name], expected[name])


@pytest.mark.parametrize("cut", [0, 3, 100, 600, 5000])
def test_what_is_no_matlab_file_is_refused(tmp_path, cut):
    path = tmp_path / "log.mat"
    savemat(path, {"imu": {"time": T, "gyro": GYRO}})
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(DataError, match="log.mat: "):
        tables_of(path)
    savemat(path, {"name": "x"})
    with pytest.raises(DataError, match="holds no numeric arrays"):
        tables_of(path)


def test_parquet(tmp_path):
    pytest.importorskip("pyarrow")
    path = tmp_path / "log.parquet"
    moments = pd.Index(pd.to_datetime(1714567890 + T, unit="s", utc=True), name="time")
    names = ["gx", "gy", "gz", "ax", "ay", "az"]
    pd.DataFrame(np.c_[GYRO, ACCEL], columns=names, index=moments).to_parquet(path)
    (table,) = tables_of(path).values()
    np.testing.assert_array_equal(table.numbers("gx"), GYRO[:, 0])
    assert table.cells("time").dtype == np.int64
    recording = sd.read(path)
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z" and len(recording.imu.t) == len(T)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(DataError, match="log.parquet: is not a Parquet file"):
        tables_of(path)


def test_parquet_without_pyarrow_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "log.parquet"
    path.write_bytes(b"PAR1")

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DataError, match="pip install pyarrow"):
        tables_of(path)


def test_arrays_without_numbers_are_no_tables(tmp_path):
    write_73(tmp_path / "a.mat", {"a": {"none": np.zeros((0, 3)), "t": T, "x": T}})
    (table,) = tables_of(tmp_path / "a.mat").values()
    assert list(table.frame.columns) == ["t", "x"]


@pytest.mark.parametrize("name", ["t", b"\xff"])
def test_what_is_no_array_in_a_matlab_file_ends_in_one_line(tmp_path, name):
    """A named type and a group whose name is no UTF-8."""
    path = tmp_path / "a.mat"
    write_73(path, {})
    with h5py.File(path, "r+") as file:
        if name == "t":
            file[name] = np.dtype("f8")
        else:
            h5py.h5g.create(file.id, name)
    with pytest.raises(
        DataError, match="a.mat: (holds no numeric arrays|is not a complete MATLAB)"
    ):
        tables_of(path)


def test_numbers_of_a_type_that_numpy_has_not_end_in_one_line(tmp_path):
    wide = h5py.h5t.IEEE_F64LE.copy()
    wide.set_ebias(2**20)
    with h5py.File(tmp_path / "a.mat", "w") as file:
        h5py.h5d.create(file.id, b"x", wide, h5py.h5s.create_simple((3,)))
    with pytest.raises(DataError, match="a.mat: is not a complete MATLAB file"):
        tables_of(tmp_path / "a.mat")
