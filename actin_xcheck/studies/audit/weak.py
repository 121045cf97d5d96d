"""Rows of the audit: the transport theorem and the weak forms, (B.1) to (B.16).

Identities are evaluated on smooth fields in the unit disk, which moves with the velocity beta where one is
about transport; weak forms on one step of the implementation.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.studies.audit import RowAnswer, answer, examines
from actin_xcheck.studies.audit.sample import (
    ROUND_OFF,
    circle,
    disk_quadrature,
    relative,
    second_step,
)

_L0 = 0.8

POINTS, WEIGHTS = disk_quadrature()
"""Quadrature on the unit disk."""

RIM, NORMALS, LENGTH = circle()
"""Points on its rim, their normals and the length each stands for."""

_Field = Callable[[Array], Array]


def _rate(g: Callable[[float], Any], step: float = 1e-3) -> Any:
    """Derivative at 0, of fourth order."""
    return (8 * (g(step) - g(-step)) - g(2 * step) + g(-2 * step)) / (12 * step)


def _derivative(g: _Field, k: int, x: Array, step: float = 1e-4) -> Array:
    """Derivative of a field in direction k at points x (2, n)."""
    unit = np.eye(2)[:, [k]]
    return np.asarray(_rate(lambda s: g(x + s * unit), step))


def _component(field: _Field, k: int) -> _Field:
    return lambda x: field(x)[k]


def _divergence(field: _Field, x: Array, step: float = 1e-4) -> Array:
    """Divergence of a vector field at points x (2, n)."""
    return np.asarray(sum(_derivative(_component(field, k), k, x, step) for k in range(2)))


def _gradient(g: _Field, x: Array, step: float = 1e-4) -> Array:
    """Gradient of a scalar field at points x (2, n), (2, n)."""
    return np.array([_derivative(g, k, x, step) for k in range(2)])


def _w(x: Array) -> Array:
    """A smooth test function without symmetry."""
    return np.asarray(np.sin(1.3 * x[0] + 0.4) * np.exp(0.5 * x[1]))


def _identity(left: float, right: float, **values: Any) -> RowAnswer:
    """The answer to an identity between two numbers."""
    difference = abs(left - right) / max(abs(left), 1e-3)
    return answer(difference < 1e-7, left=left, right=right, **values)


def _over_disk(values: Array) -> float:
    """The integral over the disk of values at `POINTS`."""
    return float(WEIGHTS @ values)


def _over_rim(values: Array) -> float:
    """The integral over the rim of values at `RIM`."""
    return float(values.sum() * LENGTH)


def _beta(x: Array) -> Array:
    return np.array([0.3 * x[0] + 0.2 * x[1] ** 2, -0.1 * x[0] * x[1] + 0.15])


def _a(x: Array, t: float = 0.0) -> Array:
    return np.asarray(1 + 0.2 * np.sin(x[0] + 2 * t) * x[1] + 0.1 * x[0] * np.cos(3 * t))


def _a_t() -> Array:
    """Partial derivative of a in time at t = 0."""
    return np.asarray(0.4 * np.cos(POINTS[0]) * POINTS[1])


def _transported(g: Callable[[Array, float], Array]) -> float:
    """d/dt at t = 0 of the integral of g over the disk as it moves with beta."""

    def total(t: float) -> float:
        # second order in t is enough for a central difference of points, Jacobians are exact for them
        e, moved = 1e-5, lambda x: x + t * _beta(x)
        columns = [(moved(POINTS + s) - moved(POINTS - s)) / (2 * e) for s in e * np.eye(2)[:, :, None]]
        jacobian = columns[0][0] * columns[1][1] - columns[0][1] * columns[1][0]
        return _over_disk(g(moved(POINTS), t) * jacobian)

    return float(_rate(total))


def _material() -> Array:
    """Da/Dt at t = 0 by following the particles."""
    return np.asarray(_rate(lambda t: _a(POINTS + t * _beta(POINTS), t)))


def _advected() -> Array:
    """grad a . beta at t = 0."""
    return np.asarray((_gradient(_a, POINTS) * _beta(POINTS)).sum(axis=0))


def _diluted() -> Array:
    """a div beta at t = 0."""
    return _a(POINTS) * (0.3 - 0.1 * POINTS[0])


def _flux(x: Array) -> Array:
    """a beta at t = 0."""
    return _a(x) * _beta(x)


def _weighted(x: Array, t: float) -> Array:
    return _a(x, t) * _w(x)


def __w_moves() -> float:
    """The integral of a Dw/Dt for the steady w."""
    return _over_disk((_gradient(_w, POINTS) * _flux(POINTS)).sum(axis=0))


@examines("eqB.1")
def _reynolds() -> RowAnswer:
    return _identity(_transported(_a), _over_disk(_material() + _diluted()))


@examines("eqB.8")
def _restated() -> RowAnswer:
    """(B.8) integrated over the moving disk with the residual of an arbitrary a as a source."""
    diffusion = _divergence(partial(_gradient, _a, step=1e-2), POINTS, 1e-2)
    change = _a_t() - 0.4 * diffusion + _divergence(_flux, POINTS)
    rim_flux = _over_rim(NORMALS * _gradient(_a, RIM))
    gain = 1 - _a(POINTS)
    return _identity(_over_disk(change - gain), _transported(_a) - 0.4 * rim_flux - _over_disk(gain))


@examines("eqB.9")
def _product_rule() -> RowAnswer:
    flux = _divergence(_flux, POINTS)
    difference = relative(flux - _advected() - _diluted(), flux)
    return answer(difference < 1e-8, difference=difference, count=POINTS.shape[1])


@examines("eqB.10")
def _material_derivative() -> RowAnswer:
    difference = relative(_material() - _a_t() - _advected(), _material())
    return answer(difference < 1e-8, difference=difference)


@examines("eqB.11")
def _material_form() -> RowAnswer:
    partial_form = _a_t() + _divergence(_flux, POINTS)
    difference = relative(_material() + _diluted() - partial_form, partial_form)
    return answer(difference < 1e-8, difference=difference)


@examines("eqB.12", "eqB.13")
def _weak_rate() -> RowAnswer:
    """D/dt read as D/Dt and as the partial derivative."""
    w = _w(POINTS)
    dilution = _over_disk(_a(POINTS) * w * (0.3 - 0.1 * POINTS[0]))
    truth = _transported(_weighted) - __w_moves()
    material, as_partial = (_over_disk(w * rate) + dilution for rate in (_material(), _a_t()))
    return answer(
        abs(as_partial - truth) < 1e-6,
        corrected=abs(material - truth) < 1e-6,
        truth=truth,
        material=material,
        as_partial=as_partial,
    )


@examines("eqB.14")
def _conservative_form() -> RowAnswer:
    right = _over_disk(_w(POINTS) * (_material() + _diluted())) + __w_moves()
    return _identity(_transported(_weighted), right)


@examines("eqB.15c", "eqB.16c")
def _weak_step() -> RowAnswer:
    """The implementation's step of the weak transport equation, whose Dw/Dt vanishes."""
    step = second_step()
    rate = (step.after.mass() @ step.new.a - step.before.mass() @ step.old.a) / step.dt
    d = step.model.parameters.d
    rest = step.before.load() - (d * step.after.stiffness() + step.after.mass()) @ step.new.a
    difference = relative(rate - rest, step.before.load())
    return answer(difference < ROUND_OFF, difference=difference)


@examines("eqB.2")
def _constants() -> RowAnswer:
    """D and C against the model's moduli, in dyn/cm^2 and scaled."""
    units = DimensionalParameters(psi=72.0, p=0.3)
    E, nu = units.E, units.nu
    model = Model(units.non_dimensional())
    (mu1, mu2), (one, nu_prime) = model.viscous_moduli(), model.elastic_moduli()
    stress, rate = E / (1 + nu), units.k_a
    printed = {
        "D11": units.mu1 + units.mu2,
        "D12": units.mu2,
        "D33": units.mu1 / 2,
        "C11": E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)),
        "C12": E * nu / ((1 + nu) * (1 - 2 * nu)),
        "C33": E / (2 * (1 + nu)),
    }
    viscous = ((mu1 + mu2) * stress / rate, mu2 * stress / rate, mu1 / 2 * stress / rate)
    ours = (*viscous, (one + nu_prime) * stress, nu_prime * stress, one / 2 * stress)
    worst = max(abs(mine / theirs - 1) for theirs, mine in zip(printed.values(), ours, strict=True))
    return answer(worst < ROUND_OFF, printed=printed, worst=worst)


def _u(x: Array) -> Array:
    return np.array([np.sin(x[0]) * x[1] + 0.2 * x[0], np.cos(x[1]) + 0.3 * x[0] ** 2 * x[1]])


def _gradients(x: Array) -> Array:
    """du_i/dx_k at points x, (2, 2, n)."""
    return np.array([_gradient(_component(_u, i), x) for i in range(2)])


def _stress(row: int, x: Array) -> Array:
    """Row of the stress (2, n) as (B.2) writes it, C11 = 1.75, C12 = 0.75, C33 = 0.5."""
    (u_x, u_y), (v_x, v_y) = _gradients(x)
    sheared = 0.5 * (u_y + v_x)
    return np.array([1.75 * u_x + 0.75 * v_y, sheared] if row == 0 else [sheared, 0.75 * u_x + 1.75 * v_y])


def _tensor(row: int, x: Array) -> Array:
    """The same row of eps(u) + nu' (div u) I of (2.4)."""
    grad = _gradients(x)
    stress = ((grad + grad.swapaxes(0, 1)) / 2)[row]
    stress[row] += 0.75 * (grad[0, 0] + grad[1, 1])
    return np.asarray(stress)


@examines("eqB.2a", "eqB.2b")
def _decoupled(axis: str) -> RowAnswer:
    """Divergence of the stress of (B.2) against that of (2.4)."""
    x, row = np.array([[0.3, -0.5, 0.1], [0.2, 0.4, -0.6]]), "xy".index(axis)
    truth = _divergence(partial(_tensor, row), x, 1e-2)
    difference = relative(_divergence(partial(_stress, row), x, 1e-2) - truth, truth)
    return answer(difference < 1e-9, difference=difference)


@examines("eqB.3a", "eqB.3b")
def _first_weak_form(axis: str) -> RowAnswer:
    """Green's identity: the two sides of (B.3) differ by the traction that (2.1f) sets to zero."""
    stress = partial(_stress, "xy".index(axis))
    left = _over_disk((_gradient(_w, POINTS) * stress(POINTS)).sum(axis=0))
    traction = _over_rim(_w(RIM) * (NORMALS * stress(RIM)).sum(axis=0))
    right = -_over_disk(_w(POINTS) * _divergence(stress, POINTS, 1e-2))
    return _identity(left - traction, right, traction=traction)


def _f(delta: float, x: Array) -> Array:
    """The active stress of a smooth concentration, without dilation."""
    a = 1 + 0.2 * x[0] + 0.1 * x[1]
    return Model(Parameters(62.4, 0.26)).active_stress(a, np.zeros_like(a), delta)


@examines("eqB.4")
def _active_terms() -> RowAnswer:
    """The bracket of (B.4) against the model; its derivative exists off the ring only."""
    a, phi = np.array([0.5, 1.0, 2.0]), np.array([0.1, -0.2, 0.0])
    model = Model(Parameters(62.4, 0.26))
    by_hand = 0.26 / (1 + phi) * (1 + 2 / np.pi * np.arctan(a)) + 62.4 * a**2 * np.exp(-a / 1.4)
    difference = relative(model.active_stress(a, phi, 1.0) - by_hand, by_hand)
    jump = _f(1.0, _L0 * NORMALS) - _f(0.0, _L0 * NORMALS)
    return answer(difference < ROUND_OFF, difference=difference, least=jump.min(), largest=jump.max())


@examines("eqB.5")
def _green() -> RowAnswer:
    def g(x: Array) -> Array:
        return np.asarray(np.cos(0.7 * x[0] - 1.1 * x[1]) + x[0] ** 2)

    left, right = [], []
    for k in range(2):
        left.append(_over_disk(_w(POINTS) * _derivative(g, k, POINTS)))
        inside = _over_disk(g(POINTS) * _derivative(_w, k, POINTS))
        right.append(_over_rim(NORMALS[k] * _w(RIM) * g(RIM)) - inside)
    worst = max(abs(one - other) for one, other in zip(left, right, strict=True))
    return answer(worst < 1e-8, worst=worst, left=left)


@examines("eqB.6")
def _split() -> RowAnswer:
    """The x component of (B.6) in the sense that (B.7) uses, with and without the jump's own contribution."""
    f0, f1 = (partial(_f, delta) for delta in (0.0, 1.0))
    parts = (f0, *disk_quadrature(0.0, _L0)), (f1, *disk_quadrature(_L0, 1.0))
    whole = -sum(float(weights @ (f(x) * _derivative(_w, 0, x))) for f, x, weights in parts)
    whole += LENGTH * float((NORMALS[0] * f1(RIM) * _w(RIM)).sum())
    regions = sum(float(weights @ (_w(x) * _derivative(f, 0, x))) for f, x, weights in parts)
    ring = _L0 * NORMALS
    traction = _L0 * LENGTH * float((NORMALS[0] * (f1(ring) - f0(ring)) * _w(ring)).sum())
    return answer(
        abs(whole - regions) < 1e-7,
        corrected=abs(whole - regions - traction) < 1e-7,
        whole=whole,
        regions=regions,
        traction=traction,
        sum=regions + traction,
    )


@examines("eqB.7a", "eqB.7b", "eqB.15a", "eqB.16a")
def _second_weak_form(axis: str) -> RowAnswer:
    """The implementation's load and stress against (B.7), (B.15), (B.16) by hand, one component."""
    step, row = second_step(), "xy".index(axis)
    load = step.balance.assemble(step.old.x, step.old.a[step.mesh.triangles], 0.0).load
    by_hand = (step.force() - step.elasticity() @ step.displacements()[0]).reshape(2, -1)[row]
    difference = relative(load.reshape(-1, 2).T[row] - by_hand, by_hand)
    return answer(difference < ROUND_OFF, difference=difference)


@examines("eqB.15b", "eqB.16b")
def _boundary_over_domain() -> RowAnswer:
    """A uniform f exerts no force, w = y + 0.3 must give 0; the implementation has the boundary integral."""
    inside = -float(WEIGHTS.sum())
    over_rim = _over_rim(NORMALS[1] * (RIM[1] + 0.3))
    over_domain = _over_disk(POINTS[1] / np.hypot(*POINTS) * (POINTS[1] + 0.3))
    implemented = _second_weak_form("y")
    return answer(
        abs(inside + over_domain) < 1e-9,
        corrected=abs(inside + over_rim) < 1e-9 and implemented.holds,
        inside=inside,
        over_rim=over_rim,
        over_domain=over_domain,
        **implemented.values,
    )
