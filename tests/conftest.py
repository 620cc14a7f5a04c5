"""What all tests share: the command line, a small library of kernels, and the folder of recorded data
with one line that says so where it is missing."""

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from browser import NO_CHROMIUM

import strapdown
from strapdown import plugins
from strapdown.checks import DataError
from strapdown.cli import app
from strapdown.io.locate import data_folder as find_data_folder

NO_DATA = "recorded data not found (STRAPDOWN_DATA)"
MIN_ROOM = 2**28
"""Bytes that the temporary folder must take for tests to be run there."""
ELSEWHERE = Path(__file__).resolve().parents[1] / "build" / "tmp"
"""Where they are run otherwise."""
NO_ROOM = pytest.StashKey[str]()


@pytest.fixture(scope="session")
def data_folder():
    """Folder of the recorded data; the test is skipped where there is none."""
    try:
        return find_data_folder(__file__)
    except DataError:
        pytest.skip(NO_DATA)


@pytest.fixture(scope="module", autouse=True)
def registered_for_this_file_alone():
    """What a study registers is gone when the next file of tests asks for all names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plugins, "_plugins", {**plugins._plugins})
        yield


KERNELS = (
    *("strapdown.core.loop.loop.run", "strapdown.aiding.position.observe"),
    *("strapdown.aiding.velocity.observe", "strapdown.filters.ins.closed_loop.predict"),
    "strapdown.filters.ins.closed_loop.correct",
    "strapdown.core.loop.stages.dead_reckoning.alone",
    "strapdown.core.loop.stages.contradicting.judge_beside_gnss",
)


@pytest.fixture(scope="session")
def kernel_library(tmp_path_factory):
    """Folder of a library of KERNELS, one for all processes that test; skipped where none can be
    built."""
    return _built_once(tmp_path_factory, "kernels", "--only", ",".join(KERNELS))


@pytest.fixture(scope="session")
def whole_library(tmp_path_factory):
    """Folder of the whole library for all levels of processor, one for all processes that test."""
    return _built_once(tmp_path_factory, "whole-library", "--levels", "all")


def _built_once(tmp_path_factory, name, *words):
    from strapdown.native import build

    try:
        build.levels_here()
    except DataError as error:
        pytest.skip(str(error))
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    with open(f"{folder}.lock", "wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if not folder.exists():
            source = str(Path(strapdown.__file__).parents[1])
            done = subprocess.run(
                [sys.executable, "-m", "strapdown.native.build", str(folder), *words],
                env={**os.environ, "PYTHONPATH": source, "NUMBA_DISABLE_JIT": "0"},
                capture_output=True,
                text=True,
            )
            assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def command(monkeypatch, capsys):
    """Function of the words after `strapdown` -> (exit code, standard output, lines of standard
    error without that on compiling)."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["strapdown", *map(str, words)])
        code = 0
        try:
            app.main()
        except SystemExit as end:
            code = end.code or 0
        shown = capsys.readouterr()
        return (
            code,
            shown.out,
            [line for line in shown.err.splitlines() if not line.startswith("compiling")],
        )

    return run


@pytest.fixture
def good(command):
    """Function of the words -> standard output of a command that must end well and say nothing
    on standard error."""

    def run(*words):
        code, out, err = command(*words)
        assert (code, err) == (0, []), (code, out, err)
        return out

    return run


def pytest_configure(config):
    """Where the temporary folder has no room, take one in the checkout, also for processes of tests."""
    if config.option.basetemp or hasattr(config, "workerinput"):
        return
    try:
        is_full = shutil.disk_usage(tempfile.gettempdir()).free < MIN_ROOM
    except OSError:
        is_full = True
    if is_full:
        config.stash[NO_ROOM] = (
            f"temporary folder without {MIN_ROOM // 2**20} MiB: used {ELSEWHERE}"
        )
        ELSEWHERE.mkdir(parents=True, exist_ok=True)
        os.environ["TMPDIR"], tempfile.tempdir = str(ELSEWHERE), None


def pytest_terminal_summary(terminalreporter):
    """One line for all tests that were skipped for want of one thing."""
    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    for wanted in (NO_DATA, NO_CHROMIUM):
        if skipped := sum(wanted in reason for reason in reasons):
            terminalreporter.write_line(f"{skipped} tests skipped: {wanted}")
    if no_room := terminalreporter.config.stash.get(NO_ROOM, ""):
        terminalreporter.write_line(no_room)
