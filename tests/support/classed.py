"""A receiver whose positions are told by carrier solution, made from one whose are not."""

from dataclasses import replace

import numpy as np


def split(recording, classes, **changes):
    """The recording with its positions as one source per class. `classes` (n,) names of the class
    of each fix; `changes` {class: fields of its source}."""
    sources = []
    for a in recording.sources:
        if a.kind != "position":
            sources.append(a)
            continue
        for name in dict.fromkeys(classes.tolist()):
            own = a._where(np.asarray(classes) == name)
            named = {"name": f"GNSS position {name}", "receiver": "GNSS"}
            sources.append(replace(own, **named, **changes.get(name, {})))
    return replace(recording, sources=tuple(sources))


def alternating(many, every=25):
    """(many,) classes that change after so many fixes: fixed, float, fixed, single."""
    names = np.array(["fixed", "float", "fixed", "single"])
    return names[np.arange(many) // every % 4]
