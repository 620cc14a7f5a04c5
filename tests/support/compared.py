"""Comparisons made up for the tests of their page: errors that grow with the square of time, as
large as asked for, along a made-up flight."""

import numpy as np
import pandas as pd
from synthetic import flight

from strapdown.experiments.outages.result import Comparison
from strapdown.experiments.outages.scores import ErrorTrack

TRUTH = flight(900, rate=5.0)
LIST = ((200.0, 230.0), (400.0, 430.0), (600.0, 630.0), (800.0, 830.0))
SWEEP = tuple((200.0 + 5 * k, 230.0 + 5 * k) for k in range(40))
START = {
    "t": 30.0,
    "lla": (0.8, 0.2, 300.0),
    "v_n": (1.0, 0.0, 0.0),
    "rph": (0.0, 0.0, -1.0),
    "b_a": (0.0,) * 3,
    "b_g": (0.0,) * 3,
    "std": (0.1,) * 15,
    "note": "made up",
}
NOISE = {
    "gyro": 1e-4,
    "accel": 1e-3,
    "gyro_bias": 0.0,
    "accel_bias": 0.0,
    "gyro_decay": 0.0,
    "accel_decay": 0.0,
}


def made(sizes, windows=LIST, failed=(), sweep=False, silent=(), seed=1, spread=0.05, **more):
    """A Comparison of {filter: size}: its errors at the end of 30 s are about `size` m north, half
    of it east and a quarter down.

    failed: (filter, outage from 1) that are not scored; silent: filters that claim no standard
    deviation; spread: of the sizes over the outages.
    """
    rng, rows, tracks = np.random.default_rng(seed), [], {}
    for name, size in sizes.items():
        tracks[name] = []
        for number, (start, stop) in enumerate(windows, 1):
            track, row = _outage(
                size * np.exp(spread * rng.standard_normal()), stop - start, name in silent
            )
            head = {
                "filter": name,
                "outage": number,
                "start_s": start,
                "stop_s": stop,
                "length_s": stop - start,
            }
            lost = (name, number) in failed
            last = {
                "distance_m": 40.0 * (stop - start),
                "said": "stopped: lost & <gone>" if lost else "",
            }
            rows.append(head | ({key: np.nan for key in row} if lost else row) | last)
            tracks[name].append(None if lost else track)
    words = (
        "made-up windows, each a run of its own"
        if sweep
        else f"{len(windows)} outages of a list, all in one run"
    )
    settings = {
        "imu": "made-up imu",
        "noise": NOISE,
        "start": START,
        "kinds": ["position"],
        "withheld": {"gnss": 30 * len(windows), "other": 0},
        "kept": {},
        "options": {name: {"interval": 60.0, "model": "true"} for name in sizes},
        "sources": {name: ["gnss"] for name in sizes},
        "reference": {name: "A Book (1999)" for name in sizes},
    }
    given = {"name": "made-up flight", "notes": ("one note",)} | more
    return Comparison(
        protocol="text",
        words=words,
        sweep=sweep,
        filters=tuple(sizes),
        windows=tuple(windows),
        kinds=("position",),
        scores=pd.DataFrame(rows),
        tracks=tracks,
        reference=TRUTH,
        span=(30.0, 900.0),
        settings=settings,
        **given,
    )


def _outage(size, length, silent):
    since = np.linspace(0.0, length, 61)
    error = size * ((since + 3.0) / 33.0)[:, None] ** 2 * [1.0, -0.5, 0.25]
    std = None if silent else np.tile(np.abs(error).mean(axis=0), (len(since), 1))
    rms, end, horizontal = (
        np.sqrt((error**2).mean(axis=0)),
        error[-1],
        np.hypot(error[:, 0], error[:, 1]),
    )
    axes = ("north", "east", "down")
    row = {f"{axis}_rmse_m": rms[i] for i, axis in enumerate(axes)} | {
        f"{axis}_end_m": end[i] for i, axis in enumerate(axes)
    }
    row |= {
        "horizontal_rmse_m": float(np.sqrt((horizontal**2).mean())),
        "horizontal_max_m": horizontal.max(),
        "horizontal_end_m": horizontal[-1],
        "drift_percent": 100 * horizontal[-1] / (40.0 * length),
        "velocity_rmse_m_s": size / 20,
        "velocity_end_m_s": size / 10,
    }
    row |= {f"{name}_rmse_deg": np.nan for name in ("roll", "pitch", "heading")}
    share = lambda k, columns: (
        np.nan if silent else float((np.abs(error) <= k * std)[:, columns].mean())
    )
    row |= {f"coverage_{k}": share(k, [0, 1]) for k in (1, 2, 3)} | {
        f"down_coverage_{k}": share(k, [2]) for k in (1, 2, 3)
    }
    return ErrorTrack(since, error, std), row
