"""The recorded flights and drives of examples/recordings, fused and scored: `strapdown reproduce
recordings`.

thor75 is compared with the solution computed on board over the time in which that one has
converged; drive0708 is scored in nine outages of 15 s; the ring-laser record gives the Earth's rate
and a heading from it.
"""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from strapdown import io
from strapdown.alignment.static_attitude import Gyrocompass, gyrocompass
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.core.mathematics.earth import RATE
from strapdown.data.recording import Recording
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors, outages, rms
from strapdown.fileio.files import together
from strapdown.io.locate import data_folder
from strapdown.pages.page import report
from strapdown.preprocessing.stationary import motionless
from strapdown.typing import Ints, Notify, Progress

from ..common import markdown
from ..common.example_recordings import DESCRIPTIONS, FLIGHT, windows_of
from ..common.pages import ReproductionPage, write_page
from ..common.reproduction import Asked, reproduction
from ..common.targets import claim
from . import calibrated_compass, drift, table as recordings_table
from .cases import LASER, cases

FILTERS = ("closed-loop", "open-loop")
DRIVES = {
    "drive0708": ("GNSS alone", 5.5),
    "drive0708-vehicle": ("with the vehicle's constraints", 1.8),
}
"""Description, what it adds, and the bound on the median of the largest horizontal errors, m."""
FLIGHT_CLAIMS = (
    ("roll", 0.4, "deg"),
    ("pitch", 0.4, "deg"),
    ("heading", 2.0, "deg"),
    ("position N", 0.5, "m"),
    ("position E", 0.5, "m"),
    ("position D", 0.5, "m"),
)
"""Rms difference of the closed loop on thor75, and the bound on it."""
DEG_H = np.degrees(3600.0)
"""deg/h in a rad/s."""
LASER_HEADING, LASER_BOUNDS = 88.0, (0.1, 0.5, 3.0)
"""Heading of the parked vehicle (deg) as the data folder states it, and bounds on the
differences in vertical and horizontal rate (deg/h) and heading (deg). They are set by the
vehicle: it tilts by up to 0.15 deg during the record, a mean rate of 0.3 deg/h about a
horizontal axis, which is 1.3 deg of heading; twice that and a little is allowed, and of the
vertical axis, about which springs do not turn it, a fifth."""
INTRODUCTION = (
    "Real recordings, fused from raw IMU and GNSS as examples/recordings describes them, with the "
    "closed loop, and with the open loop beside it.",
    "thor75 is a fixed-wing UAV with a MEMS IMU at 50 Hz and GPS at 1 Hz. Its reference is the "
    "solution of the autopilot on board: another filter "
    "on the same sensors, no independent truth. Its own accelerometer bias y still moves from -0.33 "
    "m/s^2 at 227 s to -0.44 at 527 s, "
    "worth 0.6 deg of roll, and most of the difference lies in its first half minute; the table "
    "shows the same errors over later windows too.",
    "drive0708 is a car in hills with a MEMS IMU at 100 Hz and RTK GNSS at 4 Hz. Fixes are withheld "
    "for 15 s every 50 s, nine times, from 60 s after "
    "the car first reaches 4 m/s; the error is the largest horizontal distance from the RTK "
    "solution within each outage.",
)
LASER_INTRODUCTION = (
    "lasergyro is a ring-laser IMU in a parked vehicle, 1847 s at 100 Hz. Its mean rate, levelled "
    "by its mean specific force, is the Earth's: the "
    "vertical part tells the latitude, the direction of the horizontal part the heading. The "
    "vehicle vibrates and rocks; the table shows ten "
    "parts of the record beside the whole. The stated deviation of heading is that of the scatter "
    "of such parts.",
)
NO_LASER = (
    "The ring-laser record is not in the data folder, so that there is no word on the Earth's rate "
    "here.",
)


@reproduction("recordings", "notify", "progress")
@together()
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Fuse and score the recordings, write the page into the folder `out`, return the claims.
    Raises DataError."""
    folder = Path(asked.recordings or DESCRIPTIONS)
    if not (folder / "thor75.toml").exists():
        raise DataError(
            f"{folder}: no thor75.toml there; give the folder of the descriptions "
            f"(examples/recordings of the source tree)"
        )
    claims, tables, links = score_recordings(folder, out, asked.notify)
    every, shown = every_filter(folder, asked.notify, asked.progress)
    introduction = (
        INTRODUCTION
        + calibrated_compass.INTRODUCTION
        + (LASER_INTRODUCTION if "lasergyro" in tables else NO_LASER)
        + recordings_table.INTRODUCTION
    )
    page = ReproductionPage(
        "strapdown on recorded data",
        introduction,
        claims,
        tables | every,
        links,
        notes=shown,
        texts={"table.md": in_docs(shown)},
    )
    write_page(out, page)
    return claims


def score_recordings(
    folder: Path, out: Path, notify: Notify | None = None
) -> tuple[list[dict[str, Any]], dict[str, tuple[str | None, pd.DataFrame]], list[tuple[str, str]]]:
    """(claims, {name: (caption, DataFrame)}, links) of flight, drive, magnetometer and ring laser;
    the pages of their solutions go into the folder `out`. Raises DataError."""
    flight, flight_claims, flight_links = _flight(folder, out, notify)
    drive, summary, drive_claims, drive_links = _drive(folder, out, notify)
    magnetic, magnetic_claims = calibrated_compass.magnetometer(folder, FLIGHT, notify)
    laser, laser_claims = _laser(folder)
    tables = {
        "thor75": ("thor75: rms difference from the solution on board", flight),
        "drive0708-summary": ("drive0708: largest horizontal error in the nine outages", summary),
        "drive0708": ("drive0708: every outage", drive),
        **magnetic,
    }
    if laser is not None:
        tables["lasergyro"] = ("lasergyro: the Earth's rate and the heading from it", laser)
    claims = flight_claims + drive_claims + magnetic_claims + laser_claims
    return claims, tables, flight_links + drive_links


def in_docs(shown: Sequence[tuple[str, pd.DataFrame]]) -> str:
    """Markdown of [(heading, DataFrame of text)]."""
    return markdown.tables((f"### {heading}", table) for heading, table in shown)


def every_filter(
    folder: Path, notify: Notify | None, progress: Progress | None = None
) -> tuple[dict[str, tuple[None, pd.DataFrame]], list[tuple[str, pd.DataFrame]]]:
    """Every filter on every recording, and dead reckoning: ({name: (caption, DataFrame)},
    [(heading, DataFrame of text)])."""
    found = cases(folder)
    scores = recordings_table.scores(found, notify=notify, progress=progress)
    apart = drift.outage_scores(found[0].recording, found[1].recording, notify=notify)
    summary = drift.summary(apart)
    shown = [
        (recordings_table.EVERY, recordings_table.wide(scores)),
        (drift.HEADING, drift.text_table(summary)),
    ]
    if scores["held"].any():
        shown.append((recordings_table.TRIALS, recordings_table.by_trial(scores)))
    return {
        "every-filter": (None, scores.drop(columns="held")),
        "dead-reckoning": (None, summary),
        "dead-reckoning-outages": (None, apart),
    }, shown


def _flight(
    folder: Path, out: Path, notify: Notify | None
) -> tuple[pd.DataFrame, list[dict[str, Any]], list[tuple[str, str]]]:
    recording = io.read(folder / "thor75.toml")
    solutions = {name: fuse(recording, name, notify=notify) for name in FILTERS}
    rows = []
    for (name, solution), start in product(solutions.items(), (FLIGHT[0], 270.0, 300.0)):
        r = rms(errors(solution, recording.reference), (start, FLIGHT[1]))
        about = (name, f"{start:.0f}-{FLIGHT[1]:.0f}")
        rows.append((*about, *r.position, *r.velocity, *np.degrees(r.rph)))
    vectors = [
        f"{quantity} {axis}, {unit}"
        for quantity, unit in (("position", "m"), ("velocity", "m/s"))
        for axis in "NED"
    ]
    table = pd.DataFrame(
        rows, columns=["filter", "window, s", *vectors, "roll, deg", "pitch, deg", "heading, deg"]
    )
    report(
        solutions, recording.reference, title="thor75: closed and open loop", window=FLIGHT
    ).save(out / "thor75.html")
    claims = [
        claim(f"thor75 closed loop, {name} rms", table.iloc[0][f"{name}, {unit}"], bound, unit)
        for name, bound, unit in FLIGHT_CLAIMS
    ]
    return table, claims, [("thor75: closed and open loop", "thor75.html")]


def _drive(
    folder: Path, out: Path, notify: Notify | None
) -> tuple[pd.DataFrame, pd.DataFrame, list[dict[str, Any]], list[tuple[str, str]]]:
    rows, links = [], []
    for description, (text, _) in DRIVES.items():
        recording = io.read(folder / f"{description}.toml")
        windows = windows_of(recording)
        solutions = {name: fuse(recording.hidden(windows), name, notify=notify) for name in FILTERS}
        rows += [
            (description, name, s.start, s.stop, s.horizontal_max, s.horizontal_end, s.down_max)
            for name, solution in solutions.items()
            for s in outages(solution, recording.reference, windows)
        ]
        title = f"{description}: nine outages of 15 s"
        report(solutions, recording.reference, title=title).save(out / f"{description}.html")
        links.append((f"{title}, {text}", f"{description}.html"))
    table = pd.DataFrame(rows, columns=drift.EACH[:-1])
    by_filter = table.groupby(["recording", "filter"], sort=False)
    largest, end = by_filter["largest horizontal, m"], by_filter["horizontal at the end, m"]
    summary = pd.DataFrame(
        {
            "median, m": largest.median(),
            "largest, m": largest.max(),
            "median at the end, m": end.median(),
        }
    )
    claims = [
        claim(
            f"drive0708 closed loop, {text}: median of the largest horizontal error in nine 15 s "
            "outages",
            summary.loc[(description, "closed-loop"), "median, m"],
            bound,
            "m",
        )
        for description, (text, bound) in DRIVES.items()
    ]
    return table, summary.reset_index(), claims, links


def _laser(folder: Path) -> tuple[pd.DataFrame | None, list[dict[str, Any]]]:
    """(table, claims) of the ring-laser record; (None, []) where the data folder lacks it."""
    path = data_folder(folder).joinpath(*LASER)
    if not path.exists():
        return None, []
    return earth_rate(io.read(path))


def earth_rate(recording: Recording) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """(table, claims): the Earth's rate in the record of a parked ring-laser IMU whose header
    names its latitude, and the heading from it."""
    imu, latitude = recording.imu, recording.meta["position"][0]
    whole, ten = np.arange(len(imu.t)), np.array_split(np.arange(len(imu.t)), 10)
    found = [_compass(imu, rows) for rows in (whole, *ten)]
    still = motionless(imu, recording.span[0])
    stated = (
        np.degrees(gyrocompass(still.rate, still.force, still.rate_std, still.tilt_std).heading_std)
        if still
        else np.nan
    )
    rows = [
        (
            f"{imu.t[rows[0]]:.0f}-{imu.t[rows[-1]]:.0f}",
            each.vertical * DEG_H,
            each.horizontal * DEG_H,
            each.total * DEG_H,
            np.degrees(each.latitude),
            *np.degrees(each.rph),
            np.nan,
        )
        for rows, each in zip((whole, *ten), found)
    ]
    rows[0] = (*rows[0][:-1], stated)
    rows.append(
        (
            "the Earth's",
            RATE * np.sin(latitude) * DEG_H,
            RATE * np.cos(latitude) * DEG_H,
            RATE * DEG_H,
            np.degrees(latitude),
            *[np.nan] * 4,
        )
    )
    table = pd.DataFrame(
        rows,
        columns=[
            "seconds",
            "vertical rate, deg/h",
            "horizontal rate, deg/h",
            "rate, deg/h",
            "latitude by it, deg",
            "roll, deg",
            "pitch, deg",
            "heading, deg",
            "stated deviation of heading, deg",
        ],
    )
    _, vertical, horizontal, _, _, _, _, heading, _ = rows[0]
    off = (heading - LASER_HEADING + 180) % 360 - 180
    return table, [
        claim(f"lasergyro: {name}", abs(figure), bound, unit)
        for name, figure, bound, unit in zip(
            (
                f"measured vertical Earth rate {vertical:.2f} deg/h, distance from "
                f"{rows[-1][1]:.2f}",
                f"measured horizontal Earth rate {horizontal:.2f} deg/h, distance from "
                f"{rows[-1][2]:.2f}",
                f"gyrocompass heading {heading:.1f} deg, distance from {LASER_HEADING:g}",
            ),
            (vertical - rows[-1][1], horizontal - rows[-1][2], off),
            LASER_BOUNDS,
            ("deg/h", "deg/h", "deg"),
        )
    ]


def _compass(imu: Imu, rows: Ints) -> Gyrocompass:
    """The Gyrocompass of the mean rate and specific force of these samples."""
    seconds = imu.dt[rows].sum()
    return gyrocompass(imu.dtheta[rows].sum(axis=0) / seconds, imu.dv[rows].sum(axis=0) / seconds)
