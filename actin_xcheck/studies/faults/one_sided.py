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
from actin_xcheck.studies.faults.fault import Fault, Function
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


def _without_traction(right: Function, self: Any, x: Array, v: Array, across: Array, force: Array) -> Any:
    return right(self, x, v, across, 0 * force)


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


def _lagged_on_edges(right: Function, self: Any, x: Array, a: Array, a_rim: Array, *arguments: Any) -> Any:
    return right(self, x, a, _before(self.space, a_rim), *arguments)


def _lagged_on_faces(right: Function, self: Any, area: Array, a: Array, *arguments: Any) -> Any:
    return right(self, area, _before(self.faces, a), *arguments)


def _in_the_reference(gradient: Array) -> Array:
    """Trace of (I - G)^-1 - I, the gradient by xi of what has a gradient G (2, 2, ...) by x."""
    stretch = np.linalg.inv(np.eye(2) - np.moveaxis(gradient, (0, 1), (-2, -1)))
    return np.asarray(np.trace(stretch, axis1=-2, axis2=-1) - 2)


def _dilated_in_the_reference(right: Function, self: Any, u: Array) -> Any:
    strain, _ = right(self, u)
    gradient = np.einsum("aiqe,jae->ijqe", self.gradients, u[:, self.rule.cells])
    return strain, _in_the_reference(gradient)


def _divergence_in_the_reference(right: Function, gradient: Array) -> Array:
    return _in_the_reference(gradient)


def _exchanged(right: Function, self: Any, moduli: tuple[float, float]) -> Array:
    return np.asarray(right(self, moduli[::-1]))


def _exchanged_across(right: Function, self: Any, sample: Any, moduli: tuple[float, float]) -> Any:
    matrix, wrong = right(self, sample, moduli), right(self, sample, moduli[::-1])
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    across = (rows + matrix.indices) % 2 == 1
    matrix.data[across] = wrong.data[across]
    return matrix


# wrong closures


def _faces_along_the_current_rim(right: Function, self: Any, closure: Closure, faces: Any) -> None:
    right(self, Closure.CURRENT_NORMAL if closure is Closure.REFERENCE_NORMAL else closure, faces)


def _per_cell(right: Function, cls: Any, ties: Any, diamonds: Any, volumes: Array) -> Any:
    return right(cls, ties, diamonds, np.full_like(volumes, volumes.mean()))


def _without_torque(right: Function, self: Any, x: Array, load: Array) -> Any:
    gauge = right(self, x, load)
    if gauge.load is load:  # of another closure
        return gauge
    rigid, weighted = self.rigid(x)
    turn = np.linalg.solve(rigid.T @ weighted, rigid.T @ load)[-1]
    return replace(gauge, load=gauge.load + weighted[:, -1] * turn)


def _moved_torque(right: Function, self: Any, *arguments: Any) -> Any:
    gauge, x = right(self, *arguments), arguments[0].mean(axis=1)
    return replace(gauge, torque=gauge.torque + x[0] * gauge.force[1] - x[1] * gauge.force[0])


def _torque_of_volumes_moved(right: Function, self: Any, v: Array) -> Any:
    force, torque = right(self, v)
    x = self.x.mean(axis=1)
    return force, torque + x[0] * force[1] - x[1] * force[0]


_READINGS: tuple[tuple[str, str, type[Model]], ...] = (
    ("saturation-ignored", "ignores a_sat", _Unsaturated),
    ("saturation-of-table-2", "takes the a_sat of Table 2 whatever the scene says", _AlwaysSaturated),
    ("pressure-rounded", "has 0.64 in place of 2/π", _Rounded),
    ("poisson-of-table-2", "takes the ν of Table 2 whatever the scene says", _Poisson),
    ("bulk-negative", "has −ν′ in place of ν′", _NegativeBulk),
)

_CODES = (("fem", "elements", _FEM, "system"), ("fv", "finite volumes", _FV, "loads"))

OF_BOTH = tuple(
    fault
    for code, words, balance, loads in _CODES
    for fault in (
        *(
            Fault(
                f"{code}-{name}",
                f"The force balance of the {words} {what}.",
                code,
                f"{balance}.{loads}",
                _Read(model),
            )
            for name, what, model in _READINGS
        ),
        Fault(
            f"{code}-ring-inside-out",
            f"The {words} polymerise within the ring in place of beyond it.",
            code,
            f"{balance}.__init__",
            _inside_out,
        ),
        Fault(
            f"{code}-ring-blurred",
            f"δ is the mean over the cells around for the {words}: the jump of f at the ring is lost.",
            code,
            f"{balance}.__init__",
            _blurred,
        ),
        Fault(
            f"{code}-ring-smeared",
            f"δ rises from 0 to 1 over a width of 0.2 for the {words}, where it should jump.",
            code,
            f"{balance}.__init__",
            _smeared,
        ),
    )
)

OF_ELEMENTS = (
    Fault(
        "fem-rim-not-carried",
        "The deformation gradient across the rim stays what it was at the start, in the finite elements.",
        "fem",
        "fem.rim:FreeRim.rate",
        nothing,
    ),
    Fault(
        "fem-rim-reaction-dropped",
        "The closure's reaction has no part in how the rim's finite elements stretch.",
        "fem",
        "fem.rim:FreeRim._reaction",
        nothing,
    ),
    Fault(
        "fem-rim-jump-dropped",
        "A membrane's own load is no traction on the rim's finite elements.",
        "fem",
        "fem.force_balance:ForceBalance._jump",
        nothing,
    ),
    Fault(
        "fem-rim-load-lagged",
        "The load on the rim's edges is that of the concentration of the call before.",
        "fem",
        f"{_FEM}.system",
        _lagged_on_edges,
    ),
    Fault(
        "fem-dilation-in-reference",
        "The dilation is the divergence of u with respect to ξ in place of x.",
        "fem",
        "fem.kernels:CellSample.strain",
        _dilated_in_the_reference,
    ),
    Fault(
        "fem-viscosities-swapped",
        "μ₁ and μ₂ change places where one component of the velocity loads the other.",
        "fem",
        "fem.force_balance:Network.matrix",
        _exchanged_across,
    ),
    Fault(
        "fem-torque-left",
        "The torque on a free cell is not balanced.",
        "fem",
        f"{_FEM}._balanced",
        _without_torque,
    ),
    Fault(
        "fem-torque-about-origin",
        "The torque on a free cell is told about the origin in place of the centroid.",
        "fem",
        f"{_FEM}._balanced",
        _moved_torque,
    ),
)

OF_VOLUMES = (
    Fault(
        "fv-rim-not-carried",
        "The deformation gradient across the rim stays what it was at the start, in the finite volumes.",
        "fv",
        "fv.rim:RimFaces.rate",
        nothing,
    ),
    Fault(
        "fv-rim-traction-dropped",
        "Finite volumes stretch across the rim as if no traction acted on its faces.",
        "fv",
        "fv.rim:RimFaces.rate",
        _without_traction,
    ),
    Fault(
        "fv-rim-load-dropped",
        "The rim's faces of the finite volumes are pulled from within and not pushed from without.",
        "fv",
        f"{_FV}._on_rim",
        nothing,
    ),
    Fault(
        "fv-rim-load-lagged",
        "The load on the rim's faces is that of the concentration of the call before.",
        "fv",
        f"{_FV}._on_rim",
        _lagged_on_faces,
    ),
    Fault(
        "fv-dilation-in-reference",
        "The dilation is the divergence of u with respect to ξ in place of x.",
        "fv",
        "fv.mechanics:divergence",
        _divergence_in_the_reference,
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
        nothing,
    ),
    Fault(
        "fv-kink-dropped",
        "The velocity's kink at the ring is left out of what is interpolated there.",
        "fv",
        f"{_FV}._kink",
        nothing,
    ),
    Fault(
        "fv-elasticity-forgotten",
        "A viscoelastic network of finite volumes forgets its displacement.",
        "fv",
        f"{_FV}.displacement",
        forgotten,
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
        nothing,
    ),
    Fault(
        "fv-gauge-per-cell",
        "The load of a free cell is balanced by a force per finite volume in place of a force per area.",
        "fv",
        "fv.system:Gauge.of",
        _per_cell,
    ),
    Fault(
        "fv-torque-about-origin",
        "The torque on a free cell of finite volumes is told about the origin in place of the centroid.",
        "fv",
        "fv.system:System.net",
        _torque_of_volumes_moved,
    ),
)

FAULTS = (*OF_BOTH, *OF_ELEMENTS, *OF_VOLUMES)
