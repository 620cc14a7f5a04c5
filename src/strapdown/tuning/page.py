"""The page of a Tuning: what was found, how the likelihood tells it, and what the innovations are
like before and after."""

from typing import TYPE_CHECKING

from ..pages.parts import TableCell, caption, fold, numbered_list, paragraphs, table
from ..pages.shell import Document, Page
from ..pages.verdict_block import judgement_html
from .figures import (
    DRAWN,
    autocorrelation_figure,
    drawn_sources,
    nis_figure,
    profiles_figure,
    rejected_figure,
    spectra_figure,
)

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from .findings import Tuning

FOOTER = "Intervals: 95 %, by profile likelihood. Whitened innovations have variance 1 and no correlation where the noise is right."

STYLE = ".text { text-align: left }"


def page(found: "Tuning") -> Page:
    """The Page of a Tuning. Raises DataError."""
    sources = drawn_sources(found.before, found.after)
    start, stop = found.seconds
    document = Document(
        f"Noise of {found.name}",
        {
            "recording": found.name,
            "time": f"{start:.1f} to {stop:.1f} s",
            "filter": found.after.meta.get("filter", ""),
            "runs of the filter": str(found.runs),
        },
        FOOTER,
        f"{found.summary}.",
        _verdict(found),
        STYLE,
    )

    def place(drawn: "go.Figure", heading: str) -> str:
        return document.place(drawn if drawn.data else None, heading)

    innovations = {
        "Spectra of the whitened innovations": spectra_figure,
        "Autocorrelation of the whitened innovations": autocorrelation_figure,
        "NIS over time": nis_figure,
        "Rejected fixes": rejected_figure,
    }
    likelihood = place(profiles_figure(found.parameters), "Likelihood of each number")
    document.add("Numbers", likelihood, _parameters(found))
    document.add(
        "Before and after",
        _fits(found),
        *(place(draw(found, sources), name) for name, draw in innovations.items()),
    )
    return document.page()


def _verdict(found: "Tuning") -> str:
    """HTML of the summary, and of what the data do not decide."""
    look, sign, word = ("right", "✓", "All numbers are decided by the data")
    if found.undecided:
        look, sign, word = ("doubt", "?", "The data do not decide everything")
    return judgement_html(
        look,
        sign,
        word,
        fold("What is not decided, and why", numbered_list(found.undecided)),
        fold("Notes", paragraphs([*found.notes, found.used])),
    )


def _parameters(found: "Tuning") -> str:
    """HTML of the table of parameters."""
    header = (
        "",
        TableCell("what it is", "text"),
        "given",
        "used",
        "unit",
        "95 % interval",
        "the data",
    )
    rows = [
        (
            each.label,
            TableCell(each.meaning, "text"),
            each.value_text(each.given) if each.given else "none",
            each.value_text(each.value),
            each.unit,
            each.interval or "open",
            each.status,
        )
        for each in found.parameters
    ]
    said = (
        "“tuned”: both ends of the interval are known. “at most”, “at least”: only that end is. "
        "“open”: any value fits. “kept”: as given, because innovations stay correlated for reasons "
        "that the model lacks."
    )
    return table(header, rows) + caption(said)


def _fits(found: "Tuning") -> str:
    """HTML of the table of sources."""
    compared = (f"{what} {when}" for what in ("NIS", "correlation", "rejected") for when in DRAWN)
    header = ("source", *compared)
    rows = [
        (
            fit.source,
            *(f"{x:.2f}" for x in (*fit.nis, *fit.correlation)),
            *(f"{100 * x:.1f} %" for x in fit.rejected),
        )
        for fit in found.fits
    ]
    said = (
        "NIS: its median over what is expected, 1 where the noise is right, above 1 where the stated standard "
        "deviations are too small. Correlation: of whitened innovations one fix apart, of all fixes, 0 where right."
    )
    return table(header, rows) + caption(said)
