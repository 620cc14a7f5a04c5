"""A stretch that the 11 kg Aerosonde flies over a flat Earth with given commands: truth, an
ideal IMU, positions of the controls."""

from typing import NamedTuple

import numpy as np
from flat_flight import ORIGIN, flat, geodetic

from strapdown import InitialState
from strapdown.core.compile.records import rows
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.flight import trim
from strapdown.flight.aircraft_model.dynamics import Loads, evaluate, step
from strapdown.flight.aircraft_model.parameters import aircraft

PARAMETERS = aircraft("aerosonde").parameters(earth="flat", origin=ORIGIN)


class Flown(NamedTuple):
    """A flight of n samples."""

    recording: Recording  # with fixes of position and velocity, if any
    start: InitialState  # the truth
    truth: np.ndarray  # (n + 1, 17) states of the aircraft
    inputs: np.ndarray  # (n, 9) what the filters are told: 1, controls at mid-sample, wind, seconds

    @property
    def flat(self):
        """(n + 1, 6) position and velocity about the start."""
        return np.c_[flat(self.truth[:, :3]), self.truth[:, 3:6]]


def flown(seconds, dt=0.01, wind=(3.0, -2.0, 0.5), fixes=()):
    """From trim at 25 m/s with steps of the four controls, in a steady wind (m/s, NED) that the
    filters are told. fixes: times, s."""
    go, begin = (
        step,
        trim(aircraft("aerosonde"), 25.0, origin=ORIGIN, course=0.6, wind=wind, earth="flat"),
    )
    air, count = np.r_[wind, np.zeros(6)], round(seconds / dt)
    states, increments, inputs = [np.array(begin.state)], [], []
    for k in range(count):
        t, state, out = k * dt, states[-1].copy(), np.empty(6)
        commands = np.array(begin.commands) + [
            0.03 * (1 < t < 2),
            0.04 * (2 < t < 3) - 0.04 * (3.5 < t < 4.5),
            -0.03 * (t > 4),
            0.1 * (t > 2.5),
        ]
        go(PARAMETERS, state, commands, air, dt, out)
        inputs.append(np.r_[1.0, 0.5 * (states[-1][13:] + state[13:]), wind, dt])
        states.append(state)
        increments.append(out)
    states, increments, t = np.array(states), np.array(increments), dt * np.arange(1, count + 1)
    rows, rng = np.round(np.array(fixes, float) / dt).astype(int), np.random.default_rng(5)
    seen = np.c_[flat(states[:, :3]), states[:, 3:6]][rows] + rng.standard_normal(
        (len(rows), 6)
    ) * np.repeat([1.0, 0.1], 3)
    sources = (
        Source(
            "position", dt * rows, geodetic(seen[:, :3]), np.full((len(rows), 3), 1.0), gate=np.inf
        ),
        Source("velocity", dt * rows, seen[:, 3:], np.full((len(rows), 3), 0.1), gate=np.inf),
    )
    start = InitialState(
        0.0,
        tuple(states[0, :3]),
        tuple(states[0, 3:6]),
        (0.0,) * 3,
        (0.0,) * 3,
        (0.0,) * 3,
        (2.0,) * 3 + (0.5,) * 3 + (1e-6,) * 9,
    )
    imu = Imu(
        t,
        np.full(count, dt),
        np.ascontiguousarray(increments[:, :3]),
        np.ascontiguousarray(increments[:, 3:]),
    )
    return Flown(
        Recording(imu, sources, None, {"name": "flown"}),
        start.towards(states[0, 6:10]),
        states,
        np.array(inputs),
    )


def acceleration(quaternion, omega, controls, wind, v):
    """m/s^2, NED, that `evaluate` of the aircraft finds at that velocity, attitude, rates,
    positions of the controls and wind."""
    rates, (loads,) = np.empty(19), rows(Loads, 1)
    evaluate(
        PARAMETERS,
        np.r_[ORIGIN, v, quaternion, omega, controls],
        np.r_[wind, np.zeros(6)],
        rates,
        loads,
    )
    return rates[3:6].copy()
