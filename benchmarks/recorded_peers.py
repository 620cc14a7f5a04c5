"""strapdown beside other packages on real recordings: errors, honesty, time.

All get the same samples, fixes, noise, start and standard deviations: positions alone, which each of
them takes. By itself it runs all that build/recorded-peers has not yet, some twenty minutes, and
writes the table of docs/reference/evidence/peers.md.

    python benchmarks/recorded_peers.py              # all
    python benchmarks/recorded_peers.py thor75       # what has this in its name, without the table
"""

import json
import os
import sys
import traceback
from pathlib import Path
from typing import NamedTuple

# threads over 15 x 15 matrices only slow the peers down
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import numpy as np
import peers
import subject
from workload import DEG, Workload

import strapdown as sd
from strapdown.geometry.geodesy import displacement
from strapdown.io.locate import data_folder
from strapdown_reproductions.common import markdown
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS, in_motion, windows_of
from strapdown_reproductions.recordings.cases import with_optics

ROOT = Path(__file__).resolve().parents[1]
FOLDER, PAGE = ROOT / "build" / "recorded-peers", ROOT / "docs/reference/evidence/peers.md"
MARK = "<!-- begin: table of python benchmarks/recorded_peers.py -->"
BIAS = {"gyro": 1.0 * DEG, "accel": 0.3}
"""rad/s, m/s^2: what all know of the biases at the start where the IMU is not better."""
START = dict(vel_std=0.5, level_std=2.0, azimuth_std=5.0)
"""m/s, deg: of the start, which is at the reference or, for the car, at a solution with all fixes."""
DECIMATED = 3
"""Samples of BROAD that make one, 95 Hz of 286: the slow peers take milliseconds for each."""
PIECE = 10.0
"""s that are enough to time a peer."""
LOST = 1000.0
"""m: beyond it a filter has lost its way."""


class Trial(NamedTuple):
    """A recording as all get it, and what they are scored by."""

    workload: Workload
    outages: list  # [(start, stop)] s
    reference: sd.Trajectory
    attitude: bool  # whether the reference knows it
    scored: tuple  # (start, stop) s


def flight():
    """thor75, from the air on."""
    recording = sd.read(DESCRIPTIONS / "thor75.toml")
    outages = [(t, t + 15.0) for t in np.arange(270.0, 560.0, 50.0)]
    return made("thor75", recording, 225.0, 578.0, 0.02, 2.0, outages, (240.0, 575.0), True)


def drive():
    """drive0708, from where it moves."""
    recording = sd.read(DESCRIPTIONS / "drive0708.toml")
    windows = windows_of(recording)
    begin = windows[0][0] - 30.0
    scored = (windows[0][0], recording.span[1] - 1)
    return made("drive0708", recording, begin, scored[1], 0.01, 0.03, windows, scored, False)


def in_the_hand(path):
    """A trial of BROAD with a position from the cameras each second."""
    recording = in_motion(with_optics(path))
    ((start, stop),) = recording.meta["movement"]
    outages = [(t, t + 5.0) for t in np.arange(start + 20.0, stop - 5.0, 25.0)]
    name = f"BROAD {path.stem[:2]}"
    step = DECIMATED * float(np.median(recording.imu.dt))
    return made(name, recording, start - 5.0, stop, step, 0.1, outages, (start, stop), True)


def made(name, recording, start, stop, step, fix_std, outages, scored, attitude):
    """The Trial of a recording between two times: samples on a grid of `step` s that its fixes lie
    on, by interpolation of what they add up to."""
    (position,) = (a for a in recording.sources if a.kind == "position")
    inside = (position.t > start) & (position.t < stop)
    first = position.t[inside][0]
    t = first + step * np.arange(int((stop - first) / step))
    imu = recording.imu

    def on_grid(increments):
        at = np.r_[imu.t[0] - imu.dt[0], imu.t]
        sums = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])
        summed = np.column_stack([np.interp(t, at, column) for column in sums.T])
        return np.vstack([np.zeros(3), np.diff(summed, axis=0)])

    k = np.rint((position.t[inside] - first) / step).astype(int)
    on = (k > 0) & (k < len(t)) & (np.abs(position.t[inside] - first - k * step) < step / 2)
    grade = sd.imu(recording.meta["grade"])
    parameters = dict(START, gnss_std=fix_std, pos_std=max(fix_std, 0.1))
    for sensor, triad in (("gyro", grade.gyro), ("accel", grade.accel)):
        parameters |= {
            f"{sensor}_noise": triad.noise,
            f"{sensor}_bias_std": min(BIAS[sensor], triad.turn_on_bias),
            f"{sensor}_bias_walk": max(triad.bias_walk, 1e-7),
        }
    p = parameters
    deviations = (p["pos_std"], p["vel_std"], p["level_std"] * DEG, p["accel_bias_std"])
    stds = np.repeat([*deviations, p["gyro_bias_std"]], 3)
    stds[8] = p["azimuth_std"] * DEG
    workload = Workload(
        name,
        step,
        t,
        on_grid(imu.dtheta),
        on_grid(imu.dv),
        None,
        None,
        None,
        t[k[on]],
        position.y[inside][on],
        _state(recording, first, attitude),
        stds,
        parameters,
    )
    return Trial(workload, outages, recording.reference, attitude, scored)


def _state(recording, t, attitude):
    """(lla, v, rph) of the reference at t, or of strapdown with all fixes where it knows no
    attitude; where it knows no velocity, that of its positions over a second."""
    path = recording.reference if attitude else sd.fuse(recording).trajectory
    i = int(np.argmin(np.abs(path.t - t)))
    v = path.v_n[i] if path.v_n is not None else None
    if v is None or not np.isfinite(v).all():
        a, b = (int(np.argmin(np.abs(path.t - at))) for at in (path.t[i] - 0.1, path.t[i] + 0.1))
        v = displacement(path.lla[b : b + 1], path.lla[a : a + 1])[0] / (path.t[b] - path.t[a])
    return path.lla[i], v, path.rph[i]


def strapdown_run(workload, _=np.inf):
    """The closed loop of strapdown, without a gate, as the others have none."""
    solution = subject.fuse(workload, "closed-loop")
    path = solution.trajectory
    seconds = subject.timed_run(workload, "closed-loop")
    took = min(seconds() for _ in range(20))  # a loop of milliseconds, on a machine with other work
    return peers.judged(
        workload, took, path.t, path.lla, path.v_n, path.rotation.as_matrix(), path.std[:, :3]
    )


OWN = "strapdown closed-loop"
RUNS = {
    OWN: strapdown_run,
    "python-ins feedback": peers.pyins_feedback,
    "smsfusion AidedINS": peers.smsfusion_aided,
    "filterpy UKF": peers.filterpy_ukf,
}

SLOW = {"filterpy UKF": ("thor75", "BROAD 15")}
"""Recordings that are enough for what takes milliseconds for a sample."""


def hidden(trial):
    """The Workload without the fixes in the outages."""
    w = trial.workload
    keep = ~inside(trial.outages, w.fix_t)
    return w._replace(fix_t=w.fix_t[keep], fix=w.fix[keep])


def inside(windows, t):
    """Which of the times lie in one of the windows."""
    return np.logical_or.reduce([(t > start) & (t <= stop) for start, stop in windows])


def figures(trial, estimate, windows):
    """{figure: value} of an Estimate over windows, at the times of the reference: rms of position
    (m), velocity (m/s) and attitude (deg), and of its positions the share within 3 standard
    deviations (%) and the rms over them."""
    from scipy.spatial.transform import Rotation

    w, truth = trial.workload, trial.reference
    at = np.clip(np.searchsorted(truth.t, estimate.t), 1, len(truth.t) - 1)
    at -= (estimate.t - truth.t[at - 1]) < (truth.t[at] - estimate.t)
    known = (np.abs(truth.t[at] - estimate.t) < w.dt / 2) & inside(windows, estimate.t)
    at, found = at[known], {}
    error = displacement(estimate.lla[known], truth.lla[at])
    size = lambda e: float(np.sqrt((e**2).sum(axis=1).mean()))
    found["position"] = size(error)
    scaled = np.abs(error / estimate.std[known])
    found["within"] = 100 * float((scaled <= 3).mean())
    found["ratio"] = float(np.sqrt((scaled**2).mean()))
    if truth.v_n is not None and np.isfinite(truth.v_n[at]).all():
        found["velocity"] = size(estimate.v[known] - truth.v_n[at])
    if trial.attitude:
        turned = Rotation.from_matrix(estimate.C[known]) * truth.rotation[at].inv()
        found["attitude"] = size(turned.as_rotvec(degrees=True))
    return found


def measured(trial, name):
    """{figure: value} of one system: with all fixes, and in the outages."""
    path = FOLDER / f"{trial.workload.name} {name}.json"
    if path.exists():
        return json.loads(path.read_text(encoding="utf-8"))
    try:
        with np.errstate(all="ignore"):
            all_fixes, without = (RUNS[name](w, np.inf) for w in (trial.workload, hidden(trial)))
            found = {
                "us": timed(trial.workload, name),
                "all": figures(trial, all_fixes.estimate, [trial.scored]),
                "outages": figures(trial, without.estimate, trial.outages),
            }
    except (ValueError, np.linalg.LinAlgError, FloatingPointError) as error:
        traceback.print_exc()
        found = {"stopped": f"{type(error).__name__}: {str(error).splitlines()[0]}"}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found), encoding="utf-8")
    return found


HEADER = (
    "recording",
    "system",
    "time, µs per sample",
    "position, m",
    "velocity, m/s",
    "attitude, deg",
    "in outages: position, m",
    "velocity, m/s",
    "attitude, deg",
    "within 3 std, %",
    "error over std",
)


def text(rows):
    """The table: one line for each recording and system."""
    return (
        "\n".join(
            "| " + " | ".join(line) + " |" for line in (HEADER, ["---"] * 11, *map(cells, rows))
        )
        + "\n"
    )


def cells(row):
    """The cells of a row, as text."""
    name = [row["recording"], row["system"]]
    if "stopped" in row:
        return [*name, "", f"stopped: {row['stopped']}", *[""] * 7]
    time = f"{row['us']:.0f}" if row["us"] >= 100 else f"{row['us']:.3g}"
    if row["all"]["position"] > LOST or row["outages"]["position"] > LOST:
        lost = f"lost: {row['all']['position']:.2g} m with all fixes"
        return [*name, time, lost, *[""] * 7]
    errors = [
        f"{row[when][what]:.3g}" if what in row[when] else "–"
        for when in ("all", "outages")
        for what in ("position", "velocity", "attitude")
    ]
    honest = [f"{row['outages']['within']:.1f}", f"{row['outages']['ratio']:.2f}"]
    return [*name, time, *errors, *honest]


def timed(workload, name):
    """µs of the processor for a sample, on a piece; the second time, since the first may compile."""
    piece = workload.first(workload.t[0] + PIECE)
    if name == OWN:
        return RUNS[name](workload).us
    return [RUNS[name](piece, np.inf).us for _ in range(2)][1]


def trials():
    """All Trials."""
    broad = sorted((data_folder(DESCRIPTIONS) / "broad").glob("*.npz"))
    return [flight(), drive(), *map(in_the_hand, broad)]


def main(names):
    """Run what is not there, and write the table."""
    rows = []
    for trial in trials():
        for name in RUNS:
            title = f"{trial.workload.name} {name}"
            if trial.workload.name not in SLOW.get(name, (trial.workload.name,)) or (
                names and not any(part in title for part in names)
            ):
                continue
            found = measured(trial, name)
            print(trial.workload.name, name, found, flush=True)
            rows.append({"recording": trial.workload.name, "system": name, **found})
    if not names:
        markdown.insert(PAGE, text(rows), MARK)


if __name__ == "__main__":
    main(sys.argv[1:])
