"""The filters of Alam et al. and their variants on the simulated flight, over seeds: scores of
every outage, variation of the bias estimates, tracks.

All five windows are withheld in one run, as in the paper. All filters of a seed have the same
samples, fixes, start and noise.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.alignment.initial import align
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import Errors, errors
from strapdown.experiments.outages.protocols import protocol
from strapdown.filters.observer import gains
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.scenario import scenario
from strapdown.sim.synthesis import Simulator
from strapdown.typing import Array, Notify, Progress

from ..common.runner import on_threads
from .readings import EKF, NLO, NORM, READINGS, VARIANTS, XKF, Variant, label_of
from .xkf_as_printed import make_known

PROTOCOL, LENGTH = "30/300", 30.0
"""An outage of 30 s at the end of every 300 s but the first."""
FIXES = ("position", "velocity")
ROWS = 20
"""Every so many samples are scored: 10 Hz."""
SETTLED, LATE = (600.0, 1850.0), (1250.0, 1850.0)
"""s: the flight after the first ten minutes to the touchdown, in which bias estimates should be
stable; and its last ten minutes."""
FAR, FAST = 1e4, 1e3
"""m and m/s: score of a filter that stopped or has a larger error."""
MEASURES = {
    "north_rmse_m": FAR,
    "east_rmse_m": FAR,
    "down_rmse_m": FAR,
    "horizontal_rmse_m": FAR,
    "horizontal_end_m": FAR,
    "velocity_end_m_s": FAST,
}
"""Measures that decide claims, each with the largest value that counts."""
TURN_ON = {"accel": 0.049, "gyro": float(np.radians(0.2))}
"""m/s^2 and rad/s: standard deviation of the turn-on biases of the grade `dmu10`."""
ASTRAY = {sensor: 100 * size for sensor, size in TURN_ON.items()}
"""The wander and rms error of the bias estimates of a filter that stopped, or whose are larger."""
WANDERS = ("wander", "rms", "true", "wander_late", "true_late")
"""Columns on the bias estimates of a sensor."""
LAST = 0.1
"""s before the end of an outage: its last scored row; at the end itself a fix is used again."""
SINCE = np.r_[np.arange(0.0, LENGTH), LENGTH - LAST]
"""s in an outage at which errors are kept for the growth curves."""


FULL, CLOSED = "XKF, 15 states", "closed loop"
FULL_PRINTED = "XKF, 15 states, Jacobian at the observer"
FILTERS = {
    **{label: VARIANTS[label] for label in (EKF, NLO, XKF)},
    FULL: Variant("xkf", {"near": 0.0}),
    CLOSED: Variant("closed-loop"),
}
"""The three of the paper by its letter, the affine exogenous filter with the library's error model
around the library's observer, and an anchor, by the names that they have in tables."""
EKF_NO_COURSE, XKF_NO_COURSE = "EKF, no course", "XKF, no course"
CONSTANT, POSITION_ALONE = "NLO, constant gains", "NLO, constant gains, no velocity injected"
STABILISED = "accelerometer bias constant"


def constant_gains(injected: bool) -> dict[str, float]:
    """The gains that the design settles to at the study's fixes, with velocities `injected` or
    positions alone, as options of `nlo`."""
    o = gains.check_gain_options(NORM)
    jumps = gains.schedule(o, 0.2, 0.2 if injected else 0.0, 2.1, 0.1)
    return {
        f"k{of}{kind[0]}": float(value)
        for kind, K in gains.last_gains(jumps)
        for of, value in zip("pvx", K)
    }


SIMULATED_ALONE = {
    CONSTANT: Variant("nlo", NORM | constant_gains(True)),
    POSITION_ALONE: Variant("nlo", NORM | constant_gains(False)),
    **{label_of(each.ekf, STABILISED): VARIANTS[each.ekf] for each in READINGS},
}
"""Variants that need the receiver of the study, or its IMU."""
ABLATIONS = {
    **{label: each for label, each in VARIANTS.items() if label not in FILTERS},
    FULL_PRINTED: Variant("xkf", {"near": np.inf, "jacobian": "observer"}),
    EKF_NO_COURSE: Variant("two-stage-ekf", VARIANTS[EKF].options | {"course": "none"}),
    XKF_NO_COURSE: Variant(VARIANTS[XKF].filter, VARIANTS[XKF].options | {"course": "none"}),
    "NLO, printed course": Variant("nlo", NORM | {"course": "printed"}),
    "NLO, course frozen": Variant("nlo", NORM | {"course": "frozen"}),
    "NLO, no course": Variant("nlo", NORM | {"course": "none"}),
    "NLO, accelerometer bias held": Variant("nlo", NORM | {"adaptation": 0.0}),
    **SIMULATED_ALONE,
}
"""The other readings, and ablations of the heading correction, of the estimation of the
accelerometer bias and of the gains, to be compared with the same filter of FILTERS."""
AXES = ("north", "east", "down")
Row: TypeAlias = dict[str, float | str]
"""{column: value} of a row of a table of AlamResults, or the part of it that one function finds."""


class AlamRun(NamedTuple):
    """One run at 10 Hz: errors true - estimate, estimates and truth, for the figures."""

    t: Array  # (n,) s
    rph: Array  # (n, 3) rad, estimate
    v_b: Array  # (n, 3) m/s, estimate in body axes
    b_a: Array  # (n, 3) m/s^2, estimate
    b_g: Array  # (n, 3) rad/s, estimate
    position: Array  # (n, 3) m NED, error
    velocity: Array  # (n, 3) m/s NED, error


class AlamResults(NamedTuple):
    """Results of all runs."""

    # a row per seed, filter and outage: case, block (the seed), filter, outage, start_s, stop_s,
    # MEASURES, ..., said
    scores: pd.DataFrame
    # a row per seed and filter: wander and rms error of the estimates, wander of the true biases,
    # said
    biases: pd.DataFrame
    # {filter: (2, runs, len(SINCE)) m}, horizontal and vertical, of all outages of all seeds
    growth: dict[str, Array]
    sample: dict[str, AlamRun]  # {filter: Run of the first seed}
    recording: Recording  # of the first seed, with the withheld fixes


@lru_cache(maxsize=1)
def simulator() -> Simulator:
    """The Simulator of the built-in scenario `alam`: 33 min at 200 Hz."""
    return Simulator(scenario("alam"))


@lru_cache(maxsize=1)
def windows() -> tuple[tuple[float, float], ...]:
    """((start, stop), ...) of the five outages, s."""
    end = scenario("alam").duration
    return protocol(PROTOCOL, (0.0, end), end, None).windows


def run_all(
    seeds: Iterable[int],
    variants: dict[str, Variant] | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
    notify: Notify | None = None,
) -> AlamResults:
    """Results of `variants` (default: FILTERS and ABLATIONS) over `seeds`. progress: called with
    the fraction done; say: of slow compilation."""
    seeds, variants = list(seeds), FILTERS | ABLATIONS if variants is None else variants
    scores: list[Row] = []
    biases: list[Row] = []
    growth: dict[str, list[Array]] = {label: [] for label in variants}
    sample: dict[str, AlamRun] = {}
    make_known()
    simulator()  # before the threads, which would each compute it
    of_seed = lambda seed: _seed(seed, variants, seed == seeds[0], notify)
    for found in on_threads(of_seed, seeds, threads, progress):
        scores += found[0]
        biases += found[1]
        for label, curves in found[2].items():
            growth[label] += curves
        sample |= found[3]
    grown = {
        label: np.array(own).reshape(-1, 2, len(SINCE)).swapaxes(0, 1)
        for label, own in growth.items()
    }
    return AlamResults(
        pd.DataFrame(scores), pd.DataFrame(biases), grown, sample, recording(seeds[0])
    )


def recording(seed: int) -> Recording:
    """The Recording of a seed with the fixes of the outages withheld."""
    return (
        simulator()
        .recording(simulator().scenario.imu, np.random.default_rng(seed))
        .hidden(windows(), kinds=FIXES)
    )


def _seed(
    seed: int, variants: dict[str, Variant], kept: bool, notify: Notify | None
) -> tuple[list[Row], list[Row], dict[str, list[Array]], dict[str, AlamRun]]:
    """(rows of scores, rows of biases, {label: curves}, {label: Run}) of one seed; the Runs
    where they are `kept`."""
    hidden = recording(seed)
    start = align(hidden, imu_spec(hidden.meta["grade"]))
    scores, biases, growth, sample = [], [], {}, {}
    for label, variant in variants.items():
        try:
            solution = _fly_variant(hidden, label, variant, start, notify)
        except DataError as error:
            outages = [{**MEASURES, "said": str(error)}] * len(windows())
            wandered = without_biases(str(error))
            growth[label] = [np.full((2, len(SINCE)), np.inf)] * len(windows())
        else:
            e = errors(solution, hidden.reference)
            stopped = solution.meta.get("stopped", "")
            outages = [score_outage(e, window, stopped) for window in windows()]
            wandered = wander(solution, hidden)
            growth[label] = [curve(e, window) for window in windows()]
            if kept:
                sample[label] = _sample(solution, e)
        biases.append({"filter": label, "seed": seed, **wandered})
        scores += [
            {
                "case": f"outage {k}",
                "block": seed,
                "filter": label,
                "outage": k,
                "start_s": start_s,
                "stop_s": stop_s,
                **score,
            }
            for k, ((start_s, stop_s), score) in enumerate(zip(windows(), outages), 1)
        ]
    return scores, biases, growth, sample


def _fly_variant(
    hidden: Recording, label: str, variant: Variant, start: InitialState, notify: Notify | None
) -> Solution:
    """Return the Solution of a variant; a stabilised accelerometer bias is a constant, so that its
    estimate settles.

    The paper's filters do not model scale and misalignment, although the grade states them.
    """
    noise = None
    if label.endswith(STABILISED):
        noise = imu_spec(hidden.meta["grade"]).noise()._replace(accel_bias=0.0, accel_decay=0.0)
    return fuse(
        hidden,
        variant.filter,
        start=start,
        noise=noise,
        every=ROWS,
        notify=notify,
        estimate=[],
        options=variant.options,
    )


def _sample(solution: Solution, e: Errors) -> AlamRun:
    own = solution.trajectory
    v_b = own.rotation.inv().apply(own.v_n.copy())
    columns = (own.t, own.rph, v_b, solution.b_a, solution.b_g)
    return AlamRun(*(column[e.rows] for column in columns), e.position, e.velocity)


def score_outage(e: Errors, window: tuple[float, float], stopped: str) -> Row:
    """Return {measure: value, "said": text} of an outage from metrics.Errors: FAR and FAST where
    the filter did not complete it or has larger errors.

    window: (start, stop) in s; stopped: why the run ended early, "" where it did not; the affected
    outages get this text.
    """
    inside = (e.t > window[0] - 1e-6) & (e.t < window[1] - 1e-6)
    if (
        not inside.any()
        or e.t[inside][-1] < window[1] - 2 * LAST
        or not np.isfinite(np.c_[e.position, e.velocity][inside]).all()
    ):
        return {**MEASURES, "said": stopped or "no estimate"}
    position, velocity = e.position[inside], e.velocity[inside]
    rmse = np.sqrt((position**2).mean(axis=0))
    found = dict(zip((f"{axis}_rmse_m" for axis in AXES), rmse)) | {
        "horizontal_rmse_m": np.hypot(*rmse[:2]),
        "horizontal_end_m": np.hypot(*position[-1, :2]),
        "velocity_end_m_s": np.linalg.norm(velocity[-1]),
    }
    said = (
        (stopped or "diverged")
        if any(found[name] > most for name, most in MEASURES.items())
        else ""
    )
    return {name: float(min(found[name], most)) for name, most in MEASURES.items()} | {"said": said}


def wander(solution: Solution, hidden: Recording) -> Row:
    """{measure: value, "said": text} of the bias estimates: of the three of a sensor together,
    standard deviations over time and rms error.

    Over SETTLED, over LATE the names that end in _late; beside them the standard deviations of the
    true biases (_true). m/s^2 and rad/s; ASTRAY where the run ended before, or what is larger.
    """
    rows = np.clip(np.searchsorted(hidden.imu.t, solution.t - 1e-6), 0, len(hidden.imu.t) - 1)
    found: dict[str, float] = {}
    for sensor, estimate, true in (
        ("accel", solution.b_a, hidden.meta["b_a"][rows]),
        ("gyro", solution.b_g, hidden.meta["b_g"][rows]),
    ):
        whole, late = (_over(period, solution.t, estimate, true) for period in (SETTLED, LATE))
        values = dict(zip(WANDERS, (*whole, late[0], late[2])))
        found |= {f"{sensor}_{what}": value for what, value in values.items()}
    most = {name: ASTRAY[name.split("_")[0]] for name in found}
    beyond = any(value >= most[name] for name, value in found.items())
    said = (solution.meta.get("stopped") or "diverged") if beyond else ""
    return {name: min(value, most[name]) for name, value in found.items()} | {"said": said}


def without_biases(said: str) -> Row:
    """Return the row of `wander` for a run that did not begin."""
    return {
        f"{sensor}_{what}": most if "true" not in what else np.nan
        for sensor, most in ASTRAY.items()
        for what in WANDERS
    } | {"said": said}


def _over(
    period: tuple[float, float], t: Array, estimate: Array, true: Array
) -> tuple[float, float, float]:
    """(standard deviation of the estimate, its rms error, standard deviation of the true bias)
    over a period; inf, inf, NaN of what ended before."""
    inside = (t >= period[0]) & (t <= period[1])
    if not inside.any() or t[-1] < period[1] or not np.isfinite(estimate[inside]).all():
        return np.inf, np.inf, np.nan
    spread = lambda values: float(np.sqrt(values[inside].var(axis=0).sum()))
    return (
        spread(estimate),
        float(np.sqrt(((true - estimate)[inside] ** 2).sum(axis=1).mean())),
        spread(true),
    )


def curve(e: Errors, window: tuple[float, float]) -> Array:
    """(2, len(SINCE)) horizontal and vertical error at SINCE after the outage began, m; inf
    where there is no estimate."""
    rows = np.searchsorted(e.t, window[0] + SINCE - 1e-6)
    known = (rows < len(e.t)) & (
        np.abs(e.t[np.minimum(rows, len(e.t) - 1)] - window[0] - SINCE) < 0.5 * LAST
    )
    rows = np.minimum(rows, len(e.t) - 1)
    found = np.where(known, [e.horizontal[rows], np.abs(e.position[rows, 2])], np.inf)
    return np.where(np.isfinite(found), found, np.inf)
