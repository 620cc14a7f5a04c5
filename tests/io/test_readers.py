"""The registry of readers: what it lists, how a file finds its reader, readers from outside and
what is wrong with them."""

import gzip
import re
import sqlite3
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown import plugins
from strapdown.checks import DataError
from strapdown.io import readers as room, registry as readers
from strapdown.io.inspection import inspect
from strapdown.io.reader import Reader

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.short


def still(path):
    """A recording of 100 samples at rest, whatever the file holds."""
    t, n = 0.01 * np.arange(1, 101), 100
    return sd.Recording.from_arrays(
        t, np.zeros((n, 3)), np.tile([0.0, 0.0, -9.8], (n, 1)), name=path.stem
    )


MINE = Reader("mine", (".mine", ".mine.xz"), "log of my logger", still)


def add(reader):
    readers.REGISTRY.add(reader, __name__)


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    """What a test adds is gone after it."""
    monkeypatch.setattr(plugins, "_plugins", {})


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "walk.mine"
    path.write_bytes(b"MINE")
    return path


def test_a_file_is_a_reader():
    folder = Path(room.__file__).parent
    assert len(readers.readers()) == len(list(folder.glob("*.py"))) - 1
    for name, reader in readers.readers().items():
        assert isinstance(reader, Reader) and reader.name == name
        readers._check_fields(reader)


def test_formats_that_share_a_suffix_tell_themselves_apart():
    every = readers.readers().values()
    for suffix in {suffix for reader in every for suffix in reader.suffixes}:
        blind = [each.name for each in every if suffix in each.suffixes and each.sniff is None]
        assert len(blind) <= 1, suffix


def test_the_page_names_every_suffix():
    page = (ROOT / "docs" / "reference" / "recording-format.md").read_text(encoding="utf-8")
    for reader in readers.readers().values():
        assert any(suffix in page for suffix in reader.suffixes), reader.name


@pytest.mark.parametrize(
    "name, expected",
    [
        ("recording.toml", "recording.toml"),
        ("a.NC", "netcdf"),
        ("a.imu.XZ", "psins"),
        ("a.npz", "broad"),
        ("a.csv.gz", "table"),
        ("a.gz", None),
        ("csv", None),
    ],
)
def test_a_file_finds_its_reader(name, expected):
    reader = readers.find(Path(name))
    assert (reader and reader.name) == expected


def test_a_reader_from_outside_is_known_everywhere(log, command):
    with pytest.raises(DataError, match=r"type '\.mine' cannot be read; supported are .*\.imu, "):
        sd.read(log)
    add(MINE)
    add(MINE)
    assert sd.read(log).meta["name"] == "walk"
    assert any("100 samples" in fact for fact in inspect(log).facts)
    with pytest.raises(DataError, match=r"supported are .*\.mine, "):
        sd.read(log.with_suffix(".other"))
    code, out, err = command("inspect", str(log))
    # its gyro never changes
    assert code == 3 and "100 samples" in out and err == []
    for name in ("fuse", "inspect", "compare", "calibrate", "allan"):
        code, out, _ = command(name, "--help")
        words = " ".join(out.split())
        assert code == 0 and "`strapdown formats`" in words
    listed = " ".join(command("formats")[1].split())
    assert ".mine log of my logger" in listed and ".imu log of the PSINS toolbox" in listed
    code, _, err = command("inspect", str(log), "--write", "x.toml")
    assert code == 2 and "is a recording already" in err[0]


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"name": "psins"}, "the library already has a Reader of the name 'psins'"),
        ({"name": ""}, "a Reader has the name ''; it must be text"),
        ({"name": 3}, "the name 3; it must be text"),
        ({"suffixes": (".mine", ".imu")}, r"end in \.imu are read by 'psins'; give it a sniff"),
        ({"suffixes": ".mine"}, "suffixes is '.mine'; it must be a tuple"),
        ({"suffixes": ("mine",)}, "it must be a tuple of endings"),
        ({"suffixes": (".Mine",)}, "it must be a tuple of endings in lower case"),
        ({"suffixes": ()}, "empty only with a sniff"),
        ({"summary": "two\nlines"}, "it must be one line of text"),
        ({"read": None}, "read is None; it must be a function"),
        ({"read": "read"}, "read is 'read'; it must be a function"),
        ({"inspect": 1}, "inspect is 1; it must be a function of a path, or None"),
        ({"sniff": True}, "sniff is True; it must be a function"),
        ({"begins": b"LOG1"}, "begins is b'LOG1'; it must be a tuple of bytes"),
    ],
)
def test_what_is_wrong_with_a_reader_is_named(changes, words):
    before = readers.readers()
    with pytest.raises(DataError, match=words) as error:
        add(MINE._replace(**changes))
    assert "\n" not in str(error.value) and readers.readers() == before


def test_what_is_no_reader_is_refused():
    with pytest.raises(DataError, match="is a function; it must be one of .*Reader"):
        sd.register(still)


def test_two_readers_that_claim_a_file_alike_are_refused(log):
    add(MINE)
    add(MINE._replace(name="other", suffixes=(".mine",)))
    with pytest.raises(DataError, match="the readers 'mine' and 'other' both claim it"):
        sd.read(log)


def test_sniffing_tells_apart_what_shares_a_suffix(tmp_path):
    for mark in (b"A", b"B"):
        add(
            Reader(
                f"raw {mark.decode()}",
                (".raw",),
                "raw bytes",
                still,
                sniff=lambda path, mark=mark: path.read_bytes()[:1] == mark,
            )
        )
    table = Reader("log", (".csv",), "log", still, sniff=lambda path: path.read_bytes()[:1] == b"A")
    add(table)
    path = tmp_path / "x.raw"
    for content, expected in ((b"A", "raw A"), (b"B", "raw B"), (b"C", None)):
        path.write_bytes(content)
        reader = readers.find(path)
        assert (reader and reader.name) == expected
    # a suffix that nobody has, and one that another format has without a sniff
    for name, content, expected in (
        ("plain", b"B", "raw B"),
        ("a.csv", b"A", "log"),
        ("a.csv", b"B", "table"),
    ):
        (tmp_path / name).write_bytes(content)
        assert readers.find(tmp_path / name).name == expected


def test_the_longest_suffix_wins(tmp_path):
    add(Reader("long", (".imu.csv",), "log", still))
    assert readers.find(Path("a.imu.csv")).name == "long"
    assert readers.find(Path("a.csv")).name == "table"


def mip():
    """A MIP packet, with Fletcher's checksum."""
    data, a, b = b"ue\x80\x02\x02\x04", 0, 0
    for byte in data:
        a = (a + byte) & 255
        b = (b + a) & 255
    return data + bytes((a, b)) + bytes(100)


def database(path):
    """The content of a database of ROS 2 without messages."""
    with sqlite3.connect(path) as tables:
        tables.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type)")
    tables.close()
    return path.read_bytes()


@pytest.mark.parametrize("name", ["log", "log.txt", "log.csv", "log.ulg", "log.csv.gz"])
def test_a_content_that_is_known_is_read_whatever_its_name(tmp_path, name):
    contents = {
        "ulog": b"ULog\x01\x12\x35\x01" + bytes(8),
        "dataflash": b"\xa3\x95\x80" + bytes(100),
        "mcap": b"\x89MCAP0\r\n" + bytes(100),
        "rosbag1": b"#ROSBAG V2.0\n" + bytes(100),
    }
    if name != "log.ulg":  # these have no mark of their own at their beginning
        contents |= {"rosbag2": database(tmp_path / "made"), "unread": mip()}
    for expected, content in contents.items():
        pack = gzip.compress if name.endswith(".gz") else bytes
        (tmp_path / name).write_bytes(pack(content))
        assert readers.find(tmp_path / name).name == expected
    for damaged in (b"", b"ULog", bytes(50)):  # its own reader says what is wrong with it
        path = tmp_path / "damaged.ulg"
        path.write_bytes(damaged)
        assert readers.find(path).name == "ulog"


def test_a_content_that_nobody_knows_is_no_table(tmp_path, command):
    (tmp_path / "flight.bin").write_bytes(bytes(range(256)) * 20)
    for name in ("fuse", "inspect"):
        code, _, err = command(name, str(tmp_path / "flight.bin"))
        assert code == 2 and "its suffix is that of dataflash, but its content is not" in err[0]


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("a.ulg", b"", "is not a ULog: it is empty; copy it again"),
        ("a.ulg", b"ULog\x01", "is not a ULog: it ends after 5 bytes, within its header"),
        (
            "a.ulg",
            b"ULog\x01\x12\x35\x01",
            "is not a ULog: it ends after 8 bytes, within its header",
        ),
        (
            "a.ulg",
            b"t,x\n0,1\n",
            "is not a ULog: it begins with other bytes; give the complete file",
        ),
        ("a.bag", b"", "is not a bag of ROS 1 in format 2.0: it is empty"),
        ("a.bag", b"#ROSBAG V1.2\n" + bytes(9), "`rosbag migrate` converts format 1.2"),
        ("a.mcap", b"\x89MC", "is not an MCAP file of version 0: it ends after 3 bytes"),
        ("a.BIN", b"", "a.BIN: is empty; copy it again"),
        (
            "a.db3",
            b"SQLite format 3\0" + bytes(50),
            "`sqlite3 FILE.db3 .recover | sqlite3 whole.db3`",
        ),
        (
            "a.csv",
            b"t,x\n" + b"0,1\n" * 9 + b"0,1,2\n",
            "line 11 has 3 cells, but the lines before it at most 2",
        ),
    ],
)
def test_what_is_no_file_of_its_format_is_told_in_words(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    for look in (sd.read, inspect):
        with pytest.raises(DataError, match=words) as error:
            look(tmp_path / name)
        assert "C error" not in str(error.value)


def test_a_zip_of_one_file_is_read_as_that_file(tmp_path):
    def zipped(files):
        with zipfile.ZipFile(tmp_path / "q.zip", "w") as archive:
            for name, content in files.items():
                archive.writestr(name, content)
        return readers.find(tmp_path / "q.zip")

    ulog = b"ULog\x01\x12\x35\x01" + bytes(8)
    assert zipped({"flight.ulg": ulog}).name == "ulog"
    assert zipped({"flight": ulog}).name == "ulog"
    assert zipped({"logs/a.csv": "t,x\n0,1\n", "__MACOSX/logs/._a.csv": "x"}).name == "table"
    assert zipped({"drive.bag": b"cut"}).name == "rosbag1"
    assert zipped({"a.ulg": ulog, "b.ulg": ulog}) is None
    with pytest.raises(
        DataError, match="holds 2 files that are not a recording together; unpack it"
    ):
        readers.taker(tmp_path / "q.zip")


def fails(path):
    raise KeyError("no such key\nat all")


def needs_more(path):
    import no_such_package  # noqa: F401


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"read": needs_more}, "'mine' needs a package that is not installed (No module named"),
        ({"read": fails}, "the reader 'mine' fails in `read` (KeyError: "),
        ({"inspect": fails}, "the reader 'mine' fails in `inspect` (KeyError: "),
        ({"sniff": fails}, "the reader 'mine' fails in `sniff` (KeyError: "),
        ({"read": lambda path: path.read_text() + 1}, "in `read` (TypeError: "),
        ({"read": lambda path: {}}, "the reader 'mine' returns a dict instead of a Recording"),
        (
            {"inspect": lambda path: ["fact"]},
            "the reader 'mine' returns a list instead of facts and problems",
        ),
    ],
)
def test_a_reader_that_fails_ends_in_one_line(log, command, changes, words):
    add(MINE._replace(**changes))
    for name in ["inspect"] if "inspect" in changes else ["fuse", "inspect"]:
        code, _, err = command(name, str(log))
        assert code == 2 and len(err) == 1 and words in err[0] and "walk.mine" in err[0]


def test_the_kind_of_a_packed_file_is_named(tmp_path):
    with pytest.raises(DataError, match=r"files of type '\.xyz\.xz' cannot be read"):
        sd.read(tmp_path / "a.b.xyz.xz")


def test_other_formats_do_without_what_descriptions_need():
    code = (
        "import sys, strapdown as sd\nfrom strapdown.io import readers as room, registry as readers\nreaders.readers()\n"
        "print({'pydantic', 'xarray', 'plotly', 'h5netcdf', 'pandas'} & set(sys.modules))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert re.fullmatch(r"set\(\)\n", shown.stdout), shown
