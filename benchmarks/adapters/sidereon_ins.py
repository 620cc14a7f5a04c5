"""sidereon: its loosely coupled InertialFilter (EKF), in ECEF. Its RTS smoother
knows states at fixes alone and cannot be scored between them."""

import math
import time

import numpy as np

from adapters import earth_frame, fixes_by_sample, judged
from strapdown.geometry.geodesy import to_ecef

LONG = 1e5
"""s: time constant of its Gauss-Markov biases, long so that they walk."""
BLOCKS = (slice(0, 3), slice(3, 6), slice(6, 9))
"""Position, velocity and attitude in its covariance."""


def _filter(w):
    import sidereon as s

    p, (r, v, C) = w.parameters, earth_frame.start(w)
    walk = {x: p[x + "_bias_walk"] * math.sqrt(LONG / 2) for x in ("accel", "gyro")}
    spec = s.ImuSpec(p["accel_noise"], p["gyro_noise"], walk["accel"], walk["gyro"], LONG, LONG)
    P = np.diag(w.std**2)
    P[6:9, 6:9] = earth_frame.attitude_covariance(w)
    state = s.InsFilterState.from_covariance(
        s.NavState(0.0, list(r), list(v), C), s.ErrorStateLayout.FIFTEEN, P
    )
    return s.InertialFilter.with_config(state, s.InertialFilterConfig(spec))


def _fix(w, t, lla):
    import sidereon as s

    cov = np.eye(3) * w.parameters["gnss_std"] ** 2
    return s.GnssFixMeasurement.position(
        t, list(to_ecef(lla)), cov, 10, fix_status=s.GnssFixStatus.FIXED
    )


def _rows(states):
    """Arrays in ECEF of its states: position, velocity, attitude, blocks of the covariance."""
    rows = [
        (x.nominal.position_ecef_m, x.nominal.velocity_ecef_mps, x.nominal.attitude_body_to_ecef)
        for x in states
    ]
    covariances = [np.asarray(x.covariance) for x in states]
    blocks = np.array([[P[b, b] for b in BLOCKS] for P in covariances])
    return *(np.array(column) for column in zip(*rows)), blocks


def loose(workload, seconds=60.0):
    """sidereon's loosely coupled EKF with 15 states."""
    return _run(workload, seconds, 0.0)


def sign_undone(workload, seconds=60.0):
    """The same with samples to which twice the estimated gyro bias is added: version 3.0.4 corrects samples
    by the opposite of what its error model says (`python benchmarks/sidereon_sign.py`)."""
    return _run(workload, seconds, 2.0)


def _run(workload, seconds, added):
    import sidereon as s

    w = workload.first(seconds)
    run, fixes, t, states = _filter(w), fixes_by_sample(w), (w.t - w.t[0]).tolist(), []
    dv, dtheta, bias = w.dv.tolist(), w.dtheta, np.zeros(3)
    fixes = {k: _fix(w, t[k], fix) for k, fix in fixes.items()}
    begin = time.process_time()
    for k in range(1, len(t)):
        turned = (dtheta[k] + bias).tolist()
        state = run.propagate(s.ImuSample.increment(t[k], dv[k], turned, t[k] - t[k - 1]))
        if k in fixes:
            run.update_loose(fixes[k])
            state = run.state
            bias = added * w.dt * np.array(state.nominal.gyro_bias_rps)
        states.append(state)
    took = time.process_time() - begin
    return judged(w, took, w.t[1:], *earth_frame.estimate(*_rows(states)))
