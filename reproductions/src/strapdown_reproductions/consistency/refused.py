"""Cells that are refused: a filter is not to be used there, and why.

At most MOST of a filter. They stay in the table with what was measured, and count for no target.
"""

from .worlds import Cell

MOST = 3
"""Refused cells of a filter."""
REFUSED: dict[Cell, str] = {}
"""{cell: the measurement that shows why}."""
