"""The study of Mollaei et al. in cells: what is flown, the published Tables 2 to 4, and the
scores of a case as a table."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import band
from strapdown.typing import Array

from ..common.paired_ratios import by_case
from .metrics import MEASURES

NO_FILTER, EKF, UKF, PKF, TRUTH = "no filter", "EKF", "UKF", "PKF", "true state"
MODES = (NO_FILTER, EKF, UKF, PKF)
"""The four of the paper, by the names that they have in tables; TRUTH is the reference flight,
steered by the true state."""
FILTERS = MODES[1:]
AT_TRIM, ONCE, HELD = "EKF at trim", "EKF once", "EKF, attitude held"
EKFS = {
    EKF: "linearised at the estimate, as equation (22) has it",
    AT_TRIM: "forces linearised at the trim, with the attitude as it is",
    ONCE: "linearised once, at the trim, in the attitude too",
    HELD: "linearised once, at the trim, in the six states alone: the attitude is held at the trim's",
}
"""Readings of "linearizes the process around the operating point" (section 3.1), by mode."""
FED_TRUTH = "true feedback"
DIRECT = {
    NO_FILTER: "the last fix, with the errors of the receiver",
    FED_TRUTH: "true position and velocity, which no aircraft has",
}
"""Readings of "no filter and real feedback" (Table 2), by mode; zero once the GPS is cut."""
POINTS = "PKF by points"
"""The particle filter with components predicted by the sigma points (37) to (39)."""
CLOSED, CKF = "closed loop", "CKF"
SIX, FULL = "six states", "15 states"
IMU, MODEL = "IMU", "model"
SENSORS, PRINTED = "sensors", "printed"
E0, E1, E2, TURN, WIND, OUTLIERS = "E0", "E1", "E2", "turn", "wind", "outliers"
EXPERIMENTS = {
    E0: "25 s with fixes",
    E1: "25 s, fixes cut at 15 s",
    E2: "315 s, fixes cut at 15 s",
    TURN: "25 s of turning flight, fixes cut at 15 s",
    WIND: "as E2 in 3 m/s of wind that nobody is told of",
    OUTLIERS: "as E1, steered by the true state, a tenth of the fixes with ten times the error",
}
CUT = 15.0
"""s at which the fixes end."""
FEW_FIXES, FAR_START, GUSTS, HZ_20, HZ_10 = (
    "position fixes alone",
    "start 10 m and 5 m/s off",
    "light turbulence",
    "filter at 20 Hz",
    "filter at 10 Hz",
)
CONDITIONS = (FEW_FIXES, FAR_START, GUSTS, HZ_20, HZ_10)
"""Other conditions that the paper leaves open and that might favour its filters."""


class FlightCase(NamedTuple):
    """Flights that are compared with one another."""

    experiment: str  # of EXPERIMENTS
    form: str = SIX  # or FULL
    # input of the prediction during the outage, in E0 between fixes: IMU or MODEL
    prediction: str = IMU
    tuning: str = SENSORS  # Q and R from the sensors, or as PRINTED
    condition: str = ""  # of CONDITIONS; "": as usual

    def __str__(self) -> str:
        """Name in tables and texts; default values are left out."""
        parts = [
            self.experiment,
            self.form * (self.form == FULL),
            f"{self.prediction}-driven",
            "printed Q, R" * (self.tuning == PRINTED),
            self.condition,
        ]
        return ", ".join(part for part in parts if part)

    @property
    def linear(self) -> bool:
        """True where the process is linear by algebra: position and velocity, driven by the IMU.

        EKF and UKF are then one filter, and so is the PKF except for its draws.
        """
        return self.form == SIX and self.prediction == IMU


CASES = (
    *(
        FlightCase(experiment, SIX, prediction, tuning)
        for experiment in (E0, E1)
        for prediction in (IMU, MODEL)
        for tuning in (SENSORS, PRINTED)
    ),
    FlightCase(E2),
    FlightCase(E2, prediction=MODEL),
    FlightCase(TURN),
    FlightCase(TURN, prediction=MODEL),
    FlightCase(WIND),
    FlightCase(WIND, prediction=MODEL),
    FlightCase(OUTLIERS),
    FlightCase(OUTLIERS, prediction=MODEL),
    *(
        FlightCase(experiment, FULL, prediction)
        for experiment in (E1, E2, TURN)
        for prediction in (IMU, MODEL)
    ),
    *(
        FlightCase(experiment, prediction=MODEL, condition=condition)
        for condition in CONDITIONS
        for experiment in (E0, E1)
    ),
)
"""All that are flown. During an outage Q
moves no estimate but that of UKF and PKF through their spread, and R none: E2 is flown with one
tuning."""
PUBLISHED = {
    "Table 2": {
        "fx_n": (0.1314, 1.0659, 0.2513, 0.1013),
        "fy_n": (0, 0, 0, 0),
        "fz_n": (0.2982, 2.6447, 0.6103, 0.4401),
        "gx": (0.0862, 2.537, 0.33, 0.1449),
        "gy": (0, 0, 0, 0),
        "gz": (0.0047, 0.6123, 0.0315, 0.0073),
        "over_x_pct": (1.2362, 5.0732, 56.3589, 2.3981),
        "over_z_pct": (11.4462, 741.31, 25.2314, 4.8788),
    },
    "Table 3": {
        "fx_n": (4.0548, 0.4664, 0.1145, 0.0536),
        "fy_n": (0, 0, 0, 0),
        "fz_n": (1.4949, 0.6771, 0.2308, 0.1798),
        "gx": (1.835, 0.8348, 0.1443, 0.0591),
        "gy": (0, 0, 0, 0),
        "gz": (0.2589, 0.1104, 0.0104, 0.0049),
        "over_x_pct": (np.inf, 53.4087, 11.6219, 5.4411),
        "over_z_pct": (np.inf, 1635.3, 72.0926, 29.7413),
    },
    "Table 4": {
        "fx_n": (np.nan, np.nan, 0.0018, 0.0011),
        "fy_n": (np.nan, np.nan, 0, 0),
        "fz_n": (np.nan, np.nan, 0.043, 0.0235),
        "gx": (np.nan, np.nan, 0.0051, 0.0018),
        "gy": (np.nan, np.nan, 0, 0),
        "gz": (np.nan, np.nan, 0.0056, 0.0057),
        "over_x_pct": (np.nan, np.nan, 8.337, 5.1873),
        "over_z_pct": (np.nan, np.nan, 38.7196, 23.8822),
    },
}
"""{table: {criterion: values of MODES}} as printed, its decimal strokes as points; inf:
"Divergence", NaN: not flown."""
TABLE_OF = {E0: "Table 2", E1: "Table 3", E2: "Table 4"}


def wide(scores: pd.DataFrame) -> dict[FlightCase, pd.DataFrame]:
    """{Case: DataFrame} of the table of scores: a row per seed, columns by measure and mode, cases
    in their order.

    A row's index is (block, outage), the seed and 0, as common.paired_ratios.ratio takes it.
    attrs["lost"]: {mode: flights that stopped or diverged}.
    """
    rows = scores.assign(block=scores["seed"], outage=0)
    found = by_case(rows, list(FlightCase._fields), MEASURES, "mode")
    for case, own in scores.groupby(list(FlightCase._fields), sort=False):
        lost = own["said"].ne("").groupby(own["mode"], sort=False).sum()
        found[case].attrs["lost"] = lost.astype(int).to_dict()
    return {FlightCase(*case): table for case, table in found.items()}


def of(
    tables: dict[FlightCase, pd.DataFrame],
    experiment: str,
    *,
    form: str = SIX,
    prediction: str | None = None,
    tuning: str | None = None,
) -> dict[FlightCase, pd.DataFrame]:
    """The tables of one experiment in one form, with default conditions, of all readings or of
    those named."""
    return {
        case: table
        for case, table in tables.items()
        if case.experiment == experiment
        and case.form == form
        and not case.condition
        and prediction in (None, case.prediction)
        and tuning in (None, case.tuning)
    }


def flown_values(table: pd.DataFrame, measure: str, mode: str) -> Array:
    """(n,) values of a measure of a mode in the table of a case, empty where it was not flown."""
    if (measure, mode) not in table.columns:
        return np.empty(0)
    values = table[measure, mode].to_numpy(float)
    return values[~np.isnan(values)]


def middle(values: Array | Sequence[float], most: float = np.inf) -> str:
    """Text: the median and in brackets the 10 and 90 % quantiles over the seeds; "diverged" from
    the most on that counts."""
    if not len(values):
        return "–"
    shown = [
        f"{value:.3g}" if value < most else "diverged"
        for value in np.quantile(values, (0.5, 0.1, 0.9), method="inverted_cdf")
    ]
    return f"{shown[0]} ({shown[1]} to {shown[2]})" if set(shown) != {"diverged"} else "diverged"


CRITERIA = {
    "fx_n": "Fx, N",
    "fy_n": "Fy, N",
    "fz_n": "Fz, N",
    "gx_n": "Gx as weight, N",
    "gy_n": "Gy as weight, N",
    "gz_n": "Gz as weight, N",
    "mx_nm": "Gx as moment, N m",
    "my_nm": "Gy as moment, N m",
    "mz_nm": "Gz as moment, N m",
    "over_x_pct": "overshoot of velocity X, %",
    "over_z_pct": "overshoot of velocity Z, %",
    "step_x_pct": "the same, of the step, X, %",
    "step_z_pct": "the same, of the step, Z, %",
}
"""Rows of Tables 2 to 4 redrawn: rms deviations from the final value, and overshoots."""


def redraw_table(tables: dict[FlightCase, pd.DataFrame], experiment: str) -> pd.DataFrame:
    """DataFrame shaped as the paper's table of an experiment: a row per criterion and reading,
    "published / ours" for each mode, and ours with true feedback as no filter."""
    return pd.DataFrame(
        [
            {
                "rms deviation from the final value, or overshoot": title,
                "prediction": case.prediction,
                **{
                    mode: f"{_print_value(value)} / "
                    f"{middle(flown_values(table, measure, mode), MEASURES[measure])}"
                    for mode, value in zip(MODES, _published_values(TABLE_OF[experiment], measure))
                },
                FED_TRUTH: middle(flown_values(table, measure, FED_TRUTH), MEASURES[measure]),
            }
            for case, table in of(tables, experiment, tuning=SENSORS).items()
            for measure, title in CRITERIA.items()
        ]
    )


def _published_values(table: str, measure: str) -> tuple[float, ...]:
    """Values of MODES of a published table; its Gx, Gy and Gz stand beside weight and moment."""
    by_axis = f"g{measure[1]}" if measure[0] in "gm" else ""
    return PUBLISHED[table].get(measure, PUBLISHED[table].get(by_axis, (np.nan,) * len(MODES)))


def _print_value(value: float) -> str:
    return "divergence" if np.isinf(value) else "–" if np.isnan(value) else f"{value:g}"


LEFT_OUT = {
    "horizontal_rmse_m": "position, horizontal, m",
    "vertical_rmse_m": "position, vertical, m",
    "velocity_rmse_m_s": "velocity, m/s",
    "attitude_rmse_deg": "attitude, deg",
    "outage_horizontal_rmse_m": "in the outage: horizontal, m",
    "horizontal_end_m": "at its end: horizontal, m",
    "vertical_end_m": "at its end: vertical, m",
    "velocity_end_m_s": "at its end: velocity, m/s",
    "drift_m_s": "drift, m/s",
    "off_max_m": "aircraft from the reference flight, at most, m",
    "off_route_m": "aircraft beside its route, at most, m",
}
"""Columns that the tables of the paper leave out."""


def left_out(
    tables: dict[FlightCase, pd.DataFrame], cases: Collection[FlightCase] | None = None
) -> pd.DataFrame:
    """A row per case and mode: medians and quantiles over the seeds, NEES, and flights lost."""
    return pd.DataFrame(
        [
            {
                "case": str(case),
                "mode": mode,
                "flights": len(flown_values(table, "fx_n", mode)),
                "lost": lost,
                **{
                    title: middle(flown_values(table, measure, mode), MEASURES[measure])
                    for measure, title in LEFT_OUT.items()
                },
                "NEES at 15 s": _nees(flown_values(table, "nees_cut", mode)),
                "NEES at the end": _nees(flown_values(table, "nees_end", mode)),
            }
            for case, table in tables.items()
            if cases is None or case in cases
            for mode, lost in table.attrs["lost"].items()
        ]
    )


def _nees(values: Array) -> str:
    """Text: mean over the flights that were not lost and, in brackets, the band that it keeps in
    95 % of studies if a filter is as good as it says (six states)."""
    if not len(values):
        return "–"
    low, high = band(6, len(values))
    return f"{values.mean():.3g} ({low:.2f} to {high:.2f})"
