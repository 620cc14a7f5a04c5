"""Fixes of which some are replaced by outliers: the effect of the gate, robust and adaptive
sources on them, and their cost without outliers."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine.batch import fuse
from strapdown.geometry.geodesy import displace_lla

from .worlds import record_world, score

SHARE, SIZE = 0.1, 20.0
"""Part of the fixes that are replaced, and the standard deviations of what they err by then."""
BEGUN = 30.0
"""s from which fixes are replaced: by then a run has found its start, which one of them would
spoil."""
MEMORY = 60.0
"""s of the adaptive sources."""
WAYS: dict[str, dict[str, Any]] = {
    "gate": {},
    "no gate": {"gate": np.inf},
    "robust": {"robust": True},
    "adaptive": {"adaptive": MEMORY},
    "both": {"robust": True, "adaptive": MEMORY},
}
CLEAN, DIRTY = "clean", "outliers"


def rows(world: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, fixes and way."""
    for seed in seeds:
        right = record_world(world, seed)
        for fixes, recording in ((CLEAN, right), (DIRTY, spoil_recording(right, seed))):
            for way, options in WAYS.items():
                asked = replace(
                    recording, sources=tuple(replace(a, **options) for a in recording.sources)
                )
                solution = fuse(asked)
                yield {"world": world, "fixes": fixes, "way": way, "seed": seed} | score(
                    solution, recording
                )._asdict()


def spoil_recording(recording: Recording, seed: int) -> Recording:
    """The recording with SHARE of each source's fixes replaced by ones that err by SIZE standard
    deviations, normally distributed, from BEGUN on."""
    streams = np.random.default_rng([seed, 23]).spawn(len(recording.sources))
    return replace(
        recording,
        sources=tuple(_spoil_source(a, rng) for a, rng in zip(recording.sources, streams)),
    )


def _spoil_source(a: Source, rng: np.random.Generator) -> Source:
    off = (rng.random(len(a.t)) < SHARE) & (a.t > a.t[0] + BEGUN)
    error = SIZE * a.std * rng.standard_normal(a.std.shape) * off[:, None]
    return replace(a, y=displace_lla(a.y, error) if a.kind == "position" else a.y + error)
