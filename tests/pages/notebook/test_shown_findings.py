"""What findings show of themselves in a notebook: their lines and numbers, without script, names from
files inert."""

import re
from dataclasses import replace
from html import unescape

import pytest

import strapdown as sd
from strapdown.allan.deviation import allan
from strapdown.flight import Sensors
from strapdown.pages.notebook import cards

NAME = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def drive():
    made = sd.simulate("car", duration=120.0, imu="industrial", seed=4)
    return replace(
        made,
        meta=made.meta | {"name": NAME},
        sources=tuple(replace(each, name=f"{each.name} {NAME}") for each in made.sources),
    )


@pytest.fixture(scope="module")
def found(drive):
    """{name: finding}."""
    estimated = sd.fuse(drive, estimate=["clock"])
    return {
        "diagnosis": sd.diagnose(drive),
        "estimated": estimated.installation,
        "installation": sd.calibrate_installation(drive),
        "tuning": sd.tune(drive),
        "flight": sd.flight.fly(
            "turning", duration=10.0, seed=1, sensors=Sensors(imu="industrial")
        ),
        "allan": allan(sd.simulate("static", duration=200.0, imu="consumer", seed=1).imu),
    }


SAID = {
    "diagnosis": ("Diagnosis", "lever arm forward: consistent with the given value ("),
    "estimated": ("Estimated installation", "clock of GNSS position"),
    "installation": ("Installation", "lever arm down: consistent with the given value ("),
    "tuning": ("Tuning: ", "white noise of the turn rate"),
    "flight": ("Flight(turning on closed-loop: 10.0 s flown to the end)", "not judged"),
    "allan": ("Allan analysis of 200 s", "white noise"),
}


@pytest.mark.parametrize("name", SAID)
def test_a_finding_shows_its_lines(found, name):
    shown = found[name]._repr_html_()
    assert shown.startswith(cards.STYLE) and "<script" not in shown
    words = re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", shown.removeprefix(cards.STYLE)))
    words = unescape(words).strip()
    title, line = SAID[name]
    assert ("&lt;script" in shown) == (name not in ("flight", "allan"))
    assert words.startswith(title) and line in words


@pytest.mark.parametrize("name", ["diagnosis", "installation", "tuning"])
def test_its_numbers_are_those_of_the_finding(found, name):
    shown = unescape(found[name]._repr_html_())
    if name == "tuning":
        values = [f"{row.found:.3g}" for row in found[name].table().itertuples()]
    else:
        values = [line for line in found[name].lines if "consistent" in line]
    assert len(values) > 2 and all(value in shown for value in values)
