"""The filters of Alam et al. as printed, step by step against their equations in plain numpy: five
minutes at rest and in motion, with an outage of half a minute."""

from functools import cache

import numpy as np
import pytest
from exogenous_twin import ExogenousTwin, Motion as At
from plain_ins import increments, way_between
from recordings import start
from scipy.spatial.transform import Rotation
from two_stage_twin import State, Twin

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.compile.jit import COMPILED
from strapdown.core.loop.contract import Noise, compile_kernel
from strapdown.core.mathematics.source import new_source
from strapdown.filters.observer import xkf
from strapdown.filters.observer.equations import embedded_observer
from strapdown.filters.two_stage import xkf_two_stage
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion, static
from strapdown_reproductions.alam import xkf_as_printed

NOISE = Noise(3e-4, 3e-3, 2e-5, 2e-4, 1 / 200, 1 / 100)
SECONDS, RATE = (300.0 if COMPILED else 12.0), 20.0
OUTAGE = (150.0, 180.0)
ARM = np.array([0.3, -0.2, -0.5])
PRINTED = {"level": "raw", "velocity": "down"}
OWN = {"covariance": "published"}
PLACE = (DEG * 47.0, DEG * 8.0, 500.0)


def weaving():
    """Turns to both sides at 30 m/s, which bank up to 30 deg, climbs and descents."""
    course = lambda t: DEG * (80 + 60 * np.sin(0.1 * t) + 0.5 * t)
    bank = lambda t: DEG * 30 * np.cos(0.1 * t)
    return Motion(
        "weaving",
        PLACE,
        lambda t: (30 * np.cos(course(t)), 30 * np.sin(course(t)), -2.0 * np.sin(0.05 * t)),
        lambda t: (bank(t), DEG * 4 * np.sin(0.05 * t), course(t)),
    )


@cache
def recorded(at_rest):
    """A Recording with fixes once a second but in the outage."""
    motion = static(PLACE, (DEG * 2.0, DEG * -3.0, DEG * 40.0)) if at_rest else weaving()
    gnss = Gnss(lever_arm=tuple(ARM))
    return sd.simulate(motion, SECONDS, "tactical", 7, RATE, gnss).hidden([OUTAGE])


FILTERS = {
    "xkf": (xkf.XKF, True),
    "two-stage-ekf": (filters.find("two-stage-ekf"), False),
    "xkf-two-stage": (xkf_two_stage.XKF_TWO_STAGE, True),
    "xkf-two-stage-as-printed": (xkf_as_printed.XKF_AS_PRINTED, True),
}
CASES = {
    "EKF": ("two-stage-ekf", OWN),
    "EKF, raw accelerometers": ("two-stage-ekf", {"level": "raw"} | OWN),
    "EKF, raw accelerometers, velocity down": ("two-stage-ekf", PRINTED | OWN),
    "XKF, affine": ("xkf-two-stage", {"bias_law": "norm"} | OWN),
    "XKF, affine, raw and down": ("xkf-two-stage", {"bias_law": "norm"} | PRINTED | OWN),
    "XKF, transition at the observer": ("xkf-two-stage-as-printed", {"bias_law": "norm"}),
    "XKF, transition at the observer, raw and down": (
        "xkf-two-stage-as-printed",
        {"bias_law": "norm"} | PRINTED,
    ),
}


class Flown:
    """A filter by its kernels, one sample or fix at a time, and the observer inside."""

    def __init__(self, name, recording, options):
        self.filter, self.inside = FILTERS[name]
        observers = {kind: aiding.find(kind) for kind in ("position", "velocity")}
        for needed in (self.filter.predict, self.filter.correct):
            compile_kernel(needed)
        for sensor in observers.values():
            compile_kernel(sensor.observe)
        self.observers = observers
        options, _ = self.filter.configure(options, recording.sources)
        self.belief = self.filter.start(start(recording), NOISE, **options)

    def observer(self):
        """State of the observer, or None where there is none."""
        if not self.inside:
            return None
        module = xkf_two_stage if "printed" not in self.filter.name else xkf_as_printed
        bar = embedded_observer(self.belief, module.INSIDE.start)
        return State(bar.lla, bar.v_n, angles(bar.C_nb), bar.b_a, bar.b_g)

    def predict(self, u, dt):
        self.filter.predict(self.belief, u, dt, NOISE)

    def correct(self, kind, y, deviation):
        sensor, source = self.observers[kind], new_source()
        source.parameters[:3] = ARM
        number, rest = aiding.number(sensor.name), (source, np.inf, np.zeros(12))
        self.filter.correct(self.belief, y.copy(), deviation.copy(), number, sensor.observe, *rest)


def angles(C):
    """Roll, pitch, heading of C_nb by the elements of the matrix, which is a rotation to rounding
    alone."""
    pitch = np.arcsin(-C[2, 0])
    return np.array([np.arctan2(C[2, 1], C[2, 2]), pitch, np.arctan2(C[1, 0], C[0, 0])])


def apart(belief, twin):
    """Differences: m, m/s, rad, biases and P by standard deviations."""
    P = twin.covariance()
    scale, C = np.sqrt(np.diag(P)), twin.at.C
    velocity = twin.about.C @ twin.at.v
    turned = Rotation.from_matrix(belief.C_nb @ C.T).magnitude()
    bias = np.r_[belief.b_a - twin.at.b_a, belief.b_g - twin.at.b_g] / scale[9:]
    return (
        np.abs(way_between(belief.lla, twin.at.lla)).max(),
        np.abs(belief.v_n - velocity).max(),
        turned,
        np.abs(bias).max(),
        np.abs((belief.P - P) / np.outer(scale, scale)).max(),
    )


def by_sample(recording):
    """{number of a sample: [(kind, y, standard deviations)]} of the fixes at its end."""
    fixes = {}
    for source in recording.sources:
        for t, y, deviation in zip(source.t, source.y, source.std):
            fixes.setdefault(round(float(t) * RATE), []).append((source.kind, y, deviation))
    return fixes


def differences(case, at_rest):
    """The largest of all differences, at every sample and fix."""
    name, options = CASES[case]
    recording = recorded(at_rest)
    flown = Flown(name, recording, options)
    twin = Twin(
        start(recording),
        NOISE,
        flown.observer(),
        affine="printed" not in name,
        raw=options.get("level") == "raw",
        down=options.get("velocity") == "down",
    )
    fixes, found = by_sample(recording), []
    for k, (_, dt, u) in enumerate(increments(recording.imu), 1):
        flown.predict(u, dt)
        twin.predict(u, dt, flown.observer())
        found.append(apart(flown.belief, twin))
        for kind, y, deviation in fixes.get(k, ()):
            flown.correct(kind, y, deviation)
            getattr(twin, kind)(y, deviation, ARM)
            if flown.inside:
                twin.jump(flown.observer())
            found.append(apart(flown.belief, twin))
    return np.array(found)


FULL = {
    "XKF, 15 states, affine": {"near": 0.0},
    "XKF, 15 states, Jacobian at the observer": {"near": np.inf, "jacobian": "observer"},
}


def differences_of_fifteen(options, at_rest):
    """The same of `xkf`."""
    recording = recorded(at_rest)
    flown = Flown("xkf", recording, options)
    belief = flown.belief
    state = lambda of: At(*(np.array(part) for part in of[:5]))
    observer = lambda: state(embedded_observer(belief, xkf.INSIDE.start))
    twin, found = ExogenousTwin(state(belief), belief.P, NOISE, not options["near"]), []

    def compare():
        scale = np.sqrt(np.diag(twin.P))
        e = np.abs(state(belief).minus(twin.at))
        P = np.abs((belief.P - twin.P) / np.outer(scale, scale)).max()
        biases = (e[9:] / scale[9:]).max()
        found.append((e[:3].max(), e[3:6].max(), e[6:9].max(), biases, P))

    fixes = by_sample(recording)
    for k, (_, dt, u) in enumerate(increments(recording.imu), 1):
        flown.predict(u, dt)
        twin.predict(u, dt, observer())
        compare()
        for kind, y, deviation in fixes.get(k, ()):
            flown.correct(kind, y, deviation)
            twin.correct(kind, y, deviation, ARM)
            twin.jump(observer())
            compare()
    return np.array(found)


BOUNDS = (1e-6, 3e-8, 1e-9, 1e-8, 3e-9)
"""m, m/s, rad, biases and P by standard deviations (biases 1e-10 m/s^2 and below). Latitude and
longitude in double precision round to 1e-9 m at each step, which adds up in the outage."""


@pytest.mark.parametrize("at_rest", [True, False], ids=["at-rest", "in-motion"])
@pytest.mark.parametrize("case", CASES)
def test_a_filter_is_its_printed_equations(case, at_rest):
    assert (differences(case, at_rest).max(axis=0) < BOUNDS).all()


@pytest.mark.parametrize("at_rest", [True, False], ids=["at-rest", "in-motion"])
@pytest.mark.parametrize("case", FULL)
def test_a_filter_of_fifteen_states_is_its_printed_equations(case, at_rest):
    assert (differences_of_fifteen(FULL[case], at_rest).max(axis=0) < BOUNDS).all()


def test_the_forms_of_the_xkf_are_not_one():
    """What tells them apart is a hundred thousand times what their twins differ by."""
    recording = recorded(False)
    xkf_as_printed.make_known()
    affine, printed = (
        sd.fuse(
            recording,
            name,
            start=start(recording),
            noise=NOISE,
            options={"bias_law": "norm"} | PRINTED,
        )
        for name in ("xkf-two-stage", "xkf-two-stage-as-printed")
    )
    turned = (affine.trajectory.rotation * printed.trajectory.rotation.inv()).magnitude()
    assert turned.max() > 1e-4
