"""The Recording, on which filters run: IMU samples, sources of fixes and a reference."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from ..aiding import find
from ..checks import DataError, check_type
from ..core.loop.contract import Imu
from ..typing import Array, ArrayLike, File
from ..units.time_scales import Moment, ends, seconds_to, utc
from .operations import operation
from .solution import Source, Trajectory
from .value import TakenByTime, Value

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go
    import xarray as xr

    from ..sensor_models.imu import ImuSpec
    from .vehicle import Vehicle


class RecordingMeta(TypedDict, total=False):
    """Metadata of a recording; each key only where it is known.

    Keys that a reader or a user adds under other names are kept.

    Attributes
    ----------
    name : str
        Name of the recording.
    epoch : str or None
        UTC of t = 0, ISO 8601, where the clock is absolute.
    date : str or None
        Date, ISO 8601, of the geomagnetic model.
    notes : list[str]
        What was handled while reading.
    read : list[str]
        What was taken from the files, and how.
    grade : str or dict[str, Any] or ImuSpec or None
        The IMU: name or file of a grade, or its values.
    vehicle : str or dict[str, Any] or Vehicle or None
        The vehicle: its name or its bounds.
    place : (3,) array
        Latitude and longitude, rad, and height, m, near the start.
    temperature : (m, 2) array
        Times, s, and temperature of the IMU, degC.
    imu_lever_arm : sequence of float
        (3,) from the reference point of the vehicle to the IMU, m.
    imu_mounting : sequence of float
        (3,) rotation vector from the axes of the case to the body, rad.
    point : str
        Point of the vehicle that the reference is of: "imu" or another.
    estimate : Mapping[str, tuple of float]
        Parameters of the IMU that become states: priors, SI.
    guessed_axes : str
        The axes of the IMU where somebody guessed them and nobody confirmed them.
    undecided_gyro : str
        A complaint of the unit of the gyro, which holds unless the vehicle is a
        multicopter.
    sensors : dict[str, Any]
        Description of sensors as files have it.
    height_columns : dict[str, str]
        {column: name of the source} of heights in one file.
    b_a : (n, 3) array
        True accelerometer bias of a simulated IMU, m/s^2.
    b_g : (n, 3) array
        True gyro bias of a simulated IMU, rad/s.
    b_baro : array
        True error of a simulated barometer, m.
    movement : Sequence[sequence of float]
        Windows (start, stop) of a trial that count, s.
    position : list[float]
        What the header of a PSINS file says of the start, SI.
    velocity : list[float]
        As position.
    attitude : list[float]
        As position.
    gravity : float
        As position, m/s^2.
    start : dict[str, Any]
        Fields of the InitialState from which a live filter began; `fuse` begins there too.
    installed : dict[str, Any]
        What its recording.toml says of the installation; not of one changed after reading.
    aircraft : str
        Aircraft of a simulated flight.
    filter_options : dict[str, Any]
        Options of the filter of a simulated flight.
    outages : Sequence[tuple[float, float]]
        Windows without fixes of a simulated flight, s.
    wind : sequence of float
        Of a simulated flight, m/s towards north, east, down.
    told_wind : sequence of float
        The wind that its filter is told, m/s.
    turbulence : str
        Of a simulated flight.
    earth : str
        Of a simulated flight: geodetic or flat.
    feedback : str
        What its autopilot flies on.
    prediction : str
        What its filter is propagated by.
    seed : int
        Seed of a simulation.
    """

    name: str
    epoch: str | None
    date: str | None
    notes: list[str]
    read: list[str]
    grade: str | dict[str, Any] | ImuSpec | None
    vehicle: str | dict[str, Any] | Vehicle | None
    place: Sequence[float] | Array
    temperature: Array
    imu_lever_arm: Sequence[float]
    imu_mounting: Sequence[float]
    point: str
    estimate: Mapping[str, tuple[float, ...]]
    guessed_axes: str
    undecided_gyro: str
    sensors: dict[str, Any]
    height_columns: dict[str, str]
    b_a: Array
    b_g: Array
    b_baro: Array
    movement: Sequence[Sequence[float]]
    position: list[float]
    velocity: list[float]
    attitude: list[float]
    gravity: float
    start: dict[str, Any]
    installed: dict[str, Any]
    aircraft: str
    filter_options: dict[str, Any]
    outages: Sequence[tuple[float, float]]
    wind: Sequence[float]
    told_wind: Sequence[float]
    turbulence: str
    earth: str
    feedback: str
    prediction: str
    seed: int


@dataclass(frozen=True, eq=False)
class Recording(Value, TakenByTime):
    """IMU samples, sources of fixes and, optionally, a reference to score against.

    Attributes
    ----------
    imu : Imu
        Samples of the IMU, increments in body axes.
    sources : tuple of Source
        Sources of fixes and constraints.
    reference : Trajectory or None
        The truth, or the best known solution; None without one.
    meta : RecordingMeta
        Facts of the recording.
    """

    imu: Imu
    sources: tuple[Source, ...] = ()
    reference: Trajectory | None = None
    meta: RecordingMeta = field(default_factory=RecordingMeta)

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        gyro: ArrayLike,
        accel: ArrayLike,
        sources: Iterable[Source] = (),
        reference: Trajectory | None = None,
        kind: str = "rate",
        **meta: Any,
    ) -> Recording:
        """From arrays in body FRD axes: `gyro` and `accel` (n, 3) in rad/s and m/s^2, or, with
        kind="increment", in rad and m/s.

        Row k is the integral (or mean) over (t[k-1], t[k]]; the first row's interval is the median
        one. Raises DataError.
        """
        imu, cleaned, notes = operation("clean")(t, gyro, accel, sources, kind, meta.get("vehicle"))
        known = cast(RecordingMeta, {"name": "arrays", **meta, "notes": notes})
        return cls(imu, cleaned, reference, known)

    @classmethod
    def from_frames(
        cls,
        imu: pd.DataFrame,
        sources: Iterable[Source] = (),
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
            sources=sources,
            reference=reference,
            kind=kind,
            **meta,
        )

    def __len__(self) -> int:
        return len(self.imu.t)

    def with_meta(self, **facts: Unpack[RecordingMeta]) -> Self:
        """The same recording with these facts in its meta."""
        return replace(self, meta={**self.meta, **facts})

    def with_notes(self, notes: Iterable[str]) -> Self:
        """The same recording with further notes."""
        return self.with_meta(notes=[*self.meta.get("notes", []), *notes])

    def without_meta(self, name: str) -> Self:
        """The same recording without a fact of its meta."""
        left = {key: value for key, value in self.meta.items() if key != name}
        return replace(self, meta=cast(RecordingMeta, left))

    @property
    def span(self) -> tuple[float, float]:
        """First and last time covered by IMU samples, s."""
        return float(self.imu.t[0] - self.imu.dt[0]), float(self.imu.t[-1])

    @property
    def utc(self) -> NDArray[np.datetime64] | None:
        """UTC of the IMU samples as datetime64[ns] (n,); None where the clock is not absolute."""
        epoch = self.meta.get("epoch")
        return None if epoch is None else utc(epoch, self.imu.t)

    def between(self, start: Moment | None = None, stop: Moment | None = None) -> Self:
        """Return the part from start to stop, with the rows of the reference that cover it.

        Parameters
        ----------
        start, stop : float, str, datetime or numpy.datetime64, optional
            s of the recording, or dates in UTC where its clock is absolute; open by default.

        Raises
        ------
        DataError
            Where there are no IMU samples, or a date is given without an absolute clock.
        """
        begin, end = ends(start, stop, self.meta.get("epoch"), "recording")
        first, last = np.searchsorted(self.imu.t, [begin, end], side="right")
        if last - first < 2:
            raise DataError(
                f"no IMU samples between {begin:g} and {end:g} s; the recording covers "
                f"{self.span[0]:.3f} to {self.span[1]:.3f} s"
            )
        return replace(
            self,
            imu=Imu(*(column[first:last] for column in self.imu)),
            sources=tuple(a.between(begin, end) for a in self.sources),
            reference=None
            if self.reference is None
            else _covering_rows(self.reference, begin, end),
        )

    def hidden(
        self, windows: Collection[tuple[float, float]], kinds: Collection[str] | None = None
    ) -> Self:
        """The same recording with the recorded fixes inside `windows` withheld (constraints
        stay, unless `kinds` names them)."""

        def hide(a: Source) -> bool:
            return a.kind in kinds if kinds else find(a.kind).recorded

        return replace(
            self, sources=tuple(a.without(windows) if hide(a) else a for a in self.sources)
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
        return f"Recording({self.meta.get('name', '')}: {len(self.imu.t)} IMU samples, {self.span[0]:.1f} to {self.span[1]:.1f} s, {list(self.sources)})"


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedRecording(Recording):
    """A Recording with its truth: `reference` is always there.

    Attributes
    ----------
    imu, sources, meta
        As of a Recording.
    reference : Trajectory
        The truth, with velocity and attitude, at the IMU samples and one interval before the first.
    """

    reference: Trajectory = field(kw_only=True)


def _seconds(table: pd.DataFrame, epoch: str) -> Array:
    """(n,) s since the epoch of the dates that are the index of a table."""
    dates: Any = table.index if table.index.tz is None else table.index.tz_convert("UTC")  # type: ignore[attr-defined]  # it has dates
    dates = dates.to_numpy("M8[ns]")
    after = (dates - dates[0]) / np.timedelta64(1, "ns") * 1e-9
    return seconds_to(dates[0], epoch, "the index of the table") + after


def _covering_rows(reference: Trajectory, start: float, stop: float) -> Trajectory:
    """The rows of a reference from start to stop, s, and one more on either side."""
    first, last = np.searchsorted(reference.t, [start, stop])
    return reference.take(slice(max(int(first) - 1, 0), int(last) + 1))


def check_recording(recording: object) -> None:
    """Refuse what is no Recording, such as the path of one. Raises DataError."""
    check_type(recording, "recording", Recording, "a Recording: read it first with sd.read")
