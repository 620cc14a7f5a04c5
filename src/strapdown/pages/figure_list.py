"""The figures of the report page, in its order: one list, to which plugins add."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import plotly.graph_objects as go

from .. import plugins
from ..checks import DataError, check_keys
from ..core.loop.contract import ATT, BA, BG, POS, VEL
from ..data import calibration_parameters
from ..data.solution import Solution, Trajectory
from ..evaluation import metrics
from ..evaluation.metrics import Errors
from . import figures, fix_figures, installation_figures, sensor_figures, separation_figures
from .summary import claimed_std

Text: TypeAlias = str | Callable[[Sequence[Solution]], str]
"""A text, or what makes it of the solutions that it is about."""
Draw: TypeAlias = Callable[..., go.Figure | None]
TAKES = ("errors", "scores", "colour", "window", "recording", "solutions")
"""Names that `Figure.takes` may have."""


class Figure(NamedTuple):
    """A figure of the report page.

    `draw(solution, reference)` returns a plotly Figure, or None where the figure does not apply to
    that solution. It is called once for each Solution of the page. `reference` is a Trajectory, or
    None where there is none that the solutions are scored by. Sentences in a list
    `figure.layout.meta["notes"]` are shown below it; `figure.layout.height` is in pixels.

    A draw that raises does not lose the page: one line says which figure and why in its place, and
    so does `Page.notes`.
    """

    name: str  # in the list, and where something is said of it
    title: str | Text  # above it
    draw: Draw
    caption: Text = ""  # below it
    section: str = "More figures"  # heading on the page under which it stands
    # what `draw` also takes, by name: "errors", the metrics.Errors of the solution or None;
    # "scores", {name: Errors} of all; "colour", of the solution on this page; "window", (start,
    # stop) s that is scored or None; "recording", the Recording that they were made of, None where
    # it is not known; "solutions", {name: Solution} of all
    takes: tuple[str, ...] = ()
    # one figure of all solutions: `draw` gets {name: Solution} instead of a Solution, and neither
    # errors nor colour
    together: bool = False


def figures_of_page() -> list[Figure]:
    """Those of the library, then those of plugins."""
    return [*FIGURES, *(figure for figure, _ in REGISTRY.plugin_values().values())]


def _own_figure(name: str) -> Figure | None:
    return next((figure for figure in FIGURES if figure.name == name), None)


def check(figure: Figure) -> None:
    """Refuse a Figure that cannot be used. Raises DataError."""
    if not figure.title:
        raise DataError(f"figure {figure.name!r}: its title must be text")
    if not callable(figure.draw):
        raise DataError(
            f"figure {figure.name!r}: draw is {figure.draw!r}; it must be a function of a Solution "
            f"and a reference"
        )
    check_keys(figure.takes, TAKES, f"figure {figure.name!r}, takes")


REGISTRY = plugins.Registry(
    Figure, "no figure is called", _own_figure, lambda: [figure.name for figure in FIGURES], check
)


def _band_caption(states: slice, claimed: str, before: str = "", after: str = "") -> Text:
    """A caption with the words on the band where the filter claims standard deviations of those
    states."""
    return lambda shown: before + (claimed if _any_claimed(shown, states) else "") + after


def _any_claimed(shown: Sequence[Solution], states: slice) -> bool:
    return any(metrics.any_known(claimed_std(solution)[:, states]) for solution in shown)


def _whitens(solution: Solution) -> bool:
    """Return True where the solution has the expected size of its innovations."""
    return metrics.any_known(solution.innovations.root)


def _claimed_title(shown: Sequence[Solution]) -> str:
    """Title of the figure of claimed uncertainty: which there is."""
    parts = (
        ("position", slice(0, 2)),
        ("height", slice(2, 3)),
        ("velocity", VEL),
        ("attitude", ATT),
    )
    known = [name for name, states in parts if _any_claimed(shown, states)]
    if "position" in known:
        known = [name for name in known if name != "height"]
    return f"3σ of {', '.join(known)}"


def _of_errors(draw: Draw) -> Draw:
    """`draw` of the errors where there is a reference."""

    def draw_errors(
        solutions: dict[str, Solution],
        reference: Trajectory | None,
        scores: dict[str, Errors],
        window: tuple[float, float] | None,
    ) -> go.Figure | None:
        return draw(solutions, scores, window) if scores else None

    return draw_errors


def _draw_scored(part: str, draw: Draw) -> Draw:
    """`draw` of those solutions whose errors of that `part` are known."""

    def draw_known(
        solutions: dict[str, Solution],
        scores: dict[str, Errors],
        window: tuple[float, float] | None,
    ) -> go.Figure | None:
        known = {name: e for name, e in scores.items() if metrics.any_known(getattr(e, part))}
        return draw(solutions, known, window) if known else None

    return _of_errors(draw_known)


def _angles(
    solutions: dict[str, Solution],
    scores: dict[str, Errors],
    window: tuple[float, float] | None,
) -> go.Figure | None:
    """The angles of the attitude error, where one solution of the page has no position."""
    if all(metrics.any_known(e.horizontal) for e in scores.values()):
        return None
    return figures.attitude_angles(solutions, scores, window)


def _of_installation(name: str) -> Figure:
    """The figure of the parameters of the installation of that name."""
    return Figure(
        f"installation-{name}",
        name.replace("-", " ").capitalize(),
        lambda all, reference: installation_figures.estimates(all, name),
        "True − given, with ±2σ; dashed: ±2σ of the prior.",
        INSTALLATION,
        together=True,
    )


SENSORS = "Sensors"
"""Heading of the section of what the sensors read, where a table stands first."""
INSTALLATION = "Installation"
"""Heading of the section of what of the installation was estimated, where a table stands first."""
AS_ERRORS = ("scores", "window")
FIGURES: list[Figure] = [
    Figure(
        "track",
        "Seen from above",
        figures.track,
        "Dots are position fixes: the estimate plus its innovation.",
        "Track",
        together=True,
    ),
    Figure(
        "height",
        "Height",
        figures.height,
        "Above the WGS-84 ellipsoid. Dots are position fixes.",
        "Track",
        together=True,
    ),
    Figure(
        "horizontal-error",
        "Horizontal error",
        lambda all, reference, scores: figures.horizontal(all, scores) if scores else None,
        _band_caption(slice(0, 2), "It should stay below the dotted 3σ that the filter claims."),
        "Track",
        ("scores",),
        together=True,
    ),
    Figure(
        "track-3d",
        "In three dimensions",
        figures.space,
        "All axes to one scale: drag to turn, scroll to come closer.",
        "Track",
        together=True,
    ),
    Figure(
        "position-error",
        "Position error",
        _draw_scored("position", figures.position),
        _band_caption(POS, "With the ±3σ band that the filter claims."),
        "Errors",
        AS_ERRORS,
        together=True,
    ),
    Figure(
        "velocity-error",
        "Velocity error",
        _draw_scored("velocity", figures.velocity),
        _band_caption(VEL, "With its ±3σ band."),
        "Errors",
        AS_ERRORS,
        together=True,
    ),
    Figure(
        "attitude-error",
        "Attitude error",
        _draw_scored("rph", figures.attitude),
        _band_caption(
            ATT,
            "; ±3σ bands from the rotation vector, correlations neglected",
            "Heading wrapped to ±180 deg",
            ".",
        ),
        "Errors",
        AS_ERRORS,
        together=True,
    ),
    Figure(
        "attitude-angles",
        "Angle of the attitude error",
        _of_errors(_angles),
        "Of the whole rotation, of the vertical, and about it: without signs, and alike in every "
        "attitude.",
        "Errors",
        AS_ERRORS,
        together=True,
    ),
    Figure(
        "position",
        "Position",
        lambda all, reference: figures.position(all) if reference is None else None,
        _band_caption(POS, ", with ±3σ", "North and east from the start, and height", "."),
        "Motion",
        together=True,
    ),
    Figure(
        "heave",
        "Heave",
        figures.heave,
        _band_caption(
            slice(2, 3),
            ", with ±3σ",
            "Height, upwards, about its mean",
            "; a reference about its own.",
        ),
        "Motion",
        together=True,
    ),
    Figure(
        "velocity",
        "Velocity",
        lambda all, reference: figures.velocity(all, compare=reference),
        _band_caption(VEL, "With ±3σ."),
        "Motion",
        together=True,
    ),
    Figure(
        "attitude",
        "Attitude",
        lambda all, reference: figures.attitude(all, compare=reference),
        _band_caption(ATT, "; with ±3σ", "Heading is clockwise from north", "."),
        "Motion",
        together=True,
    ),
    Figure(
        "sigma",
        _claimed_title,
        lambda all, reference: figures.sigma(all),
        "Logarithmic axes: it falls with aiding and grows without.",
        "Claimed uncertainty",
        together=True,
    ),
    Figure(
        "separation",
        "Separation of filter and smoother",
        lambda all, reference: separation_figures.separation(all),
        "The filter knows the past alone, the smoother all: their difference should stay below its "
        "dotted 3σ. It is no difference of a forward and a backward solution, since the smoother "
        "contains the filter.",
        "Claimed uncertainty",
        together=True,
    ),
    Figure(
        "accel-bias",
        "Accelerometer bias",
        lambda all, reference: figures.accel_bias(all),
        _band_caption(BA, ", with ±3σ", "In body axes, forward, right, down", "."),
        "Biases",
        together=True,
    ),
    Figure(
        "gyro-bias",
        "Gyro bias",
        lambda all, reference: figures.gyro_bias(all),
        _band_caption(BG, ", with ±3σ", "In body axes, forward, right, down", "."),
        "Biases",
        together=True,
    ),
    *(
        _of_installation(name)
        for name in (*calibration_parameters.OF_SOURCE, *calibration_parameters.OF_IMU)
    ),
    Figure(
        "innovations",
        "Innovations",
        lambda s, reference, solutions: fix_figures.innovations(s, solutions),
        lambda shown: (
            "Fix − estimate: around zero and without pattern when all is well"
            f"{', 95 % within the dotted ±2σ' if any(map(_whitens, shown)) else ''}. Rejected fixes "
            f"have a mark for each probable cause."
        ),
        "Fixes",
        ("solutions",),
    ),
    Figure(
        "nis",
        "Normalised innovation squared",
        lambda s, reference, solutions: fix_figures.nis(s, solutions),
        "A fix above the gate is rejected.",
        "Fixes",
        ("solutions",),
    ),
    Figure(
        "whiteness",
        "Autocorrelation of innovations",
        lambda all, reference: fix_figures.whiteness(all),
        "Of accepted fixes, mean over the components. Of a right filter 95 % of the lags lie "
        "between the dashed lines; what lies above says that errors last.",
        "Fixes",
        together=True,
    ),
    Figure(
        "nis-quantiles",
        "NIS over chi-square",
        lambda all, reference: fix_figures.nis_quantiles(all),
        "Quantiles, rejected fixes too. Above the dashed line innovations are larger than the "
        "filter claims, below it smaller.",
        "Fixes",
        together=True,
    ),
    Figure(
        "weights",
        "Robust and adaptive sources",
        lambda s, reference: fix_figures.weights(s),
        "Weight: the stated variance of a fix over that with which it was used. Noise: the standard "
        "deviations that a source was found to have, over those stated.",
        "Fixes",
    ),
    Figure(
        "readings",
        "Specific force and angular rate",
        lambda all, reference, recording: sensor_figures.readings(recording, all),
        "As read, biases included, in body axes, forward, right, down.",
        SENSORS,
        ("recording",),
        together=True,
    ),
    Figure(
        "temperature",
        "Temperature",
        lambda all, reference, recording: sensor_figures.temperature(recording, all),
        "As the IMU measured it. A bias that follows it can be corrected by a table of biases over "
        "temperature in the calibration file.",
        SENSORS,
        ("recording",),
        together=True,
    ),
    Figure(
        "spectra",
        "Vibration",
        lambda all, reference, recording: sensor_figures.spectra(recording),
        "Power spectral density, one-sided, by Welch's method. Peaks are vibration; dashed is the "
        "white noise of the grade of the IMU.",
        SENSORS,
        ("recording",),
        together=True,
    ),
    Figure(
        "intervals",
        "Intervals",
        lambda all, reference, recording: sensor_figures.intervals(recording, all),
        "From sample to sample: what leaves the level is jitter or a gap.",
        SENSORS,
        ("recording",),
        together=True,
    ),
    Figure(
        "extra",
        "Columns of the filter",
        lambda s, reference, colour: figures.extra(s, colour),
        "What this filter publishes besides the navigation state.",
        "Filter columns",
        ("colour",),
    ),
]
"""The figures of a report page, in its order; `Motion` is headed `Estimates` without a reference."""
