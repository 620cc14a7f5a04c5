"""Reading attitudes: angles and quaternions in several conventions against scipy, missing
headings, what is refused, and checks against the gyro."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from nine_axis import TOML, attitude, tables
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.io import read, write_recording
from strapdown.io.inspection import draft, inspect

pytestmark = pytest.mark.short
T = 0.1 * np.arange(1, 1001)
TRUE = attitude(T)
ENU_OF_NED = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])  # its own inverse
FLU_OF_FRD = Rotation.from_matrix(np.diag([1.0, -1, -1]))
IMU = TOML[TOML.index("[imu]") : TOML.index("[[source]]")]
PART = """[[source]]
kind = "attitude"
file = "ahrs.csv"
time = { column = "t", unit = "s" }
columns = ["roll", "pitch", "heading"]
unit = "deg"
std = [0.5, 0.5, 2.0]
"""


def angles(turn=TRUE):
    """Roll, pitch and heading in deg, as a frame with the times."""
    return pd.DataFrame(
        np.c_[T, turn.as_euler("ZYX", degrees=True)[:, ::-1]],
        columns=["t", "roll", "pitch", "heading"],
    )


def quaternion(turn=TRUE):
    return pd.DataFrame(np.c_[T, turn.as_quat()], columns=["t", "qx", "qy", "qz", "qw"])


@pytest.fixture
def build(tmp_path):
    """Function (frame, change of the section) -> path of recording.toml."""

    def build(frame=None, toml=lambda text: text, more=""):
        tables()[0].to_csv(tmp_path / "imu.csv", index=False)
        (angles() if frame is None else frame).to_csv(tmp_path / "ahrs.csv", index=False)
        path = tmp_path / "recording.toml"
        path.write_text(IMU + toml(PART) + more)
        return path

    return build


def difference(y, turn=TRUE):
    return (Rotation.from_euler("ZYX", y[:, ::-1]) * turn.inv()).magnitude().max()


def columns(names, **more):
    text = ", ".join(f'"{name}"' for name in names)
    return lambda s: (
        s.replace('"roll", "pitch", "heading"', text)
        + "".join(f'{key} = "{value}"\n' for key, value in more.items())
    )


def test_angles_in_either_unit(build):
    recording = read(build())
    (fixes,) = recording.sources
    np.testing.assert_allclose(
        fixes.y, np.radians(angles()[["roll", "pitch", "heading"]]), rtol=1e-12
    )
    np.testing.assert_allclose(fixes.std, np.radians(np.tile([0.5, 0.5, 2.0], (1000, 1))))
    assert fixes.kind == "attitude" and fixes.parameters == () and recording.meta["notes"] == []
    rad = angles().assign(
        **{name: np.radians(angles()[name]) for name in ("roll", "pitch", "heading")}
    )
    (again,) = read(
        build(rad, lambda s: s.replace('"deg"', '"rad"').replace("[0.5, 0.5, 2.0]", "0.01"))
    ).sources
    np.testing.assert_allclose(again.y, fixes.y, rtol=1e-9)
    assert (again.std == 0.01).all()


@pytest.mark.parametrize(
    "names, order", [(["qw", "qx", "qy", "qz"], "wxyz"), (["qx", "qy", "qz", "qw"], "xyzw")]
)
def test_quaternions_in_both_orders(build, names, order):
    (fixes,) = read(build(quaternion(), columns(names, quaternion=order))).sources
    assert difference(fixes.y) < 1e-9 and fixes.std[0, 2] == pytest.approx(np.radians(2.0))
    # as 16-bit counts
    counts = quaternion().assign(**{name: (quaternion()[name] * 32768).round() for name in names})
    (scaled,) = read(
        build(counts, lambda s: columns(names, quaternion=order)(s) + f"scale = {1 / 32768}\n")
    ).sources
    assert difference(scaled.y) < 1e-4


def test_other_axes_for_quaternions_and_angles(build):
    """An AHRS that tells the attitude of forward, left, up in east, north, up; yaw then counts
    from east, against the clock."""
    told = ENU_OF_NED * TRUE * FLU_OF_FRD.inv()
    (fixes,) = read(
        build(
            quaternion(told),
            columns(["qw", "qx", "qy", "qz"], quaternion="wxyz", axes="FLU to ENU"),
        )
    ).sources
    assert difference(fixes.y) < 1e-9
    yaw = angles(told)
    (fixes,) = read(build(yaw, columns(["roll", "pitch", "heading"], axes="FLU to ENU"))).sources
    assert difference(fixes.y) < 1e-9
    np.testing.assert_allclose(
        np.exp(1j * fixes.y[:, 2]), np.exp(1j * (np.pi / 2 - np.radians(yaw.heading))), atol=1e-9
    )
    (inverse,) = read(
        build(
            quaternion(told.inv()),
            lambda s: (
                columns(["qx", "qy", "qz", "qw"], quaternion="xyzw", axes="FLU to ENU")(s)
                + "scale = [-1, -1, -1, 1]\n"
            ),
        )
    ).sources
    assert difference(inverse.y) < 1e-9


def test_without_a_heading(build):
    (level,) = read(
        build(
            angles().drop(columns="heading"),
            lambda s: columns(["roll", "pitch"])(s).replace("[0.5, 0.5, 2.0]", "0.5"),
        )
    ).sources
    assert np.isnan(level.y[:, 2]).all() and np.isnan(level.std[:, 2]).all()
    np.testing.assert_allclose(level.y[:, :2], np.radians(angles()[["roll", "pitch"]]))
    told = angles(ENU_OF_NED * TRUE * FLU_OF_FRD.inv()).assign(
        heading=lambda f: f.heading.where(f.index % 2 == 0)
    )
    (mixed,) = read(build(told, columns(["roll", "pitch", "heading"], axes="FLU to ENU"))).sources
    np.testing.assert_allclose(mixed.y[:, :2], level.y[:, :2], atol=1e-9)
    assert np.isnan(mixed.y[1::2, 2]).all() and difference(mixed.y[::2], TRUE[::2]) < 1e-9


def test_roll_and_pitch_come_together(build):
    frame = angles()
    frame.loc[3, "roll"] = frame.loc[5, "pitch"] = np.nan
    recording = read(build(frame))
    assert (
        len(recording.sources[0].t) == 998
        and "2 rows without time, value" in recording.meta["notes"][0]
        and "line 5" in recording.meta["notes"][0]
    )
    y = np.radians(angles()[["roll", "pitch", "heading"]].to_numpy())
    y[3, 0] = np.nan
    imu = tables()[0].to_numpy()
    made = Recording.from_arrays(
        imu[:, 0], imu[:, 1:4], imu[:, 4:7], (Source("attitude", T, y, np.full((1000, 3), 0.01)),)
    )
    assert len(made.sources[0].t) == 999
    y[3, 0], y[5, 1] = np.inf, 2.0
    with pytest.raises(DataError, match="^attitude, row 5: pitch is 114.592 deg"):
        Recording.from_arrays(
            imu[:, 0],
            imu[:, 1:4],
            imu[:, 4:7],
            (Source("attitude", T, y, np.full((1000, 3), 0.01)),),
        )
    frame.loc[:, "roll"] = np.inf
    with pytest.raises(DataError, match="no usable fix of kind attitude"):
        read(build(frame, columns(["roll", "pitch", "heading"], axes="FLU to ENU")))


def test_deviations_from_columns_and_a_clock_that_is_set(build):
    frame = angles().assign(std=0.3, sdh=0.02, t=1e3 * (T + 5))
    (fixes,) = read(
        build(
            frame,
            lambda s: s.replace(
                "[0.5, 0.5, 2.0]", '["std", "std", { column = "sdh", unit = "rad" }]'
            ).replace(
                '{ column = "t", unit = "s" }', '{ column = "t", unit = "ms", offset = -5.0 }'
            ),
        )
    ).sources
    np.testing.assert_allclose(fixes.std[0], [np.radians(0.3), np.radians(0.3), 0.02])
    np.testing.assert_allclose(fixes.t, T, atol=1e-9)


def test_the_same_words_in_a_reference(build):
    position = 'time = { column = "t", unit = "s" }\nposition = { columns = ["lat", "lon", "alt"], unit = ["deg", "deg", "m"] }\n'
    frame = quaternion(ENU_OF_NED * TRUE * FLU_OF_FRD.inv()).assign(
        lat=47.0, lon=8.0, alt=500.0, roll=1.0, pitch=2.0, heading=3.0
    )
    frame.loc[4, "qx"] = np.nan
    more = (
        '\n[reference]\nfile = "ahrs.csv"\n'
        + position
        + 'attitude = { columns = ["qx", "qy", "qz", "qw"], quaternion = "xyzw", axes = "FLU to ENU" }\n'
    )
    path = build(frame, lambda s: "", more)
    reference = read(path).reference
    known = np.isfinite(reference.q_nb).all(axis=1)
    assert (~known).sum() == 1 and (
        Rotation.from_quat(reference.q_nb[known][:, [1, 2, 3, 0]]) * TRUE[known].inv()
    ).magnitude().max() < 1e-9
    for change, words in (
        ('quaternion = "xyzw", ', "for a quaternion give the order"),
        ('axes = "FLU to ENU"', 'unit = "deg"'),
        ('"FLU to ENU"', '"ENU"'),
    ):
        path.write_text(IMU + more.replace(change, "" if "order" in words else words))
        with pytest.raises(
            DataError,
            match="order"
            if "order" in words
            else "a quaternion has none|write the axes of the body",
        ):
            read(path)


@pytest.mark.parametrize(
    "change, words",
    [
        (columns(["roll", "pitch", "yaw"]), "column 'yaw' is missing"),
        (
            columns(["roll", "heading"]),
            "'heading' has the name of a heading, but two columns are roll and pitch",
        ),
        (
            columns(["roll"]),
            "columns: 1 given; attitude is roll, pitch, heading, or roll and pitch alone",
        ),
        (columns(["roll", "pitch", "heading", "t"]), "for a quaternion give the order"),
        (
            columns(["roll", "pitch", "heading"], quaternion="wxyz"),
            r"3 given, a quaternion \(wxyz\) has 4",
        ),
        (
            columns(["qw", "qx", "qy", "qz"], quaternion="zyxw"),
            "quaternion: input should be 'wxyz' or 'xyzw'",
        ),
        (lambda s: s.replace('"deg"', '"m"'), "unit 'm' is one of length; accepted for angle"),
        (lambda s: s.replace('unit = "deg"\n', ""), "unit is missing; accepted for angle"),
        (lambda s: s.replace("[0.5, 0.5, 2.0]", "[0.5, 0.5]"), "std: 2 given, attitude has 3"),
        (
            lambda s: s.replace("[0.5, 0.5, 2.0]", "0"),
            "std is 0; it must be a finite number above 0",
        ),
        (lambda s: s + 'axes = "ENU"\n', 'such as "FLU to ENU"'),
        (lambda s: s + 'axes = "FLU to NUE"\n', "unknown axes 'NUE'"),
        (lambda s: s + 'axes = "FLU to +z +x +y"\n', "must point up or down"),
        (lambda s: s + 'axes = "FRU to NED"\n', "unknown axes 'FRU'"),
        (lambda s: s + 'axes = "+x +y -z to NED"\n', "left-handed"),
        (lambda s: s + "lever_arm = [0, 0, 0]\n", "lever_arm: attitude takes none"),
        (
            lambda s: (
                s.replace('"attitude"', '"velocity"').replace('"deg"', '"m/s"')
                + 'quaternion = "wxyz"\n'
            ),
            "quaternion: velocity takes none",
        ),
        (lambda s: s + "scale = [1, 1]\n", "scale: 2 given"),
    ],
)
def test_descriptions_with_mistakes(build, change, words):
    with pytest.raises(DataError, match=words) as error:
        read(build(toml=change))
    assert (
        "\n" not in str(error.value)
        and "recording.toml" in str(error.value)
        or "ahrs.csv" in str(error.value)
    )


def with_row(frame, **values):
    frame.loc[7, list(values)] = list(values.values())
    return frame


@pytest.mark.parametrize(
    "frame, toml, words",
    [
        (
            with_row(angles(), heading=400.0),
            lambda s: s,
            "line 9: heading is 400 deg, but at most 360.*wrap angles",
        ),
        (with_row(angles(), pitch=91.0), lambda s: s, "line 9: pitch is 91 deg, but at most 90"),
        (angles(), lambda s: s.replace('"deg"', '"rad"'), "line 2: roll is .*deg read as rad"),
        (
            angles(),
            lambda s: columns(["roll", "pitch", "heading"], axes="FLU to ENU")(s).replace(
                '"deg"', '"rad"'
            ),
            "line 2: roll is .*deg read as rad",
        ),
        (with_row(angles(), roll=-361.0), lambda s: s, "roll is -361 deg"),
        (
            angles().assign(**{k: np.radians(angles()[k]) for k in ("roll", "pitch", "heading")}),
            lambda s: s,
            r"\[\[source\]\] 1 \(attitude\) unit: .*0.019.* times as much as the gyro: rad read as deg",
        ),
        (
            angles().assign(**{k: np.radians(angles()[k]) for k in ("roll", "pitch")}),
            columns(["roll", "pitch"]),
            "std: 3 given, attitude has 2",
        ),
        (
            angles().assign(**{k: np.radians(angles()[k]) for k in ("roll", "pitch")}),
            lambda s: columns(["roll", "pitch"])(s).replace("[0.5, 0.5, 2.0]", "0.5"),
            "rad read as deg",
        ),
        (
            with_row(quaternion(), qw=0.0, qx=0.0, qy=0.0, qz=0.0),
            columns(["qw", "qx", "qy", "qz"], quaternion="wxyz"),
            r"line 9: quaternion \[0 0 0 0\] has norm 0, not 1; empty its cells",
        ),
        (
            with_row(quaternion(), qw=2.0),
            columns(["qw", "qx", "qy", "qz"], quaternion="wxyz"),
            "line 9: quaternion .* has norm 2.*check columns and scale",
        ),
        (
            angles().assign(roll=3.0, pitch=1.0, heading=40.0),
            lambda s: s,
            "no usable fix of kind attitude; it never changes while the gyro turns",
        ),
        (angles().assign(t=T + 1e5), lambda s: s, "nothing falls within the IMU record"),
    ],
)
def test_tables_with_mistakes(build, frame, toml, words):
    with pytest.raises(DataError, match=words) as error:
        read(build(frame, toml))
    assert "\n" not in str(error.value)


def test_stuck_fixes_are_dropped_and_counted(build):
    held = angles()
    held.loc[200:300, ["roll", "pitch", "heading"]] = held.loc[
        200, ["roll", "pitch", "heading"]
    ].to_numpy()
    recording = read(build(held))
    assert len(recording.sources[0].t) == 900 and any(
        "attitude: 100 rows dropped, stuck at one value" in note for note in recording.meta["notes"]
    )
    # a table that turns about the vertical
    flat = pd.DataFrame(np.c_[T, 0 * T, 0 * T], columns=["t", "roll", "pitch"])
    path = build(flat, lambda s: columns(["roll", "pitch"])(s).replace("[0.5, 0.5, 2.0]", "0.5"))
    imu = tables()[0].assign(gx=0.0, gy=0.0, gz=0.3, ax=0.0, ay=0.0, az=-9.81)
    imu.to_csv(path.parent / "imu.csv", index=False)
    assert len(read(path).sources[0].t) == 1000


def merged(frame):
    """The rows of the AHRS in a table of 100 Hz, whose other rows have empty cells."""
    table = pd.DataFrame({"t": 0.01 * np.arange(10, 10001)})
    table.loc[::10, ["roll", "pitch", "heading"]] = frame[["roll", "pitch", "heading"]].to_numpy()
    return table


@pytest.mark.parametrize("empty", [["roll"], ["roll", "pitch", "heading"]])
def test_missing_cells_of_a_merged_table_are_not_stuck_ones(build, empty):
    silent = angles()
    silent.loc[400:699, empty] = np.nan
    recording = read(build(merged(silent)))
    assert len(recording.sources[0].t) == 700
    (note,) = recording.meta["notes"]
    assert (
        "9291 rows without time, value or standard deviation dropped, the first in line 3" in note
    )
    held = angles()
    held.loc[200:300, ["roll", "pitch", "heading"]] = held.loc[
        200, ["roll", "pitch", "heading"]
    ].to_numpy()
    # empty cells between them do not hide those that are
    notes = read(build(merged(held))).meta["notes"]
    assert (
        "attitude: 100 rows dropped, stuck at one value" in notes[0]
        and "8991 rows without time, value" in notes[1]
        and len(notes) == 2
    )
    same = angles()
    same.loc[700, ["roll", "pitch", "heading"]] = same.loc[
        399, ["roll", "pitch", "heading"]
    ].to_numpy()
    same.loc[400:699, ["roll", "pitch", "heading"]] = np.nan
    assert len(read(build(same)).sources[0].t) == 700  # a value that is there again after a pause


def test_rows_without_heading_are_counted_with_their_longest_pause(build):
    frame = angles()
    frame.loc[[5, 7, *range(400, 450), *range(900, 1000)], "heading"] = np.nan
    expected = "attitude: 152 rows of 1000 without heading, the longest time without one 10 s from 90.000 s"
    assert read(build(frame)).meta["notes"] == [expected]
    assert f"note: {expected}" in inspect(build(frame)).facts
    # none at all: it gives roll and pitch alone
    assert read(build(angles().assign(heading=np.nan))).meta["notes"] == []


def test_rad_read_as_deg_in_a_merged_table(build):
    path = build(merged(angles() * [1, *[np.pi / 180] * 3]))
    with pytest.raises(
        DataError,
        match=r"\[\[source\]\] 1 \(attitude\) unit: .* 0.019.* times as much as the gyro: rad read as deg",
    ):
        read(path)
    assert any("rad read as deg" in problem for problem in inspect(path).problems)


def test_rad_read_as_deg_in_arrays_and_netcdf(build, tmp_path):
    good = read(build())
    (box,) = good.sources
    wrong = replace(box, y=np.radians(box.y), name="box")
    imu = tables()[0].to_numpy()
    with pytest.raises(DataError, match="^box unit: the attitude turns 0.019.* rad read as deg"):
        Recording.from_arrays(imu[:, 0], imu[:, 1:4], imu[:, 4:7], (wrong,))
    write_recording(replace(good, sources=(wrong,)), tmp_path / "a.nc")
    with pytest.raises(DataError, match="box unit: the attitude turns 0.019"):
        read(tmp_path / "a.nc")
    assert any("rad read as deg" in problem for problem in inspect(tmp_path / "a.nc").problems)


def test_a_round_trip_through_netcdf(build, tmp_path):
    recording = read(
        build(
            angles().assign(heading=lambda f: f.heading.where(f.index > 9)),
            lambda s: s + 'name = "xsens"\ngate = 9.0\n',
        )
    )
    write_recording(recording, tmp_path / "a.nc")
    (one,), (other,) = recording.sources, read(tmp_path / "a.nc").sources
    assert (other.kind, other.name, other.gate, other.parameters) == ("attitude", "xsens", 9.0, ())
    np.testing.assert_array_equal(np.c_[one.t, one.y, one.std], np.c_[other.t, other.y, other.std])
    assert "turns of xsens against those of the gyro: correlation 1.000" in str(
        inspect(tmp_path / "a.nc")
    )


def test_inspection_of_a_good_record(build):
    found = inspect(build())
    assert found.problems == () and any(
        "turns of attitude against those of the gyro: correlation 1.000, attitude / gyro 1 ("
        in fact
        for fact in found.facts
    ), found


def mixed(gyro_axes):
    """The angles of a body whose axes are not those of the IMU."""
    return angles(TRUE * Rotation.from_matrix(gyro_axes).inv())


@pytest.mark.parametrize(
    "frame, words",
    [
        (
            angles().assign(t=T + 0.5),
            "fits the gyro best with -0.50 s added to its time, or +0.50 s to that of the IMU: check `offset`",
        ),
        (
            mixed([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]),
            "it turns like a gyro with the axes '+y +x -z'",
        ),
        (
            angles().assign(
                pitch=lambda f: f.pitch / 4,
                roll=lambda f: f.roll / 4,
                heading=lambda f: f.heading / 4,
            ),
            "times as much as the gyro: an incorrect unit or scale",
        ),
        (
            angles()
            .assign(heading=angles().heading.to_numpy(), t=T)
            .iloc[np.repeat(np.arange(0, 1000, 4), 4)]
            .assign(t=T),
            "75 % of the fixes repeat",
        ),
    ],
)
def test_inspection_names_what_is_wrong(build, frame, words):
    problems = inspect(build(frame)).problems
    assert any(words in problem for problem in problems), problems


def test_inspection_compares_the_vertical_at_rest(build, tmp_path):
    path = build(angles().assign(roll=0.0, pitch=20.0, heading=50.0))
    tables()[0].assign(gx=0.0, gy=0.0, gz=0.0, ax=0.0, ay=0.0, az=-9.81).to_csv(
        tmp_path / "imu.csv", index=False
    )
    found = inspect(path)
    assert any(
        "at rest its vertical is 20 deg from that of the accelerometer" in problem
        for problem in found.problems
    ), found


def test_reports_show_its_innovations_in_degrees():
    from types import SimpleNamespace

    from strapdown.pages.fix_figures import unit

    unit_name, factor, rows = unit(SimpleNamespace(meta={"kinds": {"xsens": "attitude"}}), "xsens")
    assert (unit_name, rows) == ("deg", ("roll", "pitch", "heading")) and factor == pytest.approx(
        180 / np.pi
    )


def test_a_draft_has_the_attitude_commented_out(tmp_path):
    imu = tables()[0].iloc[4::5].reset_index(drop=True)
    frame = pd.concat(
        [
            imu,
            angles()
            .drop(columns="t")
            .rename(columns={"roll": "Roll_deg", "pitch": "Pitch_deg", "heading": "Yaw_deg"}),
        ],
        axis=1,
    ).assign(yaw_rate=0.1)
    frame.to_csv(tmp_path / "log.csv", index=False)
    text = draft([tmp_path / "log.csv"], {}, tmp_path)
    assert '# columns = ["Roll_deg", "Pitch_deg", "Yaw_deg"]' in text and '# unit = "deg"' in text
    assert any(
        "attitude: Roll_deg, Pitch_deg, Yaw_deg in deg" in fact
        for fact in inspect(tmp_path / "log.csv").facts
    )
    frame.rename(columns={"Yaw_deg": "Azimuth_deg"}).to_csv(tmp_path / "azimuth.csv", index=False)
    assert '# columns = ["Roll_deg", "Pitch_deg", "Azimuth_deg"]' in draft(
        [tmp_path / "azimuth.csv"], {}, tmp_path
    )
    path = tmp_path / "recording.toml"
    path.write_text(text)
    assert read(path).sources == ()
    head, part = text.split('# [[source]]\n# kind = "attitude"')
    path.write_text(head + '[[source]]\nkind = "attitude"' + part.replace("\n# ", "\n"))
    assert difference(read(path).sources[0].y) < 1e-9
