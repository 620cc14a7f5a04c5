"""Points that Alam et al. leave unspecified or print wrongly, and the choice made here for each."""

CHOICES = (
    (
        "the flight",
        "33 minutes in a Slingsby T67C; its data are not public",
        "simulated, the built-in scenario alam: the stated duration, phases, heights, rates and "
        "accelerations; path, speeds, 5 m/s of "
        "wind and light gusts are ours; and two public recordings, thor75 (fixed-wing UAV) and "
        "drive0708 (car)",
    ),
    (
        'accelerations "−5.2 g and +2.3 g"',
        "no axis, no sign convention",
        "specific force along the body's z axis, downwards: −1 g in level flight; reached in "
        "pull-ups and push-overs with level wings, "
        "while turns are coordinated",
    ),
    ("rates to ±50 deg/s", "no axis", "roll rate in reversals of steep turns"),
    (
        "DMU-10",
        '"commercial grade", no figures',
        "the grade dmu10: noise and bias instability of its class, turn-on biases, scale factors "
        "and misalignments assumed; no "
        "vibration of the engine, no temperature",
    ),
    (
        "MAX8W receiver",
        "5 Hz, no figures",
        "5 Hz, white errors: 2.1 m horizontally (2.5 m CEP), 3.5 m vertically, 0.1 and 0.15 m/s; no "
        "wander of the position, no latency; "
        "lever arm (0.4, 0, −0.5) m, known to the filters",
    ),
    (
        "reference",
        "RTK by RTKLIB with a station of CZEPOS, partly float",
        "the truth of the simulation; thor75: the solution on board; drive0708: RTK",
    ),
    (
        "start",
        '"left for initialisation"',
        "alignment on the same recording, the same for all filters: level and gyro bias from the "
        "rest, heading from the course while "
        "taxiing",
    ),
    (
        "tuning of all filters",
        '"in Rohac et al. (2017)"',
        "the defaults of the library: noise of the IMU's grade and the fixes' deviations; the "
        "observer's gains by its design at the fix "
        "interval; none changed for this study",
    ),
    (
        "(2), (3): biases without hats; the course vector",
        "[cos χ, −sin χ, 0], right only for level wings and a course that is the heading",
        "corrected; course by default tilt-compensated; printed, frozen and none as ablations (none "
        "also of EKF and XKF)",
    ),
    (
        "accelerometer bias of the observer",
        "‖b‖ for ‖b‖², and y_f from the estimate itself, which adapts nothing",
        "‖b‖², y_f = ‖f̂‖² − ‖f_IMU‖² (letter); and the library's own law, biases and wind from ξ "
        "(charity)",
    ),
    (
        "(5), (6), (9) of the two-stage EKF",
        "no rows of the bias, −cos θ sin θ and no g, gravity turned the wrong way",
        "corrected; see the page on the two-stage filters. The Earth turns and is round in the "
        "prediction of the state",
    ),
    (
        "(6): which accelerometers level stage 1",
        'the accelerometers as they are, "when only gravity affects the sensor"',
        "with their bias, less the change of velocity between fixes (letter); without the bias of "
        "stage 2 (spirit)",
    ),
    (
        "(10): what is measured of the velocity",
        "all of it in z, its downward component in ẑ and in the text",
        "the downward component (letter); all of it (spirit)",
    ),
    (
        "heading from the GNSS velocity",
        "conditions in Rohac et al. (2017)",
        "least speed and largest bank, options of the filters with the defaults of the library",
    ),
    (
        "XKF",
        '"the Jacobian ... to calculate the transition matrix is performed based on the estimated '
        'states by NLO", after Johansen & Fossen (2017)',
        "the EKF with that transition matrix (letter: XKF); the affine filter of Johansen & Fossen, "
        "whose mean goes on about the observer too (spirit: XKF, affine); both with the library's 15 "
        "states beside them",
    ),
    (
        "(8): the attitude as an input of stage 2",
        "whose is not said; given it, (9) is linear, so that only this choice, and no point of "
        "linearisation, matters to stage 2",
        "by the letter that of stage 1; of the affine XKF the observer's or (own attitude) that of "
        "its own stage 1",
    ),
    (
        "(8): the ACF as an input",
        '"can be found in Rohac et al. (2017)"',
        "ω × v of the estimate; no other source is flown, as none is printed",
    ),
    (
        "gains of the observer",
        '"in Rohac et al. (2017)"',
        "for the printed law k1 = 0.3, k2 = 0.03, ki = 0.01, wander 0.02; those of the library (0.1, "
        "0.003, 0.003, 0.01) one at a time and all together, and the library's law with the former "
        "(charity)",
    ),
    (
        "outages",
        "30 s in each 5-minute interval except the first, marked on a map",
        "the last 30 s of each full interval; position and velocity withheld; all five in one run",
    ),
    (
        "RMSE",
        '"during the GNSS outages"',
        "over the 30 s, at 10 Hz; the errors at the end beside it",
    ),
    (
        "attitude, velocity, biases",
        "plots alone",
        "scored too; the wander of the bias estimates is their standard deviation over time",
    ),
    ("number of flights", "one", "{seeds} of IMU and receiver errors on one path"),
    (
        "a filter that diverges",
        "not mentioned",
        "stays in the table and counts with 10 km and 1 km/s, the wander of its bias estimates with "
        "100 times the turn-on biases",
    ),
    (
        '"rapidly", "significantly", "stabilised"',
        "not quantified",
        "twice as far, twice as much, a fifth of the turn-on bias",
    ),
    (
        "thor75",
        "",
        "all 30 s windows inside 240 to 575 s that begin every 5 s, each a run of its own; windows "
        "that overlap the first of a block are in that block; "
        "neighbouring blocks overlap too, and the interval over blocks is widened for it",
    ),
    ("drive0708", "", "nine windows of 15 s, all in one run"),
)
"""(what, in the paper, here); {seeds}: how many the page has."""
