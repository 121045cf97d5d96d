"""The deformation gradient on a free rim's faces, carried where the load sees the dilation there.

Of F = dx/dxi a face knows what becomes of its own edge.  What becomes of its normal at rest, F N, a
difference towards the cell's middle tells to first order only.  It is a state of its own instead,

    d(F N)/dt = (grad v) F N,

with grad v along the edge from its ends' velocities, and across it from the traction that the force balance
has found on the face: (sigma_v + sigma_e) n of (2.3) and (2.4) is linear in the derivative across.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from actin_xcheck.core.model import Array, Model
from fv.mesh import Faces
from fv.stress import divergence, normal_derivative, traction

STEP = 1e-4
"""Of the difference that finds an initial displacement's slope, of second order and from inside."""


class RimFaces:
    """F N on the rim's faces, (2, n_rim).

    Parameters
    ----------
    model : moduli.
    faces : of the reference mesh.
    on_rim : which of its boundary's faces are on the rim, (n_boundary,).
    """

    def __init__(self, model: Model, faces: Faces, on_rim: NDArray[np.bool_]) -> None:
        self.model = model
        self.faces = faces.rim[on_rim]
        self._start, self._end = faces.nodes[:, self.faces]
        xi = faces.mesh.xi
        self._edge, self._middle = self._edges(xi), (xi[:, self._start] + xi[:, self._end]) / 2
        self.normals = np.array([self._edge[1], -self._edge[0]]) / np.hypot(*self._edge)

    def start(self, u0: Callable[[Array], Array]) -> Array:
        """F N (2, n_rim) of an initial displacement of material points, (2, n) -> (2, n)."""
        here, near, far = (u0(self._middle - n * STEP * self.normals) for n in range(3))
        return self.normals + (3 * here - 4 * near + far) / (2 * STEP)

    def grad_u(self, x: Array, across: Array) -> Array:
        """I - F^-1 (2, 2, n_rim) with vertices at x (2, N)."""
        edge = self._edges(x)
        determinant = edge[0] * across[1] - edge[1] * across[0]
        dual_edge = np.array([across[1], -across[0]]) / determinant
        dual_across = np.array([-edge[1], edge[0]]) / determinant
        inverse = self._edge[:, None] * dual_edge + self.normals[:, None] * dual_across
        return np.eye(2)[:, :, None] - inverse

    def dilation(self, x: Array, across: Array) -> Array:
        """The dilation (n_rim,)."""
        return divergence(self.grad_u(x, across))

    def rate(self, x: Array, v: Array, across: Array, force: Array) -> Array:
        """(grad v) F N (2, n_rim).

        Parameters
        ----------
        x, v : positions and velocities of the vertices, (2, N).
        across : F N.
        force : traction times length of the faces, (2, n_rim).
        """
        viscous, elastic = self.model.viscous_moduli(), self.model.elastic_moduli()
        edge = self._edges(x)
        length = np.hypot(*edge)
        tangent, n = edge / length, np.array([edge[1], -edge[0]]) / length
        along = (self._edges(v) / length)[:, None] * tangent
        known = traction(along, n, viscous) + traction(self.grad_u(x, across), n, elastic)
        grad_v = along + normal_derivative(force / length - known, n, viscous)[:, None] * n
        rate: Array = (grad_v * across).sum(axis=1)
        return rate

    def read(self, other: "RimFaces", across: Array) -> Array:
        """F N (2, n_rim) from that of another mesh of the disk."""
        return np.asarray(around(other._middle, across)(on_angles(self._middle)).T, np.float64)

    def _edges(self, nodal: Array) -> Array:
        """Differences (2, n_rim) of vertex values (2, N) along the faces."""
        difference: Array = nodal[:, self._end] - nodal[:, self._start]
        return difference


def on_angles(points: Array) -> Array:
    """Angles (n,) of points (2, n), from 0 to 2 pi."""
    return np.remainder(np.arctan2(points[1], points[0]), 2 * np.pi)


def around(points: Array, values: Array) -> CubicSpline:
    """The periodic spline of the angle through values (2, n) at points (2, n) around the origin."""
    angles = on_angles(points)
    order = np.argsort(angles)
    order = np.append(order, order[0])
    turns = np.append(angles[order[:-1]], angles[order[0]] + 2 * np.pi)
    return CubicSpline(turns, values[:, order].T, bc_type="periodic")
