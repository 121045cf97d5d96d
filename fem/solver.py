"""The paper's scheme (B.23): force balance, move the nodes, transport on the moved mesh."""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from actin_xcheck.geometry import Mesh, integral, orientation
from actin_xcheck.linear import SymmetricSolver
from actin_xcheck.model import Array
from actin_xcheck.observables import area, balance_residual
from actin_xcheck.result import Outcome
from actin_xcheck.solver import Mechanics, Polygonal, Problem, State
from fem.force_balance import ForceBalance
from fem.space import Space


@dataclass(frozen=True)
class FemState(State):
    """A `State` with nodal concentrations `a` (N,) and the mass matrix of its configuration."""

    mass: sp.csr_matrix = field(default_factory=lambda: sp.csr_matrix((0, 0)))


class FemP1Paper(Polygonal):
    """P1 elements in space and (B.23) in time.

    Parameters
    ----------
    problem : what to solve.
    mesh : the reference mesh.
    mechanics : who moves the nodes.
    """

    def __init__(self, problem: Problem, mesh: Mesh, mechanics: Mechanics) -> None:
        self.problem = problem
        self.mesh = mesh
        self.mechanics = mechanics
        if isinstance(mechanics, ForceBalance):
            self.space = mechanics.space
        else:
            self.space = Space.on(mesh, 1, problem.model.parameters.l0)
        pattern = self.space.scalars.pattern
        self._solver = SymmetricSolver(pattern.rows, pattern.columns, self.space.parts)

    def init(self) -> FemState:
        """Interpolate the initial data on the mesh (B.5.1)."""
        x = self.mechanics.start(self.mesh.xi + self.problem.u0(self.mesh.xi))
        a = self.problem.a0(self.mesh.xi)
        v = self.mechanics.velocity(0.0, x, a[self.mesh.triangles])
        return FemState(0.0, x, a, v, mass=self._mass(x))

    def corners(self, state: State) -> Array:
        """Corner values (3, n_cells) of the continuous P1 field."""
        return state.a[self.mesh.triangles]

    def step(self, state: State, dt: float) -> tuple[FemState, Outcome]:
        """One step of (B.23); every matrix is assembled on the configuration the equation names."""
        assert isinstance(state, FemState)
        move = self.mechanics.advance(state.t, dt, state.x, self.corners(state))
        new = FemState(
            state.t + dt, move.x, state.a, move.v, 0.0, move.net_force, move.net_torque, mass=state.mass
        )
        outcome = move.outcome if not move.outcome.ok else orientation(self.mesh, new.t, move.x)
        return (new, outcome) if not outcome.ok else self._transport(state, new, dt)

    def _transport(self, old: FemState, new: FemState, dt: float) -> tuple[FemState, Outcome]:
        """((1 + dt) M + dt d K)(t+dt) a = M(t) (a + dt) (B.23b), plus dt times the source at t + dt."""
        rate, d = self.problem.model.reaction_rate(), self.problem.model.parameters.d
        space, mass = self.space, self._mass(new.x)
        source = self._source(new.t, new.x)
        rhs = old.mass @ (old.a + dt * rate) + dt * source
        stiffness = space.scalars.matrix(space.gradients.at(new.x).stiffness())
        left = space.scalars.pattern.matrix((1 + dt * rate) * mass.data + dt * d * stiffness.data)
        a, outcome = self._solver.solve(left, rhs)
        triangles = self.mesh.triangles
        residual = balance_residual(
            dt,
            rate,
            integral(old.x, triangles, old.a[triangles]),
            integral(new.x, triangles, a[triangles]),
            area(old.x, triangles),
            float(source.sum()),
        )
        return replace(new, a=a, mass=mass, balance_residual=residual), outcome

    def _mass(self, x: Array) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.inside.at(x).mass())

    def _source(self, t: float, x: Array) -> Array:
        if self.problem.source is None:
            return np.zeros(x.shape[1])
        rule = self.space.inside
        place, origin = (rule.blend(nodes[:, rule.cells]) for nodes in (x, self.space.xi))
        return self.space.scalars.vector(rule.at(x).load(self.problem.source(place, origin, t)))
