"""What a step of each filter costs over that of the closed loop:

    python benchmarks/filter_costs.py

writes filter_costs.csv beside this file, which the pages of the filters show. Filters of position
run on the first ten minutes of workload A (IMU 100 Hz, position and velocity at 1 Hz, and for
those fed by an AHRS its records at 1 Hz), those of attitude alone on a trial with gravity and
field at each sample. Each turn runs the closed loop beside them. The shortest of all turns counts,
of both: what else the machine does only adds to a time.
"""

import csv
from pathlib import Path

import attitude
import exogenous
import navigation
import subject
import workload

OUT = Path(__file__).with_name("filter_costs.csv")
TURNS = 40
SLOW = {"pkf": 3, "ckf": 15, "ukf": 15, "ekf": 15}
"""{filter: turns} of those whose run takes seconds."""


def compared(name):
    """(us per IMU sample, that over the closed loop's)."""
    from strapdown import filters

    w, filter = workload.load("A").first(600.0), filters.find(name)
    us, sources = 1e6 / (len(w.t) - 1), [exogenous.velocity(w)]
    if "attitude" in filter.needs:
        sources.append(navigation.attitude(w))
    closed = subject.timed_run(w, "closed-loop", sources=sources)
    if 0 in filter.estimates:
        own, scale = subject.timed_run(w, name, sources=sources), 1.0
    else:
        recording = attitude.trial().recording
        own = attitude.timed_run(recording, name)
        scale = (len(w.t) - 1) / len(recording.imu.t)
    closed(), own()
    turns = [(closed(), own()) for _ in range(SLOW.get(name, TURNS))]
    reference, took = (min(times) for times in zip(*turns))
    return us * took * scale, took * scale / reference


def main():
    from strapdown import filters

    rows = []
    for name in filters.own_names():
        took, ratio = compared(name)
        rows.append((name, f"{took:.2g}", f"{ratio:.2g}"))
        print(*rows[-1], flush=True)
    with OUT.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([("filter", "us per IMU sample", "over closed-loop"), *rows])


if __name__ == "__main__":
    main()
