"""Solutions made up for the tests of files and pages: a circling flight, a truth, and estimates
that err as their covariance says."""

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.data.solution import BRIDGED, INVALID, Innovations, Solution, Trajectory
from strapdown.data.verdict import Reason, Untested, Verdict

LATE = Reason(
    "clock",
    "innovations of velocity grow with acceleration, 0.25 s late (0.23 to 0.27), expected within "
    "0.02 s",
    "set `offset = 0.25` in its [[source]], then fuse again",
    "gnss velocity",
    4.2,
)
TURNED = Reason(
    "axes",
    "the course is 89.7 deg right of the heading at 12 m/s, expected within 3 deg",
    "rotate `axes` of [imu] by 90 deg, then fuse again",
    weight=7.0,
)
WORSE = Reason(
    "imu noise",
    "the gyro bias about z is 140 times the std of the description, expected within 4",
    "check the grade of the IMU with `strapdown allan`",
    weight=1.8,
)
UNSEEN = (Untested("heading", "no turns", "turn", ("heading",)),)
TRUSTED = Verdict.of([], UNSEEN)
DOUBTFUL = Verdict.of([WORSE], UNSEEN)
WRONG = Verdict.of([LATE, WORSE, TURNED])

STD_FLOOR = np.r_[
    1.0,
    1.0,
    1.5,
    np.full(3, 0.05),
    np.radians([0.1, 0.1, 0.5]),
    np.full(3, 0.01),
    np.full(3, np.radians(20) / 3600),
]
STD_START = np.r_[
    10.0,
    10,
    15,
    1,
    1,
    1,
    np.radians([2, 2, 20]),
    np.full(3, 0.2),
    np.full(3, np.radians(300) / 3600),
]


def flight(seconds=600.0, rate=10.0, lat=47.0, lon=8.0, radius=800.0, speed=40.0):
    """A circle with a slow climb as a Trajectory; `lat`, `lon` of its centre in deg."""
    t = np.arange(0.0, seconds, 1 / rate)
    turn = speed / radius * t
    metres_n, metres_e = radius * np.cos(turn), radius * np.sin(turn)
    lla = np.c_[
        np.radians(lat) + metres_n / 6.368e6,
        np.radians(lon) + metres_e / (6.388e6 * np.cos(np.radians(lat))),
        400 + 0.3 * t,
    ]
    lla[:, 1] = (lla[:, 1] + np.pi) % (2 * np.pi) - np.pi
    v_n = np.c_[-speed * np.sin(turn), speed * np.cos(turn), np.full(len(t), -0.3)]
    q = Rotation.from_euler(
        "ZYX", np.c_[turn + np.pi / 2, np.full(len(t), 0.05), np.full(len(t), 0.2)]
    ).as_quat()[:, [3, 0, 1, 2]]
    return Trajectory(t, lla, v_n, q)


def solution(truth, seed=1, drift=0.0, name="closed-loop", noise=1.0, **meta):
    """An estimate of `truth` with honest standard deviations, `drift` m/s^2 of growing position
    error, fixes, gaps and events."""
    rng = np.random.default_rng(seed)
    n, t = len(truth), truth.t - truth.t[0]
    std = STD_FLOOR + (STD_START - STD_FLOOR) * np.exp(
        -t[:, None] / np.r_[np.full(6, 5.0), np.full(9, 30.0)]
    )
    error = (
        noise * std * _smooth(rng.standard_normal((n, 15)), max(int(8 / np.median(np.diff(t))), 2))
    )
    std[:, 0:2] += 0.5 * abs(drift) * t[:, None] ** 2
    error[:, 0] += 0.4 * drift * t**2
    lla = (
        truth.lla
        - np.c_[
            error[:, 0] / 6.368e6, error[:, 1] / (6.388e6 * np.cos(truth.lla[:, 0])), -error[:, 2]
        ]
    )
    attitude = Rotation.from_rotvec(-error[:, 6:9]) * truth.rotation
    q = attitude.as_quat()[:, [3, 0, 1, 2]]
    trajectory = Trajectory(truth.t, lla, truth.v_n - error[:, 3:6], q, std)
    status = np.zeros(n, int)
    status[(t > 200) & (t < 200.8)], status[(t > 400) & (t < 412)] = BRIDGED, INVALID
    events = (
        (200.0, "gap of 0.8 s bridged"),
        (400.0, "gap of 12 s: position & velocity <held>"),
        (412.0, "gnss re-acquired"),
    )
    meta = {
        "filter": name,
        "imu": "tactical",
        "recording": "synthetic flight",
        "notes": ["2 % of rows were repeated & dropped"],
        "kinds": {"gnss": "position"},
        **meta,
    }
    return Solution(
        trajectory,
        0.05 + error[:, 9:12],
        np.radians(40) / 3600 + error[:, 12:15],
        status,
        fixes(truth.t, rng),
        events,
        meta=meta,
    )


def fixes(t, rng):
    """Innovations of two sources, each with a few rejected."""
    times = np.arange(t[0] + 1, t[-1], 1.0)
    t_fix, source = np.repeat(times, 2), np.tile([0, 1], len(times))
    innovation = rng.standard_normal((len(t_fix), 3)) * np.where(source == 0, 1.5, 0.1)[:, None]
    nis = (innovation**2).sum(axis=1) / np.where(source == 0, 1.5, 0.1) ** 2
    accepted = nis < 11.0
    far = np.flatnonzero(source == 0)[len(times) // 3]
    innovation[far], nis[far], accepted[far] = [50.0, 2.0, -1.0], 1200.0, False
    return Innovations(t_fix, source, innovation, nis, accepted, ("gnss", "velocity"), (16.3, 16.3))


def _smooth(white, width):
    kernel = np.exp(-(np.linspace(-2, 2, width) ** 2))
    kernel /= np.sqrt((kernel**2).sum())
    return np.column_stack([np.convolve(column, kernel, mode="same") for column in white.T])


def attitude_only(made, heave=False, name="attitude-mekf"):
    """The same Solution of a filter of attitude and gyro bias, with `heave` of height and vertical
    velocity too, aided by a magnetic field.

    The field's innovations are angles, in rad, in the first row alone.
    """
    from dataclasses import replace

    unknown = np.r_[0, 1, 3, 4, 9, 10, 11] if heave else np.r_[0:6, 9:12]
    part = lambda values, first: np.where(
        np.isin(np.arange(first, first + 3), unknown), np.nan, values
    )
    trajectory, t = made.trajectory, np.arange(made.t[0] + 0.5, made.t[-1], 0.5)
    rng = np.random.default_rng(11)
    angle = rng.normal(0, np.radians(1.5), len(t))
    innovations = Innovations(
        t,
        np.zeros(len(t), int),
        np.c_[angle, np.full((len(t), 2), np.nan)],
        (angle / np.radians(1.5)) ** 2,
        np.ones(len(t), bool),
        ("field",),
        (10.8,),
    )
    std = np.where(np.isin(np.arange(15), unknown), np.nan, trajectory.std)
    trajectory = replace(
        trajectory, lla=part(trajectory.lla, 0), v_n=part(trajectory.v_n, 3), std=std
    )
    return replace(
        made,
        trajectory=trajectory,
        b_a=np.full_like(made.b_a, np.nan),
        innovations=innovations,
        events=made.events[:1],
        columns={},
        status=np.where(made.status == INVALID, 0, made.status),
        meta=made.meta | {"filter": name, "kinds": {"field": "magnetic-field"}},
    )
