"""Film strips: the deforming cell at the output times, one row per method and one per FV - FEM difference.

Pictures hold no text, which is left to HTML: it can be selected and follows the reader's theme.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from actin_xcheck.geometry import Mesh
from actin_xcheck.model import Array
from actin_xcheck.store import Run

MAX_COLUMNS = 5

_WIDTH = 2.2  # inches
_DPI = 120
_OUTLINE = "#8a8f98"  # seen on white and on black


@dataclass(frozen=True)
class Panel:
    """One picture: PNG in base64, what it shows in words, and the range of its values."""

    png: str
    alt: str
    extent: str


@dataclass(frozen=True)
class Row:
    """Pictures of one method (or of one difference) at the strip's times; None where there is no frame."""

    label: str
    is_difference: bool
    panels: tuple[Panel | None, ...]


@dataclass(frozen=True)
class ColourBar:
    """A colour map as a CSS gradient between two labelled values."""

    label: str
    low: str
    high: str
    gradient: str


@dataclass(frozen=True)
class FilmStrip:
    """Rows of pictures at common times, with one colour bar for a and one for the differences."""

    times: tuple[float, ...]
    rows: tuple[Row, ...]
    bars: tuple[ColourBar, ...]
    clipped: bool


def film_strip(runs: Sequence[Run]) -> FilmStrip:
    """Draw the runs of one scene; differences are FV's cell means less FEM's, drawn where FEM's cell is.

    The colours span what the completed runs reach: a run on its way to a singularity must not wash them out.
    """
    times = _columns(runs)
    named = {run.attributes["method_name"]: run for run in runs}
    shots = {name: _shots(run, times) for name, run in named.items()}
    window = _window([x for row in shots.values() for x, _ in filter(None, row)] + [runs[0].xi])
    brushes = {name: _Brush(run, window) for name, run in named.items()}

    completed = [name for name, run in named.items() if run.attributes["outcome"] == "completed"]
    scale = _span([shots[name] for name in completed or named])
    rows = [
        Row(name, False, brushes[name].row(f"a of {name}", times, row, "viridis", scale))
        for name, row in shots.items()
    ]
    bars = [_bar("a", "viridis", scale)]
    fem = next((name for name in named if name.startswith("fem")), "")
    if differences := _differences(named, shots, fem):
        reach = max(map(abs, _span(list(differences.values())))) or 1.0
        rows += [
            Row(name, True, brushes[fem].row(name, times, row, "RdBu_r", (-reach, reach)))
            for name, row in differences.items()
        ]
        bars.append(_bar("difference of a", "RdBu_r", (-reach, reach)))
    return FilmStrip(tuple(times), tuple(rows), tuple(bars), clipped=_span(list(shots.values())) != scale)


Shot = tuple[Array, Array] | None
"""Positions (2, N) and values on cells (n_cells,) at one time, or None where the run has no such frame."""


def _columns(runs: Sequence[Run]) -> list[float]:
    """At most MAX_COLUMNS output times, evenly through those of all runs and with each run's last one."""
    times = np.unique(np.concatenate([run.times for run in runs]).round(9))
    last = {int(np.argmin(np.abs(times - run.times[-1]))) for run in runs if len(run.times)}
    free = max(MAX_COLUMNS - len(last), 0)
    even = np.linspace(0, len(times) - 1, free + 1).round().astype(int)[:free]
    chosen = sorted(last | {int(i) for i in even})
    return [float(t) for t in times[chosen]]


def _shots(run: Run, times: Sequence[float]) -> list[Shot]:
    found = [np.flatnonzero(np.abs(run.times - t) < 1e-9) for t in times]
    return [(run.points[i[0]], run.a_cells[i[0]]) if len(i) else None for i in found]


def _differences(named: dict[str, Run], shots: dict[str, list[Shot]], fem: str) -> dict[str, list[Shot]]:
    """FV less FEM, by the name of its row, for those on the same triangles; none without FEM."""
    return {
        f"{name} − {fem}": [
            (ours[0], theirs[1] - ours[1]) if ours and theirs else None
            for ours, theirs in zip(shots[fem], shots[name], strict=True)
        ]
        for name, run in named.items()
        if fem and name.startswith("fv") and np.array_equal(run.triangles, named[fem].triangles)
    }


def _window(positions: Sequence[Array]) -> tuple[Array, Array]:
    """The box around all positions, with a margin: corners (2,), (2,)."""
    everything = np.hstack(positions)
    everything = everything[:, np.isfinite(everything).all(axis=0)]
    low, high = everything.min(axis=1), everything.max(axis=1)
    margin = 0.03 * (high - low).max()
    return low - margin, high + margin


def _span(rows: Sequence[Sequence[Shot]]) -> tuple[float, float]:
    """Smallest and largest finite value in rows of shots."""
    everything = np.concatenate([shot[1] for row in rows for shot in row if shot] or [np.empty(0)])
    finite = everything[np.isfinite(everything)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)


def _in_words(low: float, high: float) -> str:
    """A range of values; nearly equal ones as middle and half-width, else both would print alike."""
    middle, half = (low + high) / 2, (high - low) / 2
    if 0 < half < 1e-3 * abs(middle):
        return f"{middle:.6g} ± {half:.2g}"
    return f"{low:.3g} … {high:.3g}" if half else f"{low:.6g}"


def _bar(label: str, colours: str, scale: tuple[float, float]) -> ColourBar:
    stops = ", ".join(to_hex(colour) for colour in colormaps[colours](np.linspace(0, 1, 12)))
    low, high = scale
    digits = 3 if high - low > 1e-2 * abs(high) else 9
    return ColourBar(label, f"{low:.{digits}g}", f"{high:.{digits}g}", f"linear-gradient(to right, {stops})")


class _Brush:
    """Draws the cells of one run's mesh in one window, over the outline of where the cell began."""

    def __init__(self, run: Run, window: tuple[Array, Array]) -> None:
        rim = Mesh(run.xi, run.triangles, h=np.nan).rim_nodes
        self._triangles, self._rim = run.triangles, np.append(rim, rim[0])
        self._start = run.xi[:, self._rim]
        self._window = window

    def row(
        self,
        what: str,
        times: Sequence[float],
        shots: Sequence[Shot],
        colours: str,
        scale: tuple[float, float],
    ) -> tuple[Panel | None, ...]:
        """Draw one row of a strip."""
        return tuple(
            self._panel(f"{what} at t = {t:.4g}", shot, colours, scale) if shot else None
            for t, shot in zip(times, shots, strict=True)
        )

    def _panel(self, what: str, shot: tuple[Array, Array], colours: str, scale: tuple[float, float]) -> Panel:
        x, values = shot
        (left, bottom), (right, top) = self._window
        figure = Figure((_WIDTH, _WIDTH * (top - bottom) / (right - left)), _DPI, facecolor="none")
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        # Without antialiasing neighbours leave no seams; the rim drawn over them smooths the outline.
        cells = dict(facecolors=values, cmap=colours, norm=Normalize(*scale), antialiased=False)
        axes.tripcolor(*x, self._triangles.T, **cells)
        axes.plot(*x[:, self._rim], color=_OUTLINE, linewidth=0.9)
        axes.plot(*self._start, color=_OUTLINE, linewidth=0.7, linestyle=(0, (3, 2)))
        axes.set(xlim=(left, right), ylim=(bottom, top))
        buffer = BytesIO()
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})
        low, high = _span([[shot]])
        extent = f"|·| ≤ {max(-low, high) + 0.0:.3g}" if scale[0] == -scale[1] else _in_words(low, high)
        return Panel(b64encode(buffer.getvalue()).decode(), f"{what}, values {extent}", extent)
