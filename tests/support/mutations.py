"""Damaged files: small whole ones are bent at random, and each is read in a process of its own that
may neither hang, nor take much memory, nor end otherwise than in a recording or in one line.

Run as a program it reads a pickled `Job` from standard input and writes what went wrong as a pickled
list of `Red`: a fresh process has no threads, so it can fork.
"""

import os
import pickle
import resource
import shutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import looks
import numpy as np
from mutators import BYTES, TEXT, is_text
from structured_mutators import BY_SUFFIX, sealed

BATCH = 50
"""Mutations that one forked child reads before the next begins."""
INSPECTED = 25
"""Every so many mutations are also inspected, which takes longer."""
CPU, WALL = 10.0, 120.0
"""s that one mutation may take: of the processor, and on a busy machine."""
SPARE = 500e6
"""Bytes of memory beyond ten times the content."""


class Case(NamedTuple):
    """Small whole files that make one recording, solution, scenario or whatever `look` reads."""

    name: str
    files: Mapping[str, bytes]
    opened: tuple[str, ...]  # what is read; "" is the folder of the files, (): every file of it
    bent: tuple[str, ...]  # one of these is bent
    look: Callable[[list[Path], bool], str] = looks.recording  # what is wrong with what is read
    refused: bool = False  # whether also the whole files are
    # instead of bending one file: other files, of a random generator and those of the case
    change: Callable[[np.random.Generator, Mapping[str, bytes]], dict[str, bytes]] | None = None


class Job(NamedTuple):
    case: Case
    seeds: range
    folder: Path
    cpu: float = CPU  # s that one mutation may take of the processor


class Red(NamedTuple):
    """A mutation that ended as none may, the folder it is kept in and what happened."""

    seed: int
    kept: Path
    said: str

    def __str__(self) -> str:
        return f"seed {self.seed}: {self.said} ({self.kept})"


def bent(case: Case, seed: int) -> dict[str, bytes]:
    """The files of the case with one of them bent, one to three times."""
    rng = np.random.default_rng(seed)
    if case.change is not None:
        return case.change(rng, case.files)
    files = dict(case.files)
    name = case.bent[rng.integers(len(case.bent))]
    ways = BYTES + TEXT * 2 if is_text(files[name]) else BYTES
    own = BY_SUFFIX.get(Path(name).suffix, ())
    drawn = [own if own and rng.integers(2) else ways for _ in range(rng.integers(1, 4))]
    # a library that writes a file anew gets it whole: of damaged bytes it could hang or crash here
    for way in sorted(drawn, key=lambda way: way is not own):
        if not files[name]:
            break
        files[name] = way[rng.integers(len(way))](rng, files[name])
    if name.endswith(".nc") and rng.integers(3):
        files[name] = sealed(files[name])
    return files


def lay(case: Case, files: Mapping[str, bytes], folder: Path) -> list[Path]:
    """The files in the folder, and the paths to read."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    opened = case.opened or files
    return [folder / name if name else folder for name in opened]


def _child(job: Job, seeds: range, out: int) -> None:
    """Read the mutations of these seeds, and write a line for each before and after."""
    for seed in seeds:
        folder = job.folder / "now"
        os.write(out, f"{seed} begins\n".encode())
        shutil.rmtree(folder, ignore_errors=True)
        resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
        files = bent(job.case, seed)
        paths = lay(job.case, files, folder)
        with open("/proc/self/statm") as file:
            now = int(file.read().split()[0]) * resource.getpagesize()
        most = int(now + 10 * sum(map(len, files.values())) + SPARE)
        resource.setrlimit(resource.RLIMIT_AS, (most, -1))
        signal.setitimer(signal.ITIMER_PROF, job.cpu)
        signal.setitimer(signal.ITIMER_REAL, WALL)
        try:
            said = looks.judged(job.case.look, paths, seed % INSPECTED == 0)
        except BaseException as error:
            said = f"{type(error).__name__}: {error}".replace("\n", " | ")
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        os.write(out, f"{seed} ends {said[:500]!r}\n".encode())


def reds(job: Job) -> list[Red]:
    """The mutations that ended as none may; only in a process that has no threads."""
    found: list[Red] = []
    seeds = job.seeds
    while len(seeds):
        batch = seeds[:BATCH]
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(read)
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 2)
            _child(job, batch, write)
            os._exit(0)
        os.close(write)
        with os.fdopen(read, "rb") as pipe:
            lines = pipe.read().decode().splitlines()
        status = os.waitpid(child, 0)[1]
        last = batch[0] - 1
        for line in lines:
            seed, _, rest = line.partition(" ")
            last = int(seed)
            if rest.startswith("ends") and rest != "ends ''":
                found.append(_kept(job, last, rest[5:]))
        if status:
            number = status & 127
            ways = {signal.SIGPROF: f"takes more than {job.cpu:g} s of the processor"}
            ways[signal.SIGALRM] = f"takes more than {WALL:g} s"
            found.append(_kept(job, last, ways.get(number, f"the process ends with {status}")))
        else:
            last = batch[-1]
        seeds = range(last + 1, job.seeds.stop)
    return found


def _kept(job: Job, seed: int, said: str) -> Red:
    """A Red whose files stay."""
    folder = job.folder / f"{job.case.name} {seed}"
    lay(job.case, bent(job.case, seed), folder)
    return Red(seed, folder, said)


def run(job: Job) -> list[Red]:
    """`reds` in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__],
        input=pickle.dumps(job),
        capture_output=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return pickle.loads(done.stdout)


def main() -> None:
    """Read a job and write what it finds; what the files are as they are must be read."""
    import mutations  # the module by its own name, so that its classes are those of the caller

    job = pickle.load(sys.stdin.buffer)
    warnings.simplefilter("ignore")
    whole = lay(job.case, job.case.files, job.folder / "whole")
    look = looks.judged if job.case.refused else lambda look, *rest: look(*rest)
    said = look(job.case.look, whole, True)  # and what it imports is there before the first fork
    assert not said, said
    sys.stdout.buffer.write(pickle.dumps(mutations.reds(job)))


if __name__ == "__main__":
    main()
