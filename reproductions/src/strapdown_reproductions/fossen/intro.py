"""The introductory example of Fossen's chapter 14 (section 14.4.1): an aided INS along one axis, in
plain numpy.

A body moves along a line and turns about one axis; its accelerometer and rate sensor have biases,
and its position and angle are measured now and then. The five states are position (m), velocity
(m/s), angle (rad), accelerometer bias (m/s^2) and rate bias (rad/s). Three filters use the same
records: the feedforward one estimates the error of an INS that it never touches, the feedback one
puts that estimate into the INS at each fix, the direct one estimates the state itself. Errors are
true - estimate, so that a bias, which is what a sensor reads too much, drives them with a minus.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from scipy.linalg import expm

from strapdown.typing import Array, ArrayLike, Mask

from ..common.reproduction import SEED

STATES = (
    "position, m",
    "velocity, m/s",
    "angle, deg",
    "accelerometer bias, m/s^2",
    "rate bias, deg/s",
)
SCALE = np.array([1.0, 1.0, np.degrees(1), 1.0, np.degrees(1)])
"""From SI to the units of STATES."""
H = np.array([[1.0, 0, 0, 0, 0], [0, 0, 1, 0, 0]])
"""Measurement matrix: position and angle are measured."""
FORMS = ("feedforward", "feedback", "direct")
BIASES = ("constant", "decaying")
BEGIN = (0.3, 0.05)
"""m/s^2 and rad/s: the biases at the beginning."""
OUTAGE = (180.0, 240.0)
"""s without fixes."""


class IntroModel(NamedTuple):
    """The model that a filter assumes. Densities are roots: m/s/sqrt(s) and so on; time constants
    in s, inf for a random walk."""

    accel: float = 0.005 * 0.1**0.5
    rate: float = 0.005 * 0.1**0.5
    accel_bias: float = 3e-4
    rate_bias: float = 3e-5
    accel_time: float = 300.0
    rate_time: float = 300.0
    position_std: float = 0.05  # m
    angle_std: float = 0.01  # rad
    start_std: tuple[float, float, float, float, float] = (1.0, 0.3, 0.1, 0.3, 0.1)

    @property
    def R(self) -> Array:
        """(2, 2) covariance of a measurement of position and angle."""
        return np.diag([self.position_std, self.angle_std]) ** 2

    def without_decay(self) -> "IntroModel":
        """The same with biases that are driven by white noise alone, as the chapter's direct
        filters have them."""
        return self._replace(accel_time=np.inf, rate_time=np.inf)


MODEL = IntroModel()
"""That of the published example."""


class IntroRecord(NamedTuple):
    """Simulated records of several runs: IMU samples are means over the dt before their time."""

    t: Array  # (n + 1,) s, from 0
    dt: float  # s
    imu: Array  # (n, runs, 2) measured acceleration m/s^2 and rate rad/s
    true: Array  # (n + 1, runs, 5) states
    fixes: Array  # (n, runs, 2) measured position and angle after each sample
    fixed: Mask  # (n,) whether there is a fix


class IntroFixes(NamedTuple):
    """When there are fixes: each `every` s but in the outages [(start, stop)], s."""

    outages: Sequence[tuple[float, float]] = ()
    every: float = 1.0

    def at(self, t: Array, rate: float) -> Mask:
        """(n,) whether there is one after a sample of `rate` Hz that ends at t (n,)."""
        fixed = np.arange(1, len(t) + 1) % round(self.every * rate) == 0
        for start, stop in self.outages:
            fixed &= (t < start) | (t >= stop)
        return fixed


ALWAYS = IntroFixes()


class IntroEstimate(NamedTuple):
    """A filter's estimates of a record, rows as those of `IntroRecord.true`."""

    x: Array  # (n + 1, runs, 5) states
    std: Array  # (n + 1, 5) standard deviations that it states
    ins: Array  # (n + 1, runs, 3) position, velocity and angle of the INS behind it


Kept: TypeAlias = dict[tuple[str, int, str], tuple[IntroRecord, IntroEstimate]]
"""By biases, outage (0 or 1) and form."""


def dynamics(model: IntroModel) -> tuple[Array, Array]:
    """(F (5, 5), G (5, 4)) of the error states: d dx/dt = F dx + G w, w the noise of
    acceleration, rate and the two biases."""
    F, G = np.zeros((5, 5)), np.zeros((5, 4))
    F[0, 1], F[1, 3], F[2, 4] = 1.0, -1.0, -1.0
    F[3, 3], F[4, 4] = -1 / model.accel_time, -1 / model.rate_time
    G[1, 0], G[2, 1], G[3, 2], G[4, 3] = -1.0, -1.0, 1.0, 1.0
    return F, G


def discretise(model: IntroModel, dt: float) -> tuple[Array, Array]:
    """(Phi (5, 5), Q (5, 5)) over dt s, by Van Loan's matrix exponential."""
    F, G = dynamics(model)
    W = np.diag([model.accel, model.rate, model.accel_bias, model.rate_bias]) ** 2
    both = expm(np.block([[-F, G @ W @ G.T], [np.zeros((5, 5)), F.T]]) * dt)
    Phi = both[5:, 5:].T
    Q = Phi @ both[:5, 5:]
    return Phi, 0.5 * (Q + Q.T)


def observable(measured: ArrayLike, model: IntroModel = MODEL) -> int:
    """Number of the five states that the rows `measured` (k, 5) determine: the rank of the
    observability matrix."""
    F, rows = dynamics(model)[0], [np.atleast_2d(measured)]
    for _ in range(4):
        rows.append(rows[-1] @ F)
    return int(np.linalg.matrix_rank(np.vstack(rows)))


def simulate(
    rng: np.random.Generator,
    runs: int = 1,
    biases: str = "constant",
    fixes: IntroFixes = ALWAYS,
    duration: float = 300.0,
    rate: float = 10.0,
    model: IntroModel = MODEL,
) -> IntroRecord:
    """A IntroRecord of `duration` s at `rate` Hz: acceleration and rate are the first components of the
    chapter's signal 1.

    biases: "constant", or "decaying" with the time constants of the model, from BEGIN both; the
    model's driving noise moves the decaying ones.
    """
    n, dt = round(duration * rate), 1 / rate
    t = np.arange(n + 1) * dt
    motion = np.stack(
        [t - 10 * np.sin(0.1 * t), 1 - np.cos(0.1 * t), 0.15 * np.sin(0.2 * t)], axis=1
    )
    bias = np.tile(np.array(BEGIN), (n + 1, runs, 1))
    if biases == "decaying":
        keep = np.exp(-dt / np.array([model.accel_time, model.rate_time]))
        steps = (
            np.sqrt(dt)
            * np.array([model.accel_bias, model.rate_bias])
            * rng.standard_normal((n, runs, 2))
        )
        for k in range(n):
            bias[k + 1] = keep * bias[k] + steps[k]
    true = np.concatenate([np.repeat(motion[:, None], runs, axis=1), bias], axis=2)
    mean = np.diff(motion[:, 1:], axis=0)[:, None] / dt
    imu = (
        mean
        + bias[1:]
        + np.array([model.accel, model.rate]) / np.sqrt(dt) * rng.standard_normal((n, runs, 2))
    )
    measured = true[1:] @ H.T + np.array(
        [model.position_std, model.angle_std]
    ) * rng.standard_normal((n, runs, 2))
    return IntroRecord(t, dt, imu, true, measured, fixes.at(t[1:], rate))


def strapdown(state: Array, u: Array, dt: float) -> Array:
    """Position, velocity and angle (runs, 3) a sample later: acceleration and rate u (runs, 2)
    constant over dt."""
    position, velocity, angle = state.T
    return np.stack(
        [
            position + dt * velocity + 0.5 * dt * dt * u[:, 0],
            velocity + dt * u[:, 0],
            angle + dt * u[:, 1],
        ],
        axis=1,
    )


def estimate(
    record: IntroRecord, form: str = "feedforward", model: IntroModel = MODEL
) -> IntroEstimate:
    """The IntroEstimate of one of FORMS, begun at the true position, velocity and angle and with biases
    of 0.

    feedforward: the INS integrates the raw IMU; its error, biases included, is the filter's state
    and decays with the time constants. feedback: the error is put into INS and biases at each fix
    and is 0 then; in between the INS holds its biases, as in the published code. direct: the five
    states themselves, with the IMU as input and biases that do not decay. Raises ValueError for
    another form.
    """
    if form not in FORMS:
        raise ValueError(f"no form {form!r}; there is: {', '.join(FORMS)}")
    return (
        _direct(record, model.without_decay())
        if form == "direct"
        else _indirect(record, model, form == "feedback")
    )


def _indirect(record: IntroRecord, model: IntroModel, feedback: bool) -> IntroEstimate:
    Phi, Q = discretise(model, record.dt)
    runs = record.imu.shape[1]
    ins, bias, dx, P = (
        record.true[0, :, :3],
        np.zeros((runs, 2)),
        np.zeros((runs, 5)),
        np.diag(model.start_std) ** 2,
    )
    rows = [(np.c_[ins, bias], np.diag(P), ins)]
    for u, fix, fixed in zip(record.imu, record.fixes, record.fixed):
        ins = strapdown(ins, u - bias, record.dt)
        dx, P = dx @ Phi.T, Phi @ P @ Phi.T + Q
        if fixed:
            dx, P = correct(dx, P, fix - ins @ H[:, :3].T, model.R)
            if feedback:
                ins, bias, dx = ins + dx[:, :3], bias + dx[:, 3:], np.zeros((runs, 5))
        rows.append((np.c_[ins, bias] + dx, np.diag(P), ins))
    return _stack_rows(rows)


def _direct(record: IntroRecord, model: IntroModel) -> IntroEstimate:
    Phi, Q = discretise(model, record.dt)
    runs = record.imu.shape[1]
    x, P = np.c_[record.true[0, :, :3], np.zeros((runs, 2))], np.diag(model.start_std) ** 2
    rows = [(x, np.diag(P), x[:, :3])]
    for u, fix, fixed in zip(record.imu, record.fixes, record.fixed):
        x, P = x @ Phi.T, Phi @ P @ Phi.T + Q
        x[:, :3] += strapdown(np.zeros((runs, 3)), u, record.dt)
        if fixed:
            x, P = correct(x, P, fix, model.R)
        rows.append((x, np.diag(P), x[:, :3]))
    return _stack_rows(rows)


def _stack_rows(rows: Sequence[tuple[Array, Array, Array]]) -> IntroEstimate:
    x, variance, ins = (np.array(column) for column in zip(*rows))
    return IntroEstimate(x, np.sqrt(variance), ins)


def correct(x: Array, P: Array, y: Array, R: Array) -> tuple[Array, Array]:
    """States (runs, 5) and covariance after measurements y (runs, 2) of position and angle, or
    of their errors; Joseph's form."""
    gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    rest = np.eye(5) - gain @ H
    return x + (y - x @ H.T) @ gain.T, rest @ P @ rest.T + gain @ R @ gain.T


def study(runs: int, seed: int = SEED) -> tuple[pd.DataFrame, Kept]:
    """(DataFrame, {(biases, outage, form): (Record, Estimate)}): rows of seed, biases, outage (0 or
    1), form and what became of position and bias.

    position_m and ins_m: errors of estimate and INS, at the end of the record or of the OUTAGE;
    bias_before, bias_after: error of the accelerometer bias at the beginning and at the end of the
    OUTAGE, m/s^2; bias_left: its estimate at the end by that at the beginning, and bias_model what the
    time constant leaves of it.
    """
    rows, kept = [], {}
    for i, biases in enumerate(BIASES):
        for outage in (0, 1):
            record = simulate(
                np.random.default_rng([seed, i, outage]),
                runs,
                biases,
                IntroFixes((OUTAGE,) if outage else ()),
            )
            before, after = (int(np.argmin(np.abs(record.t - at))) for at in OUTAGE)
            after, end = after - 1, after - 1 if outage else len(record.t) - 1
            faded = np.exp(-(record.t[after] - record.t[before - 1]) / MODEL.accel_time)
            for form in FORMS:
                made = estimate(record, form)
                error, ins = (
                    np.abs(record.true - made.x),
                    np.abs(record.true[end, :, 0] - made.ins[end, :, 0]),
                )
                rows += [
                    {
                        "seed": k,
                        "biases": biases,
                        "outage": outage,
                        "form": form,
                        "position_m": error[end, k, 0],
                        "ins_m": ins[k],
                        "bias_before": error[before - 1, k, 3],
                        "bias_after": error[after, k, 3],
                        "bias_left": made.x[after, k, 3] / made.x[before - 1, k, 3],
                        "bias_model": faded,
                    }
                    for k in range(runs)
                ]
                kept[biases, outage, form] = record, made
    return pd.DataFrame(rows), kept
