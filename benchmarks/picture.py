"""The picture of README.md: the demo flight with a GNSS outage, fused and smoothed, with what the
filter said of itself. Writes docs/pictures/outage.svg, or with --check ends with 1 where that is
another.

Same seed, same numbers, so that the file changes only where results do.
"""

import sys
from html import escape
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.geometry.geodesy import displacement
from strapdown.sim.trajectory import demo_flight

FILE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "outage.svg"
SECONDS, OUTAGE, SEED, GRADE = 420.0, (240.0, 285.0), 7, "consumer"
SHOWN = 215.0, 310.0
"""s: of the track and the errors."""
INK, GREY, GRID = "#1f2933", "#6b7785", "#e4e8ec"
FILTERED, SMOOTHED, FIX, TRUTH, LOST = "#0072b2", "#d55e00", "#009e73", "#1f2933", "#fbe3cf"
"""Colours that the colour-blind tell apart (Okabe and Ito)."""
WIDE, HIGH = 960, 440
PLAN = 62, 58, 400, 328
"""px: left, top, width, height of the plan."""
ERRORS = (560, 62, 376, 136), (560, 246, 376, 136)


def runs():
    """(recording with the outage, closed loop, smoothed)."""
    whole = sd.simulate(demo_flight(), SECONDS, GRADE, SEED)
    seen = whole.hidden([OUTAGE])
    return seen, sd.fuse(seen, every=50), sd.smooth(seen, every=50)


def drawn():
    """The SVG."""
    recording, filtered, smoothed = runs()
    parts = [
        _text(PLAN[0], 30, "45 seconds without GNSS", size=17, weight=600),
        _text(ERRORS[0][0], 30, "Errors, and the 3σ that was claimed", size=17, weight=600),
        *_plan(recording, filtered, smoothed),
    ]
    names = ("position error east, m", "heading error, deg")
    for frame, name, pick in zip(ERRORS, names, (_east, _heading)):
        parts += _errors(frame, name, pick, recording.reference, (filtered, smoothed))
    left, top, _, high = ERRORS[1]
    parts.append(_text(left + ERRORS[1][2] / 2, top + high + 36, "time, s", GREY, "middle"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {HIGH}" width="{WIDE}" '
        f'height="{HIGH}" font-family="system-ui,sans-serif" font-size="13" role="img">'
        "<title>A flight with 45 seconds without GNSS: the track in plan, and the errors of position "
        "and heading inside the three standard deviations that the filter claims</title>"
        f'<rect width="100%" height="100%" rx="10" fill="#ffffff"/>{"".join(parts)}</svg>\n'
    )


def _plan(recording, filtered, smoothed):
    origin = recording.reference.lla[:1]
    places = lambda lla: displacement(lla, np.broadcast_to(origin, lla.shape))[:, 1::-1] / 1000
    (fixes,) = (places(a.y[_in(SHOWN, a.t)]) for a in recording.sources if a.kind == "position")
    tracks = {"closed-loop": filtered, "smoothed": smoothed}
    reference = recording.reference
    truth = places(reference.lla[_in(SHOWN, reference.t)][::20])
    low, span = truth.min(0), np.ptp(truth, 0)
    scale = min(PLAN[2] / span[0], PLAN[3] / span[1])
    middle = low + span / 2
    at = lambda p: np.column_stack(
        [
            PLAN[0] + PLAN[2] / 2 + (p[:, 0] - middle[0]) * scale,
            PLAN[1] + PLAN[3] / 2 - (p[:, 1] - middle[1]) * scale,
        ]
    )
    parts = [_line(at(places(reference.lla[_in(OUTAGE, reference.t)][::20])), LOST, 16)]
    parts += _ellipses(filtered, at(places(filtered.trajectory.lla)), scale)
    parts += [_circle(x, y) for x, y in at(fixes)]
    for solution, colour in zip(tracks.values(), (FILTERED, SMOOTHED)):
        shown = _in(SHOWN, solution.t)
        parts.append(_line(at(places(solution.trajectory.lla[shown])), colour, 2.2))
    parts.append(_line(at(truth), TRUTH, 1.3, "5 4"))
    legend = [
        (FILTERED, "closed-loop"),
        (SMOOTHED, "smoothed"),
        (TRUTH, "truth"),
        (FIX, "GNSS fixes"),
        (LOST, "outage"),
    ]
    x = PLAN[0]
    for colour, name in legend:
        parts.append(
            f'<rect x="{x}" y="{HIGH - 32}" width="14" height="10" rx="2" fill="{colour}"/>'
        )
        parts.append(_text(x + 19, HIGH - 23, name))
        x += 32 + 7.6 * len(name)
    length = _tick(span.max() / 3)
    y = PLAN[1] + 6
    parts.append(_line(np.array([[PLAN[0], y], [PLAN[0] + length * scale, y]]), INK, 2))
    parts.append(_text(PLAN[0], y + 18, f"{1000 * length:g} m", GREY))
    return parts


def _errors(frame, name, pick, truth, solutions):
    left, top, wide, high = frame
    found = []
    for solution in solutions:
        error, deviation = pick(sd.errors(solution, truth), solution)
        shown = _in(SHOWN, solution.t)
        found.append((solution.t[shown], error[shown], 3 * deviation[shown]))
    tick = _tick(max(band.max() for _, _, band in found))
    limit = 1.05 * max(tick, *(band.max() for _, _, band in found))
    x = lambda t: left + (t - SHOWN[0]) / (SHOWN[1] - SHOWN[0]) * wide
    y = lambda e: top + high / 2 * (1 - e / limit)
    parts = [
        f'<rect x="{x(OUTAGE[0]):.1f}" y="{top}" width="{x(OUTAGE[1]) - x(OUTAGE[0]):.1f}" '
        f'height="{high}" fill="{LOST}"/>',
        _text(left, top - 8, name, GREY),
    ]
    for value in (-tick, 0.0, tick):
        parts.append(_line(np.array([[left, y(value)], [left + wide, y(value)]]), GRID, 1))
        parts.append(_text(left - 7, y(value) + 4, f"{value:g}".replace("-", "−"), GREY, "end"))
    for t in np.arange(20 * np.ceil(SHOWN[0] / 20), SHOWN[1], 20):
        parts.append(_text(x(t), top + high + 17, f"{t:g}", GREY, "middle"))
    for (t, error, band), colour in zip(found, (FILTERED, SMOOTHED)):
        edge = np.column_stack([np.r_[x(t), x(t)[::-1]], np.r_[y(band), y(-band[::-1])]])
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in edge)
        parts.append(f'<polygon points="{points}" fill="{colour}" fill-opacity="0.16"/>')
        parts.append(_line(np.column_stack([x(t), y(error)]), colour, 1.8))
    return parts


def _ellipses(solution, points, scale):
    """What the filter claims of its place, three standard deviations east and north, each 5 s."""
    found = []
    for t in np.arange(OUTAGE[0] + 5, OUTAGE[1] + 0.1, 5):
        i = int(np.argmin(np.abs(solution.t - t)))
        north, east = 3 * solution.trajectory.std[i, :2] / 1000 * scale
        x, y = points[i]
        found.append(
            f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{east:.1f}" ry="{north:.1f}" '
            f'fill="{FILTERED}" fill-opacity="0.10" stroke="{FILTERED}" stroke-opacity="0.35"/>'
        )
    return found


def _in(window, t):
    return (t >= window[0]) & (t <= window[1])


def _east(errors, solution):
    return errors.position[:, 1], solution.trajectory.std[:, 1]


def _heading(errors, solution):
    return np.degrees(errors.rph[:, 2]), np.degrees(solution.trajectory.std[:, 8])


def _tick(largest):
    """A round number below the largest."""
    power = 10.0 ** np.floor(np.log10(largest))
    return max(step * power for step in (1, 2, 5) if step * power <= largest)


def _line(points, colour, width, dash=""):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}" '
        f'stroke-linejoin="round" stroke-linecap="round"{dashes}/>'
    )


def _circle(x, y):
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{FIX}"/>'


def _text(x, y, text, fill=INK, anchor="start", size=13, weight=400):
    return (
        f'<text x="{x:g}" y="{y:g}" fill="{fill}" text-anchor="{anchor}" font-size="{size}" '
        f'font-weight="{weight}">{escape(text)}</text>'
    )


if __name__ == "__main__":
    if "--check" in sys.argv:
        if FILE.read_text(encoding="utf-8") != drawn():
            sys.exit(f"{FILE}: another picture comes out; run python benchmarks/picture.py")
    else:
        FILE.write_text(drawn(), encoding="utf-8")
        print(f"wrote {FILE}: {FILE.stat().st_size / 1e3:.0f} kB")
