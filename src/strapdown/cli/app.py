"""The command line. Bad input ends in one line on standard error and exit code 2; what is found
wrong by `inspect`, or is not trusted with --strict, in 3; Ctrl-C in one line and 130; nothing is left
half-written."""

import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn, TypedDict

import typer

import strapdown as sd

from ..checks import brief
from ..extras import name_extra
from ..units.wording import count_text
from . import calibrate, compare, diagnose, export, filters, fly, lists, simulation, tune
from .console import (
    ADAPTIVE,
    AHRS,
    ESTIMATE,
    FILTER,
    FROM,
    GRADE,
    IMU,
    MAP,
    NOT_TRUSTED,
    OPTION,
    ROBUST,
    SOURCES,
    STRICT,
    TAKE,
    TO,
    VEHICLE,
    WRITE,
    Progress,
    asked_imu,
    check_draft,
    end,
    estimates,
    grade_of,
    instances,
    memories,
    option_values,
    print_errors,
    print_outages,
    print_verdicts,
    read_given,
    recording_argument,
    results_folder,
    robust_sources,
    save_draft,
    save_page,
    summarise,
    with_figures,
)
from .help import Command, Commands, ResultCommand
from .live.command import live
from .output import (
    INTERRUPTED,
    complain,
    give_up_output,
    note,
    open_standard_streams,
    record,
    say,
    say_verdict,
    spell_for,
    wrote,
)

if TYPE_CHECKING:
    from ..engine.options import RunOptions
    from ..evaluation.protection import ProtectionLevels
    from ..io.inspection import Inspection
    from ..pages.shell import Page

app = typer.Typer(
    cls=Commands,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Aided inertial navigation from IMU, GNSS and other records, with uncertainties.",
)


def main() -> None:
    """Entry point of the command `strapdown`."""
    if len(sys.argv) == 1:
        sys.argv.append("--help")
    sys.unraisablehook = _again
    open_standard_streams()
    for stream in (sys.stdout, sys.stderr):
        spell_for(stream)
    warnings.showwarning = _warn
    try:
        # typer takes Ctrl-C for itself and returns the code, as it does that of an Exit
        try:
            code = app(standalone_mode=False, prog_name="strapdown")
        finally:  # here a full disk is refused, at the end of Python it no longer is
            sys.stdout.flush()
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if code:
            raise SystemExit(code)
    except (KeyboardInterrupt, typer.Abort):
        _stop("interrupted; files written so far are whole, nothing is half-written", INTERRUPTED)
    except Exception as error:
        # usage errors of typer's own, whichever click it carries
        if hasattr(error, "format_message"):
            context = getattr(error, "ctx", None)
            _stop(
                error.format_message()
                + (f" See `{context.command_path} --help`." if context else "")
            )
        if isinstance(error, sd.DataError):
            _stop(str(error))
        if told := name_extra(error):
            _stop(str(told))
        if isinstance(error, MemoryError):
            _stop("memory ran out; take a part of the recording, or a larger machine")
        if isinstance(error, OSError):
            _refuse_system(error)
        raise


def _refuse_system(error: OSError) -> NoReturn:
    """End with what the system refuses: a file of a name, or else standard output."""
    what = "standard output" if error.filename is None else brief(str(error.filename))
    give_up_output()
    _stop(
        f"{what}: cannot be used ({error.strerror or error}); make room there, or choose another place"
    )


def _again(raised: "sys.UnraisableHookArgs") -> None:
    """Ctrl-C that fell into the clean-up of an object, where Python only reports exceptions:
    give it once more, a little later."""
    if not issubclass(raised.exc_type, KeyboardInterrupt):
        return sys.__unraisablehook__(raised)
    threading.Timer(0.02, signal.raise_signal, (signal.SIGINT,)).start()


def _warn(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    """A warning that is meant for the user as a line; others as Python shows them."""
    if category.__name__ == "PluginWarning":
        complain(f"strapdown: {message}")
    else:
        _python_warns(message, category, *place, **more)


_python_warns = warnings.showwarning


def _stop(message: str, code: int = 2) -> NoReturn:
    with suppress(OSError):  # of a standard error that is full
        complain("strapdown: " + message.replace("\n", " "))
    raise SystemExit(code)


def _version(context: typer.Context, given: typer.CallbackParam, wanted: bool) -> bool:
    """Handle --version and --verbose: answer when both are known, before typer looks at any other
    option, for which it loads pydantic."""
    said = {**context.params, given.name: wanted}
    if {"version", "verbose"} <= said.keys():
        if said["version"]:
            print(f"strapdown {sd.__version__}")
            if said["verbose"]:
                from ..core.compile import library

                print("\n".join(library.describe_library()))
            raise typer.Exit()
        if said["verbose"]:
            context.fail("--verbose goes with --version.")
    return wanted


@app.callback()
def options(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print the version and end."
        ),
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            callback=_version,
            is_eager=True,
            help="With --version: also where the kernels come from.",
        ),
    ] = False,
    plugin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="Python file or module; see `strapdown plugins`.",
        ),
    ] = None,
    max_size: Annotated[
        float | None,
        typer.Option(metavar="GB", help="Largest content of a file that is read, unpacked."),
    ] = None,
    pipes: Annotated[
        bool, typer.Option("--pipes", help="Read also pipes, as of <(zcat imu.csv.gz).")
    ] = False,
    inside: Annotated[
        bool,
        typer.Option("--inside", help="Refuse files outside the folder of a description."),
    ] = False,
) -> None:
    """Options of the command itself."""
    from ..fileio.limits import reading_limits

    changes: dict[str, float | bool] = {"pipes": pipes, "outside": not inside}
    if max_size is not None:
        changes["size"] = 1e9 * max_size
    context.with_resource(reading_limits(**changes))
    if plugin:
        from ..plugins import name_plugins

        name_plugins(plugin)


@app.command(cls=ResultCommand)
@with_figures
def demo(
    out: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"),
    seed: Annotated[int, typer.Option(help="Seed of the random errors.")] = 7,
    imu: GRADE = "tactical",
    recorded: Annotated[
        bool,
        typer.Option("--recorded", help="Take a recorded drive from the package."),
    ] = False,
    map: MAP = False,
) -> None:
    """Simulate a 10-minute flight, or take a recorded drive, fuse it open and closed loop, print the
    errors and write a page."""
    shown = _recorded_demo() if recorded else _simulated_demo(imu, seed)
    say(shown.about)
    record(about=shown.about, window_s=shown.window)
    truth = shown.recording.reference
    assert truth is not None  # as of all that is simulated, and of the drive
    with results_folder(out.parent), Progress() as progress:
        solutions = {
            name: sd.fuse(
                shown.recording,
                name,
                imu=shown.imu,
                notify=progress.notify,
                progress=progress.track(name),
            )
            for name in ("closed-loop", "open-loop")
        }
        print_verdicts({name: solution.verdict for name, solution in solutions.items()})
        print_errors(solutions, truth, shown.window)
        title = f"strapdown demo: {shown.title}"
        save_page(sd.report(solutions, truth, title, window=shown.window, map=map), out)


class _Demo(NamedTuple):
    """A recording and what `demo` says of it."""

    recording: "sd.Recording"
    imu: str | None  # None: the recording names it
    window: tuple[float, float]  # s that are scored
    about: str
    title: str


def _simulated_demo(imu: str, seed: int) -> _Demo:
    from ..sim.trajectory import demo_flight

    about = f"simulated flight: 600 s, {imu} IMU at 100 Hz, GNSS position and velocity at 1 Hz, seed {seed}"
    flight = sd.simulate(demo_flight(), 600.0, imu, seed)
    return _Demo(flight, imu, (120.0, 600.0), about, "a simulated 10-minute flight")


DEMO_OUTAGES = ((200.0, 215.0), (320.0, 335.0), (440.0, 455.0))
"""Windows (s) without fixes in the recorded drive."""


def _recorded_demo() -> _Demo:
    drive = sd.example("drive")
    windows = ", ".join(f"{start:.0f} to {stop:.0f} s" for start, stop in DEMO_OUTAGES)
    about = (
        "recorded drive: 549 s in hills, consumer IMU at 100 Hz, RTK position and velocity at 4 Hz; fixes "
        f"withheld from {windows} (recorded by rtklibexplorer, BSD 3-Clause licence)"
    )
    title = "a recorded drive with three outages"
    return _Demo(drive.hidden(DEMO_OUTAGES), None, (60.0, drive.span[1]), about, title)


@app.command(cls=ResultCommand)
@with_figures
def fuse(
    recording: Annotated[list[Path], recording_argument()],
    filter: FILTER = "closed-loop",
    imu: IMU = None,
    sources: SOURCES = None,
    take: TAKE = None,
    vehicle: VEHICLE = None,
    start: FROM = None,
    stop: TO = None,
    hide: Annotated[
        str | None,
        typer.Option(metavar="T:T,...", help="Withhold fixes in these windows, s."),
    ] = None,
    heading: Annotated[
        float | None,
        typer.Option(metavar="DEG", help="Initial heading, clockwise from north."),
    ] = None,
    option: OPTION = None,
    estimate: ESTIMATE = None,
    robust: ROBUST = None,
    adaptive: ADAPTIVE = None,
    every: Annotated[int, typer.Option(metavar="N", help="Keep each N-th row.")] = 1,
    ahrs: AHRS = None,
    ahrs_rate: Annotated[float, typer.Option(metavar="HZ", help="Rate of its output.")] = 10.0,
    smooth: Annotated[
        bool,
        typer.Option(
            "--smooth",
            help="Use the whole recording for each time.",
        ),
    ] = False,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Apply what `strapdown diagnose` finds; fuse again.",
        ),
    ] = False,
    diagnosed: Annotated[
        bool,
        typer.Option("--diagnose", help="Say what of the installation is wrong."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of results.  [default: NAME-FILTER[-smooth]]"),
    ] = None,
    also: Annotated[
        str | None,
        typer.Option(
            metavar="ENDING,...",
            help="gpx, geojson, tum (for evo), csv.gz, csv.xz.",
        ),
    ] = None,
    utc: Annotated[
        bool,
        typer.Option("--utc", help="Column of UTC times in solution.csv."),
    ] = False,
    origin: Annotated[
        str | None,
        typer.Option(
            metavar="LAT,LON,HEIGHT",
            help="Of the positions in track.tum, deg and m.",
        ),
    ] = None,
    map: MAP = False,
    write: WRITE = None,
    strict: STRICT = False,
) -> None:
    """Fuse a recording: writes solution.nc, solution.csv, report.html and, where there is a
    position, track.kml."""
    windows, endings = _windows(hide), _endings(also)
    files: SolutionFiles = {"utc": utc, "origin": _origin(origin, endings)}
    options: dict[str, Any] = option_values(option)
    run: RunOptions = {
        "vehicle": vehicle,
        "every": every,
        "ahrs": ahrs,
        "ahrs_rate": ahrs_rate,
        "estimate": estimates(estimate),
        "robust": robust_sources(robust),
        "adaptive": memories(adaptive),
        "options": options,
    }
    check_draft(write, recording)
    whole, grade = read_given(recording, imu, take, sources)
    _check_utc(utc, whole)
    save_draft(write, recording, imu, take)
    run["imu"] = named = grade or grade_of(whole)
    part = whole.between(start, stop)
    seen = part.hidden(windows)
    with results_folder(
        out or Path(f"{part.meta.get('name') or recording[0].stem}-{filter}{'-smooth' * smooth}")
    ) as folder:
        run["start"] = begin = _start(seen, named, heading, filter)
        solution, label = (_follow if follow else _run)(seen, filter, smooth, run)
        if windows:
            solution.meta["withheld"] = windows
        summarise(solution)
        if windows:
            _say_withheld(_count(part) - _count(seen))
        if whole.reference is not None:
            print_errors({label: solution}, whole.reference)
            print_outages(solution, whole.reference, windows)
        page = sd.report(solution, whole.reference, map=map)
        _write_solution(solution, folder, endings, files, page)
    if diagnosed:
        try:
            diagnose.show(seen, filter, named, vehicle, begin, options)
        except sd.DataError as error:  # the results are written
            note(f"diagnose: {error}")
    end(strict, [solution.verdict])


def _say_withheld(fixes: int) -> None:
    say(f"{count_text(fixes, 'fix', 'es')} withheld")
    record(fixes_withheld=fixes)


def _count(recording: "sd.Recording") -> int:
    """Number of fixes of a recording."""
    return sum(len(a.t) for a in recording.sources)


def _check_utc(utc: bool, recording: "sd.Recording") -> None:
    """Refuse --utc of a recording without an absolute clock. Raises DataError."""
    if utc and recording.utc is None:
        raise sd.DataError(
            "--utc: the recording has no absolute clock; say its `clock` or `epoch` in the "
            "recording.toml, or leave --utc out"
        )


def _run(
    recording: "sd.Recording", filter: str, smooth: bool, run: "RunOptions"
) -> tuple["sd.Solution", str]:
    """(the Solution of a recording, what to call it); with a bar of the progress."""
    call, label = (sd.smooth, f"{filter}, smoothed") if smooth else (sd.fuse, filter)
    with Progress() as progress:
        run["notify"] = progress.notify
        return call(recording, filter, progress=progress.track(label), **run), label


def _follow(
    recording: "sd.Recording", filter: str, smooth: bool, run: "RunOptions"
) -> tuple["sd.Solution", str]:
    """The same after the advice of `diagnose` was followed; prints what it changed."""
    from ..installation.follow import follow_with

    make = lambda part, options: _run(part, filter, smooth, options)[0]
    found = follow_with(recording, make, **run)
    for line in found.lines:
        say(line)
    record(applied=found.applied, left=found.left)
    return found.after, f"{filter}, smoothed" if smooth else filter


class SolutionFiles(TypedDict):
    """Options of `write_solution`; the origin is for those in a local frame."""

    utc: bool
    origin: tuple[float, ...] | None


def _with_protection(solution: "sd.Solution") -> "sd.Solution":
    """A trusted solution with columns of its protection levels."""
    from dataclasses import replace

    if not solution.verdict.trusted or solution.trajectory.std is None:
        return solution
    levels = solution.protection()
    say(str(levels))
    record(protection={"risk": levels.risk, **_medians(levels)})
    columns = {**solution.columns, **levels.as_columns()}
    return replace(solution, columns=columns)


def _medians(levels: "ProtectionLevels") -> dict[str, float]:
    """Medians of protection levels for the document."""
    import numpy as np

    of = {
        "horizontal_m": levels.horizontal,
        "vertical_m": levels.vertical,
        "heading_deg": np.degrees(levels.heading),
    }
    return {
        key: float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan
        for key, values in of.items()
    }


def _write_solution(
    solution: "sd.Solution",
    folder: Path,
    endings: Sequence[str],
    files: SolutionFiles,
    page: "Page",
) -> None:
    """Write the files of a solution, all or none."""
    from ..fileio.files import together

    names = ["solution.nc", "solution.csv", *(["track.kml"] if solution.has_position else [])]
    names += [f"solution.{ending}" for ending in endings if "csv" in ending]
    if solution.has_position:
        names += [f"track.{ending}" for ending in endings if "csv" not in ending]
    kept = _with_protection(solution)
    with together():
        for name in names:
            origin = files["origin"] if name.endswith(".tum") else None
            sd.write_solution(kept, folder / name, utc=files["utc"], origin=origin)
            wrote(folder / name)
        save_page(page, folder / "report.html")
    if not solution.has_position:
        say("no track, because there is no position")


def _start(
    recording: "sd.Recording",
    imu: "str | sd.ImuSpec | dict[str, Any]",
    heading: float | None,
    filter: str,
) -> "sd.InitialState | None":
    """The InitialState of `filter` at a heading (deg) that the user knows; None leaves it to `fuse`."""
    if heading is None:
        return None
    from ..engine.prepare import has_position
    from ..filters import find

    if not isfinite(heading):
        raise sd.DataError(
            f"--heading {heading:g}: it must be a number, deg clockwise from true north"
        )
    if not -360 <= heading <= 360:
        raise sd.DataError(
            f"--heading {heading:g}: it is clockwise from true north in deg, at most 360"
        )
    return sd.align(recording, imu, heading=radians(heading), position=has_position(find(filter)))


@app.command(cls=ResultCommand)
def inspect(
    path: Annotated[list[Path], recording_argument("PATH")],
    write: WRITE = None,
    imu: IMU = None,
    take: TAKE = None,
) -> None:
    """Say what a recording or a table holds, what is probably wrong with it (rates, gaps, clocks,
    units, axes, mounting) and what could not be checked. Ends with 3 where something is wrong."""
    from ..io.inspection import inspect

    check_draft(write, path)
    number, grade = asked_imu(imu)
    if grade is not None and write is None:
        raise sd.DataError(
            f"--imu {grade}: inspect writes a grade into a draft; add --write FILE, or leave it out"
        )
    found = inspect(*path, **instances(number, take))
    show_inspection(found)
    save_draft(write, path, imu, take)
    if found.problems:
        raise typer.Exit(NOT_TRUSTED)


def show_inspection(found: "Inspection") -> None:
    """Print what was found in a file; the problems with --quiet, too."""
    for line in found.lines:
        (say_verdict if line.startswith(PROBLEM) else say)(line)
    record(
        path=found.path,
        facts=found.facts,
        problems=found.problems,
        reasons=[reason._asdict() for reason in found.reasons],
        inconclusive=found.inconclusive,
    )


PROBLEM = "problem: "
"""Beginning of a line of `inspect` on what is wrong."""


def _endings(text: str | None) -> list[str]:
    """Those of --also, which are written beside the usual files."""
    from ..checks import check_choice
    from ..io.solution import ENDINGS

    usual = ("nc", "csv", "kml")
    asked = [each.strip().removeprefix(".") for each in (text or "").split(",")]
    found = [each for each in dict.fromkeys(asked) if each and each not in usual]
    for each in found:
        check_choice(each, "--also", [ending for ending in ENDINGS if ending not in usual])
    return found


def _origin(text: str | None, endings: Sequence[str]) -> tuple[float, ...] | None:
    """(latitude rad, longitude rad, height m) from "LAT,LON,HEIGHT" in deg and m. Raises DataError."""
    if text is None:
        return None
    if "tum" not in endings:
        raise sd.DataError("--origin: only track.tum has positions from it; add --also tum")
    try:
        latitude, longitude, height = map(float, text.split(","))
    except ValueError:
        raise sd.DataError(
            f"--origin {text!r}: write latitude,longitude,height in deg and m, as 47.63,9.35,400"
        ) from None
    return radians(latitude), radians(longitude), height


def _windows(text: str | None) -> list[tuple[float, float]]:
    """[(start, stop)] from "T:T,T:T"."""
    windows = []
    for item in filter(str.strip, (text or "").split(",")):
        try:
            start, stop = map(float, item.split(":"))
        except ValueError:
            raise sd.DataError(
                f"--hide {item!r}: a window is START:STOP in seconds, windows are separated by "
                f"commas"
            ) from None
        if not start < stop:
            raise sd.DataError(f"--hide {item!r}: the window ends before it starts")
        windows.append((start, stop))
    return windows


COMMANDS: dict[type[Command], tuple[Callable[..., None], ...]] = {
    ResultCommand: (
        *simulation.COMMANDS,
        *(with_figures(compare.compare), with_figures(tune.tune), with_figures(fly.fly)),
        *(diagnose.diagnose, export.export),
    ),
    Command: (*lists.COMMANDS, filters.filters, live),
}
for kind, functions in COMMANDS.items():
    for function in functions:
        app.command(cls=kind)(function)
app.add_typer(calibrate.group)

if __name__ == "__main__":
    main()
