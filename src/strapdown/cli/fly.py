"""The command fly: an aircraft flown by an autopilot on a filter's estimates, with the receiver
cut on the way."""

import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

import strapdown as sd

from . import complete
from .console import (
    FILTER,
    GRADE,
    OPTION,
    SEED,
    STRICT,
    Progress,
    end,
    number,
    option_values,
    print_errors,
    print_outages,
    results_folder,
    save_page,
    summarise,
)
from .output import record, say, table, wrote

FEEDBACK = Annotated[str, typer.Option(help="The autopilot's: estimate, or truth.")]
PREDICTION = Annotated[
    str,
    typer.Option(help="While GNSS is cut: imu, model; model-always."),
]
BAROMETER = Annotated[
    bool, typer.Option("--barometer", help="Carry a barometer of 10 samples per second.")
]
WIND = Annotated[
    str | None,
    typer.Option(metavar="N,E[,D]", help="Wind towards north, east and down, m/s."),
]


def fly(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN",
            autocompletion=complete.plans,
            help="straight, turning, or a .toml file.",
        ),
    ] = "straight",
    filter: FILTER = "closed-loop",
    imu: GRADE = "industrial",
    gnss: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            autocompletion=complete.receivers,
            help="See `strapdown receivers`; or a .toml file.",
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds to fly.  [default: the plan's]")
    ] = None,
    outage: Annotated[
        str | None,
        typer.Option(
            metavar="T:T,...", help="Cut the receiver in these windows, s; 15: for the rest."
        ),
    ] = None,
    feedback: FEEDBACK = "estimate",
    prediction: PREDICTION = "imu",
    turbulence: Annotated[str, typer.Option(help="none, light, moderate or severe.")] = "none",
    wind: WIND = None,
    aircraft: Annotated[str, typer.Option(help="Aircraft, or its .toml file.")] = "aerosonde",
    seed: SEED = 0,
    barometer: BAROMETER = False,
    option: OPTION = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results.  [default: fly-PLAN-FILTER]")
    ] = None,
    strict: STRICT = False,
) -> None:
    """Fly an aircraft on a filter's estimates: writes recording.nc, solution.nc, log.csv and
    report.html."""
    from ..fileio.files import together
    from ..flight.asked import SENSORS, Loop, World
    from ..flight.figures import facts, sections
    from ..flight.run_flight import fly as flown
    from ..pages.page import Added
    from ..sensor_models.barometer import Barometer

    sensors = SENSORS._replace(imu=imu, outage=outage)
    if gnss is not None:
        sensors = sensors._replace(gnss=gnss)
    if barometer:
        sensors = sensors._replace(barometer=Barometer(rate=10.0))
    with (
        results_folder(out or Path(f"fly-{Path(plan).stem}-{filter}")) as folder,
        Progress() as progress,
    ):
        flight = flown(
            plan,
            filter,
            seed=seed,
            duration=duration,
            world=World(aircraft, wind=_wind(wind), turbulence=turbulence),
            sensors=sensors,
            loop=Loop(feedback, prediction, notify=progress.notify),
            progress=progress.track(filter),
            **_options(option, flown),
        )
        windows = withheld_outages(flight)
        if windows:
            flight.solution.meta["withheld"] = windows
        page = sd.report(
            {filter: flight.solution},
            flight.recording.reference,
            f"Flight {flight.plan.name} on {filter}",
            added=Added(sections(flight), facts(flight)),
        )
        with together():
            sd.write_recording(flight.recording, folder / "recording.nc")
            sd.write_solution(flight.solution, folder / "solution.nc")
            write_log(flight, folder / "log.csv")
            wrote(*(folder / name for name in ("recording.nc", "solution.nc", "log.csv")))
            save_page(page, folder / "report.html")
    show(flight, filter, windows)
    end(strict, [flight.solution.verdict])


def _options(items: list[str] | None, flown: Callable[..., object]) -> dict[str, float | str]:
    """{name: value} of the filter's own options, from NAME=VALUE; those that a flight decides
    are refused."""
    from ..flight.asked import DECIDED

    values = option_values(items)
    decided = {*inspect.signature(flown).parameters, *DECIDED}
    if taken := [name for name in values if name in decided]:
        raise sd.DataError(
            f"--option {taken[0]}: the flight decides this one for its filter; leave it out (--seed "
            f"and --aircraft are the flight's)"
        )
    return values


def write_log(flight: "sd.flight.Flight", path: Path) -> None:
    """Write the log of a Flight as CSV, atomically; every column's name has its unit."""
    import pandas as pd

    from ..fileio.files import write_table

    write_table(pd.DataFrame(flight.log), path, 9)


def show(flight: "sd.flight.Flight", name: str, windows: Sequence[tuple[float, float]]) -> None:
    """Print what became of a Flight: the filter's errors, the outages, and how the aircraft kept
    to its plan."""
    summarise(flight.solution)
    print_errors({name: flight.solution}, flight.recording.reference)
    print_outages(flight.solution, flight.recording.reference, windows)
    for start, stop in windows if flight.solution.has_position else []:
        say(drift(flight, start, stop))
    kept = path_errors(flight)
    table(
        ("the aircraft", "rms", "largest", "at the end"),
        [(what, *map(number, values)) for what, values in kept.items()],
    )
    if flight.stopped:
        say(str(flight.stopped))
    record(
        aircraft={what: dict(zip(PATH_ERROR_KEYS, values)) for what, values in kept.items()},
        stopped=flight.stopped,
    )


PATH_ERROR_KEYS = "rms", "largest", "at_the_end"
"""Names of the numbers of `path_errors` in the document."""


def withheld_outages(flight: "sd.flight.Flight") -> list[tuple[float, float]]:
    """[(start, stop)] in s of the outages as they are scored: to the last sample before a fix
    may be used again, or to where the flight stopped."""
    t = flight.recording.imu.t

    def last(stop: float) -> float:
        return float(t[t < stop - 1e-6][-1]) if stop < t[-1] else float(t[-1])

    return [
        (start, last(stop) if start < t[-1] else stop)
        for start, stop in flight.recording.meta["outages"]
    ]


def path_errors(flight: "sd.flight.Flight") -> dict[str, tuple[float, float, float]]:
    """{what: (RMS, the value of largest magnitude, last)}: how far the aircraft was off its plan, and
    its controls off their trim."""
    import numpy as np

    log, degrees = flight.log, np.degrees(1)
    rows = [
        ("right of its route, m", log["right of route, m"]),
        ("above its route, m", log["above route, m"]),
        (
            "airspeed less what was asked, m/s",
            log["airspeed, m/s"] - log["commanded airspeed, m/s"],
        ),
    ]
    for control, trimmed in zip(("elevator", "aileron", "rudder"), flight.trim.commands):
        rows.append((f"{control} from trim, deg", (log[f"{control}, rad"] - trimmed) * degrees))
    rows.append(("throttle from trim, %", (log["throttle"] - flight.trim.commands[3]) * 100))
    return {
        what: (
            float(np.sqrt(np.mean(values**2))),
            float(values[np.abs(values).argmax()]),
            float(values[-1]),
        )
        for what, values in rows
    }


def drift(flight: "sd.flight.Flight", start: float, stop: float) -> str:
    """A sentence on the horizontal error that an outage added, m and by the distance flown in
    it."""
    import numpy as np

    from ..evaluation.metrics import errors
    from ..geometry.geodesy import displacement

    truth, e = flight.recording.reference, errors(flight.solution, flight.recording.reference)
    scored = np.flatnonzero((e.t >= start) & (e.t <= stop))
    if len(scored) < 2:
        return f"drift in {start:g}-{stop:g} s: none, the flight ended before"
    first, last = scored[[0, -1]]
    there = truth.lla[(truth.t >= e.t[first]) & (truth.t <= e.t[last])]
    flown = np.linalg.norm(displacement(there[1:], there[:-1])[:, :2], axis=1).sum()
    grown = float(np.hypot(*(e.position[last, :2] - e.position[first, :2])))
    return f"drift in {start:g}-{stop:g} s: {number(grown)} m in {e.t[last] - e.t[first]:.3g} s, {grown / flown:.2%} of {flown:.0f} m flown"


def _wind(text: str | None) -> tuple[float, float, float]:
    """(north, east, down) m/s from "N,E" or "N,E,D"."""
    if text is None:
        return 0.0, 0.0, 0.0
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (2, 3):
        raise sd.DataError(f"--wind {text!r}: write north,east or north,east,down in m/s, as 4,-3")
    north, east, down = (*values, 0.0)[:3]
    return north, east, down
