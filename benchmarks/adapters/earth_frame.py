"""The start of a workload in ECEF and back, for packages that work there."""

import numpy as np

from strapdown.geometry.geodesy import from_ecef, ned_axes, to_ecef


def start(workload):
    """(position m, velocity m/s, C_be) of a workload's start in ECEF."""
    from scipy.spatial.transform import Rotation

    lla, v, rph = (np.asarray(part, float) for part in workload.start)
    axes = ned_axes(lla).T
    return to_ecef(lla), axes @ v, axes @ Rotation.from_euler("xyz", rph).as_matrix()


def attitude_covariance(workload):
    """(3, 3) of the start's rotation vector in ECEF, rad^2."""
    axes = ned_axes(np.asarray(workload.start[0], float)).T
    return axes @ np.diag(workload.std[6:9] ** 2) @ axes.T


def estimate(r, v, C, blocks):
    """(lla, v NED, C_bn, std) of (n, 3), (n, 3), (n, 3, 3) in ECEF and of the covariances of
    position, velocity and attitude there, (n, 3, 3, 3)."""
    lla = from_ecef(r)
    axes = ned_axes(lla)
    in_ned = axes[:, None] @ blocks @ np.swapaxes(axes, 1, 2)[:, None]
    std = np.sqrt(np.diagonal(in_ned, axis1=2, axis2=3)).reshape(len(r), 9)
    return lla, np.einsum("nij,nj->ni", axes, v), axes @ C, std
