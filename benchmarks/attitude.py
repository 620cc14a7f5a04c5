"""Attitude estimators under measurement: time per sample of the compiled loop on a BROAD trial, vqf
beside it, and accuracy on the five trials.

Needs the data folder (`STRAPDOWN_DATA`, or shared/data above). Gravity comes with each sample's
specific force, the magnetic field at each sample too.
"""

import sys
import tempfile
import time
from pathlib import Path

import figures
import numpy as np
import subject

from strapdown_reproductions.broad import main

TIMES = {"attitude, mahony time": "mahony", "attitude, MEKF time": "attitude-mekf"}
"""Figure and filter."""
ACCURACY = [
    "attitude, BROAD MEKF mean",
    "attitude, BROAD mahony mean",
    "attitude, BROAD smoothed mean",
    "attitude, BROAD MEKF trial 24",
    "attitude, BROAD MEKF trial 33",
]
"""The claims of `strapdown reproduce broad`, in the order of `broad.CLAIMS`."""
TRIAL = "02_undisturbed_slow_rotation_B"
TURNS = 15
"""Runs of each estimator, in turns with vqf; the median counts."""


SIMULATED = ["attitude, MEKF NEES inside", "attitude, mahony starts", "attitude, MEKF starts"]


def simulated():
    """[(value, note)] for `SIMULATED`: the statistics of tests/filters, whose functions these
    are."""
    sys.path[:0] = [
        str(Path(__file__).resolve().parents[1] / "tests" / part)
        for part in ("filters/attitude", "filters", "support")
    ]
    import test_attitude_consistency as consistency
    import test_attitude_starts as starts

    share = min(
        consistency.share_inside(
            consistency.runs(consistency.simulated(consistency.DURATION), spec)[0]
        )
        for spec in (consistency.WALK, consistency.MARKOV)
    )
    found = []
    for k in (0.5, 1.0):
        t, error = starts.angles(0.0, "mahony", duration=20 / k + 0.5, k1=k, k2=k)
        found.append((error[:, (t >= 10 / k) & (t <= 20 / k)] < 10).all(axis=1).sum())
    t, error = starts.angles(0.0, "attitude-mekf")
    return [
        (share, "the lower of a walking and a Gauss-Markov bias"),
        (min(found), "the lower of k1 = k2 = 0.5 and 1"),
        ((error[:, t >= 60.0] < 10).all(axis=1).sum(), ""),
    ]


def trial():
    """The Trial that times are measured on."""
    return main.load(main.data_folder() / "broad" / f"{TRIAL}.npz")


def timed_run(recording, name):
    """A function that runs filter `name` over a Recording and returns the seconds of the
    compiled loop, every sample stored; without covariance."""
    from strapdown import filters
    from strapdown.alignment.initial import align
    from strapdown.engine.options import run_options
    from strapdown.engine.prepare import assumed_noise, has_position

    start = align(
        recording,
        assumed_noise(recording.meta["grade"], None, True)[1],
        position=has_position(filters.find(name)),
    )
    return subject.timed(lambda begin: begin(recording, name, run_options(start=start)))


def vqf_run(made):
    """A function that runs vqf over a Trial and returns the seconds of its batch call; None
    where vqf is not installed."""
    peer = main.PEERS[0]
    if not main.installed_version(peer.package):
        return None
    samples = [np.ascontiguousarray(made.arrays[name]) for name in ("gyr", "acc", "mag")]

    def seconds():
        begin = time.perf_counter()
        peer.run(*samples, made.fs)
        return time.perf_counter() - begin

    return seconds


def times():
    """[(us per IMU sample, note)] of the filters of `TIMES`: medians of runs in turns with vqf."""
    made, found = trial(), []
    vqf = vqf_run(made)
    for name in TIMES.values():
        own = timed_run(made.recording, name)
        own()
        pairs = np.array([(own(), vqf() if vqf else np.nan) for _ in range(TURNS)])
        ours, theirs = np.median(pairs, axis=0) / len(made.recording.imu.t) * 1e6
        found.append(
            (
                ours,
                f"vqf {theirs:.3f} us, ratio {np.median(pairs[:, 0] / pairs[:, 1]):.2f}"
                if vqf
                else "vqf is not installed",
            )
        )
    return found


def accuracy():
    """[(rms orientation error in deg, note)] for `ACCURACY`."""
    with tempfile.TemporaryDirectory() as folder:
        claims = {
            claim["claim"]: claim["value"] for claim in main.reproduce(Path(folder), quick=True)
        }
    wanted = [main.claim_text(name, which) for name, which, _ in main.CLAIMS]
    return [(claims.get(text), "strapdown reproduce broad") for text in wanted]


def peer_figures():
    """Figures without target: what the fast peers reach on the five trials, or that they are not
    installed."""
    names = [peer.name for peer in main.PEERS if not peer.slow]
    if not main.installed_version("vqf"):
        return [
            figures.informative(f"attitude, BROAD {name}", None, "deg", "vqf is not installed")
            for name in names
        ]
    made = [main.load(path) for path in sorted((main.data_folder() / "broad").glob("*.npz"))]
    table = main.tables(made, [run for each in made for run in main.peer_runs(each, quick=True)])[
        "orientation"
    ][1].set_index("estimator")
    return [
        figures.informative(
            f"attitude, BROAD {name}",
            table.loc[name, "mean, deg"],
            "deg",
            f"{table.loc[name, 'time, us per sample']:.2f} us per sample",
        )
        for name in names
    ]
