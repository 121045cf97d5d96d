"""Lagrange triangles: P_k fields on curved cells, by their values at nodes, equispaced or Gauss-Lobatto
ones.

What is stored of a run are values at equispaced nodes, as VTK numbers them (`vtkLagrangeTriangle`):
vertices first, then the inner nodes of the edges 0-1, 1-2 and 2-0, then those inside, which are the nodes
of a triangle of order k - 3.

What is computed with has scikit-fem's order, and Gauss-Lobatto nodes on edges.  Uniform nodes are the same
for k <= 2.  For larger k they would cost order twice: the area of a curved disk would converge at order 4
and 6 instead of 2 k for k = 3 and 4; and a closure that holds rim *nodes* to a direction lets test
functions slip in between, by a polynomial that vanishes at an edge's nodes, against which the tangential
traction does work. Only at Gauss-Lobatto nodes is that polynomial orthogonal to degree k - 2; velocities
would converge at order k - 1/2 in L2 instead of k + 1.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss

from actin_xcheck.core.contract import Grid
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array

TABLED = 19
"""Degree up to which the rule of fewest points is tabled."""


def nodes(order: int) -> Array:
    """Barycentric coordinates of the nodes of a triangle of order k >= 1, (3, n_local)."""
    return np.array(lattice(order)).T / order


def lattice(order: int) -> list[tuple[int, int, int]]:
    """The same times k, node by node: whole numbers that add up to k."""
    if order == 0:
        return [(0, 0, 0)]
    ends = order * np.eye(3, dtype=int)
    along = [(ends[i], ends[(i + 1) % 3] - ends[i]) for i in range(3)]
    on_edges = [start + direction * step // order for start, direction in along for step in range(1, order)]
    inside = [np.add(1, node) for node in (lattice(order - 3) if order >= 3 else [])]
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
    number = {node: n for n, node in enumerate(lattice(order))}

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
    points, weights = quadrature(degree)
    return Rule(weights, *Basis(nodes(order))(points))


def quadrature(degree: int) -> tuple[Array, Array]:
    """Points (2, q) of the reference triangle and weights (q,), exact for polynomials of a degree."""
    if degree <= TABLED:
        degrees, x, y, weights = _tabled()
        of = degrees == max(degree, 2)
        return np.array([x[of], y[of]]), weights[of]
    z, w = leggauss(degree // 2 + 2)  # on a square one side of which is pressed into a corner
    s, left = (1 + z) / 2, (1 - z)[:, None] / 2
    points = np.array([s * left, np.broadcast_to((1 - left), (s.size, s.size))])
    return points.reshape(2, -1), (w * w[:, None] * left / 4).ravel()


@cache
def _tabled() -> Array:
    """Degrees, places and weights of tabled rules one after another, (4, n)."""
    return np.loadtxt(Path(__file__).with_name("triangle_rules.csv"), delimiter=",", unpack=True)


class Basis:
    """The Lagrange basis of order k with nodes of given barycentric coordinates (3, n_local).

    Parameters
    ----------
    nodes : where one function is 1 and all others are 0.
    """

    def __init__(self, nodes: Array) -> None:
        self.order = order_of(nodes.shape[1])
        self._change = np.linalg.inv(_modes(self.order, nodes[1:])[0])

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Values (n_local, q) and slopes (n_local, 2, q) at points (2, q) of the reference triangle."""
        if self.order == 1:  # exact: numbers of straight cells are those of `geometry` to the last bit
            slopes = np.array([[-1.0, -1], [1, 0], [0, 1]])
            values = np.array([1 - points[0] - points[1], points[0], points[1]])
            return values, np.repeat(slopes[..., None], points.shape[1], axis=2)
        found = self._change @ _modes(self.order, points)
        return found[0], found[1:].swapaxes(0, 1)


def _modes(order: int, points: Array) -> Array:
    """Orthogonal polynomials of degrees up to k on the triangle and both slopes, (3, n_local, q).

    Legendre's along one side, scaled by the distance from the corner across, times Jacobi's in that distance
    (Dubiner, J. Sci. Comput. 6, 1991), by their recurrences; each number is carried with its slopes.
    """
    x, y = (np.array([at, np.full_like(at, i == 0), np.full_like(at, i == 1)]) for i, at in enumerate(points))
    one = np.zeros_like(x)
    one[0] = 1

    def times(f: Array, g: Array) -> Array:
        return np.array([f[0] * g[0], f[1] * g[0] + f[0] * g[1], f[2] * g[0] + f[0] * g[2]])

    along, width, across = 2 * x + y - one, one - y, 2 * y - one
    square = times(width, width)
    sides = [one, along]
    for n in range(1, order):
        sides.append(((2 * n + 1) * times(along, sides[n]) - n * times(square, sides[n - 1])) / (n + 1))
    found = []
    for i in range(order + 1):
        a = 2 * i + 1
        jacobi = [one, ((a + 2) * across + a * one) / 2]
        for n in range(1, order - i):
            m = 2 * n + a
            ahead = (m + 1) * (m * (m + 2) * times(across, jacobi[n]) + a * a * jacobi[n])
            jacobi.append(
                (ahead - 2 * n * (n + a) * (m + 2) * jacobi[n - 1]) / (2 * (n + 1) * (n + a + 1) * m)
            )
        scale = np.sqrt(2 * i + 1)
        found += [scale * np.sqrt(i + j + 1) * times(sides[i], jacobi[j]) for j in range(order + 1 - i)]
    return np.array(found).swapaxes(0, 1)


def sizes_by_degree(order: int, field: Array) -> Array:
    """Root mean squares, over the reference triangles of all cells, of a field's parts of degrees 0 to k.

    Of values (..., n_local, n_cells) at the equispaced nodes of order k; the parts are (..., k + 1).
    """
    modes = np.linalg.solve(_modes(order, nodes(order)[1:])[0].T, field)
    of = np.array([i + j for i in range(order + 1) for j in range(order + 1 - i)])
    parts = [(modes[..., of == degree, :] ** 2).sum(axis=-2).mean(axis=-1) for degree in range(order + 1)]
    return np.sqrt(np.stack(parts, axis=-1))


def areas(x: Array, cells: Indices) -> Array:
    """Areas (n_cells,) of curved cells (n_local, n_cells) with node positions x (2, N)."""
    order = order_of(len(cells))
    return rule(order, 2 * order - 2).dx(x, cells).sum(axis=0)


def gradient(rule: Rule, field: Array, x: Array, cells: Indices) -> Array:
    """Derivatives (k, 2, q, n_cells) in x at the points of a rule, of a field (k, N) on nodes at x (2, N)."""
    jacobian = np.einsum("ajq,iae->qeij", rule.slopes, x[:, cells])
    slopes = np.einsum("ajq,kae->qekj", rule.slopes, field[:, cells])
    return np.einsum("qekj,qeji->kiqe", slopes, np.linalg.inv(jacobian))


HIGHEST = 8
"""The largest k."""

EDGES = ((0, 1), (1, 2), (0, 2))
"""Local vertices at the ends of a cell's edges, along which their nodes are numbered."""


class Lagrange:
    """P_k by its nodes.

    Attributes
    ----------
    order : k.
    uniform : barycentric coordinates of equispaced nodes, vertices first, then edge by edge, (3, n_local).
    nodes : those of the nodes, (3, n_local).
    """

    def __init__(self, order: int) -> None:
        self.order = order
        numbers = np.array(lattice(order)).T
        numbers[:, 2 * order + 1 : 3 * order] = numbers[:, 2 * order + 1 : 3 * order][:, ::-1]
        self.uniform = numbers / order
        if order < 5:
            on_edge = (numbers == 0).any(axis=0)
            self.nodes = np.where(on_edge, lobatto(order)[numbers], self.uniform)
        else:
            self.nodes = np.array([_spread(tuple(node)) for node in numbers.T.tolist()]).T
        self._basis = Basis(self.nodes)

    def tabulate(self, points: Array) -> tuple[Array, Array]:
        """Basis functions (n_local, q) and their slopes (n_local, 2, q) at reference points (2, q)."""
        return self._basis(points)


@cache
def lagrange(order: int) -> Lagrange:
    """Return the element of order k, 1 to `HIGHEST`."""
    return Lagrange(order)


@cache
def lobatto(order: int) -> Array:
    """The k + 1 Gauss-Lobatto points of [0, 1]."""
    inner = np.real(Legendre.basis(order).deriv().roots())
    return np.concatenate([[0.0], (1 + inner) / 2, [1.0]])


def _spread(node: tuple[int, ...]) -> Array:
    """Barycentric coordinates of a node by its whole ones, on simplices of any dimension.

    The mean of where the faces would have it, each as far as the node is from the corner across: on edges
    Gauss-Lobatto nodes, inside well-conditioned ones (Isaac, SIAM J. Sci. Comput. 42, 2020).
    """
    if len(node) == 1:
        return np.ones(1)
    order, place, total = sum(node), np.zeros(len(node)), 0.0
    for i, number in enumerate(node):
        weight = lobatto(order)[order - number] if order else 1.0
        place[np.arange(len(node)) != i] += weight * _spread(node[:i] + node[i + 1 :])
        total += weight
    return place / total


def least_dilation(grid: Grid, x: Array) -> tuple[float, Array]:
    """The smallest 1 + phi on a grid whose nodes are at x (2, N), and the material point (2,) it is at.

    From F = dx/dxi the dilation is phi = 2 - tr F^-1, as in the pressure (2.5).
    """
    points = rule(grid.order, 2 * grid.order)
    before, now = (np.einsum("ajq,iae->ijqe", points.slopes, at[:, grid.cells]) for at in (grid.xi, x))
    (x_r, x_s), (y_r, y_s) = now
    adjugate = np.array([[y_s, -x_s], [-y_r, x_r]])
    trace = np.einsum("ijqe,jiqe->qe", before, adjugate) / (x_r * y_s - x_s * y_r)
    where = np.unravel_index(trace.argmax(), trace.shape)
    return float(3 - trace[where]), points.blend(grid.xi, grid.cells)[:, where[0], where[1]]
