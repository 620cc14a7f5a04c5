"""From rows of runs to tables: a row for each value of some columns, counts of outcomes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

Tables: TypeAlias = Mapping[str, tuple[str | None, pd.DataFrame]]
"""{name: (caption, DataFrame)}; a caption of None keeps a table off the page."""


def group_rows(
    rows: pd.DataFrame,
    keys: Sequence[str],
    measures: Callable[[pd.DataFrame], Mapping[str, Any]],
    columns: Sequence[str] | None = None,
) -> pd.DataFrame:
    """A row for each value of the `keys`, in their order: these, and the `measures` of the rows
    that have it; columns: of the measures, where there may be no rows."""
    found = [
        {**dict(zip(keys, key)), **measures(own)}
        for key, own in (rows.groupby(list(keys), sort=False) if len(rows) else ())
    ]
    return pd.DataFrame(found, columns=None if columns is None else [*keys, *columns])


def outcomes(
    rows: pd.DataFrame, keys: Sequence[str], column: str, order: Sequence[str]
) -> pd.DataFrame:
    """A row for each value of the `keys`: how many of its rows have each value of the `column`, in
    this order."""
    counts = rows.groupby(list(keys), sort=False)[column].value_counts().unstack(fill_value=0)
    return counts.reindex(columns=list(order), fill_value=0)


def with_rows(tables: Tables) -> Tables:
    """Those of the tables that have rows."""
    return {name: (caption, table) for name, (caption, table) in tables.items() if len(table)}


def rms(values: pd.Series) -> float:
    """Root of the mean square."""
    return float(np.sqrt((values**2).mean()))
