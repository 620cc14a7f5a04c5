"""The commands calibrate: bias, scale, misalignment and soft iron of accelerometer and magnetometer
from a record, and calibrate installation: clocks, lever arms, mounting and scale from a log."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import strapdown as sd

from .console import (
    FROM,
    IMU,
    OPTION,
    OUT,
    RELATIVE,
    TAKE,
    TO,
    VEHICLE,
    Progress,
    grade_of,
    option_values,
    read_given,
    record_parameters,
    recording_argument,
    results_folder,
    save_page,
    with_figures,
)
from .help import ResultCommand
from .output import note, record, say, say_verdict, table, wrote

if TYPE_CHECKING:
    from ..calibration.installation.findings import Installation

SENSORS, INSTALLATION = "sensors", "installation"
"""Commands of the group: the first stands without its name, and where it is not the second."""


class CommandGroup(TyperGroup):
    """`calibrate RECORDING`, and `calibrate installation RECORDING`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As click asks."""
        if args[:1] not in ([INSTALLATION], ["--help"]):
            args = [SENSORS, *args]
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help of the command without a name."""
        command = self.commands[SENSORS]
        own = command.context_class(command, info_name=ctx.info_name, parent=ctx.parent)
        command.format_help(own, formatter)


class Unnamed(ResultCommand):
    """The command of a group that stands without its name."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """As click asks."""
        return super().make_context(parent.info_name, args, parent.parent, **extra)

    def usages(self, ctx: Any) -> list[str]:
        """Its own, then that of the other command."""
        return [*super().usages(ctx), f"{ctx.command_path} {INSTALLATION} [OPTIONS] RECORDING"]


group = typer.Typer(
    cls=CommandGroup,
    name="calibrate",
    help="Calibrate accelerometer or magnetometer from a record, or the installation from a log.",
)

SENSOR = Annotated[
    str | None,
    typer.Option(help="accelerometer, magnetometer, or a magnetometer's name."),
]


@group.command(SENSORS, cls=Unnamed, hidden=True)
@with_figures
def calibrate(
    recording: Annotated[list[Path], recording_argument()],
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
    found = sd.calibrate(read_given(recording)[0], sensor, start, stop)
    for text in found.notes:
        note(text)
    table(found.header, found.rows)
    if {"bias", "matrix", "temperature"} & set(found.columns):
        say(
            "these numbers are on top of the calibration that the recording names; the file holds "
            "both"
        )
    say_verdict(found.verdict)
    _record(found)
    with results_folder(out):
        found.write(out)
    say(f"in recording.toml: {found.hint.format(f'{out}/calibration.toml')}")
    wrote(out / "calibration.toml", out / "calibration.html")


def _record(found: "sd.Calibration") -> None:
    """Add a calibration of a sensor to the document, in m/s^2 or T."""
    bias_std, matrix_std = found.std
    record(
        sensor=found.sensor,
        form=found.form,
        unit="m/s^2" if found.sensor == "accelerometer" else "T",
        bias=found.bias,
        bias_std=bias_std,
        matrix=found.matrix,
        matrix_std=matrix_std,
        strength=found.strength,
        rms_before=found.before,
        rms_after=found.after,
        residual_rms=found.residual,
        coverage=found.coverage,
        lacking=found.lacking,
        held=found.held,
    )


@group.command(INSTALLATION, cls=ResultCommand)
@with_figures
def installation(
    recording: Annotated[list[Path], recording_argument()],
    write: Annotated[
        bool,
        typer.Option(
            "--write",
            help="Change recording.toml; keep the old one as .before.",
        ),
    ] = False,
    imu_clock: Annotated[
        bool,
        typer.Option(
            "--imu-clock",
            help="The IMU's own time stamps are wrong.",
        ),
    ] = False,
    filter: RELATIVE = "closed-loop",
    imu: IMU = None,
    take: TAKE = None,
    vehicle: VEHICLE = None,
    start: FROM = None,
    stop: TO = None,
    option: OPTION = None,
    out: Annotated[Path | None, typer.Option(help="Folder for a page.  [default: none]")] = None,
) -> None:
    """Find clock offsets, lever arms, mounting and odometer scale from a log, and write them into
    its recording.toml."""
    from ..fileio.files import together

    options: dict[str, Any] = option_values(option)
    whole, grade = read_given(recording, imu, take)
    part = whole.between(start, stop)
    with results_folder(out) if out else nullcontext(), Progress() as progress:
        found = sd.calibrate_installation(
            part,
            filter,
            imu=grade or grade_of(whole),
            vehicle=vehicle,
            imu_clock=imu_clock,
            notify=progress.notify,
            progress=progress.track("calibrate installation"),
            options=options,
        )
        for line in found.lines:
            say(line)
        record_parameters(found.parameters)
        record(changes=found.changes)
        with together():
            lines, refusal = _change(found, recording[0], write)
            if out:  # the page says what was written
                save_page(found.page(), out / "installation.html")
        for line in lines:
            say_verdict(line)
    if refusal:
        raise refusal


def _change(
    found: "Installation", path: Path, write: bool
) -> tuple[list[str], sd.DataError | None]:
    """(What changes in the file, as lines; why not, where it was asked to and cannot). With
    `write` it is changed."""
    if not found.edits and not (write and found.unsure):
        return [f"nothing to change in {path}"], None
    try:
        lines = found.diff(path)
        kept = found.write(path) if write else None
        wrote(*[path] * write)
    except sd.DataError as error:
        by_hand = "to change by hand:" if found.changes else "nothing to change"
        told = [by_hand, *(f"  {line}" for line in found.changes)]
        return (told, error) if write else ([*told, f"note: {error}"], None)
    told = [f"changed in {path}:" if write else f"to change in {path} (--write does it):"]
    told += [f"  {line}" for line in lines]
    return [*told, f"the old file is {kept}"] if kept else told, None
