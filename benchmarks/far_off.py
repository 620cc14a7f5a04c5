"""`python benchmarks/far_off.py [--runs 30]`: starts whose heading is far off, as the table of
docs/explanation/sigma-points.md.

The weaving flight of the consistency tests with its walking MEMS IMU, 180 s, position and velocity
once a second; the standard deviation of the initial heading tells its error. A run has converged
when its heading is within 3 deg at the end; in brackets the median seconds until it stays there.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / part) for part in ("src", "tests/support", "tests/filters")]

import numpy as np  # noqa: E402
from test_consistency import RATE, WALK, weaving  # noqa: E402

import strapdown as sd  # noqa: E402
from strapdown.data.recording import Recording  # noqa: E402
from strapdown.sensor_models.gnss import Gnss  # noqa: E402
from strapdown.sim.synthesis import draw_start  # noqa: E402
from strapdown.sim.trajectory import increments, sample  # noqa: E402

SECONDS, NEAR = 180, 3.0
OFF = 30, 60, 90, 120, 150, 175
FILTERS = (("closed-loop", {}), ("ukf", {}), ("ukf", {"sigma": "symmetric"}), ("ckf", {}))


def flown(seed, truth, ideal, off, gated, name, options):
    """(heading error at the end deg, seconds until it stays below NEAR, count of repairs) of one
    run that begins `off` (deg), to the left or the right."""
    of_imu, of_gnss, of_start = np.random.default_rng(seed).spawn(3)
    accel, gyro = WALK.bias_std()
    start = draw_start(
        truth,
        np.r_[[5.0] * 3, [0.3] * 3, np.radians([0.5, 0.5, 0.0]), [accel] * 3, [gyro] * 3],
        of_start,
    )
    turned = start.rph[2] + np.radians(off) * (1 if seed % 2 else -1)
    start = start._replace(
        rph=(*start.rph[:2], turned), std=(*start.std[:8], np.radians(off), *start.std[9:])
    )
    fixes = Gnss().fixes(truth, of_gnss)
    fixes = fixes if gated else tuple(replace(source, gate=np.inf) for source in fixes)
    solution = sd.fuse(
        Recording(WALK.corrupt(ideal, of_imu)[0], fixes),
        name,
        noise=WALK.noise(),
        start=start,
        every=RATE,
        options=options,
    )
    heading = np.degrees(np.abs(sd.errors(solution, truth).attitude[:, 2]))
    away = np.flatnonzero(heading > NEAR)
    return (
        heading[-1],
        away[-1] + 1 if len(away) else 0,
        solution.columns["repairs"][-1] if "repairs" in solution.columns else 0,
    )


def main(runs):
    """Print the table."""
    t = np.arange(SECONDS * RATE + 1) / RATE
    truth, ideal, repairs = sample(weaving(), t[::RATE]), increments(weaving(), t), 0
    print(
        "| heading wrong by | gates | "
        + " | ".join(
            f"`{name}`" + "".join(f", {value}" for value in options.values())
            for name, options in FILTERS
        )
        + " |"
    )
    print("|---" * (2 + len(FILTERS)) + "|")
    for gated in (False, True):
        for off in OFF:
            cells = []
            for name, options in FILTERS:
                end, settled, repaired = np.array(
                    [flown(seed, truth, ideal, off, gated, name, options) for seed in range(runs)]
                ).T
                repairs += repaired.sum()
                there = end < NEAR
                cells.append(
                    f"{there.sum()}"
                    + (f" ({np.median(settled[there]):.0f})" if there.any() else "")
                )
            print(
                f"| {off}° | {'usual' if gated else 'off'} | " + " | ".join(cells) + " |",
                flush=True,
            )
    print(f"{runs} runs each; repairs: {repairs:.0f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=30)
    main(parser.parse_args().runs)
