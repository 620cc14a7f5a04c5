"""Read many damaged files: `python tests/fuzz.py FORMAT... --count 100000 --seed 1 --jobs 2`.

Formats are the names of the cases of tests/support/all_cases.py, all of them where none is given.
What ends otherwise than in a good result or in a line of complaint is counted, told and kept in a
folder of its own; the exit code is then 1.
"""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "support")]

import mutations  # noqa: E402
from all_cases import CASES  # noqa: E402

PART = 1000
"""Mutations of one process."""
SHOWN = 10
"""Reds of a format that are told."""


def options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(CASES))
    parser.add_argument("--count", type=int, default=10_000, help="mutations of each format")
    parser.add_argument("--seed", type=int, default=0, help="of the first one")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--out", type=Path, help="folder for what is wrong (default: a new one)")
    given = parser.parse_args()
    if unknown := [name for name in given.formats if name not in CASES]:
        parser.error(f"unknown format {unknown[0]!r}; there are {', '.join(CASES)}")
    return given


def fuzzed(name, given, out):
    """(mutations, reds, s) of a format."""
    begin, folder = time.perf_counter(), out / name
    (folder / "made").mkdir(parents=True, exist_ok=True)
    case = CASES[name](folder / "made")
    stop, reds, done = given.seed + given.count, [], 0
    parts = [range(k, min(k + PART, stop)) for k in range(given.seed, stop, PART)]
    with ThreadPoolExecutor(given.jobs) as pool:
        places = {}
        for part in parts:
            job = mutations.Job(case, part, folder / f"{part[0]}")
            places[pool.submit(mutations.run, job)] = part
        for each in as_completed(places):
            reds += each.result()
            done += len(places[each])
            print(f"\r{name}: {done} of {given.count}, {len(reds)} red", end="", flush=True)
    print(f", {time.perf_counter() - begin:.0f} s")
    for red in sorted(reds)[:SHOWN]:
        print(f"  {red.seed}: {red.said[:200]} ({red.kept})")
    return reds


def main():
    given = options()
    out = given.out or Path(tempfile.mkdtemp(prefix="strapdown-fuzz-"))
    found = {name: fuzzed(name, given, out) for name in given.formats or CASES}
    print(f"\n{'format':20} {'mutants':>8} {'red':>6}")
    for name, reds in found.items():
        print(f"{name:20} {given.count:8} {len(reds):6}")
    print(f"what was red is in {out}")
    return int(any(found.values()))


if __name__ == "__main__":
    sys.exit(main())
