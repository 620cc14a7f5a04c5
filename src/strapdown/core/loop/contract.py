"""The contract between sensors, filters and the loop that runs them: the signatures of their
kernels and the tuples they pass.

Everything is SI and radians, navigation frame NED, body frame forward-right-down; errors are true -
estimate. `docs/explanation/design.md` tells why.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from ...checks import check_choice
from ...typing import Array, Mask, Vector
from ..compile.jit import (
    COMPILED,
    address,
    bind_kernel,
    caller,
    compile_kernel,
    compile_together,
    helper,
    kernel,
    matrix,
)
from ..compile.signatures import in_lanes
from ..compile.workspace import MAX_STATES, Slots
from ..mathematics.belief import ATT, BA, BG, POS, STATES, VEL, FilterState, Noise
from ..mathematics.rotation import euler_to_matrix, quaternion_to_euler
from ..mathematics.source import OBSERVE, Kind, Observe, SourceRow
from ..mathematics.tape import ADJOINT_STEP, SAVE_STEP, AdjointStep, SaveStep, Smoother
from .cursor import Cursor
from .kernels import CORRECT, PREDICT, STAGE, STEP, Kernels
from .tables import (
    BRIDGED,
    DOUBTFUL,
    INVALID,
    VALID,
    Fixes,
    Imu,
    Output,
    Status,
    Use,
)

__all__ = [
    "FilterState",
    "InitialState",
    "Noise",
    "Imu",
    "Fixes",
    "Cursor",
    "Output",
    "Filter",
    "Smoother",
    "Slots",
    "MeasurementModel",
    "SourceLike",
    "Condition",
    "Observe",
    "Predict",
    "Correct",
    "SaveStep",
    "AdjointStep",
    "Configure",
    "Diagnose",
    "first_event",
    "VALID",
    "BRIDGED",
    "INVALID",
    "DOUBTFUL",
    "OBSERVE",
    "PREDICT",
    "CORRECT",
    "IN_LANES",
    "SHARED",
    "side_by_side",
    "SAVE_STEP",
    "ADJOINT_STEP",
    "POS",
    "VEL",
    "ATT",
    "BA",
    "BG",
    "STATES",
    "DECAYING",
    "HELD",
    "RANDOM_WALK",
    "MAX_STATES",
    "COMPILED",
    "kernel",
    "helper",
    "matrix",
    "address",
    "bind_kernel",
    "caller",
    "compile_kernel",
    "compile_together",
    "Kind",
    "SourceRow",
    "Status",
    "Use",
    "Kernels",
    "STAGE",
    "STEP",
]


BIAS = "bias"
"""The option of every filter with biases that can decay: one of"""
BIAS_MODELS = DECAYING, HELD, RANDOM_WALK = "decaying", "held", "random-walk"
"""Biases of the time constants of the IMU, where it has any. "decaying": the estimates go to zero with
them, as the mean of a Gauss-Markov process does. "held": what was found of a bias stays, its
uncertainty alone goes back to that of the process. "random-walk": no time constant counts."""


class InitialState(NamedTuple):
    """Initial state of a filter with standard deviations, SI and radians. Print it, or override a
    part with `_replace`. Parts left empty, `()`, are found from the recording or from the first
    samples of a stream.

    Attributes
    ----------
    t : float
        Time, s.
    lla : tuple of float
        Latitude, rad, longitude, rad, and ellipsoidal height, m.
    v_n : tuple of float
        Velocity towards north, east and down, m/s.
    rph : tuple of float
        Roll, pitch, heading, rad; NaN, NaN, heading if only the heading is known.
    b_a : tuple of float
        Accelerometer bias, m/s^2.
    b_g : tuple of float
        Gyro bias, rad/s.
    std : tuple of float
        15 standard deviations in the order of the error states, then those of the augmented
        states.
    note : str
        How each part was found.
    motion : tuple of float
        Angular rate (3, body, rad/s), velocity and acceleration of the antenna (3 each,
        NED, SI) of a start whose position and velocity come from fixes and so share their clock and
        lever arm errors; () otherwise.
    """

    t: float
    lla: tuple[float, ...] = ()
    v_n: tuple[float, ...] = ()
    rph: tuple[float, ...] = ()
    b_a: tuple[float, ...] = ()
    b_g: tuple[float, ...] = ()
    std: tuple[float, ...] = ()
    note: str = ""
    motion: tuple[float, ...] = ()

    def towards(self, q_nb: Vector) -> "InitialState":
        """This InitialState with the attitude of a unit quaternion, scalar first, body to navigation.
        Raises ValueError where it is none."""
        q = np.asarray(q_nb, float)
        size = np.linalg.norm(q)
        if q.shape != (4,) or not abs(size - 1) < 1e-3:
            raise ValueError(
                f"start: q_nb is {q_nb}; it must be four numbers, scalar first, whose squares add "
                f"up to 1 (here to {size * size:.4g})"
            )
        roll, pitch, heading = quaternion_to_euler(q / size).tolist()
        return self._replace(rph=(roll, pitch, heading))

    def belief(self, workspace: Array) -> FilterState:
        """A FilterState at this start with a diagonal P; `workspace` is the filter's own array."""

        def column(values: tuple[float, ...]) -> Array:
            return np.array(values, float)

        C = np.empty((3, 3))
        roll, pitch, heading = (float(angle) for angle in self.rph)
        euler_to_matrix(roll, pitch, heading, C)
        return FilterState(
            column(self.lla),
            column(self.v_n),
            C,
            column(self.b_a),
            column(self.b_g),
            np.diag(column(self.std) ** 2),
            np.zeros(3),
            np.zeros(3),
            workspace,
            np.zeros(len(self.std) - STATES),
        )


SHARED = ("std", "noise")
"""Arguments that all runs side by side have in common, beside plain arguments; the rest of these is
their own."""
IN_LANES = {each: in_lanes(each, *SHARED) for each in (OBSERVE, PREDICT, CORRECT)}
"""Signatures of sensors and filters for eight runs at once."""


def side_by_side(kernel: Any) -> Any:
    """The kernel of a sensor or a filter for eight runs at once."""
    return kernel.for_runs(IN_LANES[kernel.signature])


class SourceLike(Protocol):
    """A source of measurements, as a filter sees it before a run: a Source, which is defined above
    the kernels. Times in s, y and std in SI and radians."""

    @property
    def kind(self) -> str:
        """Name of what it measures, as in `aiding`."""

    @property
    def name(self) -> str:
        """As shown in tables; empty: the kind."""

    @property
    def t(self) -> Array:
        """Times (m,), s."""

    @property
    def y(self) -> Array:
        """Measured values (m, components); NaN where not measured."""

    @property
    def std(self) -> Array:
        """Standard deviations (m, rows)."""

    @property
    def estimate(self) -> Mapping[str, Sequence[float]]:
        """{parameter of its installation that is a state: prior standard deviations, SI}."""

    @property
    def parameters(self) -> Sequence[float]:
        """As its MeasurementModel says, e.g. a lever arm."""


Predict: TypeAlias = Callable[[FilterState, Array, float, Noise], None]
"""(belief, u, dt, noise): u[0:6] = rotation (rad) and velocity (m/s) increments over dt (s)."""
Correct: TypeAlias = Callable[
    [FilterState, Array, Array, int, Observe, SourceRow, float, Array], float
]
"""(belief, y, std, kind, observe, source, gate, innovation (12,)) -> NIS: the innovation y -
h(belief) e; behind it the same whitened, L^-1 e, N(0, 1) each where the filter is right; behind
that L by rows (00, 10, 11, 20, 21, 22), L L' its covariance. NaN of what is not measured or has no
covariance."""
Configure: TypeAlias = Callable[
    [dict[str, Any], Sequence[SourceLike]], tuple[dict[str, Any], list[str]]
]
"""(options, sources that the filter uses) -> (options, notes). Raises ValueError."""
Diagnose: TypeAlias = Callable[[Array, Array, Mapping[str, Array]], list[tuple[float, str]]]
"""(t (n,), lla (n, 3), {column: (n,)}) -> [(t, text)] of the kept rows."""


class Condition(NamedTuple):
    """A condition that a filter reports while it runs; in `Filter.conditions`."""

    text: str  # as in an event, with the remedy
    doubtful: bool = True  # whether rows are DOUBTFUL as long as it lasts


def first_event(t: Array, where: Mask, text: str) -> list[tuple[float, str]]:
    """[(t, text)] at the first of the kept rows `where` it is so, [] without any: for
    Filter.diagnose."""
    return [(float(t[np.argmax(where)]), text)] if np.any(where) else []


class Filter(NamedTuple):
    """One architecture. `name` is its file's name with dashes; `reference` its source in the
    literature."""

    name: str
    reference: str
    # (InitialState, Noise, **options) -> FilterState; plain Python, refuses bad options
    start: Callable[..., FilterState]
    predict: Predict
    correct: Correct
    # the standard deviations it claims; the others are published as NaN
    states: tuple[int, ...] = tuple(range(STATES))
    # the states it estimates at all; the others are published as NaN. Without position it starts
    # without one
    estimates: tuple[int, ...] = tuple(range(STATES))
    slots: Slots = Slots()  # what its workspace holds, output columns first
    # kinds of measurement that it can use; None: all. Sources of other kinds are left out and named in
    # the notes
    uses: tuple[str, ...] | None = None
    needs: tuple[str, ...] = ()  # kinds without which it cannot run
    # options that the sources decide where the user does not; refuses what it cannot run on
    configure: Configure | None = None
    unaided_note: str = ""  # what to say where a recording has no source that it can use
    smoother: Smoother | None = None
    diagnose: Diagnose | None = None  # what of the kept rows a user must know
    # what it can say of itself, and the number of its workspace in which its kernels leave which of
    # them holds now, counted from 1; 0 for none
    conditions: tuple[Condition, ...] = ()
    condition: int | None = None
    # whether states that are parameters of the installation may stand behind its own
    installation: bool = False
    # whether it gates, and the standard deviations of a fix decide what it does with it, so that
    # sources can be robust and adaptive
    weighs: bool = True
    # whether its kernels also compile for eight runs at once: they choose by `core.compile.choosing` and
    # have no `if` on a value
    lanes: bool = False
    # kernels that its `start` calls, so that they are compiled before a stream begins
    start_kernels: tuple[Callable[..., Any], ...] = ()
    # the one of BIAS_MODELS that it assumes where nobody says; "": none of its estimates decays, and
    # there is no such option
    bias: str = ""
    # for whom it is, and for what to take another one, as the list of filters has them: a phrase of
    # at most 60 characters each
    good_for: str = ""
    poor_for: str = ""

    def __copy__(self) -> "Filter":
        return self  # kernels are not copied

    def __deepcopy__(self, memo: dict[int, Any]) -> "Filter":
        return self

    @property
    def columns(self) -> tuple[str, ...]:
        """Names, with units, of its extra output columns."""
        return self.slots.columns

    @property
    def options(self) -> dict[str, Any]:
        """{name of an option: default}."""
        own = list(inspect.signature(self.start).parameters.items())[2:]
        found = {name: option.default for name, option in own}
        return found | {BIAS: self.bias} if self.bias else found

    def with_bias_model(self, noise: Noise, options: Mapping[str, Any]) -> Noise:
        """`noise` with the bias model of these options. Raises DataError for an unknown one."""
        if not self.bias:
            return noise
        model = check_choice(options.get(BIAS, self.bias), BIAS, BIAS_MODELS)
        if model == RANDOM_WALK:
            return noise._replace(gyro_decay=0.0, accel_decay=0.0)
        return noise._replace(held=float(model == HELD)) if BIAS in options else noise

    def begin(self, start: InitialState, noise: Noise, **options: Any) -> FilterState:
        """The belief of `start`; its kernels are to be given the noise that is `assumed`. Raises
        RuntimeError where its workspace is smaller than `slots` says, so that kernels would write
        beyond it."""
        assumed = self.with_bias_model(noise, options)
        if self.bias:
            options.pop(BIAS, None)
        belief = self.start(start, assumed, **options)
        if belief.workspace.size < self.slots.size:
            raise RuntimeError(
                f"filter {self.name!r}: its start made a workspace of {belief.workspace.size} "
                f"numbers; its slots take {self.slots.size}"
            )
        return belief


class MeasurementModel(NamedTuple):
    """One kind of measurement: how it is observed, and what the edge must know to read it."""

    name: str
    observe: Observe
    # what each component of y is: "latitude", "longitude", "length", "speed", "angle",
    # "acceleration", "angular rate", "magnetic field", "pressure"
    quantities: tuple[str, ...]
    # what source.parameters[0:3] is: "" nothing, "antenna" or "reference": lever arm from the IMU to that
    # point, m, body; "field": T, NED; "baseline": from one antenna to another, m, body; "drag":
    # coefficients forward and to the right, 1/s
    parameters: str = ""
    # what source.parameters[3:6] is: "" nothing, "direction": unit vector, body;
    # "beacon": latitude and longitude, rad, height above the ellipsoid, m; "atmosphere": pressure, Pa,
    # and temperature, K, at a height, m, or none
    more_parameters: str = ""
    # axes in which it is a function of the pose alone, which an invariant filter needs: "n", such as a
    # position or a height, or "b", such as a magnetic field or a wheel speed; "": neither
    pose_axes: str = ""
    vector: str = ""  # frame of y where it is a vector that the description's axes turn: "n" or "b"
    recorded: bool = True  # False: a constraint of the vehicle, rows at a rate instead of a file
    when: str = ""  # a constraint that holds only then: "at rest" or "moving"
    # y of a constraint is the mean of that over the step before it: "gyro" or "accel"
    mean_of: str = ""
    slips: bool = False  # whether side slip in turns can widen its standard deviation
    reference: str = ""
    # names, with units, of the states that each source of this kind brings along
    states: tuple[str, ...] = ()
    # states behind these that are there where a source asks to estimate "vertical-wind"
    more_states: tuple[str, ...] = ()
    state_std: float = 0.0  # their initial standard deviation
    state_walk: float = 0.0  # their random walk, unit/sqrt(s)
    # a name for these states where all sources of the kinds that give it have them in common, as
    # "wind"; "": each source has its own
    shared: str = ""
    # parameters of the installation that its observation knows as states: names of `calibration_parameters`
    calibration_parameters: tuple[str, ...] = ()
    lanes: bool = False  # whether its kernel also compiles for eight runs at once
