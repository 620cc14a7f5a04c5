"""The command calibrate: bias, scale, misalignment and soft iron of accelerometer and
magnetometer from a record."""

from pathlib import Path
from typing import Annotated

import typer

import strapdown as sd

from .console import OUT, recording_argument, results_folder, table

SENSOR = Annotated[
    str | None,
    typer.Option(
        help="accelerometer, magnetometer, or the name of a magnetometer.  "
        "[default: magnetometer, where there is one]"
    ),
]


def calibrate(
    recording: Annotated[Path, recording_argument("; docs/calibrate.md tells how to record it.")],
    sensor: SENSOR = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="T", help="First second to use.")
    ] = None,
    stop: Annotated[
        float | None, typer.Option("--to", metavar="T", help="Last second to use.")
    ] = None,
    out: OUT = Path("calibration"),
) -> None:
    """Calibrate accelerometer or magnetometer from a record: the file that recording.toml names
    as calibration, residuals, coverage."""
    found = sd.calibrate(sd.read(recording), sensor, start, stop)
    for note in found.notes:
        print(f"note: {note}")
    table(found.header, found.rows)
    if {"bias", "matrix", "temperature"} & set(found.columns):
        print(
            "these numbers are on top of the calibration that the recording names; the file holds "
            "both"
        )
    print(found.verdict)
    with results_folder(out):
        found.write(out)
    print(f"wrote {out}/calibration.toml, calibration.html")
    print(f"in recording.toml: {found.hint.format(f'{out}/calibration.toml')}")
