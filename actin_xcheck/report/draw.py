"""Exhibits made ready for HTML, which `templates/parts.html` lays out: figures, pictures, tables."""

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure as Drawn
from numpy.typing import NDArray
from PIL import Image

from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Exhibit, Outline, Outlines, Picture, Sheet, Shots
from actin_xcheck.report.figure import Figure, figure

OUTLINE = "#8a8f98"  # seen on white and on black
DIVERGING, SEQUENTIAL = "RdBu_r", "viridis"

_WIDTH = 2.2  # inches
_DPI = 120

Window = tuple[Array, Array]
"""Lower left and upper right corner, (2,) each."""


@contextmanager
def unstyled() -> Iterator[None]:
    """A context in which pictures are to be made: matplotlib's own style, whatever a `matplotlibrc` says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        yield


@dataclass(frozen=True)
class Panel:
    """One picture: WebP in base64, what it shows in words, and the range of its values."""

    webp: str
    alt: str
    extent: str


@dataclass(frozen=True)
class ColourBar:
    """A colour map as a CSS gradient between two labelled values."""

    label: str
    low: str
    high: str
    gradient: str


@dataclass(frozen=True)
class Colours:
    """A colour map and the values at its ends."""

    name: str
    low: float
    high: float

    def bar(self, label: str) -> ColourBar:
        """The colour bar, called `label`."""
        stops = ", ".join(to_hex(colour) for colour in colormaps[self.name](np.linspace(0, 1, 12)))
        digits = 3 if self.high - self.low > 1e-2 * abs(self.high) else 9
        low, high = (f"{value:.{digits}g}" for value in (self.low, self.high))
        return ColourBar(label, low, high, f"linear-gradient(to right, {stops})")

    def extent(self, values: Array) -> str:
        """The range of values in words: its reach where the map is symmetric."""
        low, high = span([values])
        return f"|·| ≤ {max(-low, high) + 0.0:.3g}" if self.low == -self.high else _in_words(low, high)


def colours(values: Sequence[Array]) -> Colours:
    """Return a diverging map where values have both signs, else a sequential one."""
    low, high = span(values)
    if low < 0 < high:
        return Colours(DIVERGING, -max(-low, high), max(-low, high))
    return Colours(SEQUENTIAL, *scale_ends(low, high))


def window(positions: Iterable[Array]) -> Window:
    """The box around all positions (2, n), with a margin."""
    everything = np.hstack(list(positions))
    everything = everything[:, np.isfinite(everything).all(axis=0)]
    low, high = everything.min(axis=1), everything.max(axis=1)
    margin = 0.03 * (high - low).max()
    return low - margin, high + margin


def span(values: Sequence[Array]) -> tuple[float, float]:
    """Smallest and largest finite value."""
    everything = np.concatenate([np.ravel(one) for one in values] or [np.empty(0)])
    finite = everything[np.isfinite(everything)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)


def scale_ends(low: float, high: float) -> tuple[float, float]:
    """The ends of a colour scale for values from `low` to `high`: round-off must not look like a pattern."""
    middle, least = (low + high) / 2, 1e-6 * max(abs(low), abs(high))
    return (low, high) if high - low >= least else (middle - least / 2, middle + least / 2)


def closed_rim(triangles: Indices) -> Indices:
    """Rim nodes of triangles (3, n_cells) in order, the first one again at the end."""
    rim = Mesh(np.empty((2, 0)), triangles, h=np.nan).rim_nodes
    return np.append(rim, rim[0])


def _in_words(low: float, high: float) -> str:
    """A range of values; nearly equal ones as middle and half-width, else both would print alike."""
    middle, half = (low + high) / 2, (high - low) / 2
    if 0 < half < 1e-3 * abs(middle):
        return f"{middle:.6g} ± {half:.2g}"
    return f"{low:.3g} … {high:.3g}" if half else f"{low:.6g}"


class Canvas:
    """One picture in the making; what shows a value goes on `axes`."""

    def __init__(self, shown: Window, dpi: float = _DPI, wide: float = _WIDTH, ground: str = "none") -> None:
        (left, bottom), (right, top) = shown
        self._figure = Drawn((wide, wide * (top - bottom) / (right - left)), dpi, facecolor=ground)
        self.axes: Axes = self._figure.add_axes((0, 0, 1, 1), xlim=(left, right), ylim=(bottom, top))
        self.axes.set_autoscale_on(False)
        self.axes.set_axis_off()

    def panel(self, what: str, extent: str) -> Panel:
        """Return the picture of `what`."""
        buffer = BytesIO()
        Image.fromarray(self.pixels()).save(buffer, "WEBP", quality=92)  # a sixth of a PNG, in no time
        return Panel(b64encode(buffer.getvalue()).decode(), f"{what}, values {extent}", extent)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture as (height, width, 4): red, green, blue and opacity."""
        drawn = FigureCanvasAgg(self._figure)
        drawn.draw()
        return np.array(drawn.buffer_rgba())


class Brush:
    """Draws cells of one triangulation (3, n_cells) in one window, over a dotted outline (2, n)."""

    def __init__(self, triangles: Indices, outline: Array, shown: Window, dpi: int = _DPI) -> None:
        self._triangles, self._rim = triangles, closed_rim(triangles)
        self._outline, self._window, self._dpi = outline, shown, dpi

    @unstyled()
    def panel(self, what: str, x: Array, values: Array, scale: Colours) -> Panel:
        """Draw a cell with node positions x (2, N) and values on triangles (n_cells,)."""
        canvas = Canvas(self._window, self._dpi)
        # Without antialiasing neighbours leave no seams; the rim drawn over them smooths the outline.
        cells = dict(facecolors=values, cmap=scale.name, norm=Normalize(scale.low, scale.high))
        canvas.axes.tripcolor(*x, self._triangles.T, antialiased=False, **cells)
        canvas.axes.plot(*x[:, self._rim], color=OUTLINE, linewidth=0.9)
        canvas.axes.plot(*self._outline, color=OUTLINE, linewidth=0.7, linestyle=(0, (3, 2)))
        return canvas.panel(what, scale.extent(values))


_NUMBER = re.compile(r"[-+−]?(\d[\d.,]*|none|decay)?([eE][-+]?\d+)?( ± [\d.]+i)? ?%?")

_T = np.linspace(0, 2 * np.pi, 181)
_CIRCLE = np.array([np.cos(_T), np.sin(_T)])


@dataclass(frozen=True)
class Drawing:
    """An exhibit ready for the page.

    Attributes
    ----------
    kind : name of its class in small letters.
    title, note : text.
    path : where its numbers stand in the file.
    figure : of plotly.js.
    panels : pictures with their titles and the pages that clicks lead to, empty without.
    outlines : rims, each with its polygons in a drawing of 100 x 100.
    bars : what the colours of pictures mean.
    rows : of a table, header first; `numeric` says which columns hold numbers.
    """

    kind: str
    title: str
    note: str
    path: str
    figure: Figure | None = None
    panels: tuple[tuple[str, Panel, str], ...] = ()
    outlines: tuple[tuple[Outline, str, str], ...] = ()
    bars: tuple[ColourBar, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    numeric: tuple[bool, ...] = ()


def draw(exhibit: Exhibit, path: str) -> Drawing:
    """Draw an exhibit that is stored at `path`."""
    match exhibit:
        case Picture():
            return _picture(exhibit, path)
        case Shots():
            return _shots(exhibit, path)
        case Outlines():
            outlines = tuple((one, _polygon(one.points), _polygon(one.due)) for one in exhibit.outlines)
            return Drawing("outlines", exhibit.title, exhibit.note, path, outlines=outlines)
        case Sheet():
            columns = zip(*exhibit.rows[1:], strict=True)
            numeric = tuple(all(map(_NUMBER.fullmatch, column)) for column in columns)
            numeric = numeric or (False,) * len(exhibit.rows[0])
            return Drawing("sheet", exhibit.title, exhibit.note, path, rows=exhibit.rows, numeric=numeric)
        case _:
            kind = type(exhibit).__name__.lower()
            return Drawing(kind, exhibit.title, exhibit.note, path, figure(exhibit))


@unstyled()
def _picture(picture: Picture, path: str) -> Drawing:
    values, scale = picture.values, colours([picture.values])
    n_r, n_theta = values.shape
    r, theta = np.meshgrid(np.linspace(0, 1, n_r), np.linspace(0, 2 * np.pi, n_theta), indexing="ij")
    canvas = Canvas(window([_CIRCLE]))
    x, y, norm = r * np.cos(theta), r * np.sin(theta), Normalize(scale.low, scale.high)
    canvas.axes.pcolormesh(x, y, values, cmap=scale.name, norm=norm, shading="gouraud")
    canvas.axes.plot(*_CIRCLE, color=OUTLINE, linewidth=0.9)
    panel = canvas.panel(picture.title, scale.extent(values))
    return Drawing(
        "picture", picture.title, "", path, panels=((picture.title, panel, ""),), bars=(scale.bar(""),)
    )


def _shots(shots: Shots, path: str) -> Drawing:
    scale = colours([shot.values for shot in shots.shots])
    shown = window([_CIRCLE, *(shot.x for shot in shots.shots)])
    panels = tuple(
        (
            shot.title,
            Brush(shot.triangles, _CIRCLE, shown).panel(shot.title, shot.x, shot.values, scale),
            shot.link,
        )
        for shot in shots.shots
    )
    return Drawing("shots", shots.title, shots.note, path, panels=panels, bars=(scale.bar("a"),))


def _polygon(points: Array) -> str:
    """Points (2, n) of a rim in a drawing of 100 x 100 whose unit is 30."""
    x, y = 50 + 30 * points[0], 50 - 30 * points[1]
    return " ".join(f"{a:.2f},{b:.2f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
