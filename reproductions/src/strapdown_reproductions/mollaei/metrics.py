"""Scores of one flight of Mollaei et al.: their deviations from a final value and overshoots, and
scores that they leave out.

All are functions of arrays at the IMU samples. Errors are true - estimate.
"""

from typing import NamedTuple

import numpy as np

from strapdown.typing import Array

FINAL = 2.0
"""s: the final value of a signal is its mean over so many seconds at the end."""
WITHIN = 0.1
"""Settled: within this share of the reference flight's range about the final value."""
FAR = 1e5
"""m: what a flight that stopped, or went further, is scored with. The other most values of
MEASURES are as far beyond what is flown."""
MEASURES = {
    "fx_n": 1e3,
    "fy_n": 1e3,
    "fz_n": 1e3,
    "mx_nm": 1e3,
    "my_nm": 1e3,
    "mz_nm": 1e3,
    "gx_n": 1e3,
    "gy_n": 1e3,
    "gz_n": 1e3,
    "over_x_pct": 1e4,
    "over_y_pct": 1e4,
    "over_z_pct": 1e4,
    "step_x_pct": 1e4,
    "step_z_pct": 1e4,
    "aileron_deg": 100.0,
    "elevator_deg": 100.0,
    "rudder_deg": 100.0,
    "engine_rad_s": 1e4,
    "alpha_deg": 360.0,
    "alpha_off_deg": 360.0,
    "settle_elevator_s": 1e3,
    "settle_engine_s": 1e3,
    "settle_alpha_s": 1e3,
    "horizontal_rmse_m": FAR,
    "vertical_rmse_m": FAR,
    "velocity_rmse_m_s": 1e3,
    "attitude_rmse_deg": 180.0,
    "fixed_horizontal_rmse_m": FAR,
    "outage_horizontal_rmse_m": FAR,
    "outage_vertical_rmse_m": FAR,
    "outage_velocity_rmse_m_s": 1e3,
    "horizontal_end_m": FAR,
    "vertical_end_m": FAR,
    "velocity_end_m_s": 1e3,
    "drift_m_s": 1e3,
    "worst_m": FAR,
    "off_rms_m": FAR,
    "off_max_m": FAR,
    "off_end_m": FAR,
    "off_route_m": FAR,
    "nees_cut": 1e9,
    "nees_end": 1e9,
}
"""{measure: the most that counts of it}; a measure's unit is the end of its name. fx ... gz,
aileron ... alpha: rms deviation from the final value of the flight itself, and under the same
name with `_ref` from that of the reference flight. The final value is the mean of the last FINAL
seconds, also of a flight that still drifts then. With `_by_truth` and `_by_fixes`: see `distances`,
of flights with fixes alone. worst_m: the estimate's largest error after the
cut, of the whole flight where there is no cut; off_max_m and off_route_m: of the whole flight."""
SIGNALS = {
    "fx_n": ("force", 0),
    "fy_n": ("force", 1),
    "fz_n": ("force", 2),
    "mx_nm": ("moment", 0),
    "my_nm": ("moment", 1),
    "mz_nm": ("moment", 2),
    "gx_n": ("gravity", 0),
    "gy_n": ("gravity", 1),
    "gz_n": ("gravity", 2),
    "aileron_deg": ("surfaces", 0),
    "elevator_deg": ("surfaces", 1),
    "rudder_deg": ("surfaces", 2),
    "engine_rad_s": ("engine", None),
    "alpha_deg": ("alpha", None),
}
"""{measure of deviation: (field of Record, column)}."""
MEASURES |= {f"{name}_ref": MEASURES[name] for name in SIGNALS}
DEVIATIONS = ("fx_n", "fz_n", "gx_n", "gz_n", "mx_nm", "my_nm", "mz_nm")
"""Fx and Fz; Gx and Gz as weight; and all three as moments."""
BY_TRUTH, BY_FIXES = "by_truth", "by_fixes"
"""Which curve of direct feedback another is held against."""
MEASURES |= {f"{name}_{blue}": 1e3 for name in DEVIATIONS for blue in (BY_TRUTH, BY_FIXES)}
LOST = MEASURES | {"nees_cut": np.nan, "nees_end": np.nan}
"""Scores of a flight that stopped: the most of each; there is no NEES of it."""


class FlightRecord(NamedTuple):
    """The signals of a flight that the scores need, a row per IMU sample."""

    t: Array  # (n,) s
    force: Array  # (n, 3) N, aerodynamic and propulsive, body axes
    moment: Array  # (n, 3) N m, body axes
    gravity: Array  # (n, 3) N, weight along the body axes
    velocity: Array  # (n, 3) m/s, true, body axes
    surfaces: Array  # (n, 3) aileron, elevator, rudder, deg
    engine: Array  # (n,) rad/s
    alpha: Array  # (n,) deg
    place: Array  # (n, 3) m NED of the aircraft from the start
    beside: Array  # (n,) m, of the aircraft to the right of its route
    position: Array  # (n, 3) m NED, error of the estimate
    v_error: Array  # (n, 3) m/s NED, error of the estimate
    attitude: Array  # (n,) rad, angle between true and estimated attitude
    # (2,) of position and velocity, where the fixes end or would, and at the end; NaN where no
    # covariance was kept
    nees: Array
    stopped: str = ""  # why the flight ended early

    def signal(self, name: str) -> Array:
        """(n,) of one of SIGNALS."""
        field, column = SIGNALS[name]
        values = getattr(self, field)
        return values if column is None else values[:, column]


def final(t: Array, values: Array) -> float:
    """Mean of `values` (n,) at `t` (n,) s over the last FINAL seconds."""
    return values[t > t[-1] - FINAL].mean(axis=0)


def deviation(values: Array, last: float) -> float:
    """Root mean square of values (n,) - last over all rows."""
    return float(np.sqrt(np.mean((values - last) ** 2)))


def overshoot(values: Array, last: float, begin: float = 0.0) -> float:
    """Per cent by which `values` (n,) go beyond `last`, seen from `begin`, of |last - begin|: 100
    (extreme - last) / (last - begin), 0 or more.

    With begin = 0 that is the overshoot of MATLAB's stepinfo without an initial value. inf where
    last = begin.
    """
    step = last - begin
    if step == 0:
        return np.inf
    return max(0.0, 100.0 * float(np.max((values - last) / step)))


def settling_time(t: Array, values: Array, last: float, width: float) -> float:
    """s from t[0] to the last time at which values (n,) are not within `width` of `last`; 0
    where they always are."""
    outside = np.flatnonzero(np.abs(values - last) > width)
    return float(t[outside[-1]] - t[0]) if len(outside) else 0.0


def score(
    record: FlightRecord, reference: FlightRecord, cut: float | None = None
) -> dict[str, float | str]:
    """{measure: value, "said": text} of a flight, the names of MEASURES; of a stopped flight the
    most of each.

    reference: Record of the same flight steered by the truth; cut: when the fixes end, s, None
    where they do not.
    """
    if record.stopped or not np.isfinite(record.place).all():
        return {**LOST, "said": record.stopped or "no finite state"}
    found = {
        **deviations(record, reference),
        **transients(record, reference),
        **estimates(record, cut),
        **ways(record, reference),
    }
    if cut is None:
        found |= distances(record, reference, BY_TRUTH)
    said = "diverged" if max(found["worst_m"], found["off_max_m"]) >= FAR else ""
    # np.minimum keeps a NaN: there is nothing to measure
    return {
        name: float(np.minimum(found.get(name, np.nan), most)) for name, most in MEASURES.items()
    } | {"said": said}


def deviations(record: FlightRecord, reference: FlightRecord) -> dict[str, float]:
    """Rms deviations of SIGNALS from their final value, and from that of the reference flight."""
    return {
        f"{name}{ending}": deviation(record.signal(name), final(judge.t, judge.signal(name)))
        for name in SIGNALS
        for ending, judge in (("", record), ("_ref", reference))
    }


def distances(record: FlightRecord, blue: FlightRecord, name: str) -> dict[str, float]:
    """Distance of the curves of DEVIATIONS from those of a flight by direct feedback, the blue
    ones of the paper: rms distance as a share of the rms deviation of the blue curve from its
    final value; inf where that has none, or one flight was shorter.

    name: BY_TRUTH or BY_FIXES, by what the blue one flew."""
    found = {}
    for signal in DEVIATIONS:
        own, its = record.signal(signal), blue.signal(signal)
        size = deviation(its, final(blue.t, its)) if len(its) == len(own) else 0.0
        found[f"{signal}_{name}"] = deviation(own, its) / size if size > 0 else np.inf
    return found


def transients(record: FlightRecord, reference: FlightRecord) -> dict[str, float]:
    """Overshoots of velocity, settling times, and how far the final angle of attack is off."""
    overshoots = {
        f"{of}_{axis}_pct": overshoot(
            record.velocity[:, k], final(record.t, record.velocity[:, k]), begin
        )
        for axis, k in (("x", 0), ("y", 1), ("z", 2))
        for of, begin in (("over", 0.0), ("step", reference.velocity[0, k]))
    }
    settled = {
        f"settle_{name.partition('_')[0]}_s": settling_time(
            record.t,
            record.signal(name),
            final(record.t, record.signal(name)),
            WITHIN * np.ptp(reference.signal(name)),
        )
        for name in ("elevator_deg", "engine_rad_s", "alpha_deg")
    }
    off = abs(float(final(record.t, record.alpha) - final(reference.t, reference.alpha)))
    return overshoots | settled | {"alpha_off_deg": off}


def estimates(record: FlightRecord, cut: float | None) -> dict[str, float]:
    """Errors of the estimate over the flight and in the outage; NEES of six states at the cut
    and at the end."""
    t, length = record.t, np.linalg.norm
    level, down = length(record.position[:, :2], axis=1), np.abs(record.position[:, 2])
    distance, speed = length(record.position, axis=1), length(record.v_error, axis=1)
    after = np.zeros(len(t), bool) if cut is None else t > cut + 1e-6
    before = ~after & (t > t[0] + FINAL)  # the first seconds are of the start's own error
    rms = lambda values: float(np.sqrt(np.mean(values**2))) if values.size else np.nan
    at_end = {
        "horizontal_end_m": level[-1],
        "vertical_end_m": down[-1],
        "velocity_end_m_s": speed[-1],
        "drift_m_s": level[-1] / (t[-1] - (cut or 0.0)),
    }
    return {
        "horizontal_rmse_m": rms(level),
        "vertical_rmse_m": rms(down),
        "velocity_rmse_m_s": rms(speed),
        "attitude_rmse_deg": float(np.degrees(rms(record.attitude))),
        "fixed_horizontal_rmse_m": rms(level[before]),
        "outage_horizontal_rmse_m": rms(level[after]),
        "outage_vertical_rmse_m": rms(down[after]),
        "outage_velocity_rmse_m_s": rms(speed[after]),
        **(dict.fromkeys(at_end, np.nan) if cut is None else at_end),
        "worst_m": distance[after].max() if cut is not None else distance.max(),
        "nees_cut": record.nees[0],
        "nees_end": record.nees[1],
    }


def ways(record: FlightRecord, reference: FlightRecord) -> dict[str, float]:
    """Distances of the aircraft from the reference flight at the same time, m: rms, largest, at
    the end; and beside its route at most."""
    apart = np.linalg.norm(record.place - reference.place[: len(record.place)], axis=1)
    return {
        "off_rms_m": np.sqrt(np.mean(apart**2)),
        "off_max_m": apart.max(),
        "off_end_m": apart[-1],
        "off_route_m": np.abs(record.beside).max(),
    }
