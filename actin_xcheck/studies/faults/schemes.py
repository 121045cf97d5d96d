"""Faults of the Runge-Kutta pairs, of step control, of curved elements and of meshes, and of smaller models:
a sector, one ray, linear modes.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from actin_xcheck.core.lagrange import lagrange
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.studies.faults.fault import Fault, Function


def _wrong_entry(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    right(self, *arguments, **named)
    entries = np.array(self.tableau.explicit)
    entries[-1, :2] += 0.3, -0.3  # the row's sum, which is the stage's time, stays
    self.tableau = replace(self.tableau, explicit=entries)


def _embedded(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    right(self, *arguments, **named)
    self.tableau = replace(self.tableau, b=self.tableau.b_embedded)


def _stages_at_start(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    right(self, *arguments, **named)
    self.tableau = replace(self.tableau, c=0 * self.tableau.c)


def _first_velocity(right: Function, self: Any, old: Any, dt: float, stages: list[Any]) -> Any:
    v = stages[0].move.v
    return right(self, old, dt, [replace(stage, move=replace(stage.move, v=v)) for stage in stages])


def _confident(right: Function, self: Any, state: Any, dt: float) -> Any:
    new, outcome = right(self, state, dt)
    return replace(new, local_error=1e-3 * new.local_error), outcome


def _one_velocity(right: Function, self: Any, state: Any, dt: float, stage: Any, rates: list[Any]) -> Array:
    return np.asarray(right(self, state, dt, stage, [rates[0] for _ in rates]))


def _equal_weights(right: Function, *arguments: Any) -> tuple[Array, Array]:
    points, weights = right(*arguments)
    return points, np.full_like(weights, weights.mean())


def _straight(right: Function, mesh: Mesh, triangles: Array, ring: float, order: int) -> Array:
    nodes = lagrange(order).nodes
    return np.einsum("cn,...ce->...ne", nodes, mesh.xi[:, triangles])


def _unfitted(right: Function, points: Array, refine: int, ring: float, *rest: float) -> Array:
    return np.asarray(right(points, refine, ring - 0.1, *rest))


OF_SCHEMES = (
    Fault(
        "imex-tableau-entry",
        "One entry of the explicit tableau is wrong by 0.3; its row has the right sum.",
        "fem",
        "fem.imex:FemImex.__init__",
        _wrong_entry,
    ),
    Fault(
        "imex-embedded-weights",
        "The pair goes on with its embedded solution.",
        "fem",
        "fem.imex:FemImex.__init__",
        _embedded,
    ),
    Fault(
        "imex-stage-times",
        "All stages take the source term and the prescribed velocity of the step's beginning.",
        "fem",
        "fem.imex:FemImex.__init__",
        _stages_at_start,
    ),
    Fault(
        "imex-first-velocity",
        "The nodes of a step all move with the velocities of its first stage.",
        "fem",
        "fem.imex:FemImex._combined",
        _first_velocity,
    ),
    Fault(
        "imex-error-underestimated",
        "The error estimate that chooses the steps is 1000 times too small.",
        "fem",
        "fem.imex:FemImex.step",
        _confident,
    ),
    Fault(
        "fv-error-underestimated",
        "The error estimate that chooses the steps is 1000 times too small.",
        "fv",
        "fv.solver:FvSecondOrder.step",
        _confident,
    ),
    Fault(
        "fv-first-velocity",
        "Both stages move the nodes with the velocities of the step's beginning: a first-order start.",
        "fv",
        "fv.solver:FvSecondOrder._place",
        _one_velocity,
    ),
    Fault(
        "quadrature-weights",
        "All points of a quadrature have one weight: right for P1 cells, too low a degree above.",
        "fem",
        "fem.space:quadrature",
        _equal_weights,
    ),
    Fault(
        "curved-rim-dropped",
        "All cells are straight: the P_k nodes of the rim lie on a polygon.",
        "fem",
        "fem.space:_curved",
        _straight,
    ),
    Fault(
        "ring-not-fitted",
        "No line of nodes lies on the ring where δ jumps.",
        "both",
        "actin_xcheck.core.mesh:_on_circles",
        _unfitted,
    ),
)


def _sides_left_free(right: Function, closure: Closure, space: Any) -> tuple[Any, Array]:
    return np.zeros(0, dtype=np.int64), np.zeros((2, 0))


def _more_mirrors(right: Function, problem: Any, end: float) -> Any:
    found = right(problem, end)
    return replace(found, mirrors=found.mirrors and replace(found.mirrors, mirrors=2 * found.mirrors.mirrors))


def _counted_once_less(right: Function, self: Any, state: Any) -> Any:
    found, copies = right(self, state), len(self.images)
    return replace(found, total_actin=found.total_actin * (copies - 1) / copies)


def _without_r(right: Function, self: Any, r: Array) -> Any:
    shape, values = right(self, r), self.ray.values
    dx = shape.dx / shape.r
    return replace(shape, dx=dx, mass=(values.T * dx) @ values)


def _without_hoop(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    self._hoop = 0 * self._hoop


def _a_little_longer(right: Function, self: Any, values: Any, dt: float) -> Any:
    return right(self, values, (1 + 1e-4) * dt)


OF_SMALLER_MODELS = (
    Fault(
        "sector-sides-free",
        "Nodes on the mirror lines of a sector move as they like.",
        "fem",
        "fem.boundary:along_sides",
        _sides_left_free,
    ),
    Fault(
        "sector-too-narrow",
        "A cell is taken for twice as symmetric as it is: a quarter of it is solved in place of a half.",
        "fem",
        "actin_xcheck.runs.fidelity:symmetry_of",
        _more_mirrors,
    ),
    Fault(
        "sector-multiplicity",
        "Total actin is summed over one image of the sector too few.",
        "fem",
        "fem.sector:Unfolded.measure",
        _counted_once_less,
    ),
    Fault(
        "radial-metric-dropped",
        "The area element of the ray is 2π dr in place of 2π r dr.",
        "fem",
        "fem.radial:Radial._shape",
        _without_r,
    ),
    Fault(
        "radial-hoop-dropped",
        "μ₂ does not couple the strains along the ray and across it.",
        "fem",
        "fem.radial:Radial.__init__",
        _without_hoop,
    ),
    Fault(
        "modal-rate-off",
        "All linear modes evolve faster by 1e-4 of their rates.",
        "fem",
        "fem.linearised:AngularMode.carried",
        _a_little_longer,
    ),
)

FAULTS = (*OF_SCHEMES, *OF_SMALLER_MODELS)
