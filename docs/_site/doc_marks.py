"""Text that a command writes, between two marks of a page."""

import re


def filled(page: str, name: str, command: str, text: str) -> str:
    """A page with `text` between the marks of `name`."""
    begin, end = f"<!-- begin: {name} of {command} -->", "<!-- end -->"
    pattern = rf"{re.escape(begin)}\n.*?{re.escape(end)}"
    if not re.search(pattern, page, re.DOTALL):
        raise ValueError(f"no marks of {name!r}: {begin} ... {end}")
    return re.sub(pattern, lambda _: f"{begin}\n{text}{end}", page, count=1, flags=re.DOTALL)
