"""From a motion and error models to a Recording with its truth; and a filter's start drawn around that truth."""
from pathlib import Path

import numpy as np

from ..core.contract import ATT, BA, BG, POS, STATES, VEL, Start
from ..data import DataError, Recording
from ..geodesy import displaced
from ..sensors.gnss import Gnss
from ..sensors.imu import grade
from .trajectory import increments, sample


def simulate(motion, duration, imu, seed, rate=100.0, gnss=Gnss()):
    """A Recording of `duration` s: IMU samples at `rate` Hz with the errors of `imu` (grade, file or ImuSpec), GNSS fixes, truth as reference.

    meta holds the grade, the seed and the true biases "b_a" (m/s^2) and "b_g" (rad/s), (n, 3) at the IMU samples. IMU and GNSS have their own
    random streams: the fixes of a seed are the same for every grade. Raises DataError.
    """
    if not (0 < rate < np.inf and 0 < duration < np.inf and round(duration * rate) >= 2):
        raise DataError(f"cannot simulate {duration!r} s at {rate!r} Hz; both must be larger than 0 and give two samples or more")
    spec = grade(imu)
    t = np.arange(round(duration * rate) + 1) / rate
    truth = sample(motion, t)
    of_imu, of_gnss = np.random.default_rng(seed).spawn(2)
    samples, b_a, b_g = spec.corrupt(increments(motion, t), of_imu)
    meta = {"name": motion.name, "grade": str(imu) if isinstance(imu, (str, Path)) else spec, "seed": seed, "notes": [], "b_a": b_a, "b_g": b_g}
    return Recording(samples, gnss.fixes(truth, of_gnss), truth, meta)


def draw_start(truth, sd, rng, t=None, biases=None):
    """A Start at the truth's row at `t` (its first by default) less an error drawn from the 15 standard deviations `sd` (SI, radians).

    Errors are true - estimate, the attitude's in the navigation frame: q_true = dq (x) q_est. `biases` are the true (b_a, b_g) there;
    without them the estimated biases are 0, right where the sensor has drawn its biases from the same standard deviations.
    """
    from scipy.spatial.transform import Rotation
    sd = np.asarray(sd, float)
    if sd.shape != (STATES,) or not np.all((sd >= 0) & np.isfinite(sd)):
        raise DataError(f"a start needs {STATES} standard deviations, finite and 0 or more")
    row = 0 if t is None else int(np.argmin(np.abs(truth.t - t)))
    if t is not None and abs(truth.t[row] - t) > 1e-6:
        raise DataError(f"the truth has no row at {t:g} s; the nearest is at {truth.t[row]:g} s")
    error = sd * rng.standard_normal(STATES)
    heading, pitch, roll = (Rotation.from_rotvec(-error[ATT]) * truth.rotation[row]).as_euler("ZYX")
    b_a, b_g = (np.zeros(3), np.zeros(3)) if biases is None else (np.asarray(biases[0]) - error[BA], np.asarray(biases[1]) - error[BG])
    numbers = lambda values: tuple(float(value) for value in values)
    return Start(float(truth.t[row]), numbers(displaced(truth.lla[row], -error[POS])), numbers(truth.v_n[row] - error[VEL]),
                 numbers((roll, pitch, heading % (2 * np.pi))), numbers(b_a), numbers(b_g), numbers(sd), "truth less an error drawn from sd")
