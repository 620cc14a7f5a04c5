"""What all pages share: one self-contained HTML file that works offline, asks the network for
nothing, and is written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from typing import TYPE_CHECKING

from ..files import replacing
from ..typing import File

if TYPE_CHECKING:
    import plotly.graph_objects as go

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
"""Content security policy: a browser then refuses any request, whatever a script should try."""
USUAL_HEIGHT = 450
"""px of a figure that does not say its own, which is plotly's."""
FRAME_HEIGHT = 700
"""px of a page in a cell of a notebook."""


@dataclass(frozen=True)
class Page:
    """A finished page; `html` is its text, `notes` what its reader should also be told."""

    html: str
    notes: tuple[str, ...] = ()  # one line each

    def save(self, path: File) -> None:
        """Write the page to `path`, atomically. Raises DataError where it cannot be written."""
        with replacing(path) as part:
            part.write_text(self.html, encoding="utf-8")

    def _repr_html_(self) -> str:
        """The page in a frame of its own, where its scripts run and reach nothing else."""
        return (
            f"<iframe sandbox='allow-scripts' title='report' style='width:100%;height:"
            f"{FRAME_HEIGHT}px;border:1px solid rgba(128,128,128,.4);border-radius:8px' "
            f'srcdoc="{escape(self.html)}"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Page({len(self.html) / 1e6:.1f} MB of HTML; .save(path) writes it)"


def shell(
    title: str,
    facts: str,
    sections: Sequence[tuple[str, str]],
    footer: str,
    introduction: str = "",
    style: str = "",
    wide: bool = False,
    notes: tuple[str, ...] = (),
) -> Page:
    """The Page around sections [(heading, HTML)]; `facts` and `introduction` are HTML, `footer` is
    text, `style` further CSS, `notes` are those of the Page.

    Figures made by `placed` are drawn where there are any; a page without them does without plotly,
    4 MB of script.
    """
    links = "".join(
        f"<a href='#s{i}'>{escape(heading)}</a>" for i, (heading, _) in enumerate(sections)
    )
    body = "".join(
        f"<section id=s{i}><h2>{escape(heading)}</h2>{text}</section>"
        for i, (heading, text) in enumerate(sections)
    )
    scripts = ""
    if "<div class=plot" in body:
        from plotly.offline import get_plotlyjs

        scripts = f"<script>{get_plotlyjs()}</script><script>{_shipped('page.js')}</script>"
    text = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{POLICY}"><title>{escape(title)}</title>
<link rel="icon" href="data:,"><style>{_shipped("page.css")}{style}</style></head><body class="{"wide" if wide else ""}">
<header><div><h1>{escape(title)}</h1>{facts}</div></header><nav><div>{links}</div></nav><main>{introduction}{body}</main>
<footer>{escape(footer)}</footer>
{scripts}</body></html>
"""
    return Page(text, notes)


def _shipped(name: str) -> str:
    """The text of a file beside this one."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def listed(facts: Mapping[str, object]) -> str:
    """HTML of {name: text} for the head of a page; what is empty is left out."""
    return f"<dl>{''.join(f'<div><dt>{escape(name)}</dt><dd>{escape(str(text))}</dd></div>' for name, text in facts.items() if text)}</dl>"


def placed(number: int, figure: go.Figure, heading: str, caption: str = "", tag: str = "") -> str:
    """HTML of a plotly figure, the page's `number`-th; its data follow as JSON, in which plotly
    writes no `<`. `tag` is HTML."""
    said = (figure.layout.meta or {}).get("notes", ())
    notes = "".join(f"<p class=note>{escape(text)}</p>" for text in said)
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return (
        f"<figure><h3>{escape(heading)}{tag}</h3><div class=plot id=p{number} "
        f"style='height:{figure.layout.height or USUAL_HEIGHT}px'></div>{below}{notes}"
        f"<script type='application/json' id=data-p{number}>{figure.to_json()}</script></figure>"
    )
