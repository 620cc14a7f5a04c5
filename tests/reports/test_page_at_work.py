"""The page at work: a browser without network zooms, points, plays, folds and jumps, and all
figures follow."""

import json
import re
from dataclasses import replace
from html import unescape

import pytest
from browser import CHROMIUM, browse
from synthetic import flight, solution

from strapdown import report

pytestmark = [
    pytest.mark.short,
    pytest.mark.skipif(
        CHROMIUM is None, reason="no Chromium found (chromium, chromium-browser or google-chrome)"
    ),
]
TRUTH = flight(600, rate=2.0)
MADE = solution(TRUTH)
ALIKE = [(float(50 + k), f"fix rejected: {k} m off") for k in range(37)]
EVENTS = (*ALIKE, *MADE.events)
DRIVER = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
const until = async test => { for (let k = 0; k < 400 && !test(); k++) await wait(25); return test(); };
const range = plot => plot.layout.xaxis.range.map(x => +x.toFixed(2));
const said = {};
const settled = () => until(() => !stale.size && !following);
const times = () => plots.filter(isTimed);
const mouse = (target, type, x, y) => target.dispatchEvent(new MouseEvent(type, {bubbles: true, cancelable: true, view: window, clientX: x, clientY: y, button: 0, buttons: type === "mouseup" ? 0 : 1}));
(async () => {
  await until(() => document.body.dataset.drawn);
  await until(() => document.body.classList.contains("plays"));
  const [first, second] = times(), last = times().at(-1), track = plots.find(isTrack);
  said.figures = times().length;
  said.began = range(first);
  first.scrollIntoView({block: "center"});
  await wait(200);
  const box = first.querySelector(".nsewdrag").getBoundingClientRect(), y = box.top + box.height / 2;
  mouse(first.querySelector(".nsewdrag"), "mousedown", box.left + 0.25 * box.width, y);
  mouse(document, "mousemove", box.left + 0.3 * box.width, y);
  mouse(document, "mousemove", box.left + 0.5 * box.width, y);
  mouse(document, "mouseup", box.left + 0.5 * box.width, y);
  await until(() => range(first)[0] !== said.began[0]);
  await settled();
  said.zoomed = times().map(range);
  mouse(first, "mousemove", box.left + 0.5 * box.width, y);
  await until(() => document.body.dataset.cursor);
  await wait(100);
  said.pointed = +document.body.dataset.cursor;
  said.line = !first.querySelector(".cursor").hidden;
  track.scrollIntoView({block: "center"});
  await wait(200);
  said.here = !track.querySelector(".here").hidden;
  document.querySelector("#playback [name=all]").click();
  await settled();
  said.whole = times().map(range);
  const button = document.querySelector("#playback button"), slider = document.querySelector("#playback input");
  document.querySelector("#playback [name=rate]").value = 100;
  slider.value = 100; slider.dispatchEvent(new Event("input"));
  await wait(50);
  said.slid = +document.body.dataset.cursor;
  said.values = document.querySelector("#playback dl").textContent;
  said.utc = document.querySelector("#playback .utc").textContent;
  button.click();
  said.playing = button.getAttribute("aria-label");
  await until(() => +slider.value > 110);
  button.click();
  said.played = +document.body.dataset.cursor > 110;
  const fold = document.querySelector(".occasions details:has(b)");
  said.folded = [fold.open, fold.querySelector("summary").textContent];
  fold.querySelector("summary").click();
  await wait(50);
  said.unfolded = fold.open;
  document.querySelector(".occasions li[value='38'] .jump").click();
  await settled();
  said.jumped = times().map(range);
  said.at = +document.body.dataset.cursor;
  first.dispatchEvent(new KeyboardEvent("keydown", {key: "0", bubbles: true}));
  await settled();
  said.keyed = range(last);
  first.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowRight", bubbles: true}));
  await wait(50);
  said.stepped = +document.body.dataset.cursor;
  const section = document.querySelector("main details.section");
  section.querySelector("summary").click();
  await wait(50);
  said.closed = section.open;
  window.dispatchEvent(new Event("beforeprint"));
  said.printed = section.open;
  document.body.dataset.said = JSON.stringify(said);
})().catch(error => { document.body.dataset.said = JSON.stringify({error: String(error), said}); });
</script>"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What the driver saw."""
    folder = tmp_path_factory.mktemp("page")
    made = replace(MADE, events=EVENTS, meta=MADE.meta | {"epoch": "2024-05-01T12:00:00Z"})
    html = report({"a": made, "b": MADE}, TRUTH).html
    (folder / "a.html").write_text(html.replace("</body>", DRIVER + "</body>"), encoding="utf-8")
    found = re.search(r'data-said="([^"]*)"', browse(folder, "--dump-dom"))
    assert found, "the driver did not come to its end"
    found = json.loads(unescape(found[1]))
    assert "error" not in found, found
    return found


def test_zooming_one_time_axis_zooms_all(said):
    first, *others = said["zoomed"]
    low, high = said["began"]
    width = high - low
    assert first == pytest.approx([low + 0.25 * width, low + 0.5 * width], abs=0.02 * width)
    assert len(others) > 5 and all(each == first for each in others)
    assert all(each == said["began"] for each in said["whole"])


def test_the_cursor_stands_in_figures_and_on_the_track(said):
    low, high = said["zoomed"][0]
    assert said["pointed"] == pytest.approx((low + high) / 2, abs=0.02 * (high - low))
    assert said["line"] and said["here"]


def test_playing_moves_the_cursor_and_says_values_with_their_deviations(said):
    assert said["slid"] == 100 and said["playing"] == "Pause" and said["played"]
    assert re.search(r"north-?[\d.]+ ± [\d.]+ m", said["values"])
    assert re.search(r"heading[\d.]+ ± [\d.]+ deg", said["values"])
    assert said["utc"].startswith("2024-05-01 12:01:40")


def test_alike_events_fold_and_a_click_jumps(said):
    assert said["folded"] == [False, "fix rejected: 0 m off ×37"] and said["unfolded"]
    low, high = said["began"]
    margin = 0.05 * (high - low)
    for jumped in said["jumped"]:
        assert jumped == pytest.approx([200 - margin, 200 + margin], abs=0.02)
    assert said["at"] == 200


def test_keys_reset_and_step_and_print_unfolds(said):
    low, high = said["began"]
    assert said["keyed"] == [low, high]
    assert said["stepped"] == pytest.approx(200 + 0.01 * (high - low), abs=0.1)
    assert not said["closed"] and said["printed"]
