"""Drawings as inline SVG that takes its ink from the page, and how lines are told apart."""

import re
from contextlib import AbstractContextManager
from dataclasses import dataclass
from html import escape
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK = "#0d0e0f"
"""Stand-in for the page's ink."""
_GRID = "#d0d1d2"  # stand-in for the colour of the page's lines
_STYLE = {
    "svg.fonttype": "none",  # real text: small, selectable, in the page's font
    "svg.hashsalt": "actin_xcheck",  # the same files give the same page
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    "font.size": 9,
    **{name: INK for name in ("text.color", "axes.labelcolor", "xtick.color", "ytick.color")},
    "axes.edgecolor": _GRID,
    "axes.grid": True,
    "grid.color": _GRID,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.limits": (-3, 4),  # labels short enough for their margin
}


@dataclass(frozen=True)
class Style:
    """How one line is drawn, in a chart and in the legend beside it."""

    colour: str
    width: float


STYLES = (
    *(Style("#5b9bf0", 3.6), Style("#e4572e", 1.5), Style("#2a9d6e", 1.2), Style("#a463c9", 1.0)),
    *(Style("#c98a00", 1.0), Style("#1aa3b5", 1.0), Style("#d4569b", 1.0), Style("#8a8f98", 1.0)),
)
"""Lines mostly coincide, so each is drawn thinner than the one before, on top of it."""


def styled() -> AbstractContextManager[None]:
    """A context in which figures are to be made and turned into SVG."""
    return mpl.rc_context(_STYLE)


def calm(axes: Axes) -> None:
    """Keep the value axis from magnifying round-off: it spans at least 1e-9 of what it shows."""
    low, high = axes.get_ylim()
    least = 1e-9 * max(1.0, abs(low), abs(high))
    if high - low < least:
        middle = (low + high) / 2
        axes.set_ylim(middle - least / 2, middle + least / 2)


def svg(figure: Figure, label: str, prefix: str) -> str:
    """Return a figure as an SVG element, its ink and grid left to the page's style sheet.

    Parameters
    ----------
    figure : drawn within `styled`.
    label : what it shows, for those who cannot see it.
    prefix : keeps ids apart from those of other drawings on the page.
    """
    buffer = StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>{prefix}-", text)
    text = text.replace(INK, "currentColor").replace(_GRID, "var(--line)")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)
