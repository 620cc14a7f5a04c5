"""`strapdown live --terminal`: the numbers of the page, in place on a terminal and a line a second elsewhere."""

import io
import sys
import time

import pytest
from recordings import events_of, flight

import strapdown as sd
from strapdown.cli.live import dashboard, terminal

pytestmark = pytest.mark.short

CONFIG = {
    "imu": "tactical",
    "source": [{"kind": "position", "name": "GNSS position"}, {"kind": "altitude", "name": "baro"}],
    "lag": 0.0,
    "align_within": 5.0,
    "input": [{"port": "file:none.jsonl"}],
}
TEXT = """imu = "tactical"
[[source]]
kind = "position"
[[input]]
port = "file:none.jsonl"
"""


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


@pytest.fixture(scope="module")
def watched():
    """A dashboard after a flight of 20 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dashboard, "PERIOD", 0.0)
        with sd.Live(CONFIG) as live:
            live.watch()
            for event in events_of(flight()):
                if isinstance(event, sd.Sample) or event.source == 0:
                    live.stream.step(event)
                    live._hear_samples()
                    live.turn()
            live._tell("something happened")
            live.turn()
            yield live.watch()


def test_the_lines_have_all_numbers_with_units(watched):
    _, shown = watched.since(0)
    text = "\n".join(terminal.view_lines(shown, shown["events"]))
    for part in (
        "strapdown live: configuration, filter closed-loop",
        "20.00 s: valid, computed from the samples",
        "verdict: not yet",
        "position  4",
        "m north, ",
        " m/s: north ",
        " deg, heading ",
        " used, 0 rejected, innovation ",
        " of 16.3",
        "baro: 0 used, 0 rejected",
        "file:none.jsonl: No such file",
        "newest events:",
        "  20.00 s: something happened",
    ):
        assert part in text, part
    assert "nan" not in text and "None" not in text


def test_before_the_start_it_says_what_is_missing():
    with sd.Live(CONFIG) as live:
        live.watch()
        live.turn()
        _, shown = live.watch().since(0)
    assert terminal.view_lines(shown, [])[1] == (
        "no time yet: invalid, waits for the first IMU sample"
    )
    line = terminal.one_line_view(shown)
    assert line.endswith("position 0 used, 0 rejected; baro 0 used, 0 rejected; verdict not yet")


def test_the_verdict_is_a_line_with_its_span_and_why_a_new_one_failed(watched):
    _, shown = watched.since(0)
    verdict = {"word": "doubtful", "line": "doubtful: a reason", "of": "1.0 to 20.0 s, 3 s ago"}
    for error, more in (("", ""), ("it ended", "; the last attempt failed: it ended")):
        told = shown | {"verdict": verdict | {"error": error}}
        lines = terminal.view_lines(told, [])
        assert f"verdict (1.0 to 20.0 s, 3 s ago): doubtful: a reason{more}" in lines
        assert terminal.one_line_view(told).endswith("; verdict doubtful")


def test_a_terminal_is_a_viewer(watched, monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert watched.viewers == 0
    with terminal.TerminalView(watched) as view:
        end = time.monotonic() + 60.0
        while not watched.viewers:
            assert time.monotonic() < end
            time.sleep(0.01)
    view._thread.join(60.0)
    assert watched.viewers == 0


@pytest.mark.parametrize("kind, columns", [(Screen, 40), (Screen, 100), (io.StringIO, 100)])
def test_a_terminal_is_written_in_place_and_others_line_by_line(
    kind, columns, watched, monkeypatch
):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", "24")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(terminal, "EVERY", 0.01)
    monkeypatch.setattr(sys, "stdout", kind())
    with terminal.TerminalView(watched) as view:
        end = time.monotonic() + 60.0
        while sys.stdout.getvalue().count("valid") < 2:
            assert time.monotonic() < end
            time.sleep(0.01)
    text = sys.stdout.getvalue()
    assert view.in_place == (kind is Screen)
    if view.in_place:
        assert text.startswith(terminal.CLEAR + terminal.HOME)
        frame = text.split(terminal.HOME)[1]
        lines = frame.split("\n")
        assert len(lines) <= 24 and lines[-1] == terminal.BELOW
        assert all(len(line) < columns + len(terminal.END_OF_LINE) for line in lines[:-1])
    else:
        first, second, *_ = text.splitlines()
        assert first.startswith("20.00 s: valid") and "\x1b" not in text and first == second


def test_a_dumb_terminal_has_lines(monkeypatch):
    monkeypatch.setattr(sys, "stdout", Screen())
    monkeypatch.setenv("TERM", "dumb")
    assert not terminal.is_in_place()


def test_the_command_shows_lines(command, tmp_path, monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.01)
    (tmp_path / "live.toml").write_text(TEXT)
    code, out, err = command("live", tmp_path / "live.toml", "--terminal", "--seconds", 0.2)
    assert code == 0 and "no time yet: invalid, waits for the first IMU sample; position" in out
    assert out.splitlines()[-1].startswith("position: 0 used, 0 rejected")


DASH = '[[output]]\nport = "-"\n'


@pytest.mark.parametrize(
    "more, words, names",
    [
        (DASH, ["--terminal"], "--terminal and the output `-`"),
        ("", ["--terminal", "--json"], "--terminal and --json"),
        (DASH, ["--json"], "the output `-` and --json"),
    ],
)
def test_standard_output_is_for_one_of_them(more, words, names, command, tmp_path):
    (tmp_path / "live.toml").write_text('state = "state"\n' + TEXT + more)
    code, out, err = command("live", tmp_path / "live.toml", *words)
    assert (code, out) == (2, "") and not (tmp_path / "state").exists()
    assert err == [f"strapdown: {names} both need standard output; leave out one"]


def test_a_reader_that_goes_ends_the_view_alone(watched, monkeypatch):
    """An exception in its thread would be a warning, and so an error."""

    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    monkeypatch.setattr(terminal, "EVERY", 0.01)
    monkeypatch.setattr(sys, "stdout", Gone())
    with terminal.TerminalView(watched) as view:
        view._thread.join(60.0)
        assert not view._thread.is_alive()
