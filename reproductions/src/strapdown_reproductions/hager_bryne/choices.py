"""Points that Hager & Bryne leave open or print wrongly, and the choice made here for each."""

CHOICES = (
    (
        "Table II, signs of F_θv and F_θp",
        "printed with the sign opposite to what the paper's own corrections demand",
        "corrected, as numeric differentiation of the mechanization demands; printed in the "
        "ablation",
    ),
    (
        "sign of the accelerometer bias",
        "F has +R for the accelerometer bias and −R for the gyro bias",
        "−R for both, f = f_measured − b",
    ),
    (
        "denominators in F_θp, F_θv(1,2), F_vp(1,3)",
        "squared or with the wrong radius",
        'those of the derivatives; printed in the error model "literal" of the ablation',
    ),
    (
        "gravity gradient in F_vp",
        "missing",
        "∂g/∂h and ∂g/∂μ are in F; without them in the ablation",
    ),
    (
        "gravity",
        'g(μ, λ) "as in Groves 2.4.7", whose model depends on latitude and height',
        "g(μ, h): Somigliana with the second-order free-air term; g(μ) alone in the ablation",
    ),
    ("eccentricity", "e = f(2 − f)", "that is e²; the radii use it so"),
    ("the rotation vector, equation (2)", "a factor ‖θ‖ too many", "the exponential map"),
    (
        "bias dynamics, equation (13)",
        "without driving noise",
        "first-order Gauss-Markov with variance σ²(1 − exp(−2 Δt/τ)) per step",
    ),
    (
        "σ and ρ of Table III",
        "σ in the unit of the bias, used as entry of Q_c; ρ in s",
        "σ stationary standard deviation, ρ time constant; σ as density of the driving noise, which "
        "Q_c = diag(σ²) says, a reading",
    ),
    ("unit of ARW", "rad/s^(3/2)", "rad/√s"),
    ("VRW of navigation grade, 1e-12", "a placeholder", "kept; the filter is told the same value"),
    (
        "gyro bias of consumer grade, 9.81e-3 rad/s",
        "same digits as the tactical accelerometer bias: a suspect copy",
        "kept",
    ),
    (
        "the update, equation (15)",
        "without the predicted error",
        "with it; without it, as printed, a reading of the closed loop, and of the open loop, which "
        "then forgets the drift of its INS at each fix, in the ablation: it cannot be meant there",
    ),
    ("covariance update, equation (16)", "(I − WH)P", "Joseph's form"),
    (
        "position measurement, equation (17)",
        "in NED, of a geodetic state",
        "displacement from the estimate in metres NED, noise 1 m on each axis",
    ),
    ("height noise", '"projected into latitude and longitude"; height not mentioned', "1 m too"),
    (
        "closed loop and biases",
        '"(19) evaluating to zero", yet the biases stay in the error state',
        "Φ b is composed into the state at each step (closed-loop-error-bias); a prediction of zero, "
        "which lets no bias into the INS, on all flights with the chosen readings, where it hardly "
        "differs from (15) as printed; bias in the INS in the ablation",
    ),
    ("time of R_nb in equation (7)", "not stated", "the middle of the step"),
    (
        "kinematics of the open loop's position error",
        "in latitude, longitude and height, linear",
        "as in the paper; linear in metres, and exact to second order, in the ablation",
    ),
    (
        "initial errors and P0",
        "not stated, but for an accelerometer bias that is alike for all grades",
        "1 m, 0.1 m/s, 0.1 deg roll and pitch, 0.2 deg heading, 0.1 m/s² accelerometer bias for all "
        "grades; gyro bias as the grade's σ; errors "
        "of position, velocity and attitude drawn from it, true biases from the grade, estimated as "
        "0. Readings: the grade's own std of the accelerometer bias; true biases of zero, as figure 2 "
        "has them; at navigation grade a tenth of the attitude error, and none of it. "
        "0.5 m/s² for the offset in the ablation",
    ),
    (
        "the flights",
        "only length, mean speed, and kind of 07 and 10",
        "eleven paths of this library with the stated lengths and speeds",
    ),
    (
        "seeds",
        "not stated",
        "one seed per study; each run has its own stream, shared by filters and grades",
    ),
    (
        '"highly inconsistent"',
        "not defined",
        "NEES of the 15 states above the chi-square bound of one false alarm in a million at each "
        "epoch for more than 10 s; results also with the 500 m rule alone",
    ),
    (
        "RMSE of aborted runs",
        "not stated",
        "all runs by the 500 m rule alone, each epoch from there on 500 m; readings: the same by both "
        "rules, and by both rules until each is interrupted; survival and RMSE of survivors beside",
    ),
    (
        "a raw INS far from the Earth",
        "not mentioned",
        "beyond 500 km of height inverse-square gravity goes on, and the run is counted as "
        '"left the model"; survival with and without',
    ),
    ("axes of the 0.5 m/s² offset", "not stated", "on each body axis, unknown to the filter"),
    (
        "what the offset is",
        '"a constant initial acceleration bias offset"',
        "two readings: constant during the flight, which the filter's model of a decaying "
        "bias contradicts; and initial value of the bias process, decaying with it",
    ),
    ("flights with offset", "08-11 left out", "01-07"),
    ("gating of fixes", "not mentioned", "none"),
    (
        "epochs that are scored",
        "not stated",
        "each second; curves and comparisons of biases and attitude each 5 s",
    ),
    (
        "Van Loan's discretisation",
        "named",
        "used; at 20 Hz it agrees with a second-order series to rounding",
    ),
    (
        '"occasional resets"',
        "in the conclusion only",
        "periodic-reset with intervals of 1 to 1200 s in the ablation",
    ),
)
"""(what, in the paper, here)."""
