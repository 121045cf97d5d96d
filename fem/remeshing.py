"""Curved elements that go on where their mesh would fold, on a new triangulation of the reference disk."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache

import numpy as np

from actin_xcheck.core.contract import Frame, Grid, Memento, Probes, State
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.observables import Measures
from fem.fields import Lattice, cell_means, measure
from fem.force_balance import ForceBalance
from fem.imex import FemImex, ImexState
from fem.solver import TransportMatrices
from fem.space import Space
from fem.triangulation import (
    SLIVER,
    NoMesh,
    Reading,
    Rebalanced,
    edge_of,
    new_mesh,
    placed_space,
    projected,
    remeshed,
    shapes,
)

LESS = 0.8
"""Of a shape: where there is no better mesh, another one is sought when this much is left."""


_COUNTED = ("remeshings", "area_change", "limit")


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

    part: "Part | None" = None
    inner: ImexState | None = None
    remeshings: int = 0
    area_change: float = 0.0
    limit: float = SLIVER


class Part:
    """A solver on one mesh, and what reads its fields at the nodes that are stored.

    Parameters
    ----------
    solver : on the mesh.
    shown : the space whose nodes are stored.
    """

    def __init__(self, solver: FemImex, shown: Space) -> None:
        self.solver, self._shown = solver, shown

    @cached_property
    def reading(self) -> Reading:
        """At the nodes of the space that is shown, (N,)."""
        return Reading.at(self.solver.space, self._shown.xi)


class Remeshing:
    """A `FemImex` whose mesh is replaced when a cell has lost its shape; see `remesh.py`.

    New edges are as long, in the moving cell, as the first mesh's were at the start: short waves, which d
    cuts off at a wave number of the current configuration, stay as resolved as they were.  Where the cell
    shrinks, they shrink with it, so that there are never fewer cells.  What is stored of a state is read at
    the material points of the first mesh, so that a film has one topology; measured is the state itself.

    Parameters
    ----------
    first : the solver on the mesh to start with, of a disk.
    build : binds the solver to another mesh and its force balance.
    """

    def __init__(self, first: FemImex, build: Callable[[Mesh, ForceBalance], FemImex]) -> None:
        self.first, self.build = first, build
        self.mesh = mesh = first.mesh
        self._shown = self.first.space
        self._edge = edge_of(mesh)
        self._lattice = Lattice(self._shown, mesh.triangles)

    @property
    def grid(self) -> Grid:
        """That of the first mesh."""
        return self._lattice.grid

    def init(self) -> RemeshedState:
        """On the first mesh."""
        inner = self.first.init()
        blank = RemeshedState(inner.t, inner.x, inner.a, inner.v)
        return _outer(blank, Part(self.first, self._shown), inner)

    def step(self, state: RemeshedState, dt: float) -> tuple[RemeshedState, Outcome]:
        """A step on the mesh of the moment, replaced after it where it is about to fold.

        Where no better mesh is found the run goes on as long as no cell turns over.
        """
        part, inner = _parts(state)
        new, outcome = part.solver.step(inner, dt)
        if not outcome.ok:
            return state, outcome
        after = _outer(state, part, new)
        worst = shapes(part.solver.space, new.x).min()
        if worst > state.limit:
            return after, outcome
        try:
            return self._replaced(after)
        except NoMesh:
            return replace(after, limit=LESS * worst), outcome

    def check(self, state: RemeshedState) -> Outcome:
        """The orientation of the cells of the moment."""
        part, inner = _parts(state)
        return part.solver.check(inner)

    def corners(self, state: RemeshedState) -> Array:
        """Values (3, n_cells) at the corners of the first mesh's cells."""
        part, inner = _parts(state)
        return part.reading.of(inner.a)[self.mesh.triangles]

    def measure(self, state: RemeshedState) -> Measures:
        """Integrals over the cells of the moment."""
        part, inner = _parts(state)
        return part.solver.measure(inner)

    def frame(self, state: RemeshedState) -> Frame:
        """The polynomials of the moment at the nodes of the grid."""
        part, inner = _parts(state)
        read = [part.reading.of(nodal) for nodal in (inner.x, inner.v, inner.a)]
        means = cell_means(self._shown, read[0], read[2])
        x, v, a = (self._lattice.moved(nodal) for nodal in read)
        return Frame(x, v, a, means)

    def probes(self, points: Array) -> Probes[RemeshedState]:
        """Material points (2, k), found in every mesh anew."""

        @lru_cache(maxsize=1)  # those of meshes that have been left are not asked again
        def of(part: Part) -> Probes[ImexState]:
            return part.solver.probes(points)

        def read(state: RemeshedState) -> tuple[Array, Array]:
            part, inner = _parts(state)
            return of(part)(inner)

        return read

    def memento(self, state: RemeshedState) -> Memento:
        """The inner solver's, with the mesh of the moment and what is counted."""
        part, inner = _parts(state)
        mesh, space = part.solver.mesh, part.solver.space
        counted = {name: np.asarray(getattr(state, name)) for name in _COUNTED}
        placed = {"mesh_xi": mesh.xi, "triangles": mesh.triangles, "xi": space.xi}
        return {**part.solver.memento(inner), **counted, **placed}

    def restored(self, memento: Memento) -> RemeshedState:
        """The state again, on its mesh."""
        counted = {name: memento[name].tolist() for name in _COUNTED}
        part = Part(self.first, self._shown)
        if counted["remeshings"]:
            mesh = new_mesh(memento["mesh_xi"], memento["triangles"])
            model, order = self.first.problem.model, self._shown.order
            space = placed_space(mesh, order, model.parameters.l0, memento["xi"])
            part = Part(self.build(mesh, Rebalanced(model, mesh, space)), self._shown)
        inner = part.solver.restored(memento)
        blank = RemeshedState(inner.t, inner.x, inner.a, inner.v, **counted)
        return _outer(blank, part, inner)

    def _replaced(self, state: RemeshedState) -> tuple[RemeshedState, Outcome]:
        """The same moment on a new mesh: x and v interpolated, a projected, total actin kept.

        Raises
        ------
        NoMesh : there is no sound one.
        """
        (part, inner), model = _parts(state), self.first.problem.model
        old, shown = part.solver.space, self._shown
        before = measure(old, inner.x, inner.a)
        shrunk = np.sqrt(before.area / measure(shown, shown.xi, np.ones(shown.xi.shape[1])).area)
        edge = self._edge * min(shrunk, 1.0)
        mesh, space = remeshed(old, inner.x, model.parameters.l0, edge)
        balance = Rebalanced(model, mesh, space)
        solver = self.build(mesh, balance)
        reading = Reading.at(old, space.xi)
        x, v = solver.mechanics.settle(reading.of(inner.x)), reading.of(inner.v)
        a, outcome = projected(old, space, x, inner.a, before.total_actin)
        content = TransportMatrices(space, x).mass @ a
        carried = balance.carried_from(part.solver.mechanics, inner.carried)
        new = replace(inner, x=x, a=a, v=v, carried=carried, content=content, anchor=Anchor(x))
        change = state.area_change + abs(measure(space, x, a).area / before.area - 1)
        counted = replace(state, remeshings=state.remeshings + 1, area_change=change, limit=SLIVER)
        return _outer(counted, Part(solver, self._shown), new), outcome


def _outer(state: RemeshedState, part: Part, inner: ImexState) -> RemeshedState:
    """What `state` counts, at the moment of an inner state."""
    common = {field.name: getattr(inner, field.name) for field in fields(State)}
    return replace(state, **common, part=part, inner=inner)


def _parts(state: RemeshedState) -> tuple[Part, ImexState]:
    """The solver of the moment and its state, at the time that the time loop gave it."""
    assert state.part is not None
    assert state.inner is not None
    return state.part, replace(state.inner, t=state.t)
