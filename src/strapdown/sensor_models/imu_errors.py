"""The errors of an IMU, sample after sample: from ideal increments and what chance has decided
before the first sample to increments as measured and the biases behind them.

`simulate_errors` is one kernel for one run and for eight. What all runs share (samples, times,
sizes of the errors) and what each has of its own (keys, constants, states) are arguments apart, and
what depends on a run is chosen by `where`, never by `if`. It goes on from its state: blocks of any
lengths give the bits of one block.

Order: scale, misalignment and g-sensitivity of the true increments; bias and noise; quantisation;
saturation.
"""

import math
from typing import NamedTuple

import numpy as np

from ..core.compile.jit import helper, kernel
from ..core.compile.selection import where
from ..core.compile.signatures import in_lanes, reals, record, signature, wholes
from ..core.loop.contract import Imu
from ..core.mathematics.elementary import floor
from ..core.mathematics.threefry import normal_pair
from ..typing import Array, Ints
from .errors import Triad, WarmUp
from .noise import FLICKER_TIMES, FLICKER_VARIANCE, even_steps, gauss_markov_step
from .streams import RandomStream

GYRO, ACCEL = 0, 1
"""Numbers of the two triads, and the order in which they stand in all arrays."""
NOISE, WALK, MARKOV, TIME, FLICKER, STEP, FULL, DISTORTED, FELT, SIZES = range(10)
"""Places of a triad's sizes, shared by all runs: white noise, bias walk, Gauss-Markov bias and its time
constant, flicker, step of the counter, full scale, and whether it has a distortion and a g-sensitivity;
their number. 0: none."""
OF_NOISE, OF_WALK, OF_MARKOV, OF_FLICKER, KEYS = 0, 2, 4, 6, 8
OF_SAMPLES = {
    OF_NOISE: "noise",
    OF_WALK: "bias_walk",
    OF_MARKOV: "gauss_markov",
    OF_FLICKER: "flicker",
}
"""Places of a triad's keys, two words each: the terms that draw anew with each sample, as their
streams are named; their number."""
CONSTANT, DISTORTION, SENSITIVITY, CONSTANTS = 0, 3, 12, 21
"""Places of what is constant in a run: a triad's turn-on bias, what scale and misalignment add to
the true increments (3 x 3), what specific force adds (3 x 3); their number."""
PROCESSES = len(FLICKER_TIMES)
WALKED, DRIFTED, FLICKERED = 0, 3, 6
LEFT = FLICKERED + 3 * PROCESSES
SPARE, DRAWN, STATE = LEFT + 3, LEFT + 6, LEFT + 9
"""Places of a triad's state: walk, Gauss-Markov (of variance 1) and flicker (processes of variance 1, by
rows), what the counter has left over, in steps, halves of blocks of random numbers that the next
sample takes, three random numbers; their number."""
RATES = 2 * (2 + PROCESSES)
"""Places of the share that is left of each Gauss-Markov process and the standard deviation of what
is new: those of the triads, then flicker's."""
FLICKER_SCALE = float(np.sqrt(FLICKER_VARIANCE))
FLICKER_T = tuple(FLICKER_TIMES.tolist())
FLICKER_BLOCKS = (3 * PROCESSES + 1) // 2  # of random numbers in a sample


class Shared(NamedTuple):
    """Samples and error sizes that all runs share."""

    dtheta: Array  # (n, 3) rad, ideal
    dv: Array  # (n, 3) m/s, ideal
    dt: Array  # (n,) s
    step: Array  # (n,) s since the sample before; inf at the first of all
    told: Array  # (n or 0, 6) rad/s, m/s^2: biases that chance has no part in
    sizes: Array  # (2 SIZES,)


class Own(NamedTuple):
    """Random constants of a run, drawn before its first sample, and its current state."""

    keys: Ints  # (2 KEYS,)
    constants: Array  # (2 CONSTANTS,)
    state: Array  # (2 STATE,)

    @property
    def distortions(self) -> Array:
        """(27,) three 3 x 3 by rows: what true rotations and velocity increments add to the measured
        rotations, and velocity increments to themselves."""
        gyro, accel = self.constants.reshape(2, CONSTANTS)
        return np.r_[gyro[DISTORTION:], accel[DISTORTION:SENSITIVITY]]

    @property
    def left(self) -> Array:
        """(6,) what the counters of gyros and accelerometers have left over, in steps."""
        return self.state.reshape(2, STATE)[:, LEFT : LEFT + 3].ravel()


SHARED = record(
    Shared,
    dtheta=reals("n", 3),
    dv=reals("n", 3),
    dt=reals("n"),
    step=reals("n"),
    told=reals("told", 6),
    sizes=reals(2 * SIZES),
)
OWN = record(Own, keys=wholes(2 * KEYS), constants=reals(2 * CONSTANTS), state=reals(2 * STATE))
SIMULATE = signature(
    "simulate_errors",
    rows=wholes(2),
    shared=SHARED,
    own=OWN,
    rates=reals(RATES),
    u=reals("block", 6),
    bias=reals("block", 6),
)
SIMULATE_LANES = in_lanes(SIMULATE, "shared", "rates", words=("keys",))
"""For eight runs at once."""


@kernel(SIMULATE)
def simulate_errors(
    rows: Ints, shared: Shared, own: Own, rates: Array, u: Array, bias: Array
) -> None:
    """The samples rows[0] to before rows[1] of a run, whose state goes on. `rates` (RATES,) is room
    to work.

    u (n, 6): rotations (rad) and velocity increments (m/s) as measured, from rows[0] on; bias
    (n, 6) behind them: rad/s, m/s^2.
    """
    for row in range(rows[0], rows[1]):
        if row == rows[0] or shared.step[row] != shared.step[row - 1]:
            _set_rates(shared.step[row], shared.sizes, rates)
        for triad in range(2):
            _bias(triad, row - rows[0], row, shared, own, rates, bias)
            _measure_increments(triad, row - rows[0], row, shared, own, bias, u)


simulate_errors_in_lanes = simulate_errors.for_runs(SIMULATE_LANES)  # type: ignore[attr-defined]
"""For eight runs at once."""


@helper
def _bias(
    triad: int, i: int, row: int, shared: Shared, own: Own, rates: Array, bias: Array
) -> None:
    """Go on with the bias of a triad."""
    sizes, constants, state = shared.sizes, own.constants, own.state
    z, s, o = triad * SIZES, triad * STATE, 3 * triad
    for c in range(3):
        bias[i, o + c] = constants[triad * CONSTANTS + CONSTANT + c]
    if shared.told.shape[0] > 0:
        for c in range(3):
            bias[i, o + c] += shared.told[row, o + c]
    if sizes[z + WALK] > 0:
        _draw(triad, OF_WALK, row, own)
        if row > 0:
            drive = sizes[z + WALK] * math.sqrt(shared.step[row])
            for c in range(3):
                state[s + WALKED + c] += drive * state[s + DRAWN + c]
        for c in range(3):
            bias[i, o + c] += state[s + WALKED + c]
    if sizes[z + MARKOV] > 0:
        _draw(triad, OF_MARKOV, row, own)
        keep, drive = rates[2 * triad], rates[2 * triad + 1]
        for c in range(3):
            now = keep * state[s + DRIFTED + c] + drive * state[s + DRAWN + c]
            state[s + DRIFTED + c] = now
            bias[i, o + c] += sizes[z + MARKOV] * now
    if sizes[z + FLICKER] > 0:
        _flicker(triad, row, own, rates)
        size = FLICKER_SCALE * sizes[z + FLICKER]
        for j in range(3 * PROCESSES):
            bias[i, o + j % 3] += size * state[s + FLICKERED + j]


@helper
def _draw(triad: int, key: int, row: int, own: Own) -> None:
    """The numbers 3 row to 3 row + 2 of a key into the state, row after row: of a block that two
    rows share the second half waits there."""
    k0, k1 = own.keys[triad * KEYS + key], own.keys[triad * KEYS + key + 1]
    state, s, block = own.state, triad * STATE + DRAWN, 3 * (row >> 1)
    spare = triad * STATE + SPARE + (key >> 1)
    if row & 1:
        state[s] = state[spare]
        state[s + 1], state[s + 2] = normal_pair(k0, k1, block + 2)
    else:
        state[s], state[s + 1] = normal_pair(k0, k1, block)
        state[s + 2], state[spare] = normal_pair(k0, k1, block + 1)


@helper
def _flicker(triad: int, row: int, own: Own, rates: Array) -> None:
    """Go on with the processes of flicker, by rows of the three axes."""
    k, at = triad * KEYS + OF_FLICKER, triad * STATE + FLICKERED
    for block in range(FLICKER_BLOCKS):
        one, other = normal_pair(own.keys[k], own.keys[k + 1], FLICKER_BLOCKS * row + block)
        j = 2 * block
        own.state[at + j] = _gone_on(own.state[at + j], one, j, rates)
        if j + 1 < 3 * PROCESSES:
            own.state[at + j + 1] = _gone_on(own.state[at + j + 1], other, j + 1, rates)


@helper
def _gone_on(value: float, new: float, j: int, rates: Array) -> float:
    """Process j of flicker after a step."""
    p = j // 3
    return rates[4 + 2 * p] * value + rates[5 + 2 * p] * new


@helper
def _measure_increments(
    triad: int, i: int, row: int, shared: Shared, own: Own, bias: Array, u: Array
) -> None:
    """The increments of a triad as measured."""
    sizes, constants, state, dt = shared.sizes, own.constants, own.state, shared.dt[row]
    z, s, o = triad * SIZES, triad * STATE, 3 * triad
    for c in range(3):
        u[i, o + c] = bias[i, o + c] * dt
    if sizes[z + NOISE] > 0:
        _draw(triad, OF_NOISE, row, own)
        drive = sizes[z + NOISE] * math.sqrt(dt)
        for c in range(3):
            u[i, o + c] += drive * state[s + DRAWN + c]
    _distort(triad, i, row, shared, constants, u)
    if sizes[z + STEP] > 0:
        for c in range(3):
            count = state[s + LEFT + c] + u[i, o + c] / sizes[z + STEP]
            whole = floor(count)
            state[s + LEFT + c] = count - whole
            u[i, o + c] = whole * sizes[z + STEP]
    if sizes[z + FULL] > 0:
        full = sizes[z + FULL] * dt
        for c in range(3):
            x = u[i, o + c]
            u[i, o + c] = where(x > full, full, where(x < -full, -full, x))


@helper
def _distort(triad: int, i: int, row: int, shared: Shared, constants: Array, u: Array) -> None:
    """Add the true increments of a triad, with g-sensitivity, scale and misalignment."""
    z, o, d = triad * SIZES, 3 * triad, triad * CONSTANTS
    if shared.sizes[z + FELT] > 0:
        for c in range(3):
            at = d + SENSITIVITY + 3 * c
            for e in range(3):
                u[i, o + c] += constants[at + e] * shared.dv[row, e]
    for c in range(3):
        at = d + DISTORTION + 3 * c
        for e in range(3):
            true = shared.dtheta[row, e] if triad == GYRO else shared.dv[row, e]
            if shared.sizes[z + DISTORTED] > 0:
                u[i, o + c] += constants[at + e] * true
            if e == c:
                u[i, o + c] += true


@helper
def _set_rates(step: float, sizes: Array, rates: Array) -> None:
    """For a step in s."""
    for triad in range(2):
        if sizes[triad * SIZES + MARKOV] > 0:
            rates[2 * triad], rates[2 * triad + 1] = gauss_markov_step(
                step / sizes[triad * SIZES + TIME]
            )
    if sizes[FLICKER] > 0 or sizes[SIZES + FLICKER] > 0:
        for p in range(PROCESSES):
            rates[4 + 2 * p], rates[5 + 2 * p] = gauss_markov_step(step / FLICKER_T[p])


def sizes_of(gyro: Triad, accel: Triad) -> Array:
    """(2 SIZES,) of two triads."""
    return np.array([_sizes(gyro), _sizes(accel)]).ravel()


def _sizes(triad: Triad) -> list[float]:
    return [
        triad.noise,
        triad.bias_walk,
        triad.gauss_markov,
        triad.time_constant,
        triad.flicker,
        triad.quantisation,
        triad.saturation,
        float(triad.scale_factor > 0 or triad.misalignment > 0),
        float(triad.g_sensitivity > 0),
    ]


def shared_errors(gyro: Triad, accel: Triad, warm_up: WarmUp | None, imu: Imu) -> Shared:
    """Return the part of the errors that all runs over an error-free `imu` share."""
    told = np.zeros((0, 6))
    if warm_up is not None and len(imu.t):
        temperature = warm_up.temperature(imu.t - (imu.t[0] - imu.dt[0]))
        told = np.hstack(
            [
                triad.temperature_bias(temperature)
                if triad.temperature
                else np.zeros((len(imu.t), 3))
                for triad in (gyro, accel)
            ]
        )
    step = even_steps(np.r_[np.inf, np.diff(imu.t)][: len(imu.t)])
    dtheta, dv, dt = (np.ascontiguousarray(part, float) for part in (imu.dtheta, imu.dv, imu.dt))
    return Shared(dtheta, dv, dt, step, told, sizes_of(gyro, accel))


def draw_errors(gyro: Triad, accel: Triad, stream: RandomStream) -> Own:
    """Draw the random constants of a run before its first sample. Each term has a stream of its own
    name, so that two grades with one seed differ by size alone."""
    keys, constants = np.zeros((2, KEYS), np.int64), np.zeros((2, CONSTANTS))
    state = np.zeros((2, STATE))
    for row, (name, triad) in enumerate((("gyro", gyro), ("accel", accel))):
        of, own = stream.child(name).child, constants[row]
        for at, term in OF_SAMPLES.items():
            keys[row, at : at + 2] = of(term).key
        if triad.turn_on_bias:
            own[:DISTORTION] = triad.turn_on_bias * of("turn_on_bias").standard_normal(3)
        scale = misalignment = np.zeros((3, 3))
        if triad.scale_factor:
            scale = np.diag(triad.scale_factor * of("scale_factor").standard_normal(3))
        if triad.misalignment:
            angles = triad.misalignment * of("misalignment").standard_normal((3, 3))
            misalignment = angles * (1 - np.eye(3))
        own[DISTORTION:SENSITIVITY] = (scale + misalignment).ravel()
        if triad.g_sensitivity:
            own[SENSITIVITY:] = triad.g_sensitivity * of("g_sensitivity").standard_normal(9)
        if triad.quantisation:
            state[row, LEFT : LEFT + 3] = of("quantisation").random(3)
    return Own(keys.ravel(), constants.ravel(), state.ravel())
