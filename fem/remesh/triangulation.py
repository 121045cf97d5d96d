"""A new triangulation of the reference disk whose image under the current map x(xi) is well shaped.

The reference disk stays what fields are functions of: displacements, delta, the ring and material points
follow from xi as before.  Nodes are chosen in the current configuration and pulled back.  Those of the ring
and of the rim are evenly spaced along their curves, on which they stay exactly; between them an even lattice
is relaxed to the centroids of its cells (Lloyd, IEEE Trans. Inf. Theory 28, 1982) and triangulated by SciPy.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from actin_xcheck.core.mesh import Indices, Mesh, signed_areas
from actin_xcheck.core.model import Array
from fem.remesh.space import SLIVER, new_mesh, pulled_back, shapes
from fem.remesh.transfer import Reading
from fem.space import Space

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
