"""Reading barometers beside a magnetometer, constraints of heights, sources given as arrays, and
a recorded flight with all of them."""

import numpy as np
import pytest
from nine_axis import TOML, build, tables  # noqa: F401 (a fixture)

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.io import read

pytestmark = pytest.mark.short


def pressure(text):
    return text[: text.index("[[source]]")] + (
        '[[source]]\nkind = "pressure"\nfile = "mag.csv"\ntime = { column = "t", unit = "s" }\ncolumns = ["p"]\n'
        'unit = "hPa"\nstd = 2.0\nlever_arm = [0.5, 0.0, 0.0]\n'
    )


def test_pressure(build):
    (baro,) = read(build(mag=lambda f: f.assign(p=955.0 + 0.01 * f.t), toml=pressure)).sources
    np.testing.assert_allclose(baro.y[:, 0], 95500 + 1.0 * tables()[1].t, rtol=1e-12)
    np.testing.assert_allclose(baro.std, 2.0)  # m, whatever the unit of the pressure
    assert baro.parameters == (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    "value, unit, words",
    [
        (
            955.0,
            "Pa",
            "line 2: pressure is 955 Pa, but that of air is 5000 to 200000: hPa or mbar read as Pa?",
        ),
        (95.5, "Pa", "kPa read as Pa?"),
        (1014.5, "Pa", "hPa or mbar read as Pa?"),
        (310.0, "Pa", "hPa or mbar read as Pa?"),
        (95500.0, "hPa", "Pa read as hPa or mbar?"),
        (955.0, "kPa", "hPa or mbar read as kPa?"),
        (0.0, "Pa", "check columns, unit and scale"),
    ],
)
def test_impossible_pressures(build, value, unit, words):
    with pytest.raises(DataError) as error:
        read(
            build(
                mag=lambda f: f.assign(p=value),
                toml=lambda s: pressure(s).replace('"hPa"', f'"{unit}"'),
            )
        )
    assert words in str(error.value)


def test_one_impossible_pressure_is_no_mistaken_unit(build):
    with pytest.raises(DataError, match="line 9: pressure is 0 Pa.*leave such rows out"):
        read(build(mag=lambda f: f.assign(p=np.where(f.index == 7, 0.0, 955.0)), toml=pressure))


def test_pressure_altitude_gravity_and_sea_level(build):
    text = pressure(TOML).replace('"pressure"', '"pressure-altitude"').replace(
        '"hPa"', '"m"'
    ) + "".join(
        f'\n[[source]]\nkind = "{kind}"\nrate = 5.0\nstd = {std}\n'
        for kind, std in (("gravity", 0.5), ("zero-sea-level", 1.5))
    )
    height, gravity, sea = read(build(mag=lambda f: f.assign(p=500.0), toml=lambda s: text)).sources
    assert (
        height.y[0, 0] == 500.0 and gravity.parameters == () and sea.parameters == (0.0, 0.0, 0.0)
    )
    assert (
        gravity.y.shape == (500, 3)
        and sea.y.shape == (500, 1)
        and not gravity.y.any()
        and sea.std[0, 0] == 1.5
    )


@pytest.mark.parametrize("parameters", [(), (0.0, 0.0, 0.0), (20.0, 1.0, 43.0)])
def test_arrays_need_the_field_too(parameters):
    t = 0.01 * np.arange(1, 101)
    mag = Source("magnetic-field", t, np.full((100, 3), 2e-5), np.full((100, 3), 1e-6), parameters)
    with pytest.raises(
        DataError, match="magnetic-field: parameters are .* geomagnetic_field returns it"
    ):
        Recording.from_arrays(t, np.zeros((100, 3)), np.tile([0, 0, -9.8], (100, 1)), (mag,))


def test_the_uav_reads_with_its_magnetometer_and_barometer(tmp_path, data_folder, monkeypatch):
    monkeypatch.setenv("STRAPDOWN_DATA", str(data_folder))
    part = (
        TOML[TOML.index("[[source]]") :]
        .replace("mag.csv", "${STRAPDOWN_DATA}/thor75/imu_mag_air.csv.xz")
        .replace('"t"', '"t_s"')
    )
    part = (
        part.replace('"mx", "my", "mz"', '"mx_gauss_raw", "my_gauss_raw", "mz_gauss_raw"')
        .replace('"uT"', '"gauss"')
        .replace("0.5", "0.01")
    )
    air = pressure(TOML)[pressure(TOML).index("[[source]]") :].replace(
        "mag.csv", "${STRAPDOWN_DATA}/thor75/imu_mag_air.csv.xz"
    )
    air = air.replace('"t"', '"t_s"').replace('"p"', '"static_p_kPa"').replace('"hPa"', '"kPa"')
    imu = (
        TOML[TOML.index("[imu]") : TOML.index("[[source]]")]
        .replace("imu.csv", "${STRAPDOWN_DATA}/thor75/imu_mag_air.csv.xz")
        .replace('"t"', '"t_s"')
    )
    for sensor, unit in (("g", "rad_s"), ("a", "m_s2")):
        for axis in "xyz":
            imu = imu.replace(f'"{sensor}{axis}"', f'"{sensor.replace("a", "f")}{axis}_{unit}"')
    path = tmp_path / "thor.toml"
    path.write_text(
        'date = "2012-10-10"\nplace = { latitude = 45.33, longitude = -93.23, height = 250.0, unit = "deg" }\n'
        + imu
        + part
        + 'axes = "+x -y -z"\n\n'
        + air
    )
    recording = read(path)
    mag, baro = recording.sources
    assert (
        len(mag.t) > 34000 and len(baro.t) == 34811 and 90e3 < baro.y.min() < baro.y.max() < 100e3
    )
    assert (
        "WMM2010 on 2012-10-10" in recording.meta["notes"][0]
        and "calibrate it" in recording.meta["notes"][1]
    )
