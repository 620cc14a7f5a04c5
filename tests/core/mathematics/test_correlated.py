"""What becomes of correlated errors of a source between its fixes, against dense matrices."""

import numpy as np
import pytest

from strapdown.core.mathematics.time_correlated import FADED, unfade

pytestmark = pytest.mark.short


def test_the_adjoint_is_that_of_the_dense_matrix():
    rng, n = np.random.default_rng(1), 18
    A, lam, Phi = rng.normal(size=(n, n)), rng.normal(size=n), np.eye(n)
    Phi[15, 15] = Phi[17, 17] = 0.7
    Lam = A @ A.T
    found, Found = lam.copy(), Lam.copy()
    unfade(np.array([FADED, 0.7, 15, 0, 17]), found, Found)
    np.testing.assert_allclose(found, Phi.T @ lam, rtol=1e-12)
    np.testing.assert_allclose(Found, Phi.T @ Lam @ Phi, rtol=1e-12)
