"""`Live`, the program of `strapdown live`: it reads ports, steps a LiveStream, and writes states and a log."""

import heapq
import os
import select
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ...checks import DataError, check_number, locate_errors
from ...core.loop.contract import INVALID, Imu
from ...core.loop.gaps import BRIDGE
from ...data.solution import Source
from ...engine.live_stream import LiveStream
from ...engine.notifier import OnEvent
from ...engine.saved_state import OtherStateError, state_text, write_state_text
from ...engine.stream import Measurement, Sample
from ...engine.verdict_process import SpanVerdict, VerdictProcess
from ...io import read
from ...io.readers.live_log import fix_line, head_line, sample_line
from ...plugins import one_line
from ...units.time_scales import gps_from_unix
from .arrival_clock import ArrivalClock, ArrivalIntervals, Arrivals, ClockEstimate
from .clocked_events import ClockedEvents
from .config import Config, InputPart, OutputPart, config_of
from .dashboard import Dashboard
from .decoders import decoder
from .disk_job import DiskJob
from .encoders import encoder
from .input_formats import QUIET, Clock, Decoder
from .line_formats import NO_CLOCK
from .notices import Notices, Senders
from .output_formats import state_at
from .page_server import PageServer
from .ports import Mark, Port
from .pulse_clock import PulseClock, PulseEstimate
from .pulse_file import PulseFile
from .receiver_imu import ReceiverWithImu
from .sinks import Sink

PAUSE = 0.002
"""s that the program sleeps where nothing comes, at most."""
FLUSH = 1.0
"""s between two times at which the log is forced to the disk."""
LOOK = 1.0
"""s between two looks at ports for what is to be reported."""
IMU_SILENT = 5.0
"""s without a sample of use after which that is reported."""
CALM = 0.001
"""s after a sample in which an epoch of a receiver is decoded, which takes longer than a sample: the
next one comes later."""
BATCH = 1000
"""Events of a recording that are taken at a time, at most."""


def time_of_arrival(monotonic: float | None = None) -> float:
    """Return the time of this machine, now or at a time of `time.monotonic`, UNIX s; it never steps
    while the machine runs."""
    return STARTED + (time.monotonic() if monotonic is None else monotonic)


STARTED = time.time() - time.monotonic()


class _Bytes:
    """An input from a port."""

    def __init__(self, part: InputPart, clock: Clock, kinds: list[str]) -> None:
        assert part.address is not None  # of all but a recording
        self.port = Port(part.address)
        self.ends_lines = part.address.kind == "udp" and part.format in ("json", "nmea")
        self._clock, self.senders = clock, Senders()
        self.pulse_clock = PulseClock(part.latency, clock) if part.pps else None
        self.pulses = PulseFile(part.pps) if part.pps else None
        self.clocked: ClockedEvents | None = None
        if part.clock == "arrival":
            self.clocked = ClockedEvents(self.pulse_clock or ArrivalClock(part.latency), clock)
        self.clocked_imu = ClockedEvents(ArrivalClock(), clock) if part.imu else None
        self.unstamped = Arrivals() if part.clock == NO_CLOCK else None
        self._latency = part.latency
        name = f"{part.format} of {part.address}".replace("/", "_")
        self.decoder: Decoder = decoder(part.format, part.clock, clock, kinds, name, part.columns)
        if part.mounting is not None:
            self.decoder = ReceiverWithImu(self.decoder, part.imu, part.mounting)

    @property
    def ended(self) -> bool:
        """True where nothing more will come."""
        return self.port.ended

    def events(self, has_time: bool) -> list[Sample | Measurement]:
        """Return what has come, and with `has_time` what is complete because nothing more came."""
        if self.pulses is not None and self.pulse_clock is not None:
            if (came := self.pulses.read()) is not None:
                self.pulse_clock.take_pulse(time_of_arrival(came))
            self.pulse_clock.look(time_of_arrival())
        found: list[Sample | Measurement] = []
        lost = self.port.lost
        for k, piece in enumerate(self.port.read()):
            events = self.decoder.feed(piece + b"\n" if self.ends_lines else piece)
            found += events
            if self.port.senders and events and type(events[0]) is Sample:
                self.senders.take(self.port.senders[k])
        if has_time:
            found += self.decoder.idle()
        if self.ended or self.port.lost > lost:
            found += self.decoder.end()
        return self._with_times(found)

    def rest(self) -> list[Sample | Measurement]:
        """Return what is complete because the program ends, and count what is not."""
        return self._with_times(self.decoder.end())

    def _with_times(self, found: list[Sample | Measurement]) -> list[Sample | Measurement]:
        """Return events with times by their arrival where that counts."""
        if self.unstamped is not None:
            return self._at_arrival(self.unstamped, found)
        return found if self.clocked is None else self._by_arrival(self.clocked, found)

    def _at_arrival(
        self, unstamped: Arrivals, found: list[Sample | Measurement]
    ) -> list[Sample | Measurement]:
        """Return measurements with the time of their arrival."""
        now = time_of_arrival(self.decoder.last)
        for _ in found:
            unstamped.take(now)
        t = self._clock.of_gps(float(gps_from_unix(now - self._latency))) if found else 0.0
        return [each._replace(t=t) for each in found]

    def _by_arrival(
        self, clocked: ClockedEvents, found: list[Sample | Measurement]
    ) -> list[Sample | Measurement]:
        """Return events with times by their arrival, those of a receiver's IMU by its own clock."""
        samples: list[Sample | Measurement] = []
        if self.clocked_imu is not None:
            samples = [each for each in found if type(each) is Sample]
            found = [each for each in found if type(each) is not Sample]
            samples = self.clocked_imu.take(samples, time_of_arrival())
        known = clocked.take(found, time_of_arrival(self.decoder.last))
        return known + samples

    @property
    def bad(self) -> int:
        """Number of lines or pieces that could not be read, and of events with a stamp of no use."""
        clocked = [each.bad for each in (self.clocked, self.clocked_imu) if each is not None]
        return self.decoder.bad + sum(clocked)

    @property
    def why(self) -> str:
        """Why the first of these is `bad`."""
        found = [each.why for each in (self.clocked, self.clocked_imu) if each is not None]
        return next(filter(None, [self.decoder.why, *found]), "")

    @property
    def clocks(self) -> dict[str, ClockEstimate | PulseEstimate | ArrivalIntervals]:
        """{port: estimate} of its clocks, that of a receiver's IMU with "IMU" behind the port."""
        own = self.unstamped if self.clocked is None else self.clocked.arrivals
        imu = None if self.clocked_imu is None else self.clocked_imu.arrivals
        names = str(self.port.address), f"{self.port.address} IMU"
        found = [(name, each.estimate) for name, each in zip(names, (own, imu)) if each is not None]
        return {name: estimate for name, estimate in found if estimate is not None}

    def mark(self) -> list[Any] | None:
        """Return where a growing file goes on, for `resume`; None of other ports."""
        found = self.port.mark(self.decoder.unused)
        return [*found, self.decoder.memory] if found else None

    def resume(self, mark: Sequence[Any]) -> None:
        """Go on after what was used before a restart."""
        *place, memory = mark
        self.port.resume(Mark(*map(int, place)), lambda: self.decoder.resume(memory))

    def close(self) -> None:
        """Close the port, and count what waits in vain."""
        self.port.close()
        if isinstance(self.decoder, ReceiverWithImu):
            self.decoder.leave()
        for clocked in filter(None, (self.clocked, self.clocked_imu)):
            clocked.leave()


class _Replayed:
    """An input from a recording, at a speed."""

    def __init__(
        self, part: InputPart, sources: Sequence[Source], tell: Callable[[str], None]
    ) -> None:
        recording = read(part.recording)
        fixes = []
        for a, place in zip(recording.sources, _places(recording.sources, sources)):
            if place is None:
                tell(f"{part.recording}: {a.name or a.kind} is no [[source]]; it is left out")
            else:
                fixes.append(_fix_rows(place, a))
        self.name = f"recording:{part.recording}"
        rows = heapq.merge(_sample_rows(recording.imu), *fixes, key=lambda row: row[:3])
        self._events: Iterator[_Row] = iter(rows)
        self._next = next(self._events, None)
        self._speed, self._first, self._began = part.speed, 0.0, -1.0

    @property
    def ended(self) -> bool:
        """True where nothing more will come."""
        return self._next is None

    def events(self, _: bool) -> list[Sample | Measurement]:
        """Return what is due."""
        if self._next is not None and self._began < 0:
            self._first, self._began = self._next[0], time.monotonic()
        until = inf
        if self._speed < inf:
            until = self._first + self._speed * (time.monotonic() - self._began)
        found: list[Sample | Measurement] = []
        while self._next is not None and self._next[0] <= until and len(found) < BATCH:
            found.append(self._next[3])
            self._next = next(self._events, None)
        return found

    def rest(self) -> list[Sample | Measurement]:
        """Return nothing: events of a recording are whole."""
        return []

    def close(self) -> None:
        """Take nothing more."""
        self._next = None


def _places(recorded: Sequence[Source], own: Sequence[Source]) -> list[int | None]:
    """Return the index among `own` of each source of a recording: the one with its kind and name,
    else the next one of its kind; None where there is none."""
    found: list[int | None] = [None] * len(recorded)
    for alike in (_same_name, _same_kind):
        for i, a in enumerate(recorded):
            free = [k for k, b in enumerate(own) if k not in found and alike(a, b)]
            if found[i] is None and free:
                found[i] = free[0]
    return found


def _same_kind(a: Source, b: Source) -> bool:
    return a.kind == b.kind


def _same_name(a: Source, b: Source) -> bool:
    return a.kind == b.kind and a.name == b.name


_Row = tuple[float, int, int, Sample | Measurement]
"""(t in s, 1 for a sample, source, event): by the first three a fix comes before the sample that ends
with it."""


def _sample_rows(imu: Imu) -> Iterator[_Row]:
    columns = (column.tolist() for column in imu)
    return ((t, 1, 0, Sample(t, dt, tuple(a), tuple(b))) for t, dt, a, b in zip(*columns))


def _fix_rows(source: int, a: Source) -> Iterator[_Row]:
    rows = zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
    return ((t, 0, source, Measurement(t, source, tuple(y), tuple(std))) for t, y, std in rows)


class _StatePort:
    """States to a port at a rate, by the time of the samples."""

    def __init__(self, part: OutputPart) -> None:
        self.sink, self._every = Sink(part.address), 1 / part.rate
        self._encode = encoder(part.format, part.messages)
        self._due = -inf

    def show(self, live: LiveStream, epoch: float | None) -> None:
        """Write the newest state where one is due."""
        t = live.t
        if t < self._due - 1e-6 and t > self._due - 2 * self._every:
            return
        self._due = (t if abs(t - self._due) > self._every else self._due) + self._every
        it = state_at(t, epoch, live.status, live.belief, live.alignments)
        if data := self._encode(it):
            self.sink.write(data)


class _Log:
    """A log of what the filter uses; each start begins a file of its own."""

    def __init__(self, path: str, tell: Callable[[str], None]) -> None:
        self._path, self._tell, self.written = Path(path), tell, list[Path]()
        self._now, self.cut = self._path, dict[Path, str]()  # why a file ends too early
        self._file: BinaryIO | None = None
        self._start: object = None
        self._forced, self._forcing = time.monotonic(), DiskJob(self._fail)

    def use(self, stream: Any, config: Config, sample: Sample, fixes: list[Measurement]) -> None:
        """Write a sample and the measurements used with it."""
        try:
            if self._start is not stream:
                self._begin(stream, config)
            if self._file is not None:
                lines = [fix_line(int(fix.source), fix.t, fix.y, fix.std) for fix in fixes]
                self._file.write("".join([*lines, sample_line(*sample)]).encode())
        except OSError as error:
            self._fail(error)

    def _begin(self, stream: Any, config: Config) -> None:
        self._leave()
        self._start, path = stream, self._free_path()
        assert stream.start is not None  # it has used a sample
        setup = (stream.start, config.imu, config.vehicle, stream.estimated)
        line = head_line(config.filter, stream.used, *setup)
        self._now = path
        self._file = path.open("xb")
        self.written.append(path)
        self._file.write(line.encode())

    def _free_path(self) -> Path:
        """Return the path, or the first of its numbered ones that is free."""
        path, number = self._path, 1
        while path.exists():
            number += 1
            path = self._path.with_name(f"{self._path.stem}-{number}{self._path.suffix}")
        return path

    def force(self) -> None:
        """Have what was written brought to the disk once in FLUSH s."""
        now = time.monotonic()
        if not self._forcing.is_free() or self._file is None or now < self._forced + FLUSH:
            return
        self._forced = now
        try:
            self._file.flush()
            self._forcing.begin(_on_disk, self._now, os.fsync, self._file.fileno())
        except OSError as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        path = Path(getattr(error, "filename", None) or self._now)
        if path in self.cut:  # as when what was left over is written
            return
        self.cut[path] = why = getattr(error, "strerror", "") or str(error)
        self._tell(f"log: {path}: cannot be written ({why}); it ends here")
        if path == self._now:
            self._leave()

    def _leave(self) -> None:
        """Have the file closed, once what was written is on the disk."""
        file, self._file = self._file, None
        if file is not None:
            self._forcing.begin(_on_disk, self._now, file.close)

    def close(self) -> None:
        """Close the file, and wait for the disk."""
        self._leave()
        self._forcing.end()


def _on_disk(path: Path, function: Callable[..., None], *arguments: object) -> None:
    """Call a function on a file, whose errors name it: the next one may have begun."""
    try:
        function(*arguments)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _not_replaced(text: str) -> DataError:
    return DataError(f"{text}; to keep the file, name another one as `state`, else remove it")


class Live:
    """A filter in a running system, as `strapdown live` runs it: samples and measurements from ports,
    states to ports, a log and a state on disk.

    Parameters
    ----------
    config : str, Path or dict
        A TOML file, or a table with its keys (docs/how-to/live.md).
    on_event : callable
        Function called with (t, text) of each event when it begins.
    page : int
        Port of 127.0.0.1 where a page in the browser shows what the filter does; 0: one that is free.

    Attributes
    ----------
    stream : LiveStream
        The filter.
    verdicts : VerdictProcess
        The process that judges the filter, and why it failed.
    page : str
        Address of the page; empty without one.

    Raises
    ------
    DataError
        If the configuration has an unknown key or a value out of range, or another program has the port
        of the page.

    Examples
    --------
    >>> import strapdown as sd
    >>> port = {"port": "udp:127.0.0.1:7001", "format": "json"}
    >>> with sd.Live({"imu": "consumer", "filter": "mekf", "input": [port]}) as live:
    ...     live.stream.waits_for
    'the first IMU sample'
    """

    def __init__(
        self,
        config: str | Path | Mapping[str, Any] | Config,
        on_event: OnEvent | None = None,
        page: int | None = None,
    ) -> None:
        self.config = own = config_of(config)
        self._on_event = on_event
        self._dashboard: Dashboard | None = None
        self.verdicts, self._wants_verdict, self._failure = VerdictProcess(), False, ""
        self.clock = Clock(own.epoch)
        self._log = _Log(own.log, self._tell) if own.log else None
        with locate_errors(own.name):
            self.stream = LiveStream(
                own.filter,
                sources=own.sources,
                imu=own.imu,
                vehicle=own.vehicle,
                lag=own.lag,
                replay=own.replay,
                align_within=own.align_within,
                options=own.options,
                estimate=own.estimate,
                on_event=self._hear,
                on_use=self._use if self._log else None,
            )
        if page is not None:
            self.watch()
        kinds = [a.kind for a in own.sources]
        self.inputs: list[_Bytes | _Replayed] = [
            _Replayed(part, own.sources, self._tell)
            if part.recording
            else _Bytes(part, self.clock, kinds)
            for part in own.inputs
        ]
        self.outputs = [_StatePort(part) for part in own.outputs]
        self._heard = self._saved = time.monotonic()
        self._saving = DiskJob(lambda error: self._tell(str(error)))
        self._notices, self._looked = Notices(self._tell), -inf
        self._is_silent, self._closed, self._ends = False, False, False
        self._is_restored = False  # and no sample of use came since
        if own.state and Path(own.state).exists():
            self._restore()
        self._server = None if page is None else PageServer(self.watch(), page)
        self.page = self._server.url if self._server else ""

    def watch(self) -> Dashboard:
        """Return the numbers that a page shows, which are taken ten times a second from now on."""
        if self._dashboard is None:
            self._dashboard = Dashboard(self.config.name, self.config.filter)
        return self._dashboard

    def _restore(self) -> None:
        """Go on from the state on disk. Raises DataError where the file is of something else, since
        the next save would replace it."""
        path, own = self.config.state, self.config.epoch
        try:
            self.stream.restore(path)
        except OtherStateError as error:
            raise _not_replaced(str(error)) from error
        except DataError as error:
            self._tell(f"{error}; beginning anew")
            return
        saved = self.stream.epoch
        if own is not None and saved != own:
            raise _not_replaced(f"{path}: was saved with another epoch")
        self._is_restored = True
        # times go on from the same midnight, however long the program was off
        self.clock.epoch = saved
        for name, mark in self.stream.carried.items():
            for each in self._growing_files():
                if str(each.port.address) == name:
                    each.resume(mark)
        where = f"from {self.stream.t:.2f} s" if self.stream.started else "before its first state"
        self._tell(f"{path}: goes on {where}")

    # ---- the loop

    def turn(self) -> bool:
        """Take what has come, and write what is due; return False where nothing had come."""
        count = 0
        for each in self.inputs:
            for event in each.events(not CALM < self.since_sample < QUIET):
                count += 1
                self._step(event)
        self._look_after()
        return count > 0

    def _step(self, event: Sample | Measurement) -> None:
        newest = self.stream.stream.newest
        self.stream.step(event)
        # a sample that is dropped, or waits to be confirmed, renews nothing; a new alignment may begin
        # at an earlier time
        if isinstance(event, Sample) and self.stream.stream.newest != newest:
            self._hear_samples()
            if self.stream.started:
                for output in self.outputs:
                    output.show(self.stream, self.clock.epoch)
                if self._dashboard is not None:
                    self._dashboard.pass_by(self.stream)

    def _hear_samples(self) -> None:
        self._heard, self._is_restored = time.monotonic(), False
        if self._is_silent:
            self._is_silent = False
            self._tell("IMU: samples come again")

    def _look_after(self) -> None:
        """Force the log to the disk, save the state, and see whether samples still come."""
        now = time.monotonic()
        if self._log is not None:
            self._log.force()
        due = self.config.state and now >= self._saved + self.config.save_every
        if self._saving.is_free() and due:
            self._saved = now
            self._save()
        if now >= self._looked + LOOK:
            if self._looked == -inf:
                self._tell_open_ports()
            self._looked = now
            self._look_at_ports()
        if now > self._heard + IMU_SILENT and not self._is_silent:
            self._is_silent = True
            self._tell(f"IMU: no sample of use for {IMU_SILENT:g} s")
        self._judge()
        self._show()

    def _judge(self) -> None:
        """Let another process make verdicts while somebody wants them."""
        if self._wants_verdict or (self._dashboard is not None and self._dashboard.viewers):
            self.verdicts.look(self.stream.stream)
            before, self._failure = self._failure, self.verdicts.error
            if self._failure and self._failure != before:
                self._tell(f"verdict: {self._failure}; the filter goes on")

    def _show(self) -> None:
        """Let those who watch have the newest numbers; a fault there never ends the filter."""
        if self._dashboard is None:
            return
        try:
            self._dashboard.look(self)
        except Exception as error:
            dashboard, self._dashboard = self._dashboard, None
            dashboard.close()
            self._tell(f"page: {one_line(error)}; it shows nothing more")

    def _growing_files(self) -> list[_Bytes]:
        """Return the inputs from files that grow."""
        found = [each for each in self.inputs if isinstance(each, _Bytes)]
        return [each for each in found if each.port.address.kind == "file"]

    def _tell_open_ports(self) -> None:
        """Report that what is sent from now on is read; a connection is still being made."""
        inputs = [each.port for each in self.inputs if isinstance(each, _Bytes)]
        opened = [each.address for each in inputs if not each.error and each.address.kind != "tcp"]
        if names := [str(address) for address in opened]:
            self._tell(f"ports open: {', '.join(names)}")

    def _look_at_ports(self) -> None:
        """Report ports that fail or go on again, and inputs that cannot be read."""
        for each in self.inputs:
            if isinstance(each, _Bytes):
                self._notices.of_port(each.port, "")
                self._notices.of_input(each.port, each.decoder, each.bad, each.why, each.senders)
                if each.pulses is not None and each.pulse_clock is not None:
                    self._notices.of_pulses(each.pulses, each.pulse_clock)
                for clocked in filter(None, (each.clocked, each.clocked_imu)):
                    self._notices.of_clock(each.port, clocked.arrivals.news)
        for output in self.outputs:
            lost = f"; lost: {output.sink.dropped} states"
            self._notices.of_port(output.sink, lost)

    def _save(self) -> None:
        carried = self.stream.carried
        for each in self._growing_files():
            if mark := each.mark():
                carried[str(each.port.address)] = mark
        self.stream.epoch = self.clock.epoch
        path = self.config.state
        try:
            text = state_text(path, self.stream.saved_content())
            self._saving.begin(write_state_text, path, text)
        except DataError as error:
            self._tell(str(error))

    def run(self, seconds: float = inf) -> None:
        """Go on until all inputs have ended, for so many seconds, or until `end`, and close all.

        Parameters
        ----------
        seconds : float
            Longest time, s.

        Raises
        ------
        DataError
            If `seconds` is negative or NaN.
        """
        check_number(seconds, "seconds", "s", least=0, infinite=True)
        end = time.monotonic() + seconds
        try:
            while time.monotonic() < end and not self._ends:
                if all(each.ended for each in self.inputs):
                    break
                if not self.turn():
                    self._wait()
        finally:
            self.close()

    def end(self) -> None:
        """Let `run` end after the turn that it is in; for a handler of signals, or another thread."""
        self._ends = True

    def _wait(self) -> None:
        """Sleep until a port has bytes, at most for PAUSE s, since files are looked at."""
        ports = [each.port.number for each in self.inputs if isinstance(each, _Bytes)]
        select.select([number for number in ports if number is not None], [], [], PAUSE)

    def close(self) -> None:
        """Use what waits, save the state, and close log and ports. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        # what a restart reads again is left to it
        left = self._growing_files() if self.config.state else []
        for each in self.inputs:
            for event in each.rest() if each not in left else []:
                self._step(event)
        if self.config.state:
            self._save()
        self._saving.end()
        self._finish()
        self.verdicts.close()
        for each in self.inputs:
            each.close()
        for output in self.outputs:
            output.sink.close()
        self._look_at_ports()
        if self._log is not None:
            self._log.close()
        if self._dashboard is not None:
            self._dashboard.close()
        if self._server is not None:
            self._server.close()

    def _finish(self) -> None:
        """Use what waits, or count it where there was no start; a state on disk keeps that."""
        try:
            if self.stream.started:
                self.stream.finish()
            elif not self.config.state:
                self.stream.leave()
        except DataError as error:
            self._tell(str(error))

    def __enter__(self) -> "Live":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ---- reports

    def _use(self, sample: Sample, fixes: list[Measurement]) -> None:
        assert self._log is not None  # it asks for them
        self._log.use(self.stream.stream, self.config, sample, fixes)

    def _tell(self, text: str) -> None:
        newest = self.stream.stream.newest if hasattr(self, "stream") else -inf
        self._hear(newest if newest > -inf else 0.0, text)

    def _hear(self, t: float, text: str) -> None:
        if self._dashboard is not None:
            self._dashboard.hear(t, text)
        if self._on_event is None:
            return
        try:
            self._on_event(t, text)
        except Exception as error:
            self._on_event = None
            self._hear(t, self.stream.note_deaf(t, error))

    @property
    def verdict(self) -> SpanVerdict | None:
        """The newest verdict on what the filter has kept, with its span; None before there is one.
        Another process makes them, while somebody watches, and from the first call of this on."""
        self._wants_verdict = True
        return self.verdicts.newest

    @property
    def bad(self) -> int:
        """Number of lines, and of pieces of a receiver, that could not be read."""
        return sum(each.bad for each in self.inputs if isinstance(each, _Bytes))

    @property
    def missed(self) -> dict[str, int]:
        """{port: number of datagrams that the system dropped}, where it tells (Linux)."""
        ports = [each.port for each in self.inputs if isinstance(each, _Bytes)]
        return {str(port.address): port.missed for port in ports if port.address.kind == "udp"}

    @property
    def unsent(self) -> dict[str, int]:
        """{port: number of states that it did not take} of the outputs."""
        return {str(each.sink.address): each.sink.dropped for each in self.outputs}

    @property
    def ports(self) -> dict[str, str]:
        """{port: why it cannot be used now, empty where it can} of inputs, pulses and outputs."""
        replayed = [each.name for each in self.inputs if isinstance(each, _Replayed)]
        inputs = [each for each in self.inputs if isinstance(each, _Bytes)]
        places: list[Port | PulseFile | Sink] = [each.port for each in inputs]
        places += [each.pulses for each in inputs if each.pulses is not None]
        places += [each.sink for each in self.outputs]
        return dict.fromkeys(replayed, "") | {str(each.address): each.error for each in places}

    @property
    def since_sample(self) -> float:
        """s since the last sample came that the stream took, or the program began."""
        return time.monotonic() - self._heard

    @property
    def is_stale(self) -> bool:
        """True where no sample that the stream took came for so long that a filter would not bridge it,
        or since a restart from a state on disk."""
        is_old = self._is_restored or self.since_sample > BRIDGE
        return self.stream.stream.newest > -inf and is_old

    @property
    def status(self) -> int:
        """Status of the state now: that of the stream, INVALID where it `is_stale`."""
        return INVALID if self.is_stale else self.stream.status

    @property
    def clocks(self) -> dict[str, ClockEstimate | PulseEstimate | ArrivalIntervals]:
        """{port: estimate} of the inputs with the clock "arrival" or "none"."""
        found: dict[str, ClockEstimate | PulseEstimate | ArrivalIntervals] = {}
        for each in self.inputs:
            if isinstance(each, _Bytes):
                found |= each.clocks
        return found

    @property
    def logs(self) -> list[Path]:
        """Files of the log, one for each start."""
        return [*self._log.written] if self._log else []

    @property
    def cut_logs(self) -> dict[str, str]:
        """{file of the log: why it ends too early}."""
        return {str(path): why for path, why in self._log.cut.items()} if self._log else {}
