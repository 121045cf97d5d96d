"""The part of the diffusive flux that FiPy's two-point term cannot see.

Across a face with area vector S and centroid distance D, the over-relaxed split S = |S|^2/(D.S) D + T leaves
T tangential to the face.  The two-point part goes into FiPy's DiffusionTerm; T.grad a is the difference of
the face's two vertex values, which are interpolated from the cells around each vertex by least squares,
exactly for linear fields.  Without it the scheme does not converge on triangles.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.geometry import Indices
from actin_xcheck.model import Array
from fv.mesh import Faces


def over_relaxed(faces: Faces, x: Array) -> Array:
    """Two-point coefficients |S|^2/(D.S) of the interior faces, (n_interior,)."""
    area, distance = faces.geometry(x)
    return (area**2).sum(axis=0) / (area * distance).sum(axis=0)


def two_point(faces: Faces, x: Array) -> Array:
    """The coefficients |S|/|D| of a plain two-point flux, (n_interior,): inconsistent on triangles."""
    area, distance = faces.geometry(x)
    return np.hypot(*area) / np.hypot(*distance)


def vertex_interpolation(faces: Faces, x: Array) -> sp.csr_matrix:
    """Linear-exact interpolation from cell averages to vertices, (N, n_cells).

    A least-squares plane through the centroids around each vertex; cells at the rim are mirrored across
    their rim face, which carries n.grad a = 0 (2.1f) into the fit.
    """
    vertex, cell, place = _stencil(faces, x)
    offset = place - x[:, vertex]
    terms = np.array([np.ones(vertex.size), *offset])
    count = x.shape[1]
    normal = np.array(
        [[np.bincount(vertex, terms[i] * terms[j], count) for i in range(3)] for j in range(3)]
    ).transpose(2, 0, 1)
    value = np.linalg.solve(normal, np.broadcast_to(np.array([[1.0], [0], [0]]), (count, 3, 1)))[..., 0]
    weights = (value[vertex].T * terms).sum(axis=0)
    return sp.csr_matrix((weights, (vertex, cell)), shape=(count, faces.mesh.triangles.shape[1]))


def _stencil(faces: Faces, x: Array) -> tuple[Indices, Indices, Array]:
    """Triples (vertex, cell, place of the cell's value), with the mirror images at the rim."""
    triangles = faces.mesh.triangles
    centroids = x[:, triangles].mean(axis=1)
    start, end = faces.nodes[:, faces.rim]
    owner = faces.cells[0, faces.rim]
    edge = x[:, end] - x[:, start]
    normal = np.array([edge[1], -edge[0]]) / np.hypot(*edge)
    height = ((centroids[:, owner] - x[:, start]) * normal).sum(axis=0)
    mirrored = centroids[:, owner] - 2 * height * normal
    every = np.arange(triangles.shape[1])
    vertex = np.concatenate([*triangles, start, end])
    cell = np.concatenate([every, every, every, owner, owner])
    place = np.hstack([centroids, centroids, centroids, mirrored, mirrored])
    return vertex, cell, place


def cross_flux(faces: Faces, x: Array, to_vertices: sp.csr_matrix) -> sp.csr_matrix:
    """Matrix (n_cells, n_cells) of the net tangential inflow sum_f T.grad a into each cell."""
    area, distance = faces.geometry(x)
    tangential = area - (area**2).sum(axis=0) / (area * distance).sum(axis=0) * distance
    start, end = faces.nodes[:, faces.interior]
    edge = x[:, end] - x[:, start]
    flux = (tangential * edge).sum(axis=0) / (edge**2).sum(axis=0)
    first, second = faces.cells[:, faces.interior]
    rows = np.concatenate([first, first, second, second])
    columns = np.concatenate([end, start, end, start])
    values = np.concatenate([flux, -flux, -flux, flux])
    shape = (faces.mesh.triangles.shape[1], x.shape[1])
    return sp.csr_matrix((values, (rows, columns)), shape=shape) @ to_vertices


def reconstruct(triangles: Indices, a: Array, vertex_values: Array) -> Array:
    """Linear field in each cell with mean a (n_cells,) and the vertex values' gradient: (3, n_cells)."""
    corners = vertex_values[triangles]
    return corners - corners.mean(axis=0) + a
