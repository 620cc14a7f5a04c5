"""Calibration of accelerometer and magnetometer from a record: `calibrate` and its result, the
`Calibration`."""

from dataclasses import dataclass, field

import numpy as np

from ..alignment.location import place_of
from ..data import DataError
from ..geodesy import STANDARD_GRAVITY, gravity

DETAIL = {"accelerometer": ("m/s^2", 1.0, "m/s^2"), "magnetometer": ("T", 1e6, "uT")}
"""SI unit, factor to the unit of tables, and that unit."""
SAMPLES = 5000
"""Of a magnetometer about so many are used, evenly spaced: what is left of a calibration is not
white, so that more would add little."""
WRONG_STRENGTH, TURNED = 0.05, np.radians(10)
"""Relative error of strength after calibration, and turn of the magnetometer against the IMU
(rad), that are worth a note."""


@dataclass(frozen=True, repr=False)
class Calibration:
    """calibrated = matrix @ (measured - bias), body axes, SI (m/s^2 or T); `to_toml` writes it
    in the axes of the recording's columns."""

    sensor: str  # "accelerometer" or "magnetometer"
    form: str  # "rests", "ellipsoid" or "turning"
    bias: np.ndarray  # (3,)
    matrix: np.ndarray  # (3, 3)
    covariance: np.ndarray  # (12, 12) of the bias and of the rows of the matrix
    strength: float  # the strength that was fitted: gravity, or the Earth's field
    before: float  # rms error of the strength before
    after: float  # rms error of the strength after
    residual: np.ndarray  # (3,) rms misfit per axis
    coverage: float  # share of the sphere's cells that were seen
    lacking: tuple  # half-axes of the body near which no direction was seen, such as "-z"
    held: tuple  # parameters that the record does not determine, left at identity
    weakest: float  # least singular value, see strapdown.calibration.ellipsoid.WEAKEST
    notes: tuple  # sentences for the user
    t: np.ndarray  # (n,) s, of the samples
    measured: np.ndarray  # (n, 3) samples that were fitted, body axes
    residuals: np.ndarray  # (n, 3) misfits; NaN where a sample was not used
    columns: dict = field(
        default_factory=dict
    )  # axes and earlier calibration of the columns, from recording.meta
    name: str = ""  # of the recording

    @property
    def sd(self):
        """(3,) standard deviations of the bias and (3, 3) of the matrix."""
        deviations = np.sqrt(np.diag(self.covariance))
        return deviations[:3], deviations[3:].reshape(3, 3)

    @property
    def calibrated(self):
        """(n, 3) the samples after calibration."""
        return (self.measured - self.bias) @ self.matrix.T

    @property
    def header(self):
        """Header of `rows`."""
        return self.sensor, "x", "y", "z", "unit"

    @property
    def rows(self):
        """Bias, matrix, their standard deviations and the residuals as text, a row each."""
        _, factor, unit = DETAIL[self.sensor]
        shown = lambda values, digits=4: tuple(f"{float(value):.{digits}g}" for value in values)
        bias_sd, matrix_sd = self.sd
        rows = [
            ("bias", *shown(self.bias * factor), unit),
            ("  sd", *shown(bias_sd * factor, 2), unit),
        ]
        for axis, row, deviation in zip("xyz", self.matrix, matrix_sd):
            rows += [
                (f"matrix, row {axis}", *(f"{value:.5f}" for value in row), ""),
                ("  sd", *shown(deviation, 2), ""),
            ]
        return [*rows, ("misfit, rms", *shown(self.residual * factor, 3), unit)]

    @property
    def verdict(self):
        """Two sentences: strength before and after, and the directions."""
        _, factor, unit = DETAIL[self.sensor]
        lack = f"; none near {', '.join(self.lacking)}" if self.lacking else ""
        error = f"rms error {self.before * factor:.3g} before and {self.after * factor:.3g} {unit} after"
        return (
            f"strength: {self.strength * factor:.4g} {unit}, {error}. "
            f"Directions: {self.coverage:.0%} of the sphere{lack}"
        )

    @property
    def hint(self):
        """Where recording.toml names the file."""
        return (
            '[imu] calibration = "{}"'
            if self.sensor == "accelerometer"
            else '[[aiding]] kind = "magnetic-field": calibration = "{}"'
        )

    def sections(self):
        """{section: Correction} in the axes of the columns; it holds what the recording's own
        calibration did too."""
        from ..io.calibration_file import composed

        return composed(
            "accel" if self.sensor == "accelerometer" else "magnetometer",
            self.bias,
            self.matrix,
            self.columns,
        )

    def to_toml(self, path):
        """Write a calibration file that recording.toml can name (docs/calibrate.md). Raises
        DataError where it cannot be written."""
        from ..io.calibration_file import write_calibration
        from ..preprocessing.origin import counted

        count = counted(len(self.t), "rest" if self.form == "rests" else "sample")
        comments = [
            f"{self.sensor} of {self.name or 'a recording'}, {self.t[0]:.1f} to {self.t[-1]:.1f} s, {count}, form {self.form!r}",
            "corrected = matrix @ (raw - bias), axes of the columns",
            self.verdict,
        ]
        write_calibration(path, self.sections(), comments + list(self.notes))

    def write(self, folder):
        """Write calibration.toml and calibration.html into `folder`. Raises DataError where that
        cannot be done."""
        from .page import page

        self.to_toml(folder / "calibration.toml")
        page(self).save(folder / "calibration.html")

    def __repr__(self):
        return f"Calibration({self.sensor}, {self.form}: {self.verdict})"


def calibrate(recording, sensor=None, start=None, stop=None):
    """The Calibration of the accelerometer or magnetometer of a Recording, or of its part from
    `start` to `stop`, s.

    sensor: "accelerometer", "magnetometer", or the name of a source of kind magnetic-field; None
    takes the magnetometer where there is one. Raises DataError of one line: too few directions (and
    which lack), a constant sensor, nothing to calibrate.
    """
    part = recording.between(-np.inf if start is None else start, np.inf if stop is None else stop)
    sources = [a for a in part.aidings if a.kind == "magnetic-field"]
    chosen = sensor or ("magnetometer" if sources else "accelerometer")
    if chosen == "accelerometer":
        return _accelerometer(part)
    if not sources:
        raise DataError(
            f"{chosen}: the recording has no source of kind magnetic-field; name one in recording.toml, or calibrate the accelerometer"
        )
    named = sources if chosen == "magnetometer" else [a for a in sources if a.name == chosen]
    if not named:
        there = dict.fromkeys(
            ("accelerometer", "magnetometer", *(a.name or a.kind for a in sources))
        )
        raise DataError(f"sensor {chosen!r} is unknown; there is {', '.join(there)}")
    notes = (
        [
            f"{len(named)} magnetometers: {named[0].name or named[0].kind!r} is calibrated; name another as sensor"
        ]
        if len(named) > 1
        else []
    )
    return _magnetometer(part, named[0], notes)


def _accelerometer(part):
    from .methods import coverage, lacking, rests, six_positions

    found, local, notes = rests(part.imu), *_gravity(part)
    fit = six_positions(found, local)
    share, _, lack = coverage(found.force)
    if lack:
        notes.append(lacking(lack, "no rest with"))
    return _made(
        "accelerometer",
        "rests",
        fit,
        local,
        found.t,
        found.force,
        (share, lack),
        notes,
        part,
        _columns(part, "accel"),
    )


def _gravity(part):
    """(local gravity in m/s^2, notes)."""
    place = place_of(part.meta, part.aidings)
    if place is None:
        return STANDARD_GRAVITY, [
            f"the place is not known: gravity is taken as {STANDARD_GRAVITY} m/s^2, which may be wrong by 0.3 %; give place"
        ]
    return float(gravity(place.lla[0], place.lla[2])), []


def _magnetometer(part, source, notes):
    from ..io.magnetic_record import sound
    from ..preprocessing.origin import Origin
    from .methods import coverage, hard_and_soft_iron, lacking, typical

    columns = _columns(part, source.name or source.kind)
    strength, dip = _reference(source, columns)
    if strength is None:
        notes.append(
            "the Earth's field is not known: the matrix keeps the typical strength of the sensor; give date and place, or field"
        )
    keep, more = sound(
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
        notes.append(lacking(lack, "no field along"))
    return _made("magnetometer", form, fit, size, t, y, (share, lack), notes, part, columns)


def _reference(source, columns):
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


def _form_notes(form, fit, gyro, t, size):
    if form == "turning":
        notes = [
            "form: turning, the field turned by the gyros; gyro bias "
            + " ".join(f"{value:.3f}" for value in np.degrees(gyro))
            + " deg/s"
        ]
        U, _, Vt = np.linalg.svd(fit.matrix)
        angle = np.arccos(np.clip((np.trace(U @ Vt) - 1) / 2, -1, 1))
        if angle > TURNED:
            notes.append(
                f"the magnetometer is turned by {np.degrees(angle):.0f} deg against the IMU; the matrix turns it back, but check axes"
            )
    else:
        notes = [
            "form: ellipsoid, strength alone; how the magnetometer is turned against the IMU is not part of it"
        ]
    return notes


def _made(sensor, form, fit, strength, t, measured, directions, notes, part, columns):
    used, notes = fit.used, list(notes)
    error = lambda vectors: float(
        np.sqrt(np.mean((np.linalg.norm(vectors, axis=1) - strength) ** 2))
    )
    after = error((measured[used] - fit.bias) @ fit.matrix.T)
    out = int(np.isfinite(measured).all(axis=1).sum() - used.sum()) if form != "turning" else 0
    if out:
        notes.append(f"{out} of {len(t)} left out as outliers")
    if fit.held:
        notes.append(
            f"no excitation: {', '.join(fit.held)} cannot be told from the bias and the others; left at identity"
        )
    if form == "rests" and len(t) <= 9 - len(fit.held):
        notes.append(
            f"{len(t)} rests for {9 - len(fit.held)} parameters: the misfit is zero by construction; more orientations would tell"
        )
    if after > WRONG_STRENGTH * strength:
        notes.append(
            f"the strength still varies by {100 * after / strength:.0f} % rms: iron or currents that are not fixed to the sensor"
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
        part.meta.get("name", ""),
    )


def _columns(part, name):
    sensors = part.meta.get("sensors", {})
    return (
        {"gyro": sensors.get("gyro", {}), **sensors[name]}
        if name in sensors and name == "accel"
        else sensors.get(name, {})
    )
