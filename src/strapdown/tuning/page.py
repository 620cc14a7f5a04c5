"""The page of a Tuning: what was found, how the likelihood tells it, and what the innovations are
like before and after."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from .. import __version__
from ..reports.shell import Page, listed, placed, shell
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
    from .findings import Tuning

FOOTER = "Intervals: 95 %, by profile likelihood. Whitened innovations have variance 1 and no correlation where the noise is right."

STYLE = ".text { text-align: left }"


def page(found: "Tuning") -> Page:
    """The Page of a Tuning. Raises DataError."""
    sources = drawn_sources(found.before, found.after)
    likelihood = [("Likelihood of each number", profiles_figure(found.parameters))]
    innovations = [
        ("Spectra of the whitened innovations", spectra_figure(found, sources)),
        ("Autocorrelation of the whitened innovations", autocorrelation_figure(found, sources)),
        ("NIS over time", nis_figure(found, sources)),
        ("Rejected fixes", rejected_figure(found, sources)),
    ]
    drawn = {
        heading: placed(number, figure, heading)
        for number, (heading, figure) in enumerate([*likelihood, *innovations], 1)
        if figure.data
    }
    start, stop = found.seconds
    facts = {
        "recording": found.name,
        "time": f"{start:.1f} to {stop:.1f} s",
        "filter": found.after.meta.get("filter", ""),
        "runs of the filter": str(found.runs),
        "software": f"strapdown {__version__}",
    }
    curves, compared = (
        "".join(drawn.get(heading, "") for heading, _ in part) for part in (likelihood, innovations)
    )
    sections = [
        ("Numbers", _parameters(found) + curves),
        ("Before and after", _fits(found) + compared),
    ]
    return shell(f"Noise of {found.name}", listed(facts), sections, FOOTER, _verdict(found), STYLE)


def _verdict(found: "Tuning") -> str:
    """HTML of the summary, and of what the data do not decide."""
    look, sign = ("doubt", "?") if found.undecided else ("right", "✓")
    items = "".join(f"<li>{escape(text)}</li>" for text in found.undecided)
    notes = "".join(f"<p>{escape(text)}</p>" for text in found.notes)
    return (
        f"<div class='verdict {look}'><p class=word><i>{sign}</i>{escape(found.summary)}</p>"
        f"{f'<ol>{items}</ol>' if items else ''}{notes}<p class=untested>{escape(found.used)}</p></div>"
    )


def _html_table(header: Sequence[str], rows: Sequence[Sequence[str]], text: int = 1) -> str:
    """HTML; the first `text` columns are words, the others numbers."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=text' if i < text else ''}>{escape(cell)}</{tag}>"
            for i, cell in enumerate(row)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return (
        f"<div class=scroll><table><thead><tr>{cells('th', header)}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    )


def _parameters(found: "Tuning") -> str:
    """HTML of the table of parameters."""
    header = ("", "what it is", "given", "used", "unit", "95 % interval", "the data")
    rows = [
        (
            each.label,
            each.meaning,
            each.shown(each.given) if each.given else "none",
            each.shown(each.value),
            each.unit,
            each.interval or "open",
            each.status,
        )
        for each in found.parameters
    ]
    caption = (
        "“tuned”: both ends of the interval are known. “at most”, “at least”: only that end is. "
        "“open”: any value fits. “kept”: as given, because innovations stay correlated for reasons "
        "that the model lacks."
    )
    return _html_table(header, rows, text=2) + f"<p class=caption>{caption}</p>"


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
    caption = (
        "NIS: its median over what is expected, 1 where the noise is right, above 1 where the stated standard "
        "deviations are too small. Correlation: of whitened innovations one fix apart, of all fixes, 0 where right."
    )
    return _html_table(header, rows) + f"<p class=caption>{caption}</p>"
