"""Calibration of accelerometer and magnetometer from a record: `calibrate` and its result, the
`Calibration`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..alignment.location import place_of
from ..checks import DataError, check_type
from ..data.recording import Recording, check_recording
from ..data.solution import Source
from ..fileio.files import together
from ..geometry.geodesy import gravity
from ..io.magnetic_record import sound_samples
from ..preprocessing.origin import Origin
from ..typing import Array
from ..units.constants import STANDARD_GRAVITY
from .ellipsoid import EllipsoidFit
from .findings import Result
from .methods import (
    coverage,
    hard_and_soft_iron,
    missing_directions,
    rests,
    six_positions,
    typical,
)

SAMPLES = 5000
"""Samples of a magnetometer that are used, about, evenly spaced: what is left of a calibration is not
white, so that more would add little."""
WRONG_STRENGTH, TURNED = 0.05, np.radians(10)
"""Relative error of strength after calibration, and turn of the magnetometer against the IMU
(rad), that are worth a note."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """Result of `calibrate`, with what writes it."""

    def write(self, folder: Path) -> None:
        """Write calibration.toml and calibration.html into `folder`, both or none. Raises
        DataError where that cannot be done."""
        from .page import page

        with together():
            self.to_toml(folder / "calibration.toml")
            page(self).save(folder / "calibration.html")


Calibration.__doc__ = Result.__doc__  # which has the fields, for `help`


def calibrate(
    recording: Recording,
    sensor: str | None = None,
    start: float | None = None,
    stop: float | None = None,
) -> Calibration:
    """Return the calibration of the accelerometer or magnetometer of a recording.

    Parameters
    ----------
    recording : Recording
        Recording in which the sensor was turned to many directions.
    sensor : str, optional
        "accelerometer", "magnetometer", or the name of a source of kind magnetic-field; by default the
        magnetometer where there is one.
    start, stop : float, optional
        s, the part of the recording that is used.

    Returns
    -------
    Calibration
        Bias (3,) and matrix (3, 3) in body axes, SI, with their covariance and what the record does
        not determine.

    Raises
    ------
    DataError
        If directions are missing (the message lists them), the sensor is constant, or the recording
        has none.

    Notes
    -----
    docs/how-to/calibrate.md lists the motions that each method needs.

    References
    ----------
    Gander, Golub & Strebel (1994), "Least-squares fitting of circles and ellipses"; Renaudin, Afzal &
    Lachapelle (2010), "Complete triaxis magnetometer calibration in the magnetic domain"; with gyros the
    model of Kok & Schoen (2016), IEEE Sensors Journal 16(14).
    """
    check_recording(recording)
    check_type(sensor, "sensor", str | None, "the name of a sensor, or None")
    part = recording.between(start, stop)
    sources = [a for a in part.sources if a.kind == "magnetic-field"]
    chosen = sensor or ("magnetometer" if sources else "accelerometer")
    if chosen == "accelerometer":
        return _accelerometer(part)
    if not sources:
        raise DataError(
            f"{chosen}: the recording has no source of kind magnetic-field; name one in "
            f"recording.toml, or calibrate the accelerometer"
        )
    named = sources if chosen == "magnetometer" else [a for a in sources if a.name == chosen]
    if not named:
        there = dict.fromkeys(
            ("accelerometer", "magnetometer", *(a.name or a.kind for a in sources))
        )
        raise DataError(f"sensor {chosen!r} is unknown; there is {', '.join(there)}")
    notes = (
        [
            f"{len(named)} magnetometers: {named[0].name or named[0].kind!r} is calibrated; "
            "choose another with sensor"
        ]
        if len(named) > 1
        else []
    )
    return _magnetometer(part, named[0], notes)


def _accelerometer(part: Recording) -> Calibration:
    found, local, notes = rests(part.imu), *_gravity(part)
    fit = six_positions(found, local)
    share, _, lack = coverage(found.force)
    if lack:
        notes.append(missing_directions(lack, "no rest with"))
    fitted = _Fitted(
        "accelerometer",
        "rests",
        fit,
        local,
        found.t,
        found.force,
        (share, lack),
        notes,
        _columns(part, "accel"),
    )
    return _make_calibration(fitted, part.meta.get("name", ""))


def _gravity(part: Recording) -> tuple[float, list[str]]:
    """(local gravity in m/s^2, notes)."""
    place = place_of(part.meta, part.sources)
    if place is None:
        return STANDARD_GRAVITY, [
            f"the place is not known: gravity is taken as {STANDARD_GRAVITY} m/s^2, which may be "
            f"wrong by 0.3 %; give place"
        ]
    return float(gravity(place.lla[0], place.lla[2])), []


def _magnetometer(part: Recording, source: Source, notes: list[str]) -> Calibration:
    columns = _columns(part, source.name or source.kind)
    strength, dip = _reference(source, columns)
    if strength is None:
        notes.append(
            "the Earth's field is not known: the matrix keeps the typical strength of the sensor; "
            "give date and place, or field"
        )
    keep, more = sound_samples(
        source.t, source.y, part.imu, source.name or source.kind, Origin(source.name or source.kind)
    )
    t, y = source.t[keep], source.y[keep]
    t, y = (column[:: max(1, len(t) // SAMPLES)] for column in (t, y))
    fit, form, gyro = hard_and_soft_iron(t, y, part.imu, strength, dip)
    m = (y[fit.used] - fit.bias) @ fit.matrix.T
    share, _, lack = coverage(m)
    size = strength if strength is not None else float(np.mean(np.linalg.norm(m, axis=1)))
    notes += more + _form_notes(form, fit, gyro, t, typical(y))
    if lack:
        notes.append(missing_directions(lack, "no field along"))
    fitted = _Fitted("magnetometer", form, fit, size, t, y, (share, lack), notes, columns)
    return _make_calibration(fitted, part.meta.get("name", ""))


def _reference(source: Source, columns: dict[str, Any]) -> tuple[float, float] | tuple[None, None]:
    """(strength in T, dip in rad) of the Earth's field; (None, None) where they are not known."""
    if (
        len(source.parameters) < 3
        or columns.get("field") == "record"
        or not np.linalg.norm(source.parameters[:3]) > 0
    ):
        return None, None
    north, east, down = source.parameters[:3]
    return float(np.linalg.norm(source.parameters[:3])), float(
        np.arctan2(down, np.hypot(north, east))
    )


def _form_notes(
    form: str, fit: EllipsoidFit, gyro: Array | None, t: Array, size: float
) -> list[str]:
    if form == "turning" and gyro is not None:
        notes = [
            "form: turning, the field turned by the gyros; gyro bias "
            + " ".join(f"{value:.3f}" for value in np.degrees(gyro))
            + " deg/s"
        ]
        U, _, Vt = np.linalg.svd(fit.matrix)
        angle = np.arccos(np.clip((np.trace(U @ Vt) - 1) / 2, -1, 1))
        if angle > TURNED:
            notes.append(
                f"the magnetometer is rotated by {np.degrees(angle):.0f} deg from the IMU; the "
                "matrix corrects this, but check axes"
            )
    else:
        notes = [
            "form: ellipsoid, from the strength alone; it does not contain the rotation between "
            "magnetometer and IMU"
        ]
    return notes


class _Fitted(NamedTuple):
    """A fit and what it was made of."""

    sensor: str
    form: str
    fit: EllipsoidFit
    strength: float
    t: Array  # (n,) s
    measured: Array  # (n, 3)
    directions: tuple[float, tuple[str, ...]]  # share of the sphere, half-axes that lack
    notes: list[str]
    columns: dict[str, Any]


def _make_calibration(fitted: _Fitted, name: str) -> Calibration:
    """The Calibration; `name` is that of the recording."""
    sensor, form, fit, strength, t, measured, directions, notes, columns = fitted
    used, notes = fit.used, list(notes)

    def error(vectors: Array) -> float:
        return float(np.sqrt(np.mean((np.linalg.norm(vectors, axis=1) - strength) ** 2)))

    after = error((measured[used] - fit.bias) @ fit.matrix.T)
    out = int(np.isfinite(measured).all(axis=1).sum() - used.sum()) if form != "turning" else 0
    if out:
        notes.append(f"{out} of {len(t)} left out as outliers")
    if fit.held:
        notes.append(
            f"no excitation: {', '.join(fit.held)} cannot be separated from the bias and the "
            "others; left at identity"
        )
    if form == "rests" and len(t) <= 9 - len(fit.held):
        notes.append(
            f"{len(t)} rests for {9 - len(fit.held)} parameters: the misfit is zero by "
            "construction; more orientations would test it"
        )
    if after > WRONG_STRENGTH * strength:
        notes.append(
            f"the strength still varies by {100 * after / strength:.0f} % rms: iron or currents "
            f"that are not fixed to the sensor"
        )
    return Calibration(
        sensor,
        form,
        fit.bias,
        fit.matrix,
        fit.covariance,
        strength,
        error(measured[used]),
        after,
        np.sqrt(np.nanmean(fit.residuals**2, axis=0)),
        *directions,
        fit.held,
        fit.weakest,
        tuple(notes),
        t,
        measured,
        fit.residuals,
        columns,
        name,
    )


def _columns(part: Recording, name: str) -> dict[str, Any]:
    sensors = part.meta.get("sensors", {})
    return (
        {"gyro": sensors.get("gyro", {}), **sensors[name]}
        if name in sensors and name == "accel"
        else sensors.get(name, {})
    )
