"""Files that change the noise of a recording's sources in any format: a factor on their standard
deviations and their correlated errors, as `tune` finds them."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from ..aiding import find
from ..checks import DataError, check_number, check_path, did_you_mean, locate_errors
from ..data.recording import Recording, check_recording
from ..data.solution import Correlated, Source
from ..fileio.files import read_toml, replacing
from ..fileio.toml_keys import Key, flag, items, read_table, section
from ..typing import File
from ..units.constants import MAX_TIME_CONSTANT
from ..units.quantities import shown_unit

FACTOR, CORRELATED = "std_factor", "correlated"
"""Keys of a section."""
MAX_FACTOR = 1e6


class SourceNoise(NamedTuple):
    """The noise of a source, from the section of its name."""

    factor: tuple[float, ...] = (1.0,)  # on its standard deviations: one, or one per row
    # std in the units of tables, one or one per row; None: as the recording has them
    correlated: Correlated | None = None
    said: str = ""  # comment after the factor


def read_noise(path: File) -> dict[str, SourceNoise]:
    """Return {name of a source: SourceNoise} of a file. Raises DataError."""
    table = read_toml(path, "give the file that `strapdown tune` wrote")
    with locate_errors(path):
        return {
            name: SourceNoise(**section(_section)(content, name)) for name, content in table.items()
        }


def with_noise(recording: Recording, file: File) -> Recording:
    """Return the recording with the noise of its sources from a file of `strapdown tune`.

    Parameters
    ----------
    recording : Recording
        Sources that the file does not name stay as they are.
    file : str or path
        NAME-sources.toml.

    Returns
    -------
    Recording
        With these standard deviations and time-correlated errors.

    Raises
    ------
    DataError
        If the file cannot be read, or names a source that the recording does not have, or has
        twice.
    """
    check_recording(recording)
    check_path(file, "file")
    found = read_noise(file)
    names = [a.name or a.kind for a in recording.sources]
    for name in found:
        if names.count(name) != 1:
            there = "several sources" if name in names else "no source"
            raise DataError(
                f"{file}: [{name}]: the recording has {there} of that name"
                f"{did_you_mean(name, names)}; it has {', '.join(names) or 'none'}"
            )
    noises = [found.get(name) for name in names]
    sources = [
        a if noise is None else _with_noise(a, noise, f"{file}: [{name}]")
        for a, name, noise in zip(recording.sources, names, noises)
    ]
    # it no longer agrees with its own file
    return replace(recording, sources=tuple(sources)).without_meta("installed")


def write_noise(path: File, noises: Mapping[str, SourceNoise], comments: Iterable[str]) -> None:
    """Write {name of a source: SourceNoise} as a file that `read_noise` reads. Raises DataError
    where it cannot be written."""
    lines = [f"# {comment}" for comment in comments]
    for name, noise in noises.items():
        said = f"  # {noise.said}" if noise.said else ""
        lines += ["", f"[{_quote_key(name)}]", f"{FACTOR} = {_factors_text(noise.factor)}{said}"]
        if noise.correlated is not None:
            lines.append(f"{CORRELATED} = {correlated_text(noise.correlated)}")
    with replacing(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def in_tables(correlated: Correlated, kind: str) -> Correlated:
    """Convert correlated errors of a kind of source from SI to the units of tables."""
    sizes = [shown_unit(quantity)[1] for quantity in find(kind).quantities]
    return correlated._replace(std=tuple(std * size for std, size in zip(correlated.std, sizes)))


def correlated_text(correlated: Correlated) -> str:
    """Return the value of the key `correlated` in TOML, for standard deviations in the units of
    tables."""
    std = ", ".join(f"{each:.4g}" for each in correlated.std)
    states = "" if correlated.states else ", states = false"
    return f"{{ std = [{std}], time = {correlated.time:.4g}{states} }}"


def _factors_text(factor: tuple[float, ...]) -> str:
    texts = [f"{each:.4g}" for each in factor]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"


def _quote_key(name: str) -> str:
    """Return a name as a key of TOML; the names of a Recording are printable, because they are
    checked."""
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _section(value: Any, where: str) -> dict[str, Any]:
    return read_table(value, KEYS, where)


def _factor(value: Any, where: str) -> tuple[float, ...]:
    values = items(value, where) if isinstance(value, list) else [value]
    return tuple(float(check_number(each, where, above=0, most=MAX_FACTOR)) for each in values)


def _read_correlated(value: Any, where: str) -> Correlated:
    return Correlated(**{"states": True} | read_table(value, OF_CORRELATED, where))


def _deviations(value: Any, where: str) -> tuple[float, ...]:
    values = items(value, where) if isinstance(value, list) else [value]
    return tuple(float(check_number(each, where, least=0)) for each in values)


def _time(value: Any, where: str) -> float:
    return float(check_number(value, where, "s", above=0, most=MAX_TIME_CONSTANT))


OF_CORRELATED = {
    "std": Key("std", _deviations, "write std = [1.5, 1.5, 3.0], in the units of tables"),
    "time": Key("time", _time, "write time = 30.0, in s"),
    "states": Key("states", flag),
}
KEYS = {FACTOR: Key("factor", _factor), CORRELATED: Key("correlated", _read_correlated)}
"""Keys of a section."""


def _with_noise(a: Source, noise: SourceNoise, where: str) -> Source:
    """Return a source with that noise. Raises DataError."""
    sizes = [shown_unit(quantity)[1] for quantity in find(a.kind).quantities]
    factor = _of_each(noise.factor, len(sizes), f"{where} {FACTOR}", a.kind)
    a = replace(a, std=a.std * factor)
    if noise.correlated is None:
        return a
    std = _of_each(noise.correlated.std, len(sizes), f"{where} {CORRELATED}, std", a.kind)
    if not any(std):
        raise DataError(f"{where} {CORRELATED}, std: none is above zero; leave {CORRELATED} out")
    si = tuple(each / size for each, size in zip(std, sizes))
    return replace(a, correlated=noise.correlated._replace(std=si))


def _of_each(values: tuple[float, ...], many: int, where: str, kind: str) -> tuple[float, ...]:
    """Return `many` values, which may be given as one. Raises DataError."""
    if len(values) not in (1, many):
        raise DataError(f"{where}: {len(values)} given; {kind} has {many}")
    return values * many if len(values) == 1 else values
