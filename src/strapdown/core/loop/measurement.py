"""The use of a measurement, step by step: its plausibility, the stages, the correction by the
filter, the opening of its gate, and the counts of its source.

Rules of the gate (docs/reference/conventions.md):
- A sensor beside GNSS that contradicts it is left out (stages/contradicting.py).
- Another source whose measurements were rejected REJECTED times in a row over at least LIFT_AFTER seconds
  has its gate opened until one passes it again. Before such a measurement is used, P is multiplied by
  NIS/gate, DOUBT at most; where a position is further off than that, its squared innovation is
  added to the variances of position. Sources of neither position nor velocity are given LIFTS such
  uses, LIFT_AFTER seconds apart: one that nothing in the states explains, such as a field beside
  iron, would let P explode. An altitude moves the height alone, a source with states of its own, such
  as wind, these alone. Of two heights that contradict each other one is left out instead
  (stages/heights.py). Velocities over ground in the body that nothing else helps
  (stages/dead_reckoning.py) have their gates opened after LIFT_ALONE s, as often as it takes: the
  filter shall not lose its only aid.
"""

import math

from ...typing import Array
from ..compile.jit import helper, inline
from ..mathematics.belief import FilterState
from ..mathematics.source import Kind, SourceRow
from .cursor import Books, Cursor
from .integrity import (
    CONFIRM,
    HEARD,
    LEFT,
    confirm,
    exclude_contradicting,
    exclude_source,
    flag_unreliable,
    gnss_is_used,
    is_plausible,
    length,
    make_room_for_gnss,
    reachable,
    share_states,
    test,
)
from .kernels import Kernels, correct_at, observe_at
from .log import Code, notify
from .loop_tape import call_stage, save_step
from .observation import observed_alone
from .reacquisition import height_alone, make_room
from .tables import Fixes, FixRow, Output, Status, Use

REJECTED, LIFT_AFTER = 5, 3.0  # rejections in a row; s
LIFT_ALONE = 1.0  # s, of velocities in the body that nothing else helps
LIFTS = 3  # uses in a row with the gate opened, of sources of neither position nor velocity
ASK_FIRST = -1.0  # the gate with which a filter says what it makes of a measurement, and no more


@inline
def use_next(
    kernels: Kernels, belief: FilterState, fixes: Fixes, cursor: Cursor, out: Output
) -> None:
    """Hand the next measurement to the filter and keep the books of its source."""
    state, work = cursor.state[0], cursor.work[0]
    k, height = state.fix, belief.lla[2]
    s = fixes.source[k]
    source, books = fixes.sources[s], cursor.books[s]
    work.believable = is_plausible(fixes, k, belief, cursor)
    _begin(belief, fixes, k, cursor)
    for i in range(kernels.prepare.size):
        call_stage(kernels.prepare[i], kernels, belief, fixes, k, cursor, out.record)
    use = Use.NOT_ASKED
    if work.believable:
        books.last = fixes.t[k]
        use = _ask(kernels, belief, fixes, k, cursor, out)
    if work.withheld >= 0:
        fixes.y[k, work.withheld] = work.height
    state.corrected += belief.lla[2] - height
    _keep_books(source, books, s, use, fixes.t[k], cursor)
    _write(belief, source, s, use, fixes.t[k], cursor, out.fix[k])
    state.fix += 1


@inline
def _begin(belief: FilterState, fixes: Fixes, k: int, cursor: Cursor) -> None:
    """Reset the work space before the stages, and propagate the augmented states of the source."""
    s, work = fixes.source[k], cursor.work[0]
    source = fixes.sources[s]
    for i in range(3):
        work.stds[i], work.factor[i] = fixes.std[k, i], 1.0
    if work.believable == 0:
        for i in range(12):
            work.innovation[i] = math.nan
    work.nis, work.weight, work.gate = math.nan, 1.0, source.gate
    work.alone, work.withheld, work.lifted = 0, -1, 0
    if source.walk > 0:
        last = cursor.books[s].walked
        for i in range(fixes.sources.size):
            if share_states(source, fixes.sources[i]):
                last = max(last, cursor.books[i].walked)
        walk(belief.P, source, fixes.t[k] - last)
        cursor.books[s].walked = fixes.t[k]


@helper
def walk(P: Array, source: SourceRow, seconds: float) -> None:
    """Propagate the random walk of a source's augmented states over the time since the last
    measurement of any source that shares them: only these observe them, so that this can wait for
    one."""
    for i in range(source.first_state, source.first_state + source.states):
        P[i, i] += source.walk * source.walk * seconds


@inline
def _ask(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, out: Output
) -> Use:
    """Correct the filter by a measurement: once, or a second time with the gate opened. Returns its
    use."""
    s, state, work = fixes.source[k], cursor.state[0], cursor.work[0]
    source, t = fixes.sources[s], fixes.t[k]
    weighed = (source.robust > 0 or source.memory > 0) and work.gate >= 0
    gate = ASK_FIRST if weighed else work.gate
    work.nis = _correct(kernels, belief, fixes, k, cursor, gate)
    lift = work.nis > max(gate, source.gate) and _is_due(cursor.books[s], work.alone, t)
    if lift and source.beside_gnss > 0 and gnss_is_used(fixes, t, cursor):
        if exclude_contradicting(fixes, s, t, cursor):
            make_room_for_gnss(belief.P)
        lift = False
    if weighed and not lift and work.nis > gate:
        call_stage(kernels.weigh, kernels, belief, fixes, k, cursor, out.record)
    save_step(belief, state, out.record)
    test(cursor, s, work.innovation, work.nis, t)
    if lift and _lift(kernels, belief, fixes, k, cursor, out):
        _correct(kernels, belief, fixes, k, cursor, math.inf)
        save_step(belief, state, out.record)
    return _use(source, gate, cursor)


@inline
def _correct(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, gate: float
) -> float:
    """The NIS of measurement k with this gate, its innovation in the work."""
    source, work = fixes.sources[fixes.source[k]], cursor.work[0]
    for i in range(9):
        work.innovation[3 + i] = math.nan  # not every filter whitens
    observe = observe_at(kernels.observers[source.kind])
    return correct_at(kernels.correct)(
        belief, fixes.y[k], work.stds, source.kind, observe, source, gate, work.innovation
    )


@inline
def _is_due(books: Books, alone: int, t: float) -> bool:
    """True where the gate of a source is to be opened for a measurement beyond it."""
    return (
        books.in_a_row >= REJECTED
        and t - books.since >= (LIFT_ALONE if alone else LIFT_AFTER)
        and (books.lifts < LIFTS or alone > 0)
        and books.contradicts == 0
    )


@helper
def _lift(
    kernels: Kernels, belief: FilterState, fixes: Fixes, k: int, cursor: Cursor, out: Output
) -> bool:
    """Make room in P for a measurement whose source was rejected for long; False where it is left
    out instead."""
    s, t, state, work = fixes.source[k], fixes.t[k], cursor.state[0], cursor.work[0]
    source, books, several = fixes.sources[s], cursor.books[s], cursor.state[0].heights > 1
    books.rejecting = 1
    flag_unreliable(cursor, t)
    if source.kind == Kind.POSITION and not reachable(belief, work.innovation, s, t, cursor):
        notify(cursor, Code.TOO_FAR, s, t, length(work.innovation))
        work.weight = 0.0
        return False
    vertical = height_alone(source.kind, work.innovation) and (
        several or (source.kind == Kind.ALTITUDE and state.positioned > 0)
    )
    if vertical and kernels.contradicted != 0:
        if call_stage(kernels.contradicted, kernels, belief, fixes, k, cursor, out.record) > 0:
            work.weight = 0.0
            return False
    if books.lifted_at == 0:
        notify(cursor, Code.LIFTED, s, t, length(work.innovation))
    if source.states > 0:
        observed_alone(kernels, belief, fixes, k, cursor)
    make_room(belief.P, source, vertical, work)
    work.lifted, source.kept = 1, 1.0
    return True


@inline
def _use(source: SourceRow, gate: float, cursor: Cursor) -> Use:
    """Return the use of a measurement, from its NIS and innovation in the cursor."""
    work = cursor.work[0]
    e, use = work.innovation, Use.ACCEPTED
    if math.isnan(work.nis):
        if math.isnan(e[0]) and math.isnan(e[1]) and math.isnan(e[2]):
            use = Use.UNMEASURED
    elif work.gate < 0:
        use = Use.REJECTED
    elif work.nis > source.gate:
        # a gate that was opened from the start is no second call of `correct`
        if work.lifted > 0:
            use = Use.REACQUIRED
        elif work.nis > gate:
            use = Use.REJECTED
    return use


@inline
def _keep_books(
    source: SourceRow, books: Books, s: int, use: Use, t: float, cursor: Cursor
) -> None:
    """Count what became of a measurement; what a position says of the status."""
    state, work = cursor.state[0], cursor.work[0]
    if work.nis > source.gate:
        _beyond(source, books, s, t, cursor)
    elif work.believable and not math.isnan(work.nis):
        books.in_a_row = books.lifts = books.lifted_at = books.rejecting = 0
    if use > 0:
        if books.accepted == 0 or t - books.last_used > HEARD:
            books.used_since = t
        books.last_used = t
        books.accepted += 1
    if use == Use.REJECTED:
        books.rejected += 1
    if state.unconfirmed > 0:
        if use == Use.ACCEPTED:
            confirm(cursor, t)
        elif use != Use.UNMEASURED and books.rejecting != LEFT and books.contradicts == 0:
            state.unconfirmed = CONFIRM  # measurements in a row
    if use > 0 and source.kind == Kind.POSITION and state.status == Status.INVALID:
        state.status = Status.VALID


@inline
def _beyond(source: SourceRow, books: Books, s: int, t: float, cursor: Cursor) -> None:
    """Count a measurement beyond its gate, and leave its source out where lifting did not help."""
    work = cursor.work[0]
    if books.in_a_row == 0:
        books.since = t
    books.in_a_row += 1
    if work.lifted > 0:
        books.lifted_at = books.in_a_row
        if work.alone == 0 and source.kind != Kind.POSITION and source.kind != Kind.VELOCITY:
            books.lifts += 1
            books.since = t
    if books.lifts == LIFTS and books.in_a_row == books.lifted_at + REJECTED:
        notify(cursor, Code.LEFT_OUT, s, books.since, 0.0)
        exclude_source(cursor, s)


@inline
def _write(
    belief: FilterState, source: SourceRow, s: int, use: Use, t: float, cursor: Cursor, row: FixRow
) -> None:
    """Tell of a measurement."""
    work = cursor.work[0]
    row.t, row.source, row.nis, row.use = t - source.delay, s, work.nis, use
    for i in range(3):
        row.innovation[i], row.whitened[i] = work.innovation[i], work.innovation[3 + i]
        row.factor[i], row.v[i] = work.factor[i], belief.v_n[i]
    for i in range(6):
        row.root[i] = work.innovation[6 + i]
    used = 1.0 if use > 0 else 0.0
    row.weight = work.weight if source.robust > 0 and work.believable else used
