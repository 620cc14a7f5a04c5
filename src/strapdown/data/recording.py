"""The Recording, on which filters run: IMU samples, sources of fixes and a reference."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from ..aiding import find
from ..checks import DataError, brief
from ..core.loop.contract import Imu
from ..typing import Array, ArrayLike, File
from ..units.time_scales import ends, seconds_to, utc
from .operations import operation
from .solution import Aiding, Trajectory
from .value import Value

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go
    import xarray as xr

    from ..sensor_models.imu import ImuSpec
    from .vehicle import Vehicle


class RecordingMeta(TypedDict, total=False):
    """Metadata of a recording; each key only where it is known.

    Keys that a reader or a user adds under other names are kept.
    """

    name: str
    epoch: str | None  # UTC of t = 0, ISO 8601, where the clock is absolute
    date: str | None
    notes: list[str]  # what was handled while reading
    read: list[str]  # what was taken from the files, and how
    grade: str | dict[str, Any] | ImuSpec | None  # the IMU: name or file of a grade, or its values
    vehicle: str | dict[str, Any] | Vehicle | None
    place: (
        Sequence[float] | Array
    )  # (3,) latitude and longitude, rad, and height, m, near the start
    temperature: Array  # (m, 2) s and degC of the IMU
    imu_lever_arm: Sequence[float]  # (3,) from the reference point of the vehicle to the IMU, m
    imu_mounting: Sequence[float]  # (3,) rotation vector from the axes of the case to the body, rad
    point: str  # of the vehicle that the reference is of: "imu" or another
    estimate: Mapping[
        str, tuple[float, ...]
    ]  # parameters of the IMU that become states: priors, SI
    guessed_axes: str  # the axes of the IMU where somebody guessed them and nobody confirmed them
    # a complaint of the unit of the gyro, which holds unless the vehicle is a multicopter
    undecided_gyro: str
    sensors: dict[str, Any]  # description of sensors as files have it
    height_columns: dict[str, str]  # {column: name of the source} of heights in one file
    b_a: Array  # (n, 3) true biases of a simulated IMU, m/s^2
    b_g: Array  # (n, 3) rad/s
    b_baro: Array  # true error of a simulated barometer, m
    movement: Sequence[Sequence[float]]  # s, the windows of a trial that count
    # of a file of PSINS: what its header says of the start, SI
    position: list[float]
    velocity: list[float]
    attitude: list[float]
    gravity: float
    # what its recording.toml says of the installation; not of one changed after reading
    installed: dict[str, Any]
    # of a simulated flight
    aircraft: str
    filter_options: dict[str, Any]
    outages: Sequence[tuple[float, float]]  # s
    wind: Sequence[float]  # m/s towards north, east, down
    told_wind: Sequence[float]
    turbulence: str
    earth: str
    feedback: str
    prediction: str
    seed: int


@dataclass(frozen=True, eq=False)
class Recording(Value):
    """IMU samples, sources of fixes and, where there is one, a reference to score against."""

    imu: Imu
    aidings: tuple[Aiding, ...] = ()
    reference: Trajectory | None = None
    meta: RecordingMeta = field(default_factory=RecordingMeta)

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        gyro: ArrayLike,
        accel: ArrayLike,
        aidings: Iterable[Aiding] = (),
        reference: Trajectory | None = None,
        kind: str = "rate",
        **meta: Any,
    ) -> Recording:
        """From arrays in body FRD axes: `gyro` and `accel` (n, 3) in rad/s and m/s^2, or, with
        kind="increment", in rad and m/s.

        Row k is the integral (or mean) over (t[k-1], t[k]]; the first row's interval is the median
        one. Raises DataError.
        """
        imu, sources, notes = operation("clean")(t, gyro, accel, aidings, kind, meta.get("vehicle"))
        known = cast(RecordingMeta, {"name": "arrays", **meta, "notes": notes})
        return cls(imu, sources, reference, known)

    @classmethod
    def from_frames(
        cls,
        imu: pd.DataFrame,
        aidings: Iterable[Aiding] = (),
        reference: Trajectory | None = None,
        kind: str = "rate",
        **meta: Any,
    ) -> Recording:
        """From a DataFrame indexed by time with columns gyro_x, gyro_y, gyro_z, accel_x, accel_y,
        accel_z (pyins), SI and radians, such as `to_pandas` gives.

        The index has seconds, or dates (UTC where they have no zone): then the clock is absolute, and
        t counts from `epoch`, ISO 8601, by default the whole second of the first date. Raises
        DataError.
        """
        axes = [[f"{sensor}_{axis}" for axis in "xyz"] for sensor in ("gyro", "accel")]
        missing = [name for names in axes for name in names if name not in imu.columns]
        if missing:
            raise DataError(
                f"IMU table: column {missing[0]!r} is missing; it has "
                f"{', '.join(map(str, imu.columns))}"
            )
        gyro, accel = (imu[names].to_numpy(float) for names in axes)
        dated = imu.index.dtype.kind == "M" or hasattr(imu.index, "tz_convert")
        if dated:
            meta.setdefault("epoch", f"{imu.index[0]:%Y-%m-%dT%H:%M:%S}Z")
        return cls.from_arrays(
            _seconds(imu, meta["epoch"]) if dated else imu.index.to_numpy(float),
            gyro,
            accel,
            aidings=aidings,
            reference=reference,
            kind=kind,
            **meta,
        )

    def __len__(self) -> int:
        return len(self.imu.t)

    def knowing(self, **facts: Unpack[RecordingMeta]) -> Recording:
        """The same recording with these facts in its meta."""
        return replace(self, meta={**self.meta, **facts})

    def noting(self, notes: Iterable[str]) -> Recording:
        """The same recording with further notes."""
        return self.knowing(notes=[*self.meta.get("notes", []), *notes])

    def forgetting(self, name: str) -> Recording:
        """The same recording without a fact of its meta."""
        left = {key: value for key, value in self.meta.items() if key != name}
        return replace(self, meta=cast(RecordingMeta, left))

    def __getitem__(self, part: slice) -> Recording:
        """The part of `recording[100:200]`, s, as `between` takes it, with the rows of the reference
        that cover it; dates do where the clock is absolute. Raises DataError where it is empty."""
        start, stop = ends(part, self.meta.get("epoch"), "recording")
        reference = self.reference
        if reference is not None:
            first, last = np.searchsorted(reference.t, [start, stop])
            reference = reference.taking(slice(max(int(first) - 1, 0), int(last) + 1))
        return replace(self.between(start, stop), reference=reference)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time covered by IMU samples, s."""
        return float(self.imu.t[0] - self.imu.dt[0]), float(self.imu.t[-1])

    @property
    def utc(self) -> NDArray[np.datetime64] | None:
        """UTC of the IMU samples as datetime64[ns] (n,); None where the clock is not absolute."""
        epoch = self.meta.get("epoch")
        return None if epoch is None else utc(epoch, self.imu.t)

    def between(self, start: float = -np.inf, stop: float = np.inf) -> Recording:
        """The part within [start, stop], s."""
        first, last = np.searchsorted(self.imu.t, [start, stop], side="right")
        if last - first < 2:
            raise DataError(
                f"no IMU samples between {start:g} and {stop:g} s; the recording covers "
                f"{self.span[0]:.3f} to {self.span[1]:.3f} s"
            )
        return replace(
            self,
            imu=Imu(*(column[first:last] for column in self.imu)),
            aidings=tuple(a.between(start, np.nextafter(stop, np.inf)) for a in self.aidings),
        )

    def hidden(
        self, windows: Collection[tuple[float, float]], kinds: Collection[str] | None = None
    ) -> Recording:
        """The same recording with the recorded fixes inside `windows` withheld (constraints
        stay, unless `kinds` names them)."""

        def hide(a: Aiding) -> bool:
            return a.kind in kinds if kinds else find(a.kind).recorded

        return replace(
            self, aidings=tuple(a.without(windows) if hide(a) else a for a in self.aidings)
        )

    def save(self, path: File) -> None:
        """Write it to a file .nc, as `write_recording`. Raises DataError."""
        operation("save recording")(self, path)

    def plot(self, what: str = "readings") -> go.Figure:
        """A plotly Figure, which can be changed: "readings" of the IMU, its "temperature" and the
        "spectra" of its vibration; "intervals" from sample to sample and fix to fix; "sources", when each has fixes; "track",
        fixes and reference from above. Raises DataError."""
        figure: go.Figure = operation("figure")(self, what)
        return figure

    def to_pandas(self, part: str = "imu") -> pd.DataFrame:
        """pandas DataFrame of the samples of the IMU, as `from_frames` takes it, of the "reference",
        or of the fixes of the source of that name; dates are the index where the clock is absolute.

        Units and names of the CF conventions stand in `attrs`. Raises DataError.
        """
        frame: pd.DataFrame = operation("frame")(self, part)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """xarray Dataset of all of it: samples over `time`, fixes of each source and the reference
        over times of their own. Raises DataError where xarray is missing."""
        dataset: xr.Dataset = operation("dataset")(self)
        return dataset

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def __repr__(self) -> str:
        return f"Recording({self.meta.get('name', '')}: {len(self.imu.t)} IMU samples, {self.span[0]:.1f} to {self.span[1]:.1f} s, {list(self.aidings)})"


def _seconds(table: pd.DataFrame, epoch: str) -> Array:
    """(n,) s since the epoch of the dates that are the index of a table."""
    dates: Any = table.index if table.index.tz is None else table.index.tz_convert("UTC")  # type: ignore[attr-defined]  # it has dates
    dates = dates.to_numpy("M8[ns]")
    after = (dates - dates[0]) / np.timedelta64(1, "ns") * 1e-9
    return seconds_to(dates[0], epoch, "the index of the table") + after


def check_recording(recording: object) -> None:
    """Refuse what is no Recording, such as the path of one. Raises DataError."""
    if not isinstance(recording, Recording):
        raise DataError(
            f"recording is {brief(recording)}; it must be a Recording: read it first with sd.read"
        )
