"""The pages of `--help` beside the options: commands by task, options in groups, examples, the page
with details. Light, since every start loads it."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from ..plugins import TITLE as PLUGINS_PAGE
from .output import command_output, fit_lines, text_width


class About(NamedTuple):
    """A command in the lists of `--help`."""

    task: str  # heading below which the command itself lists it
    short: str  # what one does with it, in a line
    page: str  # of the documentation, its title
    examples: tuple[tuple[str, str], ...]  # (what it does, command line)


LOG, SENSORS, SIMULATION, MORE = (
    "From a log to a page",
    "Sensors and their installation",
    "Simulation and studies",
    "Lists, results and firmware",
)
ABOUT = {
    "inspect": About(
        LOG,
        "see what a log holds and what is wrong with it",
        "Check a recording for set-up errors",
        (
            ("What a log holds, and what is wrong with it", "strapdown inspect flight.ulg"),
            (
                "Two tables, and a draft of their description",
                "strapdown inspect imu.csv gnss.csv --write recording.toml",
            ),
            ("The second IMU of a log", "strapdown inspect flight.bin --imu 1"),
        ),
    ),
    "fuse": About(
        LOG,
        "position, velocity and attitude of a log, as a page and tables",
        "Fuse a recording",
        (
            (
                "A log to a page, with the default filter",
                "strapdown fuse flight.ulg --imu industrial",
            ),
            (
                "Without the fixes of half a minute, and GPX beside the rest",
                "strapdown fuse drive.nc --hide 120:150 --also gpx --out tunnel",
            ),
        ),
    ),
    "compare": About(
        LOG,
        "filters side by side in the same GNSS outages",
        "Compare filters on the same outages",
        (
            (
                "Two filters, 30 s without GNSS in every 300 s",
                "strapdown compare flight.nc --filters closed-loop,nlo --outages 30/300",
            ),
            (
                "Windows of 10 and 20 s all over the flight, options of a filter",
                "strapdown compare flight.nc --filters closed-loop,periodic-reset:interval=60 "
                "--outages 10,20@120:280/20",
            ),
        ),
    ),
    "diagnose": About(
        LOG,
        "clock, lever arm, mounting, odometer scale: what is wrong",
        "Diagnose clock, lever arm and mounting errors",
        (
            ("What of the installation is wrong", "strapdown diagnose recording.toml"),
            ("Of a part of the log", "strapdown diagnose drive.nc --from 60 --to 600"),
        ),
    ),
    "live": About(
        LOG,
        "the same filters on what sensors send now",
        "Run a filter on live data: strapdown live",
        (
            ("Ports, sources and outputs from a file", "strapdown live vehicle.toml"),
            ("For ten minutes", "strapdown live vehicle.toml --seconds 600"),
            ("With a page in the browser", "strapdown live vehicle.toml --page 8765"),
        ),
    ),
    "allan": About(
        SENSORS,
        "how good an IMU is, from a record at rest",
        "Measure IMU noise: Allan deviation",
        (
            ("Noise of an IMU that lay still", "strapdown allan parked.nc --out allan"),
            ("Only the quiet part", "strapdown allan parked.csv --from 10 --to 3600"),
        ),
    ),
    "calibrate": About(
        SENSORS,
        "magnetometer, accelerometer, or the installation",
        "Calibrate accelerometer and magnetometer",
        (
            (
                "The magnetometer, from a flight with turns",
                "strapdown calibrate recording.toml --from 240 --to 575",
            ),
            (
                "The accelerometer, from a dozen rests",
                "strapdown calibrate rests.csv --sensor accelerometer",
            ),
        ),
    ),
    "calibrate installation": About(
        SENSORS,
        "clocks, lever arms, mounting and scale, from a log",
        "Estimate lever arms, clock offsets and mounting",
        (
            (
                "What is wrong, with a page",
                "strapdown calibrate installation recording.toml --out page",
            ),
            (
                "The same, written into the description",
                "strapdown calibrate installation recording.toml --write",
            ),
        ),
    ),
    "tune": About(
        SENSORS,
        "the noise of IMU and receivers, from a log",
        "Tune the noise from a log",
        (
            ("Files for --imu and --sources", "strapdown tune drive.nc --out noise"),
            (
                "To use them",
                "strapdown fuse drive.nc --imu noise/drive-imu.toml --sources noise/drive-sources.toml",
            ),
            ("Into the description itself", "strapdown tune recording.toml --write"),
        ),
    ),
    "demo": About(
        SIMULATION,
        "a simulated flight and its page, in a second",
        "Read the report and save solutions",
        (
            ("A page of ten minutes of flight", "strapdown demo"),
            ("Another flight's noise, a worse IMU", "strapdown demo --seed 8 --imu industrial"),
        ),
    ),
    "simulate": About(
        SIMULATION,
        "a recording whose truth is known",
        "Simulate a recording",
        (
            ("A drive", "strapdown simulate car --seed 3 --duration 60 --out car.nc"),
            (
                "Your own scenario with a grade of IMU",
                "strapdown simulate climb.toml --imu consumer --out climb.nc",
            ),
        ),
    ),
    "study": About(
        SIMULATION,
        "filters over many simulated runs, with intervals",
        "Run a Monte Carlo study",
        (
            (
                "Two filters with two IMUs, three runs each",
                "strapdown study demo --imu tactical --imu industrial --filter closed-loop --filter "
                "open-loop --runs 3",
            ),
            (
                "A wrong installation that is estimated",
                "strapdown study car --filter closed-loop:estimate=clock+lever-arm --installation "
                "clock=0.1,lever-arm=0.5 --out installed",
            ),
        ),
    ),
    "advise": About(
        SIMULATION,
        "which loop suits your IMU and mission",
        "Open loop, resets or closed loop?",
        (
            (
                "A tactical IMU, an hour and a half of circuits",
                "strapdown advise --imu tactical --flight dynamic --duration 90min",
            ),
            (
                "The short answer",
                "strapdown advise --imu consumer --flight car --duration 10min --quick --out short",
            ),
        ),
    ),
    "fly": About(
        SIMULATION,
        "an aircraft that flies on a filter's estimates",
        "Fly an aircraft on a filter's estimates",
        (
            ("Turns without GNSS from 15 s on", "strapdown fly turning --outage 15: --out cut"),
            (
                "Another filter, wind and turbulence",
                "strapdown fly straight --filter ukf --wind 3,-2 --turbulence light",
            ),
        ),
    ),
    "filters": About(
        MORE,
        "the filters, and all about one",
        "Filters",
        (
            ("What each is good for", "strapdown filters"),
            ("Options, states and needs of one", "strapdown filters closed-loop"),
        ),
    ),
    "imus": About(
        MORE,
        "grades of IMUs and their error terms",
        "Describe an IMU",
        (("All grades", "strapdown imus"),),
    ),
    "receivers": About(
        MORE,
        "GNSS receivers that can be simulated",
        "Simulate a recording",
        (("All receivers", "strapdown receivers"),),
    ),
    "kits": About(
        MORE,
        "constraints of vehicles, to be appended to a description",
        "Start from a vehicle kit",
        (
            ("All kits", "strapdown kits"),
            ("That of a car", "strapdown kits car"),
        ),
    ),
    "formats": About(
        MORE,
        "formats of logs and tables that are read",
        "Read the log of a device",
        (("All formats", "strapdown formats"),),
    ),
    "doctor": About(
        MORE,
        "what is installed, compiled and found",
        "Troubleshooting",
        (("This installation", "strapdown doctor"),),
    ),
    "plugins": About(
        MORE,
        "what comes from outside the library",
        PLUGINS_PAGE,
        (
            ("What is installed", "strapdown plugins"),
            ("With a file of your own", "strapdown --plugin my_filter.py plugins"),
        ),
    ),
    "reproduce": About(
        MORE,
        "published and recorded results, run again",
        "Claims of four papers, tested",
        (
            ("Every filter on every recording", "strapdown reproduce recordings --out recordings"),
            ("A paper's study, in a minute", "strapdown reproduce hager-bryne --quick --out paper"),
        ),
    ),
    "export": About(
        MORE,
        "a filter as C code for firmware",
        "Export a filter as C for firmware",
        (
            (
                "For a Cortex-M7",
                "strapdown export --sources position,velocity --target cortex-m7 --out firmware",
            ),
            (
                "For this machine, the example replays a log",
                "strapdown export --sources position --target host --replay flight.nc --out exported",
            ),
        ),
    ),
}
"""{command: what `--help` tells of it}, in the order of the lists."""
INPUT, OTHERS = "Input", "Options"
GROUPS = {
    INPUT: "recorded imu gnss sources take vehicle from to hide heading sensor imu-clock recordings scenario "
    "flight duration outage outages kinds replay installation",
    "Filter": "filter filters option estimate robust adaptive ahrs ahrs-rate smooth follow every correlated "
    "alignment target waiting",
    "Aircraft": "aircraft feedback prediction turbulence wind barometer",
    "Runs": "runs seed quick ablations workers scheduler",
    "Output": "page terminal out also utc origin figures write map diagnose strict json quiet help",
}
"""{heading: names of options}; those of no heading come last."""
ENDS = """Exit codes: 0 done; 1 a fault of strapdown itself; 2 bad input; 3 something is wrong or not \
trusted; 130 interrupted."""


WIDEST = 80
"""Columns that help takes at most."""
NAMES = 26
"""Columns of the names in a list; longer ones stand in a line of their own."""
NARROW = 60
"""Columns below which every name stands in a line of its own."""


def _list_lines(rows: Sequence[tuple[str, str]], width: int) -> Iterator[str]:
    """The lines of a list of (name, text)."""
    column = 2 + min(max(len(name) for name, _ in rows), NAMES)
    beside = width >= NARROW
    column = column + 2 if beside else 4
    for name, text in rows:
        if not text:
            yield f"  {name}"
        elif beside and len(name) + 4 <= column:
            yield from _fit_help(text, width, f"  {name}".ljust(column), " " * column)
        else:
            yield f"  {name}"
            yield from _fit_help(text, width, " " * column, " " * column)


def _fit_help(text: str, width: int, indent: str, further: str) -> list[str]:
    """The lines of a text; a short default stays in one."""
    kept = re.sub(r"\[default: .{,24}\]$", lambda found: found[0].replace(" ", KEPT), text)
    return [line.replace(KEPT, " ") for line in fit_lines(kept, width, indent, further)]


TYPES = {"<path>": "PATH", "<int>": "N", "<float>": "X", "<str>": "NAME"}
"""{what typer calls the value of an option: what people do}."""


def _groups(command: Any, ctx: Any, width: int) -> Iterator[str]:
    """The lines of arguments and options, in groups."""
    found: dict[str, list[tuple[str, str]]] = {heading: [] for heading in (*GROUPS, OTHERS)}
    heading_of = {name: heading for heading, names in GROUPS.items() for name in names.split()}
    for parameter in command.get_params(ctx):
        record = parameter.get_help_record(ctx)
        if record and parameter.param_type_name == "argument":
            about = record[1].removesuffix("[required]").strip()  # as the usage says
            found[INPUT].append((parameter.metavar or record[0], about))
        elif record:
            name = parameter.opts[0].removeprefix("--")
            found[heading_of.get(name, OTHERS)].append((_names(parameter, record[0]), record[1]))
    for heading, records in found.items():
        if records:
            yield from ("", f"{heading}:", *_list_lines(records, width))


def _names(parameter: Any, names: str) -> str:
    """The names of an option and its value, with dots where it may be repeated."""
    for ours, theirs in TYPES.items():
        names = names.replace(ours, theirs)
    return names + "..." * (parameter.multiple and not names.endswith("..."))


def _example(line: str, width: int) -> str:
    """A command line, which goes on before an option."""
    kept = re.sub(r"(--\S+) (?!-)", rf"\1{KEPT}", line)
    return " \\\n".join(fit_lines(kept, width - 2, "  ", "      ")).replace(KEPT, " ")


KEPT = "\xa0"
"""A blank at which no line is broken."""


def _shown_width() -> int:
    return min(text_width(), WIDEST)


class Command(TyperCommand):
    """A command whose help has its options in groups, examples and a page, and whose output is shown
    as `output.command_output` says."""

    quiet = False

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.params += [each for each in _of_output() if self.quiet or each.name == "json"]

    def invoke(self, ctx: Any) -> Any:
        """As click asks."""
        as_json, quiet = ctx.params.pop("json"), ctx.params.pop("quiet", False)
        with command_output(ctx.command_path.removeprefix("strapdown "), as_json, quiet):
            return super().invoke(ctx)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """As click asks; names that are required stand without braces."""
        return [
            piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)
        ]

    def usages(self, ctx: Any) -> list[str]:
        """Lines of a call."""
        return [" ".join([ctx.command_path, *self.collect_usage_pieces(ctx)])]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """As click asks; no word of it is broken."""
        width = _shown_width()
        for before, line in zip(("Usage: ", *[" " * 7] * 9), self.usages(ctx)):
            formatter.write("\n".join(fit_lines(line, width, before, " " * 9)) + "\n")
        lines = ["", *fit_lines(" ".join((self.help or "").split()), width)]
        lines += _groups(self, ctx, width)
        if about := ABOUT.get(ctx.command_path.removeprefix("strapdown ")):
            lines += ["", "Examples:"]
            for what, line in about.examples:
                lines += fit_lines(f"# {what}", width, "  ", "  # ")
                lines.append(_example(line, width))
            lines += ["", *fit_lines(f'More: the page "{about.page}" of the documentation.', width)]
        formatter.write("\n".join(lines) + "\n")


class ResultCommand(Command):
    """A command with a result, which --quiet reduces to its verdict."""

    quiet = True


@cache
def _of_output() -> list[Any]:
    """The options that every command has, made by typer as those of a function are."""
    made = typer.Typer(add_completion=False)

    @made.command()
    def options(
        json: Annotated[
            bool, typer.Option("--json", help="One JSON document on standard output.")
        ] = False,
        quiet: Annotated[
            bool, typer.Option("--quiet", help="Print the verdict and errors alone.")
        ] = False,
    ) -> None:
        """Options alone."""

    return [*typer.main.get_command(made).params]


class Commands(TyperGroup):
    """The command itself: its help lists the commands by task."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """As click asks."""
        width, there = _shown_width(), self.list_commands(ctx)
        lines = [
            *fit_lines(f"{ctx.command_path} [OPTIONS] COMMAND [ARGS]...", width, "Usage: "),
            "",
        ]
        lines += fit_lines(" ".join((self.help or "").split()), width)
        longest = max(map(len, there))
        for task in (LOG, SENSORS, SIMULATION, MORE):
            rows = [
                (name.ljust(longest), about.short)
                for name, about in ABOUT.items()
                if about.task == task and name in there
            ]
            lines += ["", f"{task}:", *_list_lines(rows, width)]
        records = [each.get_help_record(ctx) for each in self.get_params(ctx)]
        lines += ["", f"{OTHERS}:", *_list_lines([each for each in records if each], width), ""]
        lines += fit_lines(
            "`strapdown COMMAND --help` has the options and examples of a command, the page "
            '"Use the command line" of the documentation more.',
            width,
        )
        lines += fit_lines(ENDS, width)
        formatter.write("\n".join(lines) + "\n")
