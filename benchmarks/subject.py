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

[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 1.0]
"""


def noise(p):
    """strapdown's Noise of the workload's parameters: random-walk biases."""
    from strapdown.core.loop.contract import Noise

    return Noise(
        p["gyro_noise"], p["accel_noise"], p["gyro_bias_walk"], p["accel_bias_walk"], 0.0, 0.0
    )


def start(workload):
    """strapdown's Start of the workload: its perturbed state and standard deviations."""
    from strapdown.core.loop.contract import InitialState

    lla, v, rph = workload.start
    return InitialState(
        float(workload.t[0]),
        tuple(lla),
        tuple(v),
        tuple(rph),
        (0.0,) * 3,
        (0.0,) * 3,
        tuple(workload.std),
    )


def fixes(workload):
    """The position fixes; without gate, since the yardstick has none."""
    import strapdown as sd

    return sd.Source(
        "position",
        workload.fix_t,
        workload.fix,
        np.full(workload.fix.shape, workload.parameters["gnss_std"]),
        gate=np.inf,
    )


def recording(workload, *sources):
    """strapdown's Recording of the workload, with these sources beside its position fixes."""
    import strapdown as sd

    return sd.Recording.from_arrays(
        workload.t[1:],
        workload.dtheta[1:],
        workload.dv[1:],
        sources=[fixes(workload), *sources],
        kind="increment",
    )


def fuse(workload, name, **options):
    """Solution of filter `name` on the workload."""
    import strapdown as sd

    return sd.fuse(
        recording(workload),
        name,
        start=start(workload),
        noise=noise(workload.parameters),
        **options,
    )


def accuracy(workload, name):
    """Rms of filter `name` over the workload, every sample."""
    path = fuse(workload, name).trajectory
    return score(workload, path.t, path.lla, path.v_n, path.rotation.as_matrix())


def timed_run(workload, name, every=1, sources=(), estimate=None, **options):
    """A function that runs filter `name` over the whole workload and returns the seconds of the
    compiled loop; every `every`-th sample is stored, where it is not each of them with its
    covariance as in a study. `sources` are sources beside the position fixes, `estimate` what of the
    installation are states.

    As with the yardstick, compiling, the start and the output arrays are there before the clock
    starts.
    """
    from strapdown.engine.options import run_options

    log, at_start, densities = (
        recording(workload, *sources),
        start(workload),
        noise(workload.parameters),
    )
    return timed(
        lambda begin: begin(
            log,
            name,
            run_options(
                options=options,
                start=at_start,
                noise=densities,
                every=every,
                covariance=every > 1,
                estimate=estimate,
            ),
        )
    )


def timed(made):
    """A function that runs the Run that `made(engine.begin)` gives, anew each time, and returns
    the seconds of the compiled loop alone."""
    from strapdown.engine import batch
    from strapdown.engine.prepare import ROWS_AT_ONCE

    out = made(batch.begin).out
    for part in out[:3]:
        part[...] = 0.0  # its pages are there

    def seconds():
        run = made(batch.begin)
        begin = time.perf_counter()
        for rows in run.chunks(ROWS_AT_ONCE):
            run.advance(rows, out)
        return time.perf_counter() - begin

    return seconds


def stream_times(workload):
    """(us per IMU sample, us per fix) of `Stream.step`: medians over the seconds of a workload with
    1 Hz fixes.

    A fix is used with the sample that ends at its time, so its cost is that of both steps less that
    of a sample.
    """
    import strapdown as sd

    stream = sd.Stream(
        "closed-loop",
        start=start(workload),
        noise=noise(workload.parameters),
        sources=[fixes(workload)],
    )
    deviation, samples = (workload.parameters["gnss_std"],) * 3, []
    for t, dtheta, dv in zip(
        workload.t[1:].tolist(), workload.dtheta[1:].tolist(), workload.dv[1:].tolist()
    ):
        samples.append(sd.Sample(t, workload.dt, tuple(dtheta), tuple(dv)))
    each, plain, both = len(samples) // len(workload.fix_t), [], []
    for k, (t, y) in enumerate(zip(workload.fix_t.tolist(), workload.fix.tolist())):
        fix, block = sd.Measurement(t, 0, tuple(y), deviation), samples[k * each : (k + 1) * each]
        begin = time.perf_counter()
        for sample in block[:-1]:
            stream.step(sample)
        middle = time.perf_counter()
        stream.step(fix)
        stream.step(block[-1])
        plain.append((middle - begin) / (each - 1) * 1e6)
        both.append((time.perf_counter() - middle) * 1e6)
    stream.finish()
    if stream.counts() != [(len(workload.fix_t), 0)]:
        raise RuntimeError(f"the stream used {stream.counts()} of {len(workload.fix_t)} fixes")
    return float(np.median(plain)), float(np.median(np.array(both) - plain))


def write_log(workload, folder=FOLDER / "log"):
    """Path of a recording.toml with two CSV files, as a user has one."""
    folder.mkdir(parents=True, exist_ok=True)
    imu = np.c_[workload.t, workload.dtheta, workload.dv][1:]
    gnss = np.c_[workload.fix_t, workload.fix / [DEG, DEG, 1.0]]
    np.savetxt(
        folder / "imu.csv", imu, fmt="%.12g", delimiter=",", header="t,x,y,z,vx,vy,vz", comments=""
    )
    np.savetxt(
        folder / "gnss.csv", gnss, fmt="%.12g", delimiter=",", header="t,lat,lon,alt", comments=""
    )
    (folder / "recording.toml").write_text(LOG)
    return folder / "recording.toml"
