"""The linear twin: an error that is exactly consistent with its covariance, and the effect of
chance on it.

A Kalman filter of the 15 error states runs along the truth with the IMU's noise and the fixes of a
cell. Its error is a Gauss-Markov sequence: over an epoch e <- A e + w, where A is the product of all
transitions and corrections (I - K H) Phi, and P the covariance that is left. Whitened by the roots
L of P, z = L^-1 e, it is z <- M z + (I - M M')^(1/2) n with M = L'^-1 A L and n of unit variance, so
that z is N(0, I) at each epoch, correlated in time as in the filter. Sets of such runs give the
number of epochs that a consistent filter has inside a band.

Equations: Groves (2013), Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems, 14.2.4; they are written down here again, so that the twin owes the filters nothing.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from strapdown.core.loop.contract import ATT, BA, BG, POS, STATES, VEL, Noise
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.evaluation.consistency import band
from strapdown.geometry.geodesy import radii
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.scenario import Scenario
from strapdown.sim.synthesis import Simulator
from strapdown.typing import Array, Ints

from ..common.gnss_alone import EPOCH, keep
from .worlds import world

EARTH_RATE, GRAVITY = 7.292115e-5, 9.81  # rad/s, m/s^2
BLOCK = 4000
"""Samples whose transitions are held at a time, about."""
SETS = 400
"""Sets of runs of a right filter: 4 of them are below what 1 in 100 come to."""


class Memory(NamedTuple):
    """Transition and noise of the twin's error from one epoch to the next."""

    covariance: Array  # (epochs + 1, 15, 15), the first at the start
    transition: Array  # (epochs, 15, 15) A


class Right(NamedTuple):
    """Results of sets of runs of a consistent filter."""

    inside: Array  # (sets,) share of the epochs inside the band
    anees: Array  # (sets,) mean of NEES over the states


def right(scenario: str, grade_name: str, fed: bool, runs: int, sets: int = SETS) -> Right:
    """Sets of `runs` of the twin of a cell, at the epochs that the table counts."""
    own, imu = world(scenario, fed), imu_spec(grade_name)
    made = Simulator(own)
    memory = make_memory(
        made.ideal_recording(),
        np.diag(own.start_deviations(imu) ** 2),
        imu.noise(),
        own.gnss.lever_arm,
        epoch_samples(own),
    )
    return draw_sets(whiten_memory(memory), runs, sets, np.random.default_rng(1))


def epoch_samples(own: Scenario) -> Ints:
    """The samples at whose end a study of this scenario keeps an epoch: the last, and back."""
    return np.arange(round(own.duration * own.rate) - 1, -1, -round(EPOCH * own.rate) * keep(own))[
        ::-1
    ]


def whiten_memory(memory: Memory) -> Array:
    """M of every epoch (epochs, 15, 15)."""
    P = memory.covariance
    scale = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    L = np.linalg.cholesky(P / (scale[:, :, None] * scale[:, None, :])) * scale[:, :, None]
    M = np.linalg.solve(
        L[1:] / scale[1:, :, None], (memory.transition / scale[1:, :, None]) @ L[:-1]
    )
    return np.asarray(M)


def draw_sets(M: Array, runs: int, sets: int, rng: np.random.Generator) -> Right:
    """Right of `sets` sets of `runs`, of M (epochs, s, s)."""
    epochs, s, _ = M.shape
    value, vector = np.linalg.eigh(np.eye(s) - M @ M.transpose(0, 2, 1))
    root = (vector * np.sqrt(np.clip(value, 0, None))[:, None, :]).astype(np.float32)
    low, high = band(s, runs)
    z = rng.standard_normal((s, sets * runs), np.float32)
    inside, total = np.zeros(sets), np.zeros(sets)
    for carried, renewed in zip(M.astype(np.float32), root):
        z = carried @ z + renewed @ rng.standard_normal(z.shape, np.float32)
        mean = (z * z).sum(axis=0, dtype=float).reshape(sets, runs).mean(axis=1)
        inside += (mean >= low) & (mean <= high)
        total += mean
    return Right(inside / epochs, total / epochs / s)


def make_memory(
    ideal: Recording, P: Array, noise: Noise, lever_arm: tuple[float, ...], at: Ints
) -> Memory:
    """Memory of the twin along an ideal recording from the covariance P, at the end of the samples
    `at`."""
    A, covariances, transitions = np.eye(STATES), [P], []
    fixes, epochs = _corrections(ideal, lever_arm), set(at.tolist())
    stops = sorted(epochs | set(fixes))
    for stop, (Phi, Q) in zip(stops, _transitions_between(ideal, noise, stops)):
        P, A = Phi @ P @ Phi.T + Q, Phi @ A
        for H, R in fixes.get(stop, ()):
            K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            left = np.eye(STATES) - K @ H
            P, A = left @ P @ left.T + K @ R @ K.T, left @ A
        if stop in epochs:
            covariances.append(P)
            transitions.append(A)
            A = np.eye(STATES)
    return Memory(np.array(covariances), np.array(transitions))


def _transitions_between(
    ideal: Recording, noise: Noise, stops: Sequence[int]
) -> Iterator[tuple[Array, Array]]:
    """Transition and noise up to the end of each of the samples `stops` from that of the one
    before."""
    begin = 0
    for part in np.array_split(stops, stops[-1] // BLOCK + 1):
        first = begin
        Phi, Q = _transitions(ideal, noise, np.arange(first, part[-1] + 1))
        for stop in part.tolist():
            rows = slice(begin - first, stop + 1 - first)
            yield compose_steps(Phi[rows], Q[rows])
            begin = stop + 1


def compose_steps(Phi: Array, Q: Array) -> tuple[Array, Array]:
    """Transition and noise of steps (n, 15, 15) one after the other."""
    while len(Phi) > 1:
        odd = len(Phi) % 2
        second, first = Phi[1 + odd :: 2], Phi[odd::2]
        later = second @ Q[odd::2] @ second.transpose(0, 2, 1) + Q[1 + odd :: 2]
        Phi, Q = (
            np.concatenate([Phi[:odd], second @ first]),
            np.concatenate([Q[:odd], later]),
        )
    return Phi[0], Q[0]


def _rows(ideal: Recording, source: Source) -> Ints:
    """The samples at whose end the fixes are."""
    return np.clip(np.searchsorted(ideal.imu.t, source.t - 1e-6), 0, len(ideal.imu.t) - 1)


def _transitions(ideal: Recording, noise: Noise, rows: Ints) -> tuple[Array, Array]:
    """Phi and Q of the samples `rows` (n, 15, 15), to the second order in their length."""
    assert ideal.reference is not None
    truth, n, dt = ideal.reference.take(rows + 1), len(rows), ideal.imu.dt[rows]
    assert truth.v_n is not None
    C = truth.rotation.as_matrix()
    f = np.einsum("nij,nj->ni", C, ideal.imu.dv[rows] / dt[:, None])
    lat, height = truth.lla[:, 0], truth.lla[:, 2]
    meridian, normal = radii(lat)
    north, east = meridian + height, normal + height
    v = truth.v_n
    earth = EARTH_RATE * np.stack([np.cos(lat), np.zeros(n), -np.sin(lat)], axis=1)
    transport = np.stack([v[:, 1] / east, -v[:, 0] / north, -v[:, 1] * np.tan(lat) / east], axis=1)
    F = np.zeros((n, STATES, STATES))
    F[:, POS, VEL] = np.eye(3)
    F[:, VEL, VEL] = -skew(2 * earth + transport)
    F[:, VEL, ATT], F[:, VEL, BA] = -skew(f), -C
    F[:, VEL.stop - 1, POS.stop - 1] = (
        2 * GRAVITY / np.sqrt(north * east)
    )  # gravity grows downwards
    F[:, ATT, ATT], F[:, ATT, BG] = -skew(earth + transport), -C
    F[:, ATT.start, VEL.start + 1] = -1 / east
    F[:, ATT.start + 1, VEL.start] = 1 / north
    F[:, ATT.start + 2, VEL.start + 1] = np.tan(lat) / east
    F[:, range(BA.start, BA.stop), range(BA.start, BA.stop)] = -noise.accel_decay
    F[:, range(BG.start, BG.stop), range(BG.start, BG.stop)] = -noise.gyro_decay
    step = F * dt[:, None, None]
    density = np.repeat(
        [0.0, noise.accel**2, noise.gyro**2, noise.accel_bias**2, noise.gyro_bias**2], 3
    )
    half = 0.5 * dt[:, None, None] * np.diag(density)
    Phi = np.eye(STATES) + step + 0.5 * step @ step
    return Phi, Phi @ half @ Phi.transpose(0, 2, 1) + half


def skew(v: Array) -> Array:
    """(n, 3, 3) with skew(a) b = a x b."""
    out = np.zeros((len(v), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = v.T
    return out - out.transpose(0, 2, 1)


def _corrections(
    ideal: Recording, lever_arm: tuple[float, ...]
) -> dict[int, list[tuple[Array, Array]]]:
    """{sample: [(H, R)]} of the fixes."""
    truth, imu = ideal.reference, ideal.imu
    assert truth is not None
    found: dict[int, list[tuple[Array, Array]]] = {}
    for source in ideal.sources:
        rows = _rows(ideal, source)
        C = truth.rotation[rows + 1].as_matrix()
        H, R = np.zeros((len(rows), 3, STATES)), source.std[:, None, :] ** 2 * np.eye(3)
        arm = C @ np.array(lever_arm)
        if source.kind == "position":
            H[:, :, POS], H[:, :, ATT] = np.eye(3), -skew(arm)
        elif source.kind == "velocity":
            rate = imu.dtheta[rows] / imu.dt[rows, None]
            swept = np.einsum("nij,nj->ni", C, np.cross(rate, lever_arm))
            H[:, :, VEL], H[:, :, ATT] = np.eye(3), -skew(swept)
        else:  # attitude: rotations about the forward and right axes of the heading, and down
            heading = np.arctan2(C[:, 1, 0], C[:, 0, 0])
            c, s, none = np.cos(heading), np.sin(heading), np.zeros(len(rows))
            H[:, 0, ATT] = np.stack([c, s, none], axis=1)
            H[:, 1, ATT] = np.stack([-s, c, none], axis=1)
            H[:, 2, ATT.stop - 1] = 1.0
        for row, h, r in zip(rows.tolist(), H, R):
            found.setdefault(row, []).append((h, r))
    return found
