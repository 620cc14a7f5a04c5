"""Other packages on the samples of a BROAD trial, each as a small function: arrays in the sensor's
axes -> its attitude in east, north, up.

All run with the settings that their packages ship. `vqf`, `ahrs` and `imufusion` are optional: `installed_version` tells
which are there.
"""

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

import numpy as np

from strapdown.typing import Array

NWU = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""North, west, up in east, north, up."""
NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""North, east, down in east, north, up."""
FLIPPED = np.array([0.0, 1.0, 0.0, 0.0])
"""Forward, right, down in the sensor's axes: half a turn about x."""
DOWN = np.array([1.0, -1.0, -1.0])


class Peer(NamedTuple):
    """An estimator of another package."""

    name: str
    package: str  # on PyPI
    # (gyr rad/s, acc m/s^2, mag uT, fs Hz) -> (n, 4) sensor to ENU, scalar first
    run: Callable[[Array, Array, Array, float], Array]
    slow: bool  # a Python loop over the samples
    text: str  # how it is called
    # orientation error of the five trials in deg, or its mean alone, as measured before
    known: tuple[float, ...] = ()


def installed_version(package: str) -> str | None:
    """Its version, or None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def product(p: Array, q: Array) -> Array:
    """Quaternion products of (4,) or (n, 4) with (n, 4) or (4,), scalar first."""
    (a, b, c, d), (w, x, y, z) = np.moveaxis(p, -1, 0), np.moveaxis(q, -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def _vqf(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from vqf import VQF

    return VQF(1 / fs).updateBatch(gyr, acc, mag)["quat9D"]


def _vqf_offline(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from vqf import offlineVQF

    return offlineVQF(gyr, acc, mag, 1 / fs)["quat9D"]


def _madgwick(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from ahrs.filters import Madgwick

    return product(NWU, Madgwick(gyr=gyr, acc=acc, mag=mag, frequency=fs).Q)


def _mahony(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from ahrs.filters import Mahony

    return Mahony(gyr=gyr, acc=acc, mag=mag, frequency=fs).Q


def _ekf(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from ahrs.filters import EKF

    return product(
        product(
            NED, EKF(gyr=gyr * DOWN, acc=-acc * DOWN, mag=mag * DOWN, frequency=fs, frame="NED").Q
        ),
        FLIPPED,
    )


def _ekf_as_is(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    from ahrs.filters import EKF

    return product(NWU, EKF(gyr=gyr, acc=acc, mag=mag, frequency=fs).Q)


def _fusion(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    return _xio(gyr, acc, mag, fs)


def _fusion_example(gyr: Array, acc: Array, mag: Array, fs: float) -> Array:
    rejections = dict(acceleration_rejection=10, magnetic_rejection=10, rejection_timeout=5)
    return _xio(gyr, acc, mag, fs, gain=0.5, gyroscope_range=2000, **rejections)


def _xio(gyr: Array, acc: Array, mag: Array, fs: float, **settings: float) -> Array:
    """imufusion with its correction of the gyro bias, as its examples have it."""
    import imufusion

    bias, ahrs = imufusion.Bias(), imufusion.Ahrs()
    bias.set_settings(imufusion.BiasSettings(sample_rate=fs))
    convention = imufusion.CONVENTION_NWU
    ahrs.set_settings(imufusion.AhrsSettings(sample_rate=fs, convention=convention, **settings))
    q = np.empty((len(gyr), 4))
    for k, (rate, force, field) in enumerate(zip(np.degrees(gyr), acc / 9.80665, mag)):
        ahrs.update(bias.update(rate), force, field)
        q[k] = ahrs.get_quaternion()
    return product(NWU, q)


PEERS = (
    Peer("vqf", "vqf", _vqf, False, "VQF(Ts).updateBatch, quat9D", (1.38, 2.31, 4.08, 1.55, 3.75)),
    Peer(
        "vqf, offline",
        "vqf",
        _vqf_offline,
        False,
        "offlineVQF, quat9D: uses the samples after as well as before",
        (2.40,),
    ),
    Peer(
        "ahrs Madgwick",
        "ahrs",
        _madgwick,
        True,
        "samples in the sensor's axes; its navigation frame is north, west, up",
        (7.8,),
    ),
    Peer(
        "ahrs Mahony",
        "ahrs",
        _mahony,
        True,
        "samples in the sensor's axes; its navigation frame is east, north, up",
        (31.7,),
    ),
    Peer(
        "ahrs EKF",
        "ahrs",
        _ekf,
        True,
        "samples in forward, right, down and gravity for specific force, as its frame NED wants "
        "them; its default "
        "field is that of Munich, with a declination of some 4 deg that this reference does not "
        "have",
    ),
    Peer(
        "ahrs EKF, sensor axes",
        "ahrs",
        _ekf_as_is,
        True,
        "samples as the record has them, as the others get them; its equations want other axes",
        (31.9,),
    ),
    Peer("imufusion", "imufusion", _fusion, True, "Bias and Ahrs, default settings"),
    Peer(
        "imufusion, its example",
        "imufusion",
        _fusion_example,
        True,
        "with the settings of its advanced example: rejections beyond 10 deg, for 5 s at most",
    ),
)
