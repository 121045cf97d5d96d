"""The page of a frontier report, from `frontier.h5` alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.draw import draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.svg import axes_data
from actin_xcheck.report.ticks import ticks
from actin_xcheck.studies.frontier.bisection import Cell, Node
from actin_xcheck.studies.frontier.classes import Kind
from actin_xcheck.studies.frontier.planes import Axis
from actin_xcheck.studies.frontier.record import FILE_NAME, Map, Row, read_frontier

FRAME = {"width": 420, "height": 330, "left": 64, "right": 404, "top": 8, "bottom": 292}
"""A drawing and, within it, its axes: right and down."""

_LETTERS = 9 / 11
"""Height of other drawings' letters over these'."""

_COLOURS = {
    str(Kind.NOT_RUN): "#f8f6f2",
    str(Kind.ACCURATE): "#9ceac9",
    str(Kind.UNKNOWN): "#cebb71",
    str(Kind.ENDS): "#91a6b8",
    str(Kind.SILENT): "#e95c02",
}
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
class Drawn:
    """A map ready for the template: everything in units of its drawing; `axes` as `svg.axes_data`."""

    map: Map
    path: str
    axes: str
    blocks: tuple[_Block, ...]
    border: str
    dots: tuple[_Dot, ...]
    curves: tuple[_Curve, ...]
    xticks: tuple[_Tick, ...]
    yticks: tuple[_Tick, ...]
    legend: tuple[tuple[str, str], ...]


def write_frontier_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/frontier.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_frontier(folder / FILE_NAME)
    chapters = [
        (
            chapter,
            [
                draw(one, f"/exhibits/{chapter.key}/{one.key}", f"c{i}-{j}")
                for j, one in enumerate(chapter.exhibits)
            ],
        )
        for i, chapter in enumerate(stored.chapters)
    ]
    run = [row for one in stored.maps for row in one.points if row.kind != Kind.NOT_RUN]
    told = {name: value for name, value in stored.attributes.items() if name != "scene"}
    html = environment(folder).get_template("frontier.html")
    text = html.render(
        attributes=told,
        scene=stored.attributes["scene"],
        maps=[_drawn(one) for one in stored.maps],
        chapters=chapters,
        runs=len(run),
        uncertainty=max((row.uncertainty for row in run if row.kind != Kind.UNKNOWN), default=math.nan),
        file=stored.path,
        frame=FRAME,
    )
    return put_page(folder, text)


def colour_of(label: str) -> str:
    """The colour of a class; failures by their Outcome."""
    if label in _COLOURS:
        return _COLOURS[label]
    return _FAILURES[Ending(label.removeprefix(f"{Kind.FAILED}: "))]


class _Scale:
    """Places of an axis as coordinates of the drawing; between places linearly."""

    def __init__(self, axis: Axis, low: float, high: float) -> None:
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
        if self.axis.name == "h":
            return tuple(_Tick(self.at(value), f"1/{round(1 / value)}") for value in self.axis.values)
        room = _LETTERS * abs(self.high - self.low)
        found = ticks(*self.ends, room, across=self.high > self.low)
        return tuple(_Tick(self.at(value), label) for value, label in found)

    def _measure(self, value: float) -> float:
        return math.log(value) if self.axis.log else value

    def _back(self, measure: float) -> float:
        return math.exp(measure) if self.axis.log else measure


def _drawn(one: Map) -> Drawn:
    across = _Scale(one.plane.x, FRAME["left"], FRAME["right"])
    up = _Scale(one.plane.y, FRAME["bottom"], FRAME["top"])
    labels = {(row.column, row.row): row.label for row in one.points}
    cells = [Cell(*corners) for corners in one.cells.tolist()]
    classes = (*_COLOURS, *(f"{Kind.FAILED}: {ending}" for ending in _FAILURES))
    return Drawn(
        one,
        f"/maps/{one.key}",
        axes_data(
            (FRAME["left"], FRAME["top"], FRAME["right"], FRAME["bottom"]),
            across.ends,
            up.ends,
            (one.plane.x.label, one.plane.y.label),
        ),
        tuple(block for cell in cells for block in _blocks(cell, labels, across, up)),
        _border(one, cells, labels, across, up),
        tuple(_Dot(across.place(row.column), up.place(row.row), _title(one, row)) for row in one.points),
        tuple(
            _Curve(line.label, _polyline(line.x, line.y, across, up), dash)
            for line, dash in zip(one.lines, _DASHES * 2, strict=False)
        ),
        across.ticks(),
        up.ticks(),
        tuple((label, colour_of(label)) for label in classes if label in labels.values()),
    )


def _quarters(cell: Cell) -> list[tuple[Node, tuple[float, float, float, float]]]:
    """The corners of a cell with the quarter each stands for: left, right, bottom, top."""
    middle_x, middle_y = (cell.left + cell.right) / 2, (cell.bottom + cell.top) / 2
    return [
        (
            (i, j),
            (min(i, middle_x), max(i, middle_x), min(j, middle_y), max(j, middle_y)),
        )
        for i, j in cell.corners
    ]


def _blocks(cell: Cell, labels: dict[Node, str], across: _Scale, up: _Scale) -> list[_Block]:
    """A cell as one rectangle, or as four where its corners are not of one class."""
    seen = {labels[node] for node in cell.corners}
    if len(seen) == 1:
        return [_block((cell.left, cell.right, cell.bottom, cell.top), seen.pop(), across, up)]
    return [_block(box, labels[node], across, up) for node, box in _quarters(cell)]


def _block(box: tuple[float, float, float, float], label: str, across: _Scale, up: _Scale) -> _Block:
    left, right = across.place(box[0]), across.place(box[1])
    low, high = up.place(box[2]), up.place(box[3])
    return _Block(left, high, round(right - left, 2), round(low - high, 2), colour_of(label))


def _border(one: Map, cells: Sequence[Cell], labels: dict[Node, str], across: _Scale, up: _Scale) -> str:
    """The path between quarters of different classes, on the lattice of half places."""
    columns, rows = 2 * (len(one.plane.x.values) - 1), 2 * (len(one.plane.y.values) - 1)
    grid = np.empty((columns, rows), dtype=object)
    for cell in cells:
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


def _title(one: Map, row: Row) -> str:
    """What a reader sees who points at a point."""
    where = ", ".join(f"{axis.label} = {value:.4g}" for axis, value in _coordinates(one, row))
    return f"{where}; {row.steps} steps, refine {row.refine}: {row.label}. {row.sentence}"


def _coordinates(one: Map, row: Row) -> tuple[tuple[Axis, float], tuple[Axis, float]]:
    x, y = one.plane.x, one.plane.y
    return (x, x.values[row.column]), (y, y.values[row.row])
