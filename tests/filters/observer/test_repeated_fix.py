"""When a fix is the one before, handed over with the gate opened, and when it is another."""

import numpy as np
import pytest

from strapdown.filters.observer.repeated_fix import FORGOTTEN, KIND, MEMORY, is_repeated

pytestmark = pytest.mark.short
POSITION, VELOCITY = 0.0, 1.0
FIX = dict(y=np.array([1.0, np.nan, 3.0]), kind=POSITION)


def after(gate, nis):
    """A memory after a fix with that gate and NIS."""
    memory = MEMORY.zeros()
    memory[KIND] = FORGOTTEN
    assert not is_repeated(memory, gate=gate, nis=nis, **FIX)
    return memory


def test_the_fix_after_a_rejection_with_the_gate_lifted_is_the_same():
    assert is_repeated(after(16.0, 17.0), gate=np.inf, nis=2.0, **FIX)


@pytest.mark.parametrize("gate, nis", [(np.inf, 17.0), (16.0, 15.0), (16.0, np.nan)])
def test_after_an_accepted_one_it_is_another(gate, nis):
    assert not is_repeated(after(gate, nis), gate=np.inf, nis=2.0, **FIX)


@pytest.mark.parametrize(
    "other",
    [
        dict(gate=16.0),
        dict(kind=VELOCITY),
        dict(y=np.array([1.0, np.nan, 3.1])),
        dict(y=np.array([1.0, 2.0, 3.0])),
    ],
)
def test_another_gate_kind_or_value_is_another_fix(other):
    assert not is_repeated(after(16.0, 17.0), **{**FIX, "gate": np.inf, "nis": 2.0, **other})


def test_it_is_forgotten_once_taken():
    memory = after(16.0, 17.0)
    assert is_repeated(memory, gate=np.inf, nis=2.0, **FIX) and not is_repeated(
        memory, gate=np.inf, nis=2.0, **FIX
    )
