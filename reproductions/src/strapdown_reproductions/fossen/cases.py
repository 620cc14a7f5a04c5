"""The case studies of Fossen's chapter 14: which filter on which sensors, with which weights, from
which start; and one run in numbers.

The published weights are variances Q of white noise that a code adds as h^2 Q in each step of h = 1
ms, so that they are no property of the noise: another step would mean another tuning. Here each
becomes the spectral density q = h Q of its own step and holds at every rate. Weights R of
measurements are variances of one fix and are kept, though the published code skips all fixes but
those that come with a position, and here every fix is used when it comes.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import (
    BA,
    BG,
    BIAS,
    DECAYING,
    HELD,
    RANDOM_WALK,
    Filter,
    InitialState,
    Noise,
)
from strapdown.data.recording import Recording
from strapdown.data.solution import Trajectory
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors
from strapdown.filters.ins.open_loop import OPEN_LOOP
from strapdown.sim.synthesis import draw_start
from strapdown.typing import Array

from . import signals
from .force_observer import FORCE_OBSERVER
from .printed_filters import GRAVITY_SIZE, MAX_COLUMN, PRINTED_FILTERS

PUBLISHED_STEP = 1e-3
"""s: of the published scripts."""
CHAPTER, FADING, RIGHT = "chapter", "chapter, decaying", "true noises"
TUNINGS = (CHAPTER, FADING, RIGHT)
"""The published weights with estimates of the biases that are held, as the published code has them;
the same weights with estimates that decay, as the chapter's equations have them; the true noises,
and estimates that decay where the true biases do."""
THE_CHAPTERS = (CHAPTER, FADING)
DECIDING = (CHAPTER, RIGHT)
"""Tunings that decide claims, where a claim is not about decay itself."""
ROWS = 10.0
"""Hz: rows of a run that are scored."""
ACCEL_BELOW, GYRO_BELOW = 0.02, 0.05 * float(np.linalg.norm(signals.GYRO_BIAS))
"""m/s^2 and rad/s: a bias has converged when the length of its error stays below this: 6 and 5 %
of the biases at the start."""
RMS = {"position_m": 0, "velocity_m_s": 3, "attitude_rad": 6, "accel_m_s2": 9, "gyro_rad_s": 12}
"""Names of rms errors, and the first of the three states that each is of."""
LAST = 100.0
"""s at the end of a run over which its errors are averaged; growth is against those as long
before."""
START_STD = (
    1.0,
    1.0,
    1.0,
    0.1,
    0.1,
    0.1,
    *np.radians([2.0, 2.0, 5.0]).tolist(),
    0.3,
    0.3,
    0.3,
    0.1,
    0.1,
    0.1,
)
"""With the true noises: m, m/s, rad, and of biases that are estimated as 0, m/s^2 and rad/s."""


class Weights(NamedTuple):
    """Published weights: Q of velocity, accelerometer bias, attitude and gyro bias, time constants
    (s), and R of each kind of measurement.

    R of field and gravity is that of a unit vector; the others are in m^2, (m/s)^2 and rad^2.
    """

    Q: tuple[float, float, float, float]
    times: tuple[float, float]
    R: dict[str, float]


MEKF = Weights(
    (0.01, 0.01, 0.1, 0.001),
    (500.0, 500.0),
    {"position": 1.0, "velocity": 0.1, "magnetic-field": 0.01, "heading": 0.01, "gravity": 1.0},
)
"""SIMaidedINSquat and ins_mekf of the Marine Systems Simulator."""
EULER = Weights(
    (0.1, 0.001, 0.1, 0.001), (1000.0, 500.0), {"position": 0.1, "heading": 0.001, "gravity": 1.0}
)
"""SIMaidedINSeuler and ins_euler, an indirect filter in Euler angles: the chapter's direct one
has no published code."""
AHRS = Weights((1.0, 1.0, 10.0, 0.01), (1000.0, 500.0), {"position": 1.0, "attitude": 1.0})
"""SIMaidedINSeuler and ins_ahrs."""
OBSERVER_GAINS = {"k1": 1.0, "k2": 1.0, "ki": 0.1}
"""1/s, of the attitude observers: poles at 0.11 and 0.89 1/s, so that the published gyro biases are
found in half a minute."""
TRUE_STD = {
    "position": signals.POSITION_STD,
    "velocity": signals.VELOCITY_STD,
    "magnetic-field": signals.DIRECTION_STD,
    "heading": signals.COMPASS_STD,
    "attitude": signals.AHRS_STD,
    "gravity": 1.0 / GRAVITY_SIZE,
}
"""Standard deviations of the simulated noise; that of gravity represents the body's acceleration,
1 m/s^2. Of field and gravity, over their size."""
SIZE = {"magnetic-field": float(np.linalg.norm(signals.FIELD)), "gravity": GRAVITY_SIZE}
"""T and m/s^2: factors from unit vectors to the measured quantities."""


OWN = PRINTED_FILTERS | {FORCE_OBSERVER.name: FORCE_OBSERVER}
"""The chapter's filters that are no part of the library."""


AS_PUBLISHED = {"attitude_error": "neglected"}
"""Filters with an AHRS: ins_ahrs takes each record for exact in the velocity; its R weighs the
angles alone."""
CONSIDERED = ", attitude error considered"
"""End of the label of a case beside the published one, whose filter considers what errors of the
records do to the velocity: only with the true noises, for R of the chapter is a weight of 1 rad^2
and not the variance of an AHRS."""


class FilterCase(NamedTuple):
    """A filter with its sensors. `white`: tunings with which its biases are driven by white
    noise alone; with the others they decay."""

    name: str
    filter: str
    kinds: tuple[str, ...]
    weights: Weights
    white: tuple[str, ...] = ()
    interval: float = signals.POSITION_INTERVAL  # s between positions
    rate: float = 100.0  # IMU samples per second
    tunings: tuple[str, ...] = TUNINGS
    options: Mapping[str, str | float] = {}  # of the filter
    # of the fixes only those that come with a position are used, as in the code of the chapter's edition
    together: bool = False

    @property
    def value(self) -> Filter:
        """The Filter: the library's, or one of the chapter's that the library does not have."""
        return OWN.get(self.filter) or filters.find(self.filter)

    def bias(self, tuning: str) -> str:
        """Its bias model, a name of the option `bias`."""
        if tuning in self.white:
            return RANDOM_WALK
        return HELD if tuning == CHAPTER else DECAYING


CASES = (
    FilterCase(
        "mekf, position + field, 1 Hz", "mekf", ("position", "magnetic-field"), MEKF, interval=1.0
    ),
    FilterCase("mekf, position + field", "mekf", ("position", "magnetic-field"), MEKF),
    FilterCase(
        "mekf, position + velocity + field",
        "mekf",
        ("position", "velocity", "magnetic-field"),
        MEKF,
    ),
    FilterCase(
        "mekf, position + gravity + field", "mekf", ("position", "gravity", "magnetic-field"), MEKF
    ),
    FilterCase("mekf, position + compass", "mekf", ("position", "heading"), MEKF),
    FilterCase(
        "mekf, position + velocity + compass", "mekf", ("position", "velocity", "heading"), MEKF
    ),
    FilterCase(
        "mekf, position + field, white-driven biases",
        "mekf",
        ("position", "magnetic-field"),
        MEKF,
        white=TUNINGS,
        tunings=(CHAPTER,),
    ),
    FilterCase(
        "mekf as printed, position + gravity + field",
        "mekf-printed",
        ("position", "gravity", "magnetic-field"),
        MEKF,
        together=True,
    ),
    FilterCase(
        "mekf as printed, position + gravity + compass",
        "mekf-printed",
        ("position", "gravity", "heading"),
        MEKF,
        together=True,
    ),
    FilterCase(
        "direct-euler, position + compass",
        "direct-euler",
        ("position", "heading"),
        EULER,
        white=(CHAPTER,),
        tunings=DECIDING,
    ),
    FilterCase(
        "euler-direct as printed, position + compass",
        "euler-direct",
        ("position", "heading"),
        EULER,
        white=(CHAPTER,),
        tunings=DECIDING,
    ),
    FilterCase(
        "euler-indirect as printed, position + gravity + compass",
        "euler-indirect",
        ("position", "gravity", "heading"),
        EULER,
    ),
    FilterCase(
        "euler-indirect as printed, position + compass",
        "euler-indirect",
        ("position", "heading"),
        EULER,
    ),
    FilterCase(
        "euler-indirect corrected, position + compass",
        "euler-indirect",
        ("position", "heading"),
        EULER,
        options={"errors": "corrected"},
    ),
    FilterCase(
        "ahrs-direct as printed",
        "ahrs-direct",
        ("position", "attitude"),
        AHRS,
        white=TUNINGS,
        tunings=DECIDING,
    ),
    FilterCase("ahrs-indirect as printed", "ahrs-indirect", ("position", "attitude"), AHRS),
    FilterCase(
        "direct-ahrs",
        "direct-ahrs",
        ("position", "attitude"),
        AHRS,
        white=(CHAPTER,),
        tunings=DECIDING,
        options=AS_PUBLISHED,
    ),
    FilterCase(
        "direct-ahrs, white-driven biases",
        "direct-ahrs",
        ("position", "attitude"),
        AHRS,
        white=TUNINGS,
        tunings=(RIGHT,),
        options=AS_PUBLISHED,
    ),
    FilterCase(
        "indirect-ahrs-closed",
        "indirect-ahrs-closed",
        ("position", "attitude"),
        AHRS,
        options=AS_PUBLISHED,
    ),
    FilterCase(
        "indirect-ahrs-open",
        "indirect-ahrs-open",
        ("position", "attitude"),
        AHRS,
        options=AS_PUBLISHED,
    ),
    *(
        FilterCase(name + CONSIDERED, name, ("position", "attitude"), AHRS, tunings=(RIGHT,))
        for name in ("direct-ahrs", "indirect-ahrs-closed", "indirect-ahrs-open")
    ),
    FilterCase(
        "observer, reference by gravity",
        "force-observer",
        ("velocity", "magnetic-field"),
        MEKF,
        tunings=(RIGHT,),
        options={"reference": "gravity", **OBSERVER_GAINS},
    ),
    FilterCase(
        "observer, reference by GNSS",
        "force-observer",
        ("velocity", "magnetic-field"),
        MEKF,
        tunings=(RIGHT,),
        options={"reference": "gnss", **OBSERVER_GAINS},
    ),
    FilterCase("fixed-gain", "fixed-gain", ("position", "attitude"), AHRS, tunings=(RIGHT,)),
)
FAST = tuple(
    case._replace(name=f"{case.name}, 1 kHz", rate=1000.0)
    for case in CASES
    if case.name in ("mekf, position + field", "mekf, position + compass")
)
"""At the IMU rate of the published scripts."""


def noise(case: FilterCase, tuning: str, excitation: str) -> Noise:
    """Return the Noise that the filter of a case assumes.

    The chapter's: the published weights as densities, biases of direct filters without decay. true
    noises: what is simulated, the bias model included; the drive of the varying biases also where
    they are constant.
    """
    if tuning in THE_CHAPTERS:
        accel, accel_bias, gyro, gyro_bias = np.sqrt(
            np.array(case.weights.Q) * PUBLISHED_STEP
        ).tolist()
        times = case.weights.times
    else:
        accel = gyro = signals.SAMPLE_NOISE * case.rate**-0.5
        accel_bias, gyro_bias = (std * np.sqrt(2 / signals.BIAS_TIME) for std in signals.BIAS_STD)
        times = (signals.BIAS_TIME if excitation == "signal 2" else np.inf,) * 2
    accel_decay, gyro_decay = (0.0, 0.0) if tuning in case.white else (1 / time for time in times)
    return Noise(gyro, accel, gyro_bias, accel_bias, gyro_decay, accel_decay)


def deviation(case: FilterCase, tuning: str, kind: str) -> float:
    """Standard deviation that a fix of `kind` is given, in the unit of its source. Raises
    DataError where no weight is known."""
    if tuning in THE_CHAPTERS and kind not in case.weights.R:
        raise DataError(f"{case.name}: no weight of {kind!r} is published")
    unit = np.sqrt(case.weights.R[kind]) if tuning in THE_CHAPTERS else TRUE_STD[kind]
    return float(unit * SIZE.get(kind, 1.0))


def select_sources(recording: Recording, case: FilterCase, tuning: str) -> Recording:
    """The recording with the sources of a case alone, which state the deviations of a tuning."""
    chosen = [a for a in recording.sources if a.kind in case.kinds]
    if case.together:
        fixed = next(a.t for a in chosen if a.kind == "position")
        chosen = [a._where(np.isin(np.round(a.t, 6), np.round(fixed, 6))) for a in chosen]
    return replace(
        recording,
        sources=tuple(
            replace(a, std=np.full(a.std.shape, deviation(case, tuning, a.kind))) for a in chosen
        ),
    )


def start(recording: Recording, tuning: str, seed: int) -> InitialState:
    """Where a run begins: as the published scripts do, at the truth with deviations of 1 of
    everything, or at an error drawn from START_STD. Biases 0."""
    truth = recording.reference
    if tuning in THE_CHAPTERS:
        place, speed, angles = (
            tuple(map(float, part[0])) for part in (truth.lla, truth.v_n, truth.rph)
        )
        return InitialState(
            0.0, place, speed, angles, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15, "the truth"
        )
    unbiased, rng = (np.zeros(3), np.zeros(3)), np.random.default_rng([seed, 77])
    return draw_start(truth, np.r_[START_STD[:9], np.zeros(6)], rng, biases=unbiased)._replace(
        std=START_STD
    )


class CaseRun(NamedTuple):
    """One run at ROWS a second: errors true - estimate, SI and radians, NaN where nothing is
    estimated."""

    t: Array  # (n,) s
    error: Array  # (n, 15)
    std: Array  # (n, 15)
    bias: Array  # (n, 6) true biases
    stopped: str  # why it ended early, or ""
    angle_std: float  # rad: the largest deviation of an Euler angle; NaN without such states
    ins: Array  # (n,) m: how far the raw INS of a feedforward filter is off; NaN without one

    def size(self, states: slice) -> Array:
        """(n,) length of the error of three states."""
        return np.linalg.norm(self.error[:, states], axis=1)


def run(recording: Recording, case: FilterCase, tuning: str, excitation: str, seed: int) -> CaseRun:
    """Run of a case on a Recording of fossen_signals; a filter that breaks down ends it early."""
    used, every, truth = (
        select_sources(recording, case, tuning),
        round(case.rate / ROWS),
        recording.reference,
    )
    options = dict(case.options)
    if case.value.bias:
        options[BIAS] = case.bias(tuning)
    try:
        solution = fuse(
            used,
            case.value,
            start=start(recording, tuning, seed),
            noise=noise(case, tuning, excitation),
            every=every,
            options=options,
        )
    except DataError as error:
        return CaseRun(
            np.empty(0),
            np.empty((0, 15)),
            np.empty((0, 15)),
            np.empty((0, 6)),
            str(error),
            np.nan,
            np.empty(0),
        )
    e = errors(
        solution,
        Trajectory(truth.t[::every], truth.lla[::every], truth.v_n[::every], truth.q_nb[::every]),
    )
    rows = np.searchsorted(recording.imu.t, solution.t - 1e-6)
    bias = np.c_[recording.meta["b_a"][rows], recording.meta["b_g"][rows]]
    error = np.c_[e.position, e.velocity, e.attitude, bias - np.c_[solution.b_a, solution.b_g]]
    beside = [solution.columns.get(name, np.full(len(e.t), np.nan)) for name in OPEN_LOOP.columns]
    ins = np.linalg.norm(e.position + np.stack(beside, axis=1), axis=1)
    angles = solution.columns.get(MAX_COLUMN, np.full(1, np.nan))
    largest = float(angles[-1])
    return CaseRun(
        solution.t,
        error,
        solution.trajectory.std,
        bias,
        solution.meta.get("stopped", ""),
        largest,
        ins,
    )


def settling_time(t: Array, size: Array, below: float) -> float:
    """s: since when `size` (n,) stays below a bound to the end; inf where it does not, NaN where
    it is nowhere known."""
    if not len(size) or not size[-1] < below:
        return np.nan if len(size) and np.isnan(size).all() else np.inf
    above = np.flatnonzero(~(size < below))
    return float(t[above[-1] + 1]) if len(above) else 0.0


def _rms(size: Array) -> float:
    """Root of the mean square of sizes; NaN where there is none."""
    return float(np.sqrt(np.mean(size**2))) if len(size) else np.nan


def numbers(run: CaseRun, duration: float) -> dict[str, float | bool]:
    """{name: number} of a run: times of convergence, rms errors over the last LAST s, shares of the
    biases' deviations that are left.

    growth and ins_growth are those of the position error of the estimate and of the raw INS: rms
    over the last LAST s by that over the LAST s before. accel_first_s is when the error of the
    accelerometer biases first was below its bound, whether it stayed there or not.
    """
    ended = bool(run.stopped) or not len(run.t) or run.t[-1] < duration - 1.0
    late, before = run.t >= duration - LAST, abs(run.t - (duration - 1.5 * LAST)) < 0.5 * LAST
    rms = lambda states: np.nan if ended else _rms(run.size(states)[late])
    grown = lambda size: np.nan if ended else _rms(size[late]) / _rms(size[before])
    below = np.flatnonzero(run.size(BA) < ACCEL_BELOW)
    left = {
        f"{name}_left_{axis}": np.nan if ended else float(run.std[-1, state] / run.std[0, state])
        for name, states in (("accel", BA), ("gyro", BG))
        for axis, state in zip("xyz", range(15)[states])
    }
    return {
        "stopped": ended,
        "accel_s": np.inf if ended else settling_time(run.t, run.size(BA), ACCEL_BELOW),
        "gyro_s": np.inf if ended else settling_time(run.t, run.size(BG), GYRO_BELOW),
        "angle_std_rad": run.angle_std,
        "ins_m": np.nan if ended else float(run.ins[-1]),
        "growth": grown(run.size(slice(0, 3))),
        "ins_growth": grown(run.ins),
        "accel_first_s": float(run.t[below[0]]) if len(below) else np.inf,
        **{name: rms(slice(i, i + 3)) for name, i in RMS.items()},
        **left,
    }
