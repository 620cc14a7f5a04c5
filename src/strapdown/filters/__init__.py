"""Filter architectures by family. A filter's name is its file's name with dashes, in whatever
folder; the file ends in one `Filter(...)` value."""

import copyreg
import importlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from .. import plugins
from ..checks import DataError, check_choice, check_type
from ..core.loop.contract import (
    ADJOINT_STEP,
    BIAS,
    BIAS_MODELS,
    CORRECT,
    PREDICT,
    SAVE_STEP,
    STATES,
    Filter,
    Slots,
    compile_kernel,
)

FAMILIES = {
    "ins": "Kalman filters of the strapdown equations",
    "invariant": "Kalman filters whose error is on a group",
    "sigma_point": "Sigma-point Kalman filters",
    "particle": "Mixtures of Kalman filters",
    "observer": "Nonlinear observer and exogenous Kalman filter",
    "two_stage": "Two stages: attitude first, then the motion",
    "ahrs_aided": "Filters fed by an AHRS, or with Euler angles",
    "attitude": "Attitude without a position",
}
"""{folder of a family: what its filters are}, the one to begin with first."""


@cache
def _modules() -> dict[str, str]:
    """{name: module} of every file below this folder; those that hold no filter are what a
    family shares."""
    files = sorted(
        file.relative_to(folder).with_suffix("")
        for folder in __path__
        for file in Path(folder).rglob("*.py")
        if file.stem != "__init__"
    )
    found = {
        file.stem.replace("_", "-"): ".".join((__name__, *file.parts))
        for file in sorted(files, key=lambda file: file.stem)
    }
    if len(found) < len(files):
        raise RuntimeError(f"two files below {__name__} have one name")
    return found


def _filter(name: str) -> Filter | None:
    """The Filter that the file of that name holds, or None."""
    module = _modules().get(name) if isinstance(name, str) else None
    if not module:
        return None
    held = vars(importlib.import_module(module)).values()
    return next((one for one in held if isinstance(one, Filter) and one.name == name), None)


@cache
def own_names() -> list[str]:
    """Names of the library's own filters; no plugin is imported."""
    return [name for name in _modules() if _filter(name)]


def family(name: str) -> str:
    """The family of a filter, a key of FAMILIES; "" of one that a plugin brings."""
    return _modules()[name].split(".")[-2] if name in own_names() else ""


def names() -> list[str]:
    """Names of all filters: the library's, then those of plugins."""
    return REGISTRY.names()


def find(name: str | Filter) -> Filter:
    """The Filter of that name; of the library's own, only its file is imported. Raises DataError
    with the nearest name."""
    check_type(name, "filter", str | Filter, "the name of a filter, or a Filter")
    return name if isinstance(name, Filter) else REGISTRY.find(name)


def compile_filter_kernel(filter: Filter, kernel: Callable[..., Any]) -> None:
    """Compile a kernel of a filter. Raises DataError as `aiding.compile_observation` does."""
    with plugins.blame_plugin(filter, kernel, lambda: REGISTRY.brought_by(filter.name)):
        compile_kernel(kernel)


def check(filter: Filter) -> None:
    """Refuse a Filter that cannot be used. Raises DataError."""
    what = f"Filter {filter.name!r}: "
    plugins.check_word(filter)
    plugins.check_kernel(filter.predict, PREDICT, 4, what + "predict")
    plugins.check_kernel(filter.correct, CORRECT, 8, what + "correct")
    if smoother := filter.smoother:
        plugins.check_kernel(smoother.save_step, SAVE_STEP, 2, what + "save_step")
        plugins.check_kernel(smoother.adjoint_step, ADJOINT_STEP, 4, what + "adjoint_step")
    if not callable(filter.start) or len(inspect.signature(filter.start).parameters) < 2:
        raise DataError(f"{what}start must be a function of an InitialState, a Noise and options")
    if filter.bias:
        check_choice(filter.bias, what + BIAS, BIAS_MODELS)
        if BIAS in inspect.signature(filter.start).parameters:
            raise DataError(f"{what}start has an option {BIAS}, which the Filter has itself")
    for field in ("states", "estimates"):
        if not set(getattr(filter, field)) <= set(range(STATES)):
            raise DataError(f"{what}{field} must be indices of states, 0 to {STATES - 1}")
    for field in ("uses", "needs"):
        kinds = getattr(filter, field) or ()
        if not isinstance(kinds, tuple) or not all(isinstance(kind, str) for kind in kinds):
            raise DataError(
                f"{what}{field} is {kinds!r}; it must be a tuple of kinds of measurement"
            )
    for field in ("configure", "diagnose"):
        if not callable(getattr(filter, field) or callable):
            raise DataError(f"{what}{field} is {getattr(filter, field)!r}; it must be a function")
    for field in ("good_for", "poor_for"):
        if not isinstance(getattr(filter, field), str):
            raise DataError(f"{what}{field} is {getattr(filter, field)!r}; it must be text")
    if not isinstance(filter.slots, Slots):
        raise DataError(f"{what}slots is {filter.slots!r}; it must be Slots")


REGISTRY = plugins.Registry(Filter, "no filter is called", _filter, own_names, check)


def _by_name(filter: Filter) -> tuple[Callable[[str], Filter], tuple[str]]:
    """Kernels are no data: another process finds the filter by its name. Raises DataError for one
    that cannot be found so."""
    try:
        found = find(filter.name)
    except DataError:
        found = None
    if found is not filter:
        raise DataError(
            f"filter {filter.name!r} is known in this process alone; strapdown.register makes it known"
        )
    return find, (filter.name,)


copyreg.pickle(Filter, _by_name)
