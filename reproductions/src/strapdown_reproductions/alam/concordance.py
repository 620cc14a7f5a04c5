"""Concordance of Alam et al.: the code and the test of each equation, figure, table and claim."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..common.concordance import ConcordanceEntry, of_claims
from .claims import CLAIMS

OBSERVER, TWO_STAGE = "src/strapdown/filters/observer", "src/strapdown/filters/two_stage"
HERE = "reproductions/src/strapdown_reproductions/alam"
EQUATIONS_TEST = "tests/filters/observer/test_equations.py"
GAINS_TEST = "tests/filters/observer/test_observer_gains.py"
MODEL_TEST = "tests/filters/two_stage/test_two_stage.py"
ROWS_TEST = "tests/filters/two_stage/test_corrections.py"
TWIN = "tests/reproductions/test_alam_as_printed.py::test_a_filter_is_its_printed_equations"
TWIN_15 = (
    "tests/reproductions/test_alam_as_printed.py::"
    "test_a_filter_of_fifteen_states_is_its_printed_equations"
)
ECEF = f"{EQUATIONS_TEST}::test_it_is_the_observer_in_ecef_coordinates_to_first_order_in_the_sample"
STUDY, CLAIMS_TEST = (
    "tests/reproductions/test_alam.py",
    "tests/reproductions/test_alam_claims.py::test_a_world_in_which_the_paper_is_right",
)
PAGE = f"{STUDY}::test_a_small_study_writes_its_page"
SORTIE = "tests/sim/test_sortie.py::test_the_flight_of_alam_has_the_stated_envelope"
WINDOWS = f"{STUDY}::test_the_windows_are_those_of_the_paper"
EQUATIONS = (
    ConcordanceEntry(
        "(1)",
        "kinematics in ECEF",
        f"{OBSERVER}/equations.py::advance",
        ECEF,
        "as printed, in north, east, down; equal in ECEF",
    ),
    ConcordanceEntry(
        "(2)",
        "attitude and gyro bias, projection",
        f"{OBSERVER}/equations.py::turn",
        f"{EQUATIONS_TEST}::test_the_projection_keeps_the_bound_and_does_nothing_inside",
        "corrected: the bias has its hat; the projection is smooth",
    ),
    ConcordanceEntry(
        "2.1.2, injection",
        "two vectors in the body against two in ECEF",
        f"{OBSERVER}/equations.py::_towards_force",
        ECEF,
        "as printed",
    ),
    ConcordanceEntry(
        "(3)",
        "specific force; course as a vector",
        f"{OBSERVER}/equations.py::_course",
        f"{EQUATIONS_TEST}::"
        "test_printed_course_turns_a_right_attitude_and_the_tilt_compensated_does_not",
        "corrected: tilt-compensated; course=printed is the vector as it stands",
    ),
    ConcordanceEntry(
        "2.1.2, χ",
        "course of the GNSS velocity",
        f"{OBSERVER}/equations.py::too_slow",
        "tests/filters/observer/test_nlo.py::"
        "test_near_standstill_the_course_is_held_and_that_is_said",
        "as printed, with atan2; when it counts is ours",
    ),
    ConcordanceEntry(
        "2.1.3, θ and y_f",
        "accelerometer bias",
        f"{OBSERVER}/equations.py::_adapt",
        f"{EQUATIONS_TEST}::test_adaptation_uses_what_is_measured_and_the_square_of_the_bias",
        "corrected: ‖b‖², and y_f by what is measured; the printed one adapts nothing",
    ),
    ConcordanceEntry(
        "2.1.3, excitation",
        "∫ φ φ' ≥ ε I",
        f"{OBSERVER}/equations.py::smallest",
        f"{EQUATIONS_TEST}::test_the_monitor_is_the_smallest_eigenvalue",
        "as printed, over a forgetting mean",
    ),
    ConcordanceEntry(
        "2.1.4, observer",
        "position, velocity, ξ, specific force",
        f"{OBSERVER}/equations.py::_translate",
        f"{EQUATIONS_TEST}::"
        "test_a_turn_by_sigma_leaves_the_force_where_it_was_with_the_bias_taken_off_and_not_without",
        "corrected: f - b in both places",
    ),
    ConcordanceEntry(
        "2.1.4, θ² K_ξp",
        "high gain",
        f"{OBSERVER}/gains.py::_given_gains",
        f"{GAINS_TEST}::test_theta_speeds_all_up_alike_with_its_cube_on_xi_and_not_with_its_square",
        "corrected: θ³; θ = 1 in the study",
    ),
    ConcordanceEntry(
        "2.1.4, C_v = 0",
        "velocity left out",
        f"{OBSERVER}/gains.py::last_gains",
        f"{GAINS_TEST}::test_raw_velocity_injected_has_no_equilibrium_at_the_truth",
        "corrected: C_v multiplies the measured velocity too",
    ),
    ConcordanceEntry(
        "2.1.4, A - KC",
        "gains that are stable",
        f"{OBSERVER}/gains.py::spectral_radius",
        f"{GAINS_TEST}::test_the_riccati_design_is_that_of_scipy",
        "sampled at the fixes; the published gains are elsewhere",
    ),
    ConcordanceEntry(
        "(4), (5)",
        "stage 1: Euler angles, gyro bias",
        f"{TWO_STAGE}/model.py::propagate",
        TWIN,
        "corrected: rows of the bias",
    ),
    ConcordanceEntry(
        "(6)",
        "gravity and course",
        f"{TWO_STAGE}/corrections.py::_level",
        f"{MODEL_TEST}::test_printed_measurement_of_gravity",
        "corrected: -cos θ cos φ, times g; level=raw has the accelerometers as they are, less the "
        "change of velocity",
    ),
    ConcordanceEntry(
        "2.2.1, heading",
        "ψ of the GNSS velocity",
        f"{TWO_STAGE}/corrections.py::course",
        f"{ROWS_TEST}::test_a_course_is_a_heading",
        "as printed; when it counts is ours",
    ),
    ConcordanceEntry(
        "(7)",
        "stage 2: states",
        f"{TWO_STAGE}/two_stage_ekf.py::start",
        TWIN,
        "as printed",
    ),
    ConcordanceEntry(
        "(8)",
        "inputs: specific force, attitude, ACF",
        f"{HERE}/readings.py::FORMS",
        "tests/filters/two_stage/test_xkf_two_stage.py::test_which_attitude_drives_stage_2",
        "whose attitude: readings; ACF = ω × v of the estimate, as its source is elsewhere",
    ),
    ConcordanceEntry(
        "(9)",
        "position, velocity in the body, bias",
        f"{TWO_STAGE}/model.py::propagate",
        f"{MODEL_TEST}::test_printed_velocity_equation",
        "corrected: gravity turned by C_bn",
    ),
    ConcordanceEntry(
        "(10)",
        "position, velocity",
        f"{TWO_STAGE}/corrections.py::see",
        f"{MODEL_TEST}::test_printed_measurement_of_stage_two",
        "contradicts itself: both readings, velocity=down and full",
    ),
    ConcordanceEntry(
        "2.3, by its letter",
        "transition matrix at the observer",
        f"{HERE}/xkf_as_printed.py::XKF_AS_PRINTED",
        TWIN,
        "as printed",
    ),
    ConcordanceEntry(
        "2.3, as it refers to",
        "affine filter about the observer",
        f"{TWO_STAGE}/xkf_two_stage.py::XKF_TWO_STAGE",
        TWIN,
        "Johansen & Fossen (2017)",
    ),
    ConcordanceEntry(
        "2.3, 15 states",
        "both forms with the library's errors",
        f"{OBSERVER}/xkf.py::XKF",
        TWIN_15,
        "not in the paper; near=0, and near=inf with jacobian=observer",
    ),
    ConcordanceEntry("Fig. 1", "photographs of aircraft and sensors", "", "", "nothing to compute"),
    ConcordanceEntry(
        "3", "sensors and rates", f"{HERE}/choices.py::CHOICES", SORTIE, "grade dmu10; assumed"
    ),
    ConcordanceEntry(
        "Fig. 2", "track and heights", f"{HERE}/figures.py::flight", SORTIE, "simulated flight"
    ),
    ConcordanceEntry(
        "Fig. 3", "outages", f"{HERE}/runs.py::windows", WINDOWS, "30 s before each full 5 min"
    ),
    ConcordanceEntry(
        "Fig. 4",
        "attitude, biases, position, velocity",
        f"{HERE}/figures.py::figure4",
        PAGE,
        "redrawn",
    ),
    ConcordanceEntry(
        "Table 1",
        "RMSE in the outages",
        f"{HERE}/table1.py::PUBLISHED",
        f"{STUDY}::test_the_published_table_says_what_was_counted_in_it",
        "redrawn beside it; text and table contradict each other downwards",
    ),
)
"""In the order of the paper; claims follow."""


def entries(claims: Sequence[Mapping[str, Any]]) -> list[ConcordanceEntry]:
    """All entries, those of the findings `claims` last."""
    return [*EQUATIONS, *of_claims(claims, CLAIMS, f"{HERE}/claims.py", CLAIMS_TEST)]
