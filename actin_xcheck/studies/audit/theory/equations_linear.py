"""Rows of the audit: linear stability, (3.3) to (3.9), (A.1), (A.2) and Remark A.1."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, circle, disk_quadrature, found
from actin_xcheck.theory.dispersion import (
    Version,
    active_slope,
    coefficients,
    growth_rates,
    k2_crit,
    printed_3_7,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.eigenfields import cell_eigenfield
from actin_xcheck.theory.errata import TABLE_6_PRINTED
from actin_xcheck.theory.exact import DiskModes
from actin_xcheck.theory.modes import Mode, wavenumber

_NEAR = Model(Parameters(62.4, 0.26), delta=Delta.FULL)
"""The article's bifurcation point, in the ring."""

_RATES, _SQUARES = np.array([1.5 + 0.3j, -0.7, 0.2 - 2j]), np.array([3.4, 9.3, 0.6])
"""Rates and wave numbers at which determinants are compared."""


@dataclass(frozen=True)
class _Slopes:
    """Derivatives of the model's own active stress at a = 1, phi = 0, and what is left of them."""

    in_a: float
    in_phi: float

    @classmethod
    def of(cls, model: Model) -> "_Slopes":
        """Differentiate numerically, to about 1e-9."""
        delta, one, zero, h = float(model.delta is Delta.FULL), np.array(1.0), np.array(0.0), 1e-5
        f = model.active_stress
        return cls(
            float((f(one + h, zero, delta) - f(one - h, zero, delta)) / (2 * h)),
            float((f(one, zero + h, delta) - f(one, zero - h, delta)) / (2 * h)),
        )


def _linearised() -> Finding:
    slopes, p = _Slopes.of(_NEAR), _NEAR.parameters.p
    sigma = sigma_prime(_NEAR.parameters)
    printed = max(abs(slopes.in_a - sigma - 2 / np.pi * p), abs(slopes.in_phi + p))
    ours = max(
        abs(slopes.in_a - active_slope(_NEAR)),
        abs(slopes.in_phi - stiffness(_NEAR) + 1 + _NEAR.parameters.nu_prime),
    )
    return found(
        Judgement.MISPRINT,
        f"At a = 1, φ = 0, δ = 1, p = 0.26 the model's stress has ∂f/∂a - σ'(1) = {slopes.in_a - sigma:.5f}"
        f" and ∂f/∂φ = {slopes.in_phi:.5f}; printed are (2/π)p = {2 / np.pi * p:.5f} and -p = {-p:.5f}.",
        "arctan a is expanded about 0 instead of the steady state a = 1, where it is π/4 with slope 1/2: "
        f"(p/π)δ and p(1 + δ/2) belong there, which agree to {ours:.0e}. With δ = 0 nothing changes.",
        holds=printed < 1e-6,
        corrected=ours < 1e-6,
        numbers={"df/da": slopes.in_a, "df/dphi": slopes.in_phi, "printed off by": printed},
    )


def _eigenfunctions() -> Finding:
    """What (3.4) with the modes of A.1 says of the rim, against the moving cell's own modes."""
    x, n, _ = circle()
    along = float(np.abs((n * Mode(1, 1).gradient(x)).sum(axis=0)).max())
    cell = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
    modes = DiskModes(cell, 1)
    field = cell_eigenfield(modes, complex(modes.rates(0.0)[0]))
    inside, _ = disk_quadrature()
    moves = float(np.abs((n * field.u(x)).sum(axis=0)).max() / np.hypot(*field.u(inside)).max())
    near = replace(_NEAR, delta=Delta.NONE)
    growing = {
        closure: sum(DiskModes(replace(near, closure=closure), m).count(0.0) for m in range(4))
        for closure in (Closure.IRROTATIONAL_WALL, Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE)
    }
    wall, normal, free = growing.values()
    return found(
        Judgement.MISPRINT,
        f"u = C∇w with n·∇w = 0 gives |u·n| = {along:.1e} on the rim; in the moving cell's leading m = 1 mode"
        f" at ψ = 270 it is {moves:.2f} of the largest |u|. At ψ = 62.4, p = 0.26, m = 0 to 3, rates with Re"
        f" λ > 0 number {wall} on the static wall, {normal} in the cell with normal motion, {free} in the"
        " traction-free cell.",
        "Modes built on n·∇w = 0 hold the rim fixed, which (2.1e) and (2.1f) do not. (3.6) is exact for v·n ="
        " 0 and curl v = 0 on a static disk only; the cell needs modes that satisfy its own rim conditions.",
        holds=along > 1e-3 or wall == normal == free,
        corrected=moves > 1e-3 and wall > 0 == normal,
        numbers={"wall": wall, "normal": normal, "free": free, "rim motion": moves},
    )


def _determinant(p_inside: float, slope: float) -> Any:
    """The determinant of (3.5) with p_inside for p and slope for sigma'(1) + p (2/pi) delta, complex."""
    par, k2 = _NEAR.parameters, _SQUARES
    k = np.sqrt(k2)
    matrix = np.array(
        [
            [_RATES + par.d * k2 + 1, _RATES * 1j * k],
            [-1j * k * slope + 0j, par.mu * k2 * _RATES + k2 * (1 + par.nu_prime) - p_inside * k2],
        ]
    )
    return np.linalg.det(np.moveaxis(matrix, -1, 0))


def _polynomial(version: Version) -> Any:
    b, c = coefficients(_NEAR, _SQUARES, version)
    return _SQUARES * (_NEAR.parameters.mu * _RATES**2 + b * _RATES + c)


def _off(value: Any, truth: Any) -> float:
    return float(np.abs(value / truth - 1).max())


def _printed_determinant() -> Any:
    p = _NEAR.parameters.p
    return _determinant(p, sigma_prime(_NEAR.parameters) + p * 2 / np.pi)


def _true_determinant() -> Any:
    slopes = _Slopes.of(_NEAR)
    return _determinant(-slopes.in_phi, slopes.in_a)


def _dispersion_matrix() -> Finding:
    printed, ours = (
        _off(one, _true_determinant()) for one in (_printed_determinant(), _polynomial(Version.CORRECTED))
    )
    algebra = _off(_printed_determinant(), _polynomial(Version.AS_PRINTED))
    return found(
        Judgement.MISPRINT,
        "At three (λ, k²), ψ = 62.4, p = 0.26, δ = 1: the printed determinant is k² times (3.6) to"
        f" {algebra:.1e}, and differs from that of the model's own slopes by up to {printed:.2%}.",
        "The algebra from (3.3) is right, signs included; p and (2/π)pδ are inherited from it and should be "
        f"p(1 + δ/2) and (p/π)δ, with which the determinants agree to {ours:.0e}.",
        holds=printed < 1e-6,
        corrected=ours < 1e-6 and algebra < ROUND_OFF,
        numbers={"printed off by": printed, "corrected off by": ours, "algebra": algebra},
    )


def _dispersion_polynomial() -> Finding:
    printed, ours = (
        _off(_polynomial(version), _true_determinant()) for version in (Version.AS_PRINTED, Version.CORRECTED)
    )
    (b, c), (b_ours, c_ours) = (
        coefficients(_NEAR, wavenumber(1, 1) ** 2, version)
        for version in (Version.AS_PRINTED, Version.CORRECTED)
    )
    return found(
        Judgement.MISPRINT,
        f"For w1,1 at ψ = 62.4, p = 0.26, δ = 1: b = {b:.4f}, c = {c:.4f} printed, b = {b_ours:.4f}, "
        f"c = {c_ours:.4f} from the model's slopes; the polynomial is off by up to {printed:.2%}.",
        "μdk² + 1 + ν' + μ - σ'(1) is right; p and (2/π)pδ should be p(1 + δ/2) and (p/π)δ, in c too.",
        holds=printed < 1e-6,
        corrected=ours < 1e-6,
        numbers={"b printed": float(b), "b": float(b_ours), "c printed": float(c), "c": float(c_ours)},
    )


def _dispersion_relation() -> Finding:
    k2 = np.array([wavenumber(1, 1) ** 2])
    (b, c), mu = coefficients(_NEAR, k2, Version.AS_PRINTED), _NEAR.parameters.mu
    printed, roots = printed_3_7(_NEAR, k2)[:, 0], growth_rates(_NEAR, k2, Version.AS_PRINTED)[:, 0]
    left, ours = (float(np.abs(mu * z**2 + b * z + c).max() / np.abs(b * z).max()) for z in (printed, roots))
    return found(
        Judgement.MISPRINT,
        f"For w1,1 at ψ = 62.4, p = 0.26, δ = 1 (3.7) gives λ = {printed[0]:.4f}, which leaves {left:.1%} of"
        f" b λ in the printed (3.6); its roots are {roots[0].real:.4f} and {roots[1].real:.4f} ({ours:.0e}"
        " left).",
        "k² stands under the root and in the denominator although (3.6) has already divided by it: "
        "[-b ± √(b² - 4μc)]/(2μ). Only that gives the real λ that A.1.1 calls a Turing instability.",
        holds=left < 1e-9,
        corrected=ours < 1e-9,
        numbers={"Re printed": printed[0].real, "Im printed": printed[0].imag, "leading root": roots[0].real},
    )


def _b_negative() -> Finding:
    model, par = _NEAR, _NEAR.parameters
    slopes = _Slopes.of(model)
    truth = -(1 + par.nu_prime + par.mu + slopes.in_phi - slopes.in_a) / (par.mu * par.d)
    printed, ours = k2_crit(model, Version.AS_PRINTED), k2_crit(model)
    return found(
        Judgement.MISPRINT,
        f"G = {-printed * par.mu * par.d:.4f} and k²_crit = {printed:.4f} as printed, {ours:.4f} from the"
        " model's slopes (ψ = 62.4, p = 0.26, δ = 1).",
        "b < 0 just where μdk² < |G| with G < 0; in G, p + (2/π)pδ = 1.6366 p should be p(1 + δ/2) + (p/π)δ ="
        " 1.8183 p. For δ = 0 (3.8) is exact.",
        holds=abs(printed - truth) < 1e-6,
        corrected=abs(ours - truth) < 1e-6,
        numbers={"k2_crit printed": printed, "k2_crit": ours},
    )


def _slope_of_contractility() -> Finding:
    worst = 0.0
    for a_sat in (0.3, 0.5, 1.1, 1.4):
        par = Parameters(62.4, 0.26, a_sat=a_sat)
        contractility: Any = Model(par).contractility  # plain arithmetic: takes the complex step
        slope = contractility(np.array(1 + 1e-30j)).imag / 1e-30
        worst = max(worst, abs(sigma_prime(par) - slope) / par.psi)
    return found(
        Judgement.REPRODUCED,
        f"σ'(1) = {sigma_prime(Parameters(62.4, 0.26)):.5f} at ψ = 62.4, a_sat = 1.4; for four a_sat it"
        f" differs from the complex-step derivative of σ by {worst:.1e} ψ.",
        "ψ(2 - 1/a_sat) e^{-1/a_sat} is the derivative at a = 1.",
        holds=worst < ROUND_OFF,
        numbers={"difference": worst},
    )


def _bessel_slope(m: int, z: Array) -> Array:
    """J_m'(z) from Bessel's integral, apart from any library."""
    t = 2 * np.pi * np.arange(256) / 256
    return np.asarray((np.sin(t) * np.sin(m * t - np.multiply.outer(z, np.sin(t)))).mean(axis=-1))


def _wavenumbers() -> Finding:
    count, orders = len(TABLE_6_PRINTED), len(TABLE_6_PRINTED[0])
    zeros = [np.array([wavenumber(m, n) for n in range(1, count + 1)]) for m in range(orders)]
    worst = max(float(np.abs(_bessel_slope(m, z)).max()) for m, z in enumerate(zeros))
    scan = np.arange(1, 1801) / 100.0  # no zero of another number in between
    changes = [
        int((np.diff(np.sign(_bessel_slope(m, scan[scan < z[-1] + 0.01]))) != 0).sum())
        for m, z in enumerate(zeros)
    ]
    complete = changes == [count - (m == 0) for m in range(orders)]
    return found(
        Judgement.REPRODUCED,
        f"J_m' from Bessel's integral at the {count * orders} j'_m,n of Table 6: at most {worst:.1e}; sign"
        f" changes up to the fourth: {', '.join(map(str, changes))} for m = 0 to 5.",
        "k_m,n = j'_m,n/R with j'_0,1 = 0 counted first, so that (0, 2) is the first non-trivial zero of"
        " J_0'.",
        holds=worst < ROUND_OFF and complete,
        numbers={"largest |J'|": worst},
    )


def _pressure_bound() -> Finding:
    par = _NEAR.parameters
    printed = 1 + par.nu_prime
    bounds = {}
    for delta in (Delta.NONE, Delta.FULL):
        one, two = (stiffness(Model(Parameters(62.4, p), delta=delta)) for p in (0.0, 1.0))
        bounds[delta] = one / (one - two)  # the stiffness is linear in p
    inner, ring = bounds[Delta.NONE], bounds[Delta.FULL]
    slopes = _Slopes.of(Model(Parameters(62.4, 1.646), delta=Delta.FULL))
    sign = 1 + par.nu_prime + slopes.in_phi
    return found(
        Judgement.MISPRINT,
        f"c(k²) > 0 needs p < {inner:.4f} where δ = 0 but p < {ring:.4f} where δ = 1; at p = 1.646 "
        f"(Section 5.1.2) the ring's 1 + ν' + ∂f/∂φ is {sign:.3f}.",
        "The bound 1 + ν' = 1.75 leaves out arctan 1 = π/4: p(1 + δ/2) < 1 + ν' is right.",
        holds=abs(ring - printed) < 1e-9 and sign > 0,
        corrected=abs(inner - printed) < 1e-9 and abs(1.5 * ring - printed) < 1e-9 and sign < 0,
        numbers={"bound, δ = 0": inner, "bound, δ = 1": ring},
    )


def _helmholtz() -> Finding:
    x, h = np.array([[0.3, -0.5, 0.1], [0.2, 0.4, -0.6]]), 1e-3
    ratios = []
    for mode in (Mode(0, 2), Mode(1, 1), Mode(3, 1)):
        w = mode.value
        shifts = (np.array([[h], [0.0]]), np.array([[0.0], [h]]))
        laplacian = sum(w(x + s) - 2 * w(x) + w(x - s) for s in shifts) / h**2
        ratios.append(laplacian / w(x) / mode.k**2)
    worst = float(np.abs(np.array(ratios) + 1).max())
    return found(
        Judgement.MISPRINT,
        f"Δw/(k² w) by differences at three points for w0,2, w1,1 and w3,1: -1 to {worst:.1e}.",
        "The remark's Δw = k² w lacks the minus sign that the paragraph above it has; its eigenvalues and "
        "eigenfunctions belong to Δw = -k² w.",
        holds=worst > 1e-3,
        corrected=worst < 1e-5,
        numbers={"difference from -1": worst},
    )


LINEAR_EQUATIONS: tuple[Row, ...] = (
    Row(
        "eq3.3",
        _linearised,
    ),
    Row(
        "eq3.4",
        _eigenfunctions,
    ),
    Row("eq3.5", _dispersion_matrix),
    Row(
        "eq3.6",
        _dispersion_polynomial,
    ),
    Row("eq3.7", _dispersion_relation),
    Row(
        "eq3.8",
        _b_negative,
    ),
    Row("eq3.9", _slope_of_contractility),
    Row("eqA.1", _wavenumbers),
    Row("eqA.2", _pressure_bound),
    Row(
        "remarkA.1",
        _helmholtz,
    ),
)
