"""The types a user meets: Trajectory, Aiding, Solution, and Recording in recording.py. Inside SI
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
from ..geometry import geodesy
from ..typing import Array, ArrayLike, File, Ints, Mask, Vector
from ..units.time_scales import ends, utc, within
from .operations import operation
from .value import Value
from .verdict import NOT_JUDGED, Verdict

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go
    import xarray as xr
    from scipy.spatial.transform import Rotation

    from ..evaluation.metrics import Errors
    from ..evaluation.other_instants import Instants
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
SD_COLUMNS = [
    "sd_north",
    "sd_east",
    "sd_down",
    "sd_VN",
    "sd_VE",
    "sd_VD",
    "sd_rotation_north",
    "sd_rotation_east",
    "sd_rotation_down",
    *("sd_" + name for name in BIAS_COLUMNS),
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
    **{name: "m/s^2" if "accel" in name else "deg/h" for name in BIAS_COLUMNS + SD_COLUMNS[9:]},
    **dict(zip(SD_COLUMNS, ["m"] * 3 + ["m/s"] * 3 + ["deg"] * 3)),
}
"""Unit of every column of `Trajectory.table` and `Solution.table`."""
SD_SCALE = np.r_[np.ones(6), np.full(3, np.degrees(1)), np.ones(3), np.full(3, np.degrees(3600))]
"""From SI to the units of the `sd_` columns; its last six also to those of the biases."""
OF_WHOLE = "this part by itself: the verdict is that of the whole run"
"""What the verdict of a part of a Solution says beside."""


def _frame(t: Array, columns: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(columns, index=pd.Index(t, name="t"))


def _assume_known(part: Array | None) -> Array:
    """A part of a Trajectory that its maker is sure of: for the type checker, nothing else."""
    return part  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Trajectory(Value):
    """Position, velocity and attitude over time: truth, reference and solution alike. What is
    not known is None or NaN."""

    t: Array  # (n,) s
    # (n, 3) latitude rad, longitude rad, ellipsoidal height m; NaN where only the attitude is known
    lla: Array
    v_n: Array | None = None  # (n, 3) m/s NED
    q_nb: Array | None = None  # (n, 4) scalar first, body to navigation
    # (n, k) standard deviations of the first k error states, SI and radians
    sd: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, part: slice) -> Trajectory:
        """The rows of `trajectory[100:200]`, s, both ends included. Raises DataError where there are
        none."""
        return self.taking(within(self.t, *ends(part, None, "trajectory"), "trajectory"))

    def taking(self, rows: slice | Mask | Ints) -> Trajectory:
        """These rows of it."""
        parts = (self.t, self.lla, self.v_n, self.q_nb, self.sd)
        return Trajectory(*(None if part is None else part[rows] for part in parts))  # type: ignore[arg-type]  # t and lla are there

    @cached_property
    def rotation(self) -> Rotation:
        """scipy Rotation (n,) from body to navigation frame."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(_assume_known(self.q_nb)[:, [1, 2, 3, 0]])

    @cached_property
    def rph(self) -> Array:
        """(n, 3) roll, pitch, heading in rad, heading in [0, 2 pi); NaN where the quaternion is."""
        angles = quaternion_to_euler(_assume_known(self.q_nb))
        return np.c_[angles[:, :2], angles[:, 2] % (2 * np.pi)]

    def displaced(self, lever_arm: Vector, omega: Array) -> Trajectory:
        """The trajectory of another point of the body: `lever_arm` (3,) m from this one, body;
        `omega` (n, 3) rad/s, bias-free body rate.

        Standard deviations stay those of the original point.
        """
        turn = self.rotation
        return replace(
            self,
            lla=geodesy.displace_lla(self.lla, turn.apply(lever_arm)),
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


class Correlated(NamedTuple):
    """Errors of a source that last: first-order Gauss-Markov processes, one per row of its
    innovation, beside the white ones that its standard deviations are of."""

    sd: tuple[float, ...]  # stationary, by row, SI; 0: none
    time: float  # correlation time, s
    # whether a filter that can estimates them; else they widen the standard deviations
    states: bool = True


@dataclass(frozen=True, eq=False)
class Aiding(Value):
    """One source of fixes. `sd` has a column per row of the innovation; a missing component of
    `y` is NaN."""

    kind: str  # a name of `strapdown.aiding.names()`
    t: Array  # (m,) s
    y: Array  # (m, components), SI and radians
    sd: Array  # (m, rows) m, m/s or rad
    parameters: tuple[float, ...] = ()  # e.g. lever arm from the IMU to the antenna, m, body
    gate: float | None = None  # bound on the NIS; None: 0.1 % false alarms; inf: no gate
    name: str = ""  # shown in tables; the kind by default
    # {parameter of the installation (names of `calibration_parameters`) to estimate: prior standard deviations}
    estimate: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    # of a constraint across the wheels: side slip, rad per m/s^2 of lateral acceleration; adds to sd
    slip: float = 0.0
    correlated: Correlated | None = None
    robust: bool = False  # a heavy-tailed likelihood in place of the gate
    adaptive: float = 0.0  # s of memory with which the noise is followed; 0: it is as given

    def between(self, start: float, stop: float) -> Aiding:
        """The fixes of [start, stop), s."""
        return self._where((self.t >= start) & (self.t < stop))

    def without(self, windows: Iterable[tuple[float, float]]) -> Aiding:
        """The fixes outside every (start, stop) window of seconds."""
        keep = np.ones(len(self.t), bool)
        for start, stop in windows:
            keep &= (self.t < start) | (self.t >= stop)
        return self._where(keep)

    def _where(self, keep: Mask) -> Aiding:
        return replace(self, t=self.t[keep], y=self.y[keep], sd=self.sd[keep])

    def _repr_html_(self) -> str:
        return str(operation("card")(self))

    def __repr__(self) -> str:
        return f"Aiding({self.name or self.kind}, {len(self.t)} fixes)"


@dataclass(frozen=True, eq=False)
class Innovations(Value):
    """The innovations of a solution and the use of each measurement, in time order."""

    t: Array  # (m,) s
    source: Ints  # (m,) index into `names`
    innovation: Array  # (m, 3) m, m/s, rad, m/s^2 or T; NaN where there was nothing to measure
    nis: Array  # (m,) normalised innovation squared; NaN where the filter does not gate
    accepted: Mask  # (m,)
    names: tuple[str, ...] = ()  # of the sources
    gates: tuple[float, ...] = ()  # of the sources: bounds on the NIS
    # (m, 3) whitened: N(0, 1) each where the filter is right; NaN without a covariance, None of a file
    whitened: Array | None = None
    # (m, 6) rows of L (00, 10, 11, 20, 21, 22), L L' the covariance of the innovation; as whitened
    root: Array | None = None
    # (m,) stated variance over that with which it was used: 1 as stated, 0 not used, between them of
    # a robust source; None of a file
    weight: Array | None = None
    # (m, 3) standard deviations that an adaptive source had found, over those stated; else 1. NIS,
    # whitened and root are by them; None of a file
    followed: Array | None = None

    def between(self, start: float, stop: float) -> Innovations:
        """Those of fixes from start to stop, s, both included."""
        near = (self.t >= start) & (self.t <= stop)
        by_fix: dict[str, Any] = {
            name: part[near] for name, part in vars(self).items() if isinstance(part, np.ndarray)
        }
        return replace(self, **by_fix)


class Separation(NamedTuple):
    """How far a filter, which knows the past alone, was from its smoother, row by row: position,
    velocity and attitude."""

    size: NDArray[np.float32]  # (n, 3) m, m/s, rad; NaN where nothing can be compared
    sd: NDArray[np.float32]  # (n, 3) of the difference, its components together


class Rejected(NamedTuple):
    """A run of rejected fixes of a source, and why they were probably rejected."""

    source: str
    start: float  # s, of the first and of the last of them
    stop: float
    number: int  # rejected
    of: int  # fixes of the source meanwhile
    # jump, drift, clock, noise too small, other sources disagree, single outliers or not known
    cause: str
    seen: str  # what was seen, with number and unit
    remedy: str

    def __str__(self) -> str:
        fixes = "fix" if self.of == 1 else "fixes"
        many = f"{self.number} of {self.of}" if self.number < self.of else f"{self.number}"
        when = f"from {self.start:.1f} to {self.stop:.1f} s" if self.number > 1 else "here"
        return f"{self.source}: {many} {fixes} rejected {when}: {self.seen}; {self.remedy}"


class SolutionMeta(TypedDict, total=False):
    """Metadata of a solution; each key only where it is known."""

    filter: str
    recording: str  # its name
    epoch: str | None  # UTC of t = 0, ISO 8601, where the clock is absolute
    date: str | None
    notes: list[str]  # what was handled on the way
    read: list[str]  # what was taken from the files
    imu: str  # name of the grade
    vehicle: str  # its name
    start: dict[str, Any]  # fields of the InitialState
    noise: dict[str, float]  # fields of the Noise
    kinds: dict[str, str]  # {source: kind}
    bias_sd: Sequence[float] | None  # what the description of the IMU allows, m/s^2 and rad/s
    fixes_outside: int  # fixes before the start or after the samples
    point: str  # of the vehicle that it is of: "imu" or another
    withheld: Sequence[tuple[float, float]]  # s, windows without fixes
    installation: dict[str, Any]  # parameters that were states, as given and found
    rejected: list[dict[str, Any]]  # fields of each Rejected
    heights_apart: list[dict[str, Any]]  # sources of height that contradict each other
    stopped: str  # why the run ended early
    smoothed: bool
    filter_against_smoother: dict[str, float]  # mean squared difference over its expectation
    filter_options: dict[str, Any]
    verdict: dict[str, Any]  # `Verdict.as_dict`, of a solution read from a file


@dataclass(frozen=True, eq=False)
class Solution(Value):
    """The result of a filter on a recording: n rows, SI and radians, in NED."""

    # with sd of the 15 error states; NaN where the filter estimates or claims none
    trajectory: Trajectory
    b_a: Array  # (n, 3) accelerometer bias, m/s^2; NaN where the filter estimates none
    b_g: Array  # (n, 3) gyro bias, rad/s; NaN where the filter estimates none
    status: NDArray[np.integer[Any]]  # (n,) VALID, BRIDGED, INVALID or DOUBTFUL
    innovations: Innovations
    # (t in s, text): gaps, re-acquisitions, what else the user must know
    events: tuple[tuple[float, str], ...] = ()
    # the filter's extra output columns (n,) by name, which says the unit
    columns: dict[str, Array] = field(default_factory=dict)
    covariance: Array | None = None  # (n, k, k) at the same times, where it was asked for
    meta: SolutionMeta = field(default_factory=SolutionMeta)
    # the sources that the filter used, with their samples; None of a solution read from a file
    recording: Recording | None = field(default=None, repr=False, compare=False)
    # of a smoothed solution; None of others, and of a file that is no NetCDF
    separation: Separation | None = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.t)

    def between(
        self, start: float | str | None = None, stop: float | str | None = None
    ) -> Solution:
        """Return the rows from start to stop, s or dates, both included, with their fixes and events.

        Its verdict is that of the whole, and says so. Raises DataError where there are no rows.
        """
        return self[start:stop]

    def __getitem__(self, part: slice) -> Solution:
        """The rows of `solution[100:200]`, s, both ends included, with their fixes and events; dates
        do where the clock is absolute.

        Its verdict is that of the whole, and says so. Raises DataError where there are no rows.
        """
        start, stop = ends(part, self.meta.get("epoch"), "solution")
        rows = within(self.t, start, stop, "solution")
        untested = (*self.verdict.untested, OF_WHOLE)
        verdict = replace(self.verdict, untested=tuple(dict.fromkeys(untested)))
        meta: SolutionMeta = {**self.meta, "verdict": verdict.as_dict()}
        if "rejected" in meta:
            meta["rejected"] = _runs_during(meta["rejected"], start, stop)
        if "heights_apart" in meta:
            meta["heights_apart"] = _runs_during(meta["heights_apart"], start, stop)
        return replace(
            self.taking(rows),
            innovations=self.innovations.between(start, stop),
            events=tuple(event for event in self.events if start <= event[0] <= stop),
            meta=meta,
        )

    def taking(self, rows: slice | Mask | Ints) -> Solution:
        """These rows of it, with all fixes and events."""
        apart = self.separation
        return replace(
            self,
            trajectory=self.trajectory.taking(rows),
            b_a=self.b_a[rows],
            b_g=self.b_g[rows],
            status=self.status[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
            covariance=None if self.covariance is None else self.covariance[rows],
            separation=apart and Separation(apart.size[rows], apart.sd[rows]),
        )

    def seconds(self, status: int) -> float:
        """Time in s over which rows have this status; a row covers the time since the one before
        it."""
        return float(np.diff(self.t, prepend=self.t[:1])[self.status == status].sum())

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict on whether to trust the solution, with the reasons: computed when asked for,
        or as its file says; "not judged" where a file says nothing."""
        if "verdict" in self.meta:
            return Verdict.from_dict(self.meta["verdict"])
        if self.recording is None:
            remedy = "its file has no verdict, fuse the recording again"
            return Verdict(NOT_JUDGED, untested=(remedy,))
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

    def save(self, path: File, *, utc: bool = False) -> None:
        """Write it to a file by the ending of its path, as `write_solution`: .nc, .csv, .csv.gz,
        .csv.xz, .kml, .gpx, .geojson or .tum. Raises DataError."""
        operation("save solution")(self, path, utc)

    def table(self) -> pd.DataFrame:
        """pandas DataFrame of state, biases, standard deviations and status, units as in
        `UNITS`."""
        return _frame(self.t, self.as_columns())

    def as_columns(self) -> dict[str, NDArray[Any]]:
        """The columns of its table by name, (n,) each."""
        biases = np.c_[self.b_a, self.b_g] * SD_SCALE[9:]
        return {
            **self.trajectory.as_columns(),
            **dict(zip(BIAS_COLUMNS, biases.T)),
            **dict(zip(SD_COLUMNS, (_assume_known(self.trajectory.sd) * SD_SCALE).T)),
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
