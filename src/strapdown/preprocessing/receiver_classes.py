"""Classes of a receiver: its fixes by carrier solution, each class a source of its own.

A filter, `tune` and the pages take them as they are. What asks where the receiver was, or compares it
with other sensors, joins them again.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..data.solution import Source


def join_classes(sources: Iterable[Source]) -> tuple[Source, ...]:
    """The sources with the classes of each receiver as one source, in the place of the first: all
    fixes in the order of time, each with its own standard deviation."""
    sources = tuple(sources)
    groups: dict[object, list[Source]] = {}
    for k, a in enumerate(sources):
        own = (a.kind, a.receiver, tuple(a.parameters)) if a.receiver else k
        groups.setdefault(own, []).append(a)
    return tuple(each[0] if len(each) == 1 else _join(each) for each in groups.values())


def _join(classes: list[Source]) -> Source:
    t = np.concatenate([a.t for a in classes])
    order = np.argsort(t, kind="stable")
    std = [np.broadcast_to(a.std, a.y.shape) for a in classes]
    first = classes[0]
    return replace(
        first,
        t=t[order],
        y=np.concatenate([a.y for a in classes])[order],
        std=np.concatenate(std)[order],
        name=f"{first.receiver} {first.kind}",
    )
