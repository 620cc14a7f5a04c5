"""Sigma-point and particle Kalman filters and the aircraft in the loop under measurement: steps in the engine, five minutes of flight, the study."""
import time

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
    closed, own, ratio = alternating(subject.timed_run(w, "closed-loop"), subject.timed_run(w, "ukf"), turns)
    return [(own * us, f"{ratio:.0f} x closed loop ({closed * us:.3f} us)")]


def pkf(alternating, turns):
    """[(time of a component over that of the closed loop, note)] on the first minute of workload A."""
    w = workload.load("A").first(60)
    us = 1e6 / (len(w.t) - 1)
    closed, own, ratio = alternating(subject.timed_run(w, "closed-loop"), subject.timed_run(w, "pkf", components=COMPONENTS), turns)
    return [(ratio / COMPONENTS, f"{own * us / COMPONENTS:.3f} us against {closed * us:.3f} us per IMU sample; {COMPONENTS} components")]
