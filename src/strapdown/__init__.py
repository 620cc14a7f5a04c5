"""strapdown: aided inertial navigation, from IMU, GNSS and other records to
position, velocity, attitude and biases with honest uncertainties.

    read, simulate, align             a Recording; an InitialState
    fuse, smooth, Stream              a Solution, with its Verdict
    errors, compare, report           how far off solutions are, and a page about it
    diagnose, calibrate, tune         what is wrong with a set-up
    Study, fly                        many runs; a filter that flies an aircraft

Functions and arrays have SI, radians and seconds, tables degrees. n is north,
east, down; b forward, right, down; C_nb and q_nb (scalar first) take b to n.
Errors are true less estimated. `help(strapdown.fuse)` has more, and dir(strapdown)
every name.
"""

import sys

import lazy_loader

from .data.operations import provide

__version__ = "0.2.0"
# the names in __init__.pyi: `import strapdown` costs nothing
__getattr__, _dir, __all__ = lazy_loader.attach_stub(__name__, __file__)


class _Names(list[str]):
    """The public names; `help(strapdown)` finds none of them in it, which would be 3600 lines."""

    def __contains__(self, name: object) -> bool:
        asks = sys._getframe(1).f_globals.get("__name__")
        return asks != "pydoc" and super().__contains__(name)


__all__ = _Names([*__all__, "__version__"])
# what values can do through rooms above them
provide(
    {
        "clean": f"{__name__}.preprocessing.fixes:clean_recording",
        "errors": f"{__name__}.evaluation.metrics:errors",
        "at": f"{__name__}.evaluation.other_instants:at",
        "protection": f"{__name__}.evaluation.protection:protection_levels",
        "save solution": f"{__name__}.io.solution:write_solution",
        "save recording": f"{__name__}.io:write_recording",
        "installation": f"{__name__}.installation.states:estimated_installation",
        "judge": f"{__name__}.verdict.judge:judge",
        "card": f"{__name__}.pages.notebook.cards:card_of",
        "figure": f"{__name__}.pages.notebook.plots:figure_of",
        "frame": f"{__name__}.pages.notebook.labelled:frame_of",
        "dataset": f"{__name__}.pages.notebook.labelled:dataset_of",
    }
)


def __dir__() -> list[str]:
    return sorted(__all__)
