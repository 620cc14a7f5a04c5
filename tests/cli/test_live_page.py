"""The live page: only its own requests are answered, its events are the numbers of the filter, slow viewers
never keep the filter waiting, and a browser shows numbers that change until the program ends."""

import http.client
import json
import socket
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from types import SimpleNamespace

import numpy as np
import pytest
from browser import Driven, needs_chromium
from recordings import events_of, flight

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.live import dashboard, page_server, terminal
from strapdown.core.loop.contract import DOUBTFUL, Status
from strapdown.core.mathematics.rotation import matrix_to_euler
from strapdown.engine import verdict_process
from strapdown.geometry.geodesy import displacement
from strapdown.pages.verdict_block import verdict_block

pytestmark = pytest.mark.short

SOURCES = [
    {"kind": "position", "name": "GNSS position", "lever_arm": [0.3, -0.2, -0.5]},
    {"kind": "velocity", "lever_arm": [0.3, -0.2, -0.5]},
]
CONFIG = {
    "imu": "tactical",
    "source": SOURCES,
    "lag": 0.0,
    "align_within": 5.0,
    "epoch": "2024-05-17T00:00:00Z",
    "input": [{"port": "file:none.jsonl"}],
}
LATE = 60.0
"""s that a test waits for another thread, at most."""


@pytest.fixture
def started(monkeypatch):
    """A program with a page that has used a flight of 20 s."""
    monkeypatch.setattr(dashboard, "PERIOD", 0.0)
    monkeypatch.setattr(dashboard, "SLOW_PERIOD", 0.0)
    with sd.Live(CONFIG, page=0) as live:
        feed(live, events_of(flight()))
        yield live


def feed(live, events):
    """Give events to the filter, with a look after every tenth."""
    for k, event in enumerate(events):
        live.stream.step(event)
        live._hear_samples()
        if k % 10 == 0:
            live.turn()
    live.turn()


def port_of(live):
    return int(live.page.rstrip("/").rpartition(":")[2])


@contextmanager
def asked(live, path="/", method="GET", **headers):
    """The answer to a request."""
    connection = http.client.HTTPConnection("127.0.0.1", port_of(live), timeout=LATE)
    try:
        connection.putrequest(method, path, skip_host=True)
        host = headers.pop("Host", f"127.0.0.1:{port_of(live)}")
        if host:
            connection.putheader("Host", host)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        with connection.getresponse() as answer:
            yield answer
    finally:
        connection.close()


def event_of(answer):
    """The next event of a stream."""
    while True:
        line = answer.readline()
        assert line, "the stream has ended"
        if line.startswith(b"data: "):
            return json.loads(line[6:], parse_constant=pytest.fail)


# ---- requests


@pytest.mark.parametrize(
    "status, path, method, headers",
    [
        (200, "/", "GET", {}),
        (200, "/", "GET", {"Host": "localhost:PORT"}),
        (200, "/", "GET", {"Host": "[::1]:PORT"}),
        (200, "/", "GET", {"Sec_Fetch_Site": "cross-site"}),
        (200, "/events", "GET", {"Origin": "http://127.0.0.1:PORT"}),
        (200, "/events", "GET", {"Sec_Fetch_Site": "same-origin"}),
        (403, "/events", "GET", {"Sec_Fetch_Site": "cross-site"}),
        (403, "/events", "GET", {"Origin": "http://127.0.0.1:1"}),
        (403, "/events", "GET", {"Origin": "https://127.0.0.1:PORT"}),
        (403, "/events", "GET", {"Origin": "null"}),
        (403, "/events", "GET", {"Origin": "http://evil.example"}),
        (403, "/", "GET", {"Host": "evil.example"}),
        (403, "/", "GET", {"Host": "evil.example:PORT"}),
        (403, "/", "GET", {"Host": "127.0.0.1"}),
        (403, "/", "GET", {"Host": "127.0.0.1:1"}),
        (403, "/", "GET", {"Host": "127.0.0.1.evil.example:PORT"}),
        (403, "/", "GET", {"Host": ""}),
        (404, "/events/", "GET", {}),
        (404, "/?a=1", "GET", {}),
        (404, "/favicon.ico", "GET", {}),
        (404, "/../../etc/passwd", "GET", {}),
        (405, "/", "POST", {}),
        (405, "/events", "PUT", {}),
        (405, "/", "HEAD", {}),
        (405, "/", "OPTIONS", {}),
        (405, "/", "DELETE", {}),
        (405, "/", "ANYTHING", {}),
    ],
)
def test_only_requests_of_the_page_itself_are_answered(status, path, method, headers, idle):
    headers = {name: text.replace("PORT", str(port_of(idle))) for name, text in headers.items()}
    with asked(idle, path, method, **headers) as answer:
        assert answer.status == status
        assert status != 405 or answer.getheader("Allow") == "GET"
        if status == 200:
            assert "default-src 'none'" in answer.getheader("Content-Security-Policy")


@pytest.fixture(scope="module")
def idle():
    """A program that has no samples yet."""
    with sd.Live(CONFIG, page=0) as live:
        live.turn()
        yield live


def test_the_page_needs_nothing_else(idle):
    with asked(idle) as answer:
        page = answer.read().decode()
    assert len(page) < 60_000 and "{STYLE}" not in page and "{SCRIPT}" not in page
    assert "http://" not in page and "https://" not in page and "src=" not in page


def test_bytes_that_are_no_request_change_nothing(idle):
    for data in (b"\r\n\r\n", b"\xff" * 3000, b"GET / HTTP/9\r\n\r\n", b"GET " + b"a" * 70_000):
        with socket.create_connection(("127.0.0.1", port_of(idle))) as raw, suppress(OSError):
            raw.sendall(data)
            raw.shutdown(socket.SHUT_WR)
            raw.recv(100)
    with asked(idle) as answer:
        assert answer.status == 200


@pytest.mark.parametrize("page", ["8765", 80.5, True, -1, 70_000, [1]])
def test_what_is_no_port_is_refused(page):
    with pytest.raises(DataError, match="^page is .*; it must be a whole number"):
        sd.Live(CONFIG, page=page)


def test_a_port_in_use_is_one_line_and_exit_code_2(idle, command, tmp_path):
    (tmp_path / "live.toml").write_text('imu = "tactical"\n[[input]]\nport = "file:a.jsonl"\n')
    code, out, err = command("live", tmp_path / "live.toml", "--page", port_of(idle))
    assert (code, out) == (2, "") and len(err) == 1
    assert f"page: port {port_of(idle)} of 127.0.0.1" in err[0] and "name another one" in err[0]


def test_the_command_says_where_the_page_is(command, tmp_path):
    (tmp_path / "live.toml").write_text('imu = "tactical"\n[[input]]\nport = "file:a.jsonl"\n')
    code, _, err = command("live", tmp_path / "live.toml", "--page", 0, "--seconds", 0.01)
    assert code == 0 and err[0].startswith("page: http://127.0.0.1:")


# ---- events


def test_before_the_start_the_page_says_what_is_missing(idle):
    with asked(idle, "/events") as answer:
        shown = event_of(answer)
    assert shown["status"] == "invalid" and shown["reason"] == "waits for the first IMU sample"
    assert shown["whole"] and shown["t"] is None and "lat_lon" not in shown
    assert shown["track"] == [] and [each["used"] for each in shown["sources"]] == [0, 0]


def test_a_state_without_samples_is_invalid(started, monkeypatch):
    """After as long as a filter bridges, in the line of a terminal and for those who ask, too."""
    for since, expected in ((0.9, "valid"), (1.1, "invalid"), (24.2, "invalid")):
        monkeypatch.setattr(sd.Live, "since_sample", since)
        started.turn()
        _, shown = started.watch().since(0)
        assert shown["status"] == expected == Status(started.status).name.lower()
        if since > 1:
            assert shown["reason"] == f"no sample for {since:.0f} s"
            line = terminal.one_line_view(shown)
            assert f"20.00 s ({shown['utc']}): invalid, no sample for {since:.0f} s; " in line
    assert Status(started.stream.status).name == "VALID"  # at its own time


def test_a_doubtful_state_names_an_event_of_the_filter(started, monkeypatch):
    monkeypatch.setattr(sd.Live, "status", DOUBTFUL)
    monkeypatch.setattr(sd.Live, "since_sample", 0.0)
    event = (1.0, "GNSS position: rejected")
    monkeypatch.setattr(type(started.stream), "events", [event])
    started.watch().hear(2.0, "ports open: udp:1")
    monkeypatch.setattr(started.watch(), "_due", 0.0)
    started.turn()
    reason = started.watch().since(0)[1]["reason"]
    assert reason == f"something contradicts the state; the newest event: {event[1]}"


def test_events_are_the_numbers_of_the_filter(started):
    with asked(started, "/events") as answer:
        shown = event_of(answer)
    stream, state = started.stream, started.stream.belief
    assert shown["t"] == stream.t and shown["status"] == "valid"
    assert shown["utc"].startswith("2024-05-17T00:00:20")
    assert shown["lat_lon"] == np.degrees(state.lla[:2]).tolist()
    assert shown["height"] == state.lla[2] and shown["v_n"] == state.v_n.tolist()
    assert shown["speed"] == pytest.approx(np.linalg.norm(state.v_n))
    roll, pitch, heading = np.degrees(matrix_to_euler(state.C_nb))
    assert shown["rph"] == pytest.approx([roll, pitch, heading % 360])
    std = np.sqrt(np.diag(state.P))
    assert shown["position_std"] + shown["velocity_std"] == pytest.approx(std[:6])
    assert shown["ellipse"] == pytest.approx([state.P[0, 0], state.P[0, 1], state.P[1, 1]])
    assert shown["rph_std"][2] == pytest.approx(np.degrees(std[8]), rel=0.2)
    assert [each["name"] for each in shown["sources"]] == ["GNSS position", "velocity"]
    assert [(each["used"], each["rejected"]) for each in shown["sources"]] == stream.counts()
    assert "NaN" not in json.dumps(shown)


def test_tests_are_those_of_the_solution(started):
    with asked(started, "/events") as answer:
        shown = event_of(answer)
    innovations = started.stream.solution.innovations
    for k, gate in enumerate(innovations.gates):
        mine = innovations.source == k
        t, ratio, accepted = zip(*shown["ratios"][str(k)])
        assert t == pytest.approx(innovations.t[mine])
        assert ratio == pytest.approx(np.sqrt(innovations.nis[mine] / gate))
        assert [*accepted] == innovations.accepted[mine].tolist()
        newest = shown["tests"][str(k)]
        assert newest["nis"] == pytest.approx(innovations.nis[mine][-1])
        size = np.linalg.norm(innovations.innovation[mine][-1])
        assert newest["innovation"] == pytest.approx(size) and newest["unit"] == ["m", "m/s"][k]


def test_the_track_and_fixes_are_metres_from_the_first_position(started):
    with asked(started, "/events") as answer:
        shown = event_of(answer)
    track, place = np.array(shown["track"]), np.array(shown["place"])
    assert track[0].tolist() == [0.0, 0.0] and 20 < len(track) < 40
    # half a second apart at 30 m/s
    assert np.linalg.norm(np.diff(track, axis=0), axis=1) == pytest.approx(13.0, abs=4.0)
    source, *fix, accepted = shown["fixes"][-1]
    away = displacement(flight().sources[0].y[-1], started.stream.belief.lla)[[1, 0]]
    assert fix - place == pytest.approx(away, abs=1e-3) and (source, accepted) == (0, True)


def test_a_viewer_gets_all_at_first_and_then_what_is_new(started):
    recording = flight(25.0)
    with asked(started, "/events") as first, asked(started, "/events") as second:
        before = [event_of(answer) for answer in (first, second)]
        assert before[0] == before[1] and before[0]["whole"]
        started.stream.step(
            sd.Measurement(20.5, 0, tuple(recording.sources[0].y[10]), (1.0, 1.0, 1.0))
        )
        later = [each for each in events_of(recording) if each.t > 20.0]
        feed(started, later)
        for answer in (first, second):
            news = [event_of(answer)]
            while news[-1]["t"] < 24.9:
                news.append(event_of(answer))
            assert not any(each["whole"] for each in news)
            points = sum((each["track"] for each in news), [])
            assert 5 <= len(points) <= 26
            rejected = [fix for each in news for fix in each["fixes"] if not fix[3]]
            assert len(rejected) == 1  # half a kilometre off


def test_an_event_is_shown_once(started):
    with asked(started, "/events") as answer:
        event_of(answer)
        started._tell("something <b>odd</b>")
        started.turn()
        news = [event_of(answer)]
        while not news[-1]["events"]:
            news.append(event_of(answer))
        assert news[-1]["events"] == [[started.stream.stream.newest, "something <b>odd</b>"]]
        started.turn()
        assert event_of(answer)["events"] == []


def test_a_filter_without_a_position_shows_none(monkeypatch):
    monkeypatch.setattr(dashboard, "PERIOD", 0.0)
    config = CONFIG | {"filter": "mahony", "source": [], "align_within": 1.0}
    with sd.Live(config, page=0) as live:
        feed(live, [each for each in events_of(flight()) if isinstance(each, sd.Sample)])
        with asked(live, "/events") as answer:
            shown = event_of(answer)
    assert shown["has_position"] is False and "place" not in shown
    assert shown.get("lat_lon", [None, None]) == [None, None]


# ---- verdicts


NOT_YET = {"word": "not yet", "line": "not yet", "of": "", "error": ""}


def turn_until(live, is_so):
    """Let the program go on until it is so."""
    _ = live.stream.verdict  # compiles what the other process needs, which has a low priority
    end = time.monotonic() + LATE
    while not is_so():
        assert time.monotonic() < end
        live.turn()
        time.sleep(0.005)


def test_nobody_who_watches_no_verdict(started):
    started.turn()
    assert started.verdicts._thread is None and started.watch().viewers == 0


def test_a_viewer_gets_the_verdict_with_its_span(started):
    with asked(started, "/events") as answer:
        shown = event_of(answer)
        assert shown["verdict"] == NOT_YET
        assert shown["verdicts"] == []
        turn_until(started, lambda: started.verdicts.newest)
        started.turn()
        while not shown["verdicts"]:
            shown = event_of(answer)
        verdict = started.stream.verdict
        (html,) = shown["verdicts"][0]
        assert html == verdict_block({"": verdict}) and "Not judged" in html
        assert shown["verdict"]["word"] == "not judged" and shown["verdict"]["line"] == verdict.line
        first = started.stream.stream.start.t
        assert shown["verdict"]["of"].startswith(f"{first:.1f} to 20.0 s, ")
        started.turn()
        assert event_of(answer)["verdicts"] == []
        with asked(started, "/events") as second:
            assert event_of(second)["verdicts"] == [[html]]
    until(lambda: started.watch().viewers == 0)


def test_a_new_alignment_has_no_verdict_yet(started):
    started.watch().viewers = 1
    turn_until(started, lambda: started.verdicts.newest)
    started.turn()
    _, before = started.watch().since(0)
    started.stream._align_anew("for a test", 20.0)
    started.turn()
    _, shown = started.watch().since(0)
    assert before["verdicts"] != [[""]] == shown["verdicts"]
    assert shown["verdict"] == NOT_YET


def test_a_verdict_that_fails_is_one_event(started, monkeypatch):
    said = []
    started._on_event = lambda t, text: said.append(text)
    started.watch().viewers = 1

    def none(module):
        raise OSError

    monkeypatch.setattr(verdict_process, "start_process", none)
    for _ in range(2):
        started.verdicts._due = -np.inf
        started.turn()
        turn_until(started, lambda: started.verdicts._given == np.inf)
    started.turn()
    assert said == ["verdict: no process could be started; the filter goes on"]
    assert started.watch().since(0)[1]["verdict"]["error"] == "no process could be started"


def test_in_python_a_verdict_is_made_once_asked_for(tmp_path):
    """And that of `fuse` on the log is the same."""
    with sd.Live(CONFIG | {"log": str(tmp_path / "log.jsonl")}) as live:
        feed(live, events_of(flight(60.0)))
        assert live.verdicts._thread is None
        assert live.verdict is None
        turn_until(live, lambda: live.verdict)
        newest = live.verdict
        process = live.verdicts._process
    assert process.poll() is not None
    assert newest.verdict == live.stream.verdict == sd.fuse(sd.read(live.logs[0])).verdict
    assert newest.stop == live.stream.t == 60.0 and newest.verdict.trusted


def test_the_program_may_end_while_a_verdict_is_made(started):
    started.watch().viewers = 1
    turn_until(started, lambda: started.verdicts._process)
    process = started.verdicts._process
    started.close()
    until(lambda: process.poll() is not None)
    started.verdicts._thread.join(LATE)
    assert not started.verdicts._thread.is_alive()


# ---- viewers


def test_viewers_are_bounded(idle):
    assert until(lambda: idle._server._server.viewers._value == page_server.MAX_VIEWERS)
    with ExitStack() as stack:
        answers = [
            stack.enter_context(asked(idle, "/events")) for _ in range(page_server.MAX_VIEWERS)
        ]
        assert [answer.status for answer in answers] == [200] * page_server.MAX_VIEWERS
        with asked(idle, "/events") as refused:
            assert refused.status == 503 and b"8 viewers" in refused.read()
        with asked(idle) as page:
            assert page.status == 200
    assert until(lambda: status(idle, "/events") == 200)


def status(live, path):
    live.turn()
    with asked(live, path) as answer:
        return answer.status


def until(is_so):
    """Return True once it is so."""
    end = time.monotonic() + LATE
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)
    return True


def test_connections_are_bounded(idle):
    waiting = [
        socket.create_connection(("127.0.0.1", port_of(idle)), timeout=LATE)
        for _ in range(page_server.MAX_CONNECTIONS + 5)
    ]
    # those beyond are closed without an answer
    assert until(lambda: sum(is_closed(each) for each in waiting) >= 5)
    for each in waiting:
        each.close()

    def answers():
        with suppress(http.client.HTTPException, OSError):
            return status(idle, "/") == 200

    assert until(answers)


def is_closed(connection):
    connection.setblocking(False)
    try:
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def test_a_viewer_that_does_not_read_gets_the_newest_later(started, monkeypatch):
    with socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.connect(("127.0.0.1", port_of(started)))
        slow.settimeout(LATE)
        host = f"Host: 127.0.0.1:{port_of(started)}\r\n\r\n"
        slow.sendall(f"GET /events HTTP/1.1\r\n{host}".encode())
        answer = slow.makefile("rb")
        assert event_of(answer)["whole"]
        before = started.watch().number
        for k in range(2000):
            started._tell(f"event {k}")
            started.turn()
        assert started.watch().number == before + 2000  # none of them waited
        shown = []
        while not shown or [20.0, "event 1999"] not in [
            [round(t), text] for t, text in shown[-1]["events"]
        ]:
            shown.append(event_of(answer))
        assert len(shown) < 1900  # the rest was left out
        assert len(shown[-1]["events"]) <= dashboard.MAX_EVENTS


def test_a_fault_of_the_page_never_ends_the_filter(started, monkeypatch):
    said = []
    started._on_event = lambda t, text: said.append(text)
    monkeypatch.setattr(dashboard, "losses", lambda live: 1 / 0)
    with asked(started, "/events") as answer:
        event_of(answer)
        started.turn()
        started.turn()
        while answer.readline():
            pass
    assert said == ["page: ZeroDivisionError: division by zero; it shows nothing more"]


@pytest.mark.parametrize("speed", [20.0, np.inf])
def test_a_replay_at_a_high_speed_has_a_round_track(speed, tmp_path):
    """Between two looks, 0.1 s apart, it goes far."""
    sd.write_recording(flight(60.0), tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": speed}
    live = sd.Live({"imu": "tactical", "input": [part], "lag": 0.0})
    watched = live.watch()
    live.run()
    _, shown = watched.since(0)
    track = np.array(shown["track"])
    steps = np.linalg.norm(np.diff(track, axis=0), axis=1)
    # at 30 m/s a point in 0.2 s; without those between looks 60 m
    assert len(track) > 5
    assert speed == np.inf or (len(track) > 150 and np.median(steps) < 8.0)
    assert shown["ports"] == {f"recording:{tmp_path / 'flight.nc'}": ""}


def test_places_between_looks_are_bounded_and_even(idle):
    watched, belief = idle.watch(), SimpleNamespace(lla=np.zeros(3))
    for k in range(10_000):
        watched.pass_by(SimpleNamespace(t=0.01 * k, belief=belief))
    times = [t for t, _ in watched._passed]
    assert 10 <= len(times) <= dashboard.MAX_PASSED and times[0] == 0.0 and times[-1] > 90.0
    assert np.diff(times) == pytest.approx(6.4, abs=0.2)


def test_a_long_track_keeps_its_beginning_and_end(monkeypatch):
    monkeypatch.setattr(dashboard, "MAX_TRACK", 100)
    track = dashboard.ThinnedTrack()
    for k in range(1000):
        track.add_point(k + 1, float(k), k)
    points = [values[0] for values in track.since(0)]
    assert points[0] == 0 and points[-1] > 980 and 50 <= len(points) <= 100
    assert np.ptp(np.diff(points)) <= 16
    track.add_point(1001, 5.0, "after a step back")
    assert track.since(1000) == [("after a step back",)]


# ---- a browser


@needs_chromium
def test_a_browser_shows_numbers_that_change_until_the_program_ends(tmp_path):
    rejected = [
        sd.Measurement(t, 0, tuple(flight().sources[0].y[0] + [1e-4, 0, 0]), (1.0, 1.0, 1.0))
        for t in (18.5, 18.6)
    ]
    events = sorted([*events_of(flight()), *rejected], key=lambda event: event.t)
    live = sd.Live(CONFIG, page=0)
    feed(live, events[:-100])
    _ = live.stream.verdict  # compiles what the other process needs, which has a low priority
    over = threading.Event()

    def go_on():
        for event in events[-100:]:
            live.stream.step(event)
            live._hear_samples()
            live.turn()
            time.sleep(0.02)
        while not over.is_set():
            live.turn()
            time.sleep(0.01)
        live.close()

    thread = threading.Thread(target=go_on)
    with Driven(live.page, tmp_path) as page:
        live.turn()
        thread.start()
        page.until("at('word').textContent === 'valid'")
        first = page.run("at('t').textContent")
        page.until(f"at('t').textContent !== '{first}'")
        assert not page.run("document.body.classList.contains('lost')")
        page.until("at('t').textContent === '20.00 s'")
        # the samples have ended
        page.until("at('word').textContent === 'invalid'")
        page.until("document.title === 'invalid – strapdown live'")
        assert page.run("at('status').className") == "verdict wrong"
        assert page.run("/^no sample for [0-9]+ s$/.test(at('reason').textContent)")
        for name, unit in {"height": "m", "speed": "km/h)", "lat": "°", "heading": "°"}.items():
            assert page.run(f"at('{name}').textContent").endswith(unit), name
        sources = page.run("at('sources').textContent")
        assert "GNSS position" in sources and "2 rejected" in sources and "gate 16.3" in sources
        page.until("at('verdict').textContent.includes('Not judged')")
        assert page.run("/^Verdict on .* to .* s, .* s ago.$/.test(at('verdict-of').textContent)")
        # what was unfolded stays so where the next verdict comes
        page.run("at('verdict').querySelector('details').open = true")
        page.run("writeVerdict(at('verdict').innerHTML.replace(' open', ''))")
        assert page.run("at('verdict').querySelector('details').open")
        painted = "getImageData(0, 0, 600, 300).data.some(each => each)"
        assert page.run(f"at('track').getContext('2d').{painted}")
        for width in (1280, 390):
            page.picture(tmp_path / f"{width}.png", width, 900)
            assert page.run("document.documentElement.scrollWidth") <= width
        over.set()
        page.until("document.body.classList.contains('lost')")
        thread.join()
        assert page.run("document.title").startswith("no connection")
        assert page.run("getComputedStyle(at('connection')).display") == "flex"
        # another program on the same port
        with sd.Live(CONFIG, page=port_of(live)) as again:
            end = time.monotonic() + LATE
            while page.run("document.body.classList.contains('lost')"):
                assert time.monotonic() < end
                again.turn()
            assert page.run("at('word').textContent") == "invalid"
            assert page.run("track.length") == 0
            assert page.run("at('verdict').textContent + at('verdict-of').textContent") == (
                "Verdict: not yet."
            )
            # a program that hangs does not look alive
            page.until("document.body.classList.contains('lost')")
