"""The distributions of chance against scipy's."""

import numpy as np
import pytest
from scipy.special import chdtrc, pdtr

from strapdown.engine.rejections.chance import as_many, farther


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_farther_is_the_tail_of_chi_square(rows):
    nis = np.r_[0.0, np.logspace(-6, 3, 100), 1e6]
    found = [farther(rows, each) for each in nis.tolist()]
    np.testing.assert_allclose(found, chdtrc(rows, nis), rtol=1e-12)
    assert farther(0, 1.0) == 0


@pytest.mark.parametrize("expected", [0.0, 1e-300, 0.6, 12.0, 1200.0, 1e5])
def test_as_many_is_the_tail_of_poisson(expected):
    for count in {0, 1, 2, 30, int(expected), int(1.1 * expected)}:
        wanted = 1 - pdtr(count - 1, expected) if count else 1.0
        assert as_many(count, expected) == pytest.approx(wanted, abs=1e-9), count
