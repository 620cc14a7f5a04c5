"""Flight plans: their files, and what is refused of both."""

import pytest

from strapdown.checks import DataError
from strapdown.flight.plan import RAD_PER_DEG as DEG, FlightPlan, flight_plan

PLAN = """name = "field"
place = { latitude_deg = 47.63, longitude_deg = 9.35, height_m = 480 }
waypoints_m = [[0, 0, 0], [500, 0, 20], [500, 500.5, 40]]
airspeed_m_s = [25, 26]
bank_deg = 25
duration_s = 20
"""


@pytest.mark.short
def test_a_plans_file_is_the_plan(tmp_path):
    (tmp_path / "mine.toml").write_text(PLAN)
    expected = FlightPlan(
        "field",
        ((0, 0, 0), (500, 0, 20), (500, 500.5, 40)),
        (25, 26),
        bank=25 * DEG,
        duration=20,
        place=(47.63 * DEG, 9.35 * DEG, 480),
    )
    assert (
        flight_plan(tmp_path / "mine.toml") == flight_plan(str(tmp_path / "mine.toml")) == expected
    )
    (tmp_path / "least.toml").write_text("waypoints_m = [[0, 0, 0], [500, 0, 0]]")
    assert flight_plan(tmp_path / "least.toml") == FlightPlan("least", ((0, 0, 0), (500, 0, 0)))


@pytest.mark.short
@pytest.mark.parametrize(
    "old, new, said",
    [
        ("bank_deg", "bank", "unknown key 'bank'.*did you mean 'bank_deg'"),
        ("waypoints_m", "#", "waypoints_m is missing"),
        ("25\nd", "'25'\nd", "bank_deg is .25.; it must be a finite number"),
        ("500.5, 40", "500.5", "waypoints is .*it must be n x 3 finite numbers"),
        ("500.5", "true", "waypoints_m 3 2 is True"),
        ("20\n", "[20]\n", "duration_s is .20.; it must"),
        ("height_m = 480", "height = 480", "place: unknown key 'height' .did you mean 'height_m'"),
        ("26]", "26, 27]", "3 airspeeds for 2 legs"),
        ('"field"', "3", "name is 3"),
        ("480", "1" + "0" * 400, "height_m is a whole number of more than 64 bits"),
        ("= 47.63", "= 95", "up to 89 deg"),
        ("]]", "]", "is not TOML"),
    ],
)
def test_a_bad_plans_file_is_refused_in_one_line(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(PLAN.replace(old, new))
    with pytest.raises(DataError, match=said) as refused:
        flight_plan(path)
    assert str(refused.value).startswith(f"{path}: ") and "\n" not in str(refused.value)


@pytest.mark.short
@pytest.mark.parametrize(
    "field, value",
    [
        ("bank", "a"),
        ("bank", [0.5]),
        ("clearance", "a"),
        ("start_airspeed", "a"),
        ("duration", "a"),
    ],
)
def test_plans_of_the_wrong_type_are_refused(field, value):
    with pytest.raises(DataError, match=f"plan 'p': {field}.* is"):
        FlightPlan("p", ((0, 0, 0), (900, 0, 0)), **{field: value})
