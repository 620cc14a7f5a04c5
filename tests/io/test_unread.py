"""Formats of other devices are named in one line, with what to do."""

import struct

import numpy as np
import pytest
from support import written_ubx as ubx

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io import registry
from strapdown.io.readers.unsupported_formats import FORMATS, unsupported_format

pytestmark = pytest.mark.short
SAMPLES = {
    "gpmf/hero5_1s.raw": "GoPro telemetry",
    "gpmf/hero11_gps9_11s.raw": "GoPro telemetry",
    "nmea2000/boat_wide_turn_port_250s.raw.xz": "NMEA 2000",
    "mip/microstrain_36s.bin.xz": "MicroStrain",
    "aceinna/openimu_z1_21s.raw": "OpenIMU",
    "aceinna/openimu_s1.raw": "OpenIMU",
    "novatel/inspvax_corrimudata_bestpos_3s.bin": "NovAtel",
    "novatel/inspvax_corrimudata_bestpos_3s.pcapng": "network packets",
    "sbet/two_points.sbet": "SBET",
    "mavlink/timesync_only_93s.tlog": "MAVLink",
    "blackbox/betaflight42_error_recovery.bbl": "Betaflight",
}


@pytest.mark.parametrize("name", SAMPLES)
def test_the_samples_are_named(data_folder, command, name):
    path = data_folder / "native" / name
    for words in (("fuse", path), ("inspect", path)):
        code, _, err = command(*words)
        assert code == 2 and len(err) == 1
        assert SAMPLES[name] in err[0] and "cannot be read" in err[0] and path.name in err[0]


WRITTEN = {
    "video.mp4": (b"\0\0\0\x20ftypmp41" + bytes(100), "MP4"),
    "a.obs": (
        b"     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n",
        "RINEX",
    ),
    "a.rtcm3": (bytes.fromhex("D300133ED7D30202980EDEEF34B4BD62AC0941986F33360B98"), "RTCM 3"),
    "can.log": (b"(1502979132.106111) can0 09F805FD#A01B2C3D4E5F6071\n" * 3, "NMEA 2000"),
    "a.sbet": (
        np.tile([0, 0.57, -2.04, 107, 1, 2, 3, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0], (50, 1))
        .__add__(np.outer(np.arange(1, 51), np.eye(17)[0]))
        .tobytes(),
        "SBET",
    ),
}
"""By name of the file: (content, what it is). The RTCM frame is the example of RTCM 10403 (message
1005)."""


@pytest.mark.parametrize("name", WRITTEN)
def test_what_has_no_sample_is_named(tmp_path, name):
    path = tmp_path / name
    content, what = WRITTEN[name]
    path.write_bytes(content)
    with pytest.raises(DataError, match=what) as error:
        sd.read(path)
    assert "\n" not in str(error.value)


def test_logs_that_carry_such_pieces_are_read(tmp_path):
    content, _ = WRITTEN["a.rtcm3"]
    path = tmp_path / "port.ubx"
    path.write_bytes(content + ubx.pvt(np.array([1_400_000_000_000])).tobytes())
    assert unsupported_format(path) is None and registry.find(path).name == "ubx"


def test_noise_and_text_are_none_of_them(tmp_path):
    rng = np.random.default_rng(8)
    path = tmp_path / "noise.bin"
    for i in range(20):
        path.write_bytes(rng.integers(0, 256, 60_000, np.uint8).tobytes())
        assert unsupported_format(path) is None, i
    for text in ("t,ax\n1,2\n" * 1000, "queue blue due true value " * 3000, "", "\0" * 1360):
        path.write_text(text)
        assert unsupported_format(path) is None
    path.write_bytes(struct.pack("<17d", *range(17)))
    assert unsupported_format(path) is None
    assert unsupported_format(tmp_path) is None


def test_every_format_says_what_to_do():
    for each in FORMATS:
        assert each.why and each.remedy and "\n" not in each.name + each.why + each.remedy
