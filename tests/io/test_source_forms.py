"""Sources in other forms than the library's: speed and course, ECEF, heights above the geoid, rows
that do not count, an accelerometer with a table of its own. Against pymap3d and closed forms."""

import numpy as np
import pandas as pd
import pymap3d
import pytest
from conftest import TOML
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.geometry.geodesy import from_ecef, ned_axes, to_ecef
from strapdown.io.description.inspected_description import inspect_description
from strapdown.io.description.read import read_description as read
from strapdown.sensor_models.geoid import undulation

pytestmark = pytest.mark.short
IMU, POSITION, VELOCITY = TOML.split("[[source]]")
POSITION, VELOCITY = "[[source]]" + POSITION, "[[source]]" + VELOCITY
KNOT = 1852 / 3600


def entry(kind, **keys):
    """A section [[source]] of gnss.csv; values as TOML."""
    head = f'[[source]]\nkind = "{kind}"\nfile = "gnss.csv"\n'
    time = 'time = { column = "t", unit = "s" }\n'
    return head + time + "".join(f"{key} = {value}\n" for key, value in keys.items())


COURSE = dict(form='"speed, course, up"', columns='["s", "c", "up"]', unit='["knot", "deg", "m/s"]')
ECEF = dict(axes='"ECEF"', columns='["x", "y", "z"]', unit='"m"')
ECEF_VELOCITY = dict(axes='"ECEF"', columns='["vx", "vy", "vz"]', unit='"m/s"', std="0.1")


@pytest.fixture
def fixes(build):
    """Function (section, ..., change of the table) -> Recording of the small recording with these
    sections in place of its own."""

    def fixes(*sections, gnss=None, imu=IMU):
        return read(build(gnss=gnss, toml=lambda _: imu + "\n".join(sections)))

    return fixes


def courses(gnss):
    k = np.arange(len(gnss))
    return gnss.assign(s=(2.0 + k) / KNOT, c=10.0 + 17 * k, up=0.3)


def test_speed_and_course_are_north_and_east(fixes):
    [source] = fixes(entry("velocity", std="[0.4, 2.0, 0.7]", **COURSE), gnss=courses).sources
    k = np.arange(20)
    speed, course = 2.0 + k, np.radians(10 + 17 * k)
    v = np.c_[speed * np.cos(course), speed * np.sin(course), np.full(20, -0.3)]
    np.testing.assert_allclose(source.y, v, atol=1e-12)
    # the covariance through the derivative of (s cos c, s sin c); a course's error is no less than
    # what the speed's is worth across the track
    across = np.maximum(0.4 * KNOT / speed, np.radians(2))
    J = np.array([[np.cos(course), -v[:, 1]], [np.sin(course), v[:, 0]]]).transpose(2, 0, 1)
    P = J @ (np.array([np.full(20, 0.4 * KNOT), across]).T[:, :, None] ** 2 * J.transpose(0, 2, 1))
    np.testing.assert_allclose(source.std[:, :2] ** 2, P[:, [0, 1], [0, 1]], rtol=1e-12)
    np.testing.assert_allclose(source.std[:, 2], 0.7)


def test_a_speed_without_course(fixes):
    def holes(gnss):
        gnss = courses(gnss)
        gnss.loc[3, ["s", "c"]] = [0.2 / KNOT, np.nan]  # stands
        gnss.loc[4, "c"] = np.nan  # goes somewhere
        gnss.loc[5, "s"] = -1.0  # unknown
        return gnss

    keys = COURSE | dict(form='"speed, course"', columns='["s", "c"]', unit='["knot", "deg"]')
    recording = fixes(entry("velocity", std="0.2", **keys), gnss=holes)
    [source] = recording.sources
    assert (
        len(source.t) == 18 and not {14.5, 15.5} & set(source.t) and np.isnan(source.y[:, 2]).all()
    )
    stands = source.t == 13.5
    np.testing.assert_array_equal(source.y[stands, :2], 0)
    np.testing.assert_allclose(source.std[stands, :2], np.hypot(0.2, 0.2 * KNOT))
    np.testing.assert_allclose(source.std[~stands], 0.2 * KNOT)
    said = " ".join(recording.meta["notes"])
    assert "2 rows without a course, of which 1 at a standstill" in said
    assert "1 row with a negative speed" in said and "line 7" in said


def test_a_reference_of_speed_and_course(fixes):
    reference = """
[reference]
file = "gnss.csv"
time = { column = "t", unit = "s" }
velocity = { columns = ["s", "c"], unit = ["knot", "deg"], form = "speed, course" }
"""
    unknown = lambda gnss: courses(gnss).assign(s=lambda frame: frame.s.where(frame.t != 12.5, -1))
    found = fixes(POSITION, reference, gnss=unknown)
    k = np.array([0, 1, *range(3, 20)])
    speed, course = 2.0 + k, np.radians(10 + 17 * k)
    np.testing.assert_allclose(found.reference.t, 10.5 + k)
    np.testing.assert_allclose(
        found.reference.v_n[:, :2],
        np.c_[speed * np.cos(course), speed * np.sin(course)],
        atol=1e-12,
    )
    assert any("1 row with a negative speed" in note for note in found.meta["notes"])


def geocentric(gnss):
    lla = gnss[["lat", "lon", "alt"]].to_numpy().T
    x, y, z = pymap3d.geodetic2ecef(*lla)
    u, v, w = pymap3d.enu2uvw(gnss.ve, gnss.vn, -gnss.vd, *lla[:2])
    return gnss.assign(x=x, y=y, z=z, vx=u, vy=v, vz=w, sx=1.0, sy=2.0, sz=3.0, sxy=-0.9, sn=0.0)


def test_geodesy_against_pymap3d_and_pyproj():
    rng = np.random.default_rng(3)
    lla = rng.uniform([-1.57, -3.14, -9e3], [1.57, 3.14, 4e5], (500, 3))
    xyz = np.stack(pymap3d.geodetic2ecef(*lla.T, deg=False), axis=1)
    np.testing.assert_allclose(to_ecef(lla), xyz, atol=1e-8)
    np.testing.assert_allclose(from_ecef(xyz)[:, :2], lla[:, :2], atol=1e-14)
    np.testing.assert_allclose(from_ecef(xyz)[:, 2], lla[:, 2], atol=1e-8)
    from pyproj import Transformer

    theirs = Transformer.from_crs("EPSG:4978", "EPSG:4979").transform(*xyz.T, radians=True)
    np.testing.assert_allclose(np.array(theirs[:2]), lla[:, :2].T, atol=1e-12)
    enu = np.stack(pymap3d.uvw2enu(*xyz.T, lla[:, 0], lla[:, 1], deg=False), axis=1)
    ned = np.einsum("nij,nj->ni", ned_axes(lla), xyz)
    np.testing.assert_allclose(ned, enu[:, [1, 0, 2]] * [1, 1, -1], atol=1e-7)


@pytest.mark.parametrize(
    ("std", "covariance"),
    [
        ("3.0", np.diag([9.0, 9, 9])),
        ('["sx", "sy", "sz"]', np.diag([1.0, 4, 9])),
        ('["sx", "sy", "sz", "sxy", "sn", "sn"]', [[1, -0.81, 0], [-0.81, 4, 0], [0, 0, 9]]),
        (
            '[{ column = "sx", unit = "m^2" }, { column = "sy", unit = "m^2", scale = 2.0 }, 3.0, '
            '{ column = "sxy", unit = "m^2" }, "sn", "sn"]',
            [[1, -0.9, 0], [-0.9, 4, 0], [0, 0, 9]],
        ),
    ],
)
def test_a_position_in_ecef(fixes, std, covariance):
    expected = fixes(POSITION).sources[0]
    source = fixes(entry("position", std=std, **ECEF), gnss=geocentric).sources[0]
    np.testing.assert_allclose(source.y, expected.y, rtol=0, atol=1e-8)
    R = np.array(  # of x, y and z in north, east, down
        [np.array(pymap3d.uvw2enu(*axis, 45.0, 7.0))[[1, 0, 2]] * [1, 1, -1] for axis in np.eye(3)]
    ).T
    np.testing.assert_allclose(
        source.std[0], np.sqrt(np.diag(R @ np.array(covariance, float) @ R.T)), rtol=1e-9
    )


def test_a_velocity_in_ecef_is_turned_where_the_vehicle_is(fixes):
    expected = fixes(VELOCITY).sources[0]
    section, position = entry("velocity", **ECEF_VELOCITY), entry("position", std="1.0", **ECEF)
    place = 'place = { latitude = 45.0, longitude = 7.0, unit = "deg" }\n'
    before = section, position  # the order of sections does not count
    for recording in (
        fixes(*before, gnss=geocentric),
        fixes(section, gnss=geocentric, imu=place + IMU),
    ):
        source = recording.sources[0]
        np.testing.assert_allclose(source.y, expected.y, rtol=0, atol=1e-6)
        np.testing.assert_allclose(source.std, 0.1)
    with pytest.raises(
        DataError, match=r"\[\[source\]\] 1 \(velocity\): its position is unknown; add"
    ):
        fixes(section, gnss=geocentric)


def test_an_attitude_in_ecef(fixes):
    rph = np.c_[10 * np.sin(np.arange(20)), 5 * np.cos(np.arange(20)), 17 * np.arange(20) % 360]

    def turned(gnss):
        gnss = geocentric(gnss)
        to_ned = Rotation.from_matrix(ned_axes(np.radians(gnss[["lat", "lon", "alt"]].to_numpy())))
        body = Rotation.from_euler("ZYX", rph[:, ::-1], degrees=True)
        flu = Rotation.from_matrix(np.diag([1.0, -1, -1]))
        q = (to_ned.inv() * body * flu).as_quat()
        return gnss.assign(qx=q[:, 0], qy=q[:, 1], qz=q[:, 2], qw=q[:, 3])

    keys = dict(axes='"FLU to ECEF"', quaternion='"xyzw"', columns='["qx", "qy", "qz", "qw"]')
    section = entry("attitude", unit='"deg"', std="1.0", **keys)
    source = fixes(section, POSITION, gnss=turned).sources[0]
    off = (np.degrees(source.y) - rph + 180) % 360 - 180
    np.testing.assert_allclose(off, 0, atol=1e-9)
    np.testing.assert_allclose(source.std, np.radians(1.0))
    reference = """
[reference]
file = "gnss.csv"
time = { column = "t", unit = "s" }
attitude = { columns = ["qx", "qy", "qz", "qw"], quaternion = "xyzw", axes = "FLU to ECEF" }
"""
    where = 'position = { columns = ["x", "y", "z"], unit = "m", axes = "ECEF" }\n'
    speed = 'velocity = { columns = ["vx", "vy", "vz"], unit = "m/s", axes = "ECEF" }\n'
    for more in ("", where + speed):
        found = fixes(POSITION, VELOCITY, reference + more, gnss=turned)
        off = (np.degrees(found.reference.rph) - rph + 180) % 360 - 180
        np.testing.assert_allclose(off, 0, atol=1e-9)
    np.testing.assert_allclose(found.reference.lla, found.sources[0].y, atol=1e-8)
    np.testing.assert_allclose(found.reference.v_n, found.sources[1].y, atol=1e-9)


def test_heights_above_the_geoid(fixes):
    lla = fixes(POSITION).sources[0].y
    model = undulation(lla[:, 0], lla[:, 1])
    assert 45 < model[0] < 60  # the western Alps
    table = lambda gnss: gnss.assign(sep=100 * np.arange(len(gnss)))
    for geoid, added in (
        ('"EGM96"', model),
        ('{ column = "sep", unit = "cm" }', np.arange(20)),
        ('{ value = 46.3, unit = "m" }', 46.3),
    ):
        line = f"geoid = {geoid}\n"
        altitude = dict(columns='["alt"]', unit='"m"', std="1.0", geoid=geoid)
        recording = fixes(entry("altitude", **altitude), POSITION + line, gnss=table)
        height, position = recording.sources
        np.testing.assert_allclose(position.y, lla + np.array([0, 0, 1]) * np.c_[added], atol=1e-9)
        np.testing.assert_allclose(height.y[:, 0], position.y[:, 2], atol=1e-6)
        assert sum("above the geoid" in note for note in recording.meta["notes"]) == 2
    reference = '[reference]\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\n'
    position = 'position = { columns = ["lat", "lon", "alt"], unit = ["deg", "deg", "m"], geoid = '
    found = fixes(POSITION, reference + position + '"EGM96" }').reference
    np.testing.assert_allclose(found.lla[:, 2] - lla[:, 2], model, atol=1e-9)


def test_inspection_names_the_key(build):
    reference = """
[reference]
file = "gnss.csv"
time = { column = "t", unit = "s" }
position = { columns = ["lat", "lon", "alt"], unit = ["deg", "deg", "m"] }
"""
    msl = (TOML + reference).replace('"alt"', '"alt_msl"')
    path = build(gnss=lambda gnss: gnss.rename(columns={"alt": "alt_msl"}), toml=lambda _: msl)
    wrong = [line for line in inspect_description(path).problems if "mean sea level" in line]
    assert len(wrong) == 2 and all('geoid = "EGM96"' in line for line in wrong)
    told = msl.replace('std = ["std"', 'geoid = "EGM96"\nstd = ["std"')
    told = told.replace('"deg", "m"] }', '"deg", "m"], geoid = "EGM96" }')
    path.write_text(told, encoding="utf-8")
    assert not any("mean sea level" in line for line in inspect_description(path).problems)


@pytest.mark.parametrize(
    ("where", "left"),
    [
        ('{ column = "fix", least = 3 }', range(0, 20, 2)),
        ('{ column = "fix", least = 3, most = 3 }', range(0, 20, 4)),
        ('{ column = "fix", equals = [3, 5] }', range(0, 20, 2)),
        ('{ column = "status", equals = "A" }', range(10)),
        ('{ column = "status", equals = ["A", "x"] }', range(10)),
        ('{ column = "held", unequal = 3 }', (0, 1, *range(3, 8), 18, 19)),
        ('{ column = "held", changes = true }', (0, 3, 8, 18)),
        ('[{ column = "fix", most = 4 }, { column = "status", equals = "A" }]', (0, 3, 4, 7, 8)),
    ],
)
def test_rows_that_do_not_count(fixes, where, left):
    def change(gnss):
        k = np.arange(len(gnss))
        fix = np.select([k % 4 == 0, k % 4 == 1, k % 4 == 2], [3, np.nan, 5], 2)
        gnss = gnss.assign(fix=fix, status=np.where(k < 10, "A", "V"))
        gnss["held"] = np.repeat([1.0, np.nan, 2.0, 3.0, 2.0], [2, 1, 5, 10, 2])
        gnss.loc[11, "lat"] = 95.0  # refused where it counts
        return gnss

    recording = fixes(POSITION + f"where = {where}\n", gnss=change)
    assert np.array_equal(recording.sources[0].t, 10.5 + np.array(list(left)))
    assert any("of 20 left out, without" in note for note in recording.meta["notes"])


def test_where_that_leaves_nothing_is_refused(fixes):
    with pytest.raises(DataError, match=r"gnss.csv: where: none of its 20 rows has std >= 9"):
        fixes(POSITION + 'where = { column = "std", least = 9 }\n')


BOTH = TOML.replace('"m/s^2" }', '"m/s^2", file = "accel.csv" }')


def apart(tmp_path, build, rate, change=lambda frame: frame, kind="rate"):
    """The small recording with an accelerometer of another rate (Hz) in a file of its own: it feels
    a ramp, of which means over intervals are known."""
    t = 9.9 + np.arange(1, round(21 * rate) + 1) / rate
    middle = t - 0.5 / rate
    accel = np.c_[0.1 * middle, np.full(len(t), 0.2), np.full(len(t), -9.8)]
    frame = pd.DataFrame(
        np.c_[t, accel / (rate if kind == "increment" else 1)], columns=["t", "ax", "ay", "az"]
    )
    change(frame).to_csv(tmp_path / "accel.csv", index=False)
    toml = BOTH
    if kind == "increment":
        toml = toml.replace('kind = "rate"', 'kind = "increment"').replace('"m/s^2"', '"m/s"')
        toml = toml.replace('"deg/s"', '"deg"')
    scaled = lambda frame: frame.assign(**{g: frame[g] / 100 for g in ("gx", "gy", "gz")})
    return build(imu=scaled if kind == "increment" else None, toml=lambda _: toml)


@pytest.mark.parametrize("kind", ["rate", "increment"])
@pytest.mark.parametrize("rate", [50.0, 100.0, 123.0, 400.0])
def test_an_accelerometer_of_another_rate(tmp_path, build, rate, kind):
    recording = read(apart(tmp_path, build, rate, kind=kind))
    imu = recording.imu
    assert len(imu.t) == 2000
    expected = np.c_[0.1 * (imu.t - imu.dt / 2), np.full(2000, 0.2), np.full(2000, -9.8)]
    # a slower one is shared out in steps
    np.testing.assert_allclose(imu.dv / imu.dt[:, None], expected, atol=0.06 / rate)
    np.testing.assert_allclose(
        imu.dv.sum(axis=0), (expected * imu.dt[:, None]).sum(axis=0), rtol=1e-4
    )
    assert any(f"(100 and {rate:g} Hz)" in note for note in recording.meta["notes"])


def test_gaps_of_the_accelerometer(tmp_path, build):
    lost = lambda frame: frame[(frame.t < 15) | (frame.t > 16)].drop(index=[200])
    recording = read(apart(tmp_path, build, 100.0, lost))
    imu = recording.imu
    assert len(imu.t) == pytest.approx(1900, abs=2)
    assert not ((imu.t > 15.02) & (imu.t < 15.99)).any() and np.isfinite(imu.dv).all()
    assert (np.diff(imu.t) > 0.5).sum() == 1 and imu.dt.max() < 0.011
    assert any("of the gyro dropped" in note for note in recording.meta["notes"])


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            lambda frame: frame.assign(t=frame.t + 500),
            "gyro and accelerometer have no time in common",
        ),
        (lambda frame: frame[:1], "accel.csv: 1 usable IMU sample; at least 2 are needed"),
        (
            lambda frame: frame.assign(t=frame.t * 1000),
            "samples are .* s apart, but .* check the unit of time",
        ),
    ],
)
def test_an_accelerometer_that_does_not_belong(tmp_path, build, change, text):
    with pytest.raises(DataError, match=text) as refusal:
        read(apart(tmp_path, build, 100.0, change))
    assert "\n" not in str(refusal.value)


WRONG = {
    "a form of what is none": (
        entry("position", form='"speed, course"', columns='["s"]', unit='"m"', std="1"),
        "form: position takes none",
    ),
    "form and axes": (
        entry("velocity", axes='"ENU"', std="1", **COURSE),
        "axes: a course is measured from north",
    ),
    "an unknown form": (
        entry("velocity", **(COURSE | dict(form='"course"')), std="1"),
        "form: input should be 'speed, course'",
    ),
    "too few columns": (
        entry("velocity", **(COURSE | dict(columns='["s", "c"]')), std="1"),
        "columns: 2 given, velocity has 3: speed, course, up",
    ),
    "an angle for a speed": (
        entry("velocity", **(COURSE | dict(unit='["deg", "deg", "m/s"]')), std="1"),
        "unit: unit 'deg' is one of angle",
    ),
    "two deviations of three": (
        entry("velocity", std="[1, 2]", **COURSE),
        "std: 2 given, velocity has 3",
    ),
    "five of a covariance": (
        entry("position", std="[1, 1, 1, 1, 1]", **ECEF),
        "std: 5 given, position has 3",
    ),
    "a covariance in NED": (
        POSITION.replace('["std", "std", "std"]', "[1, 1, 1, 0.1, 0.1, 0.1]"),
        "std: 6 given",
    ),
    "degrees in ECEF": (
        entry("position", std="1", **(ECEF | dict(unit='["deg", "deg", "m"]'))),
        "unit: unit 'deg' is one of angle; accepted for length",
    ),
    "axes of a position": (
        POSITION + 'axes = "ENU"',
        "axes: 'ENU' of a position; .* or x, y, z with axes = \"ECEF\"",
    ),
    "an altitude in ECEF": (
        entry("altitude", columns='["alt"]', unit='"m"', std="1", axes='"ECEF"'),
        "axes: altitude is not a vector",
    ),
    "tilt in ECEF": (
        entry("attitude", columns='["a", "b"]', unit='"deg"', std="1", axes='"FRD to ECEF"'),
        "axes: roll and pitch alone do not determine an attitude in ECEF",
    ),
    "no centimetres": (
        entry("position", std="1", **(ECEF | dict(unit='"cm"'))),
        "line 2: x, y, z are 63.* km from the centre of the Earth",
    ),
    "a geoid of ECEF": (
        entry("position", std="1", geoid='"EGM96"', **ECEF),
        "geoid: only heights take it",
    ),
    "a geoid of a velocity": (VELOCITY + 'geoid = "EGM96"', "geoid: only heights take it"),
    "an unknown geoid": (
        POSITION + 'geoid = "EGM08"',
        "geoid: 'EGM08' is not a geoid; give \"EGM96\"",
    ),
    "a geoid without unit": (
        POSITION + "geoid = { value = 46.3 }",
        "geoid: its height: unit is missing",
    ),
    "a geoid in degrees": (
        POSITION + 'geoid = { column = "sep", unit = "deg" }',
        "geoid: unit 'deg' is one of angle",
    ),
    "no such column": (
        POSITION + 'geoid = { column = "sep", unit = "m" }',
        "column 'sep' is missing",
    ),
    "an altitude nowhere": (
        entry("altitude", columns='["alt"]', unit='"m"', std="1", geoid='"EGM96"'),
        "its position is unknown; add a source of positions",
    ),
    "where without a rule": (
        POSITION + 'where = { column = "fix" }',
        "least, most, equals, unequal or changes is missing",
    ),
    "where misspelt": (
        POSITION + 'where = { column = "fix", leest = 3 }',
        "unknown key 'leest' .did you mean 'least'",
    ),
    "where of no column": (
        POSITION + 'where = { column = "fix", least = 3 }',
        "column 'fix' is missing",
    ),
    "where of a constraint": (
        '[[source]]\nkind = "zero-velocity"\nrate = 1.0\nstd = 0.1\nwhere = { column = "a", least = 1 }',
        "where: zero-velocity takes none",
    ),
    "a variance of another unit": (
        POSITION.replace('["std", "std", "std"]', '{ column = "std", unit = "m/s^2" }'),
        "std: unit 'm/s.2' is one of acceleration",
    ),
    "a reference of course": (
        '[reference]\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\ncourse = { columns = ["c"], unit = "deg" }',
        "unknown key 'course'",
    ),
    "a reference of nothing": (
        '[reference]\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }',
        r"\[reference\] position: is missing",
    ),
    "a geoid of a reference's velocity": (
        '[reference]\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\nvelocity = { columns = ["vn", "ve", "vd"], unit = "m/s", geoid = "EGM96" }',
        "velocity.geoid: only a position",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_refused_in_one_line(fixes, name):
    section, text = WRONG[name]
    with pytest.raises(DataError, match=text) as refusal:
        fixes(section, gnss=geocentric)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 500
