"""The readings of Hager & Bryne: that the cross is full, what is flown for each, how one flight is scored
by each abort rule, and how the votes are told."""

import numpy as np
import pandas as pd
import pytest
from test_hager_bryne import made_up

from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator
from strapdown_reproductions.common.concordance import missing_references
from strapdown_reproductions.common.pages import NOT_REPRODUCED, REPRODUCED
from strapdown_reproductions.common.reproduction import Asked
from strapdown_reproductions.hager_bryne import claims, main, readings
from strapdown_reproductions.hager_bryne.cells import (
    CellRows,
    by_time,
    compare_filters,
    grew,
    is_contained,
    nees_within,
)
from strapdown_reproductions.hager_bryne.concordance import entries
from strapdown_reproductions.hager_bryne.imus import density_reading, starting_at_zero
from strapdown_reproductions.hager_bryne.readings import (
    ABORT,
    BIASES,
    BY_LETTER,
    CHOSEN,
    FACTORS,
    IN_SPIRIT,
    OF_WORLD,
    P0,
    SIGMA,
    START,
    UPDATE,
    FlownWorld,
    WorldReading,
    by_level,
    cross,
    votes,
    votes_rows,
    votes_table,
    within,
)

pytestmark = pytest.mark.short


def test_factors_are_the_fields_of_a_reading_and_the_first_levels_are_chosen():
    assert [factor.field for factor in FACTORS] == list(WorldReading._fields)
    assert [factor.levels[0].key for factor in FACTORS] == list(CHOSEN)
    assert [factor.field for factor in OF_WORLD] == list(FlownWorld._fields)
    words = {level.word for factor in FACTORS for level in factor.levels}
    assert words == {"letter", "spirit", "charity"}


def test_the_letter_and_the_spirit():
    assert BY_LETTER[:7] == ("density", "alike", "zero", "chosen", "printed", "until", "constant")
    assert IN_SPIRIT[:7] == ("std", "alike", "drawn", "chosen", "prior", "500", "initial")
    assert within(BY_LETTER, (UPDATE,)) == CHOSEN._replace(update="printed")


def test_the_cross_is_full():
    factors = (SIGMA, P0, BIASES, START, UPDATE, ABORT)
    found = cross(factors)
    assert found[0] == CHOSEN and len(found) == len(set(found)) == 2 * 2 * 2 * 3 * 2 * 3
    assert {each.offset for each in found} == {CHOSEN.offset}
    assert len({each.world for each in found}) == len(main.worlds()) + 1 == 24


def test_a_world_is_flown_as_it_is_read():
    wanted = main.studies(Asked())
    flown = wanted[FlownWorld("density", "own", "zero", "tenth").name]
    chosen = wanted["flights"].cells[0].scenario
    cell = flown.cells[0]
    assert {each.imu.name for each in flown.cells} == {"paper1-navigation-density-zero"}
    assert cell.scenario.name == chosen.name
    assert cell.scenario.start_std[6:9] == pytest.approx(0.1 * np.array(chosen.start_std[6:9]))
    assert cell.scenario.start_std[9:12] == (None, None, None)
    assert chosen.start_std[9:12] == (0.1, 0.1, 0.1)
    own = FlownWorld("density", "alike", "drawn", "chosen").name
    assert len(wanted[own].cells) == 3 * 25 and wanted[own].runs == main.CROSS_RUNS
    offsets = {each.scenario.offset_decays for each in flown.cells if each.scenario.accel_offset[0]}
    assert offsets == {True, False}


def test_a_quick_run_has_the_chosen_world_and_the_letter():
    wanted = main.studies(Asked(quick=True))
    assert set(wanted) == {"flights", "offset", "initial", BY_LETTER.world.name}


def test_the_density_reading_of_table_three():
    spec = density_reading("paper1-tactical")
    assert spec.accel.gauss_markov == pytest.approx(9.81e-3 * np.sqrt(1800))
    assert spec.gyro.gauss_markov == pytest.approx(4.8481e-6 * np.sqrt(1800))
    assert spec.noise().accel_bias == pytest.approx(9.81e-3)


def test_biases_that_start_at_zero():
    """They wander from there as the same process does: what is missing is the first draw, which
    decays."""
    spec, flight = imu_spec("paper1-consumer"), scenario("paper1-01").replace(duration=30.0)
    zero = starting_at_zero(spec)
    assert zero.noise() == spec.noise() and zero.bias_std() == spec.bias_std()
    drawn, own = (Simulator(flight).recording(each, 3).meta for each in (spec, zero))
    for name, triad in (("b_a", spec.accel), ("b_g", spec.gyro)):
        assert not own[name][0].any() and own[name][-1].all() and drawn[name][0].all()
        decay = np.exp(-np.arange(len(own[name])) * 0.05 / triad.time_constant)[:, None]
        np.testing.assert_allclose(
            own[name], drawn[name] - drawn[name][0] * decay, atol=1e-9 * triad.gauss_markov
        )


def scored_rows(**changes):
    numbers, rows = made_up(2.0)
    return numbers, rows._replace(**changes)


def test_abort_rules_score_the_same_flights():
    """Errors grow ten times after half of the flight, where the second rule interrupts the first
    filter: until then it is as good as before, counted on it errs by 500 m, by the 500 m rule alone it
    has the larger errors."""
    numbers, rows = made_up(1.0)
    half = len(rows.t) // 2
    error, distance, until = rows.error.copy(), rows.distance.copy(), rows.until.copy()
    error[0, :, half:] *= 10.0
    distance[0, :, half:] *= 10.0
    until[0, :, half:] = False
    censored = (np.where(until, np.minimum(distance, 500.0), 500.0) ** 2).mean(axis=-1)
    found = compare_filters(
        numbers | {"censored": censored},
        rows._replace(error=error, distance=distance, until=until),
    )
    alone = np.sqrt((half + 100 * (len(rows.t) - half)) / len(rows.t))
    assert found["position_until"] == pytest.approx(1.0, rel=0.1)
    assert found["position_500"] == pytest.approx(alone, rel=0.1)
    assert found["position_both"] > 100
    assert found["tilt_until"] == pytest.approx(1.0, rel=0.2) and found["tilt_500"] > 5
    assert found["steps_until"] == pytest.approx(1.0, rel=0.2) and found["steps_500"] > 5


def test_growth_is_told_by_the_last_two_quarters():
    t = np.arange(40.0)
    distance = np.array([t, t[::-1], np.where(t < 25, 1.0, np.inf), np.where(t < 5, 9.0, 1.0)])
    np.testing.assert_array_equal(grew(distance), [True, False, True, False])


def test_what_the_filter_states_is_contained_or_not():
    _, rows = made_up(1.0)
    std = np.full_like(rows.std, 0.5)
    std[0, 0, 30, 0] = 2.0  # after 120 s
    std[0, 1, 2, 0] = 2.0  # before
    found = is_contained(rows._replace(std=std), 0)
    assert not found[0] and found[1:].all()


def test_nees_counts_while_the_position_is_within_500_m():
    _, rows = made_up(1.0)
    nees, inside = rows.nees.copy(), rows.within.copy()
    nees[0, :, 10:] = 150.0
    inside[0, :, 10:] = False
    np.testing.assert_allclose(nees_within(rows._replace(nees=nees, within=inside), 0), 15.0)


def test_errors_of_a_straight_flight_are_told_by_time():
    _, rows = made_up(1.0)
    distance = np.where(rows.t <= 100.0, 3.0, 4.0) * np.ones_like(rows.distance)
    found = by_time(rows._replace(distance=distance), (100.0, 200.0, 1e4))
    assert found["open_by_100_s"] == pytest.approx(3.0)
    assert found["open_by_200_s"] == pytest.approx(np.sqrt(12.5))
    assert not any("10000" in name for name in found)


VOTES = {
    reading: REPRODUCED if reading.update == "printed" else NOT_REPRODUCED
    for reading in cross((SIGMA, UPDATE))
}


def test_votes_say_which_reading_turns_the_verdict():
    text = votes((SIGMA, UPDATE), VOTES)
    assert text == (
        "By the letter reproduced; in the spirit not reproduced; of 4 readings 2 reproduced, 2 not "
        "reproduced; what turns it most is update of the closed loop (reproduced: with prior 0 of 2, "
        "(15) as printed 2 of 2)."
    )
    assert by_level(SIGMA, VOTES) == {"std": (1, 2), "density": (1, 2)}
    same = votes((SIGMA,), {reading: REPRODUCED for reading in cross((SIGMA,))})
    assert same == "By the letter reproduced; in the spirit reproduced; of 2 readings 2 reproduced."


def test_each_reading_has_its_line():
    read = [readings.ReadClaim(claims.CLAIMS["mandatory"].claim, (SIGMA, UPDATE))]
    table = votes_table(read, [VOTES])
    assert len(table) == sum(len(factor.levels) for factor in FACTORS)
    told = {(row["read"], row["as"]): row["1"] for _, row in table.iterrows()}
    assert told["update of the closed loop", "(15) as printed"] == "2/2"
    assert told["sigma of Table III", "stationary standard deviation"] == "1/2"
    assert told["aborted runs", ABORT.levels[0].name] == ""
    rows = votes_rows([VOTES], read)
    assert (
        len(rows) == 4 and set(rows["abort"]) == {""} and set(rows["sigma"]) == {"std", "density"}
    )


def test_every_entry_of_the_concordance_leads_somewhere():
    found = [{"claim": "", "source": "", "verdict": "partly"}] * len(claims.CLAIMS)
    all_entries = entries(found)
    assert missing_references(all_entries) == []
    printed = " ".join(entry.printed for entry in all_entries)
    for table in ("Table I", "Table II", "Table III"):
        assert table in printed
    for figure in range(1, 7):
        assert f"Fig. {figure}" in printed
    numbers = {1, 2, 3, 4, 5, *range(6, 11), 11, 12, 13, 14, 15, 16, 17, 18, *range(19, 27)}
    assert numbers == set(range(1, 27)) and "(24) to (26)" in printed


def test_a_row_of_cells_has_all_that_was_scored():
    numbers, rows = made_up(1.0)
    assert isinstance(rows, CellRows)
    found = pd.DataFrame([compare_filters(numbers, rows)])
    for level in ABORT.levels:
        assert f"position_{level.key}" in found
    for name in ("open_given_up_300", "open_onset_600", "closed_anees_500", "open_given_up_s"):
        assert name in found


def test_the_arithmetic_of_what_the_paper_contradicts():
    """As the page has it."""
    tactical, consumer, navigation = (
        imu_spec(f"paper1-{name}") for name in ("tactical", "consumer", "navigation")
    )
    as_density = {each: density_reading(each) for each in ("paper1-tactical", "paper1-consumer")}
    per_hour = np.degrees(1) * 3600
    wide, low = as_density["paper1-tactical"], as_density["paper1-consumer"]
    assert wide.accel.gauss_markov == pytest.approx(0.416, abs=5e-4)
    assert wide.gyro.gauss_markov * per_hour == pytest.approx(42, abs=0.5)
    assert tactical.gyro.gauss_markov * per_hour == pytest.approx(1, abs=1e-4)
    assert low.accel.gauss_markov == pytest.approx(1.41, abs=5e-3)
    assert np.degrees(low.gyro.gauss_markov) == pytest.approx(6.9, abs=0.05)
    ratios = [
        (consumer.gyro.gauss_markov / tactical.gyro.gauss_markov, 2023),
        (consumer.gyro.noise / tactical.gyro.noise, 63),
        (consumer.accel.gauss_markov / tactical.accel.gauss_markov, 12),
        (consumer.accel.noise / tactical.accel.noise, 40),
        (tactical.gyro.noise / navigation.gyro.noise, 364),
        (tactical.gyro.gauss_markov / navigation.gyro.gauss_markov, 485),
        (tactical.accel.gauss_markov / navigation.accel.gauss_markov, 981),
    ]
    for ratio, told in ratios:
        assert ratio == pytest.approx(told, abs=0.51)
    assert tactical.accel.noise / navigation.accel.noise == pytest.approx(3.3e8)
