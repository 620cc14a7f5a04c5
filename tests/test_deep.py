"""The record of the deep tests, and which of them a change can reach."""

import json
import re

import deep
import pytest
import reach

TOLD = {
    "wall": 12.3,
    "files": {"tests/io/test_a.py": (3.0, 2), "tests/test_b.py": (40.25, 11)},
    "outcomes": {"passed": 12, "failed": 1},
    "failed": ["tests/test_b.py::test_x[a b]"],
}
COMMIT = "0123456789abcdef0123456789abcdef01234567"


@pytest.fixture
def record(tmp_path, monkeypatch):
    """A record of two parts, as a run writes it."""
    heading = [f"make deep, 2026-11-24, commit {COMMIT}", "Python 3.11"]
    parts = [["", *deep.of_part(name, TOLD)] for name in ("deep", "short without the compiler")]
    monkeypatch.setattr(deep, "RECORD", tmp_path / "deep.txt")
    deep.RECORD.write_text("\n".join([*heading, *parts[0], *parts[1]]) + "\n")


def test_what_is_recorded_is_read_again(record):
    last = deep.recorded()
    assert last.commit == COMMIT and last.failed == 2
    assert last.seconds == pytest.approx(
        {"tests/test_b.py": 40.25, "tests/io/test_a.py": 3.0}, abs=0.06
    )


def test_what_failed_is_run_again_and_counts_no_longer_where_it_passes(record, monkeypatch):
    """In the first part it passes, in the second it still fails."""

    def run(marks, off, files, told):
        assert files == TOLD["failed"]
        told.write_text(json.dumps({"failed": files if off else []}))
        return int(off)

    monkeypatch.setattr(deep, "run", run)
    monkeypatch.setattr(deep, "git", lambda *words: COMMIT if "rev-parse" in words else "")
    before = deep.recorded()
    assert deep.again() == 1
    assert deep.recorded() == before._replace(failed=1)
    (line,) = [each for each in deep.RECORD.read_text().splitlines() if "mended" in each]
    assert line == f"failed, mended, passes at commit {COMMIT}: {TOLD['failed'][0]}"


def test_the_shortest_that_fit_are_chosen(record):
    last = deep.recorded()
    assert deep.fitting(last, [*last.seconds]) == ["tests/io/test_a.py"]
    assert deep.fitting(last, ["tests/test_b.py"]) == []


@pytest.mark.parametrize("commits, status", [(150, 0), (151, 1)])
def test_too_many_commits_fail(record, monkeypatch, capsys, commits, status):
    monkeypatch.setattr(deep, "git", lambda *words: str(commits) if "rev-list" in words else "")
    assert deep.ago(deep.recorded(), [], 1, 1) == status
    said = capsys.readouterr().out
    assert f"{commits} commits and 0 changed" in said and ("make deep" in said) == bool(status)


def test_a_checkout_without_the_commit_says_so(record, monkeypatch, capsys):
    monkeypatch.setattr(deep, "git", lambda *words: "")
    assert deep.some(soon=True) == 0
    assert "is not in this checkout" in capsys.readouterr().out


def test_functions_of_kernels_are_counted_without_their_comments(tmp_path, monkeypatch):
    before = "@helper\ndef f(a):\n    return a\n\n@kernel(RUN)\ndef g(a):\n    return a\n\ndef h(a):\n    return a\n"
    now = before.replace("return a\n\n@", "return a  # why\n\n@").replace(
        "g(a):\n    return a", "g(a):\n    return 2 * a"
    )
    monkeypatch.setattr(deep, "ROOT", tmp_path)
    monkeypatch.setattr(deep, "git", lambda *words: before)
    file = tmp_path / "src/strapdown/core/a.py"
    file.parent.mkdir(parents=True)
    file.write_text(now.replace("def h(a):\n    return a", "def h(a):\n    return 3"))
    assert deep.changed_kernels(COMMIT, ["src/strapdown/core/a.py", "docs/b.md"]) == 1
    file.unlink()
    assert deep.changed_kernels(COMMIT, ["src/strapdown/core/a.py"]) == 2


WHERE = (
    "io/test_mutations",
    "filters/test_consistency",
    "tuning/test_tune",
    "cli/test_kills_and_disks",
)
WHERE = tuple(f"tests/{name}.py" for name in WHERE)


@pytest.mark.parametrize(
    "changed, wanted",
    [
        ("src/strapdown/io/readers/dataflash.py", (0, 3)),  # found by listing
        ("src/strapdown/filters/particle/pkf.py", (0, 1, 2, 3)),
        ("src/strapdown/tuning/tune.py", (2, 3)),
        ("src/strapdown/pages/page.py", (3,)),  # by `sd.report` of the command line
        ("src/strapdown/native/export/templates/main.c", (3,)),
        ("tests/support/mutations.py", (0,)),
        ("reproductions/src/strapdown_reproductions/alam/main.py", ()),
        ("LICENSE", ()),
        ("pyproject.toml", (0, 1, 2, 3)),
    ],
)
def test_a_change_reaches_what_imports_it(changed, wanted):
    tests = [reach.ROOT / name for name in WHERE]
    assert all(test.is_file() for test in tests)
    assert reach.reached([changed], tests) == [tests[k] for k in wanted]


def test_a_page_of_the_documentation_reaches_the_tests_of_the_documentation():
    tests = [reach.TESTS / "test_docs.py", reach.TESTS / "tuning" / "test_tune.py"]
    assert reach.reached(["docs/how-to/compare.md"], tests) == tests[:1]


def test_every_listed_package_is_there():
    for importer, package in reach.LISTED.items():
        assert {importer, package} <= reach.graph().modules


def test_the_record_names_files_that_are_there():
    assert re.fullmatch("[0-9a-f]{40}|", deep.recorded().commit)
