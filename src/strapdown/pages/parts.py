"""Pieces of a page as HTML: tables, lists, paragraphs, captions and notes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

LISTED = 500
"""At most this many notes or events are listed."""


class Html(str):
    """Text that is HTML already."""


class Ruled(list[object]):
    """A row with a rule above it."""


class TableCell(NamedTuple):
    """A cell of a table with a look of its own."""

    text: object
    kind: str = ""  # its classes in page.css or in the style of the page
    columns: int = 1  # that it covers
    rows: int = 1


def table(
    head: Iterable[object],
    rows: Iterable[Iterable[object]],
    kind: str = "",
    above: Iterable[object] = (),
    foot: Iterable[Iterable[object]] = (),
) -> str:
    """An HTML table of texts, of Html and of `TableCell`; texts are escaped. kind: further classes of the
    block around it; above: a row over the head; foot: rows below, which stay in view."""
    heads = "".join(_row("th", row) for row in (list(above), head) if row)
    body, below = ("".join(_row("td", row) for row in part) for part in (rows, foot))
    foot_part = f"<tfoot>{below}</tfoot>" if below else ""
    return (
        f"<div{classes(f'scroll {kind}'.strip())}><table><thead>{heads}</thead>"
        f"<tbody>{body}</tbody>{foot_part}</table></div>"
    )


def _row(tag: str, cells: Iterable[object]) -> str:
    """A row of an HTML table, of cells `tag`."""
    rule = classes("rule") if isinstance(cells, Ruled) else ""
    return f"<tr{rule}>{''.join(_cell(tag, cell) for cell in cells)}</tr>"


def _cell(tag: str, cell: object) -> str:
    text, kind, columns, rows = cell if isinstance(cell, TableCell) else TableCell(cell)
    look = classes(kind)
    look += f" colspan={columns}" if columns > 1 else ""
    look += f" rowspan={rows}" if rows > 1 else ""
    return f"<{tag}{look}>{markup(text)}</{tag}>"


def markup(text: object) -> str:
    """HTML of a text; Html stays as it is."""
    return text if isinstance(text, Html) else escape(str(text))


def classes(kind: str) -> str:
    """The attribute of an element of these classes."""
    quote = "'" if " " in kind else ""
    return f" class={quote}{kind}{quote}" if kind else ""


def split_cells(cells: Iterable[object], every: int) -> list[TableCell]:
    """Cells with a rule left of the first of every so many."""
    made = [cell if isinstance(cell, TableCell) else TableCell(cell) for cell in cells]
    return [
        cell if i % every else cell._replace(kind=f"split {cell.kind}".strip())
        for i, cell in enumerate(made)
    ]


def bullet_list(items: Sequence[object], kind: str = "list", limit: int = LISTED) -> str:
    """An HTML list of texts, at most so many of them, and how many more there are; "" of none."""
    more = [f"and {len(items) - limit} more"] if len(items) > limit else []
    return f"<ul{classes(kind)}>{_items([*items[:limit], *more])}</ul>" if items else ""


def numbered_list(items: Sequence[object]) -> str:
    """A numbered HTML list of texts; "" of none."""
    return f"<ol>{_items(items)}</ol>" if items else ""


def _items(items: Iterable[object]) -> str:
    return "".join(f"<li>{markup(item)}</li>" for item in items)


def paragraphs(texts: Iterable[object], kind: str = "") -> str:
    """An HTML paragraph of each text; kind: their class in page.css."""
    return "".join(f"<p{classes(kind)}>{markup(text)}</p>" for text in texts)


def caption(text: object) -> str:
    """HTML of a text below a table."""
    return paragraphs([text], "caption")


def remarks(texts: Iterable[object]) -> str:
    """HTML of what a reader must also know."""
    return paragraphs(texts, "note")


def fold(heading: str, *parts: str) -> str:
    """An HTML block that opens on a click at its heading; "" around nothing."""
    summary = f"<summary>{escape(heading)}</summary>"
    return f"<details class=fold>{summary}{''.join(parts)}</details>" if any(parts) else ""


def around(kind: str, *parts: str) -> str:
    """An HTML block of these classes around parts; "" around nothing."""
    return f"<div{classes(kind)}>{''.join(parts)}</div>" if any(parts) else ""
