"""strapdown.h: the structs, constants and functions of an exported filter, from the same tables of
fields as its object."""

import inspect
import re
from collections.abc import Iterator
from importlib.resources import files
from string import Template
from textwrap import wrap

from ... import aiding
from ...core.compile.records import notes
from ...core.compile.signatures import Row
from ...core.loop.contract import MeasurementModel
from ...core.mathematics import solution_row
from ...engine.prepare import augmented_states, axes_of_rows
from ...units import quantities
from .chosen import GIVEN, Chosen
from .layout import RECORDS, ExportLayout, MemoryPlace
from .texts import CLASSES, ENUMS, FIELDS, SIZES, ExportNames, Name

PREFIX = "STRAPDOWN_"
WIDTH = 100
PARAMETERS = {
    "": "it takes none",
    "antenna": "lever arm from the IMU to the antenna, m, body (3)",
    "reference": "lever arm from the IMU to the reference point of the vehicle, m, body (3)",
    "field": "magnetic field, T, NED (3)",
    "baseline": "vector from the first to the second antenna, m, body (3)",
    "drag": "drag coefficients of the rotors forward and to the right, 1/s (2), then 0",
}
"""Meanings of the parameters of a source, by `MeasurementModel.parameters`."""
MORE_PARAMETERS = {
    "": "",
    "direction": ", then the direction, a unit vector, body (3)",
    "beacon": ", then latitude and longitude, rad, and ellipsoidal height, m, of the beacon (3)",
    "atmosphere": ", then air pressure, Pa, and temperature, K, at a height, m (3); 0 is the ICAO atmosphere",
}
"""The same by `MeasurementModel.more_parameters`."""

QUANTITIES = {"length": "height", "speed": "velocity"}
"""Names of the quantities of a fix in the header."""


def template(name: str) -> Template:
    """One of the files beside this one."""
    return Template((files(__package__) / "templates" / name).read_text(encoding="utf-8"))


def header(of: Chosen, made: ExportLayout) -> str:
    """The text of strapdown.h."""
    sources = ExportNames(
        "strapdown_source_index",
        "SOURCE_",
        "The sources. y and std are what strapdown_fix takes, parameters what strapdown_source takes.",
        tuple(
            Name(identifier(name), i, source_text(aiding.find(a.kind)))
            for i, (a, name) in enumerate(zip(of.sources, of.names))
        ),
    )
    sizes = [(text[0], made.sizes[size], text[1]) for size, text in SIZES.items()]
    sizes.insert(0, ("PARAMETERS", GIVEN, "numbers that strapdown_source takes"))
    own = [
        Name(f"OWN_{i}" if i else "OWN", solution_row.NAV_WIDTH + i, text)
        for i, text in enumerate(columns(of))
    ]
    return template("strapdown.h").substitute(
        filter=of.filter.name,
        sources="\n   ".join(wrap(", ".join(of.names), WIDTH - 16)),
        sizes="\n".join(
            line for name, value, text in sizes for line in _constant(name, value, text)
        ).removesuffix(","),
        enums="\n\n".join(
            _enum(
                each._replace(constants=(*each.constants, *own))
                if each.name == "strapdown_row"
                else each
            )
            for each in (sources, *ENUMS)
        ),
        noise=_struct("noise", made, "    "),
        rows=_rows(made),
        records="\n".join(
            f"    strapdown_noise {record};"
            if record == "noise"
            else f"    struct {{\n{_struct(record, made, '        ')}\n    }} {record};"
            for record in RECORDS
        ),
    )


def identifier(name: str) -> str:
    """In upper case, as a part of a name in C."""
    return name.upper().replace("-", "_")


def columns(of: Chosen) -> list[str]:
    """Return the meaning of each column behind the status."""
    states = [each.name for each in augmented_states(of.sources)]
    return [*of.filter.columns, *states, *(f"standard deviation of {name}" for name in states)]


def source_text(sensor: MeasurementModel) -> str:
    """Return a description of its measurements and parameters, with units."""
    units = [quantities.si(quantities.dimension(q)) for q in sensor.quantities]
    words = QUANTITIES | ({"length": "vector"} if sensor.vector else {})
    named = [f"{words.get(q, q)} {unit}" for q, unit in zip(sensor.quantities, units)]
    count = len(named)
    y = f"{named[0]} ({count})" if len({*named}) == 1 and count > 1 else ", ".join(named)
    rows = [quantities.si(quantities.innovation_dimension(q)) for q in sensor.quantities]
    std = f"{rows[0]}, {', '.join(axes_of_rows(sensor))}" if count == 3 else rows[0]
    when = f"; hand one in only {sensor.when}" if sensor.when else ""
    frame = {"n": ", NED", "b": ", body"}.get(sensor.vector, "")
    zero = ": 0" if sensor.name.startswith("zero-") else ""
    return (
        f"y: {y}{frame}{zero}; std ({count}): {std}; parameters: "
        f"{PARAMETERS[sensor.parameters]}{MORE_PARAMETERS[sensor.more_parameters]}{when}"
    )


def comment(text: str, indent: str = "") -> list[str]:
    """Lines of a comment."""
    lines = wrap(text, WIDTH - len(indent) - 6)
    return [f"{indent}{'/* ' if not i else '   '}{line}" for i, line in enumerate(lines[:-1])] + [
        f"{indent}{'/* ' if len(lines) == 1 else '   '}{lines[-1]} */"
    ]


def _constant(name: str, value: int, text: str) -> Iterator[str]:
    yield from comment(text, "    ")
    yield f"    {PREFIX}{name} = {value},"


def _enum(names: ExportNames) -> str:
    lines = [*comment(names.text), f"enum {names.name} {{"]
    for each in names.constants:
        lines += _constant(names.prefix + each.name.removeprefix("ROW_"), each.value, each.text)
    lines[-1] = lines[-1].removesuffix(",")
    return "\n".join([*lines, "};"])


def _struct(record: str, made: ExportLayout, indent: str) -> str:
    """The fields of a record; of what takes no room only a line."""
    lines: list[str] = []
    for place in made.of(record):
        if place.length == 0:
            continue
        kind = "double" if place.real else "int64_t"
        lines += comment(FIELDS[record][place.name], indent)
        kind = kind if place.row is None else type_name(place.row)
        lines.append(f"{indent}{kind} {place.name}{'' if place.single else _shape(place)};")
    return "\n".join(lines)


def type_name(row: Row) -> str:
    """Return the name of a row's type in C."""
    words = re.findall("[A-Z][a-z]*", row.name)
    return "strapdown_" + "_".join(words).lower() + ("" if words[-1] == "Row" else "_row")


def _rows(made: ExportLayout) -> str:
    """The structs of the tables that there are."""
    found = {place.row: None for place in made.places if place.row and place.length}
    return "\n\n".join(map(_row, found))


def _row(row: Row) -> str:
    made = CLASSES[row.name]
    text = inspect.getdoc(made) or ""
    lines = [*comment(" ".join(text.split())), "typedef struct {"]
    for name, real, shape in row.fields:
        lines += comment(notes(made)[name], "    ")
        sizes = "".join(f"[{size}]" for size in shape)
        lines.append(f"    {'double' if real else 'int64_t'} {name}{sizes};")
    return "\n".join([*lines, f"}} {type_name(row)};"])


def _shape(place: MemoryPlace) -> str:
    """In brackets, sizes that have a name in C by that."""
    return "".join(
        f"[{PREFIX}{SIZES[declared][0]}]" if declared in SIZES else f"[{size}]"
        for declared, size in zip(place.sizes, place.shape)
    )
