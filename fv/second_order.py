"""Second order in time: an additive Runge-Kutta pair whose implicit stages FiPy assembles on moved meshes.

ARS(2,2,2) of Ascher, Ruuth and Spiteri (Appl. Numer. Math. 25, 1997, section 2.6), abscissae 0, gamma and 1:
nodes move explicitly, x' = v(x, a), and what the cells hold, P = V a, follows implicitly,
P' = d L(x) a + k (V - P) + V s, by the L-stable two-stage SDIRK method.  Both halves end at their last stage,
so that the step's result is a solution of a stage, and a stage is conservative like backward Euler.

    x2 = x + gamma dt v1                          P2 = P + gamma dt P'2
    x3 = x + dt (delta v1 + (1 - delta) v2)       P3 = P + dt ((1 - gamma) P'2 + gamma P'3)
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from actin_xcheck.core.contract import Move
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import integral, orientation, signed_areas
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import PrescribedMotion
from fv import krylov
from fv.diamond import over_relaxed_split, reconstruct, vertex_interpolation
from fv.solver import FvDiamond, FvState

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

    The nodes of a prescribed motion are where it has them; the force balance's are integrated.
    """

    def step(self, state: FvState, dt: float) -> tuple[FvState, Outcome]:
        """Two stages: move the nodes with the velocities so far, then solve for what the cells hold there."""
        here, inverse = state, None
        rates: list[Move] = []
        solutions: list[_Solution] = []
        start = state.a * signed_areas(state.x, self.mesh.triangles)
        for stage in STAGES:
            rates.append(self._rate(here))
            outcome = rates[-1].outcome
            if outcome.ok:
                x = self._place(state, dt, stage, rates)
                here = replace(here, t=state.t + stage.at * dt, x=x, v=rates[-1].v)
                outcome = orientation(self.mesh, here.t, here.x)
            if outcome.ok:
                carried = start + _blend(stage.implicit, [solution.change for solution in solutions])
                solution, outcome = self._solve(here, GAMMA * dt, carried, inverse)
                here, inverse = solution.state, solution.inverse
                solutions.append(solution)
            if not outcome.ok:
                return here, outcome
        return self._concluded(state, here, dt, rates, solutions), outcome

    def _rate(self, here: FvState) -> Move:
        """Velocities of the nodes now; of no use where the motion is prescribed."""
        if isinstance(self.mechanics, PrescribedMotion):
            return Move(here.x, np.zeros_like(here.x))
        return self.moved_by(here).flow(here.t, here.x, self.corners(here))

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
        operator = krylov.Operator(matrix, from_vertices, to_vertices, model.parameters.d)
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


def _blend(weights: tuple[float, ...], values: list[Any]) -> Any:
    """The weighted sum of numbers or arrays of one shape; 0 of none."""
    return sum(weight * value for weight, value in zip(weights, values, strict=True))
