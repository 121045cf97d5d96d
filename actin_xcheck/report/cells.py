"""Pictures of cells: triangles coloured by values, in one window and one colour scale, over an outline.

Pictures hold no text, which is left to HTML: it can be selected and follows the reader's theme.
"""

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
from matplotlib.figure import Figure

from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array

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
    """One picture: PNG in base64, what it shows in words, and the range of its values."""

    png: str
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

    def __init__(self, shown: Window, dpi: int = _DPI) -> None:
        (left, bottom), (right, top) = shown
        self._figure = Figure((_WIDTH, _WIDTH * (top - bottom) / (right - left)), dpi, facecolor="none")
        self.axes: Axes = self._figure.add_axes((0, 0, 1, 1), xlim=(left, right), ylim=(bottom, top))
        self.axes.set_autoscale_on(False)
        self.axes.set_axis_off()

    def panel(self, what: str, extent: str) -> Panel:
        """Return the picture of `what`."""
        buffer = BytesIO()
        FigureCanvasAgg(self._figure).print_png(buffer, metadata={"Software": None})
        return Panel(b64encode(buffer.getvalue()).decode(), f"{what}, values {extent}", extent)


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
