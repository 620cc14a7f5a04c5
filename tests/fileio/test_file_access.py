"""The ways of opening a file: each within the limits, and no other way in the package."""

import ast
import io
import json
import os
import tempfile
import threading
import time
import zipfile
from pathlib import Path

import pytest
from at_most import at_most

import strapdown as sd
from strapdown.checks import MAX_MESSAGE, DataError
from strapdown.fileio.file_access import (
    LINE,
    Zip,
    check_lines,
    files_of,
    json_of,
    metered_file,
    open_file,
    settings_text,
    toml_of,
)
from strapdown.fileio.files import read_toml
from strapdown.fileio.limits import LimitError, Meter, regular

pytestmark = pytest.mark.short
PACKAGE = Path(sd.__file__).parent
FULL = Path("/dev/full")
ATTRIBUTES = {
    *("open", "read_text", "read_bytes", "File", "ZipFile", "load", "loads", "loadmat", "loadtxt"),
    *("connect", "mmap", "read_csv", "read_parquet", "ParquetFile", "open_mfdataset", "fromfile"),
    *("memmap", "GzipFile", "LZMAFile", "BZ2File", "genfromtxt", "fdopen", "FileIO", "parse"),
}
"""Names of what opens a file or parses its text, whatever they are called on."""
BARE = {"open", "loadmat", "ParquetFile"}
OTHERS = {
    *("self.loads", "balance.loads", "vehicle.loads", "known.trim.loads"),  # forces of an aircraft
    "reader.open",
    "entry.load",
    "EntryPoint().load",
    "?.load",
    "builder.load",
}
"""Of the same name, and not of files."""
ALLOWED = {
    # the ways themselves
    "fileio/file_access.py": {
        "path.open",
        "tomllib.loads",
        "json.loads",
        "self.open",
        "zipfile.ZipFile",
    },
    "fileio/limits.py": {"path.open"},  # a pipe, to copy it
    # counted by open_bytes, or of regular
    "io/tables/table_file.py": {
        "gzip.open",
        "lzma.open",
        "bz2.open",
        "plain.open",
        "mmap.mmap",
        "zstd().open",
    },
    "io/tables/hdf5_file.py": {"h5py.File", "plain.open", "mmap.mmap"},  # of regular
    "io/tables/table_text.py": {
        "pd.read_csv",
        "np.loadtxt",
    },  # of open_bytes, or of regular and check_lines
    "io/tables/table_arrays.py": {"ParquetFile"},  # of regular
    "io/readers/rosbag2.py": {"sqlite3.connect"},  # of regular
    "fileio/checksum.py": {"open"},  # of regular, by own/hdf5_content; and to append
    "cli/output.py": {"os.open", "os.fdopen"},  # the null device, to write
    "cli/live/ports.py": {"os.open", "tcp.connect"},  # lines, sockets
    "cli/live/sinks.py": {"os.open", "path.open"},  # to append
    "cli/live/program.py": {"path.open"},  # to write
    # what is in memory already
    "io/own/text_rules.py": {"json.loads"},
    "io/decoding/robots/packed_chunks.py": {"bz2.open", "lz4.frame.open", "zstd().open"},
    "io/decoding/phones/csv_export.py": {"pd.read_csv"},
    "io/readers/psins.py": {"np.loadtxt"},
    "io/description/rewriting.py": {"tomllib.loads", "tomlkit.parse", "target.read_bytes"},
    "sim/scenario_model.py": {"json.loads"},
    # what packages ship, or this package wrote and named by a digest
    "flight/aircraft_model/parameters.py": {"tomllib.loads", "folder.joinpath().read_text"},
    "cli/live/page_server.py": {"resources.files().joinpath().read_text"},
    "experiments/advice/mission.py": {"tomllib.loads", "resource.read_text"},
    "sensor_models/imu.py": {"tomllib.loads", "resource.read_text"},
    "sensor_models/receiver.py": {"tomllib.loads", "resource.read_text"},
    "experiments/monte_carlo/sources.py": {"file.read_bytes"},
    "sensor_models/geoid.py": {"files().joinpath().read_bytes"},
    "units/time_scales.py": {"files().joinpath().read_text"},
    "pages/shell.py": {"resources.files().joinpath().read_text"},
    "core/compile/kernel_cache.py": {
        "ast.parse",
        "file.read_bytes",
        "pickle.loads",
        "self.path.read_bytes",
    },
    # what this package built, known by its digest, and asks of the system
    "core/compile/library.py": {
        "open",
        "json.loads",
        "manifest.read_bytes",
        "file.read_bytes",
        "machine_code.load",
    },
    "core/compile/machine_code.py": {"open", "json.loads", "c.mmap"},
    # pipes to processes of its own, and a number that it wrote
    "core/compile/other_process.py": {"os.fdopen"},
    "core/compile/side_by_side.py": {"pickle.load", "path.read_text"},
    "engine/verdict_process.py": {"json.loads", "pickle.load", "pickle.loads"},
    "native/ir.py": {"json.loads", "file.read_text"},
    "native/build.py": {"?.read_bytes", "path.read_bytes"},
    "native/wheel.py": {"zipfile.ZipFile", "json.loads"},
    "native/export/folder.py": {"json.loads", "?.read_text", "kept.read_text", "?.read_bytes"},
    "native/export/header.py": {"?.read_text"},
    "native/export/wasm.py": {"?.read_bytes"},
    # what is written
    "fileio/files.py": {"h5netcdf.File"},
    "fileio/locks.py": {"open"},
    "io/solutions/solution_csv.py": {"gzip.open", "lzma.open"},
    "experiments/monte_carlo/campaign.py": {
        "open",
        "json.loads",
        "file.read_bytes",
        "xarray.open_mfdataset",
    },
}
"""{file: calls that open or parse without the ways of `file_access`}, by why they may."""


def called(node):
    if isinstance(node, ast.Attribute):
        return f"{called(node.value)}.{node.attr}"
    if isinstance(node, ast.Call):
        return f"{called(node.func)}()"
    return node.id if isinstance(node, ast.Name) else "?"


def calls(file):
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        # also as a value: {".gz": gzip.open}
        if isinstance(node, ast.Attribute) and node.attr in ATTRIBUTES:
            yield called(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in BARE:
                yield node.func.id


def test_nothing_else_opens_a_file():
    """Whoever adds a reader opens by `file_access`, `open_bytes`, `map_file`, `open_hdf5`, ..., or says here
    why not."""
    found = {}
    for file in PACKAGE.rglob("*.py"):
        name = file.relative_to(PACKAGE).as_posix()
        found[name] = set(calls(file)) - OTHERS - ALLOWED.get(name, set())
    assert {name: more for name, more in found.items() if more} == {}


def test_what_has_no_size_is_empty(tmp_path):
    (tmp_path / "empty").touch()
    with open_file(tmp_path / "empty") as file:
        assert file.read() == b""
    if Path("/proc/self/environ").exists():
        with open_file("/proc/self/environ") as file:
            assert file.read() == b""


def test_a_line_without_an_end_is_refused_however_it_is_read(tmp_path):
    long = tmp_path / "long.csv"
    long.write_bytes(b"t,x\n1,2\n" * 300_000 + b"1," * LINE)
    with pytest.raises(LimitError, match=r"long.csv: has a line of more than 2 MB"):
        check_lines(long)
    with pytest.raises(LimitError, match="a line of more"), long.open("rb") as file:
        metered_file(file, Meter(long), lines=True).read()
    with long.open("rb") as file:
        assert len(metered_file(file, Meter(long)).read()) == long.stat().st_size
    short = tmp_path / "short.csv"
    short.write_bytes(b"1,2\n" * LINE)
    check_lines(short)
    with short.open("rb") as file:
        assert metered_file(file, Meter(short), lines=True).read() == short.read_bytes()


def test_what_unpacks_is_counted_as_it_comes(tmp_path):
    file = io.BytesIO(bytes(2_000_000))
    with sd.reading_limits(size=1.5e6), pytest.raises(LimitError, match="a.gz: has 0.00"):
        metered_file(file, Meter("a.gz")).read()
    with pytest.raises(LimitError, match="unpacks to .* from 0.001 MB"):
        meter = Meter("a.gz", 1000)
        for _ in range(200):
            meter.add(1e6)


def test_files_of_a_zip_and_a_folder_are_counted(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for k in range(20):
            archive.writestr(f"{k}.csv", bytes(100))
            (tmp_path / f"{k}.csv").touch()
    with Zip(tmp_path / "a.zip") as archive:
        assert len(archive.namelist()) == 20 and archive.content("3.csv").read() == bytes(100)
    with sd.reading_limits(entries=19):
        for opened in (Zip, files_of):
            with pytest.raises(LimitError, match="20 files or more, and 19 are read"):
                opened(tmp_path / "a.zip" if opened is Zip else tmp_path)


DEEP = {
    "arrays": "a=" + "[" * 100_000,
    "inline": "a=" + "{a=" * 100_000,
    "dotted": ".".join("a" * 100_000) + "=1",
    "dotted and quoted": ' . "b" . '.join("a" * 50_000) + "=1",
    "header": f"[{'.'.join('a' * 100_000)}]",
    "values": "a=[" + "1," * 200_000 + "]",
    "keys": "\n".join(f"a.b{k}=1" for k in range(200_000)),
    "unended": '"""\\' * 100_000,
    "unended too": "a='''" + '"""\\"' * 100_000,
    "whole number": "a = " + "9" * 5000,
    "hexadecimal": "a = [{b = 0x" + "f" * 5000 + "}]",
    "large": "# " + "x" * 5_000_000,
}


@pytest.mark.parametrize("kind", DEEP)
def test_toml_that_would_take_long_or_deep_is_refused_at_once(kind, tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(DEEP[kind], encoding="utf-8")
    before = time.process_time()
    with at_most(20), pytest.raises(DataError, match=r"x\.toml: (is not TOML|has )") as caught:
        read_toml(path, "")
    assert time.process_time() - before < 2.0 and len(str(caught.value)) < 300


def test_strings_and_comments_of_toml_do_not_count():
    text = (
        f"""a = "{"[" * 99}" # {"[" * 99}\nb = '{"." * 99}'\nc = \"\"\"{"{" * 99}\n\\\"\"\"\"\n"""
    )
    assert toml_of(text, "") == {"a": "[" * 99, "b": "." * 99, "c": "{" * 99 + '\n"'}
    numbers = ", ".join(["1.5"] * 1000)
    assert len(toml_of(f"a = [{numbers}]\n'x.y'.z = {{a.b = 1}}", "")["a"]) == 1000


def test_json_ends_in_a_line():
    assert json_of(json.dumps({"a": [1]}), "") == {"a": [1]}
    for text in ("[" * 200_000, "{", "9" * 5000, b"\xff"):
        with pytest.raises(DataError, match=r"^m\.json: .*(JSON)"):
            json_of(text, "m.json")


def test_settings_are_bounded(tmp_path):
    path = tmp_path / "x.toml"
    path.write_text("a = 1\r\n")
    assert settings_text(path) == "a = 1\n"
    with sd.reading_limits(settings=5), pytest.raises(LimitError, match="x.toml: has more than"):
        settings_text(path)


def test_messages_are_one_printable_line():
    message = str(DataError("a\nb\x1b[31m\u202eevil\x9b " + "x" * 9000 + " remedy"))
    assert message.isprintable() and len(message) == MAX_MESSAGE and message.endswith("remedy")
    assert message.startswith(r"a b\x1b[31m\u202eevil\x9b x")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX only: named pipes")
def test_a_pipe_is_read_once_and_its_copy_goes(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_bytes, args=(b"abc",), daemon=True).start()
    with sd.reading_limits(pipes=True):
        copy = regular(pipe)
        with sd.reading_limits(depth=3):
            assert [regular(pipe).read_bytes() for _ in range(2)] == [b"abc"] * 2
        assert regular(pipe) == copy and copy.exists()
        with pytest.raises(LimitError, match="no regular file"):
            regular("/dev/zero")
    assert not copy.exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX only: named pipes")
def test_a_pipe_is_bounded(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_bytes, args=(bytes(5000),), daemon=True).start()
    with sd.reading_limits(pipes=True, size=4999), pytest.raises(LimitError, match="--max-size"):
        regular(pipe)


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
def test_a_pipe_that_the_temporary_folder_does_not_hold_is_one_line(tmp_path, monkeypatch):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    threading.Thread(target=pipe.write_bytes, args=(bytes(5000),), daemon=True).start()
    full = lambda **_: open(FULL, "wb", 0)  # as a file on a full disk
    monkeypatch.setattr(tempfile, "NamedTemporaryFile", full)
    with pytest.raises(sd.DataError, match=r"pipe: the temporary folder .*No space.*TMPDIR"):
        with sd.reading_limits(pipes=True):
            regular(pipe)


def test_links_that_lead_out_are_refused_where_files_stay_inside(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.csv").write_text("1")
    (tmp_path / "in" / "own.csv").write_text("1")
    (tmp_path / "in" / "link.csv").symlink_to("../secret.csv")
    (tmp_path / "in" / "near.csv").symlink_to("own.csv")
    with sd.reading_limits(outside=False):
        regular(tmp_path / "in" / "near.csv")
        with pytest.raises(LimitError, match=r"link\.csv: is outside the folder"):
            regular(tmp_path / "in" / "link.csv")
    regular(tmp_path / "in" / "link.csv")
