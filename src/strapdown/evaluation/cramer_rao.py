"""Posterior Cramer-Rao bound of the 15 states along a known trajectory: what no filter can undercut
on average.

Source: Tichavsky, Muravchik & Nehorai (1998), "Posterior Cramer-Rao bounds for discrete-time
nonlinear filtering".
"""

from typing import NamedTuple

import numpy as np

from ..checks import DataError
from ..core.loop.contract import ATT, BA, BG, POS, STATES, VEL, InitialState, Noise
from ..data.recording import Recording
from ..data.solution import Solution, Trajectory
from ..engine.batch import fuse
from ..typing import Array
from .metrics import errors

DEPARTURE = 0.1
"""Largest error of the belief in its standard deviations; a bound is worth nothing where the
linearisation is not at the truth."""
NEGLIGIBLE_ERRORS = 1e-2, 1e-4
"""m, rad: errors that cannot change a Jacobian, allowed however small the standard deviation is."""


class Bound(NamedTuple):
    """The bound at times `t`: the least covariance of true - estimate, states in their usual
    order and units (SI, radians)."""

    t: Array  # (n,) s
    covariance: Array  # (n, 15, 15)
    std: Array  # (n, 15) roots of its diagonal

    @property
    def position(self) -> Array:
        """(n,) m: least root mean square of the three-dimensional position error."""
        return self._length(POS)

    @property
    def velocity(self) -> Array:
        """(n,) m/s: as `position`, of the velocity."""
        return self._length(VEL)

    @property
    def attitude(self) -> Array:
        """(n,) rad: as `position`, of the attitude's rotation vector."""
        return self._length(ATT)

    @property
    def accel_bias(self) -> Array:
        """(n,) m/s^2: as `position`, of the three accelerometer biases."""
        return self._length(BA)

    @property
    def gyro_bias(self) -> Array:
        """(n,) rad/s: as `position`, of the three gyro biases."""
        return self._length(BG)

    def _length(self, states: slice) -> Array:
        return np.sqrt(np.square(self.std[:, states]).sum(axis=1))


def cramer_rao(recording: Recording, start: InitialState, noise: Noise, every: int = 1) -> Bound:
    """The posterior Cramer-Rao Bound at every `every`-th IMU sample of an ideal recording.

    recording: error-free IMU samples, fixes at the truth that carry the standard deviations of the
    real ones, and the truth as reference; start: the true state, with the standard deviations of
    the prior; noise: the true Noise of the IMU.

    For additive Gaussian noise the bound's recursion is the covariance recursion of an extended
    Kalman filter whose Jacobians are taken at the truth. The closed loop on ideal data is the
    device: with every innovation zero its belief stays on the truth, and its P is that covariance.
    The source's expectation over trajectories falls away because one is given. The bound is on the
    mean square over prior, IMU and fixes, all Gaussian and as stated: fixes whose errors are white,
    with Gauss-Markov ones beside them where `Source.correlated` says so, and biases that walk or
    decay as `noise` says. One run, or a filter in a lucky minute, may be below it.

    Raises DataError where the belief leaves the truth: position by more than 0.1 of its standard
    deviation (and 1 cm), attitude by more than 0.1 of its own (and 0.1 mrad), per axis; or where a
    fix is not used.
    """
    if recording.reference is None or recording.reference.q_nb is None:
        raise DataError(
            "the bound needs the true trajectory with its attitude as the recording's reference"
        )
    solution = fuse(
        recording, "closed-loop", start=start, noise=noise, every=every, covariance=True
    )
    _check(solution, recording.reference)
    assert solution.covariance is not None  # it was asked for
    covariance = solution.covariance[:, :STATES, :STATES]
    return Bound(solution.t, covariance, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))


def _check(solution: Solution, truth: Trajectory) -> None:
    """Raise DataError where the belief is not on the truth, or fixes were rejected."""
    if rejected := [name for name, (_, bad) in solution.counts().items() if bad]:
        raise DataError(
            f"the bound needs ideal data, but fixes of {', '.join(rejected)} were rejected; give "
            f"fixes without noise"
        )
    e, std = errors(solution, truth), solution.trajectory.std
    assert std is not None
    for name, error, states, room, unit in (
        ("position", e.position, POS, NEGLIGIBLE_ERRORS[0], "m"),
        ("attitude", e.attitude, ATT, NEGLIGIBLE_ERRORS[1], "rad"),
    ):
        beyond = np.abs(error) - DEPARTURE * std[e.rows, states] - room
        if not np.all(beyond <= 0):
            row, axis = np.unravel_index(
                np.argmax(np.where(np.isnan(beyond), np.inf, beyond)), beyond.shape
            )
            raise DataError(
                f"the belief of the bound is {error[row, axis]:.3g} {unit} from the true {name} at "
                f"{e.t[row]:.2f} s "
                f"({std[e.rows, states][row, axis]:.3g} {unit} standard deviation); give an ideal "
                f"recording and its exact start"
            )
