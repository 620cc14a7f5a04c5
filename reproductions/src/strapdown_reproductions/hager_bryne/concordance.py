"""Concordance of Hager & Bryne: the code and the test of each equation, figure, table and claim."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..common.concordance import ConcordanceEntry, of_claims
from .claims import CLAIMS

CORE, FILTERS = "src/strapdown/core/mathematics", "src/strapdown/filters/ins"
HERE, GRADES = (
    "reproductions/src/strapdown_reproductions/hager_bryne",
    "reproductions/src/strapdown_reproductions/grades",
)
MATHEMATICS, LOOPS = "tests/core/mathematics", "tests/filters/ins/test_loops.py"
ERRATA = f"{MATHEMATICS}/test_errata_paper1.py"
PRINTED = "tests/reproductions/test_printed_updates.py"
STUDY, CLAIMS_TEST = (
    "tests/reproductions/test_hager_bryne.py",
    "tests/reproductions/test_hager_bryne_claims.py",
)
READINGS = "tests/reproductions/test_hager_bryne_readings.py"
FIGURES, CELLS = f"{HERE}/figures.py", f"{HERE}/cells.py"
IN_PAGE = f"{STUDY}::test_the_study_writes_page_tables_and_claims"
EQUATIONS = (
    ConcordanceEntry(
        "Table I",
        "ellipsoid, Earth rate",
        f"{CORE}/earth.py::E2",
        f"{ERRATA}::test_finding_h_the_first_eccentricity_is_squared",
        "corrected: e = f (2 - f) is e²",
    ),
    ConcordanceEntry(
        "(1), (11)",
        "nominal state and error state",
        f"{CORE}/belief.py::FilterState",
        f"{MATHEMATICS}/test_error_dynamics.py::test_block_of_F_is_the_derivative",
        "as printed; position errors in metres",
    ),
    ConcordanceEntry(
        "(2)",
        "quaternion of a rotation vector",
        f"{CORE}/rotation.py::turned_on",
        f"{MATHEMATICS}/test_rotation.py::test_rotate_left_and_right_are_the_exponential_map",
        "corrected: a factor ‖θ‖ too many",
    ),
    ConcordanceEntry(
        "(3)",
        "radii of curvature",
        f"{CORE}/earth.py::radii",
        f"{MATHEMATICS}/test_earth.py::test_radii_at_48_degrees_are_those_of_e2_and_not_of_e",
        "as printed, with e² = f (2 - f)",
    ),
    ConcordanceEntry(
        "(4), (5)",
        "Earth rate and transport rate",
        f"{CORE}/earth.py::rotation_rates",
        f"{MATHEMATICS}/test_earth.py::test_rates_are_those_at_which_the_frames_turn",
        "as printed",
    ),
    ConcordanceEntry(
        "(6) to (10)",
        "attitude, velocity and position of a step",
        f"{CORE}/mechanization.py::mechanize",
        f"{MATHEMATICS}/test_mechanization.py::test_a_step_is_the_textbook_one",
        "as printed, with R_nb of the middle of the step; gravity of latitude and height",
    ),
    ConcordanceEntry(
        "(12), Table II",
        "F and G of the error state",
        f"{CORE}/error_dynamics.py::kinematic_blocks",
        f"{ERRATA}::test_the_literal_model_is_table_ii",
        "corrected: signs, radii and squares; as printed by error_model=literal",
    ),
    ConcordanceEntry(
        "(13)",
        "biases as Gauss-Markov processes",
        f"{CORE}/error_state.py::decay_biases",
        f"{MATHEMATICS}/test_kalman.py::test_biases_decay_as_gauss_markov_processes",
        "as printed, with the driving noise that the text names",
    ),
    ConcordanceEntry(
        "(14), (16)",
        "gain and covariance",
        f"{CORE}/kalman.py::update",
        f"{MATHEMATICS}/test_kalman.py::test_correction_is_the_textbook_one",
        "as printed, in Joseph's form",
    ),
    ConcordanceEntry(
        "(15)",
        "update of the error state",
        f"{HERE}/printed_updates.py::correct",
        f"{PRINTED}::test_a_loop_is_the_printed_one",
        "corrected: the prior is missing; as printed by closed-loop-as-printed",
    ),
    ConcordanceEntry(
        "(17)",
        "position measurement",
        "src/strapdown/aiding/position.py",
        f"{PRINTED}::test_a_loop_is_the_printed_one",
        "in metres NED from the estimate",
    ),
    ConcordanceEntry(
        "(18)",
        "covariance prediction, Van Loan",
        f"{CORE}/error_state.py::linearised_step",
        f"{MATHEMATICS}/test_kalman.py::test_prediction_agrees_with_van_loan",
        "as printed",
    ),
    ConcordanceEntry(
        "(19) to (23)",
        "open loop",
        f"{FILTERS}/open_loop.py::predict",
        f"{LOOPS}::test_the_raw_ins_of_the_open_loop_is_the_belief_less_its_error",
        "as printed, with the prior in (15); without it as open-loop-as-printed",
    ),
    ConcordanceEntry(
        "(24) to (26)",
        "closed loop",
        f"{FILTERS}/closed_loop_error_bias.py::predict",
        f"{LOOPS}::test_the_closed_loop_is_the_textbook_filter",
        "as printed, with the prior in (15)",
    ),
    ConcordanceEntry(
        "IV-B",
        '"(19) evaluating to zero"',
        f"{HERE}/printed_updates.py::ZERO_PREDICTION",
        f"{PRINTED}::test_a_loop_is_the_printed_one",
        "a reading on all flights, hardly other than (15) as printed",
    ),
    ConcordanceEntry(
        "IV-B",
        "bias in the INS",
        f"{FILTERS}/closed_loop.py::predict",
        f"{LOOPS}::test_bias_in_the_ins_and_in_the_error_state_agree_per_step_to_second_order",
        "as described",
    ),
    ConcordanceEntry(
        "Table III",
        "IMU grades",
        f"{GRADES}/paper1-tactical.toml::gauss_markov",
        f"{READINGS}::test_the_density_reading_of_table_three",
        "as printed; sigma in two readings",
    ),
    ConcordanceEntry(
        "V",
        "zero initial bias",
        f"{HERE}/imus.py::StartsAtZero",
        f"{READINGS}::test_biases_that_start_at_zero",
        "a reading",
    ),
    ConcordanceEntry(
        "V",
        "500 m, or highly inconsistent",
        f"{HERE}/readings.py::ABORT",
        f"{READINGS}::test_abort_rules_score_the_same_flights",
        "three readings; the bound on the NEES is ours",
    ),
    ConcordanceEntry(
        "V",
        "offset of 0.5 m/s²",
        f"{HERE}/main.py::scenarios",
        f"{STUDY}::test_the_full_study_is_the_papers",
        "two readings",
    ),
)
FIGURE_ENTRIES = (
    ConcordanceEntry(
        "Fig. 1", "flights", f"{FIGURES}::in_space", IN_PAGE, "our own paths of the lengths told"
    ),
    ConcordanceEntry(
        "Fig. 2",
        "position RMSE by flight",
        f"{FIGURES}::positions",
        IN_PAGE,
        "claims 1 to 5, 17, 18",
    ),
    ConcordanceEntry(
        "Fig. 3", "errors on flight 10", f"{FIGURES}::errors_of_a_run", IN_PAGE, "claims 5, 20"
    ),
    ConcordanceEntry("Fig. 4", "attitude RMSE", f"{FIGURES}::attitudes", IN_PAGE, "claims 9 to 11"),
    ConcordanceEntry(
        "Fig. 5", "biases on flight 07", f"{FIGURES}::biases", IN_PAGE, "claims 12, 14, 22"
    ),
    ConcordanceEntry(
        "Fig. 6", "position RMSE with offset", f"{FIGURES}::positions", IN_PAGE, "claims 12, 13"
    ),
)


def entries(claims: Sequence[Mapping[str, Any]]) -> list[ConcordanceEntry]:
    """All entries; `claims`: findings on CLAIMS."""
    test = f"{CLAIMS_TEST}::test_every_verdict_is_reached_by_every_claim"
    return [
        *EQUATIONS,
        *FIGURE_ENTRIES,
        *of_claims(claims, CLAIMS, f"{HERE}/claims.py", test),
    ]
