"""Faults of one code's force balance: the other code, which has another one, must show each.

Both can read an equation wrong in the same ways.  A wrong reading is a model that one code is given.
"""

from copy import copy
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from actin_xcheck.core.model import Array, Closure, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.studies.faults.fault import Catalogue, Function
from actin_xcheck.studies.faults.mechanics import forgotten, nothing

_FEM, _FV = "fem.force_balance:ForceBalance", "fv.mechanics:FvForceBalance"
_TABLE_2 = Parameters(0.0, 0.0)


# wrong readings of the equations


class _Unsaturated(Model):
    """Contraction without a_sat."""

    def contractility(self, a: Array) -> Array:
        return self.parameters.psi * a**2


class _AlwaysSaturated(Model):
    """Contraction with the a_sat of Table 2."""

    def contractility(self, a: Array) -> Array:
        return Model(replace(self.parameters, a_sat=_TABLE_2.a_sat)).contractility(a)


class _Rounded(Model):
    """The pressure with 0.64 in place of 2/pi."""

    def pressure(self, a: Array, phi: Array, delta: Array | float) -> Array:
        return super().pressure(a, phi, 0.32 * np.pi * delta)


class _Poisson(Model):
    """The elastic stress with the nu of Table 2."""

    def elastic_moduli(self) -> tuple[float, float]:
        return 1.0, _TABLE_2.nu_prime


class _NegativeBulk(Model):
    """The elastic stress with -nu' in place of nu'."""

    def elastic_moduli(self) -> tuple[float, float]:
        one, nu_prime = super().elastic_moduli()
        return one, -nu_prime


@dataclass(frozen=True)
class _Read:
    """A balance reads the equations as a wrong model has them."""

    model: type[Model]

    def __call__(self, right: Function, balance: Any, *arguments: Any) -> Any:
        other = copy(balance)
        other.model = self.model(**vars(balance.model))
        return right(other, *arguments)


# wrong deltas, loads and gradients


def _inside_out(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    self.delta = 1 - self.delta


def _blurred(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    ends, count = self.mesh.triangles, self.mesh.xi.shape[1]
    around = np.bincount(ends.ravel(), np.tile(self.delta, 3), count) / np.bincount(ends.ravel())
    self.delta = around[ends].mean(axis=0)


def _smeared(right: Function, self: Any, *arguments: Any) -> None:
    right(self, *arguments)
    if self.delta.any() and not self.delta.all():  # there is a ring
        beyond = np.hypot(*self.mesh.centroids) - self.model.parameters.l0
        self.delta = np.clip(0.5 + beyond / 0.2, 0, 1)


_BEFORE: WeakKeyDictionary[Any, Array] = WeakKeyDictionary()


def _before(key: Any, now: Array) -> Array:
    """What was there at the call before."""
    before = _BEFORE.get(key, now)
    _BEFORE[key] = now
    return before


def _in_the_reference(gradient: Array) -> Array:
    """Trace of (I - G)^-1 - I, the gradient by xi of what has a gradient G (2, 2, ...) by x."""
    stretch = np.linalg.inv(np.eye(2) - np.moveaxis(gradient, (0, 1), (-2, -1)))
    return np.asarray(np.trace(stretch, axis1=-2, axis2=-1) - 2)


# wrong closures


_READINGS: tuple[tuple[str, str, type[Model]], ...] = (
    ("saturation-ignored", "ignores a_sat", _Unsaturated),
    ("saturation-of-table-2", "takes the a_sat of Table 2 whatever the scene says", _AlwaysSaturated),
    ("pressure-rounded", "has 0.64 in place of 2/π", _Rounded),
    ("poisson-of-table-2", "takes the ν of Table 2 whatever the scene says", _Poisson),
    ("bulk-negative", "has −ν′ in place of ν′", _NegativeBulk),
)

_CODES = (("fem", "elements", _FEM, "system"), ("fv", "finite volumes", _FV, "loads"))

FAULTS = Catalogue()

for _code, _words, _balance, _loads in _CODES:
    for _name, _what, _model in _READINGS:
        _reads = f"The force balance of the {_words} {_what}."
        FAULTS(f"{_code}-{_name}", _code, f"{_balance}.{_loads}", _reads)(_Read(_model))
    for _name, _what, _wrong in (
        ("inside-out", f"The {_words} polymerise within the ring in place of beyond it.", _inside_out),
        (
            "blurred",
            f"δ is the mean over the cells around for the {_words}: the jump of f at the ring is lost.",
            _blurred,
        ),
        (
            "smeared",
            f"δ rises from 0 to 1 over a width of 0.2 for the {_words}, where it should jump.",
            _smeared,
        ),
    ):
        FAULTS(f"{_code}-ring-{_name}", _code, f"{_balance}.__init__", _what)(_wrong)

OF_BOTH = (*FAULTS,)


FAULTS(
    "fem-rim-not-carried",
    "fem",
    "fem.boundary:FreeRim.rate",
    "The deformation gradient across the rim stays what it was at the start, in the finite elements.",
)(nothing)
FAULTS(
    "fem-rim-reaction-dropped",
    "fem",
    "fem.boundary:FreeRim._reaction",
    "The closure's reaction has no part in how the rim's finite elements stretch.",
)(nothing)
FAULTS(
    "fem-rim-jump-dropped",
    "fem",
    "fem.force_balance:ForceBalance._jump",
    "A membrane's own load is no traction on the rim's finite elements.",
)(nothing)


@FAULTS("fem-rim-load-lagged", "fem", f"{_FEM}.system")
def _lagged_on_edges(right: Function, self: Any, x: Array, a: Array, a_rim: Array, *arguments: Any) -> Any:
    """The load on the rim's edges is that of the concentration of the call before."""
    return right(self, x, a, _before(self.space, a_rim), *arguments)


@FAULTS("fem-dilation-in-reference", "fem", "fem.kernels:CellSample.strain")
def _dilated_in_the_reference(right: Function, self: Any, u: Array) -> Any:
    """The dilation is the divergence of u with respect to ξ in place of x."""
    strain, _ = right(self, u)
    gradient = np.einsum("aiqe,jae->ijqe", self.gradients, u[:, self.rule.cells])
    return strain, _in_the_reference(gradient)


@FAULTS("fem-viscosities-swapped", "fem", "fem.force_balance:Network.matrix")
def _exchanged_across(right: Function, self: Any, sample: Any, moduli: tuple[float, float]) -> Any:
    """μ₁ and μ₂ change places where one component of the velocity loads the other."""
    matrix, wrong = right(self, sample, moduli), right(self, sample, moduli[::-1])
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    across = (rows + matrix.indices) % 2 == 1
    matrix.data[across] = wrong.data[across]
    return matrix


@FAULTS("fem-torque-left", "fem", f"{_FEM}._balanced")
def _without_torque(right: Function, self: Any, x: Array, load: Array) -> Any:
    """The torque on a free cell is not balanced."""
    gauge = right(self, x, load)
    if gauge.load is load:  # of another closure
        return gauge
    rigid, weighted = self.rigid(x)
    turn = np.linalg.solve(rigid.T @ weighted, rigid.T @ load)[-1]
    return replace(gauge, load=gauge.load + weighted[:, -1] * turn)


@FAULTS("fem-torque-about-origin", "fem", f"{_FEM}._balanced")
def _moved_torque(right: Function, self: Any, *arguments: Any) -> Any:
    """The torque on a free cell is told about the origin in place of the centroid."""
    gauge, x = right(self, *arguments), arguments[0].mean(axis=1)
    return replace(gauge, torque=gauge.torque + x[0] * gauge.force[1] - x[1] * gauge.force[0])


FAULTS(
    "fv-rim-not-carried",
    "fv",
    "fv.rim:RimFaces.rate",
    "The deformation gradient across the rim stays what it was at the start, in the finite volumes.",
)(nothing)


@FAULTS("fv-rim-traction-dropped", "fv", "fv.rim:RimFaces.rate")
def _without_traction(right: Function, self: Any, x: Array, v: Array, across: Array, force: Array) -> Any:
    """Finite volumes stretch across the rim as if no traction acted on its faces."""
    return right(self, x, v, across, 0 * force)


FAULTS(
    "fv-rim-load-dropped",
    "fv",
    f"{_FV}._on_rim",
    "The rim's faces of the finite volumes are pulled from within and not pushed from without.",
)(nothing)


@FAULTS("fv-rim-load-lagged", "fv", f"{_FV}._on_rim")
def _lagged_on_faces(right: Function, self: Any, area: Array, a: Array, *arguments: Any) -> Any:
    """The load on the rim's faces is that of the concentration of the call before."""
    return right(self, area, _before(self.faces, a), *arguments)


@FAULTS("fv-dilation-in-reference", "fv", "fv.mechanics:divergence")
def _divergence_in_the_reference(right: Function, gradient: Array) -> Array:
    """The dilation is the divergence of u with respect to ξ in place of x."""
    return _in_the_reference(gradient)


@FAULTS("fv-viscosities-swapped", "fv", "fv.stress:Diamonds.cross")
def _exchanged(right: Function, self: Any, moduli: tuple[float, float]) -> Array:
    """μ₁ and μ₂ change places in the part of the traction that vertex values make."""
    return np.asarray(right(self, moduli[::-1]))


FAULTS(
    "fv-cross-dropped",
    "fv",
    "fv.stress:Diamonds.cross",
    "The part of the traction that vertex values make is left out: two points alone.",
)(nothing)
FAULTS(
    "fv-kink-dropped",
    "fv",
    f"{_FV}._kink",
    "The velocity's kink at the ring is left out of what is interpolated there.",
)(nothing)
FAULTS(
    "fv-elasticity-forgotten",
    "fv",
    f"{_FV}.displacement",
    "A viscoelastic network of finite volumes forgets its displacement.",
)(forgotten)


@FAULTS("fv-rim-direction-current", "fv", "fv.boundary:Ties.__init__")
def _faces_along_the_current_rim(right: Function, self: Any, closure: Closure, faces: Any) -> None:
    """The rim's faces and vertices of the finite volumes move along its current normal."""
    right(self, Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure, faces)


FAULTS(
    "fv-wall-friction-dropped",
    "fv",
    "fv.system:System._friction",
    "The wall has no friction for the finite volumes.",
)(nothing)


@FAULTS("fv-gauge-per-cell", "fv", "fv.system:Gauge.of")
def _per_cell(right: Function, cls: Any, ties: Any, diamonds: Any, volumes: Array) -> Any:
    """The load of a free cell is balanced by a force per finite volume in place of a force per area."""
    return right(cls, ties, diamonds, np.full_like(volumes, volumes.mean()))


@FAULTS("fv-torque-about-origin", "fv", "fv.system:System.net")
def _torque_of_volumes_moved(right: Function, self: Any, v: Array) -> Any:
    """The torque on a free cell of finite volumes is told about the origin in place of the centroid."""
    force, torque = right(self, v)
    x = self.x.mean(axis=1)
    return force, torque + x[0] * force[1] - x[1] * force[0]
