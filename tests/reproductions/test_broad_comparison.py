"""The BROAD comparison: scoring against scipy, what is left out of it, tables and claims, and
the peers' own figures."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Trajectory
from strapdown_reproductions.broad import figures, main, peers

N = 400
T = np.arange(N) * 0.01


def path_of(rotation, t=T):
    """A Trajectory of attitude alone."""
    return Trajectory(t, np.full((len(t), 3), np.nan), q_nb=rotation.as_quat()[:, [3, 0, 1, 2]])


def recording(truth, known=slice(None), movement=((1.0, 2.0),)):
    """A Recording whose reference has the rows `known` of a Rotation."""
    path = path_of(truth)
    reference = Trajectory(path.t[known], path.lla[known], q_nb=path.q_nb[known])
    return Recording(
        Imu(T, np.full(N, 0.01), np.zeros((N, 3)), np.zeros((N, 3))),
        (),
        reference,
        {"movement": [list(w) for w in movement]},
    )


def trial(truth, number="02", **more):
    made = recording(truth, **more)
    return main.BroadTrial(
        f"{number}_made", made, {}, 100.0, main.moving_samples(made) & np.isin(T, made.reference.t)
    )


def random(seed=1, n=N):
    return Rotation.random(n, rng=np.random.default_rng(seed))


@pytest.mark.short
def test_angles_against_scipy():
    """The orientation error is scipy's magnitude, inclination the angle between the vertical
    axes seen from the body, heading the rest."""
    truth, estimate = random(1), random(2)
    total, inclination, heading = main.angles(path_of(estimate), recording(truth)).T
    np.testing.assert_allclose(total, (truth * estimate.inv()).magnitude(), atol=1e-7)
    down = [each.inv().apply([0, 0, 1.0]) for each in (truth, estimate)]
    np.testing.assert_allclose(np.cos(inclination), np.einsum("ij,ij->i", *down), atol=1e-7)
    np.testing.assert_allclose(
        np.cos(total / 2), np.cos(inclination / 2) * np.cos(heading / 2), atol=1e-7
    )


@pytest.mark.short
def test_angles_do_not_depend_on_the_axes_of_the_sensor_or_of_the_ground():
    """Other body axes change nothing; other axes of the ground with the same vertical (ENU for
    NED) neither."""
    truth, estimate = random(3), random(4)
    expected = main.angles(path_of(estimate), recording(truth))
    body, ground = (
        Rotation.from_rotvec([0.3, -1.0, 2.0]),
        Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) * Rotation.from_euler("z", 0.4),
    )
    for left, right in ((Rotation.identity(), body), (ground, Rotation.identity()), (ground, body)):
        np.testing.assert_allclose(
            main.angles(path_of(left * estimate * right), recording(left * truth * right)),
            expected,
            atol=1e-7,
        )


@pytest.mark.short
@pytest.mark.parametrize(
    "axis, angles", [("z", (0.3, 0.0, 0.3)), ("x", (0.3, 0.3, 0.0)), ("y", (0.3, 0.3, 0.0))]
)
def test_a_turn_about_one_axis_of_the_ground(axis, angles):
    truth = random(5)
    np.testing.assert_allclose(
        main.angles(path_of(Rotation.from_euler(axis, -0.3) * truth), recording(truth)),
        np.tile(angles, (N, 1)),
        atol=1e-7,
    )


@pytest.mark.short
def test_the_sign_of_a_quaternion_does_not_matter():
    truth = random(6)
    path = path_of(truth)
    assert np.nanmax(main.angles(Trajectory(T, path.lla, q_nb=-path.q_nb), recording(truth))) < 1e-7


@pytest.mark.short
def test_only_movement_with_a_reference_counts():
    """An estimate that is wrong outside counts nothing; rows without reference are not
    interpolated, nor are they scored."""
    truth = random(7)
    known = np.ones(N, bool)
    known[120:150] = False
    made = trial(truth, known=known, movement=((1.0, 1.49), (3.0, 3.0)))
    assert np.array_equal(np.flatnonzero(made.scored), np.r_[100:120, 300])
    off = np.where(made.scored, 0.1, 1.5)
    run = main.TrialRun(
        "x",
        made.name,
        main.angles(path_of(Rotation.from_euler("z", off[:, None]) * truth), made.recording),
        1.0,
    )
    assert np.isnan(run.angles[120:150]).all() and np.isfinite(run.angles[known]).all()
    np.testing.assert_allclose(main.rms(run, made), [0.1, 0, 0.1], atol=1e-7)


@pytest.mark.short
def test_a_missing_estimate_is_not_a_good_one():
    truth = random(8)
    made = trial(truth)
    path = path_of(truth)
    q = path.q_nb.copy()
    q[150] = np.nan
    for late in (
        Trajectory(T, path.lla, q_nb=q),
        Trajectory(T[101:], path.lla[101:], q_nb=path.q_nb[101:]),
    ):
        assert np.isnan(
            main.rms(main.TrialRun("x", made.name, main.angles(late, made.recording), 1.0), made)
        ).all()
    early = Trajectory(T[100:], path.lla[100:], q_nb=path.q_nb[100:])
    assert (
        main.rms(main.TrialRun("x", made.name, main.angles(early, made.recording), 1.0), made)
        < 1e-7
    ).all()


def five(errors, us=1.0):
    """(trials, runs) of {estimator: five turns about the vertical in deg}."""
    truth = random(9)
    trials = [trial(truth, number) for number in ("02", "15", "21", "24", "33")]
    runs = [
        main.TrialRun(
            name,
            made.name,
            main.angles(
                path_of(Rotation.from_euler("z", -value, degrees=True) * truth), made.recording
            ),
            us,
        )
        for name, values in errors.items()
        for made, value in zip(trials, values)
    ]
    return trials, runs


@pytest.mark.short
def test_tables_and_claims():
    trials, runs = five({"attitude-mekf": (1, 2, 3, 2.6, 4), "vqf": (1, 1, 1, 1, 2)})
    tables = main.tables(trials, runs)
    (caption, orientation), heading = tables["orientation"], tables["heading"][1]
    assert list(orientation.columns) == [
        "estimator",
        "02*, deg",
        "15, deg",
        "21*, deg",
        "24*, deg",
        "33, deg",
        "mean, deg",
        "mean of the others, deg",
        "time, us per sample",
    ]
    np.testing.assert_allclose(
        orientation.iloc[0, 1:].astype(float), [1, 2, 3, 2.6, 4, 2.52, 3.0, 1.0], atol=1e-5
    )
    np.testing.assert_allclose(
        heading.iloc[1, 1:].astype(float), [1, 1, 1, 1, 2, 1.2, 1.5], atol=1e-5
    )
    assert "chosen on" in caption and (
        tables["inclination"][1].iloc[:, 1:].astype(float) < 1e-4
    ).all(axis=None)
    claims = main.judge_orientation(orientation, trials)
    assert [(c["holds"], c["bound"]) for c in claims] == [(True, 2.6), (False, 2.5), (True, 5.0)]
    # one trial decides nothing of the mean
    assert [c["bound"] for c in main.judge_orientation(orientation, trials[3:4])] == [2.5]


@pytest.mark.short
def test_what_cannot_be_scored_fails_its_claim():
    trials, runs = five({"attitude-mekf": (1, 1, 1, 1, 1)})
    runs[1] = runs[1]._replace(angles=np.full((N, 3), np.nan))
    claims = main.judge_orientation(main.tables(trials, runs)["orientation"][1], trials)
    assert not claims[0]["holds"] and claims[1]["holds"]


@pytest.mark.short
def test_every_claim_is_about_an_estimator_there_is():
    assert {name.partition(",")[0] for name, _, _ in main.CLAIMS} <= set(main.estimators())
    assert "closed-loop" not in main.estimators() and "open-loop" not in main.estimators()


@pytest.mark.short
def test_markdown_of_the_tables(goes_into_its_page):
    trials, runs = five({"attitude-mekf": (1, 2, 3, 2.6, 4)})
    text = main.in_docs(main.tables(trials, runs))
    assert text.count("| attitude-mekf |") == 3 and r"02\*, deg" in text and "| 2.52 |" in text
    goes_into_its_page("broad", text)


@pytest.mark.short
def test_seconds_of_a_curve():
    t, angle = (
        np.arange(250) / 100,
        np.r_[np.full(100, 3.0), np.full(100, np.nan), np.full(50, 4.0)],
    )
    angle[:50] = np.nan
    middle, error = figures.per_second(t, angle)
    np.testing.assert_allclose(middle, [0.5, 1.5, 2.5])
    np.testing.assert_allclose(error, [3.0, np.nan, 4.0])


@pytest.mark.short
def test_figures_say_what_they_show():
    trials, runs = five(
        {
            "attitude-mekf": (1, 2, 3, 2.6, 4),
            "vqf": (1, 1, 1, 1, 2),
            "ahrs Mahony": (30, 1, 1, 1, 90),
        }
    )
    drawn = figures.figures(trials, runs)
    assert len(drawn) == 6
    for _, figure, caption in drawn:
        axes = [
            axis for name, axis in figure.to_dict()["layout"].items() if name.startswith("xaxis")
        ]
        assert caption and all("[" in axis["title"]["text"] for axis in axes)
    last = drawn[-1][1]
    # before and after the movement
    assert [shape["x1"] for shape in last.to_dict()["layout"]["shapes"]] == pytest.approx(
        [1.0, 3.99]
    )
    assert [trace.visible for trace in last.data] == [True, True, "legendonly"]
    assert len({(trace.line.color, trace.line.dash) for trace in last.data}) == 3


@pytest.mark.short
def test_products_of_quaternions_against_scipy():
    a, b = random(10), random(11)
    quaternion = lambda r: r.as_quat()[..., [3, 0, 1, 2]]
    made = peers.product(quaternion(a), quaternion(b)) * np.sign(
        quaternion(a * b)[:, :1] * peers.product(quaternion(a), quaternion(b))[:, :1]
    )
    np.testing.assert_allclose(made, quaternion(a * b), atol=1e-12)
    for frame, north in ((peers.NWU, [1.0, 0, 0]), (peers.NED, [1.0, 0, 0])):
        # north is the second axis of ENU
        np.testing.assert_allclose(
            Rotation.from_quat(np.roll(frame, -1)).apply(north), [0, 1, 0], atol=1e-12
        )


@pytest.mark.short
def test_a_peer_that_is_not_installed_is_said(monkeypatch):
    trials, runs = five({"attitude-mekf": (1, 2, 3, 2.6, 4)})
    monkeypatch.setattr(main, "installed_version", lambda package: None)
    assert (
        list(
            main.peer_runs(
                trials[0]._replace(
                    arrays={name: np.zeros((N, 3)) for name in ("gyr", "acc", "mag")}
                ),
                False,
            )
        )
        == []
    )
    notes = dict(main._notes(False, main.tables(trials, runs)))["Estimators"]
    assert (notes["package"] == "vqf: not installed").sum() == 2 and (
        notes["package"] == "ahrs: not installed"
    ).sum() == 4


@pytest.mark.short
def test_a_folder_without_trials_is_refused(tmp_path):
    with pytest.raises(DataError, match="no BROAD trials"):
        main.reproduce(tmp_path / "out", recordings=tmp_path)
    assert not (tmp_path / "out").exists()


@pytest.mark.short
def test_a_trial_that_cannot_be_scored_is_refused(tmp_path):
    n = 1000
    arrays = {
        "fs": 100.0,
        "gyr": np.zeros((n, 3)),
        "acc": np.tile([0, 0, 9.81], (n, 1)),
        "mag": np.tile([0, 18.0, -45], (n, 1)),
        "quat_wxyz_enu": np.tile([1.0, 0, 0, 0], (n, 1)),
        "pos_enu": np.zeros((n, 3)),
        "movement": np.zeros(n, bool),
    }
    np.savez(tmp_path / "99_still.npz", **arrays)
    with pytest.raises(DataError, match="99_still.npz: no sample has both"):
        main.load(tmp_path / "99_still.npz")
    np.savez(
        tmp_path / "99_still.npz",
        **arrays | {"movement": np.ones(n, bool), "quat_wxyz_enu": np.full((n, 4), np.nan)},
    )
    with pytest.raises(DataError, match="99_still.npz: no sample has both"):
        main.load(tmp_path / "99_still.npz")
    half = np.where(np.arange(n)[:, None] < 600, [1.0, 0, 0, 0], np.nan)
    np.savez(
        tmp_path / "99_still.npz",
        **arrays | {"movement": np.arange(n) >= 500, "quat_wxyz_enu": half},
    )
    made = main.load(tmp_path / "99_still.npz")
    assert (
        np.array_equal(np.flatnonzero(made.scored), np.arange(500, 600))
        and made.number == "99"
        and made.fs == 100.0
    )


def number(data_folder, which):
    (path,) = (data_folder / "broad").glob(f"{which}_*.npz")
    return main.load(path)


@pytest.mark.parametrize("which, k", [("02", 0), ("24", 3)])
def test_a_peer_has_its_known_error(data_folder, which, k):
    """vqf with default settings, within 2 % of the figure known for it: the scoring is the same."""
    pytest.importorskip("vqf")
    made = number(data_folder, which)
    runs = {run.estimator: run for run in main.peer_runs(made, quick=True)}
    assert set(runs) == {"vqf", "vqf, offline"}
    assert np.degrees(main.rms(runs["vqf"], made)[0]) == pytest.approx(
        peers.PEERS[0].known[k], rel=0.02
    )


def test_reproduction_writes_its_page(data_folder, tmp_path):
    (tmp_path / "trials").mkdir()
    (path,) = (data_folder / "broad").glob("24_*.npz")
    (tmp_path / "trials" / path.name).symlink_to(path)
    claims = main.reproduce(tmp_path / "out", quick=True, recordings=tmp_path / "trials")
    assert sorted(each.name for each in (tmp_path / "out").iterdir()) == [
        "claims.json",
        "heading.csv",
        "inclination.csv",
        "index.html",
        "orientation.csv",
        "over-std.csv",
        "table.md",
    ]
    over = pd.read_csv(tmp_path / "out" / "over-std.csv").set_index("estimator")["24"]
    assert all(
        0.1 < float(value) < 2
        for name in ("attitude-mekf", "mahony")
        for value in over[name].split()
    )
    assert json.loads((tmp_path / "out" / "claims.json").read_text()) == claims
    table = pd.read_csv(tmp_path / "out" / "orientation.csv")
    assert (
        set(main.estimators()) <= set(table["estimator"])
        and (table["time, us per sample"] > 0).all()
    )
