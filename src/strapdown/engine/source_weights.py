"""Robust or adaptive sources by the choice of the caller."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from ..checks import DataError, brief, check_number
from ..data.recording import Recording
from ..data.solution import Source

Robust: TypeAlias = bool | str | Iterable[str]
"""True for all sources, False for none, or their names or kinds."""
Adaptive: TypeAlias = float | Mapping[str, float]
"""Memory in s of all sources, 0 for none; or {name or kind: memory}."""


def with_weights(
    recording: Recording, robust: Robust | None, adaptive: Adaptive | None
) -> Recording:
    """Return the recording with its sources as `apply_weights` makes them. Raises DataError."""
    if robust is None and adaptive is None:
        return recording
    return replace(recording, sources=apply_weights(recording.sources, robust, adaptive))


def apply_weights(
    sources: Iterable[Source], robust: Robust | None, adaptive: Adaptive | None
) -> tuple[Source, ...]:
    """Return the sources with these of them robust or adaptive, in place of their own settings;
    unchanged for None. Raises DataError."""
    made = list(sources)
    if robust is not None:
        chosen = _robust(made, robust)
        made = [replace(a, robust=i in chosen) for i, a in enumerate(made)]
    if adaptive is not None:
        memory = _adaptive(made, adaptive)
        made = [replace(a, adaptive=memory.get(i, 0.0)) for i, a in enumerate(made)]
    return tuple(made)


def _robust(sources: list[Source], robust: Robust) -> set[int]:
    if isinstance(robust, bool):
        return set(range(len(sources))) if robust else set()
    names: list[Any] = [robust] if isinstance(robust, str) else _name_list(robust)
    return {i for name in names for i in _source_indices(sources, name, "robust")}


def _name_list(robust: Any) -> list[Any]:
    try:
        return list(robust)
    except TypeError:
        raise DataError(
            f"robust is {brief(robust)}; it must be True, False, or names of sources"
        ) from None


def _adaptive(sources: list[Source], adaptive: Adaptive) -> dict[int, float]:
    if not isinstance(adaptive, Mapping):
        memory = _memory(adaptive, "adaptive")
        return {i: memory for i in range(len(sources))}
    return {
        i: _memory(memory, f"adaptive of {name}")
        for name, memory in adaptive.items()
        for i in _source_indices(sources, name, "adaptive")
    }


def _memory(value: Any, what: str) -> float:
    return check_number(value, what, "s", least=0, most=1e6)


def _source_indices(sources: list[Source], name: Any, option: str) -> list[int]:
    """The sources of this name or, where none has it, of this kind. Raises DataError."""
    word = str(name).lower()
    named = [i for i, a in enumerate(sources) if a.name.lower() == word]
    found = named or [i for i, a in enumerate(sources) if a.kind == word]
    if not found:
        names = ", ".join(dict.fromkeys(a.name or a.kind for a in sources)) or "none"
        raise DataError(f"{option}: no source {brief(name)}; the recording has {names}")
    return found
