"""Times of `Stream.step` where fixes come late: `python benchmarks/late_fixes.py`.

A simulated flight of 60 s at 200 Hz with position and velocity once a second, through a stream
that waits, one that is asked for `now` after each sample, and one that replays. Medians in us of
a sample and of a fix; the table of docs/how-to/stream.md.
"""

import time

import numpy as np

import strapdown as sd

LAG = 2.0
DELAYS = (0.1, 0.3, 1.0, 1.9)


def arrivals(recording: sd.Recording, delay: float) -> list[sd.Sample | sd.Measurement]:
    """Its samples and fixes as they arrive, fixes `delay` s late."""
    columns = (column.tolist() for column in recording.imu)
    found: list[tuple[float, sd.Sample | sd.Measurement]] = [
        (row[0], sd.Sample(row[0], row[1], tuple(row[2]), tuple(row[3]))) for row in zip(*columns)
    ]
    for k, a in enumerate(recording.sources):
        rows = zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
        found += [(t + delay, sd.Measurement(t, k, tuple(y), tuple(std))) for t, y, std in rows]
    return [event for _, event in sorted(found, key=lambda each: each[0])]


def times(recording: sd.Recording, delay: float, now: bool, replay: bool) -> tuple[float, float]:
    """Medians of the times of a sample and of a fix, us."""
    stream = sd.Stream(
        "closed-loop", imu="tactical", sources=recording.sources, lag=LAG, replay=replay
    )
    took: dict[type, list[float]] = {sd.Sample: [], sd.Measurement: []}
    for event in arrivals(recording, delay):
        begin = time.perf_counter()
        stream.step(event)
        if now:
            stream.now  # noqa: B018 (what it costs)
        if stream.started:
            took[type(event)].append(time.perf_counter() - begin)
    sample, fix = (1e6 * float(np.median(each[10:])) for each in took.values())
    return sample, fix


def main() -> None:
    recording = sd.simulate("demo", 60.0, seed=1, rate=200.0)
    print("| stream | fixes late by | a sample, us | a fix, us |\n|---|---|---|---|")
    for name, now, replay in (
        ("`lag=2`", False, False),
        ("`lag=2`, `now` after each step", True, False),
        ("`lag=2, replay=True`", False, True),
    ):
        for delay in DELAYS if replay else DELAYS[:1]:
            sample, fix = times(recording, delay, now, replay)
            print(f"| {name} | {delay:g} s | {sample:.3g} | {fix:.3g} |")


if __name__ == "__main__":
    main()
