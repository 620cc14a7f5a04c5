"""What a stream refuses, in one line and without harm, as fuse and Recording do."""

import numpy as np
import pytest
from recordings import flight, start
from test_stream import events_of, play, stream_of

import strapdown as sd
from strapdown.checks import DataError
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.preprocessing.imu_samples import imu_from_arrays

pytestmark = pytest.mark.short
GOOD = Sample(1.0, 0.05, (0.0, 0.0, 0.0), (0.0, 0.0, -0.49))


def no_harm(stream):
    """Whether the stream goes on as if nothing had been."""
    play(stream, events_of(flight()))
    solution = sd.fuse(flight(), start=start(flight()))
    return np.array_equal(stream.belief.lla, solution.trajectory.lla[-1]) and not stream.dropped


@pytest.mark.parametrize(
    "wrong, text",
    [
        ((1.5, 2, 3), r"step is given \(1.5, 2, 3\); it must be a Sample\(t, dt, dtheta, dv\)"),
        (None, "step is given None; it must be a Sample"),
        ("sample", "step is given 'sample'"),
        (np.zeros(100), r"step is given array\(\[0., 0."),
        (GOOD._replace(t="1.0"), "IMU sample: t is '1.0'; it must be a number of seconds"),
        (GOOD._replace(t=None), "IMU sample: t is None"),
        (GOOD._replace(t=True), "IMU sample: t is True; it must be a number of seconds"),
        (GOOD._replace(t=1.7e12), "IMU sample: t is 1700000000000.0; .* seconds, at most 1e[+]11"),
        (GOOD._replace(dt=True), "IMU sample at 1.000 s: dt is True"),
        (GOOD._replace(dt=10), "IMU sample at 1.000 s: dt is 10 s; .*; is it in ms?"),
        (GOOD._replace(dt=None), "IMU sample at 1.000 s: dt is None"),
        (GOOD._replace(dt=0.0), "IMU sample at 1.000 s: dt is 0 s; it must be above 0"),
        (GOOD._replace(dt=-0.05), "IMU sample at 1.000 s: dt is -0.05 s"),
        (GOOD._replace(dt=50.0), "IMU sample at 1.000 s: dt is 50 s; .* at most 1"),
        (GOOD._replace(dtheta=(0.0, 0.0)), "IMU sample at 1.000 s: dtheta is .*; it must be three"),
        (GOOD._replace(dtheta=0.1), "IMU sample at 1.000 s: dtheta is 0.1; it must be three numb"),
        (GOOD._replace(dtheta="abc"), "IMU sample at 1.000 s: dtheta is 'abc'"),
        (GOOD._replace(dv=(1, 2, None)), r"IMU sample at 1.000 s: dv is \(1, 2, None\)"),
        (GOOD._replace(dv=np.zeros((1, 3))), "IMU sample at 1.000 s: dv is array"),
    ],
)
def test_what_is_no_sample_is_refused(wrong, text):
    stream = stream_of(flight())
    with pytest.raises(DataError, match=f"^{text}") as error:
        stream.step(wrong)
    assert "\n" not in str(error.value) and no_harm(stream)


@pytest.mark.parametrize(
    "fix, text",
    [
        ({"y": (1.56, 0.2, 300.0)}, "latitude is 89.3814 deg; results hold up to 89 deg"),
        (
            {"y": (0.8, 170.0, 300.0)},
            "longitude is 170 rad; is the unit deg, or is a scale missing",
        ),
        ({"y": (0.8, 0.2, 3e6)}, "length is 3e[+]06 m; is the unit mm or ft?"),
        ({"source": 1, "y": (3e4, 0.0, 0.0)}, "speed is 30000 m/s; is the unit mm/s or cm/s?"),
    ],
)
def test_units_of_fixes_are_refused_in_the_words_of_a_recording(fix, text):
    stream, wrong = (
        stream_of(flight()),
        Measurement(1.5, 0, (0.8, 0.2, 300.0), (1.0,) * 3)._replace(**fix),
    )
    name = ("GNSS position", "GNSS velocity")[wrong.source]
    with pytest.raises(DataError, match=f"^fix at 1.500 s: {name}: {text}"):
        stream.step(wrong)
    source = sd.Source(
        "velocity" if wrong.source else "position",
        np.array([1.5]),
        np.array([wrong.y]),
        np.ones((1, 3)),
    )
    imu = flight().imu
    with pytest.raises(DataError, match=text):
        sd.Recording.from_arrays(imu.t, imu.dtheta, imu.dv, [source], kind="increment")
    assert no_harm(stream)


@pytest.mark.parametrize("latitude", [47.6, -1.6, np.float64(90.0)])
def test_a_latitude_in_degrees_is_named_so(latitude):
    stream = stream_of(flight())
    with pytest.raises(DataError) as error:
        stream.step(Measurement(1.5, 0, (latitude, 0.2, 300.0), (1.0,) * 3))
    text = f"latitude is {latitude:g} rad; is it in degrees?"
    assert str(error.value) == f"fix at 1.500 s: GNSS position: {text}" and no_harm(stream)


@pytest.mark.parametrize(
    "kind, y, text",
    [
        (
            "pressure",
            (1013.0,),
            "pressure is 1013 Pa, but that of air is 5000 to 200000: hPa or mbar",
        ),
        ("attitude", (10.0, 2.0, 1.0), "roll is 572.958 deg, but at most 360"),
        ("attitude", (0.1, 1.7, 1.0), "pitch is 97.4028 deg, but at most 90"),
        ("magnetic-field", (45.0, 0.0, 0.0), "magnetic field is 45 T; the Earth's is 22 to 67 uT"),
    ],
)
def test_units_of_other_kinds(kind, y, text):
    n = len(y)
    empty = sd.Source(kind, np.empty(0), np.empty((0, n)), np.empty((0, n)))
    stream = Stream(
        "closed-loop", start=start(flight()), imu="tactical", sources=[*flight().sources, empty]
    )
    with pytest.raises(DataError, match=f"^fix at 1.500 s: {kind}: {text}"):
        stream.step(Measurement(1.5, 2, y, (1.0,) * n))
    assert no_harm(stream)


def test_a_time_that_is_none_is_refused():
    with pytest.raises(DataError, match="^fix: t is 'noon'; it must be a number of seconds"):
        stream_of(flight()).step(Measurement("noon", 0, (0.8, 0.2, 300.0), (1.0,) * 3))


@pytest.mark.parametrize("begin", [True, False])
@pytest.mark.parametrize("gyro, accel", [(1.0, 1 / 9.80665), (1.0, 20.0), (1.0, -1.0), (1e3, 1.0)])
def test_units_of_samples_are_refused_after_ten_seconds(gyro, accel, begin):
    recording = flight()
    imu = recording.imu._replace(dtheta=recording.imu.dtheta * gyro, dv=recording.imu.dv * accel)
    with pytest.raises(DataError) as expected:
        first = imu.t <= 10.0 + 1e-6
        imu_from_arrays(imu.t[first], imu.dtheta[first], imu.dv[first], "increment")
    stream = Stream(
        "closed-loop",
        start=start(recording) if begin else None,
        imu="tactical",
        sources=recording.sources,
    )
    samples = [Sample(*row) for row in zip(*(column.tolist() for column in imu))]
    with pytest.raises(DataError) as error:
        play(stream, samples)
    assert str(error.value) == str(expected.value)
    with pytest.raises(DataError, match="^IMU: "):
        play(stream, samples[-1:])
    (event,) = [event for event in stream.events if event[1].startswith("IMU: ")]
    assert event[0] == pytest.approx(10.0, abs=0.06) and event[1] == str(error.value)


@pytest.mark.parametrize(
    "option, text",
    [
        ({"every": 0}, "every is 0; it must be a whole number, 1 or more"),
        ({"history": 10}, "history is 10 samples; it must be a whole number, 100 or more"),
        ({"history": 10**12}, "history is 1000000000000 samples; .* at most 1e[+]07"),
        ({"history": 10**7, "covariance": True}, "history is 10000000 samples; .* at most 2e[+]06"),
        ({"align_within": -1.0}, "align_within is -1.0 s"),
        ({"sources": None}, r"sources is None; it must be a list of Source, \[\] for none"),
        ({"sources": "position"}, "sources is 'position'; it must be a list of Source"),
        ({"sources": ["position"]}, r"sources\[0\] is 'position'; it must be a Source"),
        ({"sources": flight().sources[0]}, "sources is one Source; it must be a list of them"),
        ({"on_event": "print"}, "on_event is 'print'; it must be a function of"),
        ({"on_event": 3}, "on_event is 3; it must be a function of"),
        ({"covariance": "no"}, "covariance is 'no'; it must be True or False"),
        ({"start": sd.InitialState("20")}, "start: t is '20'; it must be 1 finite number"),
        ({"imu": {}}, "imu is {}; a dict must have the fields of an ImuSpec"),
        ({"imu": None}, "give imu=, one of .*, or a file that describes it$"),
        ({"vehicle": {}}, "vehicle: it has no limit; give some of speed, acceleration, lowest, hi"),
        ({"ahrs_rate": 5.0}, "ahrs_rate is 5 Hz, but no AHRS runs"),
        ({"ahrs": "closed-loop"}, "closed-loop is not an AHRS"),
        ({"vehicle": "tram"}, "vehicle is 'tram'"),
        ({"start": 3.0}, "start is 3.0; it must be an InitialState"),
        (
            {"no_option": 3.0},
            "Stream has no option 'no_option'; one of the filter's own is given as",
        ),
        ({"options": {"no_option": 3.0}}, "filter 'closed-loop' has no option 'no_option'"),
    ],
)
def test_options_that_are_refused(option, text):
    given = {"start": start(flight()), "imu": "tactical", "sources": flight().sources} | option
    with pytest.raises(DataError, match=f"^{text}"):
        Stream("closed-loop", **given)


@pytest.mark.short
def test_sources_in_the_place_of_the_filter_are_refused_in_one_line():
    text = r"^filter is \(Source\(GNSS position, .*; it must be the name of a filter, or a Filter$"
    with pytest.raises(DataError, match=text):
        Stream(flight().sources, imu="tactical")
