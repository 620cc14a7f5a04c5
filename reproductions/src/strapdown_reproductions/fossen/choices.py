"""Points that Fossen's chapter 14 and its published code leave unspecified or do otherwise, and the
choice made here for each."""

CHOICES = (
    (
        "the Earth",
        "flat, at rest; gravity of the latitude, without height",
        "the turning ellipsoid with gravity by height; specific force "
        "and rate in body axes are the "
        "published ones, so that the gyro's is against inertial space",
    ),
    (
        "samples of the IMU",
        "values at the end of each step",
        "integrals over each step of the true force and rate",
    ),
    ("length of a run", "100 s in the scripts; claims of 1-2 minutes", "300 s"),
    (
        "rates",
        "text: IMU 100 Hz, position 1 Hz; scripts: IMU 1 kHz, field 100 Hz, position 5 Hz",
        "IMU 100 Hz, field and compass 100 Hz, "
        "position and velocity 5 Hz; also position at 1 Hz, and IMU at 1 kHz",
    ),
    (
        "noise of the IMU",
        "0.005 m/s² and 0.005 rad/s per sample, at 1 kHz",
        "the same per sample at every rate",
    ),
    (
        "noise of the magnetometer",
        "0.005 nT per axis of a field of 52 000 nT",
        "0.005 of the field's strength: 0.26 uT",
    ),
    ("noise of compass and AHRS", "none", "white, 0.005 rad; AHRS at 10 Hz"),
    (
        "AHRS",
        "measures independently of the IMU's noise, with every sample",
        "independent here too, at 10 Hz, carried on by the gyros between records; a real one uses the "
        "same gyros and accelerometers",
    ),
    (
        "errors of the AHRS in the velocity",
        "none: ins_ahrs takes its attitude for exact, and R weighs the angles alone",
        "none with the chapter's weights, of which R = 1 rad² is no variance of an AHRS; with the "
        "true noises both neglected and considered (Schmidt 1966)",
    ),
    (
        "weights Q",
        "variances that the code adds as h² Q in each step of 1 ms",
        "densities q = h Q of that step, at every rate",
    ),
    (
        "weights R",
        "of fixes that are used only together with a position: the code computes the others and "
        "drops them",
        "the filters as printed drop them too; the library's use every fix when it comes, so that 100 "
        "fields a second weigh more than in the scripts",
    ),
    (
        "weights of the direct filters",
        "no code published",
        "those of the published filter with the same sensors (ins_euler, ins_ahrs); "
        "biases driven by white noise, without decay",
    ),
    (
        "gains of the fixed-gain observer",
        "not stated",
        "the defaults of `fixed-gain`, which has no weights",
    ),
    (
        "attitude observer with a reference vector by GNSS (the helicopter's)",
        "a demonstration on data that is not public, with positions differentiated twice; no gains",
        "velocity differences over the time between two fixes, less gravity, against the integral of "
        "the specific force (force-observer), with gravity alone beside it: on the signals with k1 = "
        "k2 = 1 1/s, ki = 0.1 1/s, on the recorded flight thor75 with the gains by default",
    ),
    (
        "which tuning",
        "weights larger than the simulated noise by far, not explained",
        "twice: the chapter's weights, and the simulated "
        "noises with the simulated model of the biases",
    ),
    (
        "start",
        "at the true position, velocity and attitude, biases 0, P the identity in m, m/s, rad",
        "so with the chapter's weights; with "
        "the true noises errors drawn from 1 m, "
        "0.1 m/s, 2 deg of roll and pitch, 5 deg of heading; deviations of the biases 0.3 m/s² and "
        "0.1 rad/s",
    ),
    (
        "time constants",
        "500 s (MEKF), 1000 and 500 s (Euler angles, AHRS), in the code",
        "those with the chapter's weights; with the true "
        "noises 300 s where the biases vary so, none where they are constant",
    ),
    (
        "varying biases of signal 2",
        "constant in the generator of the chapter's edition; in its later one they begin there and vary "
        "with 300 s, 20 µg and 8 deg/h",
        "both, each a reading; varying ones decay by two thirds in the run",
    ),
    (
        "gravity as a reference vector",
        "a unit vector, variance 1, in every correction; by a flag in later versions of the code",
        "so in the filters as printed; in the library's a source of one case, specific force against "
        "gravity with 9.8 m/s², and 1 m/s² for the true noises: the body's acceleration, of up to 0.3 "
        "m/s², lasts for tens of seconds",
    ),
    (
        '"converged"',
        "not defined; read off plots",
        "the length of the error of the three biases is below 0.02 m/s² (0.35 deg/s) and "
        "stays there",
    ),
    (
        'experiments behind "1-2 minutes"',
        "one run of one signal",
        "50 seeds, two signals, six sets of sensors, published weights and true noises",
    ),
    (
        '"sufficiently excited"',
        "not quantified",
        "the two signals against a body at rest, one in steady straight motion, and one that "
        "swings its heading alone",
    ),
    (
        "estimates of the biases between fixes",
        "decay in the equations of the text; carried over in ins_mekf and ins_ahrs, whose time "
        "constants are in the covariance alone",
        "held with the chapter's weights, as in the code; decaying beside it; with the true noises "
        "as the true biases do",
    ),
    (
        "Euler angles in the direct filter",
        "no code published",
        "as printed, angles as states and P of the angles (euler-direct); integrated by the "
        "midpoint rule; `direct-euler` beside it, which keeps P in rotations",
    ),
    (
        "Euler angles in the indirect filter (ins_euler)",
        "the error is a small rotation of the body, but is added to the angles; the "
        "compass row is [0 0 1]; a row of gravity with every position",
        "as printed, with that row and without it, and with the errors of the angles (euler-indirect)",
    ),
    (
        "covariance blow-up",
        "not quantified",
        "a stated standard deviation of an angle beyond half a turn, or a run that stops or is 10 m "
        "off",
    ),
    (
        "compass row of the MEKF (ins_mekf_psi)",
        "derivative by the whole attitude: zero pointing south; exact in later versions",
        "printed in the filter as printed, exact in the library's",
    ),
    (
        "growth of an error",
        "not quantified",
        "rms of the last 100 s over that of the 100 s before, above 1.5; linear growth has 1.65",
    ),
    (
        '"high-acceleration manoeuvres"',
        "not quantified",
        "a coordinated turn of 30 m/s and 0.2 rad/s: 6 m/s²",
    ),
    (
        "semiglobal stability",
        "no set of starts",
        "30 to 170 deg about random axes, k1 = k2 = 1 1/s, ki = 0.1 1/s, 600 s without noise",
    ),
    ("gates", "none", "none"),
    (
        "seeds",
        "none",
        "each sensor of each run has its own stream; filters and tunings share the draws of a seed",
    ),
)
"""(what, in the chapter and its code, here)."""
