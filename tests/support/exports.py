"""Recordings that show all rules of the loop, and exported filters called from Python."""

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.core.compile.records import dtype_of
from strapdown.core.loop.contract import Imu
from strapdown.sim.trajectory import demo_flight

STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
"""Options of a C compiler that warns of everything."""


def rough_flight(seconds=120.0, seed=3):
    """A flight with gaps of the IMU, wild fixes, a receiver that is off for long, a velocity that
    nothing explains and wrong claims of standing still, in every two minutes."""
    recording = sd.simulate(demo_flight(), seconds, "tactical", seed)
    t = recording.imu.t
    keep = np.ones(len(t), bool)
    position, velocity = recording.sources
    y, v = position.y.copy(), velocity.y.copy()
    for begin in np.arange(0.0, seconds - 60, 120.0):
        for first, last in ((20.0, 20.4), (31.0, 34.25)):
            keep &= ~((t > begin + first) & (t <= begin + last))
        y[np.abs(position.t - begin - 25) < 0.3, 0] += 200 / 6.4e6
        y[(position.t > begin + 45) & (position.t < begin + 60), 1] += 80 / 6.4e6
        v[(velocity.t > begin + 70) & (velocity.t < begin + 80), 2] += 4.0
        y[np.abs(position.t - begin - 85) < 0.3, 2] = np.nan
    still = np.arange(90.0, seconds, 37.0)
    return replace(
        recording,
        imu=Imu(*(column[keep] for column in recording.imu)),
        sources=(
            replace(position, y=y, parameters=(0.4, -0.2, -1.1)),
            replace(velocity, y=v),
            sd.Source(
                "altitude",
                t[777::1000] + 0.0033,
                recording.reference.lla[777::1000, 2:] + 0.0,
                np.full((len(t[777::1000]), 1), 2.0),
            ),
            sd.Source(
                "zero-velocity", still, np.zeros((len(still), 3)), np.full((len(still), 3), 0.05)
            ),
        ),
    )


def build_example(compiler, folder):
    """Compile the example of an export in its folder; warnings are errors."""
    sources = "main.c", "strapdown_calls.c", "strapdown.o"
    code, said = run(compiler, *STRICT, *sources, "-lm", "-o", "main", folder=folder)
    assert code == 0, said


def run(*command, folder, timeout=500):
    """(exit code, what it printed) of a command in a folder."""
    done = subprocess.run(
        list(map(str, command)), cwd=folder, capture_output=True, text=True, timeout=timeout
    )
    return done.returncode, done.stdout + done.stderr


class InC:
    """An exported filter, its functions called from Python."""

    def __init__(self, folder, compiler, size):
        code, said = run(
            compiler,
            *STRICT,
            "-shared",
            "-fPIC",
            f"-DSTRAPDOWN_KEPT={Delayed.KEPT}",
            "strapdown_calls.c",
            "strapdown_delayed.c",
            "strapdown.o",
            "-lm",
            "-o",
            "filter.so",
            folder=folder,
        )
        assert code == 0, said
        self.c = ctypes.CDLL(str(Path(folder) / "filter.so"))
        self.numbers = (ctypes.c_double * (size // 8))()

    def start(self, values):
        return self.c.strapdown_start(self.numbers, _doubles(values))

    def source(self, source, parameters, gate):
        given = None if parameters is None else _doubles(parameters)
        return self.c.strapdown_source(self.numbers, source, given, ctypes.c_double(gate))

    def fix(self, source, t, y, deviations):
        return self.c.strapdown_fix(
            self.numbers, source, ctypes.c_double(t), _doubles(y), _doubles(deviations)
        )

    def sample(self, t, dt, dtheta, dv):
        real = ctypes.c_double
        return self.c.strapdown_sample(
            self.numbers, real(t), real(dt), _doubles(dtheta), _doubles(dv)
        )

    def saved(self):
        """What strapdown_save makes of it, as bytes."""
        made = ctypes.create_string_buffer(16 + len(bytes(self.numbers)))
        self.c.strapdown_save(made, self.numbers)
        return made.raw

    def restore(self, saved):
        return self.c.strapdown_restore(
            self.numbers, ctypes.create_string_buffer(saved, len(saved))
        )

    def read(self, place):
        """The numbers of a place of its layout, or the rows of a table."""
        if place.row is not None:
            there = np.frombuffer(self.numbers, np.int64)[place.first :][: place.length]
            return there.copy().view(dtype_of(place.row))
        whole = np.frombuffer(self.numbers, float if place.real else np.int64)
        return whole[place.first : place.first + place.length].reshape(place.shape).copy()


class Delayed:
    """An exported filter that takes late fixes, from an InC that has begun."""

    KEPT = 200
    """STRAPDOWN_KEPT."""

    def __init__(self, begun):
        words = len(begun.numbers)
        self.c, self.begun = begun.c, begun
        self.numbers = (ctypes.c_double * (2 * words + 8 * self.KEPT + 2))()
        self.newest = slice(words, 2 * words)
        self.c.strapdown_delay(self.numbers, begun.numbers)

    def sample(self, t, dt, dtheta, dv):
        real = ctypes.c_double
        return self.c.strapdown_delayed_sample(
            self.numbers, real(t), real(dt), _doubles(dtheta), _doubles(dv)
        )

    def fix(self, source, t, y, deviations):
        return self.c.strapdown_delayed_fix(
            self.numbers, source, ctypes.c_double(t), _doubles(y), _doubles(deviations)
        )

    def read(self, place):
        """The numbers of a place of the newest state."""
        self.c.strapdown_delayed_catch_up(self.numbers)
        whole = np.frombuffer(self.numbers, float)[self.newest]
        self.begun.numbers = type(self.begun.numbers)(*whole)
        return self.begun.read(place)


def _doubles(values):
    return (ctypes.c_double * len(values))(*map(float, values))
