"""The lists of formats and of what is installed."""

import platform

import strapdown as sd
from strapdown.io.registry import readers


def test_formats_lists_every_reader_that_reads(good):
    lines = good("formats").splitlines()
    text = " ".join(" ".join(lines).split())
    for reader in readers().values():
        if reader.summary:
            assert reader.summary.split(",")[0][:30] in text
    assert ".ulg" in text and max(map(len, lines[:-2])) <= 80


def test_doctor_tells_of_this_installation(good, monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path))
    lines = dict(
        (line[:13].strip(), line[14:])
        for line in good("doctor").splitlines()
        if not line.startswith(" ")
    )
    assert lines["strapdown"].startswith(sd.__version__)
    assert lines["python"].startswith(platform.python_version())
    assert lines["data folder"] == str(tmp_path)
    assert {"packages", "kernels", "kernel cache", "plugins"} <= set(lines)


def test_doctor_without_a_data_folder_says_so(good, monkeypatch):
    monkeypatch.setenv("STRAPDOWN_DATA", "nowhere")
    assert "data folder   none" in good("doctor")
