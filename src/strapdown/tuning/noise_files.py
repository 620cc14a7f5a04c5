"""The files of a Tuning: a description of the IMU, the noise of the sources, and a recording.toml
that is changed to have both."""

import datetime
import os
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..checks import DataError
from ..data.recording import Recording
from ..fileio.files import together
from ..io.description.found import Change
from ..io.description.rewriting import check_writable
from ..io.description.rewriting_noise import (
    CORRELATED,
    GRADE,
    NoiseEdit,
    change_noise,
    scaled_deviations,
)
from ..io.noise_file import SourceNoise, correlated_text, in_tables, write_noise
from ..sensor_models.imu import ImuSpec
from ..typing import Array
from .numbers import IMU, TIME, WHITE

if TYPE_CHECKING:
    from .findings import NoiseParameter, Tuning

COMMAND = "tune"


def name_of(recording: Recording) -> str:
    """The beginning of the names of the files of a recording."""
    return Path(str(recording.meta.get("name") or "recording")).name


def imu_file(recording: Recording) -> str:
    """Name of the file that describes the IMU."""
    return f"{name_of(recording)}-imu.toml"


def sources_file(recording: Recording) -> str:
    """Name of the file with the noise of the sources."""
    return f"{name_of(recording)}-sources.toml"


def check_absent(*paths: Path) -> None:
    """Refuse to write where a file is already. Raises DataError."""
    for path in paths:
        if os.path.lexists(path):
            raise DataError(
                f"{path}: exists already and is not overwritten; move it away, or choose another "
                "folder"
            )


def write(found: "Tuning", folder: Path) -> list[Path]:
    """Write the IMU and the noise of the sources into a folder; the paths. Raises DataError."""
    imu, sources = folder / imu_file(found.recording), folder / sources_file(found.recording)
    check_absent(imu, sources)
    comments = [
        f"Noise of the sources, {_origin(found)}.",
        f"Use: strapdown fuse RECORDING --imu {imu.name} --sources {sources.name}",
        "std_factor multiplies the standard deviations of a source. correlated can be copied into a "
        "recording.toml.",
    ]
    with together():
        describe_imu(found).to_toml(imu)
        write_noise(sources, _noises(found), comments)
    return [imu, sources]


def describe_imu(found: "Tuning") -> ImuSpec:
    """The IMU as found, with its name and where its numbers are from."""
    of_imu = [each for each in found.parameters if each.source == IMU]
    said = "; ".join(
        f"{each.name} 95 % {each.interval} {each.unit}"
        if each.interval
        else f"{each.name} not decided"
        for each in of_imu
    )
    return replace(
        found.imu,
        name=f"{name_of(found.recording)}-tuned",
        source=f"{_origin(found)}{said and ': '}{said}",
    )


def _origin(found: "Tuning") -> str:
    start, stop = found.seconds
    date = datetime.date.today().isoformat()
    return f"found by strapdown tune on {date} in {name_of(found.recording)}, {start:.1f} to {stop:.1f} s"


def _noises(found: "Tuning") -> dict[str, SourceNoise]:
    """Return the changes to the noise of the sources, by name. Raises DataError where two have one
    name."""
    noises: dict[str, SourceNoise] = {}
    for number, (old, new) in enumerate(zip(found.recording.sources, found.tuned.sources)):
        name = old.name or old.kind
        if name in noises:
            raise DataError(
                f"two sources are called {name}; give them different names, so that the file "
                "identifies each"
            )
        factors = _factors(found, number)
        one = factors[:1] if len(set(factors)) == 1 else factors
        lasting = new.correlated if new.correlated != old.correlated else None
        shown = None if lasting is None else in_tables(lasting, old.kind)
        if shown is not None or set(factors) != {1.0}:
            noises[name] = SourceNoise(one, shown, _std_comment(found, name))
    return noises


def _factors(found: "Tuning", number: int) -> tuple[float, ...]:
    """By which the standard deviations of a source have changed, by row."""
    old, new = (
        np.asarray(each.sources[number].std, float) for each in (found.recording, found.tuned)
    )
    with np.errstate(all="ignore"):
        ratio = np.where((old > 0) & np.isfinite(old), new / old, np.nan)
    return tuple(_median(column) for column in ratio.T)


def _median(ratio: Array) -> float:
    """Four digits of the median, as files have it; 1 without any."""
    known = ratio[np.isfinite(ratio)]
    return float(f"{np.median(known):.4g}") if known.size else 1.0


def _std_comment(found: "Tuning", source: str) -> str:
    """Return the comment on the standard deviations of a source: factors with their intervals."""
    own = [p for p in found.parameters if p.source == source and p.what is WHITE]
    told = [f"{p.part} {_times(p)}".strip() for p in own if p.given]
    return f"95 % {', '.join(told) or 'not decided'}"


def _times(noise: "NoiseParameter") -> str:
    """The interval of a factor."""
    low = f"{noise.low / noise.given:.3g}" if noise.low > 0 else "0"
    high = f"{noise.high / noise.given:.3g} times" if noise.high < inf else "any factor"
    return f"{low} to {high}"


def difference(found: "Tuning", path: Path) -> list[str]:
    """The lines of a recording.toml that `change` would change. Raises DataError."""
    edits = _edits(found, path)
    return _change(found.recording).lines(path, edits)


def change(found: "Tuning", path: Path) -> tuple[Path, Path]:
    """Change a recording.toml and write the IMU file beside it; (that, the copy of the old file).
    Raises DataError, and then nothing is changed."""
    imu = path.with_name(imu_file(found.recording))
    check_absent(imu)
    edits = _edits(found, path)
    with together():
        describe_imu(found).to_toml(imu)
        kept = _change(found.recording).write(path, edits)
    return imu, kept


def check_changeable(recording: Recording, path: Path) -> None:
    """Refuse what is no recording.toml, or has other values than the recording was read with.
    Raises DataError."""
    _change(recording).check(path)
    check_writable(path)


def _edits(found: "Tuning", path: Path) -> list[NoiseEdit]:
    """Return the edits to a recording.toml. Raises DataError where it is another file."""
    check_changeable(found.recording, path)
    named = f'"{imu_file(found.recording)}"'
    edits = [NoiseEdit(None, GRADE, (named,), "95 % intervals in that file")]
    for number, (old, new) in enumerate(zip(found.recording.sources, found.tuned.sources)):
        name, factors = old.name or old.kind, _factors(found, number)
        if set(factors) != {1.0}:
            edits.append(scaled_deviations(path, number, factors, _std_comment(found, name)))
        if new.correlated is not None and new.correlated != old.correlated:
            text = correlated_text(in_tables(new.correlated, old.kind))
            times = [p.interval for p in found.parameters if (p.source, p.what) == (name, TIME)]
            said = f"95 % time {f'{times[0]} s' if any(times) else 'not decided'}"
            edits.append(NoiseEdit(number, CORRELATED, (text,), said))
    return edits


def _change(recording: Recording) -> Change:
    return Change(recording, COMMAND, change_noise)
