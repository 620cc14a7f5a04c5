"""The page at work: somebody zooms, points, plays, folds and jumps in a browser without network,
and all figures follow."""

import re
from dataclasses import replace

import pytest
from browser import Driven, needs_chromium
from synthetic import flight, solution

from strapdown import report

pytestmark = [pytest.mark.short, needs_chromium]
TRUTH = flight(600, rate=2.0)
MADE = solution(TRUTH)
ALIKE = [(float(50 + k), f"fix rejected: {k} m off") for k in range(37)]
DATED = replace(
    MADE, events=(*ALIKE, *MADE.events), meta=MADE.meta | {"epoch": "2024-05-01T12:00:00Z"}
)
WHOLE = [0, 599.5]
RANGES = "plots.filter(isTimed).map(plot => plot.layout.xaxis.range.map(x => +x.toFixed(2)))"
SETTLED = "!stale.size && !following"
CURSOR = "+document.body.dataset.cursor"


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    report({"a": DATED, "b": MADE}, TRUTH).save(folder / "a.html")
    with Driven(folder / "a.html", folder) as page:
        page.until("document.body.dataset.drawn && document.body.classList.contains('plays')")
        yield page


@pytest.fixture
def page(opened):
    """The page as it is when it has been opened."""
    opened.point(1, 1)
    opened.run("show(null), hold(null), window.scrollTo(0, 0)")
    opened.until(SETTLED)
    assert set(map(tuple, opened.run(RANGES))) == {tuple(WHOLE)}
    return opened


def box(page, figure):
    """Left, top, width and height of the area that a figure draws in, scrolled into view."""
    page.run(f"{figure}.scrollIntoView({{block: 'center'}})")
    page.until(f"near.has({figure})")
    area = f"{figure}.querySelector('.nsewdrag').getBoundingClientRect()"
    return page.run(f"(b => [b.left, b.top, b.width, b.height])({area})")


FIRST = "plots.find(isTimed)"


def test_zooming_one_time_axis_zooms_all_and_so_does_going_back(page):
    left, top, width, height = box(page, FIRST)
    y = top + height / 2
    page.drag(*((left + part * width, y) for part in (0.25, 0.3, 0.4, 0.5)))
    page.until("span")
    page.until(SETTLED)
    first, *others = page.run(RANGES)
    assert first == pytest.approx([150, 300], abs=12) and len(others) > 5
    assert all(each == first for each in others)
    # what plotly makes of a double click, for which a busy machine is too slow
    page.run(f"Plotly.relayout({FIRST}, {{'xaxis.range': {WHOLE}}}).then(() => 0)")
    page.until("span === null")
    page.until(SETTLED)
    assert all(each == WHOLE for each in page.run(RANGES))


def test_the_cursor_stands_in_figures_and_on_the_track(page):
    left, top, width, height = box(page, FIRST)
    page.point(left + width / 2, top + height / 2)
    page.until(CURSOR)
    assert page.run(CURSOR) == pytest.approx(300, abs=12)
    page.until(f"{FIRST}.querySelector('.cursor:not([hidden])')")
    page.until("plots.find(isTrack).querySelector('.here:not([hidden])')")
    # values in another figure in view, below the same time
    page.until(f"plots.some(plot => plot !== {FIRST} && plot.querySelector('.hoverlayer text'))")


def test_playing_moves_the_cursor_and_says_values_with_their_deviations(page):
    page.run("slider.value = 100, slider.dispatchEvent(new Event('input')), rate.value = 100")
    page.until(f"Math.abs({CURSOR} - 100) < 0.1")
    page.until("bar.querySelector('.utc').textContent.includes('12:01:')")
    values = page.run("bar.querySelector('dl').textContent")
    assert re.search(r"north-?[\d.]+ ± [\d.]+ m", values)
    assert re.search(r"heading[\d.]+ ± [\d.]+ deg", values)
    page.run("document.activeElement.blur()")
    page.press(" ")
    assert page.run("button.getAttribute('aria-label')") == "Pause"
    page.until(f"{CURSOR} > 120")
    page.press(" ")
    assert page.run("button.getAttribute('aria-label')") == "Play"


def test_alike_events_fold_and_a_click_jumps(page):
    fold = "document.querySelector('.occasions details:has(b)')"
    assert page.run(f"{fold}.open") is False
    assert page.run(f"{fold}.firstChild.textContent") == "fix rejected: 0 m off ×37"
    page.run(f"{fold}.firstChild.click()")
    assert page.run(f"{fold}.open && {fold}.querySelectorAll('li').length") == 37
    page.run("document.querySelector('.occasions li[value=\"38\"] .jump').click()")
    page.until(SETTLED)
    margin = 0.05 * WHOLE[1]
    for each in page.run(RANGES):
        assert each == pytest.approx([200 - margin, 200 + margin], abs=0.02)
    page.until(f"{CURSOR} === 200")


def test_keys_zoom_step_and_reset(page):
    page.run(f"{FIRST}.focus()")
    page.press("+")
    page.until(SETTLED)
    assert page.run(RANGES)[-1] == pytest.approx([149.88, 449.62], abs=0.02)
    page.press("ArrowRight")
    page.until(CURSOR)
    assert page.run(CURSOR) == pytest.approx(299.75 + 3, abs=0.1)
    page.press("0")
    page.until("span === null")


def test_sections_fold_and_unfold_for_print(page):
    section = "document.querySelector('main details.section')"
    page.run(f"{section}.querySelector('summary').click()")
    assert page.run(f"{section}.open") is False
    page.run("window.dispatchEvent(new Event('beforeprint'))")
    assert page.run(f"{section}.open") is True
    page.run("window.dispatchEvent(new Event('afterprint'))")
    assert page.run(f"{section}.open") is False
    page.run(f"{section}.open = true")
