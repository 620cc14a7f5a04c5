"""The types a user meets: Trajectory, Source, Solution, and Recording in recording.py. Inside SI
and radians; tables are in degrees and say so.

Tables follow the column names of pyins: lat, lon, alt, VN, VE, VD, roll, pitch, heading (deg, m,
m/s).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..checks import DataError as DataError
from ..core.loop.contract import BRIDGED, DOUBTFUL, INVALID, VALID, Imu  # noqa: F401 (status values: part of what a user meets here)
from ..core.mathematics.rotation import quaternion_to_euler
from ..extras import optional_import
from ..geometry import geodesy
from ..geometry.rotations import Rotation
from ..typing import Array, ArrayLike, File, Ints, Mask, Vector
from ..units.time_scales import Moment, ends, utc, within
from ..units.wording import count_text
from .operations import operation
from .value import TakenByTime, Value, read_only
from .verdict import NOT_JUDGED, RISK, Untested, Verdict

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go
    import xarray as xr
    from scipy.spatial.transform import Rotation as ScipyRotation

    from ..evaluation.metrics import Errors
    from ..evaluation.other_instants import Instants
    from ..evaluation.protection import ProtectionLevels
    from ..installation.states import EstimatedInstallation
    from .recording import Recording

ATTITUDE_COLUMNS = ["roll", "pitch", "heading"]
NAV_COLUMNS = ["lat", "lon", "alt", "VN", "VE", "VD", *ATTITUDE_COLUMNS]
BIAS_COLUMNS = [
    "accel_bias_x",
    "accel_bias_y",
    "accel_bias_z",
    "gyro_bias_x",
    "gyro_bias_y",
    "gyro_bias_z",
]
STD_COLUMNS = [
    "std_north",
    "std_east",
    "std_down",
    "std_VN",
    "std_VE",
    "std_VD",
    "std_rotation_north",
    "std_rotation_east",
    "std_rotation_down",
    *("std_" + name for name in BIAS_COLUMNS),
]
UNITS = {
    "t": "s",
    "lat": "deg",
    "lon": "deg",
    "alt": "m",
    "VN": "m/s",
    "VE": "m/s",
    "VD": "m/s",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
    **{name: "m/s^2" if "accel" in name else "deg/h" for name in BIAS_COLUMNS + STD_COLUMNS[9:]},
    **dict(zip(STD_COLUMNS, ["m"] * 3 + ["m/s"] * 3 + ["deg"] * 3)),
}
"""Unit of every column of `Trajectory.table` and `Solution.table`."""
GNSS = ("position", "velocity")
"""Kinds of measurement of a receiver, by which sensors beside it are judged."""
STD_SCALE = np.r_[np.ones(6), np.full(3, np.degrees(1)), np.ones(3), np.full(3, np.degrees(3600))]
"""From SI to the units of the `std_` columns; its last six also to those of the biases."""
OF_WHOLE = Untested("this part by itself", "the verdict is that of the whole run")
"""Remark in the verdict of a part of a Solution."""


def _frame(t: Array, columns: dict[str, Any]) -> pd.DataFrame:
    with optional_import("a table"):
        import pandas as pd

    return pd.DataFrame(columns, index=pd.Index(t, name="t"))


def _assume_known(part: Array | None) -> Array:
    """A part of a Trajectory that its maker is sure of: for the type checker, nothing else."""
    return part  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Trajectory(Value, TakenByTime):
    """Position, velocity and attitude over time: a truth, a reference or a solution. Unknown
    quantities are None or NaN.

    Attributes
    ----------
    t : (n,) array
        Times, s.
    lla : (n, 3) array
        Latitude rad, longitude rad, ellipsoidal height m; NaN where only the attitude is
        known.
    v_n : (n, 3) array or None
        Velocity towards north, east and down, m/s.
    q_nb : (n, 4) array or None
        Attitude, scalar first, body to navigation frame.
    std : (n, k) array or None
        Standard deviations of the first k error states, SI and radians.
    """

    t: Array
    lla: Array
    v_n: Array | None = None
    q_nb: Array | None = None
    std: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float | None = None, stop: float | None = None) -> Trajectory:
        """Return the rows from start to stop, s, both included. Raises DataError where there are
        none."""
        return self.take(within(self.t, *ends(start, stop, None, "trajectory"), "trajectory"))

    def take(self, rows: slice | Mask | Ints) -> Trajectory:
        """These rows of it."""
        parts = (self.t, self.lla, self.v_n, self.q_nb, self.std)
        return Trajectory(*(None if part is None else part[rows] for part in parts))  # type: ignore[arg-type]  # t and lla are there

    @property
    def rotation(self) -> ScipyRotation:
        """scipy Rotation (n,) from body to navigation frame. scipy 1.17 takes no read-only arrays:
        body velocity is `path.rotation.inv().apply(path.v_n.copy())`."""
        from scipy.spatial.transform import Rotation as ScipyRotation

        return ScipyRotation.from_quat(_assume_known(self.q_nb)[:, [1, 2, 3, 0]])

    @cached_property
    def rph(self) -> Array:
        """(n, 3) roll, pitch, heading in rad, heading in [0, 2 pi); NaN where the quaternion is."""
        angles = quaternion_to_euler(_assume_known(self.q_nb))
        return read_only(np.c_[angles[:, :2], angles[:, 2] % (2 * np.pi)])

    def displaced(self, lever_arm: Vector, omega: Array) -> Trajectory:
        """The trajectory of another point of the body: `lever_arm` (3,) m from this one, body;
        `omega` (n, 3) rad/s, bias-free body rate.

        Standard deviations stay those of the original point.
        """
        turn = attitude_of(self)
        return replace(
            self,
            lla=geodesy.displace_lla(self.lla, turn.apply(np.array(lever_arm, float))),
            v_n=_assume_known(self.v_n) + turn.apply(np.cross(omega, lever_arm)),
        )

    def table(self) -> pd.DataFrame:
        """pandas DataFrame indexed by time (s), columns in the units of `UNITS`."""
        return _frame(self.t, self.as_columns())

    def as_columns(self) -> dict[str, Array]:
        """The columns of its table by name, (n,) each."""
        parts = {
            name: np.degrees(self.lla[:, i]) if i < 2 else self.lla[:, 2]
            for i, name in enumerate(NAV_COLUMNS[:3])
        }
        if self.v_n is not None:
            parts |= dict(zip(NAV_COLUMNS[3:6], self.v_n.T))
        if self.q_nb is not None:
            parts |= dict(zip(ATTITUDE_COLUMNS, np.degrees(self.rph).T))
        return parts

    def to_pandas(self) -> pd.DataFrame:
        """Its `table`, with units and names of the CF conventions in `attrs`."""
        frame: pd.DataFrame = operation("frame")(self)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """xarray Dataset over time, with units and names of the CF conventions. Raises DataError
        where xarray is missing."""
        dataset: xr.Dataset = operation("dataset")(self)
        return dataset

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def __repr__(self) -> str:
        span = f"{self.t[0]:.3f} to {self.t[-1]:.3f} s" if len(self) else "empty"
        return f"Trajectory({len(self)} rows, {span})"


def attitude_of(path: Trajectory) -> Rotation:
    """The Rotation (n,) of a trajectory with attitude, from body to navigation frame."""
    return Rotation.from_wxyz(_assume_known(path.q_nb))


class Correlated(NamedTuple):
    """Errors of a source that last: first-order Gauss-Markov processes, one per row of its
    innovation, beside the white ones that its standard deviations are of.

    Attributes
    ----------
    std : tuple of float
        Stationary standard deviation by row, SI; 0: none.
    time : float
        Correlation time, s.
    states : bool
        True: a filter that can estimates them; False: they widen the standard deviations.
    """

    std: tuple[float, ...]
    time: float
    states: bool = True


@dataclass(frozen=True, eq=False)
class Source(Value):
    """One source of fixes. `std` has a column per row of the innovation; a missing component of
    `y` is NaN.

    Attributes
    ----------
    kind : str
        Kind of measurement, a name of `strapdown.aiding.names()`.
    t : (m,) array
        Times of the fixes, s.
    y : (m, components) array
        Measured values, SI and radians; NaN where a component is missing.
    std : (m, rows) array
        Standard deviations of the rows of the innovation, m, m/s or rad.
    parameters : tuple of float
        Such as the lever arm from the IMU to the antenna, m, body axes.
    gate : float or None
        Bound on the NIS; None: 0.1 % false alarms; inf: no gate.
    name : str
        Name shown in tables; the kind by default.
    estimate : Mapping[str, tuple of float]
        {parameter of the installation (names of `calibration_parameters`) to estimate:
        prior standard deviations}.
    slip : float
        Of a constraint across the wheels: side slip, rad per m/s^2 of lateral acceleration;
        adds to std.
    correlated : Correlated or None
        Time-correlated errors; None without any.
    robust : bool
        True: a heavy-tailed likelihood instead of the gate.
    adaptive : float
        Memory in s of the adaptive noise; 0: the noise stays as given.
    receiver : str
        Name of the receiver of which this is a class; sources of one kind and receiver are its
        fixes by carrier solution. Empty: all fixes are in this source.
    """

    kind: str
    t: Array
    y: Array
    std: Array
    parameters: tuple[float, ...] = ()
    gate: float | None = None
    name: str = ""
    estimate: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    slip: float = 0.0
    correlated: Correlated | None = None
    robust: bool = False
    adaptive: float = 0.0
    receiver: str = ""

    def between(self, start: float, stop: float) -> Source:
        """Return the fixes from start to stop, s, both included."""
        return self._where((self.t >= start) & (self.t <= stop))

    def without(self, windows: Iterable[tuple[float, float]]) -> Source:
        """The fixes outside every (start, stop) window of seconds."""
        keep = np.ones(len(self.t), bool)
        for start, stop in windows:
            keep &= (self.t < start) | (self.t >= stop)
        return self._where(keep)

    def _where(self, keep: Mask) -> Source:
        return replace(self, t=self.t[keep], y=self.y[keep], std=self.std[keep])

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def __repr__(self) -> str:
        return f"Source({self.name or self.kind}, {count_text(len(self.t), 'fix', 'es')})"


@dataclass(frozen=True, eq=False)
class Innovations(Value):
    """The innovations of a solution and the use of each measurement, in time order.

    Attributes
    ----------
    t : (m,) array
        Times of the measurements, s.
    source : (m,) array
        Index into `names`.
    innovation : (m, 3) array
        m, m/s, rad, m/s^2 or T; NaN where there was nothing to measure.
    nis : (m,) array
        Normalised innovation squared; NaN where the filter does not gate.
    accepted : (m,) array
        True: the filter used it.
    names : tuple of str
        Names of the sources.
    gates : tuple of float
        Bounds on the NIS of the sources.
    whitened : (m, 3) array or None
        Whitened: N(0, 1) each where the filter is right; NaN without a covariance, None of
        a file.
    root : (m, 6) array or None
        Rows of L (00, 10, 11, 20, 21, 22), L L' the covariance of the innovation; as
        whitened.
    weight : (m,) array or None
        Stated variance over that with which it was used: 1 as stated, 0 not used, between
        them of a robust source; None of a file.
    followed : (m, 3) array or None
        Standard deviations that an adaptive source had found, over those stated; else 1.
        NIS, whitened and root are by them; None of a file.
    """

    t: Array
    source: Ints
    innovation: Array
    nis: Array
    accepted: Mask
    names: tuple[str, ...] = ()
    gates: tuple[float, ...] = ()
    whitened: Array | None = None
    root: Array | None = None
    weight: Array | None = None
    followed: Array | None = None

    def between(self, start: float, stop: float) -> Innovations:
        """Those of fixes from start to stop, s, both included."""
        near = (self.t >= start) & (self.t <= stop)
        by_fix: dict[str, Any] = {
            name: part[near] for name, part in vars(self).items() if isinstance(part, np.ndarray)
        }
        return replace(self, **by_fix)


class Separation(NamedTuple):
    """The distance of a filter, which knows the past alone, from its smoother, row by row: position,
    velocity and attitude.

    Attributes
    ----------
    size : (n, 3) array
        m, m/s, rad; NaN where nothing can be compared.
    std : (n, 3) array
        Of the difference, its components together.
    """

    size: NDArray[np.float32]
    std: NDArray[np.float32]


class Rejected(NamedTuple):
    """A run of rejected fixes of a source, and why they were probably rejected.

    Attributes
    ----------
    source : str
        Name of the source.
    start : float
        Time of the first of them, s.
    stop : float
        Time of the last of them, s.
    number : int
        How many were rejected.
    of : int
        How many fixes the source had meanwhile.
    cause : str
        Jump, drift, clock, noise too small, other sources disagree, single outliers or not
        known.
    seen : str
        What was seen, with number and unit.
    remedy : str
        What to change.
    """

    source: str
    start: float
    stop: float
    number: int
    of: int
    cause: str
    seen: str
    remedy: str

    def __str__(self) -> str:
        fixes = "fix" if self.of == 1 else "fixes"
        many = f"{self.number} of {self.of}" if self.number < self.of else f"{self.number}"
        when = f"from {self.start:.1f} to {self.stop:.1f} s" if self.number > 1 else "here"
        return f"{self.source}: {many} {fixes} rejected {when}: {self.seen}; {self.remedy}"


class SolutionMeta(TypedDict, total=False):
    """Metadata of a solution; each key only where it is known.

    Attributes
    ----------
    filter : str
        Name of the filter.
    recording : str
        Name of the recording.
    epoch : str or None
        UTC of t = 0, ISO 8601, where the clock is absolute.
    date : str or None
        Date of the recording, ISO 8601.
    notes : list[str]
        What was handled on the way.
    read : list[str]
        What was taken from the files.
    imu : str
        Name of the grade.
    vehicle : str
        Its name.
    start : dict[str, Any]
        Fields of the InitialState.
    noise : dict[str, float]
        Fields of the Noise.
    kinds : dict[str, str]
        {source: kind}.
    bias_std : sequence of float or None
        What the description of the IMU allows, m/s^2 and rad/s.
    fixes_outside : int
        Fixes before the start or after the samples.
    point : str
        Point of the vehicle that it is of: "imu" or another.
    withheld : Sequence[tuple[float, float]]
        Windows without fixes, s.
    installation : dict[str, Any]
        Parameters that were states, as given and found.
    rejected : list[dict[str, Any]]
        Fields of each Rejected.
    heights_apart : list[dict[str, Any]]
        Sources of height that contradict each other.
    stopped : str
        Why the run ended early.
    smoothed : bool
        True: by `smooth`.
    filter_against_smoother : dict[str, float]
        Mean squared difference over its expectation.
    filter_options : dict[str, Any]
        Options of the filter's own.
    verdict : dict[str, Any]
        `Verdict.as_dict`, of a solution read from a file.
    """

    filter: str
    recording: str
    epoch: str | None
    date: str | None
    notes: list[str]
    read: list[str]
    imu: str
    vehicle: str
    start: dict[str, Any]
    noise: dict[str, float]
    kinds: dict[str, str]
    bias_std: Sequence[float] | None
    fixes_outside: int
    point: str
    withheld: Sequence[tuple[float, float]]
    installation: dict[str, Any]
    rejected: list[dict[str, Any]]
    heights_apart: list[dict[str, Any]]
    stopped: str
    smoothed: bool
    filter_against_smoother: dict[str, float]
    filter_options: dict[str, Any]
    verdict: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Solution(Value, TakenByTime):
    """The result of a filter on a recording: n rows, SI and radians, in NED.

    Attributes
    ----------
    trajectory : Trajectory
        Rows with standard deviations of the 15 error states; NaN where the filter estimates
        or claims none.
    b_a : (n, 3) array
        Accelerometer bias, m/s^2; NaN where the filter estimates none.
    b_g : (n, 3) array
        Gyro bias, rad/s; NaN where the filter estimates none.
    status : (n,) array
        VALID, BRIDGED, INVALID or DOUBTFUL.
    innovations : Innovations
        Innovations and the use of each measurement.
    events : tuple[tuple[float, str], ...]
        (t in s, text): gaps, re-acquisitions and further facts for the user.
    columns : dict[str, Array]
        The filter's extra output columns (n,) by name, which says the unit.
    covariance : (n, k, k) array or None
        Error covariance at the same times, where it was asked for.
    meta : SolutionMeta
        Facts of the run.
    recording : Recording or None
        The sources that the filter used, with their samples; None of a solution read from a
        file.
    separation : Separation or None
        Of a smoothed solution, how far the filter was from it; None of others, and of a
        file that is no NetCDF.
    """

    trajectory: Trajectory
    b_a: Array
    b_g: Array
    status: NDArray[np.integer[Any]]
    innovations: Innovations
    events: tuple[tuple[float, str], ...] = ()
    columns: dict[str, Array] = field(default_factory=dict)
    covariance: Array | None = None
    meta: SolutionMeta = field(default_factory=SolutionMeta)
    recording: Recording | None = field(default=None, repr=False, compare=False)
    separation: Separation | None = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: Moment | None = None, stop: Moment | None = None) -> Solution:
        """Return the rows from start to stop, both included, with their fixes and events.

        Its verdict is that of the whole, and says so.

        Parameters
        ----------
        start, stop : float, str, datetime or numpy.datetime64, optional
            s of the recording, or dates in UTC where its clock is absolute; open by default.

        Raises
        ------
        DataError
            Where there are no rows, or a date is given without an absolute clock.
        """
        first, last = ends(start, stop, self.meta.get("epoch"), "solution")
        rows = within(self.t, first, last, "solution")
        untested = (*self.verdict.untested, OF_WHOLE)
        verdict = replace(self.verdict, untested=tuple(dict.fromkeys(untested)))
        meta: SolutionMeta = {**self.meta, "verdict": verdict.as_dict()}
        if "rejected" in meta:
            meta["rejected"] = _runs_during(meta["rejected"], first, last)
        if "heights_apart" in meta:
            meta["heights_apart"] = _runs_during(meta["heights_apart"], first, last)
        return replace(
            self.take(rows),
            innovations=self.innovations.between(first, last),
            events=tuple(event for event in self.events if first <= event[0] <= last),
            meta=meta,
        )

    def take(self, rows: slice | Mask | Ints) -> Solution:
        """These rows of it, with all fixes and events."""
        apart = self.separation
        return replace(
            self,
            trajectory=self.trajectory.take(rows),
            b_a=self.b_a[rows],
            b_g=self.b_g[rows],
            status=self.status[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
            covariance=None if self.covariance is None else self.covariance[rows],
            separation=apart and Separation(apart.size[rows], apart.std[rows]),
        )

    def seconds(self, status: int) -> float:
        """Time in s over which rows have this status; a row covers the time since the one before
        it."""
        return float(np.diff(self.t, prepend=self.t[:1])[self.status == status].sum())

    @property
    def verdict(self) -> Verdict:
        """The verdict on whether to trust the solution, with the reasons: computed when asked for,
        or as its file says; "not judged" where a file says nothing."""
        if "verdict" in self.meta:
            return Verdict.from_dict(self.meta["verdict"])
        if self.recording is None:
            none = Untested("anything", "its file has no verdict; fuse the recording again")
            return Verdict(NOT_JUDGED, untested=(none,))
        return self._judged

    @cached_property
    def _judged(self) -> Verdict:
        verdict: Verdict = operation("judge")(self)
        return verdict

    @property
    def installation(self) -> EstimatedInstallation:
        """Parameters of the installation that were states (`estimate`), as the run ended with them;
        empty where none was."""
        found: EstimatedInstallation = operation("installation")(self)
        return found

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """Runs of rejected fixes with their probable cause, in the order of time; none of what the
        gates reject by chance."""
        return tuple(Rejected(**run) for run in self.meta.get("rejected", ()))

    @property
    def t(self) -> Array:
        """Times of the rows (n,), s."""
        return self.trajectory.t

    @property
    def lla(self) -> Array:
        """Latitude and longitude, rad, and ellipsoidal height, m (n, 3); NaN where the filter
        estimates none."""
        return self.trajectory.lla

    @property
    def v_n(self) -> Array:
        """Velocity towards north, east and down (n, 3), m/s; NaN where the filter estimates none."""
        return _assume_known(self.trajectory.v_n)

    @property
    def q_nb(self) -> Array:
        """Attitude as quaternions (n, 4), scalar first, body to navigation frame."""
        return _assume_known(self.trajectory.q_nb)

    @property
    def rph(self) -> Array:
        """Roll, pitch and heading (n, 3), rad, heading in [0, 2 pi)."""
        return self.trajectory.rph

    @property
    def std(self) -> Array:
        """Standard deviations of the 15 error states (n, 15), SI and radians; NaN where the filter
        claims none."""
        return _assume_known(self.trajectory.std)

    @property
    def utc(self) -> NDArray[np.datetime64] | None:
        """UTC of the rows as datetime64[ns] (n,); None where the recording had no absolute clock.
        Within a leap second its time is shown twice."""
        epoch = self.meta.get("epoch")
        return None if epoch is None else utc(epoch, self.t)

    @property
    def has_position(self) -> bool:
        """True where latitude, longitude and height are known in any row; filters of attitude alone
        publish NaN."""
        return bool(np.isfinite(self.trajectory.lla).all(axis=1).any())

    def errors(self, reference: Trajectory | None = None) -> Errors:
        """Return true less estimated position, velocity and attitude, as `strapdown.errors`; the
        default reference is that of the recording it was made of. Raises DataError."""
        if reference is None and self.recording is not None:
            reference = self.recording.reference
        if reference is None:
            raise DataError("errors: the recording has no reference; give one, a Trajectory")
        errors: Errors = operation("errors")(self, reference)
        return errors

    def at(self, times: ArrayLike, lever_arm: ArrayLike = (0.0, 0.0, 0.0)) -> Instants:
        """Return position, velocity, attitude and covariance at any instants, s or dates, of a point
        that is a lever arm away, m, body axes: see `evaluation.other_instants.at`. Raises
        DataError."""
        instants: Instants = operation("at")(self, times, lever_arm)
        return instants

    def protection(self, risk: float = RISK) -> ProtectionLevels:
        """Return the protection levels of position and heading at a risk of misleading information:
        see `evaluation.protection.protection_levels`. Raises DataError."""
        levels: ProtectionLevels = operation("protection")(self, risk)
        return levels

    def save(self, path: File, *, utc: bool = False, origin: ArrayLike | None = None) -> None:
        """Write it to a file by the ending of its path, as `write_solution`: .nc, .csv, .csv.gz,
        .csv.xz, .kml, .gpx, .geojson or .tum, whose positions are from an `origin`. Raises
        DataError."""
        operation("save solution")(self, path, utc=utc, origin=origin)

    def table(self) -> pd.DataFrame:
        """pandas DataFrame of state, biases, standard deviations and status, units as in
        `UNITS`."""
        return _frame(self.t, self.as_columns())

    def as_columns(self) -> dict[str, NDArray[Any]]:
        """The columns of its table by name, (n,) each."""
        biases = np.c_[self.b_a, self.b_g] * STD_SCALE[9:]
        return {
            **self.trajectory.as_columns(),
            **dict(zip(BIAS_COLUMNS, biases.T)),
            **dict(zip(STD_COLUMNS, (_assume_known(self.trajectory.std) * STD_SCALE).T)),
            **self.columns,
            "status": self.status,
        }

    def counts(self) -> dict[str, tuple[int, int]]:
        """{source: (accepted, rejected)} over all fixes that were measured."""
        i = self.innovations
        measured = ~np.isnan(i.innovation).all(axis=1)
        return {
            name: (
                int((i.accepted & measured & (i.source == s)).sum()),
                int((~i.accepted & measured & (i.source == s)).sum()),
            )
            for s, name in enumerate(i.names)
        }

    def plot(self, what: str | None = None, reference: Trajectory | None = None) -> go.Figure:
        """A figure of the report page as a plotly Figure, which can be changed: "track", "attitude",
        "errors" or any other name; a wrong one is told with all that there are.

        what: by default the track, of a filter of attitude alone the attitude; reference: what errors
        are taken against (default: that of the recording it was made of). Raises DataError.
        """
        figure: go.Figure = operation("figure")(self, what, reference)
        return figure

    def to_pandas(self) -> pd.DataFrame:
        """Its `table` with dates as the index where the clock is absolute; units and names of the CF
        conventions stand in `attrs`."""
        frame: pd.DataFrame = operation("frame")(self)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """xarray Dataset over time and fixes, as the NetCDF file has it: units and names of the CF
        conventions, dates where the clock is absolute. Raises DataError where xarray is missing."""
        dataset: xr.Dataset = operation("dataset")(self)
        return dataset

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def __repr__(self) -> str:
        fixes = ", ".join(
            f"{name} {good} accepted {bad} rejected" for name, (good, bad) in self.counts().items()
        )
        return f"Solution({self.meta.get('filter', '')}: {self.trajectory!r}, {fixes or 'no fixes'}, {len(self.events)} events)"


def _runs_during(runs: list[dict[str, Any]], start: float, stop: float) -> list[dict[str, Any]]:
    """Those of runs of fixes that reach into [start, stop], s."""
    return [run for run in runs if run["start"] <= stop and run["stop"] >= start]
