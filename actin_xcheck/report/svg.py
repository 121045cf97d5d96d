"""Drawings as inline SVG that takes its ink from the page, and how lines are told apart.

Every drawing says how its page's script may zoom and read it, so that no number is stated twice: `data-axes`
on the element are its axes (`axes_data`), `data-zoom` on a group are the directions in which it follows them,
and `data-name` is what it is called.
"""

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from io import StringIO
from itertools import count

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.spines import Spine
from matplotlib.text import Annotation
from matplotlib.ticker import FixedLocator, NullLocator

from actin_xcheck.report.ticks import ticks

INK = "#0d0e0f"
"""Stand-in for the page's ink."""
_GRID = "#d0d1d2"  # stand-in for the colour of the page's lines
_STYLE = {
    "svg.fonttype": "none",  # real text: small, selectable, in the page's font
    "svg.hashsalt": "actin_xcheck",  # the same files give the same page
    "path.simplify_threshold": 0.02,  # points, so that lines stand being zoomed
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    "font.size": 9,
    **{name: INK for name in ("text.color", "axes.labelcolor", "xtick.color", "ytick.color")},
    "axes.edgecolor": _GRID,
    "axes.grid": True,
    "grid.color": _GRID,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,  # margins as wide as what stands in them
    "figure.constrained_layout.w_pad": 0.03,
    "figure.constrained_layout.h_pad": 0.03,
}


@dataclass(frozen=True)
class Style:
    """How one line is drawn, in a chart and in the legend beside it."""

    colour: str
    width: float


STYLES = (
    *(Style("#527ed4", 3.6), Style("#cd3122", 1.5), Style("#20814d", 1.2), Style("#9c4fa3", 1.0)),
    *(Style("#bd8b0b", 1.0), Style("#06a5ac", 1.0), Style("#e85e9f", 1.0), Style("#6f707a", 1.0)),
)
"""Lines mostly coincide, so each is drawn thinner than the one before, on top of it; apart for every eye."""


@contextmanager
def unstyled() -> Iterator[None]:
    """A context in which pictures are to be made: matplotlib's own style, whatever a `matplotlibrc` says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        yield


@contextmanager
def styled() -> Iterator[None]:
    """A context in which figures are to be made and turned into SVG."""
    with unstyled():
        mpl.rcParams.update(_STYLE)
        yield


def calm(axes: Axes) -> None:
    """Keep the value axis from magnifying round-off: it spans at least 1e-9 of what it shows."""
    low, high = axes.get_ylim()
    least = 1e-9 * max(0.0 if axes.get_yscale() == "log" else 1.0, abs(low), abs(high))
    if high - low < least:
        middle = (low + high) / 2
        axes.set_ylim(middle - least / 2, middle + least / 2)


def axes_data(
    box: Sequence[float], x: tuple[str, float, float], y: tuple[str, float, float], names: Sequence[str]
) -> str:
    """Return what a drawing says of its axes, as JSON.

    Parameters
    ----------
    box : left, top, right and bottom edge in the drawing's units.
    x, y : "linear" or "log", and the values at the left and right edge, at the bottom and top.
    names : of the two axes.
    """
    return json.dumps({"box": [round(float(edge), 4) for edge in box], "x": x, "y": y, "names": list(names)})


def svg(figure: Figure, label: str, prefix: str) -> str:
    """Return a figure of one pair of axes as an SVG element, its ink and grid left to the page's style sheet.

    Parameters
    ----------
    figure : drawn within `styled`; lines with a label are read out by it.
    label : what it shows, for those who cannot see it.
    prefix : keeps ids apart from those of other drawings on the page.
    """
    (axes,) = figure.axes
    _number(figure, axes)
    follows = _follow(axes)
    buffer = StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"font-family: [^;\"]*;? ?", "", text)  # the page's own
    text = re.sub(r"\n\s*", "\n", text)
    for gid, said in follows.items():
        text = text.replace(f'<g id="{gid}">', f'<g id="{gid}" {said}>', 1)
    text = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{prefix}-", text)
    text = text.replace(INK, "currentColor").replace(_GRID, "var(--line)")
    data = f"data-axes='{escape(_axes_of(figure, axes))}'"
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" {data} ', 1)


def _number(figure: Figure, axes: Axes) -> None:
    """Number the axes that no names stand along; a third of their length is left to the margins."""
    width, height = 72 * figure.get_size_inches() * 2 / 3
    for axis, room, across in ((axes.xaxis, width, True), (axes.yaxis, height, False)):
        if not isinstance(axis.get_major_locator(), FixedLocator):
            low, high = sorted(axis.get_view_interval())
            axis.set_ticks(*zip(*ticks(axis.get_scale(), low, high, room, across), strict=True))
            axis.set_minor_locator(NullLocator())


def _axes_of(figure: Figure, axes: Axes) -> str:
    width, height = 72 * figure.get_size_inches()
    place = axes.get_position()
    box = (place.x0 * width, (1 - place.y1) * height, place.x1 * width, (1 - place.y0) * height)
    x, y = (axes.get_xscale(), *axes.get_xlim()), (axes.get_yscale(), *axes.get_ylim())
    return axes_data(box, x, y, (axes.get_xlabel(), axes.get_ylabel()))


def _follow(axes: Axes) -> dict[str, str]:
    """Name the groups of all that is drawn in data coordinates; by name, their attributes."""
    numbers, found = count(), {}
    for artist in axes.get_children():
        if isinstance(artist, Axis | Spine):
            continue
        directions = _directions(artist, axes)
        if not directions:
            continue
        gid = artist.get_gid() or f"drawn-{next(numbers)}"
        artist.set_gid(gid)
        label = str(artist.get_label())
        named = f' data-name="{escape(label)}"' if label and not label.startswith("_") else ""
        found[gid] = f'data-zoom="{directions}"{named}'
    return found


def _directions(artist: Artist, axes: Axes) -> str:
    """ "x", "y", both or none: where an artist follows the axes."""
    if isinstance(artist, Annotation):
        given = artist.xycoords if isinstance(artist.xycoords, tuple) else (artist.xycoords,) * 2
        follows: Sequence[bool] = [one == "data" for one in given]
    else:
        follows = artist.get_transform().contains_branch_seperately(axes.transData)
    return "".join(name for name, one in zip("xy", follows, strict=True) if one)
