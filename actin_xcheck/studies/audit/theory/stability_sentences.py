"""Rows of the audit: quantitative sentences of Section 3.3 on linear stability."""

import math
from functools import partial

import numpy as np

from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.figures import W11, borders, linear_model
from actin_xcheck.studies.audit.theory.measures import ROUND_OFF, found, rounds_to
from actin_xcheck.theory.dispersion import (
    Version,
    coefficients,
    growth_rates,
    k2_crit,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.exact import DiskModes
from actin_xcheck.theory.modes import Mode, wavenumber

_CONSTANT = (Delta.NONE, Delta.FULL)


def _void_at_zero() -> Finding:
    """The determinant (3.5) at k = 0 for any rate."""
    worst = 0.0
    for rate in (2.0, -0.7, 1 + 3j):
        par, k = Parameters(62.4, 0.26), 0.0
        slope = sigma_prime(par)
        matrix = np.array(
            [[rate + par.d * k**2 + 1, rate * 1j * k], [-1j * k * slope, k**2 * (par.mu * rate + 1.49)]]
        )
        worst = max(worst, abs(np.linalg.det(matrix)))
    b, c = coefficients(linear_model(270.0, 0.0, Delta.NONE), 0.0)
    root = float(growth_rates(linear_model(270.0, 0.0, Delta.NONE), 0.0)[0].real)
    return found(
        Judgement.REPRODUCED,
        f"At k = 0 the determinant is {worst:.1e} for every λ. The bracket of (3.6) would give λ = {root:.2f}"
        f" at ψ = 270 (b = {b:.2f}, c = {c:.2f}).",
        "(3.6) says nothing at k = 0: a uniform a exerts no force and decays with rate -1.",
        holds=worst == 0,
        numbers={"determinant": worst, "bracket's root": root},
    )


def _c_sign() -> Finding:
    k2 = np.array([wavenumber(1, 1) ** 2, 100.0, 1e4])
    signs = {
        (p, delta, version): np.sign(coefficients(linear_model(62.4, p, delta), k2, version)[1])
        for p in (0.26, 1.1, 1.76, 3.0) for delta in _CONSTANT for version in Version
    }  # fmt: skip
    above = all((s < 0).all() for (p, *_), s in signs.items() if p > 1.75)
    below = all((s > 0).all() for (p, *_), s in signs.items() if p < 1.75)
    return found(
        Judgement.REPRODUCED,
        f"c(k²) at k² = 3.39, 100, 1e4: negative for p = 1.76 and 3.0 ({above}), positive for 0.26 and 1.1"
        f" ({below}), both δ, printed and corrected.",
        "p > 1 + ν' is sufficient for c < 0 in either version; corrected, p > 1.167 is already enough where δ"
        " = 1.",
        holds=above and below,
        numbers={"1 + nu'": 1.75},
    )


def _ranges() -> Finding:
    """Conditions 1 to 3: how many of the wave numbers up to k = 1000 grow."""
    cases = {1: (5.0, 2.0), 2: (62.4, 0.26), 3: (62.4, 2.0)}
    k2 = np.linspace(wavenumber(1, 1), 1000, 4000) ** 2
    growing, signs = {}, {}
    for number, (psi, p) in cases.items():
        model = linear_model(psi, p, Delta.NONE)
        b, c = coefficients(model, k2)
        signs[number] = (bool(b[0] < 0), bool(c[0] < 0))
        growing[number] = float((growth_rates(model, k2)[0].real > 0).mean())
    return found(
        Judgement.REPRODUCED,
        f"Share of wave numbers up to k = 1000 that grow: {growing[1]:.0%} for b > 0, c < 0, {growing[2]:.2%}"
        f" for b < 0, c > 0, {growing[3]:.0%} for both negative.",
        "c < 0 at one wave number is c < 0 at all: infinitely many modes grow. With c > 0 only k² <"
        " k²_crit do.",
        holds=signs == {1: (False, True), 2: (True, False), 3: (True, True)}
        and growing[1] == growing[3] == 1 > growing[2] > 0,
        numbers={f"condition {number}": share for number, share in growing.items()},
    )


def _sufficient() -> Finding:
    """G and k_crit of the two bullets with and without the minus signs, at the article's point."""
    par, p = Parameters(62.4, 0.26), 0.26
    sigma, pressure = sigma_prime(par), p * (1 + 2 / math.pi)
    right, bare = 1 + par.nu_prime + par.mu - sigma - pressure, 1 + par.nu_prime + par.mu * sigma * pressure
    crit = k2_crit(linear_model(62.4, p, Delta.FULL), Version.AS_PRINTED)
    agrees = abs(-right / (par.mu * par.d) - crit) < 1e-9
    return Finding(
        Judgement.UNDECIDABLE if agrees else Judgement.NOT_REPRODUCED,
        f"At ψ = 62.4, p = 0.26, δ = 1 the displayed (3.8) has G = {right:.4f} < 0; read without minus signs"
        f" the bullets would have {bare:.1f} > 0. k²_crit = {crit:.4f} > k²1,1 ="
        f" {wavenumber(1, 1) ** 2:.4f}.",
        "The text at hand lacks the minus signs in both bullets and the third condition, k1² < k²_crit, which"
        " the next sentence speaks of; whether the print or its transcription lost them cannot be told. The"
        " displayed (3.8) with k1² < k²_crit gives b < 0 for w1,1.",
        numbers={"G": right, "without signs": bare},
    )


def _either_large() -> Finding:
    par, k2 = Parameters(1.0, 0.26), wavenumber(1, 1) ** 2
    rest = par.mu * (1 + par.d * k2) + 1 + par.nu_prime
    psi, p = (rest - 0.26) / sigma_prime(par), rest
    below, above = (coefficients(linear_model(psi * s, 0.26, Delta.NONE), k2)[0] for s in (0.999, 1.001))
    low, high = (coefficients(linear_model(0.0, p * s, Delta.NONE), k2)[0] for s in (0.999, 1.001))
    return found(
        Judgement.REPRODUCED,
        f"δ = 0: b(k²1,1) < 0 for ψ > {psi:.3f} at p = 0.26, and for p > {p:.2f} at ψ = 0.",
        f"Either can do it for b alone. But p = {p:.2f} is far beyond 1.75, where c < 0: for finitely many"
        " growing modes σ'(1) must be large.",
        holds=bool(below > 0 > above and low > 0 > high),
        numbers={"psi": psi, "p": p},
    )


def _sigma_at_half() -> Finding:
    values = {a_sat: sigma_prime(Parameters(1.0, 0.0, a_sat=a_sat)) for a_sat in (0.1, 0.3, 0.49, 0.5, 0.51)}
    double = sigma_prime(Parameters(2.0, 0.0)) / sigma_prime(Parameters(1.0, 0.0))
    return found(
        Judgement.REPRODUCED,
        "σ'(1)/ψ: "
        + ", ".join(f"{v:.2e} at a_sat = {a}" for a, v in values.items())
        + f"; doubling ψ gives {double:g} times.",
        "Zero at 1/2, negative below, proportional to ψ.",
        holds=values[0.5] == 0
        and values[0.51] > 0
        and all(values[a] < 0 for a in (0.1, 0.3, 0.49))
        and double == 2,
        numbers={f"a_sat = {a}": v for a, v in values.items()},
    )


def _negative_sigma() -> Finding:
    """a_sat = 0.4: the p that makes b(k_11) negative, against the p that makes c negative."""
    still = Model(Parameters(62.4, 0.0, a_sat=0.4), delta=Delta.FULL)
    k2 = wavenumber(1, 1) ** 2

    def b(p: float) -> float:
        return float(coefficients(still.varied(p=p), k2, Version.AS_PRINTED)[0])

    p = b(0.0) / (b(0.0) - b(1.0))  # b is linear in p
    return found(
        Judgement.REPRODUCED,
        f"a_sat = 0.4, ψ = 62.4, δ = 1, σ'(1) = {sigma_prime(still.parameters):.3f}: b(k²1,1) < 0 needs p >"
        f" {p:.2f}.",
        "A large enough p does it, as the sentence says, but beyond 1.75 c < 0 as well: with a_sat < 1/2 no p"
        " isolates finitely many modes.",
        holds=b(0.99 * p) > 0 > b(1.01 * p),
        numbers={"p": p},
    )


def _above_saturation() -> Finding:
    grid = np.linspace(0.05, 5, 991)
    slope = np.array([sigma_prime(Parameters(1.0, 0.0, a_sat=float(a_sat))) for a_sat in grid])
    same = bool(((slope > 1e-12) == (2 * grid > 1 + 1e-9)).all())
    return found(
        Judgement.REPRODUCED,
        f"σ'(1) > 0 just where 2 a_sat > 1, at {grid.size} values of a_sat: {same}.",
        "The assumption is the condition that actin at rest lies on the rising part of σ.",
        holds=same,
        numbers={"values": grid.size},
    )


def _onset(model: Model, m: int) -> float:
    """The psi from the article's 62.4 to 1000 beyond which a mode of angular number m grows, to 1e-9."""
    low, high = 62.4, 1000.0
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        if DiskModes(model.varied(psi=middle), m).count(0.0):
            high = middle
        else:
            low = middle
    return high


def _bifurcation_point(closure: Closure) -> Finding:
    """The cell's own thresholds at p = 0.26, delta = 0, against the article's 62.4 and its wall's."""
    model = Model(Parameters(0.0, 0.26), closure=closure, delta=Delta.NONE)
    psi = {m: _onset(model, m) for m in (0, 1)}
    printed = borders(0.26, Delta.NONE, W11, Version.CORRECTED).neutral
    return found(
        Judgement.NOT_REPRODUCED,
        f"p = 0.26, δ = 0, '{closure}': ψ* = {psi[0]:.4f} (m = 0) and {psi[1]:.4f} (m = 1);"
        f" w1,1 of the static wall sets in at {printed:.4f}, and the article takes 62.4.",
        "The relation of the static wall does not give the moving cell's bifurcation points: at ψ = 62.4 its"
        " w1,1 decays, and it is m = 0 that grows first. For m = 0 both agree, since n·∇a = 0 alone"
        " fixes it.",
        holds=abs(psi[1] / printed - 1) < 0.05,
        numbers={"m = 0": psi[0], "m = 1": psi[1], "wall, m = 1": printed},
    )


def _discrete() -> Finding:
    zeros = [Mode(m, n).k ** 2 for m in range(6) for n in range(1, 5)]
    gap = float(np.diff(np.sort(zeros)).min())
    return found(
        Judgement.REPRODUCED,
        f"The 24 wave numbers k² of Table 6 are {gap:.3f} or more apart.",
        "Zeros of analytic functions are isolated.",
        holds=gap > 0,
        numbers={"smallest gap": gap},
    )


def _nu_prime() -> Finding:
    nu_prime = Parameters(62.4, 0.26).nu_prime
    e = stiffness(linear_model(62.4, 0.0, Delta.NONE))
    return found(
        Judgement.REPRODUCED,
        f"ν = 0.3 gives ν' = {nu_prime:.6f}, 1 + ν' = {e:.6f}.",
        "ν/(1 - 2ν).",
        holds=rounds_to(nu_prime, "0.75") and abs(e - 1.75) < ROUND_OFF,
        numbers={"nu'": nu_prime},
    )


STABILITY_SENTENCES: tuple[Row, ...] = (
    Row("s3.3-zero", _void_at_zero),
    Row("s3.3-c", _c_sign),
    Row(
        "s3.3-ranges",
        _ranges,
    ),
    Row(
        "s3.3-sufficient",
        _sufficient,
    ),
    Row("s3.3-either", _either_large),
    Row(
        "s3.3-half",
        _sigma_at_half,
    ),
    Row(
        "s3.3-negative",
        _negative_sigma,
    ),
    Row("s3.3-assumption", _above_saturation),
    Row(
        "s3.3-points-normal",
        partial(_bifurcation_point, Closure.REFERENCE_NORMAL),
    ),
    Row(
        "s3.3-points-free",
        partial(_bifurcation_point, Closure.TRACTION_FREE),
    ),
    Row("s3.3.1-discrete", _discrete),
    Row("sA.1.1-nu", _nu_prime),
)
