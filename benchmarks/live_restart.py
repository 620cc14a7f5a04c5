"""Consistency after a restart of a live stream: `python benchmarks/live_restart.py`.

Simulated flights with fixed seeds go through a `LiveStream` whose fixes come late, until it is saved. A new one is
restored 10 s later; what came meanwhile is lost. Beside it are the stream that ran on without these data, and one
that had them. Printed, and written into the page, is the mean NEES of position, velocity and attitude for some times
after the restart, divided by the number of their components, with the band of 95 % of a consistent filter.
"""

import tempfile
from pathlib import Path

import numpy as np
from late_fixes import arrivals

import strapdown as sd
from strapdown.core.mathematics.belief import ATT, POS, VEL
from strapdown.evaluation.consistency import band, nees, state_errors
from strapdown_reproductions.common import markdown

PAGE = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "live.md"
MARK = "<!-- begin: restart of python benchmarks/live_restart.py -->"
RUNS = 60
RATE, DELAY = 50.0, 0.2
AWAY = (60.0, 70.0)
"""s between which the program is off."""
AFTER = (1.5, 5.0, 15.0, 40.0)
"""s after it at which the states are looked at."""
PARTS = {"position": POS, "velocity": VEL, "attitude": ATT}
WAYS = ("restarted", "the same gap, no restart", "no gap")


def new(recording: sd.Recording) -> sd.LiveStream:
    """A stream that has used nothing."""
    return sd.LiveStream(
        "closed-loop",
        imu="tactical",
        sources=recording.sources,
        lag=1.0,
        replay=True,
        covariance=True,
        history=10_000,
    )


def streams(recording: sd.Recording, path: Path) -> list[sd.LiveStream]:
    """The streams of `WAYS` at the end of a recording."""
    events = arrivals(recording, DELAY)
    came = np.maximum.accumulate([event.t for event in events])
    first, last = np.searchsorted(came, AWAY, side="right").tolist()
    gapped, whole, restarted = (new(recording) for _ in WAYS)
    for event in events[:first]:
        gapped.step(event)
    gapped.save(path)
    restarted.restore(path)
    for stream in (restarted, gapped):
        for event in events[last:]:
            stream.step(event)
    for event in events:
        whole.step(event)
    for stream in (restarted, gapped, whole):
        stream.finish()
    return [restarted, gapped, whole]


def of_parts(stream: sd.LiveStream, recording: sd.Recording) -> list[list[float]]:
    """NEES of each part at each time after the restart, over its number of components."""
    solution = stream.solution
    rows = np.searchsorted(solution.t, np.array(AFTER) + AWAY[1] - 1e-6)
    error, P = state_errors(solution, recording)[rows], solution.covariance[rows]
    return [(nees(error[:, part], P[:, part, part]) / 3).tolist() for part in PARTS.values()]


def measured(runs: int) -> tuple[np.ndarray, int]:
    """(NEES (run, way, part, time), number of runs in which a restart changed bits)."""
    found, changed = [], 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(runs):
            recording = sd.simulate("demo", AWAY[1] + AFTER[-1] + 2.0, seed=seed, rate=RATE)
            ways = streams(recording, Path(folder) / "state")
            found.append([of_parts(stream, recording) for stream in ways])
            restarted, gapped, _ = ways
            pairs = zip(restarted.belief, gapped.belief)
            same = all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
            changed += not (same and restarted.counts() == gapped.counts())
    return np.array(found), changed


def text_of(found: np.ndarray, changed: int) -> str:
    """The table of the page."""
    runs = len(found)
    low, high = (bound / 3 for bound in band(3, runs))
    head = ["", "", *(f"{t:g} s after" for t in AFTER)]
    lines = [head, ["---"] * len(head)]
    mean = found.mean(axis=0)
    lines += [
        [name if way == 0 else "", WAYS[way], *(f"{value:.2f}" for value in mean[way, k])]
        for k, name in enumerate(PARTS)
        for way in range(len(WAYS))
    ]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    inside = int(((mean[0] >= low) & (mean[0] <= high)).sum())
    return (
        f"Mean NEES over the number of components, {runs} simulated flights, {AWAY[1] - AWAY[0]:g} s off; of a "
        f"consistent filter it is 1, within {low:.2f} to {high:.2f} in 95 %. After a restart {inside} of "
        f"{mean[0].size} are; {changed} of {runs} flights end with other bits or counts than without the restart.\n\n"
        f"{table}\n"
    )


def main() -> None:
    """Print the table, and put it into the page."""
    text = text_of(*measured(RUNS))
    print(text)
    markdown.insert(PAGE, text, MARK)


if __name__ == "__main__":
    main()
