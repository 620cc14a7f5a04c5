"""Values of a recording.toml changed in place: what else is in the file stays, byte by byte."""

import math
import tomllib

import pytest

from strapdown.checks import DataError
from strapdown.data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, SCALE
from strapdown.io.description.edits import Edit, edit_text
from strapdown.io.description.rewriting import rewrite, rewrite_text

MARK = "2026-11-22, calibrate installation"
KINDS = ["position", "velocity", "speed"]
TEXT = """# a drive
date = "2024-05-01"

[imu]
file = "imu.csv"  # the logger
time = { column = "t", unit = "s" }   # its clock
mounting = { roll = -179.364, pitch = 6.760, unit = "deg" }

# the receiver
[[source]]
kind = "position"
time = { column = "t", unit = "s", offset = -0.20 }       # of the receiver
lever_arm = [
  0.5,  # by tape
  0.2,
  -1.0,
]

# its Doppler
[[source]]
kind = "velocity"

[source.time]
column = "t"
unit = "s"

# the wheel
[[source]]
kind = "speed"
time.column = "t"
time.offset = 1.0 # by hand
scale = 0.001
# the end
"""


@pytest.fixture
def path(tmp_path):
    made = tmp_path / "recording.toml"
    made.write_text(TEXT)
    return made


def changed(path, *edits, kinds=KINDS):
    """Lines that are gone, and lines that are new."""
    old = path.read_text().splitlines()
    new = rewrite_text(path, edits, kinds, MARK).splitlines()
    return [line for line in old if line not in new], [line for line in new if line not in old]


@pytest.mark.short
@pytest.mark.parametrize(
    ("edit", "gone", "new"),
    [
        (
            Edit(0, CLOCK, (0.002,), (0.003,)),
            'time = { column = "t", unit = "s", offset = -0.20 }       # of the receiver',
            'time = { column = "t", unit = "s", offset = -0.198 }       # of the receiver; offset +- '
            f"0.003 s, {MARK}",
        ),
        (
            Edit(None, CLOCK, (-0.1,), (0.0114,)),
            'time = { column = "t", unit = "s" }   # its clock',
            'time = { column = "t", unit = "s", offset = -0.100 }   # its clock; offset +- 0.011 s, '
            f"{MARK}",
        ),
        (
            Edit(2, CLOCK, (0.25,), (0.004,)),
            "time.offset = 1.0 # by hand",
            f"time.offset = 1.250 # by hand; +- 0.004 s, {MARK}",
        ),
        (
            Edit(2, SCALE, (0.99,), (0.0002,)),
            "scale = 0.001",
            f"scale = 0.0009900  # +- 0.0002 of it, {MARK}",
        ),
        (
            Edit(
                None,
                MOUNTING,
                tuple(map(math.radians, (-179.364, 8.76, 1.5))),
                (0, 1e-3, 2e-3),
            ),
            'mounting = { roll = -179.364, pitch = 6.760, unit = "deg" }',
            'mounting = { roll = -179.364, pitch = 8.760, unit = "deg", heading = 1.500 }  # pitch +- '
            f"0.06 deg, heading +- 0.11 deg, {MARK}",
        ),
    ],
)
def test_one_line_changes_and_keeps_its_comment(path, edit, gone, new):
    assert changed(path, edit) == ([gone], [new])


@pytest.mark.short
def test_of_an_arm_over_several_lines_only_what_was_estimated_changes(path):
    gone, new = changed(path, Edit(0, LEVER_ARM, (1.234, 9.0, -1.5), (0.02, 0.0, 0.3)))
    assert gone == ["  0.5,  # by tape", "  -1.0,", "]"]
    assert new == [
        "  1.23,  # by tape",
        "  -1.50,",
        f"]  # forward +- 0.02 m, down +- 0.3 m, {MARK}",
    ]


@pytest.mark.short
def test_what_is_missing_is_added_at_the_end_of_its_section(path):
    text = rewrite_text(
        path,
        [Edit(1, LEVER_ARM, (1.0, 0.0, 2.0), (0.1, 0.0, 0.1)), Edit(1, CLOCK, (0.5,), (0.01,))],
        KINDS,
        MARK,
    )
    assert (
        f"""kind = "velocity"
lever_arm = [1.00, 0.00, 2.00]  # forward +- 0.10 m, down +- 0.10 m, {MARK}

[source.time]
column = "t"
unit = "s"
offset = 0.500  # +- 0.010 s, {MARK}

# the wheel
"""
        in text
    )
    plain = 'kind = "zero-lateral-velocity"\nrate = 10.0\n\n# the end\n'
    path.write_text(f"[imu]\nfile = 'x'\n\n[[source]]\n{plain}")
    assert changed(
        path,
        Edit(0, LEVER_ARM, (1.0, 0.0, 2.0), (0.2, 0.2, 0.2)),
        kinds=["zero-lateral-velocity"],
    )[1][0].startswith("lever_arm = [1.00, 0.00, 2.00]")
    edits = [Edit(None, MOUNTING, (0.0, 0.1, 0.0), (0.0, 1e-3, 0.0))]
    made = rewrite_text(path, edits, ["zero-lateral-velocity"], MARK)
    assert tomllib.loads(made)["imu"]["mounting"] == {"unit": "deg", "pitch": 5.73}


@pytest.mark.short
def test_what_was_said_before_is_replaced(path):
    edit = Edit(0, CLOCK, (0.002,), (0.003,))
    path.write_text(rewrite_text(path, [edit], KINDS, "2025-01-01, calibrate installation"))
    _, (line,) = changed(path, edit)
    assert line.endswith(f"# of the receiver; offset +- 0.003 s, {MARK}")
    assert "offset = -0.196" in line


@pytest.mark.short
def test_lines_end_as_they_did(path):
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    new = rewrite_text(path, [Edit(1, LEVER_ARM, (1.0, 0, 2.0), (0.1, 0, 0.1))], KINDS, MARK)
    assert new.count("\n") == new.count("\r\n") == TEXT.count("\n") + 1


@pytest.mark.short
def test_each_file_that_was_replaced_is_kept(path):
    edit = Edit(0, CLOCK, (0.1,), (0.003,))
    copies = [rewrite(path, [edit], KINDS, MARK) for _ in range(3)]
    assert [copy.name for copy in copies] == [
        f"recording.toml.before{number}" for number in ("", "-2", "-3")
    ]
    assert copies[0].read_text() == TEXT
    offsets = [
        tomllib.loads(each.read_text())["source"][0]["time"]["offset"] for each in [*copies, path]
    ]
    assert offsets == pytest.approx([-0.2, -0.1, 0.0, 0.1])
    assert len(list(path.parent.iterdir())) == 4


@pytest.mark.short
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            TEXT.replace('kind = "velocity"', 'kind = "position"'),
            "has [imu] and 3 [[source]] (position, position, speed), but the recording has "
            "position, velocity, speed; give the file from which it was read",
        ),
        (TEXT.replace("[imu]", "[other]"), "has no [imu] (position, velocity, speed), but"),
        (
            'source = [{ kind = "position", time = { column = "t" } }, { kind = "velocity" }, '
            '{ kind = "speed" }]\n[imu]\nfile = "x"\n',
            "its layout cannot be changed in place; change it by hand",
        ),
        (TEXT + "[imu]\n", "is not TOML: "),
    ],
)
def test_what_cannot_be_changed_is_refused_and_stays(path, text, said):
    path.write_text(text)
    with pytest.raises(DataError) as refused:
        rewrite(path, [Edit(0, CLOCK, (0.1,), (0.01,))], KINDS, MARK)
    assert said in str(refused.value) and "\n" not in str(refused.value)
    assert path.read_text() == text and len(list(path.parent.iterdir())) == 1


@pytest.mark.short
def test_a_file_that_is_read_only_stays(path):
    path.chmod(0o444)
    with pytest.raises(DataError, match="is read-only; make it writable, or change it by hand"):
        rewrite(path, [Edit(0, CLOCK, (0.1,), (0.01,))], KINDS, MARK)
    assert path.read_text() == TEXT and len(list(path.parent.iterdir())) == 1


def test_an_edit_is_told_with_the_digits_of_the_file():
    deg = math.radians(1.0)
    for edit, text in (
        (Edit(0, CLOCK, (-0.20123,), (0.0004,)), "time: add -0.2012 s to offset"),
        (
            Edit(0, LEVER_ARM, (1.0, 0.26, 0.0), (0.2, 0.004, 0.0)),
            "lever_arm = [1.00, 0.260, 0.000]",
        ),
        (
            Edit(None, MOUNTING, (deg, -2 * deg, 0.0), (0.0, 0.02 * deg, 0.0)),
            'mounting = { roll = 1.000, pitch = -2.000, heading = 0.000, unit = "deg" }',
        ),
        (Edit(2, SCALE, (1.01234,), (0.001,)), "scale: multiply by 1.0123"),
    ):
        assert edit_text(edit) == text


def test_a_clock_of_two_tables_is_left_to_the_user(path):
    own = 'accel = { columns = ["x", "y", "z"], time = { column = "t", unit = "s" } }\n'
    path.write_text(TEXT.replace("# the receiver", own))
    edit = Edit(None, CLOCK, (0.25,), (0.01,))
    with pytest.raises(DataError, match=r"\[imu\] accel has its own time; add \+0.25 s"):
        rewrite_text(path, [edit], KINDS, MARK)


def test_keys_beside_stay(path):
    keys = 'geoid = "EGM96"\nwhere = { column = "fix", least = 3 }  # 3D\n'
    path.write_text(TEXT.replace("lever_arm", keys + "lever_arm"))
    gone, new = changed(path, Edit(0, CLOCK, (0.125,), (0.01,)))
    assert len(gone) == len(new) == 1 and "offset = -0.075" in new[0]
