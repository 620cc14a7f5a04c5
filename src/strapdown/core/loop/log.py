"""The log in which the loop says what a user must know."""

from enum import IntEnum
from typing import TYPE_CHECKING

from ..compile.jit import helper

if TYPE_CHECKING:
    from .cursor import Cursor


class Code(IntEnum):
    """Kinds of rows of the log; engine/events.py has their messages. APART is the smoother's."""

    BRIDGED_GAP = 0
    HELD_GAP = 1
    LIFTED = 2
    LEFT_OUT = 3
    TOO_FAR = 4
    OUT_OF_RANGE = 5
    FULL_SCALE = 6
    STUCK = 7
    COARSE = 8
    JITTERED = 9
    FLOORED = 10
    NO_FIX = 11
    TOO_FAST = 12
    TOO_HIGH = 13
    MEAN_OFF = 14
    NIS_OFF = 15
    BELIEF_TOO_FAST = 16
    BELIEF_TOO_HIGH = 17
    IN_CONDITION = 18
    APART = 19
    CLOCK_OFF = 20
    HEIGHT_APART = 21
    HEIGHT_AGAIN = 22
    DISTURBED = 23
    IRON_WAITS = 24
    FROZEN = 25
    UNCHECKED = 26
    CONTRADICTS = 27
    AGREES_AGAIN = 28


class LogRow:
    """A row of the log: an event, from when to when."""

    t: float  # s
    until: float  # s
    code: int  # a Code
    which: int  # source, axis or condition
    count: int  # how often
    value: float  # the largest


FOLD = 10.0  # s within which what happens again belongs to the same row of the log
LOG_ROWS, LOG_FULL = 256, 128  # of which the loop stops at the second, so that the log is emptied


@helper
def notify(cursor: "Cursor", code: int, which: int, t: float, value: float) -> None:
    """Write into the log, or into the row of it that says the same of less than FOLD s ago.

    Rows are merged as intervals are, so that it does not matter when the log is emptied.
    """
    log, state = cursor.log, cursor.state[0]
    for k in range(state.logged - 1, -1, -1):
        row = log[k]
        if row.code == code and row.which == which:
            if t - row.until <= FOLD or state.logged == log.size:
                row.until = max(row.until, t)
                row.count += 1
                if abs(value) > abs(row.value):
                    row.value = value
                return
            break
    if state.logged < log.size:
        row = log[state.logged]
        row.t, row.until, row.count = t, t, 1
        row.code, row.which, row.value = code, which, value
        state.logged += 1
