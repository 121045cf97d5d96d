"""Lagrange triangles as VTK numbers them: P_k fields on curved cells, by their values at equispaced nodes.

What is stored of a run is such a field.  Vertices come first, then the inner nodes of the edges 0-1, 1-2 and
2-0, then those inside, which are the nodes of a triangle of order k - 3 (`vtkLagrangeTriangle`).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


def nodes(order: int) -> Array:
    """Barycentric coordinates of the nodes of a triangle of order k >= 1, (3, n_local)."""
    return np.array(_lattice(order)).T / order


def _lattice(order: int) -> list[tuple[int, int, int]]:
    """The same times k: whole numbers that add up to k."""
    if order == 0:
        return [(0, 0, 0)]
    ends = order * np.eye(3, dtype=int)
    along = [(ends[i], ends[(i + 1) % 3] - ends[i]) for i in range(3)]
    on_edges = [start + direction * step // order for start, direction in along for step in range(1, order)]
    inside = [np.add(1, node) for node in (_lattice(order - 3) if order >= 3 else [])]
    return [(int(i), int(j), int(k)) for i, j, k in (*ends, *on_edges, *inside)]


def order_of(n_local: int) -> int:
    """The order k of a triangle with (k + 1)(k + 2)/2 nodes; ValueError where there is none."""
    order = round((np.sqrt(8 * n_local + 1) - 3) / 2)
    if order < 1 or (order + 1) * (order + 2) // 2 != n_local:
        raise ValueError(f"no Lagrange triangle has {n_local} nodes")
    return order


@cache
def pieces(order: int) -> Indices:
    """Local nodes (3, k^2) of the triangles into which the nodes cut one of order k, counter-clockwise."""
    number = {node: n for n, node in enumerate(_lattice(order))}

    def at(i: int, j: int) -> int:
        return number[order - i - j, i, j]

    rows = [(i, j) for i in range(order) for j in range(order - i)]
    upright = [(at(i, j), at(i + 1, j), at(i, j + 1)) for i, j in rows]
    turned = [(at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)) for i, j in rows if i + j < order - 1]
    return np.array(upright + turned).T


@dataclass(frozen=True, eq=False)
class Rule:
    """Quadrature points of the reference triangle and the basis of order k there.

    Attributes
    ----------
    weights : (q,), their sum 1/2.
    values : basis functions, (n_local, q).
    slopes : their derivatives, (n_local, 2, q).
    """

    weights: Array
    values: Array
    slopes: Array

    def blend(self, field: Array, cells: Indices) -> Array:
        """Values at the points (..., q, n_cells) of a field (..., N) with nodes cells (n_local, n_cells)."""
        return np.einsum("aq,...ae->...qe", self.values, field[..., cells])

    def dx(self, x: Array, cells: Indices) -> Array:
        """Weights (q, n_cells) of integrals over the cells with node positions x (2, N)."""
        (x_r, x_s), (y_r, y_s) = np.einsum("ajq,iae->ijqe", self.slopes, x[:, cells])
        return self.weights[:, None] * (x_r * y_s - x_s * y_r)


@cache
def rule(order: int, degree: int) -> Rule:
    """Return the basis of order k at the points of a rule that is exact for polynomials of a degree."""
    from skfem import ElementTriP1  # here: most of what reads runs integrates nothing
    from skfem.quadrature import get_quadrature

    points, weights = get_quadrature(ElementTriP1(), degree)
    powers = np.array([(i, n - i) for n in range(order + 1) for i in range(n + 1)]).T

    def monomials(at: Array, lowered: tuple[int, int] = (0, 0)) -> Array:
        """x^i y^j, or its derivative in x or y, (n_local, q)."""
        left = [np.maximum(power - by, 0) for power, by in zip(powers, lowered, strict=True)]
        factor = np.prod([np.where(by, power, 1) for power, by in zip(powers, lowered, strict=True)], axis=0)
        return factor[:, None] * at[0] ** left[0][:, None] * at[1] ** left[1][:, None]

    change = np.linalg.inv(monomials(nodes(order)[1:]))
    if order == 1:
        change = np.rint(change)  # exact: numbers of straight cells are those of `geometry` to the last bit
    slopes = [change @ monomials(points, lowered) for lowered in ((1, 0), (0, 1))]
    return Rule(weights, change @ monomials(points), np.stack(slopes, axis=1))


def areas(x: Array, cells: Indices) -> Array:
    """Areas (n_cells,) of curved cells (n_local, n_cells) with node positions x (2, N)."""
    order = order_of(len(cells))
    return rule(order, 2 * order - 2).dx(x, cells).sum(axis=0)
