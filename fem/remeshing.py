"""Curved elements that go on where their mesh would fold, on a new triangulation of the reference disk."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from actin_xcheck.core.contract import Frame, Grid, Memento
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.remesh import new_mesh
from actin_xcheck.core.remeshing import Remeshed, RemeshedState
from fem.fields import Lattice, cell_means, measure
from fem.force_balance import ForceBalance
from fem.imex import FemImex, ImexState
from fem.solver import TransportMatrices
from fem.space import Space
from fem.triangulation import Reading, Rebalanced, placed_space, projected, remeshed, shapes


@dataclass(frozen=True, eq=False)
class FemPart:
    """A solver on one mesh, and what reads its fields at the nodes that are stored.

    Attributes
    ----------
    solver : on the mesh.
    shown : the space whose nodes are stored.
    """

    solver: FemImex
    shown: Space

    @cached_property
    def reading(self) -> Reading:
        """At the nodes of the space that is shown, (N,)."""
        return Reading.at(self.solver.space, self.shown.xi)

    @property
    def placed(self) -> Memento:
        """The mesh and the space's nodes."""
        mesh, space = self.solver.mesh, self.solver.space
        return {"mesh_xi": mesh.xi, "triangles": mesh.triangles, "xi": space.xi}

    def worst(self, x: Array) -> float:
        """The worst shape of a cell with nodes at x (2, N)."""
        return float(shapes(self.solver.space, x).min())


class Remeshing(Remeshed[FemPart]):
    """A `FemImex` whose mesh is replaced; x and v are interpolated, a is projected."""

    def __init__(self, first: FemImex, build: Callable[[Mesh, ForceBalance], FemImex]) -> None:
        super().__init__(first, build)
        self._shown = first.space
        self._lattice = Lattice(self._shown, first.mesh.triangles)

    @property
    def grid(self) -> Grid:
        """That of the first mesh."""
        return self._lattice.grid

    @cached_property
    def area_at_rest(self) -> float:
        """That of the first mesh's curved cells."""
        shown = self._shown
        return measure(shown, shown.xi, np.ones(shown.xi.shape[1])).area

    def started(self) -> FemPart:
        """The part on the first mesh."""
        return FemPart(self.first, self._shown)

    def again(self, memento: Memento) -> FemPart:
        """The part on the mesh that a memento has."""
        mesh = new_mesh(memento["mesh_xi"], memento["triangles"])
        model, order = self.first.problem.model, self._shown.order
        space = placed_space(mesh, order, model.parameters.l0, memento["xi"])
        return FemPart(self.build(mesh, Rebalanced(model, mesh, space)), self._shown)

    def corners(self, state: RemeshedState) -> Array:
        """Values (3, n_cells) at the corners of the first mesh's cells."""
        part, inner = self.parts(state)
        return part.reading.of(inner.a)[self.mesh.triangles]

    def frame(self, state: RemeshedState) -> Frame:
        """The polynomials of the moment at the nodes of the grid."""
        part, inner = self.parts(state)
        read = [part.reading.of(nodal) for nodal in (inner.x, inner.v, inner.a)]
        means = cell_means(self._shown, read[0], read[2])
        x, v, a = (self._lattice.moved(nodal) for nodal in read)
        return Frame(x, v, a, means)

    def carried_over(
        self, part: FemPart, inner: ImexState, edge: float
    ) -> tuple[FemPart, ImexState, Outcome]:
        """A new part and the same moment on it; NoMesh where there is none."""
        model, old = self.first.problem.model, part.solver.space
        mesh, space = remeshed(old, inner.x, model.parameters.l0, edge)
        balance = Rebalanced(model, mesh, space)
        solver = self.build(mesh, balance)
        reading = Reading.at(old, space.xi)
        x, v = solver.mechanics.settle(reading.of(inner.x)), reading.of(inner.v)
        a, outcome = projected(old, space, x, inner.a, part.solver.measure(inner).total_actin)
        content = TransportMatrices(space, x).mass @ a
        carried = balance.carried_from(part.solver.mechanics, inner.carried)
        new = replace(inner, x=x, a=a, v=v, carried=carried, content=content, anchor=Anchor(x))
        return FemPart(solver, self._shown), new, outcome
