"""The functions of filters/sigma_point/sigma_points.py without the compiler, and a filter made
of them for any model: what the tests compare with other filters."""

import importlib.util
from unittest.mock import patch

import numpy as np

from strapdown.core.compile import jit
from strapdown.filters.sigma_point import sigma_points


def uncompiled(module=sigma_points):
    """A module of helpers anew, its functions as they are written: compiled one by one for a
    test they would cost seconds."""
    as_it_is = lambda function: function
    with patch.multiple(
        jit, helper=as_it_is, inline=as_it_is, matrix=jit._matrix_twin, flatten=np.ravel
    ):
        spec = importlib.util.spec_from_file_location(
            f"{module.__package__}.uncompiled_{module.__name__.rpartition('.')[2]}", module.__file__
        )
        made = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(made)
    return made


points = uncompiled()


def weights(states, alpha=0.1, beta=2.0, kappa=0.0):
    """Van der Merwe's (2004) weights: of the centre in mean and in covariance, and of every
    other point."""
    lam = alpha**2 * (states + kappa) - states
    centre = lam / (states + lam)
    return centre, centre + 1 - alpha**2 + beta, 0.5 / (states + lam)


class SigmaPointFilter:
    """x' = f(x, w), y = h(x) + v. With `noises` the process noise w has points of its own;
    without, the rows `added` of its square root are appended."""

    def __init__(self, x, P, made, f, h, R, noises=None, added=None):
        """`made` gives the set for a number of states; `noises` (k, k) and `added` (k, n) are
        square roots by rows, A'A = Q."""
        self.x, self.f, self.h, self.R = np.array(x, float), f, h, np.atleast_1d(R)
        self.n, self.lanes = len(x), (len(x) + 8) // 8 * 8
        self.noises, self.added = (
            np.zeros((0, 0)) if noises is None else noises,
            np.zeros((0, self.n)) if added is None else added,
        )
        self.step_set, self.fix_set = made(self.n + len(self.noises)), made(self.n)
        self.A, self.repairs = np.zeros((self.n + 1) * self.lanes), 0
        self.repairs += points.factor(np.array(P, float), self.n, self.lanes, self.A)

    @property
    def root(self):
        """Rows of the square root (n, n)."""
        return self.A.reshape(-1, self.lanes)[: self.n, : self.n]

    @property
    def P(self):
        P = np.zeros((self.n, self.n))
        points.covariance(self.A, self.n, self.lanes, P)
        return P

    def predict(self, *more):
        n, k = self.n, len(self.noises)
        (spread, rest), pairs = self.step_set, n + k
        steps = spread * np.block([[self.root, np.zeros((n, k))], [np.zeros((k, n)), self.noises]])
        centre, rows = self.f(self.x, np.zeros(k), *more), 2 * pairs + 1 + len(self.added)
        A, mean = np.zeros((rows + 1, self.lanes)), np.zeros(self.lanes)
        A[: 2 * pairs, :n] = [
            self.f(self.x + step[:n], step[n:], *more) - centre for step in (*steps, *-steps)
        ]
        A[2 * pairs + 1 : rows, :n] = self.added
        A = A.ravel()
        take = points.deviations(A, pairs, 0, self.lanes, spread, rest, mean)
        points.triangle(A, rows, n, self.lanes)
        self.A[: n * self.lanes] = A[: n * self.lanes]
        if take > 0:
            self.repairs += points.downdate(
                self.A, take * mean[:n], n, self.lanes, np.full(2 * n, np.nan)
            )
        self.x = centre + mean[:n]

    def update(self, y, gate=np.inf):
        """Returns the NIS."""
        n, rows = self.n, len(self.R)
        steps = self.fix_set[0] * self.root
        E = np.array([y - self.h(self.x + step) for step in (np.zeros(n), *steps, *-steps)])
        self.innovation, dx = np.zeros(rows), np.zeros(n)
        work = np.full(rows * (n + rows + 5), np.nan)
        nis, repaired = points.correct_root(
            self.A, n, self.lanes, E, rows, *self.fix_set, self.R, gate, self.innovation, work, dx
        )
        self.repairs += repaired
        self.x = self.x + dx
        return nis
