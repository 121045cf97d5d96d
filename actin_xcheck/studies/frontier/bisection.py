"""Borders between classes of points on a lattice, found by bisection of the cells that they cross.

The lattice is finite: its finest cells are one place wide.  Coarse cells come first; a cell whose known
points are not of one class is split in every direction in which it is wider than one place.  Points on its
sides count too, for a neighbour may have found a border that its own corners do not see.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

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
