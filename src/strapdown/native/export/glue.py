"""strapdown_calls.c, which passes samples and fixes to the object of an exported filter, with the
start of the filter as assignments."""

from collections.abc import Iterator, Mapping

from ... import aiding
from ...core.loop.contract import InitialState, Noise
from ...core.loop.log import FOLD
from ...core.loop.loop import SAME_TIME
from ...core.mathematics.earth import LATITUDE_LIMIT
from ...preprocessing.imu_samples import MAX_INTERVAL
from ...units.constants import MAX_PAUSE
from .chosen import Chosen
from .header import template
from .image import Image, Known
from .layout import MemoryPlace

HERE = {"C_nb": "C[{}]", "variance": "variance[{}]", "t": "values->t"}
"""Parts of a start that C computes or has as one number; others are arrays of strapdown_values."""


def glue(of: Chosen, made: Image, format: str) -> str:
    """The text of strapdown_calls.c; `format` marks what it saves, in hexadecimal."""
    components = (len(aiding.find(a.kind).quantities) for a in of.sources)
    return template("strapdown_calls.c").substitute(
        most_latitude=repr(LATITUDE_LIMIT),
        longest_sample=repr(MAX_INTERVAL),
        longest_gap=repr(MAX_PAUSE),
        same_time=repr(SAME_TIME),
        same_event=repr(FOLD),
        example="\n".join(_example(of.start, of.noise)),
        format=f"0x{format}",
        components=", ".join(map(str, components)),
        noise_possible="\n".join(_noise_possible()),
        fixed="".join(f"{line}\n" for line in _refuse_other_start(made)),
        constants="\n".join(_assignments(made.constants, _number)),
        copies="\n".join(_assignments(made.copies, _value_text)),
    )


def _example(start: InitialState, noise: Noise) -> Iterator[str]:
    for name in ("t", "lla", "v_n", "rph", "b_a", "b_g", "std"):
        value = getattr(start, name)
        numbers = [value] if name == "t" else list(value[:15])
        listed = ", ".join(repr(float(each)) for each in numbers)
        yield f"    .{name} = {listed if name == 't' else f'{{{listed}}}'},"
    yield f"    .noise = {{{', '.join(map(repr, map(float, noise)))}}},"


def _noise_possible() -> Iterator[str]:
    tested = " && ".join(
        f"finite(values->noise.{name}) && values->noise.{name} >= 0" for name in Noise._fields
    )
    tested += " && values->noise.held <= 1"
    yield f"    if (!({tested}))".replace(
        " && values->noise.gyro >=", "\n          && values->noise.gyro >=", 1
    )
    yield "        return 0;"


def _refuse_other_start(made: Image) -> Iterator[str]:
    """Refuses a start that differs where the image holds only for one."""
    for part in made.fixed:
        parts = [f"noise.{name}" for name in Noise._fields]
        if part != "noise":
            parts = [f"{part}[{i}]" for i in range(3)]
        for name in parts:
            yield f"    if (values->{name} != strapdown_example.{name})"
            yield "        return STRAPDOWN_FIXED;"


def _assignments(
    numbers: Mapping[MemoryPlace, Mapping[int, object]], text: object
) -> Iterator[str]:
    for place, values in numbers.items():
        for k, value in values.items():
            yield f"    filter->{place.record}.{place.name}{place.within(k)[0]} = {text(value)};"  # type: ignore[operator]


def _number(value: float) -> str:
    if value in (float("inf"), float("-inf")):
        return "INFINITE.number" if value > 0 else "-INFINITE.number"
    if value != value:
        return "NOT_MEASURED.number"
    return repr(value)


def _value_text(value: Known) -> str:
    if value.part in HERE:
        return HERE[value.part].format(value.at)
    if value.part == "noise":
        return f"values->noise.{Noise._fields[value.at]}"
    return f"values->{value.part}[{value.at}]"
