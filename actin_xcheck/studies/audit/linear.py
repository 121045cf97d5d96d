"""Rows of the audit: linear stability, (3.3) to (3.9), (A.1), (A.2), Remark A.1; borders of modes."""

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.studies.audit import RowAnswer, answer, examines
from actin_xcheck.studies.audit.sample import ROUND_OFF, circle, disk_quadrature
from actin_xcheck.theory.dispersion import (
    Mode,
    Version,
    active_slope,
    coefficients,
    growth_rates,
    isolated_modes,
    k2_crit,
    printed_3_7,
    sigma_prime,
    stiffness,
    wavenumber,
)
from actin_xcheck.theory.eigenfields import cell_eigenfield
from actin_xcheck.theory.errata import TABLE_6_PRINTED
from actin_xcheck.theory.exact import DiskModes

W11, W21, W02 = Mode(1, 1), Mode(2, 1), Mode(0, 2)

CONSTANT = (Delta.NONE, Delta.FULL)

VERSIONS = tuple(product(CONSTANT, Version))
"""What a statement about (3.6) is examined for: either constant delta, as printed and corrected."""

PRINTED, CORRECTED = Version.AS_PRINTED, Version.CORRECTED

_NEAR = Model(Parameters(62.4, 0.26), delta=Delta.FULL)
"""The article's bifurcation point, in the ring."""

_RATES, _SQUARES = np.array([1.5 + 0.3j, -0.7, 0.2 - 2j]), np.array([3.4, 9.3, 0.6])
"""Rates and wave numbers at which determinants are compared."""


def linear_model(psi: float, p: float, delta: Delta) -> Model:
    """Return Table 2's model at another psi and p, delta constant."""
    return Model(Parameters(psi, p), delta=delta)


def leading(psi: float, p: float, delta: Delta, version: Version, mode: Mode = W11) -> complex:
    """Return a mode's leading rate by (3.6)."""
    return complex(growth_rates(linear_model(psi, p, delta), mode.k**2, version)[0])


def isolated(psi: float, p: float) -> list[tuple[Mode, ...]]:
    """Return the modes with b < 0 for each of `VERSIONS`."""
    return [isolated_modes(linear_model(psi, p, delta), version) for delta, version in VERSIONS]


def kind(psi: float, p: float, delta: Delta, version: Version, mode: Mode = W11) -> str:
    """Return what a mode does: "stable", "damped" (the article's Hopf), "oscillatory" or "real" (Turing)."""
    rate = leading(psi, p, delta, version, mode)
    if rate.real < 0:
        return "damped" if rate.imag else "stable"
    return "oscillatory" if rate.imag else "real"


@dataclass(frozen=True)
class Borders:
    """The psi at which a mode starts to oscillate, to grow, and to grow without oscillation."""

    damped: float
    neutral: float
    real: float


def borders(p: float, delta: Delta, version: Version, mode: Mode = W11) -> Borders:
    """Return a mode's borders at pressure p from the double roots of (3.6), counted on either side.

    ArithmeticError where the roots do not change character there.
    """
    still = linear_model(0.0, p, delta)
    par, e = still.parameters, stiffness(still, version)
    decay = par.mu * (1 + par.d * mode.k**2)
    slopes = (math.sqrt(decay) - math.sqrt(e)) ** 2, decay + e, (math.sqrt(decay) + math.sqrt(e)) ** 2
    per_psi, at_rest = sigma_prime(Parameters(1.0, p)), active_slope(still, version)
    psi = [(slope - at_rest) / per_psi for slope in slopes]
    sides = [kind(at * (1 + shift), p, delta, version, mode) for at in psi for shift in (-1e-6, 1e-6)]
    if sides != ["stable", "damped", "damped", "oscillatory", "oscillatory", "real"]:
        raise ArithmeticError(f"{mode} at p = {p:g}: {sides}")
    return Borders(*psi)


def _slopes(model: Model) -> tuple[float, float]:
    """Derivatives in a and phi of the model's active stress at a = 1, phi = 0, numerically, to about 1e-9."""
    delta, one, zero, h = float(model.delta is Delta.FULL), np.array(1.0), np.array(0.0), 1e-5
    f = model.active_stress
    return (
        float((f(one + h, zero, delta) - f(one - h, zero, delta)) / (2 * h)),
        float((f(one, zero + h, delta) - f(one, zero - h, delta)) / (2 * h)),
    )


@examines("eq3.3")
def _linearised() -> RowAnswer:
    (in_a, in_phi), p = _slopes(_NEAR), _NEAR.parameters.p
    sigma = sigma_prime(_NEAR.parameters)
    printed = max(abs(in_a - sigma - 2 / np.pi * p), abs(in_phi + p))
    ours = max(
        abs(in_a - active_slope(_NEAR)), abs(in_phi - stiffness(_NEAR) + 1 + _NEAR.parameters.nu_prime)
    )
    return answer(
        printed < 1e-6,
        corrected=ours < 1e-6,
        in_a=in_a,
        in_phi=in_phi,
        excess=in_a - sigma,
        printed_in_a=2 / np.pi * p,
        printed_in_phi=-p,
        printed=printed,
        ours=ours,
    )


@examines("eq3.4")
def _eigenfunctions() -> RowAnswer:
    """What (3.4) with the modes of A.1 says of the rim, against the moving cell's own modes."""
    x, n, _ = circle()
    along = float(np.abs((n * W11.gradient(x)).sum(axis=0)).max())
    modes = DiskModes(linear_model(270.0, 0.0, Delta.NONE), 1)
    field = cell_eigenfield(modes, complex(modes.rates(0.0)[0]))
    inside, _ = disk_quadrature()
    moves = float(np.abs((n * field.u(x)).sum(axis=0)).max() / np.hypot(*field.u(inside)).max())
    near = replace(_NEAR, delta=Delta.NONE)
    wall, normal, free = (
        sum(DiskModes(replace(near, closure=closure), m).count(0.0) for m in range(4))
        for closure in (Closure.IRROTATIONAL_WALL, Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE)
    )
    return answer(
        along > 1e-3 or wall == normal == free,
        corrected=moves > 1e-3 and wall > 0 == normal,
        along=along,
        moves=moves,
        wall=wall,
        normal=normal,
        free=free,
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


def _printed_determinant() -> Any:
    p = _NEAR.parameters.p
    return _determinant(p, sigma_prime(_NEAR.parameters) + p * 2 / np.pi)


def _true_determinant() -> Any:
    in_a, in_phi = _slopes(_NEAR)
    return _determinant(-in_phi, in_a)


def _polynomial(version: Version) -> Any:
    b, c = coefficients(_NEAR, _SQUARES, version)
    return _SQUARES * (_NEAR.parameters.mu * _RATES**2 + b * _RATES + c)


def _off(value: Any, truth: Any) -> float:
    return float(np.abs(value / truth - 1).max())


@examines("eq3.5")
def _dispersion_matrix() -> RowAnswer:
    printed, ours = (
        _off(one, _true_determinant()) for one in (_printed_determinant(), _polynomial(CORRECTED))
    )
    algebra = _off(_printed_determinant(), _polynomial(PRINTED))
    corrected = ours < 1e-6 and algebra < ROUND_OFF
    return answer(printed < 1e-6, corrected=corrected, algebra=algebra, printed=printed, ours=ours)


@examines("eq3.6")
def _dispersion_polynomial() -> RowAnswer:
    off = {version: _off(_polynomial(version), _true_determinant()) for version in Version}
    pairs = {version: coefficients(_NEAR, W11.k**2, version) for version in Version}
    return answer(off[PRINTED] < 1e-6, corrected=off[CORRECTED] < 1e-6, pairs=pairs, off=off)


@examines("eq3.7")
def _dispersion_relation() -> RowAnswer:
    k2 = np.array([W11.k**2])
    (b, c), mu = coefficients(_NEAR, k2, PRINTED), _NEAR.parameters.mu
    printed, roots = printed_3_7(_NEAR, k2)[:, 0], growth_rates(_NEAR, k2, PRINTED)[:, 0]
    left, ours = (float(np.abs(mu * z**2 + b * z + c).max() / np.abs(b * z).max()) for z in (printed, roots))
    return answer(left < 1e-9, corrected=ours < 1e-9, printed=printed, left=left, roots=roots, ours=ours)


@examines("eq3.8")
def _b_negative() -> RowAnswer:
    par, (in_a, in_phi) = _NEAR.parameters, _slopes(_NEAR)
    truth = -(1 + par.nu_prime + par.mu + in_phi - in_a) / (par.mu * par.d)
    printed, ours = k2_crit(_NEAR, PRINTED), k2_crit(_NEAR)
    return answer(
        abs(printed - truth) < 1e-6,
        corrected=abs(ours - truth) < 1e-6,
        G=-printed * par.mu * par.d,
        printed=printed,
        ours=ours,
    )


@examines("eq3.9")
def _slope_of_contractility() -> RowAnswer:
    worst = 0.0
    for a_sat in (0.3, 0.5, 1.1, 1.4):
        par = Parameters(62.4, 0.26, a_sat=a_sat)
        contractility: Any = Model(par).contractility  # plain arithmetic: takes the complex step
        slope = contractility(np.array(1 + 1e-30j)).imag / 1e-30
        worst = max(worst, abs(sigma_prime(par) - slope) / par.psi)
    return answer(worst < ROUND_OFF, sigma=sigma_prime(_NEAR.parameters), worst=worst)


def _bessel_slope(m: int, z: Array) -> Array:
    """J_m'(z) from Bessel's integral, apart from any library."""
    t = 2 * np.pi * np.arange(256) / 256
    return np.asarray((np.sin(t) * np.sin(m * t - np.multiply.outer(z, np.sin(t)))).mean(axis=-1))


@examines("eqA.1")
def _wavenumbers() -> RowAnswer:
    count, orders = len(TABLE_6_PRINTED), len(TABLE_6_PRINTED[0])
    zeros = [np.array([wavenumber(m, n) for n in range(1, count + 1)]) for m in range(orders)]
    worst = max(float(np.abs(_bessel_slope(m, z)).max()) for m, z in enumerate(zeros))
    scan = np.arange(1, 1801) / 100.0  # no zero of another number in between
    changes = [
        int((np.diff(np.sign(_bessel_slope(m, scan[scan < z[-1] + 0.01]))) != 0).sum())
        for m, z in enumerate(zeros)
    ]
    complete = changes == [count - (m == 0) for m in range(orders)]
    return answer(worst < ROUND_OFF and complete, count=count * orders, worst=worst, changes=changes)


@examines("eqA.2")
def _pressure_bound() -> RowAnswer:
    printed = 1 + _NEAR.parameters.nu_prime
    bounds = []
    for delta in CONSTANT:
        one, two = (stiffness(linear_model(62.4, p, delta)) for p in (0.0, 1.0))
        bounds.append(one / (one - two))  # the stiffness is linear in p
    inner, ring = bounds
    sign = printed + _slopes(linear_model(62.4, 1.646, Delta.FULL))[1]
    return answer(
        abs(ring - printed) < 1e-9 and sign > 0,
        corrected=abs(inner - printed) < 1e-9 and abs(1.5 * ring - printed) < 1e-9 and sign < 0,
        inner=inner,
        ring=ring,
        sign=sign,
    )


@examines("remarkA.1")
def _helmholtz() -> RowAnswer:
    x, h = np.array([[0.3, -0.5, 0.1], [0.2, 0.4, -0.6]]), 1e-3
    ratios = []
    for mode in (W02, W11, Mode(3, 1)):
        w, shifts = mode.value, (np.array([[h], [0.0]]), np.array([[0.0], [h]]))
        laplacian = sum(w(x + s) - 2 * w(x) + w(x - s) for s in shifts) / h**2
        ratios.append(laplacian / w(x) / mode.k**2)
    worst = float(np.abs(np.array(ratios) + 1).max())
    return answer(worst > 1e-3, corrected=worst < 1e-5, worst=worst)
