"""Cells that are refused: a filter is not to be used there, and why.

At most MOST of a filter. They stay in the table with what was measured, and count for no target.
"""

from .worlds import Cell

MOST = 3
"""Refused cells of a filter."""
_RAW = (
    "Its INS keeps the turn-on bias of the accelerometers for all of the run: at the end it is {} km "
    "off (median of 6 runs), where its error is no longer linear. Use indirect-ahrs-closed, which "
    "is consistent there."
)
REFUSED: dict[Cell, str] = {
    Cell("indirect-ahrs-open", "straight", "consumer"): _RAW.format(59),
    Cell("indirect-ahrs-open", "ship", "consumer"): _RAW.format(386),
    Cell("indirect-ahrs-open", "ship", "industrial"): _RAW.format(69),
}
"""{cell: the measurement that shows why}."""
