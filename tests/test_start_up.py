"""What a process loads on its way to the first solution: each of these libraries takes longer than
the filter."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown.sim.trajectory import demo_flight

COMPILER = {"numba", "llvmlite", "scipy", "scipy.linalg"}
"""The compiler, and what it takes of scipy; needed only where kernels are not in the library."""
NEVER = {
    *("scipy.interpolate", "scipy.spatial", "scipy.special", "scipy.stats"),
    *("pandas", "xarray", "pyarrow", "matplotlib", "jinja2", "rich", "ssl"),
}
"""Nowhere on these paths."""
PAGE = {"plotly", "h5netcdf", "typer"}
DESCRIPTION = """[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
kind = "increment"
gyro = { columns = ["x", "y", "z"], unit = "rad" }
accel = { columns = ["vx", "vy", "vz"], unit = "m/s" }
grade = "tactical"

[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 1.0]
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Folder with one flight as recording.nc and as recording.toml with two CSV files."""
    folder = tmp_path_factory.mktemp("flight")
    recording = sd.simulate(demo_flight(), 60.0, "tactical", 1)
    sd.write_recording(recording, folder / "recording.nc")
    imu, fixes = recording.imu, recording.sources[0]
    y = fixes.y.copy()
    y[50, 0] += 1e-5  # rad, 64 m: rejected, and no reason to doubt the rest
    lla = y / [np.pi / 180, np.pi / 180, 1.0]
    for name, head, columns in (
        ("imu", "t,x,y,z,vx,vy,vz", (imu.t, imu.dtheta, imu.dv)),
        ("gnss", "t,lat,lon,alt", (fixes.t, lla)),
    ):
        table = np.column_stack(columns)
        np.savetxt(folder / f"{name}.csv", table, "%.12g", ",", header=head, comments="")
    (folder / "recording.toml").write_text(DESCRIPTION)
    return folder


def loaded(code, *arguments, library="0"):
    """The modules of a new process that ran `code`, with the kernels of a library where one is
    named."""
    path = str(Path(sd.__file__).parents[1])
    code += "\nprint(*sys.modules, sep='\\n')"
    required = "" if library == "0" else "1"
    kernels = {"STRAPDOWN_LIBRARY": str(library), "STRAPDOWN_REQUIRE_LIBRARY": required}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}", *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": path, "PYTHONWARNINGS": "error"} | kernels,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


SOLUTION = """
import strapdown as sd
solution = sd.fuse(sd.read(sys.argv[1]), "closed-loop")
assert len(solution.t) > 5000
"""
COMMAND = """
from strapdown.cli.app import main
try:
    main()
except SystemExit as end:
    assert not end.code
"""


@pytest.mark.parametrize(
    "name, more", [("recording.nc", set()), ("recording.toml", {"h5py"})], ids=["netcdf", "csv"]
)
def test_the_first_solution_loads_what_it_needs(recordings, kernel_library, name, more):
    found = loaded(SOLUTION, recordings / name, library=kernel_library)
    assert found & (NEVER | PAGE | COMPILER | more) == set()


def test_the_command_loads_what_its_files_and_its_page_need(recordings, kernel_library, tmp_path):
    words = ("fuse", recordings / "recording.toml", "--out", tmp_path / "out")
    found = loaded(COMMAND, *words, library=kernel_library)
    assert found & (NEVER | COMPILER) == set() and found >= PAGE
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize("word", ["--help", "--version"])
def test_help_and_version_load_no_numbers(word):
    heavy = NEVER | PAGE | COMPILER | {"numpy", "pydantic"}
    assert loaded(COMMAND, word) & heavy == {"typer"}


def test_verbose_tells_more_of_the_version(command):
    for words in (("--version", "--verbose"), ("--verbose", "--version")):
        code, text, errors = command(*words)
        assert code == 0 and errors == [] and len(text.splitlines()) > 1
    code, text, errors = command("--verbose", "filters")
    assert (code, text) == (2, "") and errors[0].startswith(
        "strapdown: --verbose goes with --version"
    )
