"""Numbers, counts, lengths of time and lists as people write them."""

import math
from collections.abc import Sequence


def count_text(count: int, noun: str, plural: str = "s") -> str:
    """`1 row`, `2 rows`, or with the ending of another plural `2 fixes`."""
    return f"{count} {noun}{'' if count == 1 else plural}"


def number(value: float | None) -> str:
    """Three digits, or as many as stand before the point; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:#.3g}".rstrip(".") if abs(value) >= 1e-4 or value == 0 else f"{value:.2e}"


def short(value: float) -> str:
    """Three digits less zeros at the end, or as many as stand before the point."""
    return f"{value:.0f}" if 999.5 <= abs(value) < 1e7 else f"{value:.3g}"


def join_words(words: Sequence[str]) -> str:
    """`a, b and c`."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def metres(value: float) -> str:
    """`12.3 m`, `4.56 km`."""
    return f"{value / 1000:.3g} km" if value >= 1000 else f"{value:.3g} m"


def duration_text(seconds: float) -> str:
    """`12.3 s`, `10 min 5 s`, `23 h 5 min`."""
    if seconds < 120:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    parts = [f"{hours} h", f"{minutes} min"] if hours else [f"{minutes} min", f"{rest} s"]
    return " ".join(part for part in parts if not part.startswith("0 "))


def capitalise(text: str) -> str:
    """The text with a capital; all else of it stays."""
    return text[:1].upper() + text[1:]
