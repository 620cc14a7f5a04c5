"""What of a filter can be exported and what is refused, its struct, its start, and the header's words."""

import re
from functools import cache

import numpy as np
import pytest

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.compile.records import notes, row_of
from strapdown.core.compile.signatures import Numbers, Rows
from strapdown.core.loop import contract
from strapdown.core.loop.log import Code
from strapdown.core.mathematics import solution_row
from strapdown.native.export.chosen import choose_export
from strapdown.native.export.folder import find_target
from strapdown.native.export.glue import glue
from strapdown.native.export.header import header, source_text, type_name
from strapdown.native.export.image import image, known_numbers
from strapdown.native.export.layout import RECORDS, layout, numbers, sizes_of
from strapdown.native.export.texts import CLASSES, CODE, ENUMS, FIELDS, SIZES
from strapdown.sim.trajectory import demo_flight

SOURCES = {
    "attitude-mekf": ["heading", "magnetic-field"],
    "mahony": ["heading"],
    "vru": ["pressure"],
    "fixed-gain": ["position", "attitude"],
}
FIXED = {"attitude-mekf": ("noise", "lla"), "mahony": ("noise", "lla")}
REFUSED = {
    "nlo": "SQUARE",
    "pkf": "COMPONENTS",
    "vru": "P, VARIANCE",
    "xkf": "CLOSE, INSIDE.BLOCK.SQUARE",
    "xkf-two-stage": "INSIDE.BLOCK.SQUARE",
}


@cache
def flight():
    return sd.simulate(demo_flight(), 20.0, "tactical", 7)


def choice(name="closed-loop", kinds=None, **options):
    usual = ["position", "velocity"]
    if "attitude" in filters.find(name).needs:
        usual = ["position", "attitude"]
    return choose_export(name, kinds or SOURCES.get(name, usual), flight(), **options)


def pictured(of):
    made = layout(sizes_of(of.records(of.start)))
    return made, image(of.filter, of.records, made, of.start, of.noise)


@pytest.mark.parametrize("name", filters.own_names())
def test_the_start_of_a_filter_is_constants_and_copies_or_is_refused(name):
    of = choice(name)
    if name in REFUSED:
        with pytest.raises(sd.DataError, match=f"{name}.*its start computes {REFUSED[name]},"):
            pictured(of)
        return
    made, found = pictured(of)
    assert found.fixed == FIXED.get(name, ())
    # another start than any that was tried, put together as C does
    start = of.start._replace(b_a=(0.01, -0.02, 0.03), rph=(0.2, -0.1, 2.0), v_n=(1.0, 2.0, 3.0))
    want, want_whole = numbers(of.records(start), made)
    got, got_whole = np.zeros_like(want), np.zeros_like(want_whole)
    for place, values in found.constants.items():
        for k, value in values.items():
            real = place.within(k)[1]
            (got if real else got_whole)[place.first + k] = value
    parts = known_numbers(start, of.noise)
    for place, copies in found.copies.items():
        for k, what in copies.items():
            got[place.first + k] = parts[what]
    np.testing.assert_array_equal(got, want)
    np.testing.assert_array_equal(got_whole, want_whole)


def test_each_number_of_the_struct_has_eight_bytes_and_its_own_place():
    of = choice()
    made, _ = pictured(of)
    ends = [place.first + place.length for place in made.places]
    assert [place.first for place in made.places] == [0, *ends[:-1]] and made.length == ends[-1]
    assert made.sizes["n"] == 15 and made.sizes["fixes"] == made.sizes["fix_rows"] == 16
    of = choice(kinds=["position", "pressure"], waiting=3)
    assert layout(sizes_of(of.records(of.start))).sizes["n"] == 16  # with the barometer's bias


def test_every_field_and_every_name_has_its_words():
    assert {record: list(texts) for record, texts in FIELDS.items()} == {
        record: list(kinds.made._fields) for record, kinds in RECORDS.items()
    }
    for names in ENUMS:
        assert all(each.text for each in names.constants), names.name
    for made in CLASSES.values():
        assert all(notes(made).values()) and list(notes(made)) == [
            name for name, _, _ in row_of(made).fields
        ]
    assert {each.value for each in CODE.constants} == set(Code) - {
        Code.APART,  # the smoother's
        Code.CLOCK_OFF,  # of clocks that are estimated
    }
    named = {
        size
        for kinds in RECORDS.values()
        for kind in kinds.kinds
        if isinstance(kind, Numbers | Rows)
        for size in kind.shape
    }
    assert set(SIZES) <= named
    for kind in aiding.own_names():
        assert "parameters: " in source_text(aiding.find(kind))


def test_the_header_shows_every_field_with_its_words():
    of = choice(kinds=["position", "pressure", "zero-velocity"])
    made, found = pictured(of)
    text, plain = header(of, made), re.sub(r"\s+", " ", header(of, made))
    for place in made.places:
        if place.length:
            words = FIELDS[place.record][place.name]
            assert re.sub(r"\s+", " ", words) in plain, place
            kind = type_name(place.row) if place.row else "(double|int64_t)"
            assert re.search(rf"{kind} {place.name}[\[;]", text), place
    for name, value in (
        ("STATES", 16),
        ("SOURCES", 3),
        ("SOURCE_PRESSURE", 1),
        ("ROW_STD", solution_row.STD),
        ("DOUBTFUL", contract.DOUBTFUL.value),
        ("STUCK", Code.STUCK.value),
    ):
        assert f"    STRAPDOWN_{name} = {value}" in text, name
    assert "pressure bias" in plain  # a column behind the status
    assert "$" not in text and "$" not in glue(of, found, "0")
    assert max(map(len, text.splitlines())) <= 100


def test_a_source_text_says_units_axes_and_parameters():
    assert source_text(aiding.find("position")) == (
        "y: latitude rad, longitude rad, height m; std (3): m, north, east, down; "
        "parameters: lever arm from the IMU to the antenna, m, body (3)"
    )
    assert "hand one in only at rest" in source_text(aiding.find("zero-velocity"))


@pytest.mark.parametrize(
    "arguments, said",
    [
        (dict(name="closed-lop"), "did you mean 'closed-loop'"),
        (dict(kinds=["positon"]), "did you mean 'position'"),
        (dict(kinds=["course", "pressure"], name="attitude-mekf"), "does not use"),
        (dict(kinds=["position"], name="fixed-gain"), "needs attitude aiding.*among the sources"),
        (dict(options={"speed": 1}), "has no option 'speed'"),
        (dict(options={"error_model": "x"}), "error_model is 'x'"),
        (dict(imu="tacticl"), "tactical"),
        (dict(waiting=0), "waiting is 0"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(arguments, said):
    with pytest.raises(sd.DataError, match=said) as caught:
        pictured(choice(**arguments))
    assert "\n" not in str(caught.value)


def test_no_sources_and_an_unknown_target_are_refused():
    with pytest.raises(sd.DataError, match="sources: there are none"):
        choose_export("closed-loop", [], flight())
    with pytest.raises(sd.DataError, match="did you mean 'cortex-m7'"):
        find_target("cortex-m8")
    assert find_target("wasm32").name == "wasm32"


def test_a_recording_with_more_fixes_in_a_gap_than_there_is_room_for_is_refused():
    of = choice(waiting=1)
    with pytest.raises(sd.DataError, match="2 fixes up to one sample.*--waiting 2"):
        of.replay()
