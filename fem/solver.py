"""The paper's scheme (B.23): force balance, move the nodes, transport on the moved mesh."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log2

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import Mechanics, Memento, Polygonal, Problem, State, recalled, remembered
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import Operator, SymmetricSolver
from actin_xcheck.core.mesh import Mesh, orientation, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.observables import balance_residual
from actin_xcheck.core.preconditioner import Preconditioner
from fem.force_balance import ForceBalance
from fem.space import CELLWISE, Space


class TransportMatrices:
    """M and K of (B.22) in one configuration.

    Parameters
    ----------
    space : of the concentration.
    x : node positions (2, N).
    """

    def __init__(self, space: Space, x: Array) -> None:
        self.space, self.x = space, x

    @cached_property
    def mass(self) -> sp.csr_matrix | Operator:
        """M, (N, N)."""
        return CellTransport(self, 1.0, 0.0) if self.space.order >= CELLWISE else self._mass

    @cached_property
    def stiffness(self) -> sp.csr_matrix | Operator:
        """K, (N, N)."""
        return CellTransport(self, 0.0, 1.0) if self.space.order >= CELLWISE else self._stiffness

    def combined(self, mass: float, diffusion: float) -> sp.csr_matrix | Operator:
        """A multiple of M plus one of K."""
        if self.space.order >= CELLWISE:
            return CellTransport(self, mass, diffusion)
        return self.assembled(mass, diffusion)

    def assembled(self, mass: float, diffusion: float) -> sp.csr_matrix:
        """The same, entry by entry."""
        data = mass * self._mass.data + diffusion * self._stiffness.data
        return self.space.scalars.pattern.matrix(data)

    @cached_property
    def _mass(self) -> sp.csr_matrix:
        return self._mass_at(self.x)

    def _mass_at(self, x: Array) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.inside.at(x).mass())

    @cached_property
    def _stiffness(self) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.gradients.at(self.x).stiffness())

    def kept(self, a: Array, total: float) -> tuple[Array, Array]:
        """Shift a (N,) by what a solver has left of a total amount; also M a, whose sum that is."""
        content = self.mass @ a
        inside = self.space.inside.at(self.x)
        ones = self.space.scalars.vector(inside.load(np.ones_like(inside.dx)))
        shift = (total - content.sum()) / ones.sum()
        return a + shift, content + shift * ones

    def diagonal(self) -> Array:
        """Of M, (N,)."""
        if self.space.order < CELLWISE:
            return np.asarray(self._mass.diagonal())
        squares = self.space.inside.values[..., 0] ** 2
        return self.space.scalars.vector(squares @ self.space.inside.at(self.x).dx)


@dataclass(frozen=True, eq=False)
class CellTransport:
    """A multiple of M plus one of K, applied cell by cell: many numbers are never made."""

    of: TransportMatrices
    mass: float
    diffusion: float

    def __matmul__(self, a: Array) -> Array:
        """Apply it to a concentration (N,)."""
        space = self.of.space
        sample, (values, slopes), local = space.inside.at(self.of.x), space.inside.tables, a[space.cells]
        summed = np.zeros_like(local)
        if self.mass:
            summed += values.T @ (self.mass * sample.dx * (values @ local))
        if self.diffusion:
            flux = np.einsum("mnp,np->mp", sample.metric, (slopes @ local).reshape(2, -1))
            summed += self.diffusion * (slopes.T @ flux.reshape(-1, local.shape[1]))
        return space.scalars.vector(summed)

    def assembled(self) -> sp.csr_matrix:
        """The matrix."""
        return self.of.assembled(self.mass, self.diffusion)


class TransportSolver:
    """Solves with multiples of M + s K, M and K of (B.22) in any configuration, s >= 0.

    The same matrix in a configuration nearby preconditions it, with s rounded to a fourth of an octave, or to
    an octave where iterations are cheap: few factorisations serve all steps, and what a solve returns depends
    on its arguments alone.

    Parameters
    ----------
    space : of the concentration.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        pattern = space.scalars.pattern
        self._solver = SymmetricSolver(pattern.rows, pattern.columns, space.parts)
        self._rest = Anchor(space.xi)
        self._parts = 1 if space.order >= CELLWISE else 4

    def solve(
        self,
        matrix: sp.csr_matrix | Operator,
        rhs: Array,
        diffusion: float,
        anchor: Anchor | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Outcome]:
        """Solve with a multiple (N, N) of M + s K, s being `diffusion`, for a right-hand side (N,).

        An anchor near, the reference disk if none is given, makes it fast, and so does a solution near.
        """
        rounded = 2.0 ** (round(self._parts * log2(diffusion)) / self._parts) if diffusion > 0 else 0.0
        anchor = anchor or self._rest
        return self._solver.solve(
            matrix, rhs, anchor.factor(rounded, lambda: self._factor(anchor.x, rounded)), start
        )

    def _factor(self, x: Array, diffusion: float) -> Preconditioner | None:
        return self._solver.preconditioner(TransportMatrices(self.space, x).assembled(1.0, diffusion))


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
        mechanics, corners = self._near(state.anchor), self.corners(state)
        if isinstance(mechanics, ForceBalance):
            move = mechanics.advance(state.t, dt, state.x, corners, state.v)
        else:
            move = mechanics.advance(state.t, dt, state.x, corners)
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
