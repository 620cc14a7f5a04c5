"""GNSS_IMU of rtklibexplorer: the kernels of its loosely coupled filter after Groves, in the order of its
main program, from a folder; without zero-velocity updates, yaw alignment and velocity matching, for which the
others have no like."""

import os
import sys
import time
from pathlib import Path

import numpy as np

from adapters import earth_frame, fixes_by_sample, judged
from strapdown.geometry.geodesy import radii, to_ecef

UNKNOWN = 1e3
"""m/s: standard deviation of the velocity that its update wants and no fix has."""


def _kernels():
    """Its module of kernels; ImportError without the folder."""
    folder = Path(os.environ.get("STRAPDOWN_PEERS", "")) / "GNSS_IMU" / "src"
    if not folder.is_dir():
        raise ImportError("set STRAPDOWN_PEERS to a folder with a clone of rtklibexplorer/GNSS_IMU")
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    import imu_math

    return imu_math


def _config(kernels, w):
    p, config = w.parameters, kernels.LC_KF_Config()
    config.nstates, config.lever_arm_b = 15, np.zeros(3)
    config.attitude_noise_var, config.vel_noise_var = p["gyro_noise"] ** 2, p["accel_noise"] ** 2
    config.accel_bias_noise_var = p["accel_bias_walk"] ** 2
    config.gyro_bias_noise_var = p["gyro_bias_walk"] ** 2
    config.pos_meas_SD, config.vel_meas_SD = np.full(3, p["gnss_std"]), np.full(3, UNKNOWN)
    return config


def loose(workload, seconds=60.0):
    """The loosely coupled filter of GNSS_IMU with 15 states."""
    kernels = _kernels()
    w = workload.first(seconds)
    config, fixes = _config(kernels, w), fixes_by_sample(w)
    (r, v, C), bias, P = earth_frame.start(w), np.zeros(6), np.zeros((15, 15))
    order = np.r_[6:9, 3:6, 0:3, 9:12, 12:15]
    P[np.ix_(range(15), range(15))] = np.diag(w.std[order] ** 2)
    P[:3, :3] = earth_frame.attitude_covariance(w)
    lat = w.start[0][0]
    gravity = kernels.Gravity_ECEF(r)
    meridian, normal = radii(lat)
    radius = float(np.hypot(normal * np.cos(lat), meridian * np.sin(lat)))
    rows = []
    begin = time.process_time()
    for k in range(1, len(w.t)):
        f, omega = w.dv[k] / w.dt - bias[:3], w.dtheta[k] / w.dt - bias[3:]
        r, v, C = kernels.Nav_equations_ECEF(w.dt, r, v, C, f, omega, gravity)
        P = kernels.LC_KF_Predict(w.dt, C, v, r, bias, P, f, omega, config, gravity, radius)
        if k in fixes:
            C, v, r, bias, P = kernels.LC_KF_GNSS_Update(
                to_ecef(fixes[k]), v, C, v, r, bias, P, f, omega, config
            )
            # its main program keeps that of the start, which is right for some hundred metres
            gravity = kernels.Gravity_ECEF(r)
        C = kernels.ortho_C(C)
        rows.append((r, v, C, [P[6:9, 6:9], P[3:6, 3:6], P[:3, :3]]))
    took = time.process_time() - begin
    columns = (np.array(column) for column in zip(*rows))
    return judged(w, took, w.t[1:], *earth_frame.estimate(*columns))
