"""Profiles of a likelihood that is known in closed form."""

import numpy as np
import pytest

from strapdown.tuning.fisher_scoring import climb, profile
from strapdown.tuning.likelihood import Point, Seen
from strapdown.units.constants import CHI_SQUARE_95

ROOT = 20 * np.linalg.cholesky(np.array([[1, 0, -0.7], [0, 1, -0.6], [-0.7, -0.6, 1]])).T


class Quadratic:
    """One fix whose innovation is linear in three unknowns, of which the third alone is coupled to
    the others: log L is -1/2 |ROOT theta|^2."""

    low, high = np.full(3, -5.0), np.full(3, 5.0)

    def at(self, theta):
        e = ROOT @ theta
        log = np.array([-0.5 * e @ e])
        eye = np.eye(3)[None]
        return Point(theta, Seen(np.zeros(1, int), e[None], eye, e[None], log, True), log[0])

    def all(self, thetas):
        return list(map(self.at, thetas))


@pytest.mark.parametrize("j", range(3))
def test_a_profile_lets_all_follow_that_are_coupled_through_others(j):
    likelihood = Quadratic()
    top = climb(likelihood, np.array([0.1, -0.2, 0.1]), np.arange(3))
    found = profile(likelihood, top, j)
    half = np.sqrt(CHI_SQUARE_95 * np.linalg.inv(ROOT.T @ ROOT)[j, j])
    assert [found.low, found.high] == pytest.approx([-half, half], rel=0.05)
