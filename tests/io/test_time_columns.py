"""Times of a description: every way to write them means the same recording, by Python's own
calendar."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest

from strapdown.checks import DataError
from strapdown.io import read
from strapdown.io.tables.calendar_text import moments, patterns
from strapdown.units.time_scales import gps_from_unix

pytestmark = pytest.mark.short
START = datetime(2024, 5, 1, 12, 30, tzinfo=UTC)
PLAIN = 'time = { column = "t", unit = "s" }'
LEAPS = 18.0  # s by which GPS time is ahead of UTC since 2017


def stamps(frame, start=START):
    """Moments of the rows of a table of the fixture `build`, as datetime."""
    return [start + timedelta(seconds=float(t)) for t in frame["t"]]


def as_text(pattern, zone=UTC, ahead=0.0, start=START):
    def change(frame):
        shifted = [
            when.astimezone(zone) + timedelta(seconds=ahead) for when in stamps(frame, start)
        ]
        parts = pattern.split("|")
        columns = {
            f"p{i}": [when.strftime(part) for when in shifted] for i, part in enumerate(parts)
        }
        return frame.assign(**columns)

    return change


def as_numbers(function):
    return lambda frame: frame.assign(
        **function(np.array([each.timestamp() for each in stamps(frame)]))
    )


def of_week(unix):
    gps = gps_from_unix(unix)
    return {"p0": gps % 604800, "p1": (gps // 604800).astype(int)}


ZONE = timezone(timedelta(hours=2))
WAYS = {
    "iso": (as_text("%Y-%m-%dT%H:%M:%S.%fZ"), 'column = "p0", format = "iso"'),
    "iso with a blank": (as_text("%Y-%m-%d %H:%M:%S.%f"), 'column = "p0", format = "iso"'),
    "iso with a zone": (as_text("%Y-%m-%dT%H:%M:%S.%f%z", ZONE), 'column = "p0", format = "iso"'),
    "iso, basic": (as_text("%Y%m%dT%H%M%S.%fZ"), 'column = "p0", format = "iso"'),
    "local time": (
        as_text("%Y-%m-%dT%H:%M:%S.%f", ZONE),
        'column = "p0", format = "iso", offset = -7200',
    ),
    "GPS calendar": (
        as_text("%Y/%m/%d %H:%M:%S.%f", ahead=LEAPS),
        'column = "p0", format = "%Y/%m/%d %H:%M:%S", clock = "gps"',
    ),
    "decimal comma": (
        as_text("%d.%m.%Y %H:%M:%S,%f"),
        'column = "p0", format = "%d.%m.%Y %H:%M:%S"',
    ),
    "half days": (
        as_text("%b %d %Y %I:%M:%S.%f %p"),
        'column = "p0", format = "%b %d %Y %I:%M:%S %p"',
    ),
    "apart": (
        as_text("%d.%m.%Y|%H:%M:%S.%f"),
        'column = "p1", date = "p0", format = "%d.%m.%Y %H:%M:%S"',
    ),
    "apart, iso": (as_text("%Y-%m-%d|%H:%M:%S.%f"), 'column = "p1", date = "p0", format = "iso"'),
    "NMEA": (as_text("%d%m%y|%H%M%S.%f"), 'column = "p1", date = "p0", format = "%d%m%y %H%M%S"'),
    "one day": (as_text("%H:%M:%S.%f"), 'column = "p0", date = "2024-05-01", format = "iso"'),
    "unix": (as_numbers(lambda unix: {"p0": unix}), 'column = "p0", unit = "s", clock = "unix"'),
    "week": (as_numbers(of_week), 'column = "p0", unit = "s", clock = "gps", week = "p1"'),
    "a week": (as_numbers(of_week), 'column = "p0", unit = "s", clock = "gps", week = 2312'),
}


@pytest.mark.parametrize("way", WAYS)
def test_each_way_to_write_times_is_the_same_recording(build, way):
    change, keys = WAYS[way]
    plain = read(build())
    found = read(build(change, change, lambda text: text.replace(PLAIN, f"time = {{ {keys} }}")))
    assert found.meta["epoch"] == "2024-05-01T00:00:00Z" and found.meta["date"] == "2024-05-01"
    shift = 12.5 * 3600
    np.testing.assert_allclose(found.imu.t, plain.imu.t + shift, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.sources[0].t, plain.sources[0].t + shift, rtol=0, atol=1e-6)
    assert abs(found.utc[0] - np.datetime64("2024-05-01T12:30:10.01")) < np.timedelta64(1, "us")


@pytest.mark.parametrize(
    ("pattern", "keys"),
    [
        ("%H:%M:%S.%f", 'column = "p0", date = "2024-05-01", format = "%H:%M:%S"'),
        ("%d%m%y|%H%M%S.%f", 'column = "p1", date = "p0", format = "%d%m%y %H%M%S"'),
    ],
)
def test_midnight_is_passed(build, pattern, keys):
    start = datetime(2024, 5, 1, 23, 59, 45, tzinfo=UTC)
    change = as_text(pattern, start=start)
    found = read(build(change, change, lambda text: text.replace(PLAIN, f"time = {{ {keys} }}")))
    np.testing.assert_allclose(found.imu.t, 86385 + 10 + 0.01 * np.arange(1, 2001), atol=1e-6)
    assert str(found.utc[-1])[:19] == "2024-05-02T00:00:15"


def test_a_time_of_day_alone_counts_from_midnight_for_all_sources(build):
    """The first fix comes after midnight, the first sample before it."""
    start = datetime(2024, 5, 1, 23, 59, 49, 800000, tzinfo=UTC)
    change, keys = as_text("%H:%M:%S.%f", start=start), 'column = "p0", format = "%H:%M:%S"'
    found = read(build(change, change, lambda text: text.replace(PLAIN, f"time = {{ {keys} }}")))
    assert "epoch" not in found.meta and found.utc is None
    assert found.imu.t[0] == pytest.approx(86399.81)
    assert found.sources[0].t[0] == pytest.approx(86400.3)


def test_a_week_ends(build):
    # 2024-05-05 00:00:00 GPS time begins week 2313
    def change(frame):
        return frame.assign(tow=(frame["t"] + 604780.0) % 604800)

    keys = 'time = { column = "tow", unit = "s", clock = "gps", week = 2312 }'
    found = read(build(change, change, lambda text: text.replace(PLAIN, keys)))
    assert np.allclose(np.diff(found.imu.t), 0.01, atol=1e-6)
    assert str(found.utc[0])[:22] == "2024-05-04T23:59:32.01"


def test_nanoseconds_and_a_leap_second():
    cells = np.array(
        ["2016-12-31T23:59:59.123456789Z", "2016-12-31T23:59:60.5Z", "2017-01-01T00:00:00Z", ""],
        object,
    )
    found, wrong = moments(cells, patterns("iso")[1])
    assert not wrong.any() and np.isnan(found.second[3])
    np.testing.assert_array_equal(found.second[:3], [59.123456789, 60.5, 0.0])
    t = gps_from_unix(found.minute[:3]) + found.second[:3]
    np.testing.assert_allclose(np.diff(t), [1.376543211, 0.5], atol=1e-6)


PATTERNS = [
    "%Y-%m-%d %H:%M:%S.%f",
    "%d.%m.%y %H-%M-%S",
    "%m/%d/%Y %I:%M:%S %p",
    "%Y %j %H%M%S",
    "%b %d %Y %H:%M:%S",
]


@pytest.mark.parametrize("pattern", PATTERNS)
def test_against_strptime(pattern):
    """Whole seconds of two centuries, and every change of one character that strptime refuses is
    refused too."""
    rng = np.random.default_rng(3)
    whole = rng.integers(-(10**9), 4 * 10**9, 300)
    if "%y" in pattern:
        whole = rng.integers(0, 3 * 10**9, 300)
    texts = [datetime.fromtimestamp(int(each), UTC).strftime(pattern) for each in whole]
    found, wrong = moments(np.array(texts, object), patterns(pattern)[1])
    assert not wrong.any()
    np.testing.assert_array_equal(found.minute + found.second, whole)
    bent = []
    for text in texts:
        i = rng.integers(len(text))
        bent.append(text[:i] + rng.choice(list("0123456789:x")) + text[i + 1 :])
    found, wrong = moments(np.array(bent, object), patterns(pattern)[1])
    for text, bad, minute, second in zip(bent, wrong, *found):
        try:
            expected = datetime.strptime(text, pattern).replace(tzinfo=UTC).timestamp()
        except ValueError:
            assert bad or second >= 60, text  # a leap second
        else:
            assert not bad and minute + second == pytest.approx(expected, abs=1e-6), text


def test_a_cell_that_is_no_time_is_named_by_line(build):
    def change(frame):
        frame = as_text("%Y-%m-%dT%H:%M:%SZ")(frame)
        frame.loc[7, "p0"] = "2024-02-30T12:30:00Z"
        return frame

    keys = 'time = { column = "p0", format = "iso" }'
    with pytest.raises(
        DataError, match=r"gnss\.csv, line 9, column 'p0': '2024-02-30T12:30:00Z' is no"
    ):
        read(
            build(as_text("%Y-%m-%dT%H:%M:%S.%fZ"), change, lambda text: text.replace(PLAIN, keys))
        )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('column = "t"', "unit is missing"),
        ('column = "t", format = "iso", unit = "s"', "leave it out"),
        ('column = "t", format = "%H:%Q"', "'%Q' is not one of"),
        ('column = "t", format = "%M:%S"', "neither a day nor an hour"),
        ('column = "t", format = "%d.%m.%Y", date = "day"', "one blank"),
        ('column = "t", format = "%d.%m.%Y %H:%M", date = "2024-05-01"', "leave one of them out"),
        ('column = "t", unit = "s", date = "day"', "give the format of both"),
        ('column = "t", format = "%H:%M:%S", clock = "gps"', "needs a `date`"),
        ('column = "t", format = "iso", clock = "gps", week = 3', "week: only clock"),
    ],
)
def test_what_makes_no_sense_is_refused(build, keys, said):
    with pytest.raises(DataError, match=said):
        read(build(toml=lambda text: text.replace(PLAIN, f"time = {{ {keys} }}", 1)))


def test_one_clock_for_all(build):
    change = as_text("%Y-%m-%dT%H:%M:%S.%fZ")
    keys = 'time = { column = "p0", format = "iso" }'
    with pytest.raises(DataError, match="has no absolute clock, but that of"):
        read(build(change, None, lambda text: text.replace(PLAIN, keys, 1)))
    path = build(change, change, lambda text: text.replace(PLAIN, keys))
    assert pd.read_csv(path.parent / "imu.csv")["p0"][0].endswith("Z")


@pytest.mark.parametrize("factor", [1e3, 1e15, -1e3])
def test_a_clock_of_another_unit_is_told(build, factor):
    change = as_numbers(lambda unix: {"p0": unix * factor})
    keys = 'time = { column = "p0", unit = "s", clock = "unix" }'
    with pytest.raises(DataError, match="is in the year .* check unit, clock and week"):
        read(build(change, change, lambda text: text.replace(PLAIN, keys)))


def test_an_epoch_is_a_time_of_recordings(build):
    for epoch in ("0001-01-01", "2300-01-01T00:00:00Z"):
        with pytest.raises(DataError, match="epoch: .* is no time between 1970 and 2200"):
            read(build(toml=lambda text: f'epoch = "{epoch}"\n{text}'))
    far = read(build(toml=lambda text: f'epoch = "2100-01-01"\n{text}'))
    assert str(far.utc[0])[:19] == "2100-01-01T00:00:10"
