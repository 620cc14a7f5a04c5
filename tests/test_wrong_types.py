"""Every public function refuses arguments of a wrong type in one line that names the argument."""

import inspect

import pytest

import strapdown as sd
from strapdown.sim.trajectory import demo_flight


class Odd:
    """What no argument may be."""

    def __repr__(self):
        return "<Odd>"


WRONG = {"object": Odd(), "list": [Odd()], "number": 7}
FUNCTIONS = [name for name in sd.__all__ if inspect.isfunction(getattr(sd, name))]
SAID_AS = {"name": ("aircraft", "imu", "receiver", "scenario")}
"""{argument: words that name it, where a line does not have the argument's own}."""
FITS = {("simulate", "duration"), ("trim", "airspeed"), ("geomagnetic_field", "*")}
"""Functions and arguments that a number fits."""
NO_ARGUMENTS = {"examples", "reading_limits", "register", "scenarios", "vehicle_kits"}
"""Functions whose arguments have no places, and which have tests of their own."""


@pytest.fixture(scope="module")
def fitting():
    """{argument: a value that fits}."""
    recording = sd.simulate(demo_flight(), 20.0, "tactical", seed=1)
    solution = sd.fuse(recording, every=10)
    return {
        "recording": recording,
        "solution": solution,
        "trajectory": solution,
        "solutions": solution,
        "reference": recording.reference,
        "errors": solution.errors(),
        "imu": sd.imu("tactical"),
        "windows": [(1.0, 2.0)],
        "path": "nothing.nc",
        "file": "nothing.toml",
        "motion": "demo",
        "plan": "straight",
        "aircraft": "aerosonde",
        "airspeed": 25.0,
        "trim": sd.flight.trim("aerosonde", 25.0),
        "date": 2025.0,
        "lat": 0.5,
        "lon": 0.1,
        "name": "sbas",
        "f": [0.0, 0.0, -9.8],
    }


def first_arguments(name):
    """Arguments by place: those that are needed, and at least two."""
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    found = [
        p for p in inspect.signature(getattr(sd, name)).parameters.values() if p.kind in places
    ]
    needed = sum(p.default is p.empty for p in found)
    return [p.name for p in found[: max(needed, 2)]], needed


CASES = [
    (name, argument, kind)
    for name in FUNCTIONS
    if name not in NO_ARGUMENTS
    for argument in first_arguments(name)[0]
    for kind in WRONG
    if not (kind == "number" and FITS & {(name, argument), (name, "*")})
]


@pytest.mark.parametrize(("name", "argument", "kind"), CASES)
def test_a_wrong_type_is_refused_in_one_line(name, argument, kind, fitting, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, needed = first_arguments(name)
    place = arguments.index(argument)
    given = [fitting.get(each) for each in arguments[: max(needed, place + 1)]]
    given[place] = WRONG[kind]
    with pytest.raises(sd.DataError) as caught:
        getattr(sd, name)(*given)
    text = str(caught.value)
    words = (argument, *SAID_AS.get(argument, ()))
    assert "\n" not in text and any(word.rstrip("s") in text for word in words), text
    assert len(text) < 400


def test_every_function_is_here():
    assert {name for name, *_ in CASES} | NO_ARGUMENTS == set(FUNCTIONS)


def test_a_report_names_what_fits():
    for wrong in ("x", ["x"], {"a": "x"}):
        with pytest.raises(sd.DataError, match="'x'; it must be a Solution, a list of them"):
            sd.report(wrong)
