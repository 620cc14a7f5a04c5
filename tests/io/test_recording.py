"""A description becomes SI, body axes and NED: against values worked out by hand from the same
small files."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.loop.contract import MeasurementModel
from strapdown.io import read
from strapdown.io.locate import data_folder, locate

pytestmark = pytest.mark.short


def table(path, name="imu"):
    return pd.read_csv(path.parent / f"{name}.csv")


def test_units_become_si(build):
    path = build()
    recording, raw, fixes = read(path), table(path), table(path, "gnss")
    rates = recording.imu.dtheta / recording.imu.dt[:, None]
    np.testing.assert_allclose(rates, np.radians(raw[["gx", "gy", "gz"]]), rtol=1e-9)
    np.testing.assert_allclose(
        recording.imu.dv / recording.imu.dt[:, None], raw[["ax", "ay", "az"]], rtol=1e-9
    )
    position, velocity = recording.sources
    np.testing.assert_allclose(
        position.y, np.c_[np.radians(fixes[["lat", "lon"]]), fixes.alt], rtol=1e-12
    )
    np.testing.assert_allclose(position.std, 1.5)
    np.testing.assert_allclose(velocity.std, 0.1)
    assert recording.meta == {
        "height_columns": {"alt": "position"},
        "installed": {
            "[imu] time offset": [0.0],
            "[imu] mounting": [0.0, 0.0, 0.0],
            "[imu] lever_arm": [0.0, 0.0, 0.0],
            "[[source]] 1 (position) lever_arm": [0.0, 0.0, 0.0],
            "[[source]] 1 (position) std": [1.0, 1.0, 1.0],
            "[[source]] 1 (position) correlated": [],
            "[[source]] 1 (position) time offset": [0.0],
            "[[source]] 1 (position) scale": [1.0, 1.0, 1.0],
            "[[source]] 2 (velocity) lever_arm": [0.0, 0.0, 0.0],
            "[[source]] 2 (velocity) std": [0.1, 0.1, 0.1],
            "[[source]] 2 (velocity) correlated": [],
            "[[source]] 2 (velocity) time offset": [0.0],
            "[[source]] 2 (velocity) scale": [1.0, 1.0, 1.0],
        },
        "name": "recording",
        "date": "2024-05-01",
        "point": "imu",
        "imu_lever_arm": [0.0, 0.0, 0.0],
        "notes": [],
    }
    assert velocity.std.flags.c_contiguous and velocity.name == "velocity"


def test_time_unit_scale_and_offset(build):
    path = build(
        imu=lambda f: f.assign(t=(f.t * 1000).round().astype(int)),
        toml=lambda s: s.replace('unit = "s" }', 'unit = "ms", offset = -0.125 }', 1),
    )
    assert read(path).imu.t[0] == pytest.approx(10.01 - 0.125)


@pytest.mark.parametrize(
    "axes, names",
    [
        ("FLU", ["ax", "-ay", "-az"]),
        ("RFU", ["ay", "ax", "-az"]),
        ("-z +y +x", ["-az", "ay", "ax"]),
    ],
)
def test_axes(build, axes, names):
    true = table(build())

    def turned(frame):
        frame = frame.copy()
        for body, name in zip("xyz", names):
            sign = -1 if name[0] == "-" else 1
            for sensor in "ag":
                frame[sensor + name[-1]] = sign * true[sensor + body]
        return frame

    imu = read(build(imu=turned, toml=lambda s: s.replace('"FRD"', f'"{axes}"'))).imu
    np.testing.assert_allclose(imu.dv / imu.dt[:, None], true[["ax", "ay", "az"]], rtol=1e-9)
    np.testing.assert_allclose(
        imu.dtheta / imu.dt[:, None], np.radians(true[["gx", "gy", "gz"]]), rtol=1e-9
    )


def test_mounting_and_calibration(build, tmp_path):
    true = table(build())
    C = Rotation.from_euler("ZYX", [-170.0, 5.0, 178.0], degrees=True).as_matrix()
    M, bias = (
        np.array([[1.01, 0.002, 0.0], [0.0, 0.98, 0.001], [0.003, 0.0, 1.02]]),
        np.array([0.3, -0.2, 0.1]),
    )

    def raw(frame):
        sensor = true[["ax", "ay", "az"]] @ C
        frame[["ax", "ay", "az"]] = np.linalg.solve(M, sensor.T).T + bias
        frame[["gx", "gy", "gz"]] = np.degrees(
            np.radians(true[["gx", "gy", "gz"]].to_numpy()) @ C + [0.01, 0.02, 0.03]
        )
        return frame

    (tmp_path / "imu_calibration.toml").write_text(
        f"[accel]\nbias = {bias.tolist()}\nmatrix = {M.tolist()}\n[gyro]\nbias = [0.01, 0.02, 0.03]\n"
    )
    path = build(
        imu=raw,
        toml=lambda s: s.replace(
            'axes = "FRD"',
            'mounting = { roll = 178.0, pitch = 5.0, heading = -170.0, unit = "deg" }\n'
            'calibration = "imu_calibration.toml"',
        ),
    )
    imu = read(path).imu
    np.testing.assert_allclose(imu.dv / imu.dt[:, None], true[["ax", "ay", "az"]], atol=1e-9)
    np.testing.assert_allclose(
        imu.dtheta / imu.dt[:, None], np.radians(true[["gx", "gy", "gz"]]), atol=1e-9
    )
    for text, words in (
        ("[accel]\nbias = 3", "must be 3 finite numbers"),
        ("[mag]\nbias = [1.0, 2.0, 3.0]", "unknown section 'mag'"),
        ("[accel]\noffset = 1", "no other key"),
    ):
        (tmp_path / "imu_calibration.toml").write_text(text)
        with pytest.raises(DataError, match=words):
            read(path)


def test_increments_and_counts(build):
    true = read(build())
    path = build(
        imu=lambda f: f.assign(
            **{c: f[c] * 0.01 / 0.001 for c in ("gx", "gy", "gz", "ax", "ay", "az")}
        ),
        toml=lambda s: (
            s.replace('"rate"', '"increment"')
            .replace('unit = "deg/s"', 'unit = "deg", scale = 0.001')
            .replace('unit = "m/s^2"', 'unit = "m/s", scale = 0.001')
        ),
    )
    for first, second in zip(true.imu, read(path).imu):
        np.testing.assert_allclose(first, second, rtol=1e-9)


def test_enu_velocity_turns_values_and_standard_deviations(build):
    path = build(
        toml=lambda s: s.replace('["vn", "ve", "vd"]', '["ve", "vn", "vd"]').replace(
            "std = 0.1", 'axes = "ENU"\nstd = [0.1, 0.2, { column = "std", unit = "cm/s" }]'
        )
    )
    velocity = read(path).sources[1]
    np.testing.assert_allclose(velocity.y[0], [0.11, -0.08, 0.1])
    np.testing.assert_allclose(velocity.std[0], [0.2, 0.1, 0.015])
    missing = read(
        build(
            gnss=lambda f: f.assign(vd=np.nan),
            toml=lambda s: s.replace("std = 0.1", 'axes = "ENU"\nstd = 0.1'),
        )
    ).sources[1]
    assert np.isnan(missing.y).tolist() == [[False, False, True]] * 20


def test_scalar_kinds_units_of_std_and_lever_arms(build):
    extra = """
[[source]]
kind = "heading"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["alt"]
unit = "deg"
std = 2.0
gate = inf
name = "compass"

[[source]]
kind = "speed"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["alt"]
unit = "km/h"
scale = 0.1
std = 3.6

[[source]]
kind = "altitude"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["alt"]
unit = "ft"
std = 10
lever_arm = [0.5, 0.0, 0.0]

[[source]]
kind = "zero-lateral-velocity"
rate = 5.0
std = 0.15
lever_arm = [-1.0, 0.0, 0.0]

[[source]]
kind = "zero-lateral-velocity"
rate = 2.0
std = 0.15
"""
    recording = read(
        build(toml=lambda s: s.replace('axes = "FRD"', "lever_arm = [0.1, 0.2, -0.65]", 1) + extra)
    )
    heading, speed, altitude, lateral, other = recording.sources[2:]
    assert (
        heading.y[0, 0] == pytest.approx(np.radians(250))
        and heading.std[0, 0] == pytest.approx(np.radians(2))
        and heading.gate == np.inf
    )
    assert heading.name == "compass" and heading.parameters == ()
    assert speed.y[0, 0] == pytest.approx(25 / 3.6) and speed.std[0, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(speed.parameters, [-0.1, -0.2, 0.65])
    assert altitude.y[0, 0] == pytest.approx(250 * 0.3048) and altitude.std[0, 0] == pytest.approx(
        3.048
    )
    np.testing.assert_allclose(altitude.parameters, [0.4, -0.2, 0.65])
    np.testing.assert_allclose(lateral.parameters, [-1.1, -0.2, 0.65])
    np.testing.assert_allclose(lateral.t, 10 + 0.2 * np.arange(1, 101))
    assert lateral.y.shape == lateral.std.shape == (100, 1) and not lateral.y.any()
    assert other.name == "zero-lateral-velocity 7" and len(other.t) == 40
    np.testing.assert_allclose(recording.sources[0].parameters, [-0.1, -0.2, 0.65])


def test_constraint_at_rest_holds_only_there_and_none_in_a_gap(build):
    def moving(frame):
        frame.loc[1000:1499, "ax"] += 3 * np.sin(np.arange(500))
        return frame.drop(range(300, 400))

    constraint = '\n[[source]]\nkind = "{}"\nrate = 10.0\nstd = 0.05\n'
    path = build(
        imu=moving,
        toml=lambda s: (
            s + constraint.format("zero-velocity") + constraint.format("zero-lateral-velocity")
        ),
    )
    recording = read(path)
    t = recording.sources[2].t
    assert not ((t > 19.1) & (t < 25.9)).any() and ((t > 26.2) & (t < 30.01)).sum() > 35
    assert not ((t > 13.01) & (t < 14.0)).any() and (t < 13.005).sum() == 30
    always = recording.sources[3].t
    assert not ((always > 13.01) & (always < 13.99)).any() and len(always) == 191
    assert any("zero-velocity: at rest for" in note for note in recording.meta["notes"])


RATES = """
[[source]]
kind = "zero-angular-rate"
rate = 10.0
std = {}
"""


def test_zero_angular_rate_is_told_the_mean_of_the_gyro_over_the_step_before(build):
    path = build(
        imu=lambda frame: frame.drop(range(303, 307)), toml=lambda s: s + RATES.format(0.1)
    )
    recording = read(path)
    imu, rates = recording.imu, recording.sources[2]
    assert rates.y.shape == rates.std.shape == (200, 3) and np.all(rates.std == 0.1)
    means = imu.dtheta[:300].reshape(30, 10, 3).sum(axis=1) / 0.1
    np.testing.assert_allclose(rates.y[:30], means, rtol=1e-9)
    in_gap = np.r_[300:303, 303:306]  # the six samples that are left of that step
    np.testing.assert_allclose(rates.y[30], imu.dtheta[in_gap].sum(axis=0) / 0.06, rtol=1e-9)
    assert not any("scatter" in note for note in recording.meta["notes"])


def test_zero_angular_rate_at_long_steps_is_told_the_rest_alone(build):
    def turning_before(frame):
        frame.loc[:649, "gz"] += 20.0 + np.sin(np.arange(650))
        return frame

    text = RATES.format(0.1).replace("10.0", "0.25")
    rates = read(build(imu=turning_before, toml=lambda s: s + text)).sources[2]
    assert len(rates.t) > 1 and np.abs(rates.y).max() < np.radians(1.5)


def test_zero_angular_rate_is_not_known_better_than_it_scatters(build):
    recording = read(build(toml=lambda s: s + RATES.format(1e-5)))
    expected = np.radians(0.1) / np.sqrt(10)  # of the samples, ten to a mean
    np.testing.assert_allclose(recording.sources[2].std, expected, rtol=0.2)
    assert any("zero-angular-rate: its means scatter" in note for note in recording.meta["notes"])


def test_side_slip_is_of_the_constraint_across_the_wheels_alone(build):
    constraint = '\n[[source]]\nkind = "zero-{}-velocity"\nrate = 2.0\nstd = 0.1\nslip = {}\n'
    path = build(toml=lambda s: s + constraint.format("lateral", 0.005))
    assert read(path).sources[2].slip == 0.005
    with pytest.raises(DataError, match="slip: zero-vertical-velocity takes none"):
        read(build(toml=lambda s: s + constraint.format("vertical", 0.005)))
    with pytest.raises(DataError, match="slip"):
        read(build(toml=lambda s: s + constraint.format("lateral", 5)))


def test_table_without_header_and_other_separators(build, tmp_path):
    expected, frame = read(build()), table(tmp_path / "x")
    text = frame.to_csv(index=False, header=False, sep=";")
    path = build(
        toml=lambda s: (
            s.replace('column = "t"', "column = 1", 1)
            .replace('["gx", "gy", "gz"]', "[2, 3, 4]")
            .replace('["ax", "ay", "az"]', "[5, 6, 7]")
        )
    )
    (tmp_path / "imu.csv").write_text("# logged by hand\n" + text)
    np.testing.assert_array_equal(read(path).imu.dv, expected.imu.dv)
    (tmp_path / "imu.csv").write_text(text.replace(";", "  "))
    np.testing.assert_array_equal(read(path).imu.dv, expected.imu.dv)
    (tmp_path / "imu.csv").write_text(text)
    with pytest.raises(DataError, match="no header line: give columns by number"):
        read(build_named(path))


def build_named(path):
    path.write_text(
        path.read_text()
        .replace("column = 1", 'column = "t"')
        .replace("[2, 3, 4]", '["a", "b", "c"]')
        .replace("[5, 6, 7]", '["d", "e", "f"]')
    )
    return path


def test_reference(build, tmp_path):
    (tmp_path / "truth.csv").write_text(
        "time,la,lo,h,e,n,u,r,p,y\n"
        + "".join(f"{11 + k},45,7,250,1,2,3,10,20,{350 + k}\n" for k in (0, 1, 3, 2, 4))
    )
    section = """
[reference]
file = "truth.csv"
time = { column = "time", unit = "s" }
position = { columns = ["la", "lo", "h"], unit = ["deg", "deg", "m"] }
velocity = { columns = ["e", "n", "u"], unit = "m/s", axes = "ENU" }
attitude = { columns = ["r", "p", "y"], unit = "deg" }
"""
    reference = read(build(toml=lambda s: s + section)).reference
    np.testing.assert_allclose(reference.t, [11, 12, 13, 14, 15])
    np.testing.assert_allclose(reference.v_n, [[2, 1, -3]] * 5)
    np.testing.assert_allclose(
        np.degrees(reference.rph), np.c_[[10] * 5, [20] * 5, 350 + np.arange(5)]
    )
    with pytest.raises(DataError, match=r"\[reference\]: nothing falls within the IMU record"):
        read(
            build(
                toml=lambda s: s + section.replace('unit = "s" }', 'unit = "s", offset = 900.0 }')
            )
        )
    attitude_alone = section.replace("position", "#").replace("velocity", "#")
    reference = read(build(toml=lambda s: s + attitude_alone)).reference
    assert len(reference) == 5 and reference.v_n is None and np.isnan(reference.lla).all()
    np.testing.assert_allclose(np.degrees(reference.rph)[:, 0], 10)
    with pytest.raises(DataError, match=r"\[reference\] position: is missing"):
        read(build(toml=lambda s: s + attitude_alone.replace("attitude", "#")))
    with pytest.raises(DataError, match=r"\[reference\] time: is missing"):
        read(build(toml=lambda s: s + section.replace("time =", "#")))


def test_reference_written_by_this_library(build, tmp_path):
    expected = read(build()).sources[0]
    frame = pd.DataFrame(
        {
            "t [s]": expected.t,
            "lat [deg]": np.degrees(expected.y[:, 0]),
            "lon [deg]": np.degrees(expected.y[:, 1]),
            "alt [m]": expected.y[:, 2],
        }
    )
    frame.to_csv(tmp_path / "solution.csv", index=False)
    reference = read(build(toml=lambda s: s + '[reference]\nfile = "solution.csv"\n')).reference
    np.testing.assert_allclose(reference.lla, expected.y)
    assert reference.v_n is None and reference.q_nb is None


def test_a_new_kind_of_aiding_needs_nothing_here(build, monkeypatch):
    from strapdown import aiding, plugins

    monkeypatch.setattr(plugins, "_plugins", {})
    observe = aiding.find("position").observe  # nothing here calls it
    sensor = MeasurementModel("airflow", observe, ("speed", "angle"), parameters="antenna")
    aiding.REGISTRY.add(sensor, __name__)
    extra = '[[source]]\nkind = "airflow"\nfile = "gnss.csv"\ntime = { column = "t", unit = "s" }\ncolumns = ["vn", "ve"]\nunit = ["knot", "deg"]\nstd = [1.0, 2.0]\n'
    airflow = read(build(toml=lambda s: s + extra)).sources[2]
    np.testing.assert_allclose(airflow.y[0], [0.11 * 1852 / 3600, np.radians(-0.08)])
    np.testing.assert_allclose(airflow.std[0], [1852 / 3600, np.radians(2)])


def test_data_folder(tmp_path, monkeypatch):
    (tmp_path / "shared" / "data").mkdir(parents=True)
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.delenv("STRAPDOWN_DATA", raising=False)
    assert data_folder(tmp_path / "a" / "b") == tmp_path / "shared" / "data"
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path / "a"))
    assert locate("${STRAPDOWN_DATA}/x.csv", tmp_path) == tmp_path / "a" / "x.csv"
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path / "none"))
    with pytest.raises(DataError, match="is not a folder"):
        data_folder()
    monkeypatch.delenv("STRAPDOWN_DATA")
    monkeypatch.chdir("/")
    with pytest.raises(DataError, match="no data folder was found above"):
        data_folder("/")
