"""The flights of Mollaei et al. over seeds: every case and mode scored, records of the first seed,
growth of the errors.

All modes of a seed have the same sensor errors. Trim, gains and plan are computed once; seeds run
in threads, since kernels let go of the interpreter.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.checks import DataError
from strapdown.core.loop.contract import Filter
from strapdown.data.solution import Trajectory
from strapdown.evaluation.consistency import nees
from strapdown.evaluation.metrics import errors
from strapdown.flight import Flight, fly
from strapdown.flight.asked import records
from strapdown.flight.plan import FlightPlan, straight, turning
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec
from strapdown.typing import Array, Progress

from ..common.runner import on_threads
from . import metrics
from .cells import (
    AT_TRIM,
    CASES,
    CKF,
    CLOSED,
    CUT,
    DIRECT,
    E0,
    E1,
    E2,
    EKF,
    FAR_START,
    FED_TRUTH,
    FEW_FIXES,
    FILTERS,
    FULL,
    GUSTS,
    HELD,
    HZ_10,
    HZ_20,
    IMU,
    MODEL,
    NO_FILTER,
    ONCE,
    OUTLIERS,
    PKF,
    POINTS,
    PRINTED,
    SIX,
    TURN,
    UKF,
    WIND,
    FlightCase,
)
from .metrics import FlightRecord
from .outliers import contaminate, with_filter
from .six_state import filters as mollaei_six

GRADE = "mollaei"
RECEIVER = Gnss(interval=0.2)
EXACT = {
    "imu": ImuSpec("ideal", Triad(), Triad()),
    "gnss": Gnss(interval=0.01, position_std=1e-6, velocity_std=1e-6),
}
"""Sensors of FED_TRUTH, whose last fix is the true state of each sample."""
STEP = {"higher": 10.0, "faster": 2.0, "airspeed": 25.0}
"""m, m/s, m/s: the straight flight begins trimmed at `airspeed` and is asked at 0 s to be so
much higher and faster."""
SECONDS = {E2: 315.0, WIND: 315.0}
"""Durations; 25 s of the others."""
TRIMMED = {"airspeed": STEP["airspeed"]}
FILTERS_SIX: dict[str, tuple[Filter, dict[str, Any]]] = {
    NO_FILTER: (mollaei_six.RAW, {}),
    FED_TRUTH: (mollaei_six.RAW, {}),
    EKF: (mollaei_six.EKF6, {}),
    AT_TRIM: (mollaei_six.EKF6, {"linearised": "trim", **TRIMMED}),
    ONCE: (mollaei_six.EKF6, {"linearised": "once", **TRIMMED}),
    HELD: (mollaei_six.EKF6, {"linearised": "held", **TRIMMED}),
    UKF: (mollaei_six.UKF6, {}),
    CKF: (mollaei_six.CKF6, {}),
    PKF: (mollaei_six.PKF6, {}),
    POINTS: (mollaei_six.PKF6, {"transition": "sigma-points"}),
}
"""{mode: (Filter, its options)}."""
FILTERS_FULL = {CLOSED: "closed-loop", EKF: "ekf", UKF: "ukf", CKF: "ckf", PKF: "pkf"}
START_STD = (1.0, 1.0, 1.5, 0.1, 0.1, 0.1, *[0.0] * 3, *[None] * 6)
"""Standard deviations at the start of the six-state filters: m, m/s; their attitude is the true
one, since nothing would ever correct it."""
FLAT = {"earth": "flat", "start_std": START_STD, "gate": np.inf, "inputs": mollaei_six.INPUTS}
"""Options of a flight with the six-state filters."""
PREDICTIONS = {
    (IMU, False): "imu",
    (IMU, True): "imu",
    (MODEL, False): "model",
    (MODEL, True): "model-always",
}
"""{(who predicts, whether there is no outage): as `fly` has it}: in E0 between fixes."""
BREEZE = (3.0, 0.0, 0.0)
"""m/s, NED: the wind of WIND, from behind."""
GIVEN: dict[str, dict[str, Any]] = {
    "": {},
    FEW_FIXES: {"gnss": RECEIVER._replace(velocity_std=None)},
    FAR_START: {"start_std": (*[10.0] * 3, *[5.0] * 3, *START_STD[6:])},
    GUSTS: {"turbulence": "light"},
    HZ_20: {"filter_rate": 20.0},
    HZ_10: {"filter_rate": 10.0},
}
"""{condition: options of a flight}."""
SHARES = {(WIND, SIX): 10, (OUTLIERS, SIX): 8, (E1, FULL): 4, (TURN, FULL): 4, (E2, FULL): 10}
"""{(experiment, form): a seed in so many is flown} where no verdict hangs on a share of the
flights; all seeds elsewhere."""
SELDOM = 8
"""A seed in so many is flown of CONDITIONS, and with components predicted by sigma points."""
TIMES = 50
"""Points of the growth curves."""


class MollaeiResults(NamedTuple):
    """Results of all flights."""

    # a row per Case (its fields as columns), mode and seed: metrics.MEASURES, apart_m, said
    scores: pd.DataFrame
    samples: dict[
        tuple[FlightCase, str], FlightRecord
    ]  # {(Case, mode): ...} of the first seed, six states
    references: dict[
        str, FlightRecord
    ]  # {experiment: ...} of the flights steered by the true state
    # {(Case, mode): ((k,) s, (runs, 2, k) m horizontal error and distance of the aircraft from the
    # reference flight)}
    curves: dict[tuple[FlightCase, str], tuple[Array, Array]]
    # {(mode, prediction): wall time of one flight of E2 with six states, nothing else running, s}
    seconds: dict[tuple[str, str], float]


def plan(experiment: str) -> FlightPlan:
    """The FlightPlan of an experiment."""
    return turning() if experiment == TURN else straight(**STEP)


def duration(experiment: str) -> float:
    """s."""
    return SECONDS.get(experiment, 25.0)


def modes(case: FlightCase, number: int) -> tuple[str, ...]:
    """Return the modes flown in a case with the seed of that number in the study, from 0.

    The readings of the EKF where the flight stays near the trim; AT_TRIM only where the model
    predicts, since driven by the IMU it is the EKF. Without a filter a condition tells nothing.
    """
    if case.form == FULL:
        return tuple(FILTERS_FULL)
    if case.experiment == OUTLIERS:
        return CKF, PKF
    nonlinear = case.prediction == MODEL
    near = case.experiment in (E0, E1, E2)
    points = nonlinear and case.experiment in (E0, E1) and number % SELDOM == 0
    return (
        *(NO_FILTER,) * (not case.condition),
        *(FED_TRUTH,) * (near and not case.condition),
        EKF,
        *(AT_TRIM,) * (near and nonlinear),
        *(ONCE, HELD) * near,
        UKF,
        PKF,
        *(POINTS,) * (points and not case.condition),
    )


def share(case: FlightCase) -> int:
    """Return n where a case is flown with every n-th seed."""
    return SELDOM if case.condition else SHARES.get((case.experiment, case.form), 1)


def flight(
    case: FlightCase, mode: str, seed: int, components: int | None = None, **changes: Any
) -> Flight:
    """The Flight of a mode in a case; components: of the PKF, None for its default; changes: its
    duration, or fields of what `fly` is given."""
    given = {
        "imu": GRADE,
        "gnss": RECEIVER,
        "outage": None if case.experiment == E0 else [(CUT, duration(case.experiment) + 1.0)],
        "prediction": PREDICTIONS[case.prediction, case.experiment == E0],
        "covariance": True,
    }
    if case.experiment == WIND:
        given |= {"wind": BREEZE, "told_wind": (0.0, 0.0, 0.0)}
    chosen: Filter | str
    options: dict[str, Any] = {}
    if case.form == SIX:
        chosen, options = FILTERS_SIX[mode]
        given |= FLAT
    else:
        chosen = FILTERS_FULL[mode]
    given |= GIVEN[case.condition]
    if mode == FED_TRUTH:
        given |= EXACT
    if case.tuning == PRINTED and mode != NO_FILTER:
        options = options | mollaei_six.REPRODUCED
    if mode in (PKF, POINTS) and components:
        options = options | {"components": components}
    seconds = changes.pop("duration", duration(case.experiment))
    asked = records(**{**given, **changes})
    return fly(plan(case.experiment), chosen, seed=seed, duration=seconds, **asked, **options)


def flight_with_outliers(
    case: FlightCase, mode: str, seed: int, components: int | None = None
) -> Flight:
    """The Flight of a mode in OUTLIERS: the filter runs over the fixes of a flight steered by the
    true state, some of them with larger errors; the model predicts between fixes too."""
    prediction = PREDICTIONS[case.prediction, True]
    made = flight(case, mode, seed, components, feedback="truth", prediction=prediction)
    filter, _ = FILTERS_SIX[mode]
    return with_filter(made, contaminate(made.recording, seed), filter)


@lru_cache(maxsize=16)
def reference(experiment: str, form: str = SIX, filter_rate: float | None = None) -> FlightRecord:
    """Record of the flight steered by the true state, over the same Earth and in calm air, at the
    samples of a filter of that rate (Hz; None: the IMU's)."""
    mode = NO_FILTER if form == SIX else CLOSED
    changes = {"feedback": "truth", "filter_rate": filter_rate}
    return record(flight(FlightCase(experiment, form), mode, 0, **changes))


def beside(case: FlightCase) -> FlightRecord:
    """The reference of the flights of a case."""
    return reference(case.experiment, case.form, GIVEN[case.condition].get("filter_rate"))


def record(flight: Flight) -> FlightRecord:
    """Record of a Flight: the scores' view of it, a row per sample flown."""
    column = lambda name: flight.log[name]
    stack = lambda names: np.column_stack([column(name) for name in names])
    solution, reference = flight.solution, flight.recording.reference
    off = errors(solution, reference)
    rows = len(off.t)  # a filter that stopped may have one less
    flown = slice(1, rows + 1)  # the first row is the start
    truth = Trajectory(
        *(values[flown] for values in (reference.t, reference.lla, reference.v_n, reference.q_nb))
    )
    craft, gravity = (
        flight.trim.aircraft,
        flight.trim.aircraft.parameters(flight.trim.earth, flight.trim.origin).gravity,
    )
    weight = craft["mass"] * gravity * truth.rotation.inv().apply([0.0, 0.0, 1.0])
    at = [min(int(np.searchsorted(truth.t, CUT - 1e-6)), rows - 1), rows - 1]
    claimed = np.isfinite(solution.trajectory.std[at, :6]).all(
        axis=1
    )  # without a filter nothing is
    six_off, six_P = np.c_[off.position, off.velocity][at], solution.covariance[at][:, :6, :6]
    return FlightRecord(
        *(
            values[:rows]
            for values in (
                column("t, s"),
                stack(("Fx, N", "Fy, N", "Fz, N")),
                stack(("Gx, N m", "Gy, N m", "Gz, N m")),
                weight,
                stack(("u, m/s", "v, m/s", "w, m/s")),
                np.degrees(stack(("aileron, rad", "elevator, rad", "rudder, rad"))),
                column("propeller speed, rad/s"),
                np.degrees(column("angle of attack, rad")),
                displacement(truth.lla, reference.lla[0]),
                column("right of route, m"),
            )
        ),
        off.position,
        off.velocity,
        np.linalg.norm(off.attitude, axis=1),
        np.where(claimed, nees(six_off, six_P), np.nan),
        str(flight.stopped or ""),
    )


def score_flight(
    case: FlightCase, mode: str, seed: int, components: int | None
) -> tuple[dict[str, float | str], FlightRecord | None]:
    """(row of the table of scores, Record or None) of one flight; a flight that could not begin
    is lost."""
    try:
        flown = flight_with_outliers if case.experiment == OUTLIERS else flight
        made = record(flown(case, mode, seed, components))
    except DataError as error:
        return {**metrics.LOST, "said": str(error)}, None
    return metrics.score(made, beside(case), None if case.experiment == E0 else CUT), made


Flown: TypeAlias = tuple[dict[str, float | str], Array, FlightRecord | None]
"""(scores and apart_m, curve, Record where it is kept) of a flight."""


def run_all(
    seeds: Iterable[int],
    components: int | None = None,
    cases: Sequence[FlightCase] | None = None,
    progress: Progress | None = None,
    threads: int | None = None,
) -> MollaeiResults:
    """Results over `seeds`, or SHARES of them; cases: by default all. components: of the PKF;
    progress: called with the fraction done."""
    seeds, cases = list(seeds), CASES if cases is None else cases
    groups: dict[tuple[str, str, str], list[FlightCase]] = {}
    for case in cases:
        groups.setdefault((case.experiment, case.form, case.condition), []).append(case)
    # alone, and before the threads, which would each compile
    seconds = times(seeds[0], components) if (E2, SIX, "") in groups else {}
    references = {own[0]: beside(own[0]) for own in groups.values()}
    tasks = [
        (group, number)
        for group, own in groups.items()
        for number in range(0, len(seeds), share(own[0]))
    ]
    tasks.sort(key=lambda task: (-duration(task[0][0]), task[1]))
    lengths = np.cumsum([duration(group[0]) for group, _ in tasks])
    flights: dict[tuple[FlightCase, str, int], Flown] = {}
    flown = lambda task: _fly_cases(groups[task[0]], seeds[task[1]], task[1], components)
    for found, done in zip(on_threads(flown, tasks, threads), lengths):
        flights |= found
        if progress:
            progress(float(done / lengths[-1]))
    rows, samples, grown = [], {}, {}
    for case, mode, seed in sorted(flights, key=lambda key: (cases.index(key[0]), key[2])):
        scores, growth, own = flights[case, mode, seed]
        rows.append({**case._asdict(), "mode": mode, "seed": seed, **scores})
        grown.setdefault((case, mode), []).append(growth)
        if own is not None:
            samples[case, mode] = own
    return MollaeiResults(
        pd.DataFrame(rows),
        samples,
        {
            case.experiment: own
            for case, own in references.items()
            if case.form == SIX and not case.condition
        },
        {key: (curve_times(key[0].experiment), np.array(own)) for key, own in grown.items()},
        seconds,
    )


def times(seed: int, components: int | None = None) -> dict[tuple[str, str], float]:
    """{(mode, prediction): wall time of a flight of E2 with six states, s}; each was flown
    before for a moment, so that nothing compiles."""
    found = {}
    for mode, prediction in (
        (NO_FILTER, IMU),
        *((mode, prediction) for prediction in (IMU, MODEL) for mode in FILTERS),
    ):
        flight(FlightCase(E2, prediction=prediction), mode, seed, components, duration=CUT + 1)
        begun = perf_counter()
        flight(FlightCase(E2, prediction=prediction), mode, seed, components)
        found[mode, prediction] = perf_counter() - begun
    return found


def _fly_cases(
    cases: list[FlightCase], seed: int, number: int, components: int | None
) -> dict[tuple[FlightCase, str, int], Flown]:
    """{(case, mode, seed): Flown} of all modes of the cases of one experiment, form and condition
    with the seed of that number; of the first with Records, of six states."""
    found: dict[tuple[FlightCase, str, int], Flown] = {}
    direct: dict[str, tuple[dict[str, float | str], FlightRecord | None]] = {}
    kept = number == 0 and cases[0].form == SIX and not cases[0].condition
    for case in cases:
        ekf = None
        for mode in modes(case, number):
            if mode in DIRECT:  # knows no prediction and no Q, R: one flight for all cases
                if mode not in direct:
                    direct[mode] = score_flight(case, mode, seed, components)
                scores, own = direct[mode]
            else:
                scores, own = score_flight(case, mode, seed, components)
            ekf = own if mode == EKF else ekf
            found[case, mode, seed] = (
                {
                    **scores,
                    **beside_fixes(case, own, direct),
                    "apart_m": largest_distance(own, ekf),
                },
                curve(own, beside(case)),
                own if kept else None,
            )
    return found


def beside_fixes(
    case: FlightCase,
    own: FlightRecord | None,
    direct: Mapping[str, tuple[object, FlightRecord | None]],
) -> dict[str, float]:
    """The `metrics.distances` from the flight of the same seed by the fixes themselves, where both
    were flown with fixes alone."""
    _, blue = direct.get(NO_FILTER, ("", None))
    if case.experiment != E0 or own is None or blue is None:
        return {}
    found = metrics.distances(own, blue, metrics.BY_FIXES)
    return {name: min(value, metrics.MEASURES[name]) for name, value in found.items()}


def largest_distance(one: FlightRecord | None, other: FlightRecord | None) -> float:
    """m: largest distance between two flights' aircraft or between their estimates; NaN where
    one was not flown, inf where it was not as long."""
    if one is None or other is None:
        return np.nan
    if len(one.t) != len(other.t):
        return np.inf
    estimates = (one.place - one.position) - (other.place - other.position)
    return float(
        max(
            np.linalg.norm(one.place - other.place, axis=1).max(),
            np.linalg.norm(estimates, axis=1).max(),
        )
    )


def curve_times(experiment: str) -> Array:
    """(TIMES,) s of the growth curves."""
    return np.linspace(0.0, duration(experiment), TIMES + 1)[1:]


def curve(record: FlightRecord | None, reference: FlightRecord) -> Array:
    """(2, TIMES) horizontal error of the estimate, and distance of the aircraft from the
    reference flight, m; inf where it had stopped."""
    found = np.full((2, TIMES), np.inf)
    if record is not None:
        t = np.linspace(0.0, reference.t[-1], TIMES + 1)[1:]
        rows = np.searchsorted(record.t, t - 1e-6)
        rows = rows[rows < len(record.t)]
        found[:, : len(rows)] = (
            np.hypot(*record.position[rows, :2].T),
            np.linalg.norm(record.place[rows] - reference.place[rows], axis=1),
        )
    return found


def texts() -> dict[str, str]:
    """{brace: text} for mollaei_choices: the flights and their receiver."""
    p, v = (
        ", ".join(f"{value:g}" for value in std)
        for std in (RECEIVER.position_std, RECEIVER.velocity_std)
    )
    return {
        "plan": f"level and straight, trimmed at {STEP['airspeed']:g} m/s; asked at 0 s to be "
        f"{STEP['higher']:g} m higher and "
        f"{STEP['faster']:g} m/s faster, which the values converge to",
        "gnss": f"white errors of {p} m and {v} m/s (north, east, down), as good as the filters are "
        f"told",
    }
