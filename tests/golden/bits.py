"""Digests of what the filters make of a recording of exact numbers, kept in bits.json: `python -m
golden.bits` (from tests/) writes them anew after a wanted change of the arithmetic.

The recording is made of integers and powers of two, so that every machine has the same one: an IMU
that shakes about a slow turn, fixes that scatter about a slow drift. It is no flight; it takes the
kernels through predictions, corrections, rejected fixes and a gap. Under strict arithmetic the bits of
a result then depend on two things alone: on the mathematical library of the C compiler, which `libm`
tells, and, for the filters of BY_LAPACK, whose start multiplies matrices, on that of numpy. It takes
other code on other processors, and the code of MATRICES on every one of x86-64 with AVX2.
"""

import hashlib
import json
import math
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown import filters
from strapdown.core.compile import library
from strapdown.core.loop.contract import InitialState, Noise

FILE = Path(__file__).with_name("bits.json")
SAMPLES, DT = 600, 1 / 64
BY_LAPACK = ("pkf",)
MATRICES = {"OPENBLAS_CORETYPE": "Haswell"}
"""Setting under which bits.json is made; numpy's library reads it when it is loaded."""
BRIEF = {"start_time": 1.0}  # the observer learns when its start is over
OPTIONS = {"pkf": {"components": 3}, "nlo": BRIEF, "xkf": BRIEF, "xkf-two-stage": BRIEF}
STD = (2.0, 2.0, 2.0, 0.5, 0.5, 0.5, 0.0625, 0.0625, 0.125, 0.0625, 0.0625, 0.0625, *[2**-12] * 3)
NOISE = Noise(2**-14, 2**-10, 2**-20, 2**-16, 0.0, 0.0)


def scatter(count, columns, seed):
    """(count, columns) multiples of 2^-10 from -1 to 1, the same everywhere."""
    numbers, state = [], seed
    for _ in range(count * columns):
        state = (1664525 * state + 1013904223) % 2**32
        numbers.append((state >> 21) / 2**10 - 1.0)
    return np.array(numbers).reshape(count, columns)


@cache
def recording():
    """The recording."""
    t = DT * np.arange(1, SAMPLES + 1)
    dtheta = DT * (scatter(SAMPLES, 3, 1) * 2**-6 + (0.0, 0.0, 2**-5))
    dv = DT * (scatter(SAMPLES, 3, 2) * 2**-3 + (0.0, 0.25, -9.8046875))
    whole = np.r_[0 : SAMPLES // 2, SAMPLES // 2 + 40 : SAMPLES]  # a gap of 40 samples
    at = 0.25 * np.arange(1, 37) + 2**-8
    off = scatter(len(at), 3, 3)
    off[20] *= 64.0  # one that is rejected
    place = np.array([0.75, 0.125, 512.0]) + off * (2**-22, 2**-22, 2.0)
    heading = scatter(len(at), 3, 4) * 2**-5 + at[:, None] * (0.0, 0.0, 2**-5)
    field = np.array([2**-16, 0.0, 2**-15]) + scatter(len(at), 3, 5) * 2**-22
    still = np.full((len(at), 3), 0.5)
    sources = [
        sd.Source("position", at, place, still * 4, (0.5, 0.0, -1.0)),
        sd.Source("velocity", at, scatter(len(at), 3, 6), still, (0.5, 0.0, -1.0)),
        sd.Source("attitude", at + DT / 4, heading, still / 16),
        sd.Source("magnetic-field", at + DT / 2, field, still * 2**-20, (2**-16, 0.0, 2**-15)),
    ]
    return sd.Recording.from_arrays(
        t[whole], dtheta[whole], dv[whole], sources=sources, kind="increment"
    )


def begin():
    """Where every filter begins."""
    return InitialState(
        0.0, (0.75, 0.125, 512.0), (0.0,) * 3, (2**-5, -(2**-6), 0.5), (0.0,) * 3, (0.0,) * 3, STD
    )


def digest(name):
    """Of all rows and covariances of a filter."""
    solution = sd.fuse(
        recording(),
        name,
        start=begin(),
        noise=NOISE,
        covariance=True,
        options=OPTIONS.get(name, {}),
    )
    path = solution.trajectory
    parts = path.t, path.lla, path.v_n, path.q_nb, path.std, solution.covariance
    return hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in parts)).hexdigest()


def libm():
    """Digest of the functions of the C library that kernels call, at some hundreds of places."""
    x = scatter(100, 2, 9)
    values = [f(3.0 * a) for f in (math.sin, math.cos, math.exp, math.atan) for a in x[:, 0]]
    values += [math.log(2.0 + a) for a in x[:, 0]] + [math.asin(a) for a in x[:, 0]]
    values += [math.atan2(a, b) for a, b in x] + [math.hypot(a, b) for a, b in x]
    values += [(2.0 + a) ** (1.5 + b) for a, b in x]
    return hashlib.sha256(np.array(values).tobytes()).hexdigest()


def lapack():
    """Digest of what numpy's library of matrices makes of products and square roots of one."""
    A = scatter(15, 15, 7)
    made = [A[:n, :n] @ scatter(n, 3, n) for n in (3, 6, 15)]
    made += [A @ A.T, np.linalg.cholesky(A @ A.T + np.eye(15)), np.linalg.eigh(A @ A.T)[1]]
    return hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in made)).hexdigest()


def found(*names):
    """{name: digest}, also of `lapack`, in a process of its own under MATRICES; empty where this
    processor has not their code."""
    if "x86-64-v3" not in library.levels():
        return {}
    script = (
        "import json, sys; from golden import bits; "
        "print(json.dumps([bits.lapack(), *map(bits.digest, sys.argv[1:])]))"
    )
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", script, *names],
        env={**os.environ, "PYTHONPATH": paths, **MATRICES},
        stdout=subprocess.PIPE,
        check=True,
    )
    return dict(zip(("lapack", *names), json.loads(done.stdout)))


def kept():
    """What bits.json says."""
    return json.loads(FILE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    made = found(*filters.names())
    if not made:
        raise SystemExit("bits.json is made on Linux, on x86-64 with AVX2")
    FILE.write_text(json.dumps({"libm": libm(), **made}, indent=1) + "\n", encoding="utf-8")
