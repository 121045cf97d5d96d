"""Planes divided by the classes of their points, as figures that say of every point what it is."""

import html
import math
from collections.abc import Iterator, Sequence
from itertools import product
from textwrap import wrap
from typing import Any

import numpy as np

from actin_xcheck.core.errors import Ending
from actin_xcheck.report.exhibits import Classes, Line, Places

Node = tuple[int, int]
"""Column and row."""

_COLOURS = {
    "not run": "#f8f6f2",
    "accurate": "#9ceac9",
    "truth unknown": "#cebb71",
    "ends with the model": "#91a6b8",
    "silently wrong": "#e95c02",
}
_FAILED = "failed: "
"""What the classes of failures begin with; then comes the Outcome."""

_FAILURES = {
    Ending.NEGATIVE_CONCENTRATION: "#68744a",
    Ending.TANGLED: "#575c85",
    Ending.SINGULAR_DILATION: "#852d62",
    Ending.STEP_TOO_SMALL: "#02492f",
    Ending.NOT_CONVERGED: "#4d213a",
    Ending.INTERRUPTED: "#340d4f",
    Ending.NON_FINITE: "#01161b",
}
"""From light to dark, so that no two are one grey; apart for eyes without red, green or blue too."""

_DASHES = ("6px,3px", "1.5px,2.5px", "9px,2px,2px,2px", "3px,2px", "12px,3px")
_DARK = "#111111"

WIDE, TITLE = 36, 28
"""Letters of a line of a legend and of an axis' title."""

READ = "%{text}<extra></extra>"
"""What is read where the pointer rests: the text and nothing else."""


def text(said: str, wide: int = 0) -> str:
    """As plotly.js shows it letter by letter, no markup and no mathematics, in lines of `wide`."""
    lines = wrap(said, wide) if wide else [said]
    return "<br>".join(html.escape(line, quote=False).replace("$", "&#36;") for line in lines)


def colour_of(label: str) -> str:
    """The colour of a class; failures by their Outcome."""
    if label in _COLOURS:
        return _COLOURS[label]
    return _FAILURES[Ending(label.removeprefix(_FAILED))]


def classes(one: Classes) -> dict[str, Any]:
    """Return a plane as `data` and `layout`."""
    nodes = [(int(column), int(row)) for column, row in one.nodes.T]
    labels = dict(zip(nodes, one.classes, strict=True))
    every = (*_COLOURS, *(f"{_FAILED}{ending}" for ending in _FAILURES))
    names = [name for name in every if name in labels.values()]
    x, y = _halves(one.x), _halves(one.y)
    grid = _grid(one, labels)
    numbers = [[names.index(label) if label else None for label in row] for row in grid.T.tolist()]
    border_x, border_y = _border(grid, x, y)
    sentences = [text(sentence) for sentence in one.sentences]
    data = [
        painted(x, y, numbers, names, [colour_of(name) for name in names]),
        _thin(border_x, border_y, "#ffffff", 3) | {"opacity": 0.55},
        _thin(border_x, border_y, _DARK, 1),
        *(trace for number, line in enumerate(one.lines) for trace in _theory(line, number)),
        {
            "type": "scatter", "mode": "markers", "x": [x[2 * column] for column, _ in nodes],
            "y": [y[2 * row] for _, row in nodes], "text": sentences, "hovertemplate": READ,
            "showlegend": False, "opacity": 0.6,
            "marker": {"size": 4, "color": _DARK, "line": {"width": 0.6, "color": "#ffffff"}},
        },
        *(patch(name, colour_of(name)) for name in names),
    ]  # fmt: skip
    layout = {"height": 340, "xaxis": _axis(one.x), "yaxis": _axis(one.y), "hovermode": "closest"}
    return {"data": data, "layout": layout}


def painted(
    x: Sequence[float | None],
    y: Sequence[float | None],
    codes: list[list[int | None]],
    names: list[str],
    colours: list[str],
) -> dict[str, Any]:
    """A map of numbered regions, x and y their centres or edges; `names` are read where the pointer rests."""
    n = max(len(colours), 1)
    scale = [[(code + side) / n, colour] for code, colour in enumerate(colours) for side in (0, 1)]
    return {
        "type": "heatmap", "x": x, "y": y, "z": codes, "zmin": -0.5, "zmax": n - 0.5, "colorscale": scale,
        "showscale": False, "names": [text(name) for name in names], "hovertemplate": READ,
    }  # fmt: skip


def patch(name: str, colour: str) -> dict[str, Any]:
    """An entry of the legend for a colour of a map."""
    marker = {"symbol": "square", "size": 11, "color": colour, "line": {"width": 1, "color": "#8a8f98"}}
    return {
        "type": "scatter",
        "x": [None],
        "y": [None],
        "mode": "markers",
        "name": text(name, WIDE),
        "marker": marker,
    }


def _halves(axis: Places) -> list[float]:
    """The places of a lattice, and between any two the middle, on its scale."""
    there, back = (np.log, np.exp) if axis.log else (np.asarray, np.asarray)
    n = len(axis.values)
    between = back(np.interp(np.arange(2 * n - 1) / 2, np.arange(n), there(axis.values)))
    return [float(f"{one:.9g}") for one in between]


def _axis(axis: Places) -> dict[str, Any]:
    """With labels of every width of the mesh, else of round numbers; to the ends of the lattice."""
    ends = [float(axis.values[0]), float(axis.values[-1])]
    said: dict[str, Any] = {
        "title": {"text": text(axis.label, TITLE)},
        "type": "log" if axis.log else "linear",
    }
    said["range"] = [math.log10(end) for end in ends] if axis.log else ends
    if axis.label == "h":
        said |= {"tickvals": axis.values.tolist(), "ticktext": [f"1/{round(1 / h)}" for h in axis.values]}
    return said


def _grid(one: Classes, labels: dict[Node, str]) -> np.ndarray:
    """Classes (2 columns - 2, 2 rows - 2) between half places: every corner of a cell has its quarter."""
    grid = np.full((2 * len(one.x.values) - 2, 2 * len(one.y.values) - 2), None, dtype=object)
    for left, right, low, high in one.cells.tolist():
        for column, row in product((left, right), (low, high)):
            across = slice(2 * left, left + right) if column == left else slice(left + right, 2 * right)
            up = slice(2 * low, low + high) if row == low else slice(low + high, 2 * high)
            grid[across, up] = labels[round(column), round(row)]
    return grid


def _border(
    grid: np.ndarray, x: list[float], y: list[float]
) -> tuple[list[float | None], list[float | None]]:
    """Strokes between different classes, apart by a None."""
    strokes = [((x[i + 1],) * 2, (y[j], y[j + 1])) for i, j in np.argwhere(grid[1:] != grid[:-1]).tolist()]
    strokes += [
        ((x[i], x[i + 1]), (y[j + 1],) * 2) for i, j in np.argwhere(grid[:, 1:] != grid[:, :-1]).tolist()
    ]
    return [at for across, _ in strokes for at in (*across, None)], [
        at for _, up in strokes for at in (*up, None)
    ]


def _thin(x: list[Any], y: list[Any], colour: str, width: float) -> dict[str, Any]:
    line = {"color": colour, "width": width}
    return {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": y,
        "line": line,
        "showlegend": False,
        "hoverinfo": "skip",
    }


def _theory(line: Line, number: int) -> Iterator[dict[str, Any]]:
    """A line of theory, on a halo that sets it off."""
    finite = np.isfinite(line.x) & np.isfinite(line.y)
    x, y = line.x[finite].tolist(), line.y[finite].tolist()
    yield _thin(x, y, "#ffffff", 3) | {"opacity": 0.55}
    own = {"dash": _DASHES[number % len(_DASHES)], "color": _DARK, "width": 1.2}
    yield {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": text(line.label, WIDE), "line": own}
