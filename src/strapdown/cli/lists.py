"""Lists of what there is: grades of IMUs, receivers, formats, plugins, and this installation."""

import os
import platform
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

import strapdown as sd

from ..extras import OPTIONAL, remedy
from . import complete
from .output import fit_lines, record, say, table, text_width


def imus(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            autocompletion=complete.imus,
            help="The grade, part or file to tell all about.  [default: the list of all]",
        ),
    ] = None,
) -> None:
    """List the IMU grades and parts with their main errors; or tell all about one."""
    from ..sensor_models.imu import imu, imu_parts, imus

    if name is None:
        header = (*(heading for heading, _ in MAIN_ERRORS),)
        table(("grade", *header), [_main_errors(each) for each in imus()])
        say()
        table(("part", *header), [_main_errors(part) for part in imu_parts()])
        say("\n`strapdown imus NAME` tells all about one, with its source.")
        record(grades=_sheets(imus()), parts=_sheets(imu_parts()))
        return
    spec = imu(name)
    sheet = {key: value for key, value in spec.datasheet().items() if value}
    say("\n".join(fit_lines(f"{spec.name}: {spec.source}", text_width(), "", "  ")))
    say()
    table(("error", "value"), [(key, f"{value:.4g}") for key, value in sheet.items()])
    record(name=spec.name, source=spec.source, datasheet=sheet)


MAIN_ERRORS = (
    ("gyro noise, deg/sqrt(h)", "gyro noise, deg/sqrt(h)"),
    ("turn-on, deg/h", "gyro turn-on bias, deg/h"),
    ("in run, deg/h", "gyro gauss markov, deg/h"),
    ("accel noise, m/s/sqrt(h)", "accel noise, m/s/sqrt(h)"),
    ("turn-on, mg", "accel turn-on bias, mg"),
    ("in run, mg", "accel gauss markov, mg"),
)
"""(heading, term of the data sheet) of the list."""


def _sheets(names: Iterable[str]) -> dict[str, dict[str, float]]:
    """{name: all terms of its data sheet}, with units in their names."""
    from ..sensor_models.imu import imu

    return {name: imu(name).datasheet() for name in names}


def _main_errors(name: str) -> tuple[str, ...]:
    from ..sensor_models.imu import imu

    sheet = imu(name).datasheet()
    return name, *(f"{sheet[term]:.4g}" if sheet[term] else "-" for _, term in MAIN_ERRORS)


def receivers() -> None:
    """List the GNSS receivers that can be simulated, with their standard deviations north, east,
    down."""
    from ..sensor_models.receiver import receiver_grade, receivers

    sheets = {name: receiver_grade(name).sheet() for name in receivers()}
    terms = next(iter(sheets.values()))
    table(
        ("", *sheets),
        [(term, *(sheet[term] or "-" for sheet in sheets.values())) for term in terms],
    )
    record(receivers=sheets)


def kits(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="The kit to print.  [default: the list of all]"),
    ] = None,
) -> None:
    """List the kits of vehicles; or print one, to be appended to a recording.toml and changed."""
    from ..io.vehicle_kits import vehicle_kit, vehicle_kits

    if name is None:
        about = {each: vehicle_kit(each).partition(":")[0].lstrip("# ") for each in vehicle_kits()}
        table(("kit", "for"), [(each, text) for each, text in about.items()])
        say("\n`strapdown kits NAME >> recording.toml` appends one.")
        record(kits=about)
        return
    text = vehicle_kit(name)
    say(text.rstrip("\n"))
    record(kit=name, text=text)


def plugins() -> None:
    """List what comes from outside the library: installed packages, STRAPDOWN_PLUGINS, --plugin."""
    from ..registration import registration_rows

    rows = registration_rows()
    if rows:
        table(PLUGIN_HEADER, rows)
    else:
        say("no plugins: nothing is installed, in STRAPDOWN_PLUGINS or given by --plugin")
    record(plugins=[dict(zip(PLUGIN_HEADER, row)) for row in rows])


PLUGIN_HEADER = "plugin", "from", "brings", "cannot be used"


def formats() -> None:
    """List the formats of recordings that are read, with their suffixes."""
    from ..io.registry import formats as known

    table(("suffix", "format"), [(", ".join(ends) or "any", what) for what, ends in known()])
    say()
    say(
        "A format is recognised by its content, and by its suffix where several could be meant. Files "
        "may be packed (.xz, .gz, .bz2, .zip)."
    )
    say(
        "Several files of logs or tables make one recording: "
        "`strapdown inspect imu.csv gnss.csv --write recording.toml`."
    )
    record(formats=[{"format": what, "suffixes": ends} for what, ends in known()])


def doctor() -> None:
    """Tell what is installed, compiled and found: the lines that a report of a fault should hold."""
    found: dict[str, list[str]] = {}
    for what, how in _of_installation():
        say("\n".join(fit_lines(f"{what:13} {how}", text_width(), "", " " * 14)))
        found.setdefault(what, []).append(how)
    record(installation=found)


WITH = {
    "numpy": "",
    "plotly": "",
    **{name: f"for {package.use}: {remedy(name)}" for name, package in OPTIONAL.items()},
    "strapdown-reproductions": "for `strapdown reproduce`: pip install ./reproductions",
}
"""{package: its use and how to install it, where one may do without}."""


def _of_installation() -> Iterator[tuple[str, str]]:
    """(what, how it is) of this installation."""
    from ..core.compile import library
    from ..io.locate import data_folder
    from ..registration import registration_rows

    yield "strapdown", f"{sd.__version__} in {os.path.dirname(sd.__file__)}"
    yield (
        "python",
        f"{platform.python_version()} on {platform.platform()}, {os.cpu_count()} processors",
    )
    there = {name: _version(name) for name in WITH}
    yield "packages", ", ".join(f"{name} {found}" for name, found in there.items() if found)
    for name, use in WITH.items():
        if not there[name]:
            yield "missing", f"{name}: {use or 'needed; install strapdown again'}"
    for line in library.describe_library():
        what, _, how = line.partition(": ")
        yield what, how
    if there["numba"]:
        yield "kernel cache", _kernel_cache()
    try:
        yield "data folder", str(data_folder())
    except sd.DataError as error:
        yield "data folder", f"none, which only some examples need: {error}"
    plugins = registration_rows()
    yield "plugins", ", ".join(row[0] for row in plugins) or "none"


def _kernel_cache() -> str:
    """Files and size of what this user's runs compiled."""
    from ..core.compile import kernel_cache

    kept = kernel_cache.folder()
    files = [path for path in kept.rglob("*") if path.is_file()] if kept and kept.is_dir() else []
    size = sum(path.stat().st_size for path in files) / 1e6
    return f"{len(files)} files, {size:.0f} MB in {kept or 'no folder: no home'}"


def _version(package: str) -> str:
    """The version of an installed package; empty where there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


COMMANDS = (imus, receivers, kits, formats, plugins, doctor)
"""In the order of `--help`."""
