"""The closures: which way each rim node may move, and what keeps the system solvable.

A tied node moves along one direction only: both of its components are one free unknown, weighted.  The
prolongation P from free unknowns q to nodal vectors thus has one entry a row, and P^T L P q = P^T F leaves no
force along the directions left free.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.geometry import Indices
from actin_xcheck.model import Array, Closure
from fem.kernels import Pattern, bincount
from fem.space import Space


def rim_directions(closure: Closure, space: Space, x: Array) -> Array:
    """Unit directions (2, n_rim) in which rim nodes may move; see `Closure` for each reading.

    Parameters
    ----------
    closure : the reading; a `traction-free` rim moves freely, its three tied nodes take their rays.
    space : on the reference disk.
    x : current node positions (2, N).
    """
    rim = space.rim_nodes
    match closure:
        case Closure.REFERENCE_NORMAL | Closure.TRACTION_FREE:
            # the normal of the non-deformed circle (B.7): a rim point keeps to its ray
            direction = space.xi[:, rim]
        case Closure.CURRENT_NORMAL:
            # n_i proportional to the integral of phi_i n ds; for P1 the chord between the neighbours, turned
            direction = space.rim_vectors.vector(space.on_rim.at(x).normal_load(1.0)).reshape(-1, 2)[rim].T
        case Closure.IRROTATIONAL_WALL:
            direction = np.array([-x[1, rim], x[0, rim]])
    return direction / np.hypot(*direction)


class Constraint:
    """The free unknowns of a closure and the reduced system in them; the pattern is fixed, weights move.

    Parameters
    ----------
    closure : which nodes are tied, and how.
    space : on the reference disk.
    """

    def __init__(self, closure: Closure, space: Space) -> None:
        self.closure = closure
        self.space = space
        self._which = np.arange(space.rim_nodes.size)
        if closure is Closure.TRACTION_FREE:
            # three rim points on their rays take the rigid motions out; the balance puts the right ones back
            self._which = np.arange(3) * space.rim_nodes.size // 3
        self.tied = space.rim_nodes[self._which]
        components = np.full(space.xi.shape[1], 2)
        components[self.tied] = 1
        first = np.cumsum(components) - components
        self.unknown: Indices = np.stack([first, first + components - 1], axis=1).ravel()
        """The free unknown behind each component of a nodal vector, (2 N,)."""
        self.parts = np.repeat(space.parts, components)
        """The space's dissection of nodes, by free unknown, (n_free,)."""
        self._full = space.vectors.pattern
        self.pattern = Pattern(
            self.unknown[self._full.rows], self.unknown[self._full.columns], int(components.sum())
        )

    def weights(self, x: Array) -> Array:
        """What each component takes of its free unknown, (2 N,)."""
        weights = np.ones((x.shape[1], 2))
        weights[self.tied] = rim_directions(self.closure, self.space, x)[:, self._which].T
        return weights.ravel()

    def reduce(self, weights: Array, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """P^T L P (n_free, n_free) of a matrix L (2 N, 2 N) summed by the space's own pattern."""
        return self.pattern.sum(matrix.data * weights[self._full.rows] * weights[self._full.columns])

    def restrict(self, weights: Array, load: Array) -> Array:
        """P^T F (n_free,) of a load F (2 N,)."""
        return bincount(self.unknown, weights * load, self.pattern.size)

    def prolongation(self, x: Array) -> sp.csr_matrix:
        """Sparse map P (2 N, n_free) from free unknowns to interleaved nodal vectors."""
        return sp.csr_matrix((self.weights(x), self.unknown, np.arange(self.unknown.size + 1)))


def settle(closure: Closure, space: Space, x: Array) -> Array:
    """Put rim nodes that slid along the wall back onto it; other closures leave positions alone.

    Valid to first order in the amplitude, which is all `irrotational-wall` is for.
    """
    if closure is not Closure.IRROTATIONAL_WALL:
        return x
    rim = space.rim_nodes
    settled = x.copy()
    settled[:, rim] *= np.hypot(*space.xi[:, rim]) / np.hypot(*x[:, rim])
    return settled


def rigid_motions(x: Array, centre: Array) -> Array:
    """Two translations and the rotation about `centre` (2,), as interleaved vectors (2 N, 3)."""
    motions = np.zeros((2 * x.shape[1], 3))
    motions[0::2, 0] = 1
    motions[1::2, 1] = 1
    motions[0::2, 2] = -(x[1] - centre[1])
    motions[1::2, 2] = x[0] - centre[0]
    return motions
