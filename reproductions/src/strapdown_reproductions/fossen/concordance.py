"""Concordance of Fossen's chapter 14: the code and the test of each equation, figure, table and
claim.

The slides have no numbers of equations, so that each stands under its section.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from ..common.concordance import ConcordanceEntry, of_claims
from .claims import CLAIMS

SRC, TESTS = "src/strapdown", "tests"
HERE, STUDIED = "reproductions/src/strapdown_reproductions/fossen", "tests/reproductions"
EARTH, ROTATION = f"{SRC}/core/mathematics/earth.py", f"{SRC}/core/mathematics/rotation.py"
PRINTED, INTRO = f"{HERE}/printed_filters.py", f"{HERE}/intro.py"
TWINS = f"{STUDIED}/test_fossen_twins.py::test_each_printed_filter_is_its_equations"
OBSERVERS = f"{STUDIED}/test_fossen_twins.py::test_each_observer_is_its_equations"
ERRATA, OF_INTRO = f"{STUDIED}/test_errata_fossen.py", f"{STUDIED}/test_fossen_intro.py"
STUDY, FIGURES = f"{STUDIED}/test_fossen.py", f"{HERE}/figures.py"
IN_PAGE = f"{STUDY}::test_the_study_writes_page_tables_and_claims"
STATIC = f"{TESTS}/alignment/test_static_attitude.py"
SENSORS = (
    ConcordanceEntry(
        "14.1",
        "transform of the estimates from the IMU to the origin of the craft, by its lever arm",
        f"{SRC}/data/vehicle.py::Vehicle",
        f"{TESTS}/reproductions/test_vehicle_kit.py",
        "as printed",
    ),
    ConcordanceEntry(
        "14.1",
        "temperature-indexed table of offsets",
        f"{SRC}/sensor_models/imu_errors.py",
        f"{TESTS}/sensor_models/test_imu.py::test_temperature_bias_follows_the_table_along_the_warm_up",
        "as printed",
    ),
    ConcordanceEntry(
        "14.1.1",
        "rate measurement: rate, bias driven by white noise, white noise",
        f"{SRC}/sensor_models/imu.py::ImuSpec",
        f"{TESTS}/sensor_models/test_imu.py::test_bias_walk_grows_with_the_root_of_time",
        "as printed, on the turning Earth",
    ),
    ConcordanceEntry(
        "14.1.2",
        "force measurement: acceleration less gravity, bias, white noise",
        f"{HERE}/signals.py::recording",
        f"{STUDY}::test_samples_have_the_published_noise_at_any_rate",
        "as printed",
    ),
    ConcordanceEntry(
        "14.1.2",
        "what an accelerometer measures on a levelled table",
        f"{HERE}/signals.py::ideal",
        f"{STUDY}::test_a_body_at_rest_feels_gravity_and_the_turning_earth",
        "as printed: -g",
    ),
    ConcordanceEntry(
        "14.1.2",
        "gravity of the WGS-84 ellipsoid",
        f"{EARTH}::gravity",
        f"{STATIC}::test_gravity_is_the_published_formula",
        "as printed at height 0; with height and its north component besides",
    ),
    ConcordanceEntry(
        "14.1.3",
        "field measurement: field in the body, bias, white noise",
        f"{SRC}/sensor_models/magnetometer.py::Magnetometer",
        f"{TESTS}/sensor_models/test_magnetometer.py::test_every_distortion_enters_where_the_equation_says",
        "as printed, with soft iron besides",
    ),
    ConcordanceEntry(
        "14.1.3",
        "hard-iron calibration",
        f"{SRC}/calibration/fitting.py::calibrate",
        f"{TESTS}/calibration/test_calibration.py",
        "as printed, with soft iron besides",
    ),
    ConcordanceEntry(
        "14.1.3",
        "declination of the World Magnetic Model",
        f"{SRC}/sensor_models/geomagnetism.py",
        f"{TESTS}/sensor_models/test_geomagnetism.py::test_official_values",
        "as printed",
    ),
    ConcordanceEntry(
        "14.1.3",
        "heading from the levelled field plus declination",
        f"{SRC}/alignment/static_attitude.py::static_attitude",
        f"{ERRATA}::test_g_the_sign_of_the_magnetic_heading",
        "corrected: the sign of the published staticRollPitchYaw.m",
    ),
)
ATTITUDE = (
    ConcordanceEntry(
        "14.2.1",
        "roll and pitch by specific force",
        f"{SRC}/alignment/static_attitude.py::static_attitude",
        f"{ERRATA}::test_g_one_argument_arctangents_turn_the_body_upright",
        "corrected: all quadrants; claim 15",
    ),
    ConcordanceEntry(
        "14.2.1",
        "low-pass of the specific force",
        f"{SRC}/filters/attitude/mahony.py::start",
        f"{TESTS}/filters/attitude/test_attitude_twins.py::test_poles_are_those_of_the_closed_loop",
        "as an option",
    ),
    ConcordanceEntry(
        "14.2.2",
        "vertical reference unit: GNSS position and velocity moved to the IMU",
        f"{SRC}/aiding/position.py::observe",
        f"{TESTS}/aiding/test_aiding.py::test_jacobian_is_the_derivative",
        "as printed, in the measurement",
    ),
    ConcordanceEntry(
        "14.2.2",
        "heave",
        f"{SRC}/filters/attitude/vru.py",
        f"{TESTS}/filters/attitude/test_vru.py::test_heave_in_a_swell",
        "named alone in the chapter",
    ),
    ConcordanceEntry(
        "14.2.3",
        "attitude observer with bias correction (Mahony 2008), by cross products (Grip 2016)",
        f"{SRC}/filters/attitude/mahony.py::MAHONY",
        f"{TESTS}/filters/attitude/test_attitude_twins.py::test_without_low_pass_the_observer_is_the_published_one",
        "as printed with low_pass = 0; claims 16 and 17",
    ),
    ConcordanceEntry(
        "14.2.3",
        "reference vector 1, gravity",
        f"{HERE}/force_observer.py::FORCE_OBSERVER",
        OBSERVERS,
        "as printed, over the interval of a fix",
    ),
    ConcordanceEntry(
        "14.2.3",
        "reference vector 2, field, with its orthogonal projection",
        f"{HERE}/statements.py::observer",
        f"{STUDIED}/test_fossen_statements.py::test_the_observer_converges_at_its_poles",
        "as printed, projected and whole",
    ),
    ConcordanceEntry(
        "14.2.3",
        "reference vector 3, compass",
        f"{SRC}/filters/attitude/mahony.py::correct",
        f"{TESTS}/filters/attitude/test_attitude_twins.py::test_each_combination_of_directions_corrects_what_it_sees",
        "corrected: about the vertical, at any roll and pitch",
    ),
    ConcordanceEntry(
        "14.2.3, helicopter",
        "acceleration reference vector by GPS",
        f"{HERE}/force_observer.py::FORCE_OBSERVER",
        OBSERVERS,
        "velocity differenced once in place of position twice; the flight is not public; claim 18",
    ),
    ConcordanceEntry(
        "14.2.3, aircraft",
        "traffic pattern of a Piper Cherokee",
        f"{HERE}/statements.py::flight",
        f"{STUDIED}/test_fossen_statements.py::test_on_the_recorded_flight_gnss_tells_the_force",
        "not public: thor75 in its place; claim 18",
    ),
)
DIRECT = (
    ConcordanceEntry(
        "14.3",
        "strapdown navigation equations",
        f"{SRC}/core/mathematics/mechanization.py::mechanize",
        TWINS,
        "as printed, on the turning ellipsoid",
    ),
    ConcordanceEntry(
        "14.3", "rotation matrix and T(Theta)", f"{PRINTED}::transform", TWINS, "as printed"
    ),
    ConcordanceEntry(
        "14.3.1",
        "fixed-gain observer with an AHRS",
        f"{SRC}/filters/ahrs_aided/fixed_gain.py::FIXED_GAIN",
        OBSERVERS,
        "sampled: the poles of the printed one",
    ),
    ConcordanceEntry(
        "14.3.1",
        "commuting gains K = diag(k, k, l)",
        f"{SRC}/filters/ahrs_aided/fixed_gain.py::start",
        f"{TESTS}/filters/ahrs_aided/test_fixed_gain.py::test_a_turned_vehicle_has_turned_errors",
        "as printed",
    ),
    ConcordanceEntry(
        "14.3.1",
        "error dynamics and F Hurwitz",
        f"{HERE}/statements.py::error_dynamics",
        f"{STUDIED}/test_fossen_statements.py::test_the_poles_of_F_are_those_of_the_observer",
        "as printed; claim 19",
    ),
    ConcordanceEntry(
        "14.3.2",
        "15-state Kalman filter with an AHRS",
        f"{PRINTED}::AHRS_DIRECT",
        TWINS,
        "as printed; claim 1",
    ),
    ConcordanceEntry(
        "14.3.2",
        "the library's direct filter with an AHRS",
        f"{SRC}/filters/ahrs_aided/direct_ahrs.py::DIRECT_AHRS",
        f"{STUDIED}/test_fossen_ahrs.py::test_with_the_chapters_weights_they_are_the_published_recursion",
        "within a hundredth of a standard deviation of the printed one where errors of the AHRS are neglected",
    ),
    ConcordanceEntry(
        "14.3.2",
        "proof of observability",
        f"{INTRO}::observable",
        f"{OF_INTRO}::test_position_and_angle_tell_all_five_states_and_neither_alone_does",
        "by rank in the introductory example; claim 1 for 15 states",
    ),
    ConcordanceEntry(
        "14.3.3",
        "15-state EKF with Euler angles and its Jacobians",
        f"{PRINTED}::DIRECT",
        TWINS,
        "as printed; claims 2 and 3",
    ),
    ConcordanceEntry(
        "14.3.3",
        "specific force, or gravity, as a measurement",
        f"{PRINTED}::_see_direction",
        TWINS,
        'as printed; "usually we drop this measurement"',
    ),
)
INDIRECT = (
    ConcordanceEntry(
        "14.4",
        "feedforward and feedback of the error",
        f"{INTRO}::estimate",
        f"{OF_INTRO}::test_without_decay_all_three_forms_are_one_filter",
        "as printed",
    ),
    ConcordanceEntry(
        "14.4.1",
        "five-state example, its error model and bias models",
        f"{INTRO}::dynamics",
        f"{OF_INTRO}::test_transition_and_noise_have_their_closed_forms",
        "as printed; claims 4 and 5",
    ),
    ConcordanceEntry(
        "14.4.1",
        "predictor and corrector of the linear filter",
        f"{INTRO}::correct",
        f"{OF_INTRO}::test_the_steady_state_is_that_of_the_riccati_equation",
        "as printed",
    ),
    ConcordanceEntry(
        "14.4.2",
        "error-state filter with an AHRS, feedback: ins_ahrs.m",
        f"{PRINTED}::AHRS_INDIRECT",
        TWINS,
        "as printed; claims 6, 7 and 9",
    ),
    ConcordanceEntry(
        "14.4.2",
        "the same, feedforward",
        f"{SRC}/filters/ahrs_aided/indirect_ahrs_open.py::INDIRECT_AHRS_OPEN",
        f"{STUDIED}/test_fossen_ahrs.py::test_with_the_chapters_weights_they_are_the_published_recursion",
        "no code published; claim 8",
    ),
    ConcordanceEntry(
        "14.4.2, Euler angles",
        "ins_euler.m with its row of gravity",
        f"{PRINTED}::INDIRECT",
        TWINS,
        "as printed",
    ),
    ConcordanceEntry(
        "14.4.2, Euler angles",
        "a rotation error added to angles",
        f"{PRINTED}::ERRORS",
        f"{ERRATA}::test_f_a_rotation_error_added_to_euler_angles_is_wrong_at_tilt",
        "corrected as an option",
    ),
    ConcordanceEntry(
        "14.4.3", "quaternion, 2 x Gibbs vector, injection", f"{PRINTED}::_add", TWINS, "as printed"
    ),
    ConcordanceEntry(
        "14.4.3",
        "error model and INS model of the MEKF: ins_mekf.m",
        f"{PRINTED}::MEKF_PRINTED",
        TWINS,
        "as printed; claims 10 to 14",
    ),
    ConcordanceEntry(
        "14.4.3",
        "the library's MEKF",
        f"{SRC}/filters/ins/mekf.py::MEKF",
        f"{TESTS}/filters/ins/test_published_mekf.py::test_held_biases_are_the_published_recursion",
        "every fix is used when it comes, exact row of the compass, covariance turned by the injection",
    ),
    ConcordanceEntry(
        "14.4.3",
        "reference vectors of gravity and field",
        f"{PRINTED}::_see_direction",
        TWINS,
        "as printed",
    ),
    ConcordanceEntry(
        "14.4.3",
        "compass by Gibbs vector: ins_mekf_psi.m",
        f"{PRINTED}::_compass_row",
        f"{ERRATA}::test_b_the_printed_compass_row_fades_with_heading",
        "as printed; the library's row is exact, as in later versions of ins_mekf_psi.m",
    ),
    ConcordanceEntry(
        "14.4.3",
        "a fix without a position is dropped",
        f"{HERE}/cases.py::select_sources",
        f"{ERRATA}::test_c_a_field_between_position_fixes_is_used",
        'as printed for "mekf as printed"; the library uses every fix',
    ),
    ConcordanceEntry(
        "14.4.3",
        "weights Qd, added as h² Qd",
        f"{HERE}/cases.py::noise",
        f"{STUDY}::test_published_weights_belong_to_their_step_and_densities_do_not",
        "as densities of the published step",
    ),
    ConcordanceEntry(
        "14.4.3, ExINS_MEKF.m",
        "loop, rates and weights of the case study",
        f"{HERE}/cases.py::CASES",
        f"{STUDY}::test_published_weights_and_what_they_mean",
        "as published",
    ),
    ConcordanceEntry(
        "insSignal.m",
        "signals 1 and 2",
        f"{HERE}/signals.py::SIGNALS",
        f"{STUDY}::test_signals_are_the_published_ones",
        "as published; biases of signal 2 constant and varying",
    ),
)
FIGURE_ENTRIES = (
    ConcordanceEntry(
        "14.3, figure",
        "coupling of translation and rotation",
        "",
        "",
        "a block diagram: nothing to compute",
    ),
    ConcordanceEntry(
        "14.4, figures",
        "feedforward and feedback filters",
        "",
        "",
        "block diagrams: nothing to compute",
    ),
    ConcordanceEntry(
        "14.4.2, figure",
        "INS drift, bias compensated",
        f"{FIGURES}::introduction",
        IN_PAGE,
        "figures 7 and 8, claim 8",
    ),
    ConcordanceEntry(
        "14.2.3, figures",
        "helicopter and aircraft",
        f"{FIGURES}::flight",
        f"{STUDIED}/test_fossen_statements.py::test_on_the_recorded_flight_gnss_tells_the_force",
        "not public: figure 9 on thor75",
    ),
    ConcordanceEntry(
        "Fig. 14.9",
        "position, velocity and attitude of the MEKF",
        f"{FIGURES}::states",
        IN_PAGE,
        "figures 2a and 2b, claim 12",
    ),
    ConcordanceEntry(
        "Fig. 14.10",
        "biases of the MEKF",
        f"{FIGURES}::estimates",
        IN_PAGE,
        "figures 3a and 3b, claims 10 and 11",
    ),
)
EQUATIONS = (*SENSORS, *ATTITUDE, *DIRECT, *INDIRECT)


def entries(claims: Sequence[Mapping[str, Any]]) -> list[ConcordanceEntry]:
    """All entries; `claims`: findings on CLAIMS."""
    test = f"{STUDIED}/test_fossen_claims.py::test_every_verdict_is_reached_by_every_claim"
    return [*EQUATIONS, *FIGURE_ENTRIES, *of_claims(claims, CLAIMS, f"{HERE}/claims.py", test)]
