"""Figures of solutions, and the page that shows them: `strapdown.report(solution).save("report.html")`."""
import sys
from types import ModuleType


class _Callable(ModuleType):
    """`strapdown.report` is this package, and by its public name the function too: importing a part of the package would put the
    module in the function's place, so the module answers the call."""

    def __call__(self, solutions, reference=None, title=None, window=None):
        from .page import report
        return report(solutions, reference, title, window)


sys.modules[__name__].__class__ = _Callable
