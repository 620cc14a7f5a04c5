"""`strapdown reproduce` finds what installed packages offer, and says in one line what is missing, foreign or broken."""

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

import strapdown
from strapdown.plugins import PluginWarning


def offered(monkeypatch, *entries):
    """Let these be the installed entry points `strapdown.reproductions`."""
    monkeypatch.setattr(
        "strapdown.cli.complete.entry_points",
        lambda group: entries if group == "strapdown.reproductions" else (),
    )


def entry(name, value, version=strapdown.__version__, package="strapdown-reproductions"):
    """An entry point of an installed package."""
    made = EntryPoint(name, value, "strapdown.reproductions")
    vars(made)["dist"] = SimpleNamespace(name=package, version=version)
    return made


def study(out, runs=3, notify=None):
    """A reproduction as a package outside could bring it: writes its page and returns its claims."""
    (out / "index.html").write_text("<p>done</p>")
    notify("begun")
    return [{"claim": f"holds in {runs} runs", "verdict": "reproduced"}]


def test_a_reproduction_from_another_package_runs_with_the_options_that_it_takes(
    command, monkeypatch, tmp_path
):
    offered(monkeypatch, entry("mine", f"{__name__}:study", "7.0", "somebody-elses"))
    code, out, _ = command("reproduce", "mine", "--runs", 5, "--out", tmp_path)
    assert code == 0 and "holds in 5 runs" in out and (tmp_path / "index.html").exists()
    code, _, err = command("reproduce", "mine", "--quick", "--out", tmp_path)
    assert code == 2 and err == ["strapdown: reproduce mine has no option --quick; it takes --runs"]


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        ([], "the package strapdown-reproductions is not installed; install it"),
        ([entry("other", "x:y")], "nothing to reproduce is called 'mine'; there is: other"),
        (
            [entry("mine", "x:y", "0.0.1")],
            "strapdown-reproductions 0.0.1 belongs to another strapdown than",
        ),
        (
            [entry("mine", "no_such_module:y")],
            "cannot be loaded (No module named 'no_such_module'); install it again",
        ),
        (
            [entry("mine", "json:no_such_name")],
            "cannot be loaded (module 'json' has no attribute 'no_such_name')",
        ),
    ],
)
def test_what_cannot_be_run_is_one_line(command, monkeypatch, tmp_path, entries, text):
    offered(monkeypatch, *entries)
    code, _, err = command("reproduce", "mine", "--out", tmp_path / "out")
    assert code == 2 and len(err) == 1 and text in err[0] and not (tmp_path / "out").exists()


def test_without_the_reproductions_the_library_has_its_own_grades_and_scenarios(monkeypatch):
    from strapdown.fileio import files

    monkeypatch.setattr(files, "entry_points", lambda group: ())
    files.shipped_files.cache_clear()
    try:
        assert strapdown.imus() == ["consumer", "dmu10", "industrial", "navigation", "tactical"]
        assert "demo" in strapdown.scenarios() and "paper1-01" not in strapdown.scenarios()
        with pytest.raises(strapdown.DataError, match="unknown scenario 'paper1-01'"):
            strapdown.scenario("paper1-01")
    finally:
        files.shipped_files.cache_clear()


def test_a_package_that_should_bring_grades_and_cannot_be_imported(monkeypatch):
    from strapdown.fileio import files

    monkeypatch.setattr(
        files, "entry_points", lambda group: [EntryPoint("x", "no_such_package", group)]
    )
    files.shipped_files.cache_clear()
    try:
        with (
            pytest.warns(
                PluginWarning,
                match="no_such_package: it should bring grades, and cannot be imported",
            ),
            pytest.raises(strapdown.DataError, match="unknown IMU 'nonsense'"),
        ):
            strapdown.imu("nonsense")
        assert strapdown.imu("tactical").name == "tactical"
    finally:
        files.shipped_files.cache_clear()


def test_help_names_what_takes_an_option_that_few_take():
    """An option of three reproductions or fewer says which; faults has a filter."""
    import inspect

    from typer.main import get_command

    from strapdown.cli import app, complete

    found = complete.offered_commands()
    if "consistency" not in found:
        pytest.skip("strapdown-reproductions is not installed")
    takes = {name: inspect.signature(each.load()).parameters for name, each in found.items()}
    assert "filter" in takes["faults"]
    for parameter in get_command(app.app).commands["reproduce"].params:
        taking = [name for name in sorted(takes) if parameter.name in takes[name]]
        if parameter.name not in ("name", "out", "help", "json", "quiet") and len(taking) <= 3:
            assert taking and all(name in parameter.help for name in taking), parameter.name


def test_a_filter_of_the_faults_is_all_that_runs():
    faults = pytest.importorskip("strapdown_reproductions.faults.main")
    assert [each.name for each in faults.choose_subjects(["vru"])] == ["vru"]
    assert len(faults.choose_subjects(())) > 20
    with pytest.raises(strapdown.DataError, match="leave out --quick"):
        faults.reproduce("nowhere", quick=True, filter=["vru"])
