"""Result of a calibration, as values, rows of a table and a file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..io.calibration_file import Correction, compose_corrections, write_calibration
from ..typing import Array, File
from ..units.wording import count_text
from .methods import DETAIL


@dataclass(frozen=True, repr=False)
class Result:
    """calibrated = matrix @ (measured - bias), body axes, SI (m/s^2 or T); `to_toml` writes it
    in the axes of the recording's columns."""

    sensor: str  # "accelerometer" or "magnetometer"
    form: str  # "rests", "ellipsoid" or "turning"
    bias: Array  # (3,)
    matrix: Array  # (3, 3)
    covariance: Array  # (12, 12) of the bias and of the rows of the matrix
    strength: float  # the strength that was fitted: gravity, or the Earth's field
    before: float  # rms error of the strength before
    after: float  # rms error of the strength after
    residual: Array  # (3,) rms misfit per axis
    coverage: float  # share of the sphere's cells that were seen
    lacking: tuple[str, ...]  # half-axes of the body near which no direction was seen, such as "-z"
    held: tuple[str, ...]  # parameters that the record does not determine, left at identity
    weakest: float  # least singular value, see strapdown.calibration.ellipsoid.WEAKEST
    notes: tuple[str, ...]  # sentences for the user
    t: Array  # (n,) s, of the samples
    measured: Array  # (n, 3) samples that were fitted, body axes
    residuals: Array  # (n, 3) misfits; NaN where a sample was not used
    # axes and earlier calibration of the columns, from recording.meta
    columns: dict[str, Any] = field(default_factory=dict)
    name: str = ""  # of the recording

    @property
    def sd(self) -> tuple[Array, Array]:
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

        def shown(values: Array, digits: int = 4) -> tuple[str, ...]:
            return tuple(f"{float(value):.{digits}g}" for value in values)

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
            else '[[aiding]] kind = "magnetic-field": calibration = "{}"'
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
