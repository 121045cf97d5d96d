"""A new triangulation of the reference disk whose image under the current map x(xi) is well shaped.

The reference disk stays what fields are functions of: displacements, delta, the ring and material points
follow from xi as before.  Nodes are chosen in the current configuration and pulled back.  Those of the ring
and of the rim are evenly spaced along their curves, on which they stay exactly; between them an even lattice
is relaxed to the centroids of its cells (Lloyd, IEEE Trans. Inf. Theory 28, 1982) and triangulated by SciPy.

Its sides are straight in the current configuration.  Pulled back to the reference disk they are curved as the
deformation has curved them: straight sides there would cut across thin cells, which is what well shaped ones
in a sheared cell have started as.  How far cells are from losing their shape is told before one turns over.
Fields are carried over by projection, their sums kept.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.lagrange import lagrange
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh, signed_areas
from actin_xcheck.core.model import Array, Model
from fem.fields import locate
from fem.force_balance import ForceBalance
from fem.space import Space

CHUNK = 4_000_000
"""Pairs of points and cells that are looked at together."""

NEAR = 1e-8
"""Distance at which a point is hit."""


@dataclass(frozen=True, eq=False)
class Reading:
    """Points in the cells of a space: what reads any of its fields there.

    Attributes
    ----------
    nodes : of the cell at each point, (n_local, q).
    values : the cell's basis functions there, (n_local, q).
    hit : whether the point is in a cell, or as near to one as `NEAR`, (q,).
    """

    nodes: Indices
    values: Array
    hit: NDArray[np.bool_]

    @classmethod
    def at(cls, space: Space, points: Array) -> Self:
        """Read at material points (2, q); one beyond the rim by the width of a chord's arc is read too."""
        size = max(CHUNK // space.cells.shape[1], 1)
        parts = [locate(space, points[:, i : i + size]) for i in range(0, points.shape[1], size)]
        nodes = np.hstack([space.cells[:, cells] for cells, _ in parts])
        values = np.hstack([found for _, found in parts])
        reached = np.einsum("aq,iaq->iq", values, space.xi[:, nodes])
        return cls(nodes, values, np.hypot(*(reached - points)) < NEAR)

    @classmethod
    def at_places(cls, space: Space, x: Array, places: Array) -> Self:
        """Read at places (2, q) where the nodes of the space are at x (2, N)."""
        return cls.at(replace(space, xi=x), places)

    def of(self, field: Array) -> Array:
        """Values (..., q) of a field (..., N)."""
        return np.einsum("aq,...aq->...q", self.values, field[..., self.nodes])


def projected(old: Space, new: Space, x: Array, a: Array, total: float) -> tuple[Array, Outcome]:
    """The concentration a of `old` on `new`, (N,): its L2 projection, in sum `total` to round-off.

    The integrals are those over the cells of `new`, as they lie now; a factor 1 + O(h^(k+1)) puts right what
    they lose of the sum.

    Parameters
    ----------
    old, new : spaces on the same disk.
    x : current node positions of `new`, (2, N).
    a : nodal values on `old`.
    total : of actin, to be kept.
    """
    rule = new.rule(2 * new.order + 1)
    sample = rule.at(x)
    points = rule.blend(new.xi[:, new.cells])
    density = Reading.at(old, points.reshape(2, -1)).of(a).reshape(points.shape[1:])
    mass = new.scalars.matrix(new.inside.at(x).mass())
    found, outcome = solve(mass, new.scalars.vector(sample.load(density)))
    return found * (total / (mass @ found).sum()), outcome


SLIVER = 0.2
"""Shape of a cell below which the mesh is about to break.

An equilateral triangle has it when it is sheared by 2.8; on the article's meshes no cell starts below
0.5.
"""

_TO_EQUILATERAL = np.array([[1, -1 / np.sqrt(3)], [0, 2 / np.sqrt(3)]])
"""Inverse of the map of the reference triangle to the equilateral one with sides of length 1."""


def shapes(space: Space, x: Array) -> Array:
    """Shape of each cell with nodes x (2, N), the worst of its quadrature points, (n_cells,).

    The mean ratio 2 det A / |A|^2 of the map A from an equilateral triangle: 1 where it is one, 0 where an
    angle, the area or one point of a curved cell has none left, negative where it has turned over (Knupp,
    SIAM J. Sci. Comput. 23, 2001).
    """
    tangent_map = space.inside.tangent_map(x)
    (a, b), (c, d) = np.einsum("ijqe,jk->ikqe", tangent_map, _TO_EQUILATERAL)
    ratio = 2 * (a * d - b * c) / (a**2 + b**2 + c**2 + d**2)
    worst: Array = (ratio * space.orientation).min(axis=0)
    return worst


def soundness(space: Space, t: float, x: Array) -> Outcome:
    """`tangled`, with the worst cell, where a mesh is about to fold; the cells are still valid then."""
    of_cells = shapes(space, x)
    worst = int(np.argmin(of_cells))
    if of_cells[worst] > SLIVER:
        return COMPLETED
    started, now = (nodes[:, space.cells[:3, worst]].mean(axis=1) for nodes in (space.xi, x))
    message = (
        f"the mesh is about to fold at t = {t:.6g}: the shape of the cell that started at "
        f"({started[0]:.3f}, {started[1]:.3f}), now at ({now[0]:.3f}, {now[1]:.3f}), has fallen to "
        f"{of_cells[worst]:.2g} of an equilateral triangle's; a run with --remesh would go on"
    )
    return Outcome(Ending.TANGLED, message)


def pulled_back(old: Space, x: Array, mesh: Mesh, ring: float) -> Space | None:
    """The space of `old`'s order on a new mesh; None where a node lies in none of the old cells.

    Sides on the ring and on the rim stay arcs of their circles, and their cells are curved towards them
    degree by degree (Lenoir, SIAM J. Numer. Anal. 23, 1986); all others are straight where `old` is at x.
    """
    space = Space.on(mesh, old.order, ring)
    if old.order == 1:
        return placed_space(mesh, 1, ring, space.xi)
    shares, cells = lagrange(old.order).nodes, space.cells
    now = Reading.at(old, space.xi).of(x)
    local = np.einsum("cn,ice->ine", shares, now[:, cells[:3]])
    kept = np.arange(space.xi.shape[1]) < mesh.xi.shape[1]
    arcs = _neighbours(mesh.xi, cells[:3], ring) | _neighbours(mesh.xi, cells[:3], 1.0)
    for i, curved in enumerate(arcs):
        j, across = (i + 1) % 3, (i + 2) % 3
        side = np.flatnonzero(np.isclose(shares[across], 0) & (shares[i] * shares[j] > 0))
        width = shares[i] + shares[j]
        s = shares[j] / np.where(width > 0, width, 1.0)
        bumps = np.array([s * (1 - s) * (2 * s - 1) ** (m - 2) for m in range(2, old.order + 1)])
        departure = (now[:, cells] - local)[:, side][..., curved]
        fading = bumps * width ** np.arange(2, old.order + 1)[:, None]
        fitted = np.einsum("sm,ise->ime", np.linalg.inv(bumps[:, side]), departure)
        local[..., curved] += np.einsum("mn,ime->ine", fading, fitted)
        kept[cells[np.ix_(side, curved)]] = True
    places = np.empty_like(space.xi)
    places[:, cells] = local
    found = Reading.at_places(old, x, places[:, ~kept])
    if not found.hit.all():
        return None
    xi = space.xi.copy()
    xi[:, ~kept] = found.of(old.xi)
    return placed_space(mesh, old.order, ring, xi)


def placed_space(mesh: Mesh, order: int, ring: float, xi: Array) -> Space:
    """The space of order k on a mesh, its nodes at xi (2, N)."""
    # which way a thin curved cell runs is not told by its corners at rest, but by their order
    smallest, next_one = mesh.triangles.argmin(axis=0), np.sort(mesh.triangles, axis=0)[1]
    successor = np.take_along_axis(mesh.triangles, (smallest[None] + 1) % 3, axis=0)[0]
    orientation = np.where((successor == next_one) | (order < 3), 1.0, -1.0)
    return replace(Space.on(mesh, order, ring), xi=xi, orientation=orientation)


def new_mesh(xi: Array, triangles: Indices) -> Mesh:
    """A mesh without layers; its h is that of the disk with as many cells."""
    return Mesh(xi, triangles, 2 / np.sqrt(triangles.shape[1]), layered=False)


def _neighbours(xi: Array, triangles: Indices, radius: float) -> NDArray[np.bool_]:
    """Which sides join neighbours on a circle, (3, n_cells): side i runs from corner i to corner i + 1."""
    nodes = np.flatnonzero(np.abs(np.hypot(*xi) - radius) < ON_A_CIRCLE)
    place = np.full(xi.shape[1], -1)
    place[nodes[np.argsort(np.arctan2(xi[1, nodes], xi[0, nodes]))]] = np.arange(nodes.size)
    start, end = place[triangles], np.roll(place[triangles], -1, axis=0)
    apart = np.remainder(end - start, nodes.size)
    found: NDArray[np.bool_] = (start >= 0) & (end >= 0) & ((apart == 1) | (apart == nodes.size - 1))
    return found


class Rebalanced(ForceBalance):
    """The force balance on a given space."""

    def __init__(self, model: Model, mesh: Mesh, space: Space) -> None:
        super().__init__(model, mesh, space.order, space)
        self.delta = model.delta_on_cells(space.farthest(model.parameters.l0))

    def carried_from(self, other: object, carried: Array) -> Array:
        """What another mesh's force balance carries, on this one."""
        if not isinstance(other, ForceBalance) or self.free_rim is None or other.free_rim is None:
            return carried
        return self.free_rim.read(other.free_rim, carried)


FINE = 8
"""Points that stand for an edge's length of a curve."""

SWEEPS = 8
"""Of relaxation: more of them change the worst angle no further."""

CLEAR = 0.6
"""Distance of inner nodes to the curves, in edges: then no curve's edge is lost to the triangulation."""

FINER = 0.8, 3
"""Edges are shortened to this where no mesh is found, so often."""

MOST_CELLS = 100_000
"""More would not be affordable."""


class NoMesh(Exception):
    """There is no sound mesh; the message says why."""


def remeshed(space: Space, x: Array, ring: float, edge: float) -> tuple[Mesh, Space]:
    """Return a mesh of the reference disk and a space whose cells are well shaped where `space` is at x.

    Parameters
    ----------
    space : of a disk.
    x : node positions, (2, N).
    ring : material radius of the curve that edges must follow.
    edge : length of the edges in the current configuration; shorter where ring and rim are closer than that.

    Raises
    ------
    NoMesh : no such mesh is found.
    """
    factor, times = FINER
    for trial in range(times):
        try:
            return _tried(space, x, ring, edge * factor**trial)
        except (NoMesh, QhullError) as error:
            reason = error
    raise NoMesh(f"no sound mesh with edges down to {edge * factor ** (times - 1):.2g}: {reason}")


def edge_of(mesh: Mesh) -> float:
    """Mean length of the edges of a mesh's cells, that of equilateral triangles with their area."""
    return float(np.sqrt(4 / np.sqrt(3) * signed_areas(mesh.xi, mesh.triangles).mean()))


def _tried(space: Space, x: Array, ring: float, edge: float) -> tuple[Mesh, Space]:
    curves = [_Curve(space, x, radius, edge) for radius in (ring, 1.0)]
    gap = cKDTree(curves[0].fine.T).query(curves[1].fine.T)[0].min()
    if gap < edge:
        edge = gap
        curves = [_Curve(space, x, radius, edge) for radius in (ring, 1.0)]
    on_curves = [curve.nodes(edge) for curve in curves]
    fixed_xi, fixed = (np.hstack([pair[i] for pair in on_curves]) for i in (0, 1))
    outline = on_curves[1][1]
    if (cells := _area(outline) / (np.sqrt(3) / 4 * edge**2)) > MOST_CELLS:
        raise NoMesh(f"it would have {cells:.0f} cells, more than {MOST_CELLS}")
    inner = _relaxed(fixed, outline, cKDTree(np.hstack([curve.fine for curve in curves]).T), edge)
    found = Reading.at_places(space, x, inner)
    inner, inner_xi = inner[:, found.hit], found.of(space.xi)[:, found.hit]
    places, xi = np.hstack([fixed, inner]), np.hstack([fixed_xi, inner_xi])
    triangles = _triangulated(places, outline)
    ends = np.cumsum([0] + [nodes.shape[1] for _, nodes in on_curves])
    for start, end in pairwise(ends):
        _require_edges(triangles, np.arange(start, end))
    mesh = new_mesh(xi, triangles)
    return mesh, _sound(space, x, mesh, ring)


class _Curve:
    """A material circle as it lies now.

    Attributes
    ----------
    radius : in the reference disk.
    angles, fine : points of it by their angles there (n + 1,) and where they are now (2, n + 1), closed.
    """

    def __init__(self, space: Space, x: Array, radius: float, edge: float) -> None:
        count = FINE * max(space.rim_nodes.size, int(np.ceil(2 * np.pi / edge)))
        self.radius, self.angles = radius, np.linspace(0, 2 * np.pi, count + 1)
        self.fine = Reading.at(space, self._circle(self.angles)).of(x)

    def nodes(self, edge: float) -> tuple[Array, Array]:
        """Nodes spaced by `edge` along the curve: where they started and where they are, (2, n) each."""
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(self.fine))))
        count = max(int(np.ceil(along[-1] / edge)), FINE)
        at = np.interp(np.linspace(0, along[-1], count, endpoint=False), along, self.angles)
        now = [np.interp(at, self.angles, component) for component in self.fine]
        return self._circle(at), np.array(now)

    def _circle(self, angles: Array) -> Array:
        return self.radius * np.array([np.cos(angles), np.sin(angles)])


def _relaxed(fixed: Array, outline: Array, curves: cKDTree, edge: float) -> Array:
    """Inner nodes (2, n) between nodes on the curves, at least `CLEAR` edges away from every curve."""
    low, high = outline.min(axis=1), outline.max(axis=1)
    rows = np.arange(low[1] - edge, high[1] + edge, edge * np.sqrt(3) / 2)
    row, column = np.meshgrid(np.arange(rows.size), np.arange(low[0] - edge, high[0] + edge, edge))
    lattice = np.array([(column + edge / 2 * (row % 2)).ravel(), rows[row.ravel()]])

    def clear(points: Array) -> NDArray[np.bool_]:
        near: NDArray[np.bool_] = curves.query(points.T)[0] > CLEAR * edge
        return near

    inner = lattice[:, clear(lattice) & _within(outline, lattice)]
    for _ in range(SWEEPS):
        places = np.hstack([fixed, inner])
        triangles = _triangulated(places, outline)
        weights = signed_areas(places, triangles)
        centroids = places[:, triangles].mean(axis=1)
        total, first, second = (
            np.bincount(triangles.ravel(), np.tile(weights * value, 3), places.shape[1])[fixed.shape[1] :]
            for value in (1.0, *centroids)
        )
        moved = np.array([first, second]) / np.where(total > 0, total, 1.0)
        stays = ~(clear(moved) & _within(outline, moved)) | (total == 0)
        inner = np.where(stays, inner, moved)
    return inner


def _triangulated(places: Array, outline: Array) -> Indices:
    """The Delaunay triangles (3, n) of points (2, N), counter-clockwise, that lie inside of a polygon."""
    triangles = Delaunay(places.T).simplices.T.astype(np.int64)
    areas = signed_areas(places, triangles)
    triangles = np.where(areas > 0, triangles, triangles[[0, 2, 1]])
    return triangles[:, _within(outline, places[:, triangles].mean(axis=1))]


def _within(outline: Array, points: Array) -> NDArray[np.bool_]:
    """Whether points (2, n) lie inside of a polygon (2, k), (n,)."""
    from matplotlib.path import Path  # here: most runs are never remeshed

    inside: NDArray[np.bool_] = Path(outline.T).contains_points(points.T)
    return inside


def _area(outline: Array) -> float:
    x, y = outline
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _require_edges(triangles: Indices, loop: Indices) -> None:
    """Raise NoMesh unless neighbours in a closed loop of nodes (n,) share an edge."""
    size = triangles.max() + loop.max() + 2
    sides = np.hstack([triangles[[i, (i + 1) % 3]] for i in range(3)])
    wanted = np.sort([loop, np.roll(loop, -1)], axis=0)
    there = np.isin(wanted[0] * size + wanted[1], sides.min(axis=0) * size + sides.max(axis=0))
    if not there.all():
        raise NoMesh(f"{np.count_nonzero(~there)} edges of the ring or the rim are not in the triangulation")


def _sound(old: Space, x: Array, mesh: Mesh, ring: float) -> Space:
    """Return the space on a mesh; raises NoMesh where its cells are not sound, at rest or now."""
    new = pulled_back(old, x, mesh, ring)
    if new is None:
        raise NoMesh("a side leaves the cell")
    if (at_rest := shapes(new, new.xi).min()) <= 0:
        raise NoMesh(f"a cell of the reference disk is turned over (shape {at_rest:.2g})")
    if (moved := shapes(new, Reading.at(old, new.xi).of(x)).min()) <= 1.5 * SLIVER:
        raise NoMesh(f"a cell has the shape {moved:.2g}")
    return new
