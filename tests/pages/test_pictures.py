"""Figures as files: what the buttons of a page and --figures save."""

import shutil
import xml.etree.ElementTree as ET

import plotly.graph_objects as go
import pytest
from browser import Driven, needs_chromium

from strapdown.checks import DataError
from strapdown.pages import pictures
from strapdown.pages.shell import Document

pytestmark = pytest.mark.short


def page():
    document = Document("Two figures", {}, "", "Two lines.")
    for heading in ("Seen & drawn", "Seen & drawn"):
        document.add(heading, document.place(go.Figure(go.Scatter(y=[1.0, 3.0, 2.0])), heading))
    return document.page()


@needs_chromium
def test_each_figure_is_a_file_named_after_its_heading(tmp_path):
    with pictures.saving_pictures(tmp_path / "figures"):
        page().save(tmp_path / "a.html")
    page().save(tmp_path / "b.html")  # outside the context
    found = sorted((tmp_path / "figures").iterdir())
    assert [path.name for path in found] == ["seen-drawn-2.svg", "seen-drawn.svg"]
    for path in found:
        root = ET.parse(path).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        text = path.read_text(encoding="utf-8")
        assert (
            "Seen &amp; drawn" in text and "scatterlayer" in text and "rgb(255, 255, 255)" in text
        )


@needs_chromium
def test_a_button_saves_a_figure_on_white_whatever_the_theme(tmp_path):
    page().save(tmp_path / "a.html")
    with Driven(tmp_path / "a.html", tmp_path) as driven:
        dark = {"name": "prefers-color-scheme", "value": "dark"}
        driven.call("Emulation.setEmulatedMedia", features=[dark])
        driven.until("document.body.dataset.drawn")
        assert driven.run("document.querySelectorAll('.saving button').length") == 4
        driven.run(
            "HTMLAnchorElement.prototype.click = function () { window.saved = this.download; }, 0"
        )
        for name in ("svg", "png"):
            driven.run(
                f"[...document.querySelectorAll('.saving button')].find(b => b.textContent === '{name.upper()}').click()"
            )
            driven.until(f"window.saved === 'seen-drawn.{name}'")
        assert driven.run("picture(plots[0], 'png')").startswith("iVBOR")
        light = driven.run("picture(plots[0], 'svg')")
        assert "rgb(31, 41, 51)" in light and "rgb(255, 255, 255)" in light


def test_without_a_browser_it_is_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(DataError, match="no browser draws them.*press SVG"):
        with pictures.saving_pictures(tmp_path):
            raise AssertionError("it ran")


def test_a_browser_that_draws_nothing_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: shutil.os.path.join("/bin", "true"))
    with pytest.raises(DataError, match="did not draw the page"):
        pictures.save_pictures(page().html, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()
