"""Two awkward tables of a simulated drive are read in one try, and the answer is the truth's."""

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.io.inspection import draft, inspect
from strapdown.sensor_models.geoid import undulation
from strapdown.units.time_scales import gps_of, unix_from_gps

DEG, G, KNOT = np.pi / 180, 9.80665, 1852 / 3600
START = "2024-05-01T23:59:30Z"
WEEK, OF_WEEK = divmod(gps_of(START), 604800)


@pytest.fixture(scope="module")
def drive():
    """Two minutes of a simulated car, with the truth."""
    return sd.simulate("car", duration=120.0, seed=3)


def comma(frame, digits):
    """Rows of text with semicolons and decimal commas."""
    columns = [frame[name].map(f"{{:.{digits[name]}f}}".format) for name in frame]
    return [";".join(row).replace(".", ",") for row in zip(*columns)]


def imu_csv(recording):
    """Time of week in ms, deg/s and g, forward-left-up, a line of units, markers between rows."""
    imu = recording.imu
    flip = np.array([1, -1, -1])
    rates, force = imu.dtheta / imu.dt[:, None] / DEG * flip, imu.dv / imu.dt[:, None] / G * flip
    names = ["TOW", "GyroX", "GyroY", "GyroZ", "AccX", "AccY", "AccZ"]
    frame = pd.DataFrame(np.c_[(OF_WEEK + imu.t) * 1e3, rates, force], columns=names)
    rows = comma(frame, dict(zip(names, [1, *[7] * 6])))
    rows[3000:3000] = ["--- event 1 ---", "# lap; 2"]
    head = ["Logger 7, firmware 1.2", ";".join(names), "ms;deg/s;deg/s;deg/s;g;g;g"]
    return "\r\n".join(head + rows) + "\r\n"


def gnss_csv(recording):
    """ISO times, knots and degrees, height above the geoid with its separation, a fix of 0."""
    position, velocity = (
        next(each for each in recording.sources if each.kind == kind)
        for kind in ("position", "velocity")
    )
    t, rows = np.intersect1d(position.t, velocity.t, return_indices=True)[:2]
    lat, lon, height = position.y[rows].T
    v = velocity.y[np.searchsorted(velocity.t, t)]
    n = undulation(lat, lon)
    moments = pd.to_datetime(unix_from_gps(gps_of(START) + t), unit="s", utc=True)
    fix = np.where(np.arange(len(t)) % 97 == 50, 0, 1)
    frame = pd.DataFrame(
        {
            "lat": np.where(fix, lat / DEG, 0.0),
            "lon": np.where(fix, lon / DEG, 0.0),
            "altitude": np.where(fix, height - n, 0.0),
            "geoid_sep": n,
            "sog": np.hypot(v[:, 0], v[:, 1]) / KNOT,
            "cog": np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360,
        }
    )
    text = comma(frame, dict.fromkeys(frame, 8))
    stamps = moments.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    lines = [f"{stamp};{row};{each}" for stamp, row, each in zip(stamps, text, fix)]
    return "\n".join(["utc;" + ";".join(frame) + ";fix", *lines]) + "\n"


@pytest.fixture
def pair(drive, tmp_path):
    """Paths of the two tables."""
    (tmp_path / "imu.csv").write_text(imu_csv(drive))
    (tmp_path / "gnss.csv").write_text(gnss_csv(drive))
    return [tmp_path / "imu.csv", tmp_path / "gnss.csv"]


def test_the_awkward_pair_is_read_in_one_try(drive, pair, tmp_path):
    found = inspect(*pair)
    assert found.problems == (), found.problems
    path = tmp_path / "recording.toml"
    path.write_text(draft(pair, {}, tmp_path))
    for recording in (sd.read(*pair), sd.read(path)):
        shift = recording.imu.t[0] - drive.imu.t[0]
        assert shift == pytest.approx(86370.0, abs=1e-4)  # since midnight, UTC
        np.testing.assert_allclose(recording.imu.t - shift, drive.imu.t, atol=1e-4)
        np.testing.assert_allclose(recording.imu.dv, drive.imu.dv, atol=2e-4)
        np.testing.assert_allclose(recording.imu.dtheta, drive.imu.dtheta, atol=1e-6)
        position, velocity = recording.sources
        there = next(each for each in drive.sources if each.kind == "position")
        rows = np.searchsorted(there.t, position.t - shift - 1e-3)
        np.testing.assert_allclose(position.t - shift, there.t[rows], atol=1e-4)
        np.testing.assert_allclose(position.y[:, :2], there.y[rows, :2], atol=1e-9)
        np.testing.assert_allclose(position.y[:, 2], there.y[rows, 2], atol=1e-6)
        assert position.y[:, 0].min() > 0.1  # no row without a fix
        fast = next(each for each in drive.sources if each.kind == "velocity")
        rows = np.searchsorted(fast.t, velocity.t - shift - 1e-3)
        moving = np.hypot(*fast.y[rows, :2].T) > 0.5
        np.testing.assert_allclose(velocity.y[moving, :2], fast.y[rows][moving, :2], atol=1e-6)
        assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"
        assert any("2 lines without data" in note for note in recording.meta["notes"])


def test_the_solution_of_the_awkward_pair_is_that_of_the_simulation(drive, pair):
    solution = sd.fuse(sd.read(*pair), imu="consumer")
    truth = drive.reference
    t, lla = solution.t - 86370.0, solution.trajectory.lla
    scale = 6378137.0 * np.array([1.0, np.cos(truth.lla[0, 0])])
    there = np.stack([np.interp(t, truth.t, each) for each in truth.lla.T], axis=1)
    north_east = (lla[:, :2] - there[:, :2]) * scale
    assert np.sqrt(np.mean(north_east**2, axis=0)).max() < 1.5  # m
    assert np.sqrt(np.mean((lla[:, 2] - there[:, 2]) ** 2)) < 2.5


def test_a_clock_that_nothing_tells_is_asked(pair):
    frame = pd.read_csv(pair[0], sep=";", decimal=",", skiprows=[0, 2], comment="#")
    frame = frame[frame["TOW"].str.contains(",")]
    own = (frame["TOW"].str.replace(",", ".").astype(float) / 1e3 - OF_WEEK).rename("time_s")
    pd.concat([own, frame.drop(columns="TOW")], axis=1).to_csv(pair[0], index=False)
    with pytest.raises(sd.DataError, match="the zero of its time 'time_s' .* is unknown.*epoch = "):
        sd.read(*pair)


def test_time_of_week_in_both_files_needs_no_week(pair):
    lines = pair[1].read_text().splitlines()
    seconds = [OF_WEEK - gps_of(START) + gps_of(line.partition(";")[0]) for line in lines[1:]]
    rows = [f"{t:.3f};{line.partition(';')[2]}" for t, line in zip(seconds, lines[1:])]
    pair[1].write_text("\n".join([lines[0].replace("utc", "gps_tow"), *rows]).replace(".", ","))
    recording = sd.read(*pair)
    assert recording.imu.t[0] == pytest.approx(OF_WEEK, abs=1.0) and len(recording.sources) == 2


FIX = {
    "hAcc [mm],vAcc [mm]": (["900", "1500"], [0.9, 0.9, 1.5]),
    "sdn(m),sde(m),sdu(m)": (["1", "2", "3"], [1, 2, 3]),
    "accuracy": (["3"], [3, 3, 6]),
    "nsat": (["9"], [2, 2, 4]),
}


@pytest.mark.parametrize("names", FIX)
@pytest.mark.short
def test_accuracies(tmp_path, names):
    cells, expected = FIX[names]
    rows = [f"{k},{48 + 1e-6 * k:.7f},9.0,500,{','.join(cells)}" for k in range(20)]
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join([f"t,latitude,longitude,h_ell,{names}", *rows]))
    assert position(tmp_path, path).std[0] == pytest.approx(expected)


def position(folder, path):
    """The position that a table of fixes yields beside an IMU at rest."""
    t = np.arange(0, 30, 0.02)
    still = np.random.default_rng(1).normal(0, 0.01, (len(t), 6)) + [0, 0, 0, 0, 0, -9.8]
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    pd.DataFrame(np.c_[t, still], columns=names).to_csv(folder / "imu.csv", index=False)
    return sd.read(folder / "imu.csv", path).sources[0]


@pytest.mark.short
@pytest.mark.parametrize(
    "header, row, lla",
    [
        ("t,lat,ns,lon,ew,alt", "{t},4807.038,N,01131.000,W,545", [48.1173, -11.516667, 545]),
        ("t,LatDeg,LngDeg,Hgt", "{t},48.1173,-11.5,545", [48.1173, -11.5, 545]),
        ("t,lat,lon,height", "{t},481173000,-115000000,545000", [48.1173, -11.5, 545]),
        ("t,lat,lon,alt_msl,geoid_separation", "{t},48,9,500,47.5", [48, 9, 547.5]),
        ("t,x,y,z", "{t},4156857.99,671388.51,4774562.81", [48.7830, 9.1747, 480]),
    ],
)
def test_positions_of_many_spellings(tmp_path, header, row, lla):
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join([header, *(row.format(t=k) for k in range(20))]))
    found = position(tmp_path, path)
    if header == "t,x,y,z":
        assert np.degrees(found.y[0, :2]) == pytest.approx([48.78, 9.175], abs=0.05)
        return
    assert np.degrees(found.y[0, :2]) == pytest.approx(lla[:2], abs=1e-5)
    assert found.y[0, 2] == pytest.approx(lla[2])
    description = tmp_path / "recording.toml"
    description.write_text(draft([tmp_path / "imu.csv", path], {}, tmp_path))
    np.testing.assert_array_equal(sd.read(description).sources[0].y, found.y)


@pytest.mark.parametrize("hour", [12, 23])
def test_a_time_of_day_takes_the_day_of_the_other_table(tmp_path, hour):
    """Also where midnight falls into the record."""
    start = pd.Timestamp(f"2024-05-01T{hour}:59:50")

    def stamps(n, interval, form):
        return (start + pd.to_timedelta(interval * np.arange(n), unit="s")).strftime(form)

    still = [f"{t},0,0,0,0,0.1,-9.8" for t in stamps(1500, 0.02, "%H:%M:%S.%f")]
    (tmp_path / "imu.csv").write_text("\n".join(["time,gx,gy,gz,ax,ay,az", *still]))
    fixes = [f"{t},48.1,9.0,500" for t in stamps(30, 1.0, "%Y-%m-%dT%H:%M:%SZ")]
    (tmp_path / "gnss.csv").write_text("\n".join(["time,lat,lon,h_ell", *fixes]))
    recording = sd.read(tmp_path / "imu.csv", tmp_path / "gnss.csv")
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"
    assert recording.imu.t[-1] == pytest.approx(hour * 3600 + 3590 + 1499 * 0.02, abs=1e-4)
    assert recording.sources[0].t[-1] == pytest.approx(hour * 3600 + 3590 + 29)
    assert any("the day of gnss.csv" in line for line in recording.meta["read"])
    assert sd.read(tmp_path / "imu.csv").meta.get("epoch") is None


def test_rows_of_zeros_are_no_fixes(drive, pair):
    rows = pair[1].read_text().splitlines()
    for k in range(300, 350):
        rows[k] = rows[k].partition(";")[0] + ";0,0;0,0;0,0;0,0;0,0;0,0;1"
    pair[1].write_text("\n".join(rows))
    recording = sd.read(*pair)
    for source in recording.sources:
        assert np.diff(source.t).max() == pytest.approx(51 * 0.2, abs=0.21)
    assert any("50 rows of" in line and "are zero" in line for line in recording.meta["read"])


def test_fixes_held_beside_an_imu_count_once(drive, tmp_path):
    position = drive.sources[0]
    imu = drive.imu
    names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
    frame = pd.DataFrame(np.c_[imu.t, np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]], columns=names)
    row = np.searchsorted(position.t, imu.t + 1e-9) - 1
    held = np.where(row[:, None] < 0, np.nan, position.y[row] / [DEG, DEG, 1.0])
    frame[["lat", "lon", "h_ell"]] = held
    frame.to_csv(tmp_path / "log.csv", index=False)
    recording = sd.read(tmp_path / "log.csv")
    (found,) = recording.sources
    last = position.t <= imu.t[-1] + 1e-9
    np.testing.assert_allclose(found.t, position.t[last], atol=1e-3)
    np.testing.assert_allclose(found.y, position.y[last], rtol=1e-12)
    assert any("repeat the fix of the row before" in line for line in recording.meta["read"])


@pytest.mark.parametrize(
    "mark", ["EVENT;2;door open", "MARK;3", "Temp;31,5", "E;1;2;3;4;5;6;7;8;9", "Übergang;1,5;;;"]
)
def test_a_row_that_begins_with_a_word_is_a_mark(pair, mark):
    rows = pair[0].read_text().splitlines()
    pair[0].write_text("\n".join([*rows[:5000], mark, *rows[5000:]]))
    recording = sd.read(*pair)
    assert len(recording.imu.t) == 12000
    assert any("3 lines without data" in note for note in recording.meta["notes"])


def test_a_cell_that_is_no_number_is_named(pair):
    rows = pair[0].read_text().splitlines()
    row = rows[5000].split(";")
    pair[0].write_text("\n".join([*rows[:5000], ";".join(["?12", *row[1:]]), *rows[5000:]]))
    with pytest.raises(sd.DataError, match=r"line 5001, column 'TOW': '\?12' is not a number"):
        sd.read(*pair)
    pair[0].write_text("\n".join([*rows[:5000], ";".join([row[0], "?", *row[2:]]), *rows[5000:]]))
    with pytest.raises(sd.DataError, match=r"line 5001, column 'GyroX': '\?' is not a number"):
        sd.read(*pair)


@pytest.mark.short
@pytest.mark.parametrize(
    "header, row",
    [
        ("utc,date,lat,N/S,lon,E/W,alt", "1200{k:05.2f},010524,4807.038,N,01131.000,W,545"),
        ("time,lat,NS,lon,EW,alt", "2024-05-01T12:00:{k:05.2f}Z,4807.038,N,01131.000,W,545"),
    ],
)
def test_degrees_and_minutes_beside_times_of_the_calendar(tmp_path, header, row):
    """As NMEA writes them: the digits of a date are of no year long ago, and N/S is a sign."""
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join([header, *(row.format(k=k) for k in range(1, 20))]))
    imu = tmp_path / "imu.csv"
    rows = [f"{1714564800 + 0.02 * k:.2f},0,0,0,0,0.1,-9.8" for k in range(1500)]
    imu.write_text("\n".join(["time,gx,gy,gz,ax,ay,az", *rows]))
    (found,) = sd.read(imu, path).sources
    assert np.degrees(found.y[0, :2]) == pytest.approx([48.1173, -11.516667], abs=1e-6)
    assert found.t[0] == 12 * 3600 + 1


@pytest.mark.short
@pytest.mark.parametrize(
    "name, cells, kept",
    [
        ("fixType", "0 1 2 3 3 4", 3),
        ("quality", "0 0 1 4 5 2", 4),
        ("status", "A V A A V A", 4),
        ("fix", "none 2D 3D 3D RTK NoFix", 3),
    ],
)
def test_rows_without_a_fix_do_not_count(tmp_path, name, cells, kept):
    rows = [f"{k},48.1,9.0,500,{cell}" for k, cell in enumerate(cells.split())]
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join([f"t,lat,lon,h_ell,{name}", *rows]))
    assert len(position(tmp_path, path).t) == kept


@pytest.mark.short
def test_gyro_and_accelerometer_in_files_of_their_own(tmp_path):
    t = np.arange(0, 20, 0.01)
    random = np.random.default_rng(2)
    for name, value in (("gyro", [0, 0, 0]), ("acc", [0, 0, 9.8])):
        frame = pd.DataFrame(
            random.normal(value, 0.01, (len(t), 3)), columns=[f"{name}_{a}" for a in "xyz"]
        )
        frame.insert(0, "timestamp", (1714567890 + t) * 1e3)
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    recording = sd.read(tmp_path / "gyro.csv", tmp_path / "acc.csv")
    assert recording.imu.dv[:, 2].mean() / recording.imu.dt.mean() == pytest.approx(-9.8, abs=0.01)
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"


@pytest.mark.short
def test_an_accelerometer_without_gravity_is_asked_about(tmp_path):
    path = tmp_path / "imu.csv"
    values = np.c_[
        np.arange(500) / 50,
        np.random.default_rng(3).normal(0, 0.1, (500, 6)) * ([0.01] * 3 + [1] * 3),
    ]
    pd.DataFrame(values, columns=["t", "gx", "gy", "gz", "ax", "ay", "az"]).to_csv(
        path, index=False
    )
    with pytest.raises(sd.DataError, match="gravity was taken out"):
        sd.read(path)
    (problem,) = inspect(path).problems
    assert "gravity was taken out" in problem
    described = tmp_path / "recording.toml"
    described.write_text(draft([path], {}, tmp_path))
    (problem,) = inspect(described).problems
    assert "[imu] accel: the forces have" in problem and "gravity was taken out" in problem


@pytest.mark.short
def test_a_table_of_one_row_per_event_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("".join(f"{k},{kind},1.0,2.0\n" for k in range(20) for kind in ("imu", "gps")))
    with pytest.raises(sd.DataError, match="column 2 holds 'imu', 'gps'"):
        sd.read(path)


@pytest.mark.short
@pytest.mark.parametrize(
    "header, row, lla",
    [
        ("t,lat,N/S,lon,E/W,alt", "{t},3354.0,S,01851.0,E,500", [-33.9, 18.85]),
        ("t,lat,hem_ns,lon,hem_ew,alt", "{t},3354.0,S,01851.0,W,500", [-33.9, -18.85]),
        ("t,lat,hemisphere_ns,lon,hemisphere_ew,alt", "{t},33.9,S,18.85,W,500", [-33.9, -18.85]),
        ("t,lat,hemisphere,lon,alt", "{t},33.9,South,-18.85,500", [-33.9, -18.85]),
    ],
)
def test_hemispheres_of_any_name(tmp_path, header, row, lla):
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join([header, *(row.format(t=k) for k in range(20))]))
    assert np.degrees(position(tmp_path, path).y[0, :2]) == pytest.approx(lla, abs=1e-9)


@pytest.mark.short
def test_a_hemisphere_that_nothing_tells_is_said(tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text("\n".join(["t,lat,lon,alt", *(f"{k},3354.0,01851.0,500" for k in range(20))]))
    position(tmp_path, path)
    told = sd.read(tmp_path / "imu.csv", path).meta["read"]
    assert any(
        "assumed north and east, because no column gives the hemisphere" in line for line in told
    )


@pytest.mark.short
def test_an_accelerometer_is_no_accuracy_of_the_position(drive, tmp_path):
    imu, fixes = drive.imu, drive.sources[0]
    rates, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    names = ["t", *(f"gyr_{a}" for a in "xyz"), *(f"acc_{a}" for a in "xyz"), "lat", "lon", "alt"]
    rows = np.searchsorted(imu.t, fixes.t)
    cells = np.full((len(imu.t), 3), np.nan)
    cells[rows] = fixes.y / [DEG, DEG, 1]
    path = tmp_path / "log.csv"
    frame = pd.DataFrame(np.c_[imu.t, rates, force, cells], columns=names).assign(vx=1.0, soc=99)
    frame.to_csv(path, index=False)
    recording = sd.read(path)
    assert recording.sources[0].std[0] == pytest.approx([2, 2, 4])
    assert any(
        line.endswith("log.csv: columns not recognised or not needed: vx, soc")
        for line in recording.meta["read"]
    )


@pytest.mark.short
def test_a_magnetometer_is_left_until_asked_for(tmp_path):
    names = ["t", *(f"{s}{a}" for s in ("g", "a", "m") for a in "xyz")]
    values = np.random.default_rng(5).normal([0, 0, 0, 0, 0, -9.8, 20, 0, 44], 0.01, (900, 9))
    path = tmp_path / "log.csv"
    pd.DataFrame(np.c_[np.arange(900) / 50, values], columns=names).to_csv(path, index=False)
    recording = sd.read(path)
    assert recording.sources == ()
    assert any(
        "the table does not say that it is calibrated" in line for line in recording.meta["read"]
    )
    assert len(sd.read(path, magnetometer=0).sources) == 1


@pytest.mark.short
def test_the_accuracy_of_a_course_is_that_of_the_speed(tmp_path):
    path = tmp_path / "gnss.csv"
    rows = (f"{k},{48 + 4e-4 * k},9,500,45,0,0" for k in range(20))
    path.write_text("\n".join(["t,lat,lon,h_ell,speed,course,vd", *rows]))
    position(tmp_path, path)
    velocity = sd.read(tmp_path / "imu.csv", path).sources[1]
    np.testing.assert_allclose(velocity.std, 0.2)


@pytest.mark.short
def test_a_height_that_is_not_recognised_is_asked_for(tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text(
        "\n".join(["t,lat,lon,tallness,speed", *(f"{k},48,9,500,1" for k in range(20))])
    )
    with pytest.raises(sd.DataError, match=r"no column is recognised as the height, .* tallness"):
        position(tmp_path, path)
    path.write_text(path.read_text().replace("tallness", "Höhe [m]"))
    assert position(tmp_path, path).y[0, 2] == 500


SENSORS = {
    "gyro_x [mdps],gyro_y [mdps],gyro_z [mdps],acc_x [mg],acc_y [mg],acc_z [mg]": (
        1e-3 * DEG,
        1e-3,
    ),
    "wx [deg/h],wy [deg/h],wz [deg/h],ax,ay,az": (DEG / 3600, 1.0),
    "p,q,r,SpecForceX,SpecForceY,SpecForceZ": (1.0, 1.0),
    "RateX,RateY,RateZ,f_x [counts],f_y [counts],f_z [counts]": (1.0, 1 / 16384),
    "roll_rate,pitch_rate,yaw_rate,ax_g,ay_g,az_g": (1.0, 1.0),
}


@pytest.mark.short
@pytest.mark.parametrize("names", SENSORS)
def test_names_and_units_of_inertial_sensors(tmp_path, names):
    of_rate, of_force = SENSORS[names]
    values = np.random.default_rng(6).normal([0.02, -0.01, 0.03, 0, 0, -1], 1e-4, (900, 6))
    cells = values / (
        [of_rate] * 3 + [of_force / (G if of_force == 1 and "_g" not in names else 1)] * 3
    )
    path = tmp_path / "imu.csv"
    head = ["t", *names.split(",")]
    pd.DataFrame(np.c_[np.arange(900) / 50, cells], columns=head).to_csv(path, index=False)
    imu = sd.read(path).imu
    np.testing.assert_allclose(imu.dtheta.mean(axis=0) * 50, [0.02, -0.01, 0.03], atol=1e-4)
    assert imu.dv[:, 2].mean() * 50 == pytest.approx(-G, rel=1e-3)


TIMES = {
    "ts": ("{unix:.3f}", 1714557630.0),
    "Zeitstempel": ("{unix:.3f}", 1714557630.0),
    "ms": ("{own:.0f}", 1000.0),
    "when": ("{unix_ms:.0f}", 1714557630.0),
    "wann": ("2024-05-01T10:00:{s:06.3f}Z", 1714557630.0),
    "Datum,Uhrzeit": ("01.05.2024,10:00:{s:06.3f}", 1714557630.0),
    "IMUtime": ("{own_us:.0f}", 1000.0),  # as large as POSIX seconds
    "clock_us": ("{own_us:.0f}", 1000.0),
    "iTOW": ("{early:.0f}", 400.0),  # ms, as UBX has it, early in the week
    "gps_time": ("{late:.3f}", 295248.0),
}


@pytest.mark.short
@pytest.mark.parametrize("name", TIMES)
def test_times_of_many_names_and_sizes(tmp_path, name):
    form, zero = TIMES[name]
    rows = []
    for k in range(900):
        s = k / 50
        cells = form.format(
            unix=1714557630 + s,
            unix_ms=1e3 * (1714557630 + s),
            own=1e3 * (1000 + s),
            own_us=1e6 * (1000 + s),
            early=1e3 * (400 + s),
            late=295248 + s,
            s=30 + s,
        )
        rows.append(f"{cells},0.001,{0.0001 * (k % 7)},0,0,0.1,-9.8")
    path = tmp_path / "imu.csv"
    path.write_text("\n".join([f"{name},gx,gy,gz,ax,ay,az", *rows]))
    recording = sd.read(path)
    if zero > 1e9:
        assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"
        zero -= 1714521600
    assert recording.imu.t[0] == pytest.approx(zero, abs=1e-4)
    assert recording.imu.dt.mean() == pytest.approx(0.02, rel=1e-4)


@pytest.mark.short
def test_a_table_without_a_time_lists_its_columns(tmp_path):
    path = tmp_path / "imu.csv"
    path.write_text("n,gx,gy,gz\n" + "\n".join(f"{k},0,0,{k % 3}" for k in range(9)))
    with pytest.raises(
        sd.DataError, match="the content of a time, among n, gx, gy, gz: rename the"
    ):
        sd.read(path)


@pytest.mark.short
def test_whole_numbers_as_ubx_has_them(tmp_path):
    path = tmp_path / "gnss.csv"
    rows = (
        f"{k},{480000000 + round(k * 7e7 / 111195)},90000000,500000,7000,0,9,900,60"
        for k in range(40)
    )
    path.write_text("\n".join(["t,lat,lon,height,velN,velE,velD,hAcc,sAcc", *rows]))
    place = position(tmp_path, path)
    velocity = sd.read(tmp_path / "imu.csv", path).sources[1]
    assert np.degrees(place.y[0, 0]) == pytest.approx(48) and place.y[0, 2] == 500
    np.testing.assert_allclose(place.std[0], [0.9, 0.9, 1.8])
    np.testing.assert_allclose(velocity.y, np.tile([7.0, 0.0, 0.009], (len(velocity.t), 1)))
    np.testing.assert_allclose(velocity.std, 0.06)


@pytest.mark.short
def test_measured_values_come_before_true_ones(tmp_path):
    names = [f"{s}{a}{of}" for of in ("", "_meas") for s in "AG" for a in "xyz"]
    values = np.random.default_rng(5).normal([0, 0, -9.8, 0, 0, 0] * 2, 0.01, (900, 12))
    values[:, :6] = [0, 0, -9.8, 0, 0, 0]
    path = tmp_path / "sim.csv"
    frame = pd.DataFrame(np.c_[np.arange(900) / 50, values], columns=["time", *names])
    frame.to_csv(path, index=False)
    recording = sd.read(path)
    assert recording.imu.dv[:, 0].std() * 50 == pytest.approx(0.01, rel=0.2)
    assert any("not needed: Ax, Ay, Az, Gx, Gy, Gz" in line for line in recording.meta["read"])


@pytest.mark.short
def test_the_scale_of_gyro_counts_is_asked_for(tmp_path):
    values = np.random.default_rng(5).normal([0, 0, 50, 0, 0, 16384], 30, (900, 6)).round()
    path = tmp_path / "imu.csv"
    frame = pd.DataFrame(np.c_[np.arange(900) / 50, values])
    frame.to_csv(path, index=False, header=["t", "gx", "gy", "gz", "ax", "ay", "az"])
    with pytest.raises(sd.DataError, match="gx, gy, gz are whole numbers.* unit and scale"):
        sd.read(path)


@pytest.mark.short
@pytest.mark.parametrize(
    "column, assumed",
    [
        ("Temp [°C]", False),
        ("imu_temperature_degC", False),
        ("temp", True),
        ("Temp [°F]", None),
        ("baro_temp", None),
    ],
)
def test_the_column_of_the_temperature(tmp_path, column, assumed):
    values = np.random.default_rng(5).normal([0, 0, 0, 0, 0, -9.8], 0.01, (900, 6))
    path, names = tmp_path / "imu.csv", ["t", "gx", "gy", "gz", "ax", "ay", "az", column]
    warmth = np.linspace(20, 30, 900)
    pd.DataFrame(np.c_[np.arange(900) / 50, values, warmth], columns=names).to_csv(path)
    found = sd.read(path).meta
    assert ("temperature" in found) == (assumed is not None)
    assert any("temperature" in line and "degC" in line for line in found["read"]) == bool(assumed)
    if assumed is not None:
        assert found["temperature"][:, 1] == pytest.approx(
            20 + found["temperature"][:, 0] / 1.8, abs=0.1
        )
