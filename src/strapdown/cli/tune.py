"""The command tune: the noise of the IMU and of each source, told by a recording."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import strapdown as sd

from .console import (
    FROM,
    IMU,
    OPTION,
    RELATIVE,
    TAKE,
    TO,
    VEHICLE,
    Progress,
    grade_of,
    option_values,
    read_given,
    recording_argument,
    results_folder,
    save_page,
)
from .output import record, record_note, say, wrote

if TYPE_CHECKING:
    from ..tuning.findings import Tuning


def tune(
    recording: Annotated[list[Path], recording_argument()],
    filter: RELATIVE = "closed-loop",
    imu: IMU = None,
    take: TAKE = None,
    vehicle: VEHICLE = None,
    start: FROM = None,
    stop: TO = None,
    correlated: Annotated[
        bool,
        typer.Option(
            "--correlated/--no-correlated",
            help="Look for errors that last over many fixes.",
        ),
    ] = True,
    option: OPTION = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of results.  [default: NAME-tune; with --write none]"),
    ] = None,
    write: Annotated[
        bool,
        typer.Option(
            "--write",
            help="Change recording.toml; keep the old one as .before.",
        ),
    ] = False,
) -> None:
    """Find the noise of the IMU and of each source, and how long errors of GNSS last, from a log;
    write them for --imu and --sources, or into its recording.toml."""
    from ..tuning.noise_files import check_absent, check_changeable, imu_file, name_of, sources_file

    whole, grade = read_given(recording, imu, take)
    part = whole.between(start, stop)
    named = grade or grade_of(whole)
    folder = out if write else out or Path(f"{name_of(part)}-tune")
    if write:
        check_changeable(part, recording[0])
        check_absent(recording[0].with_name(imu_file(part)))
    elif folder:
        check_absent(folder / imu_file(part), folder / sources_file(part))
    with results_folder(folder) if folder else nullcontext(), Progress() as progress:
        found = sd.tune(
            part,
            filter,
            imu=named,
            vehicle=vehicle,
            correlated=correlated,
            notify=progress.notify,
            progress=progress.track("tune"),
            options=option_values(option),
        )
        for line in found.lines:
            say(line)
        record(parameters=found.table(), span_s=found.seconds, runs=found.runs)
        for text in found.notes:
            record_note(text)
        _write_results(found, recording[0], folder, write)


def _write_results(found: "Tuning", path: Path, folder: Path | None, write: bool) -> None:
    """Write what was asked for, all or nothing; say how to use it."""
    from ..fileio.files import together

    lines, written = [], []
    with together():
        if write:
            changes = found.diff(path)
            imu, kept = found.change(path)
            written = [path, imu]
            lines = [f"changed in {path}:", *(f"  {line}" for line in changes)]
            lines += [f"the old file is {kept}", f"it names {imu} as grade"]
        elif folder:
            imu, sources = written = found.write(folder)
            lines = [f"to use them: strapdown fuse {path} --imu {imu} --sources {sources}"]
        wrote(*written)
        if folder:
            save_page(found.page(), folder / "tune.html")
    for line in lines:
        say(line)
