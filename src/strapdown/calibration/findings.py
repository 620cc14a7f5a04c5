"""Result of a calibration, as values, rows of a table and a file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..data.value import Value
from ..io.calibration_file import Correction, compose_corrections, write_calibration
from ..typing import Array, File
from ..units.wording import count_text
from .methods import DETAIL


@dataclass(frozen=True, eq=False, repr=False)
class Result(Value):
    """calibrated = matrix @ (measured - bias), body axes, SI (m/s^2 or T); `to_toml` writes it
    in the axes of the recording's columns.

    Attributes
    ----------
    sensor : str
        "accelerometer" or "magnetometer".
    form : str
        "rests", "ellipsoid" or "turning".
    bias : (3,) array
        Bias, m/s^2 or T.
    matrix : (3, 3) array
        Scale and misalignment.
    covariance : (12, 12) array
        Of the bias and of the rows of the matrix.
    strength : float
        The strength that was fitted: gravity, or the Earth's field.
    before : float
        Rms error of the strength before.
    after : float
        Rms error of the strength after.
    residual : (3,) array
        Rms misfit per axis.
    coverage : float
        Share of the sphere's cells that were seen.
    lacking : tuple of str
        half-axes of the body near which no direction was seen, such as "-z".
    held : tuple of str
        Parameters that the record does not determine, left at identity.
    weakest : float
        Least singular value, see strapdown.calibration.ellipsoid.WEAKEST.
    notes : tuple of str
        Sentences for the user.
    t : (n,) array
        s, of the samples.
    measured : (n, 3) array
        Samples that were fitted, body axes.
    residuals : (n, 3) array
        Misfits; NaN where a sample was not used.
    columns : dict[str, Any]
        Axes and earlier calibration of the columns, from recording.meta.
    name : str
        Of the recording.
    """

    sensor: str
    form: str
    bias: Array
    matrix: Array
    covariance: Array
    strength: float
    before: float
    after: float
    residual: Array
    coverage: float
    lacking: tuple[str, ...]
    held: tuple[str, ...]
    weakest: float
    notes: tuple[str, ...]
    t: Array
    measured: Array
    residuals: Array
    columns: dict[str, Any] = field(default_factory=dict)
    name: str = ""

    @property
    def std(self) -> tuple[Array, Array]:
        """(3,) standard deviations of the bias and (3, 3) of the matrix."""
        deviations = np.sqrt(np.diag(self.covariance))
        return deviations[:3], deviations[3:].reshape(3, 3)

    @property
    def calibrated(self) -> Array:
        """(n, 3) the samples after calibration."""
        return (self.measured - self.bias) @ self.matrix.T

    @property
    def header(self) -> tuple[str, ...]:
        """Header of `rows`."""
        return self.sensor, "x", "y", "z", "unit"

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Bias, matrix, their standard deviations and the residuals as text, a row each."""
        _, factor, unit = DETAIL[self.sensor]

        def texts(values: Array, digits: int = 4) -> tuple[str, ...]:
            return tuple(f"{float(value):.{digits}g}" for value in values)

        bias_std, matrix_std = self.std
        rows = [
            ("bias", *texts(self.bias * factor), unit),
            ("  std", *texts(bias_std * factor, 2), unit),
        ]
        for axis, row, deviation in zip("xyz", self.matrix, matrix_std):
            rows += [
                (f"matrix, row {axis}", *(f"{value:.5f}" for value in row), ""),
                ("  std", *texts(deviation, 2), ""),
            ]
        return [*rows, ("misfit, rms", *texts(self.residual * factor, 3), unit)]

    @property
    def verdict(self) -> str:
        """Two sentences: strength before and after, and the directions."""
        _, factor, unit = DETAIL[self.sensor]
        lack = f"; none near {', '.join(self.lacking)}" if self.lacking else ""
        error = f"rms error {self.before * factor:.3g} before and {self.after * factor:.3g} {unit} after"
        return (
            f"strength: {self.strength * factor:.4g} {unit}, {error}. "
            f"Directions: {self.coverage:.0%} of the sphere{lack}"
        )

    @property
    def hint(self) -> str:
        """Where recording.toml names the file."""
        return (
            '[imu] calibration = "{}"'
            if self.sensor == "accelerometer"
            else '[[source]] kind = "magnetic-field": calibration = "{}"'
        )

    def sections(self) -> dict[str, Correction]:
        """{section: Correction} in the axes of the columns; it holds what the recording's own
        calibration did too."""
        return compose_corrections(
            "accel" if self.sensor == "accelerometer" else "magnetometer",
            self.bias,
            self.matrix,
            self.columns,
        )

    def to_toml(self, path: File) -> None:
        """Write a calibration file that recording.toml can name (docs/how-to/calibrate.md). Raises
        DataError where it cannot be written."""
        count = count_text(len(self.t), "rest" if self.form == "rests" else "sample")
        comments = [
            f"{self.sensor} of {self.name or 'a recording'}, {self.t[0]:.1f} to {self.t[-1]:.1f} s, "
            f"{count}, form {self.form!r}",
            "corrected = matrix @ (raw - bias), axes of the columns",
            self.verdict,
        ]
        write_calibration(path, self.sections(), comments + list(self.notes))

    def _repr_html_(self) -> str:
        from ..pages.notebook.cards import card, lines
        from ..pages.parts import table

        said = lines([self.verdict, *self.notes])
        return card(f"Calibration {self.name}", {}, table(self.header, self.rows), said)

    def __repr__(self) -> str:
        return f"Calibration({self.sensor}, {self.form}: {self.verdict})"
