"""Trials of BROAD, the Berlin Robust Orientation Estimation Assessment Dataset (Laidig et al. 2021,
doi 10.3390/data6070072), as .npz files.

A hand-held IMU with a magnetometer, its attitude and position measured by cameras. An .npz file
holds `fs` (Hz), `gyr` (rad/s), `acc` (m/s^2) and `mag` (uT) in the axes of the sensor,
`quat_wxyz_enu` (sensor to east, north, up), `pos_enu` (m), both NaN where markers were lost, and
`movement`, true where errors count. The box lies with its z axis up; its x axis is defined as
forward, so the sensor's axes are FLU and the body's are (x, -y, -z).

North of the reference is magnetic north, without declination. The record does not state its place;
`BROAD_PLACE` is nominal.
"""

from dataclasses import replace
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from ...checks import DataError
from ...core.loop.contract import Imu
from ...data.recording import Recording, RecordingMeta
from ...data.solution import Source, Trajectory
from ...fileio.file_access import Zip
from ...geometry.geodesy import displace_lla
from ...preprocessing.attitude_record import quaternions
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix
from ...preprocessing.fixes import checked_sources
from ...preprocessing.origin import Origin
from ...preprocessing.stationary import at_rest, stretches
from ...sensor_models.errors import Triad
from ...sensor_models.imu import ImuSpec
from ...typing import Array, ArrayLike, File, Mask
from ...units.wording import count_text
from ..facts import recording_facts
from ..reader import Findings, Reader
from ..tables.table_file import reading_file

ARRAY_COLUMNS = {"gyr": 3, "acc": 3, "mag": 3, "quat_wxyz_enu": 4, "pos_enu": 3, "movement": 0}
"""Arrays of a file and their numbers of columns; 0 for an array without columns."""
BROAD_PLACE = (np.radians(52.512), np.radians(13.327), 70.0)
"""Latitude (rad), longitude (rad), ellipsoidal height (m) of the origin of `pos_enu`: Technische
Universitaet Berlin, nominal, not surveyed."""
MAG_DENSITY = 0.078e-6
"""T/sqrt(Hz). At rest (trials 02, 21, 24) the Allan deviation of the magnetometer falls as 0.078
uT/sqrt(tau) from 0.1 to 1 s. Between successive rows it is 0.7 uT, less than the 1.3 uT of white
noise of this density, because the magnetometer is slower than the gyro and 29 % of its rows
repeat."""
MIN_REST = 2.0
"""s: the shortest rest from which the reference field is taken."""
BROAD_IMU = ImuSpec(
    "broad",
    Triad(noise=1.0e-4, turn_on_bias=4.3e-3, bias_walk=6.3e-6),
    Triad(noise=3.1e-3, turn_on_bias=0.023, bias_walk=2.1e-4),
    "Rests of the BROAD trials 02, 21 and 24: noise from the Allan deviation at 0.1 to 1 s; turn-on "
    "bias as rms of the mean rate of the first rest "
    "and of the excess of |f| over gravity (9.813 m/s^2); bias walk from the change between first "
    "and last rest, 150 to 160 s apart.",
)
"""Errors that filters assume for the IMU, from its records at rest only."""


def read_broad(path: File) -> Recording:
    """Return the Recording of a BROAD trial: IMU and magnetic field in FRD, the optical attitude as
    reference, in NED with magnetic north.

    meta: `movement`, [[start, stop], ...] in s, the first and last sample of each stretch that
    counts; `place`, nominal; `grade`, the ImuSpec `BROAD_IMU`. The reference has the rows with a
    known attitude. The reference field of the magnetometer is (B_N, 0, B_D) of the first rest, from
    specific force and magnetic field only. Raises a one-line DataError.
    """
    path = Path(path)
    fs, arrays = parse(path)
    t, C = np.arange(len(arrays["gyr"])) / fs, axes_matrix("FLU", BODY_AXES)
    gyro, accel, field = arrays["gyr"] @ C.T, arrays["acc"] @ C.T, arrays["mag"] @ C.T * 1e-6
    meta: RecordingMeta = {
        "name": path.stem,
        "grade": BROAD_IMU,
        "place": list(BROAD_PLACE),
        "movement": windows(t, arrays["movement"]),
    }
    try:
        recording = Recording.from_arrays(t, gyro, accel, reference=_reference(t, arrays), **meta)
        return _with_field(recording, t, field, fs)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def parse(path: File) -> tuple[float, dict[str, np.ndarray[Any, Any]]]:
    """(fs in Hz, {name: array}) of a BROAD file, unchanged except numbers as float and `movement`
    as bool. Raises DataError."""
    found = _arrays(Path(path))
    if missing := [name for name in ("fs", *ARRAY_COLUMNS) if name not in found]:
        raise DataError(
            f"{path}: array {missing[0]!r} is missing; a BROAD trial has fs, "
            f"{', '.join(ARRAY_COLUMNS)}, "
            f"this file has {', '.join(found) or 'none'}"
        )
    try:
        found = {name: np.asarray(found[name], float) for name in ("fs", *ARRAY_COLUMNS)}
    except (TypeError, ValueError):
        types = ", ".join(f"{name} {array.dtype}" for name, array in found.items())
        raise DataError(
            f"{path}: the arrays of a BROAD trial are numbers, but this file has {types}"
        ) from None
    fs = found.pop("fs")
    if fs.size != 1 or not 0 < fs.item() < np.inf:
        # an array of shape (2**31, 0) is not a text either
        found_there = repr(fs.item()) if fs.size == 1 else f"an array of shape {fs.shape}"
        raise DataError(
            f"{path}: fs must be one sampling rate in Hz, above 0; it is {found_there:.60}"
        )
    n = len(found["gyr"]) if found["gyr"].ndim else 0
    for name, columns in ARRAY_COLUMNS.items():
        wanted = (n, columns) if columns else (n,)
        if found[name].shape != wanted:
            raise DataError(
                f"{path}: {name} has shape {found[name].shape}; "
                f"with {n} rows of gyr it must be {wanted}"
            )
    return fs.item(), found | {"movement": found["movement"] > 0}


def _arrays(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    """{name: array} of an .npz file."""
    try:
        with reading_file(path), Zip(path) as archive:
            return {
                name.removesuffix(".npy"): _array(archive, name)
                for name in archive.namelist()
                if name.endswith(".npy")
            }
    except DataError:
        raise
    # RuntimeError: a member is locked by a password
    except (ValueError, NotImplementedError, RuntimeError, SyntaxError, TokenError) as error:
        raise DataError(
            f"{path}: not an .npz file of plain arrays ({str(error).splitlines()[0][:80]}); a BROAD "
            f"trial is expected"
        ) from None


def _array(archive: Zip, name: str) -> np.ndarray[Any, Any]:
    """Return an array of an .npz file. Raises ValueError where it states more data than it
    holds."""
    with archive.content(name) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def windows(t: Array, inside: Mask) -> list[list[float]]:
    """[[start, stop], ...] in s: first and last of the times `t` in each stretch where `inside` is
    true."""
    return [[float(t[first]), float(t[stop - 1])] for first, stop in stretches(inside)]


def _reference(t: Array, arrays: dict[str, Any]) -> Trajectory | None:
    """Return the trajectory of the optical attitude, body to NED, where it is known; None where it
    never is."""
    q, known = (
        arrays["quat_wxyz_enu"],
        np.isfinite(arrays["quat_wxyz_enu"]).all(axis=1)
        & np.isfinite(arrays["pos_enu"]).all(axis=1),
    )
    if not known.any():
        return None
    north_east_down = arrays["pos_enu"][known] @ axes_matrix("ENU", NAVIGATION_AXES).T
    q_nb = body_to_ned(np.where(known[:, None], q, np.nan))[known]
    return Trajectory(
        t[known], displace_lla(np.tile(BROAD_PLACE, (known.sum(), 1)), north_east_down), q_nb=q_nb
    )


def with_positions(
    trial: Recording, rate: float = 1.0, std: ArrayLike = 0.05, seed: int = 0
) -> Recording:
    """Return the trial with position fixes as another source: the optical position `rate` times a
    second, with white noise of `std` (m north, east, down).

    trial: a Recording of `read_broad`. Fixes are at samples, and missing where the cameras had lost
    the body. `std` is one number or three; the noise of an epoch depends only on `seed` and the
    epoch. Raises DataError.
    """
    name, step = trial.meta.get("name", "trial"), float(np.median(trial.imu.dt))
    if np.shape(std) not in ((), (3,)) or not np.all((np.asarray(std) > 0) & np.isfinite(std)):
        raise DataError(
            f"{name}: std of the positions is {std!r}; it must be one number or three, above 0, in m"
        )
    if not 0 < rate * step <= 1 + 1e-6:
        raise DataError(
            f"{name}: positions at {rate!r} Hz; the rate must be above 0 and at most that of the "
            f"IMU, {1 / step:.4g} Hz"
        )
    if trial.reference is None:
        raise DataError(f"{name}: the trial has no optical position")
    known, std = trial.reference.t, np.broadcast_to(np.asarray(std, float), (3,))
    start, stop = trial.imu.t[[0, -1]]
    epochs = start + np.arange(1, int((stop - start) * rate + 1e-9) + 1) / rate
    after = np.clip(np.searchsorted(known, epochs), 1, len(known) - 1)
    row = np.where(epochs - known[after - 1] < known[after] - epochs, after - 1, after)
    seen = np.abs(known[row] - epochs) <= 0.5 * step * (1 + 1e-6)
    noise = std * np.random.default_rng(seed).standard_normal((len(epochs), 3))
    lla = displace_lla(trial.reference.lla[row[seen]], noise[seen])
    fixes = Source(
        "position",
        known[row[seen]],
        lla,
        np.tile(std, (len(lla), 1)),
        (0.0, 0.0, 0.0),
        name="optical position",
    )
    lost = (
        f"; {count_text(int((~seen).sum()), 'epoch')} without the body left out"
        if not seen.all()
        else ""
    )
    said = ", ".join(f"{each:g}" for each in std)
    note = f"optical position: {len(lla)} fixes at {rate:g} Hz, white noise of {said} m north, east, down added{lost}"
    return replace(trial, sources=(*trial.sources, fixes)).with_notes([note])


def body_to_ned(q: ArrayLike) -> Array:
    """Convert the attitude (n, 4) of the sensor in east, north, up to that of the body (FRD) in
    NED; scalar first, rows with NaN stay NaN.

    Raises DataError naming the first row that is not a unit quaternion.
    """
    return quaternions(np.asarray(q, float), "wxyz", "FLU to ENU", Origin("quat_wxyz_enu"))


def _with_field(recording: Recording, t: Array, field: Array, fs: float) -> Recording:
    """Return the recording with its magnetometer as a source, or, where no rest gives the reference
    field, without it and with a note."""
    rest = first_rest(recording.imu)
    inside = (
        (t >= recording.imu.t[rest.start])
        & (t < recording.imu.t[rest.stop - 1])
        & np.isfinite(field).all(axis=1)
        if rest
        else np.array([False])
    )
    if not inside.any():
        missing = f"no rest of {MIN_REST:g} s with a magnetic field for its reference: magnetometer left out"
        return recording.with_notes([missing])
    force = recording.imu.dv[rest].sum(axis=0)
    down = -force / np.linalg.norm(force)
    m = np.median(field[inside], axis=0)  # a magnet that is near for a while does not shift it
    reference = (float(np.linalg.norm(m - down * (m @ down))), 0.0, float(m @ down))
    std = np.full(field.shape, MAG_DENSITY * np.sqrt(fs))
    sources, more = checked_sources(
        recording.imu, [Source("magnetic-field", t, field, std, reference, name="magnetometer")]
    )
    return replace(recording, sources=sources).with_notes(more)


def first_rest(imu: Imu) -> slice | None:
    """Return the slice of the first rest of at least `MIN_REST` s in an Imu, by its samples alone;
    None without one."""
    long = (
        slice(int(first), int(stop))
        for first, stop in stretches(at_rest(imu))
        if imu.t[stop - 1] - imu.t[first] >= MIN_REST
    )
    return next(long, None)


def inspect(path: Path) -> Findings:
    """Return the findings on a trial; a reading error is one of them."""
    found = Findings.of()
    trial = found.attempt(read_broad, path)
    if trial is not None:
        movement = [
            f"movement: {start:.2f} to {stop:.2f} s" for start, stop in trial.meta["movement"]
        ]
        found.add(*recording_facts(trial, *movement))
    return found


READER = Reader("broad", (".npz",), "trial of the BROAD data set", read_broad, inspect)
