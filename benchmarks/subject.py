"""The library under measurement, on a workload: its recording, start and noise, and timed runs."""
import time

import numpy as np

from workload import DEG, FOLDER, score

LOG = """[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
kind = "increment"
gyro = { columns = ["x", "y", "z"], unit = "rad" }
accel = { columns = ["vx", "vy", "vz"], unit = "m/s" }
grade = "tactical"

[[aiding]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
sd = [1.0, 1.0, 1.0]
"""


def noise(p):
    """strapdown's Noise of the workload's parameters: random-walk biases."""
    from strapdown.core.contract import Noise
    return Noise(p["gyro_noise"], p["accel_noise"], p["gyro_bias_walk"], p["accel_bias_walk"], 0.0, 0.0)


def start(workload):
    """strapdown's Start of the workload: its perturbed state and standard deviations."""
    from strapdown.core.contract import Start
    lla, v, rph = workload.start
    return Start(float(workload.t[0]), tuple(lla), tuple(v), tuple(rph), (0.0,) * 3, (0.0,) * 3, tuple(workload.sd))


def fixes(workload):
    """The position fixes; without gate, since the yardstick has none."""
    import strapdown as sd
    return sd.Aiding("position", workload.fix_t, workload.fix, np.full(workload.fix.shape, workload.parameters["gnss_sd"]), gate=np.inf)


def recording(workload):
    """strapdown's Recording of the workload."""
    import strapdown as sd
    return sd.Recording.from_arrays(workload.t[1:], workload.dtheta[1:], workload.dv[1:], aidings=[fixes(workload)], kind="increment")


def fuse(workload, name, **options):
    """Solution of filter `name` on the workload."""
    import strapdown as sd
    return sd.fuse(recording(workload), name, start=start(workload), noise=noise(workload.parameters), **options)


def accuracy(workload, name):
    """Rms of filter `name` over the workload, every sample."""
    solution = fuse(workload, name)
    path = solution.trajectory
    return score(workload, path.t, path.lla, path.v_n, path.rotation.as_matrix())


def write_log(workload, folder=FOLDER / "log"):
    """Path of a recording.toml with two CSV files, as a user has one."""
    folder.mkdir(parents=True, exist_ok=True)
    imu = np.c_[workload.t, workload.dtheta, workload.dv][1:]
    gnss = np.c_[workload.fix_t, workload.fix / [DEG, DEG, 1.0]]
    np.savetxt(folder / "imu.csv", imu, fmt="%.12g", delimiter=",", header="t,x,y,z,vx,vy,vz", comments="")
    np.savetxt(folder / "gnss.csv", gnss, fmt="%.12g", delimiter=",", header="t,lat,lon,alt", comments="")
    (folder / "recording.toml").write_text(LOG)
    return folder / "recording.toml"
