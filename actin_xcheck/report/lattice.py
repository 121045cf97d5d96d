"""Planes divided by the classes of their points, as drawings that say of every point what it is."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.exhibits import Classes, Places
from actin_xcheck.report.svg import axes_data
from actin_xcheck.report.ticks import ticks

Node = tuple[int, int]
"""Column and row."""

Box = tuple[float, float, float, float]
"""Left, right, bottom and top, in places of the lattice."""

FRAME = {"width": 420, "height": 330, "left": 64, "right": 404, "top": 8, "bottom": 292}
"""A drawing and, within it, its axes: right and down."""

_LETTERS = 9 / 11
"""Height of other drawings' letters over these'."""

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

_DASHES = ("6 3", "1.5 2.5", "9 2 2 2", "3 2", "12 3")


@dataclass(frozen=True)
class _Block:
    """A rectangle of one class."""

    x: float
    y: float
    width: float
    height: float
    colour: str


@dataclass(frozen=True)
class _Dot:
    """A point with its sentence."""

    x: float
    y: float
    title: str


@dataclass(frozen=True)
class _Curve:
    """A line of theory."""

    label: str
    points: str
    dash: str


@dataclass(frozen=True)
class _Tick:
    """A label at a coordinate of the drawing."""

    at: float
    text: str


@dataclass(frozen=True)
class Divided:
    """A plane ready for the template: everything in units of its drawing; `axes` as `svg.axes_data`."""

    names: tuple[str, str]
    axes: str
    blocks: tuple[_Block, ...]
    border: str
    dots: tuple[_Dot, ...]
    curves: tuple[_Curve, ...]
    xticks: tuple[_Tick, ...]
    yticks: tuple[_Tick, ...]
    legend: tuple[tuple[str, str], ...]
    frame: dict[str, int]


def colour_of(label: str) -> str:
    """The colour of a class; failures by their Outcome."""
    if label in _COLOURS:
        return _COLOURS[label]
    return _FAILURES[Ending(label.removeprefix(_FAILED))]


class _Scale:
    """Places of an axis as coordinates of the drawing; between places linearly."""

    def __init__(self, axis: Places, low: float, high: float) -> None:
        self.axis, self.low, self.high = axis, low, high
        self._ends = [self._measure(axis.values[0]), self._measure(axis.values[-1])]

    @property
    def ends(self) -> tuple[str, float, float]:
        """The kind of the scale, the values at its low and at its high end."""
        return "log" if self.axis.log else "linear", float(self.axis.values[0]), float(self.axis.values[-1])

    def at(self, value: float) -> float:
        """Coordinate of a value."""
        part = (self._measure(value) - self._ends[0]) / (self._ends[1] - self._ends[0])
        return round(self.low + part * (self.high - self.low), 2)

    def place(self, number: float) -> float:
        """Coordinate of a place of the lattice, or between two."""
        values = [self._measure(value) for value in self.axis.values]
        return self.at(self._back(float(np.interp(number, range(len(values)), values))))

    def ticks(self) -> tuple[_Tick, ...]:
        """Labels: of every width of the mesh, else of round numbers."""
        if self.axis.label == "h":
            return tuple(_Tick(self.at(value), f"1/{round(1 / value)}") for value in self.axis.values)
        room = _LETTERS * abs(self.high - self.low)
        found = ticks(*self.ends, room, across=self.high > self.low)
        return tuple(_Tick(self.at(value), label) for value, label in found)

    def _measure(self, value: float) -> float:
        return math.log(value) if self.axis.log else value

    def _back(self, measure: float) -> float:
        return math.exp(measure) if self.axis.log else measure


def divided(one: Classes) -> Divided:
    """Draw a plane."""
    across = _Scale(one.x, FRAME["left"], FRAME["right"])
    up = _Scale(one.y, FRAME["bottom"], FRAME["top"])
    nodes = [(int(column), int(row)) for column, row in one.nodes.T]
    labels = dict(zip(nodes, one.classes, strict=True))
    classes = (*_COLOURS, *(f"{_FAILED}{ending}" for ending in _FAILURES))
    box = FRAME["left"], FRAME["top"], FRAME["right"], FRAME["bottom"]
    return Divided(
        names=(one.x.label, one.y.label),
        axes=axes_data(box, across.ends, up.ends, (one.x.label, one.y.label)),
        blocks=tuple(block for cell in one.cells.tolist() for block in _blocks(cell, labels, across, up)),
        border=_border(one, labels, across, up),
        dots=tuple(
            _Dot(across.place(column), up.place(row), sentence)
            for (column, row), sentence in zip(nodes, one.sentences, strict=True)
        ),
        curves=tuple(
            _Curve(line.label, _polyline(line.x, line.y, across, up), dash)
            for line, dash in zip(one.lines, _DASHES * 2, strict=False)
        ),
        xticks=across.ticks(),
        yticks=up.ticks(),
        legend=tuple((label, colour_of(label)) for label in classes if label in labels.values()),
        frame=FRAME,
    )


def _quarters(cell: Box) -> list[tuple[Node, Box]]:
    """The corners of a cell with the quarter each stands for."""
    left, right, bottom, top = cell
    x, y = (left + right) / 2, (bottom + top) / 2
    return [
        ((round(i), round(j)), (min(i, x), max(i, x), min(j, y), max(j, y)))
        for i, j in product((left, right), (bottom, top))
    ]


def _blocks(cell: Box, labels: dict[Node, str], across: _Scale, up: _Scale) -> list[_Block]:
    """A cell as one rectangle, or as four where its corners are not of one class."""
    quarters = _quarters(cell)
    if len(seen := {labels[node] for node, _ in quarters}) == 1:
        return [_block(cell, seen.pop(), across, up)]
    return [_block(box, labels[node], across, up) for node, box in quarters]


def _block(box: Box, label: str, across: _Scale, up: _Scale) -> _Block:
    left, right = across.place(box[0]), across.place(box[1])
    low, high = up.place(box[2]), up.place(box[3])
    return _Block(left, high, round(right - left, 2), round(low - high, 2), colour_of(label))


def _border(one: Classes, labels: dict[Node, str], across: _Scale, up: _Scale) -> str:
    """The path between quarters of different classes, on the lattice of half places."""
    columns, rows = 2 * (len(one.x.values) - 1), 2 * (len(one.y.values) - 1)
    grid = np.empty((columns, rows), dtype=object)
    for cell in one.cells.tolist():
        for node, (left, right, low, high) in _quarters(cell):
            grid[round(2 * left) : round(2 * right), round(2 * low) : round(2 * high)] = labels[node]
    x = [across.place(number / 2) for number in range(columns + 1)]
    y = [up.place(number / 2) for number in range(rows + 1)]
    upright = [f"M{x[i + 1]} {y[j]}V{y[j + 1]}" for i, j in np.argwhere(grid[1:] != grid[:-1]).tolist()]
    level = [f"M{x[i]} {y[j + 1]}H{x[i + 1]}" for i, j in np.argwhere(grid[:, 1:] != grid[:, :-1]).tolist()]
    return "".join(upright + level)


def _polyline(x: np.ndarray, y: np.ndarray, across: _Scale, up: _Scale) -> str:
    """Points of a line; what lies outside the plane is clipped by the drawing."""
    finite = np.isfinite(x) & np.isfinite(y)
    places = zip(x[finite].tolist(), y[finite].tolist(), strict=True)
    return " ".join(f"{across.at(a)},{up.at(b)}" for a, b in places)
