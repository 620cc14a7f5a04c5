"""Correlated errors of sources as states: every filter that can have them, forwards and smoothed,
against a dense Kalman filter and a textbook Rauch-Tung-Striebel smoother; what acts where there is no
state; consistency."""

from dataclasses import replace

import numpy as np
import pytest
from flat_flight import flat
from lasting import EXACT, POSITION, TIME, VELOCITY, alone, erring, straight, told
from recordings import SWIFT
from scipy.stats import chi2

import strapdown as sd
from strapdown import filters
from strapdown.geometry.geodesy import displacement

OWN_GAINS = ("nlo", "two-stage-ekf", "xkf-two-stage")
"""Filters whose gains are not those of least variance: no twin of these, and their innovations are not
white."""
ABLE = [n for n in SWIFT if filters.find(n).installation and n not in OWN_GAINS]
FREE = [name for name in ABLE if not filters.find(name).needs]
OWN = 6 + 5
"""States of the twin: errors of position and velocity, and five that are correlated errors."""


class Dense:
    """Errors of position and velocity of an INS that runs alone, and the correlated errors of its
    fixes, in dense matrices, by sample; `smoothed` after Rauch, Tung & Striebel (1965)."""

    def __init__(self, recording, start):
        path, dt = alone(recording, start), recording.imu.dt[0]
        deviation = np.array([POSITION[0], POSITION[2], *VELOCITY])
        self.x, self.P = np.zeros(OWN), np.diag([*start.std[:6], *deviation]) ** 2
        self.Phi = np.eye(OWN)
        self.Phi[:3, 3:6], keep = dt * np.eye(3), np.exp(-dt / TIME)
        self.Phi[6:, 6:] = keep * np.eye(5)
        q, one = EXACT.accel**2, np.eye(3)
        self.Q = np.zeros((OWN, OWN))
        self.Q[:3, :3], self.Q[3:6, 3:6] = q * dt**3 / 3 * one, q * dt * one
        self.Q[:3, 3:6] = self.Q[3:6, :3] = q * dt**2 / 2 * one
        self.Q[6:, 6:] = np.diag(deviation**2 * (1 - keep**2))
        H = [np.eye(3, OWN), np.eye(3, OWN, 3)]
        H[0][0, 6] = H[0][2, 7] = 1.0
        H[1][:, 8:] = np.eye(3)
        fixes = {round(t / dt): row for row, t in enumerate(recording.sources[0].t)}
        self.rows = []  # x, P predicted; x, P
        for k, (lla, v) in enumerate(zip(path.lla, path.v_n), 1):
            self.x, self.P = self.Phi @ self.x, self.Phi @ self.P @ self.Phi.T + self.Q
            before = self.x, self.P
            if k in fixes:
                position, velocity = (a for a in recording.sources[:2])
                row = fixes[k]
                self.correct(H[0], flat(position.y[row], lla), position.std[row])
                self.correct(H[1], velocity.y[row] - v, velocity.std[row])
            self.rows.append((*before, self.x, self.P))
        self.path, self.fixed = path, np.array(sorted(fixes)) - 1

    def correct(self, H, y, deviation):
        S = H @ self.P @ H.T + np.diag(deviation**2)
        K = np.linalg.solve(S, H @ self.P).T
        self.x, self.P = self.x + K @ (y - H @ self.x), self.P - K @ S @ K.T

    @property
    def filtered(self):
        return [(x, P) for _, _, x, P in self.rows]

    @property
    def smoothed(self):
        done = [self.rows[-1][2:]]
        for (_, _, x, P), (x_next, P_next, _, _) in zip(self.rows[-2::-1], self.rows[:0:-1]):
            G = np.linalg.solve(P_next, self.Phi @ P).T
            x_s, P_s = done[-1]
            done.append((x + G @ (x_s - x_next), P + G @ (P_s - P_next) @ G.T))
        return done[::-1]

    def same(self, solution, rows):
        """Assert that a solution is as these rows (x, P); correlated errors where there were
        fixes."""
        x, P = (np.array(part) for part in zip(*rows))
        deviation = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        p = flat(self.path.lla) - flat(solution.trajectory.lla)
        own = np.hstack([-p, solution.trajectory.v_n - self.path.v_n])
        np.testing.assert_allclose((own - x[:, :6]) / deviation[:, :6], 0, atol=0.03)
        np.testing.assert_allclose(solution.trajectory.std[:, :6], deviation[:, :6], rtol=0.02)
        names = [name for name in solution.columns if "correlated" in name]
        c = np.stack([solution.columns[name] for name in names], axis=1)[self.fixed]
        np.testing.assert_allclose(
            (c[:, :5] - x[self.fixed, 6:]) / deviation[self.fixed, 6:], 0, atol=0.03
        )
        np.testing.assert_allclose(c[:, 5:], deviation[self.fixed, 6:], rtol=0.02)


@pytest.fixture(scope="module")
def dense():
    return Dense(*straight())


SHORT = pytest.param("closed-loop", marks=pytest.mark.short)


@pytest.mark.parametrize("name", [SHORT, *(name for name in ABLE if name != "closed-loop")])
def test_every_filter_is_the_dense_one_with_these_states(name, dense):
    recording, start = straight(known=bool(filters.find(name).needs))
    solution = sd.fuse(recording, name, start=start, noise=EXACT)
    dense.same(solution, dense.filtered)


@pytest.mark.parametrize("name", [name for name in ABLE if filters.find(name).smoother])
def test_every_smoother_is_the_textbooks(name, dense):
    recording, start = straight()
    dense.same(sd.smooth(recording, name, start=start, noise=EXACT), dense.smoothed)


def fused(recording, start, **more):
    return sd.fuse(recording, start=start, noise=EXACT, covariance=True, **more)


def alike(first, second, tolerance=1e-6):
    """Assert that two solutions are the same to such a part of their standard deviations."""
    a, b = first.trajectory, second.trajectory
    own = np.hstack([flat(a.lla) - flat(b.lla), a.v_n - b.v_n]) / b.std[:, :6]
    np.testing.assert_allclose(own, 0, atol=tolerance)
    np.testing.assert_allclose(a.std, b.std, rtol=tolerance)


@pytest.mark.short
def test_fixes_without_a_component_only_part_the_time_between_others():
    recording, start = straight()
    more = []
    for a in recording.sources:
        t = np.sort(np.r_[a.t, a.t[:-1] + 0.2])
        y = np.full((len(t), 3), np.nan)
        y[np.isin(t, a.t)] = a.y
        more.append(replace(a, t=t, y=y, std=np.tile(a.std[:1], (len(t), 1))))
    found = fused(replace(recording, sources=tuple(more)), start)
    alike(found, fused(recording, start))


@pytest.mark.short
def test_without_states_they_widen_the_standard_deviations():
    recording, start = straight(states=False)
    wider = tuple(
        replace(a, std=np.hypot(a.std, a.correlated.std), correlated=None)
        for a in recording.sources
    )
    found = fused(recording, start)
    assert not any("correlated" in name for name in found.columns)
    alike(found, fused(replace(recording, sources=wider), start), 1e-9)


@pytest.mark.parametrize("name", [SHORT, *(name for name in ABLE if name != "closed-loop")])
def test_errors_that_are_forgotten_between_fixes_are_white(name):
    """Also where a known attitude errs, for the time of four fixes."""
    recording, start = straight(known=bool(filters.find(name).needs))
    *gnss, last = recording.sources
    if last.kind == "attitude":
        last = replace(last, std=np.full_like(last.std, 0.02))._where(
            np.arange(len(last.t)) % 4 == 3
        )
    recording = replace(recording, sources=(*gnss, last))
    recording = told(recording, POSITION, 1e-3)
    white = told(recording, POSITION, 1e-3, False)
    found, expected = (fused(each, start, filter=name) for each in (recording, white))
    alike(found, expected, 1e-3)


@pytest.mark.short
def test_errors_that_are_next_to_nothing_change_nothing():
    recording, start = straight()
    white = tuple(replace(a, correlated=None) for a in recording.sources)
    next_to_none = told(replace(recording, sources=white), (1e-6,) * 3, TIME)
    alike(fused(next_to_none, start), fused(replace(recording, sources=white), start))


@pytest.mark.short
def test_columns_stand_still_between_the_fixes_of_their_source():
    found = fused(*straight())
    names = [
        *(f"position correlated error {axis} [m]" for axis in ("north", "down")),
        *(f"velocity correlated error {axis} [m/s]" for axis in ("north", "east", "down")),
    ]
    assert list(found.columns) == [*names, *(f"std of {name}" for name in names)]
    for name, deviation in zip(names, (1.5, 2.5, 0.3, 0.2, 0.1)):
        for column, first in ((name, 0.0), (f"std of {name}", deviation)):
            values = found.columns[column]
            changed = np.flatnonzero(np.diff(values)) + 1
            np.testing.assert_allclose(found.t[changed] % 0.5, 0.0, atol=1e-6)
            assert values[0] == pytest.approx(first) and len(changed) == 40


CARS, SECONDS = range(1005, 1017), 90.0


def squares(told_of):
    """Normalised estimation errors squared of position and velocity at the end of each car, whose
    positions err for 20 s; `told_of`: makes a recording that says so."""
    found = []
    for seed in CARS:
        made = erring(sd.simulate("car", SECONDS, "tactical", seed), (1.5, 1.5, 2.5), 20.0, seed)
        solution, truth = sd.fuse(told_of(made), covariance=True), made.reference
        row = np.searchsorted(truth.t, solution.t[-1] - 1e-6)
        at = solution.trajectory
        e = np.r_[
            displacement(truth.lla[row : row + 1], at.lla[-1:])[0], truth.v_n[row] - at.v_n[-1]
        ]
        found.append(e @ np.linalg.solve(solution.covariance[-1][:6, :6], e))
    return sum(found)


def test_the_closed_loop_is_consistent_where_positions_err_for_long():
    low, high = chi2.ppf([0.005, 0.995], 6 * len(CARS))
    assert low < squares(lambda made: told(made, (1.5, 1.5, 2.5), 20.0)) < high
    assert squares(lambda made: made) > 2 * high
