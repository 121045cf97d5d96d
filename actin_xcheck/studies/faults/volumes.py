"""Faults of the finite volumes' own force balance: each in one code, so that the other one must show it."""

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Closure, Model
from actin_xcheck.studies.faults.fault import Fault, Function

_BALANCE = "fv.mechanics:FvForceBalance"


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


def _nothing(right: Function, *arguments: Any) -> Any:
    return 0 * right(*arguments)


def _exchanged(right: Function, self: Any, moduli: tuple[float, float]) -> Array:
    return np.asarray(right(self, moduli[::-1]))


def _along_the_current_rim(right: Function, self: Any, closure: Closure, faces: Any) -> None:
    right(self, Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure, faces)


def _forgotten(right: Function, self: Any, x: Array) -> Array:
    return np.zeros_like(right(self, x))


FAULTS = (
    Fault(
        "fv-saturation-ignored",
        "The finite volumes' force balance ignores a_sat.",
        "fv",
        f"{_BALANCE}.loads",
        _unsaturated,
    ),
    Fault(
        "fv-pressure-rounded",
        "The finite volumes' pressure has 0.6 in place of 2/π.",
        "fv",
        f"{_BALANCE}.loads",
        _rounded,
    ),
    Fault(
        "fv-bulk-negative",
        "The finite volumes' elastic stress has −ν′ in place of ν′.",
        "fv",
        f"{_BALANCE}.loads",
        _negative_bulk,
    ),
    Fault(
        "fv-ring-inside-out",
        "The finite volumes polymerise within the ring in place of beyond it.",
        "fv",
        f"{_BALANCE}.__init__",
        _inside_out,
    ),
    Fault(
        "fv-rim-load-dropped",
        "The rim's faces of the finite volumes are pulled from within and not pushed from without.",
        "fv",
        f"{_BALANCE}._on_rim",
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
        f"{_BALANCE}.displacement",
        _forgotten,
    ),
    Fault(
        "fv-rim-direction-current",
        "The rim's faces and vertices of the finite volumes move along its current normal.",
        "fv",
        "fv.boundary:Ties.__init__",
        _along_the_current_rim,
    ),
    Fault(
        "fv-wall-friction-dropped",
        "The wall has no friction for the finite volumes.",
        "fv",
        "fv.system:System._friction",
        _nothing,
    ),
)
