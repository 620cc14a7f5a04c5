"""strapdown itself: the closed loop, the invariant filter and the smoothers of both, without a gate, as the
others have none."""

import time

import subject

import strapdown as sd
from adapters import judged


def closed_loop(workload, seconds=float("inf")):
    """strapdown's closed loop."""
    return _filtered("closed-loop", workload, seconds)


def invariant(workload, seconds=float("inf")):
    """strapdown's invariant filter, to second order."""
    return _filtered("iekf", workload, seconds)


def _filtered(name, workload, seconds):
    return _run(sd.fuse, name, workload, seconds)


def smoothed(workload, seconds=float("inf")):
    """strapdown's RTS smoother over the closed loop."""
    return _smoothed("closed-loop", workload, seconds)


def smoothed_invariant(workload, seconds=float("inf")):
    """strapdown's RTS smoother over the invariant filter."""
    return _smoothed("iekf", workload, seconds)


def _smoothed(name, workload, seconds):
    return _run(sd.smooth, name, workload, seconds)


def _run(run, name, workload, seconds):
    """A filter or smoother; its time is that of the whole call."""
    w = workload.first(seconds)
    log, about = (
        subject.recording(w),
        dict(start=subject.start(w), noise=subject.noise(w.parameters)),
    )
    run(log, name, **about)
    begin = time.process_time()
    path = run(log, name, **about).trajectory
    took = time.process_time() - begin
    return judged(w, took, path.t, path.lla, path.v_n, path.rotation.as_matrix(), path.std[:, :9])
