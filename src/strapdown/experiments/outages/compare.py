"""Compare filters on the same outages of a recording: one start, one noise, the same sources and
the same withheld fixes for all."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from functools import cache
from os import cpu_count
from typing import Any, NamedTuple, Unpack

import pandas as pd

from ... import aiding, filters
from ...checks import DataError, check_number
from ...core.loop.contract import Filter, InitialState, Noise
from ...data.recording import Recording, check_recording
from ...data.solution import Trajectory
from ...engine.heading_hypotheses import align_start
from ...engine.installation import with_estimates
from ...engine.options import RunOptions, SourceOptions, run_options, takes
from ...engine.prepare import assumed_noise, has_position, prepare
from ...engine.source_weights import with_weights
from ...progress import listener, with_bar
from ...sensor_models.imu import ImuSpec
from ...typing import Progress
from ..filter_label import ESTIMATE, NOTHING, labelled_filter, parse_label
from .protocols import SETTLING, Protocol, Window, before_start, protocol
from .result import Comparison
from .runs import Common, Entrant, FilterWay, Result, through
from .scores import known_reference, outages_of
from .smoothed_fixes import NOTE, smoothed_fixes

WITHHELD_KINDS, BASELINE = ("position", "velocity"), "baseline"
"""Kinds of measurement that an outage of GNSS withholds, and that of two antennas, which it
withholds too where a recording has it."""
NUMBER_IN_TEXT = re.compile(r"(?<![\w.-])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")
"""A number in the text of an event."""
SLOW_FILTERS = ("pkf",)
"""Filters with hundreds of components, which take minutes instead of a second: they run only if
named."""
HERE = re.compile(r",? (?:first|from) here\b")
"""Words in the text of an event that refer to its time."""


@takes(SourceOptions)
@with_bar("compare")
def compare(
    recording: Recording,
    filters: str | Iterable[str | tuple[str, dict[str, Any]]] | None = None,
    *,
    outages: str | Iterable[Window] = "30/300",
    kinds: str | Iterable[str] = WITHHELD_KINDS,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    **shared: Unpack[SourceOptions],
) -> Comparison:
    """Run filters through the same outages of a recording, and return the Comparison of their
    errors against its reference, or without one against the withheld fixes.

    A filter that cannot run, or stops, stays in the result with its message.

    Parameters
    ----------
    recording : Recording
        With a reference, or with fixes of position.
    filters : str, or list of str or (name, options)
        Labels "NAME" or "NAME:option=value,..."; default: all that estimate a position but those of
        SLOW_FILTERS. A label may say what it estimates of the installation, as
        "NAME:estimate=clock+lever-arm" or "NAME:estimate=none", in place of `estimate`.
    outages : str, or list of (start, stop) in s
        Windows to withhold measurements in, such as "30/300" (30 s every 300 s) or "8:12,14:18"
        (from 8 to 12 s, and so on); see `outages.protocols`.
    kinds : str or list of str
        Kinds of the withheld fixes; a baseline of two antennas too, where nothing else is named.
    threads : int
        At a time; default: one per core.
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Returns
    -------
    Comparison
        Scores of every filter in every outage, and their summary.

    Raises
    ------
    DataError
        For bad input, and where no filter can run.
    """
    asked = run_options(**shared)
    start, noise, notify = asked["start"], asked["noise"], asked["notify"]
    _check(recording, threads, start, noise)
    entrants, kinds = _entrants(filters), _kinds(kinds)
    if kinds == WITHHELD_KINDS and any(a.kind == BASELINE for a in recording.sources):
        kinds = (*kinds, BASELINE)
    recording = with_weights(
        with_estimates(recording, asked["estimate"]), asked["robust"], asked["adaptive"]
    )
    _check_ahrs(asked["ahrs"])
    imu = recording.meta.get("grade") if asked["imu"] is None else asked["imu"]
    spec = assumed_noise(imu, noise, needed=start is None)[1]

    @cache
    def start_of_all() -> InitialState:
        return start or _aligned_start(recording, spec, asked)

    if recording.reference is None:
        reference, said = smoothed_fixes(recording, asked, start_of_all()), [NOTE]
    else:
        reference, said = known_reference(recording), []
    end = min(recording.span[1], float(reference.t[-1]))

    made = protocol(outages, recording.span, end, lambda: start_of_all().t + SETTLING)
    # without the fixes of an early outage, an alignment would wait or use fewer data
    before_start(made, start_of_all())
    hidden = recording.hidden(made.windows, kinds)
    begin = start or _hidden_start(hidden, spec, asked)
    before_start(made, begin)
    scenes, notes = outages_of(made, recording, reference, kinds, begin)
    notes = [*said, *notes, *_idle_ahrs(asked["ahrs"], entrants)]
    # the recording has its weights, and of each filter what it estimates
    given: RunOptions = {**asked, "start": begin, "robust": None, "adaptive": None}
    common = Common(recording, hidden, made.sweep, scenes, kinds, given)
    for entrant in entrants:
        prepare(entrant.filter, [a.kind for a in recording.sources], notify)
    ways, results = through(common, entrants, threads or cpu_count(), listener(progress))
    return _comparison(common, made, Ran(entrants, ways, results), notes, reference, spec)


def _idle_ahrs(ahrs: str | Filter | None, entrants: list[Entrant]) -> list[str]:
    """A note on an AHRS that feeds no filter."""
    if ahrs is None or any("attitude" in entrant.filter.needs for entrant in entrants):
        return []
    return [f"{ahrs} was not used, because none of these filters needs an attitude"]


def _entrants(wanted: str | Iterable[str | tuple[str, dict[str, Any]]] | None) -> list[Entrant]:
    """[Entrant] of what `compare` was given. Raises DataError."""
    if wanted is None:
        wanted = [
            name
            for name in filters.names()
            if name not in SLOW_FILTERS and has_position(filters.find(name))
        ]
    if not isinstance(wanted, Iterable):
        raise DataError(
            f"filters is {wanted!r}; it must be a list of names, of NAME:option=value, or of (name, "
            f"{{option: value}})"
        )
    made = []
    for each in [wanted] if isinstance(wanted, str) else wanted:
        found = parse_label(each) if isinstance(each, str) else labelled_filter(*_pair(each))
        made.append(Entrant(found.label, *found))
        if not has_position(found.filter):
            raise DataError(
                f"{made[-1].label} estimates no position, but outages are scored by position; leave it out"
            )
    labels = [entrant.label for entrant in made]
    if not labels:
        raise DataError("compare: there is no filter; give at least one")
    if twice := [label for label in labels if labels.count(label) > 1]:
        raise DataError(f"compare: the filter {twice[0]!r} is given twice; leave one out")
    return made


def _pair(each: object) -> tuple[str, dict[str, Any]]:
    """(name, options) where `each` is that. Raises DataError."""
    if not (
        isinstance(each, (tuple, list))
        and len(each) == 2
        and isinstance(each[0], str)
        and isinstance(each[1], dict)
    ):
        raise DataError(
            f"compare: {each!r} is not a filter; give its name, NAME:option=value, or (name, {{option: "
            f"value}})"
        )
    return each[0], each[1]


def _kinds(kinds: str | Iterable[str]) -> tuple[str, ...]:
    """Kinds of measurement to withhold, as a tuple. Raises DataError."""
    named = (kinds,) if isinstance(kinds, str) or not isinstance(kinds, Iterable) else tuple(kinds)
    if not named:
        raise DataError(
            "kinds is empty: name the kinds of fixes to withhold, such as position and velocity"
        )
    if not all(isinstance(kind, str) for kind in named):
        raise DataError(
            f"kinds is {kinds!r}; it must name kinds of fixes to withhold, such as position and "
            f"velocity"
        )
    for kind in named:
        aiding.find(kind)
    return tuple(dict.fromkeys(named))


def _check(recording: object, threads: int | None, start: object, noise: object) -> None:
    """Refuse what is of another type. Raises DataError."""
    check_recording(recording)
    if threads is not None:
        check_number(threads, "threads", least=1, whole=True)
    if start is not None and not isinstance(start, InitialState):
        raise DataError(f"start is {start!r}; it must be an InitialState, such as `align` gives")
    if noise is not None and not isinstance(noise, Noise):
        raise DataError(f"noise is {noise!r}; it must be a Noise, such as an ImuSpec gives")


def _check_ahrs(ahrs: str | Filter | None) -> None:
    """Raise DataError unless this is an attitude filter or None."""
    name = ahrs.name if isinstance(ahrs, Filter) else ahrs
    known = [each for each in filters.names() if not has_position(filters.find(each))]
    if name is not None and name not in known:
        raise DataError(f"ahrs is {name!r}, which is not an AHRS; there are: {', '.join(known)}")


def _aligned_start(recording: Recording, spec: ImuSpec | None, asked: RunOptions) -> InitialState:
    assert spec is not None  # required without a start
    return align_start(recording, spec, noise=asked["noise"], notify=asked["notify"])


def _hidden_start(recording: Recording, spec: ImuSpec | None, asked: RunOptions) -> InitialState:
    try:
        return _aligned_start(recording, spec, asked)
    except DataError as error:
        raise DataError(f"alignment without the fixes of the outages: {error}") from None


class Ran(NamedTuple):
    """The filters of a comparison and their results."""

    entrants: list[Entrant]
    ways: list[FilterWay]
    results: list[list[Result]]  # per filter and outage


def _comparison(
    common: Common,
    made: Protocol,
    ran: Ran,
    notes: list[str],
    reference: Trajectory,
    spec: ImuSpec | None,
) -> Comparison:
    """Return the Comparison from the results of the runs. Raises DataError where nothing was
    scored."""
    entrants, ways, results = ran
    labels = [entrant.label for entrant in entrants]
    rows: list[dict[str, Any]] = [
        {
            "filter": label,
            "outage": number,
            "start_s": outage.start,
            "stop_s": outage.stop,
            "length_s": round(outage.length, 6),
            **({} if isinstance(each, str) else each[0]),
            "distance_m": outage.distance,
            "said": each if isinstance(each, str) else "",
        }
        for label, own in zip(labels, results)
        for number, (each, outage) in enumerate(zip(own, common.outages), 1)
    ]
    if all(isinstance(each, str) for own in results for each in own):
        raise DataError(f"no filter completed any outage; {labels[0]}: {results[0][0]}")
    widest = max(rows, key=len)
    scores = pd.DataFrame(rows, columns=list(widest))
    tracks = {
        label: [None if isinstance(each, str) else each[1] for each in own]
        for label, own in zip(labels, results)
    }
    windows = tuple((each.start, each.stop) for each in common.outages)
    notes = [
        *common.recording.meta.get("notes", []),
        *notes,
        *_filter_notes(common, entrants, ways),
        *_doubtful(labels, ways),
        *_events(labels, results),
    ]
    return Comparison(
        common.recording.meta.get("name", ""),
        made.text,
        made.words,
        made.sweep,
        tuple(labels),
        windows,
        common.kinds,
        scores,
        tracks,
        reference,
        (common.start.t, common.recording.span[1]),
        _settings(common, entrants, ways, spec),
        tuple(notes),
        {label: way.verdict for label, way in zip(labels, ways) if way.verdict},
    )


def _settings(
    common: Common, entrants: list[Entrant], ways: list[FilterWay], spec: ImuSpec | None
) -> dict[str, Any]:
    """Return the settings that all runs share, and those of each filter."""
    ran = [(entrant, way.run) for entrant, way in zip(entrants, ways)]
    noise = common.given["noise"] or next(run.spec.noise() for _, run in ran if run and run.spec)
    return {
        "imu": spec.name if spec else "",
        "noise": noise._asdict(),
        "start": common.start._asdict(),
        "kinds": list(common.kinds),
        "withheld": _withheld_counts(common),
        "kept": {
            a.name or a.kind: a.kind
            for _, run in ran
            if run
            for a in run.recording.sources
            if a.kind not in common.kinds
        },
        "options": {
            e.label: e.filter.options | (run.options if run else e.options) | _estimate_option(e)
            for e, run in ran
        },
        "sources": {
            e.label: [a.name or a.kind for a in run.recording.sources] if run else []
            for e, run in ran
        },
        "reference": {e.label: e.filter.reference for e, _ in ran},
    }


def _estimate_option(entrant: Entrant) -> dict[str, str]:
    """Return the estimated parameters that a label names, as an option."""
    wanted = entrant.estimate
    return {} if wanted is None else {ESTIMATE: "+".join(wanted) or NOTHING}


def _withheld_counts(common: Common) -> dict[str, int]:
    """{source: fixes withheld in the outages}, each fix once, also where outages overlap."""
    found: Counter[str] = Counter()
    hidden = common.recording.hidden([each[:2] for each in common.outages], common.kinds)
    for whole, left in zip(common.recording.sources, hidden.sources):
        if whole.kind in common.kinds:
            found[whole.name or whole.kind] += len(whole.t) - len(left.t)
    return dict(found)


def _filter_notes(common: Common, entrants: list[Entrant], ways: list[FilterWay]) -> list[str]:
    """Notes of the filters on what they run on, each once."""
    known = common.recording.meta.get("notes", [])
    said = {e.label: way.run.recording.meta["notes"] for e, way in zip(entrants, ways) if way.run}
    new = dict.fromkeys(note for notes in said.values() for note in notes if note not in known)
    found = {note: [label for label, notes in said.items() if note in notes] for note in new}
    return [
        note if note.startswith(had[0]) else f"{', '.join(had)}: {note}"
        for note, had in found.items()
    ]


def _doubtful(labels: list[str], ways: list[FilterWay]) -> list[str]:
    """A note on the doubtful rows of the whole runs."""
    had = [f"{label} {way.doubtful:.4g} s" for label, way in zip(labels, ways) if way.doubtful]
    return [f"doubtful in the run through all outages: {', '.join(had)}"] if had else []


def _events(labels: list[str], results: list[list[Result]]) -> list[str]:
    """A note per kind of event of the outages, with the range of its numbers and in how many
    runs which filters had it."""
    found: dict[str, tuple[list[list[str]], dict[str, set[int]]]] = {}
    for label, own in zip(labels, results):
        for run, each in enumerate(own):
            for text in (
                () if isinstance(each, str) else [HERE.sub("", text) for _, text in each[2]]
            ):
                numbers, had = found.setdefault(NUMBER_IN_TEXT.sub("\0", text), ([], {}))
                numbers.append(NUMBER_IN_TEXT.findall(text))
                had.setdefault(label, set()).add(run)

    def runs(had: dict[str, set[int]]) -> str:
        return ", ".join(f"{label} {len(seen)}" for label, seen in had.items())

    return [
        f"in the runs with outages: {_with_ranges(text, numbers)} (runs: {runs(had)})"
        for text, (numbers, had) in found.items()
    ]


def _with_ranges(text: str, numbers: list[list[str]]) -> str:
    """`text` with each NUL replaced by the smallest and the largest of the texts of numbers,
    [[text per NUL] per event], at its place."""
    ends = [sorted(column, key=float) for column in zip(*numbers)]
    ranges = iter(
        own[0] if float(own[0]) == float(own[-1]) else f"{own[0]} to {own[-1]}" for own in ends
    )
    return re.sub("\0", lambda _: next(ranges), text)
