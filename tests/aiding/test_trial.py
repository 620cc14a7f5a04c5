"""The trial of observations from outside: the library's own pass it, mistakes are found before
anything is computed with them."""

import numpy as np
import pytest

from strapdown import aiding, plugins
from strapdown.aiding.trial import derivative_complaints
from strapdown.checks import DataError
from strapdown.core.loop.contract import OBSERVE, MeasurementModel, compile_kernel, kernel


@pytest.mark.short
@pytest.mark.parametrize("name", aiding.own_names())
def test_the_kinds_of_the_library_pass(name):
    assert derivative_complaints(aiding.find(name), aiding.compile_observation(name)) == []


@kernel(OBSERVE)
def two_rows(belief, y, parameters, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    H[0, 5] = 1.0
    return 2


@kernel(OBSERVE)
def beside(belief, y, parameters, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    H[0, 5] = 1.0
    H[0, 400] = 1.0
    return 1


@kernel(OBSERVE)
def second_row(belief, y, parameters, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    H[0, 5], H[1, 5] = 1.0, 1.0
    return 1


@kernel(OBSERVE)
def raises(belief, y, parameters, innovation, H):
    if y[0] == y[0]:
        raise ValueError("no such thing")
    return 1


@kernel(OBSERVE)
def writes(belief, y, parameters, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    belief.v_n[2] = 0.0
    H[0, 5] = 1.0
    return 1


@kernel(OBSERVE)
def wrong_sign(belief, y, parameters, innovation, H):
    innovation[0] = y[0] + belief.v_n[2]
    H[0, 5] = 1.0
    return 1


@kernel(OBSERVE)
def left_out(belief, y, parameters, innovation, H):
    """Forward speed without its derivative by the attitude."""
    innovation[0] = y[0]
    for i in range(3):
        innovation[0] -= belief.C_nb[i, 0] * belief.v_n[i]
        H[0, 3 + i] = belief.C_nb[i, 0]
    return 1


@kernel(OBSERVE)
def sometimes(belief, y, parameters, innovation, H):
    return 0


@pytest.mark.short
@pytest.mark.parametrize(
    "observe, said",
    [
        (two_rows, "returns 2; it must return the number of its rows, 1"),
        (beside, "writes beside its arrays|index 400 is out of bounds"),
        (second_row, "writes beside its arrays"),
        (raises, "fails at a trial: ValueError: no such thing"),
        (writes, "changes the belief"),
    ],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_mistakes_are_refused(observe, said):
    compile_kernel(observe)
    with pytest.raises(DataError, match=said) as error:
        derivative_complaints(MeasurementModel("mine", observe, ("speed",)), observe)
    assert "\n" not in str(error.value)


@pytest.mark.short
@pytest.mark.parametrize(
    "observe, said",
    [
        (wrong_sign, r"H\[0, 5\] is 1 \(velocity down, m/s\), and the innovation changes by -1 "),
        (left_out, r"H\[0, 6\] is 0 \(attitude north, rad\)"),
        (sometimes, None),
    ],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_derivatives_that_are_not_the_innovations_are_told(observe, said):
    compile_kernel(observe)
    found = derivative_complaints(MeasurementModel("mine", observe, ("speed",)), observe)
    if said is None:
        assert found == []
    else:
        assert any(np.char.find(found, said.replace("\\", "")) >= 0), found


@pytest.mark.short
def test_a_registered_sensor_is_tried_once_before_it_is_used(monkeypatch):
    monkeypatch.setattr(plugins, "_plugins", {})
    monkeypatch.setattr(aiding, "_tried", {})
    aiding.REGISTRY.add(MeasurementModel("mine", wrong_sign, ("speed",)), __name__)
    with pytest.warns(
        plugins.PluginWarning, match=r"test_trial.py: MeasurementModel 'mine': H\[0, 5\]"
    ):
        aiding.compile_observation("mine")
    aiding.compile_observation("mine")  # and says no more
    aiding.REGISTRY.add(MeasurementModel("other", two_rows, ("speed",)), __name__)
    with pytest.raises(
        DataError, match="plugin test_trial.py: MeasurementModel 'other': observe returns 2"
    ):
        aiding.compile_observation("other")
