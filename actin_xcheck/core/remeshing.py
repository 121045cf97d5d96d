"""Runs that go on where their mesh would fold, on a new one: what both codes have in common of it.

The new triangulation of the reference disk is one whose image under the current map x(xi) is well shaped.
The reference disk stays what fields are functions of: displacements, delta, the ring and material points
follow from xi as before.  Nodes are chosen in the current configuration and pulled back.  Those of the ring
and of the rim are evenly spaced along their curves, on which they stay exactly; between them an even lattice
is relaxed to the centroids of its cells (Lloyd, IEEE Trans. Inf. Theory 28, 1982) and triangulated by SciPy.
What a code's cells and fields become on it is the code's own.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from actin_xcheck.core.contract import Memento, Probes, State
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Indices, Mesh, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures

SLIVER = 0.2
"""Shape of a cell below which the mesh is about to break.

An equilateral triangle has it when it is sheared by 2.8; on the article's meshes no cell starts below
0.5.
"""

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


T = TypeVar("T")


@dataclass(frozen=True)
class PresentCell(Generic[T]):
    """A cell as it lies now, for whoever triangulates it.

    Attributes
    ----------
    ring : material radius of the curve that edges must follow.
    where : positions (2, n) of the material points of a circle, its radius and their angles (n,) given.
    pulled_back : material points (2, n) at places (2, n), and which of those are in the cell, (n,).
    sound : makes of a mesh of the reference disk, whose nodes are now at (2, N), what is wanted; raises
        NoMesh where its cells are not sound.
    """

    ring: float
    where: Callable[[float, Array], Array]
    pulled_back: Callable[[Array], tuple[Array, NDArray[np.bool_]]]
    sound: Callable[[Mesh, Array], T]

    def remeshed(self, edge: float, least: int) -> T:
        """What is made of a mesh whose cells are well shaped now.

        Parameters
        ----------
        edge : length of the edges in the current configuration; shorter where ring and rim are closer than
            that.
        least : edges that the rim has had.

        Raises
        ------
        NoMesh : no such mesh is found.
        """
        factor, times = FINER
        for trial in range(times):
            try:
                return self._tried(edge * factor**trial, least)
            except (NoMesh, QhullError) as error:
                reason = error
        raise NoMesh(f"no sound mesh with edges down to {edge * factor ** (times - 1):.2g}: {reason}")

    def _tried(self, edge: float, least: int) -> T:
        curves = self._curves(edge, least)
        gap = cKDTree(curves[0].fine.T).query(curves[1].fine.T)[0].min()
        if gap < edge:
            edge = gap
            curves = self._curves(edge, least)
        on_curves = [curve.nodes(edge) for curve in curves]
        fixed_xi, fixed = (np.hstack([pair[i] for pair in on_curves]) for i in (0, 1))
        outline = on_curves[1][1]
        if (cells := _area(outline) / (np.sqrt(3) / 4 * edge**2)) > MOST_CELLS:
            raise NoMesh(f"it would have {cells:.0f} cells, more than {MOST_CELLS}")
        inner = _relaxed(fixed, outline, cKDTree(np.hstack([curve.fine for curve in curves]).T), edge)
        inner_xi, hit = self.pulled_back(inner)
        places = np.hstack([fixed, inner[:, hit]])
        triangles = _triangulated(places, outline)
        ends = np.cumsum([0] + [nodes.shape[1] for _, nodes in on_curves])
        for start, end in pairwise(ends):
            _require_edges(triangles, np.arange(start, end))
        return self.sound(new_mesh(np.hstack([fixed_xi, inner_xi[:, hit]]), triangles), places)

    def _curves(self, edge: float, least: int) -> "list[_Curve]":
        count = FINE * max(least, int(np.ceil(2 * np.pi / edge)))
        angles = np.linspace(0, 2 * np.pi, count + 1)
        return [_Curve(radius, angles, self.where(radius, angles)) for radius in (self.ring, 1.0)]


def circle(radius: float, angles: Array) -> Array:
    """Points of a circle about the origin at angles (n,), (2, n)."""
    return radius * np.array([np.cos(angles), np.sin(angles)])


def edge_of(mesh: Mesh) -> float:
    """Mean length of the edges of a mesh's cells, that of equilateral triangles with their area."""
    return float(np.sqrt(4 / np.sqrt(3) * signed_areas(mesh.xi, mesh.triangles).mean()))


def new_mesh(xi: Array, triangles: Indices) -> Mesh:
    """A mesh without layers; its h is that of the disk with as many cells."""
    return Mesh(xi, triangles, 2 / np.sqrt(triangles.shape[1]), layered=False)


@dataclass(frozen=True, eq=False)
class _Curve:
    """A material circle as it lies now.

    Attributes
    ----------
    radius : in the reference disk.
    angles, fine : points of it by their angles there (n + 1,) and where they are now (2, n + 1), closed.
    """

    radius: float
    angles: Array
    fine: Array

    def nodes(self, edge: float) -> tuple[Array, Array]:
        """Nodes spaced by `edge` along the curve: where they started and where they are, (2, n) each."""
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(self.fine))))
        count = max(int(np.ceil(along[-1] / edge)), FINE)
        at = np.interp(np.linspace(0, along[-1], count, endpoint=False), along, self.angles)
        now = [np.interp(at, self.angles, component) for component in self.fine]
        return circle(self.radius, at), np.array(now)


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


LESS = 0.8
"""Of a shape: where there is no better mesh, another one is sought when this much is left."""

_COUNTED = ("remeshings", "area_change", "limit")


class Part(Protocol):
    """A solver on one mesh."""

    @property
    def solver(self) -> Any:
        """The solver."""
        ...

    @property
    def placed(self) -> Memento:
        """What its mesh is made from again."""
        ...

    def worst(self, x: Array) -> float:
        """The worst shape of a cell with nodes at x (2, N): the mean ratio, 1 where it is equilateral."""
        ...


@dataclass(frozen=True)
class RemeshedState(State):
    """The inner solver's state on the mesh of the moment, and how often the mesh has been replaced.

    Attributes
    ----------
    part : the solver on that mesh.
    inner : its state.
    remeshings : how many meshes there were before.
    area_change : sum of the relative changes of area that the replacements made, each O(h^(k+1)).
    limit : shape below which the mesh is to be replaced; it falls where no better one is found.
    """

    part: Any = None
    inner: Any = None
    remeshings: int = 0
    area_change: float = 0.0
    limit: float = SLIVER


P = TypeVar("P", bound=Part)


class Remeshed(ABC, Generic[P]):
    """A solver whose mesh is replaced when a cell has lost its shape; see `remesh.py`.

    New edges are as long, in the moving cell, as the first mesh's were at the start: short waves, which d
    cuts off at a wave number of the current configuration, stay as resolved as they were.  Where the cell
    shrinks, they shrink with it, so that there are never fewer cells.  What is stored of a state is read at
    the material points of the first mesh, so that a film has one topology; measured is the state itself.

    Parameters
    ----------
    first : the solver on the mesh to start with, of a disk.
    build : binds the solver to another mesh and its force balance.
    """

    def __init__(self, first: Any, build: Callable[..., Any]) -> None:
        self.first, self.build = first, build
        self.mesh: Mesh = first.mesh
        self._edge = edge_of(self.mesh)

    @abstractmethod
    def started(self) -> P:
        """The part on the first mesh."""

    @abstractmethod
    def again(self, memento: Memento) -> P:
        """The part on the mesh that a memento has."""

    @property
    @abstractmethod
    def area_at_rest(self) -> float:
        """That of the first mesh."""

    @abstractmethod
    def carried_over(self, part: P, inner: Any, edge: float) -> tuple[P, Any, Outcome]:
        """A new part, the same moment on it and how that went, total actin kept to round-off.

        Parameters
        ----------
        part, inner : the part of the moment and its state.
        edge : length of the new mesh's edges where the cell is now.

        Raises
        ------
        NoMesh : there is no sound one.
        """

    def init(self) -> RemeshedState:
        """On the first mesh."""
        inner = self.first.init()
        return _outer(RemeshedState(inner.t, inner.x, inner.a, inner.v), self.started(), inner)

    def step(self, state: RemeshedState, dt: float) -> tuple[RemeshedState, Outcome]:
        """A step on the mesh of the moment, replaced after it where it is about to fold.

        Where no better mesh is found the run goes on as long as no cell turns over.
        """
        part, inner = self.parts(state)
        new, outcome = part.solver.step(inner, dt)
        if not outcome.ok:
            return state, outcome
        after = _outer(state, part, new)
        worst = part.worst(new.x)
        if worst > state.limit:
            return after, outcome
        try:
            return self._replaced(after)
        except NoMesh:
            return replace(after, limit=LESS * worst), outcome

    def check(self, state: RemeshedState) -> Outcome:
        """The orientation of the cells of the moment."""
        part, inner = self.parts(state)
        outcome: Outcome = part.solver.check(inner)
        return outcome

    def measure(self, state: RemeshedState) -> Measures:
        """Integrals over the cells of the moment."""
        part, inner = self.parts(state)
        measures: Measures = part.solver.measure(inner)
        return measures

    def probes(self, points: Array) -> Probes[RemeshedState]:
        """Material points (2, k), found in every mesh anew."""

        @lru_cache(maxsize=1)  # those of meshes that have been left are not asked again
        def of(part: Any) -> Probes[Any]:
            probes: Probes[Any] = part.solver.probes(points)
            return probes

        def read(state: RemeshedState) -> tuple[Array, Array]:
            _, inner = self.parts(state)
            return of(state.part)(inner)

        return read

    def memento(self, state: RemeshedState) -> Memento:
        """The inner solver's, with the mesh of the moment and what is counted."""
        part, inner = self.parts(state)
        counted = {name: np.asarray(getattr(state, name)) for name in _COUNTED}
        return {**part.solver.memento(inner), **counted, **part.placed}

    def restored(self, memento: Memento) -> RemeshedState:
        """The state again, on its mesh."""
        counted = {name: memento[name].tolist() for name in _COUNTED}
        part = self.again(memento) if counted["remeshings"] else self.started()
        inner = part.solver.restored(memento)
        return _outer(RemeshedState(inner.t, inner.x, inner.a, inner.v, **counted), part, inner)

    def parts(self, state: RemeshedState) -> tuple[P, Any]:
        """The solver of the moment and its state, at the time that the time loop gave it."""
        assert state.part is not None
        part: P = state.part
        return part, replace(state.inner, t=state.t)

    def _replaced(self, state: RemeshedState) -> tuple[RemeshedState, Outcome]:
        """The same moment on a new mesh."""
        part, inner = self.parts(state)
        before = part.solver.measure(inner).area
        shrunk = np.sqrt(before / self.area_at_rest)
        part, new, outcome = self.carried_over(part, inner, self._edge * min(shrunk, 1.0))
        change = state.area_change + abs(part.solver.measure(new).area / before - 1)
        counted = replace(state, remeshings=state.remeshings + 1, area_change=change, limit=SLIVER)
        return _outer(counted, part, new), outcome


def _outer(state: RemeshedState, part: Part, inner: State) -> RemeshedState:
    """What `state` counts, at the moment of an inner state."""
    common = {field.name: getattr(inner, field.name) for field in fields(State)}
    return replace(state, **common, part=part, inner=inner)
