"""The commands that simulate: simulate, study, advise, reproduce; and allan, which measures what
a simulation needs."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import strapdown as sd

from ..units.wording import count_text
from . import complete
from .console import (
    GNSS,
    GRADE,
    OUT,
    SCHEDULER,
    SEED,
    WORKERS,
    Progress,
    read_given,
    recording_argument,
    results_folder,
    save_page,
    standard_deviations,
    with_figures,
)
from .output import note, record, say, say_verdict, table, wrote

if TYPE_CHECKING:
    import pandas as pd

    from ..allan.page import Analysis


def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            autocompletion=complete.scenarios,
            help="A scenario's name or .toml file.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="The recording to write, .nc.")],
    imu: Annotated[
        str | None,
        typer.Option(
            metavar="GRADE",
            autocompletion=complete.imus,
            help="See `strapdown imus`; or a .toml file.",
        ),
    ] = None,
    gnss: GNSS = None,
    seed: SEED = 0,
    duration: Annotated[
        float | None,
        typer.Option(metavar="S", help="Seconds.  [default: the scenario's]"),
    ] = None,
) -> None:
    """Simulate a scenario and write it with its truth, as a recording that `strapdown fuse`
    reads."""
    if out.suffix.lower() != ".nc":
        raise sd.DataError(
            f"--out {out}: a recording is written as NetCDF; name a file that ends in .nc"
        )
    recording = sd.simulate(sd.scenario(scenario), duration, imu, seed, gnss=gnss)
    with results_folder(out.parent):
        sd.write_recording(recording, out)
    for text in recording.meta["notes"]:
        note(text)
    fixes = {a.name or a.kind: len(a.t) for a in recording.sources}
    counts = ", ".join(f"{count} {name}" for name, count in fixes.items())
    say(
        f"simulated {recording.span[1] - recording.span[0]:g} s: {len(recording.imu.t)} IMU "
        f"samples, {counts or 'no fixes'}, the truth as reference"
    )
    record(span_s=recording.span, seed=seed, imu_samples=len(recording.imu.t), fixes=fixes)
    wrote(out)


def study(
    scenario: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO",
            autocompletion=complete.scenarios,
            help="Names or .toml files of scenarios.",
        ),
    ],
    imu: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GRADE",
            autocompletion=complete.imus,
            help="See `strapdown imus`; or a .toml file.",
        ),
    ] = None,
    gnss: GNSS = None,
    filter: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            autocompletion=complete.filters,
            help="NAME:option=value,...  [default: closed-loop, open-loop]",
        ),
    ] = None,
    runs: Annotated[
        int, typer.Option(metavar="N", help="Runs of each scenario with each IMU.")
    ] = 50,
    installation: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=STD,...",
            help="Standard deviations of errors that each run draws: clock=0.1,lever-arm=0.5,mounting=0/2/2,scale=0.02 in s, m, deg.",
        ),
    ] = None,
    seed: SEED = 0,
    out: OUT = Path("study"),
    workers: WORKERS = 0,
    scheduler: SCHEDULER = None,
) -> None:
    """Run filters many times on the same simulated data and score them; an interrupted study
    goes on where it was."""
    made = sd.Study(
        tuple(_with_receiver(sd.scenario(name), gnss) for name in scenario),
        tuple(filter or ("closed-loop", "open-loop")),
        tuple(imu or ()),
        runs,
        seed,
        installation=standard_deviations([installation], "--installation")
        if installation is not None
        else {},
    )
    say(
        f"{count_text(len(made.cells), 'cell')}, {count_text(len(made.filters), 'filter')}, "
        f"{count_text(runs, 'run')}: "
        f"{made.steps() / 1e6:.3g} million filter steps"
    )
    with results_folder(out), Progress() as progress:
        campaign = made.run(
            out,
            workers=workers,
            scheduler=scheduler,
            notify=progress.notify,
            progress=progress.track("study"),
        )
        save_page(campaign.page(), out / "index.html")
    print_summary(campaign.summary)
    record(runs=runs, seed=seed, summary=campaign.summary)
    wrote(out / "index.html", out / "summary.csv", out / "runs.csv", out / "chunks")


def _with_receiver(scenario: "sd.Scenario", gnss: str | None) -> "sd.Scenario":
    """The scenario with the receiver of that name or file; without one as it is."""
    return scenario if gnss is None else scenario.replace(gnss=sd.receiver(gnss, scenario.gnss))


def print_summary(summary: "pd.DataFrame") -> None:
    """The columns of a summary that a screen has room for."""
    from ..experiments.monte_carlo.page import GIVEN_UP

    header = (
        "scenario",
        "IMU",
        "filter",
        "survived",
        "position rms, m (95 %)",
        "until given up, m",
        "given up",
        "heading, deg",
        "NEES/15",
        "rms/bound",
    )
    table(
        header,
        [
            (
                row.scenario,
                row.imu,
                row["filter"],
                f"{row.survived:.0%}",
                _interval(row, "rmse_position_m"),
                _digits(row.until_abort_position_m),
                ", ".join(f"{row[why]} {why}" for why in GIVEN_UP if row[why]) or "-",
                _digits(row.rmse_heading_deg),
                _digits(row.anees),
                _digits(row.bound_ratio),
            )
            for _, row in summary.iterrows()
        ],
    )


def _digits(value: float) -> str:
    return "-" if value != value else f"{value:.3g}"


def _interval(row: "pd.Series[Any]", name: str) -> str:
    """A number of a row of the summary, and its interval; a dash where no run tells it."""
    if row[name] != row[name]:
        return "-"
    return f"{_digits(row[name])} ({_digits(row[name + '_low'])}-{_digits(row[name + '_high'])})"


def advise(
    imu: GRADE,
    flight: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            autocompletion=complete.missions,
            help="dynamic (circuits), a scenario, or a .toml file.",
        ),
    ],
    duration: Annotated[str, typer.Option(metavar="T", help="90min, 2h, or seconds.")],
    runs: Annotated[
        int | None,
        typer.Option(metavar="N", help="Runs of the study."),
    ] = None,
    seed: SEED = 0,
    map: Annotated[
        bool | None,
        typer.Option(
            "--map/--no-map",
            help="Also the map of grades, durations and dynamics.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="No map, fewer runs and reset intervals.")
    ] = False,
    alignment: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="given, or moving (by an alignment).",
        ),
    ] = "given",
    out: OUT = Path("advice"),
    workers: WORKERS = 0,
    scheduler: SCHEDULER = None,
) -> None:
    """Open loop, closed loop, or reset every t seconds, for your IMU and mission: with
    intervals, and how sure it is."""
    from ..experiments.advice.advise import advise

    with results_folder(out), Progress() as progress:
        made = advise(
            imu,
            flight,
            duration,
            runs=runs,
            seed=seed,
            out=out,
            map=map,
            quick=quick,
            workers=workers,
            scheduler=scheduler,
            notify=progress.notify,
            progress=progress.track("advise"),
            alignment=alignment,
        )
    condition, answer, *others = str(made).splitlines()
    say_verdict(condition)
    say_verdict(answer)
    for line in others:
        say(line)
    record(**made.as_dict())
    wrote(out / "index.html")


def _reproduction(name: str) -> Callable[..., list[dict[str, Any]]]:
    """The function of that name that an installed package offers as an entry point."""
    offered = complete.offered_commands()
    if not offered:
        raise sd.DataError(
            f"reproduce {name}: the package strapdown-reproductions is not installed; install it "
            f"from the folder reproductions of the "
            "repository (pip install ./reproductions)"
        )
    if name not in offered:
        raise sd.DataError(
            f"nothing to reproduce is called {name!r}; there is: {', '.join(sorted(offered))}"
        )
    package = offered[name].dist
    if (
        package is not None
        and package.version != sd.__version__
        and package.name == "strapdown-reproductions"
    ):
        raise sd.DataError(
            f"reproduce {name}: {package.name} {package.version} belongs to another strapdown than "
            f"{sd.__version__}; "
            "install both from one checkout (pip install . ./reproductions)"
        )
    try:
        return offered[name].load()
    except (ImportError, AttributeError) as error:
        raise sd.DataError(
            f"reproduce {name}: {package.name if package else offered[name].value} cannot be loaded "
            f"({error}); install it again"
        ) from None


def reproduce(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            autocompletion=complete.reproductions,
            help="What to run again; an unknown name lists them.",
        ),
    ],
    out: OUT = Path("reproduction"),
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Less of it, in about a minute."),
    ] = False,
    ablations: Annotated[
        bool, typer.Option("--ablations", help="Also what decides the result, of hager-bryne.")
    ] = False,
    runs: Annotated[
        int | None, typer.Option(metavar="N", help="Runs of each configuration.")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of the random errors."),
    ] = None,
    workers: WORKERS = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Dask scheduler, tcp://HOST:PORT; of hager-bryne.",
        ),
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(help="Folder of the recordings."),
    ] = None,
    filter: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            autocompletion=complete.filters,
            help="Only this filter, of consistency and faults.",
        ),
    ] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            autocompletion=complete.scenarios,
            help="Only this scenario, of consistency.",
        ),
    ] = None,
) -> None:
    """Run a published or recorded result again: writes index.html, CSV tables and claims.json."""
    run = _reproduction(name)
    asked = dict(
        quick=quick,
        ablations=ablations,
        runs=runs,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        recordings=recordings,
        filter=filter or None,
        scenario=scenario or None,
    )
    given = {
        key: value
        for key, value in asked.items()
        if value is not None and value is not False and (key, value) != ("workers", 0)
    }
    takes = inspect.signature(run).parameters
    if foreign := [key for key in given if key not in takes]:
        own = [f"--{key}" for key in asked if key in takes]
        raise sd.DataError(
            f"reproduce {name} has no option --{foreign[0]}; it takes {', '.join(own)}"
        )
    with results_folder(out), Progress() as progress:
        told: dict[str, Callable[[], object]] = {
            "notify": lambda: progress.notify,
            "progress": lambda: progress.track(name),
        }
        claims = run(out, **given, **{key: made() for key, made in told.items() if key in takes})
    if claims and "verdict" in claims[0]:
        table(("verdict", "the paper says"), [(c["verdict"], c["claim"]) for c in claims])
    else:
        table(
            ("claim", "target", "measured", "holds"),
            [(c["claim"], c["target"], c["figure"], "yes" if c["holds"] else "no") for c in claims],
        )
    record(claims=claims)
    wrote(out / "index.html")


def allan(
    recording: Annotated[list[Path], recording_argument()],
    imu: Annotated[str | None, typer.Option(metavar="N", help="IMU N of a log.")] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="T", help="First second of the rest.")
    ] = None,
    stop: Annotated[
        float | None, typer.Option("--to", metavar="T", help="Last second of the rest.")
    ] = None,
    out: OUT = Path("allan"),
) -> None:
    """Allan deviation of an IMU at rest: its noise coefficients, their plot, and the grade they
    suggest."""
    from ..allan.page import analyse

    found, grade = read_given(recording, imu)
    if grade is not None:
        raise sd.DataError(
            f"--imu {grade}: allan finds the noise itself; give the number of an IMU of the log, or "
            f"leave it out"
        )
    analysis = analyse(found, start, stop)
    for text in analysis.notes:
        note(text)
    table(analysis.header, analysis.rows)
    say_verdict(analysis.verdict)
    record(
        span_s=analysis.recording.span,
        grade=analysis.suggestion.grade,
        disturbed=analysis.disturbed,
        coefficients=[*_coefficients(analysis)],
    )
    with results_folder(out):
        analysis.write(out)
    wrote(*(out / name for name in ("allan.html", "allan.csv", "allan-imu.toml")))


def _coefficients(analysis: "Analysis") -> Iterator[dict[str, Any]]:
    """The noise coefficients of both triads for the document, in the units of data sheets; of what
    cannot be told from zero the limit alone is known."""
    from ..allan.fit import COEFFICIENTS
    from ..units.conversion import SHEET, in_units

    for sensor in (analysis.result.gyro, analysis.result.accel):
        fit = sensor.triad.fit
        for name in fit.names:
            si = COEFFICIENTS[name].units[sensor.name]
            numbers = {"value": fit.value, "std": fit.std, "limit": fit.limit}
            yield {"sensor": sensor.name, "coefficient": name, "unit": SHEET[si]} | {
                key: in_units(of[name], si) for key, of in numbers.items()
            }


COMMANDS = (
    simulate,
    with_figures(study),
    with_figures(advise),
    reproduce,
    with_figures(allan),
)
