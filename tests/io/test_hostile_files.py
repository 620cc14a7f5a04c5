"""Files that a stranger made to stop, fill or question the process that reads them: each ends in
one line, soon and in little memory, and tells nothing of what is in a file that is no table."""

import bz2
import gzip
import lzma
import os
import re
import struct
import sys
import threading
import tomllib
import tracemalloc
import zipfile
import zlib

import h5py
import numpy as np
import pytest
import zstandard
from at_most import at_most
from scipy.io import savemat

import strapdown as sd
from strapdown.checks import DataError
from strapdown.fileio.limits import LimitError
from strapdown.io import read
from strapdown.io.inspection import draft, inspect
from strapdown.io.registry import readers
from strapdown.io.tables.table_arrays import tables_of
from strapdown.io.tables.table_text import read_table

pytestmark = pytest.mark.short
MB = 1_000_000
ROW = b"0,0,0,0,0,0,0\n"
TABLE = b"t,gx,gy,gz,ax,ay,az\n" + ROW * (4 * MB // len(ROW))
PLAIN = {".csv": lambda content: content}
PACKERS = {
    ".csv.gz": lambda content: gzip.compress(content, 9),
    ".csv.xz": lzma.compress,
    ".csv.bz2": bz2.compress,
    ".csv.zst": lambda content: zstandard.ZstdCompressor(level=19).compress(content),
    ".csv.zip": lambda content: zipped({"a.csv": content}),
}


@pytest.fixture(autouse=True)
def tight(monkeypatch):
    """Less is free than by default, so that small files can be too large."""
    monkeypatch.setattr("strapdown.fileio.limits.FREE", MB)
    monkeypatch.setattr("strapdown.io.tables.hdf5_file.FREE", MB)


def zipped(files, path=None):
    import io

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def written(path, content):
    path.write_bytes(content)
    return path


def refused(path, message, most=25 * MB):
    """The line that refuses a file, read and inspected in little memory."""
    for function in (read, inspect):
        tracemalloc.start()
        try:
            said = told(function, path)
            assert tracemalloc.get_traced_memory()[1] < most
        finally:
            tracemalloc.stop()
        assert re.search(message, said) and str(path) in said


def told(function, path):
    """What a function says of a file, its error or its lines."""
    try:
        return str(function(path))
    except DataError as error:
        assert str(error).isprintable()
        return str(error)


# what unpacks to far more than it is


@pytest.mark.parametrize("ending", PACKERS)
def test_a_packed_table_is_read_as_far_as_it_is_in_proportion(tmp_path, ending):
    path = written(tmp_path / f"x{ending}", PACKERS[ending](TABLE))
    with sd.reading_limits(expansion=20):
        refused(path, "unpacks to .* as no log does", 60 * MB)
    path = written(path, PACKERS[ending](TABLE[: MB // 7]))
    assert len(read_table(path).lines) > 10_000


PACKED_LOGS = sorted(
    {end for each in readers().values() for end in each.suffixes if end.endswith(".gz")}
)


@pytest.mark.parametrize("ending", PACKED_LOGS)
def test_a_packed_file_of_nothing_is_refused(tmp_path, ending):
    path = written(tmp_path / f"x{ending}", gzip.compress(b""))
    refused(path, r"x\S*: (?!.*more memory|.*fails in)")


def test_a_zip_that_lies_of_its_sizes_is_counted(tmp_path):
    content = bytearray(zipped({"a.csv": TABLE}))
    for mark, at in ((b"PK\3\4", 22), (b"PK\1\2", 24)):
        struct.pack_into("<I", content, content.find(mark) + at, 100)
    path = written(tmp_path / "x.csv.zip", bytes(content))
    with sd.reading_limits(expansion=50), pytest.raises(DataError, match="x.csv.zip: "):
        read(path)


def test_members_of_an_export_are_counted_together(tmp_path):
    rows = b"time,seconds_elapsed,z,y,x\n" + b"1,0,0,0,0\n" * (MB // 13)  # one alone would be free
    names = ("Gyroscope", "TotalAcceleration", "Magnetometer")
    path = written(tmp_path / "x.zip", zipped({f"{name}.csv": rows for name in names}))
    with sd.reading_limits(expansion=50):
        refused(path, "unpacks to", 60 * MB)


def test_an_npz_of_zeros_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "x.npz", gyr=np.zeros(20 * MB // 8), fs=100.0)
    with sd.reading_limits(expansion=50):
        refused(tmp_path / "x.npz", "unpacks to", 60 * MB)


def test_arrays_of_matlab_are_counted_as_they_unpack(tmp_path):
    savemat(tmp_path / "x.mat", {"a": np.zeros((5000, 500))}, do_compression=True)
    with sd.reading_limits(expansion=50):
        refused(tmp_path / "x.mat", "unpacks to")
    savemat(tmp_path / "y.mat", {"s": {"a": np.arange(9.0), "b": np.ones(9)}}, do_compression=True)
    assert tables_of(tmp_path / "y.mat")["s"].numbers("a").tolist() == list(range(9))


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind, sizes, *rest):
    parts = [
        element(6, struct.pack("<II", kind, 0)),
        element(5, struct.pack(f"<{len(sizes)}i", *sizes)),
        element(1, b"x"),
    ]
    return element(14, b"".join(parts + list(rest)))


HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"


@pytest.mark.parametrize("kind", [1, 2, 4, 6], ids=["cells", "structs", "text", "numbers"])
def test_matrices_of_matlab_may_not_state_more_than_they_hold(tmp_path, kind):
    names = (struct.pack("<HHi", 5, 4, 8), element(1, b"field".ljust(8))) if kind == 2 else ()
    path = written(tmp_path / "x.mat", HEADER + matrix(kind, (30000, 30000), *names))
    refused(path, "states 900000000 elements|not a complete MATLAB file|holds no numeric arrays")


def test_matrices_of_matlab_may_not_nest_without_end(tmp_path):
    names = struct.pack("<HHi", 5, 4, 8), element(1, b"field".ljust(8))
    inner = matrix(1, (0, 0))
    for _ in range(60):
        inner = matrix(2, (1, 1), *names, inner)
    packed = zlib.compress(inner)
    for content in (inner, struct.pack("<II", 15, len(packed)) + packed):
        refused(written(tmp_path / "x.mat", HEADER + content), "61 matrices within|41 matrices")


MATRICES = {
    "numbers of no type": matrix(6, (2, 1), element(0x7000, bytes(16))),
    "a text of 4 GB": matrix(4, (1, 2), struct.pack("<II", 1, 2**32 - 8) + bytes(16)),
    "numbers of 4 GB": matrix(6, (2, 1), struct.pack("<II", 9, 2**32 - 8)),
    "a shape of none": matrix(6, (), element(9, bytes(16))),
    "a negative shape": matrix(6, (-2, -1), element(9, bytes(16))),
    "a long tag": matrix(6, (2, 1), struct.pack("<HHi", 5, 9, 0)),
    "no matrix": element(9, bytes(16)),
}


@pytest.mark.parametrize("kind", MATRICES)
def test_damaged_matrices_of_matlab_end_in_a_line(tmp_path, kind):
    path = written(tmp_path / "x.mat", HEADER + MATRICES[kind])
    refused(path, "x.mat: (is not a complete MATLAB file|holds no numeric arrays)")


def hdf5(path, fill):
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    return path


def packed_twice(file):
    settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    settings.set_chunk((1000,))
    settings.set_deflate(9)
    settings.set_deflate(9)
    space = h5py.h5s.create_simple((1000,))
    h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, space, settings)


HDF5 = {
    "unallocated": lambda file: file.create_dataset("x", (10**9,), "f8", chunks=(1000,)),
    "unallocated and whole": lambda file: file.create_dataset("x", (10**9,), "f8"),
    "zeros": lambda file: file.create_dataset("x", data=np.zeros(2 * MB), compression="gzip"),
    "many": lambda file: [file.create_dataset(f"x{k}", (10**5,), "f8") for k in range(50)],
    "another file": lambda file: file.update({"x": h5py.ExternalLink("/etc/passwd", "/x")}),
    "a loop": lambda file: file.create_group("a").update({"b": file["/"]}),
    "a soft loop": lambda file: file.update({"a": h5py.SoftLink("/")}),
    "deep": lambda file: file.create_group("/".join("a" * 50)),
    "another's bytes": lambda file: file.create_dataset(
        "x", (100,), "u1", external=[("/etc/passwd", 0, 100)]
    ),
    "unpacks twice": packed_twice,
    "long packed chunk": lambda file: file.create_dataset(
        "x", (10,), "f8", chunks=(10,), compression="gzip"
    ).id.write_direct_chunk((0,), bytes(50_000)),
    "large chunk": lambda file: file.create_dataset(
        "x", (10,), "f8", chunks=(10 * MB,), maxshape=(None,)
    ),
}


@pytest.mark.parametrize("kind", HDF5)
@pytest.mark.parametrize("name", ["x.mat", "x.nc"])
def test_hdf5_may_not_show_what_it_does_not_hold(tmp_path, kind, name):
    path = hdf5(tmp_path / name, HDF5[kind])
    with sd.reading_limits(expansion=20), pytest.raises(LimitError, match=name):
        read(path)


@pytest.mark.parametrize("size", [0, 8, 2**64 - 16, 2**63])
@pytest.mark.parametrize("name", ["x.mat", "x.nc"])
def test_texts_of_hdf5_fill_their_place_one_after_the_other(tmp_path, name, size):
    """HDF5 looks for ever for the end of a rest of no bytes."""
    path = hdf5(tmp_path / name, lambda file: file.attrs.update({"a": "text"}))
    content = bytearray(path.read_bytes())
    rest = content.index(b"GCOL") + 16 + 16 + 8  # behind the one text
    assert struct.unpack_from("<HHI", content, rest) == (0, 0, 0)
    struct.pack_into("<Q", content, rest + 8, size)
    refused(written(path, bytes(content)), "its texts extend beyond their heap")


def test_a_chunk_that_unpacks_to_more_than_it_is_long_is_tried(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown.io.tables.hdf5_file.MANY_PACKED", 100)
    bomb = zlib.compress(bytes(MB), 9)
    for size, whole in ((1000, False), (MB // 8, True)):

        def fill(file):
            array = file.create_dataset("x", (size,), "f8", chunks=(size,), compression="gzip")
            array.id.write_direct_chunk((0,), bomb)

        path = hdf5(tmp_path / "x.mat", fill)
        if whole:
            assert len(tables_of(path)["x"].frame) == size
        else:
            with pytest.raises(LimitError, match="decompresses to more than its 8000 bytes"):
                read(path)


def test_parquet_is_read_some_rows_at_a_time(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow.parquet import write_table

    texts = pyarrow.array(["x" * 10_000]).take(pyarrow.array(np.zeros(5000, int)))
    table = pyarrow.table({"t": np.arange(5000.0), "s": texts, "l": [[1.0]] * 5000})
    write_table(table, tmp_path / "x.parquet")
    found = tables_of(tmp_path / "x.parquet")["x"]
    assert list(found.frame) == ["t", "s"] and len(found.frame) == 5000
    assert "1 columns of lists" in found.notes[0] and len(found.cells("s")[3]) == 10_000
    write_table(pyarrow.table({"t": np.zeros(3 * MB)}), tmp_path / "z.parquet")
    with sd.reading_limits(expansion=50):
        refused(tmp_path / "z.parquet", "unpacks to")
    with sd.reading_limits(columns=2):
        refused(tmp_path / "x.parquet", "has 3 columns or more")


# what stands in the way


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX only: named pipes")
@pytest.mark.parametrize("name", ["x.csv", "x.nc", "x.ubx", "x.bag", "x.toml", "x", "x.csv.gz"])
def test_pipes_and_devices_end_in_a_line(tmp_path, name):
    os.mkfifo(tmp_path / name)
    (tmp_path / "zero").mkdir()
    (tmp_path / "zero" / name).symlink_to("/dev/zero")
    description = written(tmp_path / "d.toml", DESCRIPTION.replace("FILE", name).encode())
    with at_most(20):
        refused(tmp_path / name, "no regular file.*--pipes")
        refused(tmp_path / "zero" / name, "no regular file")
        with pytest.raises(
            DataError, match="no regular file|no TOML|not valid TOML|is not a table"
        ):
            read(description)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX only: named pipes")
@pytest.mark.parametrize("function", [read, inspect])
def test_a_table_can_come_through_a_pipe(tmp_path, function):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    rows = "".join(f"{k / 100:.2f},0,0,0.001,0,0,-9.81\n" for k in range(500))
    content = "time_s,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z\n" + rows
    for text, fits in ((content, True), ("just a text\n" * 99, False), ("\0\1\2", False)):
        threading.Thread(target=pipe.write_text, args=(text,), daemon=True).start()
        with sd.reading_limits(pipes=True):
            if fits:
                assert "500" in str(function(pipe))
            else:
                with pytest.raises(
                    DataError, match="pipe: (is not a table|the data from the pipe)"
                ):
                    function(pipe)


def test_a_table_of_too_many_columns_is_refused(tmp_path):
    with sd.reading_limits(columns=50):
        for head in (",".join(f"c{k}" for k in range(99)) + "\n", ""):
            path = written(tmp_path / "x.csv", (head + (",".join("1" * 99) + "\n") * 9).encode())
            refused(path, "has 99 columns or more")
        uneven = ",".join("1" * 99) + "\n" + "1,2,3\n" * 9  # its first row is taken for names
        refused(written(tmp_path / "x.csv", uneven.encode()), "has 99 columns or more")
    refused(written(tmp_path / "x.csv", b"1," * 40_000), "does not end within 64 KB")
    long = b"# a title\n" + b"1," * 3 * MB
    refused(written(tmp_path / "x.csv", long), "a line of more than|not a table|columns", 60 * MB)
    below = b"# a title\n" + b"1," * 80_000 + b"\n"  # no more than a line may have
    refused(written(tmp_path / "x.csv", below), "its first row does not end within 64 KB")


def test_separators_of_records_and_next_lines_of_unicode_end_no_line(tmp_path):
    """Neither for those who look at the first lines, nor for those who read all."""
    for mark in ("\x1c", "\x1e", "\x85", "\u2028", "\v"):
        content = f"t,gyro{mark},accel\n" + "1,2,3\n" * 5
        table = read_table(written(tmp_path / "x.csv", content.encode()))
        assert len(table.lines) == 5 and list(table.names)[0] == "t", repr(mark)
    said = told(read, written(tmp_path / "x.csv", b"t,lat\x1e$,0.5"))
    assert str(tmp_path / "x.csv") in said


def test_a_long_name_among_thousands_takes_little_memory(tmp_path):
    """A square of texts as wide as the longest would be 400 MB."""
    content = b"a" * 30_000 + b",0" * 3500
    refused(written(tmp_path / "x.csv", content), "has a header but no rows", 60 * MB)


@pytest.mark.parametrize("ending", [".csv", ".csv.gz"])
@pytest.mark.parametrize("header", [False, True])
def test_short_lines_below_a_long_row_are_not_filled_up(tmp_path, ending, header):
    """50 kB of text that would be 1e8 cells, while as many written ones are a table."""
    row, pack = b",".join([b"1"] * 2000) + b"\n", (PLAIN | PACKERS)[ending]
    path = written(tmp_path / f"x{ending}", pack(2 * row + b"\n" * 50_000))
    with sd.reading_limits(expansion=1e6):
        tracemalloc.start()
        try:
            with pytest.raises(DataError, match="a row has 2000 cells, but most others have few"):
                read_table(path, header)
            assert tracemalloc.get_traced_memory()[1] < 60 * MB
        finally:
            tracemalloc.stop()
        whole = read_table(written(path, pack(row * 600)), header)
    assert (len(whole.lines), len(whole.names)) == (600 - header, 2000)


@pytest.mark.parametrize("name", ["x.csv", "x.csv.gz", "x.csv.zip"])
def test_a_table_with_a_line_without_an_end_is_refused(tmp_path, name):
    content = b"t,x\n" + b"1,2\n" * 20_000 + b"1," * 3 * MB
    path = written(tmp_path / name, PACKERS.get(name[1:], bytes)(content))
    message = r"^\S*: has a line of more than 2 MB"
    with sd.reading_limits(expansion=1e6), pytest.raises(LimitError, match=message):
        read_table(path)


def test_running_out_of_memory_or_depth_is_told_with_the_remedy(tmp_path, monkeypatch):
    path = written(tmp_path / "x.csv", TABLE[:5000])
    for error, remedy in (
        (MemoryError, "more memory than there is; split it"),
        (RecursionError, ""),
    ):

        def fail(*_, error=error):
            raise error

        monkeypatch.setattr("strapdown.io.tables.table_text.layout", fail)
        with pytest.raises(LimitError, match=f"x.csv: .*{remedy}"):
            read(path)


# what must not be told

SECRETS = {
    "passwd": "root:x:0:0:root:/root:/bin/sekret\ndaemon:x:1:1:daemon:/usr/sbin:/sekret\n" * 9,
    "shadow": "root:$6$sekret$abc:19000:0:99999:7:::\n" * 9,
    "key": "-----BEGIN OPENSSH PRIVATE KEY-----\n" + "sekretAAAA\n" * 20,
    "env": 'SEKRET_KEY="sekret"\nPORT=5432\nDEBUG=1\n',
    "fstab": "UUID=sekret / ext4 errors=remount-ro 0 1\nUUID=sekret /home ext4 x 0 2\n",
    "hosts": "127.0.0.1 sekret\n10.0.0.1 sekret2\n",
    "pgpass": "host:5432:db:user:sekret\n" * 5,
    "netrc": "machine sekret login sekret password sekret\n" * 3,
    "ini": "[sekret]\nuser = sekret\nport = 5432\n",
    "json": '{"sekret": "sekret",\n "n": 1,\n "m": 2}\n',
    "prose": "Dear sekret, it was on 2024-05-01.\nYours, sekret\n" * 5,
}
DESCRIPTION = """[imu]
file = "FILE"
time = { column = 1, unit = "s" }
gyro = { columns = [2, 3, 4], unit = "rad/s" }
accel = { columns = [5, 6, 7], unit = "m/s^2" }
"""


@pytest.mark.parametrize("kind", SECRETS)
@pytest.mark.parametrize(
    "name", ["x", "x.csv", "x.txt", ".env", "x.log", "x.ubx", "x.pos", "x.imu"]
)
def test_what_is_no_table_is_not_quoted(tmp_path, kind, name):
    path = written(tmp_path / name, SECRETS[kind].encode())
    named = DESCRIPTION.replace("FILE", name)
    by_name = named.replace("1,", '"sekret",').replace("= 1", '= "time"')
    paths = [path]
    for k, text in enumerate(
        (named, by_name, named + 'calibration = "FILE"\n'.replace("FILE", name))
    ):
        paths.append(written(tmp_path / f"d{k}.toml", text.encode()))
    for each in paths:
        for function in (read, inspect, lambda path: draft([path], {}, tmp_path)):
            assert "sekret" not in told(function, each).replace("'sekret'", "").lower()


def test_names_of_columns_are_told_of_what_is_a_table(tmp_path):
    path = written(tmp_path / "x.csv", b"time,mode,name\n1,auto,a\n2,manual,b\n")
    assert "mode" in str(inspect(path))


def test_a_description_stays_inside_where_it_must(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    rows = b"".join(b"%d,0,0,0,0,0,-9.81\n" % k for k in range(9))
    outside, link = written(tmp_path / "o.csv", rows), folder / "link.csv"
    written(folder / "own.csv", rows)
    link.symlink_to(outside)
    for name in ("../o.csv", str(outside), "link.csv", "own.csv", "~/o.csv"):
        path = written(folder / "d.toml", DESCRIPTION.replace("FILE", name).encode())
        with sd.reading_limits(outside=False):
            if name == "own.csv":
                assert len(read(path).imu.t) == 9
            else:
                with pytest.raises(LimitError, match=r"d\.toml: .* is outside the folder"):
                    read(path)


def test_names_with_control_characters_stay_on_their_line(tmp_path):
    head = '"time","gyro_x","gyro_y","gyro_z","acc_x","acc_y","acc_z","a\u202eb\x1b[31m"\n'
    rows = "".join(f"{k / 100:.2f},0,0,0.001,0,0,-9.81,7\n" for k in range(99))
    path = written(tmp_path / "x\x1b[2J\n.csv", (head + rows).encode())
    drafted = draft([path], {}, tmp_path)
    for line in [*inspect(path).lines, *drafted.splitlines(), *read(path).meta["read"]]:
        assert line.isprintable()
    assert tomllib.loads(drafted)["imu"]["file"] == path.name
    written(path, b"a,b\n1,2\n")
    line = told(read, path)
    assert line.isprintable() and line.count("x\\x1b[2J") == 1


def test_a_week_of_csv_is_not_stopped(tmp_path):
    """15 GB of which nearly all is a hole: refused by its first lines, not by its size."""
    path = tmp_path / "x.csv"
    with path.open("wb") as file:
        file.write(b"t,x\n1,2\n" * 9)
        file.truncate(15_000_000_000)
    with pytest.raises(DataError) as caught:
        read(path)
    assert "--max-size" not in str(caught.value)
    assert sys.getsizeof(caught.value) < 10_000


def central(content, at, value, size=2):
    """The zip with a field of its directory, at this place of the record, changed."""
    start = content.index(b"PK\x01\x02") + at
    return content[:start] + value.to_bytes(size, "little") + content[start + size :]


def renamed(content, first):
    """The zip whose name, said to be UTF-8, has a byte that is none; `first`: from the directory
    on."""
    where = content.index(b"PK\x01\x02") if first else 0
    flagged = content.replace(b"PK\x03\x04\x14\0\0\0", b"PK\x03\x04\x14\0\0\x08", 1)
    at = flagged.index(b"imu.csv", where)
    flagged = flagged[:at] + b"\xff" + flagged[at + 1 :]
    return central(flagged, 8, 0x800) if first else flagged


ZIPS = {
    "a name in the directory": (lambda zip: renamed(zip, True), "a name in it is no text"),
    "a name before the file": (lambda zip: renamed(zip, False), "a name in it is no text"),
    "a version to come": (lambda zip: central(zip, 6, 99), "is packed in a way that is not read"),
    "another method": (lambda zip: central(zip, 10, 77), "is packed in a way that is not read"),
    "a password": (lambda zip: central(zip, 8, 1), "is packed in a way that is not read"),
    "a place beyond the end": (lambda zip: central(zip, 42, 2**31, 4), "truncated or damaged"),
}


@pytest.mark.parametrize("name", ["table.csv.zip", "log.ulg.zip", "phone.zip", "trial.npz"])
@pytest.mark.parametrize("kind", ZIPS)
def test_a_zip_that_zipfile_cannot_take_ends_in_a_line(tmp_path, kind, name):
    change, said = ZIPS[kind]
    path = tmp_path / name
    path.write_bytes(change(zipped({"imu.csv": TABLE[:1000]})))
    for function in (inspect, read)[name == "trial.npz" :]:
        with pytest.raises(DataError) as caught:
            function(path)
        assert name in str(caught.value) and len(str(caught.value).splitlines()) == 1
    if name == "table.csv.zip":
        assert said in str(caught.value)


SHORT = b"t,gx,gy,gz,ax,ay,az\n" + b"1,0,0,4,5,2,7\n" * 100_000
"""A table whose numbers take four times its text in memory, and with what a row takes six times."""
WORDS = b"t,name\n" + b"".join(b"%d,a%x\n" % (k % 10, k) for k in range(100_000))


@pytest.mark.parametrize("ending", [*PLAIN, *PACKERS])
@pytest.mark.parametrize("content", [SHORT, WORDS], ids=["numbers", "words"])
def test_a_table_is_bounded_by_what_it_takes_in_memory(tmp_path, monkeypatch, ending, content):
    monkeypatch.setattr("strapdown.fileio.limits.FREE", 1e9)
    path = tmp_path / f"short{ending}"
    path.write_bytes((PLAIN | PACKERS)[ending](content))
    with sd.reading_limits(size=3.0 * len(content)):
        with pytest.raises(LimitError, match="raise the limit .option --max-size before"):
            read_table(path)
    with sd.reading_limits(size=15.0 * len(content)):
        assert len(read_table(path).lines) == 100_000


def test_a_packed_table_is_in_proportion_as_it_is_in_memory(tmp_path):
    """Of these the text alone is not 200 times the packed bytes."""
    path = tmp_path / "short.csv.gz"
    path.write_bytes(gzip.compress(SHORT[: 20 + 14 * 60_000], 1))
    assert 60_000 * 14 < MB + 200 * path.stat().st_size < 60_000 * 88
    with pytest.raises(LimitError, match="unpacks to .* as no log does"):
        read_table(path)


@pytest.mark.parametrize(
    "name, row",
    [
        ("short.imu.gz", b"1 0 0 4 5 2\n"),
        ("short.pos.gz", b"2024/01/01 0:0:0 1 2 3 1 5\n"),
        ("short.txt.gz", b"UncalGyro,1,2,3,4,5\n"),
    ],
)
def test_logs_of_text_are_bounded_so_too(tmp_path, monkeypatch, name, row):
    monkeypatch.setattr("strapdown.fileio.limits.FREE", 1e9)
    head = {
        "imu": b"0 0 0 0 0 0\n",
        "pos": b"%  GPST  latitude(deg) longitude(deg) height(m) Q ns\n",
    }
    head |= {"txt": b"# Raw,utcTimeMillis\n# UncalGyro,utcTimeMillis,elapsedRealtimeNanos,x,y,z\n"}
    content = head[name.split(".")[1]] + row * 100_000
    (tmp_path / name).write_bytes(gzip.compress(content))
    with sd.reading_limits(size=1.5 * len(content)), pytest.raises(LimitError, match="max-size"):
        read(tmp_path / name)


def test_the_memory_of_a_table_is_what_the_page_says(tmp_path, monkeypatch):
    """At most four times the limit, measured by what Python and numpy allocate."""
    monkeypatch.setattr("strapdown.fileio.limits.FREE", 1e9)
    path, limit = tmp_path / "short.csv.gz", 12e6
    path.write_bytes(gzip.compress(SHORT, 1))
    tables_of(path)  # what is imported stays
    tracemalloc.start()
    try:
        with sd.reading_limits(size=limit):
            tables_of(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * limit
    finally:
        tracemalloc.stop()
