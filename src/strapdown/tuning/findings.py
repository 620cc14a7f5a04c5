"""The result of `tune`: the noise of the IMU and of each source, with intervals, and the
combinations that the data do not determine."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isclose
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..data.recording import Recording
from ..data.solution import Solution
from ..data.value import Value
from ..evaluation.fix_statistics import lasts
from ..sensor_models.imu import ImuSpec
from ..typing import Array, File
from .noise_files import change, difference, name_of, write
from .numbers import WHITE, NoiseNumber

if TYPE_CHECKING:
    import pandas as pd

    from ..pages.shell import Page

TUNED, AT_MAX, AT_MIN, OPEN, KEPT = "tuned", "at most", "at least", "open", "kept"
"""Status of a NoiseParameter: both ends of its interval are there; only the upper; only the lower; none;
or its innovations are correlated for reasons that the model lacks, so that a smaller value would
mean nothing, and the given one stays."""


@dataclass(frozen=True, eq=False)
class NoiseParameter(Value, NoiseNumber):
    """A number with what the data say of it, SI."""

    value: float  # what the tuned recording and IMU have
    low: float  # ends of the 95 % interval of the profile likelihood; 0 where it is open
    high: float  # inf where it is open
    status: str
    # the scan of the profile: values and twice the loss of log-likelihood, (k,) each
    scan: tuple[Array, Array]

    @property
    def meaning(self) -> str:
        """The meaning of the parameter, in a few words."""
        return self.what.meaning

    @property
    def stays(self) -> bool:
        """True where the given value is kept."""
        return isclose(self.value, self.given, rel_tol=1e-6)

    @property
    def agrees(self) -> bool:
        """True where the given value lies within the interval."""
        return self.given > 0 and self.low <= self.given <= self.high

    @property
    def interval(self) -> str:
        """The 95 % interval in words, without its unit; "" where both ends are open."""
        low, high = self.value_text(self.low), self.value_text(self.high)
        if self.low > 0 and self.high < inf:
            return f"{low} to {high}"
        if self.high < inf:
            return f"at most {high}"
        return f"at least {low}" if self.low > 0 else ""

    def __str__(self) -> str:
        return f"{self.label} ({self.meaning}): {self._interval_text()}"

    def _interval_text(self) -> str:
        value = f"{self.value_text(self.value)} {self.unit}"
        if self.status == TUNED:
            return f"{value}, 95 % {self.interval}; {self._beside_given()}"
        used = f"{value} kept as given" if self.stays else f"{value} is used"
        if self.status == KEPT:
            return (
                f"{used}; the data favour a smaller value, but the innovations stay correlated, "
                "which makes it meaningless"
            )
        if self.status == OPEN:
            return f"the data do not determine it, any value fits; {used}"
        given = "" if self.stays else f"; {self._beside_given()}"
        return f"the data show only that it is {self.interval} {self.unit} (95 %); {used}{given}"

    def _beside_given(self) -> str:
        """Return the comparison of the given value with the estimate, in words."""
        if not self.given > 0:
            return "none was given"
        ratio = self.value / self.given
        more = max(ratio, 1 / ratio)
        times = f"{more:.2g} times" if more > 1.1 else f"{100 * (more - 1):.2g} %"
        size = f"{times} too {'small' if ratio > 1 else 'large'}"
        return f"given {self.value_text(self.given)}, {'which fits too' if self.agrees else size}"

    def value_text(self, value: float) -> str:
        """An SI value with three digits in its unit, which is not told."""
        shown = value * self.factor
        return f"{shown:.0f}" if 999.5 <= abs(shown) < 1e6 else f"{shown:.3g}"


class Direction(NamedTuple):
    """A way in which several parameters can change together without the data minding."""

    weights: Mapping[str, float]  # {source and name: change of its logarithm}, of unit length
    # factor by which the parameters of the largest weight may change along it, 95 %
    spread: float
    text: str


class SourceFit(NamedTuple):
    """The fit of the innovations of a source, before and after."""

    source: str
    nis: tuple[float, float]  # median over the median of its chi-square
    correlation: tuple[float, float]  # of whitened innovations one fix apart
    rejected: tuple[float, float]  # share of its fixes

    @property
    def unexplained(self) -> bool:
        """True where the innovations stay correlated for reasons that the model lacks."""
        return lasts(self.correlation[1])

    def __str__(self) -> str:
        nis, correlation, rejected = self.nis, self.correlation, self.rejected
        return (
            f"{self.source}, before and after: median NIS {nis[0]:.2f} and {nis[1]:.2f} of its "
            f"expectation, correlation one fix apart {correlation[0]:.2f} and {correlation[1]:.2f}, "
            f"rejected {100 * rejected[0]:.1f} and {100 * rejected[1]:.1f} %"
        )


@dataclass(frozen=True, eq=False)
class Tuning(Value):
    """The noise estimated from a recording.

    Attributes
    ----------
    parameters : tuple of NoiseParameter
        Each noise as given and as found.
    directions : tuple of Direction
        Combinations of them that the data hardly determine.
    fits : tuple of SourceFit
        Statistics of each source's innovations.
    recording : Recording
        The recording as given.
    tuned : Recording
        The recording, its sources with the values found.
    imu : ImuSpec
        The IMU with the noise found.
    log_likelihood : tuple[float, float]
        Log-likelihood before and after, of the same fixes.
    runs : int
        How often the filter ran.
    seconds : tuple[float, float]
        Part of the recording that was used, s.
    before : Solution
        Solution as given.
    after : Solution
        Solution as tuned.
    notes : tuple of str
        Further facts for the user, a line each.
    """

    parameters: tuple[NoiseParameter, ...]
    directions: tuple[Direction, ...]
    fits: tuple[SourceFit, ...]
    recording: Recording
    tuned: Recording
    imu: ImuSpec
    log_likelihood: tuple[float, float]
    runs: int
    seconds: tuple[float, float]
    before: Solution
    after: Solution
    notes: tuple[str, ...] = field(default=())

    @property
    def summary(self) -> str:
        """One sentence: how many numbers the data tell, and how many they do not."""
        counts = [
            (sum(each.status in states for each in self.parameters), text)
            for text, states in (
                ("only bounded", (AT_MAX, AT_MIN)),
                ("not decided", (OPEN,)),
                ("kept as given because innovations stay correlated", (KEPT,)),
            )
        ]
        more = ", ".join(f"{n} {'is' if n == 1 else 'are'} {text}" for n, text in counts if n)
        tuned = sum(each.status == TUNED for each in self.parameters)
        told = f"{tuned} of {len(self.parameters)} numbers are determined by the data"
        return f"{told}; {more}" if more else told

    @property
    def undecided(self) -> list[str]:
        """Combinations of parameters and sources that the data do not determine, and why, a line
        each."""
        return [
            *(each.text for each in self.directions),
            *(self._unexplained_text(fit) for fit in self.fits if fit.unexplained),
        ]

    def _unexplained_text(self, fit: SourceFit) -> str:
        """That the noise of a source cannot be told."""
        own = (p for p in self.parameters if p.source == fit.source and p.what is WHITE)
        smaller = any(p.value < p.given and not p.stays for p in own)
        return (
            f"innovations of {fit.source} stay correlated ({fit.correlation[1]:.2f} one fix "
            "apart) for reasons outside the model: noise factors mean nothing "
            f"there{'' if smaller else ', and none was made smaller'}"
        )

    @property
    def lines(self) -> list[str]:
        """For people: the summary, every parameter, what is not decided, how it fits, notes."""
        parameters = map(str, self.parameters)
        fits = map(str, self.fits)
        return [self.summary, *parameters, *self.undecided, *fits, *self.notes, self.used]

    @property
    def used(self) -> str:
        """The part of the recording that was used, the runs of the filter and the gain in
        log-likelihood, in words."""
        (start, stop), (before, after) = self.seconds, self.log_likelihood
        return (
            f"used: {start:.1f} to {stop:.1f} s, {stop - start:.0f} s, in {self.runs} runs of the "
            f"filter; the log-likelihood rose by {after - before:.1f}"
        )

    def table(self) -> "pd.DataFrame":
        """pandas DataFrame of the parameters, a row each, in the unit of the row."""
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "source": each.source,
                    "parameter": each.name,
                    "unit": each.unit,
                    "given": each.given * each.factor,
                    "found": each.value * each.factor,
                    "low": each.low * each.factor,
                    "high": each.high * each.factor,
                    "status": each.status,
                    "meaning": each.meaning,
                }
                for each in self.parameters
            ]
        )

    @property
    def name(self) -> str:
        """The name of the recording, with which the names of its files begin."""
        return name_of(self.recording)

    def write(self, folder: File) -> list[Path]:
        """Write NAME-imu.toml, which serves as `imu`, and NAME-sources.toml, for `with_noise`,
        into a folder; the paths. Raises DataError where one is there already or cannot be
        written; then none is."""
        return write(self, Path(folder))

    def diff(self, path: File) -> list[str]:
        """The lines of a recording.toml that `change` would change, with their numbers: - as they
        are, + as they would be. Raises DataError where it is another file, or cannot be changed."""
        return difference(self, Path(path))

    def change(self, path: File) -> tuple[Path, Path]:
        """Write what was found into the recording.toml that the recording was read from, with
        comments that have interval and date, and NAME-imu.toml beside it, which it then names as
        `grade`; (that file, the copy of the old recording.toml that is kept beside it).

        Raises DataError where it is another file, cannot be changed, or where the IMU file is there
        already; then nothing is changed.
        """
        return change(self, Path(path))

    def page(self) -> "Page":
        """The page: numbers, likelihood, and innovations before and after."""
        from .page import page

        return page(self)

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def __repr__(self) -> str:
        return f"Tuning({self.summary})"

    def _repr_html_(self) -> str:
        from ..pages.notebook.cards import card, frame, lines

        said = lines([*self.undecided, *self.notes, self.used])
        return card(f"Tuning: {self.summary}", {}, frame(self.table()), said)
