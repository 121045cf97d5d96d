"""Lagrange elements P_k on the reference triangle, in scikit-fem's order, with Gauss-Lobatto nodes on edges.

Uniform nodes are the same for k <= 2.  For larger k they would cost order twice: the area of a curved disk
would converge at order 4 and 6 instead of 2 k for k = 3 and 4; and a closure that holds rim *nodes* to a
direction lets test functions slip in between, by a polynomial that vanishes at an edge's nodes, against which
the tangential traction does work.  Only at Gauss-Lobatto nodes is that polynomial orthogonal to degree k - 2;
velocities would converge at order k - 1/2 in L2 instead of k + 1.
"""

from functools import cache

import numpy as np
from numpy.polynomial.legendre import Legendre

from actin_xcheck.core.lagrange import Basis, lattice
from actin_xcheck.core.model import Array

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
