"""An installation without the packages of the extras: what it does, and what it says of the rest."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown import extras
from strapdown.checks import DataError

ROOT = Path(__file__).resolve().parents[1]
REFUSED = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"numba", "llvmlite", "scipy", "pandas", "lz4", "backports"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refuse())
"""
"""Code that makes imports of what the extras compile, logs and analysis bring fail."""
COMMAND = f"{REFUSED}from strapdown.__main__ import main\nmain()"


def run(code, *words, compiled="0"):
    """(exit code, standard output, lines of errors) of a new process without those packages."""
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        env={
            **os.environ,
            "NUMBA_DISABLE_JIT": str(int(not int(compiled))),
            "PYTHONPATH": str(Path(sd.__file__).parents[1]),
            "STRAPDOWN_LIBRARY": "0",
        },
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout, done.stderr.splitlines()


FIRST = """
import strapdown as sd
for recording in (sd.example("drive").between(3.0, 8.0), sd.simulate("demo", 3.0, seed=1)):
    solution = sd.fuse(recording, "closed-loop")
    solution.save(f"{sys.argv[1]}/solution.nc")
    sd.report(solution, recording.reference).save(f"{sys.argv[1]}/report.html")
print(len(solution), "rows")
"""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A folder with a table of numbers, and one with an empty cell."""
    folder = tmp_path_factory.mktemp("tables")
    t = np.arange(0, 5, 0.01)
    rows = np.column_stack([t, *np.random.default_rng(1).normal(0, 1e-3, (6, len(t)))])
    rows[:, 6] += 9.8
    text = "t,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z\n" + "\n".join(
        ",".join(f"{each:.9g}" for each in row) for row in rows
    )
    (folder / "imu.csv").write_text(text + "\n")
    (folder / "gaps.csv").write_text(re.sub(r"(?m)^(0\.1,)[^,]*", r"\1", text) + "\n")
    return folder


def test_the_first_solution_and_its_page_need_no_extra(tmp_path):
    """By the functions in Python: a wheel brings them as machine code."""
    code, said, errors = run(REFUSED + FIRST, tmp_path)
    assert (code, errors) == (0, []) and re.fullmatch(r"\d+ rows\n", said)
    assert (tmp_path / "report.html").stat().st_size > 1e5


def test_a_table_of_numbers_is_inspected_without_pandas(table):
    code, said, errors = run(COMMAND, "inspect", table / "imu.csv")
    assert code in (0, 3) and errors == [] and "IMU" in said


SAID = {
    "numba": (
        ("demo", "--out", "never.html"),
        r"strapdown\.\S+ must be compiled \(.*\), which needs numba: pip install "
        r'"strapdown\[compile\]"',
    ),
    "pandas": (
        ("inspect", "gaps.csv"),
        r"gaps\.csv: a DataFrame, or a table with text or empty cells, needs pandas: pip install "
        r'"strapdown\[logs\]"',
    ),
    "backports.zstd": (
        ("inspect", "packed.csv.zst"),
        r"packed\.csv\.zst: reading a file that is packed by zstd needs backports\.zstd: pip install "
        r'"strapdown\[logs\]"',
    ),
    "scipy": (
        ("allan", "imu.csv"),
        r'this analysis needs scipy: pip install "strapdown\[analysis\]"',
    ),
}


@pytest.mark.parametrize("package", SAID)
def test_a_command_names_the_extra_that_it_lacks(table, package, monkeypatch):
    if package == "backports.zstd" and sys.version_info >= (3, 14):
        pytest.skip("a part of Python")
    monkeypatch.chdir(table)
    (table / "packed.csv.zst").write_bytes(b"\x28\xb5\x2f\xfd" + bytes(20))
    words, expected = SAID[package]
    code, _, errors = run(COMMAND, *words, compiled=str(int(package == "numba")))
    assert code == 2 and re.fullmatch(f"strapdown: {expected}", errors[-1])
    assert not [line for line in errors if "Traceback" in line]


@pytest.mark.parametrize("package", extras.OPTIONAL)
def test_every_missing_package_is_told_with_an_extra_that_brings_it(package):
    of = extras.OPTIONAL[package]
    module = f"{package}.part" if package != "backports.zstd" else package
    told = extras.name_extra(ModuleNotFoundError("", name=module))
    assert str(told) == f'{of.use} needs {package}: pip install "strapdown[{of.extra}]"'
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    brought = listed["project"]["optional-dependencies"][of.extra]
    assert any(re.match(rf"{re.escape(package)}\b", each) for each in brought)


def test_any_other_failed_import_stays_what_it_is():
    assert extras.name_extra(ModuleNotFoundError("", name="unknown")) is None
    assert extras.name_extra(ValueError("numba")) is None
    with pytest.raises(ModuleNotFoundError, match="nowhere"), extras.optional_import():
        raise ModuleNotFoundError("No module named 'nowhere'", name="nowhere")
    with (
        pytest.raises(
            DataError, match=r'^reading ROS bags needs lz4: pip install "strapdown\[logs\]"$'
        ),
        extras.optional_import("reading ROS bags"),
    ):
        raise ModuleNotFoundError("No module named 'lz4.frame'", name="lz4.frame")
