"""The command line. Bad input ends in one line on standard error and exit code 2; Ctrl-C in one line and 130; nothing is left half-written."""
import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
                  help="Aided inertial navigation: from IMU, GNSS and other records to position, velocity, attitude and biases with uncertainties.")
OUT = Annotated[Path, typer.Option(help="Folder for the results.")]
IMU = Annotated[Optional[str], typer.Option(help="IMU grade (see `strapdown imus`) or a file that describes one; default: what the recording names.")]


def main():
    """Entry point of the command `strapdown`."""
    try:
        app(standalone_mode=False)
    except KeyboardInterrupt:
        _stop("interrupted; files written so far are whole, nothing is half-written", 130)
    except Exception as error:
        from .data import DataError
        if isinstance(error, typer.Abort):
            _stop("interrupted; files written so far are whole, nothing is half-written", 130)
        if hasattr(error, "format_message"):  # usage errors of typer's own, whichever click it carries
            _stop(error.format_message())
        if isinstance(error, DataError):
            _stop(str(error))
        raise


def _stop(message, code=2):
    print(f"strapdown: {message}", file=sys.stderr)
    raise SystemExit(code)


def _version(wanted: bool):
    if wanted:
        from . import __version__
        print(f"strapdown {__version__}")
        raise typer.Exit()


@app.callback()
def options(version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and end.")] = False):
    """Options of the command itself."""


@app.command()
def demo(out: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"), seed: int = 7, imu: str = "tactical"):
    """Simulate a 10-minute flight, fuse it open and closed loop, print the errors and write a page."""
    import strapdown as sd
    from .sim.trajectory import demo_flight
    recording = sd.simulate(demo_flight(), 600.0, imu, seed)
    print(f"simulated flight: 600 s, {imu} IMU at 100 Hz, GNSS position and velocity at 1 Hz, seed {seed}")
    with _Progress() as progress:
        solutions = {name: sd.fuse(recording, name, say=progress.say, progress=progress.track(name)) for name in ("closed-loop", "open-loop")}
    _print_errors(solutions, recording.reference, (120.0, 600.0))
    sd.report(solutions, recording.reference, title="strapdown demo: a simulated 10-minute flight", window=(120.0, 600.0)).save(out)
    print(f"wrote {out}")


@app.command()
def fuse(recording: Path, filter: Annotated[str, typer.Option(help="Architecture; see `strapdown filters`.")] = "closed-loop", imu: IMU = None,
         start: Annotated[Optional[float], typer.Option("--from", help="First second of the recording to use.")] = None,
         stop: Annotated[Optional[float], typer.Option("--to", help="Last second of the recording to use.")] = None,
         hide: Annotated[Optional[str], typer.Option(help="Withhold recorded fixes: T:T,T:T in seconds.")] = None,
         heading: Annotated[Optional[float], typer.Option(help="Initial heading, deg, where you know it (to 2 deg).")] = None,
         option: Annotated[Optional[list[str]], typer.Option(help="An option of the filter, NAME=VALUE; may be repeated.")] = None,
         every: Annotated[int, typer.Option(help="Keep each n-th row of the solution.")] = 1,
         out: Annotated[Optional[Path], typer.Option(help="Folder for the results [default: NAME-FILTER].")] = None):
    """Fuse a recording (recording.toml or .nc): writes solution.nc, solution.csv, track.kml and report.html."""
    import strapdown as sd
    from math import inf, radians
    windows, options = _windows(hide), _options(option)
    whole = sd.read(recording)
    part = whole.between(-inf if start is None else start, inf if stop is None else stop).hidden(windows)
    begin = None
    if heading is not None:
        begin = sd.align(part, sd.grade(imu or _grade_of(part)), heading=radians(heading))
    out = out or Path(f"{part.meta.get('name') or recording.stem}-{filter}")
    with _Progress() as progress:
        solution = sd.fuse(part, filter, imu=imu, start=begin, every=every, say=progress.say, progress=progress.track(filter), **options)
    _summarise(solution)
    if whole.reference is not None:
        _print_errors({filter: solution}, whole.reference, None)
    _make_folder(out)
    for name in ("solution.nc", "solution.csv", "track.kml"):
        sd.write_solution(solution, out / name)
    sd.report(solution, whole.reference).save(out / "report.html")
    print(f"wrote {out}/solution.nc, solution.csv, track.kml, report.html")


def _grade_of(recording):
    from .data import DataError
    from .sensors.imu import grades
    if recording.meta.get("grade") is None:
        raise DataError(f"the recording does not name its IMU: give --imu, one of {', '.join(grades())}, or a file that describes it")
    return recording.meta["grade"]


@app.command()
def inspect(path: Path, write: Annotated[Optional[Path], typer.Option(help="From a bare CSV: draft the recording.toml that describes it.")] = None):
    """Say what a recording or a CSV holds, and what is probably wrong with it: rates, gaps, time base, units, axes."""
    from .io.inspection import inspect
    print(inspect(path))
    if write is not None:
        from .files import replacing
        from .io.draft import draft
        text = draft(path, write.resolve().parent)
        with replacing(write) as part:
            part.write_text(text)
        print(f"wrote {write}: read it through, then `strapdown inspect {write}`")


@app.command()
def filters():
    """List the filter architectures with their sources."""
    from . import filters
    _table(("filter", "reference"), [(name, filters.find(name).reference) for name in filters.names()])


@app.command()
def imus():
    """List the IMU grades with their error terms."""
    from .sensors.imu import grade, grades
    specs = [grade(name) for name in grades()]
    rows = dict.fromkeys(key for spec in specs for key in spec.datasheet())
    _table(("", *(spec.name for spec in specs)), [(key, *(_number(spec.datasheet().get(key)) for spec in specs)) for key in rows])


@app.command()
def reproduce(name: str, out: OUT = Path("reproduction"),
              recordings: Annotated[Optional[Path], typer.Option(help="Folder of the recordings' descriptions [default: examples/recordings].")] = None):
    """Run a published or recorded result again: writes index.html, CSV tables and claims.json. NAME: recordings."""
    from .data import DataError
    if name != "recordings":
        raise DataError(f"nothing to reproduce is called {name!r}; there is: recordings")
    from .papers.recordings import reproduce
    _make_folder(out)
    with _Progress() as progress:
        claims = reproduce(out, recordings, say=progress.say)
    _table(("claim", "target", "measured", "holds"), [(c["claim"], c["target"], c["figure"], "yes" if c["holds"] else "no") for c in claims])
    print(f"wrote {out}/index.html")


def _windows(text):
    """[(start, stop)] from "T:T,T:T"."""
    from .data import DataError
    windows = []
    for item in filter(str.strip, (text or "").split(",")):
        try:
            start, stop = map(float, item.split(":"))
        except ValueError:
            raise DataError(f"--hide {item!r}: a window is START:STOP in seconds, windows are separated by commas") from None
        if not start < stop:
            raise DataError(f"--hide {item!r}: the window ends before it starts")
        windows.append((start, stop))
    return windows


def _options(items):
    """{name: value} from NAME=VALUE, numbers as float."""
    from .data import DataError
    options = {}
    for item in items or ():
        name, equals, value = item.partition("=")
        if not equals:
            raise DataError(f"--option {item!r}: write NAME=VALUE")
        try:
            options[name.strip()] = float(value)
        except ValueError:
            options[name.strip()] = value.strip()
    return options


def _make_folder(path):
    from .data import DataError
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{path}: the folder cannot be made ({error.strerror}); choose another --out") from None


def _summarise(solution):
    import numpy as np
    for note in solution.meta.get("notes", []):
        print(f"note: {note}")
    print(f"start: {solution.meta['start']['note']}")
    for name, (good, bad) in solution.counts().items():
        print(f"{name}: {good} fixes accepted, {bad} rejected")
    if solution.meta["fixes_outside"]:
        print(f"{solution.meta['fixes_outside']} fixes lie before the start or after the last sample and were not used")
    for t, text in solution.events[:10]:
        print(f"{t:10.2f} s  {text}")
    if len(solution.events) > 10:
        print(f"           and {len(solution.events) - 10} more events; the report lists them")
    sd = solution.trajectory.sd[-1]
    print(f"at the end: position sd {_triple(sd[:3])} m NED, velocity sd {_triple(sd[3:6])} m/s, attitude sd {_triple(np.degrees(sd[6:9]))} deg")


def _triple(values):
    return " ".join(_number(value) for value in values)


def _number(value):
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _print_errors(solutions, reference, window):
    """A table of root mean square errors; says in one line why there is none."""
    import numpy as np
    from .data import DataError
    from .metrics import errors, rms
    rows = []
    for name, solution in solutions.items():
        try:
            r = rms(errors(solution, reference), window)
        except DataError as error:
            print(f"not scored: {error}")
            continue
        rows.append((name, _triple(r.position), "-" if r.velocity is None else _triple(r.velocity), "-" if r.rph is None else _triple(np.degrees(r.rph))))
    if rows:
        print("rms error against the reference" + (f" over {window[0]:g}-{window[1]:g} s" if window else ""))
        _table(("filter", "position N E D, m", "velocity N E D, m/s", "roll pitch heading, deg"), rows)


def _table(header, rows):
    widths = [max(len(str(row[i])) for row in [header, *rows]) for i in range(len(header))]
    for row in [header, ["-" * width for width in widths], *rows]:
        print("  ".join(str(cell).ljust(width) for cell, width in zip(row, widths)).rstrip())


class _Progress:
    """A progress bar on standard error where that is a terminal; plain lines for what takes long otherwise."""

    def __enter__(self):
        from rich.console import Console
        from rich.progress import Progress
        self.console = Console(stderr=True)
        self.bar = Progress(console=self.console, transient=True, disable=not self.console.is_terminal)
        self.bar.start()
        return self

    def __exit__(self, *_):
        self.bar.stop()

    def say(self, text):
        """A line that is seen at once."""
        self.console.print(text, highlight=False, soft_wrap=True)

    def track(self, name):
        """A function of the fraction done."""
        task = self.bar.add_task(name, total=1.0)
        return lambda done: self.bar.update(task, completed=float(done))


if __name__ == "__main__":
    main()
