"""Traction of an isotropic stress on the faces of moving triangles, by diamond gradients.

At a face with area vector S, vertices A and B, and a place on either side (a cell's centroid; on the boundary
the face's own midpoint) the gradient G of a velocity follows from two differences, G.D = v_R - v_L between
the places and G.E = v_B - v_A along the face: exact for linear fields.  With g = S/(D.S), the first one gives
the traction (m1/2) (G + G^T) S + m2 tr(G) S a part K (v_R - v_L) with

    K = (m1/2) |S|^2/(D.S) I + (m1/2 + m2) S S^T/(D.S),

symmetric and positive: sums of FiPy's diffusion terms, one for each pair of components.  The second one is
the cross part, of the values at the vertices.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.linear import Pattern
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from fv.mesh import Faces

Moduli = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Diamonds:
    """The faces of one configuration.

    Attributes
    ----------
    faces : the mesh's.
    first, second : the places on both sides of each face, (n_faces,).
    places : positions of all places, (2, n_places).
    area : S, out of the first place, (2, n_faces).
    distance, edge : D and E, (2, n_faces).
    """

    faces: Faces
    first: Indices
    second: Indices
    places: Array
    area: Array
    distance: Array
    edge: Array

    @classmethod
    def at(cls, faces: Faces, x: Array) -> "Diamonds":
        """With nodes at x (2, N)."""
        first, second = faces.cells[0], faces.places
        start, end = x[:, faces.nodes[0]], x[:, faces.nodes[1]]
        places = np.hstack([x[:, faces.mesh.triangles].mean(axis=1), (start + end)[:, faces.rim] / 2])
        edge = end - start
        area = np.array([edge[1], -edge[0]])
        return cls(faces, first, second, places, area, places[:, second] - places[:, first], edge)

    @property
    def reach(self) -> Array:
        """D.S (n_faces,): positive where the places are on the sides they should be on."""
        dot: Array = (self.distance * self.area).sum(axis=0)
        return dot

    def gradient(self, at_places: Array, at_vertices: Array) -> Array:
        """Gradients (2 components, 2, n_faces) of a field known at places and vertices, both (2, n)."""
        across = self.area / self.reach
        along = np.array([-self.distance[1], self.distance[0]]) / self.reach
        between = at_places[:, self.second] - at_places[:, self.first]
        start, end = self.faces.nodes
        gradients: Array = (
            between[:, None] * across + (at_vertices[:, end] - at_vertices[:, start])[:, None] * along
        )
        return gradients

    def two_point(self, moduli: Moduli) -> Array:
        """K of every face, (2, 2, n_faces)."""
        m1, m2 = moduli
        s, unit = self.area, np.eye(2)[:, :, None]
        blocks: Array = (m1 / 2 * (s * s).sum(axis=0) * unit + (m1 / 2 + m2) * s[:, None] * s) / self.reach
        return blocks

    def cross(self, moduli: Moduli) -> Array:
        """X of every face, (2, 2, n_faces): X (v_B - v_A) is the traction's other part."""
        m1, m2 = moduli
        s, along = self.area, np.array([-self.distance[1], self.distance[0]]) / self.reach
        unit = np.eye(2)[:, :, None]
        blocks: Array = m1 / 2 * ((s * along).sum(axis=0) * unit + along[:, None] * s) + m2 * (
            s[:, None] * along
        )
        return blocks


def divergence(gradient: Array) -> Array:
    """The trace (n,) of gradients (2, 2, n)."""
    trace: Array = gradient[0, 0] + gradient[1, 1]
    return trace


def traction(gradient: Array, area: Array, moduli: Moduli) -> Array:
    """(m1/2) (G + G^T) S + m2 tr(G) S (2, n) of gradients G (2, 2, n) on areas S (2, n)."""
    m1, m2 = moduli
    strain = (gradient + gradient.swapaxes(0, 1)) / 2
    found: Array = m1 * (strain * area).sum(axis=1) + m2 * divergence(gradient) * area
    return found


def normal_derivative(stress: Array, n: Array, moduli: Moduli) -> Array:
    """The g (2, n) whose gradient g n has a traction (2, n) on unit normals n (2, n).

    (m1/2) (g + n n.g) + m2 n n.g = stress.
    """
    m1, m2 = moduli
    normal = (stress * n).sum(axis=0) * n
    derivative: Array = (stress - normal) * 2 / m1 + normal / (m1 + m2)
    return derivative


class Assembly:
    """Sums of what faces do to the places on both sides, on a fixed topology.

    Rows and columns of places and of vertices are interleaved components.  A face takes from its first place
    what it gives to its second one: columns of the matrices sum to zero.

    Parameters
    ----------
    faces : the mesh's.
    unknown : the unknown behind each component of each place, (2 n_places,).
    size : number of unknowns.
    """

    def __init__(self, faces: Faces, unknown: Indices, size: int) -> None:
        self._sides = np.stack([faces.cells[0], faces.places])
        self._count = unknown.size // 2
        self._unknown = unknown
        places = 2 * self._sides[:, None] + np.arange(2)[:, None]  # (2 sides, 2 components, n_faces)
        shape = (2, 2, *places.shape)
        self._row = np.broadcast_to(places[:, :, None, None], shape).ravel()
        self._column = np.broadcast_to(places[None, None], shape).ravel()
        self.pattern = Pattern(unknown[self._row], unknown[self._column], size)
        ends = 2 * faces.nodes[:, None] + np.arange(2)[:, None]
        columns = np.broadcast_to(ends[None, None], shape).ravel()
        self._crossing = Pattern(self._row, columns, unknown.size, 2 * faces.mesh.xi.shape[1])

    def two_point(self, blocks: Array, weights: Array) -> sp.csr_matrix:
        """The matrix in the unknowns, positive, of K (2, 2, n_faces) and the places' weights."""
        signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
        entries = signs[:, None, :, None, None] * blocks[None, :, None]
        return self.pattern.sum(entries.ravel() * weights[self._row] * weights[self._column])

    def cross(self, blocks: Array) -> sp.csr_matrix:
        """The matrix (2 n_places, 2 N), from vertex values, of X (2, 2, n_faces)."""
        # first place: minus the traction; its difference is the end's value minus the start's
        signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
        entries = signs[:, None, :, None, None] * blocks[None, :, None]
        return self._crossing.sum(entries.ravel())

    def load(self, tractions: Array) -> Array:
        """What tractions (2, n_faces) out of the first places do to all places, (2, n_places)."""
        first, second = self._sides
        return np.array(
            [np.bincount(first, t, self._count) - np.bincount(second, t, self._count) for t in tractions]
        )
