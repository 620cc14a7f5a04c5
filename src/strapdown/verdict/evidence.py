"""Evidence from the run of a filter: its biases, innovations, course and claims, each against those
of a correct set-up.

The bounds are beyond what recordings with a correct set-up reached, recorded ones and simulated
ones with other random numbers than those of any published figure (docs/how-to/verdict.md).
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ..core.loop.contract import ATT, BA, BG, DOUBTFUL, VEL
from ..core.loop.gaps import BRIDGE
from ..core.mathematics.rotation import quaternion_to_euler
from ..data.solution import Innovations, Rejected, Solution, Source
from ..data.vehicle import VEHICLES
from ..data.verdict import GRAVE, Reason
from ..evaluation.fix_statistics import MEDIANS, correlation, lasts
from ..typing import Array, Ints, Mask
from ..units.constants import SETTLING

ENOUGH = 1000  # times at which course and heading are compared
GATED = 20  # fixes of a source from which its statistics say something
BIAS = 6.0  # estimated bias over what the description of the IMU allows
SURE = 3.0  # and over its own standard deviation
NIS_HIGH, NIS_LOW = 2.0, 0.06  # median NIS of a source over its expectation
NIS_PART, PARTS, SHARE_OF_PARTS = 4.0, 20, 0.1  # the same in parts of a run, and in how many
FEWEST_PARTS = 5
EXCESS = {"position": 1.4, "velocity": 3.1}
"""Variance of the innovations that lasts from fix to fix, over what the filter claims of its
prediction: recorded receivers that state whole errors come to 0.85, the velocity of one to 2.8; those
whose std was divided until it is the scatter from fix to fix to 2.3 and 3.4 and more."""
SURELY = 4.0  # standard deviations of a correlation that counts
SLOW_LAGS = 8  # fixes over which a correlation that hardly falls is averaged
REJECTED = 0.13  # share of the fixes of a source; one in a thousand is expected
MAX_OF_THEM = 0.5  # share of the rejected fixes of a source: a longer run explains them
LIFTED = 0.03  # share of the fixes for which the gate was opened
UNBELIEVED = 10.0  # s in which every fix of a source is rejected
MOVING = 3.0  # m/s above which a course is compared with the heading
SLOWEST, KNOWN_COURSE = 0.5, 5.0  # the same of a velocity known well: m/s, and claimed std of it
SIDEWAYS = 1.0  # m/s of wind, current or side slip, which sets a course off the heading
STEADY, OFF_COURSE = 25.0, 20.0  # deg: spread and mean of course less heading
LONG_GAP = 30.0
"""s without samples that make a result as doubtful as a weight of 1: the covariance grows by all that may
have happened, and of shorter gaps (1, 4 and 15 s, car, ship, aircraft, hand) the innovations show where
that was not enough."""
NEAR_POLE = np.radians(85.0)
"""rad: latitude from which north turns by a degree and more in 10 km, and dip of the field there."""
DOUBTED = 0.2  # share of the time after that in which rows are doubtful
SMOOTHER = 3.0  # mean squared difference between filter and smoother over its expectation


DIAGNOSE = "run `strapdown inspect` and `strapdown diagnose`; if neither finds a cause,"
"""First remedy where a source does not fit."""


class JudgedFixes(NamedTuple):
    """The measured fixes of one source."""

    name: str
    kind: str
    t: Array  # (m,) s
    innovation: Array  # (m, 3)
    correlation: float  # of its whitened innovations one fix apart
    slow: float  # the same, its mean over SLOW_LAGS fixes
    predicted: float  # share of their variance that is the prediction's; NaN where it is not known
    ratio: Array  # (m,) NIS over its expected median; NaN where the filter does not gate
    accepted: Mask  # (m,)
    lifted: Mask  # (m,) used although their NIS was above the gate


def by_source(solution: Solution) -> list[JudgedFixes]:
    """The JudgedFixes of each source that measured something, in the order of the sources."""
    every = solution.innovations
    rows = np.isfinite(every.innovation).sum(axis=1)
    expected = np.array([np.nan, *MEDIANS.values()])[rows]
    found = []
    assert solution.recording is not None
    sources = zip(every.names, every.gates, solution.recording.sources)
    for s, (name, gate, source) in enumerate(sources):
        own = np.flatnonzero((every.source == s) & (rows > 0))
        if len(own):
            found.append(
                JudgedFixes(
                    name,
                    source.kind,
                    every.t[own],
                    every.innovation[own],
                    0.0 if every.whitened is None else correlation(every.whitened[own]),
                    0.0 if every.whitened is None else correlation(every.whitened[own], SLOW_LAGS),
                    _predicted_share(every, own, source),
                    every.nis[own] / expected[own],
                    every.accepted[own],
                    every.accepted[own] & (every.nis[own] > gate),
                )
            )
    return found


def _predicted_share(every: Innovations, own: Ints, source: Source) -> float:
    """Median share of the variance of the innovations in rows `own` that the prediction brings, by
    the filter; NaN where it does not say, or the kind has no EXCESS."""
    if every.root is None or source.kind not in EXCESS:
        return np.nan
    root, used = every.root[own], 1.0 if every.followed is None else every.followed[own]
    variance = np.c_[
        root[:, 0] ** 2, (root[:, 1:3] ** 2).sum(axis=1), (root[:, 3:] ** 2).sum(axis=1)
    ]
    row = np.minimum(np.searchsorted(source.t, every.t[own]), len(source.t) - 1)
    share = 1 - (source.std[row] * used) ** 2 / variance
    known = [column[np.isfinite(column)] for column in share.T]
    return float(np.mean([np.median(column) for column in known if len(column)] or [np.nan]))


def check_divergence(solution: Solution) -> Iterator[Reason]:
    """The filter diverged."""
    if "stopped" in solution.meta:
        yield Reason(
            "unknown",
            f"the filter {solution.meta['stopped']}",
            "run `strapdown inspect` on the recording and correct what it finds",
            weight=10 * GRAVE,
        )


def long_gaps(solution: Solution) -> tuple[Array, Array]:
    """(when they begin (k,), how long they are (k,)) in s of the gaps of the samples that are longer than
    the loop bridges."""
    assert solution.recording is not None
    imu = solution.recording.imu
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    long = np.flatnonzero((missing > BRIDGE) & (imu.t[:-1] > solution.meta["start"]["t"]))
    return imu.t[long], missing[long]


def first_gap(solution: Solution) -> tuple[float, float]:
    """(when the first begins, how long the longest is) in s of `long_gaps`; (inf, 0) without any."""
    begins, missing = long_gaps(solution)
    return (float(begins[0]), float(missing.max())) if len(begins) else (np.inf, 0.0)


def gaps(solution: Solution) -> Iterator[Reason]:
    """Samples that are missing for longer than the loop bridges."""
    when, longest = first_gap(solution)
    if longest:
        yield Reason(
            "samples",
            f"up to {longest:.3g} s of samples are missing, first at {when:.0f} s (at most "
            f"{BRIDGE:g} s is bridged); after the gap the result, above all its heading, depends "
            "on the fixes alone",
            "fuse the parts before and after the gap separately (`--from`, `--to`)",
            weight=min(longest / LONG_GAP, GRAVE),
        )


def heights(solution: Solution) -> Iterator[Reason]:
    """Sources whose height was left out, because it and that of another contradict each other."""
    for each in solution.meta.get("heights_apart", ()):
        off = each["difference"]
        seen = (
            f"from {each['start']:.0f} to {each['stop']:.0f} s its height differs by up to "
            f"{off:+.3g} m from that of {each['other']}, and the filter leaves it out"
        )
        if not each["decided"]:
            seen += (
                "; the data do not show which of them is wrong, so the height may be "
                f"{abs(off):.3g} m off; horizontal position, velocity and attitude do not depend "
                "on it"
            )
        yield Reason(
            "height",
            seen,
            'if its heights are above mean sea level, set geoid = "EGM96" in recording.toml; '
            "otherwise leave out the source that is wrong",
            each["source"],
        )


def biases(solution: Solution) -> Iterator[Reason]:
    """Biases at the end beyond what the description of the IMU allows."""
    described, claimed = solution.meta.get("bias_std"), solution.trajectory.std
    if described is None or claimed is None:
        return
    found = []
    for sensor, bias, allowed, std, scale, unit in (
        ("accelerometer", solution.b_a[-1], described[0], claimed[-1, BA], 1.0, "m/s^2"),
        ("gyro", solution.b_g[-1], described[1], claimed[-1, BG], np.degrees(1), "deg/s"),
    ):
        times = np.where(
            np.abs(bias) > SURE * np.nan_to_num(std), np.abs(bias) / max(allowed, 1e-12), 0.0
        )
        axis = int(np.argmax(times))
        if times[axis] > BIAS:
            seen = (
                f"the estimated bias of {sensor} {'xyz'[axis]} is {bias[axis] * scale:.3g} "
                f"{unit}, {times[axis]:.3g} times the std of {allowed * scale:.2g} {unit} in the "
                "IMU description"
            )
            found.append((sensor, seen, float(times[axis] / BIAS)))
    if found:
        yield Reason(
            found[0][0] if len(found) == 1 else "imu noise",
            f"{' and '.join(seen for _, seen, _ in found)} ({BIAS:.0f} times at most)",
            "check unit, axes and time of the IMU; if they are correct, describe a less accurate "
            "IMU than " + (solution.meta.get("imu") or "this"),
            weight=max(weight for *_, weight in found),
        )


def noise(source: JudgedFixes) -> Iterator[Reason]:
    """Innovations of another size than their standard deviations say, over the run or in part
    of it."""
    if len(source.t) < GATED or not np.isfinite(source.ratio).all():
        return
    ratio = float(np.median(source.ratio))
    times = np.sqrt(ratio)
    if ratio > NIS_HIGH:
        yield Reason(
            "lasting errors" if lasts(source.correlation) else "fix noise",
            f"the innovations are {times:.2g} times as large as the standard deviations predict "
            f"({np.sqrt(NIS_HIGH):.2g} times at most)",
            DIAGNOSE + " give it a larger std",
            source.name,
            ratio / NIS_HIGH,
        )
    elif bad := _bad_parts(source):
        start, stop, worst = bad
        yield Reason(
            "outliers",
            f"between {start:.0f} and {stop:.0f} s the innovations are up to {np.sqrt(worst):.2g} "
            f"times as large as the standard deviations predict ({np.sqrt(NIS_PART):.2g} times at "
            "most)",
            DIAGNOSE + " give it a larger std, or leave out the fixes of that time",
            source.name,
            worst / NIS_PART,
        )
    if ratio < NIS_LOW and source.kind in ("position", "velocity"):
        yield _too_small(source, times)
    elif ratio <= NIS_HIGH:
        yield from _check_correlation(source, ratio)


def _too_small(source: JudgedFixes, times: float) -> Reason:
    """The Reason of innovations that are `times` as large as their standard deviations say."""
    seen = f"the innovations are {1 / times:.0f} times smaller than the standard deviations predict"
    if lasts(source.correlation):
        return Reason(
            "lasting errors",
            f"{seen}, and correlated in time ({source.correlation:.2f} from fix to fix): the "
            "receiver smooths its fixes, or their errors are time-correlated",
            "keep its std, because a smaller one would make the filter overconfident; describe "
            "the time-correlated errors with `correlated`",
            source.name,
        )
    return Reason(
        "fix noise",
        seen,
        f"divide its std by about {1 / times:.0f}; with the present std the filter gives these "
        "fixes too little weight",
        source.name,
    )


def _check_correlation(source: JudgedFixes, ratio: float) -> Iterator[Reason]:
    """Innovations that last and are larger than what the filter claims of its prediction: it takes
    errors that last for noise that averages out."""
    if source.kind not in EXCESS:
        return
    seen = {
        source.correlation: SURELY / np.sqrt(len(source.t)),
        source.slow: SURELY / np.sqrt(SLOW_LAGS * len(source.t)),
    }
    lasting = max(seen, key=lambda each: each / seen[each])
    if lasting < seen[lasting]:
        return
    excess = ratio * lasting / max(source.predicted, 1e-6)
    most = EXCESS[source.kind]
    if excess > most:
        yield Reason(
            "lasting errors",
            f"its innovations are correlated in time ({lasting:.2f} from fix to fix), and this "
            f"part is {np.sqrt(excess):.2g} times the std that the filter claims for its "
            f"prediction ({np.sqrt(most):.2g} times at most): the filter treats time-correlated "
            "errors as white noise",
            "set its std to that of the whole error, as the receiver states it, or describe the "
            "time-correlated errors with `correlated`",
            source.name,
            excess / most,
        )


def _bad_parts(source: JudgedFixes) -> tuple[float, float, float] | None:
    """(first and last time in s, largest ratio) of the parts of a run with too large
    innovations; None where there are too few."""
    size = max(GATED, -(-len(source.t) // PARTS))
    count = len(source.t) // size
    if count < FEWEST_PARTS:
        return None
    ratios = np.median(source.ratio[: count * size].reshape(count, size), axis=1)
    bad = np.flatnonzero(ratios > NIS_PART)
    if len(bad) <= SHARE_OF_PARTS * count:
        return None
    first, last = source.t[bad[0] * size], source.t[(bad[-1] + 1) * size - 1]
    return float(first), float(last), float(ratios[bad].max())


def explain_reason(reason: Reason, runs: Iterable[Rejected]) -> Reason:
    """A Reason of rejections with what the cause says of most of them, where there is one."""
    own = [run for run in runs if run.source == reason.source]
    largest = max(own, key=lambda run: run.number, default=None)
    if largest is None or largest.number < MAX_OF_THEM * sum(run.number for run in own):
        return reason
    if largest.cause == "not known":
        return reason
    return reason._replace(seen=f"{reason.seen}: {largest.seen}", remedy=largest.remedy)


def rejections(source: JudgedFixes) -> Iterator[Reason]:
    """Too many fixes that the filter did not believe, or none accepted for long."""
    if len(source.t) < GATED:
        return
    share = float(1 - source.accepted.mean())
    if share > REJECTED:
        yield Reason(
            "outliers",
            f"{100 * share:.0f} % of the fixes were rejected (0.1 % expected, {100 * REJECTED:.0f} "
            f"% at most)",
            DIAGNOSE + " give it a larger std, or leave out the wrong fixes",
            source.name,
            share / REJECTED,
        )
        return
    lifted = float(source.lifted.mean())
    if lifted > LIFTED:
        yield Reason(
            "outliers",
            f"{100 * lifted:.0f} % of the fixes passed only because the filter opened its gate "
            f"after many rejections ({100 * LIFTED:.0f} % at most)",
            DIAGNOSE + " give it a larger std, or leave out the wrong fixes",
            source.name,
            lifted / LIFTED,
        )
    times = np.r_[source.t[0], source.t[source.accepted], source.t[-1]]
    longest = int(np.argmax(np.diff(times)))
    inside = (source.t > times[longest]) & (source.t < times[longest + 1])
    seconds = float(np.diff(times)[longest])
    if seconds > UNBELIEVED and inside.sum() >= 5:
        yield Reason(
            "outliers",
            f"from {times[longest]:.0f} s on the filter rejected all {inside.sum()} fixes for "
            f"{seconds:.0f} s ({UNBELIEVED:.0f} s at most)",
            DIAGNOSE + " look at these times in the report",
            source.name,
            min(seconds / UNBELIEVED, GRAVE),
        )


def jumps(source: JudgedFixes, gaps: Array) -> Iterator[Reason]:
    """A gate of positions or velocities that had to be lifted once the start was over, and not because
    samples were missing until then (`gaps` (k,) s): what comes after rests on these fixes being right."""
    settled = source.t[0] + min(SETTLING, 0.2 * (source.t[-1] - source.t[0]))
    since = source.t[:, None] - gaps
    explained = ((since >= 0) & (since < SETTLING)).any(axis=1)
    lifted = np.flatnonzero(source.lifted & (source.t > settled) & ~explained)
    if source.kind in ("position", "velocity") and len(lifted):
        size = float(np.sqrt(np.nansum(source.innovation[lifted[0]] ** 2)))
        unit = "m" if source.kind == "position" else "m/s"
        yield Reason(
            "outliers",
            f"at {source.t[lifted[0]]:.0f} s its fixes were {size:.3g} {unit} off the prediction "
            "for so long that the filter followed them; the result after that depends on them",
            DIAGNOSE + " check whether the fixes before or after that time are correct",
            source.name,
        )


class CourseAngle(NamedTuple):
    """The course over ground less the heading, in deg."""

    mean: float
    least: float  # of a mean that is no wind, side slip or chance


def course_angle(solution: Solution, t: Array) -> CourseAngle | None:
    """The CourseAngle at the times `t` (s) of fixes, where one follows the other; None where it is no
    steady one, or the vehicle hardly moves."""
    made = solution.trajectory
    vehicle = VEHICLES.get(solution.meta.get("vehicle", ""), VEHICLES["any"])
    if made.v_n is None or made.q_nb is None or not vehicle.points_ahead:
        return None
    later = t[(t > made.t[0] + 0.2 * (made.t[-1] - made.t[0])) & (t < first_gap(solution)[0])]
    later = later[:: max(1, len(later) // ENOUGH)]
    rows = np.minimum(np.searchsorted(made.t, later), len(made.t) - 1)
    v = made.v_n[rows]
    std = np.zeros((len(rows), ATT.stop)) if made.std is None else np.nan_to_num(made.std[rows])
    speed, speed_std = np.hypot(v[:, 0], v[:, 1]), std[:, VEL].max(axis=1)
    # a filter that claims nothing has no course below MOVING
    known = np.where(speed_std > 0, np.clip(KNOWN_COURSE * speed_std, SLOWEST, MOVING), MOVING)
    fast = speed > known
    if fast.sum() < GATED:
        return None
    heading = quaternion_to_euler(made.q_nb[rows[fast]])[:, 2]
    angle = np.arctan2(v[fast, 1], v[fast, 0]) - heading
    mean = np.nanmean(np.exp(1j * angle))
    spread = float(np.degrees(np.sqrt(-2 * np.log(np.clip(abs(mean), 1e-9, 1.0)))))
    if spread > STEADY:
        return None
    aside = np.arctan2(SIDEWAYS, np.median(speed[fast]))
    unsure = np.degrees(max(aside, SURE * np.median(std[fast, ATT.stop - 1])))
    least = max(OFF_COURSE, 1.5 * spread, float(unsure))
    return CourseAngle(float(np.degrees(np.angle(mean))), least)


def course(solution: Solution, t: Array) -> Iterator[Reason]:
    """The course over ground, at the times `t` (s) of fixes, against the heading."""
    found = course_angle(solution, t)
    if found is None or abs(off := found.mean) < found.least:
        return
    quarter = abs(abs(off) - 90) < 20 or abs(off) > 160
    yield Reason(
        "axes" if quarter else "mounting",
        f"while moving, the course is steadily {abs(off):.0f} deg to the "
        f"{'right' if off > 0 else 'left'} of the heading ({OFF_COURSE:.0f} deg at most)",
        f"rotate the axes of the IMU by {-off:+.0f} deg about down (add that to `heading` of "
        "[imu] mounting, or change `axes`)",
        weight=abs(off) / OFF_COURSE,
    )


def smoother(solution: Solution) -> Iterator[Reason]:
    """The filter against the smoother, which knows what came later."""
    for what, ratio in solution.meta.get("filter_against_smoother", {}).items():
        if ratio > SMOOTHER:
            yield Reason(
                "unknown",
                f"{what} of the filter and of the smoother differ {np.sqrt(ratio):.2g} times as "
                f"much as their standard deviations allow ({np.sqrt(SMOOTHER):.2g} times at most)",
                "run `strapdown diagnose` on the recording",
                weight=ratio / SMOOTHER,
            )


def near_pole(solution: Solution) -> Iterator[Reason]:
    """A filter that knows no position where north depends on it: near the poles of the Earth, and where
    the field that it is told dips as it does there."""
    if solution.has_position or solution.recording is None:
        return
    lat = abs(solution.meta["start"]["lla"][0])
    told = [a.parameters[:3] for a in solution.recording.sources if a.kind == "magnetic-field"]
    fields = [field for field in told if len(field) == 3]
    dips = [np.arctan2(abs(down), np.hypot(north, east)) for north, east, down in fields]
    if max([lat, *dips]) < NEAR_POLE:
        return
    where = f"latitude {np.degrees(lat):.4g} deg"
    if lat < NEAR_POLE:
        where = f"a field dip of {np.degrees(max(dips)):.3g} deg"
    yield Reason(
        "unknown",
        f"at {where} the direction of north changes quickly with position, and the filter does "
        "not estimate position",
        "use a filter that estimates position, and record GNSS",
    )


def doubts(solution: Solution) -> Iterator[Reason]:
    """Rows that the run itself says are doubtful, after its start and a doubt that began there and
    ended in the first half, with what it said first."""
    t, span = solution.t, np.diff(solution.t, prepend=solution.t[:1])
    settled = t > t[0] + min(SETTLING, 0.2 * (t[-1] - t[0]))
    believed = np.flatnonzero(settled & (solution.status != DOUBTFUL))
    if len(believed) and t[believed[0]] - t[0] < 0.5 * (t[-1] - t[0]):
        settled &= t >= t[believed[0]]
    doubtful = settled & (solution.status == DOUBTFUL)
    if not doubtful.any():
        return
    share = span[doubtful].sum() / span[settled].sum()
    first = t[np.argmax(doubtful)]
    others = {str(run) for run in solution.rejected}  # which need not make rows doubtful
    said = [
        text
        for at, text in solution.events
        if at <= first and not text.startswith("IMU gap") and text not in others
    ]
    text = said[-1] if said else "contradictions"
    sources = [
        name for name in solution.innovations.names if text.startswith((f"{name}:", f"{name} "))
    ]
    sensors = [sensor for sensor in ("accelerometer", "gyro") if text.startswith(sensor)]
    yield Reason(
        "outliers" if sources else sensors[0] if sensors else "unknown",
        f"{solution.seconds(DOUBTFUL):.0f} s of the result are doubtful, "
        f"{'less than 1' if share < 0.01 else f'{100 * share:.0f}'} % of the time after the start "
        f"({100 * DOUBTED:.0f} % at most), first at {first:.0f} s: {text}",
        "remove its cause, or leave out the rows that `status` marks as doubtful",
        max(sources, key=len, default=""),
        min(share / DOUBTED, GRAVE),
    )
