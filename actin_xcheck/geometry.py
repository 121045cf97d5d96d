"""Reference meshes as plain arrays: disks with a line of nodes on the ring, and what one measures on them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.model import Array
from actin_xcheck.result import COMPLETED, Ending, Outcome

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangulation of the reference disk; it never changes, only node positions do.

    Attributes
    ----------
    xi : reference (material) positions of the nodes, (2, N).
    triangles : node numbers of each cell, counter-clockwise, (3, n_cells).
    h : the width of a layer, the length every order is measured in.
    """

    xi: Array
    triangles: Indices
    h: float

    @cached_property
    def rim(self) -> Indices:
        """Rim edges (2, n_rim), oriented and chained counter-clockwise: edge i ends where i+1 starts."""
        edges = np.hstack([self.triangles[[i, (i + 1) % 3]] for i in range(3)])
        directed = {(int(i), int(j)) for i, j in edges.T}
        following = {i: j for i, j in directed if (j, i) not in directed}
        chain = [min(following)]
        while (successor := following[chain[-1]]) != chain[0]:
            chain.append(successor)
        if len(chain) != len(following):
            raise ValueError("the mesh has more than one boundary loop")
        return np.array([chain, np.roll(chain, -1)])

    @cached_property
    def rim_nodes(self) -> Indices:
        """Rim nodes in counter-clockwise order, (n_rim,)."""
        return self.rim[0]

    @cached_property
    def centroids(self) -> Array:
        """Reference centroids of the cells, (2, n_cells)."""
        return self.xi[:, self.triangles].mean(axis=1)


def disk(refine: int, l0: float, rotation: float = 0.0) -> Mesh:
    """Return the unit disk with 2**refine layers, one of them exactly on |xi| = l0.

    The topology is that of scikit-fem's `MeshTri.init_circle(refine)` (refine 5 has the article's 2113
    nodes, 6 its 8321), whose k-th layer has 4k nodes.  Here layer k is a true circle with equal angles,
    its radius piecewise linear in k such that the layer nearest l0 lies on it: an unfitted Heaviside (2.6)
    would cost the order of convergence.

    Parameters
    ----------
    refine : number of uniform refinements of the square of four triangles, >= 1.
    l0 : radius of the ring, in (0, 1).
    rotation : angle by which the mesh is turned, radians.
    """
    points, triangles = _refined_diamond(refine)
    layers = 2**refine
    norm1 = np.abs(points).sum(axis=0)
    layer = np.rint(norm1 * layers)
    ring = min(max(round(l0 * layers), 1), layers - 1)
    radius = np.interp(layer, [0, ring, layers], [0.0, l0, 1.0])
    x, y = points / np.where(norm1 > 0, norm1, 1.0)
    fraction = np.where(y >= 0, np.where(x >= 0, y, 1 - x), np.where(x < 0, 2 - y, 3 + x))
    angle = np.pi / 2 * fraction + rotation
    return Mesh(radius * np.array([np.cos(angle), np.sin(angle)]), triangles, 1 / layers)


def _refined_diamond(refine: int) -> tuple[Array, Indices]:
    """The diamond |x| + |y| <= 1 refined uniformly: lattice points with |i| + |j| <= 2**refine."""
    n = 2**refine
    i, j = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1), indexing="ij")
    inside = np.abs(i) + np.abs(j) <= n
    number = np.full(i.shape, -1)
    number[inside] = np.arange(inside.sum())

    def triangles(signs: tuple[int, int]) -> Indices:
        """Cells of one quadrant: lower ones point away from the origin, upper ones towards it."""
        si, sj = signs
        k, m = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        lower, upper = k + m < n, k + m < n - 1

        def node(di: int, dj: int, keep: NDArray[np.bool_]) -> Indices:
            return number[n + si * (k[keep] + di), n + sj * (m[keep] + dj)]

        cells = np.hstack(
            [
                [node(0, 0, lower), node(1, 0, lower), node(0, 1, lower)],
                [node(1, 1, upper), node(0, 1, upper), node(1, 0, upper)],
            ]
        )
        return cells if si * sj > 0 else cells[[0, 2, 1]]

    quadrants = [triangles(signs) for signs in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return np.array([i[inside], j[inside]]) / n, np.hstack(quadrants)


def signed_areas(x: Array, triangles: Indices) -> Array:
    """Signed areas (n_cells,) of the triangles with node positions x (2, N); negative where inverted."""
    p0, p1, p2 = x[:, triangles[0]], x[:, triangles[1]], x[:, triangles[2]]
    e1, e2 = p1 - p0, p2 - p0
    return 0.5 * (e1[0] * e2[1] - e1[1] * e2[0])


def integral(x: Array, triangles: Indices, corners: Array) -> float:
    """Integral over the cell at x (2, N) of a piecewise linear field with corner values (3, n_cells)."""
    return float(signed_areas(x, triangles) @ corners.mean(axis=0))


def orientation(mesh: Mesh, t: float, x: Array) -> Outcome:
    """Check every triangle of a moved mesh: `tangled` names the worst one where any has lost its area."""
    areas = signed_areas(x, mesh.triangles)
    if not np.isfinite(areas).all():
        return Outcome(Ending.NON_FINITE, f"node positions are not finite at t = {t:.6g}")
    worst = int(np.argmin(areas))
    if areas[worst] > 0:
        return COMPLETED
    where = mesh.centroids[:, worst]
    message = (
        f"triangle {worst}, which started at ({where[0]:.3f}, {where[1]:.3f}), has signed area "
        f"{areas[worst]:.2e} at t = {t:.6g}"
    )
    return Outcome(Ending.TANGLED, message)


INTERIOR_POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
"""Barycentric points of the three-point rule, exact for quadratics with equal weights."""


def quadrature_points(x: Array, triangles: Indices) -> Array:
    """Points (2, 3, n_cells) of the three-point rule in the cells with node positions x (2, N)."""
    return np.einsum("qc,dcn->dqn", INTERIOR_POINTS, x[:, triangles])


def locate(mesh: Mesh, points: Array) -> tuple[Indices, Array]:
    """Find material points (2, k) in the reference mesh: their cells (k,) and barycentric weights (3, k).

    A point outside the polygon (between a chord and the circle) is replaced by its nearest point.
    """
    cells, weights = [], []
    p0, p1, p2 = (mesh.xi[:, nodes] for nodes in mesh.triangles)
    twice = 2 * signed_areas(mesh.xi, mesh.triangles)
    for point in points.T:
        inside, target = _nearest_in_polygon(mesh, point)
        d0, d1, d2 = (p - target[:, None] for p in (p0, p1, p2))
        bary = np.array([d1[0] * d2[1] - d1[1] * d2[0], d2[0] * d0[1] - d2[1] * d0[0], np.zeros_like(twice)])
        bary[:2] /= twice
        bary[2] = 1 - bary[0] - bary[1]
        cell = int(np.argmax(bary.min(axis=0)))
        weight = bary[:, cell] if inside else np.clip(bary[:, cell], 0, 1)
        cells.append(cell)
        weights.append(weight / weight.sum())
    return np.array(cells, dtype=np.int64), np.array(weights).reshape(-1, 3).T


def _nearest_in_polygon(mesh: Mesh, point: Array) -> tuple[bool, Array]:
    """Whether the point lies in the (convex, reference) polygon, and the polygon's point nearest to it."""
    start, end = mesh.xi[:, mesh.rim[0]], mesh.xi[:, mesh.rim[1]]
    edge, offset = end - start, point[:, None] - start
    if np.all(edge[0] * offset[1] - edge[1] * offset[0] >= 0):
        return True, point
    along = np.clip((edge * offset).sum(axis=0) / (edge**2).sum(axis=0), 0, 1)
    nearest = start + along * edge
    return False, nearest[:, np.argmin(np.hypot(*(nearest - point[:, None])))]
