"""Protocols of outages, by hand, and what is refused of them."""

from itertools import count

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.experiments.outages.protocols import MAX_WINDOWS, protocol

pytestmark = pytest.mark.short
SPAN = (0.0, 1000.0)


def windows(outages, span=SPAN, end=None, settled=100.0):
    return protocol(outages, span, span[1] if end is None else end, lambda: settled).windows


def test_at_the_end_of_every_period_but_the_first():
    assert windows("30/300") == ((570.0, 600.0), (870.0, 900.0))
    # the last period ends with the recording
    assert windows(" 30 / 250 ") == (
        (470.0, 500.0),
        (720.0, 750.0),
        (970.0, 1000.0),
    )
    assert windows("30/300", (7.5, 608.0)) == ((577.5, 607.5),)  # counted from the first sample
    made = protocol("30/300", (0.0, 1980.0), 1980.0, None)  # the flight of the paper: 33 min
    assert [stop for _, stop in made.windows] == [600, 900, 1200, 1500, 1800] and not made.sweep


def test_from_a_time_to_the_end():
    assert windows("15:") == ((15.0, 1000.0),)
    assert windows("15:", end=940.0) == ((15.0, 940.0),)  # a reference that ends earlier


def test_a_list_is_put_in_order():
    assert windows("200:230,100:130") == ((100.0, 130.0), (200.0, 230.0))
    assert (
        windows([(200, 230), (100.0, 130.0)])
        == windows(np.array([[100, 130], [200, 230]]))
        == ((100.0, 130.0), (200.0, 230.0))
    )
    assert windows("100:130,950:") == ((100.0, 130.0), (950.0, 1000.0))
    assert not protocol("200:230,100:130", SPAN, 1000.0, None).sweep


def test_a_sweep_has_all_offsets_that_fit():
    made = protocol("30@240:575/5", SPAN, 1000.0, None)
    assert (
        made.sweep
        and len(made.windows) == 62
        and made.windows[0] == (240.0, 270.0)
        and made.windows[-1] == (545.0, 575.0)
    )
    assert {round(b[0] - a[0], 9) for a, b in zip(made.windows, made.windows[1:])} == {5.0}
    assert windows("30,10@0:50/10") == (
        (0.0, 10.0),
        (10.0, 20.0),
        (20.0, 30.0),
        (30.0, 40.0),
        (40.0, 50.0),
        (0.0, 30.0),
        (10.0, 40.0),
        (20.0, 50.0),
    )


def test_a_sweep_without_a_range_begins_once_the_filters_have_settled():
    assert windows("300@/100") == tuple((100.0 + 100 * k, 400.0 + 100 * k) for k in range(7))
    assert windows("899@", end=1000.0) == ((100.0, 999.0),) and windows("300@", end=410.0) == (
        (100.0, 400.0),
        (105.0, 405.0),
        (110.0, 410.0),
    )


def test_steps_that_are_no_whole_numbers_keep_their_last_window():
    made = windows("0.3@0:0.9/0.1")
    assert len(made) == 7 and made[-1] == pytest.approx((0.6, 0.9))
    assert len(windows("0.1/0.3", (0.0, 0.9))) == 2


@pytest.mark.parametrize(
    "outages, said",
    [
        ("2000:3000", "outside the recording, which covers 0 to 1000 s"),
        ("1500:", "outside the recording"),
        ([(-5, 10)], "outside the recording"),
        ("1100/2000", "an outage of 1100 s is longer than the recording, which lasts 1000 s"),
        ("1100@/5", "longer than the recording"),
        ("100:1200", "an outage of 1100 s is longer"),
        ("100:130,120:150", "100 to 130 s and 120 to 150 s overlap"),
        ("130:100", "ends before it begins"),
        ("100:100", "ends before it begins"),
        ("30/600", "an outage needs at least two periods of 600 s"),
        ("30/30", "leave no fixes"),
        ("0/300", "length is 0.0 s"),
        ("-5/300", "length is -5.0 s"),
        ("30/-300", "period is -300.0 s"),
        ("30@240:575/0", "step is 0.0 s"),
        ("0,30@240:575/5", "length is 0.0 s"),
        ("400@240:575/5", "no window of 400 s fits into 240 to 575 s"),
        ("30@575:240/5", "no window of 30 s fits"),
        ("thirty", "'thirty' is not a window"),
        ("", "is not a window"),
        ("30", "'30' is not a window"),
        ("a/300", "'a' is not a number"),
        ("30/300/2", "3 numbers instead of 2"),
        ("30@x:575/5", "'x' is not a number"),
        ("30@240/5", "'240' is not a window"),
        ("nan:100", "'nan' is not a number"),
        ("100:inf", "'inf' is not a number"),
        ("30@240:575/", "'' is not a number"),
        ([], "none are given"),
        ([(1, 2, 3)], "must be text or a list"),
        (5, "must be text or a list"),
        ([("a", "b")], "must be text or a list"),
        ([(np.nan, 5.0)], "finite"),
        (f"1@0:{MAX_WINDOWS}/0.5", f"more than {MAX_WINDOWS} windows"),
        ("1e-8/2e-8", f"more than {MAX_WINDOWS} windows; give a longer period"),
        ("1e-320/2e-320", f"more than {MAX_WINDOWS} windows"),
        (((k, k + 1) for k in count()), f"more than {MAX_WINDOWS} windows in a list"),
        (",".join(["1:2"] * (MAX_WINDOWS + 1)), f"more than {MAX_WINDOWS} windows in a list"),
    ],
    ids=lambda value: str(value)[:40] if isinstance(value, str) else type(value).__name__,
)
def test_what_is_no_protocol_is_refused_in_a_line(outages, said):
    with pytest.raises(DataError) as error:
        windows(outages)
    assert said in str(error.value) and "\n" not in str(error.value)
