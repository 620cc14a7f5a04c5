"""Which branches of each room the short tests take without the compiler: `python tests/branches.py`, or `make branches`.

Writes branches.txt beside this file, which is committed, and for `mutants.py` two files in build/:
the lines that each test runs, and how much of the processor's time it takes.
"""

import argparse
import json
import os
import platform
import sys
import time
from collections import Counter, defaultdict
from datetime import date
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports numba: compiled lines are not seen
HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent / "src" / "strapdown"
LINES, SECONDS = HERE.parent / "build" / "short.coverage", HERE.parent / "build" / "short.json"
ROOMS = ("core", "aiding", "filters", "io", "engine")


class Recorder:
    """A plugin of pytest that tells coverage which test runs, and keeps how long each one takes."""

    def __init__(self, measured):
        self.measured, self.seconds, self.begin = measured, {}, 0.0

    def pytest_runtest_logstart(self, nodeid):
        self.measured.switch_context(nodeid)
        self.begin = time.process_time()

    def pytest_runtest_logfinish(self, nodeid):
        self.seconds[nodeid] = time.process_time() - self.begin
        self.measured.switch_context("")


def record(folders):
    """Run the short tests of these folders under coverage; (exit status, Coverage)."""
    import coverage
    import pytest

    LINES.parent.mkdir(exist_ok=True)
    measured = coverage.Coverage(
        data_file=str(LINES), branch=True, source=[str(SOURCE)], config_file=False
    )
    measured.erase()
    recorder = Recorder(measured)
    measured.start()
    status = pytest.main(
        ["-m", "short and not deep", "-p", "no:cacheprovider", *folders], plugins=[recorder]
    )
    measured.stop()
    measured.save()
    SECONDS.write_text(json.dumps(recorder.seconds))
    return status, measured


def table(measured, rooms):
    """A line per room, and below it one per file that lacks more than one in ten."""
    whole = LINES.with_suffix(".report.json")
    measured.json_report(outfile=str(whole))
    found = defaultdict(Counter)
    files = json.loads(whole.read_text())["files"]
    for name, file in sorted(files.items()):
        path = Path(name).resolve().relative_to(SOURCE)
        for key in (path.parts[0], str(path)):
            found[key].update(
                {
                    word: file["summary"][word]
                    for word in (
                        "covered_branches",
                        "num_branches",
                        "covered_lines",
                        "num_statements",
                    )
                }
            )
    for room in rooms:
        yield row(room, found[room])
        for path, count in found.items():
            lacks = count["num_branches"] - count["covered_branches"]
            if path.startswith(f"{room}/") and lacks > 0.1 * count["num_branches"]:
                yield "    " + row(path, count)


def row(name, count):
    """Branches and lines of a room or a file."""
    return (
        f"{name}: {count['covered_branches']} of {count['num_branches']} branches "
        f"({100 * count['covered_branches'] / max(count['num_branches'], 1):.1f} %), "
        f"{count['covered_lines']} of {count['num_statements']} statements"
    )


def main():
    """Record, print and write the table; the exit status is that of the tests."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--rooms", nargs="+", default=ROOMS, choices=ROOMS)
    rooms = asked.parse_args().rooms
    begin = time.perf_counter()
    status, measured = record([str(HERE / room) for room in rooms])
    lines = [
        f"python tests/branches.py --rooms {' '.join(rooms)}, {date.today().isoformat()}",
        f"Python {platform.python_version()}, {time.perf_counter() - begin:.0f} s, "
        "short tests of these rooms without the compiler; files that lack more than one in ten are named",
        "",
        *table(measured, rooms),
    ]
    print(*lines, sep="\n")
    if tuple(rooms) == ROOMS:
        (HERE / "branches.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main())
