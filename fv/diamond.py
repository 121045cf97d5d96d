"""The part of the diffusive flux that FiPy's two-point term cannot see.

Across a face with area vector S and centroid distance D, the over-relaxed split S = |S|^2/(D.S) D + T leaves
T tangential to the face.  The two-point part goes into FiPy's DiffusionTerm; T.grad a is the difference of
the face's two vertex values, which are interpolated from the cells around each vertex by least squares,
exactly for linear fields.  Without it the scheme does not converge on triangles.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from fv.mesh import Faces


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
