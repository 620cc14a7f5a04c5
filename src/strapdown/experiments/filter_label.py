"""Filters by label: a name, or a name with options and estimated installation parameters, as in
studies, comparisons and their tables."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .. import filters
from ..checks import DataError, check_choice
from ..core.loop.contract import STATES, Filter, InitialState, Noise
from ..data import calibration_parameters
from ..engine.prepare import check_options, new_belief

ESTIMATE, NOTHING = "estimate", "none"
"""The option of a label that names the installation parameters to estimate, and its value for
none."""
ANYWHERE, NOISELESS = (
    InitialState(
        0.0, (0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0,) * STATES
    ),
    Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
"""A start and a noise that any filter takes, to try its options with."""


class Labelled(NamedTuple):
    """The filter, options and estimated parameters that a label names."""

    filter: Filter
    options: dict[str, Any]
    # installation parameters, as in `fuse`; None where the label does not name them
    estimate: tuple[str, ...] | None = None

    @property
    def label(self) -> str:
        """The label; the same options always have the same."""
        texts = {
            key: value if isinstance(value, str) else format(value, ".12g")
            for key, value in self.options.items()
        }
        if self.estimate is not None:
            texts[ESTIMATE] = "+".join(self.estimate) or NOTHING
        ordered = ",".join(f"{key}={text}" for key, text in sorted(texts.items()))
        return self.filter.name + ":" * bool(texts) + ordered


def parse_label(label: str) -> Labelled:
    """Parse a label "name", "name:option=value,option=value" or "name:estimate=clock+lever-arm".
    Raises DataError."""
    name, _, rest = label.partition(":")
    pairs = [item.partition("=") for item in rest.split(",") if item.strip()]
    if wrong := [key for key, equals, _ in pairs if not equals]:
        raise DataError(
            f"filter {label!r}: {wrong[0]!r} is not an option with a value; write "
            f"{name}:option=value,option=value"
        )
    return labelled_filter(name, {key.strip(): _value(value) for key, _, value in pairs})


def labelled_filter(name: str, options: Mapping[str, Any]) -> Labelled:
    """Return the filter of that name with these options. ESTIMATE, names joined by "+" or a list of
    names, is not one of its own options. Raises DataError."""
    filter, own = filters.find(name), dict(options)
    estimate = _estimate(filter, own.pop(ESTIMATE)) if ESTIMATE in own else None
    check_options(filter, own)
    new_belief(filter, ANYWHERE, NOISELESS, own, ())  # refuses values
    return Labelled(filter, own, estimate)


def _estimate(filter: Filter, wanted: object) -> tuple[str, ...]:
    if isinstance(wanted, str):
        wanted = [] if wanted == NOTHING else wanted.split("+")
    if not isinstance(wanted, Sequence) or not all(isinstance(each, str) for each in wanted):
        raise DataError(
            f"filter {filter.name!r}: {ESTIMATE} is {wanted!r}; it must be names joined by +, "
            f"such as clock+lever-arm"
        )
    names = tuple(" ".join(each.split()) for each in wanted)
    for each in names:
        if "=" in each:
            raise DataError(
                f"filter {filter.name!r}: {ESTIMATE} has {each!r}; a label takes only names: give priors "
                f"in estimate= (--estimate) for all filters or in the recording"
            )
        check_parameter(each)
    if names and not filter.installation:
        able = [name for name in filters.names() if filters.find(name).installation]
        raise DataError(f"{filter.name} cannot estimate {names[0]}; these can: {', '.join(able)}")
    return names


def check_parameter(words: str) -> calibration_parameters.CalibrationParameter:
    """The parameter that "clock" or "position clock" names. Raises DataError."""
    known = {**calibration_parameters.OF_SOURCE, **calibration_parameters.OF_IMU}
    return known[check_choice((words.split() or [""])[-1], "estimate", known)]


def _value(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text.strip()
