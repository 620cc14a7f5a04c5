"""Points that Mollaei et al. leave unspecified or print wrongly, and the choice made for each."""

CHOICES = (
    (
        "the aircraft",
        '"real parameters", none given; figure 1 is captioned rotary wing',
        "Aerosonde, the 11.0 kg set of mavsim_public (aircraft.md); actuators with lag and limits",
    ),
    (
        "the autopilot",
        "not described; control inputs Ua, Ue, Ur, engine speed, AOF",
        "successive loop closure, gains from aircraft and trim (flight.md), fed by the estimate: "
        "its position, velocity, attitude and rate; "
        "the airspeed is that of the estimated velocity. AOF is taken as the angle of attack",
    ),
    (
        "the flight",
        "curves that converge to a final value; Fy = Gy = 0",
        "{plan}; no wind, no turbulence; beside it a turning flight, wind that nobody is told of, "
        "light turbulence, and a filter that starts 10 m and 5 m/s off",
    ),
    (
        '"no filter and real feedback"',
        "direct feedback of position and velocities, zero once the GPS is cut",
        "no filter: the last fix is held, zero once none came for a second; attitude by integrated "
        "gyros. Beside it true feedback: the same with the true position and velocity of each "
        "sample and a perfect IMU, one flight for all seeds. "
        "The reference flight is steered by the true state",
    ),
    (
        "sample time, GPS rate and noise",
        "missing",
        "100 Hz, 5 Hz; {gnss}; beside it the filter at 20 and at 10 Hz, and positions alone",
    ),
    (
        "the IMU",
        "ranges; random walk and noise density are one quantity and have different ranges (0.01 to "
        "0.1 deg/√h against 0.06 to 1.2)",
        "the grade mollaei: geometric means, of the white noise in the range that satisfies both "
        "rows: 0.0775 deg/√h, 158 µg/√Hz; "
        "bias instability 3.16 deg/h and 70.7 µg as flicker",
    ),
    (
        '"zero bias (bias drift)" 0.1 to 10 deg/s, 100 to 1000 µg',
        "not said what becomes of it; a gyro 1 deg/s off is useless after a second",
        "a turn-on bias, removed before the flight",
    ),
    (
        "states of the filters",
        "three positions, three velocities; nothing on attitude",
        "the same six; the attitude is the true one at the start and from then on the integrated "
        "gyros, never corrected. "
        "The 15-state filters of the library estimate it",
    ),
    (
        "who predicts",
        "not said; during the outage it is the whole difference",
        "two readings, side by side: accelerometers with that attitude (IMU-driven: linear, so that "
        "the filters are one), "
        "and the aircraft's own model from its controls (model-driven; assumed noise 0.1 m/s/√s), in "
        "E0 between the fixes. "
        "The model has the true parameters, which no real flight has",
    ),
    (
        "Q = 0.1 I, R = 0.5 I",
        "no units, no rate; one number for metres and metres per second",
        "printed: as they stand, Q added at every step of the prediction (0.1 m² and 0.1 m²/s² each "
        "10 ms), R of every fix (m², m²/s²). "
        "Beside it Q from the IMU's noise and R from the receiver's",
    ),
    (
        "where the EKF is linearised",
        'section 3.1: "linearizes the process around the operating point"; equation (22): at the '
        "estimate",
        "at the estimate; beside it forces at the trim of 25 m/s with the attitude as it is; all of "
        "the first order in the attitude too; and in the six states alone, with the attitude held at "
        "the trim's. Equation (22) speaks against the last three",
    ),
    ("gates", "none", "none with six states; the library's own (0.1 % false alarms) with 15"),
    (
        "sigma points",
        "two sets, (23) and (30), α = 0.1, β = 2, κ = 0",
        "(30), the printed parameters; a downdate that fails would be repaired and counted; with "
        "these parameters none does",
    ),
    (
        "PKF",
        "(33) to (36): Φ, θ undefined",
        "after Hoteit, Luo & Pham (2012): 500 components, each with its own Kalman correction, "
        "weights by likelihood, "
        "systematic resampling that keeps mean and covariance; prediction of each as EKF, beside it "
        "by the sigma points (37) to (39), which stand in its section",
    ),
    (
        "(21), (4), (11), (15), (17)",
        "transpose, p q, a sine, a sign, signs",
        "corrected (aircraft.md)",
    ),
    (
        "Fx, Fy, Fz",
        '"aerodynamic forces"; the thrust T stands beside Fx in (2)',
        "force of air and propeller together, along the body axes",
    ),
    (
        "Gx, Gy, Gz",
        "not defined. As moments Gx = Gz = 0 in symmetric flight, not Gy; the printed ones are the "
        "other way round, as the weight along the body axes "
        "would be: Gy = 0, and Gz / Gx is the tangent of a pitch of 3 to 14 deg in Tables 2 and 3",
        "both readings: weight (N) and moment (N m)",
    ),
    (
        '"deviation from the final value"',
        "root mean square; neither span nor final value defined",
        "over the whole flight from the mean of its last {final:g} s; beside it from that of the "
        "reference flight",
    ),
    (
        '"percentage of mutation", overshoot',
        "not defined; 1635 % in Z",
        "of the final value, as MATLAB's stepinfo does without an initial one; beside it of the "
        "step. "
        "Near a final value of zero per cents mean nothing: velocity Y is left out",
    ),
    ("number of flights", "one", "{seeds}; all modes of a seed have the same sensor errors"),
    (
        '"15 seconds" of outage',
        "heading of 4.1; the text: cut at 15 s of 25 s",
        "an outage of 10 s",
    ),
    ("five minutes with EKF and without filter", "said to diverge, not shown", "flown too"),
    (
        "a flight that stops",
        "not mentioned",
        "stays in the tables and counts with the most of each measure",
    ),
    (
        '"diverges", "much less than 500 m", "negligible"',
        "not quantified",
        "more than 500 m off; less than 100 m; less than twice the error before the outage",
    ),
)
"""(what, in the paper, here); {plan} and {gnss} are filled by runs.texts, {final} by metrics.FINAL,
{seeds} by main.flights."""
WORDS = (
    (
        "no filter, real feedback",
        "the true position and velocity",
        "letter",
        '"no filter and real feedback", "the actual feedback from the flying object\'s position and '
        'velocities"',
    ),
    ("", "the last fix, with its errors", "spirit", "what an aircraft without a filter has"),
    (
        "what predicts",
        "the IMU",
        "letter",
        '"the inertial navigation system is used as a reference path"',
    ),
    ("", "the aircraft's model", "spirit", "section 2, and the nonlinearity that is spoken of"),
    ("Q and R", "as printed", "letter", "Q = 0.1 I, R = 0.5 I"),
    ("", "from the sensors", "spirit", "what such numbers stand for"),
    ("the EKF is linearised", "at the estimate", "letter", "(22)"),
    ("", "forces at the trim", "spirit", '"around the operating point"'),
    ("", "once, or with the attitude held", "charity", "(22) speaks against it"),
    ("components of the PKF", "by sigma points", "letter", "(37) to (39)"),
    ("", "linearised at their means", "spirit", "Hoteit, Luo & Pham (2012)"),
    (
        "what is flown",
        "positions alone, a start that is off, turbulence, slower filters",
        "charity",
        "nothing; they might favour sigma points or particles",
    ),
)
"""[(what is open, reading, LETTER, SPIRIT or CHARITY of rules.py, what speaks for it)]."""
