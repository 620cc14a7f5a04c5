"""The geomagnetic field against the official test values of the World Magnetic Model, and the
two models against each other."""

import datetime
import sys

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.sensor_models.geomagnetism import decimal_year, geomagnetic_field, models

pytestmark = pytest.mark.short
DEG, NT = np.pi / 180, 1e-9

# Published with each model by NOAA's National Centers for Environmental Information: year, height
# (km), latitude, longitude (deg);
# north, east, down, horizontal, total (nT), inclination, declination (deg).
OFFICIAL = {
    "WMM2010": """
2010.0    0  80    0   6649.5   -714.6   54346.2   6687.8  54756.2   82.98   -6.13
2010.0    0   0  120  39428.8    664.9  -11683.8  39434.5  41128.9  -16.50    0.97
2010.0    0 -80  240   5657.7  15727.3  -53407.5  16714.0  55961.8  -72.62   70.21
2010.0  100  80    0   6332.2   -729.1   52194.9   6374.0  52582.6   83.04   -6.57
2010.0  100   0  120  37452.0    611.9  -11180.8  37457.0  39090.1  -16.62    0.94
2010.0  100 -80  240   5484.3  14762.8  -50834.8  15748.6  53218.3  -72.79   69.62
2012.5    0  80    0   6658.0   -606.7   54420.4   6685.5  54829.5   83.00   -5.21
2012.5    0   0  120  39423.9    608.1  -11540.5  39428.6  41082.8  -16.31    0.88
2012.5    0 -80  240   5713.6  15731.8  -53184.3  16737.2  55755.7  -72.53   70.04
2012.5  100  80    0   6340.9   -625.1   52261.9   6371.6  52648.9   83.05   -5.63
2012.5  100   0  120  37448.1    559.7  -11044.2  37452.2  39046.7  -16.43    0.86
2012.5  100 -80  240   5535.5  14765.4  -50625.9  15768.9  53024.9  -72.70   69.45""",
    "WMM2015v2": """
2015.0    0  80    0   6636.6   -451.9   54408.9   6651.9  54814.0   83.03   -3.90
2015.0    0   0  120  39521.1    377.7  -11228.8  39522.9  41087.1  -15.86    0.55
2015.0  100 -80  240   5612.2  14789.3  -50385.8  15818.3  52810.5  -72.57   69.22
2017.5    0  80    0   6605.2   -298.7   54506.3   6612.0  54905.9   83.08   -2.59
2017.5  100   0  120  37584.4    235.7  -10600.5  37585.1  39051.4  -15.75    0.36
2017.5  100 -80  240   5674.9  14793.1  -50179.5  15844.2  52621.5  -72.48   69.01""",
    "WMM2020": """
2020.0    0  80    0   6570.4   -146.3   54606.0   6572.0  55000.1   83.14   -1.28
2020.0    0   0  120  39624.3    109.9  -10932.5  39624.4  41104.9  -15.42    0.16
2020.0    0 -80  240   5940.6  15772.1  -52480.8  16853.8  55120.6  -72.20   69.36
2020.0  100  80    0   6261.8   -185.5   52429.1   6264.5  52802.0   83.19   -1.70
2020.0  100   0  120  37636.7    104.9  -10474.8  37636.9  39067.3  -15.55    0.16
2020.0  100 -80  240   5744.9  14799.5  -49969.4  15875.4  52430.6  -72.37   68.78
2022.5    0  80    0   6529.9      1.1   54713.4   6529.9  55101.7   83.19    0.01
2022.5    0   0  120  39684.7    -42.2  -10809.5  39684.7  41130.5  -15.24   -0.06
2022.5    0 -80  240   6016.5  15776.7  -52251.6  16885.0  54912.1  -72.09   69.13
2022.5  100  80    0   6224.0    -44.5   52527.0   6224.2  52894.5   83.24   -0.41
2022.5  100   0  120  37694.0    -35.3  -10362.0  37694.1  39092.4  -15.37   -0.05
2022.5  100 -80  240   5815.0  14803.0  -49755.3  15904.1  52235.4  -72.27   68.55""",
}
# Published to 1 nT: year, height, latitude, longitude; declination, inclination, horizontal, north,
# east, down, total.
ROUNDED = """
2025.0  28  89 -121  -99.77  88.47   1504   -255  -1482   56194  56214
2025.0  48  80  -96  -29.91  87.77   2164   1876  -1079   55623  55665
2025.0  51 -33  109   -5.49 -67.50  21838  21738  -2090  -52710  57055
2025.5   6 -36 -137   20.28 -52.11  25353  23782   8787  -32578  41281
2026.0  83  86  -46  -30.61  86.84   3000   2582  -1528   54279  54362
2026.5  12 -79  115 -137.58 -77.37  13023  -9614  -8786  -58104  59546
2027.5   0 -13  -59  -17.49 -15.26  22401  21366  -6733   -6112  23220
2028.5  68 -58  156   41.57 -81.52   9283   6945   6160  -62264  62953
2029.0  19  46  -22   -5.65  60.89  22632  22522  -2227   40652  46527
2029.5  31  13 -132    9.04  31.41  28145  27796   4421   17188  32978"""


def rows(text):
    return [tuple(map(float, line.split())) for line in text.strip().splitlines()]


@pytest.mark.parametrize(
    "name, row", [(name, row) for name, text in OFFICIAL.items() for row in rows(text)]
)
def test_official_values(name, row):
    year, height, lat, lon, north, east, down, horizontal, total, inclination, declination = row
    found = geomagnetic_field(year, lat * DEG, lon * DEG, 1000 * height)
    assert found.model == name and found.note == ""
    np.testing.assert_allclose(np.array(found.field) / NT, [north, east, down], atol=0.051)
    np.testing.assert_allclose(
        np.array([found.horizontal, found.total]) / NT, [horizontal, total], atol=0.051
    )
    np.testing.assert_allclose(
        np.degrees([found.inclination, found.declination]), [inclination, declination], atol=0.0051
    )


@pytest.mark.parametrize("row", rows(ROUNDED))
def test_official_values_of_2025(row):
    year, height, lat, lon, declination, inclination, horizontal, north, east, down, total = row
    found = geomagnetic_field(year, lat * DEG, lon * DEG, 1000 * height)
    assert found.model == "WMM2025" and bool(found.note) == (horizontal <= 6000)
    np.testing.assert_allclose(
        np.array([*found.field, found.horizontal, found.total]) / NT,
        [north, east, down, horizontal, total],
        atol=0.51,
    )
    np.testing.assert_allclose(
        np.degrees([found.inclination, found.declination]), [inclination, declination], atol=0.0051
    )


def test_worked_example_of_the_report_on_wmm2025():
    """Chulliat et al. (2025), table 3b: 2027.5, 100 km, 80 deg south, 240 deg east, there to ten
    decimals."""
    found = geomagnetic_field(2027.5, -80 * DEG, 240 * DEG, 100e3)
    np.testing.assert_allclose(
        np.array(found.field) / NT,
        [5983.9760496518, 14760.1359757868, -49317.6706154255],
        atol=1e-3,
    )
    assert found.declination == pytest.approx(
        1.1856308407, abs=1e-8
    ) and found.inclination == pytest.approx(-1.2584221541, abs=1e-8)


@pytest.mark.parametrize("year", [2010.1, 2013.7, 2017.0, 2022.5, 2024.9])
def test_the_models_agree_as_well_as_they_claim(year):
    """IGRF-14 is another library, another model and knows what came later: the WMM's own error
    of a component is 0.15 uT (1 sigma) at the ground."""
    rng = np.random.default_rng(1)
    places = np.c_[np.arcsin(rng.uniform(-0.999, 0.999, 40)), rng.uniform(-np.pi, np.pi, 40)]
    difference = [
        np.subtract(
            geomagnetic_field(year, *place).field,
            geomagnetic_field(year, *place, model="IGRF-14").field,
        )
        for place in places
    ]
    assert 1e-9 < np.sqrt(np.mean(np.square(difference))) < 0.15e-6


def test_before_the_world_magnetic_models_it_is_the_igrf():
    found, next_day = (
        geomagnetic_field(day, 0.8, 0.15, 300.0) for day in ("2009-12-31", "2010-01-01")
    )
    assert (found.model, next_day.model) == ("IGRF-14", "WMM2010")
    np.testing.assert_allclose(found.field, next_day.field, atol=0.15e-6)


def test_without_its_extra_the_igrf_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ppigrf", None)
    with pytest.raises(DataError, match=r'IGRF-14, .* pip install "strapdown\[igrf\]"'):
        geomagnetic_field("2001-05-01", 0.8, 0.2)
    assert geomagnetic_field("2012-05-01", 0.8, 0.2).model == "WMM2010"


def test_the_vector_agrees_with_its_angles():
    found = geomagnetic_field("2024-05-01", 0.6, 2.4, 1000.0)
    np.testing.assert_allclose(
        found.field,
        found.total
        * np.array(
            [
                np.cos(found.inclination) * np.cos(found.declination),
                np.cos(found.inclination) * np.sin(found.declination),
                np.sin(found.inclination),
            ]
        ),
        rtol=1e-12,
    )
    assert found.horizontal == pytest.approx(found.total * np.cos(found.inclination))


@pytest.mark.parametrize(
    "date",
    [
        "2012-07-02",
        datetime.date(2012, 7, 2),
        datetime.datetime(2012, 7, 2),
        "2012-07-02T00:00:00",
        2012.5,
    ],
)
def test_dates(date):
    assert decimal_year(date) == pytest.approx(2012.5, abs=1e-12)  # day 184 of 366


def test_day_fractions_count():
    assert decimal_year("2013-01-01T12:00") == pytest.approx(2013 + 0.5 / 365, abs=1e-9)
    assert decimal_year("2013-12-31T23:59:59") < 2014


def test_every_year_from_1900_has_a_model():
    spans = models().values()
    assert all(
        any(first <= year < last for first, last in spans) for year in np.arange(1900, 2030, 0.25)
    )
    assert {"WMM2010", "WMM2015v2", "WMM2020", "WMM2025", "IGRF-14"} <= set(
        models()
    ) and "WMM2015" not in models()


REFUSED = {
    "expired": (dict(date="2300-01-01"), "past the newest geomagnetic model (WMM2"),
    "before all": (
        dict(date=1899.9),
        "before the oldest geomagnetic model (IGRF-14, 1900 to 2030)",
    ),
    "no date": (dict(date=None), "None is no date"),
    "no date in the text": (dict(date="tomorrow"), "'tomorrow' is no date; write it as"),
    "not a number": (dict(date=float("nan")), "is no date"),
    "model of other years": (
        dict(model="WMM2020", date="2012-10-10"),
        "WMM2020 holds 2020 to 2025, not on 2012-10-10: it had not begun; use WMM2010",
    ),
    "expired model": (
        dict(model="WMM2010", date="2016-10-10"),
        "WMM2010 holds 2010 to 2015, not on 2016-10-10: it had expired; use WMM2015v2",
    ),
    "unknown model": (dict(model="EMM"), "there is no geomagnetic model 'EMM'; there are WMM2010"),
    "degrees": (dict(lat=44.7, lon=-93.1), "are they in degrees?"),
    "the pole": (dict(lat=np.pi / 2), "up to 89 deg"),
    "no latitude": (dict(lat=np.nan), "latitude is nan"),
    "height in mm": (dict(height=9e6), "from -12 to 850 km"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    changes, words = REFUSED[case]
    with pytest.raises(DataError) as error:
        geomagnetic_field(**dict(date="2012-10-10", lat=0.8, lon=0.1) | changes)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_near_the_magnetic_pole_a_note_warns():
    assert "magnetic heading is poor" in geomagnetic_field("2020-06-01", 86 * DEG, 170 * DEG).note
