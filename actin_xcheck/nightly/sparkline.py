"""A number through the nights as a line of text height, in a few hundred bytes of SVG."""

from collections.abc import Collection
from html import escape

import numpy as np
from markupsafe import Markup

from actin_xcheck.nightly.history.record import Kind, Series

WIDTH, HEIGHT = 120, 22
"""Units of the drawing: about pixels."""

SHOWN = 60
"""Nights at most, the last ones."""

_STATES = {"pass": "green", "fail": "red", "none": "not run"}


def sparkline(series: Series, changed: Collection[str] = ()) -> Markup:
    """Return a series as a line, its last value as a dot, nights in which it changed as strokes.

    Parameters
    ----------
    series : the number; on the logarithm where it is compared so.
    changed : names of the nights.
    """
    nights = series.nights[-SHOWN:]
    scaled, values = series.scaled[-SHOWN:], series.values[-SHOWN:]
    finite = np.isfinite(scaled)
    if not finite.any():
        return Markup('<span class="none">no number</span>')
    x = np.linspace(3, WIDTH - 3, len(nights)) if len(nights) > 1 else np.array([WIDTH - 3.0])
    low, high = scaled[finite].min(), scaled[finite].max()
    least = 0.02 if series.kind is not Kind.RATE else 1e-6  # round-off is drawn as none
    y = HEIGHT - 3 - (HEIGHT - 6) * (scaled - low) / max(high - low, least)
    lines, piece = [], list[str]()
    for i in range(len(nights)):
        if finite[i]:
            piece.append(f"{x[i]:.1f},{y[i]:.1f}")
        if piece and (not finite[i] or i == len(nights) - 1):
            lines.append(f'<polyline points="{" ".join(piece)}"/>')
            piece = []
    strokes = [
        f'<path class="change" d="M{x[i]:.1f} 0v{HEIGHT}"/>'
        for i, night in enumerate(nights)
        if night.name in changed
    ]
    last = np.flatnonzero(finite)[-1]
    dot = f'<circle cx="{x[last]:.1f}" cy="{y[last]:.1f}" r="2.2"/>'
    known = values[finite]
    said = f"{len(nights)} {'night' if len(nights) == 1 else 'nights'}: {known[0]:.3g} to {known[-1]:.3g}"
    if len(known) > 2:
        said += f", between {known.min():.3g} and {known.max():.3g}"
    if strokes:
        said += f"; changed in {', '.join(night.name for night in nights if night.name in changed)}"
    drawn = "".join([*strokes, *lines, dot])
    return Markup(
        f'<svg class="spark" role="img" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'aria-label="{escape(said)}">{drawn}</svg>'
    )


def lights(states: list[tuple[str, str]]) -> Markup:
    """Return a row of lights, a night each: its name, and "pass", "fail" or "none".

    Red lights are taller, so that they are told from green ones without colours.
    """
    shown = states[-SHOWN:]
    drawn = "".join(
        f'<rect class="{state}" x="{7 * i}" y="{0 if state == "fail" else 5}" width="5" '
        f'height="{HEIGHT if state == "fail" else HEIGHT - 10}">'
        f"<title>{escape(name)}: {_STATES[state]}</title></rect>"
        for i, (name, state) in enumerate(shown)
    )
    red = [name for name, state in shown if state == "fail"]
    said = f"{len(shown)} nights, red: {', '.join(red) or 'none'}"
    return Markup(
        f'<svg class="lights" role="img" viewBox="0 0 {7 * len(shown)} {HEIGHT}" width="{7 * len(shown)}" '
        f'height="{HEIGHT}" aria-label="{escape(said)}">{drawn}</svg>'
    )
