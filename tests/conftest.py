"""What all tests share: the command line, and the folder of recorded data with one line that
says so where it is missing."""

import sys

import pytest

from strapdown.checks import DataError
from strapdown.cli import app
from strapdown.io.locate import data_folder as find_data_folder

NO_DATA = "recorded data not found (STRAPDOWN_DATA)"


@pytest.fixture(scope="session")
def data_folder():
    """Folder of the recorded data; the test is skipped where there is none."""
    try:
        return find_data_folder(__file__)
    except DataError:
        pytest.skip(NO_DATA)


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


def pytest_terminal_summary(terminalreporter):
    """One line for all tests that were skipped for want of recorded data."""
    skipped = [
        report
        for report in terminalreporter.stats.get("skipped", [])
        if NO_DATA in str(report.longrepr)
    ]
    if skipped:
        terminalreporter.write_line(f"{len(skipped)} tests skipped: {NO_DATA}")
