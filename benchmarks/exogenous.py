"""The observer, the exogenous Kalman filter and the comparison of outages under measurement:
times in the engine, starts from far off, a whole sweep."""

import os
import time

import numpy as np
import subject
import workload

TIMES = ["exogenous, NLO step", "exogenous, XKF time"]
STARTS = ["exogenous, NLO starts, course", "exogenous, NLO starts, magnetometer"]
DRIFTS = [
    "nlo, thor75 without its magnetometer",
    "nlo, thor75 with its magnetometer",
    "nlo over two-stage EKF, thor75",
    "nlo over the printed law, drive0708",
    "xkf around it over the closed loop, thor75",
]
THOR = "30@240:575/5"
"""Windows of 30 s in the scored seconds, one every 5 s, each a run of its own."""
COMPARED = ["compare, 8 filters x 50 outages"]
FILTERS = (
    "closed-loop",
    "mekf",
    "open-loop",
    "indirect-ahrs-closed",
    "nlo",
    "two-stage-ekf",
    "xkf",
    "xkf-two-stage",
)
OUTAGES = "30@240:569/6"
"""Fifty windows of 30 s in the flight of thor75."""
VELOCITY_STD = 0.1
"""m/s."""


def velocity(w, seed=1):
    """The velocity of a workload at its fixes, with white errors (Source)."""
    import strapdown as sd

    rows = np.searchsorted(w.t, w.fix_t - 0.5 * w.dt)
    errors = np.random.default_rng(seed).standard_normal((len(rows), 3)) * VELOCITY_STD
    return sd.Source(
        "velocity", w.fix_t, w.v[rows] + errors, np.full((len(rows), 3), VELOCITY_STD), gate=np.inf
    )


def times(alternating, turns):
    """[(value, note)] for `TIMES`, on workload A with a velocity at each fix: us per sample of
    the observer; the XKF over the closed loop."""
    w = workload.load("A")
    sources, us = (velocity(w),), 1e6 / (len(w.t) - 1)
    closed = subject.timed_run(w, "closed-loop", sources=sources)
    before, observer, ratio = alternating(
        closed, subject.timed_run(w, "nlo", sources=sources), turns
    )
    theirs, own, value = alternating(closed, subject.timed_run(w, "xkf", sources=sources), turns)
    return [
        (observer * us, f"{ratio:.2f} x closed loop ({before * us:.3f} us)"),
        (value, f"{own * us:.3f} against {theirs * us:.3f} us per IMU sample"),
    ]


def starts():
    """[(of 100 seeds, note)] for `STARTS`; the notes have the other filters, and of each the share
    of the epochs from 30 s on in which its attitude is right: to be so at the end is less."""
    from strapdown_reproductions.alam import convergence

    found = {
        label: (
            int(np.isfinite(part["since_s"]).sum()),
            f"{100 * part['late_share'].mean():.0f} % of the epochs from 30 s on",
        )
        for label, part in convergence.study().groupby("case", sort=False)
    }
    course, magnetometer = (found.pop(f"NLO, {name}") for name in ("library's law", "magnetometer"))
    others = (f"{label} {count} ({share})" for label, (count, share) in found.items())
    return [(course[0], ", ".join([course[1], *others])), magnetometer]


def drifts():
    """[(value, note)] for `DRIFTS`: medians of the horizontal RMSE over the outages, and their
    ratios."""
    import strapdown as sd
    from strapdown_reproductions.common.example_recordings import DESCRIPTIONS, windows_of

    def drift(name, filters, windows):
        recording = sd.read(DESCRIPTIONS / f"{name}.toml")
        made = sd.compare(recording, filters, outages=windows or windows_of(recording))
        found = made.scores.groupby("filter", sort=False)["horizontal_rmse_m"]
        return [
            (row.iloc[0], f"the worst {row.iloc[1]:.0f} m")
            for _, row in found.agg(["median", "max"]).loc[list(made.filters)].iterrows()
        ]

    printed, affine = ("nlo", {"bias_law": "norm"}), ("xkf", {"near": 0.0})
    alone, ekf = drift("thor75", ["nlo", "two-stage-ekf"], THOR)
    full, closed, xkf = drift("thor75-full", ["nlo", "closed-loop", affine], THOR)
    own, theirs = drift("drive0708", ["nlo", printed], None)
    ratios = ((alone, ekf), (own, theirs), (xkf, closed))
    return [
        alone,
        full,
        *((one / other, f"{one:.3g} against {other:.3g} m") for (one, _), (other, _) in ratios),
    ]


def compared():
    """[(s, note)] for `COMPARED`: the whole call, page and tables included, once everything is
    compiled."""
    import tempfile
    from pathlib import Path

    import strapdown as sd

    recording = sd.read(
        Path(__file__).resolve().parents[1] / "examples" / "recordings" / "thor75-full.toml"
    )
    sd.compare(recording, FILTERS, outages="30@240:280/5")
    begin = time.perf_counter()
    made = sd.compare(recording, FILTERS, outages=OUTAGES)
    with tempfile.TemporaryDirectory() as folder:
        made.write(Path(folder))
    return [
        (
            time.perf_counter() - begin,
            f"{len(made.filters)} filters, {len(made.windows)} outages of 30 s on thor75, tables and page written; {os.cpu_count()} cores",
        )
    ]
