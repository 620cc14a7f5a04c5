"""Damaged files: small whole ones are bent at random, and each is read in a process of its own that
may neither hang, nor take much memory, nor end otherwise than in a recording or in one line.

Run as a program it reads a pickled `Job` from standard input and writes what went wrong as a pickled
list of `Red`: a fresh process has no threads, so it can fork.
"""

import os
import pickle
import re
import resource
import shutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

BATCH = 50
"""Mutations that one forked child reads before the next begins."""
INSPECTED = 25
"""Every so many mutations are also inspected, which takes longer."""
CPU, WALL = 10.0, 120.0
"""s that one mutation may take: of the processor, and on a busy machine."""
SPARE = 500e6
"""Bytes of memory beyond ten times the content."""
CRASHED = "fails at it in"
"""What the registry says of a reader that raises anything else than DataError."""


class Case(NamedTuple):
    """Small whole files that make one recording."""

    name: str
    files: Mapping[str, bytes]
    opened: tuple[str, ...]  # what is given to `read`; "" is the folder of the files
    bent: tuple[str, ...]  # one of these is bent

    @property
    def size(self) -> int:
        return sum(map(len, self.files.values()))


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


# ways of bending bytes: functions of a random generator and the content, which is not empty


def _run(rng, content):
    """(start, stop) of a run of bytes, mostly a short one."""
    start = int(rng.integers(len(content)))
    return start, min(len(content), start + int(2 ** rng.uniform(0, 11)))


def truncated(rng, content):
    return content[: int(rng.integers(len(content)))]


def flipped(rng, content):
    out = bytearray(content)
    for at in rng.integers(len(out), size=rng.integers(1, 9)):
        out[at] ^= 1 << rng.integers(8)
    return bytes(out)


def overwritten(rng, content):
    start, stop = _run(rng, content)
    n = stop - start
    fill = (rng.bytes(n), b"\0" * n, b"\xff" * n)[rng.integers(3)]
    return content[:start] + fill + content[stop:]


def removed(rng, content):
    start, stop = _run(rng, content)
    return content[:start] + content[stop:]


def repeated(rng, content):
    start, stop = _run(rng, content)
    return content[:stop] + content[start:stop] * int(rng.integers(1, 5)) + content[stop:]


def swapped(rng, content):
    a, b, c = sorted(rng.integers(len(content) + 1, size=3))
    return content[:a] + content[b:c] + content[a:b] + content[c:]


def inserted(rng, content):
    at = int(rng.integers(len(content) + 1))
    return content[:at] + rng.bytes(int(rng.integers(1, 64))) + content[at:]


def blown_up(rng, content):
    """A number somewhere, such as a length or a count, is made huge or negative."""
    width = (1, 2, 4, 8)[rng.integers(4)]
    bits = 8 * width
    value = (2**bits - 1, 2 ** (bits - 1) - 1, 2 ** (bits - 1), 2 ** (bits - 2), 0)[rng.integers(5)]
    order = ("little", "big")[rng.integers(2)]
    at = int(rng.integers(len(content)))
    return content[:at] + value.to_bytes(width, order) + content[at + width :]


BYTES = (
    truncated,
    flipped,
    flipped,
    overwritten,
    removed,
    repeated,
    swapped,
    inserted,
    blown_up,
    blown_up,
)


def _lines(change):
    def bend(rng, content):
        lines = content.split(b"\n")
        change(rng, lines)
        return b"\n".join(lines)

    return bend


@_lines
def shuffled(rng, lines):
    some = rng.choice(len(lines), min(len(lines), int(rng.integers(2, 20))), replace=False)
    held = [lines[k] for k in some]
    for k, line in zip(rng.permutation(some), held):
        lines[k] = line


@_lines
def without_lines(rng, lines):
    start = int(rng.integers(len(lines)))
    del lines[start : start + int(2 ** rng.uniform(0, 6))]


@_lines
def lines_again(rng, lines):
    start = int(rng.integers(len(lines)))
    lines[start:start] = lines[start : start + int(2 ** rng.uniform(0, 5))]


@_lines
def other_cells(rng, lines):
    """Cells are added to or taken from a line."""
    k = int(rng.integers(len(lines)))
    cells = lines[k].split(b",")
    lines[k] = b",".join(
        cells[: int(rng.integers(len(cells) + 1))] if rng.integers(2) else cells * 2
    )


NUMBERS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"99999999999999999999", b"", b"-1", b"0")
NUMBERS += (b"1e-320", b"0x1f", b"1,5", b"text", b"None", b"9223372036854775807", b"\xff\xfe")


def other_numbers(rng, content):
    """Some numbers in the text are made huge, missing or no numbers at all."""
    found = list(re.finditer(rb"-?\d+(\.\d*)?", content))
    if not found:
        return content
    new = NUMBERS[rng.integers(len(NUMBERS))]
    picked = sorted(rng.choice(len(found), min(len(found), int(2 ** rng.uniform(0, 5))), False))
    parts, last = [], 0
    for k in picked:
        parts += [content[last : found[k].start()], new]
        last = found[k].end()
    return b"".join(parts) + content[last:]


TEXT = (shuffled, without_lines, lines_again, other_cells, other_numbers, other_numbers)


def is_text(content: bytes) -> bool:
    """Whether it is lines of readable characters."""
    head = content[:2000]
    return b"\0" not in head and head.count(b"\n") > 2


def bent(case: Case, seed: int) -> dict[str, bytes]:
    """The files of the case with one of them bent, one to three times."""
    rng = np.random.default_rng(seed)
    files = dict(case.files)
    name = case.bent[rng.integers(len(case.bent))]
    ways = BYTES + TEXT * 2 if is_text(files[name]) else BYTES
    for _ in range(rng.integers(1, 4)):
        if files[name]:
            files[name] = ways[rng.integers(len(ways))](rng, files[name])
    return files


def lay(case: Case, files: Mapping[str, bytes], folder: Path) -> list[Path]:
    """The files in the folder, and the paths to read."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return [folder / name if name else folder for name in case.opened]


def look(paths: list[Path], also_inspect: bool) -> str:
    """What is wrong with how these paths are read; "" where nothing is."""
    import strapdown as sd
    from strapdown.io.inspection import inspect

    said = ""
    try:
        recording = sd.read(*paths)
        if not isinstance(recording, sd.Recording):
            return f"read gives a {type(recording).__name__}"
        for values in (recording.imu.t, recording.imu.dt, recording.imu.dtheta, recording.imu.dv):
            if not np.isfinite(values).all():
                return "the IMU of the recording is not finite"
        if not np.all(recording.imu.dt > 0):
            return "the intervals of the recording are not above 0"
    except sd.DataError as error:
        said = str(error)
    if CRASHED in said or len(said.splitlines()) > 1:
        return said
    if also_inspect:
        try:
            lines = [*inspect(*paths).lines]
        except sd.DataError as error:
            lines = [str(error)]
        wrong = [line for line in lines if CRASHED in line or len(line.splitlines()) > 1]
        return wrong[0] if wrong else ""
    return ""


def _child(job: Job, seeds: range, out: int) -> None:
    """Read the mutations of these seeds, and write a line for each before and after."""
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    most = int(now + 10 * job.case.size + SPARE)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    for seed in seeds:
        folder = job.folder / "now"
        shutil.rmtree(folder, ignore_errors=True)
        paths = lay(job.case, bent(job.case, seed), folder)
        os.write(out, f"{seed} begins\n".encode())
        signal.setitimer(signal.ITIMER_PROF, job.cpu)
        signal.setitimer(signal.ITIMER_REAL, WALL)
        try:
            said = look(paths, seed % INSPECTED == 0)
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
    """Read a job and write what it finds; the files as they are must make a recording."""
    import mutations  # the module by its own name, so that its classes are those of the caller

    job = pickle.load(sys.stdin.buffer)
    warnings.simplefilter("ignore")
    whole = lay(job.case, job.case.files, job.folder / "whole")
    said = mutations.look(whole, True)  # and what it imports is there before the first fork
    assert not said, said
    sys.stdout.buffer.write(pickle.dumps(mutations.reds(job)))


if __name__ == "__main__":
    main()
