"""A second opinion on filters that follow positions which drift away."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown import filters
from strapdown.verdict.second_filter import SECOND, follows_positions, run_second_filter

SEEN = f"{SECOND}, on the same recording: "


@pytest.fixture(scope="module")
def flight():
    return sd.simulate("demo", 210.0, seed=3)


def spoofed(recording, acceleration):
    """Positions and velocities that move away to the north together from 90 s on."""
    later = lambda a: np.clip(a.t - 90.0, 0.0, None)
    made = []
    for a in recording.sources:
        y = a.y.copy()
        if a.kind == "position":
            y[:, 0] += 0.5 * acceleration * later(a) ** 2 / 6.37e6
        elif a.kind == "velocity":
            y[:, 0] += acceleration * later(a)
        made.append(replace(a, y=y))
    return replace(recording, sources=tuple(made))


@pytest.mark.parametrize("name", ["nlo", "two-stage-ekf"])
def test_a_filter_that_follows_is_doubted_by_what_the_closed_loop_sees(flight, name):
    assert sd.fuse(flight, name).verdict.trusted
    verdict = sd.fuse(spoofed(flight, 0.05), name).verdict
    assert not verdict.trusted
    assert any(reason.seen.startswith(SEEN) for reason in verdict.reasons)


def test_the_closed_loop_needs_none(flight):
    assert run_second_filter(sd.fuse(flight)) is None
    own = {name for name in filters.own_names() if follows_positions(filters.find(name))}
    assert {"nlo", "two-stage-ekf", "xkf-two-stage", "fixed-gain", "direct-ahrs"} <= own
    assert not own & {"closed-loop", "ekf", "mekf", "ukf", "attitude-mekf", "mahony", "vru"}
