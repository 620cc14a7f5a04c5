"""Tables, lists and paragraphs of pages, and the document that they stand in."""

import plotly.graph_objects as go
import pytest

from strapdown.pages.parts import (
    Html,
    Ruled,
    TableCell,
    around,
    bullet_list,
    caption,
    numbered_list,
    remarks,
    split_cells,
    table,
)
from strapdown.pages.shell import Document

pytestmark = pytest.mark.short


def test_texts_of_a_table_are_escaped_and_html_is_not():
    assert table(["a<b"], [[1], [Html("<b>x</b>")]]) == (
        "<div class=scroll><table><thead><tr><th>a&lt;b</th></tr></thead>"
        "<tbody><tr><td>1</td></tr><tr><td><b>x</b></td></tr></tbody></table></div>"
    )


def test_a_table_has_cells_with_a_look_and_rows_above_and_below():
    above = [TableCell("", rows=2), TableCell("both", "split", columns=2)]
    made = table(
        split_cells("ab", 2),
        [Ruled(["r", *split_cells([TableCell(1, "best"), 2], 2)])],
        "tall",
        above,
        [["f"]],
    )
    assert made == (
        "<div class='scroll tall'><table><thead>"
        "<tr><th rowspan=2></th><th class=split colspan=2>both</th></tr>"
        "<tr><th class=split>a</th><th>b</th></tr></thead>"
        "<tbody><tr class=rule><td>r</td><td class='split best'>1</td><td>2</td></tr></tbody>"
        "<tfoot><tr><td>f</td></tr></tfoot></table></div>"
    )


def test_nothing_is_made_of_nothing():
    assert bullet_list([]) == numbered_list([]) == remarks([]) == around("grid", "", "") == ""


def test_long_lists_say_how_many_more_there_are():
    assert (
        bullet_list("abc", limit=2) == "<ul class=list><li>a</li><li>b</li><li>and 1 more</li></ul>"
    )
    assert numbered_list(["<"]) == "<ol><li>&lt;</li></ol>"
    assert caption("c") + remarks("n") == "<p class=caption>c</p><p class=note>n</p>"


def test_a_document_numbers_its_figures_and_leaves_out_empty_sections():
    document = Document("A < B", {"recording": "r", "empty": ""}, "the end", "It comes to <this>.")
    figure = go.Figure(go.Scatter(y=[1.0, 2.0]))
    document.add("Nothing", document.place(None, "no figure"), "")
    document.add("Curves", *(document.place(figure, name) for name in ("one", "two")))
    html = document.page().html
    assert [heading for heading, _ in document.sections] == ["Curves"]
    assert "id=data-p1" in html and "id=data-p2" in html and "id=data-p3" not in html
    assert "<title>A &lt; B</title>" in html and "<footer>the end Written by strapdown " in html
    assert "<p class=headline>It comes to &lt;this&gt;.</p>" in html
    assert "<dt>empty</dt>" not in html
    assert "<dt>recording</dt>" in html
