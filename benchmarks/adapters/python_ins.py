"""python-ins: its closed loop and its open loop, the covariance at 10 Hz or at every fix."""

import time

import numpy as np
from workload import DEG

from adapters import judged


def _setup(w):
    """Inputs of pyins' filters: initial state, its four standard deviations, increments and the
    keyword arguments."""
    import pandas as pd
    from pyins import inertial_sensor, measurements, strapdown, util

    p = w.parameters
    degrees = np.array([1 / DEG, 1 / DEG, 1.0])
    start = pd.Series(
        np.r_[w.start[0] * degrees, w.start[1], w.start[2] / DEG],
        index=util.LLA_COLS + util.VEL_COLS + util.RPH_COLS,
        name=w.t[0],
    )
    imu = pd.DataFrame(np.c_[w.dtheta, w.dv], index=w.t, columns=util.GYRO_COLS + util.ACCEL_COLS)
    models = {
        f"{sensor}_model": inertial_sensor.EstimationModel(
            p[sensor + "_bias_std"], p[sensor + "_noise"], p[sensor + "_bias_walk"]
        )
        for sensor in ("gyro", "accel")
    }
    fixes = pd.DataFrame(w.fix * degrees, index=w.fix_t, columns=util.LLA_COLS)
    models["measurements"] = [measurements.Position(fixes, p["gnss_std"])]
    return (
        start,
        [p[key] for key in ("pos_std", "vel_std", "level_std", "azimuth_std")],
        strapdown.compute_increments_from_imu(imu, "increment"),
        models,
    )


def _result(w, seconds, result):
    from pyins import transform, util

    trajectory, t = result.trajectory, result.trajectory.index.to_numpy(float)
    # it says them at 10 Hz
    names = [*util.NED_COLS, *util.VEL_COLS, *util.RPH_COLS]
    std = [np.interp(t, result.trajectory_sd.index, result.trajectory_sd[name]) for name in names]

    lla = trajectory[util.LLA_COLS].to_numpy() * [DEG, DEG, 1.0]
    C = transform.mat_from_rph(trajectory[util.RPH_COLS].to_numpy())
    v = trajectory[util.VEL_COLS].to_numpy()
    return judged(w, seconds, t, lla, v, C, np.column_stack(std) * np.repeat([1, 1, DEG], 3))


def feedback(workload, seconds=60.0):
    """pyins' closed loop (covariance at 10 Hz or at every fix)."""
    from pyins import filters

    w = workload.first(seconds)
    start, std, increments, models = _setup(w)
    begin = time.process_time()
    result = filters.run_feedback_filter(start, *std, increments, **models)
    return _result(w, time.process_time() - begin, result)


def feedforward(workload, seconds=60.0):
    """pyins' open loop: integration of the increments, then the filter beside it."""
    from pyins import filters, strapdown

    w = workload.first(seconds)
    start, std, increments, models = _setup(w)
    begin = time.process_time()
    nominal = strapdown.Integrator(start).integrate(increments)
    result = filters.run_feedforward_filter(nominal, nominal, *std, **models)
    return _result(w, time.process_time() - begin, result)
