"""When fixes are withheld: protocols of outages, as text or as windows in seconds.

30/300              30 s at the end of every 300 s of the recording but the first
                    (Alam, Whidborne & Millidere)
15:                 from 15 s to the end
100:130,200:230     a list of windows
30@240:575/5        a sweep: windows of 30 s inside 240 to 575 s, one every 5 s;
                    several lengths as 10,30,60@240:575/5
"""

import math
from collections.abc import Callable, Iterable
from itertools import islice
from typing import NamedTuple, TypeAlias

from ...checks import DataError, check_number
from ...core.loop.contract import InitialState

Window: TypeAlias = tuple[float, float]
"""Start and stop, s."""
SWEEP_STEP = 5.0
"""Default interval of the windows of a sweep, s."""
SETTLING = 60.0
"""s after the start in which a sweep that names no range withholds nothing."""
MAX_WINDOWS = 5000
"""Windows that a protocol may have."""
ROUNDING = 1e-6
"""s: times are compared with this much room."""
PROTOCOL_HINT = "write 30/300 (30 s at the end of every 300 s), 15: (from 15 s on), 100:130,200:230 (windows) or 30@240:575/5 (a sweep)"


class Protocol(NamedTuple):
    """Windows in which fixes are withheld, and whether all in one run or each in a run of its
    own."""

    text: str  # as given, or from the windows
    # ((start, stop), ...) s, in order of length and start where they are of a sweep, else of start
    windows: tuple[Window, ...]
    sweep: bool  # each window is a run of its own with all fixes before it
    words: str  # description


def protocol(
    outages: str | Iterable[Window], span: Window, end: float, settled: Callable[[], float]
) -> Protocol:
    """The Protocol of `outages`: text as above, or a list of (start, stop) in s, which may overlap
    in a sweep only.

    span: (first, last) of the recording, s; end: where a window without an end stops, s; settled:
    () -> first second of a sweep that names no range. Raises DataError for what is malformed,
    empty, too long, outside the recording or overlapping.
    """
    if not isinstance(outages, str):
        made = _list_protocol(outages)
    elif "@" in outages:
        made = _sweep(outages, span, end, settled)
    elif "/" in outages:
        made = _periodic(outages, span)
    else:
        made = _list_protocol([_window(part, end, outages) for part in outages.split(",")], outages)
    _check(made, span)
    return made


def _list_protocol(windows: Iterable[Window], text: str | None = None) -> Protocol:
    """A Protocol of windows that are withheld in one run, in order."""
    try:
        windows = tuple(islice(windows, MAX_WINDOWS + 1))
        found = tuple(sorted((float(start), float(stop)) for start, stop in windows))
    except (TypeError, ValueError):
        raise DataError(
            f"outages is {windows!r}; it must be text or a list of (start, stop) in s: "
            f"{PROTOCOL_HINT}"
        ) from None
    if not found:
        raise DataError(f"outages: none are given; {PROTOCOL_HINT}")
    if len(found) > MAX_WINDOWS:
        raise DataError(f"outages: more than {MAX_WINDOWS} windows in a list; give fewer")
    count = (
        f"{len(found)} outages of a list, all in one run"
        if len(found) > 1
        else f"one outage, {window_text(found[0])}"
    )
    return Protocol(
        text or ",".join(f"{start:.10g}:{stop:.10g}" for start, stop in found), found, False, count
    )


def _periodic(text: str, span: Window) -> Protocol:
    """A stated length at the end of every stated period but the first, counted from the
    beginning of the first IMU sample."""
    parts = text.split("/")
    if len(parts) != 2:
        raise DataError(f"outages {text!r}: {len(parts)} numbers instead of 2; {PROTOCOL_HINT}")
    length, period = _positive(text, "length", parts[0]), _positive(text, "period", parts[1])
    if length >= period:
        raise DataError(
            f"outages {text!r}: {length:g} s of every {period:g} s leave no fixes between the "
            f"outages; give a shorter length"
        )
    first, last = span
    if length > last - first:
        raise _too_long(length, span)
    if (last - first) / period > MAX_WINDOWS:
        raise DataError(f"outages {text!r}: more than {MAX_WINDOWS} windows; give a longer period")
    ends = [first + k * period for k in range(2, int((last - first + ROUNDING) / period) + 1)]
    if not ends:
        raise DataError(
            f"outages {text!r}: the recording lasts {last - first:.6g} s, but with the first period "
            f"left out, "
            f"an outage needs at least two periods of {period:g} s; give a shorter period"
        )
    words = f"{length:g} s at the end of every {period:g} s but the first, all in one run"
    return Protocol(text, tuple((end - length, end) for end in ends), False, words)


def _sweep(text: str, span: Window, end: float, settled: Callable[[], float]) -> Protocol:
    """Windows of each length at every offset inside a range."""
    stated, _, rest = text.partition("@")
    within, slash, every = rest.partition("/")
    step = _positive(text, "step", every) if slash else SWEEP_STEP
    lengths = sorted({_positive(text, "length", part) for part in stated.split(",")})
    if lengths[-1] > span[1] - span[0]:
        raise _too_long(lengths[-1], span)
    first, last = _window(within, end, text) if within.strip() else (settled(), end)
    if sum((last - first) / step for _ in lengths) > MAX_WINDOWS:
        raise DataError(f"outages {text!r}: more than {MAX_WINDOWS} windows; give a longer step")
    windows = [
        (first + k * step, first + k * step + length)
        for length in lengths
        for k in range(math.floor((last - first - length + ROUNDING) / step) + 1)
    ]
    if not windows:
        raise DataError(
            f"outages {text!r}: no window of {lengths[0]:g} s fits into {first:.10g} to {last:.10g} "
            f"s; "
            "give a shorter length or a wider range"
        )
    words = (
        f"windows of {', '.join(f'{length:g}' for length in lengths)} s inside {first:.10g} to "
        f"{last:.10g} s, one every {step:g} s, "
        "each a run of its own with all fixes before it"
    )
    return Protocol(text, tuple(windows), True, words)


def _window(part: str, end: float, text: str) -> Window:
    """(start, stop) of "A:B", or of "A:", which stops at `end`."""
    start, colon, stop = part.partition(":")
    if not colon:
        raise DataError(f"outages {text!r}: {part.strip()!r} is not a window; {PROTOCOL_HINT}")
    first = _number(text, start)
    if not stop.strip() and first >= end:
        raise DataError(
            f"outages {text!r}: {first:.10g} s is outside the recording and its reference, which "
            f"end at {end:.10g} s; "
            "give an earlier time"
        )
    return first, _number(text, stop) if stop.strip() else end


def _number(text: str, part: str) -> float:
    """The finite number that `part` of `text` is."""
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(
            f"outages {text!r}: {part.strip()!r} is not a number of seconds; {PROTOCOL_HINT}"
        )
    return value


def _positive(text: str, name: str, part: str) -> float:
    return check_number(_number(text, part), f"outages {text!r}: the {name}", "s", above=0)


def window_text(window: Window) -> str:
    """A window as text: "100 to 130 s"."""
    return "{:.10g} to {:.10g} s".format(*window)


def _too_long(length: float, span: Window) -> DataError:
    return DataError(
        f"an outage of {length:g} s is longer than the recording, which lasts "
        f"{span[1] - span[0]:.6g} s; give a shorter one"
    )


def _check(made: Protocol, span: Window) -> None:
    """Raise DataError for the first window that cannot be one, or that overlaps the next in a
    protocol of one run."""
    for start, stop in made.windows:
        window = window_text((start, stop))
        if not (math.isfinite(start) and math.isfinite(stop)):
            raise DataError(f"outage {window}: start and stop must be finite numbers, s")
        if stop - start > span[1] - span[0] + ROUNDING:
            raise _too_long(stop - start, span)
        if start < span[0] - ROUNDING or max(start, stop) > span[1] + ROUNDING:
            raise DataError(
                f"outage {window} is outside the recording, which covers {span[0]:.10g} to "
                f"{span[1]:.10g} s; give another window"
            )
        if stop <= start:
            raise DataError(f"outage {window}: it ends before it begins; give start:stop")
    for one, after in zip(made.windows, made.windows[1:] if not made.sweep else ()):
        if after[0] < one[1] - ROUNDING:
            raise DataError(
                f"outages {window_text(one)} and {window_text(after)} overlap, which is impossible in one "
                f"run; "
                "give others, or a sweep (30@240:575/5), in which each has a separate run"
            )


def before_start(made: Protocol, start: InitialState) -> None:
    """Raise DataError where a window does not begin after the start of the filters, an
    InitialState."""
    window = min(made.windows, key=lambda window: window[0])
    if window[0] <= start.t + ROUNDING:
        raise DataError(
            f"outage {window_text(window)} begins before the end of the alignment, at {start.t:.10g} s; "
            "give later outages (or, in Python, a start= before them)"
        )
