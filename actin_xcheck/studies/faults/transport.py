"""Faults of transport in both codes, of Runge-Kutta pairs and step control, of meshes, of smaller models."""

from dataclasses import replace
from importlib import import_module
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse.linalg as spl

from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.lagrange import lagrange
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.studies.faults.fault import Catalogue, Function

LOOSE = 1e-3
"""The tolerance of a solver that stops too early."""

LEAK = 1e-10
"""Of total actin, what is lost in a step: nothing but the balance can tell."""


def _at_start(right: Function, self: Any, t: float, x: Array) -> Array:
    return np.asarray(right(self, 0.0, x))


def _mass_at_rest(right: Function, self: Any, x: Array) -> Any:
    return right(self, self.space.xi)


_FIRST: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


_P1, _IMEX = "fem.solver:FemP1Paper", "fem.imex:FemImex"
_EQUATION = "fv.equations:TransportEquation"

FAULTS = Catalogue()


@FAULTS("reaction-sign", "both", "actin_xcheck.core.model:Model.reaction_rate")
def _negative(right: Function, self: Any) -> float:
    """Polymerisation has the wrong sign: −(1 − a)."""
    return -float(right(self))


@FAULTS("fem-dilution-dropped", "fem", f"{_P1}._transport")
def _undiluted_mass(right: Function, self: Any, old: Any, new: Any, dt: float) -> Any:
    """a div v is lost: the old concentration is carried over without the change of area."""
    return right(self, replace(old, mass=self._mass(new.x)), new, dt)


FAULTS("fem-mass-stale", "fem", f"{_P1}._mass", "The mass matrix is that of the reference disk.")(
    _mass_at_rest
)


@FAULTS("fem-diffusion-stale", "fem", "fem.kernels:CellSample.stiffness")
def _first_stiffness(right: Function, self: Any) -> Any:
    """Actin diffuses on the configuration that was met first: the stiffness matrix is never renewed."""
    return right(_FIRST.setdefault(self.rule, self))


FAULTS("fem-source-stale", "fem", f"{_P1}._source", "The source term is always that of t = 0.")(_at_start)


@FAULTS("fem-tolerance-loose", "fem", "actin_xcheck.core.linear:_iterated")
def _stops_early(right: Function, matrix: Any, rhs: Array, near: Any, start: Any) -> Array | None:
    """Conjugate gradients stop at a relative residual of 1e-3, and nothing looks at it again."""
    linear = import_module("actin_xcheck.core.linear")
    found: Array | None = linear._conjugate_gradients(matrix, rhs, near, LOOSE * np.linalg.norm(rhs))
    return found


@FAULTS("fem-tolerance-1e-8", "fem", "actin_xcheck.core.linear:_iterated")
def _stops_at_1e_8(right: Function, matrix: Any, rhs: Array, near: Any, start: Any) -> Array | None:
    """Conjugate gradients stop at a relative residual of 1e-8."""
    linear = import_module("actin_xcheck.core.linear")
    found: Array | None = linear._conjugate_gradients(matrix, rhs, near, 1e-8 * np.linalg.norm(rhs))
    return found


@FAULTS("fem-leak", "fem", "fem.solver:TransportSolver.solve")
def _leaking_nodes(right: Function, self: Any, matrix: Any, rhs: Array, *rest: Any) -> Any:
    """In every transport solve a part of 1e-10 of all actin is lost."""
    return right(self, matrix, (1 - LEAK) * rhs, *rest)


@FAULTS("imex-dilution-dropped", "fem", f"{_IMEX}.step")
def _undiluted_content(right: Function, self: Any, state: Any, dt: float) -> Any:
    """After a step the amounts of actin are those of its concentration on the old configuration."""
    new, outcome = right(self, state, dt)
    return (replace(new, content=self._mass(state.x) @ new.a) if outcome.ok else new), outcome


FAULTS(
    "imex-mass-stale",
    "fem",
    "fem.solver:TransportMatrices._mass_at",
    "The mass matrix of all stages is that of the reference disk.",
)(_mass_at_rest)


@FAULTS("fv-dilution-dropped", "fv", f"{_EQUATION}.system")
def _undiluted_cells(
    right: Function, self: Any, dt: float, a: Array, old: Array, new: Array, *rest: Array
) -> Any:
    """a div v is lost: the old averages are carried over without the change of volume."""
    return right(self, dt, a * new / old, old, new, *rest)


@FAULTS("fv-volumes-old", "fv", f"{_EQUATION}.system")
def _old_volumes(
    right: Function, self: Any, dt: float, a: Array, old: Array, new: Array, *rest: Array
) -> Any:
    """The new balance is struck with the old cell volumes."""
    return right(self, dt, a, old, old, *rest)


@FAULTS("fv-volumes-stale", "fv", f"{_EQUATION}._assemble")
def _volumes_at_rest(
    right: Function, self: Any, dt: float, amounts: Array, volumes: Array, *rest: Array
) -> Any:
    """Cells hold what their volumes at the start would hold."""
    return right(self, dt, amounts, self.volumes, *rest)


@FAULTS("fv-leak", "fv", f"{_EQUATION}._assemble")
def _leaking_cells(right: Function, self: Any, dt: float, amounts: Array, *rest: Array) -> Any:
    """In every step a part of 1e-10 of all actin is lost."""
    return right(self, dt, (1 - LEAK) * amounts, *rest)


@FAULTS("fv-faces-stale", "fv", "fv.mesh:Faces.geometry")
def _faces_at_rest(right: Function, self: Any, x: Array) -> Any:
    """Areas and distances of the faces are those of the reference disk."""
    return right(self, self.mesh.xi)


@FAULTS("fv-cross-flux-dropped", "fv", "fv.krylov:TransportOperator.__call__")
def _two_point_alone(right: Function, self: Any, a: Array) -> Array:
    """No correction for faces that are not orthogonal to the line between their cells."""
    return np.asarray(self.two_point @ a)


@FAULTS("fv-diffusivity-wrong", "fv", f"{_EQUATION}._assemble")
def _more_diffusion(
    right: Function, self: Any, dt: float, amounts: Array, volumes: Array, two_point: Array
) -> Any:
    """The two-point coefficients of the faces are a tenth too large."""
    return right(self, dt, amounts, volumes, 1.1 * two_point)


@FAULTS("fv-rim-not-mirrored", "fv", "fv.equations:_places")
def _not_mirrored(right: Function, faces: Any, x: Array) -> Array:
    """Cells along the rim are not mirrored across it, so that vertex values do not know n·∇a = 0."""
    places, count = right(faces, x), faces.mesh.triangles.shape[1]
    return np.hstack([places[:, :count], places[:, faces.cells[0, faces.rim]]])


@FAULTS("fv-one-sweep", "fv", "fv.krylov:solve")
def _one_sweep(
    right: Function, operator: Any, rhs: Array, guess: Array, inverse: Any
) -> tuple[Array, Outcome]:
    """The cross flux is taken from the step before: one sweep in place of a solution."""
    crossing = operator.scale * (operator.from_vertices @ (operator.to_vertices @ guess))
    return inverse(rhs + crossing), COMPLETED


@FAULTS("fv-tolerance-loose", "fv", "fv.krylov:solve")
def _loosely(right: Function, operator: Any, rhs: Array, guess: Array, inverse: Any) -> tuple[Array, Outcome]:
    """BiCGStab stops at a relative residual of 1e-3, and nothing looks at it again."""
    shape = operator.two_point.shape
    system, near = (spl.LinearOperator(shape, one, dtype=np.float64) for one in (operator, inverse))
    return spl.bicgstab(system, rhs, x0=guess, rtol=LOOSE, atol=0.0, M=near)[0], COMPLETED


FAULTS("fv-source-stale", "fv", "fv.solver:FvDiamond._source", "The source term is always that of t = 0.")(
    _at_start
)


def _confident(right: Function, self: Any, state: Any, dt: float) -> Any:
    new, outcome = right(self, state, dt)
    return replace(new, local_error=1e-3 * new.local_error), outcome


@FAULTS("imex-tableau-entry", "fem", "fem.imex:FemImex.__init__")
def _wrong_entry(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    """One entry of the explicit tableau is wrong by 0.3; its row has the right sum."""
    right(self, *arguments, **named)
    entries = np.array(self.tableau.explicit)
    entries[-1, :2] += 0.3, -0.3  # the row's sum, which is the stage's time, stays
    self.tableau = replace(self.tableau, explicit=entries)


@FAULTS("imex-embedded-weights", "fem", "fem.imex:FemImex.__init__")
def _embedded(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    """The pair goes on with its embedded solution."""
    right(self, *arguments, **named)
    self.tableau = replace(self.tableau, b=self.tableau.b_embedded)


@FAULTS("imex-stage-times", "fem", "fem.imex:FemImex.__init__")
def _stages_at_start(right: Function, self: Any, *arguments: Any, **named: Any) -> None:
    """All stages take the source term and the prescribed velocity of the step's beginning."""
    right(self, *arguments, **named)
    self.tableau = replace(self.tableau, c=0 * self.tableau.c)


@FAULTS("imex-first-velocity", "fem", "fem.imex:FemImex._combined")
def _first_velocity(right: Function, self: Any, old: Any, dt: float, stages: list[Any]) -> Any:
    """The nodes of a step all move with the velocities of its first stage."""
    v = stages[0].move.v
    return right(self, old, dt, [replace(stage, move=replace(stage.move, v=v)) for stage in stages])


FAULTS(
    "imex-error-underestimated",
    "fem",
    "fem.imex:FemImex.step",
    "The error estimate that chooses the steps is 1000 times too small.",
)(_confident)
FAULTS(
    "fv-error-underestimated",
    "fv",
    "fv.solver:FvSecondOrder.step",
    "The error estimate that chooses the steps is 1000 times too small.",
)(_confident)


@FAULTS("fv-first-velocity", "fv", "fv.solver:FvSecondOrder._place")
def _one_velocity(right: Function, self: Any, state: Any, dt: float, stage: Any, rates: list[Any]) -> Array:
    """Both stages move the nodes with the velocities of the step's beginning: a first-order start."""
    return np.asarray(right(self, state, dt, stage, [rates[0] for _ in rates]))


@FAULTS("quadrature-weights", "fem", "fem.space:quadrature")
def _equal_weights(right: Function, *arguments: Any) -> tuple[Array, Array]:
    """All points of a quadrature have one weight: right for P1 cells, too low a degree above."""
    points, weights = right(*arguments)
    return points, np.full_like(weights, weights.mean())


@FAULTS("curved-rim-dropped", "fem", "fem.space:_curved")
def _straight(right: Function, mesh: Mesh, triangles: Array, ring: float, order: int) -> Array:
    """All cells are straight: the P_k nodes of the rim lie on a polygon."""
    nodes = lagrange(order).nodes
    return np.einsum("cn,...ce->...ne", nodes, mesh.xi[:, triangles])


@FAULTS("ring-not-fitted", "both", "actin_xcheck.core.mesh:_on_circles")
def _unfitted(right: Function, points: Array, refine: int, ring: float, *rest: float) -> Array:
    """No line of nodes lies on the ring where δ jumps."""
    return np.asarray(right(points, refine, ring - 0.1, *rest))


@FAULTS("sector-sides-free", "fem", "fem.boundary:along_sides")
def _sides_left_free(right: Function, closure: Closure, space: Any) -> tuple[Any, Array]:
    """Nodes on the mirror lines of a sector move as they like."""
    return np.zeros(0, dtype=np.int64), np.zeros((2, 0))


@FAULTS("sector-too-narrow", "fem", "actin_xcheck.runs.fidelity:symmetry_of")
def _more_mirrors(right: Function, problem: Any, end: float) -> Any:
    """A cell is taken for twice as symmetric as it is: a quarter of it is solved in place of a half."""
    found = right(problem, end)
    return replace(found, mirrors=found.mirrors and replace(found.mirrors, mirrors=2 * found.mirrors.mirrors))


@FAULTS("sector-multiplicity", "fem", "fem.sector:Unfolded.measure")
def _counted_once_less(right: Function, self: Any, state: Any) -> Any:
    """Total actin is summed over one image of the sector too few."""
    found, copies = right(self, state), len(self.images)
    return replace(found, total_actin=found.total_actin * (copies - 1) / copies)


@FAULTS("radial-metric-dropped", "fem", "fem.radial:Radial._shape")
def _without_r(right: Function, self: Any, r: Array) -> Any:
    """The area element of the ray is 2π dr in place of 2π r dr."""
    shape, values = right(self, r), self.ray.values
    dx = shape.dx / shape.r
    return replace(shape, dx=dx, mass=(values.T * dx) @ values)


@FAULTS("radial-hoop-dropped", "fem", "fem.radial:Radial.__init__")
def _without_hoop(right: Function, self: Any, *arguments: Any) -> None:
    """μ₂ does not couple the strains along the ray and across it."""
    right(self, *arguments)
    self._hoop = 0 * self._hoop


@FAULTS("modal-rate-off", "fem", "fem.linearised:AngularMode.carried")
def _a_little_longer(right: Function, self: Any, values: Any, dt: float) -> Any:
    """All linear modes evolve faster by 1e-4 of their rates."""
    return right(self, values, (1 + 1e-4) * dt)
