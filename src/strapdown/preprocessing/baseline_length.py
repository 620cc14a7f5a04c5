"""Length of the vector between two antennas: known from the vehicle, and measured with every fix
whatever the attitude. A fix of another length has a wrong carrier solution."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..aiding import find
from ..checks import DataError
from ..data.solution import Source
from ..typing import Array, Mask
from ..units.wording import count_text

KIND = "baseline"
"""Kind of measurement, and meaning of its parameters."""
GIVEN_STD = 0.01
"""m: standard deviation of a length that was measured with a tape."""
SURE = 3.29
"""Standard deviations that the length of one fix in 1000 exceeds, as of the gates."""
MIN_LENGTH = 0.05
"""m: antennas closer than this show no attitude."""


def check_baseline(source: Source) -> None:
    """Refuse parameters that are no vector between two antennas. Raises DataError."""
    if find(source.kind).parameters != KIND:
        return
    given = tuple(source.parameters)
    if len(given) < 3 or not np.linalg.norm(given[:3]) >= MIN_LENGTH:
        raise DataError(
            f"{source.name or source.kind}: parameters are {given}, where the vector from the first "
            f"to the second antenna is needed, m forward, right, down, at least {MIN_LENGTH:g} m long"
        )


def length_errors(y: Array, std: Array, given: Sequence[float]) -> tuple[Array, Array]:
    """(measured length less the given one, its standard deviation), (n,) m each.

    Parameters
    ----------
    y, std : (n, 3) array
        Measured vectors and their standard deviations, m.
    given : sequence of float
        The vector in the body, m.
    """
    length = np.linalg.norm(y, axis=1)
    along = np.linalg.norm(y * std, axis=1) / np.maximum(length, MIN_LENGTH)
    return length - np.linalg.norm(given[:3]), np.hypot(along, GIVEN_STD)


def wrong_lengths(y: Array, std: Array, given: Sequence[float]) -> Mask:
    """(n,) True where the length is off by more than the stated noise allows; arguments as of
    `length_errors`."""
    error, noise = length_errors(y, std, given)
    return np.asarray(np.abs(error) > SURE * noise)


def without_wrong_lengths(source: Source) -> tuple[Source, list[str]]:
    """(the source without the fixes whose length is wrong, notes on them); a source of another kind
    as it is."""
    if find(source.kind).parameters != KIND or not len(source.t):
        return source, []
    wrong = wrong_lengths(source.y, source.std, source.parameters)
    if not wrong.any():
        return source, []
    error, _ = length_errors(source.y, source.std, source.parameters)
    note = (
        f"{source.name or source.kind}: {count_text(int(wrong.sum()), 'fix', 'es')} of {len(wrong)} "
        f"left out, whose length differs from the given {np.linalg.norm(source.parameters[:3]):.3f} m "
        f"by more than the noise, by up to {np.abs(error[wrong]).max():.3f} m"
    )
    kept = ~wrong
    return replace(source, t=source.t[kept], y=source.y[kept], std=source.std[kept]), [note]
