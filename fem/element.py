"""Lagrange elements P_k on the reference triangle, on scikit-fem's, with Gauss-Lobatto nodes on edges.

Uniform nodes are the same for k <= 2.  For k = 3 and 4 they would cost order twice: the area of a curved disk
would converge at order 4 and 6 instead of 2 k; and a closure that holds rim *nodes* to a direction lets test
functions slip in between, by a polynomial that vanishes at an edge's nodes, against which the tangential
traction does work.  Only at Gauss-Lobatto nodes is that polynomial orthogonal to degree k - 2; velocities
would converge at order k - 1/2 in L2 instead of k + 1.
"""

from functools import cache

import numpy as np
from numpy.polynomial.legendre import Legendre
from skfem import ElementTriP1, ElementTriP2, ElementTriP3, ElementTriP4

from actin_xcheck.core.model import Array

UNIFORM = {1: ElementTriP1(), 2: ElementTriP2(), 3: ElementTriP3(), 4: ElementTriP4()}
"""scikit-fem's elements by order k: their numbering and their polynomials are ours."""


class Lagrange:
    """P_k by its nodes.

    Attributes
    ----------
    order : k.
    nodes : barycentric coordinates of the nodes, vertices first, (3, n_local).
    """

    def __init__(self, order: int) -> None:
        self.order = order
        uniform = barycentric(UNIFORM[order].doflocs.T)
        inner = np.real(Legendre.basis(order).deriv().roots())
        lobatto = np.concatenate([[0.0], (1 + inner) / 2, [1.0]])
        on_edge = np.isclose(uniform, 0).any(axis=0)
        self.nodes = np.where(on_edge, lobatto[np.rint(order * uniform).astype(int)], uniform)
        self._change = np.linalg.inv(_tabulated(order, self.nodes[1:])[0])

    def tabulate(self, points: Array) -> tuple[Array, Array]:
        """Basis functions (n_local, q) and their slopes (n_local, 2, q or 1) at reference points (2, q)."""
        values, slopes = _tabulated(self.order, points)
        if self.order > 2:
            values, slopes = self._change @ values, np.einsum("ab,biq->aiq", self._change, slopes)
        return values, slopes[..., :1] if self.order == 1 else slopes


@cache
def lagrange(order: int) -> Lagrange:
    """Return the element of order k, 1 to 4."""
    return Lagrange(order)


def barycentric(points: Array) -> Array:
    """Barycentric coordinates (3, q) of points (2, q) of the reference triangle."""
    return np.array([1 - points[0] - points[1], points[0], points[1]])


def _tabulated(order: int, points: Array) -> tuple[Array, Array]:
    basis = [UNIFORM[order].lbasis(points, a) for a in range(len(UNIFORM[order].doflocs))]
    values = np.array([np.broadcast_to(value, points.shape[1]) for value, _ in basis])
    return values, np.array([np.broadcast_to(slope, points.shape) for _, slope in basis])
