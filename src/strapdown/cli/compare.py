"""The command compare: filters side by side on the same GNSS outages of one recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import strapdown as sd

from ..units.wording import count_text
from . import complete
from .console import (
    ADAPTIVE,
    AHRS,
    ESTIMATE,
    FROM,
    IMU,
    ROBUST,
    SOURCES,
    STRICT,
    TAKE,
    TO,
    VEHICLE,
    Progress,
    end,
    estimates,
    memories,
    number,
    print_verdicts,
    read_given,
    recording_argument,
    results_folder,
    robust_sources,
    triple,
)
from .output import known_columns, note, record, say, table, wrote

if TYPE_CHECKING:
    import pandas as pd

FILTERS = Annotated[
    list[str] | None,
    typer.Option(
        metavar="A,B,...",
        autocompletion=complete.filters,
        help="NAME:option=value,...  [default: those of position]",
    ),
]
OUTAGES = Annotated[
    str,
    typer.Option(
        metavar="PROTOCOL",
        help="30/300 (30 s of every 300 s), 15: (from 15 s on), 100:130 (a window), 10,30@240:575/5 (a sweep: windows of 10 and of 30 s, one every 5 s).",
    ),
]
KINDS = Annotated[
    str | None,
    typer.Option(
        metavar="KIND,...",
        autocompletion=complete.kinds,
        help="What is withheld.  [default: position,velocity]",
    ),
]


def compare(
    recording: Annotated[list[Path], recording_argument()],
    filters: FILTERS = None,
    outages: OUTAGES = "30/300",
    imu: IMU = None,
    sources: SOURCES = None,
    take: TAKE = None,
    vehicle: VEHICLE = None,
    kinds: KINDS = None,
    start: FROM = None,
    stop: TO = None,
    estimate: ESTIMATE = None,
    robust: ROBUST = None,
    adaptive: ADAPTIVE = None,
    ahrs: AHRS = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results.  [default: NAME-compare]")
    ] = None,
    strict: STRICT = False,
) -> None:
    """Compare filters in the same GNSS outages, with the same start and noise: writes index.html
    and CSV tables."""
    whole, grade = read_given(recording, imu, take, sources)
    part = whole.between(start, stop)
    given: dict[str, Any] = {"kinds": tuple(words(kinds))} if kinds is not None else {}
    with (
        results_folder(
            out or Path(f"{part.meta.get('name') or recording[0].stem}-compare")
        ) as folder,
        Progress() as progress,
    ):
        found = sd.compare(
            part,
            labels(filters),
            outages=outages,
            imu=grade,
            vehicle=vehicle,
            ahrs=ahrs,
            estimate=estimates(estimate),
            robust=robust_sources(robust),
            adaptive=memories(adaptive),
            notify=progress.notify,
            progress=progress.track("compare"),
            **given,
        )
        found.write(folder)
    show(found)
    wrote(*(folder / name for name in WRITTEN))
    end(strict, found.verdicts.values())


def labels(items: Sequence[str] | None) -> list[str] | None:
    """["NAME:option=value,option=value", ...] from words that are separated by commas too; None
    where none is given.

    A piece with "=" but without ":" is a further option of the filter before it. Raises DataError.
    """
    if not items:
        return None
    found: list[str] = []
    for item in items:
        begun = len(found)
        for piece in words(item):
            if "=" not in piece or ":" in piece.partition("=")[0]:
                found.append(piece)
            elif len(found) > begun and ":" in found[-1]:
                found[-1] += f",{piece}"
            else:
                raise sd.DataError(
                    f"--filters {item!r}: {piece!r} belongs to no filter; write NAME:{piece}"
                )
    if not found:
        raise sd.DataError(
            f"--filters {items[0]!r}: it names no filter; `strapdown filters` lists them"
        )
    return found


def words(text: str) -> list[str]:
    """The words of a text between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


def show(found: "sd.Comparison") -> None:
    """Print what a Comparison says: the verdicts, the notes, the protocol, the RMSE of each outage where they
    are few, the summary, the answer, who failed."""
    from ..experiments.outages.figures import are_listed
    from ..experiments.outages.tables import in_order
    from ..experiments.outages.texts import sentences

    print_verdicts(found.verdicts)
    for text in found.notes:
        note(text)
    # that of a list counts them itself
    count = "" if "outage" in found.words else f": {count_text(len(found.windows), 'outage')}"
    say(f"{found.words}{count}, without {' and '.join(found.kinds)}")
    start = found.settings["start"]
    say(f"start of all filters at {start['t']:.2f} s: {start['note']}")
    if are_listed(found):
        made = found.table()

        def three(i: int, name: str) -> str:
            return triple([made[axis, name].loc[i] for axis in AXES])

        say("RMSE N E D in each outage, m")
        table(
            ("outage", "from-to, s", *found.filters),
            [
                (i, f"{start:.10g}-{stop:.10g}", *(three(i, name) for name in found.filters))
                for i, (start, stop) in enumerate(found.windows, 1)
            ],
        )
    table(*known_columns(HEAD, [_row(row) for _, row in in_order(found).iterrows()]))
    for line in sentences(found):
        say(line)
    record(
        protocol=found.protocol,
        kinds=found.kinds,
        start={"t_s": start["t"], "note": start["note"]},
        windows_s=found.windows,
        scores=found.scores,
        summary=in_order(found),
        answer=list(sentences(found)),
    )


WRITTEN = "index.html", "scores.csv", "summary.csv", "paired.csv", "growth.csv", "table.csv"
AXES = ("North", "East", "Down")
"""Axes in the table of the outages."""
HEAD = (
    "filter",
    "length, s",
    "scored",
    "RMSE N E D, m (mean)",
    "horizontal, m (median)",
    "at the end, m (median, 90 %, largest)",
    "drift, % (median)",
    "heading, deg (median)",
)
"""Header of the summary."""


def _row(row: "pd.Series[Any]") -> tuple[str, ...]:
    """The cells of a row of the summary."""
    ends = triple([row[f"horizontal_end_{what}_m"] for what in ("median", "p90", "max")])
    rmse = triple([row[f"{axis.lower()}_rmse_mean_m"] for axis in AXES])
    return (
        row["filter"],
        f"{row['length_s']:g}",
        f"{row['n']} of {row['n'] + row['failures']}",
        rmse,
        number(row["horizontal_rmse_median_m"]),
        ends,
        number(row["drift_median_percent"]),
        number(row["heading_rmse_median_deg"]),
    )
