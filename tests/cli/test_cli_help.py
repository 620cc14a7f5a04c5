"""Help with groups, examples and pages, and what the shell offers."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from strapdown.cli import app, complete, help

ROOT = Path(__file__).resolve().parents[2]


def commands():
    """{name: command}; of the group `calibrate` the one without a name, and the other."""
    found = dict(typer.main.get_command(app.app).commands)
    inside = found["calibrate"].commands
    return found | {
        "calibrate": inside["sensors"],
        "calibrate installation": inside["installation"],
    }


def completed(line, shell="bash"):
    """What the shell offers at the end of a line."""
    words = shlex.split(line) + [""] * line.endswith(" ")
    given = {
        "bash": {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)},
        "zsh": {"_TYPER_COMPLETE_ARGS": line},
    }[shell]
    shown = subprocess.run(
        [sys.executable, "-m", "strapdown"],
        env={**os.environ, **given, "_STRAPDOWN_COMPLETE": f"complete_{shell}"},
        capture_output=True,
        text=True,
    )
    assert shown.stderr == ""
    return shown.stdout.splitlines()


@pytest.fixture(scope="module")
def titles():
    """The titles of the documentation's pages."""
    pages = (ROOT / "docs").rglob("*.md")
    return {page.read_text("utf-8").partition("\n")[0].removeprefix("# ") for page in pages}


@pytest.mark.short
def test_every_command_has_a_line_a_page_and_examples(titles):
    assert help.ABOUT.keys() == commands().keys()
    for name, about in help.ABOUT.items():
        assert about.page in titles, name
        assert len(about.short) < 66 and about.examples, name
        assert f" {name} " in f"{about.examples[0][1]} ", name


def shown(name, width, monkeypatch):
    """The help of a command, "" the one of all, on a terminal of a width."""
    monkeypatch.setenv("COLUMNS", str(width))
    root = typer.main.get_command(app.app)
    with pytest.raises(SystemExit), contextlib.redirect_stdout(io.StringIO()) as out:
        root.main([*name.split(), "--help"], "strapdown")
    return out.getvalue()


ALL = ("", *help.ABOUT)
SCREEN = 50
"""Rows of a terminal on which help is read."""


@pytest.mark.short
@pytest.mark.parametrize("name", ALL)
def test_help_fits_a_screen_and_breaks_no_word(name, monkeypatch):
    wide = shown(name, 80, monkeypatch)
    assert len(wide.splitlines()) <= SCREEN
    for width in (40, 80):
        text = shown(name, width, monkeypatch)
        long = [line for line in text.splitlines() if len(line) > width]
        # an option stays with its value
        assert all(line.startswith("      --") or " " not in line.strip() for line in long)
        # a command line goes on behind a backslash
        assert sorted(set(text.replace(" \\\n", " ").split()) - {"#"}) == sorted(
            set(wide.replace(" \\\n", " ").split()) - {"#"}
        )


@pytest.mark.short
@pytest.mark.parametrize("name", ALL)
def test_help_names_nothing_that_a_wheel_does_not_install(name, titles, monkeypatch):
    text = shown(name, 80, monkeypatch)
    assert not re.findall(r"\b(?:docs|benchmarks|examples|tests|reproductions|src)/", text)
    assert not re.findall(r"\S+\.md\b", text)
    joined = " ".join(text.split())
    assert set(re.findall(r'the page "([^"]*)"', joined)) <= titles
    known = {f"strapdown {each}" for each in help.ABOUT}
    for line in re.findall(r"`(strapdown [a-z ]*[a-z])[^`]*`", joined):
        assert line in known or line == "strapdown", line


@pytest.mark.short
@pytest.mark.parametrize("name", ALL)
def test_help_says_nothing_twice(name, monkeypatch):
    """No text of an option is that of another, and the formats are in `strapdown formats` alone."""
    command = commands().get(name, typer.main.get_command(app.app))
    texts = [parameter.help for parameter in command.params if getattr(parameter, "help", None)]
    assert len(texts) == len(set(texts))
    assert not re.search(r"ulg|DataFlash|MCAP|ROS|UBX|NMEA", "".join(texts))


@pytest.mark.short
@pytest.mark.parametrize(
    "line", [line for about in help.ABOUT.values() for _, line in about.examples]
)
def test_examples_are_lines_that_the_command_takes(line, monkeypatch):
    """All but the work itself."""
    root, done = typer.main.get_command(app.app), []
    found = [root, *root.commands.values(), *root.commands["calibrate"].commands.values()]
    for command in found:
        monkeypatch.setattr(command, "callback", lambda **given: done.append(given))
    root.main(shlex.split(line)[1:], "strapdown", standalone_mode=False)
    assert done


@pytest.mark.short
def test_examples_that_need_nothing_run(good, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    light = ("filters", "imus", "receivers")
    for name in light:
        for _, line in help.ABOUT[name].examples:
            assert good(*shlex.split(line)[1:])


@pytest.mark.short
@pytest.mark.parametrize("name", ["closed-loop", "vru", "xkf-two-stage"])
def test_all_about_a_filter_ends_at_a_page(good, name):
    (page,) = re.findall(r"page of the documentation: (\S+)", good("filters", name))
    assert (ROOT / f"docs/reference/filters/{page}.md").exists()


@pytest.mark.short
def test_help_has_its_options_in_groups(good):
    out = good("fuse", "--help")
    places = [out.index(f"\n{heading}:\n") for heading in ("Input", "Filter", "Output", "Examples")]
    assert places == sorted(places) and 'the page "Fuse a recording"' in out
    assert places[0] < out.index("--imu GRADE") < places[1] < out.index("--smooth") < places[2]
    there = {
        option.removeprefix("--")
        for command in (typer.main.get_command(app.app), *commands().values())
        for parameter in command.params
        for option in parameter.opts
    }
    assert set(" ".join(help.GROUPS.values()).split()) <= there | {"help"}
    assert "[RECORDING]" not in out and "Usage: strapdown fuse [OPTIONS] RECORDING...\n" in out


@pytest.mark.short
def test_the_command_lists_its_commands_by_task(good):
    out = good("--help")
    assert out.index("From a log to a page:") < out.index("  fuse ") < out.index("  study ")
    assert "130 interrupted" in " ".join(out.split())


@pytest.mark.parametrize(
    "line, offered",
    [
        ("strapdown re", ["reproduce", "receivers"]),
        ("strapdown fuse x.nc --filter attitude-", ["attitude-mekf"]),
        ("strapdown compare x.nc --filters closed-loop,nl", ["closed-loop,nlo"]),
        ("strapdown export --sources position,zero-velo", ["position,zero-velocity"]),
        ("strapdown fuse x.nc --smoo", ["--smooth"]),
        ("strapdown reproduce hag", ["hager-bryne"]),
        ("strapdown fly t", ["turning"]),
    ],
)
def test_the_shell_is_offered_names(line, offered):
    assert completed(line) == offered


def test_zsh_is_told_what_a_filter_is_good_for():
    (line,) = completed("strapdown filters xkf-t", "zsh")
    assert '"xkf-two-stage":"large initial errors' in line


def test_every_list_of_names_is_one():
    for offer in (
        complete.imus,
        complete.receivers,
        complete.scenarios,
        complete.missions,
        complete.plans,
        complete.vehicles,
        complete.targets,
        complete.attitude_filters,
        complete.reproductions,
    ):
        names = [name for name, _ in offer()]
        assert len(names) > 1 and len(set(names)) == len(names), offer


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
def test_bash_completes_names_and_files(tmp_path):
    """The script that --show-completion prints, in a shell that has a file to offer."""
    (tmp_path / "flight.ulg").touch()
    (tmp_path / "strapdown").symlink_to(Path(sys.executable).with_name("strapdown"))
    script = subprocess.run(
        [sys.executable, "-m", "strapdown", "--show-completion", "bash"],
        capture_output=True,
        text=True,
        env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
    ).stdout
    assert "complete -o default -F _strapdown_completion strapdown" in script

    def offered(*words):
        line = " ".join(map(shlex.quote, words))
        tried = f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _strapdown_completion strapdown; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        shown = subprocess.run(
            ["bash", "--norc", "-c", f"{script}\n{tried}"],
            cwd=tmp_path,
            env={**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
            capture_output=True,
            text=True,
        )
        return shown.stdout.split()

    assert offered("strapdown", "fuse", "x.nc", "--filter", "vr") == ["vru"]
    # nothing, so that bash goes on with the names of files
    assert offered("strapdown", "fuse", "fli") == []
    assert offered("strapdown", "fuse", "x.nc", "--sources", "fli") == []
