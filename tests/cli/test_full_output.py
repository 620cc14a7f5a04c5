"""Standard output that is full, and names that are too long: every command ends in one line."""

import os
import subprocess
import sys
from pathlib import Path

import given_files
import pytest

import strapdown as sd
from strapdown.io.solution import read_solution

LONG = 300 * "x"
FULL = Path("/dev/full")
COMMANDS = (
    *("imus", "receivers", "plugins", "filters", "filters closed-loop", "reproduce --help"),
    *("--help", "--version", "--version --verbose", "fuse --help", "--show-completion bash"),
    *("simulate static --duration 5 --out made.nc", "inspect drive.nc", "fuse drive.nc"),
    *("diagnose drive.nc", "advise --help", "inspect none.nc"),
)
"""What prints; commands that take longer print by the same functions."""
NO_DETECTION = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
"""The script of the shell that is named, whichever runs the tests."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a short drive."""
    folder = tmp_path_factory.mktemp("full")
    sd.write_recording(given_files.car().between(0.0, 45.0), folder / "drive.nc")
    return folder


def ended(words, folder, buffered="", **streams):
    """(exit code, lines of standard error) of a command in a process of its own."""
    source = str(Path(sd.__file__).parents[1])
    path = f"{source}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    done = subprocess.run(
        [sys.executable, "-m", "strapdown", *words.split()],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": buffered, **NO_DETECTION},
        stderr=subprocess.PIPE,
        text=True,
        **streams,
    )
    lines = done.stderr.splitlines()
    return done.returncode, [line for line in lines if not line.startswith("compiling")]


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("words", COMMANDS)
def test_a_full_output_ends_in_one_line(words, folder):
    with FULL.open("w") as full:
        code, lines = ended(words, folder, stdout=full)
    assert (code, len(lines)) == (2, 1), lines
    said = "strapdown: standard output: cannot be used (No space left on device); make room there"
    assert lines[0].startswith(said) or words == "inspect none.nc"


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
def test_it_does_so_without_a_buffer_too(folder):
    with FULL.open("w") as full:
        code, lines = ended("imus", folder, "1", stdout=full)
    assert (code, len(lines)) == (2, 1), lines


def test_a_reader_that_goes_away_is_no_fault(folder):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as closed:
        code, lines = ended("filters", folder, stdout=closed)
    assert code in (1, 2) and len(lines) <= 1, lines


WRITES = (
    *("fuse drive.nc --out", "fly straight --duration 5 --out", "study static --runs 1 --out"),
    *("compare drive.nc --outages 10/20 --filters closed-loop --out"),
    *("simulate static --duration 5 --out", "advise --imu tactical --flight car --quick --out"),
    *("tune drive.nc --out", "calibrate installation drive.nc --out"),
    *("calibrate drive.nc --sensor accelerometer --out", "reproduce noise --quick --out"),
    *("export --sources position --target host --out", "inspect imu.csv --write"),
)
READS = (
    *("fuse", "inspect", "compare", "diagnose", "tune", "allan", "calibrate", "study", "fly"),
    *("calibrate installation", "filters", "reproduce", "--plugin"),
    *("fuse drive.nc --imu", "fuse drive.nc --sources", "simulate --out a.nc"),
)


@pytest.mark.parametrize("words", [*WRITES, *READS])
@pytest.mark.parametrize("ending", ["", ".nc"])
def test_a_name_that_is_too_long_is_refused_in_one_line(
    words, ending, command, folder, monkeypatch
):
    monkeypatch.chdir(folder)
    given_files.imu_table(given_files.car().imu, folder / "imu.csv")
    before = sorted(folder.iterdir())
    code, _, lines = command(*words.split(), LONG + ending)
    assert (code, len(lines)) == (2, 1), lines
    assert sorted(folder.iterdir()) == before


def test_readers_of_results_refuse_it_too():
    for read in (sd.read, read_solution):
        with pytest.raises(sd.DataError):
            read(LONG + ".nc")
