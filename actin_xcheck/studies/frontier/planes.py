"""The planes in which frontiers are drawn, and the run that a point of one stands for.

A run at another psi ends after as many growth times as the scene's own: time is measured in 1/(k_a + f'/mu),
with f' = sigma'(1) the slope of the active stress (3.9), which is what the fastest growth is bounded by.  At
the scene's psi this is the scene's own end.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Laws
from actin_xcheck.runs.method import Method, find_method
from actin_xcheck.runs.numerics import Numerics, seconds_of
from actin_xcheck.scene.scene import Scene
from actin_xcheck.theory.dispersion import sigma_prime

REFINE = 4
"""Layers of P1 elements and finite volumes where h is not varied; P_k have the same nodes on fewer layers."""

STEPS = 160
"""Steps of a run where dt is not varied: Fig. 14's as published."""

MOST_STEPS = 500
"""Runs of more steps are not made: the budget of a point."""

H_LAYERS = 5
"""Finest mesh where h is varied: 2**5 layers of P1 elements, the article's 2113 nodes."""

CLOUD = 64
"""Points at which concentrations and positions are compared."""


@dataclass(frozen=True)
class Axis:
    """One direction of a plane.

    Attributes
    ----------
    name : "psi", "p", "h" or "dt".
    values : all places along it, increasing.
    stride : places between those that are looked at first.
    log : whether they are evenly spaced in the logarithm.
    """

    name: str
    values: tuple[float, ...]
    stride: int
    log: bool

    @property
    def label(self) -> str:
        """What is written beside it."""
        return {"psi": "ψ", "dt": "Δt"}.get(self.name, self.name)


PLANES = ("psi,dt", "psi,h", "dt,h", "psi,p")
"""By name: what is varied across and what upwards."""


@dataclass(frozen=True)
class Plane:
    """Two axes for one method."""

    x: Axis
    y: Axis

    @property
    def name(self) -> str:
        """One of `PLANES`."""
        return f"{self.x.name},{self.y.name}"

    def at(self, column: int, row: int) -> dict[str, float]:
        """Coordinates of a place by the axes' names."""
        return {self.x.name: self.x.values[column], self.y.name: self.y.values[row]}


@dataclass(frozen=True)
class Point:
    """What one run of a method is asked: a scene at some psi and p, a mesh, equal steps.

    Attributes
    ----------
    scene : TOML of the scene at this psi and p, with its own end and `cloud` as its probes.
    name : of that scene.
    psi, p, end : what it states.
    method, refine, steps : the run.
    """

    scene: str
    name: str
    psi: float
    p: float
    end: float
    method: str
    refine: int
    steps: int

    @property
    def dt(self) -> float:
        """The time step."""
        return self.end / self.steps

    @property
    def within_budget(self) -> bool:
        """Whether it is run at all."""
        return self.steps <= MOST_STEPS

    @property
    def file(self) -> str:
        """Where its scene lies in the report's folder."""
        return f"scenes/{self.name}.toml"

    @property
    def seconds(self) -> float:
        """About what it takes."""
        return seconds_of(find_method(self.method), self.refine, self.steps)

    @property
    def numerics(self) -> Numerics:
        """How it is run."""
        return Numerics(find_method(self.method), self.refine, self.dt)

    @property
    def command(self) -> str:
        """What makes the run again, from the folder of the report."""
        return self.numerics.command(self.file, "point.vtkhdf")


def plane_of(name: str, method: Method) -> Plane:
    """Return a plane for a method; UserError lists the valid names."""
    if name not in PLANES:
        raise UserError(f"--over: {name!r} is not a plane; valid: {' '.join(PLANES)}")
    axes = {
        "psi": _logarithmic("psi", 10.0, 1e4, 6),
        "dt": _logarithmic("dt", 1e-4, 1e-1, 6),
        "p": Axis("p", tuple(np.linspace(-1.5, 1.5, 25).tolist()), 4, log=False),
        "h": Axis("h", tuple(2.0**-n for n in range(layers(H_LAYERS, method), 0, -1)), 1, log=True),
    }
    x, y = name.split(",")
    return Plane(axes[x], axes[y])


DEPTH = 3
"""How often a cell is halved along psi and dt."""


def _logarithmic(name: str, low: float, high: float, cells: int) -> Axis:
    values = np.geomspace(low, high, cells * 2**DEPTH + 1)
    return Axis(name, tuple(float(f"{value:.6g}") for value in values), 2**DEPTH, log=True)


def layers(refine: int, method: Method) -> int:
    """The refinement at which a method has about the nodes that P1 elements have at `refine`; at least 1."""
    return max(1, refine - round(math.log2(method.space)))


def pace(scene: Scene, psi: float) -> float:
    """k_a + sigma'(1)/mu at some psi: the inverse of the time that runs are measured in."""
    parameters = replace(scene.parameters, psi=psi)
    return scene.physics.reaction_rate() + sigma_prime(parameters) / parameters.mu


def end_at(scene: Scene, psi: float) -> float:
    """When a run at some psi ends: after as many growth times as the scene."""
    return scene.time.end * pace(scene, scene.parameters.psi) / pace(scene, psi)


def point_of(scene: Scene, method: Method, given: dict[str, float], refine: int = REFINE) -> Point:
    """Return the run at coordinates of a plane; what is not given is the scene's, `refine` or `STEPS`."""
    psi, p = given.get("psi", scene.parameters.psi), given.get("p", scene.parameters.p)
    end = float(f"{end_at(scene, psi):.9g}")
    name = f"{scene.name[:40]}--psi-{psi:.6g}--p-{p:.6g}"
    refine = round(-math.log2(given["h"])) if "h" in given else layers(refine, method)
    steps = math.ceil(end / given["dt"] * (1 - 1e-9)) if "dt" in given else STEPS
    text = _moved(scene, name, psi, p, end)
    return Point(text, name, psi, p, end, method.name, refine, max(steps, 1))


def check(scene: Scene) -> None:
    """Raise UserError where psi and p would mean nothing, or nothing that is the same for all."""
    if scene.motion is not None:
        why, valid = "moves as prescribed, whatever psi is", "a scene whose force balance moves the cell"
    elif scene.initial.eigenmode is not None:
        why, valid = "starts on a mode, another one at every psi", "a scene that writes out its initial a"
    elif scene.laws.laws != Laws():
        why, valid = (
            "has laws of its own",
            "a scene with the article's, of which planes of psi and p are drawn",
        )
    elif scene.parameters.psi <= 0:
        why, valid = "has no contractility to scale its time by", "a scene with psi > 0"
    else:
        return
    raise UserError(f"--scene: {scene.name} {why}; valid: {valid}")


def cloud() -> tuple[tuple[float, float], ...]:
    """Points of the unit disk, each for an equal part of its area: a sunflower's seeds."""
    number = np.arange(CLOUD)
    r, theta = np.sqrt((number + 0.5) / CLOUD), number * np.pi * (3 - np.sqrt(5))
    x, y = np.round(r * np.cos(theta), 6), np.round(r * np.sin(theta), 6)
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def _moved(scene: Scene, name: str, psi: float, p: float, end: float) -> str:
    """TOML of the scene at another psi and p, without what it expects."""
    moved = {
        "name": name,
        "parameters": asdict(replace(scene.parameters, psi=psi, p=p)),
        "time": {"end": end},
        "probes": {"points": [list(point) for point in cloud()]},
    }
    return scene.varied(moved | dict.fromkeys(("dimensional", "expect", "as_published"))).text


Node = tuple[int, int]
"""A place of the lattice: column and row."""


@dataclass(frozen=True)
class Cell:
    """A rectangle of the lattice, by its first and last column and row."""

    left: int
    right: int
    bottom: int
    top: int

    @property
    def corners(self) -> tuple[Node, ...]:
        """Its four corners."""
        return tuple(product((self.left, self.right), (self.bottom, self.top)))

    def holds(self, node: tuple[float, float]) -> bool:
        """Whether a place lies in it or on its sides."""
        return self.left <= node[0] <= self.right and self.bottom <= node[1] <= self.top

    def parts(self) -> tuple["Cell", ...]:
        """Its halves or quarters; none where it is one place wide in both directions."""
        across, up = _halves(self.left, self.right), _halves(self.bottom, self.top)
        if len(across) == len(up) == 1:
            return ()
        return tuple(Cell(*columns, *rows) for columns, rows in product(across, up))


def _halves(first: int, last: int) -> tuple[tuple[int, int], ...]:
    middle = (first + last) // 2
    return ((first, last),) if middle == first else ((first, middle), (middle, last))


class Bisection:
    """The search for borders on a lattice: asks for the classes of points until no cell needs more.

    Parameters
    ----------
    columns, rows : places of the lattice.
    across, up : width and height of the first cells in places; each divides the lattice's.

    Attributes
    ----------
    cells : that tile the lattice so far.
    found : class by place; None where nobody looked, which no border is drawn against.
    """

    def __init__(self, columns: int, rows: int, across: int, up: int) -> None:
        if (columns - 1) % across or (rows - 1) % up:
            raise ValueError(f"cells of {across} x {up} do not tile a lattice of {columns} x {rows} places")
        self.cells = [
            Cell(i, i + across, j, j + up)
            for i, j in product(range(0, columns - 1, across), range(0, rows - 1, up))
        ]
        self.found: dict[Node, str | None] = {}

    def wanted(self) -> list[Node]:
        """Split what must be split and return the places whose class is missing; none when all is known."""
        while True:
            parts = {cell: cell.parts() for cell in self.cells if self._differs(cell)}
            if not any(parts.values()):
                return sorted({node for cell in self.cells for node in cell.corners} - self.found.keys())
            self.cells = [part for cell in self.cells for part in parts.get(cell) or (cell,)]

    def tell(self, classes: Mapping[Node, str | None]) -> None:
        """Take in the classes of places."""
        self.found.update(classes)

    def class_at(self, column: float, row: float) -> str | None:
        """The class of the nearest corner of the cell that holds a place between those of the lattice.

        Of those that were looked at; None where none of the cell's was.
        """
        cell = next(cell for cell in self.cells if cell.holds((column, row)))
        return nearest_class(cell, {node: self.found[node] for node in cell.corners}, column, row)

    def _differs(self, cell: Cell) -> bool:
        """Whether a cell with known corners has points of more than one class."""
        if any(node not in self.found for node in cell.corners):
            return False
        seen = {known for node, known in self.found.items() if known is not None and cell.holds(node)}
        return len(seen) > 1


def nearest_class(cell: Cell, corners: Mapping[Node, str | None], column: float, row: float) -> str | None:
    """The class at the corner of a cell nearest to a place in it, in units of the cell, of those known."""

    def distance(node: Node) -> float:
        width, height = cell.right - cell.left, cell.top - cell.bottom
        return max(abs(node[0] - column) / width, abs(node[1] - row) / height)

    known = [node for node in corners if corners[node] is not None]
    return corners[min(known, key=distance)] if known else None
