"""Attitude estimators on the BROAD trials beside their peers: `strapdown reproduce broad`.

The orientation error is the angle of the rotation between estimate and reference, without any
alignment of the two. Only samples count at which the trial's `movement` is true and the reference
known; rms per trial, then the mean over the trials.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from strapdown import filters, io
from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.data.solution import Trajectory
from strapdown.engine.batch import fuse
from strapdown.engine.prepare import has_position
from strapdown.engine.smoothing import smooth
from strapdown.evaluation.metrics import attitude_angles, errors
from strapdown.io.locate import data_folder
from strapdown.io.readers.broad import body_to_ned, parse
from strapdown.typing import Array, File, Mask, Notify

from ..common import markdown
from ..common.example_recordings import inside
from ..common.reproduction import Asked, reproduction
from ..common.study import ReproducedStudy
from ..common.targets import claim
from . import figures as broad_figures
from .peers import PEERS, Peer, installed_version
from .trials import BroadTrial, TrialRun

Result = TypeVar("Result")

CHOSEN_ON, OTHERS = ("02", "21", "24"), ("15", "33")
"""Trials that the default settings were chosen on, and the others."""
MEASURES = {
    "orientation": "orientation error (whole rotation angle)",
    "inclination": "inclination error (angle between the vertical axes)",
    "heading": "heading error (what remains about the vertical)",
}
REPEATS = 3
"""Runs of which the median time counts; of slow peers one."""
CLAIMS = (
    ("attitude-mekf", "mean", 2.6),
    ("mahony", "mean", 5.5),
    ("attitude-mekf, smoothed", "mean", 2.4),
    ("attitude-mekf", "24", 2.5),
    ("attitude-mekf", "33", 5.0),
)
"""Estimator, trial or mean over the five, and the bound on its rms orientation error, deg."""
INTRODUCTION = (
    "BROAD holds trials of a hand-held IMU with gyro, accelerometer and magnetometer at 286 Hz, "
    "whose attitude cameras measured (Laidig et al. 2021, "
    "doi 10.3390/data6070072, CC BY 4.0). Every estimator runs over the whole trial with one "
    "default setting for all trials, on the same samples.",
    "The orientation error is the angle of the rotation between estimate and reference, without "
    "heading alignment. Only samples count where the "
    "trial says that there is movement and where the reference is known: rms per trial, then the "
    "mean over the trials. Inclination is the angle "
    "between the vertical axes of estimate and reference, heading what is left: the error rotation "
    "in the navigation frame as a rotation about "
    "the vertical and one about a horizontal axis. North is magnetic north, as in the reference.",
    "The defaults of strapdown were chosen by reasoning on the sensors and on the trials 02, 21 and "
    "24, marked with a star. The others gave no "
    "constant, but what failed on them was changed (docs/reference/evidence/attitude-broad.md).",
)


def load(path: File) -> BroadTrial:
    """The Trial in an .npz file. Raises DataError."""
    recording = io.read(path)
    fs, arrays = parse(path)
    scored = moving_samples(recording)
    if recording.reference is not None:
        scored &= np.isin(recording.imu.t, recording.reference.t)
    if recording.reference is None or not scored.any():
        raise DataError(
            f"{path}: no sample has both movement and a known reference, so nothing can be scored"
        )
    return BroadTrial(Path(path).stem, recording, arrays, fs, scored)


def moving_samples(recording: Recording) -> Mask:
    """(n,) bool: the IMU samples inside the stretches of meta["movement"]."""
    return inside(recording.imu.t, recording.meta["movement"])


def angles(trajectory: Trajectory, recording: Recording) -> Array:
    """(n, 3) orientation, inclination and heading error (metrics.attitude_angles) at the IMU
    samples of a recording, rad; NaN where an estimate or the reference lacks: what the reference
    has not measured is not interpolated here."""
    found, t = np.full((len(recording.imu.t), 3), np.nan), recording.imu.t
    e = errors(trajectory, recording.reference)
    rows = np.searchsorted(t, e.t)
    measured = np.isin(e.t, recording.reference.t) & (t[np.minimum(rows, len(t) - 1)] == e.t)
    found[rows[measured]] = np.stack(attitude_angles(e), axis=-1)[measured]
    return found


def rms(run: TrialRun, trial: BroadTrial) -> Array:
    """(3,) root mean square of a TrialRun's angles over the scored samples, rad; NaN where an
    estimate is missing at one of them."""
    return np.sqrt(np.mean(run.angles[trial.scored].astype(float) ** 2, axis=0))


def estimators() -> list[str]:
    """Names of the filters that estimate roll and pitch, at least, and need no position."""
    return [
        name
        for name in filters.names()
        if not has_position(filters.find(name)) and {6, 7} <= set(filters.find(name).estimates)
    ]


def _time_calls(function: Callable[[], Result], repeats: int) -> tuple[Result, float]:
    """(result of the last call, median seconds of `repeats` calls)."""
    took = []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = function()
        took.append(time.perf_counter() - begin)
    return result, float(np.median(took))


def _run(name: str, trial: BroadTrial, trajectory: Trajectory, seconds: float) -> TrialRun:
    return TrialRun(
        name,
        trial.name,
        angles(trajectory, trial.recording).astype(np.float32),
        seconds / len(trial.recording.imu.t) * 1e6,
    )


def over_std(trajectory: Trajectory, trial: BroadTrial) -> tuple[float, ...]:
    """(3,) rms of the attitude error (north, east, down) over the standard deviation that the
    Trajectory claims, over the scored samples; NaN without one."""
    e = errors(trajectory, trial.recording.reference)
    scored = np.isin(e.t, trial.recording.imu.t[trial.scored])
    return tuple(np.sqrt(np.mean((e.attitude[scored] / e.std[scored, 6:9]) ** 2, axis=0)))


def own_runs(
    trial: BroadTrial, names: Sequence[str], notify: Notify | None = None
) -> Iterator[TrialRun]:
    """Runs of the filters `names` on a trial, and smoothed of those that can be.

    Timed is what `fuse` takes with alignment and all rows of its solution, compilation apart.
    """
    for name in names:
        kinds = [(name, fuse)] + [(f"{name}, smoothed", smooth)] * (
            filters.find(name).smoother is not None
        )
        for title, function in kinds:
            function(trial.recording, name, notify=notify)
            solution, seconds = _time_calls(lambda: function(trial.recording, name), REPEATS)
            run = _run(title, trial, solution.trajectory, seconds)._replace(
                over=over_std(solution.trajectory, trial)
            )
            if 8 not in filters.find(name).estimates:  # its heading runs free
                run.angles[:, [0, 2]] = np.nan
            yield run


def peer_runs(trial: BroadTrial, quick: bool) -> Iterator[TrialRun]:
    """Runs of the peers that are installed; with `quick` without the slow ones."""
    samples = [np.ascontiguousarray(trial.arrays[name]) for name in ("gyr", "acc", "mag")]
    t = np.arange(len(samples[0])) / trial.fs
    for peer in PEERS:
        if installed_version(peer.package) and not (quick and peer.slow):
            q, seconds = _time_calls(
                lambda: peer.run(*samples, trial.fs), 1 if peer.slow else REPEATS
            )
            yield _run(
                peer.name,
                trial,
                Trajectory(t, np.full((len(t), 3), np.nan), q_nb=body_to_ned(q)),
                seconds,
            )


class BroadComparison(NamedTuple):
    """Estimators beside each other on the same trials."""

    trials: Sequence[BroadTrial]
    runs: Sequence[TrialRun]
    tables: dict[str, tuple[str, pd.DataFrame]]  # see `tables`


@reproduction("quick", "recordings", "notify", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run all estimators on the trials in the folder `recordings` (the data folder's `broad` by
    default), write the page into `out`, return the claims; quick: without slow peers. One run
    after the other, because their time is measured. Raises DataError."""
    recordings = Path(asked.recordings) if asked.recordings else data_folder() / "broad"
    paths = sorted(recordings.glob("*.npz"))
    if not paths:
        raise DataError(f"{recordings}: no BROAD trials (.npz) there; give their folder")
    trials, names, runs = [load(path) for path in paths], estimators(), []
    for i, trial in enumerate(trials):
        if asked.notify:
            asked.notify(f"{trial.name} ...")
        if asked.progress:
            asked.progress(i / len(trials))
        runs += [*own_runs(trial, names, asked.notify), *peer_runs(trial, asked.quick)]
    found = BroadComparison(trials, runs, tables(trials, runs))
    figures = broad_figures.figures(trials, runs)
    return STUDY.write(out, found, figures=figures, notes=_notes(asked.quick, found.tables))


def in_docs(made: Mapping[str, tuple[str, pd.DataFrame]]) -> str:
    """Markdown of the tables {name: (caption, DataFrame)}, a caption above each."""
    caption = lambda text: f"{text[0].upper()}{text[1:]}:".replace("*", r"\*")
    return markdown.tables((caption(text), table) for text, table in made.values())


def tables(
    trials: Sequence[BroadTrial], runs: Sequence[TrialRun]
) -> dict[str, tuple[str, pd.DataFrame]]:
    """{name: (caption, DataFrame)}: a table per measure with a row per estimator, in deg; that
    of orientation also with the time per sample."""
    names = list(dict.fromkeys(run.estimator for run in runs))
    of = {(run.estimator, run.trial): run for run in runs}
    values = np.degrees([[rms(of[name, trial.name], trial) for trial in trials] for name in names])
    others = [trial.number not in CHOSEN_ON for trial in trials]
    made = {}
    for i, (measure, text) in enumerate(MEASURES.items()):
        own = values[..., i]
        table = pd.DataFrame(own, names, list(map(column, trials)))
        table["mean, deg"] = own.mean(axis=1)
        if 0 < sum(others) < len(trials):
            table["mean of the others, deg"] = own[:, others].mean(axis=1)
        if measure == "orientation":
            table["time, us per sample"] = [
                float(np.median([of[name, trial.name].us for trial in trials])) for name in names
            ]
        made[measure] = (
            f"rms {text} during movement; * marks trials that strapdown's defaults were chosen on",
            table.rename_axis("estimator").reset_index(),
        )
    claimed = [name for name in names if np.isfinite(of[name, trials[0].name].over).any()]
    if claimed:
        over = lambda run: " ".join("–" if np.isnan(x) else f"{x:.2f}" for x in run.over)
        made["over-std"] = (
            "rms of the attitude error over its own standard deviation, about north, east and down, "
            "during movement",
            pd.DataFrame(
                [(name, *(over(of[name, trial.name]) for trial in trials)) for name in claimed],
                columns=["estimator", *(trial.number for trial in trials)],
            ),
        )
    return made


def column(trial: BroadTrial) -> str:
    """Heading of a trial's column: its number, a star where the defaults were chosen on it."""
    return f"{trial.number}{'*' if trial.number in CHOSEN_ON else ''}, deg"


def judge_orientation(table: pd.DataFrame, trials: Sequence[BroadTrial]) -> list[dict[str, Any]]:
    """The claims that the trials and estimators at hand can decide, from the table of
    orientation errors."""
    of = table.set_index("estimator")
    heads = {trial.number: column(trial) for trial in trials}
    found = []
    for name, which, bound in CLAIMS:
        asked = sorted((*CHOSEN_ON, *OTHERS)) if which == "mean" else [which]
        if name in of.index and set(asked) <= set(heads):
            value = float(of.loc[name, [heads[number] for number in asked]].mean(skipna=False))
            found.append(claim(claim_text(name, which), value, bound, "deg"))
    return found


def claim_text(name: str, which: str) -> str:
    """Return the text of a claim on an estimator; `which` is "mean" or the number of a trial."""
    return f"{name}: {'mean over the five trials of the rms' if which == 'mean' else f'trial {which}, rms'} orientation error during movement"


def _notes(
    quick: bool, made: Mapping[str, tuple[str, pd.DataFrame]]
) -> list[tuple[str, pd.DataFrame]]:
    """[(heading, DataFrame of text)]: what each estimator is, and the known figures of the
    peers, by which the scoring is checked."""
    table = made["orientation"][1].set_index("estimator")
    about = [
        *((name, "strapdown", filters.find(name).reference) for name in estimators()),
        *((peer.name, _state(peer, quick), peer.text) for peer in PEERS),
    ]
    numbers = lambda values, form: ", ".join(map(form.format, values))
    known = [
        (peer.name, numbers(peer.known, "{:g}"), numbers(_measure_peer(peer, table), "{:.3g}"))
        for peer in PEERS
        if len(_measure_peer(peer, table))
    ]
    columns = ["estimator", "package", "what it is, or how it is called"]
    checked = ["peer", "known, deg: per trial, or the mean", "measured here, deg"]
    return [
        ("Estimators", pd.DataFrame(about, columns=columns)),
        *[("The scoring, checked", pd.DataFrame(known, columns=checked)) for _ in known[:1]],
    ]


def _state(peer: Peer, quick: bool) -> str:
    """Text: which release of a peer runs here."""
    release = installed_version(peer.package)
    if not release:
        return f"{peer.package}: not installed"
    return f"{peer.package} {release}" + ", left out by --quick" * (quick and peer.slow)


def _measure_peer(peer: Peer, table: pd.DataFrame) -> list[float]:
    """Return the errors of a peer that correspond to its `known` figures, deg: on all five trials,
    or their mean; empty where one is missing."""
    five = (*CHOSEN_ON, *OTHERS)
    own = sorted(name for name in table.columns if name.rstrip("*, deg") in five)
    if not peer.known or peer.name not in table.index or len(own) < len(five):
        return []
    row = table.loc[peer.name, own].to_list()
    return row if len(peer.known) > 1 else [np.mean(row)]


STUDY = ReproducedStudy(
    "strapdown on the BROAD trials",
    INTRODUCTION,
    lambda found: judge_orientation(found.tables["orientation"][1], found.trials),
    lambda found: found.tables,
    texts=lambda found, claims, tables: {"table.md": in_docs(tables)},
)
