"""The lists of formats and of what is installed."""

import platform
from pathlib import Path

import strapdown as sd
from strapdown.io.registry import readers


def test_formats_lists_every_reader_that_reads(good):
    lines = good("formats").splitlines()
    text = " ".join(" ".join(lines).split())
    for reader in readers().values():
        if reader.summary:
            assert reader.summary.split(",")[0][:30] in text
    assert ".ulg" in text and len(lines) == 5 + sum(
        bool(each.summary) for each in readers().values()
    )


def test_doctor_tells_of_this_installation(good, monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path))
    lines = dict(
        (line[:13].strip(), line[14:])
        for line in good("doctor").splitlines()
        if not line.startswith(" ")
    )
    assert lines["strapdown"].startswith(sd.__version__)
    assert lines["python"].startswith(platform.python_version())
    assert "data folder" in lines
    assert {"packages", "kernels", "kernel cache", "plugins"} <= set(lines)


def test_doctor_without_a_data_folder_says_so(good, monkeypatch):
    monkeypatch.setenv("STRAPDOWN_DATA", "nowhere")
    assert "data folder   none" in good("doctor")


def test_the_demo_of_a_recorded_drive_needs_no_data_folder(good, monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path / "nowhere"))
    monkeypatch.chdir(tmp_path)
    out = good("demo", "--recorded", "--out", "drive.html")
    assert "recorded drive: 549 s" in out and "verdict on both: trusted" in out
    assert "a recorded drive with three outages" in Path("drive.html").read_text()
