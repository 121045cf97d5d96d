"""Faults of the constitutive laws, the force balance and its closures.

Those of the elements are in one code, lent to finite volumes; those of the finite volumes' own balance are
each in one code, so that the other one must show it.
"""

from copy import copy
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from actin_xcheck.core.model import Array, Closure, Model
from actin_xcheck.studies.faults.fault import Fault, Function

_FEM_BALANCE = "fem.force_balance:ForceBalance"
_MODEL = "actin_xcheck.core.model:Model"


def _negative(right: Function, *arguments: Any) -> Any:
    return -right(*arguments)


def _nothing(right: Function, *arguments: Any) -> Any:
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


def _forgotten(right: Function, self: Any, x: Array) -> Array:
    return np.zeros_like(right(self, x))


_BEFORE: WeakKeyDictionary[Any, Array] = WeakKeyDictionary()


def _lagged(right: Function, self: Any, x: Array) -> Any:
    before = _BEFORE.get(self, x)
    _BEFORE[self] = x
    return right(self, before)


def _along_the_current_rim(right: Function, closure: Closure, space: Any, x: Array) -> Any:
    wrong = Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure
    return right(wrong, space, x)


def _free_to_slip(right: Function, self: Any, closure: Closure, space: Any) -> None:
    right(self, Closure.TRACTION_FREE if closure is Closure.REFERENCE_NORMAL else closure, space)


def _per_node(right: Function, self: Any, x: Array) -> tuple[Array, Array]:
    rigid, _ = right(self, x)
    return rigid, rigid


OF_ELEMENTS = (
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
        _nothing,
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
        _nothing,
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
        _forgotten,
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
        _nothing,
    ),
    Fault(
        "gauge-per-node",
        "The load of a free cell is balanced by a force per node in place of a force per area.",
        "both",
        f"{_FEM_BALANCE}.rigid",
        _per_node,
    ),
)


_FV_BALANCE = "fv.mechanics:FvForceBalance"


class _Rounded(Model):
    """The pressure with 0.6 in place of 2/pi."""

    def pressure(self, a: Array, phi: Array, delta: Array | float) -> Array:
        return super().pressure(a, phi, 0.3 * np.pi * delta)


class _NegativeBulk(Model):
    """The elastic stress with -nu' in place of nu'."""

    def elastic_moduli(self) -> tuple[float, float]:
        one, nu_prime = super().elastic_moduli()
        return one, -nu_prime


def _with_model(right: Function, self: Any, model: Model, *arguments: Any) -> Any:
    other = copy(self)
    other.model = model
    return right(other, *arguments)


def _unsaturated(right: Function, self: Any, *arguments: Any) -> Any:
    parameters = replace(self.model.parameters, a_sat=1e9)
    return _with_model(right, self, replace(self.model, parameters=parameters), *arguments)


def _rounded(right: Function, self: Any, *arguments: Any) -> Any:
    return _with_model(right, self, _Rounded(**vars(self.model)), *arguments)


def _negative_bulk(right: Function, self: Any, *arguments: Any) -> Any:
    return _with_model(right, self, _NegativeBulk(**vars(self.model)), *arguments)


def _inside_out(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    self.delta = 1 - self.delta


def _exchanged(right: Function, self: Any, moduli: tuple[float, float]) -> Array:
    return np.asarray(right(self, moduli[::-1]))


def _faces_along_the_current_rim(right: Function, self: Any, closure: Closure, faces: Any) -> None:
    right(self, Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure, faces)


OF_VOLUMES = (
    Fault(
        "fv-saturation-ignored",
        "The finite volumes' force balance ignores a_sat.",
        "fv",
        f"{_FV_BALANCE}.loads",
        _unsaturated,
    ),
    Fault(
        "fv-pressure-rounded",
        "The finite volumes' pressure has 0.6 in place of 2/π.",
        "fv",
        f"{_FV_BALANCE}.loads",
        _rounded,
    ),
    Fault(
        "fv-bulk-negative",
        "The finite volumes' elastic stress has −ν′ in place of ν′.",
        "fv",
        f"{_FV_BALANCE}.loads",
        _negative_bulk,
    ),
    Fault(
        "fv-ring-inside-out",
        "The finite volumes polymerise within the ring in place of beyond it.",
        "fv",
        f"{_FV_BALANCE}.__init__",
        _inside_out,
    ),
    Fault(
        "fv-rim-load-dropped",
        "The rim's faces of the finite volumes are pulled from within and not pushed from without.",
        "fv",
        f"{_FV_BALANCE}._on_rim",
        _nothing,
    ),
    Fault(
        "fv-viscosities-swapped",
        "μ₁ and μ₂ change places in the part of the traction that vertex values make.",
        "fv",
        "fv.stress:Diamonds.cross",
        _exchanged,
    ),
    Fault(
        "fv-cross-dropped",
        "The part of the traction that vertex values make is left out: two points alone.",
        "fv",
        "fv.stress:Diamonds.cross",
        _nothing,
    ),
    Fault(
        "fv-elasticity-forgotten",
        "A viscoelastic network of finite volumes forgets its displacement.",
        "fv",
        f"{_FV_BALANCE}.displacement",
        _forgotten,
    ),
    Fault(
        "fv-rim-direction-current",
        "The rim's faces and vertices of the finite volumes move along its current normal.",
        "fv",
        "fv.boundary:Ties.__init__",
        _faces_along_the_current_rim,
    ),
    Fault(
        "fv-wall-friction-dropped",
        "The wall has no friction for the finite volumes.",
        "fv",
        "fv.system:System._friction",
        _nothing,
    ),
)

FAULTS = (*OF_ELEMENTS, *OF_VOLUMES)
