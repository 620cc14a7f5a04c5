"""replay.bin: the samples and fixes of a recording in time order, and the filter's results, for the
example of an export.

Numbers have eight bytes, little-endian: doubles, or integers where marked whole.

    whole   MAGIC, numbers of strapdown_values, sources, STRAPDOWN_PARAMETERS, STRAPDOWN_COLUMNS
    values  strapdown_values
    sources parameters and gate of each
    then    whole SAMPLE, t, dt, dtheta (3), dv (3)
            whole FIX, whole source, t, y (3), std (3)
            whole ROW, STRAPDOWN_COLUMNS numbers: out.nav of the filter after the sample before
            whole END
"""

from collections.abc import Iterator
from itertools import chain
from struct import pack

import numpy as np

from ...core.mathematics.solution_row import T
from ...engine.prepare import Run
from .chosen import GIVEN, Chosen

MAGIC = 0x4E574F4450415254  # "TRAPDOWN"
END, SAMPLE, FIX, ROW = range(4)


def replay(of: Chosen, run: Run, every: int) -> bytes:
    """Return the content of replay.bin of a complete run: a row for every `every` samples and the
    last."""
    return b"".join(chain(_begin(of, run), _events(run, every)))


def _begin(of: Chosen, run: Run) -> Iterator[bytes]:
    start = of.start
    values = [start.t, *start.lla, *start.v_n, *start.rph, *start.b_a, *start.b_g, *start.std[:15]]
    values += of.noise
    yield pack("<5q", MAGIC, len(values), len(of.sources), GIVEN, run.out.nav.shape[1])
    yield _doubles(*values)
    for source in run.fixes.sources:
        yield _doubles(*source.parameters, source.gate)


def _events(run: Run, every: int) -> Iterator[bytes]:
    imu, fixes, nav = run.samples, run.fixes, run.out.nav
    fix, last = 0, len(imu.t) - 1
    # a fix may be used in the sample before the one whose interval contains it
    given = np.searchsorted(imu.t, fixes.t - 1e-3)
    for k in range(run.first, len(imu.t)):
        while fix < len(fixes.t) and given[fix] <= k:
            yield pack("<2q", FIX, fixes.source[fix])
            yield _doubles(fixes.t[fix], *fixes.y[fix], *fixes.std[fix])
            fix += 1
        yield pack("<q", SAMPLE) + _doubles(imu.t[k], imu.dt[k], *imu.dtheta[k], *imu.dv[k])
        if (k - run.first) % every == 0 or k == last:
            row = nav[k - run.first]
            assert row[T] == imu.t[k]
            yield pack("<q", ROW) + row.tobytes()
    yield pack("<q", END)


def _doubles(*values: float) -> bytes:
    return np.array(values, "<f8").tobytes()
