"""What is said of a Tuning, in lines and as a table."""

from dataclasses import replace

import numpy as np
import pytest
from tuned import gnss, tuning

from strapdown.tuning.findings import SourceFit


@pytest.fixture(scope="module")
def found():
    return tuning()


def test_every_number_has_a_line_with_unit_interval_and_meaning(found):
    assert [str(each) for each in found.parameters] == [
        "gyro noise (white noise of the turn rate): 1.26 deg/sqrt(h), 95 % 0.9 to 1.8; given 0.9, "
        "which fits too",
        "gyro bias walk (how fast the gyro bias wanders): the data show only that it is "
        "at most 37.1 deg/h/sqrt(h) (95 %); 12.4 deg/h/sqrt(h) kept as given",
        "accel bias walk (how fast the accelerometer bias wanders): the data do not determine it, any "
        "value fits; 0.0612 mg/sqrt(h) kept as given",
        "GNSS position noise horizontal (std of errors that are independent from fix to fix): 1.02 m, 95 % "
        "0.918 to 1.12; given 0.5, 2 times too small",
        "GNSS position noise vertical (std of errors that are independent from fix to fix): 0.75 m kept as "
        "given; the data favour a smaller value, but the innovations stay correlated, which makes "
        "it meaningless",
        "GNSS position correlated error horizontal (std of time-correlated errors): 1.5 m, "
        "95 % 1.2 to 1.9; none was given",
        "GNSS position correlation time (correlation time of those errors): the data show only that it is "
        "at least 12 s (95 %); 30 s is used; none was given",
    ]


def test_the_lines_begin_with_what_it_comes_to_and_end_with_what_was_used(found):
    assert (
        found.lines[0]
        == found.summary
        == (
            "3 of 7 numbers are determined by the data; 2 are only bounded, 1 is not decided, 1 is kept as "
            "given because innovations stay correlated"
        )
    )
    assert found.lines[1:8] == [str(each) for each in found.parameters]
    assert found.lines[-1] == (
        "used: 0.0 to 80.0 s, 80 s, in 43 runs of the filter; the log-likelihood rose by 812.0"
    )
    assert str(found).splitlines() == found.lines


def test_what_is_not_decided_is_said_in_words(found):
    assert found.undecided == [
        "GNSS position noise horizontal against gyro noise: the data determine only their sum",
        "innovations of GNSS velocity stay correlated (0.54 one fix apart) for reasons outside the "
        "model: noise factors mean nothing there, and none was made smaller",
    ]
    white = SourceFit("GNSS velocity", (1.0, 1.0), (0.02, 0.3), (0.0, 0.0))
    assert replace(found, fits=(white,), directions=()).undecided == []


def test_what_was_too_large_is_called_so(found):
    noise = replace(gnss()[0], given=5.1, value=1.02)
    assert str(noise).endswith("given 5.1, 5 times too large")


def test_the_table_is_in_the_units_of_its_rows(found):
    table = found.table()
    assert list(table.columns[:5]) == ["source", "parameter", "unit", "given", "found"]
    np.testing.assert_allclose(
        table.loc[0, ["given", "found", "low", "high"]].tolist(), [0.9, 1.26, 0.9, 1.8]
    )
    assert table.loc[2, "high"] == np.inf and table.status.tolist()[:3] == [
        "tuned",
        "at most",
        "open",
    ]
