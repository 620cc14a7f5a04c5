"""Functions shared by the commands: options, the folder for results, tables, summaries, progress.
Heavy imports inside functions, so that `--help` stays quick."""

import inspect
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer

import strapdown as sd

from ..checks import DataError, check_choice, locate_errors
from ..data.verdict import DOUBTFUL, NOT_TO_BE_TRUSTED, TRUSTED, Verdict, together
from ..units.wording import count_text, short
from . import complete
from .output import (
    complain,
    has_colour,
    is_quiet,
    known_columns,
    note,
    record,
    say,
    say_verdict,
    table,
    wrote,
)

if TYPE_CHECKING:
    from ..engine.installation import Prior
    from ..installation.findings import Estimate
    from ..pages.shell import Page
    from ..typing import Array

FILTER = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        autocompletion=complete.filters,
        help="See `strapdown filters`.",
    ),
]
RELATIVE = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        autocompletion=complete.filters,
        help="Of the closed-loop family.",
    ),
]
AHRS = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        autocompletion=complete.attitude_filters,
        help="Attitude filter that runs first and aids the others.",
    ),
]
GRADE = Annotated[
    str,
    typer.Option(
        metavar="GRADE",
        autocompletion=complete.imus,
        help="See `strapdown imus`; or a .toml file.",
    ),
]
GNSS = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        autocompletion=complete.receivers,
        help="See `strapdown receivers`; or a .toml file.",
    ),
]
OUT = Annotated[Path, typer.Option(help="Folder of results.")]
IMU = Annotated[
    str | None,
    typer.Option(
        metavar="GRADE",
        autocompletion=complete.imus,
        help="See `strapdown imus`; or a .toml file; N: IMU N of a log.",
    ),
]
SOURCES = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Noise of the fixes, a file of `strapdown tune`.",
    ),
]
TAKE = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=N",
        help="Of several alike in a log: gnss=1, reference=0, gnss=none.",
    ),
]
WRITE = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Draft the recording.toml of these tables or logs.",
    ),
]
VEHICLE = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        autocompletion=complete.vehicles,
        help="any, pedestrian, car, ship, multicopter or aircraft.",
    ),
]
OPTION = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="An option of `strapdown filters NAME`.",
    ),
]
ESTIMATE = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME,...",
        help="States for clock, lever-arm, mounting, scale; of the IMU gyro- and accel-scale, -misalignment.",
    ),
]


def _no_option(values: list[str] | None) -> list[str] | None:
    """The values of an option, none of which is an option that was taken for one."""
    for value in values or ():
        if value.startswith("-"):
            raise typer.BadParameter(f"it takes a value, and is followed by {value}; write all")
    return values


ROBUST = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SOURCE,...",
        callback=_no_option,
        help="Sources with a heavy-tailed likelihood; all, or none.",
    ),
]
ADAPTIVE = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SECONDS",
        help="Memory to follow their noise with; or SOURCE=SECONDS.",
    ),
]
FROM = Annotated[
    float | None,
    typer.Option("--from", metavar="T", help="First second to use."),
]
TO = Annotated[float | None, typer.Option("--to", metavar="T", help="Last second to use.")]
STRICT = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Exit with 3 unless the verdict is `trusted`.",
    ),
]
MAP = Annotated[
    bool,
    typer.Option(
        "--map",
        help="Add a street map, loaded from the network.",
    ),
]
FIGURES = Annotated[
    Path | None,
    typer.Option(
        "--figures",
        metavar="DIR",
        help="Save the figures as SVG, too; needs Chromium.",
    ),
]
SEED = Annotated[int, typer.Option(help="Seed of the random errors.")]
WORKERS = Annotated[
    int,
    typer.Option(metavar="N", help="Dask processes of this machine; 0: threads."),
]
SCHEDULER = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Dask scheduler, tcp://HOST:PORT.",
    ),
]

NOT_TRUSTED = 3
"""Exit code of a command with --strict whose result is not trusted, and of `inspect` where it finds
something wrong; docs/reference/conventions.md lists all."""
SPEED_OVER = 600.0
"""s: steps of a study are further apart than the half minute that bars usually look back."""


def recording_argument(name: str = "RECORDING") -> Any:
    """The argument of a command that reads the files of a recording."""
    return typer.Argument(metavar=name, help="Files of one recording: `strapdown formats`.")


def read_given(
    paths: Sequence[Path],
    imu: str | None = None,
    take: Sequence[str] | None = None,
    sources: Path | None = None,
) -> "tuple[sd.Recording, str | None]":
    """The Recording of what a command was given, with the noise of --sources, and the grade that
    --imu names. Prints what was taken from logs, assumed and left."""
    number, grade = asked_imu(imu)
    recording = sd.read(*paths, **instances(number, take))
    told = [
        line
        for line in recording.meta.get("read", [])
        if grade is None or not line.startswith("assumed: imu grade")
    ]
    for line in told:
        say(line)
    record(read=told)
    return (recording if sources is None else sd.with_noise(recording, sources)), grade


def asked_imu(text: str | None) -> tuple[int | None, str | None]:
    """(number, grade) of --imu, either of which may be missing."""
    number, _, grade = (text or "").partition(",")
    if not number.strip().isdecimal():
        return None, text
    return int(number), grade.strip() or None


def instances(imu: int | None, take: Sequence[str] | None) -> dict[str, int | None]:
    """Return the `instances` of `read` from --imu and --take. Raises DataError."""
    found: dict[str, int | None] = {} if imu is None else {"imu": imu}
    for item in take or ():
        name, _, number = (part.strip() for part in item.partition("="))
        if not (number.isdecimal() or number == "none"):
            raise DataError(f"--take {item!r}: write NAME=N, as gnss=1, or NAME=none")
        found[name] = None if number == "none" else int(number)
    return found


def check_draft(write: Path | None, paths: Sequence[Path]) -> None:
    """Refuse a --write before anything is done. Raises DataError."""
    from ..io.inspection import check_drafted

    if write is None:
        return
    check_drafted(paths)
    if os.path.exists(write):  # False of a name that is too long, which writing refuses
        raise DataError(
            f"--write {write}: there is such a file already; name another, or remove it"
        )


def save_draft(
    write: Path | None, paths: Sequence[Path], imu: str | None, take: Sequence[str] | None
) -> None:
    """Write the draft that --write asks for, where it does, with the grade of --imu. Raises
    DataError."""
    from ..fileio.files import replacing
    from ..io.inspection import draft

    if write is None:
        return
    folder = write.resolve().parent
    number, grade = asked_imu(imu)
    if grade is not None and sd.imu(grade).name and Path(grade).suffix == ".toml":
        grade = Path(os.path.relpath(grade, folder)).as_posix()
    text = draft(paths, instances(number, take), folder, grade)
    with replacing(write) as part:
        part.write_text(text, encoding="utf-8")
    say(f"read {write} through, then `strapdown inspect {write}`")
    wrote(write)


def summarise(solution: "sd.Solution") -> None:
    """Print the summary of a solution without its errors: the verdict first, then notes, start,
    fixes, events, uncertainty at the end."""
    from ..core.loop.contract import DOUBTFUL
    from ..pages.summary import claimed_std

    print_verdicts({"": solution.verdict})
    for text in solution.meta.get("notes", []):
        note(text)
    say(f"start: {solution.meta['start']['note']}")
    counts, outside = solution.counts(), solution.meta["fixes_outside"]
    for name, (good, bad) in counts.items():
        say(f"{name}: {count_text(good, 'fix', 'es')} accepted, {bad} rejected")
    if outside:
        verbs = ("lies", "was") if outside == 1 else ("lie", "were")
        say(
            f"{count_text(outside, 'fix', 'es')} {verbs[0]} before the start or after the last sample "
            f"and {verbs[1]} not used"
        )
    for line in solution.installation.told:
        say(line)
    for t, text in solution.events[:10]:
        say(f"{t:10.2f} s  {text}")
    if len(solution.events) > 10:
        say(f"           and {len(solution.events) - 10} more events; the report lists them")
    if doubtful := solution.seconds(DOUBTFUL):
        say(f"doubtful: {doubtful:.4g} s of {solution.t[-1] - solution.t[0]:.4g} s, see the events")
    std = claimed_std(solution)[-1]
    say(f"at the end: {uncertainty(std)}")
    record(
        span_s=[solution.t[0], solution.t[-1]],
        start={"note": solution.meta["start"]["note"]},
        fixes={name: {"accepted": good, "rejected": bad} for name, (good, bad) in counts.items()},
        fixes_outside=outside,
        installation=[_parameter(each) for each in solution.installation.parameters],
        events=[{"t_s": t, "text": text} for t, text in solution.events],
        doubtful_s=doubtful,
        std_at_end={key: value for key, (_, _, value) in _claims(std).items()},
    )


def print_verdicts(verdicts: Mapping[str, Verdict]) -> None:
    """The verdict on each of {name: result}, the gravest first: its word, a line for each reason and for
    each thing that could not be tested; of several results the first reason, and the names of the others
    and of what was not tested. Results that agree share theirs."""
    groups, several = together(verdicts), len(verdicts) > 1
    for names, verdict in groups:
        all_of_them = "both" if len(names) == 2 else f"all {len(names)}"
        them = all_of_them if len(groups) == 1 else ", ".join(names)
        say_verdict(f"verdict{f' on {them}' if several else ''}: {_word_in_colour(verdict.word)}")
        for line in _reasons_in_short(verdict) if several else _named_once(verdict.lines[1:]):
            say(line)
    if several:
        untested = dict.fromkeys(each.what for _, verdict in groups for each in verdict.untested)
        if untested:
            say(f"  {NOT_TESTED}{', '.join(untested)}")
        record(verdicts={name: verdict.as_dict() for name, verdict in verdicts.items()})
    else:
        record(verdict=next(iter(verdicts.values())).as_dict())


NOT_TESTED = "not tested: "


def _reasons_in_short(verdict: Verdict) -> Iterator[str]:
    first, *others = verdict.reasons or (None,)
    if first:
        yield f"  {first}"
    if others:
        yield f"  also: {', '.join(reason.what for reason in others)}"


def _named_once(lines: Iterable[str]) -> Iterator[str]:
    """The lines of a verdict, of which the first alone says that something was not tested."""
    said = False
    for line in lines:
        begins = line.startswith(f"  {NOT_TESTED}")
        yield line.replace(NOT_TESTED, " " * len(NOT_TESTED), 1) if begins and said else line
        said |= begins


COLOURS = {TRUSTED: "green", DOUBTFUL: "yellow", NOT_TO_BE_TRUSTED: "red"}


def _word_in_colour(word: str) -> str:
    """A verdict's word, on a terminal in its colour."""
    return typer.style(word, fg=COLOURS.get(word), bold=True) if has_colour() else word


def end(strict: bool, verdicts: Iterable[Verdict]) -> None:
    """End a command with its exit code, which with --strict says whether all is trusted."""
    if strict and not all(verdict.trusted for verdict in verdicts):
        complain("strapdown: not trusted (--strict); the results are written")
        raise SystemExit(NOT_TRUSTED)


def with_figures(command: Callable[..., None]) -> Callable[..., None]:
    """The function of a command that writes a page, with the option --figures, of which it need not
    know."""

    @wraps(command)
    def run(*words: Any, figures: Path | None = None, **given: Any) -> None:
        if figures is None:
            return command(*words, **given)
        from ..pages.pictures import saving_pictures

        with saving_pictures(figures):
            command(*words, **given)
        wrote(figures)

    known = inspect.signature(command)
    option = inspect.Parameter(
        "figures", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=FIGURES
    )
    run.__signature__ = known.replace(parameters=[*known.parameters.values(), option])  # type: ignore[attr-defined]
    run.__annotations__ = command.__annotations__ | {"figures": FIGURES}
    return run


def save_page(page: "Page", path: Path) -> None:
    """Write a report, and say what it notes, such as a figure that could not be drawn."""
    for text in page.notes:
        note(text)
    page.save(path)
    wrote(path)


def uncertainty(std: "Array") -> str:
    """The standard deviations of one row that a filter claims, as text; those of the gyro bias
    where it claims no position."""
    return (
        ", ".join(
            f"{name} std {triple(values)} {unit}" for name, unit, values in _claims(std).values()
        )
        or "no uncertainty claimed"
    )


def _claims(std: "Array") -> "dict[str, tuple[str, str, Array]]":
    """{key of the document: (name, unit, three values)} of what `uncertainty` says."""
    import numpy as np

    parts = {
        "position_ned_m": ("position", "m NED", std[:3]),
        "velocity_ned_m_per_s": ("velocity", "m/s", std[3:6]),
        "attitude_rph_deg": ("attitude", "deg", np.degrees(std[6:9])),
    }
    if not np.isfinite(std[:2]).any():
        parts["gyro_bias_deg_per_h"] = ("gyro bias", "deg/h", np.degrees(std[12:15]) * 3600)
    return {key: part for key, part in parts.items() if np.isfinite(part[2]).any()}


def _parameter(found: "Estimate") -> dict[str, Any]:
    """An estimated parameter of an installation, for the document; its numbers are in its unit."""
    names = ("name", "sources", "status", "unit", "given", "change", "std", "motion")
    return {name: getattr(found, name) for name in names}


def record_parameters(parameters: "Iterable[Estimate]") -> None:
    """Add the estimated parameters of an installation to the document."""
    record(parameters=[_parameter(each) for each in parameters])


def print_outages(
    solution: "sd.Solution", reference: "sd.Trajectory", windows: Iterable[tuple[float, float]]
) -> None:
    """Print the error that the solution reached while its fixes were withheld, a row per window;
    says in one line why there is none."""
    from ..evaluation.metrics import outages

    found = []
    for window in windows:
        try:
            found += outages(solution, reference, [window])
        except sd.DataError as error:
            say(f"not scored: {error}")
    if found:
        table(
            (
                "fixes withheld, s",
                "largest horizontal error, m",
                "at the end, m",
                "largest vertical, m",
            ),
            [
                (
                    f"{each.start:g}-{each.stop:g}",
                    *map(number, (each.horizontal_max, each.horizontal_end, each.down_max)),
                )
                for each in found
            ],
        )
    record(
        outages=[
            {
                "start_s": each.start,
                "stop_s": each.stop,
                "horizontal_max_m": each.horizontal_max,
                "horizontal_end_m": each.horizontal_end,
                "down_max_m": each.down_max,
            }
            for each in found
        ]
    )


def triple(values: "Iterable[float]") -> str:
    """Numbers with three digits each, dashes for what is not known, one dash where nothing is."""
    texts = [number(float(value)) for value in values]
    return "-" if set(texts) == {"-"} else " ".join(texts)


def number(value: float | None) -> str:
    """A number as `short` has it; a dash for None and NaN."""
    return "-" if value is None or value != value else short(value)


def print_errors(
    solutions: "Mapping[str, sd.Solution]",
    reference: "sd.Trajectory",
    window: tuple[float, float] | None = None,
) -> None:
    """A table of root mean square errors and what of them contradicts the claims; says in one line
    why there is none. The angles of the attitude error where a solution has no position.

    A heading that runs free is not scored, nor the angle of the whole rotation with it.
    """
    import numpy as np

    from ..evaluation.metrics import AttitudeAngles, errors, rms
    from ..pages.summary import contradictions, heading_held

    rows, found, scored = [], {}, {}
    for name, solution in solutions.items():
        try:
            found[name] = errors(solution, reference)
            r = rms(found[name], window)
        except sd.DataError as error:
            say(f"not scored: {error}")
            continue
        angles = [np.degrees(part) for part in (r.rph, r.angles)]
        if not heading_held(solution):
            angles = [
                np.where([known, True, False], part, np.nan)
                for part, known in zip(angles, (True, False))
            ]
        parts = r.position, r.velocity, *angles
        rows.append((name, *map(triple, parts)))
        scored[name] = dict(zip(RMS_KEYS, parts))
    if rows:
        say(
            "rms error against the reference"
            + (f" over {short(window[0])}-{short(window[1])} s" if window else "")
        )
        header = (
            "filter",
            "position N E D, m",
            "velocity N E D, m/s",
            "roll pitch heading, deg",
            f"angle {' '.join(AttitudeAngles._fields)}, deg",
        )
        all_columns = not all(solution.has_position for solution in solutions.values())
        columns = 5 if all_columns else 4
        table(*known_columns(header[:columns], [row[:columns] for row in rows]))
    against = contradictions(found, window)
    for name, texts in against.items():
        for text in texts:
            say(f"{name}: {text}")
    record(rms_errors=scored, contradictions=against)


RMS_KEYS = "position_ned_m", "velocity_ned_m_per_s", "attitude_rph_deg", "attitude_angles_deg"
"""Names of rms errors in the document."""


class Progress:
    """A progress bar on standard error where that is a terminal, with the time that is left; plain
    lines for what takes long otherwise. Nothing with --quiet."""

    def __enter__(self) -> Self:
        self.bar = None
        if sys.stderr.isatty() and not is_quiet():
            from rich.console import Console
            from rich.progress import Progress

            self.bar = Progress(
                *Progress.get_default_columns(),
                "left",
                console=Console(stderr=True),
                transient=True,
                speed_estimate_period=SPEED_OVER,
            )
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    def notify(self, text: str) -> None:
        """A line that is seen at once."""
        if self.bar is not None:
            self.bar.console.print(text, highlight=False, markup=False)
        elif not is_quiet():
            complain(text)

    def track(self, name: str) -> Callable[[float], None]:
        """A function of the fraction done."""
        bar = self.bar
        if bar is None:
            return lambda done: None
        task = bar.add_task(name, total=1.0)
        return lambda done: bar.update(task, completed=float(done))


def option_values(items: Sequence[str] | None) -> dict[str, float | str]:
    """{name: value} from NAME=VALUE, numbers as float."""
    options: dict[str, float | str] = {}
    for item in items or ():
        name, equals, value = item.partition("=")
        if not equals:
            raise sd.DataError(f"--option {item!r}: write NAME=VALUE")
        try:
            options[name.strip()] = float(value)
        except ValueError:
            options[name.strip()] = value.strip()
    return options


def estimates(items: Sequence[str] | None) -> "dict[str, Prior] | None":
    """Return the `estimate` of `fuse` from NAME and NAME=STD, as `standard_deviations` reads them;
    None where nothing is given. Raises DataError."""
    return standard_deviations(items, "--estimate") if items else None


def robust_sources(items: Sequence[str] | None) -> bool | list[str] | None:
    """Return the `robust` of `fuse` from names between commas, `all` or `none`; None where nothing
    is given."""
    if not items:
        return None
    names = [piece.strip() for item in items for piece in item.split(",")]
    return names == ["all"] if names in (["all"], ["none"]) else names


def memories(items: Sequence[str] | None) -> float | dict[str, float] | None:
    """Return the `adaptive` of `fuse` from SECONDS, or SOURCE=SECONDS between commas; None where
    nothing is given. Raises DataError."""
    if not items:
        return None
    pieces = [piece.strip() for item in items for piece in item.split(",")]
    try:
        if len(pieces) == 1 and "=" not in pieces[0]:
            return float(pieces[0])
        return {
            name.strip(): float(seconds)
            for name, _, seconds in (piece.rpartition("=") for piece in pieces)
        }
    except ValueError:
        raise DataError(
            f"--adaptive {', '.join(pieces)}: write seconds, such as 60, or SOURCE=60"
        ) from None


def standard_deviations(items: Sequence[str], option: str) -> "dict[str, Prior]":
    """{parameter of the installation: standard deviations by component, SI, or None} of NAME and
    NAME=STD between commas, in the units of tables; of several components STD is one number, or one
    each with "/" or blanks between them. "none" alone is none of them. Raises DataError."""
    pieces = [piece.strip() for item in items for piece in item.split(",") if piece.strip()]
    if not pieces:
        raise DataError(f"{option} is empty; write names, such as clock,lever-arm, or none")
    if pieces == ["none"]:
        return {}
    if "none" in pieces:
        raise DataError(f"{option}: none stands alone; leave it or the other names out")
    found: dict[str, Prior] = {}
    for i, piece in enumerate(pieces):
        if i and "=" in pieces[i - 1] and _numbers(piece):
            raise DataError(
                f"{option}: {pieces[i - 1]!r} and {piece!r}: between the components of one parameter "
                f"write / instead of a comma, as in {pieces[i - 1]}/{piece}"
            )
        found |= _standard_deviation(piece, option)
    return found


def _standard_deviation(piece: str, option: str) -> "dict[str, Prior]":
    from ..data import calibration_parameters

    words, equals, std = (part.strip() for part in piece.partition("="))
    name = words.split()[-1] if words else ""
    known = {
        **calibration_parameters.ASKED_OF_IMU,
        **calibration_parameters.asked_at([*calibration_parameters.OF_SOURCE]),
    }
    if words.lower().startswith("imu "):  # whose scale is another
        known |= calibration_parameters.ASKED_OF_IMU
    what = known[check_choice(name, option, known)][0]
    if not equals:
        return {words: None}
    values = _numbers(std)
    if not values:
        raise DataError(
            f"{option} {piece!r}: write {words}=STD, a standard deviation"
            f"{what.unit and ' in '}{what.unit}"
        )
    with locate_errors(option):
        of_each = calibration_parameters.prior(
            what, values if len(values) > 1 else values[0], in_tables=True
        )
    return {words: of_each if len(values) > 1 else of_each[0]}


def _numbers(text: str) -> list[float]:
    """Those between blanks or "/"; none where something else stands there."""
    try:
        return [float(each) for each in text.replace("/", " ").split()]
    except ValueError:
        return []


@contextmanager
def results_folder(path: Path) -> Iterator[Path]:
    """The folder for results, made and tried before the work begins; what was made is removed
    again where the work fails and left it empty."""
    made = [folder for folder in (path, *path.parents) if not os.path.exists(folder)]
    try:
        try:
            path.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=path):
                pass
        except OSError as error:
            raise sd.DataError(
                f"--out {path}: nothing can be written there ({error.strerror}); choose another "
                f"folder"
            ) from None
        yield path
    except BaseException:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        raise


def grade_of(recording: "sd.Recording") -> "str | sd.ImuSpec | dict[str, Any]":
    """The IMU that a recording names. Raises DataError."""
    from ..sensor_models.imu import imus

    named = recording.meta.get("grade")
    if named is None:
        raise sd.DataError(
            f"the recording does not name its IMU: give --imu, one of {', '.join(imus())}, or a "
            f"file that describes it"
        )
    return named
