"""MCAP files of robots: every way of packing and indexing them, damage, and what is refused.
`rosbags` and the package `mcap`, which writes them, are the oracles."""

import lzma

import numpy as np
import pytest
from test_rosbag import (
    IMU,
    SLOW,
    UP,
    N,
    T,
    asked,
    check_drive,
    driven,
    every_type,
    log_of,
    oracle,
    same_fields,
    value,
)
from written_ros import FLU, Written, drive, imu, write_bag, write_mcap

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.decoding.robots.mcap_records import read_mcap
from strapdown.io.decoding.robots.packed_chunks import unpack_frames
from strapdown.io.decoding.robots.ros_messages import Messages
from strapdown.io.tables.table_file import map_file

__all__ = ["driven"]  # a fixture
SAMPLE = "native/rosbag2/jackal_sim_imu_odom_61s.mcap.xz"


def test_every_field_of_the_sample_is_as_mcap_and_rosbags_read_it(data_folder, tmp_path):
    from mcap.reader import make_reader
    from written_ros import types

    packed, path = data_folder / SAMPLE, tmp_path / "sample.mcap"
    path.write_bytes(lzma.decompress(packed.read_bytes()))
    expected: dict = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            read = types("cdr").deserialize_cdr(message.data, schema.name)
            expected.setdefault(channel.topic, []).append(read)
    found = list(read_mcap(map_file(path), Messages()).decode())
    assert len(found) == 2
    for topic, decoded in found:
        same_fields(topic, decoded, expected[topic.name])
    table = log_of(packed).tables["/imu/data"].frame
    force = np.array([value(each, "linear_acceleration") for each in expected["/imu/data"]])
    np.testing.assert_array_equal(table[["fx", "fy", "fz"]], force)
    assert len(sd.read(packed).imu.t) == 3061


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_a_drive_comes_back(tmp_path, driven, compression):
    check_drive(write_mcap(tmp_path / "a.mcap", drive("cdr", driven), compression), driven)


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False, "enable_data_crcs": True},
        {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False},
        {"repeat_schemas": False, "chunk_size": 3000, "enable_crcs": False},
    ],
)
def test_no_index_is_needed(tmp_path, driven, options):
    check_drive(write_mcap(tmp_path / "a.mcap", drive("cdr", driven), "lz4", **options), driven)


def test_messages_of_ros_1_in_mcap(tmp_path):
    topics = every_type("ros1")
    path = write_mcap(tmp_path / "a.mcap", topics, encoding="ros1")
    expected = oracle(write_bag(tmp_path / "a.bag", topics), "ros1")
    found = list(read_mcap(map_file(path), Messages()).decode())
    assert len(found) == 8
    for topic, decoded in found:
        same_fields(topic, decoded, expected[topic.name])


def test_messages_in_any_order_are_sorted_by_their_recording(tmp_path):
    from mcap.writer import Writer
    from written_ros import definition

    payloads = imu("cdr", T, SLOW, UP)
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file, chunk_size=10_000)
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", definition("cdr", IMU).encode())
        channel = writer.register_channel("/imu", "cdr", schema)
        for k in np.random.default_rng(3).permutation(N).tolist():
            writer.add_message(channel, int(T[k]), payloads[k], int(T[k]))
        writer.finish()
    found = sd.read(tmp_path / "a.mcap").imu.dtheta
    np.testing.assert_allclose(found, SLOW * FLU * 0.005, atol=1e-12)


def small(tmp_path, **options):
    """A file of a few chunks, its bytes."""
    topic = Written("/imu", IMU, imu("cdr", T, SLOW, UP), T)
    return write_mcap(tmp_path / "a.mcap", [topic], chunk_size=20_000, **options).read_bytes()


def test_a_file_that_was_cut_short_is_read_as_far_as_it_goes(tmp_path):
    content, path, read = small(tmp_path), tmp_path / "cut.mcap", []
    expected = log_of(tmp_path / "a.mcap").tables["/imu"].frame
    for cut in [0, 5, 8, 30, *np.linspace(500, len(content) - 1, 25).astype(int).tolist()]:
        path.write_bytes(content[:cut])
        try:
            log = log_of(path)
        except DataError as error:
            assert len(str(error).splitlines()) == 1
            continue
        rows = log.tables["/imu"].frame
        np.testing.assert_array_equal(rows, expected[: len(rows)])
        assert any("cut short" in line for line in log.left)
        read.append(len(rows))
    assert read == sorted(read) and 0 < read[0] < read[-1] == N


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_a_chunk_that_fails_its_checksum_is_not_used(tmp_path, compression):
    content = bytearray(small(tmp_path, compression=compression))
    whole = len(log_of(tmp_path / "a.mcap").tables["/imu"].frame)
    content[len(content) // 3] ^= 0xFF
    path = tmp_path / "b.mcap"
    path.write_bytes(content)
    log = log_of(path)
    assert 0 < len(log.tables["/imu"].frame) < whole
    assert any(line.startswith("a chunk ") for line in log.left)


def test_messages_outside_chunks_are_not_used_where_their_checksum_fails(tmp_path):
    content = bytearray(small(tmp_path, use_chunking=False, enable_data_crcs=True))
    content[len(content) // 2] ^= 1
    (tmp_path / "b.mcap").write_bytes(content)
    assert "fail the checksum" in asked(tmp_path / "b.mcap")


def test_other_messages_than_those_of_ros_are_refused(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.LocationFix", "protobuf", b"")
        channel = writer.register_channel("/fix", "protobuf", schema)
        writer.add_message(channel, 1, b"\0" * 30, 1)
        writer.finish()
    assert "its messages have the encoding protobuf, not that of ROS" in asked(tmp_path / "a.mcap")
    (tmp_path / "a.mcap").write_bytes(b"no such file at all")
    assert "not an MCAP file" in asked(tmp_path / "a.mcap")


def test_damaged_bytes_end_in_one_line_at_most(tmp_path):
    """With chunks that have no checksum, so that what is damaged is read."""
    topics = [
        each._replace(payloads=each.payloads[:40], times=each.times[:40])
        for each in every_type("cdr")
    ]
    path = write_mcap(tmp_path / "a.mcap", topics, "none", enable_crcs=False)
    content, rng = path.read_bytes(), np.random.default_rng(5)
    other = tmp_path / "damaged.mcap"
    for _ in range(60):
        damaged = bytearray(content)
        for at in rng.integers(0, len(content), rng.integers(1, 30)):
            damaged[at] = rng.integers(256)
        other.write_bytes(damaged)
        try:
            sd.read(other)
        except DataError as error:
            assert len(str(error).splitlines()) == 1 and "report this to its author" not in str(
                error
            )


def test_a_whole_file_packed_by_any_writer_of_zstd(tmp_path):
    """Without the size in its head, and in several frames."""
    import zstandard

    content, path = small(tmp_path, compression="none"), tmp_path / "b.mcap.zstd"
    half, plain = len(content) // 2, zstandard.ZstdCompressor()
    stream = zstandard.ZstdCompressor().compressobj()
    streamed = stream.compress(content) + stream.flush()
    for packed in (streamed, plain.compress(content[:half]) + plain.compress(content[half:])):
        path.write_bytes(packed)
        assert len(log_of(path).tables["/imu"].frame) == N
    path.write_bytes(streamed[:-40])
    assert "ended before the end-of-stream marker" in asked(path)
    path.write_bytes(streamed + b"no frame")
    assert "or damaged" in asked(path)


def test_what_zstd_unpacks_is_bounded(tmp_path):
    import zstandard

    stream = zstandard.ZstdCompressor().compressobj()
    bomb = stream.compress(bytes(10**8)) + stream.flush()
    with pytest.raises(DataError, match="more than 1000000 bytes"):
        unpack_frames(bomb, 10**6)
