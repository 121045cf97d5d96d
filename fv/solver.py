"""Finite-volume methods: FiPy's transport on a mesh that a Mechanics moves, of order 1 and 2 in time.

Second order is an additive Runge-Kutta pair whose implicit stages FiPy assembles on moved meshes:
ARS(2,2,2) of Ascher, Ruuth and Spiteri (Appl. Numer. Math. 25, 1997, section 2.6), abscissae 0, gamma and
1: nodes move explicitly, x' = v(x, a), and what the cells hold, P = V a, follows implicitly, P' = d L(x) a
+ k (V - P) + V s, by the L-stable two-stage SDIRK method.  Both halves end at their last stage, so that the
step's result is a solution of a stage, and a stage is conservative like backward Euler.

    x2 = x + gamma dt v1                          P2 = P + gamma dt P'2
    x3 = x + dt (delta v1 + (1 - delta) v2)       P3 = P + dt ((1 - gamma) P'2 + gamma P'3)
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from actin_xcheck.core import linear
from actin_xcheck.core.contract import (
    NOTHING,
    Mechanics,
    Memento,
    Move,
    Polygonal,
    Problem,
    State,
    recalled,
    remembered,
)
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Mesh, integral, orientation, quadrature_points, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor, PrescribedMotion
from actin_xcheck.core.observables import area, balance_residual
from fv import krylov
from fv.equations import TransportEquation, over_relaxed_split, reconstruct, two_point, vertex_interpolation
from fv.history import History
from fv.mechanics import FvForceBalance, PlacesMove
from fv.mesh import Faces


@dataclass(frozen=True)
class FvState(State):
    """A `State` with cell averages `a` (n_cells,).

    Attributes
    ----------
    corner_values : those of their reconstruction, (3, n_cells).
    anchor : where the finite volumes' own force balance is preconditioned in the next step.
    history : what that found in the steps before.
    """

    corner_values: Array = field(default_factory=lambda: np.zeros((3, 0)))
    anchor: Anchor | None = None
    history: History = field(default_factory=History.none)


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
    carries = False

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
        carried = self.mechanics.carried(self.problem.u0) if self.carries else NOTHING
        v = self.mechanics.flow(0.0, x, corners, carried).v
        return FvState(0.0, x, a, v, carried=carried, corner_values=corners, anchor=Anchor(x))

    def moved_by(self, state: FvState, times: list[float], moves: list[Move]) -> Mechanics:
        """The mechanics, our own force balance preconditioned where the state says, near what it will find.

        Parameters
        ----------
        state : where the step begins.
        times, moves : of its stages so far, and the time of the next one.
        """
        if state.anchor is None or not isinstance(self.mechanics, FvForceBalance):
            return self.mechanics
        return self.mechanics.near(state.anchor, state.history.guess(times, _at_places(moves)))

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
        times = [state.t]
        move = self.moved_by(state, times, []).advance(state.t, dt, state.x, self.corners(state))
        new = replace(
            state,
            t=state.t + dt,
            x=move.x,
            v=move.v,
            net_force=move.net_force,
            net_torque=move.net_torque,
            history=state.history.extended(times, _at_places([move])),
        )
        outcome = move.outcome if not move.outcome.ok else orientation(self.mesh, new.t, move.x)
        return (new, outcome) if not outcome.ok else self._transport(state, new, dt)

    def memento(self, state: FvState) -> Memento:
        """The state, the corner values that load the next force balance and where that is preconditioned."""
        where = {} if state.anchor is None else {"anchor": state.anchor.x}
        before = {"history_times": state.history.times, "history": state.history.found}
        return {**remembered(state), "corner_values": state.corner_values, **where, **before}

    def restored(self, memento: Memento) -> FvState:
        """The state again."""
        anchor = Anchor(memento["anchor"]) if "anchor" in memento else None
        return FvState(
            **recalled(memento),
            corner_values=memento["corner_values"],
            anchor=anchor,
            history=History(memento["history_times"], memento["history"]),
        )

    def _transport(self, old: FvState, new: FvState, dt: float) -> tuple[FvState, Outcome]:
        triangles, model = self.mesh.triangles, self.problem.model
        volumes, source = signed_areas(new.x, triangles), self._source(new.t, new.x)
        held = dt, old.a, signed_areas(old.x, triangles), volumes
        to_vertices = vertex_interpolation(self.faces, new.x)
        if self.consistent:
            coefficients, from_vertices = over_relaxed_split(self.faces, new.x)
            matrix, rhs = self.equation.system(*held, coefficients, source)
            operator = krylov.TransportOperator(matrix, from_vertices, to_vertices, model.parameters.d)
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


GAMMA = 1 - 1 / np.sqrt(2)
"""Diagonal of the implicit half: its stability function vanishes at infinity."""

DELTA = 1 - 1 / (2 * GAMMA)
"""First weight of the explicit half; (1 - delta) gamma = 1/2 is second order."""

EMBEDDED = GAMMA**2
"""Weight that the first-order solution of the error estimate moves from the last implicit stage to the first.

Of a stiff decay the estimate is 1 - gamma times what decays, and the first-order solution is damped like it.
"""


@dataclass(frozen=True)
class _Stage:
    """One implicit stage: its abscissa, and the weights of what is known by then.

    Attributes
    ----------
    at : the abscissa.
    explicit : weights of the velocities in the node positions.
    implicit : weights of earlier stages' changes in the amounts.
    """

    at: float
    explicit: tuple[float, ...]
    implicit: tuple[float, ...]


STAGES = (_Stage(GAMMA, (GAMMA,), ()), _Stage(1.0, (DELTA, 1 - DELTA), (1 - GAMMA,)))


@dataclass(frozen=True)
class _Solution:
    """What a stage found.

    Attributes
    ----------
    state : its concentration, on its configuration.
    change : dt P', (n_cells,).
    supply : the sum of P' over the cells, by its sources: k (|Omega| - m) and the integral of s.
    inverse : of FiPy's matrix at the first stage, which preconditions the second one too.
    """

    state: FvState
    change: Array
    supply: float
    inverse: krylov.Inverse | None


class FvSecondOrder(FvDiamond):
    """The diamond scheme in space and ARS(2,2,2) in time, with an estimate of each step's error.

    The nodes of a prescribed motion are where it has them; the force balance's are integrated, and with them
    what it carries.
    """

    carries = True

    def step(self, state: FvState, dt: float) -> tuple[FvState, Outcome]:
        """Two stages: move the nodes with the velocities so far, then solve for what the cells hold there."""
        here, inverse = state, None
        times: list[float] = []
        rates: list[Move] = []
        solutions: list[_Solution] = []
        start = state.a * signed_areas(state.x, self.mesh.triangles)
        for stage in STAGES:
            times.append(here.t)
            rates.append(self._rate(here, times, rates))
            outcome = rates[-1].outcome
            if outcome.ok:
                x = self._place(state, dt, stage, rates)
                carried = state.carried + dt * _blend(stage.explicit, [move.carried for move in rates])
                here = replace(here, t=state.t + stage.at * dt, x=x, v=rates[-1].v, carried=carried)
                outcome = orientation(self.mesh, here.t, here.x)
            if outcome.ok:
                carried = start + _blend(stage.implicit, [solution.change for solution in solutions])
                solution, outcome = self._solve(here, GAMMA * dt, carried, inverse)
                here, inverse = solution.state, solution.inverse
                solutions.append(solution)
            if not outcome.ok:
                return here, outcome
        if isinstance(self.mechanics, FvForceBalance):  # what the next step would begin with
            outcome = self.mechanics.intact(here.t, here.x, here.carried)
        here = replace(here, history=state.history.extended(times, _at_places(rates)))
        return self._concluded(state, here, dt, rates, solutions), outcome

    def _rate(self, here: FvState, times: list[float], rates: list[Move]) -> Move:
        """Velocities of the nodes now; of no use where the motion is prescribed."""
        if isinstance(self.mechanics, PrescribedMotion):
            return Move(here.x, np.zeros_like(here.x))
        return self.moved_by(here, times, rates).flow(here.t, here.x, self.corners(here), here.carried)

    def _place(self, state: FvState, dt: float, stage: _Stage, rates: list[Move]) -> Array:
        """Node positions of a stage, (2, N)."""
        if isinstance(self.mechanics, PrescribedMotion):
            return self.mechanics.advance(state.t, stage.at * dt, state.x, self.corners(state)).x
        velocity = _blend(stage.explicit, [move.v for move in rates])
        return self.mechanics.settle(state.x + dt * velocity)

    def _solve(
        self, here: FvState, dt: float, carried: Array, inverse: krylov.Inverse | None
    ) -> tuple[_Solution, Outcome]:
        """V a - dt (k (V - V a) + d L a + V s) = carried, on the configuration of `here`."""
        triangles, model = self.mesh.triangles, self.problem.model
        rate, volumes = model.reaction_rate(), signed_areas(here.x, triangles)
        source, to_vertices = self._source(here.t, here.x), vertex_interpolation(self.faces, here.x)
        coefficients, from_vertices = over_relaxed_split(self.faces, here.x)
        matrix, rhs = self.equation.stage(dt, carried, volumes, coefficients, source)
        operator = krylov.TransportOperator(matrix, from_vertices, to_vertices, model.parameters.d)
        inverse = inverse or krylov.factorise(matrix)  # the first stage is close enough
        a, outcome = krylov.solve(operator, rhs, carried / volumes, inverse)
        corners = reconstruct(triangles, a, to_vertices @ a)
        supply = float(volumes @ (source + rate - rate * corners.mean(axis=0)))
        solved = replace(here, a=a, corner_values=corners)
        return _Solution(solved, (volumes * a - carried) / GAMMA, supply, inverse), outcome

    def _concluded(
        self, old: FvState, new: FvState, dt: float, rates: list[Move], solutions: list[_Solution]
    ) -> FvState:
        """The last stage's state, with what the step as a whole tells: loads, balance and error."""
        weights, triangles = STAGES[-1], self.mesh.triangles
        gained = _blend((*weights.implicit, GAMMA), [solution.supply for solution in solutions])
        total = integral(new.x, triangles, new.corner_values)
        residual = (total - integral(old.x, triangles, old.corner_values) - dt * gained) / total
        force = _blend(weights.explicit, [np.array(move.net_force) for move in rates])
        return replace(
            new,
            v=(new.x - old.x) / dt,
            balance_residual=residual,
            net_force=(float(force[0]), float(force[1])),
            net_torque=_blend(weights.explicit, [move.net_torque for move in rates]),
            local_error=self._error(new, dt, rates, solutions),
            anchor=self.next_anchor(old, new.x, len(STAGES)),
        )

    def _error(self, new: FvState, dt: float, rates: list[Move], solutions: list[_Solution]) -> float:
        """Distance to the embedded solution: of positions in radii, of a in L2 over the cell, relative."""
        volumes = signed_areas(new.x, self.mesh.triangles)
        in_cells = EMBEDDED * (solutions[1].change - solutions[0].change) / volumes
        of_a = np.sqrt(volumes @ in_cells**2 / (volumes @ new.a**2))
        # the same multiple of dt^2 x'' as of dt^2 P'' above
        of_x = EMBEDDED * (1 - GAMMA) / GAMMA * dt * np.hypot(*(rates[1].v - rates[0].v)).max()
        return float(max(of_a, of_x))


def _at_places(moves: list[Move]) -> list[Array]:
    """What our own force balance found at the places, (2 n_places,) each; nothing of other motions."""
    return [move.at_places for move in moves if isinstance(move, PlacesMove)]


def _blend(weights: tuple[float, ...], values: list[Any]) -> Any:
    """The weighted sum of numbers or arrays of one shape; 0 of none."""
    return sum(weight * value for weight, value in zip(weights, values, strict=True))
