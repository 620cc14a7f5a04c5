"""The observer's covariance: what its own kernels do to small errors, by running them, and what
the claimed standard deviations are worth where a course is slow, fixes are of 2 cm or missing."""

import numpy as np
import pytest
from recordings import start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.compile.jit import matrix
from strapdown.core.loop.contract import InitialState, Kind, Noise, compile_kernel
from strapdown.core.mathematics.source import new_source
from strapdown.filters.observer.covariance import AUXILIARY, FULL, XI, step
from strapdown.filters.observer.equations import (
    CONDITION,
    FADE,
    MOMENT,
    SINCE_FIELD,
    SINCE_HEADING,
    XI as VALUE,
)
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import car

NLO = filters.find("nlo")
SILENT = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FIELD = np.array([21e-6, 1e-6, 43e-6])
GIVEN = dict(kpp=0.3, kvp=0.03, kxp=0.003, kpv=0.05, kvv=0.4, kxv=0.1, adaptation=0.3, crab=0.0)
GIVEN["bias_law"] = "norm"
# of position, velocity, attitude, accelerometer and gyro bias, xi
SMALL = np.repeat([1e-3, 1e-3, 1e-5, 1e-4, 1e-6, 1e-4], 3)


def fly(belief, fixes):
    """Two seconds of a turn at 50 Hz from `belief`, with what `fixes` (kinds) measure at its end
    of each second, and at once again, exactly as the belief that is first has it: (states
    afterwards)."""
    for _ in range(2):
        for _ in range(50):
            NLO.predict(belief, np.r_[0.002, -0.001, 0.006, 0.02, -0.05, -0.196], 0.02, SILENT)
        for kind, y, parameters in fixes(belief):
            NLO.correct(
                belief,
                y,
                np.full(3, 1e-9),
                kind,
                aiding.find(NAMES[kind]).observe,
                parameters,
                np.inf,
                np.zeros(12),
            )


NAMES = {
    Kind.POSITION: "position",
    Kind.VELOCITY: "velocity",
    Kind.HEADING: "heading",
    Kind.MAGNETIC_FIELD: "magnetic-field",
}


def perturbed(error, field):
    """A belief whose errors against that without any are `error` (18,)."""
    p, v, theta, b_a, b_g, xi = error.reshape(6, 3)
    C = Rotation.from_euler("ZYX", [0.7, 0.05, 0.1])
    lla = displace_lla(np.array([0.8, 0.1, 500.0]), -p)
    rph = (Rotation.from_rotvec(-theta) * C).as_euler("ZYX")[::-1]
    belief = NLO.start(
        InitialState(
            0.0,
            tuple(lla),
            tuple(np.r_[30.0, 25.0, 0.0] - v),
            tuple(rph),
            (0.0,) * 3,
            (0.0,) * 3,
            tuple(SMALL[:15]),
        ),
        SILENT,
        field=field,
        **GIVEN,
    )
    belief.b_a[:], belief.b_g[:], belief.workspace[VALUE] = -b_a, -b_g, -xi
    belief.workspace[FADE] = 0.0
    return belief


def error_of(belief, truth):
    """Errors (18,) of a belief against another."""
    turned = Rotation.from_matrix(truth.C_nb) * Rotation.from_matrix(belief.C_nb).inv()
    return np.concatenate(
        [
            displacement(truth.lla, belief.lla),
            truth.v_n - belief.v_n,
            turned.as_rotvec(),
            truth.b_a - belief.b_a,
            truth.b_g - belief.b_g,
            truth.workspace[VALUE] - belief.workspace[VALUE],
        ]
    )


@pytest.mark.short
@pytest.mark.parametrize(
    "kinds, field, most",
    [
        ((Kind.POSITION, Kind.VELOCITY), "across", 0.03),
        ((Kind.POSITION, Kind.HEADING), "across", 0.03),
        ((Kind.POSITION, Kind.MAGNETIC_FIELD), "across", 0.15),
        ((Kind.POSITION, Kind.MAGNETIC_FIELD), "vector", 0.15),
    ],
)
def test_it_is_what_the_kernels_do_to_small_errors(kinds, field, most):
    """Without noise P is the sum of the squares of errors along its axes, each by a run of its own
    against the first, whose fixes they all see."""
    for kernel in (NLO.predict, NLO.correct, *(aiding.find(NAMES[k]).observe for k in kinds)):
        compile_kernel(kernel)
    seen = []

    def measure(belief):
        truth = {
            Kind.POSITION: belief.lla.copy(),
            Kind.VELOCITY: belief.v_n.copy(),
            Kind.HEADING: np.array([np.arctan2(belief.C_nb[1, 0], belief.C_nb[0, 0])]),
            Kind.MAGNETIC_FIELD: belief.C_nb.T @ FIELD,
        }
        lever = lambda kind: new_source(
            parameters=np.r_[FIELD * (kind == Kind.MAGNETIC_FIELD), np.zeros(3)]
        )
        seen.append([(kind, np.resize(truth[kind], 3), lever(kind)) for kind in kinds])
        return seen[-1]

    exact = perturbed(np.zeros(18), field)
    n = 15 + AUXILIARY
    full = matrix(exact.workspace, FULL, n, n)
    full[15 + XI : 18 + XI, 15 + XI : 18 + XI] = np.diag(SMALL[15:] ** 2)
    fly(exact, measure)
    step(exact)
    found = np.zeros((18, 18))
    for k in range(18):
        belief, again = perturbed(SMALL * (np.arange(18) == k), field), iter(seen)
        fly(belief, lambda _, again=again: next(again))
        found += np.outer(error_of(belief, exact), error_of(belief, exact))
    scale = np.sqrt(np.diag(found))
    difference = (full[:18, :18] - found) / np.outer(scale, scale)
    assert np.abs(difference).max() < most
    np.testing.assert_array_equal(exact.P, full[:15, :15])


def walking(seed, outage=(), std_of=0.02):
    """(recording, start) of two minutes at 1.4 m/s around corners, fixes 5 times a second."""
    legs = [{"duration": 15.0}, {"duration": 6.0, "turn": 1.5}, {"duration": 15.0}]
    legs += [{"duration": 6.0, "turn": -1.5}]
    motion = car((0.82, 0.14, 500.0), 0.5, [{"repeat": 4, "legs": legs}], speed=1.4)
    made = sd.simulate(motion, 120.0, "industrial", seed, 50.0, Gnss(0.2, std_of, std_of))
    accel, gyro = sd.imu("industrial").bias_std()
    begin = start(made)._replace(
        lla=tuple(made.reference.lla[0]),
        v_n=tuple(made.reference.v_n[0]),
        std=(*[0.05] * 3, *[0.1] * 3, 0.01, 0.01, 0.03, *[accel] * 3, *[gyro] * 3),
    )
    return made.hidden([outage]) if outage else made, begin


@pytest.mark.parametrize("name", ["nlo", "xkf", "two-stage-ekf", "xkf-two-stage"])
def test_at_walking_speed_with_fixes_of_2_cm_it_stays_on_its_way(name):
    recording, begin = walking(1007)
    solution = sd.fuse(recording, name, start=begin)
    error = sd.errors(solution, recording.reference)
    assert np.linalg.norm(error.position, axis=1).max() < 0.2
    assert (
        not solution.counts()["GNSS velocity"][1] > 5
        and not solution.columns["course_held [s]"][-1]
    )
    late = solution.t > 30
    of_std = np.abs(error.attitude[late]) / solution.trajectory.std[late, 6:9]
    assert np.mean(of_std > 3) < 0.02 and abs(error.attitude[-1, 2]) < 0.02


@pytest.mark.parametrize("name", ["nlo", "xkf", "two-stage-ekf", "xkf-two-stage"])
def test_and_its_deviation_covers_what_an_outage_leaves(name):
    recording, begin = walking(1008, (80.0, 110.0))
    solution = sd.fuse(recording, name, start=begin)
    error = sd.errors(solution, recording.reference).position
    away = (solution.t > 80.0) & (solution.t < 110.0)
    deviation = solution.trajectory.std[:, :3]
    assert (np.abs(error[away]) < 3.5 * deviation[away]).all()
    assert np.linalg.norm(error[-1]) < 0.1 < deviation[away].max()


@pytest.mark.short
def test_a_course_is_one_where_its_deviation_allows_and_what_is_held_is_said():
    for kernel in (NLO.predict, NLO.correct, aiding.find("velocity").observe):
        compile_kernel(kernel)

    def held(speed, deviation):
        belief = perturbed(np.zeros(18), "across")
        belief.v_n[:] = speed, 0, 0
        said = []
        for _ in range(12):
            belief.workspace[SINCE_HEADING] = belief.workspace[SINCE_FIELD] = 1e9
            NLO.predict(belief, np.r_[0, 0, 0, 0, 0, -9.8], 1.0, SILENT)
            NLO.correct(
                belief,
                np.r_[speed, 0, 0],
                np.full(3, deviation),
                Kind.VELOCITY,
                aiding.find("velocity").observe,
                new_source(),
                np.inf,
                np.zeros(12),
            )
            said.append(belief.workspace[CONDITION])
        return said

    assert NLO.condition == CONDITION and "too slow for a course" in NLO.conditions[0].text
    # 5 deg are 0.0873 rad
    assert held(1.4, 0.12) == [0.0] * 12 and held(0.24, 0.02) == [0.0] * 12
    assert held(1.4, 0.13) == [0.0] * 9 + [1.0] * 3 == held(0.22, 0.02)


def test_a_bias_that_was_excited_once_is_not_said_again():
    observe = aiding.find("position").observe
    for kernel in (NLO.predict, NLO.correct, observe):
        compile_kernel(kernel)
    belief, said = perturbed(np.zeros(18), "across"), []
    for excitation in (0.0, 0.1, 0.0):
        for _ in range(61):
            NLO.predict(belief, np.r_[0, 0, 0, 0, 0, -9.8], 1.0, SILENT)
        belief.workspace[MOMENT] = excitation * np.eye(4)[np.triu_indices(4)]
        fix = belief.lla.copy(), np.ones(3), Kind.POSITION, observe, new_source(), np.inf
        NLO.correct(belief, *fix, np.zeros(12))
        said.append(belief.workspace[CONDITION])
    assert said == [2.0, 0.0, 0.0] and "not excited" in NLO.conditions[1].text
