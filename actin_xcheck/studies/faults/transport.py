"""Faults of the transport equation, in finite elements and in finite volumes."""

from dataclasses import replace
from importlib import import_module
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse.linalg as spl

from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.model import Array
from actin_xcheck.studies.faults.fault import Fault, Function

LOOSE = 1e-3
"""The tolerance of a solver that stops too early."""

LEAK = 1e-10
"""Of total actin, what is lost in a step: nothing but the balance can tell."""


def _negative(right: Function, self: Any) -> float:
    return -float(right(self))


def _at_start(right: Function, self: Any, t: float, x: Array) -> Array:
    return np.asarray(right(self, 0.0, x))


# finite elements


def _undiluted_mass(right: Function, self: Any, old: Any, new: Any, dt: float) -> Any:
    return right(self, replace(old, mass=self._mass(new.x)), new, dt)


def _mass_at_rest(right: Function, self: Any, x: Array) -> Any:
    return right(self, self.space.xi)


_FIRST: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


def _first_stiffness(right: Function, self: Any) -> Any:
    return right(_FIRST.setdefault(self.rule, self))


def _stops_early(right: Function, matrix: Any, rhs: Array, near: Any, start: Any) -> Array | None:
    linear = import_module("actin_xcheck.core.linear")
    found: Array | None = linear._conjugate_gradients(matrix, rhs, near, LOOSE * np.linalg.norm(rhs))
    return found


def _stops_at_1e_8(right: Function, matrix: Any, rhs: Array, near: Any, start: Any) -> Array | None:
    linear = import_module("actin_xcheck.core.linear")
    found: Array | None = linear._conjugate_gradients(matrix, rhs, near, 1e-8 * np.linalg.norm(rhs))
    return found


def _leaking_nodes(right: Function, self: Any, matrix: Any, rhs: Array, *rest: Any) -> Any:
    return right(self, matrix, (1 - LEAK) * rhs, *rest)


def _undiluted_content(right: Function, self: Any, state: Any, dt: float) -> Any:
    new, outcome = right(self, state, dt)
    return (replace(new, content=self._mass(state.x) @ new.a) if outcome.ok else new), outcome


# finite volumes


def _undiluted_cells(
    right: Function, self: Any, dt: float, a: Array, old: Array, new: Array, *rest: Array
) -> Any:
    return right(self, dt, a * new / old, old, new, *rest)


def _old_volumes(
    right: Function, self: Any, dt: float, a: Array, old: Array, new: Array, *rest: Array
) -> Any:
    return right(self, dt, a, old, old, *rest)


def _volumes_at_rest(
    right: Function, self: Any, dt: float, amounts: Array, volumes: Array, *rest: Array
) -> Any:
    return right(self, dt, amounts, self.volumes, *rest)


def _leaking_cells(right: Function, self: Any, dt: float, amounts: Array, *rest: Array) -> Any:
    return right(self, dt, (1 - LEAK) * amounts, *rest)


def _faces_at_rest(right: Function, self: Any, x: Array) -> Any:
    return right(self, self.mesh.xi)


def _two_point_alone(right: Function, self: Any, a: Array) -> Array:
    return np.asarray(self.two_point @ a)


def _more_diffusion(
    right: Function, self: Any, dt: float, amounts: Array, volumes: Array, two_point: Array
) -> Any:
    return right(self, dt, amounts, volumes, 1.1 * two_point)


def _not_mirrored(right: Function, faces: Any, x: Array) -> Array:
    places, count = right(faces, x), faces.mesh.triangles.shape[1]
    return np.hstack([places[:, :count], places[:, faces.cells[0, faces.rim]]])


def _one_sweep(
    right: Function, operator: Any, rhs: Array, guess: Array, inverse: Any
) -> tuple[Array, Outcome]:
    crossing = operator.scale * (operator.from_vertices @ (operator.to_vertices @ guess))
    return inverse(rhs + crossing), COMPLETED


def _loosely(right: Function, operator: Any, rhs: Array, guess: Array, inverse: Any) -> tuple[Array, Outcome]:
    shape = operator.two_point.shape
    system, near = (spl.LinearOperator(shape, one, dtype=np.float64) for one in (operator, inverse))
    return spl.bicgstab(system, rhs, x0=guess, rtol=LOOSE, atol=0.0, M=near)[0], COMPLETED


_P1, _IMEX = "fem.solver:FemP1Paper", "fem.imex:FemImex"
_EQUATION = "fv.equations:TransportEquation"

FAULTS = (
    Fault(
        "reaction-sign",
        "Polymerisation has the wrong sign: −(1 − a).",
        "both",
        "actin_xcheck.core.model:Model.reaction_rate",
        _negative,
    ),
    Fault(
        "fem-dilution-dropped",
        "a div v is lost: the old concentration is carried over without the change of area.",
        "fem",
        f"{_P1}._transport",
        _undiluted_mass,
    ),
    Fault(
        "fem-mass-stale",
        "The mass matrix is that of the reference disk.",
        "fem",
        f"{_P1}._mass",
        _mass_at_rest,
    ),
    Fault(
        "fem-diffusion-stale",
        "Actin diffuses on the configuration that was met first: the stiffness matrix is never renewed.",
        "fem",
        "fem.kernels:CellSample.stiffness",
        _first_stiffness,
    ),
    Fault(
        "fem-source-stale",
        "The source term is always that of t = 0.",
        "fem",
        f"{_P1}._source",
        _at_start,
    ),
    Fault(
        "fem-tolerance-loose",
        "Conjugate gradients stop at a relative residual of 1e-3, and nothing looks at it again.",
        "fem",
        "actin_xcheck.core.linear:_iterated",
        _stops_early,
    ),
    Fault(
        "fem-tolerance-1e-8",
        "Conjugate gradients stop at a relative residual of 1e-8.",
        "fem",
        "actin_xcheck.core.linear:_iterated",
        _stops_at_1e_8,
    ),
    Fault(
        "fem-leak",
        "In every transport solve a part of 1e-10 of all actin is lost.",
        "fem",
        "fem.solver:TransportSolver.solve",
        _leaking_nodes,
    ),
    Fault(
        "imex-dilution-dropped",
        "After a step the amounts of actin are those of its concentration on the old configuration.",
        "fem",
        f"{_IMEX}.step",
        _undiluted_content,
    ),
    Fault(
        "imex-mass-stale",
        "The mass matrix of all stages is that of the reference disk.",
        "fem",
        "fem.solver:TransportMatrices._mass_at",
        _mass_at_rest,
    ),
    Fault(
        "fv-dilution-dropped",
        "a div v is lost: the old averages are carried over without the change of volume.",
        "fv",
        f"{_EQUATION}.system",
        _undiluted_cells,
    ),
    Fault(
        "fv-volumes-old",
        "The new balance is struck with the old cell volumes.",
        "fv",
        f"{_EQUATION}.system",
        _old_volumes,
    ),
    Fault(
        "fv-volumes-stale",
        "Cells hold what their volumes at the start would hold.",
        "fv",
        f"{_EQUATION}._assemble",
        _volumes_at_rest,
    ),
    Fault(
        "fv-leak",
        "In every step a part of 1e-10 of all actin is lost.",
        "fv",
        f"{_EQUATION}._assemble",
        _leaking_cells,
    ),
    Fault(
        "fv-faces-stale",
        "Areas and distances of the faces are those of the reference disk.",
        "fv",
        "fv.mesh:Faces.geometry",
        _faces_at_rest,
    ),
    Fault(
        "fv-cross-flux-dropped",
        "No correction for faces that are not orthogonal to the line between their cells.",
        "fv",
        "fv.krylov:TransportOperator.__call__",
        _two_point_alone,
    ),
    Fault(
        "fv-diffusivity-wrong",
        "The two-point coefficients of the faces are a tenth too large.",
        "fv",
        f"{_EQUATION}._assemble",
        _more_diffusion,
    ),
    Fault(
        "fv-rim-not-mirrored",
        "Cells along the rim are not mirrored across it, so that vertex values do not know n·∇a = 0.",
        "fv",
        "fv.equations:_places",
        _not_mirrored,
    ),
    Fault(
        "fv-one-sweep",
        "The cross flux is taken from the step before: one sweep in place of a solution.",
        "fv",
        "fv.krylov:solve",
        _one_sweep,
    ),
    Fault(
        "fv-tolerance-loose",
        "BiCGStab stops at a relative residual of 1e-3, and nothing looks at it again.",
        "fv",
        "fv.krylov:solve",
        _loosely,
    ),
    Fault(
        "fv-source-stale",
        "The source term is always that of t = 0.",
        "fv",
        "fv.solver:FvDiamond._source",
        _at_start,
    ),
)
