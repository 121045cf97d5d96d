"""Finite volumes that go on where their mesh would fold, on a new triangulation of the reference disk.

What the cells hold is carried over by intersection: a new cell is given the integral of the old cells' linear
concentrations over what it has in common with each of them.  Along the rim, where the polygons of old and new
vertices differ by O(h^2), its mean stands for the rest of it, and one factor 1 + O(h^2) for all cells keeps
total actin to round-off.  Vertices are where they are in the current configuration; their material points
follow from the displacement by cubic interpolation in triangles, apart inside and outside of the ring, across
which its slope jumps.  Positions along ring and rim, and F N there, are periodic splines of the angle.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from actin_xcheck.core.contract import Frame, Grid, Memento
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import ON_A_CIRCLE, Indices, Mesh, locate, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.remeshing import SLIVER, NoMesh, PresentCell, Remeshed, RemeshedState, circle, new_mesh
from fv.equations import reconstruct, vertex_interpolation
from fv.history import History
from fv.mechanics import FvForceBalance
from fv.rim import around, on_angles
from fv.solver import FvDiamond, FvState

CELLS = 2048
"""New cells whose common parts with old ones are looked at together."""


@dataclass(frozen=True, eq=False)
class FvPart:
    """A solver on one mesh, and what reads its fields at the nodes that are stored.

    Attributes
    ----------
    solver : on the mesh.
    shown : the mesh whose nodes are stored.
    """

    solver: FvDiamond
    shown: Mesh

    @cached_property
    def _located(self) -> tuple[Indices, Array]:
        """The vertices around each node that is shown, and their weights, (3, N) each."""
        cells, weights = locate(self.solver.mesh, self.shown.xi)
        return self.solver.mesh.triangles[:, cells], weights

    def read(self, nodal: Array) -> Array:
        """Values (..., N) at the nodes that are shown of values at the vertices."""
        nodes, weights = self._located
        found: Array = (nodal[..., nodes] * weights).sum(axis=-2)
        return found

    @property
    def placed(self) -> Memento:
        """The mesh."""
        mesh = self.solver.mesh
        return {"mesh_xi": mesh.xi, "triangles": mesh.triangles}

    def worst(self, x: Array) -> float:
        """The worst shape of a cell with vertices at x (2, N)."""
        return float(shapes(x, self.solver.mesh.triangles).min())


class FvRemeshing(Remeshed[FvPart]):
    """Finite volumes with their own force balance, whose mesh is replaced."""

    def __init__(self, first: FvDiamond, build: Callable[[Mesh], FvDiamond]) -> None:
        super().__init__(first, build)
        self.grid: Grid = first.grid

    @cached_property
    def area_at_rest(self) -> float:
        """That of the first mesh."""
        return float(signed_areas(self.mesh.xi, self.mesh.triangles).sum())

    def started(self) -> FvPart:
        """The part on the first mesh."""
        return FvPart(self.first, self.mesh)

    def again(self, memento: Memento) -> FvPart:
        """The part on the mesh that a memento has."""
        return FvPart(self.build(new_mesh(memento["mesh_xi"], memento["triangles"])), self.mesh)

    def corners(self, state: RemeshedState) -> Array:
        """Values (3, n_cells) at the corners of the first mesh's cells."""
        return self.frame(state).a[self.mesh.triangles]

    def frame(self, state: RemeshedState) -> Frame:
        """The linear fields of the moment at the nodes of the first mesh."""
        part, inner = self.parts(state)
        now = part.solver.frame(inner)
        a = part.read(now.a)
        return Frame(part.read(now.x), part.read(now.v), a, a[self.mesh.triangles].mean(axis=0))

    def carried_over(self, part: FvPart, inner: FvState, edge: float) -> tuple[FvPart, FvState, Outcome]:
        """A new part and the same moment on it; NoMesh where there is none, or none that can go on."""
        old, ring = part.solver, part.solver.problem.model.parameters.l0
        mesh, x = remeshed(old.mesh, inner.x, ring, edge)
        solver = self.build(mesh)
        x = solver.mechanics.settle(x)
        a = averages(inner.x[:, old.mesh.triangles], inner.corner_values, x[:, mesh.triangles])
        a *= (inner.a @ signed_areas(inner.x, old.mesh.triangles)) / (a @ signed_areas(x, mesh.triangles))
        corners = reconstruct(mesh.triangles, a, vertex_interpolation(solver.faces, x) @ a)
        carried = _carried_over(old.mechanics, solver.mechanics, inner.carried)
        move = solver.mechanics.flow(inner.t, x, corners, carried)
        if not move.outcome.ok:
            raise NoMesh(move.outcome.message)
        new = replace(inner, x=x, a=a, v=move.v, carried=carried, corner_values=corners)
        return FvPart(solver, self.mesh), replace(new, anchor=Anchor(x), history=History.none()), move.outcome


def _carried_over(old: Any, new: Any, carried: Array) -> Array:
    """F N on the new mesh's rim, where it is carried."""
    if not carried.size or not isinstance(old, FvForceBalance) or not isinstance(new, FvForceBalance):
        return carried
    assert old.free_rim is not None
    assert new.free_rim is not None
    return new.free_rim.read(old.free_rim, carried)


def remeshed(mesh: Mesh, x: Array, ring: float, edge: float) -> tuple[Mesh, Array]:
    """A mesh of the reference disk with well shaped cells, and where its vertices are, (2, N).

    Parameters
    ----------
    mesh, x : of a disk, and where its vertices are, (2, N).
    ring, edge : see `Cell`.

    Raises NoMesh where no such mesh is found.
    """
    u, radius = x - mesh.xi, np.hypot(*mesh.xi)
    lines = {of: np.abs(radius - of) < ON_A_CIRCLE for of in (ring, 1.0)}
    moved = {of: around(mesh.xi[:, on], u[:, on]) for of, on in lines.items()}

    def where(of: float, angles: Array) -> Array:
        return circle(of, angles) + moved[of](angles).T

    def sound(new: Mesh, places: Array) -> tuple[Mesh, Array]:
        places, angles = places.copy(), on_angles(new.xi)
        for of in moved:
            on = np.abs(np.hypot(*new.xi) - of) < ON_A_CIRCLE
            places[:, on] = where(of, angles[on])
        if (worst := shapes(new.xi, new.triangles).min()) <= 0:
            raise NoMesh(f"a cell of the reference disk is turned over (shape {worst:.2g})")
        if (worst := shapes(places, new.triangles).min()) <= 1.5 * SLIVER:
            raise NoMesh(f"a cell has the shape {worst:.2g}")
        if (_outside(new, ring) != (np.hypot(*new.centroids) > ring)).any():
            raise NoMesh("the middle of a cell is beyond the ring")
        return new, places

    return PresentCell(ring, where, _Points(mesh, x, ring), sound).remeshed(edge, mesh.rim_nodes.size)


class _Points:
    """Material points of places in a cell whose vertices are at x (2, N)."""

    def __init__(self, mesh: Mesh, x: Array, ring: float) -> None:
        from matplotlib.tri import CubicTriInterpolator, Triangulation  # here: most runs are never remeshed

        outside = _outside(mesh, ring)
        sides = (Triangulation(*x, mesh.triangles.T[side]) for side in (~outside, outside))
        self._sides = [
            (one.get_trifinder(), [CubicTriInterpolator(one, u, "geom") for u in x - mesh.xi])
            for one in sides
        ]

    def __call__(self, places: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Of places (2, n): the points (2, n), and which places are in the cell, (n,)."""
        xi, hit = places.copy(), np.zeros(places.shape[1], dtype=bool)
        for finder, displacement in self._sides:
            here = finder(*places) >= 0
            if here.any():
                xi[:, here] -= [np.ma.getdata(one(*places[:, here])) for one in displacement]
            hit |= here
        return xi, hit


def _outside(mesh: Mesh, ring: float) -> NDArray[np.bool_]:
    """Which cells are outside of the ring, (n_cells,), by their corners that are farthest from it."""
    height = np.hypot(*mesh.xi[:, mesh.triangles]) - ring
    farthest = np.take_along_axis(height, np.abs(height).argmax(axis=0)[None], axis=0)[0]
    outside: NDArray[np.bool_] = farthest > 0
    return outside


def shapes(x: Array, triangles: Indices) -> Array:
    """The mean ratio of triangles with vertices at x (2, N), (n,): area over squared sides, at most 1."""
    corners = x[:, triangles]
    squares: Array = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(0, 1))
    return 4 * np.sqrt(3) * signed_areas(x, triangles) / squares


def averages(old: Array, corners: Array, new: Array) -> Array:
    """Means (m,) over what triangles have in common with others, of these' linear fields.

    Parameters
    ----------
    old, corners : corners of the others, (2, 3, n), and values there, (3, n).
    new : corners of the triangles, (2, 3, m).
    """
    centres, middles = old.mean(axis=1), new.mean(axis=1)
    reach = np.hypot(*(old - centres[:, None])).max()
    tree, found = cKDTree(centres.T), np.empty(new.shape[-1])
    for start in range(0, found.size, CELLS):
        part = np.arange(start, min(start + CELLS, found.size))
        own = np.hypot(*(new[:, :, part] - middles[:, None, part])).max(axis=0)
        near = tree.query_ball_point(middles[:, part].T, own + reach)
        of, at = np.repeat(part, [len(one) for one in near]), np.concatenate(near).astype(int)
        meet = _meet(old[:, :, at], new[:, :, of])
        of, at = of[meet], at[meet]
        areas, moments = _in_common(old[:, :, at], new[:, :, of])
        held = areas * corners[:, at].mean(axis=0)
        held += (
            _slopes(old[:, :, at], corners[:, at]) * (moments - areas * (centres[:, at] - middles[:, of]))
        ).sum(axis=0)
        sums = [np.bincount(of - start, one, part.size) for one in (held, areas)]
        found[part] = sums[0] / sums[1]
    return found


def _meet(one: Array, other: Array) -> NDArray[np.bool_]:
    """Whether the upright boxes around pairs of triangles (2, 3, n) meet, (n,)."""
    meet: NDArray[np.bool_] = (
        (one.min(axis=1) < other.max(axis=1)) & (other.min(axis=1) < one.max(axis=1))
    ).all(axis=0)
    return meet


def _slopes(triangles: Array, values: Array) -> Array:
    """Gradients (2, n) of linear fields with values (3, n) at corners (2, 3, n)."""
    (one, two), (first, second) = (
        (both[..., 1, :] - both[..., 0, :], both[..., 2, :] - both[..., 0, :]) for both in (triangles, values)
    )
    twice = one[0] * two[1] - one[1] * two[0]
    slopes: Array = np.array([first * two[1] - second * one[1], second * one[0] - first * two[0]]) / twice
    return slopes


def _in_common(old: Array, new: Array) -> tuple[Array, Array]:
    """Areas (n,) and first moments (2, n), about the new ones' centroids, of pairs of triangles (2, 3, n)."""
    middle = new.mean(axis=1, keepdims=True)
    line, sides = old - middle, new - middle
    for i in range(3):
        line = _cut(line, sides[:, i], sides[:, (i + 1) % 3])
    after = np.roll(line, -1, axis=1)
    cross = line[0] * after[1] - line[1] * after[0]
    return cross.sum(axis=0) / 2, ((line + after) * cross).sum(axis=1) / 6


def _cut(line: Array, start: Array, end: Array) -> Array:
    """Closed lines of k corners (2, k, n), those parts that are right of lines (2, n) moved onto these.

    There they run to and fro, without an area: 2 k corners.
    """
    side = end - start
    left = np.array([-side[1], side[0]])[:, None]
    after = np.roll(line, -1, axis=1)
    here, there = ((left * (one - start[:, None])).sum(axis=0) for one in (line, after))
    crosses = here * there < 0
    share = np.where(crosses, here, 0.0) / np.where(crosses, here - there, 1.0)
    crossing = line + share * (after - line)
    onto = [
        one - np.minimum(at, 0.0) * left / (left**2).sum(axis=0) for one, at in ((line, here), (after, there))
    ]
    first = np.where(crosses & (here < 0), crossing, onto[0])
    last = np.where(crosses & (there < 0), crossing, onto[1])
    cut: Array = np.stack([first, last], axis=2).reshape(2, -1, line.shape[-1])
    return cut
