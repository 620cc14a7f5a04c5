"""The command that exports a filter for firmware and other languages."""

from pathlib import Path
from typing import Annotated

import typer

import strapdown as sd

from . import complete
from .console import (
    FILTER,
    IMU,
    OPTION,
    VEHICLE,
    Progress,
    option_values,
    read_given,
    results_folder,
)
from .output import note, record, say, wrote

REPLAYED = 60.0
"""s of the flight that is simulated where no recording is given."""


def export(
    sources: Annotated[
        str,
        typer.Option(
            metavar="KIND,...",
            autocompletion=complete.kinds,
            help="Kinds of fixes that it takes.",
        ),
    ],
    target: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            autocompletion=complete.targets,
            help="host, aarch64, cortex-m4f, cortex-m7, wasm32, x86-64-v2 or -v3.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of results.")],
    filter: FILTER = "closed-loop",
    imu: IMU = None,
    vehicle: VEHICLE = None,
    option: OPTION = None,
    replay: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RECORDING",
            help="Replayed by the example.  [default: a minute's flight]",
        ),
    ] = None,
    waiting: Annotated[
        int, typer.Option(metavar="N", help="Fixes that may wait for a sample.")
    ] = 16,
) -> None:
    """Write a filter as an object file with a C header, an example and a README, for firmware,
    WebAssembly and other languages."""
    from ..native.export import chosen, folder as exported

    options = option_values(option)
    made_for = exported.find_target(target)
    if replay:
        recording, imu = read_given(replay, imu)
    else:
        from ..sim.trajectory import demo_flight

        recording = sd.simulate(demo_flight(), REPLAYED, imu or "tactical", 7)
    kinds = [kind.strip() for kind in sources.split(",") if kind.strip()]
    what = chosen.choose_export(filter, kinds, recording, imu, vehicle, options, waiting)
    with results_folder(out) as folder:
        with Progress() as progress:
            done = exported.export(what, made_for, folder, progress.notify)
    for text in done.notes:
        note(text)
    say(done.sizes.text)
    say(f"{folder}/README.md says how to go on")
    record(target=target, sizes_bytes=done.sizes)
    wrote(*(folder / name for name in done.files))
