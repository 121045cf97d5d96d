"""Rows of the audit: the force balance in components and its weak forms, (B.2) to (B.7), (B.15), (B.16).

Identities are evaluated on smooth fields in the unit disk, weak forms on one step of the implementation.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.fields import (
    LENGTH,
    NORMALS,
    POINTS,
    RIM,
    WEIGHTS,
    component,
    derivative,
    divergence,
    gradient,
    identity,
    test_function,
)
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, disk_quadrature, found
from actin_xcheck.studies.audit.theory.sample import relative, second_step

_L0, _AXES = 0.8, "xy"


def _g(x: Array) -> Array:
    return np.asarray(np.cos(0.7 * x[0] - 1.1 * x[1]) + x[0] ** 2)


def _constants() -> Finding:
    """D and C against the model's moduli, in dyn/cm^2 and scaled."""
    units = DimensionalParameters(psi=72.0, p=0.3)
    E, nu = units.E, units.nu
    model = Model(units.non_dimensional())
    (mu1, mu2), (one, nu_prime) = model.viscous_moduli(), model.elastic_moduli()
    stress, rate = E / (1 + nu), units.k_a
    pairs = {
        "D11": (units.mu1 + units.mu2, (mu1 + mu2) * stress / rate),
        "D12": (units.mu2, mu2 * stress / rate),
        "D33": (units.mu1 / 2, mu1 / 2 * stress / rate),
        "C11": (E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)), (one + nu_prime) * stress),
        "C12": (E * nu / ((1 + nu) * (1 - 2 * nu)), nu_prime * stress),
        "C33": (E / (2 * (1 + nu)), one / 2 * stress),
    }
    worst = max(abs(ours / printed - 1) for printed, ours in pairs.values())
    values = ", ".join(f"{name} = {printed:.5g}" for name, (printed, _) in pairs.items())
    return found(
        Judgement.REPRODUCED,
        f"With Table 1: {values} (dyn/cm², D in dyn s/cm²); the model's moduli, scaled back, agree to"
        f" {worst:.1e}. In units of (3.1): C11 = 1 + ν', C12 = ν', C33 = 1/2.",
        "D and C are those of (2.3) and (2.4).",
        holds=worst < ROUND_OFF,
        numbers={name: printed for name, (printed, _) in pairs.items()} | {"difference": worst},
    )


def _u(x: Array) -> Array:
    return np.array([np.sin(x[0]) * x[1] + 0.2 * x[0], np.cos(x[1]) + 0.3 * x[0] ** 2 * x[1]])


def _gradients(x: Array) -> Array:
    """du_i/dx_k at points x, (2, 2, n)."""
    return np.array([gradient(component(_u, i), x) for i in range(2)])


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


def _decoupled(row: int) -> Finding:
    """Divergence of the stress of (B.2) against that of (2.4)."""
    x = np.array([[0.3, -0.5, 0.1], [0.2, 0.4, -0.6]])
    truth = divergence(partial(_tensor, row), x, 1e-2)
    difference = relative(divergence(partial(_stress, row), x, 1e-2) - truth, truth)
    return found(
        Judgement.REPRODUCED,
        f"Its left side differs from the {_AXES[row]} component of ∇·(ε + ν'φI) by {difference:.1e} at three"
        " points of a smooth field; the viscous terms have the same form.",
        "The component is that of (2.1a) with f on the right.",
        holds=difference < 1e-9,
        numbers={"relative difference": difference},
    )


def _first_weak_form(row: int) -> Finding:
    """Green's identity: the two sides of (B.3) differ by the traction that (2.1f) sets to zero."""
    left = float(WEIGHTS @ (gradient(test_function, POINTS) * _stress(row, POINTS)).sum(axis=0))
    traction = float((test_function(RIM) * (NORMALS * _stress(row, RIM)).sum(axis=0)).sum() * LENGTH)
    right = -float(WEIGHTS @ (test_function(POINTS) * divergence(partial(_stress, row), POINTS, 1e-2)))
    return identity(
        f"∫∇w·σ less ∮ w σn ({traction:.6f}) against ∫ w ∂f/∂{_AXES[row]} with ∇f = -∇·σ",
        left - traction,
        right,
        "The sign and all coefficients are right; the traction drops where (2.1f) holds.",
    )


def _f(delta: float, x: Array) -> Array:
    """The active stress of a smooth concentration, without dilation."""
    a = 1 + 0.2 * x[0] + 0.1 * x[1]
    return Model(Parameters(62.4, 0.26)).active_stress(a, np.zeros_like(a), delta)


def _active_terms() -> Finding:
    """The bracket of (B.4) against the model; its derivative exists off the ring only."""
    a, phi = np.array([0.5, 1.0, 2.0]), np.array([0.1, -0.2, 0.0])
    model = Model(Parameters(62.4, 0.26))
    by_hand = 0.26 / (1 + phi) * (1 + 2 / np.pi * np.arctan(a)) + 62.4 * a**2 * np.exp(-a / 1.4)
    difference = relative(model.active_stress(a, phi, 1.0) - by_hand, by_hand)
    ring = _L0 * NORMALS
    jump = _f(1.0, ring) - _f(0.0, ring)
    return found(
        Judgement.REPRODUCED,
        f"f1 = f2 is the model's active stress to {difference:.1e}. Across |ξ| = 0.8 it jumps by"
        f" {jump.min():.4f} to {jump.max():.4f} for the a of this row.",
        "Written out correctly; ∂f/∂x holds a line source on the ring, as the article says below it.",
        holds=difference < ROUND_OFF,
        numbers={"relative difference": difference, "largest jump": float(jump.max())},
    )


def _green() -> Finding:
    def sides(k: int) -> tuple[float, float]:
        left = float(WEIGHTS @ (test_function(POINTS) * derivative(_g, k, POINTS)))
        inside = float(WEIGHTS @ (_g(POINTS) * derivative(test_function, k, POINTS)))
        return left, float((NORMALS[k] * test_function(RIM) * _g(RIM)).sum() * LENGTH) - inside

    pairs = [sides(k) for k in range(2)]
    worst = max(abs(left - right) for left, right in pairs)
    return found(
        Judgement.REPRODUCED,
        f"On the disk for two smooth fields the sides differ by {worst:.1e}, with ∫ r ∂g/∂x ="
        f" {pairs[0][0]:.6f} and ∫ r ∂g/∂y = {pairs[1][0]:.6f}.",
        "Both identities hold. Class C⁰ as stated is not enough, since the derivatives must be integrable.",
        holds=worst < 1e-8,
        numbers={"difference": worst},
    )


def _split() -> Finding:
    """The x component of (B.6) in the sense that (B.7) uses, with and without the jump's own contribution."""
    inner, outer = disk_quadrature(0.0, _L0), disk_quadrature(_L0, 1.0)

    f0, f1 = (partial(_f, delta) for delta in (0.0, 1.0))

    whole = -sum(
        float(w @ (f(x) * derivative(test_function, 0, x))) for f, (x, w) in ((f0, inner), (f1, outer))
    )
    whole += LENGTH * float((NORMALS[0] * f1(RIM) * test_function(RIM)).sum())
    regions = sum(
        float(w @ (test_function(x) * derivative(f, 0, x))) for f, (x, w) in ((f0, inner), (f1, outer))
    )
    ring = _L0 * NORMALS
    traction = _L0 * LENGTH * float((NORMALS[0] * (f1(ring) - f0(ring)) * test_function(ring)).sum())
    return found(
        Judgement.MISPRINT,
        f"∫ w ∂f/∂x, as (B.7) integrates it, is {whole:.6f}; the regions δ = 0 and δ = 1 give {regions:.6f},"
        f" and ∮ [f] w n_x over |ξ| = 0.8 gives {traction:.6f}, in sum {regions + traction:.6f}.",
        "The third integral is this line integral. With 'δ = 0 at the region of discontinuity' it would be "
        "an ordinary integral over a set without area, hence zero, and f would still not be continuous; the "
        "traction [f] n is what expands or contracts the cell.",
        holds=abs(whole - regions) < 1e-7,
        corrected=abs(whole - regions - traction) < 1e-7,
        numbers={"whole": whole, "regions": regions, "ring": traction},
    )


def _second_weak_form(row: int, discrete: bool) -> Finding:
    """The implementation's load and stress against (B.7), (B.15), (B.16) by hand, one component."""
    step = second_step()
    count = step.old.x.shape[1]
    u = step.displacements()[0]
    load = step.balance.assemble(step.old.x, step.old.a[step.mesh.triangles], 0.0).load
    by_hand = step.force() - step.elasticity() @ u
    part = slice(row * count, (row + 1) * count)
    difference = relative((load.reshape(-1, 2).T.ravel() - by_hand)[part], by_hand[part])
    what = "for all nodal w_h" if discrete else "for all piecewise linear w"
    return found(
        Judgement.REPRODUCED,
        f"The implementation's right side less elasticity, {what}, differs from -∫ f ∂w/∂{_AXES[row]} + ∮ n f"
        f" w - ∫ ∇w·σ_e assembled by hand by {difference:.1e}; δ jumps inside.",
        "The boundary term is there because σ_c and σ_p do not vanish on the rim; over the whole Ω_t, with f "
        "not differentiated, the ring's traction is included.",
        holds=difference < ROUND_OFF,
        numbers={"relative difference": difference},
    )


def _boundary_over_domain() -> Finding:
    """A uniform f exerts no force: w = y + 0.3 must give 0."""
    inside = -float(WEIGHTS.sum())
    over_rim = float((NORMALS[1] * (RIM[1] + 0.3)).sum() * LENGTH)
    n2 = POINTS[1] / np.hypot(*POINTS)
    over_domain = float(WEIGHTS @ (n2 * (POINTS[1] + 0.3)))
    return found(
        Judgement.MISPRINT,
        f"Uniform f = 1, w = y + 0.3: -∫ ∂w/∂y = {inside:.4f}; the boundary integral adds {over_rim:.4f}, the"
        f" integral over Ω as printed, n continued along rays, {over_domain:.4f}.",
        "A uniform f exerts no force only if the last integral runs over ∂Ω, ds, as in the first "
        "component; over Ω it would scale with the square of the length, the left side with the length.",
        holds=abs(inside + over_domain) < 1e-9,
        corrected=abs(inside + over_rim) < 1e-9,
        numbers={"over the rim": over_rim, "over the domain": over_domain},
    )


def _second_component(discrete: bool) -> Finding:
    """(B.15b) and (B.16b): the misprint, and that the implementation has the boundary integral."""
    misprint, implemented = _boundary_over_domain(), _second_weak_form(1, discrete)
    agrees = implemented.judgement is Judgement.REPRODUCED
    return found(
        Judgement.MISPRINT,
        f"{misprint.computed} {implemented.computed}",
        misprint.reason,
        holds=misprint.judgement is Judgement.REPRODUCED,
        corrected=misprint.judgement is Judgement.MISPRINT and agrees,
        numbers={**misprint.numbers, **implemented.numbers},
    )


def _weak(row: int, discrete: bool) -> Callable[[], Finding]:
    return partial(_second_weak_form, row, discrete)


WEAK_FORMS: tuple[Row, ...] = (
    Row(
        "eqB.2",
        _constants,
    ),
    Row("eqB.2a", partial(_decoupled, 0)),
    Row("eqB.2b", partial(_decoupled, 1)),
    Row("eqB.3a", partial(_first_weak_form, 0)),
    Row("eqB.3b", partial(_first_weak_form, 1)),
    Row(
        "eqB.4",
        _active_terms,
    ),
    Row("eqB.5", _green),
    Row(
        "eqB.6",
        _split,
    ),
    Row("eqB.7a", _weak(0, False)),
    Row("eqB.7b", _weak(1, False)),
    Row(
        "eqB.15a",
        _weak(0, False),
    ),
    Row(
        "eqB.15b",
        partial(_second_component, False),
    ),
    Row("eqB.16a", _weak(0, True)),
    Row(
        "eqB.16b",
        partial(_second_component, True),
    ),
)
