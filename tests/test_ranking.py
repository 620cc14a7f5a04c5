"""The scoring of the ranking on errors that are known, and runs of packages that fail."""

import os
import sys
import time
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import gtsam_stress
import px4_replays
import ranking
import ranking_page
import ranking_scores as scores
from adapters import Estimate, earth_frame, instants

N, STEP = 1000, 0.1


def standing():
    """A fix each second, but for the outage."""
    t = STEP * np.arange(N)
    fixes = np.array([k for k in range(10, N, 10) if not 400 < k <= 550])
    return SimpleNamespace(t=t, dt=STEP, fix_t=t[fixes], fix=np.zeros((len(fixes), 3)))


def trial(attitude=True):
    """A reference that stands still for 100 s, with one outage."""
    t = STEP * np.arange(N)
    truth = sd.Trajectory(
        t, np.tile([0.8, 0.1, 100.0], (N, 1)), np.zeros((N, 3)), np.tile([1.0, 0, 0, 0], (N, 1))
    )
    return SimpleNamespace(
        reference=truth,
        workload=standing(),
        outages=[(40.0, 55.0)],
        attitude=attitude,
        scored=(0.0, 99.0),
    )


def estimate(ned=(3.0, 0.0, 4.0), turned=(0.0, 0.0, 2.0), std=1.0):
    """A constant error of the standing reference: m, deg."""
    t = STEP * np.arange(N)
    return Estimate(
        t,
        displace_lla(np.tile([0.8, 0.1, 100.0], (N, 1)), np.tile(ned, (N, 1))),
        np.full((N, 3), 0.1),
        np.tile(Rotation.from_rotvec(turned, degrees=True).as_matrix(), (N, 1, 1)),
        np.full((N, 9), std),
    )


@pytest.mark.short
def test_scores_of_constant_errors():
    found = scores.scored(trial(), estimate(std=2.5))
    clear, outage = (found[question] for question in scores.QUESTIONS)
    assert len(outage["position"]["square"]) == 1 and len(clear["position"]["square"]) == 8
    assert outage["position"]["square"] == pytest.approx([25.0], rel=1e-3)
    assert outage["position"]["scaled"] == pytest.approx([25 / (3 * 2.5**2)], rel=1e-3)
    assert clear["position"]["inside 1"] == pytest.approx([1 / 3] * 8)
    assert clear["position"]["inside 3"] == pytest.approx([1.0] * 8)
    assert scores.size(outage["attitude"]["square"]) == pytest.approx(2.0, rel=1e-6)
    assert "attitude" not in scores.scored(trial(False), estimate())["in outages"]


@pytest.mark.short
def test_an_honest_claim_has_no_dishonesty_and_both_ways_count_alike():
    assert scores.dishonesty([0.5, 1.5]) == 0
    assert scores.dishonesty([2.0]) == pytest.approx(scores.dishonesty([0.5]))


@pytest.mark.short
def test_equal_errors_are_level_and_doubled_ones_are_not():
    rng = np.random.default_rng(3)
    a = rng.chisquare(3, 40)
    assert scores.level(a, a * rng.uniform(0.8, 1.25, 40), scores.size)
    assert not scores.level(a, 4 * a, scores.size)
    assert scores.level([1.0, 1.0], [1.0, 1.05], scores.size)  # few blocks: by closeness
    assert not scores.level([1.0, 1.0], [1.0, 2.0], scores.size)


@pytest.mark.short
@pytest.mark.parametrize("blocks", [4, 9])
def test_equal_packages_are_told_apart_in_few_cells(blocks):
    """In 5 % of cells, by a fixed draw of 400."""
    rng = np.random.default_rng(blocks)
    common = rng.chisquare(3, (400, 1, blocks))
    pairs = common * np.exp(0.3 * rng.standard_normal((400, 2, blocks)))
    apart = [not scores.level(a, b, scores.size) for a, b in pairs]
    assert 0.02 < np.mean(apart) < 0.08


@pytest.mark.short
def test_of_two_filters_of_one_package_each_competes():
    found = results()
    worse = scores.scored(trial(), estimate(ned=(30.0, 0.0, 40.0)))
    found["thor75"]["strapdown iekf"] = {"us": 2.0, "scores": worse}
    told, _, _, _, *rows = ranking_page.behind(found, smoothers=False).splitlines()
    assert "closed-loop in 0, strapdown iekf in" in told and "all of them in 0." in told
    assert rows and all(r.split("|")[6].strip().endswith("\\*") for r in rows)
    assert ranking_page.summary(found, False).count("2 of 2 |") == 2  # both faster than GNSS_IMU


@pytest.mark.short
def test_with_fixes_a_reference_that_is_the_fixes_scores_no_position():
    found = {"drive0708": results()["thor75"]}
    cells = ranking_page.cells(found, ["strapdown closed-loop", "GNSS_IMU"])
    questions = {question for _, question, error, _ in cells if error == "position"}
    assert questions == {"in outages"}


def test_a_system_that_fails_is_a_line_and_the_rest_goes_on():
    case = namedtuple("Case", ("workload", "outages"))(workload(), [(1.0, 2.0)])
    run = lambda function, **more: ranking.apart(case, ranking.System("it", function, "it"), **more)

    def absent(*_):
        raise ImportError("no such package")

    assert run(absent) == {"stopped": "ImportError: no such package"}
    assert run(lambda *_: os._exit(7)) == {"stopped": "the process ended with 7"}
    assert run(lambda *_: time.sleep(30), limit=0.2) == {"stopped": "still running after 0.2 s"}


def workload():
    """Three fixes, of which one lies in the outage."""
    fields = {"fix_t": np.array([0.5, 1.5, 2.5]), "fix": np.zeros((3, 3))}
    return namedtuple("Short", fields)(**fields)


def results():
    """Two cases: one package half as accurate as strapdown, one that stopped."""
    own = scores.scored(trial(), estimate())
    other = scores.scored(trial(), estimate(ned=(6.0, 0.0, 8.0), turned=(0.0, 0.0, 2.0)))
    own, other = {"us": 1.0, "scores": own}, {"us": 100.0, "scores": other}
    run = {"strapdown closed-loop": own, "strapdown iekf": own, "GNSS_IMU": other}
    return {"thor75": run | {"sidereon EKF": {"stopped": "panic"}}, "car, tactical": run}


@pytest.mark.short
def test_the_tables_say_who_is_first_and_who_stopped():
    found = results()
    table = ranking_page.summary(found, smoothers=False)
    own, _, peer = (line for line in table.splitlines()[2:])
    assert own.startswith("| strapdown closed-loop | 12 of 12 | 1.00 |") and "2 of 2 | 1 |" in own
    assert peer.startswith("| GNSS_IMU | 8 of 12 |") and "0 of 2 | 100 |" in peer
    assert "stopped: panic" in ranking_page.recorded(found)
    behind = ranking_page.behind(found, smoothers=False)
    assert "strapdown closed-loop in 0, strapdown iekf in 0, all of them in 0." in behind
    assert behind.count("\n") == 4
    assert "| car, tactical | 5 | 5 | – |" in ranking_page.flown(found)


@pytest.mark.short
def test_the_start_in_ecef_comes_back():
    start = (np.array([0.8, -2.0, 300.0]), np.array([1.0, 2.0, 3.0]), np.array([0.1, -0.2, 2.0]))
    workload = SimpleNamespace(start=start, std=np.arange(15.0))
    r, v, C = earth_frame.start(workload)
    blocks = np.array([[np.eye(3), 4 * np.eye(3), earth_frame.attitude_covariance(workload)]])
    lla, ned, back, std = earth_frame.estimate(r[None], v[None], C[None], blocks)
    assert lla[0] == pytest.approx(start[0], abs=1e-9) and ned[0] == pytest.approx(start[1])
    assert Rotation.from_matrix(back[0]).as_euler("ZYX")[::-1] == pytest.approx(start[2])
    assert std[0] == pytest.approx([1, 1, 1, 2, 2, 2, 6, 7, 8])


@pytest.mark.short
def test_the_inverse_jacobian_is_that_of_the_logarithm():
    r, small = np.array([0.3, -0.5, 0.9]), 1e-6
    found = gtsam_stress.inverse_jacobian(r)
    for i in range(3):
        beyond = Rotation.from_rotvec(small * np.eye(3)[i]) * Rotation.from_rotvec(r)
        assert (beyond.as_rotvec() - r) / small == pytest.approx(found[:, i], abs=1e-5)
    assert gtsam_stress.inverse_jacobian(np.zeros(3)) == pytest.approx(np.eye(3))


def test_the_stress_test_of_an_hour_of_noise_is_near_nine():
    """60 runs of the first experiment: the mean of NEES is within 9 +- 1.9 in 999 of 1000 cases."""
    experiment = gtsam_stress.isotropic(gtsam_stress.EXPERIMENTS[0])._replace(runs=60)
    assert gtsam_stress.ours(experiment).mean(axis=0) == pytest.approx([9.0, 9.0], abs=1.9)


@pytest.mark.short
def test_a_replay_is_read_by_sensor(tmp_path):
    path = tmp_path / "replay.csv"
    lines = [f"{4000 * k},imu,0.0,0.0,-9.8,0.0,0.0,0.0" for k in range(1, 500)]
    lines += [f"{4000 * k},mag,0.2,0.0,{0.42 + k // 100 / 1000}" for k in range(1, 500)]
    lines += [f"{200000 * k},gps,488103.0,85456073.0,473977508.0,0.1,0.2,0.3" for k in (1, 2, 3)]
    path.write_text("\n".join(lines) + "\n")
    found = px4_replays.recording(px4_replays.samples(path))
    position, velocity, field = found.sources
    assert np.rad2deg(position.y[0, :2]) == pytest.approx([47.3977508, 8.5456073])
    assert position.y[0, 2] == pytest.approx(488.103) and velocity.y[0] == pytest.approx(
        [0.1, 0.2, 0.3]
    )
    assert len(field.t) == 5  # repeated readings count once


@pytest.mark.short
def test_states_stand_at_fixes_and_evenly_in_gaps():
    assert instants(standing()) == [*range(10, N, 10), N - 1]
