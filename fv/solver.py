"""Finite-volume methods: FiPy's transport on a mesh that a Mechanics moves."""

from dataclasses import dataclass, field, replace

import numpy as np

from actin_xcheck.core import linear
from actin_xcheck.core.contract import Mechanics, Memento, Polygonal, Problem, State, recalled, remembered
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh, integral, orientation, quadrature_points, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from actin_xcheck.core.observables import area, balance_residual
from fv import krylov
from fv.diamond import over_relaxed_split, reconstruct, two_point, vertex_interpolation
from fv.equations import TransportEquation
from fv.mechanics import FvForceBalance
from fv.mesh import Faces


@dataclass(frozen=True)
class FvState(State):
    """A `State` with cell averages `a` (n_cells,).

    Attributes
    ----------
    corner_values : those of their reconstruction, (3, n_cells).
    anchor : where the finite volumes' own force balance is preconditioned in the next step.
    """

    corner_values: Array = field(default_factory=lambda: np.zeros((3, 0)))
    anchor: Anchor | None = None


class FvDiamond(Polygonal[FvState]):
    """Over-relaxed two-point flux by FiPy plus the linear-exact cross flux: second order in h.

    Parameters
    ----------
    problem : what to solve.
    mesh : the reference mesh.
    mechanics : who moves the nodes: a force balance loaded by our own corner values, ours or a lent one, a
        recorded or a prescribed motion (`driven`).
    """

    consistent = True

    def __init__(self, problem: Problem, mesh: Mesh, mechanics: Mechanics) -> None:
        self.problem = problem
        self.mesh = mesh
        self.mechanics = mechanics
        self.faces = Faces.of(mesh)
        model = problem.model
        self.equation = TransportEquation(self.faces, model.parameters.d, model.reaction_rate())

    def init(self) -> FvState:
        """Cell averages of the initial data."""
        xi = self.mesh.xi
        x = self.mechanics.start(xi + self.problem.u0(xi))
        points = quadrature_points(xi, self.mesh.triangles)
        a = self.problem.a0(points.reshape(2, -1)).reshape(points.shape[1:]).mean(axis=0)
        if not orientation(self.mesh, 0.0, x).ok:  # the time loop will say so; there is nothing to fit
            return FvState(0.0, x, a, np.zeros_like(x), corner_values=np.broadcast_to(a, (3, a.size)))
        corners = reconstruct(self.mesh.triangles, a, vertex_interpolation(self.faces, x) @ a)
        v = self.mechanics.velocity(0.0, x, corners)
        return FvState(0.0, x, a, v, corner_values=corners, anchor=Anchor(x))

    def moved_by(self, state: FvState) -> Mechanics:
        """The mechanics, our own force balance preconditioned where the state says."""
        if state.anchor is None or not isinstance(self.mechanics, FvForceBalance):
            return self.mechanics
        return self.mechanics.near(state.anchor, state.v)

    def next_anchor(self, old: FvState, x: Array, solves: int) -> Anchor | None:
        """Where to precondition after a step of so many force balances that led to x (2, N)."""
        kept = old.anchor
        if kept is None or not isinstance(self.mechanics, FvForceBalance):
            return kept
        return Anchor(x) if kept.worn(self.mesh.triangles, old.x, x, solves) else kept

    def corners(self, state: FvState) -> Array:
        """Corner values (3, n_cells) of the scheme's linear reconstruction."""
        return state.corner_values

    def step(self, state: FvState, dt: float) -> tuple[FvState, Outcome]:
        """Move the nodes, then one conservative backward Euler step between the two configurations."""
        move = self.moved_by(state).advance(state.t, dt, state.x, self.corners(state))
        new = replace(
            state, t=state.t + dt, x=move.x, v=move.v, net_force=move.net_force, net_torque=move.net_torque
        )
        outcome = move.outcome if not move.outcome.ok else orientation(self.mesh, new.t, move.x)
        return (new, outcome) if not outcome.ok else self._transport(state, new, dt)

    def memento(self, state: FvState) -> Memento:
        """The state, the corner values that load the next force balance and where that is preconditioned."""
        where = {} if state.anchor is None else {"anchor": state.anchor.x}
        return {**remembered(state), "corner_values": state.corner_values, **where}

    def restored(self, memento: Memento) -> FvState:
        """The state again."""
        anchor = Anchor(memento["anchor"]) if "anchor" in memento else None
        return FvState(**recalled(memento), corner_values=memento["corner_values"], anchor=anchor)

    def _transport(self, old: FvState, new: FvState, dt: float) -> tuple[FvState, Outcome]:
        triangles, model = self.mesh.triangles, self.problem.model
        volumes, source = signed_areas(new.x, triangles), self._source(new.t, new.x)
        held = dt, old.a, signed_areas(old.x, triangles), volumes
        to_vertices = vertex_interpolation(self.faces, new.x)
        if self.consistent:
            coefficients, from_vertices = over_relaxed_split(self.faces, new.x)
            matrix, rhs = self.equation.system(*held, coefficients, source)
            operator = krylov.Operator(matrix, from_vertices, to_vertices, model.parameters.d)
            a, outcome = krylov.solve(operator, rhs, old.a, krylov.factorise(matrix))
        else:
            a, outcome = linear.solve(*self.equation.system(*held, two_point(self.faces, new.x), source))
        corners = reconstruct(triangles, a, to_vertices @ a)
        residual = balance_residual(
            dt,
            model.reaction_rate(),
            integral(old.x, triangles, self.corners(old)),
            integral(new.x, triangles, corners),
            area(old.x, triangles),
            float(source @ volumes),
        )
        anchor = self.next_anchor(old, new.x, 1)
        return replace(new, a=a, corner_values=corners, balance_residual=residual, anchor=anchor), outcome

    def _source(self, t: float, x: Array) -> Array:
        if self.problem.source is None:
            return np.zeros(self.mesh.triangles.shape[1])
        place = quadrature_points(x, self.mesh.triangles)
        origin = quadrature_points(self.mesh.xi, self.mesh.triangles)
        return self.problem.source(place, origin, t).mean(axis=0)


class FvTwoPoint(FvDiamond):
    """FiPy's own diffusion term alone, kept as the exhibit: on triangles it does not converge."""

    consistent = False
