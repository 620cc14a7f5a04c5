"""`strapdown fuse --smooth` as a user meets it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from recordings import flight

import strapdown as sd
from strapdown.engine import smoothing
from strapdown.io.solution import read_solution

pytestmark = pytest.mark.short
WRITTEN = {"solution.nc", "solution.csv", "report.html"}


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """Path of 6 s in a turning hand at 50 Hz."""
    path = tmp_path_factory.mktemp("hand") / "hand.nc"
    sd.write_recording(sd.simulate("hand-held", duration=6.0, rate=50.0, seed=2), path)
    return path


@pytest.fixture(scope="module")
def outage(tmp_path_factory):
    """Path of 20 s of flight at 20 Hz whose fixes end at 12 s."""
    path, whole = tmp_path_factory.mktemp("flight") / "outage.nc", flight()
    kept = [a.t < 12 for a in whole.sources]
    fixes = tuple(
        replace(a, t=a.t[keep], y=a.y[keep], std=a.std[keep])
        for a, keep in zip(whole.sources, kept)
    )
    sd.write_recording(replace(whole, sources=fixes), path)
    return path


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    """Each test works in an empty folder."""
    monkeypatch.chdir(tmp_path)


def test_it_writes_the_same_files_beside_the_filters(command, turning):
    angles = []
    for more, folder in (
        ((), "hand-held-attitude-mekf"),
        (("--smooth",), "hand-held-attitude-mekf-smooth"),
    ):
        code, out, err = command("fuse", turning, "--filter", "attitude-mekf", *more)
        assert (code, err) == (0, []), (out, err)
        assert {
            path.name for path in Path(folder).iterdir()
        } == WRITTEN and f"wrote {folder}/" in out
        (row,) = [line for line in out.splitlines() if line.startswith("attitude-mekf")]
        assert row.startswith("attitude-mekf, smoothed ") == bool(more)
        angles.append(float(row.split()[-3]))
    assert angles[1] < 1.02 * angles[0]
    solution = read_solution("hand-held-attitude-mekf-smooth/solution.nc")
    assert solution.meta["smoothed"] is True and json.loads(json.dumps(solution.meta))
    assert "attitude-mekf, smoothed" in Path(
        "hand-held-attitude-mekf-smooth/report.html"
    ).read_text(encoding="utf-8")
    filtered = read_solution("hand-held-attitude-mekf/solution.nc")
    assert (solution.trajectory.std[:, 8] <= filtered.trajectory.std[:, 8] * (1 + 1e-9)).all()


def test_options_reach_the_smoother(command, turning):
    code, out, err = command(
        "fuse",
        turning,
        "--filter",
        "attitude-mekf",
        "--smooth",
        "--every",
        10,
        "--from",
        1,
        "--to",
        4,
        "--option",
        "low_pass=1",
        "--out",
        "x/y",
    )
    assert (code, err) == (0, []) and "wrote x/y/" in out
    solution = read_solution("x/y/solution.nc")
    assert len(solution.t) == 15 and solution.t[-1] == pytest.approx(4.0, abs=0.03)


def test_a_known_heading_needs_no_position(command, turning):
    code, out, err = command(
        "fuse", turning, "--filter", "attitude-mekf", "--smooth", "--heading", 70, "--out", "known"
    )
    assert (code, err) == (0, []) and "heading given" in out


def test_refused_in_one_line(command, turning):
    for name in ("mahony", "vru"):
        code, out, err = command("fuse", turning, "--filter", name, "--smooth")
        assert code == 2 and len(err) == 1, (out, err)
        assert err[0].startswith(f"strapdown: {name} cannot be smoothed; these can: attitude-mekf")
    assert (
        "did you mean 'attitude-mekf'"
        in command("fuse", turning, "--filter", "attitude-mkf", "--smooth")[2][0]
    )
    assert not list(Path().iterdir())


def test_a_recording_that_ends_in_an_outage(command, outage):
    """With the default filter: after the last fix both are dead reckoning, before it the
    smoother is surer."""
    for more in (("--out", "filtered"), ("--smooth", "--out", "smoothed")):
        code, out, err = command("fuse", outage, *more)
        assert (code, err) == (0, []), (out, err)
    filtered, smoothed = (
        read_solution(f"{folder}/solution.nc") for folder in ("filtered", "smoothed")
    )
    assert (
        smoothed.meta["smoothed"] is True
        and (smoothed.t == filtered.t).all()
        and smoothed.t[-1] == pytest.approx(20.0)
    )
    late = smoothed.t > 12.1
    assert smoothed.trajectory.std[late] == pytest.approx(filtered.trajectory.std[late], rel=1e-6)
    assert (
        smoothed.trajectory.std[~late, 8] <= filtered.trajectory.std[~late, 8] * (1 + 1e-9)
    ).all()
    assert smoothed.trajectory.std[0, 3] < 0.8 * filtered.trajectory.std[0, 3]


@pytest.mark.parametrize("name", ("attitude-mekf", "closed-loop"))
@pytest.mark.parametrize("moment", ("forwards", "backwards", "in the middle of the way back"))
def test_ctrl_c_leaves_nothing_half_written(command, turning, outage, monkeypatch, moment, name):
    """Whatever was in the folder before stays as it was."""
    calls = []
    whole = smoothing._restore

    def interrupt(*given):
        calls.append(given)
        if moment != "in the middle of the way back" or len(calls) == 3:
            raise KeyboardInterrupt
        whole(*given)

    monkeypatch.setattr(smoothing, "RECORDED_ROWS", 50)
    monkeypatch.setattr(smoothing, "_stand" if moment == "forwards" else "_restore", interrupt)
    Path("result/deep").mkdir(parents=True)
    Path("result/deep/solution.csv").write_text("of an earlier run")
    code, _, err = command(
        "fuse",
        turning if name == "attitude-mekf" else outage,
        "--filter",
        name,
        "--smooth",
        "--out",
        "result/deep",
    )
    assert (
        code == 130
        and len(err) == 1
        and err[0].startswith("strapdown: interrupted")
        and len(calls) in (1, 3)
    )
    assert [path.read_text() for path in Path().rglob("*") if path.is_file()] == [
        "of an earlier run"
    ]


@pytest.mark.parametrize("name", ("attitude-mekf", "closed-loop"))
def test_ctrl_c_makes_no_folder(command, turning, outage, monkeypatch, name):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(smoothing, "_restore", interrupt)
    assert (
        command(
            "fuse",
            turning if name == "attitude-mekf" else outage,
            "--filter",
            name,
            "--smooth",
            "--out",
            "result/deep",
        )[0]
        == 130
    )
    assert not list(Path().iterdir())
