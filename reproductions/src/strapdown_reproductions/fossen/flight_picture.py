"""The tilt error of the attitude observer on the recorded flight as a picture for the
documentation."""

from html import escape

import pandas as pd

from strapdown.pages.drawing import COLOURS

from .statements import RECORDED, flight_rms

PICTURE = "fossen-flight.svg"
NAMES = {"gravity": "gravity alone", "gnss": "GNSS velocity"}
"""{reference vector: its name}."""
WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 760, 280, 52, 40, 30
"""px: of the picture, and beside, below and above its lines."""
MAX_TILT = 30.0
"""deg: at the top."""


def draw_flight(flown: pd.DataFrame) -> str:
    """SVG of both lines over time, of the table of statements.flight."""
    rms = flight_rms(flown)
    parts = [_text(x_of(t), HEIGHT - 22, f"{t:g}", "middle") for t in range(200, 601, 50)]
    parts.append(_text(x_of(400), HEIGHT - 6, "time [s]", "middle"))
    for tilt in range(0, int(MAX_TILT) + 1, 10):
        y = y_of(tilt)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - 10}" stroke="#dddddd"/>')
        parts.append(_text(LEFT - 6, y + 4, f"{tilt}°", "end"))
    for k, ((name, text), colour) in enumerate(zip(NAMES.items(), COLOURS)):
        points = " ".join(
            f"{x_of(t):.1f},{y_of(tilt):.1f}"
            for t, tilt in zip(flown["second"], flown[f"{name}_deg"])
        )
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        )
        said = f"reference by {text}: {rms[name]:.2g}° rms"
        parts.append(_text(LEFT + 8 + 330 * k, 18, said, "start", colour))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" font-family="system-ui,sans-serif" font-size="12">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>{"".join(parts)}</svg>\n'
    )


def x_of(t: float) -> float:
    """px of a time, s."""
    return LEFT + (WIDTH - 10 - LEFT) * (t - RECORDED[0]) / (RECORDED[1] - RECORDED[0])


def y_of(tilt: float) -> float:
    """px of a tilt, deg."""
    return HEIGHT - BELOW - (HEIGHT - BELOW - ABOVE) * min(tilt, MAX_TILT) / MAX_TILT


def _text(x: float, y: float, text: str, anchor: str, fill: str = "#222222") -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}">{escape(text)}</text>'
    )
