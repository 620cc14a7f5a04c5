"""Wrong changes of the source, one at a time, and whether the short tests see them: `make mutants`.

    python tests/mutants.py [--rooms core aiding filters] [--count 200] [--seed 1] [--jobs 2] [--enough 20]
        [--minutes 60] [--compiled] [--out FILE]

A random sample of all mutants (`support/source_mutants.py` has the kinds) is tried without the
compiler. All tests are imported once; each mutant is a fork of that process in which the code of
its function is exchanged, and no file changes. Only tests run that run the changed line, those of
its own room first, quick ones first, and then what else their modules have, `--enough` seconds of
the processor in all, as they took when they were recorded. What is run at import is tried in a new process on a copy of the source. A failed test, a crash
or a hang kills a mutant. Survivors are listed, also those which change nothing that can be seen.
What no test runs without the compiler survives; `--compiled` tries that again with it, and says so.

mutmut 3 leaves decorated functions alone, which all kernels are; cosmic-ray starts a process per
mutant, which imports and compiles for seconds, and cannot choose tests by what they run.
"""

import argparse
import ast
import gc
import json
import os
import platform
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import types
from collections import defaultdict
from datetime import date
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"
import branches  # switches the compiler off

HERE, SOURCE = branches.HERE, branches.SOURCE
sys.path.insert(0, str(HERE / "support"))
import source_mutants  # noqa: E402

MAX = 800.0  # s; a mutant that takes longer hangs
BROKEN = 99
"""Exit status of a child in which this command itself failed."""


class Tests:
    """What each test runs and how long it takes, as `branches.py` recorded it."""

    def __init__(self):
        import coverage

        self.lines = coverage.CoverageData(str(branches.LINES))
        self.lines.read()
        self.seconds = json.loads(branches.SECONDS.read_text())

    def of(self, file, mutant, enough):
        """(names of tests in the order in which to run them, whether the line runs at import)."""
        lines = self.lines.contexts_by_lineno(str(file))
        found = set(lines.get(mutant.line) or lines.get(mutant.statement, ()))
        at_import = "" in found
        if found == {""}:  # what is made at import may count wherever the file does
            found = set().union(*lines.values())
        own = f"tests/{file.relative_to(SOURCE).parts[0]}/"
        touching = sorted(
            found & self.seconds.keys(),
            key=lambda test: self.seconds[test] * (1.0 if test.startswith(own) else 4.0),
        )
        modules = {test.split("::")[0] for test in touching}
        beside = sorted(
            (t for t in self.seconds if t.split("::")[0] in modules and t not in found),
            key=self.seconds.get,
        )
        chosen, spent = [], 0.0
        for test in [*touching, *beside]:
            if chosen and spent + self.seconds[test] > enough:
                continue
            spent += self.seconds[test]
            chosen.append(test)
        return chosen, at_import


class Server:
    """A plugin of pytest: the tests are collected, and then mutants run instead of them."""

    def __init__(self, sample, asked):
        self.sample, self.asked = sample, asked
        self.failed, self.results = None, []
        self.end = time.monotonic() + 60 * asked.minutes

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.failed = report.nodeid

    def pytest_runtestloop(self, session):
        items, tests = {item.nodeid: item for item in session.items}, Tests()
        running = {}
        for file, number in self.sample:
            while len(running) >= self.asked.jobs:
                self.wait(running)
            if time.monotonic() > self.end:
                break
            mutant = source_mutants.mutant(file.read_text(encoding="utf-8"), number)
            chosen, at_import = tests.of(file, mutant, self.asked.enough)
            chosen = [items[test] for test in chosen if test in items]
            child = os.fork()
            if not child:
                verdict = BROKEN
                try:
                    verdict = self.killed(file, mutant, chosen, at_import, tests.seconds)
                finally:
                    os._exit(verdict)
            running[child] = (file, mutant, len(chosen), time.monotonic())
        while running:
            self.wait(running)
        return True

    def wait(self, running):
        """Wait for a child to end, and end those that take too long."""
        while True:
            child, status = os.waitpid(-1, os.WNOHANG)
            if child:
                file, mutant, tests, _ = running.pop(child)
                if os.waitstatus_to_exitcode(status) == BROKEN:
                    raise RuntimeError(f"could not be tried: {told(file, mutant, tests)}")
                self.results.append((file, mutant, tests, bool(status)))
                return print(
                    "." if status else f"\n{told(file, mutant, tests)}", end="", flush=True
                )
            for each, (*_, begin) in running.items():
                if time.monotonic() - begin > MAX:
                    os.kill(each, signal.SIGKILL)
            time.sleep(0.01)

    def killed(self, file, mutant, chosen, at_import, seconds):
        """In the child: 1 where a test fails, 0 where none does. A limit of the system ends it
        where a test takes much longer than it did."""
        if not chosen and not self.asked.compiled:
            return 0
        if at_import or not chosen or not exchanged(file, mutant):
            return in_a_copy(file, mutant, [item.nodeid for item in chosen])
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30,) * 2)
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (1, 2):
            os.dup2(quiet, stream)
        for item, following in zip(chosen, [*chosen[1:], None]):
            limit = int(time.process_time() + 5 + 4 * seconds[item.nodeid])
            resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failed:
                return 1
        return 0


def exchanged(file, mutant):
    """Give every function of this file the code of the mutant; whether all could get theirs."""
    codes = defaultdict(list)

    def gather(code):
        codes[code.co_qualname, code.co_firstlineno].append(code)
        for each in code.co_consts:
            if isinstance(each, types.CodeType):
                gather(each)

    gather(compile(mutant.tree, str(file), "exec"))
    found = [
        (each, codes[each.__code__.co_qualname, each.__code__.co_firstlineno])
        for each in gc.get_objects()
        if isinstance(each, types.FunctionType) and each.__code__.co_filename == str(file)
    ]
    changed = [(each, code) for each, code in found if code != [each.__code__]]
    for each, code in changed:
        if len(code) != 1 or code[0].co_freevars != each.__code__.co_freevars:
            return False
        each.__code__ = code[0]
    return bool(changed)


def in_a_copy(file, mutant, chosen):
    """1 where a test fails in a new process whose source is a copy with the mutant. Where no test
    runs the line without the compiler, those that are named after the file do so with it."""
    room = HERE / file.relative_to(SOURCE).parent
    mirrored = room / f"test_{file.stem}.py"
    named = [str(mirrored if mirrored.exists() else room)]
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1" if chosen else "0",
        "NUMBA_CACHE_DIR": str(branches.LINES.parent / "kernels"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    with tempfile.TemporaryDirectory() as folder:
        copied = shutil.copytree(SOURCE, Path(folder, "strapdown"))
        (copied / file.relative_to(SOURCE)).write_text(ast.unparse(mutant.tree), encoding="utf-8")
        listed = Path(folder, "tests")
        listed.write_text("\n".join(chosen or named))
        environment["PYTHONPATH"] = os.pathsep.join([folder, os.environ.get("PYTHONPATH", "")])
        words = ["-x", "-m", "short and not deep", "-p", "no:cacheprovider", f"@{listed}"]
        try:
            done = subprocess.run(
                [sys.executable, "-m", "pytest", *words],
                cwd=HERE.parent,
                env=environment,
                capture_output=True,
                timeout=MAX,
            )
        except subprocess.TimeoutExpired:
            return 1
    return int(done.returncode != 0)


def told(file, mutant, tests):
    """A survivor in one line."""
    was, now = (" ".join(text.split())[:60] for text in (mutant.was, mutant.now))
    return f"{file.relative_to(SOURCE)}:{mutant.line}: {was} -> {now} (survives {tests} tests)"


def main():
    """Draw a sample, run it, print the survivors and the figures of each room."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--rooms", nargs="+", default=["core", "aiding", "filters"])
    asked.add_argument("--count", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--jobs", type=int, default=2)
    asked.add_argument("--enough", type=float, default=20.0, help="s of tests")
    asked.add_argument("--minutes", type=float, default=60.0, help="after which none begins")
    asked.add_argument("--compiled", action="store_true")
    asked.add_argument("--out", type=Path, help="file for what is printed")
    asked = asked.parse_args()
    import pytest

    if not branches.SECONDS.exists():
        branches.record([str(HERE / room) for room in branches.ROOMS])
    files = [file for room in asked.rooms for file in sorted((SOURCE / room).rglob("*.py"))]
    every = [
        (file, i) for file in files for i in range(source_mutants.count(file.read_text("utf-8")))
    ]
    begin = time.perf_counter()
    server = Server(random.Random(asked.seed).sample(every, asked.count), asked)
    modules = {test.split("::")[0] for test in json.loads(branches.SECONDS.read_text())}
    words = ["-s", "-q", "-p", "no:cacheprovider", "-m", "short and not deep"]
    pytest.main(
        [*words, *(str(HERE.parent / module) for module in sorted(modules))], plugins=[server]
    )
    seconds = time.perf_counter() - begin
    lines = [
        f"python tests/mutants.py --rooms {' '.join(asked.rooms)} --count {asked.count} "
        f"--seed {asked.seed} --enough {asked.enough:g}{' --compiled' * asked.compiled}, {date.today().isoformat()}",
        f"Python {platform.python_version()}, {seconds:.0f} s, {len(every)} mutants to draw from",
        "",
        *figures(server.results, asked.rooms),
        "",
        *sorted(told(*result[:3]) for result in server.results if not result[3]),
    ]
    print("", *lines, sep="\n")
    if asked.out:
        asked.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


def figures(results, rooms):
    """How many were killed, a line per room and one for those that no test runs."""
    for name in [*rooms, "all"]:
        killed = [
            each
            for file, _, _, each in results
            if name in (file.relative_to(SOURCE).parts[0], "all")
        ]
        share = 100 * sum(killed) / max(len(killed), 1)
        yield f"{name}: {sum(killed)} of {len(killed)} killed ({share:.0f} %)"
    unseen = [killed for *_, tests, killed in results if not tests]
    yield f"no test runs {len(unseen)} of them without the compiler; {sum(unseen)} of these killed"


if __name__ == "__main__":
    main()
