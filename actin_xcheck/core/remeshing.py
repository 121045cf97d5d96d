"""Runs that go on where their mesh would fold, on a new one: what both codes have in common of it."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from actin_xcheck.core.contract import Memento, Probes, State
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures
from actin_xcheck.core.remesh import SLIVER, NoMesh, edge_of

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
