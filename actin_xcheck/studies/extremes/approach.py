"""How a run comes near the end of the model: 1 + div u step by step, and when it reaches zero.

From F = dx/dxi the dilation is phi = 2 - tr F^-1, as in the pressure (2.5); it is read at the quadrature
points of what a method stores of a state, the same for all methods.
"""

from dataclasses import dataclass, field

import numpy as np

from actin_xcheck.core.contract import Grid, Solver, State
from actin_xcheck.core.lagrange import rule
from actin_xcheck.core.model import Array


def least_dilation(grid: Grid, x: Array) -> tuple[float, Array]:
    """The smallest 1 + phi on a grid whose nodes are at x (2, N), and the material point (2,) it is at."""
    points = rule(grid.order, 2 * grid.order)
    before, now = (np.einsum("ajq,iae->ijqe", points.slopes, nodes[:, grid.cells]) for nodes in (grid.xi, x))
    (x_r, x_s), (y_r, y_s) = now
    adjugate = np.array([[y_s, -x_s], [-y_r, x_r]])
    trace = np.einsum("ijqe,jiqe->qe", before, adjugate) / (x_r * y_s - x_s * y_r)
    where = np.unravel_index(trace.argmax(), trace.shape)
    return float(3 - trace[where]), points.blend(grid.xi, grid.cells)[:, where[0], where[1]]


@dataclass
class Approach:
    """Watches a run; rows are (t, smallest 1 + phi), `place` where it is in the last state."""

    solver: Solver
    rows: list[tuple[float, float]] = field(default_factory=list)
    place: Array = field(default_factory=lambda: np.zeros(2))
    residual: float = 0.0
    last: State | None = None

    def record(self, dt: float, state: State) -> None:
        """See every state."""
        least, self.place = least_dilation(self.solver.grid, self.solver.frame(state).x)
        self.rows.append((state.t, least))
        self.residual = max(self.residual, abs(state.balance_residual))
        self.last = state

    def frame(self, state: State) -> None:
        """Output times mean nothing here."""

    @property
    def breakdown(self) -> float:
        """When 1 + phi reaches zero: the root of the line through the last two states.

        Steps that pass it are rejected and shortened, so that the last ones lie close to it.
        """
        (t0, y0), (t1, y1) = self.rows[-2:]
        return t1 - y1 * (t1 - t0) / (y1 - y0)
