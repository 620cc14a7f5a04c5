"""A recording in one NetCDF file: what comes back is what was written; damage and refused places
end in one line."""

import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.fileio import files
from strapdown.io import read, write_recording
from strapdown.io.solution import read_solution

pytestmark = pytest.mark.short
REFERENCE = '[reference]\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\nposition = { columns = ["lat", "lon", "alt"], unit = ["deg", "deg", "m"] }\n'


def same(a, b):
    return (a is None and b is None) or np.array_equal(a, b, equal_nan=True)


def assert_equal(first, second):
    assert all(same(a, b) for a, b in zip(first.imu, second.imu))
    assert len(first.sources) == len(second.sources)
    for a, b in zip(first.sources, second.sources):
        assert (a.kind, a.gate, a.parameters, a.name, a.slip) == (
            b.kind,
            b.gate,
            b.parameters,
            b.name,
            b.slip,
        )
        assert same(a.t, b.t) and same(a.y, b.y) and same(a.std, b.std)
    if first.reference is None:
        assert second.reference is None
    else:
        assert all(
            same(getattr(first.reference, name), getattr(second.reference, name))
            for name in ("t", "lla", "v_n", "q_nb", "std")
        )


def test_round_trip(build, tmp_path):
    recording = read(
        build(
            toml=lambda s: (
                s.replace(
                    "std = 0.1",
                    'std = 0.1\ngate = inf\nlever_arm = [1.0, 0.0, 0.5]\nname = "Doppler"',
                )
                + '[[source]]\nkind = "zero-velocity"\nrate = 1.0\nstd = 0.1\n'
                + REFERENCE
            )
        )
    )
    recording = replace(
        recording, meta=recording.meta | {"b_a": np.arange(6.0).reshape(2, 3), "seed": np.int64(3)}
    )
    path = tmp_path / "recording.nc"
    write_recording(recording, path)
    again = read(path)
    assert_equal(recording, again)
    np.testing.assert_array_equal(again.meta.pop("b_a"), recording.meta.pop("b_a"))
    assert again.meta == recording.meta
    assert again.imu.dtheta.flags.c_contiguous
    assert [name for name in os.listdir(tmp_path) if "part" in name] == []


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.integers(2, 30),
    st.integers(1, 5),
    st.floats(0.01, 100),
    st.one_of(st.none(), st.floats(0.1, 100), st.just(np.inf)),
    st.text(max_size=12),
)
def test_round_trip_of_any_recording(tmp_path, n, fixes, std, gate, name):
    rng = np.random.default_rng(n)
    t = 100 + 0.01 * np.arange(n)
    source = Source(
        "position",
        np.linspace(t[0], t[-1], fixes),
        rng.normal(0.5, 0.01, (fixes, 3)),
        np.full((fixes, 3), std),
        (0.0, 1.0, 2.0),
        gate,
        "antenna",
        slip=0.004,
    )
    recording = Recording.from_arrays(
        t,
        rng.normal(0, 0.01, (n, 3)),
        rng.normal(0, 0.1, (n, 3)) - [0, 0, 9.8],
        [source],
        remark=name,
    )
    write_recording(recording, tmp_path / "any.nc")
    again = read(tmp_path / "any.nc")
    assert_equal(recording, again)
    assert again.meta == recording.meta


def test_units_stand_in_the_file(build, tmp_path):
    import xarray as xr

    write_recording(read(build()), tmp_path / "recording.nc")
    with xr.open_dataset(
        tmp_path / "recording.nc", group="source_1", engine="h5netcdf", decode_timedelta=False
    ) as group:
        assert (
            group["std"].attrs["units"] == "m"
            and group.y.attrs["units"] == "rad, rad, m"
            and group.attrs["kind"] == "position"
        )


def test_damaged_and_foreign_files(build, tmp_path):
    path = tmp_path / "recording.nc"
    write_recording(read(build()), path)
    whole = path.read_bytes()
    for content in (whole[: len(whole) // 2], b"", b"no NetCDF at all"):
        path.write_bytes(content)
        with pytest.raises(
            DataError, match="recording.nc: is not a whole NetCDF recording"
        ) as error:
            read(path)
        assert "\n" not in str(error.value)
    import xarray as xr

    for said in ("another", np.zeros(0), np.zeros((2, 2))):
        xr.Dataset({"a": 1.0}, attrs={"format": said}).to_netcdf(path, engine="h5netcdf")
        with pytest.raises(DataError, match="is not a recording"):
            read(path)
        with pytest.raises(DataError, match="is not a solution"):
            read_solution(path)


def test_samples_of_a_file_are_checked(build, tmp_path):
    recording, path = read(build()), tmp_path / "recording.nc"
    imu = recording.imu
    with pytest.raises(DataError, match="columns of the recording have different lengths"):
        write_recording(replace(recording, imu=imu._replace(dv=imu.dv[:-1])), path)
    assert not path.exists()
    for wrong, words in (
        (imu._replace(t=imu.t[::-1]), "must increase"),
        (imu._replace(dv=-imu.dv), "must read -9.8"),
    ):
        write_recording(replace(recording, imu=wrong), path)
        with pytest.raises(DataError, match=words):
            read(path)


def test_a_refused_path_leaves_nothing(build, tmp_path):
    recording = read(build())
    with pytest.raises(DataError, match="cannot be written"):
        write_recording(recording, tmp_path / "no" / "recording.nc")
    (tmp_path / "folder.nc").mkdir()
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(DataError, match="cannot be written"):
        write_recording(recording, tmp_path / "folder.nc")
    assert sorted(os.listdir(tmp_path)) == before


def test_an_imu_of_ones_own_travels_with_the_recording(tmp_path):
    from strapdown import fuse, simulate
    from strapdown.sensor_models.imu import ImuSpec, Triad
    from strapdown.sim.trajectory import demo_flight

    own = ImuSpec(
        "mine",
        Triad(noise=1e-4, turn_on_bias=1e-3),
        Triad(noise=1e-3, gauss_markov=1e-3, time_constant=100.0),
    )
    recording = simulate(demo_flight(), 10.0, own, seed=2, rate=20.0)
    write_recording(recording, tmp_path / "a.nc")
    back = read(tmp_path / "a.nc")
    assert (
        fuse(back, every=100).meta["noise"]
        == fuse(recording, every=100).meta["noise"]
        == own.noise()._asdict()
    )


FULL = """
import resource, sys
import numpy as np
import strapdown as sd
recording = sd.simulate("static", duration=15)
solution = sd.fuse(recording, "closed-loop", imu="tactical", start=sd.align(recording, sd.imu("tactical"), heading=0.0))
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
for write, what in ((sd.write_recording, recording), (sd.write_solution, solution)):
    try:
        write(what, "big.nc")
    except sd.DataError as error:
        print(error)
"""


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    """HDF5 that cannot write ends the process in its destructors; the bytes are made in memory
    first."""
    done = subprocess.run(
        [sys.executable, "-c", FULL], cwd=tmp_path, capture_output=True, text=True
    )
    line = "big.nc: cannot be written (File too large); choose another folder, or make room there"
    assert (done.returncode, done.stderr, done.stdout.splitlines()) == (0, "", [line] * 2)
    assert list(tmp_path.iterdir()) == []


def test_what_is_too_large_for_memory_is_written_directly(build, tmp_path, monkeypatch):
    recording = read(build())
    monkeypatch.setattr(files, "IN_MEMORY", 0)
    write_recording(recording, tmp_path / "large.nc")
    assert_equal(recording, read(tmp_path / "large.nc"))
    monkeypatch.setattr(files.shutil, "disk_usage", lambda folder: SimpleNamespace(free=10))
    with pytest.raises(
        DataError,
        match="small.nc: cannot be written .the disk has not the .* GB that it needs.; choose another folder",
    ):
        write_recording(recording, tmp_path / "small.nc")
    assert [path.name for path in tmp_path.glob("*.nc")] == ["large.nc"]
