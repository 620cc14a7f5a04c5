"""strapdown beside every package that can be had, on the same cases: errors, honesty, time.

    python benchmarks/ranking.py                     # all that build/ranking has not yet, and the page
    python benchmarks/ranking.py thor75 sidereon     # what has one of these in its name, without the page

Packages come from the extra `ranking`; GNSS_IMU from a clone in the folder that STRAPDOWN_PEERS names. Each run
has a process of its own: one that crashes, hangs or is missing is a line in the table.
"""

import functools
import json
import multiprocessing
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

# threads over 15 x 15 matrices only slow the packages down
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import ranking_cases as cases
import ranking_scores as scores
from adapters import (
    filterpy_ukf,
    gnss_imu,
    gtsam_graph,
    own,
    python_ins,
    sidereon_ins,
    smsfusion_ins,
)

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "ranking"
LIMIT = 900.0
"""s that a run may take."""
LOST = 1000.0
"""m: beyond it a filter has lost its way."""
PIECE = 20.0
"""s that are enough to compile a package."""


class System(NamedTuple):
    """A filter or a smoother of a package."""

    name: str
    run: object  # (workload, seconds) -> Result
    package: str
    smoother: bool = False
    on: tuple = ()  # cases that it is run on, where a sample takes milliseconds; else all


FEW = ("thor75", "demo, consumer")
SLOW = (*cases.RECORDINGS, "demo, consumer", "car, tactical", "ship, tactical")
RECORDED = (*FEW, "drive0708", "walk0827", "BROAD 02", "BROAD 15")
SYSTEMS = (
    System("strapdown closed-loop", own.closed_loop, "strapdown"),
    System("strapdown iekf", own.invariant, "strapdown"),
    System("python-ins feedback", python_ins.feedback, "python-ins", on=SLOW),
    System("smsfusion AidedINS", smsfusion_ins.aided, "smsfusion"),
    System("sidereon EKF", sidereon_ins.loose, "sidereon"),
    System("sidereon EKF, sign undone", sidereon_ins.sign_undone, "sidereon"),
    System("GNSS_IMU", gnss_imu.loose, "GNSS_IMU"),
    System("GTSAM fixed lag", gtsam_graph.fixed_lag, "gtsam"),
    System("filterpy UKF", filterpy_ukf.ukf, "filterpy", on=FEW),
    System("strapdown smooth", own.smoothed, "strapdown", smoother=True),
    System("strapdown smooth, iekf", own.smoothed_invariant, "strapdown", smoother=True),
    System("GTSAM batch", gtsam_graph.batch, "gtsam", smoother=True),
    System("smsfusion smoother", smsfusion_ins.smoothed, "smsfusion", smoother=True, on=RECORDED),
)


def hidden(trial):
    """The Workload without the fixes in the outages."""
    w, inside = trial.workload, np.zeros(len(trial.workload.fix_t), bool)
    for start, stop in trial.outages:
        inside |= (w.fix_t > start) & (w.fix_t <= stop)
    return w._replace(fix_t=w.fix_t[~inside], fix=w.fix[~inside])


def measured(trial, system):
    """Scores of one run over a Trial, as what JSON holds."""
    w = hidden(trial)
    with np.errstate(all="ignore"):
        result = system.run(w, np.inf)
        found = scores.scored(trial._replace(workload=w), result.estimate)
        return {"us": result.us, "scores": found}


def _send(pipe, trial, system):
    try:
        pipe.send(measured(trial, system))
    except Exception as error:  # of another package: whatever it is, it is a line of the table
        text = str(error).strip().splitlines()
        pipe.send({"stopped": f"{type(error).__name__}: {text[0] if text else ''}"})


def apart(trial, system, limit=LIMIT):
    """What `measured` says, from a process of its own that may crash or hang."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(theirs, trial, system))
    process.start()
    theirs.close()
    try:
        return ours.recv() if ours.poll(limit) else {"stopped": f"still running after {limit:g} s"}
    except EOFError:
        process.join()
        return {"stopped": f"the process ended with {process.exitcode}"}
    finally:
        process.kill()
        process.join()


def kept(name, seed, system, make):
    """The scores of a run: those in build/ranking, or measured and stored there."""
    path = FOLDER / f"{name} {seed} {system.name}.json"
    if path.exists():
        return json.loads(path.read_text(encoding="utf-8"))
    found = apart(make(), system)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found), encoding="utf-8")
    print(name, seed, system.name, _brief(found), flush=True)
    return found


def _brief(found):
    if "stopped" in found:
        return found["stopped"]
    outage = found["scores"]["in outages"]["position"]
    return f"{found['us']:.3g} us, {scores.size(outage['square']):.3g} m in outages"


def all_cases():
    """{name: [functions -> Trial, one for each seed]}."""
    found = {name: [make] for name, make in cases.recordings(FOLDER / "inputs").items()}
    for (motion, grade), make in cases.simulations().items():
        name = f"{motion}, {grade}"
        found[name] = [(lambda seed=seed, make=make: make(seed)) for seed in cases.SEEDS]
    return found


def joined(runs):
    """Runs with several random numbers as one: a block for each, because an error such as that of
    heading lasts through a run; the median of the times, and the first reason where one stopped."""
    stopped = [run for run in runs if "stopped" in run]
    if stopped or len(runs) == 1:
        return stopped[0] if stopped else runs[0]
    merged = {}
    for question in scores.QUESTIONS:
        merged[question] = {
            error: {
                key: [float(np.mean(run["scores"][question][error][key])) for run in runs]
                for key in part
            }
            for error, part in runs[0]["scores"][question].items()
        }
    return {"us": float(np.median([run["us"] for run in runs])), "scores": merged}


def warm():
    """Compile the kernels of packages that have them, so that the processes of the runs find them."""
    piece = cases.simulated("demo", "tactical", 0).workload.first(PIECE)
    kernels = (
        own.closed_loop,
        own.invariant,
        own.smoothed,
        smsfusion_ins.aided,
        smsfusion_ins.smoothed,
    )
    for run in kernels:
        with suppress(Exception):  # of a package that is missing or fails: a line of the table
            run(piece)


def results(names=()):
    """{case: {system: scores}} of all, or of what has one of `names` in its title."""
    found = {}
    warm()
    for name, seeds in all_cases().items():
        seeds = [functools.cache(make) for make in seeds]
        for system in SYSTEMS:
            title = f"{name} {system.name}"
            left_out = system.on and name not in system.on
            if left_out or (names and not any(part in title for part in names)):
                continue
            runs = [kept(name, k, system, make) for k, make in enumerate(seeds)]
            found.setdefault(name, {})[system.name] = joined(runs)
    return found


def main(names):
    """Run what is not there; without names write the page, too."""
    found = results(names)
    if not names:
        import ranking_page

        ranking_page.write(found)


if __name__ == "__main__":
    main(sys.argv[1:])
