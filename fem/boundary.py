"""The closures: which way each rim node may move, and what keeps the system solvable.

A tied node moves along one direction only: both of its components are one free unknown, weighted.  The
prolongation P from free unknowns q to nodal vectors thus has one entry a row, and P^T L P q = P^T F leaves no
force along the directions left free.

The straight sides of a sector are mirror lines: v.n = 0 and no shear traction; nodes slide along them.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.linear import Pattern, bincount
from actin_xcheck.core.mesh import Indices, Symmetry
from actin_xcheck.core.model import Array, Closure
from fem.space import Space


def rim_directions(closure: Closure, space: Space, x: Array) -> Array:
    """Unit directions (2, n_rim) in which rim nodes may move; see `Closure` for each reading.

    Parameters
    ----------
    closure : the reading; a `traction-free` rim moves freely, its three tied nodes take their rays.
    space : on the reference cell, or on a sector, where the rim's ends keep to their sides instead.
    x : current node positions (2, N).
    """
    rim = space.rim_nodes
    match closure:
        case Closure.REFERENCE_NORMAL:
            # the normal of the non-deformed outline (B.7): on a circle a rim point keeps to its ray
            direction = space.rim_normals
        case Closure.TRACTION_FREE:
            direction = space.xi[:, rim]
        case Closure.CURRENT_NORMAL:
            # n_i proportional to the integral of phi_i n ds; for P1 the chord between the neighbours, turned
            direction = space.rim_vectors.vector(space.on_rim.at(x).normal_load(1.0)).reshape(-1, 2)[rim].T
        case Closure.IRROTATIONAL_WALL:
            direction = np.array([-x[1, rim], x[0, rim]])
    return direction / np.hypot(*direction)


def along_sides(closure: Closure, space: Space) -> tuple[Indices, Array]:
    """The nodes (n,) on a sector's sides and how they may move: a unit direction each, or zero, (2, n).

    A node on two mirror lines stays where it is.  So does a rim node on the wall of `irrotational-wall`, and
    one of a free half disk, which could slide along its mirror line: the balance puts that motion back.
    """
    if space.symmetry is None:
        return np.zeros(0, dtype=np.int64), np.zeros((2, 0))
    first, second = space.symmetry.on_sides(space.xi)
    still = first & second & (space.symmetry.mirrors > 1)
    if closure is Closure.IRROTATIONAL_WALL:
        still[space.rim_nodes[[0, -1]]] = True
    elif closure is Closure.TRACTION_FREE and space.symmetry.mirrors == 1:
        still[space.rim_nodes[0]] = True
    nodes = np.flatnonzero(first | second)
    along = space.symmetry.sides[:, np.where(first, 0, 1)]
    return nodes, np.where(still, 0.0, along)[:, nodes]


class Constraint:
    """The free unknowns of a closure and the reduced system in them; the pattern is fixed, weights move.

    Parameters
    ----------
    closure : which nodes are tied, and how.
    space : on the reference cell or a sector.
    """

    def __init__(self, closure: Closure, space: Space) -> None:
        self.closure = closure
        self.space = space
        self._which = np.arange(space.rim_nodes.size)
        if closure is Closure.TRACTION_FREE:
            # three rim points on their rays take the rigid motions out; the balance puts the right ones back
            self._which = _a_third_apart(space)
        self.tied = space.rim_nodes[self._which]
        self.on_sides, self._along = along_sides(closure, space)
        components = np.full(space.xi.shape[1], 2)
        components[self.tied] = 1
        components[self.on_sides] = self._along.any(axis=0)
        first = np.cumsum(components) - components
        size = int(components.sum())
        # a node that stays has no unknown; it names one, with weight zero
        unknowns = np.stack([first, first + np.maximum(components, 1) - 1], axis=1)
        self.unknown: Indices = np.minimum(unknowns, size - 1).ravel()
        """The free unknown behind each component of a nodal vector, (2 N,)."""
        self.of_cells = self.unknown[space.vectors.of_cells]
        """The same of each cell, (2, n_local, n_cells)."""
        self.parts = np.repeat(space.parts, components)
        """The space's dissection of nodes, by free unknown, (n_free,)."""
        full, moves = space.vectors.pattern, np.repeat(components > 0, 2)
        self._kept = np.flatnonzero(moves[full.rows] & moves[full.columns])
        self._rows, self._columns = full.rows[self._kept], full.columns[self._kept]
        self.pattern = Pattern(self.unknown[self._rows], self.unknown[self._columns], size)

    def weights(self, x: Array) -> Array:
        """What each component takes of its free unknown, (2 N,)."""
        weights = np.ones((x.shape[1], 2))
        weights[self.tied] = rim_directions(self.closure, self.space, x)[:, self._which].T
        weights[self.on_sides] = self._along.T
        return weights.ravel()

    def reduce(self, weights: Array, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """P^T L P (n_free, n_free) of a matrix L (2 N, 2 N) summed by the space's own pattern."""
        return self.pattern.sum(matrix.data[self._kept] * weights[self._rows] * weights[self._columns])

    def restrict(self, weights: Array, load: Array) -> Array:
        """P^T F (n_free,) of a load F (2 N,)."""
        return bincount(self.unknown, weights * load, self.pattern.size)

    def prolongation(self, x: Array) -> sp.csr_matrix:
        """Sparse map P (2 N, n_free) from free unknowns to interleaved nodal vectors."""
        return sp.csr_matrix((self.weights(x), self.unknown, np.arange(self.unknown.size + 1)))


def _a_third_apart(space: Space) -> Indices:
    """Three of the rim nodes by their places in `rim_nodes`, about 120 degrees apart; none of a sector's."""
    if space.symmetry is not None:
        return np.zeros(0, dtype=np.int64)
    if space.normals is None:
        return np.arange(3) * space.rim_nodes.size // 3
    x, y = space.xi[:, space.rim_nodes]
    angle = np.remainder(np.arctan2(y, x) - np.arctan2(y[0], x[0]), 2 * np.pi)
    thirds = np.arange(3)[:, None] * 2 * np.pi / 3
    return np.where(angle <= thirds, angle, -1.0).argmax(axis=1)


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


def free_motions(symmetry: Symmetry | None) -> Array:
    """The rigid motions that mirror lines allow, by columns of translations and rotation (3, 3, 1 or 0)."""
    if symmetry is None:
        return np.eye(3)
    along = symmetry.sides[:, :1] if symmetry.mirrors == 1 else np.zeros((2, 0))
    return np.vstack([along, np.zeros(along.shape[1])])


def rigid_motions(x: Array, centre: Array) -> Array:
    """Two translations and the rotation about `centre` (2,), as interleaved vectors (2 N, 3)."""
    motions = np.zeros((2 * x.shape[1], 3))
    motions[0::2, 0] = 1
    motions[1::2, 1] = 1
    motions[0::2, 2] = -(x[1] - centre[1])
    motions[1::2, 2] = x[0] - centre[0]
    return motions
