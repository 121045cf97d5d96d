"""P1 elements with a lumped mass, and the midpoint rule in time: explicit for motion, implicit for actin.

With m_i the integral of phi_i and P_i = m_i a_i what node i holds, (B.21) and (B.22) read

    dx/dt = v(x, a),    dP/dt = k (m - P) - d K a + m s.

Nodes go half a step with v(x, a).  There the second equation is solved for b, the mean of P before and after
the step over m; all of the step is made with v and dP/dt at the midpoint.  K's columns sum to zero, so that
total actin changes by reaction and source alone, to round-off.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import Mechanics, Memento, Polygonal, Problem, State, recalled, remembered
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import solve
from actin_xcheck.core.mesh import Mesh, orientation, signed_areas
from actin_xcheck.core.model import Array


class LumpedMidpoint(Polygonal):
    """The whole method; `Polygonal` measures it, draws it and reads its probes.

    Parameters
    ----------
    problem : what to solve.
    mesh : the reference mesh.
    mechanics : who moves the nodes; it is asked for velocities.
    """

    def __init__(self, problem: Problem, mesh: Mesh, mechanics: Mechanics) -> None:
        self.problem, self.mesh, self.mechanics = problem, mesh, mechanics

    def init(self) -> State:
        """The initial data at the nodes."""
        xi = self.mesh.xi
        x, a = self.mechanics.start(xi + self.problem.u0(xi)), self.problem.a0(xi)
        return State(0.0, x, a, self.mechanics.velocity(0.0, x, a[self.mesh.triangles]))

    def corners(self, state: State) -> Array:
        """Corner values (3, n_cells) of the continuous P1 field."""
        return state.a[self.mesh.triangles]

    def step(self, state: State, dt: float) -> tuple[State, Outcome]:
        """One step of the midpoint rule; a step that fails returns the state it started from."""
        model, half = self.problem.model, state.t + dt / 2
        k, d, before = model.reaction_rate(), model.parameters.d, self._mass(state.x) * state.a
        move = self.mechanics.flow(state.t, state.x, self.corners(state))
        if not move.outcome.ok:
            return state, move.outcome
        x = state.x + dt / 2 * move.v
        outcome = orientation(self.mesh, half, x)
        if not outcome.ok:
            return state, outcome
        mass, supply = self._mass(x), self._supply(half, x)
        left = sp.diags((1 + dt / 2 * k) * mass) + dt / 2 * d * self._stiffness(x)
        b, outcome = solve(left.tocsr(), before + dt / 2 * supply)
        if outcome.ok:
            move = self.mechanics.flow(half, x, b[self.mesh.triangles])
            outcome = move.outcome
        if not outcome.ok:
            return state, outcome
        x, after = self.mechanics.settle(state.x + dt * move.v), 2 * mass * b - before
        outcome = orientation(self.mesh, state.t + dt, x)
        if not outcome.ok:
            return state, outcome
        gained = dt * (supply.sum() - k * (mass * b).sum())
        residual = float((after.sum() - before.sum() - gained) / after.sum())
        loads = move.net_force, move.net_torque
        return State(state.t + dt, x, after / self._mass(x), move.v, residual, *loads), outcome

    def memento(self, state: State) -> Memento:
        """All that the next step depends on: a state holds nothing else."""
        return remembered(state)

    def restored(self, memento: Memento) -> State:
        """The state again."""
        return State(**recalled(memento))

    def _mass(self, x: Array) -> Array:
        """The lumped mass: a third of the triangles around each node, (N,)."""
        thirds = np.tile(signed_areas(x, self.mesh.triangles) / 3, 3)
        return np.bincount(self.mesh.triangles.ravel(), thirds, x.shape[1])

    def _supply(self, t: float, x: Array) -> Array:
        """What polymerisation and source give to each node, (N,)."""
        per_area = np.full(x.shape[1], self.problem.model.reaction_rate())
        if self.problem.source is not None:
            per_area += self.problem.source(x, self.mesh.xi, t)
        return self._mass(x) * per_area

    def _stiffness(self, x: Array) -> sp.csr_matrix:
        """K: in a triangle the gradient of phi_i is the side across, turned by 90 degrees, over 2 |T|."""
        nodes = self.mesh.triangles
        sides = np.roll(x[:, nodes], 1, axis=1) - np.roll(x[:, nodes], -1, axis=1)
        entries = np.einsum("die,dje->ije", sides, sides) / (4 * signed_areas(x, nodes))
        rows, columns = np.broadcast_arrays(nodes[:, None], nodes[None])
        return sp.coo_matrix((entries.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
