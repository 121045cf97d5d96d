"""Faults of the constitutive laws, which all codes share, and of the elements' force balance and closures.

That one is lent to finite volumes.
"""

from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.studies.faults.fault import Catalogue, Function

_FEM_BALANCE = "fem.force_balance:ForceBalance"
_MODEL = "actin_xcheck.core.model:Model"


def nothing(right: Function, *arguments: Any) -> Any:
    """No part of it."""
    return 0 * right(*arguments)


def _frozen(right: Function, self: Any, t: float, dt: float, x: Array, corners: Array) -> Any:
    return replace(right(self, t, dt, x, corners), x=x)


def forgotten(right: Function, self: Any, x: Array) -> Array:
    """No displacement, (2, N)."""
    return np.zeros_like(right(self, x))


_LAST: WeakKeyDictionary[Any, tuple[Array, Array]] = WeakKeyDictionary()
"""The last two configurations that were asked for."""


FAULTS = Catalogue()


@FAULTS("rim-integral-sign", "both", "fem.kernels:RimSample.normal_load")
def _negative(right: Function, *arguments: Any) -> Any:
    """The boundary integral of f w·n enters the force balance with the wrong sign."""
    return -right(*arguments)


FAULTS(
    "rim-integral-dropped",
    "both",
    "fem.kernels:RimSample.normal_load",
    "The boundary integral of f w·n is left out, as if the active stress had no traction on the rim.",
)(nothing)


@FAULTS("rim-geometry-lagged", "both", "fem.kernels:RimRule.at")
def _lagged(right: Function, self: Any, x: Array) -> Any:
    """Normals and arc lengths of the rim are those of the configuration before."""
    now, before = _LAST.get(self, (x, x))
    if not np.array_equal(now, x):
        now, before = x, now
    _LAST[self] = now, before
    return right(self, before)


FAULTS(
    "ring-traction-dropped",
    "both",
    f"{_MODEL}.delta_on_cells",
    "The pressure does not jump at the ring: δ is 0 in all cells.",
)(nothing)


@FAULTS("two-over-pi-dropped", "both", f"{_MODEL}.pressure")
def _without_two_over_pi(right: Function, self: Any, a: Array, phi: Array, delta: Any) -> Any:
    """The pressure is p/(1 + φ) (1 + δ arctan a), without 2/π."""
    return right(self, a, phi, np.pi / 2 * delta)


@FAULTS("pressure-undiluted", "both", f"{_MODEL}.pressure")
def _undilated(right: Function, self: Any, a: Array, phi: Array, delta: Any) -> Any:
    """The pressure does not fall as the network dilates: p in place of p/(1 + φ)."""
    return right(self, a, 0 * phi, delta)


@FAULTS("contractility-linear", "both", f"{_MODEL}.contractility")
def _linear_in_a(right: Function, self: Any, a: Array) -> Array:
    """The contractility is ψ a exp(−a/a_sat) in place of ψ a² exp(−a/a_sat): the same at a = 1."""
    return np.asarray(right(self, a) / a)


@FAULTS("viscosities-swapped", "both", f"{_MODEL}.viscous_moduli")
def _swapped(right: Function, self: Any) -> tuple[float, float]:
    """μ₁ and μ₂ change places."""
    first, second = right(self)
    return second, first


@FAULTS("elastic-bulk-dropped", "both", f"{_MODEL}.elastic_moduli")
def _without_bulk(right: Function, self: Any) -> tuple[float, float]:
    """The elastic stress is ε(u) alone, without ν′ φ I."""
    return right(self)[0], 0.0


FAULTS(
    "elasticity-forgotten",
    "both",
    f"{_FEM_BALANCE}.displacement",
    "A viscoelastic network forgets its displacement, as a viscous one does.",
)(forgotten)
FAULTS(
    "mesh-frozen", "both", f"{_FEM_BALANCE}.advance", "Nodes stay where they are, whatever their velocity."
)(_frozen)
FAULTS(
    "motion-frozen",
    "both",
    "actin_xcheck.core.motion:PrescribedMotion.advance",
    "Nodes stay where they are in spite of a prescribed motion.",
)(_frozen)


@FAULTS("rim-direction-current", "both", "fem.boundary:rim_directions")
def _along_the_current_rim(right: Function, closure: Closure, space: Any, x: Array) -> Any:
    """Rim nodes move along the current normal of the rim in place of the ray they started on."""
    wrong = Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure
    return right(wrong, space, x)


@FAULTS("rim-slips", "both", "fem.boundary:Constraint.__init__")
def _free_to_slip(right: Function, self: Any, closure: Closure, space: Any) -> None:
    """The rim is free to slip tangentially: three of its nodes alone keep to their rays."""
    right(self, Closure.TRACTION_FREE if closure is Closure.REFERENCE_NORMAL else closure, space)


FAULTS(
    "wall-friction-dropped",
    "both",
    "fem.kernels:RimSample.friction",
    "The wall of irrotational-wall has no friction, so that curl v is not 0 there.",
)(nothing)


@FAULTS("gauge-per-node", "both", f"{_FEM_BALANCE}.rigid")
def _per_node(right: Function, self: Any, x: Array) -> tuple[Array, Array]:
    """The load of a free cell is balanced by a force per node in place of a force per area."""
    rigid, _ = right(self, x)
    return rigid, rigid
