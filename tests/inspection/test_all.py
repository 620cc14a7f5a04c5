"""All checks together: right recordings are not accused, the true cause of a wrong one comes first,
and strange data end in a word, never in a traceback."""

import warnings
from dataclasses import replace
from pathlib import Path

import bent
import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.inspection.all import check

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"


@pytest.mark.parametrize("name", ["drive", "flight"])
def test_right_simulations_are_not_accused(request, name):
    assert check(request.getfixturevalue(name)).reasons == []


@pytest.mark.parametrize("name", ["thor75", "drive0708"])
def test_right_recordings_are_not_accused(data_folder, name):
    assert check(sd.read(EXAMPLES / f"{name}.toml")).reasons == []


def swisslog(folder, course, late=0.0):
    """The flight, its velocity made with the course taken for rad."""
    imu = pd.read_csv(folder / "swisslog" / "imu.csv.xz").to_numpy(float)
    gps = pd.read_csv(folder / "swisslog" / "gps.csv.xz").to_numpy(float)
    t, speed, course = gps[:, 0] - late, gps[:, 4], course(gps[:, 5])
    stds = np.full((len(t), 3), 1.5)
    lla = np.c_[np.radians(gps[:, 1:3]), gps[:, 3]]
    v = np.c_[speed * np.cos(course), speed * np.sin(course), gps[:, 6]]
    sources = Source("position", t, lla, stds), Source("velocity", t, v, stds / 5)
    return Recording.from_arrays(imu[:, 0], imu[:, 1:4], imu[:, 4:7], sources)


def test_a_recorded_flight_as_it_was_logged(data_folder):
    """Its column CourseDeg is in rad, and the receiver lags by some 0.25 s."""
    logged = check(swisslog(data_folder, np.radians)).reasons
    assert logged[0].cause == "unit" and "a course in rad read as deg" in logged[0].seen
    late = check(swisslog(data_folder, lambda course: course)).reasons
    assert late[0].cause == "clock" and late[0].source == ""
    assert check(swisslog(data_folder, lambda course: course, 0.25)).reasons == []


FAULTS = [
    (lambda r: bent.later(r, 18.0), "clock"),
    (lambda r: bent.later(r, -0.25), "clock"),
    (lambda r: bent.later(r, 0.25, "velocity"), "clock"),
    (lambda r: bent.imu(r, bent.turned(90)), "axes"),
    (lambda r: bent.imu(r, np.diag([1, -1, 1])), "axes"),
    (lambda r: bent.imu(r, np.eye(3), np.diag([1, 1, -1])), "axes"),
    (lambda r: bent.velocity(r, lambda v: v[:, [1, 0, 2]] * [1, 1, -1]), "frame"),
    (lambda r: bent.velocity(r, lambda v: v * 3.6), "unit"),
    (lambda r: bent.velocity(r, lambda v: v * 1e3), "unit"),
]


@pytest.mark.parametrize("number", range(len(FAULTS)))
def test_the_true_cause_comes_first(drive, number):
    fault, cause = FAULTS[number]
    found = check(fault(drive))
    assert found.reasons[0].cause == cause, found.reasons
    assert [r.weight for r in found.reasons] == sorted(r.weight for r in found.reasons)[::-1]


def strange():
    """{what: change of a source} that no receiver should send, and some do."""
    nan = lambda a: replace(a, y=np.full_like(a.y, np.nan))
    return {
        "empty": lambda a: a.between(0, 0),
        "one fix": lambda a: a.between(100.0, 100.3),
        "a few": lambda a: a.between(100.0, 110.0),
        "nan": nan,
        "nan heights": lambda a: replace(a, y=a.y * [1, 1, np.nan]),
        "nan here and there": lambda a: replace(
            a, y=np.where(np.arange(len(a.t))[:, None] % 3 == 0, np.nan, a.y)
        ),
        "constant": lambda a: replace(a, y=np.tile(a.y[:1], (len(a.t), 1))),
        "zero": lambda a: replace(a, y=0 * a.y),
        "outside": lambda a: replace(a, t=a.t + 1e6),
        "before and after": lambda a: a.without([(10.0, 230.0)]),
        "one time": lambda a: replace(a, t=np.full_like(a.t, 50.0)),
        "huge": lambda a: replace(a, y=a.y * [1, 1, 1e6]),
    }


@pytest.mark.parametrize("what", strange())
@pytest.mark.parametrize("kinds", [("position",), ("position", "velocity")])
def test_strange_fixes(drive, what, kinds):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(bent.with_sources(drive, strange()[what], kinds))


def test_strange_samples(drive):
    imu = drive.imu
    few = imu._replace(**{name: column[:2] for name, column in imu._asdict().items()})
    gap = imu._replace(**{name: column[::4000] for name, column in imu._asdict().items()})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for samples in (few, gap, imu._replace(dtheta=0 * imu.dtheta, dv=0 * imu.dv)):
            check(replace(drive, imu=samples))
        check(replace(drive, sources=()))
