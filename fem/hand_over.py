"""A small perturbation as linear modes while they do, then by the whole model."""

from collections.abc import Callable
from dataclasses import replace
from typing import Generic

from actin_xcheck.core.contract import Frame, Grid, Memento, Probes, Problem, S, Solver
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures
from fem.modal import Modal, ModalState


class HandOver(Generic[S]):
    """A small perturbation as modes, handed over to a solver of the whole model when it has grown.

    Parameters
    ----------
    modal : carries the modes, and shows them on the mesh of the whole model.
    later : solves that.
    whole : binds the solver of the whole model to a problem; it goes on from any of the modes' states.
    bound : largest error that the modes may make, see `Modal.neglected`.
    """

    def __init__(
        self, modal: Modal, later: Solver[S], whole: Callable[[Problem], Solver[S]], bound: float
    ) -> None:
        self.modal, self.later, self.whole, self.bound = modal, later, whole, bound

    @property
    def mesh(self) -> Mesh:
        """The whole model's."""
        return self.later.mesh

    @property
    def grid(self) -> Grid:
        """The whole model's."""
        return self.later.grid

    def init(self) -> ModalState | S:
        """The modes of the initial data, or these themselves where they are too large."""
        start = self.modal.init()
        return replace(start, local_error=0.0) if self._small(start) else self.later.init()

    def step(self, state: ModalState | S, dt: float) -> tuple[ModalState | S, Outcome]:
        """A step of the modes as long as it ends within the bound, else one of the whole model."""
        if isinstance(state, ModalState):
            new, outcome = self.modal.step(state, dt)
            if outcome.ok and self._small(new):
                return replace(new, local_error=0.0), outcome  # exact in time
            return self.later.step(self._handed_over(state), dt)
        return self.later.step(state, dt)

    def check(self, state: ModalState | S) -> Outcome:
        """By whoever made the state, as all that follows."""
        return self._of(state).check(state)

    def corners(self, state: ModalState | S) -> Array:
        """Corner values (3, n_cells)."""
        return self._of(state).corners(state)

    def measure(self, state: ModalState | S) -> Measures:
        """Area, total actin, centroid and rim."""
        return self._of(state).measure(state)

    def frame(self, state: ModalState | S) -> Frame:
        """On the whole model's grid."""
        return self.later.frame(self._handed_over(state) if isinstance(state, ModalState) else state)

    def probes(self, points: Array) -> Probes[ModalState | S]:
        """Material points (2, k)."""
        modal, later = self.modal.probes(points), self.later.probes(points)
        return lambda state: modal(state) if isinstance(state, ModalState) else later(state)

    def memento(self, state: ModalState | S) -> Memento:
        """As whoever made the state keeps it."""
        return self._of(state).memento(state)

    def restored(self, memento: Memento) -> ModalState | S:
        """By whoever made it: modes have harmonics."""
        return (self.modal if "harmonics" in memento else self.later).restored(memento)

    def _small(self, state: ModalState) -> bool:
        return self.modal.neglected(state) <= self.bound

    def _of(self, state: ModalState | S) -> Solver:
        return self.modal if isinstance(state, ModalState) else self.later

    def _handed_over(self, state: ModalState) -> S:
        """The whole model's state at the time of the modes'."""
        return replace(self.whole(self.modal.handed_over(state)).init(), t=state.t)
