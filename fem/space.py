"""Isoparametric P_k elements on a reference mesh: nodes, cells, rim and the rules that integrate there."""

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from numpy.polynomial.legendre import leggauss

from actin_xcheck.core.lagrange import EDGES, lagrange, lobatto, quadrature
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh, Symmetry, arcs, signed_areas
from actin_xcheck.core.model import Array
from fem.kernels import CellRule, RimRule, Scatter

CORNERS = np.array([[0.0, 1, 0], [0, 0, 1]])
"""Vertices of the reference triangle."""

SIDES = list(permutations(range(3), 2))
"""Directed sides of a triangle, by local vertices."""


LEAF, LARGE_LEAF = 32, 200
"""Nodes that are not worth dissecting further: dense elimination is faster; those on sides of large cells."""

DENSE = 128
"""Nodes of large cells that are not dissected at all: one product is faster than the calls of many."""

CUTS = np.array([[1, 0], [0, 1], [1, 1], [1, -1]])
"""Normals of the lines tried as cuts."""


CELLWISE = 5
"""Order from which on matrices are applied cell by cell: they have few zeros, and basis values are shared."""


@dataclass(frozen=True, eq=False)
class Space:
    """P_k on a mesh; node positions x (2, N) are themselves a P_k field.

    On a layered mesh nodes on layers from the ring outwards are on true circles; inner cells fade to straight
    ones.  On others `geometry.arcs` are curved, and the cells along them.

    Attributes
    ----------
    order : k, 1 to 8.
    xi : reference positions of the nodes, those of the mesh first, (2, N).
    cells : nodes of each cell, its vertices first, (n_local, n_cells).
    orientation : -1 where a cell's vertices run clockwise, else 1, (n_cells,).
    rim : the mesh's rim edges, counter-clockwise, (2, n_rim).
    symmetry : the mesh's, of a sector.
    normals : the mesh's, (2, number of its nodes); None where its rim is the unit circle or an arc of it.
    """

    order: int
    xi: Array
    cells: Indices
    orientation: Array
    rim: Indices
    symmetry: Symmetry | None = None
    normals: Array | None = None

    @classmethod
    def on(cls, mesh: Mesh, order: int, ring: float) -> "Space":
        """Build the space of order k on a mesh; beyond the radius `ring` its layers are circles."""
        # an edge's nodes are numbered from its lower to its higher vertex, hence the sorting
        triangles = np.sort(mesh.triangles, axis=0) if order > 2 else mesh.triangles
        cells = _numbered(triangles, mesh.xi.shape[1], order)
        xi = np.empty((2, cells.max() + 1))
        curved = (_curved if order < 5 else _bent) if mesh.layered else _with_arcs
        xi[:, cells] = curved(mesh, triangles, ring, order)
        xi[:, : mesh.xi.shape[1]] = mesh.xi
        orientation = np.sign(signed_areas(mesh.xi, triangles))
        normals = None if mesh.layered else mesh.normals
        return cls(order, xi, cells, orientation, mesh.rim, mesh.symmetry, normals)

    @cached_property
    def inside(self) -> CellRule:
        """Exact for products of basis functions in straight cells, degree 2 k; loads and masses."""
        return self.rule(2 * self.order)

    @cached_property
    def gradients(self) -> CellRule:
        """Exact for products of gradients in straight cells, degree 2 (k - 1); stiffness and stresses.

        Where matrices are applied cell by cell the same points serve both.
        """
        return self.inside if self.order >= CELLWISE else self.rule(2 * (self.order - 1))

    def rule(self, degree: int) -> CellRule:
        """Points in the cells, exact for polynomials of a degree on straight ones."""
        points, weights = quadrature(degree)
        values, slopes = lagrange(self.order).tabulate(points)
        slopes = slopes[..., : self._slopes]
        signed = weights[:, None] if self.order < 3 else weights[:, None] * self.orientation
        return CellRule(self.cells, signed, values[..., None], slopes[..., None])

    @property
    def _slopes(self) -> int | None:
        """How many slopes there are where they are the same at all points."""
        return 1 if self.order == 1 else None

    @cached_property
    def on_rim(self) -> RimRule:
        """Points of degree 2 k + 1 on the rim edges; a cell's own basis gives traces of gradients too."""
        z, w = leggauss(self.order + 1)
        s, weights = (1 + z)[None] / 2, w / 2
        start, end = self._rim_sides
        along = [CORNERS[:, [p]] + (CORNERS[:, [q]] - CORNERS[:, [p]]) * s for p, q in SIDES]
        tables = lagrange(self.order).tabulate(np.hstack(along))
        values, slopes = (
            table.reshape(*table.shape[:-1], len(SIDES), -1)[..., self._rim_finds // self.cells.shape[1], :]
            for table in tables
        )
        values, slopes = values.swapaxes(-2, -1), slopes[..., : self._slopes].swapaxes(-2, -1)
        direction = CORNERS[:, end] - CORNERS[:, start]
        return RimRule(self.cells[:, self.rim_cells], weights[:, None], values, slopes, direction)

    @cached_property
    def rim_nodes(self) -> Indices:
        """Nodes on the rim in counter-clockwise order: (k n_rim,) on a disk, one more on a sector."""
        start, end = self._rim_sides
        nodes = lagrange(self.order).nodes
        along, on_edge = nodes[end], np.isclose(nodes[start] + nodes[end], 1)
        local = np.argsort(np.where(on_edge, along, np.inf), axis=1)[:, : self.order]
        starts = self.cells[local, self.rim_cells[:, None]].ravel()
        return starts if self.symmetry is None else np.append(starts, self.rim[1, -1])

    @cached_property
    def rim_normals(self) -> Array:
        """Outward normals of the reference rim at its nodes, of any length, (2, n).

        On the unit circle the rays.  Along another side they turn steadily from one of its ends to the other:
        a polygon stands for a smooth outline, whose rim could not move if it kept to all normals of a corner.
        """
        if self.normals is None:
            return self.xi[:, self.rim_nodes]
        nodes = self.rim_nodes.reshape(-1, self.order)
        start, end = (self.normals[:, ends] / np.hypot(*self.normals[:, ends]) for ends in self.rim)
        along = lobatto(self.order)[:-1]
        turned = (1 - along) * start[..., None] + along * end[..., None]
        is_arc = (np.abs(np.hypot(*self.xi[:, self.rim]) - 1) < ON_A_CIRCLE).all(axis=0)
        inner = is_arc[:, None] & (along > 0)
        return np.where(inner, self.xi[:, nodes], turned).reshape(2, -1)

    def farthest(self, ring: float) -> Array:
        """The node of each cell that is farthest from a circle, (2, n_cells).

        It is on the cell's own side, where the mean of the corners of a thin or much curved cell need not be.
        """
        nodes = self.xi[:, self.cells]
        farthest = np.abs(np.hypot(*nodes) - ring).argmax(axis=0)
        return np.take_along_axis(nodes, farthest[None, None], axis=1)[:, 0]

    @cached_property
    def scalars(self) -> Scatter:
        """Of scalar fields, unknown n being that of node n."""
        return Scatter(self.cells, self.xi.shape[1])

    @cached_property
    def vectors(self) -> Scatter:
        """Of vector fields, unknown 2 n + i being component i at node n."""
        return Scatter(_interleaved(self.cells), self.xi.size)

    @cached_property
    def rim_vectors(self) -> Scatter:
        """Of vector fields in the cells along the rim."""
        return Scatter(_interleaved(self.on_rim.cells), self.xi.size)

    @cached_property
    def parts(self) -> Indices:
        """Nested dissection of the nodes, for direct solvers, (N,)."""
        pattern = self.scalars.pattern
        if self.order < CELLWISE:
            return nested_dissection(self.xi, pattern.rows, pattern.columns, LEAF)
        if self.xi.shape[1] <= DENSE:
            return np.zeros(self.xi.shape[1], dtype=np.int64)
        # the inner nodes of a cell come first: what couples them is dense, and as large as the next cell's
        inner = self.cells[3 * self.order :]
        parts = np.full(self.xi.shape[1], -1)
        parts[inner] = np.arange(inner.shape[1])
        shared, number = np.flatnonzero(parts < 0), np.cumsum(parts < 0) - 1
        kept = (parts[pattern.rows] < 0) & (parts[pattern.columns] < 0)
        rows, columns = number[pattern.rows[kept]], number[pattern.columns[kept]]
        parts[shared] = inner.shape[1] + nested_dissection(self.xi[:, shared], rows, columns, LARGE_LEAF)
        return parts

    @cached_property
    def rim_cells(self) -> Indices:
        """The cell at each rim edge, (n_rim,)."""
        return self._rim_finds % self.cells.shape[1]

    @cached_property
    def _rim_sides(self) -> Indices:
        """Local vertices at the start and the end of each rim edge, (2, n_rim)."""
        return np.array(SIDES).T[:, self._rim_finds // self.cells.shape[1]]

    @cached_property
    def _rim_finds(self) -> Indices:
        """Where each rim edge is among all cells' sides, (n_rim,)."""
        count = self.xi.shape[1]
        keys = np.concatenate([self.cells[p] * count + self.cells[q] for p, q in SIDES])
        order = np.argsort(keys)
        return order[np.searchsorted(keys, self.rim[0] * count + self.rim[1], sorter=order)]


def _numbered(triangles: Indices, count: int, order: int) -> Indices:
    """Nodes (n_local, n_cells) of cells on so many vertices: theirs, then edge by edge, cell by cell."""
    first, second = np.sort(triangles[np.array(EDGES).T], axis=0)
    edges, edge = np.unique(first * count + second, return_inverse=True)
    inner = (order - 1) * (order - 2) // 2
    along, inside = np.arange(order - 1)[:, None], np.arange(inner)[:, None]
    on_edges = count + (order - 1) * edge.reshape(first.shape)[:, None] + along
    start = count + (order - 1) * edges.size
    cells = triangles.shape[1]
    own = start + inner * np.arange(cells) + inside
    return np.vstack([triangles, on_edges.reshape(-1, cells), own]).astype(np.int64)


def _interleaved(cells: Indices) -> Indices:
    """Vector unknowns (2 n_local, n_cells) of nodes (n_local, n_cells)."""
    return np.stack([2 * cells, 2 * cells + 1], axis=1).reshape(-1, cells.shape[1])


def _curved(mesh: Mesh, triangles: Indices, ring: float, order: int) -> Array:
    """Node positions (2, n_local, n_cells) in every cell.

    In a cell between two layers radius and layer number are linear, and so is the angle along each layer:
    that is `disk`'s own map between its nodes, but singular at the origin.  The departure from the straight
    cell therefore fades as (r/ring)^k, which keeps derivatives of order j <= k + 1 within a cell O(h^j).
    """
    corners = mesh.xi[:, triangles]
    radii = np.hypot(*corners)
    layers = np.searchsorted(_layer_radii(mesh), radii)
    angles = np.arctan2(corners[1], corners[0])
    pivot = np.take_along_axis(angles, radii.argmax(axis=0)[None], axis=0)
    angles = pivot + np.remainder(angles - pivot + np.pi, 2 * np.pi) - np.pi

    def mean(corner_values: Array) -> Array:
        return np.einsum("cn,...ce->...ne", lagrange(order).nodes, corner_values)

    radius, layer = mean(radii), mean(layers.astype(float))
    angle = mean(layers * angles) / np.where(layer > 0, layer, 1.0)
    straight, polar = mean(corners), radius * np.array([np.cos(angle), np.sin(angle)])
    return straight + np.minimum(radius / ring, 1) ** order * (polar - straight)


def _bent(mesh: Mesh, triangles: Indices, ring: float, order: int) -> Array:
    """Node positions (2, n_local, n_cells) in cells on few layers, for polynomials of high degree.

    From the ring outwards radius and angle are linear in a cell.  Inside of it cells are straight, but for
    those with a side on the ring, which the arc's departure from its chord bends: x (1 - x) q(x) on the side,
    it is l m q((1 + m - l)/2) in the cell with l and m its ends' barycentric coordinates (Szabo and Babuska,
    Finite Element Analysis, 1991, section 6.2).  All are entire: errors fall with the degree on any mesh.
    """
    corners, shares = mesh.xi[:, triangles], lagrange(order).nodes
    radii, angles = np.hypot(*corners), np.arctan2(corners[1], corners[0])
    turns = np.remainder(angles - angles[0] + np.pi, 2 * np.pi) - np.pi
    radius, angle = shares.T @ radii, angles[0] + shares.T @ turns
    on_ring = np.abs(radii - ring) < ON_A_CIRCLE
    nodes = np.einsum("cn,ice->ine", shares, corners)
    outside = (on_ring | (radii > ring)).all(axis=0)
    nodes[..., outside] = (radius * np.array([np.cos(angle), np.sin(angle)]))[..., outside]
    for i, j in EDGES:
        bent = np.flatnonzero(on_ring[i] & on_ring[j] & ~outside)
        first, second = shares[i][:, None], shares[j][:, None]
        x = (1 + second - first) / 2
        turn = np.remainder(angles[j] - angles[i] + np.pi, 2 * np.pi) - np.pi
        turned = (angles[i] + x * turn)[:, bent]
        chord = (1 - x) * corners[:, i][:, None, bent] + x * corners[:, j][:, None, bent]
        departure = ring * np.array([np.cos(turned), np.sin(turned)]) - chord
        nodes[..., bent] += _ratio(first * second, x * (1 - x)) * departure
    return nodes


def _ratio(small: Array, other: Array) -> Array:
    """The one over the other, both of which vanish at the ends of a side."""
    return np.divide(small, other, out=np.zeros_like(small), where=other > 0)


def _with_arcs(mesh: Mesh, triangles: Indices, ring: float, order: int) -> Array:
    """Node positions (2, n_local, n_cells) in cells whose sides are straight, or arcs.

    Across a cell the departure of a side from its chord fades degree by degree (Lenoir, SIAM J. Numer. Anal.
    23, 1986): with s along the side and P_m its interpolate of degree m it is sum_m w^m (P_m - P_{m-1})(s), w
    being 1 on the side and 0 at the corner across.  Derivatives of order m within a cell are then O(h^m).
    """
    corners, shares = mesh.xi[:, triangles], lagrange(order).nodes
    nodes = np.einsum("cn,ice->ine", shares, corners)
    for i, curved in enumerate(arcs(mesh.xi, triangles, ring)):
        which, j = np.flatnonzero(curved), (i + 1) % 3
        w = shares[i] + shares[j]
        s = shares[j] / np.where(w > 0, w, 1.0)
        before = np.zeros((2, s.size, which.size))
        for degree in range(2, order + 1):
            now = _departure(corners[:, i, which], corners[:, j, which], degree, s)
            nodes[:, :, which] += w[:, None] ** degree * (now - before)
            before = now
    return nodes


def _departure(start: Array, end: Array, degree: int, s: Array) -> Array:
    """Of arcs about the origin from their chords, interpolated with a degree: (2, n_s, n) at s (n_s,)."""
    known = lobatto(degree)
    angle, turn = np.arctan2(start[1], start[0]), start[0] * end[1] - start[1] * end[0]
    turn = np.arctan2(turn, (start * end).sum(axis=0))
    to = known[:, None]
    angles, radii = angle + to * turn, (1 - to) * np.hypot(*start) + to * np.hypot(*end)
    chord = (1 - to) * start[:, None] + to * end[:, None]
    values = radii * np.array([np.cos(angles), np.sin(angles)]) - chord
    change = np.vander(s, degree + 1) @ np.linalg.inv(np.vander(known, degree + 1))
    return np.einsum("sk,ike->ise", change, values)


def _layer_radii(mesh: Mesh) -> Array:
    """Where layers end, half-way between them: layer number = searchsorted(., radius)."""
    radii = np.unique(np.round(np.hypot(*mesh.xi), 12))
    return (radii[1:] + radii[:-1]) / 2


def nested_dissection(points: Array, rows: Indices, columns: Indices, leaf: int) -> Indices:
    """Parts of a nested dissection by straight cuts through medians (George, SIAM J. Numer. Anal. 10, 1973).

    Parameters
    ----------
    points : position of each node, (2, n).
    rows, columns : pairs of coupled nodes, (k,).
    leaf : nodes that are not worth dissecting further.

    Returns
    -------
    The part of each node, numbered such that both sides of a cut are eliminated before the cut, (n,).
    """
    path = np.zeros(points.shape[1], dtype=np.int64)  # digits 0 and 1: sides; 2: cut, or nothing left to cut
    active = np.ones(path.size, dtype=bool)
    while active.any():
        nodes = np.flatnonzero(active)
        _, part, size = np.unique(path[nodes], return_inverse=True, return_counts=True)
        local = np.empty_like(path)
        local[nodes] = np.arange(nodes.size)
        kept = active[rows] & active[columns]
        edges = local[rows[kept]], local[columns[kept]]
        inner = part[edges[0]] == part[edges[1]]
        first, second = edges[0][inner], edges[1][inner]
        digits = np.array([_cut(normal @ points[:, nodes], part, size, first, second) for normal in CUTS])
        costs = np.array([np.bincount(part, digit == 2, size.size) for digit in digits])
        digit = np.take_along_axis(digits, costs.argmin(axis=0)[part][None], axis=0)[0]
        digit[size[part] <= leaf] = 2
        path = 3 * path + 2
        path[nodes] += digit - 2
        active[nodes] = digit < 2
    return path


def _cut(across: Array, part: Indices, size: Indices, first: Indices, second: Indices) -> Indices:
    """Halve every part at the median of a coordinate (n,): 0 and 1 for its sides, 2 for the cut between."""
    order = np.lexsort((across, part))
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    side = (rank - (np.cumsum(size) - size)[part] >= size[part] // 2).astype(np.int64)
    side_before = side.copy()
    side[first[(side_before[first] == 0) & (side_before[second] == 1)]] = 2
    return side
