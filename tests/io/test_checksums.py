"""Files whose format has checksums: what fails one never enters a result. Of damaged logs that other
programs parse too, nothing is read that these do not find."""

import bz2
import gzip
import io
import lzma
import re
import zipfile

import mutations
import numpy as np
import pytest
import recordings
import written_ros
import zstandard
from all_cases import CASES

from strapdown.checks import DataError
from strapdown.io import registry

FLIPS, DEEP = 20, 300


def rows():
    """A small table."""
    rng = np.random.default_rng(1)
    values = np.c_[0.01 * np.arange(60), rng.normal(0, 1e-3, (60, 5)), -9.81 + 0 * np.arange(60)]
    lines = [",".join(f"{each:.6f}" for each in row) for row in values]
    return "\n".join(["t,gx,gy,gz,ax,ay,az", *lines, ""]).encode()


def in_zip(content, way=zipfile.ZIP_DEFLATED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", way) as file:
        file.writestr("imu.csv", content)
    return out.getvalue()


WAYS = {
    ".csv.gz": gzip.compress,
    ".csv.xz": lzma.compress,
    ".csv.bz2": bz2.compress,
    ".csv.zst": zstandard.ZstdCompressor(write_checksum=True).compress,
    ".csv.zip": in_zip,
    ".zip": lambda content: in_zip(content, zipfile.ZIP_STORED),
}


def table(path, content):
    path.write_bytes(content)
    (found,) = registry.find(path).open(path).tables.values()
    return found.frame.to_numpy(float)


def flipped(rng, content):
    out = bytearray(content)
    out[rng.integers(len(out))] ^= 1 << rng.integers(8)
    return bytes(out)


@pytest.mark.parametrize("ending", WAYS)
def test_a_packed_table_that_fails_its_checksum_is_refused(tmp_path, ending):
    """A bit of it is changed: it is refused, or the bit says nothing of the content."""
    rng, content = np.random.default_rng(4), WAYS[ending](rows())
    whole, refused = table(tmp_path / f"whole{ending}", content), 0
    for _ in range(FLIPS):
        try:
            found = table(tmp_path / f"a{ending}", flipped(rng, content))
        except (DataError, AttributeError):  # None finds no reader
            refused += 1
            continue
        assert np.array_equal(found, whole)
    assert refused > FLIPS // 2


@pytest.mark.parametrize("chunks", [True, False])
def test_messages_of_a_damaged_mcap_are_never_used(tmp_path, chunks):
    """A bit is changed: what is read are messages of the whole file."""
    path, rng = tmp_path / "a.mcap", np.random.default_rng(5)
    drive = written_ros.drive("cdr", recordings.flight(4.0, 25.0))
    ways = {"use_chunking": chunks, "chunk_size": 4000, "enable_data_crcs": True}
    content = written_ros.write_mcap(path, drive, "none", **ways).read_bytes()
    whole, fewer = cells(path), 0
    for _ in range(FLIPS):
        path.write_bytes(flipped(rng, content))
        try:
            found = cells(path)
        except DataError:
            fewer += 1
            continue
        fewer += len(found) < len(whole)
        assert whole >= found
    assert fewer


def cells(path):
    """{(table, row)} of a log, numbers as text."""
    return {
        (name, *map(str, row))
        for name, table in registry.find(path).open(path).tables.items()
        for row in table.frame.itertuples(index=False)
    }


def mutants(name, tmp_path):
    """(seed, content) of the bent file of a case."""
    (tmp_path / "made").mkdir()
    case = CASES[name](tmp_path / "made")
    for seed in range(DEEP):
        yield seed, mutations.bent(case, seed)[case.bent[0]]


def opened(path, content, ending):
    path.write_bytes(content)
    reader = registry.find(path)
    try:
        return reader.open(path).tables if reader and reader.name == ending else {}
    except DataError:
        return {}


@pytest.mark.deep
def test_fixes_of_damaged_nmea_are_sentences_that_another_parser_finds(tmp_path):
    from pynmeagps import NMEAReader

    used = 0
    for seed, content in mutants("nmea", tmp_path):
        theirs = set()
        for line in content.replace(b"\r", b"\n").replace(b"$", b"\n$").split(b"\n"):
            try:
                # what follows the checksum is of no sentence; that parser refuses it
                message = NMEAReader.parse(re.sub(rb"(\*..).*", rb"\1", line) + b"\r\n")
            except Exception:  # of many kinds
                continue
            if (
                message is not None
                and message.msgID == "GGA"
                and "" not in (message.lat, message.lon)
            ):
                theirs.add((round(message.lat, 6), round(message.lon, 6)))
        found = opened(tmp_path / "a.nmea", content, "nmea").get("GGA")
        if found is not None:
            ours = found.frame[["lat", "lon"]].dropna().to_numpy(float)
            used += len(ours)
            assert theirs.issuperset(map(tuple, np.round(ours, 6))), (seed, theirs, ours)
    assert used


@pytest.mark.deep
@pytest.mark.parametrize("name", ["ubx", "ubx with IMU"])
def test_fixes_of_damaged_ubx_are_frames_that_another_parser_finds(tmp_path, name):
    from pyubx2 import UBXReader

    used = 0
    for seed, content in mutants(name, tmp_path):
        theirs = set()
        for at in range(len(content) - 8):
            if content[at : at + 4] != b"\xb5\x62\x01\x07":  # NAV-PVT
                continue
            size = int.from_bytes(content[at + 4 : at + 6], "little")
            frame = content[at : at + 8 + size]
            a = b = 0
            for byte in frame[2:-2]:
                a = (a + byte) & 255
                b = (b + a) & 255
            if len(frame) == 8 + size and frame[-2:] == bytes([a, b]):
                message = UBXReader.parse(frame)
                place = message.lat, message.lon, message.height / 1e3
                theirs.add(tuple(np.round(place, 7)))
        found = opened(tmp_path / "a.ubx", content, "ubx").get("NAV-PVT")
        if found is not None:
            ours = found.frame[["lat", "lon", "height"]].dropna().to_numpy(float)
            used += len(ours)
            assert theirs.issuperset(map(tuple, np.round(ours, 7))), seed
    assert used
