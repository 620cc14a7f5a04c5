"""Noise of a recording.toml changed in place: what else is in the file stays."""

import pytest

from strapdown.checks import DataError
from strapdown.io.description.rewriting import rewrite_text
from strapdown.io.description.rewriting_noise import NoiseEdit, change_noise, scaled_deviations

pytestmark = pytest.mark.short
MARK = "2026-11-23, tune"
SAID = "95 % 1.4 to 1.6"
END = f"{SAID}, {MARK}"
HEAD = """[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }   # of the logger
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
grade = "consumer"  # a guess

[[source]]  # the receiver
kind = "KIND"
file = "p.csv"
time = { column = "t", unit = "s" }
columns = ["a", "b", "c"]
"""
POSITION = HEAD.replace("KIND", "position") + 'unit = ["rad", "rad", "m"]\n'
VELOCITY = HEAD.replace("KIND", "velocity") + 'unit = "cm/s"\n'
SAME, APART = (1.5, 1.5, 1.5), (1.5, 1.5, 2.0)


def changed(tmp_path, text, edits):
    """What follows the head when edits, functions of the path, are made."""
    path = tmp_path / "recording.toml"
    path.write_text(text)
    kind = "position" if "position" in text else "velocity"
    return rewrite_text(path, [edit(path) for edit in edits], [kind], MARK, change_noise)


def scaled(factors):
    return lambda path: scaled_deviations(path, 0, factors, SAID)


@pytest.mark.parametrize(
    ("head", "old", "factors", "new"),
    [
        (VELOCITY, "std = 3      # by hand", SAME, f"std = 4.5      # by hand; {END}"),
        (VELOCITY, "std = 3", APART, f"std = [4.5, 4.5, 6.0]  # {END}"),
        (
            VELOCITY,
            'std = "s"',
            SAME,
            f'std = {{ column = "s", unit = "cm/s", scale = 1.5 }}  # {END}',
        ),
        (
            VELOCITY,
            'std = { column = "s", unit = "(m/s)^2" } # variance',
            SAME,
            f'std = {{ column = "s", unit = "(m/s)^2", scale = 2.25 }} # variance; {END}',
        ),
        (
            VELOCITY,
            'std = { column = "s", scale = 2.0, unit = "m/s" }',
            SAME,
            f'std = {{ column = "s", scale = 3.0, unit = "m/s" }}  # {END}',
        ),
        (
            POSITION,
            'std = ["s", # m, although the columns are rad\n  0.5,   # by tape\n  1,\n]',
            (1.5, 1.0, 2.0),
            'std = [{ column = "s", unit = "m", scale = 1.5 }, # m, although the columns are rad\n'
            f"  0.5,   # by tape\n  2.0,\n]  # {END}",
        ),
        (
            VELOCITY,
            '[source.std]\ncolumn = "s" # mine\nunit = "m/s"',
            SAME,
            f'[source.std]\ncolumn = "s" # mine\nunit = "m/s"\nscale = 1.5  # {END}',
        ),
    ],
)
def test_deviations_change_and_the_rest_stays(tmp_path, head, old, factors, new):
    assert changed(tmp_path, f"{head}{old}\n# end\n", [scaled(factors)]) == f"{head}{new}\n# end\n"


def test_a_second_change_takes_the_place_of_the_comment_of_the_first(tmp_path):
    once = changed(tmp_path, f"{VELOCITY}std = 3 # mine\n", [scaled(SAME)])
    assert changed(tmp_path, once, [scaled((2.0,) * 3)]) == f"{VELOCITY}std = 9.0 # mine; {END}\n"


@pytest.mark.parametrize("before", ["", "correlated = { std = 1, time = 3 }\n"])
def test_correlated_errors_are_added_or_replaced_and_the_grade_named(tmp_path, before):
    value = "{ std = [1.5, 1.5, 3.0], time = 30.0 }"
    edits = [
        lambda path: NoiseEdit(0, "correlated", (value,), SAID),
        lambda path: NoiseEdit(None, "grade", ('"a-imu.toml"',), SAID),
    ]
    made = changed(tmp_path, f"{VELOCITY}std = 3\n{before}", edits)
    head = VELOCITY.replace(
        'grade = "consumer"  # a guess', f'grade = "a-imu.toml"  # a guess; {END}'
    )
    assert made == f"{head}std = 3\ncorrelated = {value}  # {END}\n"


def test_axes_of_the_earth_cannot_change_by_row(tmp_path):
    text = HEAD.replace("KIND", "position") + 'unit = "m"\naxes = "ECEF"\nstd = 2.0\n'
    assert "std = 3.0" in changed(tmp_path, text, [scaled(SAME)])
    with pytest.raises(DataError, match="its std is in other axes"):
        changed(tmp_path, text, [scaled(APART)])
