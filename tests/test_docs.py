"""The documentation works: every Python example and every `strapdown` line of it runs, links lead
somewhere, every public name is mentioned.

Blocks of one page share a namespace and a working folder and run from top to bottom. A block whose
fence says `needs-data` uses recorded data: where there is none, the other blocks of such a page run
without it. One whose fence says `file=NAME` is that file. A page with files brings plugins, which
stay: it runs in a process of its own.
"""

import io
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest
import typed_blocks
from page_blocks import FENCE, PAGES, blocks

import strapdown
from strapdown.cli import app
from strapdown.io.locate import data_folder as find_data_folder

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\[[^\]]+\]\(([^)\s]+)\)")


def executable(page):
    """The blocks of a page that run: python, the lines of sh that call strapdown, and files."""
    return [block for block in blocks(page) if block.language in ("python", "sh") or block.file]


def prose(page):
    """The page without its blocks."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def run_python(page, block, namespace):
    code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
    exec(code, namespace)


def run_shell(page, block, monkeypatch):
    """Each line that begins with `strapdown`, in this process; it must end well."""
    for number, line in enumerate(block.text.splitlines(), block.line):
        words = shlex.split(line, comments=True)
        if words[:1] == ["strapdown"]:
            monkeypatch.setattr(sys, "argv", words)
            try:
                app.main()
            except SystemExit as end:
                assert not end.code, f"{page.name}:{number}: {line} ended with {end.code}"


def run_page(page, found, folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "examples").symlink_to(ROOT / "examples")
    namespace = {"__name__": "__main__"}
    with redirect_stdout(io.StringIO()):
        for block in found:
            if block.file:
                (folder / block.file).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                run_python(page, block, namespace)
            else:
                run_shell(page, block, monkeypatch)


def run_page_alone(page, folder):
    """The page in a process of its own, which begins in the folder, as a user's would."""
    path = os.pathsep.join([str(ROOT / "docs" / "_site"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, __file__, str(page)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def ids(pages):
    return [page.relative_to(ROOT).as_posix() for page in pages]


def has_data():
    try:
        return find_data_folder(__file__).is_dir()
    except strapdown.DataError:
        return False


def with_marks(pages):
    """The pages as parameters of a test; those of LONG are deep."""
    marks = {True: [pytest.mark.deep], False: []}
    return [
        pytest.param(page, marks=marks[page.name in LONG], id=page.relative_to(ROOT).as_posix())
        for page in pages
    ]


LONG = (
    *("attitude-broad.md", "allan.md", "flight.md", "exogenous.md", "fuse.md", "simulate.md"),
    *(
        "advise.md",
        "firmware.md",
        "fossen.md",
        "smoothing.md",
        "outages.md",
        "compare.md",
        "open-or-closed-loop.md",
        "tune.md",
    ),
)
"""Pages whose examples take more than three seconds; what they show has tests of its own."""
WITH_DATA = [page for page in PAGES if any(block.needs_data for block in executable(page))]
WITH_EXAMPLES = [
    page
    for page in PAGES
    if any(not block.needs_data for block in executable(page))
    and not (page in WITH_DATA and has_data())
]


@pytest.mark.parametrize("page", with_marks(WITH_EXAMPLES))
def test_examples_run(page, tmp_path, monkeypatch):
    found = [block for block in executable(page) if not block.needs_data]
    if any(block.file for block in found):
        run_page_alone(page, tmp_path)
    else:
        run_page(page, found, tmp_path, monkeypatch)


@pytest.mark.parametrize("page", with_marks(WITH_DATA))
def test_examples_on_recorded_data_run(page, tmp_path, monkeypatch, data_folder):
    monkeypatch.setenv("STRAPDOWN_DATA", str(data_folder))
    run_page(page, executable(page), tmp_path, monkeypatch)


@pytest.mark.short
def test_all_examples_are_shown_to_the_type_checkers(tmp_path):
    typed_blocks.write(tmp_path)
    shown = {file.stem: file.read_text("utf-8").splitlines() for file in tmp_path.iterdir()}
    for page in PAGES:
        for block in (block for block in blocks(page) if block.language == "python"):
            name = Path(block.file).stem or typed_blocks.module_name(page)
            lines = block.text.splitlines()
            assert shown[name][block.line - 1 : block.line - 1 + len(lines)] == lines
    (fuse,) = [lines for name, lines in shown.items() if name.endswith("engine_batch")]
    source = (ROOT / "src/strapdown/engine/batch.py").read_text("utf-8").splitlines()
    (line,) = [k for k, text in enumerate(fuse) if "sd.fuse(" in text]
    assert source[line].strip() == f">>> {fuse[line]}"
    assert not any("type: ignore" in line for lines in shown.values() for line in lines)


@pytest.mark.short
@pytest.mark.parametrize("page", PAGES, ids=ids(PAGES))
def test_links_lead_somewhere(page):
    for target in LINK.findall(prose(page)):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        assert other.exists(), f"{page.name}: {target} does not exist"
        if anchor:
            assert anchor in anchors(other), f"{page.name}: {other.name} has no heading #{anchor}"


def anchors(page):
    """The names that a page's headings get on the web."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]


@pytest.mark.short
@pytest.mark.parametrize("page", PAGES, ids=ids(PAGES))
def test_fences_are_of_a_known_kind(page):
    assert page.read_text(encoding="utf-8").count("```") % 2 == 0, (
        f"{page.name}: a block is not closed"
    )
    for block in blocks(page):
        assert block.language in ("python", "sh", "toml", "text", "c"), (
            f"{page.name}:{block.line}: {block.language!r}"
        )
        assert set(block.flags) <= {"needs-data", f"file={block.file}"}, (
            f"{page.name}:{block.line}: {block.flags}"
        )


def whole():
    return "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))


@pytest.mark.short
def test_every_public_name_is_mentioned():
    text = whole()
    missing = [
        name
        for name in strapdown.__all__
        if not re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text)
    ]
    assert not missing, f"not a word in docs/ on {', '.join(missing)}"


@pytest.mark.short
def test_every_command_option_filter_and_kind_is_mentioned():
    from typer.main import get_command

    from strapdown import aiding, filters
    from strapdown.sensor_models.imu import imus

    text, commands = whole(), get_command(app.app).commands
    expected = [f"strapdown {name}" for name in commands]
    options = {
        option
        for command in commands.values()
        for parameter in command.params
        for option in parameter.opts
        if option.startswith("--")
    }
    expected += sorted(options - {"--help"})
    expected += [f"`{name}`" for name in (*filters.own_names(), *aiding.names(), *imus())]
    missing = [name for name in expected if name not in text]
    assert not missing, f"not a word in docs/ on {', '.join(missing)}"


@pytest.mark.short
def test_the_example_of_the_readme_is_short():
    (example,) = [block for block in blocks(ROOT / "README.md") if block.language == "python"]
    assert len(example.text.strip().splitlines()) <= 10


@pytest.mark.short
def test_the_test_sees_failures(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(
        "text\n```python\na = 1\n```\n```python\nassert a == 2, 'seen'\n```\n```sh\nstrapdown nonsense\n```\n"
    )
    folder = tmp_path / "work"
    folder.mkdir()
    with pytest.raises(AssertionError, match="seen"):
        run_page(page, executable(page), folder, monkeypatch)
    with pytest.raises(AssertionError, match="page.md:9: strapdown nonsense ended with 2"):
        run_shell(page, executable(page)[2], monkeypatch)


if __name__ == "__main__":
    sys.path.insert(0, str(Path.cwd()))
    with pytest.MonkeyPatch.context() as patch:
        run_page(Path(sys.argv[1]), executable(Path(sys.argv[1])), Path.cwd(), patch)
