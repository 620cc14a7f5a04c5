"""Shell completion of option values: names that the library knows, with a word on each. Heavy
imports inside functions, as everywhere here."""

from importlib.metadata import EntryPoint, entry_points

Offered = list[tuple[str, str]]
"""[(value, what it is)]."""


def filters(incomplete: str) -> Offered:
    """Filters, also the next one of a list with commas."""
    from ..filters import find, names

    return _after_comma(incomplete, [(name, find(name).good_for) for name in names()])


def attitude_filters() -> Offered:
    """Filters of attitude alone."""
    from ..filters import family, find, names

    return [(name, find(name).good_for) for name in names() if family(name) == "attitude"]


def kinds(incomplete: str) -> Offered:
    """Kinds of measurement, also the next one of a list with commas."""
    from ..aiding import names

    return _after_comma(incomplete, [(name, "") for name in names()])


def imus() -> Offered:
    """Grades of IMUs."""
    from ..sensor_models.imu import imu_parts, imus

    return [(name, "") for name in (*imus(), *imu_parts())]


def receivers() -> Offered:
    """Receivers that can be simulated."""
    from ..sensor_models.receiver import receivers

    return [(name, "") for name in receivers()]


def scenarios() -> Offered:
    """Built-in scenarios."""
    from ..sim.scenario import scenarios

    return [(name, "") for name in scenarios()]


def missions() -> Offered:
    """Kinds of flight that advice is given on."""
    from ..experiments.advice.mission import kinds

    return [(name, "") for name in kinds()]


def plans() -> Offered:
    """Built-in plans of a flight."""
    from ..flight.plan import PLANS

    return [(name, "") for name in PLANS]


def vehicles() -> Offered:
    """Vehicles whose bounds are known."""
    from ..data.vehicle import VEHICLES

    return [(name, "") for name in VEHICLES]


def targets() -> Offered:
    """Processors that filters are exported for."""
    from ..native.emit import TARGETS
    from ..native.export.folder import HOST

    return [(name, "") for name in (HOST, *TARGETS)]


def reproductions() -> Offered:
    """Reproductions that an installed package offers."""
    return [(name, "") for name in sorted(offered_commands())]


def offered_commands() -> dict[str, EntryPoint]:
    """{name: entry point} of the group `strapdown.reproductions`."""
    return {entry.name: entry for entry in entry_points(group="strapdown.reproductions")}


def _after_comma(incomplete: str, values: Offered) -> Offered:
    """The values behind what stands before the last comma."""
    begun = incomplete[: incomplete.rfind(",") + 1]
    return [(begun + value, text) for value, text in values]
