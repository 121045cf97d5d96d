"""Reference meshes as plain arrays: disks and sectors with a line of nodes on the ring; measures on them.

Meshes of another origin (`outline.py`) are without layers.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.model import Array

Indices = NDArray[np.int64]


ON_A_LINE = 1e-9
"""How near a mirror line a point of the unit disk counts as on it."""


@dataclass(frozen=True)
class Symmetry:
    """The dihedral group D_k: mirror lines through the origin at the angles start + j pi/k.

    Its sector lies between the first line and the next one; 2 k images of the sector tile the disk.

    Attributes
    ----------
    mirrors : k, at least 1.
    start : angle of the first line, radians.
    """

    mirrors: int
    start: float

    @property
    def angle(self) -> float:
        """Angle of the sector, radians."""
        return np.pi / self.mirrors

    @property
    def images(self) -> Array:
        """The maps (2 k, 2, 2) of the sector onto its images, counter-clockwise from itself.

        Even ones are rotations, odd ones reflections.
        """
        number = np.arange(2 * self.mirrors)
        turned = number % 2 == 0
        angle = np.where(turned, number * self.angle, 2 * self.start + (number + 1) * self.angle)
        cos, sin, sign = np.cos(angle), np.sin(angle), np.where(turned, 1, -1)
        return np.array([[cos, -sign * sin], [sin, sign * cos]]).transpose(2, 0, 1)

    @property
    def sides(self) -> Array:
        """Unit vectors from the origin along the sector's two sides, one a column, (2, 2)."""
        angles = self.start + np.array([0.0, self.angle])
        return np.array([np.cos(angles), np.sin(angles)])

    def on_sides(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (2, n) lie on the first and on the second side, (2, n); the origin is on both."""
        x, y = self.sides
        across = np.outer(x, points[1]) - np.outer(y, points[0])
        return (np.abs(across) < ON_A_LINE) & (self.sides.T @ points > -ON_A_LINE)

    def fold(self, points: Array) -> tuple[Array, Indices]:
        """Return the points (2, n) of the sector that points (2, n) are images of, and which image, (n,)."""
        angle = np.remainder(np.arctan2(points[1], points[0]) - self.start, 2 * np.pi)
        image = np.minimum(angle // self.angle, 2 * self.mirrors - 1).astype(np.int64)
        return np.einsum("nij,in->jn", self.images[image], points), image


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangulation of the reference cell or of a sector of it; it never changes, only node positions do.

    Attributes
    ----------
    xi : reference (material) positions of the nodes, (2, N).
    triangles : node numbers of each cell, counter-clockwise, (3, n_cells).
    h : the width of a layer, the length every order is measured in.
    symmetry : of a sector, whose straight sides are its first two mirror lines; None for a whole cell.
    layered : whether its layers are circles about the origin, as `disk`'s; sides are straight else, but for
        `arcs`, and the outline need not be a circle.
    given_normals : see `normals`, of a mesh that was refined: its outline has lost what it says of them.
    origin : the name of the file a user's mesh was read from and a hash of its nodes and cells; else empty.
    """

    xi: Array
    triangles: Indices
    h: float
    symmetry: Symmetry | None = None
    layered: bool = True
    origin: str = ""
    given_normals: Array | None = None

    @cached_property
    def rim(self) -> Indices:
        """Rim edges (2, n_rim), oriented and chained counter-clockwise: edge i ends where i+1 starts.

        The chain is closed on a disk and open on a sector, whose rim is its arc.
        """
        edges, on_side = self._boundary
        following = dict(edges[:, ~on_side].T.tolist())
        first = following.keys() - set(following.values())
        chain = [min(first or following)]
        while (successor := following.get(chain[-1], chain[0])) != chain[0] and len(chain) <= len(following):
            chain.append(successor)
        if len(chain) != len(following) + len(first):
            raise ValueError("the mesh has more than one boundary loop")
        return np.array([chain[:-1], chain[1:]] if first else [chain, np.roll(chain, -1)])

    @cached_property
    def rim_nodes(self) -> Indices:
        """Rim nodes in counter-clockwise order: (n_rim,) on a disk, (n_rim + 1,) on a sector."""
        return self.rim[0] if self.symmetry is None else np.append(self.rim[0], self.rim[1, -1])

    @cached_property
    def normals(self) -> Array:
        """Outward normals of the reference rim at its nodes, of any length, zero elsewhere, (2, N).

        On the unit circle the rays; where other sides meet, the integral of phi_i n ds: their mean by length.
        """
        if self.given_normals is not None:
            return self.given_normals
        start, end = self.xi[:, self.rim[0]], self.xi[:, self.rim[1]]
        across = np.array([(end - start)[1], -(end - start)[0]])
        before = np.roll(across, 1, axis=1)
        rays = start * (np.hypot(*across) + np.hypot(*before))
        on_arc = np.abs(np.hypot(*self.xi[:, self.rim]) - 1) < ON_A_CIRCLE
        on_arc = on_arc.all(axis=0) & np.roll(on_arc.all(axis=0), 1)
        normals = np.zeros_like(self.xi)
        normals[:, self.rim[0]] = np.where(on_arc, rays, across + before)
        return normals

    @cached_property
    def sides(self) -> Indices:
        """Edges on the straight sides of a sector, oriented counter-clockwise, (2, n); none on a disk."""
        edges, on_side = self._boundary
        return edges[:, on_side]

    @cached_property
    def _boundary(self) -> tuple[Indices, NDArray[np.bool_]]:
        """Boundary edges (2, n), counter-clockwise, and which of them are on a straight side, (n,)."""
        edges = np.hstack([self.triangles[[i, (i + 1) % 3]] for i in range(3)])
        directed = {(int(i), int(j)) for i, j in edges.T}
        outer = np.array([(i, j) for i, j in directed if (j, i) not in directed]).T
        if self.symmetry is None:
            return outer, np.zeros(outer.shape[1], dtype=bool)
        on = self.symmetry.on_sides(self.xi)
        first, second = on[:, outer[0]] & on[:, outer[1]]
        return outer, first | second

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
    return Mesh(_on_circles(points, refine, l0, np.pi / 2, rotation), triangles, 2.0**-refine)


def sector(refine: int, l0: float, symmetry: Symmetry, rotation: float = 0.0) -> Mesh:
    """Return the sector of the unit disk that a symmetry leaves, in layers like `disk`'s.

    One mirror line leaves a half, two quadrants of the disk that starts at the line.  An even number of lines
    leaves one quadrant, whatever it is: a narrower sector of the same topology would cost the same.  Both are
    parts of `disk(refine, l0, rotation)` where a line is an axis of it.  An odd number from 3 on leaves one
    quadrant's topology in an angle pi/k.

    Parameters
    ----------
    refine, l0, rotation : as for `disk`.
    symmetry : the mesh's own is the part of it that is used.
    """
    quarters = (symmetry.start + symmetry.angle * np.arange(symmetry.mirrors) - rotation) / (np.pi / 2)
    start, mirrors = symmetry.start, 2 if symmetry.mirrors % 2 == 0 else symmetry.mirrors
    on_axis = np.flatnonzero(np.abs(quarters - np.rint(quarters)) < ON_A_LINE)
    if mirrors < 3 and on_axis.size:
        start = float(rotation + np.pi / 2 * np.rint(quarters[on_axis[0]]))
    used, quadrants = Symmetry(mirrors, start), 2 if mirrors == 1 else 1
    points, triangles = _refined_diamond(refine)
    kept = (points[1] >= 0) & ((points[0] >= 0) | (quadrants == 2))
    xi = _on_circles(points[:, kept], refine, l0, used.angle / quadrants, start)
    number = np.cumsum(kept) - 1
    return Mesh(xi, number[triangles[:, kept[triangles].all(axis=0)]], 2.0**-refine, used)


def unfold(mesh: Mesh) -> Mesh:
    """Return the disk that a sector and its images tile; nodes that images share are one."""
    assert mesh.symmetry is not None
    place = shared_nodes(mesh.symmetry, mesh.xi)
    xi = np.empty((2, place.max() + 1))
    xi[:, place] = np.einsum("wij,jn->iwn", mesh.symmetry.images, mesh.xi)
    mirrored = mesh.triangles[[0, 2, 1]]
    cells = [nodes[mesh.triangles if even else mirrored] for nodes, even in zip(place, cycle((True, False)))]
    return Mesh(xi, np.hstack(cells), mesh.h)


def shared_nodes(symmetry: Symmetry, xi: Array) -> Indices:
    """Number the images of a sector's points xi (2, N), (2 k, N): a point on a side is in two, or in all."""
    image = np.arange(2 * symmetry.mirrors)[:, None]
    first, second = symmetry.on_sides(xi)
    # an image with an odd number shares its second side with the one before it, its first with the next
    owner = np.where(image % 2 == 0, image, np.where(second, image - 1, np.where(first, image + 1, image)))
    owner = np.where(first & second, 0, owner % image.size)
    numbers: Indices = np.unique(owner * xi.shape[1] + np.arange(xi.shape[1]), return_inverse=True)[1]
    return numbers.reshape(owner.shape)


def _on_circles(points: Array, refine: int, l0: float, quadrant: float, start: float) -> Array:
    """Positions (2, n) of points of the diamond: layers on circles, a quadrant's angle as given, radians."""
    layers = 2**refine
    norm1 = np.abs(points).sum(axis=0)
    layer = np.rint(norm1 * layers)
    radius = np.interp(layer, [0, _ring(layers, l0), layers], [0.0, l0, 1.0])
    x, y = points / np.where(norm1 > 0, norm1, 1.0)
    fraction = np.where(y >= 0, np.where(x >= 0, y, 1 - x), np.where(x < 0, 2 - y, 3 + x))
    angle = quadrant * fraction + start
    return radius * np.array([np.cos(angle), np.sin(angle)])


def _ring(layers: int, l0: float) -> int:
    """Which of so many layers ends on |xi| = l0."""
    return min(max(round(l0 * layers), 1), layers - 1)


def layer_widths(refine: int, l0: float) -> tuple[float, float]:
    """Width of the layers of `disk` inside and outside of the ring."""
    layers = 2**refine
    return l0 / _ring(layers, l0), (1 - l0) / (layers - _ring(layers, l0))


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


ON_A_CIRCLE = 1e-6
"""How near the unit circle or the ring a node of a mesh without layers counts as on it: files round."""


def arcs(xi: Array, triangles: Indices, ring: float) -> NDArray[np.bool_]:
    """Which sides of a mesh without layers are arcs, (3, n_cells): side i joins corners i and i + 1.

    Those of the outline whose ends are on the unit circle, and those that divide the inside of the ring from
    the outside, both ends on it.  All others are straight.
    """
    start, end = triangles, np.roll(triangles, -1, axis=0)
    keys = np.minimum(start, end) * xi.shape[1] + np.maximum(start, end)
    _, side, cells = np.unique(keys, return_inverse=True, return_counts=True)
    side = side.reshape(triangles.shape)
    outside = np.hypot(*xi[:, triangles].mean(axis=1)) > ring
    outer = np.bincount(side.ravel(), np.tile(outside, 3))

    def on(radius: float) -> NDArray[np.bool_]:
        near = np.abs(np.hypot(*xi) - radius) < ON_A_CIRCLE
        both: NDArray[np.bool_] = near[start] & near[end]
        return both

    found: NDArray[np.bool_] = (on(1.0) & (cells == 1)[side]) | (
        on(ring) & ((cells == 2) & (outer == 1))[side]
    )
    return found


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
        inside, target = nearest_in_polygon(mesh, point)
        d0, d1, d2 = (p - target[:, None] for p in (p0, p1, p2))
        bary = np.array([d1[0] * d2[1] - d1[1] * d2[0], d2[0] * d0[1] - d2[1] * d0[0], np.zeros_like(twice)])
        bary[:2] /= twice
        bary[2] = 1 - bary[0] - bary[1]
        cell = int(np.argmax(bary.min(axis=0)))
        weight = bary[:, cell] if inside else np.clip(bary[:, cell], 0, 1)
        cells.append(cell)
        weights.append(weight / weight.sum())
    return np.array(cells, dtype=np.int64), np.array(weights).reshape(-1, 3).T


def nearest_in_polygon(mesh: Mesh, point: Array) -> tuple[bool, Array]:
    """Whether the point lies in the reference polygon, and the polygon's point nearest to it."""
    start, end = mesh.xi[:, mesh.rim[0]], mesh.xi[:, mesh.rim[1]]
    edge, offset = end - start, point[:, None] - start
    across = edge[0] * offset[1] - edge[1] * offset[0]
    if np.all(across >= 0):
        return True, point
    if not mesh.layered:  # an outline need not be convex: it winds once around its points
        up = (offset[1] >= 0) & (end[1] > point[1]) & (across > 0)
        down = (offset[1] < 0) & (end[1] <= point[1]) & (across < 0)
        if up.sum() != down.sum():
            return True, point
    along = np.clip((edge * offset).sum(axis=0) / (edge**2).sum(axis=0), 0, 1)
    nearest = start + along * edge
    return False, nearest[:, np.argmin(np.hypot(*(nearest - point[:, None])))]
