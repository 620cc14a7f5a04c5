"""The deep tests, what came of them last, and how long ago that was.

    python tests/deep.py             all of them, then all short tests without the compiler: `make deep`
    python tests/deep.py --changed   those that changes since the recorded commit can reach: `make changed`
    python tests/deep.py --again     those that failed, and records which of them pass now
    python tests/deep.py --fitting   those of them that are soon done, and how long ago all were run;
                                     fails beyond MAX_COMMITS: the end of `make test`

The first writes deep.txt beside this file, which is committed: commit, date, versions, and of each file
how long its tests took and what failed.
"""

import argparse
import ast
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from datetime import date
from pathlib import Path
from typing import NamedTuple

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE / "support"), str(ROOT / "benchmarks")]
import figures  # noqa: E402
import reach  # noqa: E402

RECORD = HERE / "deep.txt"
MAX_COMMITS = 150
"""Commits after which `make test` fails until all deep tests were run again; a branch that was
merged is one."""
FITTING = 40.0
"""s of the processor that deep tests may take in `make test`."""
PARTS = (("deep", False), ("short and not deep", True))
"""(marks, whether without the compiler) of what is run."""
KERNELS = ("src/strapdown/core/", "src/strapdown/aiding/", "src/strapdown/filters/")


class Progress:
    """A plugin of pytest: a line for each test as it ends, and what is to be recorded."""

    def __init__(self):
        self.begin = time.perf_counter()
        self.total, self.done = 0, 0
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.tests: Counter[str] = Counter()
        self.outcomes: Counter[str] = Counter()
        self.failed: list[str] = []

    def pytest_xdist_node_collection_finished(self, ids):
        self.total = len(ids)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_report_teststatus(self):
        category, *_ = yield
        return category, "", ""  # the lines below stand for the dots

    def pytest_runtest_logreport(self, report):
        file = report.nodeid.partition("::")[0]
        self.seconds[file] += report.duration
        if report.failed and report.nodeid not in self.failed:
            self.failed.append(report.nodeid)
        if report.skipped:
            self.outcomes["skipped"] += 1
        elif report.when == "call" or report.failed:
            self.outcomes[report.outcome] += 1
        if report.when == "teardown":
            self.done += 1
            self.tests[file] += 1
            gone = (time.perf_counter() - self.begin) / 60
            bad = "  FAILED" if report.nodeid in self.failed else ""
            print(f"{self.done}/{self.total}  {gone:.1f} min  {report.nodeid}{bad}", flush=True)

    def told(self) -> dict:
        return {
            "wall": time.perf_counter() - self.begin,
            "files": {file: (self.seconds[file], self.tests[file]) for file in self.tests},
            "outcomes": self.outcomes,
            "failed": self.failed,
        }


def run(marks: str, off: bool, files: list[str], told: Path) -> int:
    """Run tests in a process of its own, see `child`; its exit status."""
    words = [sys.executable, __file__, "--child", marks, "--told", str(told), *files]
    environment = os.environ | ({"NUMBA_DISABLE_JIT": "1"} if off else {})
    return subprocess.run(words, cwd=ROOT, env=environment).returncode


def child(marks: str, files: list[str], told: Path) -> int:
    """Run tests with a line for each, and write what came of them to `told`."""
    progress = Progress()
    words = ["-n", "2", "--dist", "worksteal", "-m", marks, "-o", "console_output_style=classic"]
    status = pytest.main([*words, *files], plugins=[progress])
    told.write_text(json.dumps(progress.told()))
    return int(status)


def whole() -> int:
    """All of them, recorded."""
    lines, status = heading(), 0
    for marks, off in PARTS:
        with tempfile.TemporaryDirectory() as folder:
            told = Path(folder) / "told.json"
            status |= run(marks, off, [], told)
            lines += [
                "",
                *of_part(marks + " without the compiler" * off, json.loads(told.read_text())),
            ]
        RECORD.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return status


def again() -> int:
    """Those that failed; in the record, those that pass now are no longer among the failed."""
    first, *parts = RECORD.read_text(encoding="utf-8").rstrip("\n").split("\n\n")
    status = 0
    for k, (marks, off) in enumerate(PARTS[: len(parts)]):
        failed = re.findall(r"^FAILED (.*)$", parts[k], re.MULTILINE)
        if not failed:
            continue
        with tempfile.TemporaryDirectory() as folder:
            told = Path(folder) / "told.json"
            status |= run(marks, off, failed, told)
            still = json.loads(told.read_text())["failed"]
        for each in set(failed) - set(still):
            now = f"failed, mended, passes at {here()}: {each}"
            parts[k] = parts[k].replace(f"FAILED {each}", now)
    RECORD.write_text("\n\n".join([first, *parts]) + "\n", encoding="utf-8")
    return status


def here() -> str:
    """The commit, and whether something is not committed."""
    changed = ", with changes that are not committed" * bool(git("status", "--porcelain", "-uno"))
    return f"commit {git('rev-parse', 'HEAD')}{changed}"


def heading() -> list[str]:
    """Commit, date, versions and machine."""
    import numba
    import numpy

    return [
        f"make deep, {date.today().isoformat()}, {here()}",
        f"Python {platform.python_version()}, numba {numba.__version__}, numpy {numpy.__version__}, "
        f"{os.cpu_count()} cores, {platform.machine()}",
    ]


def of_part(name: str, told: dict) -> list[str]:
    """The lines of one part: how it ended, what failed, and each file with its seconds."""
    outcomes = ", ".join(f"{number} {word}" for word, number in sorted(told["outcomes"].items()))
    files = sorted(told["files"].items(), key=lambda each: -each[1][0])
    return [
        f"{name}: {told['wall']:.0f} s, {outcomes}",
        *(f"FAILED {each}" for each in told["failed"]),
        *(f"{seconds:8.1f} s {tests:5d} tests  {file}" for file, (seconds, tests) in files),
    ]


class Recorded(NamedTuple):
    """What deep.txt says."""

    commit: str
    failed: int
    seconds: dict[str, float]  # of each file of deep tests


def recorded() -> Recorded:
    """What came of the last run of all deep tests."""
    first, *parts = RECORD.read_text(encoding="utf-8").split("\n\n")
    commit = re.search(r"commit ([0-9a-f]+)", first)
    files = re.findall(r"^ *([\d.]+) s +\d+ tests  (\S+)$", parts[0], re.MULTILINE)
    return Recorded(
        commit[1] if commit else "",
        sum(len(re.findall("^FAILED", part, re.MULTILINE)) for part in parts),
        {file: float(seconds) for seconds, file in files},
    )


def git(*words: str) -> str:
    """What git prints; empty where it fails, as where a checkout has no history."""
    try:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def changed_since(commit: str) -> list[str]:
    """Files that differ from those of a commit, named from the root."""
    listed = [git("diff", "--name-only", commit), git("ls-files", "--others", "--exclude-standard")]
    return [name for names in listed for name in names.splitlines()]


def kernel_functions(source: str) -> dict[str, str]:
    """{name: what it says} of the functions of kernels in a source, comments and layout aside."""
    return {
        node.name: ast.dump(node)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
        and any(
            re.match(r"kernel|helper|inline", ast.unparse(each)) for each in node.decorator_list
        )
    }


def changed_kernels(commit: str, files: list[str]) -> int:
    """How many functions of kernels are not what they were at a commit."""
    number = 0
    for file in files:
        if file.startswith(KERNELS) and file.endswith(".py"):
            now = (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).is_file() else ""
            before, now = kernel_functions(git("show", f"{commit}:{file}")), kernel_functions(now)
            number += sum(before.get(name) != now.get(name) for name in {*before, *now})
    return number


def reached(last: Recorded, files: list[str]) -> list[str]:
    """Files of deep tests that these changed files can reach."""
    tests = [ROOT / file for file in last.seconds if (ROOT / file).is_file()]
    return [str(test.relative_to(ROOT)) for test in reach.reached(files, tests)]


def fitting(last: Recorded, files: list[str]) -> list[str]:
    """Of these files of tests, those that together take FITTING, the shortest first."""
    chosen, spent = [], 0.0
    for file in sorted(files, key=lambda file: last.seconds[file]):
        spent += last.seconds[file]
        if spent > FITTING:
            break
        chosen.append(file)
    return chosen


def some(soon: bool) -> int:
    """Those that changes since the recorded commit can reach, or those of them that are soon done."""
    last = recorded()
    if not git("cat-file", "-t", last.commit):
        print("deep tests: the commit of tests/deep.txt is not in this checkout")
        return 0
    files = changed_since(last.commit)
    within = reached(last, files)
    chosen = fitting(last, within) if soon else within
    status = 0
    if chosen:
        with tempfile.TemporaryDirectory() as folder:
            status = run("deep", False, chosen, Path(folder) / "told.json")
    return max(status, ago(last, files, len(within), len(chosen)))


def ago(last: Recorded, files: list[str], within: int, run_now: int) -> int:
    """Say how long ago all deep tests were run; 1 where that is too long ago."""
    commits = int(git("rev-list", "--first-parent", "--count", f"{last.commit}..HEAD"))
    print(
        f"deep tests: all were run {commits} commits and {changed_kernels(last.commit, files)} changed "
        f"functions of kernels ago, {last.failed} failed; what changed since can reach "
        f"{within} of their {len(last.seconds)} files, {run_now} were run now"
    )
    if commits > MAX_COMMITS:
        print(f"more than {MAX_COMMITS} commits: run `make deep` and commit tests/deep.txt")
    return int(commits > MAX_COMMITS)


def bench_ago() -> str:
    """How long ago the whole bench was run, for the line of `make test`."""
    commit = figures.commit()
    if not git("cat-file", "-t", commit):
        return "bench: the commit of benchmarks/result.json is not in this checkout"
    commits = git("rev-list", "--first-parent", "--count", f"{commit}..HEAD")
    number = changed_kernels(commit, changed_since(commit))
    return f"bench: run {commits} commits and {number} changed functions of kernels ago"


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--changed", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--fitting", action="store_true")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--told", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("files", nargs="*", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.child:
        return child(asked.child, asked.files, asked.told)
    if asked.again:
        return again()
    if not (asked.changed or asked.fitting):
        return whole()
    status = some(asked.fitting)
    print(bench_ago())
    return status


if __name__ == "__main__":
    sys.exit(main())
