"""The closures for cell-centred velocities: which way faces and vertices of the boundary may move.

Velocities live at places: the centroids of the cells, then the midpoints of the boundary's faces.  A tied
place moves along one direction only, so that both of its components are one unknown, weighted, and no force
is left along that direction.  Vertices are not unknowns: what is interpolated there is projected.

The straight sides of a sector are mirror lines: v.n = 0 and no shear traction.
"""

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.mesh import Indices, Symmetry
from actin_xcheck.core.model import Array, Closure
from fv.mesh import Faces


class Ties:
    """The unknowns behind the velocities at all places, for a closure on a mesh.

    Parameters
    ----------
    closure : the reading of the rim's conditions.
    faces : the mesh's.

    Attributes
    ----------
    places : cells and boundary faces, in this order.
    unknown : the unknown behind each component of each place, (2 places,).
    size : number of unknowns.
    on_rim : which boundary faces are on the rim, not on a sector's side, (n_boundary,).
    """

    def __init__(self, closure: Closure, faces: Faces) -> None:
        mesh = faces.mesh
        self.closure, self.mesh = closure, mesh
        self._start, self._end = faces.nodes[:, faces.rim]
        self.on_rim: NDArray[np.bool_] = np.ones(faces.rim.size, dtype=bool)
        self._sides = np.zeros((2, mesh.xi.shape[1]), dtype=bool)
        self._along = np.zeros((2, faces.rim.size))
        if mesh.symmetry is not None:
            self._sides = mesh.symmetry.on_sides(mesh.xi)
            on = self._sides[:, self._start] & self._sides[:, self._end]
            self.on_rim = ~(on[0] | on[1])
            self._along = mesh.symmetry.sides[:, np.where(on[0], 0, 1)]
        self.places = mesh.triangles.shape[1] + faces.rim.size
        self._free = self.on_rim & (closure is Closure.TRACTION_FREE)
        components = np.full(self.places, 2)
        components[mesh.triangles.shape[1] :] = np.where(self._free, 2, 1)
        first = np.cumsum(components) - components
        self.components: Indices = components
        self.unknown: Indices = np.stack([first, first + components - 1], axis=1).ravel()
        self.size = int(components.sum())

    def weights(self, x: Array) -> Array:
        """What each component of each place takes of its unknown, with nodes at x (2, N): (2 places,)."""
        directions = np.where(self.on_rim, self._of_faces(x), self._along)
        weights = np.ones((self.places, 2))
        boundary = weights[self.places - self._free.size :]
        boundary[~self._free] = directions[:, ~self._free].T
        return weights.ravel()

    def _of_faces(self, x: Array) -> Array:
        """Unit directions of the boundary's faces as the rim's closure has them, (2, n_boundary)."""
        edge = x[:, self._end] - x[:, self._start]
        match self.closure:
            case Closure.REFERENCE_NORMAL:
                normals = _unit(self.mesh.normals)
                return _unit(normals[:, self._start] + normals[:, self._end])
            case Closure.IRROTATIONAL_WALL:
                return _unit(edge)
            case Closure.CURRENT_NORMAL | Closure.TRACTION_FREE:
                return _unit(np.array([edge[1], -edge[0]]))

    def of_vertices(self, x: Array) -> tuple[Indices, Array]:
        """Tied vertices (n,) and their unit directions, zero where one stays, (2, n), with nodes at x."""
        rim, symmetry = self.mesh.rim_nodes, self.mesh.symmetry
        directions = np.zeros_like(x)
        match self.closure:
            case Closure.REFERENCE_NORMAL:
                directions[:, rim] = _unit(self.mesh.normals[:, rim])
            case Closure.CURRENT_NORMAL:
                directions[:, rim] = _unit(self._normals(x)[:, rim])
            case Closure.IRROTATIONAL_WALL:
                directions[:, rim] = _unit(np.array([-x[1, rim], x[0, rim]]))
            case Closure.TRACTION_FREE:
                rim = rim[:0]
        if symmetry is None:
            return rim, directions[:, rim]
        first, second = self._sides
        still = first & second & (symmetry.mirrors > 1)
        if self.closure is Closure.IRROTATIONAL_WALL:
            still[self.mesh.rim_nodes[[0, -1]]] = True
        on_sides = first | second
        along = np.where(still, 0.0, symmetry.sides[:, np.where(first, 0, 1)])
        directions[:, on_sides] = along[:, on_sides]
        tied = np.union1d(rim, np.flatnonzero(on_sides))
        return tied, directions[:, tied]

    def _normals(self, x: Array) -> Array:
        """Sums of the area vectors of the rim's faces at the vertices they join, (2, N)."""
        start, end = self._start[self.on_rim], self._end[self.on_rim]
        edge = x[:, end] - x[:, start]
        normals = np.zeros_like(x)
        for nodes in (start, end):
            normals[0] += np.bincount(nodes, edge[1], x.shape[1])
            normals[1] -= np.bincount(nodes, edge[0], x.shape[1])
        return normals


def settle(closure: Closure, faces: Faces, x: Array) -> Array:
    """Put rim vertices that slid along the wall back onto it; other closures leave positions alone."""
    if closure is not Closure.IRROTATIONAL_WALL:
        return x
    rim, settled = faces.mesh.rim_nodes, x.copy()
    settled[:, rim] *= np.hypot(*faces.mesh.xi[:, rim]) / np.hypot(*x[:, rim])
    return settled


def free_motions(symmetry: Symmetry | None) -> Array:
    """The rigid motions that mirror lines allow, by columns of translations and rotation (3, 3, 1 or 0)."""
    if symmetry is None:
        return np.eye(3)
    along = symmetry.sides[:, :1] if symmetry.mirrors == 1 else np.zeros((2, 0))
    return np.vstack([along, np.zeros(along.shape[1])])


def rigid_motions(x: Array, centre: Array) -> Array:
    """Two translations and the rotation about `centre` (2,) at points x (2, n): (3, 2, n)."""
    one, zero = np.ones(x.shape[1]), np.zeros(x.shape[1])
    return np.array([[one, zero], [zero, one], [centre[1] - x[1], x[0] - centre[0]]])


def _unit(vectors: Array) -> Array:
    length = np.hypot(*vectors)
    return vectors / np.where(length > 0, length, 1.0)
