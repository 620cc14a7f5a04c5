"""Figures that the pages of the documentation tell of filters that are fed by an AHRS."""

from dataclasses import replace

import numpy as np
from recordings import ahrs, start

import strapdown as sd
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.trajectory import DEG, Motion


def test_where_the_body_turns_between_records_the_direct_filter_errs_more():
    """Navigation: up to 12 deg/s of heading, 10 of roll; rms of roll, pitch and heading in four
    minutes. Six seeds gave ratios of 1.6 to 2.4 at 1 Hz, of 1.5 to 1.65 at 10 Hz."""
    swing = Motion(
        "swing",
        (DEG * 45, DEG * 10, 500.0),
        lambda t: (20 + 0 * t, 0 * t, 0 * t),
        lambda t: (
            20 * DEG * np.sin(0.5 * t),
            10 * DEG * np.sin(0.3 * t),
            120 * DEG * np.sin(0.1 * t),
        ),
    )
    bare, found = sd.simulate(swing, 300.0, "tactical", 1, 50.0), {}
    for rate in (1.0, 10.0):
        recording = replace(bare, sources=(*bare.sources, ahrs(bare.reference, rate)))
        for name in ("direct-ahrs", "indirect-ahrs-closed"):
            e = sd.rms(
                sd.errors(sd.fuse(recording, name, start=start(recording)), bare.reference),
                (60.0, 300.0),
            )
            found[name, rate] = np.sqrt((e.rph**2).mean())
    assert 1.5 < found["direct-ahrs", 1.0] / found["indirect-ahrs-closed", 1.0] < 2.5
    assert 1.4 < found["direct-ahrs", 10.0] / found["indirect-ahrs-closed", 10.0] < 1.75


def test_an_ahrs_makes_a_moving_car_worse():
    """Fuse: 0.06 deg of roll and pitch and 0.3 to 0.5 deg of heading without, from 0.2 and from 0.9
    deg on with it, by six seeds."""
    car = sd.simulate(
        "car",
        duration=300.0,
        imu="consumer",
        seed=1,
        magnetometer=Magnetometer(),
        date="2024-05-01",
    )
    alone = sd.fuse(
        replace(car, sources=tuple(a for a in car.sources if a.kind != "magnetic-field")),
        "closed-loop",
    )
    fed = sd.fuse(car, "closed-loop", ahrs="attitude-mekf", ahrs_rate=10.0)
    level, heading = zip(
        *(
            (np.sqrt((rph[:2] ** 2).mean()), rph[2])
            for s in (alone, fed)
            for rph in [np.degrees(sd.rms(sd.errors(s, car.reference), (150.0, 300.0)).rph)]
        )
    )
    assert np.allclose([level[0], heading[0]], [0.06, 0.4], rtol=0.25)
    assert level[1] > 2.5 * level[0] and heading[1] > 1.5 * heading[0]
