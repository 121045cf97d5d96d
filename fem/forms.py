"""The weak forms, read off (B.16): test functions w, gradients with respect to the current x."""

from typing import Any

from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, div, dot, grad, sym_grad

from actin_xcheck.core.model import Model


def isotropic(moduli: tuple[float, float], u: Any, w: Any) -> Any:
    """(first eps(u) + second (div u) I) : grad w, for sigma_v (2.3) and sigma_e (2.4) alike."""
    first, second = moduli
    return first * ddot(sym_grad(u), sym_grad(w)) + second * div(u) * div(w)


def network(model: Model, dt: float) -> BilinearForm:
    """A + dt B of (B.23a): viscosity plus the elasticity the step will add."""
    (mu1, mu2), (one, nu_prime) = model.viscous_moduli(), model.elastic_moduli()

    @BilinearForm
    def form(v, w, _):  # type: ignore[no-untyped-def]
        return isotropic((mu1 + dt * one, mu2 + dt * nu_prime), v, w)

    return form


def active_load(model: Model) -> LinearForm:
    """F - B u inside the cell: -f div w - sigma_e(u) : grad w (B.16a,b); fields f and u."""

    @LinearForm
    def form(w, fields):  # type: ignore[no-untyped-def]
        return -fields["f"] * div(w) - isotropic(model.elastic_moduli(), fields["u"], w)

    return form


@LinearForm
def rim_load(w, fields):  # type: ignore[no-untyped-def]
    """The boundary integral of f w.n (B.16a,b): sigma_c and sigma_p do not vanish on the rim."""
    return fields["f"] * dot(fields["n"], w)


def slip_friction(modulus: float) -> BilinearForm:
    """(modulus/R) v_tau w_tau with R = 1: on a circle, curl v = 0 is slip friction.

    With v.n = 0, curl v = 0 is t.sigma_v n = -(mu1/R) v_tau, and likewise t.sigma_e n = -(1/R) u_tau.
    """

    @BilinearForm
    def form(v, w, fields):  # type: ignore[no-untyped-def]
        n = fields["n"]
        return modulus * (n[0] * v[1] - n[1] * v[0]) * (n[0] * w[1] - n[1] * w[0])

    return form


@BilinearForm
def mass(a, w, _):  # type: ignore[no-untyped-def]
    """M of (B.22)."""
    return a * w


@BilinearForm
def stiffness(a, w, _):  # type: ignore[no-untyped-def]
    """K of (B.22)."""
    return dot(grad(a), grad(w))


@LinearForm
def source(w, fields):  # type: ignore[no-untyped-def]
    """Source term s of a manufactured solution."""
    return fields["s"] * w
