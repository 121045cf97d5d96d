"""Faults of the constitutive laws, which all codes share, and of the elements' force balance and closures.

That one is lent to finite volumes.
"""

from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.studies.faults.fault import Fault, Function

_FEM_BALANCE = "fem.force_balance:ForceBalance"
_MODEL = "actin_xcheck.core.model:Model"


def _negative(right: Function, *arguments: Any) -> Any:
    return -right(*arguments)


def nothing(right: Function, *arguments: Any) -> Any:
    """No part of it."""
    return 0 * right(*arguments)


def _swapped(right: Function, self: Any) -> tuple[float, float]:
    first, second = right(self)
    return second, first


def _without_bulk(right: Function, self: Any) -> tuple[float, float]:
    return right(self)[0], 0.0


def _linear_in_a(right: Function, self: Any, a: Array) -> Array:
    return np.asarray(right(self, a) / a)


def _undilated(right: Function, self: Any, a: Array, phi: Array, delta: Any) -> Any:
    return right(self, a, 0 * phi, delta)


def _without_two_over_pi(right: Function, self: Any, a: Array, phi: Array, delta: Any) -> Any:
    return right(self, a, phi, np.pi / 2 * delta)


def _frozen(right: Function, self: Any, t: float, dt: float, x: Array, corners: Array) -> Any:
    return replace(right(self, t, dt, x, corners), x=x)


def forgotten(right: Function, self: Any, x: Array) -> Array:
    """No displacement, (2, N)."""
    return np.zeros_like(right(self, x))


_LAST: WeakKeyDictionary[Any, tuple[Array, Array]] = WeakKeyDictionary()
"""The last two configurations that were asked for."""


def _lagged(right: Function, self: Any, x: Array) -> Any:
    now, before = _LAST.get(self, (x, x))
    if not np.array_equal(now, x):
        now, before = x, now
    _LAST[self] = now, before
    return right(self, before)


def _along_the_current_rim(right: Function, closure: Closure, space: Any, x: Array) -> Any:
    wrong = Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure
    return right(wrong, space, x)


def _free_to_slip(right: Function, self: Any, closure: Closure, space: Any) -> None:
    right(self, Closure.TRACTION_FREE if closure is Closure.REFERENCE_NORMAL else closure, space)


def _per_node(right: Function, self: Any, x: Array) -> tuple[Array, Array]:
    rigid, _ = right(self, x)
    return rigid, rigid


FAULTS = (
    Fault(
        "rim-integral-sign",
        "The boundary integral of f w·n enters the force balance with the wrong sign.",
        "both",
        "fem.kernels:RimSample.normal_load",
        _negative,
    ),
    Fault(
        "rim-integral-dropped",
        "The boundary integral of f w·n is left out, as if the active stress had no traction on the rim.",
        "both",
        "fem.kernels:RimSample.normal_load",
        nothing,
    ),
    Fault(
        "rim-geometry-lagged",
        "Normals and arc lengths of the rim are those of the configuration before.",
        "both",
        "fem.kernels:RimRule.at",
        _lagged,
    ),
    Fault(
        "ring-traction-dropped",
        "The pressure does not jump at the ring: δ is 0 in all cells.",
        "both",
        f"{_MODEL}.delta_on_cells",
        nothing,
    ),
    Fault(
        "two-over-pi-dropped",
        "The pressure is p/(1 + φ) (1 + δ arctan a), without 2/π.",
        "both",
        f"{_MODEL}.pressure",
        _without_two_over_pi,
    ),
    Fault(
        "pressure-undiluted",
        "The pressure does not fall as the network dilates: p in place of p/(1 + φ).",
        "both",
        f"{_MODEL}.pressure",
        _undilated,
    ),
    Fault(
        "contractility-linear",
        "The contractility is ψ a exp(−a/a_sat) in place of ψ a² exp(−a/a_sat): the same at a = 1.",
        "both",
        f"{_MODEL}.contractility",
        _linear_in_a,
    ),
    Fault(
        "viscosities-swapped",
        "μ₁ and μ₂ change places.",
        "both",
        f"{_MODEL}.viscous_moduli",
        _swapped,
    ),
    Fault(
        "elastic-bulk-dropped",
        "The elastic stress is ε(u) alone, without ν′ φ I.",
        "both",
        f"{_MODEL}.elastic_moduli",
        _without_bulk,
    ),
    Fault(
        "elasticity-forgotten",
        "A viscoelastic network forgets its displacement, as a viscous one does.",
        "both",
        f"{_FEM_BALANCE}.displacement",
        forgotten,
    ),
    Fault(
        "mesh-frozen",
        "Nodes stay where they are, whatever their velocity.",
        "both",
        f"{_FEM_BALANCE}.advance",
        _frozen,
    ),
    Fault(
        "motion-frozen",
        "Nodes stay where they are in spite of a prescribed motion.",
        "both",
        "actin_xcheck.core.motion:PrescribedMotion.advance",
        _frozen,
    ),
    Fault(
        "rim-direction-current",
        "Rim nodes move along the current normal of the rim in place of the ray they started on.",
        "both",
        "fem.boundary:rim_directions",
        _along_the_current_rim,
    ),
    Fault(
        "rim-slips",
        "The rim is free to slip tangentially: three of its nodes alone keep to their rays.",
        "both",
        "fem.boundary:Constraint.__init__",
        _free_to_slip,
    ),
    Fault(
        "wall-friction-dropped",
        "The wall of irrotational-wall has no friction, so that curl v is not 0 there.",
        "both",
        "fem.kernels:RimSample.friction",
        nothing,
    ),
    Fault(
        "gauge-per-node",
        "The load of a free cell is balanced by a force per node in place of a force per area.",
        "both",
        f"{_FEM_BALANCE}.rigid",
        _per_node,
    ),
)
