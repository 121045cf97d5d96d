"""Moving finite elements of order 2 to 4 in time: explicit motion, implicit diffusion, embedded error.

v = A^-1 (F - B u) is a bounded operator of order 0 in space, so motion is not stiff; diffusion alone is.
With P = M(x) a, the concentration against the test functions, (B.21) and (B.22) read

    dx/dt = v(x, a),    dP/dt = G(t, x, a) = k (H(x) - M(x) a) - d K(x) a + S(t, x),

and an additive pair takes the first explicitly and the second implicitly.  In every stage x is known before a
is asked for: one linear transport solve, one force balance.  Summed over all nodes, P is total actin; each
stage adds k (|Omega| - total) and its source to it with a mass matrix of its own, so that conservation holds
to round-off whatever the mesh does.
"""

from copy import copy
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import (
    Frame,
    Grid,
    Mechanics,
    Memento,
    Move,
    Probes,
    Problem,
    State,
    recalled,
    remembered,
    straight_frame,
)
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import Operator
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor, PrescribedMotion
from actin_xcheck.core.observables import Measures
from fem.fields import Lattice, cell_means, locate, measure, orientation
from fem.force_balance import ForceBalance
from fem.solver import TransportMatrices, TransportSolver
from fem.space import Space
from fem.tableaux import TABLEAUX


@dataclass(frozen=True)
class ImexState(State):
    """A `State` with nodal values `a` (N,) and P = M a, (N,).

    `anchor` is where the next step's systems are preconditioned, as in `FemState`.
    """

    content: Array = field(default_factory=lambda: np.zeros(0))
    anchor: Anchor | None = None


@dataclass(frozen=True)
class _Stage:
    """What a stage adds to the step: how nodes move, G (N,), and the gain of total actin it stands for."""

    a: Array
    move: Move
    rate: Array
    gain: float


class FemImex:
    """P_k elements in space, an additive Runge-Kutta pair in time.

    Parameters
    ----------
    problem : what to solve.
    mesh : the reference mesh.
    mechanics : who moves the nodes; a prescribed motion is integrated too, to the pair's order.
    space, time : orders of the elements, 1 to 8, and of the pair, 2 to 5.
    """

    def __init__(self, problem: Problem, mesh: Mesh, mechanics: Mechanics, space: int, time: int) -> None:
        self.problem, self.mesh, self.mechanics = problem, mesh, mechanics
        self.tableau = TABLEAUX[time]
        if isinstance(mechanics, ForceBalance):
            self.space = mechanics.space
        else:
            self.space = Space.on(mesh, space, problem.model.parameters.l0)
        if isinstance(mechanics, PrescribedMotion):
            self.mechanics = replace(mechanics, xi=self.space.xi)
        self._lattice = Lattice(self.space, mesh.triangles)
        self._solver = TransportSolver(self.space)
        self._anchor: Anchor | None = None

    def init(self) -> ImexState:
        """Interpolate the initial data at the nodes."""
        xi = self.space.xi
        x, a = self.mechanics.start(xi + self.problem.u0(xi)), self.problem.a0(xi)
        anchor = Anchor(x)
        carried = self.mechanics.carried(self.problem.u0)
        move = self._near(anchor)._flow(0.0, x, a, carried, None)
        return ImexState(0.0, x, a, move.v, carried=carried, content=self._mass(x) @ a, anchor=anchor)

    def corners(self, state: ImexState) -> Array:
        """Values (3, n_cells) at the corners of the cells."""
        return state.a[self.mesh.triangles]

    @property
    def grid(self) -> Grid:
        """The cells with equispaced nodes."""
        return self._lattice.grid

    def frame(self, state: ImexState) -> Frame:
        """The same polynomials by their values at the grid's nodes."""
        if self.space.order == 1:
            return straight_frame(self.mesh, state, self.corners(state))
        x, v, a = (self._lattice.moved(nodal) for nodal in (state.x, state.v, state.a))
        return Frame(x, v, a, cell_means(self.space, state.x, state.a))

    def check(self, state: ImexState) -> Outcome:
        """The orientation of the cells, at all quadrature points."""
        return orientation(self.space, state.t, state.x)

    def measure(self, state: ImexState) -> Measures:
        """Integrals over the curved cell."""
        return measure(self.space, state.x, state.a)

    def probes(self, points: Array) -> Probes[ImexState]:
        """The polynomials at material points (2, k)."""
        cells, values = locate(self.space, points)
        nodes = self.space.cells[:, cells]
        return lambda state: (
            (values * state.a[nodes]).sum(axis=0),
            (values * state.x[:, nodes]).sum(axis=1).T,
        )

    def step(self, state: ImexState, dt: float) -> tuple[ImexState, Outcome]:
        """One step of the pair; its embedded solution gives `local_error`."""
        if state.anchor is not self._anchor:
            return self._near(state.anchor).step(state, dt)
        pair, stages = self.tableau, [self._first(state)]
        for i in range(1, len(pair.c)):
            if not (outcome := stages[-1].move.outcome).ok:
                return state, outcome
            x = state.x + dt * sum(w * s.move.v for w, s in zip(pair.explicit[i], stages, strict=False))
            content = state.content + dt * sum(
                w * s.rate for w, s in zip(pair.implicit[i], stages, strict=False)
            )
            carried = state.carried + dt * sum(
                w * s.move.carried for w, s in zip(pair.explicit[i], stages, strict=False)
            )
            t = state.t + pair.c[i] * dt
            if not (outcome := orientation(self.space, t, x)).ok:
                return state, outcome
            about = self._about(pair.ahead[i], stages)
            stages.append(self._stage(t, dt * pair.gamma, x, content, carried, about))
        return self._combined(state, dt, stages)

    def memento(self, state: ImexState) -> Memento:
        """The state with P, which is no function of a to the last bit, and where it is preconditioned."""
        assert state.anchor is not None
        return {**remembered(state), "content": state.content, "anchor": state.anchor.x}

    def restored(self, memento: Memento) -> ImexState:
        """The state again."""
        known, anchor = recalled(memento), Anchor(memento["anchor"])
        return ImexState(**known, content=memento["content"], anchor=anchor)

    def _near(self, anchor: Anchor | None) -> Self:
        """Return the same, its systems preconditioned at an anchor."""
        other = copy(self)
        other._anchor = anchor
        if anchor is not None and isinstance(self.mechanics, ForceBalance):
            other.mechanics = self.mechanics.near(anchor)
        return other

    def _first(self, state: ImexState) -> _Stage:
        """The stage at the old state: explicit in both."""
        move = self._flow(state.t, state.x, state.a, state.carried, state.v)
        stiffness = TransportMatrices(self.space, state.x).stiffness
        gain, total = self._gain(state.t, state.x), self._rate() * state.content
        rate = gain - total - self.problem.model.parameters.d * (stiffness @ state.a)
        return _Stage(state.a, move, rate, float(gain.sum() - total.sum()))

    def _stage(
        self,
        t: float,
        dt: float,
        x: Array,
        content: Array,
        carried: Array,
        about: tuple[Array, Array],
    ) -> _Stage:
        """Solve M a = content + dt G(t, x, a) for a, then ask how the nodes move under it.

        `about` is what a and v are about.
        """
        k, d = self._rate(), self.problem.model.parameters.d
        matrices, gain = TransportMatrices(self.space, x), self._gain(t, x)
        left, right = matrices.combined(1 + dt * k, dt * d), content + dt * gain
        a, outcome = self._solver.solve(left, right, dt * d / (1 + dt * k), self._anchor, about[0])
        a, new = matrices.kept(a, right.sum() / (1 + dt * k))
        move = self._flow(t, x, a, carried, about[1]) if outcome.ok else Move(x, np.zeros_like(x), outcome)
        return _Stage(a, move, (new - content) / dt, float(gain.sum() - k * new.sum()))

    def _about(self, weights: Array, stages: list[_Stage]) -> tuple[Array, Array]:
        """About what a and v of the next stage are."""
        pairs = list(zip(weights, stages, strict=False))
        return sum(w * one.a for w, one in pairs), sum(w * one.move.v for w, one in pairs)

    def _flow(self, t: float, x: Array, a: Array, carried: Array, about: Array | None) -> Move:
        corners = a[self.space.cells]
        if about is not None and isinstance(self.mechanics, ForceBalance):
            return self.mechanics.flow(t, x, corners, carried, about)
        return self.mechanics.flow(t, x, corners, carried)

    def _combined(self, old: ImexState, dt: float, stages: list[_Stage]) -> tuple[ImexState, Outcome]:
        pair, last = self.tableau, stages[-1].move
        if not last.outcome.ok:
            return old, last.outcome
        velocities = np.array([stage.move.v for stage in stages])
        rates = np.array([stage.rate for stage in stages])
        x = self.mechanics.settle(old.x + dt * np.tensordot(pair.b, velocities, 1))
        content = old.content + dt * pair.b @ rates
        carried = old.carried + dt * sum(w * s.move.carried for w, s in zip(pair.b, stages, strict=True))
        outcome = orientation(self.space, old.t + dt, x)
        if outcome.ok and isinstance(self.mechanics, ForceBalance):  # what the next step would begin with
            outcome = self.mechanics.intact(old.t + dt, x, carried)
        if not outcome.ok:
            return old, outcome
        matrices = TransportMatrices(self.space, x)
        # the last stage's a is at the new time, if not of the whole order
        a, outcome = self._solver.solve(matrices.mass, content, 0.0, self._anchor, stages[-1].a)
        a, content = matrices.kept(a, content.sum())
        before = old.content.sum()
        gained = dt * sum(w * stage.gain for w, stage in zip(pair.b, stages, strict=True))
        wrong = pair.b - pair.b_embedded
        moved = dt * np.abs(np.tensordot(wrong, velocities, 1)).max()
        strains = np.array([stage.move.carried for stage in stages])
        strained = dt * np.abs(np.tensordot(wrong, strains, 1)).max(initial=0.0)
        # the mass matrix's diagonal stands for it: same norm but for a factor that no mesh changes
        spread = dt * np.sqrt(((wrong @ rates) ** 2 / matrices.diagonal()).sum() / (a @ content))
        anchor = self._anchor
        if anchor is None or anchor.worn(self.space.cells[:3], old.x, x, len(stages)):
            anchor = Anchor(x)
        new = ImexState(
            old.t + dt, x, a, last.v, (content.sum() - before - gained) / content.sum(),
            last.net_force, last.net_torque, float(max(moved, strained, spread)), carried, content, anchor,
        )  # fmt: skip
        return new, outcome

    def _rate(self) -> float:
        return self.problem.model.reaction_rate()

    def _mass(self, x: Array) -> sp.csr_matrix | Operator:
        return TransportMatrices(self.space, x).mass

    def _gain(self, t: float, x: Array) -> Array:
        """k H + S: what polymerisation and the source add, (N,)."""
        inside = self.space.inside
        density = np.full((inside.weights.shape[0], self.space.cells.shape[1]), self._rate())
        if self.problem.source is not None:
            place, origin = (inside.blend(nodes[:, inside.cells]) for nodes in (x, self.space.xi))
            density = density + self.problem.source(place, origin, t)
        return self.space.scalars.vector(inside.at(x).load(density))
