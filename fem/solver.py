"""The paper's scheme (B.23): force balance, move the nodes, transport on the moved mesh."""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import Mechanics, Memento, Polygonal, Problem, State, recalled, remembered
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh, orientation, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.observables import balance_residual
from fem.force_balance import ForceBalance
from fem.space import Space
from fem.transport import TransportSolver


@dataclass(frozen=True)
class FemState(State):
    """A `State` with nodal concentrations `a` (N,).

    Attributes
    ----------
    mass : the mass matrix of its configuration.
    anchor : where the next step's systems are preconditioned; None on the reference disk.  To go on from a
        state its positions are needed too, the factors and the mass matrix follow.
    """

    mass: sp.csr_matrix = field(default_factory=lambda: sp.csr_matrix((0, 0)))
    anchor: Anchor | None = None


class FemP1Paper(Polygonal[FemState]):
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
        self._solver = TransportSolver(self.space)

    def init(self) -> FemState:
        """Interpolate the initial data on the mesh (B.5.1)."""
        x = self.mechanics.start(self.mesh.xi + self.problem.u0(self.mesh.xi))
        a = self.problem.a0(self.mesh.xi)
        anchor = Anchor(x)
        v = self._near(anchor).velocity(0.0, x, a[self.mesh.triangles])
        return FemState(0.0, x, a, v, mass=self._mass(x), anchor=anchor)

    def corners(self, state: FemState) -> Array:
        """Corner values (3, n_cells) of the continuous P1 field."""
        return state.a[self.mesh.triangles]

    def step(self, state: FemState, dt: float) -> tuple[FemState, Outcome]:
        """One step of (B.23); every matrix is assembled on the configuration the equation names."""
        move = self._near(state.anchor).advance(state.t, dt, state.x, self.corners(state))
        new = FemState(
            state.t + dt, move.x, state.a, move.v, 0.0, move.net_force, move.net_torque, mass=state.mass
        )
        outcome = move.outcome if not move.outcome.ok else orientation(self.mesh, new.t, move.x)
        return (new, outcome) if not outcome.ok else self._transport(state, new, dt)

    def memento(self, state: FemState) -> Memento:
        """The state and where its systems are preconditioned; factors and mass matrix follow."""
        assert state.anchor is not None
        return {**remembered(state), "anchor": state.anchor.x}

    def restored(self, memento: Memento) -> FemState:
        """The state again."""
        known = recalled(memento)
        return FemState(**known, mass=self._mass(known["x"]), anchor=Anchor(memento["anchor"]))

    def _near(self, anchor: Anchor | None) -> Mechanics:
        """The mechanics, its systems preconditioned at an anchor."""
        if anchor is None or not isinstance(self.mechanics, ForceBalance):
            return self.mechanics
        return self.mechanics.near(anchor)

    def _transport(self, old: FemState, new: FemState, dt: float) -> tuple[FemState, Outcome]:
        """((1 + dt) M + dt d K)(t+dt) a = M(t) (a + dt) (B.23b), plus dt times the source at t + dt."""
        rate, d = self.problem.model.reaction_rate(), self.problem.model.parameters.d
        space, mass, moved = self.space, self._mass(new.x), self.space.inside.at(new.x)
        source = self._source(new.t, new.x)
        rhs = old.mass @ (old.a + dt * rate) + dt * source
        stiffness = space.scalars.matrix(moved.stiffness())
        left = space.scalars.pattern.matrix((1 + dt * rate) * mass.data + dt * d * stiffness.data)
        a, outcome = self._solver.solve(left, rhs, dt * d / (1 + dt * rate), old.anchor)
        triangles = self.mesh.triangles
        before, after = signed_areas(old.x, triangles), moved.dx.sum(axis=0)
        residual = balance_residual(
            dt,
            rate,
            float(before @ old.a[triangles].mean(axis=0)),
            float(after @ a[triangles].mean(axis=0)),
            float(before.sum()),
            float(source.sum()),
        )
        anchor = old.anchor
        if anchor is None or anchor.worn(triangles, old.x, new.x):
            anchor = Anchor(new.x)
        return replace(new, a=a, mass=mass, balance_residual=residual, anchor=anchor), outcome

    def _mass(self, x: Array) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.inside.at(x).mass())

    def _source(self, t: float, x: Array) -> Array:
        if self.problem.source is None:
            return np.zeros(x.shape[1])
        rule = self.space.inside
        place, origin = (rule.blend(nodes[:, rule.cells]) for nodes in (x, self.space.xi))
        return self.space.scalars.vector(rule.at(x).load(self.problem.source(place, origin, t)))
