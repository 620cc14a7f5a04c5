"""Gains of the nonlinear observer: the options of its filters, their design and checks, and the
observer's block at a start. Plain Python.

The design is that of the sampled model: between fixes p' = v, v' = f, f' = w, at a fix I - K C. Its
spectral radius over one round of the recording's fixes must be below 1, with and without the loops
that turn the attitude and adapt the biases closed around it.
"""

import math
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from inspect import Parameter, Signature, signature
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...checks import check_choice, check_number
from ...core.loop.contract import FilterState, InitialState, Noise, SourceLike
from ...core.mathematics.embedded import as_numbers
from ...typing import Array, ArrayLike, Mask
from . import adaptive_law, equations, translation_gains

DEFAULTS = dict(
    course="tilt-compensated",
    field="across",
    k1=0.1,
    k2=0.003,
    ki=0.003,
    k1_start=1.0,
    k2_start=1.0,
    ki_start=0.15,
    start_time=30.0,
    wander=0.01,
    wander_start=0.3,
    design="riccati",
    poles="-0.5 -0.5 -0.5",
    theta=1.0,
    kpp=0.0,
    kvp=0.0,
    kxp=0.0,
    kpv=0.0,
    kvv=0.0,
    kxv=0.0,
    bias_law="xi",
    xi_noise=0.1,
    memory=300.0,
    slip=5.0,
    wind=5.0,
    adaptation=0.02,
    accel_bound=1.0,
    gyro_bound=0.1,
    min_speed=0.0,
    outage_after=0.0,
)
"""Options of every filter that has the observer, as keywords of `fuse`; docs/explanation/observer.md says
what they are."""
BY_NORM = dict(k1=0.3, k2=0.03, ki=0.01, wander=0.02)
"""Gains that differ with bias_law="norm", which knows no wind: the attitude has to make up for what
that law does not find."""
OUTAGE_INTERVALS = 3.0
"""Fix intervals without a fix after which `outage_after` = 0 takes it for an outage."""
USES = ("position", "velocity", "heading", "altitude", "magnetic-field")
"""Kinds of measurement that the observer can use."""
FORCE_STD = 2 * equations.NOMINAL_GRAVITY
"""m/s^2: how wrong f_n can be at the start, whatever the attitude that it begins with."""
GYRO_LEFT = 0.003
"""rad/s: how wrong the gyro bias is at least, per axis, when the start is over."""
HALVINGS = 8
"""Times that ki_start, ki and adaptation are halved, where not given, until the loops are stable
at slow fixes."""
ROUND = 20
"""Most fixes of the faster kind in one round of both."""
StartFunction = TypeVar("StartFunction", bound=Callable[..., FilterState])
Jump: TypeAlias = tuple[float, str, Array]
"""A fix of a round: s since the fix before, "position" or "velocity", gains K (3,) on p, v, f."""


class ObserverAxis(NamedTuple):
    """The fixes of an axis, as far as its gains depend on them; an interval is 0 without two."""

    name: str
    interval: float  # s between positions
    velocity_interval: float  # s between velocities
    position_std: float  # m
    velocity_std: float  # m/s


def takes_options(start: StartFunction) -> StartFunction:
    """A `start` whose **options are those of the observer, for the engine and the listing of
    filters, which go by its signature."""
    own = [p for p in signature(start).parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    options = [
        Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default)
        for name, default in DEFAULTS.items()
    ]
    # the type of a function knows no __signature__
    start.__signature__ = Signature([*own, *options])  # type: ignore[attr-defined]
    return start


def begin(block: Array, start: InitialState, noise: Noise, **options: Any) -> None:
    """Fill an observer's block (numbers of OBSERVER) for an InitialState, a Noise and
    options, all of DEFAULTS where not given.

    Raises ValueError where an option or the start's biases are out of bounds.
    """
    o = check_gain_options(options)
    _check_bias("gyro", start.b_g, o["gyro_bound"])
    _check_bias("accel", start.b_a, o["accel_bound"])
    at = equations
    block[:] = 0.0
    block[at.SQUARE] = float(np.dot(start.b_a, start.b_a))
    block[at.SINCE_COURSE] = block[at.SINCE_HEADING] = block[at.SINCE_FIELD] = 1e9
    block[at.FADE], block[at.COURSE] = at.FADE_AT_START, math.nan
    for name in ("k1", "k2", "ki", "k1_start", "k2_start", "ki_start", "start_time"):
        block[getattr(at, name.upper())] = o[name]
    block[at.WANDER] = o["wander"] * o["theta"] ** 3
    block[at.WANDER_START] = o["wander_start"] * o["theta"] ** 3
    for name in ("gyro_bound", "accel_bound", "adaptation", "min_speed"):
        block[getattr(at, name.upper())] = o[name]
    block[at.FIELD] = at.FIELDS[o["field"]]
    block[at.MODE], block[at.TOLD] = at.COURSES[o["course"]], noise.accel
    block[at.OUTAGE_AFTER] = o["outage_after"] or OUTAGE_INTERVALS
    block[at.LAW] = at.LAWS[o["bias_law"]]
    law = adaptive_law.ADAPTIVE.views(block[at.ADAPTIVE])
    law["XI_NOISE"][...], law["MEMORY"][...] = o["xi_noise"], o["memory"]
    law["SLIP"][...] = math.radians(o["slip"])
    law["SCALE"][:] = (
        *start.std[9:12],
        *np.maximum(start.std[12:15], GYRO_LEFT),
        *(o["wind"],) * 2,
    )
    law["J"][:] = law["ROOT"][:] = np.eye(adaptive_law.COUNT)
    law["U_GYRO"][:, adaptive_law.GYRO : adaptive_law.AIR] = np.diag(
        law["SCALE"][adaptive_law.GYRO : adaptive_law.AIR]
    )
    own = translation_gains.TRANSLATION.views(block[at.MOTION])
    own["DESIGN"][...] = translation_gains.DESIGNS[_design(o)]
    own["LOST"][...] = block[at.OUTAGE_AFTER]
    own["POLE"][...], own["PAIR"][:] = np.split(np.array(_as_numbers(o)), [1])
    own["GAINS"][:], own["VELOCITY_GAINS"][:] = _given_gains(o)
    own["P"].reshape(3, 6)[:, [0, 3, 5]] = [
        (start.std[axis] ** 2, start.std[3 + axis] ** 2, FORCE_STD**2) for axis in range(3)
    ]


def _check_bias(name: str, bias: ArrayLike, bound: float) -> None:
    """Raise ValueError where the bias of a start is beyond its bound."""
    if np.linalg.norm(bias) > bound:
        raise ValueError(
            f"the start's {name} bias is {np.linalg.norm(bias):.3g}, beyond {name}_bound = {bound:g}; "
            f"give a larger bound"
        )


def implant(workspace: Array, start: InitialState, noise: Noise, **options: Any) -> None:
    """An observer of its own in `workspace`, numbers of EMBEDDED, beginning at `start`: what
    `embedded_observer` gives a view of. Raises as `begin`."""
    workspace[equations.STATE] = as_numbers(start.belief(np.empty(0)))
    begin(workspace[equations.BLOCK], start, noise, **options)


def check_gain_options(options: dict[str, Any]) -> dict[str, Any]:
    """DEFAULTS with these options in. Raises ValueError naming the first that is out of bounds."""
    printed = options.get("course") == "printed"
    law = options.get("bias_law", "norm" if printed else DEFAULTS["bias_law"])
    if printed and law == "xi":
        raise ValueError(
            "course='printed' turns the attitude about another axis than the vertical, which "
            "bias_law='xi' does not know: give bias_law='norm'"
        )
    o = {**DEFAULTS, **(BY_NORM if law == "norm" else {}), **options, "bias_law": law}
    for name in (
        "k1",
        "k2",
        "k1_start",
        "k2_start",
        "start_time",
        "gyro_bound",
        "accel_bound",
        "wander",
        "wander_start",
        "theta",
        "xi_noise",
        "memory",
        "slip",
    ):
        check_number(o[name], name, above=0)
    for name in ("ki", "ki_start", "adaptation", "min_speed", "outage_after", "wind", *GAINS):
        check_number(o[name], name, least=0)
    for name, known in (
        ("course", equations.COURSES),
        ("field", equations.FIELDS),
        ("design", ("riccati", "poles")),
        ("bias_law", equations.LAWS),
    ):
        check_choice(o[name], name, known)
    _poles(o)
    return o


GAINS = ("kpp", "kvp", "kxp", "kpv", "kvv", "kxv")
"""Options that are gains of a position and of a velocity on position, velocity and xi; none
above zero: designed."""


def _design(o: dict[str, Any]) -> str:
    return "given" if any(o[name] for name in GAINS) else o["design"]


def _given_gains(o: dict[str, Any]) -> Array:
    """The gains as given, (2, 3): of a position and of a velocity on p, v, xi."""
    t = o["theta"]
    return np.array(
        [
            [o["kpp"] * t, o["kvp"] * t**2, o["kxp"] * t**3],
            [o["kpv"], o["kvv"] * t, o["kxv"] * t**2],
        ]
    )


def _poles(o: dict[str, Any]) -> NDArray[np.complex128]:
    """Three poles, 1/s: a real one, then a pair. Raises ValueError where the text is none or
    they are not stable."""
    said = (
        f"poles is {o['poles']!r}; it must be three numbers such as '-0.5 -0.3+0.3j -0.3-0.3j', all "
        f"with real parts below zero, "
        "complex ones in pairs"
    )
    try:
        poles = (
            np.array([complex(part) for part in re.split(r"[\s,;/]+", o["poles"].strip())])
            * o["theta"]
        )
    except ValueError:
        raise ValueError(said) from None
    poles = (
        poles[np.argsort(poles.imag != 0, kind="stable")]
        if len(poles) == 3
        else np.zeros(3, complex)
    )
    paired = not poles[1:].imag.any() or abs(poles[1] - poles[2].conjugate()) <= 1e-9 * abs(
        poles[1]
    )
    if not ((poles.real < 0).all() and np.isfinite(poles).all() and not poles[0].imag and paired):
        raise ValueError(said)
    return poles


def _as_numbers(o: dict[str, Any]) -> tuple[float, float, float, float]:
    one, a, b = _poles(o)
    return (one.real, a.real, abs(a.imag), 1.0) if a.imag else (one.real, a.real, b.real, 0.0)


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """(options with `outage_after` from the sources, notes: gains at their intervals and spectral
    radius), for Filter.configure. Options that are not the observer's stay as they are.

    Raises ValueError where nothing measures position, or heading or course, or the gains are not
    stable at the intervals of these fixes.
    """
    o = check_gain_options({name: value for name, value in options.items() if name in DEFAULTS})
    kinds = {a.kind for a in sources}
    if "position" not in kinds:
        raise ValueError(
            "nothing measures the position, without which velocity and specific force are not "
            "observed: add a source of position"
        )
    if o["course"] != "none" and not kinds & {"velocity", "heading", "magnetic-field"}:
        raise ValueError(
            "nothing measures heading or course: add a source of velocity, heading or "
            "magnetic-field (course='none' runs without)"
        )
    intervals = [fix_interval(sources, kind) for kind in ("position", "velocity")]
    decided = {
        "outage_after": o["outage_after"]
        or OUTAGE_INTERVALS * min([seconds for seconds in intervals if seconds] or [1.0])
    }
    if o["bias_law"] == "xi" and o["memory"] <= decided["outage_after"]:
        raise ValueError(
            f"memory is {o['memory']:g} s: what the fixes tell would be forgotten before an outage "
            f"begins, after {decided['outage_after']:g} s; give a longer memory or bias_law='norm'"
        )
    axes, unchecked = _axes(sources)
    if not axes:
        return {**options, **decided}, [
            "fewer than two fixes of position: the observer's gains are not checked"
        ]
    free = tuple(name for name in ("ki_start", "ki", "adaptation") if name not in options)
    plain_numbers = {
        name: value if isinstance(value, str) else float(value)
        for name, value in (o | decided).items()
    }
    lowered, notes = _design_gains(tuple(plain_numbers.items()), axes, free)
    said = [
        f"{name}: fewer than two fixes of position; the observer's gains are not checked there"
        for name in unchecked
    ]
    return {**options, **decided, **dict(lowered)}, [*notes, *said]


def _axes(sources: Sequence[SourceLike]) -> tuple[tuple[ObserverAxis, ...], list[str]]:
    """North and down, and east where it has other intervals than north; the names of those that
    have fewer than two positions."""
    found = []
    for axis, name in enumerate(("north", "east", "down")):
        both = [
            (fix_interval(sources, kind, axis), _deviation(sources, kind, axis))
            for kind in ("position", "velocity")
        ]
        found.append(ObserverAxis(name, both[0][0], both[1][0], both[0][1], both[1][1]))
    if found[1][1:3] == found[0][1:3]:
        del found[1]
    return tuple(one for one in found if one.interval), [
        one.name for one in found if not one.interval
    ]


def _is_axis_measured(source: SourceLike, axis: int | None = None) -> Mask:
    """(n,) Whether each fix measures that axis, or any: missing numbers are NaN."""
    y, std = (
        np.asarray(values, float).reshape(len(source.t), -1) for values in (source.y, source.std)
    )
    finite = np.isfinite(y) & np.isfinite(std)
    return finite.any(axis=1) if axis is None else finite[:, axis]


def _deviation(sources: Sequence[SourceLike], kind: str, axis: int) -> float:
    """Median standard deviation of the fixes of that kind on an axis, 0 without any."""
    of_all = [
        np.asarray(a.std, float).reshape(len(a.t), -1)[_is_axis_measured(a, axis), axis]
        for a in sources
        if a.kind == kind and len(a.t)
    ]
    return float(np.median(np.concatenate(of_all))) if sum(map(len, of_all)) else 0.0


@lru_cache(maxsize=256)
def _design_gains(
    options: tuple[tuple[str, Any], ...], axes: tuple[ObserverAxis, ...], free: tuple[str, ...]
) -> tuple[tuple[tuple[str, float], ...], tuple[str, ...]]:
    """(options lowered, of those `free` to be, notes) for these options and axes (name, intervals,
    stds); the same question is answered but once.

    Raises ValueError where the gains are not stable.
    """
    o, lowered = dict(options), {}
    for _ in range(HALVINGS):
        if not free or all(_unstable(o, axis) is None for axis in axes):
            break
        lowered = {name: 0.5 * o[name] for name in free}
        o |= lowered
    for axis in axes:
        if unstable := _unstable(o, axis):
            raise ValueError(
                f"with these gains {unstable[0]} is not stable at fixes every {axis.interval:g} s: "
                f"spectral radius {unstable[1]:.4g}, "
                "which must be below 1; give smaller gains or slower poles"
            )
    said = [
        f"{name} lowered to {value:g}, so that the loops are stable at these fixes"
        for name, value in lowered.items()
    ]
    return tuple(lowered.items()), (*(_note(o, axis) for axis in axes), *said)


def _unstable(o: dict[str, Any], axis: ObserverAxis) -> tuple[str, float] | None:
    """(what, spectral radius) of the first loop that is not stable at these intervals and
    standard deviations, or None."""
    for end in ("_start", ""):
        jumps = schedule(o, *axis[1:], end)
        for what, radius in (
            ("the translational motion observer", spectral_radius(jumps)),
            ("the attitude", max(attitude_loop(o, jumps, end))),
            ("the adaptation", adaptation_loop(o, jumps)),
        ):
            if not radius < 1:
                return what, radius
    return None


def _note(o: dict[str, Any], axis: ObserverAxis) -> str:
    """The line on an axis: gains, intervals, spectral radii."""
    jumps = schedule(o, *axis[1:])
    every = " and ".join(
        f"{kind} every {seconds:g} s"
        for kind, seconds in (("position", axis.interval), ("velocity", axis.velocity_interval))
        if seconds
    )
    corrected = "; ".join(
        f"a {kind} corrects position, velocity and force by "
        + ", ".join(f"{value:.4g}" for value in K)
        for kind, K in last_gains(jumps)
    )
    return (
        f"observer gains, {_design(o)}, {every}; {axis.name}: {corrected}; spectral radius "
        f"{spectral_radius(jumps):.4f} per round of fixes, "
        f"{max(attitude_loop(o, jumps, '')):.4f} of the attitude with it"
    )


def fix_interval(sources: Sequence[SourceLike], kind: str, axis: int | None = None) -> float:
    """Median time (s) between the fixes of that kind (and axis, 0 to 2), all sources together; 0
    for fewer than two.

    Above 10 ms it is in whole milliseconds: time stamps jitter, and some fixes more or less would
    make other options of the same receiver.
    """
    found = [
        np.asarray(a.t, float)[_is_axis_measured(a, axis)]
        for a in sources
        if a.kind == kind and len(a.t)
    ]
    times = np.unique(np.concatenate(found)) if found else np.empty(0)
    median = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return round(median, 3) if median > 0.01 else median


def schedule(
    o: dict[str, Any],
    interval: float,
    velocity_interval: float,
    position_std: float = 1.0,
    velocity_std: float = 0.1,
    end: str = "",
) -> list[Jump]:
    """One round of fixes in the steady state: [(s since the fix before, "position" or "velocity",
    gains K (3,) on p, v, f)].

    With end "_start" at the start.

    Of two intervals the longer is taken for a whole number of the shorter (at most ROUND); both
    kinds come at its end, positions first.
    """
    slow, fast = (
        max(interval, velocity_interval),
        min(interval or velocity_interval, velocity_interval or interval),
    )
    count = min(max(round(slow / fast), 1), ROUND)
    many = (
        "velocity"
        if velocity_interval and velocity_interval <= interval or not interval
        else "position"
    )
    times = [(slow / count, many)] * count
    if interval and velocity_interval:
        other = "position" if many == "velocity" else "velocity"
        times[-1:] = sorted([(times[-1][0], many), (times[-1][0], other)], key=lambda one: one[1])
        times[-1] = (0.0, times[-1][1])
    design = _design(o)
    if design == "given":
        return [(T, kind, _given_gains(o)[int(kind == "velocity")]) for T, kind in times]
    if design == "poles":
        return [
            (
                T,
                kind,
                by_poles(
                    o,
                    kind,
                    interval if kind == "position" else velocity_interval,
                    bool(velocity_interval),
                ),
            )
            for T, kind in times
        ]
    return _riccati(
        times,
        o["wander" + end] * o["theta"] ** 3,
        {"position": position_std, "velocity": velocity_std},
    )


def by_poles(o: dict[str, Any], kind: str, T: float, velocities: bool) -> Array:
    """Gains K (3,) that give the sampled error the factors exp(s T): with velocities the pair is
    that of velocity and force."""
    one, a, b = np.expm1(_poles(o) * T)
    if kind == "velocity":
        return np.array([0.0, -(a + b + a * b).real, (a * b).real / T])
    if velocities:
        return np.array([-one.real, 0.0, 0.0])
    l1, l3 = -(one + a + b).real, -(one * a * b).real / T**2
    l2 = (one * (a + b) + a * b).real / T - 0.5 * T * l3
    return np.array([l1 - T * l2 + 0.5 * T**2 * l3, l2 - T * l3, l3])


def transition(T: float) -> Array:
    """Phi (3, 3) of position, velocity, force over T seconds."""
    return np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])


def driving_noise(T: float, q: float) -> Array:
    """Q (3, 3) over T seconds of a force driven by density q, (m/s^2)^2/s."""
    return q * np.array(
        [[T**5 / 20, T**4 / 8, T**3 / 6], [T**4 / 8, T**3 / 3, T**2 / 2], [T**3 / 6, T**2 / 2, T]]
    )


def _riccati(
    times: list[tuple[float, str]], wander: float, std: dict[str, float], rounds: int = 4000
) -> list[Jump]:
    """The gains that the Riccati equation settles to on this round of fixes."""
    P, before = np.diag([1.0, 1.0, FORCE_STD**2]), np.zeros(3 * len(times))
    for _ in range(rounds):
        gains = []
        for T, kind in times:
            Phi, row = transition(T), int(kind == "velocity")
            P = Phi @ P @ Phi.T + driving_noise(T, wander**2)
            K = P[:, row] / (P[row, row] + max(std[kind], translation_gains.MIN_STD) ** 2)
            P = P - np.outer(K, P[row])
            gains.append(K)
        if np.abs(np.concatenate(gains) - before).max() < 1e-13:
            break
        before = np.concatenate(gains)
    return [(T, kind, K) for (T, kind), K in zip(times, gains)]


def last_gains(jumps: list[Jump]) -> list[tuple[str, Array]]:
    """[(kind, K)] of the last fix of each kind in the round."""
    return list({kind: K for _, kind, K in jumps}.items())


def round_matrix(jumps: list[Jump], A: Array) -> Array:
    """Return the transition matrix over one round of fixes of the state whose first three are p, v,
    xi (of the force) and whose derivative is A x."""
    from scipy.linalg import expm

    M = np.eye(len(A))
    for T, kind, K in jumps:
        step = np.eye(len(A))
        step[:3, int(kind == "velocity")] -= K
        M = step @ expm(A * T) @ M
    return M


def spectral_radius(jumps: list[Jump]) -> float:
    """Largest modulus of the eigenvalues of the product of (I - K C) Phi over one round of
    fixes."""
    M = np.eye(3)
    for T, kind, K in jumps:
        step = np.eye(3)
        step[:, int(kind == "velocity")] -= K
        M = step @ transition(T) @ M
    return radius(M)


def radius(M: Array) -> float:
    """Largest modulus of the eigenvalues of M."""
    return float(np.abs(np.linalg.eigvals(M)).max())


def attitude_loop(o: dict[str, Any], jumps: list[Jump], end: str) -> tuple[float, float]:
    """Spectral radii over one round of fixes, of the observer with tilt and gyro bias, and of
    heading and gyro bias.

    With end "_start" they are those of the gains of the start.
    """
    g, seconds, (k1, k2, ki) = (
        equations.NOMINAL_GRAVITY,
        sum(T for T, _, _ in jumps),
        (o[name + end] for name in ("k1", "k2", "ki")),
    )
    A = np.zeros((5, 5))  # errors of p, v, f_n, tilt, gyro bias; xi is what tilt and f_n leave
    A[0, 1], A[1, 2], A[2, 4] = 1.0, 1.0, g
    A[3, 2], A[3, 3], A[3, 4] = k1 / g, -k1, 1.0
    A[4, 2], A[4, 3] = ki * k1 / g, -ki * k1
    keep = 5 if ki else 4
    T = min(seconds, equations.MAX_GAP)
    left = math.exp(-k2 * T)
    heading = np.array([[left, left * T], [-ki * (1 - left), 1 - ki * (1 - left) * T]])[
        : keep - 3, : keep - 3
    ]
    return radius(round_matrix(jumps, A[:keep, :keep])), radius(heading)


def adaptation_loop(o: dict[str, Any], jumps: list[Jump]) -> float:
    """Spectral radius of the observer with the accelerometer bias along the specific force
    adapted; 0 without adaptation."""
    if not o["adaptation"]:
        return 0.0
    # errors of p, v, f_n, bias along the force; xi is what the other two leave
    A, rate = (
        np.zeros((4, 4)),
        o["adaptation"],
    )
    A[0, 1], A[1, 2] = 1.0, 1.0
    A[2, 2], A[2, 3], A[3, 2], A[3, 3] = rate, rate, -rate, -rate
    return radius(round_matrix(jumps, A))
