"""Where Tables 2 to 4 of Mollaei et al. cannot all be of the flights that they are said to be of:
arithmetic on what is printed, without a flight.

The three experiments are one flight until the fixes are cut, and two of them until they end at 25
s. Squares only add up, and so does the highest value: a longer flight cannot have less of either.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown.typing import Array

from .cells import CUT, E0, E1, E2, MODES, NO_FILTER, PKF, PUBLISHED, TABLE_OF, UKF
from .rules import OVERSHOOTS, PRINTED_DEVIATIONS, PRINTED_Y, count_printed
from .runs import duration

AXES = {"fx_n": "Fx", "fz_n": "Fz", "gx": "Gx", "gz": "Gz", "over_x_pct": "X", "over_z_pct": "Z"}


class PrintedRatio(NamedTuple):
    """A number of a table over that of another, of one mode."""

    row: str  # as AXES has it
    mode: str
    value: float

    def __str__(self) -> str:
        return f"{self.row}, {self.mode} {self.value:.2g}"


def ratios(
    later: str, earlier: str, rows: Sequence[str], modes: Sequence[str]
) -> list[PrintedRatio]:
    """The numbers of the table of experiment `later` over those of `earlier`, where both are
    finite and not 0."""
    found = [
        PrintedRatio(AXES[row], mode, _number(later, row, mode) / _number(earlier, row, mode))
        for row in rows
        for mode in modes
        if _number(earlier, row, mode) > 0
    ]
    return [each for each in found if np.isfinite(each.value)]


def _number(experiment: str, row: str, mode: str) -> float:
    return float(PUBLISHED[TABLE_OF[experiment]][row][MODES.index(mode)])


def least_ratio(seconds: float, longer: float) -> float:
    """Return the least that an rms over `longer` s can be of that over its first `seconds`, about
    one final value: all squares of the first part, and none after it."""
    return float(np.sqrt(seconds / longer))


def contradictions() -> pd.DataFrame:
    """Return a DataFrame of text: the printed value, the condition for it, and the
    contradiction."""
    rows = [_after_the_cut(), *_one_transient(), *_overshoots(), _than_none(), _velocity_y()]
    return pd.DataFrame(rows, columns=["printed", "the arithmetic", "so"])


def _values(found: Sequence[PrintedRatio]) -> Array:
    return np.array([each.value for each in found])


def _span(found: Sequence[PrintedRatio]) -> str:
    """Text: the least and the most of the ratios."""
    values = _values(found)
    return f"{values.min():.2g} to {values.max():.2g}"


def _after_the_cut() -> tuple[str, str, str]:
    filters = [mode for mode in MODES if mode != NO_FILTER]
    found = ratios(E1, E0, PRINTED_DEVIATIONS, filters)
    least = min(found, key=lambda each: each.value)
    return (
        f"Deviations of the filters with the outage (Table 3) are {_span(found)} of those with "
        f"fixes (Table 2), in all {len(found)} rows below 1.",
        f"The flights are one until {CUT:g} s of {duration(E0):g} s. For {least.row} of the "
        f"{least.mode} {1 - least.value**2:.0%} of the squares with fixes (1 - {least.value:.3f}²) "
        f"would lie after {CUT:g} s, when the curves have converged.",
        "losing the GPS improves the flight, or more differs than the GPS",
    )


def _one_transient() -> list[tuple[str, str, str]]:
    short, long = duration(E1), duration(E2)
    least = least_ratio(short, long)
    found = []
    for row in PRINTED_DEVIATIONS:
        own = ratios(E2, E1, [row], (UKF, PKF))
        low = [each for each in own if each.value < least]
        said = "impossible for " + " and ".join(each.mode for each in low) if low else "possible"
        found.append(
            (
                f"{AXES[row]} over {long:g} s (Table 4) is {_span(own)} of that over {short:g} s "
                "(Table 3).",
                f"One transient alone gives √({short:g} / {long:g}) = {least:.3f}, any later "
                "deviation more.",
                f"{said}, about one final value",
            )
        )
    return found


def _overshoots() -> list[tuple[str, str, str]]:
    found = []
    for later, earlier, until in ((E1, E0, CUT), (E2, E1, duration(E1))):
        own = [each for each in ratios(later, earlier, OVERSHOOTS, (UKF, PKF)) if each.value < 1]
        found.append(
            (
                f"Overshoots of velocity in {TABLE_OF[later]} over those in {TABLE_OF[earlier]}: "
                + "; ".join(map(str, own))
                + ".",
                f"The flights are one until {until:g} s, and a highest value stays one.",
                f"the highest values of {TABLE_OF[earlier]} come after {until:g} s, or the final "
                "values differ by as much",
            )
        )
    return found


def _than_none() -> tuple[str, str, str]:
    every = (*PRINTED_DEVIATIONS, *OVERSHOOTS)
    text = ", ".join(
        f"{mode} {count_printed('Table 2', every, mode, NO_FILTER)}" for mode in (UKF, PKF)
    )
    return (
        'Deviations and overshoots "are minimized with UKF and PKF filters compared to cases '
        'without filters".',
        f"Rows of Table 2 that are smaller than without a filter: {text}.",
        "the table contradicts the sentence",
    )


def _velocity_y() -> tuple[str, str, str]:
    values = np.array([PUBLISHED["Table 2"][row] for row in OVERSHOOTS]).ravel()
    return (
        'Overshoots of velocity Y are "negligible, ranging between '
        f'{PRINTED_Y[0]:g}–{PRINTED_Y[1]:g}", and left out.',
        f"Of the {len(values)} overshoots that Table 2 prints for X and Z "
        f"{int((values < PRINTED_Y[1]).sum())} are below {PRINTED_Y[1]:g} and "
        f"{int((values < PRINTED_Y[0]).sum())} below {PRINTED_Y[0]:g}.",
        "what is called negligible is no smaller than what is printed",
    )
