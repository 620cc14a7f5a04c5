"""The shell of all pages: one self-contained HTML file that works offline, requests nothing from
the network, and is written whole or not at all."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from html import escape, unescape
from importlib import resources
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..fileio.files import replacing
from ..typing import File
from .packing import deflate_text, pack_json
from .parts import paragraphs, remarks
from .pictures import save_asked
from .script import plotly_script

if TYPE_CHECKING:
    import plotly.graph_objects as go

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
"""Content security policy: a browser then refuses any request, whatever a script should try."""
DEFLATED = "application/x-deflate"
"""Type of script elements that no browser runs, with what figures.js unpacks."""
NO_SCRIPT = "<noscript><p class=note>The figures need JavaScript; the tables do not.</p></noscript>"
TILES = "https://tile.openstreetmap.org"
MAP_POLICY = f"{POLICY.replace('blob:;', f'blob: {TILES};')}; connect-src {TILES}; worker-src blob:"
"""That of a page with a map, which may ask for its tiles and for nothing else."""
USUAL_HEIGHT = 450
"""px of a figure without a height of its own: plotly's default."""
FRAME_HEIGHT = 700
"""px of a page in a cell of a notebook."""


@dataclass(frozen=True)
class Page:
    """A finished page; `html` is its text, `notes` what its reader should also be told."""

    html: str
    notes: tuple[str, ...] = ()  # one line each

    def save(self, path: File) -> None:
        """Write the page to `path`, atomically, and its figures where `saving_pictures` asks for them.
        Raises DataError where that cannot be done."""
        with replacing(path) as part:
            part.write_text(self.html, encoding="utf-8")
        save_asked(self.html)

    def _repr_html_(self) -> str:
        """The page in a frame of its own, where its scripts run and reach nothing else."""
        return (
            f"<iframe sandbox='allow-scripts' title='report' style='width:100%;height:"
            f"{FRAME_HEIGHT}px;border:1px solid rgba(128,128,128,.4);border-radius:8px' "
            f'srcdoc="{escape(self.html)}"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Page({len(self.html) / 1e6:.1f} MB of HTML; .save(path) writes it)"


@dataclass
class Document:
    """A page in the making: its title, what stands below that, {name: text}, its sections, and its
    last line."""

    title: str
    facts: Mapping[str, object]
    footer: str
    headline: str  # what the page comes to, in a sentence
    introduction: str = ""  # HTML between the headline and the sections
    style: str = ""  # further CSS
    wide: bool = False
    sections: list[tuple[str, str]] = field(default_factory=list)  # (heading, HTML)
    figures: int = 0  # number of figures placed

    def place(
        self, figure: go.Figure | None, heading: str, caption: str = "", tag: str = ""
    ) -> str:
        """HTML of the next figure of the page; "" without one. `tag` is HTML."""
        if figure is None:
            return ""
        self.figures += 1
        return figure_html(self.figures, figure, heading, caption, tag)

    def add(self, heading: str, *parts: str) -> None:
        """A section of these parts, HTML, where there are any."""
        if any(parts):
            self.sections.append((heading, "".join(parts)))

    def page(self, notes: tuple[str, ...] = (), bar: str = "", policy: str = POLICY) -> Page:
        """The Page, which also says by which software it was written and when."""
        made = f"Written by strapdown {__version__} on {datetime.now(UTC):%Y-%m-%d %H:%M} UTC."
        said = replace(self, footer=f"{self.footer} {made}")
        return Page(shell(said, facts_html(self.facts), bar, policy), notes)


def shell(document: Document, facts: str = "", bar: str = "", policy: str = POLICY) -> str:
    """HTML of a page: `facts` (HTML) below its title, `bar` that of `playback_bar`, `policy` what
    the page may load.

    Figures made by `figure_html` are drawn by plotly, of whose script the page has what they use.
    """
    title, sections, style = document.title, document.sections, document.style
    links = "".join(
        f"<a href='#s{i}'>{escape(heading)}</a>" for i, (heading, _) in enumerate(sections)
    )
    body = "".join(
        f"<section id=s{i}><details class=section open><summary><h2>{escape(heading)}</h2></summary>"
        f"{text}</details></section>"
        for i, (heading, text) in enumerate(sections)
    )
    kinds = frozenset(" ".join(re.findall("<div class=plot data-kinds='([^']*)'", body)).split())
    scripts, parts = "", ["base.js"]
    if kinds:
        scripts = f"<script type='{DEFLATED}' id=plotly>{_plotly(kinds)}</script>{NO_SCRIPT}"
        parts += ["figures.js", "linked.js", *(["playback.js"] if bar else [])]
    scripts += f"<script>{''.join(map(_shipped_text, parts))}</script>"
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}"><title>{escape(title)}</title>
<link rel="icon" href="data:,"><style>{_shipped_text("page.css")}{style}</style></head><body class="{"wide" if document.wide else ""}">
<a class=skip href="#main">To the results</a><header><div><h1>{escape(title)}</h1>{facts}</div></header>
<nav aria-label=Sections><div>{links}</div></nav><main id=main>{paragraphs(filter(None, [document.headline]), "headline")}{document.introduction}{body}</main>
<footer>{escape(document.footer)}</footer>
{bar if kinds else ""}{scripts}</body></html>
"""


@functools.lru_cache(8)
def _plotly(kinds: frozenset[str]) -> str:
    return deflate_text(plotly_script(kinds).encode())


def _shipped_text(name: str) -> str:
    """The text of a file beside this one."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def facts_html(facts: Mapping[str, object]) -> str:
    """HTML of {name: text} for the head of a page; what is empty is left out."""
    return f"<dl>{''.join(f'<div><dt>{escape(name)}</dt><dd>{escape(str(text))}</dd></div>' for name, text in facts.items() if text)}</dl>"


def figure_html(
    number: int, figure: go.Figure, heading: str, caption: str = "", tag: str = ""
) -> str:
    """HTML of a plotly figure, the page's `number`-th, with its data. `tag` is HTML."""
    said = (figure.layout.meta or {}).get("notes", ())
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    content = figure.to_plotly_json()
    kinds = dict.fromkeys(["scatter", *(trace.get("type", "scatter") for trace in content["data"])])
    return (
        f"<figure><h3>{escape(heading)}{tag}</h3><div class=plot data-kinds='{' '.join(kinds)}' "
        f"id=p{number} role=img tabindex=0 aria-label='{escape(_figure_description(heading, content))}' "
        f"style='height:{figure.layout.height or USUAL_HEIGHT}px'></div>{below}"
        f"{remarks(said)}<script type='{DEFLATED}' id=data-p{number}>{pack_json(content)}</script></figure>"
    )


def _figure_description(heading: str, content: Mapping[str, Any]) -> str:
    """Return a figure in words, for those who do not see it: its axes with their ranges, its
    lines."""
    layout, told = content["layout"], [heading]
    for letter, word in (("y", "up"), ("x", "across")):
        axes = [axis for key, axis in layout.items() if re.fullmatch(f"{letter}axis[0-9]*", key)]
        titles = [(axis.get("title") or {}).get("text") for axis in axes]
        shown = [
            f"{title}{_range_text(axis)}"
            for title, axis in zip(titles, axes)
            if isinstance(title, str)
        ]
        told += [f"{word}: {'; '.join(shown)}"] if shown else []
    names = dict.fromkeys(trace["name"] for trace in content["data"] if trace.get("name"))
    told += [f"shown: {', '.join(names)}"] if names else []
    return re.sub("<[^>]*>", " ", unescape(". ".join(told)))


def _range_text(axis: Mapping[str, Any]) -> str:
    """` from 1 to 2`, where the axis says its range."""
    low_high = axis.get("range")
    if not low_high or axis.get("type") not in (None, "linear", "log"):
        return ""
    low, high = (10.0**end if axis.get("type") == "log" else end for end in low_high)
    return f" from {low:.4g} to {high:.4g}"
