"""`strapdown fuse --smooth` as a user meets it."""
import json
from pathlib import Path

import pytest

import strapdown as sd
from strapdown.io.solution import read_solution

pytestmark = pytest.mark.short
WRITTEN = {"solution.nc", "solution.csv", "report.html"}


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """Path of 6 s in a turning hand at 50 Hz."""
    path = tmp_path_factory.mktemp("hand") / "hand.nc"
    sd.write_recording(sd.simulate("hand-held", duration=6.0, rate=50.0, seed=2), path)
    return path


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    """Each test works in an empty folder."""
    monkeypatch.chdir(tmp_path)


def test_it_writes_the_same_files_beside_the_filters(command, turning):
    angles = []
    for more, folder in (((), "hand-held-attitude-mekf"), (("--smooth",), "hand-held-attitude-mekf-smooth")):
        code, out, err = command("fuse", turning, "--filter", "attitude-mekf", *more)
        assert (code, err) == (0, []), (out, err)
        assert {path.name for path in Path(folder).iterdir()} == WRITTEN and f"wrote {folder}/" in out
        row, = [line for line in out.splitlines() if line.startswith("attitude-mekf")]
        assert row.startswith("attitude-mekf, smoothed ") == bool(more)
        angles.append(float(row.split()[-3]))
    assert angles[1] < angles[0]
    solution = read_solution("hand-held-attitude-mekf-smooth/solution.nc")
    assert solution.meta["smoothed"] is True and json.loads(json.dumps(solution.meta))
    assert "attitude-mekf, smoothed" in Path("hand-held-attitude-mekf-smooth/report.html").read_text(encoding="utf-8")
    filtered = read_solution("hand-held-attitude-mekf/solution.nc")
    assert (solution.trajectory.sd[:, 8] <= filtered.trajectory.sd[:, 8] * (1 + 1e-9)).all()


def test_options_reach_the_smoother(command, turning):
    code, out, err = command("fuse", turning, "--filter", "attitude-mekf", "--smooth", "--every", 10, "--from", 1, "--to", 4, "--option", "low_pass=1", "--out", "x/y")
    assert (code, err) == (0, []) and "wrote x/y/" in out
    solution = read_solution("x/y/solution.nc")
    assert len(solution.t) == 15 and solution.t[-1] == pytest.approx(4.0, abs=0.03)


def test_a_known_heading_needs_no_position(command, turning):
    code, out, err = command("fuse", turning, "--filter", "attitude-mekf", "--smooth", "--heading", 70, "--out", "known")
    assert (code, err) == (0, []) and "heading given" in out


def test_refused_in_one_line(command, turning):
    for name in ("mahony", "closed-loop", "vru"):
        code, out, err = command("fuse", turning, "--filter", name, "--smooth")
        assert code == 2 and len(err) == 1, (out, err)
        assert err[0].startswith(f"strapdown: {name} cannot be smoothed; these can: attitude-mekf")
    assert "did you mean 'attitude-mekf'" in command("fuse", turning, "--filter", "attitude-mkf", "--smooth")[2][0]
    assert not list(Path().iterdir())


@pytest.mark.parametrize("moment", ("forwards", "backwards"))
def test_ctrl_c_leaves_nothing_half_written(command, turning, monkeypatch, moment):
    def interrupt(*_):
        raise KeyboardInterrupt
    monkeypatch.setattr("strapdown.smoothing._stand" if moment == "forwards" else "strapdown.smoothing._restore", interrupt)
    code, _, err = command("fuse", turning, "--filter", "attitude-mekf", "--smooth", "--out", "result/deep")
    assert code == 130 and len(err) == 1 and err[0].startswith("strapdown: interrupted")
    assert not list(Path().iterdir())
