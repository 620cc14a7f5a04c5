"""What all tests share: the folder of recorded data, and one line that says so where it is missing."""
import pytest

from strapdown.data import DataError
from strapdown.io.locate import data_folder as find_data_folder

NO_DATA = "recorded data not found (STRAPDOWN_DATA)"


@pytest.fixture(scope="session")
def data_folder():
    """Folder of the recorded data; the test is skipped where there is none."""
    try:
        return find_data_folder(__file__)
    except DataError:
        pytest.skip(NO_DATA)


def pytest_terminal_summary(terminalreporter):
    """One line for all tests that were skipped for want of recorded data."""
    skipped = [report for report in terminalreporter.stats.get("skipped", []) if NO_DATA in str(report.longrepr)]
    if skipped:
        terminalreporter.write_line(f"{len(skipped)} tests skipped: {NO_DATA}")
