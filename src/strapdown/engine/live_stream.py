"""A stream for a program that must go on: bad data, long gaps, clocks that jump and a filter that stops end
in counts, events and a new alignment, never in an exception."""

from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from math import inf, isfinite, nan
from typing import Any, NamedTuple, NoReturn, Unpack

from ..checks import DataError, is_number
from ..core.loop.contract import Filter, FilterState, InitialState
from ..core.loop.gaps import BRIDGE
from ..core.loop.log import FOLD
from ..data.solution import Solution, Source
from ..data.verdict import Verdict
from ..plugins import one_line
from ..typing import File
from .arrivals import Measurement, Sample, measurement_of, sample_of, unit_of_stamps
from .notifier import OnEvent
from .options import RunOptions, takes
from .saved_state import contradiction, read_state, write_state
from .stream import HISTORY, OnUse, Stream

SUSPICIOUS = BRIDGE
"""s by which the time of a sample may step ahead; beyond that others must confirm it."""
LONG_GAP = 60.0
"""s without samples after which the attitude that the filter held is unknown: by the noise of a held gap
its standard deviation is then 44 deg."""
CONFIRMED = 1.0
"""s for which samples must go on at a later time before that is taken for the time."""
CONFIRMED_BACK = 0.5
"""The same of an earlier time, s, where the state stands still meanwhile."""
MAX_SUSPECTS = 20_000
"""Largest number of samples that wait for that."""
MAX_STEP = 1.0
"""s between two such samples, at most."""
SILENT, SILENT_INTERVALS = 5.0, 10.0
"""A source is silent after so many s, or so many of its intervals where these take longer."""
MEAN_OF = 20
"""Number of intervals of which the mean counts."""
NEVER_HEARD = 30.0
"""s of samples after which a source without a measurement is silent."""
AGAIN = 60.0
"""s after which it is said again that no measurement of a source can be used."""
MAX_EVENTS = 1000
"""Largest number of events that are kept of alignments before the present one."""
INVALID_DATA, OTHER_TIME, LEFT = "invalid", "at another time", "before a new alignment"
"""Reasons why data are dropped, beside those of a Stream."""


LATE = "late"
"""The reason of a Stream that names by how much."""


class _Heard(NamedTuple):
    """The measurements of a source so far."""

    number: int = 0
    t: float = nan  # s, of the samples when the last one came
    interval: float = 0.0  # s, mean of the last ones
    used: float = nan  # s, when the last one came that could be used
    lost: tuple[tuple[str, int], ...] = ()  # (reason, number) of those since that could not
    behind: float = 0.0  # s by which they were too late, at most


class Watchdog:
    """Tells which sources are silent, by the time of the samples."""

    def __init__(self, sources: int) -> None:
        self._heard = [_Heard()] * sources
        self._due = -inf
        self._first = inf

    def hear(self, source: int, t: float, lost: str = "", behind: float = 0.0) -> None:
        """Take the time of the samples when a measurement comes, s; `lost` is the reason why it cannot
        be used, `behind` the s by which it is too late."""
        before = self._heard[source]
        number, last, interval = before[:3]
        if number:
            interval += (t - last - interval) / min(number, MEAN_OF)
        if lost:
            counts = dict(before.lost)
            counts[lost] = counts.get(lost, 0) + 1
            left = before.used, tuple(counts.items()), max(behind, before.behind)
        else:
            left = t, (), 0.0
        self._heard[source] = _Heard(number + 1, t, interval, *left)

    def silent(self, t: float) -> list[tuple[int, float]]:
        """[(source, s since its last measurement that could be used)] of the silent ones at `t` s."""
        return [
            (k, t - self._since(heard)) for k, heard in enumerate(self._heard) if self._is(t, heard)
        ]

    def losses(self, source: int) -> dict[str, int]:
        """{reason: number} of the measurements of a source since the last one that could be used."""
        return dict(self._heard[source].lost)

    def behind(self, source: int) -> float:
        """s by which these were too late, at most."""
        return self._heard[source].behind

    def _since(self, heard: _Heard) -> float:
        return heard.used if heard.used == heard.used else self._first

    def _is(self, t: float, heard: _Heard) -> bool:
        limit = max(SILENT, SILENT_INTERVALS * heard.interval) if heard.number else NEVER_HEARD
        return t - self._since(heard) > limit

    def is_due(self, t: float) -> bool:
        """True once a second of samples."""
        self._first = min(self._first, t)
        if t < self._due:
            return False
        self._due = t + 1.0
        return True


@takes(RunOptions)
class LiveStream:
    """A `Stream` for a running system. It takes the same data in the same way and returns the same
    states, and `step` never raises on data.

    - Invalid samples and measurements are dropped, counted and reported.
    - After 60 s without samples, where the time of the samples steps back, and where the filter
      stops, the stream aligns anew from the samples and measurements since.
    - Where the time of a sample steps ahead by more than 1 s, or back to times that have samples,
      the stream goes on there once samples have done so for 1 s, or 0.5 s, and drops it otherwise.
    - A source that falls silent for 5 s, and ten of its intervals, or of which nothing can be
      used for so long, is reported, and that it came back, too.

    Parameters
    ----------
    filter, sources, lag, on_event, align_within, history, replay, on_use
        As for `Stream`.

    Attributes
    ----------
    epoch : float or None
        Moment of time zero, s of GPS time since its zero, for `save` and `restore`; None where the
        caller gave none.
    carried : dict
        Texts and numbers of the caller, for `save` and `restore`.

    Raises
    ------
    DataError
        If an argument is out of range, or `imu` is missing, without which there is no alignment.

    Examples
    --------
    >>> import strapdown as sd
    >>> live = sd.LiveStream("mekf", imu="consumer")
    >>> live.waits_for
    'the first IMU sample'
    >>> _ = live.step(sd.Sample(0.01, -0.01, (0, 0, 0), (0, 0, -0.098)))
    >>> live.dropped_by["invalid"]
    1
    """

    def __init__(
        self,
        filter: str | Filter,
        *,
        sources: Sequence[Source] = (),
        lag: float = 0.0,
        on_event: OnEvent | None = None,
        align_within: float = 60.0,
        history: int = HISTORY,
        replay: bool = False,
        on_use: OnUse | None = None,
        **given: Unpack[RunOptions],
    ) -> None:
        def stream(begin: InitialState | None) -> Stream:
            return Stream(
                filter,
                sources=sources,
                lag=lag,
                on_event=None if on_event is None else self._hear,
                align_within=align_within,
                history=history,
                replay=replay,
                on_use=on_use,
                **given | {"start": begin},
            )

        self.epoch: float | None = None
        self.carried: dict[str, Any] = {}
        start = given.get("start")
        self._unstarted = stream(None)
        self._stream = deepcopy(self._unstarted) if start is None else stream(start)
        self._on_event, self._is_deaf = on_event, False
        (limits,) = self._unstarted.limits
        # as floats, since reading them from the table takes a third of a step
        ranges = ((limits.gyro_range, "rad/s"), (limits.accel_range, "m/s^2"))
        self._ranges = [(float(largest), unit) for largest, unit in ranges]
        self._names = [a.name or a.kind for a in sources]
        self._dropped = {INVALID_DATA: 0, OTHER_TIME: 0, LEFT: 0}
        # of streams before the present one
        self._past: deque[tuple[float, str]] = deque(maxlen=MAX_EVENTS)
        self._counted = [(0, 0)] * len(sources)
        self._dropped_before: dict[str, int] = {}
        self._said: dict[str, float] = {}  # s, when each of its own events was so last
        self._alignments = 0
        self._forget_suspects()
        self._watchdog, self._silent = Watchdog(len(sources)), set[int]()

    # ---- data

    def step(self, event: Sample | Measurement) -> FilterState:
        """Take a Sample or a Measurement and return the filter state (updated in place), NaN before
        an alignment. It raises nothing on data, only TypeError for what is neither."""
        if isinstance(event, Sample):
            self._take_sample(event)
        elif isinstance(event, Measurement):
            if self._suspects and (fix := _plain_fix(event)):
                self._hold_fix(fix)
            else:
                self._use_fix(event)
        else:
            raise TypeError(
                f"step is given a {type(event).__name__}, neither Sample nor Measurement"
            )
        return self._stream.belief

    def _take_sample(self, sample: Sample) -> None:
        try:
            away = sample.t - self._stream.newest
            _, dt, (a, b, c), (d, e, f) = sample
            isfinite(dt + a + b + c + d + e + f)  # they are numbers
            jumps = inf > away > SUSPICIOUS
            jumps = jumps or (-inf < away <= 0 and self._stream.has_sample_at(sample))
            is_newer = away > 0
        except (TypeError, ValueError, OverflowError):  # which the stream refuses
            jumps = is_newer = False
        if jumps:
            self._suspect(sample)
        else:
            if self._suspects and is_newer and not self._beyond_range(sample):
                self._drop_suspects()
            if self._use_sample(sample) and self._watchdog.is_due(self._stream.newest):
                self._tell_silence()

    def _use_fix(self, fix: Measurement) -> None:
        """Give a measurement to the stream."""
        before = self._stream.dropped_by
        passed, newest = self._pass_on(fix), self._stream.newest
        if newest == -inf:
            return
        with suppress(DataError):  # of no source
            source = self._stream.source_index(fix.source)
            if not passed:
                self._watchdog.hear(source, newest, INVALID_DATA)
                return
            after = self._stream.dropped_by
            lost = next((cause for cause, count in after.items() if count > before[cause]), "")
            behind = newest - self._stream.lag - fix.t if lost == LATE else 0.0
            self._watchdog.hear(source, newest, lost, behind)

    def _use_sample(self, sample: Sample) -> bool:
        """Give a sample to the stream; return False where it is refused."""
        if off := self._beyond_range(sample):
            self._refuse(f"IMU sample at {sample.t:.3f} s: {off}")
            return False
        return self._pass_on(sample)

    def _beyond_range(self, sample: Sample) -> str:
        """Say which value no alignment can use, because no sensor measures it; empty of others. After
        the start the filter bridges them, as long as they are numbers that a sensor could send."""
        factor = 1e3 if self._stream.started else 1.0
        try:
            _, dt, *increments = sample
            for (largest, unit), values in zip(self._ranges, increments):
                if (rate := max(map(abs, values)) / dt) > factor * largest:
                    return f"{rate:.4g} {unit} is out of range"
        except (TypeError, ValueError, ArithmeticError):  # which the stream refuses
            pass
        return ""

    def _pass_on(self, event: Sample | Measurement) -> bool:
        """Give data to the stream; return False where it refuses them or stops."""
        try:
            self._stream.step(event)
        except DataError as error:
            if self._stream.stopped:
                self._align_anew(str(error), self._stream.newest)
            else:
                self._refuse(str(error))
            return False
        return True

    def _refuse(self, text: str) -> None:
        self._dropped[INVALID_DATA] += 1
        self._say(INVALID_DATA, f"invalid data dropped, the first: {text}")

    # ---- samples at another time

    def _forget_suspects(self) -> None:
        self._suspects: list[Sample] = []
        self._suspect_fixes: deque[Measurement] = deque()

    def _hold_fix(self, fix: Measurement) -> None:
        """Let a measurement wait until it is known what the time is."""
        if len(self._suspect_fixes) == MAX_EVENTS:
            self._use_fix(self._suspect_fixes.popleft())
        self._suspect_fixes.append(fix)

    def _suspect(self, sample: Sample) -> None:
        """Take a sample of which the time jumps; go on there once others have confirmed it."""
        suspects = self._suspects
        apart = sample.t - suspects[-1].t if suspects else 0.0
        if abs(apart) > max(MAX_STEP, self._stream.lag):
            self._drop_suspects(apart)
        elif len(suspects) == MAX_SUSPECTS:
            self._drop_suspects()
        self._suspects.append(sample)
        ahead = sample.t > self._stream.newest
        if sample.t - self._suspects[0].t >= (CONFIRMED if ahead else CONFIRMED_BACK):
            # a sender whose line came back may repeat itself, or send what it could not
            if not ahead and self._stream.explains(self._suspects):
                self._drop_suspects()
            else:
                self._follow_suspects()

    def _follow_suspects(self) -> None:
        """Go on at the time of the suspects, after a gap or with a new alignment."""
        suspects, fixes = self._suspects, self._suspect_fixes
        jump = suspects[0].t - self._stream.newest
        self._forget_suspects()
        if not 0 < jump <= LONG_GAP:
            where = "without samples" if jump > 0 else "back in the time of the samples"
            self._align_anew(f"{abs(jump):.1f} s {where}", suspects[0].t)
        for fix in fixes:
            self._use_fix(fix)
        for sample in suspects:
            self._use_sample(sample)

    def _drop_suspects(self, apart: float = 0.0) -> None:
        """Count the suspects; the stream uses or counts those of the last minute, which are late. The
        next sample is `apart` s after them."""
        suspects, fixes = self._suspects, self._suspect_fixes
        self._forget_suspects()
        for fix in fixes:
            self._use_fix(fix)
        first, last = self._stream.newest - LONG_GAP, self._stream.newest
        others = [sample for sample in suspects if not first <= sample.t <= last]
        for sample in suspects:
            if first <= sample.t <= last:
                self._use_sample(sample)
        if others:
            self._dropped[OTHER_TIME] += len(others)
            off = f"{others[0].t - self._stream.newest:+.6g} s away"
            if apart > MAX_STEP and others[-1].t > self._stream.newest:
                off += f", the next {apart:.4g} s after it: are stamps in {unit_of_stamps(apart)}?"
            self._say(OTHER_TIME, f"IMU samples at another time dropped, the first {off}")

    def _align_anew(self, reason: str, t: float) -> None:
        """Begin with a new stream that has not started, after the data that wait in the old one."""
        old = self._stream
        if old.started and not old.stopped:
            with suppress(DataError):  # then it stops now
                old.finish()
        if not old.started or old.stopped:
            self._dropped[LEFT] += old.unused
        self._dropped[LEFT] += len(self._suspects) + len(self._suspect_fixes)
        self._past.extend(old.events)
        self._counted = self.counts()
        for cause, count in old.dropped_by.items():
            self._dropped_before[cause] = self._dropped_before.get(cause, 0) + count
        self._stream = deepcopy(self._unstarted)
        self._watchdog, self._silent = Watchdog(len(self._names)), set()
        self._alignments += 1
        self._forget_suspects()
        self._say("anew", f"{reason}: aligning anew", t)

    # ---- reports

    def _say(self, about: str, text: str, t: float | None = None) -> None:
        """Report an event unless the same was so less than FOLD s ago."""
        if t is None:
            t = self._stream.newest
        t = t if t > -inf else 0.0
        last, self._said[about] = self._said.get(about, -inf), t
        if not abs(t - last) <= FOLD:
            self._past.append((t, text))
            self._hear(t, text)

    def _hear(self, t: float, text: str) -> None:
        """Pass an event on; a callback that raises is not called again."""
        if self._on_event is None or self._is_deaf:
            return
        try:
            self._on_event(t, text)
        except Exception as error:
            self._is_deaf = True
            self.note_deaf(t, error)

    def note_deaf(self, t: float, error: Exception) -> str:
        """Add to the `events` that a callback raised an exception, and return the text."""
        said = f"on_event raised {one_line(error)}; the callback is not called again"
        self._past.append((t, said))
        return said

    def _tell_silence(self) -> None:
        """Report sources that have fallen silent since the last look, and those that came back."""
        silent = dict(self._watchdog.silent(now := self._stream.newest))
        for source, seconds in silent.items():
            name = self._names[source]
            if lost := self._watchdog.losses(source):
                if not abs(now - self._said.get(about := f"lost {source}", -inf)) < AGAIN:
                    self._say(about, f"{name}: {self._lost_text(source, lost, seconds)}", now)
            else:
                text = f"{name}: silent for {seconds:.1f} s: check its connection"
                self._say(f"silent {source}", text)
        for source in self._silent - silent.keys():
            was_lost = self._said.pop(f"lost {source}", None) is not None
            how = "are used again" if was_lost else "come again"
            self._say(f"back {source}", f"{self._names[source]}: its measurements {how}")
        self._silent = set(silent)

    def _lost_text(self, source: int, lost: Mapping[str, int], seconds: float) -> str:
        """Say why measurements came and none could be used."""
        if set(lost) == {LATE}:
            return (
                f"all measurements of the last {seconds:.1f} s came too late, by up to "
                f"{self._watchdog.behind(source):.3g} s more than the lag of {self._stream.lag:g} s: "
                "set a longer lag"
            )
        counts = ", ".join(f"{count} {reason}" for reason, count in lost.items())
        return f"none of the measurements of the last {seconds:.1f} s could be used: {counts}"

    @property
    def silent(self) -> dict[str, float]:
        """{name: s since its last measurement that could be used} of the sources that are silent."""
        found = self._watchdog.silent(self._stream.newest)
        return {self._names[source]: seconds for source, seconds in found}

    @property
    def waits_for(self) -> str:
        """Data that are needed before the state is valid, as text; empty where it is."""
        text = self._stream.waits_for
        lost = [
            f"{name} {count} {reason}"
            for source, name in enumerate(self._names)
            for reason, count in self._watchdog.losses(source).items()
        ]
        return f"{text} (dropped: {', '.join(lost)})" if text and lost else text

    @property
    def stream(self) -> Stream:
        """The present Stream, which is replaced where it aligns anew."""
        return self._stream

    @property
    def alignments(self) -> int:
        """Number of times that it began to align anew."""
        return self._alignments

    @property
    def started(self) -> bool:
        """True while there is a filter state."""
        return self._stream.started

    @property
    def belief(self) -> FilterState:
        """The filter state, NaN before an alignment."""
        return self._stream.belief

    @property
    def now(self) -> FilterState:
        """A copy of the filter state at the newest sample, as `Stream.now`."""
        return self._stream.now

    @property
    def t(self) -> float:
        """Time of the filter state, s; NaN before an alignment."""
        return self._stream.t

    @property
    def status(self) -> int:
        """VALID, BRIDGED, INVALID or DOUBTFUL, as in a row of a Solution."""
        return self._stream.status

    @property
    def events(self) -> list[tuple[float, str]]:
        """[(t, text)] of the events, those before the last alignment first."""
        return [*self._past, *self._stream.events]

    @property
    def dropped_by(self) -> dict[str, int]:
        """Numbers of unused samples and measurements by reason."""
        here = self._stream.dropped_by
        before = {
            cause: self._dropped_before.get(cause, 0) + count for cause, count in here.items()
        }
        return before | self._dropped

    def counts(self) -> list[tuple[int, int]]:
        """(accepted, rejected) per source, of all alignments."""
        pairs = zip(self._counted, self._stream.counts())
        return [(used + more, refused + others) for (used, refused), (more, others) in pairs]

    @property
    def solution(self) -> Solution:
        """The Solution since the last alignment, as `Stream.solution`. Raises DataError before."""
        return self._stream.solution

    @property
    def verdict(self) -> Verdict:
        """The verdict on its `solution`."""
        return self._stream.verdict

    def finish(self) -> FilterState:
        """Use all data that wait, as `Stream.finish`. Raises DataError where no start is
        possible."""
        if self._suspects:
            self._drop_suspects()
        return self._stream.finish()

    def leave(self) -> None:
        """Count the data that wait for a start, where it ends without one."""
        if self._suspects:
            self._drop_suspects()
        if not self._stream.started:
            reason = "before the start"
            count = self._dropped_before.get(reason, 0) + self._stream.unused
            self._dropped_before[reason] = count

    # ---- copies, save and restore

    def __deepcopy__(self, memo: dict[int, Any]) -> "LiveStream":
        own = object.__new__(type(self))
        memo[id(self)] = own
        for name, value in vars(self).items():
            setattr(own, name, value if name == "_on_event" else deepcopy(value, memo))
        return own

    def __copy__(self) -> NoReturn:
        raise TypeError("a copy of a LiveStream would share its state: use copy.deepcopy")

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError("a LiveStream cannot be pickled: use its methods save and restore")

    def save(self, path: File) -> None:
        """Write the state to a file, as `Stream.save`. Raises DataError."""
        write_state(path, self.saved_content())

    def saved_content(self) -> dict[str, Any]:
        """Return what `save` writes. Raises DataError."""
        past: dict[str, Any] = {
            "past": [*self._past],
            "counted": self._counted,
            "before": self._dropped_before,
            "own": self._dropped,
            "alignments": self._alignments,
            "epoch": self.epoch,
            "carried": self.carried,
            "said": self._said,
            "suspects": self._suspects,
            "suspect fixes": [*self._suspect_fixes],
        }
        return self._stream.saved_content() | {"live": past}

    def restore(self, path: File) -> FilterState:
        """Go on from a file that `save` wrote, as `Stream.restore`. Raises DataError; the stream is
        then unchanged."""
        saved = read_state(path)
        stream = deepcopy(self._unstarted)
        stream.put_content(path, saved)
        try:
            past: Mapping[str, Any] = saved["live"]
            alignments = int(past["alignments"])
            counted = [(int(used), int(refused)) for used, refused in past["counted"]]
            said = [(float(t), str(text)) for t, text in past["past"]]
            before = {str(cause): int(count) for cause, count in past["before"].items()}
            own = {cause: int(past["own"][cause]) for cause in self._dropped}
            epoch = past["epoch"]
            epoch = None if epoch is None else float(epoch)
            carried = dict(past["carried"])
            told = {str(about): float(t) for about, t in past["said"].items()}
            suspects = [sample_of(sample) for sample in past["suspects"]]
            fixes = [measurement_of(fix) for fix in past["suspect fixes"]]
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise contradiction(path) from error
        self._counted, self._dropped_before, self._dropped = counted, before, own
        self._past, self._alignments = deque(said, MAX_EVENTS), alignments
        self.epoch, self.carried = epoch, carried
        self._stream, self._silent = stream, set()
        self._watchdog = Watchdog(len(self._names))
        self._said, self._suspects, self._suspect_fixes = told, suspects, deque(fixes)
        return stream.belief


def _plain_fix(fix: Measurement) -> Measurement | None:
    """Return a measurement in numbers that `save` can write; None where it has others, which the
    stream refuses."""
    try:
        return measurement_of(fix) if is_number(fix.t) else None
    except (TypeError, ValueError, OverflowError):
        return None
