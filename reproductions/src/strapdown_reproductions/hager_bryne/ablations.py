"""Effect of changing one thing of the study: biases' place, printed equations, gravity, resets, the
update of the open loop.

Each variant runs on the same draws as what it is compared with. Tactical grade.
"""

from collections.abc import Iterable
from typing import Any

import pandas as pd

from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sim.scenario import Scenario, scenario

from ..common.verdicts import NONE, UNKNOWN, better, interval
from . import printed_updates
from .cells import Part, compare_filters, numbers_of, rows_of, stack_parts

OPEN, CLOSED = "open-loop:kinematics=geodetic", "closed-loop-error-bias"
"""The two filters of the paper: its error state is in latitude, longitude and height."""
FLIGHTS = ("01", "07", "10")
INTERVALS = (1, 10, 60, 300, 1200)
"""s between resets."""
MODELS = ("printed-signs", "literal", "no-gradient")


def variant(loop: str, **options: str | float) -> str:
    """The label of a filter with further options."""
    name, _, rest = loop.partition(":")
    return f"{name}:{','.join(filter(None, [rest, *(f'{key}={value}' for key, value in options.items())]))}"


PAIRS = {
    "bias": (
        "The bias inside the INS (closed-loop) against the bias in the error state "
        "(closed-loop-error-bias).",
        [("closed-loop", CLOSED)],
    ),
    "printed": (
        "Table II as printed, in part and whole, against the corrected error model.",
        [
            (variant(loop, error_model=model), loop)
            for model in MODELS[:2]
            for loop in (OPEN, CLOSED)
        ],
    ),
    "update": (
        "The open loop with the update (15) as printed, without prior, against the one that keeps "
        "it. What an open loop forgets at each fix is the whole drift of its INS.",
        [(f"{printed_updates.OPEN_LOOP.name}:kinematics=geodetic", OPEN)],
    ),
    "gradient": (
        "The error model without the gravity gradient, as printed, against the corrected one; "
        "gravity itself depends on height.",
        [(variant(loop, error_model="no-gradient"), loop) for loop in (OPEN, CLOSED)],
    ),
    "kinematics": (
        "The position error of the open loop propagated linearly in metres, and exactly to second "
        "order, against linearly in "
        "latitude, longitude and height as in the paper.",
        [("open-loop:kinematics=metres", OPEN), ("open-loop", OPEN)],
    ),
    "resets": (
        "Periodic resets, from nearly a closed loop to nearly an open one, against the closed loop; "
        "the last row is the open loop.",
        [
            *(
                (f"periodic-reset:kinematics=geodetic,interval={interval}", CLOSED)
                for interval in INTERVALS
            ),
            (OPEN, CLOSED),
        ],
    ),
}
"""Ablations within one campaign: name, and pairs of a variant and its comparison."""
CAPTIONS = {name: text for name, (text, _) in PAIRS.items()} | {
    "gravity": "Gravity that depends on latitude alone, in truth, INS and error model, against "
    "gravity that falls with height.",
    "wide": "Offset of 0.5 m/s^2 with a start that allows for it, 0.5 m/s^2 instead of 0.1: the "
    "open loop against the closed loop; compare with the rows of tactical grade in the table of "
    "flights with offset.",
}
"""{table: compared pairs}."""
COMPARISONS = (
    *(
        (name, ("filters", one), ("filters", other))
        for name, (_, pairs) in PAIRS.items()
        for one, other in pairs
    ),
    *(
        ("gravity", ("gravity", variant(loop, error_model="latitude-gravity")), ("filters", loop))
        for loop in (OPEN, CLOSED)
    ),
    ("wide", ("wide", OPEN), ("wide", CLOSED)),
)
"""(table, (campaign, filter), (campaign, filter) that it is compared with)."""
COLUMNS = {"position_500": "position RMSE", "heading_500": "heading RMSE"}


def studies(
    scenarios: Iterable[str | Scenario],
    runs: int,
    seed: int,
    imu: str | ImuSpec = "paper1-tactical",
    offset: tuple[float, float, float] = (0.5, 0.5, 0.5),
) -> dict[str, Study]:
    """{name: Study} of all ablations on Scenario values or names; `offset` in m/s^2."""
    printed_updates.make_known()
    known = [scenario(name) for name in scenarios]
    labels = tuple(
        dict.fromkeys(
            label for _, pairs in PAIRS.values() for pair in pairs for label in (*pair[::-1],)
        )
    )
    wide = lambda s: s.replace(
        name=f"{s.name}-offset",
        accel_offset=offset,
        start_std=(*s.start_std[:9], *map(abs, offset), *s.start_std[12:]),
    )
    return {
        "filters": Study(
            tuple(known), tuple(dict.fromkeys((OPEN, CLOSED, *labels))), (imu,), runs, seed
        ),
        "gravity": Study(
            tuple(s.replace(gravity="latitude") for s in known),
            tuple(variant(loop, error_model="latitude-gravity") for loop in (OPEN, CLOSED)),
            (imu,),
            runs,
            seed,
        ),
        "wide": Study(tuple(map(wide, known)), (OPEN, CLOSED), (imu,), runs, seed),
    }


def tables(
    campaigns: dict[str, Campaign],
) -> tuple[dict[str, tuple[str, pd.DataFrame]], pd.DataFrame, pd.DataFrame]:
    """({name: (caption with its sentence, DataFrame)}, rows of the resets and of the bias in the
    INS for the claims) of the campaigns of `studies`."""
    found: dict[str, list[dict[str, float | str]]] = {name: [] for name in CAPTIONS}
    for number in range(len(campaigns["filters"].cells)):
        parts = {
            (name, label): part
            for name, campaign in campaigns.items()
            for label, part in _parts(campaign, number).items()
        }
        for name, first, second in COMPARISONS:
            described = campaigns[second[0]].manifest["cells"][number]["scenario"]
            label = first[1] if first[1] != second[1] else f"{first[1]} ({name})"
            found[name].append(_row(described, label, second[1], parts[first], parts[second]))
    frames = {name: pd.DataFrame(rows) for name, rows in found.items()}
    resets = frames["resets"][frames["resets"]["variant"].str.startswith("periodic-reset")]
    intervals = [float(label.rpartition("=")[2]) for label in resets["variant"]]
    names = {f"position_both{end}": f"position{end}" for end in ("", "_low", "_high")}
    shown = {
        f"ablation-{name}": (f"{CAPTIONS[name]} {sentence(frame)}", readable(frame))
        for name, frame in frames.items()
    }
    return shown, resets.assign(interval_s=intervals).rename(columns=names), frames["bias"]


def _parts(campaign: Campaign, number: int) -> dict[str, Part]:
    """{filter: (numbers, Rows, place)} of a cell."""
    cell = campaign.cells[number]
    numbers, ran = numbers_of(campaign, cell)
    rows = rows_of(campaign, cell, numbers, ran)
    return {name: (numbers, rows, place) for place, name in enumerate(campaign.manifest["filters"])}


def _row(
    described: dict[str, Any], label: str, other: str, first: Part, second: Part
) -> dict[str, float | str]:
    """Return the row that compares a variant with another filter on the runs of a cell, whose
    scenario is described."""
    c = compare_filters(*stack_parts(first, second))
    keys = ("survived", "censored_500_m", "anees", "anees_low", "anees_high")
    return {
        "flight": described["name"].removeprefix("paper1-"),
        "minutes": described["duration_s"] / 60,
        "variant": label,
        "against": other,
        **{f"survived{end}": c[f"open_survived{end}"] for end in ("_low", "_high", "_500")},
        **{key: c[f"open_{key}"] for key in keys},
        **{f"other_{key}": c[f"closed_{key}"] for key in keys},
        **{
            f"{name}{end}": c[f"{name}{end}"]
            for name in ("position_both", "position_500", "heading_500")
            for end in ("", "_low", "_high")
        },
    }


def readable(frame: pd.DataFrame) -> pd.DataFrame:
    """The table for people: intervals in brackets."""
    plain = lambda r, name: f"{r[name]:.3g} ({r[f'{name}_low']:.3g} to {r[f'{name}_high']:.3g})"
    return pd.DataFrame(
        [
            {
                "flight": r["flight"],
                "variant": r["variant"],
                "against": r["against"],
                **{text: interval(r, name) for name, text in COLUMNS.items()},
                "NEES/15": plain(r, "anees"),
                "NEES/15 of the other": plain(r, "other_anees"),
                "survived": r["survived"],
                "other survived": r["other_survived"],
                "position RMSE, m": r["censored_500_m"],
                "other, m": r["other_censored_500_m"],
            }
            for _, r in frame.iterrows()
        ]
    )


def sentence(frame: pd.DataFrame) -> str:
    """Return a sentence on the differences that the intervals of the table resolve."""
    parts = []
    for name, text in COLUMNS.items():
        found = [better(row, name) for _, row in frame.iterrows()]
        rows = frame[[side not in (NONE, UNKNOWN) for side in found]]
        changed = sorted(
            (
                (row[name] - 1, f"{row['variant']} on {row['flight']} by {row[name] - 1:+.0%}")
                for _, row in rows.iterrows()
            ),
            key=lambda change: -abs(round(change[0], 2)),
        )
        most = "; ".join(said for _, said in changed[:3]) + ", ..." * (len(changed) > 3)
        parts.append(
            f"{text} changes beyond 1 % in {len(changed)} of {len(found)} rows"
            f"{most and f' ({most})'}, does not in {found.count(NONE)}, and "
            f"{found.count(UNKNOWN)} are not resolved"
        )
    apart = (
        (frame["anees_low"] > frame["other_anees_high"])
        | (frame["anees_high"] < frame["other_anees_low"])
    ).sum()
    survival = (frame["survived"] != frame["other_survived"]).sum()
    said = f"{'; '.join(parts)}; the intervals of NEES/15 are apart in {apart}; survival differs in {survival}."
    return said[0].upper() + said[1:]
