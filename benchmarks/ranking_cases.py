"""The cases of the ranking: what every package gets, and what it is scored by.

All get the same samples, position fixes, noise, start and standard deviations. Positions are the only fixes,
since every package takes those. Recordings are put on a grid of samples; simulated flights are those of
`sd.simulate`, five motions with five grades of IMU.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from workload import DEG, Workload

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.io.description.logs import join, open_logs
from strapdown.io.locate import data_folder
from strapdown.sensor_models.gnss import Gnss
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS, in_motion, windows_of
from strapdown_reproductions.recordings.cases import with_optics

BIAS = {"gyro": 1.0 * DEG, "accel": 0.3}
"""rad/s, m/s^2: what all know of the biases at the start of a recording where the IMU is not better."""
START = dict(vel_std=0.5, level_std=2.0, azimuth_std=5.0)
"""m/s, deg: of a recording's start, which is at the reference or at a solution with all fixes."""
SIMULATED = dict(gnss_std=1.0, pos_std=1.0, vel_std=0.1, level_std=1.0, azimuth_std=3.0)
"""m, m/s, deg: of the simulated fixes, and of the start, which is drawn by them."""
MOTIONS = ("demo", "straight", "car", "ship", "hand-held")
GRADES = ("consumer", "dmu10", "industrial", "tactical", "navigation")
RATE, SECONDS, SEEDS = 50.0, 150.0, (1, 2, 3, 4)
"""Hz, s, random numbers of the simulated flights."""
OUTAGES = ((80.0, 95.0), (115.0, 130.0))
"""s of the simulated flights; errors count from 60 s on."""
SETTLED = 60.0
RECORDINGS = (
    "thor75",
    "drive0708",
    "walk0827",
    *(f"BROAD {k}" for k in ("02", "15", "21", "24", "33")),
)
FOLLOWED = ("drive0708", "walk0827")
"""Recordings whose reference of position is the fixes: with fixes its error is not scored."""


class Trial(NamedTuple):
    """A case as all get it, and what they are scored by."""

    name: str
    workload: Workload
    outages: list  # [(start, stop)] s, without fixes
    reference: sd.Trajectory
    attitude: bool  # whether the reference knows it
    scored: tuple  # (start, stop) s


def flight():
    """thor75, from the air on."""
    recording = sd.read(DESCRIPTIONS / "thor75.toml")
    outages = [(t, t + 15.0) for t in np.arange(270.0, 560.0, 50.0)]
    return recorded("thor75", recording, 225.0, 578.0, 0.02, 2.0, outages, (240.0, 575.0), True)


def drive():
    """drive0708, from where it moves."""
    recording = sd.read(DESCRIPTIONS / "drive0708.toml")
    windows = windows_of(recording)
    begin = windows[0][0] - 30.0
    scored = (windows[0][0], recording.span[1] - 1)
    return recorded("drive0708", recording, begin, scored[1], 0.01, 0.03, windows, scored, False)


def walked(folder):
    """walk0827 with all its fixes; `folder` gets its description."""
    own = data_folder(DESCRIPTIONS) / "walk0827"
    sources = join(open_logs([own / "gnss_1730_sf.pos.xz"])).text(folder).partition("\n\n")[2]
    path = folder / "walk0827.toml"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(WALK.format(own / "imu_1730_sf.csv.xz") + sources, encoding="utf-8")
    return sd.read(path)


def walk(folder):
    """walk0827 with its fixed positions, and the two outages of its authors."""
    whole = walked(folder)
    (fixed,) = (a for a in whole.sources if a.kind == "position" and a.name.endswith("fixed"))
    reference = sd.Trajectory(fixed.t, fixed.y)
    recording = replace(whole, sources=(fixed,), reference=reference)
    begin = float(fixed.t[0])
    outages = [(begin + 25.0, begin + 40.0), (begin + 70.0, begin + 85.0)]
    span = (begin + 15.0, float(fixed.t[-1]))
    return recorded("walk0827", recording, begin + 13.0, span[1], 0.01, 0.05, outages, span, False)


WALK = """vehicle = "pedestrian"

[imu]
file = "{}"
time = {{ column = 1, unit = "s", clock = "gps", offset = -315964800.0 }}
gyro = {{ columns = [5, 6, 7], unit = "rad/s" }}
accel = {{ columns = [2, 3, 4], unit = "g" }}
axes = "-y -x -z"
grade = "consumer"

"""


def in_the_hand(path):
    """A trial of BROAD with a position from the cameras each second."""
    recording = in_motion(with_optics(path))
    ((start, stop),) = recording.meta["movement"]
    outages = [(t, t + 5.0) for t in np.arange(start + 20.0, stop - 5.0, 25.0)]
    name = f"BROAD {path.stem[:2]}"
    step = 3 * float(np.median(recording.imu.dt))  # slow packages take milliseconds for each
    return recorded(name, recording, start - 5.0, stop, step, 0.1, outages, (start, stop), True)


def recorded(name, recording, start, stop, step, fix_std, outages, scored, attitude):
    """The Trial of a recording between two times: samples on a grid of `step` s that its fixes lie
    on, by interpolation of what they add up to."""
    (position,) = (a for a in recording.sources if a.kind == "position")
    inside_span = (position.t > start) & (position.t < stop)
    first = position.t[inside_span][0]
    t = first + step * np.arange(int((stop - first) / step))
    imu = recording.imu

    def on_grid(increments):
        at = np.r_[imu.t[0] - imu.dt[0], imu.t]
        sums = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])
        summed = np.column_stack([np.interp(t, at, column) for column in sums.T])
        return np.vstack([np.zeros(3), np.diff(summed, axis=0)])

    k = np.rint((position.t[inside_span] - first) / step).astype(int)
    on = (k > 0) & (k < len(t)) & (np.abs(position.t[inside_span] - first - k * step) < step / 2)
    parameters = dict(START, gnss_std=fix_std, pos_std=max(fix_std, 0.1))
    parameters |= _noise(sd.imu(recording.meta["grade"]), BIAS)
    workload = _workload(
        name,
        (t, on_grid(imu.dtheta), on_grid(imu.dv)),
        (t[k[on]], position.y[inside_span][on]),
        _state(recording, first, attitude),
        parameters,
    )
    return Trial(name, workload, outages, recording.reference, attitude, scored)


def simulated(motion, grade, seed):
    """The Trial of a simulated flight: the start drawn by its standard deviations."""
    gnss = Gnss(interval=1.0, position_std=(SIMULATED["gnss_std"],) * 3, velocity_std=None)
    world = sd.scenario(motion).replace(
        gnss=gnss,
        imu=grade,
        rate=RATE,
        duration=SECONDS,
        magnetometer=None,
        barometer=None,
    )
    recording = sd.simulate(world, seed=seed)
    parameters = SIMULATED | _noise(sd.imu(grade), {"gyro": np.inf, "accel": np.inf})
    truth, imu, (position,) = recording.reference, recording.imu, recording.sources
    rng = np.random.default_rng((seed, 50))
    start = _drawn(truth, parameters, rng)
    zeros = np.zeros((1, 3))
    samples = (truth.t, np.vstack([zeros, imu.dtheta]), np.vstack([zeros, imu.dv]))
    name = f"{motion}, {grade}"
    workload = _workload(name, samples, (position.t, position.y), start, parameters)
    return Trial(name, workload, list(OUTAGES), truth, True, (SETTLED, SECONDS))


def _drawn(truth, p, rng):
    """(lla, v, rph) of the truth's start with errors of these standard deviations."""
    from scipy.spatial.transform import Rotation

    error = rng.standard_normal((3, 3))
    lla = displace_lla(truth.lla[0], error[0] * p["pos_std"])
    tilt = error[2] * np.array([p["level_std"], p["level_std"], p["azimuth_std"]]) * DEG
    turned = Rotation.from_rotvec(tilt) * truth.rotation[0]
    return lla, truth.v_n[0] + error[1] * p["vel_std"], turned.as_euler("ZYX")[::-1].copy()


def _noise(grade, most):
    """Noise, bias walk and bias at the start of a grade, the latter `most` where the IMU is not
    better: parameters of a workload.

    Not every package knows a Gauss-Markov process; for all it is the walk that begins like it.
    """
    found = {}
    for sensor, triad in (("gyro", grade.gyro), ("accel", grade.accel)):
        drift = triad.gauss_markov and triad.gauss_markov * np.sqrt(2 / triad.time_constant)
        found |= {
            f"{sensor}_noise": triad.noise,
            f"{sensor}_bias_std": min(
                most[sensor], np.hypot(triad.turn_on_bias, triad.gauss_markov)
            ),
            f"{sensor}_bias_walk": max(np.hypot(triad.bias_walk, drift), 1e-9),
        }
    return found


def _workload(name, samples, fixes, start, p):
    """The Workload of samples (t, dtheta, dv), fixes (t, lla), a start and parameters."""
    deviations = (p["pos_std"], p["vel_std"], p["level_std"] * DEG, p["accel_bias_std"])
    stds = np.repeat([*deviations, p["gyro_bias_std"]], 3)
    stds[8] = p["azimuth_std"] * DEG
    step = float(np.median(np.diff(samples[0])))
    return Workload(name, step, *samples, None, None, None, *fixes, start, stds, p)


def _state(recording, t, attitude):
    """(lla, v, rph) of the reference at t, or of strapdown's smoother with all fixes where it knows
    no attitude; where it knows no velocity, that of its positions over a second."""
    path = recording.reference if attitude else sd.smooth(recording).trajectory
    i = int(np.argmin(np.abs(path.t - t)))
    if abs(path.t[i] - t) > 1:
        raise ValueError(f"the solution begins at {path.t[0]:.1f} s, after the case, at {t:.1f} s")
    v = path.v_n[i] if path.v_n is not None else None
    if v is None or not np.isfinite(v).all():
        a, b = (int(np.argmin(np.abs(path.t - at))) for at in (path.t[i] - 0.1, path.t[i] + 0.1))
        v = displacement(path.lla[b : b + 1], path.lla[a : a + 1])[0] / (path.t[b] - path.t[a])
    return path.lla[i], v, path.rph[i]


def recordings(folder):
    """{name: function -> Trial} of all recordings; `folder` keeps what is made for them."""
    broad = sorted((data_folder(DESCRIPTIONS) / "broad").glob("*.npz"))
    hands = {f"BROAD {path.stem[:2]}": (lambda path=path: in_the_hand(path)) for path in broad}
    return {"thor75": flight, "drive0708": drive, "walk0827": lambda: walk(folder), **hands}


def simulations():
    """{(motion, grade): function of the seed -> Trial}."""
    return {
        (motion, grade): (lambda seed, m=motion, g=grade: simulated(m, g, seed))
        for motion in MOTIONS
        for grade in GRADES
    }
