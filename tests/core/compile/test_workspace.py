"""The declared layout of a workspace: names, sizes, and what is refused."""

import importlib
import pkgutil

import numpy as np
import pytest

import strapdown
from strapdown import filters
from strapdown.core.loop.contract import FilterState, InitialState, Noise, Slots
from strapdown.filters.ins.closed_loop import CLOSED_LOOP
from strapdown.filters.ins.open_loop import OPEN_LOOP

pytestmark = pytest.mark.short
AT = InitialState(
    0.0, (0.8, 0.1, 300.0), (1.0, 2.0, 0.1), (0.1, -0.2, 1.0), (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
)
NOISE = Noise(1e-4, 1e-3, 1e-6, 1e-5, 0.0, 0.0)


def test_slots_follow_each_other_and_have_names():
    inner = Slots()
    inner.number("A")
    slots = Slots()
    assert slots.output("repairs") == 0 and slots.outputs("x [m]", "y [m]") == slice(1, 3)
    assert slots.number("TIME") == 3 and slots.numbers("P", "Q") == (4, 5)
    assert slots.array("FORCE", 3) == slice(6, 9) and slots.matrix("GAIN", 2, 3) == 9
    more = Slots(after=slots)
    assert more.part("INNER", inner) == slice(15, 16) and more.rest("TABLE") == 16
    assert more.columns == ("repairs", "x [m]", "y [m]") and (slots.size, more.size) == (15, 16)
    workspace = more.zeros(rest=2)
    workspace[:] = range(18)
    named = more.views(workspace)
    assert list(named) == [*more.columns, "TIME", "P", "Q", "FORCE", "GAIN", "INNER", "TABLE"]
    assert named["y [m]"] == 2 and named["TIME"] == 3 and named["INNER"] == {"A": 15}
    assert np.array_equal(named["GAIN"], [[9, 10, 11], [12, 13, 14]])
    assert np.array_equal(named["TABLE"], [16, 17])


def test_columns_of_continued_layouts_share_the_room_at_the_beginning():
    base = Slots(room=2)
    assert base.array("X", 3) == slice(2, 5)
    one, other = Slots(after=base), Slots(after=base)
    assert one.number("OWN") == other.number("ELSE") == 5
    assert one.outputs("a", "b") == slice(0, 2) and other.output("c") == 0
    assert (base.columns, one.columns, other.columns) == ((), ("a", "b"), ("c",))
    with pytest.raises(RuntimeError, match="2 at most"):
        one.output("d")
    with pytest.raises(RuntimeError, match="name of its own"):
        other.output("c")


def test_what_would_overlap_is_refused_at_once():
    slots = Slots()
    slots.number("TIME")
    with pytest.raises(RuntimeError, match="slot TIME is declared twice"):
        slots.array("TIME", 3)
    with pytest.raises(RuntimeError, match="columns come first"):
        slots.output("late")
    more = Slots(after=slots)
    with pytest.raises(RuntimeError, match="slot LATE comes too late"):
        slots.number("LATE")
    with pytest.raises(RuntimeError, match="slot TIME is declared twice"):
        more.number("TIME")
    more.zeros()
    with pytest.raises(RuntimeError, match="slot LATE comes too late"):
        more.number("LATE")


def test_a_part_of_open_size_is_the_last_and_gets_its_size():
    slots = Slots()
    slots.rest("TABLE")
    with pytest.raises(RuntimeError, match="nothing follows"):
        Slots(after=slots)
    with pytest.raises(RuntimeError, match="too late"):
        slots.number("LATE")
    with pytest.raises(RuntimeError, match="open size"):
        slots.zeros()
    with pytest.raises(RuntimeError, match="open size"):
        Slots().zeros(rest=3)


def test_a_workspace_that_is_too_small_is_refused_before_a_kernel_sees_it():
    # which knows nothing of open-loop's own slots
    too_small = OPEN_LOOP._replace(start=CLOSED_LOOP.start)
    with pytest.raises(RuntimeError, match="'open-loop': its start made a workspace of 2030 numb"):
        too_small.begin(AT, NOISE)
    assert isinstance(OPEN_LOOP.begin(AT, NOISE), FilterState)
    with pytest.raises(RuntimeError, match="its slots take 20.."):
        strapdown.fuse(
            strapdown.simulate("straight", seed=1, duration=2.0), too_small, start=AT, noise=NOISE
        )


@pytest.mark.parametrize("name", filters.names())
def test_the_workspace_of_each_filter_is_the_one_that_it_declares(name):
    filter, most = filters.find(name), {"nlo": 38, "two-stage-ekf": 34, "xkf-two-stage": 34}
    for states in (15, 18, most.get(name, 45)):
        start = AT._replace(std=(1.0,) * states)
        workspace = filter.begin(start, NOISE).workspace
        assert workspace.size == filter.slots.size or filter.slots.ended
        assert set(filter.columns) <= set(filter.slots.views(workspace))


def modules():
    for room in ("core", "filters", "flight"):
        package = importlib.import_module(f"strapdown.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"strapdown.{room}."):
            yield importlib.import_module(found.name)


def test_each_slot_has_the_name_of_its_constant():
    constants, slots = set(), set()
    for module in modules():
        for name, value in vars(module).items():
            if isinstance(value, slice | int):
                constants.add((name, value.start if isinstance(value, slice) else value))
            if isinstance(value, Slots):
                slots |= {(slot, first) for slot, (first, _) in value.places.items()}
    assert len(slots) > 200 and not slots - constants
