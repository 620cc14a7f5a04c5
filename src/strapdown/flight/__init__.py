"""An aircraft flown by an autopilot on the estimates of a filter.

The names in `__init__.pyi` are public; `import strapdown.flight` costs nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
