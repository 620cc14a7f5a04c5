"""A sample never waits for what else the program does: all that it loads is loaded when its constructor
returns, the disk has a thread of its own, and receivers are decoded between samples. It is counted, not timed."""

import gc
import json
import os
import subprocess
import sys
import threading
from math import inf
from pathlib import Path

import pytest
import written_ubx
from recordings import flight
from typer.testing import CliRunner

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.app import app
from strapdown.cli.live import program
from strapdown.cli.live.disk_job import DiskJob

LOADS = Path(__file__).parents[1] / "support" / "loads_of_live.py"


@pytest.mark.parametrize("format, output", [("json", "json"), ("ubx", "nmea"), ("nmea", "mavlink")])
def test_nothing_is_loaded_after_the_constructor(format, output, tmp_path):
    """In a process of its own, where nothing is loaded yet: a whole alignment, late fixes and states. Only
    the log begins a file."""
    if output == "mavlink":
        pytest.importorskip("pymavlink")
    words = [sys.executable, LOADS, format, output, tmp_path]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["opened"] == [str(tmp_path / "log.jsonl")]
    assert min(found["used"]) > 2 and found["bad"] == 0


@pytest.fixture
def replayed(tmp_path):
    """Function that returns a Live on a simulated flight, as fast as possible."""
    sd.write_recording(flight(), tmp_path / "flight.nc")

    def make(said, **more):
        part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": inf}
        table = {"imu": "tactical", "input": [part], "lag": 0.5} | more
        return sd.Live(table, on_event=lambda t, text: said.append(text))

    return make


def test_the_disk_keeps_no_sample_waiting(replayed, tmp_path, monkeypatch):
    """The log is forced, and then the state saved, on a disk that takes nothing until the end."""
    free, begun = threading.Event(), []

    def fsync(number, force=os.fsync):
        begun.append(threading.current_thread() is threading.main_thread())
        assert free.wait(30.0)
        force(number)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(program, "FLUSH", 0.0)
    log, state = tmp_path / "log.jsonl", tmp_path / "drive.state"
    live = replayed([], log=str(log), state=str(state), save_every=1e-6)
    while live.turn():
        pass
    assert live.stream.started and not state.exists()
    assert 1 <= len(begun) <= 2  # one of the log and one of the state, each in its thread
    free.set()
    live.close()
    assert not any(begun) and state.stat().st_size > 1000
    assert sd.read(log).imu.t[-1] == live.stream.t


@pytest.mark.parametrize("error", [None, OSError(5, "Input/output error")])
def test_the_next_log_does_not_wait_for_the_one_before(replayed, tmp_path, monkeypatch, error):
    """An error of the one before is told of it, and the next one goes on."""
    free, said = threading.Event(), []

    def fsync(number):
        assert free.wait(30.0)
        if error:
            raise error

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(program, "FLUSH", 0.0)
    live = replayed(said, log=str(tmp_path / "log.jsonl"), lag=0.0)
    while live.turn():
        pass
    live._log._start = None  # as after a new alignment
    live._use(sd.Sample(30.0, 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, -0.49)), [])
    assert not free.is_set()
    free.set()
    monkeypatch.setattr(os, "fsync", lambda number: None)
    live.close()
    first, second = live.logs
    assert [sd.read(path).imu.t[-1] for path in live.logs] == [20.0, 30.0]
    assert live.cut_logs == ({str(first): "Input/output error"} if error else {})
    assert [text for text in said if text.startswith("log: ")] == [
        f"log: {path}: cannot be written ({why}); it ends here"
        for path, why in live.cut_logs.items()
    ]


def test_a_disk_that_fails_ends_the_log_and_is_said_once(replayed, tmp_path, monkeypatch):
    def fsync(number):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(program, "FLUSH", 0.0)
    said = []
    with replayed(said, log=str(tmp_path / "log.jsonl")) as live:
        while live.turn():
            pass
        assert live.stream.started
    wrong = [text for text in said if text.startswith("log: ")]
    path = tmp_path / "log.jsonl"
    assert wrong == [f"log: {path}: cannot be written (No space left on device); it ends here"]


def test_calls_of_a_disk_job_follow_each_other_and_pass_their_errors_on():
    told, done, free = [], [], threading.Event()
    job = DiskJob(told.append)
    job.begin(free.wait, 30.0)
    assert not job.is_free() and not told
    free.set()
    job.begin(done.append, 1)
    job.end()
    assert done == [1] and job.is_free()

    def fail(error):
        raise error

    errors = [OSError("full"), DataError("no folder")]
    for error in errors:
        job.begin(fail, error)
        job.end()
    assert told == errors and job.is_free()


def test_a_receiver_is_decoded_after_a_sample_or_where_none_comes(tmp_path, monkeypatch):
    """Its epoch takes longer than a sample, so that one that is due meanwhile would wait."""
    (tmp_path / "gnss.ubx").write_bytes(written_ubx.pvt([written_ubx.GPS])[0].tobytes())
    part = {"port": f"file:{tmp_path}/gnss.ubx", "format": "ubx"}
    table = {"imu": "tactical", "input": [part], "source": [{"kind": "position"}]}
    with sd.Live(table) as live:
        asked = []
        monkeypatch.setattr(live.inputs[0].decoder, "idle", lambda: asked.append(1) or [])
        for since, expected in ((0.0, 1), (0.002, 0), (0.02, 0), (0.05, 1)):
            monkeypatch.setattr(program.Live, "since_sample", since)
            asked.clear()
            live.turn()
            assert len(asked) == expected, since


def test_the_command_leaves_what_is_loaded_to_no_collection(replayed, tmp_path, monkeypatch):
    """A collection of the garbage of all that was loaded takes 60 ms."""
    frozen = []
    monkeypatch.setattr(gc, "freeze", lambda: frozen.append(len(made)))
    made, own = [], sd.Live.__init__
    monkeypatch.setattr(
        sd.Live, "__init__", lambda self, *args, **given: made.append(own(self, *args, **given))
    )
    sd.write_recording(flight(12.0), tmp_path / "flight.nc")
    (tmp_path / "live.toml").write_text(
        '[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = inf\n'
    )
    done = CliRunner().invoke(app, ["live", str(tmp_path / "live.toml")])
    assert done.exit_code == 0, done.output
    assert frozen == [1]  # once all is loaded
