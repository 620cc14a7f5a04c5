"""Files of what has no position: solutions of attitude as NetCDF and CSV, and recordings with
magnetic field, pressure and place."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import attitude_only, flight, solution

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.io.readers.netcdf import read_recording, write_recording
from strapdown.io.solution import read_solution, write_solution

pytestmark = pytest.mark.short
TRUTH = flight(30, rate=5.0)
MADE = {
    name: attitude_only(solution(TRUTH), heave=name == "vru", name=name)
    for name in ("attitude-mekf", "vru")
}


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("ending", ["nc", "csv", "csv.xz"])
def test_what_is_not_known_stays_so(name, ending, tmp_path):
    made = MADE[name]
    write_solution(made, tmp_path / f"a.{ending}")
    back = read_solution(tmp_path / f"a.{ending}")
    for part in ("lla", "v_n", "std"):
        assert np.allclose(
            getattr(back.trajectory, part),
            getattr(made.trajectory, part),
            rtol=0,
            atol=1e-9,
            equal_nan=True,
        )
    assert (
        np.isnan(back.b_a).all()
        and np.allclose(back.b_g, made.b_g, rtol=0, atol=1e-14)
        and not back.has_position
    )
    assert (back.trajectory.rotation * made.trajectory.rotation.inv()).magnitude().max() < 1e-9
    if ending == "nc":
        assert (
            np.array_equal(back.innovations.innovation, made.innovations.innovation, equal_nan=True)
            and back.meta["filter"] == name
        )


def test_csv_leaves_cells_of_the_unknown_empty(tmp_path):
    write_solution(MADE["vru"], tmp_path / "a.csv")
    head, row = (line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()[:2])
    cells = dict(zip(head, row))
    assert (
        cells["lat [deg]"]
        == cells["VE [m/s]"]
        == cells["std_north [m]"]
        == cells["accel_bias_x [m/s^2]"]
        == ""
        and float(cells["alt [m]"]) > 300
    )
    assert "nan" not in (tmp_path / "a.csv").read_text()


@pytest.mark.parametrize("name", MADE)
def test_no_track_is_written_without_position(name, tmp_path):
    with pytest.raises(
        DataError, match=f"a.kml: the solution of {name} has no position.*use .nc or .csv"
    ) as refusal:
        write_solution(MADE[name], tmp_path / "a.kml")
    assert "\n" not in str(refusal.value) and not list(tmp_path.iterdir())


def test_tables_say_nothing_of_the_unknown():
    table = MADE["attitude-mekf"].table()
    known = set(table.columns[table.notna().any()])
    assert known == {
        "roll",
        "pitch",
        "heading",
        "std_rotation_north",
        "std_rotation_east",
        "std_rotation_down",
        *(f"{std}gyro_bias_{axis}" for std in ("", "std_") for axis in "xyz"),
        "status",
    }
    assert "rows" in repr(MADE["attitude-mekf"]) and "roll" in MADE["attitude-mekf"]._repr_html_()


def recording(sources=(), **meta):
    rng = np.random.default_rng(4)
    t = np.arange(1, 501) / 50
    reference = Trajectory(TRUTH.t[:50], np.full((50, 3), np.nan), None, TRUTH.q_nb[:50])
    return Recording.from_arrays(
        t,
        rng.normal(0, 0.1, (500, 3)),
        rng.normal(0, 0.1, (500, 3)) - [0, 0, 9.81],
        sources,
        reference,
        **meta,
    )


def test_a_recording_keeps_place_date_kinds_and_a_reference_of_attitude(tmp_path):
    t, rng = np.arange(1.0, 10), np.random.default_rng(5)
    field = Source(
        "magnetic-field",
        t,
        rng.normal(0, 3e-5, (9, 3)),
        np.full((9, 3), 1e-6),
        (2e-5, 1e-6, 4e-5),
        np.inf,
        "compass",
    )
    pressure = Source(
        "pressure", t, 1e5 + rng.normal(0, 3, (9, 1)), np.full((9, 1), 0.3), (0.1, 0.2, -0.3)
    )
    altitude = Source("pressure-altitude", t, rng.normal(100, 3, (9, 1)), np.full((9, 1), 0.3))
    level, gravity = (
        Source("zero-sea-level", t, np.zeros((9, 1)), np.ones((9, 1))),
        Source("gravity", t, np.zeros((9, 3)), np.ones((9, 3))),
    )
    made = recording(
        (field, pressure, altitude, level, gravity), place=[0.9, 0.2, 70.0], date="2012-11-01"
    )
    write_recording(made, tmp_path / "a.nc")
    back = read_recording(tmp_path / "a.nc")
    assert back.meta["place"] == [0.9, 0.2, 70.0] and back.meta["date"] == "2012-11-01"
    for a, b in zip(made.sources, back.sources, strict=True):
        assert (a.kind, a.parameters, a.gate, a.name) == (b.kind, b.parameters, b.gate, b.name)
        assert all(np.array_equal(getattr(a, part), getattr(b, part)) for part in ("t", "y", "std"))
    assert (
        np.isnan(back.reference.lla).all()
        and back.reference.v_n is None
        and np.array_equal(back.reference.q_nb, made.reference.q_nb)
    )


def test_netcdf_names_the_units_of_the_new_kinds(tmp_path):
    import h5netcdf

    t = np.arange(1.0, 5)
    made = recording(
        (
            Source(
                "magnetic-field",
                t,
                np.full((4, 3), 3e-5),
                np.full((4, 3), 1e-6),
                (2e-5, 1e-6, 4.5e-5),
            ),
            Source("pressure", t, np.full((4, 1), 1e5), np.ones((4, 1))),
        )
    )
    write_recording(made, tmp_path / "a.nc")
    with h5netcdf.File(tmp_path / "a.nc") as file:
        units = [
            tuple(file[f"source_{k}"][name].attrs["units"] for name in ("y", "std")) for k in (1, 2)
        ]
    assert units == [("T", "T"), ("Pa", "m")]


def test_every_quantity_of_an_aiding_has_its_units():
    from strapdown import aiding
    from strapdown.units.quantities import OWN

    used = {q for sensor in aiding.measurements().values() for q in sensor.quantities}
    assert used == set(OWN)


def test_parts_of_a_recording_without_fixes(tmp_path):
    made = recording()
    part = made.between(2.0, 4.0)
    assert (
        part.sources == ()
        and part.span == (2.0, 4.0)
        and made.hidden([(1, 2)]).sources == ()
        and "IMU samples" in repr(part)
    )
    write_recording(part, tmp_path / "a.nc")
    assert (
        read_recording(tmp_path / "a.nc").sources == ()
        and replace(part, reference=None).reference is None
    )
