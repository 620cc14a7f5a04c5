"""strapdown export: what it refuses, without compiling anything. That it works, docs/how-to/firmware.md shows."""

import pytest

from strapdown.cli import app


@pytest.mark.parametrize(
    "more, said",
    [
        (["--target", "cortex-m8"], "did you mean 'cortex-m7'"),
        (["--filter", "pkf"], "its start computes COMPONENTS"),
        (["--sources", "positon"], "did you mean 'position'"),
        (["--filter", "fixed-gain"], "needs attitude aiding"),
        (["--option", "speed=1"], "no option 'speed'"),
        (["--replay", "none.nc"], "none.nc"),
        (["--out", "/proc/none"], "nothing can be written there"),
    ],
)
def test_what_cannot_be_exported_ends_in_one_line(more, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["strapdown", "export", "--sources", "position,velocity", "--target", "host"]
    monkeypatch.setattr("sys.argv", [*words, "--out", "out", *more])
    with pytest.raises(SystemExit) as end:
        app.main()
    error = capsys.readouterr().err
    assert end.value.code == 2 and said in error and error.count("\n") == 1, error
    assert not (tmp_path / "out").exists()
