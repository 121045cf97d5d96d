"""The transport equation in FiPy's words, pulled back to the fixed reference mesh.

With J = V/V0 the conservative Lagrangian form d/dt (V a) = sum_f d S.grad a + k (V - V a) + V s is local
but for its flux.  One implicit step is, on the reference mesh, TransientTerm(J (1 + k dt)) ==
DiffusionTerm(c): what decays stands with the new J a, what is gained with the old one, and face
coefficients c carry the moving faces.  FiPy multiplies with V0/dt and sums fluxes, so mass is exact.  Terms
of its own for decay and gain would say the same and double the cost of assembly.

In time there are two uses.  `system` is (B.23b): backward Euler, with the gain k J of polymerisation from
the old configuration.  Both codes then share one error in dt, and what is left between them is space alone.
`stage` is one implicit stage of a Runge-Kutta method: every term on the configuration of the stage.

FiPy's two-point term does not see all of the diffusive flux.  Across a face with area vector S and centroid
distance D, the over-relaxed split S = |S|^2/(D.S) D + T leaves T tangential to the face.  The two-point
part goes into FiPy's DiffusionTerm; T.grad a is the difference of the face's two vertex values, which are
interpolated from the cells around each vertex by least squares, exactly for linear fields.  Without it the
scheme does not converge on triangles.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import Indices, signed_areas
from actin_xcheck.core.model import Array
from fv.mesh import Faces, fipy


class TransportEquation:
    """FiPy's mesh, variables and terms, built once; a step fills in numbers.

    Parameters
    ----------
    faces : the mesh's faces.
    d : diffusion coefficient.
    rate : reaction rate k, 1 or 0.
    """

    def __init__(self, faces: Faces, d: float, rate: float) -> None:
        self.faces = faces
        self.d = d
        self.rate = rate
        mesh = faces.fipy_mesh()
        self.volumes = signed_areas(faces.mesh.xi, faces.mesh.triangles)
        # the old capacity stays 1: the old value of `a` is what the cells start with, per reference area
        self.a = fipy.CellVariable(mesh=mesh, name="a", hasOld=True)
        self.capacity = fipy.CellVariable(mesh=mesh, name="J (1 + k dt)", value=1.0, hasOld=True)
        self.coefficient = fipy.FaceVariable(mesh=mesh, name="c")
        area, distance = faces.geometry(faces.mesh.xi)
        self._reference = np.hypot(*distance) / np.hypot(*area)
        self.equation = fipy.TransientTerm(coeff=self.capacity, var=self.a) == fipy.DiffusionTerm(
            coeff=self.coefficient, var=self.a
        )
        self.equation.cacheMatrix()
        self.equation.cacheRHSvector()

    def system(
        self, dt: float, a: Array, old_volumes: Array, volumes: Array, two_point: Array, source: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """Let FiPy assemble one backward Euler step.

        Parameters
        ----------
        dt : the step.
        a : cell averages before the step, (n_cells,).
        old_volumes, volumes : cell areas before and after the step, (n_cells,).
        two_point : coefficients of (a_second - a_first) at the interior faces, per unit of d, (n_interior,).
        source : cell averages of the source term after the step, (n_cells,).

        Returns
        -------
        FiPy's matrix and right-hand side.
        """
        gain = self.rate * old_volumes + source * volumes
        return self._assemble(dt, old_volumes * a + dt * gain, volumes, two_point)

    def stage(
        self, dt: float, amounts: Array, volumes: Array, two_point: Array, source: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """Let FiPy assemble V a - dt (k (V - V a) + d L a + V s) = P, all over dt, at the time of a stage.

        Parameters
        ----------
        dt : the diagonal coefficient of the method times its step.
        amounts : what earlier stages leave of actin in each cell, P (n_cells,).
        volumes, two_point, source : as for `system`.
        """
        return self._assemble(dt, amounts + dt * (self.rate + source) * volumes, volumes, two_point)

    def _assemble(
        self, dt: float, amounts: Array, volumes: Array, two_point: Array
    ) -> tuple[sp.csr_matrix, Array]:
        """(1 + k dt) V a - dt d (two-point flux) = amounts, all over dt."""
        self.a.old.setValue(amounts / self.volumes)
        self.capacity.setValue((1 + self.rate * dt) * volumes / self.volumes)
        coefficient = np.zeros(self.faces.nodes.shape[1])
        coefficient[self.faces.interior] = self.d * two_point * self._reference
        self.coefficient.setValue(coefficient)
        self.equation.justResidualVector(dt=dt)
        return self.equation.matrix.matrix, np.asarray(self.equation.RHSvector)


def over_relaxed_split(faces: Faces, x: Array) -> tuple[Array, sp.csr_matrix]:
    """Both parts of the flux of grad a through the interior faces.

    Returns
    -------
    The two-point coefficients |S|^2/(D.S), (n_interior,), and the matrix (n_cells, N) of the net tangential
    inflow sum_f T.grad a into each cell from vertex values.
    """
    area, distance = faces.geometry(x)
    start, end = x[:, faces.nodes[0, faces.interior]], x[:, faces.nodes[1, faces.interior]]
    coefficients = (area * area).sum(axis=0) / (area * distance).sum(axis=0)
    edge = end - start
    flux = ((area - coefficients * distance) * edge).sum(axis=0) / (edge * edge).sum(axis=0)
    triangles = faces.mesh.triangles
    data = np.bincount(faces.corners, np.concatenate([flux, -flux, -flux, flux]), triangles.size)
    indptr = np.arange(0, triangles.size + 1, 3)
    shape = (triangles.shape[1], x.shape[1])
    return coefficients, sp.csr_matrix((data, triangles.T.ravel(), indptr), shape)


def over_relaxed(faces: Faces, x: Array) -> Array:
    """Two-point coefficients |S|^2/(D.S) of the interior faces, (n_interior,)."""
    return over_relaxed_split(faces, x)[0]


def two_point(faces: Faces, x: Array) -> Array:
    """The coefficients |S|/|D| of a plain two-point flux, (n_interior,): inconsistent on triangles."""
    area, distance = faces.geometry(x)
    return np.hypot(*area) / np.hypot(*distance)


def vertex_interpolation(faces: Faces, x: Array) -> sp.csr_matrix:
    """Linear-exact interpolation from cell averages to vertices, (N, n_cells).

    A least-squares plane through the centroids around each vertex; cells at the rim are mirrored across
    their rim face, which carries n.grad a = 0 (2.1f) into the fit.
    """
    weights, star = linear_weights(faces, x, _places(faces, x)), faces.star
    # a cell on the rim comes twice, with its mirror image: products sum the two
    return sp.csr_matrix((weights, star.cell, star.indptr), (x.shape[1], faces.mesh.triangles.shape[1]))


def linear_weights(faces: Faces, x: Array, places: Array) -> Array:
    """Weights (k,) of the values of `faces.star`, which are at `places` (2, n), in the vertices' planes.

    About the mean place of its n values a plane's weights are 1/n + (offset of the vertex).S^-1 (offset of
    the value), S being the values' scatter.
    """
    star = faces.star
    first = star.indptr[:-1]
    offset = places[:, star.value] - x[:, star.vertex]
    count = np.diff(star.indptr)
    mean = np.add.reduceat(offset, first, axis=1) / count
    px, py = offset - mean[:, star.vertex]
    xx, xy, yy = (np.add.reduceat(product, first) for product in (px * px, px * py, py * py))
    determinant = xx * yy - xy**2
    slope_x = (yy * mean[0] - xy * mean[1]) / determinant
    slope_y = (xx * mean[1] - xy * mean[0]) / determinant
    weights: Array = (1 / count)[star.vertex] - slope_x[star.vertex] * px - slope_y[star.vertex] * py
    return weights


def _places(faces: Faces, x: Array) -> Array:
    """Centroids of the cells, then those of the cells along the rim mirrored there, (2, n_cells + n_rim)."""
    centroids = x[:, faces.mesh.triangles].mean(axis=1)
    start, end = faces.nodes[:, faces.rim]
    owner = faces.cells[0, faces.rim]
    edge = x[:, end] - x[:, start]
    normal = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
    height = ((centroids[:, owner] - x[:, start]) * normal).sum(axis=0)
    return np.hstack([centroids, centroids[:, owner] - 2 * height * normal])


def cross_flux(faces: Faces, x: Array, to_vertices: sp.csr_matrix) -> sp.csr_matrix:
    """Matrix (n_cells, n_cells) of the net tangential inflow sum_f T.grad a into each cell."""
    return over_relaxed_split(faces, x)[1] @ to_vertices


def reconstruct(triangles: Indices, a: Array, vertex_values: Array) -> Array:
    """Linear field in each cell with mean a (n_cells,) and the vertex values' gradient: (3, n_cells)."""
    corners = vertex_values[triangles]
    return corners - corners.mean(axis=0) + a
