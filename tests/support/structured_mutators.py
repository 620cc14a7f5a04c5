"""Ways of bending a file by what its format is made of: keys, cells, members, arrays, attributes,
tables. `BY_SUFFIX` says which fit a file; a content that is not of its format stays as it is."""

import io
import json
import re
import sqlite3
import zipfile
import zlib
from contextlib import closing
from functools import wraps

import numpy as np

WORDS = [
    "",
    " ",
    "nan",
    "-inf",
    "é漢🛰",
    "\x1b[31m",
    "a\nb",
    "=1+1",
    "../..",
    "/dev/null",
    "a" * 70000,
]
VALUES = [None, True, 0, -1, 1e308, 10**30, float("nan"), float("inf"), [], {}, [[]], [1, "a"]]
VALUES += [{"a": 1}, [0.0] * 5000, *WORDS]
"""Values that hardly any key may have."""


def pick(rng, these):
    return these[int(rng.integers(len(these)))]


def many(rng, most=14):
    """A number of things, mostly a small one, at most 2**most."""
    return int(2 ** rng.uniform(0, most))


def in_text(change):
    """A change of text as one of bytes."""

    def bend(rng, content):
        return change(rng, content.decode("utf-8", "surrogateescape")).encode(
            "utf-8", "surrogateescape"
        )

    return bend


def of_whole(change):
    """A change of contents that a library can read, as one of any: others stay as they are."""

    @wraps(change)
    def bend(rng, content):
        try:
            return change(rng, content)
        except Exception:  # parsers raise what they stumble over, writers what they cannot write
            return content

    return bend


# TOML

TOML_VALUES = ["nan", "-inf", "1e999", "9" * 400, "true", "[]", "{}", '""', "'''\n'''", "[[[1]]]"]
TOML_VALUES += [
    "1979-05-27T07:32:00Z",
    "0001-01-01",
    "07:32:00",
    "0x7fffffffffffffffff",
    '"\\u0000"',
]
TOML_VALUES += [
    '"é漢🛰"',
    '"/dev/null"',
    '".."',
    '"a\\nb"',
    "[{a=1}, 2]",
    "[1, 'a', 1979-05-27]",
    "\x00",
]
VALUE = re.compile(r"(?<== )(\"[^\"\n]*\"|[^\s{},#\[\]]+|\[[^\]\n]*\])")


@in_text
def other_toml_values(rng, text):
    found = list(VALUE.finditer(text))
    for match in sorted(rng.permutation(len(found))[: rng.integers(1, 4)], reverse=True):
        start, stop = found[match].span()
        new = pick(rng, [*TOML_VALUES, f'"{"x" * many(rng, 17)}"', found[match][0] + "0"])
        text = text[:start] + new + text[stop:]
    return text


@in_text
def other_toml_keys(rng, text):
    """A key is named as another of the file, or as none."""
    keys = list(
        re.finditer(r"^[\w.]+(?= =)|(?<=[{,] )\w+(?= =)|(?<=^\[)[\w.]+", text, re.MULTILINE)
    )
    if not keys:
        return text
    old, new = pick(rng, keys), pick(rng, keys)[0]
    new = pick(rng, [new, new, f"{new}.{new}", '""', "'é漢'", '"\\u0000"', "a" * many(rng), "9"])
    return text[: old.start()] + new + text[old.end() :]


@in_text
def deep_toml(rng, text):
    """Tables in tables, arrays in arrays, thousands of keys."""
    n = many(rng)
    new = pick(
        rng,
        [
            f"deep = {'[' * n}{']' * n}",
            f"deep = {'{a = ' * n}1{'}' * n}",
            f"{'a.' * n}a = 1",
            f"[{'a.' * n}a]",
            "\n".join(f"a.b{k} = {k}" for k in range(n)),
            "\n".join(f"[many.a{k}]" for k in range(n)),
            "[[source]]\n" * min(n, 1000),
            f"long = [{'0, ' * n}]",
        ],
    )
    lines = text.split("\n")
    lines.insert(int(rng.integers(len(lines) + 1)), new)
    return "\n".join(lines)


# JSON


def _places(value):
    """(container, key) of everything in a JSON value."""
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, each in list(items):
        yield value, key
        yield from _places(each)


def other_json(value, rng):
    """The value with something in it replaced, moved, removed or nested."""
    places = list(_places(value))
    if not places:
        return pick(rng, VALUES)
    for _ in range(rng.integers(1, 4)):
        (container, key), (other, its) = pick(rng, places), pick(rng, places)
        new = pick(rng, VALUES)
        try:
            if rng.integers(3) == 0:
                new = json.loads(json.dumps(other[its]))
            if isinstance(container, dict) and rng.integers(4) == 0:
                del container[key]
            else:
                container[key] = new
        except (KeyError, IndexError):  # gone with what it was in
            continue
    return value


@of_whole
def bent_json(rng, content):
    if not rng.integers(8):
        n = many(rng, 16)
        return pick(rng, [b"[" * n + b"]" * n, b'{"a":' * n + b"1" + b"}" * n, b"9" * n])
    return json.dumps(other_json(json.loads(content), rng)).encode()


# tables of text


def bent_table(rng, content):
    """Quotes without end, line ends in cells, other encodings, separators, widths and lengths."""
    at, n = int(rng.integers(len(content) + 1)), many(rng, 17)
    text = content.decode("utf-8", "replace")
    first, _, rest = text.partition("\n")
    return pick(
        rng,
        [
            lambda: content[:at] + b'"' + content[at:],
            lambda: content[:at] + b'"a\nb",' + content[at:],
            lambda: content[:at] + b"\0" * min(n, 100) + content[at:],
            lambda: content[:at] + b"x" * n + content[at:],
            lambda: content[:at] + b"," * n + content[at:],
            lambda: content[:at] + b"\n" * n + content[at:],
            lambda: b"\xef\xbb\xbf" * 2 + content,
            lambda: text.encode("utf-16"),
            lambda: text.encode("utf-16")[: at | 1],
            lambda: content[:at] + text.encode("utf-16")[: 2 * n],
            lambda: (
                content[:at] + "°µ漢".encode(pick(rng, ["latin-1", "utf-8", "gb18030"]), "replace")
            ),
            lambda: content.replace(b",", pick(rng, [b";", b"\t", b" ", b"|", b",,", b", "])),
            lambda: content.replace(b".", b",").replace(b",", b";", content.count(b",")),
            lambda: content.replace(b"\n", pick(rng, [b"\r", b"\r\n", b"\n\n", b""])),
            lambda: (",".join(f"c{k}" for k in range(n)) + "\n" + rest).encode(),
            lambda: (",".join([first.split(",")[0]] * first.count(",")) + "\n" + rest).encode(),
            lambda: ("# " + "x" * n + "\n" + text).encode(),
            lambda: b"\n".join(line + b",1" * min(n, 9) for line in content.split(b"\n")),
        ],
    )()


# arrays: HDF5, npz, MATLAB, Parquet


def other_array(rng, array):
    """An array of other values, type or shape."""
    array = np.asarray(array)
    flat = array.reshape(-1)
    rows = max(len(flat), 1)
    if array.dtype.kind in "fiu" and rng.integers(2):
        out = array.astype(float)
        spot = tuple(int(rng.integers(max(size, 1))) for size in out.shape)
        with np.errstate(all="ignore"):
            return pick(
                rng,
                [
                    lambda: np.where(rng.random(out.shape) < 0.1, pick(rng, [np.nan, np.inf]), out),
                    lambda: np.where(rng.random(out.shape) < 0.1, -out, out),
                    lambda: out * pick(rng, [0.0, -1.0, 1e3, 1e30, 1e300, 1e-300]),
                    lambda: out + pick(rng, [1e3, -1e3, 1e18]),
                    lambda: out[::-1],
                    lambda: np.sort(out, axis=0),
                    lambda: np.full_like(out, out[spot] if out.size else 0.0),
                ],
            )()
    return pick(
        rng,
        [
            lambda: array[: int(rng.integers(len(array) + 1))] if array.ndim else array,
            lambda: flat,
            lambda: array[..., None],
            lambda: array.T,
            lambda: np.concatenate([array, array]) if array.ndim else array,
            lambda: flat[0] if len(flat) else array,
            lambda: np.empty((0, *array.shape[1:])),
            lambda: np.empty((2**31, 0)),
            lambda: np.zeros((1,) * 20),
            lambda: np.zeros(rows, "S3"),
            lambda: np.arange(rows) % 2 == 0,
            lambda: np.zeros(array.shape, complex),
            lambda: np.zeros(array.shape, "u1"),
            lambda: np.zeros(rows, [("t", "f8"), ("u", "i4")]),
            lambda: flat.astype("f4") if array.dtype.kind in "fiu" else np.float64(1.0),
        ],
    )()


def sealed(content):
    """With a checksum that is right, so that more than the checksum is tried."""
    from strapdown.fileio.checksum import FOUND, LINE

    content = FOUND.sub(b"", content)
    return content + LINE % zlib.crc32(content)


def _hdf5_links(rng, group, name, file):
    """What stands in the place of a dataset or group."""
    import h5py

    del group[name]
    n = 10 ** int(rng.integers(3, 16))
    pick(
        rng,
        [
            lambda: None,
            lambda: group.create_group(name),
            lambda: group.__setitem__(name, h5py.SoftLink(f"{group.name}/{name}")),
            lambda: group.__setitem__(name, h5py.SoftLink("/nowhere")),
            lambda: group.__setitem__(name, h5py.SoftLink(group.name)),
            lambda: group.__setitem__(name, h5py.ExternalLink("/dev/null", "/a")),
            lambda: group.__setitem__(name, h5py.ExternalLink("recording.nc", "/")),
            lambda: group.__setitem__(name, file),
            lambda: group.create_dataset(name, shape=(n,), dtype="f8", chunks=(min(n, 1000),)),
            lambda: group.create_dataset(name, shape=(n, 3), dtype="f8", chunks=(1, 3)),
            lambda: group.create_dataset(
                name, shape=(10,), dtype="f8", chunks=(min(n, 2**28),), maxshape=(None,)
            ),
            lambda: group.create_dataset(name, data=h5py.Empty("f8")),
            lambda: group.create_dataset(name, shape=(3,), dtype=h5py.ref_dtype),
            lambda: group.create_dataset(name, shape=(3,), dtype=h5py.vlen_dtype(float)),
            lambda: group.create_dataset(name, data="text", dtype=h5py.string_dtype()),
            lambda: group.create_dataset(name, data=[b"\xff{}"] * 3),
            lambda: group.create_dataset(
                name, shape=(5,), dtype="f8", external=[("/etc/passwd", 0, 40)]
            ),
        ],
    )()


def _hdf5_attributes(rng, thing):
    name = pick(rng, list(thing.attrs)) if len(thing.attrs) else "format"
    old = thing.attrs.get(name)
    if not rng.integers(5):
        thing.attrs.pop(name, None)
        return
    new = [value for value in VALUES[:9] if value not in (None, 10**30, {})] + WORDS[2:10]
    new += [
        np.zeros((2, 2)),
        b"\xff",
        '{"a":',
        "[" * 5000,
        np.float64("nan"),
        np.array([b"a", b"b"]),
    ]
    thing.attrs[name] = pick(rng, [*new, f"{old}0"])


@of_whole
def bent_hdf5(rng, content):
    import h5py

    buffer = io.BytesIO(content)
    with h5py.File(buffer, "r+") as file:
        found = []
        file.visit(found.append)
        name = pick(rng, found)
        parent, leaf, way = file[name].parent, name.split("/")[-1], rng.integers(6)
        if way == 0:
            _hdf5_attributes(rng, pick(rng, [file, file[name]]))
        elif way == 1:
            _hdf5_links(rng, parent, leaf, file)
        elif isinstance(file[name], h5py.Dataset):
            _hdf5_values(rng, parent, leaf)
    return buffer.getvalue()


def _hdf5_values(rng, group, name):
    """Values, type or shape of a dataset are others; of JSON, what it says."""
    old = group[name]
    kept, values = dict(old.attrs), old[()]
    if isinstance(values, bytes):
        values = bent_json(rng, values).decode()
    else:
        values = other_array(rng, values)
    del group[name]
    group.create_dataset(name, data=values)
    if rng.integers(4):
        for key, value in kept.items():
            group[name].attrs[key] = value


def _one_array(rng, arrays):
    """One of the arrays bent, renamed or left out."""
    names = [name for name in arrays if not name.startswith("__")]
    name, way = pick(rng, names), rng.integers(8)
    if way == 0:
        del arrays[name]
    elif way == 1:
        arrays[pick(rng, names)] = arrays[name]
    else:
        arrays[name] = other_array(rng, arrays[name])
    return arrays


@of_whole
def bent_npz(rng, content):
    out = io.BytesIO()
    arrays = _one_array(rng, dict(np.load(io.BytesIO(content))))
    if not rng.integers(8):
        arrays[pick(rng, list(arrays))] = np.array([{"a": 1}, None], object)
    np.savez(out, **arrays)
    return out.getvalue()


@of_whole
def bent_matlab(rng, content):
    from scipy.io import loadmat, savemat

    if content[512:516] == b"\x89HDF":
        return content[:512] + bent_hdf5(rng, content[512:])
    out = io.BytesIO()
    arrays = _one_array(rng, loadmat(io.BytesIO(content)))
    if not rng.integers(6):
        arrays["s"] = {"a": {"b": {"c": np.zeros(9)}}, "t": np.array([1, "a", {}], object)}
    savemat(out, {name: each for name, each in arrays.items() if name[0] != "_"})
    return out.getvalue()


@of_whole
def bent_parquet(rng, content):
    import pandas as pd

    out, frame = io.BytesIO(), pd.read_parquet(io.BytesIO(content))
    names, n = list(frame), len(frame)
    new = [other_array(rng, frame[pick(rng, names)].to_numpy()), pick(rng, WORDS), None]
    new += [[[1, 2]] * n, [{"a": 1}] * n, [b"\xff"] * n, pd.Categorical(["a"] * n)]
    new += [np.full(n, np.datetime64("2300-01-01", "us")), np.full(n, np.timedelta64(1, "ms"))]
    frame[pick(rng, [*names, "é", ""])] = pick(rng, new)
    if not rng.integers(5):
        frame = frame.set_index(pick(rng, names))
    frame.to_parquet(out)
    return out.getvalue()


# archives and databases


@of_whole
def bent_zip(rng, content):
    """Members renamed, doubled, nested, locked, linked, bent."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        chosen = pick(rng, names)
        for name in names:
            info, data = zipfile.ZipInfo(name), old.read(name)
            if name == chosen:
                info, data = _other_member(rng, info, data, content)
            new.writestr(info, data)
        if not rng.integers(4):
            new.writestr(chosen, b"again")
    packed = bytearray(out.getvalue())
    if not rng.integers(5):  # the flag of a locked member, in both of its headers
        for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            packed[packed.index(mark) + at] |= 1
    return bytes(packed)


def _other_member(rng, info, data, whole):
    names = [
        "../../out.csv",
        "/etc/x.csv",
        "a" * 3000,
        "",
        "a/" * 500 + "a.csv",
        "é\udc80.csv",
        "C:\\a.csv",
    ]
    way = rng.integers(5)
    if way == 0:
        info.filename = pick(rng, names)
    elif way == 1:
        data = whole
    elif way == 2:
        info.external_attr, data = 0o120777 << 16, b"/etc/passwd"
    elif way == 3:
        data = pick(rng, [b"", b"\0" * many(rng, 20), data * 3])
    else:
        data = bent_table(rng, data)
    return info, data


SQL = [
    "DROP TABLE messages",
    "DELETE FROM topics",
    "UPDATE topics SET id = NULL",
    "UPDATE topics SET id = 'a'",
    "UPDATE topics SET id = 9223372036854775807",
    "UPDATE topics SET name = x'ff00', type = 5",
    "UPDATE topics SET type = type || '{0}'",
    "UPDATE topics SET serialization_format = 'cdr2'",
    "INSERT INTO topics SELECT * FROM topics WHERE 0",
    "UPDATE messages SET data = NULL",
    "UPDATE messages SET data = 'text'",
    "UPDATE messages SET data = zeroblob({0})",
    "UPDATE messages SET data = substr(data, 1, {0} % 90) WHERE id % 7 = 0",
    "UPDATE messages SET timestamp = -timestamp",
    "UPDATE messages SET timestamp = 9223372036854775807 WHERE id % 5 = 0",
    "UPDATE messages SET timestamp = 1.5",
    "UPDATE messages SET topic_id = {0} % 5",
    "ALTER TABLE messages RENAME COLUMN data TO other",
    "ALTER TABLE messages RENAME TO old; CREATE VIEW messages AS SELECT * FROM old, old AS b",
    "ALTER TABLE messages RENAME TO old; CREATE VIEW messages AS WITH RECURSIVE r(id, topic_id, "
    "timestamp, data) AS (SELECT 1, 1, 1, x'00' UNION ALL SELECT id + 1, 1, id, x'00' FROM r) "
    "SELECT * FROM r",
    "ALTER TABLE topics RENAME TO was; CREATE VIEW topics AS SELECT * FROM topics",
]


@of_whole
def bent_database(rng, content):
    with closing(sqlite3.connect(":memory:")) as database:
        database.deserialize(content)
        database.executescript(pick(rng, SQL).format(many(rng, 20)))
        database.commit()
        return database.serialize()


TOML = (other_toml_values, other_toml_values, other_toml_keys, deep_toml)
TABLE = (bent_table,)
BY_SUFFIX = {
    ".toml": TOML,
    ".json": (bent_json,),
    ".csv": TABLE,
    ".txt": TABLE,
    ".pos": TABLE,
    ".imu": TABLE,
    ".nmea": TABLE,
    ".nc": (bent_hdf5,),
    ".mat": (bent_matlab,),
    ".npz": (bent_npz, bent_zip),
    ".parquet": (bent_parquet,),
    ".zip": (bent_zip,),
    ".db3": (bent_database,),
}
"""The ways that fit a file, by how its name ends."""


# other names


def _suffixes():
    """Endings of all formats that are read."""
    from strapdown.io import registry

    return sorted({end for reader in registry.readers().values() for end in reader.suffixes})


def misnamed(rng, files):
    """A file under the ending of another format, whole or with another one behind it."""
    content = files[pick(rng, sorted(files))]
    if not rng.integers(3):
        other = files[pick(rng, sorted(files))]
        content = (
            content[: int(rng.integers(len(content)))] + other[int(rng.integers(len(other))) :]
        )
    return {f"a{pick(rng, _suffixes())}": content}


def tiny(rng, files):
    """A file of up to 64 bytes: of nothing, or as one of a format begins."""
    start = files[pick(rng, sorted(files))][: int(rng.integers(65))]
    more = [b"", rng.bytes(int(rng.integers(65))), b"\0" * 64, b"\n" * 64, b"1,2\n" * 16]
    return {f"a{pick(rng, _suffixes())}": (start * int(rng.integers(2)) + pick(rng, more))[:64]}
