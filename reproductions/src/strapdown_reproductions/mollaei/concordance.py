"""Concordance of Mollaei et al.: the code and the test of each equation, figure, table and
claim."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..common.concordance import ConcordanceEntry, of_claims
from .claims import CLAIMS

HERE = "reproductions/src/strapdown_reproductions/mollaei"
SIX, CRAFT = f"{HERE}/six_state", "src/strapdown/flight/aircraft_model"
TESTS = "tests/reproductions"
ERRATA = "tests/flight/aircraft_model/test_errata_mollaei.py"
FLIGHT = "tests/flight/aircraft_model/test_aircraft.py"
TWINS, STUDY = f"{TESTS}/test_mollaei_twins.py", f"{TESTS}/test_mollaei.py"
FORCES, MOTION = f"{CRAFT}/forces.py::forces", f"{CRAFT}/dynamics.py::evaluate"
KALMAN, POINTS = f"{SIX}/model.py", f"{SIX}/sigma_point_filters.py"
PARTICLES, MIXTURE = f"{SIX}/particle_filter.py", "src/strapdown/filters/particle/mixture.py"
EKF_TWIN = f"{TWINS}::test_the_ekf_is_19_to_22_for_five_minutes"
EKF_TWIN_BY_MODEL = f"{TWINS}::test_the_ekf_is_19_to_22_with_the_process_1_to_18"
UKF_TWIN = f"{TWINS}::test_the_ukf_is_23_to_32_for_five_minutes"
PKF_TWIN = f"{TWINS}::test_the_pkf_is_33_to_39_at_each_step"
MOTION_TEST = f"{FLIGHT}::test_flight_is_that_of_the_textbook_s_equations_and_converges_to_it"
PICTURES = f"{STUDY}::test_a_small_study_writes_its_page"
PRINTED = "as printed"
TABLE_1 = f"{STUDY}::test_the_grade_is_inside_the_ranges_of_table_1"
TABLES = f"{STUDY}::test_the_published_tables_say_what_was_counted_in_them"
AGAINST = f"{STUDY}::test_what_the_published_tables_contradict_themselves_in"

AIRCRAFT = (
    ConcordanceEntry(
        "(1)–(3)", "forces", MOTION, f"{ERRATA}::test_forces_1_to_3_are_right", PRINTED
    ),
    ConcordanceEntry(
        "(4)",
        "roll acceleration",
        MOTION,
        f"{ERRATA}::test_a_the_roll_acceleration_4_lacks_p_q",
        "corrected: p q in the first term with I_xz",
    ),
    ConcordanceEntry(
        "(5), (6)",
        "pitch and yaw accelerations",
        MOTION,
        f"{ERRATA}::test_pitch_and_yaw_accelerations_5_and_6_are_right",
        PRINTED,
    ),
    ConcordanceEntry(
        "(7)",
        "rolling moment",
        FORCES,
        f"{ERRATA}::test_e_the_rolling_moment_7_lacks_c_lr_and_c_l0",
        "with C_lr, C_l0 and the propeller's torque besides",
    ),
    ConcordanceEntry(
        "(8), (9)",
        "pitching and yawing moment",
        FORCES,
        f"{FLIGHT}::test_forces_are_those_of_the_textbook_anywhere",
        "as printed, with C_n0 besides",
    ),
    ConcordanceEntry(
        "(10)",
        "rate of the angle of attack",
        MOTION,
        f"{ERRATA}::test_the_angle_of_attack_10_is_right",
        "as printed; u, v, w are integrated in its place",
    ),
    ConcordanceEntry(
        "(11)",
        "rate of the sideslip",
        MOTION,
        f"{ERRATA}::test_d_the_sideslip_11_lacks_drag",
        "corrected: drag; u, v, w are integrated in its place",
    ),
    ConcordanceEntry(
        "(12)",
        "rate of the airspeed",
        MOTION,
        f"{ERRATA}::test_d_the_airspeed_12_is_right_with_drag_in_wind_axes",
        "as printed, with Dc the drag in wind axes",
    ),
    ConcordanceEntry(
        "(13), (14)",
        "rates of roll and pitch",
        MOTION,
        f"{ERRATA}::test_roll_and_pitch_rates_13_and_14_are_right",
        "as printed; a quaternion is integrated in their place",
    ),
    ConcordanceEntry(
        "(15)",
        "rate of the heading",
        MOTION,
        f"{ERRATA}::test_b_the_heading_rate_15_has_a_minus_for_a_plus",
        "corrected: plus before r cos φ sec θ",
    ),
    ConcordanceEntry("(16), (18)", "velocity north and down", MOTION, MOTION_TEST, PRINTED),
    ConcordanceEntry(
        "(17)",
        "velocity east",
        MOTION,
        f"{ERRATA}::test_c_the_east_velocity_17_has_two_signs_wrong",
        "corrected: both signs of the terms with cos ψ",
    ),
)
FILTERS = (
    ConcordanceEntry(
        "(19), (20)", "gain and state", f"{KALMAN}::correct_gaussian", EKF_TWIN, PRINTED
    ),
    ConcordanceEntry(
        "(21)",
        "covariance after a fix, Joseph form",
        f"{KALMAN}::correct_gaussian",
        EKF_TWIN,
        "corrected: the transpose of the second I - K H",
    ),
    ConcordanceEntry(
        "(22)",
        "covariance between fixes",
        f"{KALMAN}::linearised",
        EKF_TWIN_BY_MODEL,
        "as printed, over one sample; other readings of the operating point beside it",
    ),
    ConcordanceEntry(
        "(23), (24)", "symmetric sigma points", f"{POINTS}::symmetric", UKF_TWIN, PRINTED
    ),
    ConcordanceEntry(
        "(25)", "state and noise together", f"{POINTS}::through", UKF_TWIN, "as printed, P_xn = 0"
    ),
    ConcordanceEntry(
        "(26)–(29)",
        "state and covariance of the UKF after a fix, printed twice",
        f"{POINTS}::correct",
        UKF_TWIN,
        "as printed, in square-root form",
    ),
    ConcordanceEntry(
        "(30)",
        "scaled sigma points",
        f"{POINTS}::merwe",
        UKF_TWIN,
        "corrected: √((n + λ) Σ), the indices as in (23)",
    ),
    ConcordanceEntry("(31), (32)", "points seen by a fix", f"{POINTS}::correct", UKF_TWIN, PRINTED),
    ConcordanceEntry(
        "(33), (34)", "mixture of Gaussians", f"{PARTICLES}::start", PKF_TWIN, PRINTED
    ),
    ConcordanceEntry(
        "(35)",
        "prediction of the mixture",
        f"{PARTICLES}::predict",
        PKF_TWIN,
        "as printed, each component by (22) or by (37) to (39)",
    ),
    ConcordanceEntry("(36)", "weights", f"{MIXTURE}::update_weights", PKF_TWIN, PRINTED),
    ConcordanceEntry(
        "(37)–(39)", "sigma points of a component", f"{PARTICLES}::predict", PKF_TWIN, PRINTED
    ),
    ConcordanceEntry(
        "4, 500 particles",
        "systematic resampling",
        f"{MIXTURE}::resample",
        PKF_TWIN,
        "as printed, mean and covariance kept (Hoteit, Luo & Pham 2012)",
    ),
    ConcordanceEntry(
        "4, Q = 0.1 I, R = 0.5 I",
        "weights of all filters",
        f"{KALMAN}::REPRODUCED",
        EKF_TWIN,
        "as printed, m² and m²/s² of each sample and fix",
    ),
)
SHOWN = (
    ConcordanceEntry(
        "Fig. 1", "axes, on a rotary wing", "", "", "a drawing; the model is a fixed wing"
    ),
    *(
        ConcordanceEntry(
            f"Fig. {number}", what, f"{HERE}/figures.py::all_figures", PICTURES, "redrawn"
        )
        for number, what in (
            (2, "forces with fixes"),
            (3, "body speed with fixes"),
            (4, "control inputs, GPS cut at 15 s"),
            (5, "position, GPS cut at 15 s"),
            (6, "forces, five minutes without GPS"),
            (7, "control inputs, five minutes without GPS"),
        )
    ),
    ConcordanceEntry(
        "Table 1",
        "parameters of the IMU",
        "reproductions/src/strapdown_reproductions/grades/mollaei.toml",
        TABLE_1,
        "geometric means of its ranges",
    ),
    *(
        ConcordanceEntry(f"Table {number}", what, f"{HERE}/cells.py::redrawn", TABLES, "redrawn")
        for number, what in (
            (2, "deviations and overshoots with fixes"),
            (3, "the same, GPS cut at 15 s"),
            (4, "the same, five minutes without GPS"),
        )
    ),
    ConcordanceEntry(
        "Tables 2–4",
        "against each other",
        f"{HERE}/contradictions.py::contradictions",
        AGAINST,
        "contradict themselves",
    ),
)


def entries(claims: Sequence[Mapping[str, Any]]) -> list[ConcordanceEntry]:
    """All entries: equations, figures and tables, and the findings `claims`."""
    rules = of_claims(claims, CLAIMS, f"{HERE}/claims.py", f"{TESTS}/test_mollaei_claims.py")
    return [*AIRCRAFT, *FILTERS, *SHOWN, *rules]
