"""The library of compiled kernels."""

from typing import Any


def find(kernel: Any) -> int | None:
    """Address of a kernel."""
    return None
