"""smsfusion: AidedINS, a filter on a flat Earth, and its fixed-interval smoother."""

import math
import time
import warnings

import numpy as np

from adapters import fixes_by_sample, judged, local_frame
from strapdown.geometry.geodesy import gravity

LONG = 1e5
"""s: time constant of its Gauss-Markov biases, long so that they walk."""


def _filter(w):
    """AidedINS in a plane tangent at the start."""
    import smsfusion
    from scipy.spatial.transform import Rotation

    p = w.parameters
    errors = [
        {"N": p[s + "_noise"], "B": p[s + "_bias_walk"] * math.sqrt(LONG / 2), "tau_cb": LONG}
        for s in ("accel", "gyro")
    ]
    start, P = Rotation.from_euler("xyz", w.start[2]), np.diag(w.std**2)
    C = start.as_matrix()
    P[6:9, 6:9] = C.T @ P[6:9, 6:9] @ C  # its errors of attitude are in body axes
    (lat, _, alt), quaternion = w.start[0], start.as_quat()[[3, 0, 1, 2]]
    return smsfusion.AidedINS(
        1 / w.dt,
        np.r_[np.zeros(3), w.start[1], quaternion, np.zeros(6)],
        P,
        *errors,
        g=gravity(lat, alt),
        ignore_bias_acc=False,
        cold_start=False,
    )


def _rows(w):
    """The arguments of its `update` in turn: sample k + 1 leads from t[k] to t[k+1]; the fix of
    t[k] comes first."""
    scale, variance = local_frame.scale(w), np.full(3, w.parameters["gnss_std"] ** 2)
    fixes = {k: (fix - w.start[0]) * scale for k, fix in fixes_by_sample(w).items()}
    f, omega = w.dv / w.dt, w.dtheta / w.dt
    for k in range(len(w.t) - 1):
        fix = fixes.get(k)
        yield f[k + 1], omega[k + 1], {"pos": fix, "pos_var": None if fix is None else variance}


def _judged(w, took, states, std):
    from scipy.spatial.transform import Rotation

    C = Rotation.from_quat(states[:, [7, 8, 9, 6]]).as_matrix()
    lla = w.start[0] + states[:, :3] / local_frame.scale(w)
    return judged(w, took, w.t[:-1], lla, states[:, 3:6], C, std)


def aided(workload, seconds=1800.0):
    """smsfusion's AidedINS; its Gauss-Markov bias with a long time constant stands for the walk."""
    w = workload.first(seconds)
    ins, rows = _filter(w), list(_rows(w))
    states, std = np.empty((len(rows), 16)), np.empty((len(rows), 9))
    begin = time.process_time()
    for k, (f, omega, fix) in enumerate(rows):
        ins.update(f, omega, **fix)
        states[k], std[k] = ins.x, np.sqrt(ins.P.diagonal()[:9])
    return _judged(w, time.process_time() - begin, states, std)


def smoothed(workload, seconds=1800.0):
    """smsfusion's FixedIntervalSmoother over the same filter."""
    import smsfusion

    w = workload.first(seconds)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is experimental
        smoother = smsfusion.FixedIntervalSmoother(_filter(w))
    rows = list(_rows(w))
    begin = time.process_time()
    for f, omega, fix in rows:
        smoother.update(f, omega, **fix)
    states, P = np.asarray(smoother.x), np.asarray(smoother.P)
    took = time.process_time() - begin
    std = np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, :9])
    return _judged(w, took, states, std)
