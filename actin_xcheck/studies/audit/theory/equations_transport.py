"""Rows of the audit: transport theorem and the weak form of transport, (B.1), (B.8) to (B.14).

Identities are evaluated on smooth fields in the unit disk that moves with the velocity beta.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.fields import (
    LENGTH,
    NORMALS,
    POINTS,
    RIM,
    WEIGHTS,
    divergence,
    gradient,
    identity,
    test_function,
)
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, found
from actin_xcheck.studies.audit.theory.sample import relative, second_step


def _beta(x: Array) -> Array:
    return np.array([0.3 * x[0] + 0.2 * x[1] ** 2, -0.1 * x[0] * x[1] + 0.15])


def _div_beta(x: Array) -> Array:
    return np.asarray(0.3 - 0.1 * x[0])


def _a(x: Array, t: float) -> Array:
    return np.asarray(1 + 0.2 * np.sin(x[0] + 2 * t) * x[1] + 0.1 * x[0] * np.cos(3 * t))


def _a_t(x: Array) -> Array:
    """Partial derivative of a in time at t = 0."""
    return np.asarray(0.4 * np.cos(x[0]) * x[1])


def _transported(g: Callable[[Array, float], Array]) -> float:
    """d/dt at t = 0 of the integral of g over the disk as it moves with beta."""
    h = 1e-3

    def total(t: float) -> float:
        # second order in t is enough for a central difference of points, Jacobians are exact for them
        e, moved = 1e-5, lambda x: x + t * _beta(x)
        columns = [(moved(POINTS + s) - moved(POINTS - s)) / (2 * e) for s in e * np.eye(2)[:, :, None]]
        jacobian = columns[0][0] * columns[1][1] - columns[0][1] * columns[1][0]
        return float(WEIGHTS @ (g(moved(POINTS), t) * jacobian))

    return (8 * (total(h) - total(-h)) - total(2 * h) + total(-2 * h)) / (12 * h)


def _material(x: Array) -> Array:
    """Da/Dt at t = 0 by following the particles."""
    h = 1e-3
    ahead, back = (_a(x + t * _beta(x), t) for t in (h, -h))
    far, early = (_a(x + t * _beta(x), t) for t in (2 * h, -2 * h))
    return (8 * (ahead - back) - far + early) / (12 * h)


def _at_start(x: Array) -> Array:
    return _a(x, 0.0)


def _advected(x: Array) -> Array:
    """grad a . beta at t = 0."""
    return np.asarray((gradient(_at_start, x) * _beta(x)).sum(axis=0))


def _flux(x: Array) -> Array:
    """a beta at t = 0."""
    return _at_start(x) * _beta(x)


def _reynolds() -> Finding:
    left = _transported(_a)
    right = float(WEIGHTS @ (_material(POINTS) + _at_start(POINTS) * _div_beta(POINTS)))
    return identity("Disk carried by a non-linear β, g a smooth field", left, right, "The theorem holds.")


def _restated() -> Finding:
    """(B.8) integrated over the moving disk with the residual of an arbitrary a as a source."""
    diffusion = divergence(partial(gradient, _at_start, step=1e-2), POINTS, 1e-2)
    change = _a_t(POINTS) - 0.4 * diffusion + divergence(_flux, POINTS)
    residual = float(WEIGHTS @ (change - (1 - _at_start(POINTS))))
    rim_flux = float((NORMALS * gradient(_at_start, RIM)).sum() * LENGTH)
    balance = _transported(_a) - 0.4 * rim_flux - float(WEIGHTS @ (1 - _at_start(POINTS)))
    return identity(
        "(B.8) integrated, and d/dt ∫a - d∮n·∇a - ∫(1 - a)",
        residual,
        balance,
        "The same equation as (2.1b); the material cell gains by flux and polymerisation only.",
    )


def _product_rule() -> Finding:
    flux = divergence(_flux, POINTS)
    difference = relative(flux - _advected(POINTS) - _at_start(POINTS) * _div_beta(POINTS), flux)
    return found(
        Judgement.REPRODUCED,
        f"∇·(aβ) and ∇a·β + a∇·β differ by {difference:.1e} at {POINTS.shape[1]} points.",
        "The product rule, nothing lost.",
        holds=difference < 1e-8,
        numbers={"relative difference": difference},
    )


def _material_derivative() -> Finding:
    difference = relative(_material(POINTS) - _a_t(POINTS) - _advected(POINTS), _material(POINTS))
    return found(
        Judgement.REPRODUCED,
        f"The rate of a along particle paths and ∂a/∂t + ∇a·β differ by {difference:.1e}.",
        "This is the derivative along the flow.",
        holds=difference < 1e-8,
        numbers={"relative difference": difference},
    )


def _material_form() -> Finding:
    partial_form = _a_t(POINTS) + divergence(_flux, POINTS)
    difference = relative(
        _material(POINTS) + _at_start(POINTS) * _div_beta(POINTS) - partial_form, partial_form
    )
    return found(
        Judgement.REPRODUCED,
        f"Da/Dt + a∇·β and ∂a/∂t + ∇·(aβ) differ by {difference:.1e}; the other terms are unchanged.",
        "(B.10) in (B.9).",
        holds=difference < 1e-8,
        numbers={"relative difference": difference},
    )


def _test_function_moves() -> float:
    """The integral of a Dw/Dt for the steady w."""
    return float(WEIGHTS @ (gradient(test_function, POINTS) * _flux(POINTS)).sum(axis=0))


def _weak_rate(rewritten: bool) -> Finding:
    """(B.12), (B.13): D/dt read as D/Dt and as the partial derivative."""
    dilution = float(WEIGHTS @ (_at_start(POINTS) * test_function(POINTS) * _div_beta(POINTS)))
    truth = _transported(lambda x, t: _a(x, t) * test_function(x)) - _test_function_moves()
    material = float(WEIGHTS @ (test_function(POINTS) * _material(POINTS))) + dilution
    as_partial = float(WEIGHTS @ (test_function(POINTS) * _a_t(POINTS))) + dilution
    symbol = "D(aw)/∂t - a Dw/∂t" if rewritten else "w Da/∂t"
    return found(
        Judgement.MISPRINT,
        f"The rate term must equal d/dt ∫aw - ∫a Dw/Dt = {truth:.6f}: with D/Dt it is {material:.6f}, with"
        f" ∂/∂t {as_partial:.6f}.",
        f"{symbol} is printed with ∂t below D: only the material derivative D/Dt, as in (B.11) and (B.14),"
        " satisfies it.",
        holds=abs(as_partial - truth) < 1e-6,
        corrected=abs(material - truth) < 1e-6,
        numbers={"D/Dt": material, "partial": as_partial, "required": truth},
    )


def _conservative_form() -> Finding:
    left = _transported(lambda x, t: _a(x, t) * test_function(x))
    right = (
        float(WEIGHTS @ (test_function(POINTS) * (_material(POINTS) + _at_start(POINTS) * _div_beta(POINTS))))
        + _test_function_moves()
    )
    return identity(
        "d/dt ∫aw against ∫w(Da/Dt + a∇·β) + ∫a Dw/Dt",
        left,
        right,
        "(B.11) times w, integrated, with (B.1); diffusion, growth and their signs are those of (B.12).",
    )


def _weak_step(place: str) -> Finding:
    """The implementation's step of the weak transport equation, whose Dw/Dt vanishes."""
    step = second_step()
    rate = (step.after.mass() @ step.new.a - step.before.mass() @ step.old.a) / step.dt
    d = step.model.parameters.d
    rest = step.before.load() - (d * step.after.stiffness() + step.after.mass()) @ step.new.a
    difference = relative(rate - rest, step.before.load())
    note = " The last integral prints a for a_h; it vanishes by (B.19)." if place == "B.16c" else ""
    return found(
        Judgement.REPRODUCED,
        f"One step for all 145 nodal test functions: d/dt ∫aw + ∫(d∇a·∇w + aw) - ∫w = {difference:.1e}"
        " of ∫w.",
        f"Basis functions move with the mesh, so that ∫a Dw/Dt = 0 and what remains is solved.{note}",
        holds=difference < ROUND_OFF,
        numbers={"residual": difference},
    )


TRANSPORT_FORMS: tuple[Row, ...] = (
    Row("eqB.1", _reynolds),
    Row("eqB.8", _restated),
    Row("eqB.9", _product_rule),
    Row("eqB.10", _material_derivative),
    Row("eqB.11", _material_form),
    Row("eqB.12", partial(_weak_rate, False)),
    Row(
        "eqB.13",
        partial(_weak_rate, True),
    ),
    Row("eqB.14", _conservative_form),
    Row("eqB.15c", partial(_weak_step, "B.15c")),
    Row(
        "eqB.16c",
        partial(_weak_step, "B.16c"),
    ),
)
