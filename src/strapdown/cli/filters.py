"""The command filters: what there is, by family, and all about one."""

import inspect
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from . import complete
from .output import fit_lines, layout, record, say, table, text_width

if TYPE_CHECKING:
    from ..core.loop.contract import Filter

NAMES = "position", "velocity", "attitude", "accelerometer bias", "gyro bias"
"""Names of the 15 error states, three components each."""
OF_PLUGINS = "Of plugins"
BIAS = (
    "bias: what becomes of the estimate of a bias between fixes; it decays with the time constant of "
    "the IMU, is held, or the bias is taken for a random walk."
)


def filters(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            autocompletion=complete.filters,
            help="The filter to tell all about.  [default: the list of all]",
        ),
    ] = None,
) -> None:
    """List the filters by family, with what each is good for and needs; or tell all about one: what
    it estimates, uses and can do, its options with their meaning, its source and its page."""
    from .. import filters

    if name is None:
        _list([filters.find(each) for each in filters.names()])
    else:
        _tell(filters.find(name))


def _list(found: "Sequence[Filter]") -> None:
    from ..filters import FAMILIES, family

    rows = [(each.name, each.good_for, ", ".join(needs(each))) for each in found]
    head, lines = layout(("filter", "good for", "needs"), rows)
    print("\n".join(head))
    for folder in (*FAMILIES, ""):
        own = [lines[i] for i, each in enumerate(found) if family(each.name) == folder]
        if own:
            say(f"\n{FAMILIES.get(folder, OF_PLUGINS)}")
            print("\n".join(line for each in own for line in each))
    say("\n`strapdown filters NAME` tells all about one.")
    record(
        filters=[
            {
                "name": each.name,
                "family": family(each.name),
                "good_for": each.good_for,
                "needs": needs(each),
            }
            for each in found
        ]
    )


def needs(filter: "Filter") -> list[str]:
    """Kinds of measurement without which a filter cannot run."""
    from ..engine.prepare import has_position

    own = ["position"] if has_position(filter) else []
    return list(dict.fromkeys([*own, *filter.needs]))


def _tell(filter: "Filter") -> None:
    from ..filters import FAMILIES, family

    own = family(filter.name)

    def yes(holds: object) -> str:
        return "yes" if holds else "no"

    facts = {
        "good for": filter.good_for,
        "not for": filter.poor_for,
        "family": FAMILIES.get(own, OF_PLUGINS),
        "estimates": ", ".join(_states(filter.estimates)),
        "without std": ", ".join(_states(set(filter.estimates) - set(filter.states))),
        "needs": ", ".join(needs(filter)),
        "uses": "all kinds of measurement" if filter.uses is None else ", ".join(filter.uses),
        "own columns": ", ".join(filter.columns),
        "smoothed": yes(filter.smoother),
        "robust and adaptive sources": yes(filter.weighs),
        "installation as states": yes(filter.installation),
        "eight runs at once in studies": yes(filter.lanes),
        "source": filter.reference,
        "page of the documentation": filter.name if own else "",
    }
    say(filter.name)
    for fact, text in facts.items():
        if text:
            say("\n".join(fit_lines(f"{fact}: {text}", text_width(), "  ", "    ")))
    say()
    table(("option", "default"), [(each, default) for each, default in filter.options.items()])
    for text in _meaning(filter):
        say("\n" + "\n".join(fit_lines(text, text_width())))
    record(name=filter.name, facts=facts, options=filter.options)


def _states(indices: Iterable[int]) -> list[str]:
    """The error states of these indices in words: "position", "height", "roll, pitch"."""
    components = [("north", "east", "down")] * 2 + [("roll", "pitch", "heading")]
    components += [("x", "y", "z")] * 2
    found = []
    for i, name in enumerate(NAMES):
        there = [part for k, part in enumerate(components[i]) if 3 * i + k in set(indices)]
        if len(there) == 3:
            found.append(name)
        elif there:
            found.append(f"{name} {' '.join(there)}")
    return found


def _meaning(filter: "Filter") -> list[str]:
    """Paragraphs on the options, as `start` has them."""
    told = (inspect.getdoc(filter.start) or "").removeprefix("Belief at `start`.")
    paragraphs = [" ".join(each.split()) for each in told.split("\n\n")]
    return [each for each in paragraphs if each] + [BIAS] * bool(filter.bias)
