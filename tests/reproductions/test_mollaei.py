"""The study of Mollaei et al.: its metrics against closed forms, the published tables as
printed, and a small study end to end."""

import json

import numpy as np
import pandas as pd
import pytest

from strapdown.checks import DataError
from strapdown.geometry import geodesy
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown_reproductions.common.pages import COLOURS, TOO_FEW
from strapdown_reproductions.common.study import choices_table
from strapdown_reproductions.mollaei import contradictions, main, metrics, outliers, runs
from strapdown_reproductions.mollaei.cells import (
    AT_TRIM,
    CASES,
    CKF,
    CLOSED,
    CONDITIONS,
    E0,
    E1,
    E2,
    EKF,
    FED_TRUTH,
    FULL,
    GUSTS,
    HELD,
    HZ_10,
    IMU,
    MODEL,
    MODES,
    NO_FILTER,
    ONCE,
    OUTLIERS,
    PKF,
    POINTS,
    PRINTED,
    PUBLISHED,
    SIX,
    TURN,
    UKF,
    WIND,
    FlightCase,
    left_out,
    middle,
    redraw_table,
    wide,
)
from strapdown_reproductions.mollaei.choices import CHOICES, WORDS
from strapdown_reproductions.mollaei.metrics import FINAL, MEASURES, FlightRecord

DT = 0.01
CUT = 15.0


def flown(duration=25.0, deviating=0.0, error=(0.0, 0.0, 0.0), stopped=""):
    """A FlightRecord whose signals settle as exp(-t): forces (-10, 0, -100) N, weight, u from 25 to 27
    m/s; `error` grows linearly from the cut on, m/s."""
    t = np.arange(1, round(duration / DT) + 1) * DT
    step, rows = np.exp(-t), np.ones((len(t), 3))
    after = np.maximum(t - CUT, 0.0)[:, None]
    return FlightRecord(
        t,
        np.array([-10.0, 0, -100]) + (1 + deviating) * step[:, None] * [1.0, 0, 5.0],
        0.1 * step[:, None] * rows,
        rows * [-5.0, 0, 107.0],
        np.array([27.0, 0, 2.0]) - step[:, None] * [2.0, 0, 0.5],
        step[:, None] * rows,
        500 + 20 * step,
        3 + step,
        np.c_[25 * t, 0 * t, 0 * t],
        0 * t,
        after * np.array(error),
        (after > 0) * np.array(error),
        np.full(len(t), 0.01),
        np.full(2, 6.0),
        stopped,
    )


REFERENCE = flown()


@pytest.mark.short
def test_deviation_overshoot_and_settling_of_a_known_response():
    """Second order, damping 0.5: overshoot exp(-pi zeta / sqrt(1 - zeta^2)) of the step."""
    t, zeta, w = np.arange(0.0, 40.0, DT), 0.5, 2.0
    wd = w * np.sqrt(1 - zeta**2)
    y = 25 + 2 * (
        1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(wd * t))
    )
    peak = 100 * np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    last = metrics.final(t, y)
    assert last == pytest.approx(27.0, abs=1e-12) and metrics.overshoot(
        y, last, 25.0
    ) == pytest.approx(peak, rel=1e-4)
    assert metrics.overshoot(y, last) == pytest.approx(peak * 2 / 27, rel=1e-4)
    assert metrics.overshoot(-y, -last) == pytest.approx(peak * 2 / 27, rel=1e-4)
    assert (
        metrics.overshoot(50 - y, 23.0, 25.0) == pytest.approx(peak, rel=1e-4)
        and metrics.overshoot(y, 25.0, 25.0) == np.inf
    )
    decay = np.exp(-t)
    assert metrics.deviation(decay, 0.0) == pytest.approx(np.sqrt(0.5 / 40), rel=0.01)
    assert (
        metrics.settling_time(t, decay, 0.0, 0.1) == pytest.approx(np.log(10), abs=DT)
        and metrics.settling_time(t, decay, 0.0, 2.0) == 0
    )


@pytest.mark.short
def test_scores_of_a_flight_are_those_of_closed_forms():
    found = metrics.score(flown(deviating=1.0, error=(0.3, 0.4, 1.2)), REFERENCE, CUT)
    t = REFERENCE.t
    last = np.exp(-t[t > 25 - FINAL]).mean()
    assert found["fx_n"] == pytest.approx(2 * np.sqrt(np.mean((np.exp(-t) - last) ** 2)), rel=1e-9)
    assert found["fz_n"] == pytest.approx(5 * found["fx_n"])
    assert (
        found["fx_n_ref"] == pytest.approx(np.sqrt(np.mean((2 * np.exp(-t) - last) ** 2)), rel=1e-9)
        and found["fy_n"] == 0
        and found["gy_n"] == 0
    )
    assert found["mx_nm"] == pytest.approx(0.05 * found["fx_n"]) and found[
        "engine_rad_s"
    ] == pytest.approx(10 * found["fx_n"])
    assert found["step_x_pct"] < 1e-6 and found["settle_alpha_s"] == pytest.approx(
        -np.log(0.1 * np.ptp(np.exp(-t))), abs=2 * DT
    )
    after = t[t > CUT + 1e-9] - CUT
    assert (
        found["outage_horizontal_rmse_m"] == pytest.approx(0.5 * np.sqrt(np.mean(after**2)))
        and found["fixed_horizontal_rmse_m"] == 0
    )
    assert found["outage_vertical_rmse_m"] == pytest.approx(
        1.2 * np.sqrt(np.mean(after**2))
    ) and found["velocity_end_m_s"] == pytest.approx(1.3)
    assert (
        found["horizontal_end_m"],
        found["vertical_end_m"],
        found["drift_m_s"],
        found["worst_m"],
    ) == pytest.approx((5.0, 12.0, 0.5, 13.0))
    assert found["attitude_rmse_deg"] == pytest.approx(np.degrees(0.01)) and found["nees_end"] == 6
    assert found["off_max_m"] == 0 and found["said"] == ""
    assert set(found) == {*MEASURES, "said"}
    with_fixes = metrics.score(REFERENCE, REFERENCE)
    assert (
        all(
            np.isnan(with_fixes[name])
            for name in ("horizontal_end_m", "drift_m_s", "outage_horizontal_rmse_m")
        )
        and with_fixes["worst_m"] == 0
    )


@pytest.mark.short
def test_a_flight_that_stops_counts_and_is_named():
    lost = metrics.score(flown(12.0, stopped="below the ground at 12 s"), REFERENCE, CUT)
    assert np.isnan([lost.pop("nees_cut"), lost.pop("nees_end")]).all()
    assert lost == {
        **{name: most for name, most in MEASURES.items() if not name.startswith("nees")},
        "said": "below the ground at 12 s",
    }
    assert (
        middle([MEASURES["fx_n"]] * 3, MEASURES["fx_n"]) == "diverged"
        and middle([1.0, 2.0, 1e3], 1e3) == "2 (1 to diverged)"
    )
    far = metrics.score(flown(error=(2e4, 0.0, 0.0)), REFERENCE, CUT)
    assert far["worst_m"] == MEASURES["worst_m"] and far["said"] == "diverged" and far["fx_n"] < 1
    moved = REFERENCE._replace(place=REFERENCE.place + np.array([0.0, 3.0, 4.0]))
    assert metrics.score(moved, REFERENCE, CUT)["off_rms_m"] == pytest.approx(5.0)
    assert (
        metrics.score(REFERENCE._replace(place=np.nan * REFERENCE.place), REFERENCE, CUT)["said"]
        == "no finite state"
    )


@pytest.mark.short
def test_the_published_tables_say_what_was_counted_in_them():
    from strapdown_reproductions.mollaei.rules import PRINTED_ALL, PRINTED_DEVIATIONS, count_printed

    assert (
        count_printed("Table 2", PRINTED_DEVIATIONS, UKF, EKF) == "4 of 4"
        and count_printed("Table 2", PRINTED_ALL, UKF, EKF) == "5 of 6"
    )
    assert (
        count_printed("Table 2", PRINTED_ALL, PKF, "no filter") == "2 of 6"
        and count_printed("Table 2", PRINTED_ALL, UKF, "no filter") == "0 of 6"
    )
    assert (
        count_printed("Table 4", PRINTED_ALL, PKF, UKF) == "5 of 6"
        and count_printed("Table 3", ("fx_n",), UKF, "no filter") == "1 of 1"
    )
    ratios = [
        PUBLISHED[table][name][1] / PUBLISHED[table][name][2]
        for table in ("Table 2", "Table 3")
        for name in PRINTED_DEVIATIONS
    ]
    # as the claim on nonlinearity says
    assert min(ratios) == pytest.approx(2.93, abs=0.01) and max(ratios) == pytest.approx(
        19.4, abs=0.1
    )


@pytest.mark.short
def test_gz_over_gx_of_the_tables_is_that_of_a_weight():
    """Printed deviations are in the ratio of a change of pitch about 2.9 to 13.6 deg of it (-m g
    sin, m g cos), in both tables with four modes."""
    slopes = [
        PUBLISHED[table]["gz"][k] / PUBLISHED[table]["gx"][k]
        for table in ("Table 2", "Table 3")
        for k in range(4)
    ]
    assert 2.8 < np.degrees(np.arctan(min(slopes))) < np.degrees(np.arctan(max(slopes))) < 13.7


@pytest.mark.short
def test_the_grade_is_inside_the_ranges_of_table_1():
    sheet = imu_spec("mollaei").datasheet()
    noise = sheet["gyro noise, deg/sqrt(h)"]
    assert noise == pytest.approx(np.sqrt(max(0.01, 0.001 * 60) * min(0.1, 0.02 * 60)), rel=1e-3)
    assert sheet["gyro flicker, deg/h"] == pytest.approx(np.sqrt(1 * 10), rel=1e-3)
    assert sheet["accel flicker, mg"] == pytest.approx(np.sqrt(10 * 500) / 1e3, rel=1e-3)
    assert (
        imu_spec("mollaei").accel.noise
        == pytest.approx(np.sqrt(50 * 500) * 1e-6 * 9.80665, rel=2e-3)
        and sheet["gyro turn-on bias, deg/h"] == 0
    )


@pytest.mark.short
def test_tables_for_people():
    made = {
        (mode, cut): metrics.score(flown(deviating=0.1 * k), REFERENCE, cut)
        for k, mode in enumerate(MODES)
        for cut in (None, CUT)
    }
    rows = [
        {
            **case._asdict(),
            "mode": mode,
            "seed": seed,
            **made[mode, None if case.experiment == E0 else CUT],
        }
        for case in CASES
        for seed in range(3)
        for mode in MODES
    ]
    tables = wide(pd.DataFrame(rows))
    assert list(tables) == list(CASES) and tables[CASES[0]].attrs["lost"] == dict.fromkeys(MODES, 0)
    first = redraw_table(tables, E0).iloc[0]
    assert (
        first[EKF].startswith("1.0659 / 0.1")
        and first["prediction"] == "IMU"
        and len(redraw_table(tables, E1)) == len(redraw_table(tables, E0)) == 2 * 13
    )
    over = (
        redraw_table(tables, E1)
        .set_index("rms deviation from the final value, or overshoot")
        .loc["overshoot of velocity X, %"]
    )
    assert (
        over["no filter"].iloc[0].startswith("divergence / ")
        and redraw_table(tables, E2)[EKF].str.startswith("– / ").all()
    )
    shown = left_out(tables)
    assert (
        len(shown) == len(CASES) * 4
        and shown["NEES at the end"].str.startswith("6 (").all()
        and set(shown["lost"]) == {0}
    )
    assert [str(FlightCase(E1, FULL, MODEL)), str(FlightCase(E0))] == [
        "E1, 15 states, model-driven",
        "E0, IMU-driven",
    ]
    assert str(FlightCase(E1, SIX, IMU, PRINTED)) == "E1, IMU-driven, printed Q, R"
    gusty = FlightCase(E1, prediction=MODEL, condition=GUSTS)
    assert str(gusty) == "E1, model-driven, light turbulence"
    assert FlightCase(E0).linear and not FlightCase(E0, FULL).linear and not gusty.linear


@pytest.mark.short
def test_the_choices_fill_their_braces():
    filled = {"seeds": "3 of E0", "plan": "a step", "gnss": "1 m", "final": FINAL}
    table = choices_table(CHOICES, **filled)
    assert not table.to_string().count("{") and len(table) == len(CHOICES)


def test_all_modes_of_a_seed_have_the_same_sensor_errors():
    """Steered by the truth they fly the same way, and then measure the same."""
    one, other = (
        runs.flight(FlightCase(E1), mode, 7, duration=2.0, feedback="truth", outage=None).recording
        for mode in (EKF, NO_FILTER)
    )
    assert np.array_equal(one.imu.dv, other.imu.dv) and np.array_equal(
        one.imu.dtheta, other.imu.dtheta
    )
    assert (
        all(np.array_equal(a.y, b.y) for a, b in zip(one.sources, other.sources))
        and len(one.sources) == 2
    )
    again = runs.flight(
        FlightCase(E1), EKF, 8, duration=2.0, feedback="truth", outage=None
    ).recording
    assert not np.array_equal(one.imu.dv, again.imu.dv)


def test_a_record_is_the_flight_it_was_made_of():
    flight = runs.flight(FlightCase(E1), EKF, 3, duration=20.0)
    made, truth = runs.record(flight), flight.recording.reference
    assert len(made.t) == 2000 == len(truth.t) - 1 and made.stopped == ""
    fixes = flight.recording.sources[0].t
    assert fixes.max() == pytest.approx(14.8)  # none at 15 s, none at the end
    from strapdown.evaluation.consistency import nees

    estimate, P = flight.solution.trajectory, flight.solution.covariance
    position, velocity = (
        geodesy.displacement(truth.lla[1:], estimate.lla),
        truth.v_n[1:] - estimate.v_n,
    )
    assert np.allclose(made.position, position, atol=1e-6) and np.allclose(
        made.v_error, velocity, atol=1e-9
    )
    assert np.allclose(
        made.attitude, (truth.rotation[1:] * estimate.rotation.inv()).magnitude(), atol=1e-7
    )
    assert made.nees[1] == pytest.approx(
        float(nees(np.r_[position[-1], velocity[-1]], P[-1, :6, :6])), rel=1e-3
    )
    lat, _, height = truth.lla[0]
    assert np.allclose(
        np.linalg.norm(made.gravity, axis=1), 11.0 * geodesy.gravity(lat, height), rtol=1e-12
    )
    assert np.array_equal(made.force[:, 2], flight.log["Fz, N"])
    # body acceleration at rest in a turn-free final state: force and weight nearly cancel
    assert np.abs(made.force[-1] + made.gravity[-1]).max() < 2.0
    body = truth.rotation[1:].inv().apply(truth.v_n[1:].copy())
    assert np.allclose(made.velocity, body, atol=1e-9) and made.place[-1, 0] == pytest.approx(
        20 * 26.5, rel=0.02
    )
    assert np.isnan(
        runs.record(runs.flight(FlightCase(E1), NO_FILTER, 3, duration=2.0, outage=None)).nees
    ).all()


def test_ekf_and_ukf_are_one_filter_where_the_imu_drives_and_not_where_the_model_does():
    apart = {}
    for driven in (IMU, MODEL):
        ekf, ukf = (
            runs.score_flight(FlightCase(E1, prediction=driven, tuning=PRINTED), mode, 11, None)[1]
            for mode in (EKF, UKF)
        )
        apart[driven] = runs.largest_distance(ukf, ekf)
    assert apart[IMU] < 1e-6 < 1e-4 < apart[MODEL] < 10
    assert (
        np.isnan(runs.largest_distance(None, None))
        and runs.largest_distance(flown(12.0), flown()) == np.inf
    )


def test_in_e0_the_model_predicts_between_fixes_and_there_only():
    """Whoever predicts is in the log; with the model the fixes go on."""
    for driven, share in ((IMU, 0.0), (MODEL, 1.0)):
        flight = runs.flight(FlightCase(E0, prediction=driven), EKF, 5, duration=4.0)
        assert flight.log["model predicts"].mean() == share
        assert flight.recording.sources[0].t[-1] == pytest.approx(4.0)
    cut = runs.flight(FlightCase(E1, prediction=MODEL), EKF, 5, duration=20.0)
    assert np.flatnonzero(cut.log["model predicts"])[0] == 1500


def test_an_ekf_at_the_trim_is_the_ekf_where_the_imu_drives_and_no_other_is():
    """What `modes` leaves out is an identity; what it flies is none."""
    own = runs.score_flight(FlightCase(E1), EKF, 12, None)[1]
    off = {
        mode: runs.largest_distance(runs.score_flight(FlightCase(E1), mode, 12, None)[1], own)
        for mode in (AT_TRIM, ONCE, HELD)
    }
    assert off[AT_TRIM] == 0 and min(off[ONCE], off[HELD]) > 0.1
    assert {AT_TRIM, POINTS}.isdisjoint(runs.modes(FlightCase(E1), 0))
    assert {AT_TRIM, POINTS} <= set(runs.modes(FlightCase(E1, prediction=MODEL), 0))
    assert POINTS not in runs.modes(FlightCase(E1, prediction=MODEL), 1)
    assert NO_FILTER not in runs.modes(FlightCase(E1, prediction=MODEL, condition=GUSTS), 0)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_condition_is_flown(condition):
    """And is scored beside a reference flight at its own samples."""
    case = FlightCase(E1, prediction=MODEL, condition=condition)
    usual, other = (
        runs.flight(each, EKF, 5, duration=4.0, outage="3:")
        for each in (case._replace(condition=""), case)
    )
    seen = {
        "position fixes alone": len(other.recording.sources) == 1,
        "start 10 m and 5 m/s off": other.start.std[:6] == (10.0,) * 3 + (5.0,) * 3,
        "light turbulence": np.ptp(other.log["wind down, m/s"]) > 0.1,
        "filter at 20 Hz": len(other.recording.imu.t) == 4 * 20,
        "filter at 10 Hz": len(other.recording.imu.t) == 4 * 10,
    }
    assert [name for name, so in seen.items() if so] == [condition]
    assert len(usual.recording.imu.t) == 400 and len(usual.recording.sources) == 2
    reference = runs.beside(case)
    assert np.allclose(np.diff(reference.t), np.diff(other.recording.imu.t)[0])
    assert reference.t[-1] == 25.0


def test_true_feedback_flies_the_reference_flight_until_the_gps_is_cut():
    """And the fixes by themselves do not; cut off, both are lost."""
    for experiment in (E0, E1):
        reference = runs.reference(experiment)
        off = {}
        for mode in (FED_TRUTH, NO_FILTER):
            made = runs.score_flight(FlightCase(experiment), mode, 5, None)[1]
            distance = np.linalg.norm(made.place - reference.place[: len(made.place)], axis=1)
            off[mode] = distance[made.t < CUT].max(), distance.max()
        assert off[FED_TRUTH][0] < 0.01 < 0.1 < off[NO_FILTER][0]
        assert (off[FED_TRUTH][1] > 100) == (off[NO_FILTER][1] > 100) == (experiment == E1)
    assert FED_TRUTH not in runs.modes(FlightCase(TURN), 0)


@pytest.mark.parametrize("driven", [IMU, MODEL])
def test_a_filter_run_beside_a_flight_is_the_filter_of_the_flight(driven):
    """With its own fixes, to the bit: inputs and options are those of the flight."""
    case = FlightCase(OUTLIERS, prediction=driven)
    options = {"duration": 4.0, "outage": "3:", "feedback": "truth"}
    options["prediction"] = runs.PREDICTIONS[driven, True]
    for mode in (CKF, PKF):
        flight = runs.flight(case, mode, 7, 20, **options)
        beside = outliers.with_filter(flight, flight.recording, runs.FILTERS_SIX[mode][0])
        ours, its = beside.solution, flight.solution
        assert np.array_equal(ours.trajectory.lla, its.trajectory.lla)
        assert np.array_equal(ours.covariance, its.covariance)


def test_a_tenth_of_the_fixes_is_ten_times_as_far_off():
    flight = runs.flight(FlightCase(E0), EKF, 7, duration=25.0, feedback="truth")
    truth = flight.recording.reference
    hit = outliers.contaminate(flight.recording, 7)
    for own, other in zip(flight.recording.sources, hit.sources):
        exact = (truth.lla if own.kind == "position" else truth.v_n)[
            np.searchsorted(truth.t, own.t - 1e-6)
        ]
        factors = np.linalg.norm(other.y - exact, axis=1) / np.linalg.norm(own.y - exact, axis=1)
        large = factors > 5
        assert np.allclose(factors[~large], 1, rtol=1e-6) and np.allclose(factors[large], 10)
        assert 3 <= large.sum() <= 25 and len(large) == 125  # 12.5 expected
        assert np.array_equal(own.std, other.std)
    again = outliers.contaminate(flight.recording, 8)
    assert not np.array_equal(again.sources[0].y, hit.sources[0].y)


@pytest.mark.short
def test_distances_between_curves_are_shares_of_what_the_other_deviates():
    """Of exp(-t) and twice that: the same as what the one deviates, about zero."""
    found = metrics.distances(flown(deviating=1.0), REFERENCE, metrics.BY_TRUTH)
    t = REFERENCE.t
    size = metrics.deviation(np.exp(-t), np.exp(-t[t > 25 - FINAL]).mean())
    share = np.sqrt(np.mean(np.exp(-2 * t))) / size
    assert found["fx_n_by_truth"] == pytest.approx(share)
    assert found["fz_n_by_truth"] == pytest.approx(share)
    assert found["mx_nm_by_truth"] == 0 and found["gx_n_by_truth"] == np.inf
    assert metrics.distances(flown(12.0), REFERENCE, "x")["fx_n_x"] == np.inf
    with_fixes, cut = metrics.score(REFERENCE, REFERENCE), metrics.score(REFERENCE, REFERENCE, CUT)
    assert with_fixes["fx_n_by_truth"] == 0 and np.isnan(cut["fx_n_by_truth"])


@pytest.mark.short
def test_what_the_published_tables_contradict_themselves_in():
    """By hand from the printed numbers."""
    table = contradictions.contradictions()
    text = " ".join(table.to_numpy().ravel())
    # 0.1104 / 0.6123 = 0.180 of Gz, EKF; 0.1449 / 0.2171... of Gz, PKF: 0.0049 / 0.0073 = 0.671
    assert "are 0.18 to 0.67 of those with fixes" in text and "in all 12 rows below 1" in text
    assert "For Gz of the EKF 97% of the squares" in text  # 1 - 0.1803^2 = 0.967
    # 0.0018 / 0.1145 = 0.0157, 0.0011 / 0.0536 = 0.0205; sqrt(25 / 315) = 0.2817
    assert "Fx over 315 s (Table 4) is 0.016 to 0.021" in text and "= 0.282" in text
    assert list(table["so"][1:5]) == ["impossible for UKF and PKF, about one final value"] * 3 + [
        "possible, about one final value"
    ]
    assert "X, UKF 0.21" in text  # 11.6219 / 56.3589
    assert "UKF 0 of 6, PKF 2 of 6" in text
    assert contradictions.least_ratio(25.0, 100.0) == 0.5


@pytest.mark.short
def test_every_reading_has_one_word():
    from strapdown_reproductions.mollaei import rules

    words = {rules.LETTER, rules.SPIRIT, rules.CHARITY}
    assert {word for _, _, word, _ in WORDS} == {each.word for each in rules.READINGS} == words
    assert not any(" " in word for word in words)


@pytest.mark.short
def test_growth_curves_end_where_a_flight_does():
    curve = runs.curve(flown(12.0, stopped="gone"), REFERENCE)
    t = runs.curve_times(E1)
    assert (
        np.isfinite(curve[:, t <= 12.0]).all()
        and np.isinf(curve[:, t > 12.0]).all()
        and np.isinf(runs.curve(None, REFERENCE)).all()
    )
    whole = runs.curve(flown(error=(3.0, 4.0, 0.0)), REFERENCE)
    assert whole[0, -1] == pytest.approx(50.0) and whole[1, -1] == 0


def test_a_flight_that_cannot_begin_is_lost(monkeypatch):
    def refuse(*_, **__):
        raise DataError("no such filter")

    monkeypatch.setattr(runs, "fly", refuse)
    row, made = runs.score_flight(FlightCase(E1), EKF, 1, None)
    assert (
        row["said"] == "no such filter"
        and row["fx_n"] == MEASURES["fx_n"]
        and np.isnan(row["nees_end"])
        and made is None
    )


SMALL = (
    FlightCase(E0),
    FlightCase(E0, prediction=MODEL),
    FlightCase(E1),
    FlightCase(E1, prediction=MODEL),
    FlightCase(E2),
    FlightCase(TURN),
    FlightCase(WIND, prediction=MODEL),
    FlightCase(E1, FULL),
    FlightCase(E1, prediction=MODEL, condition=HZ_10),
    FlightCase(OUTLIERS, prediction=MODEL),
)


def test_a_small_study_writes_its_page(monkeypatch, tmp_path, goes_into_its_page):
    monkeypatch.setattr(runs, "SECONDS", {E2: 40.0, WIND: 30.0})
    monkeypatch.setattr(runs, "FILTERS_FULL", {CLOSED: "closed-loop"})
    monkeypatch.setattr(runs, "CASES", SMALL)
    monkeypatch.setattr(main, "QUICK_COMPONENTS", 8)
    runs.reference.cache_clear()
    done = []
    claims = main.reproduce(tmp_path, quick=True, progress=done.append)
    runs.reference.cache_clear()
    assert (
        done == sorted(done)
        and done[-1] == pytest.approx(1.0)
        and {claim["verdict"] for claim in claims} <= set(COLOURS)
    )
    number, one = next(
        (i, claim) for i, claim in enumerate(claims, 1) if claim["claim"].startswith("(Not said:)")
    )
    # one filter
    assert (
        json.loads((tmp_path / "claims.json").read_text()) == claims
        and {claim["verdict"] for claim in claims} == {TOO_FEW}
        and one["answer"].startswith("UKF: at most ")
    )
    page = (tmp_path / "index.html").read_text()
    assert (
        "Figure 7b redrawn" in page
        and "A quick run, 2 of each" in page
        and "2 seeds of E1" in page
        and ">nan<" not in page
    )
    names = {
        "flights",
        "full",
        "time",
        "readings",
        "conditions",
        "words",
        "contradictions",
        "not-judged",
        *(f"redrawn-{name}" for name in ("e0", "e1", "e2")),
        *(f"left-out-{name}" for name in ("e0", "e1", "e2", "turn", "wind", "outliers")),
    }
    assert {path.stem for path in tmp_path.glob("*.csv")} == names
    flights = pd.read_csv(tmp_path / "flights.csv")
    # two seeds, but one of those that no share of flights hangs on; components by sigma points in one
    of_case = {(E0, IMU): 7, (E0, MODEL): 8, (E1, IMU): 7, (E1, MODEL): 8, (E2, IMU): 7}
    of_case |= {(TURN, IMU): 4}
    points, wind, full, slow, tails = 2, 4, 1, 6, 2
    assert len(flights) == 2 * sum(of_case.values()) + points + wind + full + slow + tails
    assert not flights["fx_n"].isna().any()
    assert flights.loc[flights["mode"] == UKF, "apart_m"][flights["prediction"] == IMU].max() < 1e-6
    text = (tmp_path / "findings.md").read_text()
    goes_into_its_page("mollaei", text)
    assert f"| {number} | (Not said:)" in text


@pytest.mark.short
def test_bad_input_is_refused(tmp_path):
    for change in ({"runs": 0}, {"seed": -1}):
        with pytest.raises(DataError, match="it must be a whole number, [01] or more"):
            main.reproduce(tmp_path, **change)
