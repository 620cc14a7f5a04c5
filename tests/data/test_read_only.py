"""Arrays of every frozen value are read-only, whoever made, copied or unpickled it, and what is derived
from them is never stale."""

import copy
import importlib
import pickle
import pkgutil
import re
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pandas as pd
import pytest
from support.recordings import flight, start

import strapdown as sd
from strapdown.data.value import Value, read_only, same
from strapdown.data.verdict import Reason, Verdict

pytestmark = pytest.mark.short
NO_VALUES = ("strapdown.__main__", "strapdown.sim.jsbsim", "strapdown.native")
HOLDS_ARRAYS = re.compile(r"\b(Array|Ints|Mask|NDArray|DataFrame|Recording|Solution|Trajectory)\b")


def modules():
    for each in pkgutil.walk_packages(sd.__path__, "strapdown."):
        if not each.name.startswith(NO_VALUES):
            yield importlib.import_module(each.name)


def frozen_classes():
    """Every frozen dataclass of the library."""
    found = {
        one: None
        for module in modules()
        for one in vars(module).values()
        if isinstance(one, type) and one.__module__ == module.__name__ and is_dataclass(one)
    }
    return [one for one in found if one.__dataclass_params__.frozen]


VALUES = [one for one in frozen_classes() if issubclass(one, Value)]


def made(kind):
    """A value with an array in every field, alone, in a dictionary or in a tuple, and these arrays."""
    arrays = [np.arange(3.0) + i for i, each in enumerate(fields(kind)) if each.init]
    shapes = [lambda a: a, lambda a: {"a": a}, lambda a: ("a", a)]
    names = [each.name for each in fields(kind) if each.init]
    parts = {name: shapes[i % 3](a) for i, (name, a) in enumerate(zip(names, arrays))}
    return kind(**parts), arrays


def arrays_of(part):
    if isinstance(part, np.ndarray):
        return [part]
    if isinstance(part, Value):
        return arrays_of(vars(part))
    parts = part.values() if isinstance(part, dict) else part if isinstance(part, tuple) else ()
    return [array for each in parts for array in arrays_of(each)]


def test_what_holds_arrays_is_a_value():
    """NamedTuples and rows of the compiled loop are none: they are worked on."""
    plain = [one for one in frozen_classes() if not issubclass(one, Value)]
    holding = (any(HOLDS_ARRAYS.search(str(part.type)) for part in fields(one)) for one in plain)
    assert not any(holding) and len(VALUES) >= 15


@pytest.mark.parametrize("kind", VALUES, ids=lambda kind: kind.__name__)
def test_arrays_of_every_value_are_read_only(kind):
    value, given = made(kind)
    other, _ = made(kind)
    copies = {
        "itself": value,
        "copy": copy.copy(value),
        "deepcopy": copy.deepcopy(value),
        "pickle": pickle.loads(pickle.dumps(value)),
    }
    first = next(each.name for each in fields(kind) if each.init)
    copies["replace"] = replace(value, **{first: np.arange(3.0)})
    for way, one in copies.items():
        assert len(arrays_of(one)) == len(given), way
        for array in arrays_of(one):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 7.0
        assert one == other and not one != other, way
    for array in given:
        array += 1.0  # its owner may write to it, and changes no value
    assert value == other
    assert replace(value, **{first: np.arange(4.0)}) != other


def test_what_nobody_will_change_is_not_copied():
    t, lla = read_only(np.arange(3.0)), np.zeros((3, 3))
    path = sd.Trajectory(t, lla)
    assert path.t is t and not np.shares_memory(path.lla, lla)
    assert replace(path, v_n=lla).lla is path.lla
    assert np.shares_memory(path.take(slice(1, 3)).lla, path.lla)
    assert t.base.flags.writeable and lla.flags.writeable


def test_a_run_and_a_stream_leave_what_they_read():
    recording = flight()
    solution = sd.fuse(recording, start=start(recording), imu="tactical", covariance=True)
    assert recording == flight()
    assert not any(array.flags.writeable for array in arrays_of(solution))
    stream = sd.Stream(
        "closed-loop", sources=recording.sources, start=start(recording), imu="tactical"
    )
    for row in zip(*recording.imu):
        stream.step(sd.Sample(*row))
    live = stream.solution
    assert not any(array.flags.writeable for array in arrays_of(live))


def test_derived_parts_are_never_stale():
    recording = flight()
    solution = sd.fuse(recording, start=start(recording), imu="tactical")
    path = solution.trajectory
    with pytest.raises(ValueError, match="read-only"):
        path.rph[0] = 0.0
    path.rotation[0] = path.rotation[1]  # of a Rotation of its own
    np.testing.assert_allclose(path.rotation.as_quat()[0, [3, 0, 1, 2]], path.q_nb[0], atol=1e-12)
    turned = replace(path, q_nb=path.q_nb[::-1])
    np.testing.assert_array_equal(turned.rph, path.rph[::-1])
    assert solution.verdict.word
    told = Verdict.of([Reason("clock", "0.25 s late", "set it", "gnss", 5.0)])
    solution.meta["verdict"] = told.as_dict()
    assert solution.verdict == told


def test_a_row_of_a_table_is_read_only_too():
    trim = sd.flight.trim(sd.flight.aircraft(), 25.0)
    for one in (trim, copy.deepcopy(trim), pickle.loads(pickle.dumps(trim))):
        with pytest.raises(ValueError, match="read-only"):
            one.loads.thrust = 0.0
        with pytest.raises(ValueError, match="read-only"):
            one.loads.force[0] = 0.0
        assert one == trim and one.loads.thrust > 0


def test_tables_compare_by_what_they_hold():
    a = pd.DataFrame({"x": [1.0, np.nan]})
    assert same(a, a.copy()) and not same(a, a + 1) and not same(a, None) and not same(None, a)


def test_what_cannot_be_compared_is_not_the_same():
    class Odd:
        def __eq__(self, other):
            raise ValueError("ambiguous")

    assert not same(Odd(), 3.0) and not same({"a": Odd()}, {"a": 3.0})
