"""Sigma-point and particle Kalman filters and the aircraft in the loop under measurement: steps
in the engine, five minutes of flight, the study."""

import os
import time

import numpy as np
import subject
import workload

UKF = ["flight, UKF step"]
PKF = ["flight, PKF per component"]
AIRCRAFT = ["flight, aircraft step"]
FLOWN = ["flight, 315 s with UKF", "flight, 315 s with PKF"]
STUDY = ["flight, study of 200 seeds"]
COMPONENTS = 500


def ukf(alternating, turns):
    """[(us per sample, note)] of the UKF on workload A."""
    w = workload.load("A")
    us = 1e6 / (len(w.t) - 1)
    closed, own, ratio = alternating(
        subject.timed_run(w, "closed-loop"), subject.timed_run(w, "ukf"), turns
    )
    return [(own * us, f"{ratio:.0f} x closed loop ({closed * us:.3f} us)")]


def pkf(alternating, turns):
    """[(time of a component over that of the closed loop, note)] on the first minute of workload
    A."""
    w = workload.load("A").first(60)
    us = 1e6 / (len(w.t) - 1)
    closed, own, ratio = alternating(
        subject.timed_run(w, "closed-loop"),
        subject.timed_run(w, "pkf", components=COMPONENTS),
        turns,
    )
    return [
        (
            ratio / COMPONENTS,
            f"{own * us / COMPONENTS:.3f} us against {closed * us:.3f} us per IMU sample; {COMPONENTS} components",
        )
    ]


def aircraft(times):
    """[(us per step of 10 ms, note)] of the aircraft on the rotating Earth, a circle in gusts:
    the median of `times` runs of 20 000 steps."""
    import numba

    import strapdown as sd
    from strapdown.core.compile.jit import compile_kernel
    from strapdown.flight.aircraft_model.dynamics import step

    compile_kernel(step)
    trim = sd.flight.trim(sd.flight.aircraft("aerosonde"), 25.0, radius=300.0)
    parameters, wind, increments = (
        trim.aircraft.parameters("geodetic", trim.origin),
        np.array([3.0, 1, 0, 0.5, 0.5, 0.5, 0.01, 0.01, 0.01]),
        np.empty(6),
    )

    @numba.njit
    def fly(parameters, state, commands, wind, increments, count):
        for _ in range(count):
            step(parameters, state, commands, wind, 0.01, increments)

    def seconds(count=20_000):
        state = trim.state.copy()
        begin = time.perf_counter()
        fly(parameters, state, trim.commands, wind, increments, count)
        return time.perf_counter() - begin

    seconds(1)
    return [
        (
            float(np.median([seconds() for _ in range(times)])) / 20_000 * 1e6,
            "geodetic, four evaluations of all forces",
        )
    ]


def flown(times):
    """[(s, note)] for `FLOWN`: the whole call of `fly` for the straight flight of 315 s without
    GNSS from 15 s, once everything is compiled.

    Some hit the ground before: their time is scaled to 315 s.
    """
    import strapdown as sd
    from strapdown.flight import Sensors

    sensors = Sensors(imu="mollaei", outage="15:")

    def seconds(filter, count):
        sd.flight.fly("straight", filter, duration=16.0, sensors=sensors)
        taken = []
        for seed in range(count):
            begin = time.perf_counter()
            flight = sd.flight.fly("straight", filter, duration=315.0, seed=seed, sensors=sensors)
            taken.append((time.perf_counter() - begin) * 315.0 / flight.recording.imu.t[-1])
        return float(np.median(taken))

    closed = seconds("closed-loop", times)
    return [
        (seconds("ukf", times), f"closed loop {closed:.2f} s"),
        (seconds("pkf", 1), f"{COMPONENTS} components, 15.75 million component steps"),
    ]


def study():
    """[(s, note)] for `STUDY`: E1 with no filter, EKF, UKF and PKF in the six-state form, driven
    by the model, the slower of the two readings."""
    from strapdown_reproductions.mollaei import runs
    from strapdown_reproductions.mollaei.cells import E1, IMU, MODEL, FlightCase

    def seconds(prediction):
        cases = [FlightCase(E1, prediction=prediction)]
        runs.run_all(range(1), cases=cases)
        begin = time.perf_counter()
        runs.run_all(range(200), cases=cases)
        return time.perf_counter() - begin

    by_imu = seconds(IMU)
    return [
        (
            seconds(MODEL),
            f"model-driven; IMU-driven {by_imu:.0f} s; {COMPONENTS} components; {os.cpu_count()} cores",
        )
    ]
