"""The initial image of the struct after a filter's start: constant numbers and copies of parts of
the start, found by starting the filter many times.

`start` of a filter is plain Python with arbitrary computations. Results other than constants and
copies cannot be expressed in C, and such a filter is refused.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...core.compile.workspace import Slots
from ...core.loop.contract import STATES, Filter, InitialState, Noise
from ...core.mathematics.rotation import euler_to_matrix
from ...typing import Array, Ints
from .layout import ExportLayout, MemoryPlace, numbers

PROBES = 16
"""Number of starts that are tried: enough that no two parts agree by chance, with standard
deviations from very small to very large, so that their limits show."""


class Known(NamedTuple):
    """A number of a start, by the name of its part in C."""

    part: str
    at: int


class Image(NamedTuple):
    """The struct before the first sample."""

    constants: Mapping[
        MemoryPlace, Mapping[int, float]
    ]  # by the number in the place; all others are 0
    copies: Mapping[MemoryPlace, Mapping[int, Known]]
    fixed: tuple[str, ...]  # parts of which it is computed, and which are those of the export


Records = Callable[[InitialState, Noise], Mapping[str, Sequence[Any]]]
MAY_BE_FIXED = ("noise", "lla")
"""Parts of a start that may be fixed for a vehicle: its IMU, and its place where only attitude
depends on it."""


def image(
    filter: Filter, records: Records, made: ExportLayout, start: InitialState, noise: Noise
) -> Image:
    """Return the image of a filter from its records at a start and a noise.

    Raises DataError where its start computes more than copies from parts that may not be fixed.
    """
    for fixed in ((), MAY_BE_FIXED[:1], MAY_BE_FIXED[1:], MAY_BE_FIXED):
        tried = [_numbers(records, made, *one) for one in _probes(start, noise, fixed)]
        changes, copied = _is_changing([numbers for numbers, _, _ in tried]), _copies(tried)
        left = [int(k) for k in np.flatnonzero(changes) if k not in copied]
        if not left:
            break
    else:
        names = ", ".join(dict.fromkeys(_name(filter, made, k) for k in left))
        raise DataError(
            f"filter {filter.name!r} cannot be exported: its start computes {names}, but an export "
            f"supports only constants and copies"
        )
    constants: dict[MemoryPlace, dict[int, float]] = {}
    copies: dict[MemoryPlace, dict[int, Known]] = {}
    values, whole, _ = tried[0]
    for place in made.places:
        for k in range(place.first, place.first + place.length):
            if k in copied:
                copies.setdefault(place, {})[k - place.first] = copied[k]
            elif values[k] or whole[k]:
                real = place.within(k - place.first)[1]
                value = float(values[k]) if real else int(whole[k])
                constants.setdefault(place, {})[k - place.first] = value
    return Image(constants, copies, fixed)


def known_numbers(start: InitialState, noise: Noise) -> dict[Known, float]:
    """Return the numbers of a start that are available in C."""
    C = np.empty((3, 3))
    roll, pitch, heading = (float(angle) for angle in start.rph)
    euler_to_matrix(roll, pitch, heading, C)
    std = np.asarray(start.std, float)
    parts: dict[str, Iterable[float]] = {
        "t": np.array([start.t]),
        "lla": start.lla,
        "v_n": start.v_n,
        "C_nb": C.ravel(),
        "b_a": start.b_a,
        "b_g": start.b_g,
        "variance": std**2,
        "std": std,
        "rph": start.rph,
        "noise": np.array(noise),
    }
    return {
        Known(part, i): float(x) for part, values in parts.items() for i, x in enumerate(values)
    }


def _probes(
    start: InitialState, noise: Noise, fixed: Sequence[str]
) -> Iterator[tuple[InitialState, Noise]]:
    """Starts and noises of any size, the parts that are fixed as given."""
    rng = np.random.default_rng(1)

    def numbers(scale: float, count: int = 3) -> tuple[float, ...]:
        return tuple((scale * rng.uniform(-1, 1, count)).tolist())

    for _ in range(PROBES):
        drawn = start._replace(
            t=numbers(1e3, 1)[0],
            lla=numbers(1.5, 1) + numbers(3.0, 1) + numbers(1e4, 1),
            v_n=numbers(10.0 ** rng.uniform(-2, 3)),
            rph=numbers(3.0, 1) + numbers(1.5, 1) + numbers(3.0, 1),
            b_a=numbers(0.5),
            b_g=numbers(0.05),
            std=tuple((10.0 ** rng.uniform(-6, 6, STATES)).tolist()),
        )
        assumed = Noise(*(10.0 ** rng.uniform(-6, 0, len(noise))).tolist())
        yield (
            drawn._replace(lla=start.lla) if "lla" in fixed else drawn,
            noise if "noise" in fixed else assumed,
        )


Tried = tuple[Array, Ints, dict[Known, float]]


def _numbers(records: Records, made: ExportLayout, start: InitialState, noise: Noise) -> Tried:
    return *numbers(records(start, noise), made), known_numbers(start, noise)


def _is_changing(arrays: Sequence[Array]) -> Array:
    stacked = np.array(arrays)
    return ~((stacked == stacked[0]) | (np.isnan(stacked) & np.isnan(stacked[0]))).all(axis=0)


def _copies(tried: Sequence[Tried]) -> dict[int, Known]:
    """Return {number of the struct: the part that it copies in all trials} for changing numbers."""
    arrays = [numbers for numbers, _, _ in tried]
    changes = _is_changing(arrays)
    by_value: dict[float, list[Known]] = {}
    for name, value in tried[0][2].items():
        by_value.setdefault(value, []).append(name)
    found = {}
    for k in np.flatnonzero(changes):
        for name in by_value.get(float(arrays[0][k]), ()):
            if all(values[k] == own[name] for values, _, own in tried):
                found[int(k)] = name
                break
    return found


def _name(filter: Filter, made: ExportLayout, k: int) -> str:
    """Return the name of a number of the struct, for messages."""
    place = next(place for place in made.places if place.first <= k < place.first + place.length)
    if place.name == "workspace":
        return _slot(filter.slots, k - place.first)
    return place.name


def _slot(slots: Slots, k: int) -> str:
    found = [(first, name) for name, (first, _) in slots.places.items() if first <= k]
    first, name = max(
        found, default=(0, slots.columns[k] if k < len(slots.columns) else "a number")
    )
    layout = slots.places[name][1] if name in slots.places else None
    return f"{name}.{_slot(layout, k - first)}" if isinstance(layout, Slots) else name
