"""The navigation filters under measurement: time on workload A with an attitude record at 1 Hz,
and consistency over 100 simulated flights."""

import sys
from pathlib import Path

import numpy as np
import subject
import workload

AHRS_STD = np.radians([0.3, 0.3, 1.0])
"""Of the attitude record: white errors of roll, pitch and heading, rad."""
TIMES = {"navigation, mekf time": "mekf", "navigation, fixed-gain time": "fixed-gain"}
"""Figure and filter, which runs in turns with the closed loop on the same sources."""
FED = ("direct-ahrs", "direct-euler", "indirect-ahrs-open", "indirect-ahrs-closed")
"""The Kalman filters whose attitude an AHRS measures."""
CONSISTENT = [
    "navigation, mekf NEES inside",
    "navigation, AHRS-fed NEES inside",
    "navigation, smoothed NEES inside",
]


def attitude(w, seed=1):
    """The attitude record of a workload: its truth once a second, with white errors (Source)."""
    import strapdown as sd

    rows = np.searchsorted(w.t, np.arange(1, int(w.t[-1]) + 1) - 0.5 * w.dt)
    errors = np.random.default_rng(seed).standard_normal((len(rows), 3)) * AHRS_STD
    return sd.Source(
        "attitude", w.t[rows], w.rph[rows] + errors, np.tile(AHRS_STD, (len(rows), 1)), gate=np.inf
    )


def times(alternating, turns):
    """[(time over the closed loop's, note)] of the filters of `TIMES`: medians of `turns`
    neighbouring runs."""
    w = workload.load("A")
    sources, found = (attitude(w),), []
    for name in TIMES.values():
        closed, own, value = alternating(
            subject.timed_run(w, "closed-loop", sources=sources),
            subject.timed_run(w, name, sources=sources),
            turns,
        )
        samples = len(w.t) - 1
        found.append(
            (
                value,
                f"{own / samples * 1e6:.3f} against {closed / samples * 1e6:.3f} us per IMU sample",
            )
        )
    return found


def consistency():
    """[(share of epochs inside the band, note)] for `CONSISTENT`: the statistics of
    tests/filters/test_consistency.py, whose functions these are."""
    tests = Path(__file__).resolve().parents[1] / "tests"
    sys.path[:0] = [str(tests / "filters"), str(tests / "support")]
    import test_consistency as made

    import strapdown as sd

    flight = made.made_flight()
    share = lambda names, estimate=sd.fuse: min(
        (made.share_inside(made.runs(flight, line, estimate=estimate)[0]), line[0], line[2].name)
        for line in made.FILTERS
        if line[0] in names
    )
    found = share(("mekf",)), share(FED), share(("closed-loop", "mekf"), sd.smooth)
    return [(value, f"the lowest: {name}, {imu}") for value, name, imu in found]
