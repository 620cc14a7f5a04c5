"""Files and sets of files are written whole or not at all, and nothing temporary stays."""

import os
import signal
import subprocess
import sys
import threading

import pandas as pd
import pytest

from strapdown.checks import DataError
from strapdown.fileio.files import replacing, together, write_table
from strapdown.fileio.locks import PART

pytestmark = pytest.mark.short


def put(path, text):
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def content(folder):
    """{name: text} of all that is in a folder, hidden or not."""
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def test_a_set_appears_at_its_end(tmp_path):
    put(tmp_path / "b", "old")
    with together():
        put(tmp_path / "a", "new")
        with together():  # belongs to the one around it
            put(tmp_path / "b", "new")
        assert not (tmp_path / "a").exists() and (tmp_path / "b").read_text() == "old"
    assert content(tmp_path) == {"a": "new", "b": "new"}


def test_a_table_has_its_digits_and_runs_nothing_in_a_spreadsheet(tmp_path):
    table = pd.DataFrame({"a [m]": [1 / 3, 2.0], "=b": ["=1+1", "x"]}, index=[7, 8])
    write_table(table, tmp_path / "a.csv", 4)
    assert content(tmp_path) == {"a.csv": "a [m],'=b\n0.3333,'=1+1\n2,x\n"}


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_set_that_fails_leaves_what_was_there(tmp_path, failure):
    put(tmp_path / "a", "old")
    with pytest.raises((DataError, KeyboardInterrupt)), together():
        put(tmp_path / "a", "new")
        put(tmp_path / "b", "new")
        with replacing(tmp_path / "c") as part:
            part.write_text("half")
            raise failure
    assert content(tmp_path) == {"a": "old"}
    put(tmp_path / "b", "later")  # no set is left open
    assert content(tmp_path) == {"a": "old", "b": "later"}


def test_a_rename_that_fails_undoes_those_before(tmp_path):
    put(tmp_path / "a", "old")
    with (
        pytest.raises(DataError, match="c: cannot be written .Is a directory.; choose"),
        together(),
    ):
        for name in "abca":
            put(tmp_path / name, "new")
        (tmp_path / "c").mkdir()
    (tmp_path / "c").rmdir()
    assert content(tmp_path) == {"a": "old"}


def test_a_rename_that_fails_is_undone_without_links(tmp_path, monkeypatch):
    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refused)
    test_a_rename_that_fails_undoes_those_before(tmp_path)


def test_a_file_written_twice_in_a_set_is_the_last(tmp_path):
    with together():
        put(tmp_path / "a", "first")
        put(tmp_path / "a", "second")
    assert content(tmp_path) == {"a": "second"}


def test_a_thread_has_its_own_set(tmp_path):
    with pytest.raises(ZeroDivisionError), together():
        thread = threading.Thread(target=put, args=(tmp_path / "chunk", "whole"))
        thread.start()
        thread.join()
        raise ZeroDivisionError
    assert content(tmp_path) == {"chunk": "whole"}


def test_a_new_file_has_the_permissions_of_any_other(tmp_path):
    umask = os.umask(0o027)
    try:
        put(tmp_path / "a", "")
    finally:
        os.umask(umask)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_the_longest_names_can_be_written(tmp_path):
    put(tmp_path / ("\N{GREEK SMALL LETTER OMEGA}" * 127), "")
    assert len(list(tmp_path.iterdir())) == 1


WRITER = """
import sys, time
from pathlib import Path
from strapdown.fileio.files import replacing, together
with together(), replacing(sys.argv[1]) as part:
    part.write_text("half")
    print("writing", flush=True)
    time.sleep(600)
"""


def writer(path):
    """A process that has begun to write a file."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout.readline() == "writing\n"
    return process


def test_what_a_killed_process_left_is_swept_and_what_a_living_one_writes_is_not(tmp_path):
    living, killed = writer(tmp_path / "a"), writer(tmp_path / "b")
    try:
        killed.kill()
        killed.wait()
        assert len(list(tmp_path.iterdir())) == 2
        put(tmp_path / "c", "whole")
        left = {path.name[:2]: path.name.endswith(PART) for path in tmp_path.iterdir()}
        assert left == {".a": True, "c": False}
        living.send_signal(signal.SIGINT)
        living.wait()
        assert content(tmp_path) == {"c": "whole"}
    finally:
        living.kill()
        for process in (living, killed):
            process.wait()
            process.stdout.close()


def test_what_others_left_is_no_business_of_a_write(tmp_path):
    """A partial download of a browser, and a pipe that bears the name of a temporary file."""
    (tmp_path / ".film.part").touch()
    os.mkfifo(tmp_path / f".pipe{PART}")
    put(tmp_path / "a", "")
    assert len(list(tmp_path.iterdir())) == 3
