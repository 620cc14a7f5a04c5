"""Reading magnetometers: units, axes, calibration, the Earth's field from model, description or
record, and every mistake said."""

import numpy as np
import pandas as pd
import pytest
from nine_axis import COLUMNS, EARTH, PLACE, added, build, tables, turned, without  # noqa: F401 (a fixture)

from strapdown.checks import DataError
from strapdown.io import read, write_recording
from strapdown.io.inspection import inspect

pytestmark = pytest.mark.short


def test_field_in_body_axes_and_reference(build):
    recording = read(build())
    (mag,) = recording.sources
    np.testing.assert_allclose(mag.y, tables()[1][COLUMNS] * 1e-6, rtol=1e-9)
    np.testing.assert_allclose(mag.std, 0.5e-6)
    assert mag.parameters == EARTH.field and recording.meta["place"] == pytest.approx(PLACE)
    (note,) = recording.meta["notes"]
    assert (
        note.startswith(
            "magnetic-field: the Earth's field is that of WMM2020 on 2024-05-01 at 47.000, 8.000 deg: declination 3."
        )
        and "dip 63." in note
    )


@pytest.mark.parametrize(
    "unit, size", [("T", 1e-6), ("uT", 1.0), ("nT", 1e3), ("gauss", 1e-2), ("mgauss", 10.0)]
)
def test_units(build, unit, size):
    scaled = lambda frame: frame.assign(**{name: frame[name] * size for name in COLUMNS})
    (mag,) = read(build(mag=scaled, toml=lambda s: s.replace('"uT"', f'"{unit}"'))).sources
    np.testing.assert_allclose(mag.y, tables()[1][COLUMNS] * 1e-6, rtol=1e-9)
    np.testing.assert_allclose(mag.std, 0.5e-6 / size)


def test_axes_turn_values_and_deviations(build):
    recording = read(
        build(
            mag=turned([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
            toml=lambda s: s.replace("std = 0.5", 'std = [0.1, 0.2, 0.3]\naxes = "+x -z +y"'),
        )
    )
    np.testing.assert_allclose(recording.sources[0].y, tables()[1][COLUMNS] * 1e-6, rtol=1e-9)
    np.testing.assert_allclose(recording.sources[0].std[0], [0.1e-6, 0.3e-6, 0.2e-6])


def test_calibration_acts_in_the_axes_of_the_columns(build, tmp_path):
    matrix, bias = (
        np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.02], [0.0, 0.02, 1.05]]),
        np.array([20.0, -30.0, 10.0]),
    )
    (tmp_path / "mag.toml").write_text(
        f"[magnetometer]\nbias = {(bias * 1e-6).tolist()}\nmatrix = {matrix.tolist()}\n"
    )
    C = np.diag([1.0, -1.0, -1.0])

    def raw(frame):
        sensor = frame[COLUMNS].to_numpy() @ C
        return frame.assign(**dict(zip(COLUMNS, np.linalg.solve(matrix, sensor.T) + bias[:, None])))

    described = added('axes = "+x -y -z"\ncalibration = "mag.toml"')
    recording = read(build(mag=raw, toml=described))
    np.testing.assert_allclose(recording.sources[0].y, tables()[1][COLUMNS] * 1e-6, atol=1e-12)
    assert len(recording.meta["notes"]) == 1
    (tmp_path / "mag.toml").write_text("[gyro]\nbias = [0.0, 0.0, 0.0]\n")
    with pytest.raises(DataError, match="magnetometer"):
        read(build(mag=raw, toml=described))
    assert "its strength varies from" in " ".join(
        read(build(mag=raw, toml=added('axes = "+x -y -z"'))).meta["notes"]
    )


def test_the_place_is_else_the_first_complete_position_fix(build, tmp_path):
    columns = {
        "t": [0.5, 0.8, 1.0, 2.0],
        "lat": [46.0, np.nan, 47.0, 48.0],
        "lon": [7.0, 7.0, 8.0, 9.0],
        "h": [np.nan, 500.0, 500.0, 500.0],
    }
    pd.DataFrame(columns).to_csv(tmp_path / "gnss.csv", index=False)
    fixes = (
        '\n[[source]]\nkind = "position"\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\ncolumns = ["lat", "lon", "h"]\n'
        'unit = ["deg", "deg", "m"]\nstd = 2.0\n'
    )
    recording = read(build(toml=lambda text: without("place")(text) + fixes))
    assert (
        recording.sources[0].parameters == pytest.approx(EARTH.field)
        and "place" not in recording.meta
    )


def test_field_given(build):
    recording = read(
        build(toml=added('field = { north = 21.0, east = 1.5, down = 43.0, unit = "uT" }'))
    )
    assert (
        recording.sources[0].parameters == pytest.approx((21e-6, 1.5e-6, 43e-6))
        and recording.meta["notes"] == []
    )
    assert "its median strength is 48.2 uT, but that of the Earth's field is 28.6 uT" in " ".join(
        read(
            build(toml=added('field = { north = 200, east = 0, down = 205, unit = "mgauss" }'))
        ).meta["notes"]
    )


@pytest.mark.parametrize(
    "line, angle, words",
    [
        ("", 0.0, "headings are from magnetic north"),
        ('declination = { value = -3.0, unit = "deg" }', -3.0, "-3.00 deg as given"),
    ],
)
def test_field_of_the_record(build, line, angle, words):
    recording = read(build(toml=added('field = "record"\n' + line)))
    north, east, down = recording.sources[0].parameters
    assert np.hypot(north, east) == pytest.approx(
        EARTH.horizontal, rel=0.01
    ) and down == pytest.approx(EARTH.field[2], rel=0.01)
    assert (
        np.degrees(np.arctan2(east, north)) == pytest.approx(angle)
        and words in recording.meta["notes"][0]
    )


def test_what_the_field_needs(build):
    for key, words in (
        ("date", 'the geomagnetic model needs the date: add date = "2012-10-10"'),
        ("place", "needs the place: add place = {"),
    ):
        with pytest.raises(
            DataError, match=r"\[\[source\]\] 1 \(magnetic-field\) field: is missing, and "
        ) as error:
            read(build(toml=without(key)))
        assert words in str(error.value)
    with pytest.raises(
        DataError, match="field: date 1850-01-01 is before the oldest geomagnetic model"
    ):
        read(build(toml=lambda s: s.replace("2024-05-01", "1850-01-01")))
    with pytest.raises(DataError, match='"record" needs times without acceleration'):
        read(
            build(
                toml=added('field = "record"'),
                imu=lambda f: f.assign(ax=2 * f.ax, ay=2 * f.ay, az=2 * f.az),
            )
        )


REFUSED = {
    "left-handed axes": (added('axes = "+x +y -z"'), "axes: axes '+x +y -z' are left-handed"),
    "lever arm": (added("lever_arm = [1.0, 0.0, 0.0]"), "lever_arm: magnetic-field takes none"),
    "field without unit": (
        added("field = { north = 20.0, east = 1.0, down = 43.0 }"),
        "field: give { north = 17.6",
    ),
    "field in gauss said to be T": (
        added('field = { north = 0.2, east = 0.0, down = 0.4, unit = "T" }'),
        "its strength is 4.472e+05 uT, but the Earth's is 22 to 67 uT",
    ),
    "declination of the model": (
        added('declination = { value = 3.0, unit = "deg" }'),
        'declination: it belongs to field = "record"',
    ),
    "declination without unit": (
        added('field = "record"\ndeclination = { value = 3.0 }'),
        "declination.unit: unit is missing; accepted for angle",
    ),
    "field without a horizontal part": (
        added('field = { north = 0.0, east = 0.0, down = 48.0, unit = "uT" }'),
        "field: it has no horizontal part and so gives no heading",
    ),
    "unit spelt G": (
        lambda s: s.replace('"uT"', '"G"'),
        "unknown unit 'G' (did you mean 'gauss'?); accepted for magnetic field: T, uT, nT, gauss, mgauss",
    ),
    "unit spelt mG": (lambda s: s.replace('"uT"', '"mG"'), "did you mean 'mgauss'?"),
    "unit in capitals": (lambda s: s.replace('"uT"', '"UT"'), "did you mean 'uT'?"),
    "unit of another kind": (lambda s: s.replace('"uT"', '"hPa"'), "unit 'hPa' is one of pressure"),
    "place in no unit": (
        lambda s: s.replace(', unit = "deg" }', " }"),
        "[place] unit: unit is missing",
    ),
    "place out of range": (
        lambda s: s.replace("latitude = 47.0", "latitude = 470.0"),
        "[place] no place is at latitude 470",
    ),
    "place at the pole": (
        lambda s: s.replace("latitude = 47.0", "latitude = 89.7"),
        "results hold up to 89 deg",
    ),
    "place with a misspelt key": (
        lambda s: s.replace("longitude", "longtitude"),
        "[place] unknown key 'longtitude' (did you mean 'longitude'?)",
    ),
    "values in nT said to be uT": (
        lambda s: s.replace("std = 0.5", "std = 0.5\nscale = 1000"),
        "mag.csv, line",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(build, case):
    change, words = REFUSED[case]
    with pytest.raises(DataError) as error:
        read(build(toml=change))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_other_kinds_take_no_calibration(build):
    with pytest.raises(
        DataError, match="calibration: pressure takes none; only a magnetometer does"
    ):
        read(
            build(
                toml=lambda s: (
                    s.replace("magnetic-field", "pressure")
                    .replace('["mx", "my", "mz"]', '["mx"]')
                    .replace('"uT"', '"Pa"')
                    + 'calibration = "c.toml"\n'
                )
            )
        )


def notes(path):
    return " ".join(read(path).meta["notes"])


def test_an_uncalibrated_one_is_said(build):
    path = build(mag=lambda f: f.assign(mx=f.mx + 25.0))
    assert "its strength varies from" in notes(
        path
    ) and "calibrate it (`strapdown calibrate`)" in notes(path)
    assert any("calibrate it" in problem for problem in inspect(path).problems)
    assert "that of the Earth's field is 48.2 uT: check the unit" in notes(
        build(toml=added("scale = 0.3"))
    )


@pytest.mark.parametrize(
    "scale, unit, words",
    [
        (
            1.0,
            "nT",
            "its median strength is 0.0482 uT, but that of the Earth's field 48.2 uT: is the unit uT, not nT?",
        ),
        (
            0.01,
            "uT",
            "median strength is 0.482 uT, but that of the Earth's field 48.2 uT: is the unit gauss, not uT?",
        ),
        (10.0, "uT", "is the unit mgauss, not uT?"),
        (0.1, "uT", "check unit, scale, columns and calibration"),
        (0.01, "T", "is the unit gauss, uT, nT or mgauss"),
    ],
)
def test_a_strength_that_a_mistaken_unit_makes_is_refused(build, scale, unit, words):
    path = build(
        mag=lambda f: f.assign(**{name: f[name] * scale for name in COLUMNS}),
        toml=lambda s: s.replace('"uT"', f'"{unit}"'),
    )
    with pytest.raises(DataError) as error:
        read(path)
    assert (
        words in str(error.value)
        and "\n" not in str(error.value)
        and any(words in text for text in inspect(path).problems)
    )


def test_hard_iron_far_above_the_field_is_no_mistaken_unit(build):
    assert "calibrate it" in notes(build(mag=lambda f: f.assign(mx=f.mx + 400.0)))


def test_one_constant_axis(build):
    path = build(mag=lambda f: f.assign(mx=20.0))
    with pytest.raises(
        DataError,
        match="mag.csv: magnetic-field: x is constant while the body turns by .* the sensor is stuck; check its column",
    ):
        read(path)
    assert any("x is constant" in problem for problem in inspect(path).problems)
    # turns about z alone leave z as it is
    level = lambda f: f.assign(gx=0.0, gy=0.0, ax=0.0, ay=0.0, az=-9.8)
    assert "is constant" not in notes(build(mag=lambda f: f.assign(mz=43.0), imu=level))
    tilted = lambda f: f.assign(
        gx=np.where(f.t < 2, np.radians(10.0), 0.0), gy=0.0, gz=0.0, ax=0.0, ay=0.0, az=-9.8
    )
    path = build(mag=lambda f: f.assign(mz=43.0), imu=tilted)
    assert (
        "z is constant while the body turns by 20 deg about another axis: the sensor is stuck, nothing was dropped"
        in notes(path)
    )


def test_a_calibration_that_mirrors_or_is_in_another_unit_is_named(build, tmp_path):
    path = build(toml=added('calibration = "mag.toml"'))
    for text, words in (
        (
            "matrix = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]",
            "mag.toml: [magnetometer] matrix mirrors the field",
        ),
        (
            "bias = [5.0, 2.0, 3.0]",
            "mag.toml: [magnetometer] bias is [5.0, 2.0, 3.0] T, beyond 1 mT",
        ),
    ):
        (tmp_path / "mag.toml").write_text(f"[magnetometer]\n{text}\n")
        with pytest.raises(DataError) as error:
            read(path)
        assert words in str(error.value)


@pytest.mark.parametrize(
    "offset, count, words",
    [
        (95.0, 50, "only 50 of 1000 fixes fall within the IMU record, 5.0 of its 100.0 s"),
        (60.0, 400, None),
    ],
)
def test_little_in_common_with_the_imu_is_said(build, offset, count, words):
    path = build(
        toml=lambda s: s.replace(
            'file = "mag.csv"\ntime = { column = "t", unit = "s" }',
            f'file = "mag.csv"\ntime = {{ column = "t", unit = "s", offset = {offset} }}',
        )
    )
    said, problems = notes(path), " ".join(inspect(path).problems)
    assert (
        (words in said and words in problems)
        if words
        else ("fixes fall within" not in said + problems)
    )
    if words:
        write_recording(read(path), path.with_suffix(".nc"))
        assert " ".join(read(path.with_suffix(".nc")).meta["notes"]).count("fixes fall within") == 1


def test_stuck_samples_are_dropped_and_counted(build):
    def stuck(frame):
        frame.loc[400:599, COLUMNS] = frame.loc[400, COLUMNS].to_numpy()
        return frame

    path = build(mag=stuck)
    assert (
        "199 samples dropped, stuck at one value for 2 s and more while the gyro turns, the first at 40.120 s"
        in notes(path)
    )
    assert len(read(path).sources[0].t) == 801
    with pytest.raises(DataError, match="mag.csv: no usable fix of kind magnetic-field"):
        read(build(mag=lambda f: f.assign(mx=20.0, my=np.nan, mz=40.0)))
    one = read(build(mag=lambda f: f.assign(mx=20.0, my=1.0, mz=40.0)))
    assert len(one.sources[0].t) == 1 and "999 samples dropped, stuck" in one.meta["notes"][0]


def test_a_sample_without_a_component_is_dropped(build):
    path = build(mag=lambda f: f.assign(my=f.my.where(f.index % 100 != 7)))
    assert (
        len(read(path).sources[0].t) == 990
        and "10 rows without time, value or standard deviation dropped, the first in line 9"
        in notes(path)
    )


def test_a_held_value_at_rest_is_not_called_stuck(build):
    # with a gyro bias of 1 deg/s
    still = lambda f: f.assign(gx=0.02, gy=0.0, gz=0.0, ax=0.0, ay=0.0, az=-9.8)
    path = build(mag=lambda f: f.assign(mx=20.0, my=1.0, mz=43.5), imu=still)
    assert len(
        read(path).sources[0].t
    ) == 1000 and "it never changes; check that the sensor works" in notes(path)


def test_saturated_samples_are_dropped_and_counted(build):
    clipped = lambda f: f.assign(mz=f.mz.clip(upper=40.0))
    count = int((tables()[1].mz > 40.0).sum())
    assert (
        50 < count < 900
        and f"{count} samples dropped, at the limit of the sensor's range (saturated)"
        in notes(build(mag=clipped))
    )
    # coarse steps are no saturation
    assert "saturated" not in notes(build(mag=lambda f: f.round({name: 0 for name in COLUMNS})))


def test_inspect_names_the_axes_that_fit(build):
    good = inspect(build(mag=turned(np.diag([1.0, -1.0, -1.0])), toml=added('axes = "+x -y -z"')))
    assert not good.problems and any(
        "magnetic-field: mean dip 63." in fact and "rms difference 0." in fact
        for fact in good.facts
    )
    for C, axes in (
        (np.diag([1.0, -1.0, -1.0]), "+x -y -z"),
        ([[0, 1, 0], [1, 0, 0], [0, 0, -1]], "+y +x -z"),
        ([[0, 0, 1], [1, 0, 0], [0, 1, 0]], "+z +x +y"),
    ):
        (problem,) = inspect(build(mag=turned(C))).problems
        assert (
            "magnetic-field axes: the dip of the field is off by" in problem
            and f"with {axes!r} by " in problem
            and problem.endswith("check axes")
        ), problem
        (problem,) = inspect(build(mag=turned(C), toml=added('field = "record"'))).problems
        assert f"with {axes!r} by " in problem


def test_reading_notes_the_axes_that_fit(build):
    assert "magnetic-field axes: the dip of the field is off by" in notes(
        build(mag=turned(np.diag([1.0, -1.0, -1.0])))
    )


def test_the_axes_that_fit_are_those_of_the_columns(build):
    (problem,) = inspect(build(toml=added('axes = "+x -z +y"'))).problems
    assert "with '+x +y +z' by 0: check axes" in problem
    (problem,) = inspect(
        build(mag=turned([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), toml=added('axes = "+x -z +y"'))
    ).problems
    assert "with '+z +x +y' by 0: check axes" in problem


def test_inspect_sees_a_left_handed_sensor(build, tmp_path):
    (problem,) = inspect(build(mag=lambda f: f.assign(my=-f.my))).problems
    assert (
        "with '+x -y +z' by 0: they are left-handed, so one column has the opposite sign" in problem
    )
    write_recording(read(tmp_path / "recording.toml"), tmp_path / "recording.nc")
    assert any("left-handed" in text for text in inspect(tmp_path / "recording.nc").problems)
    assert read(tmp_path / "recording.nc").meta["place"] == pytest.approx(PLACE)
