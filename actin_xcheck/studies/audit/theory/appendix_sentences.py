"""Rows of the audit: quantitative sentences of Appendix A."""

import numpy as np

from actin_xcheck.core.model import Delta
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.figures import W02, W11, W21, borders, kind, linear_model, turns_real
from actin_xcheck.studies.audit.theory.measures import disk_quadrature, found, rounds_to
from actin_xcheck.theory.dispersion import (
    Version,
    coefficients,
    growth_rates,
    isolated_modes,
    k2_crit,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.modes import Mode, modes_below

_CONSTANT = (Delta.NONE, Delta.FULL)


def _lowest() -> Finding:
    first, second = [mode for mode in modes_below(6.0) if mode.k > 0][:2]
    return found(
        Judgement.REPRODUCED,
        f"The lowest non-zero wave number is that of {first}, k = {first.k:.5f}, then {second} with"
        f" {second.k:.5f}; w0,2 has {W02.k:.5f}.",
        "By all zeros below 6, counted and listed.",
        holds=first == W11,
        numbers={"lowest": first.k, "second": second.k},
    )


def _steady_solutions() -> Finding:
    """How near to zero w1,1's rates ever come as psi rises: a steady state bifurcates at lambda = 0 only."""
    rates = np.array(
        [growth_rates(linear_model(psi, 0.26, Delta.NONE), W11.k**2) for psi in np.linspace(0, 120, 1201)]
    )
    product = float(np.prod(rates, axis=1).real.min())
    at_printed = growth_rates(linear_model(62.4, 0.26, Delta.NONE), W11.k**2)[0].real
    neutral = borders(0.26, Delta.NONE, W11, Version.CORRECTED).neutral
    omega = abs(growth_rates(linear_model(neutral, 0.26, Delta.NONE), W11.k**2)[0].imag)
    return found(
        Judgement.NOT_REPRODUCED,
        f"ψ from 0 to 120, p = 0.26: the product of w1,1's two rates is c/μ = {product:.4f} throughout, so"
        f" neither is ever zero. w1,1 sets in at ψ = {neutral:.3f} with frequency {omega:.3f}; at 62.4 it"
        f" grows with {at_printed:.3f}.",
        "Where c > 0 linear theory has no steady non-uniform solution: instability sets in as a growing "
        "oscillation. What is compared in Section 5.1 is the shape of the initial condition.",
        holds=product < 1e-6,
        numbers={"c/mu": product, "onset": neutral, "frequency": omega, "rate at 62.4": at_printed},
    )


def _c_positive() -> Finding:
    signs = {
        (p, delta): stiffness(linear_model(62.4, p, delta))
        for p in (0.26, 1.0, 1.646, 1.74)
        for delta in _CONSTANT
    }
    bad = [
        f"p = {p:g}, δ = {1 if delta is Delta.FULL else 0}: {e:.3f}"
        for (p, delta), e in signs.items()
        if e <= 0
    ]
    bound = 1.75 / 1.5
    ours = all(e > 0 for (p, delta), e in signs.items() if delta is Delta.NONE or p < bound)
    return found(
        Judgement.MISPRINT,
        f"1 + ν' - p(1 + δ/2), whose sign is c's, is not positive for {'; '.join(bad)}.",
        f"True where δ = 0. Where δ = 1 c > 0 needs p < {bound:.4f}, since arctan 1 = π/4.",
        holds=not bad,
        corrected=ours,
        numbers={"bound, δ = 1": bound},
    )


def _with_rising_psi() -> Finding:
    one = borders(0.26, Delta.FULL, W11, Version.AS_PRINTED)
    ours = borders(0.26, Delta.FULL, W11, Version.CORRECTED)
    return found(
        Judgement.REPRODUCED,
        f"p = 0.26, δ = 1, w1,1: damped oscillation from ψ = {one.damped:.2f}, a pair crosses Re λ = 0 at"
        f" {one.neutral:.2f}, real rates from {one.real:.2f} (printed); {ours.damped:.2f},"
        f" {ours.neutral:.2f}, {ours.real:.2f} corrected.",
        "A Hopf bifurcation comes first and real growth later. Between the two lies OS1, which this sentence "
        "leaves out and Fig. 23a shows.",
        holds=0 < one.damped < one.neutral < one.real < 62.4,
        numbers={"damped": one.damped, "Hopf": one.neutral, "real": one.real},
    )


def _typical_psi() -> Finding:
    sets = {
        (delta, version): isolated_modes(linear_model(62.4, 0.26, delta), version)
        for delta in _CONSTANT
        for version in Version
    }
    kinds = {kind(linear_model(62.4, 0.26, delta), W11, version) for delta, version in sets}
    dimensional = 62.4 / DimensionalParameters(psi=1.0, p=0.3).non_dimensional().psi
    alone = all(modes == (Mode(0, 1), W11) for modes in sets.values())
    return found(
        Judgement.REPRODUCED,
        f"ψ = 62.4, p = 0.26: b < 0 for w1,1 alone and its rates are {' and '.join(kinds)}, for both δ,"
        f" printed and corrected; ψ = {dimensional:.4f} dyn/cm².",
        "True of the dispersion relation (3.6), irrespective of δ; (3.7) as printed would give a pair.",
        holds=alone and kinds == {"real"} and rounds_to(dimensional, "72"),
        numbers={"psi, dyn/cm²": dimensional},
    )


def _identical_curves() -> Finding:
    k2 = np.linspace(0.05, 20, 400)
    inner, ring = (linear_model(62.4, 0.26, delta) for delta in _CONSTANT)
    shift = {
        v: float(np.abs(coefficients(inner, k2, v)[0] - coefficients(ring, k2, v)[0]).max()) for v in Version
    }
    gap = {
        v: float(np.abs(growth_rates(inner, k2, v)[0].real - growth_rates(ring, k2, v)[0].real).max())
        for v in Version
    }
    at = [growth_rates(model, W11.k**2, v)[0].real for v in Version for model in (inner, ring)]
    return found(
        Judgement.NOT_REPRODUCED,
        f"δ = 0 and 1 differ by {shift[Version.AS_PRINTED]:.4f} in b (printed; corrected"
        f" {shift[Version.CORRECTED]:.4f}) and by up to {gap[Version.AS_PRINTED]:.4f}"
        f" ({gap[Version.CORRECTED]:.4f}) in Re λ. λ of w1,1: {at[2]:.4f} and {at[3]:.4f} printed,"
        f" {at[0]:.4f} and {at[1]:.4f} corrected.",
        "b differs by (2/π)p at every k²: close on the scale of a plot, not identical.",
        holds=max(shift.values()) < 1e-9,
        numbers={
            "b, printed": shift[Version.AS_PRINTED],
            "Re, printed": gap[Version.AS_PRINTED],
            "Re, corrected": gap[Version.CORRECTED],
        },
    )


def _only_the_first() -> Finding:
    """The isolated sets as psi rises: nested, each with one mode more."""
    sizes = set()
    for psi in np.linspace(0, 400, 2001):
        modes = [
            mode
            for mode in isolated_modes(linear_model(float(psi), 0.26, Delta.FULL), Version.AS_PRINTED)
            if mode.k > 0
        ]
        lowest = [mode for mode in modes_below(20.0) if mode.k > 0][: len(modes)]
        sizes.add((len(modes), modes == lowest))
    nested = all(initial for _, initial in sizes)
    counts = sorted(size for size, _ in sizes)
    return found(
        Judgement.REPRODUCED,
        f"At 2001 ψ from 0 to 400 the wave numbers with b < 0 are always the lowest ones: {nested}; their"
        f" numbers are {', '.join(map(str, counts))}.",
        "b grows with k², so that a wave number is isolated together with all below it.",
        holds=nested and counts[:2] == [0, 1],
        numbers={"largest set": counts[-1]},
    )


def _first_two() -> Finding:
    crit = [k2_crit(linear_model(95.327, 0.26, delta), version) for delta in _CONSTANT for version in Version]
    printed, ours = Mode(0, 1).k ** 2, W02.k**2
    return found(
        Judgement.MISPRINT,
        f"At ψ = 95.327 k_c² is {min(crit):.4f} to {max(crit):.4f}; k²2,1 = {W21.k**2:.4f}, k²0,1 ="
        f" {printed:g}, k²0,2 = {ours:.4f}.",
        "k3² := k²0,1 would be 0, since A.1 counts j'_0,1 = 0; k²0,2 is meant, and with it k2² < k_c² < k3²"
        " holds for both δ.",
        holds=all(W21.k**2 < c < printed for c in crit),
        corrected=all(W21.k**2 < c < ours for c in crit),
        numbers={"k_c², least": min(crit), "k_c², largest": max(crit), "k²0,2": ours},
    )


def _superposition() -> Finding:
    """Best k^2 for Delta w = -k^2 w and what it leaves: w02 + 2 w21, and w21 alone."""
    x, weights = disk_quadrature()

    def left(parts: dict[Mode, float]) -> float:
        w = sum(c * mode.value(x) for mode, c in parts.items())
        laplacian = -sum(c * mode.k**2 * mode.value(x) for mode, c in parts.items())
        best = float(weights @ (laplacian * w)) / float(weights @ w**2)
        return float(np.sqrt(weights @ (laplacian - best * w) ** 2 / (weights @ laplacian**2)))

    mixed, single = left({W02: 1.0, W21: 2.0}), left({W21: 2.0})
    return found(
        Judgement.MISPRINT,
        f"For w = w0,2 + 2w2,1 no k² solves Δw = -k² w: the best leaves {mixed:.1%} of Δw (w2,1 alone:"
        f" {single:.1e}).",
        "Eigenmodes of different wave numbers do not add up to an eigenmode. Their sum solves the linearised"
        " equations (3.3), each part growing at its own rate, which is what mixed modes need.",
        holds=mixed < 1e-9,
        corrected=single < 1e-9 < mixed,
        numbers={"mixed": mixed, "single": single},
    )


def _hopf() -> Finding:
    one = borders(0.8, Delta.FULL, W11, Version.AS_PRINTED)
    psi = (one.damped + one.neutral) / 2
    rate = growth_rates(linear_model(psi, 0.8, Delta.FULL), W11.k**2, Version.AS_PRINTED)[0]
    faster = max(
        growth_rates(linear_model(psi, 0.8, Delta.FULL), mode.k**2, Version.AS_PRINTED)[0].real
        for mode in modes_below(60.0) if mode.k > 0
    )  # fmt: skip
    b = float(coefficients(linear_model(psi, 0.8, Delta.FULL), W11.k**2, Version.AS_PRINTED)[0])
    return found(
        Judgement.MISPRINT,
        f"In the middle of region H at p = 0.8 (ψ = {psi:.2f}) w1,1 has λ = {rate.real:.4f} ±"
        f" {rate.imag:.4f}i and b = {b:.3f} > 0; the largest Re λ of all modes up to k = 60 is {faster:.4f}.",
        "With Re λ < 0 it is no instability but damped oscillation: no wave number is isolated there, and the"
        " uniform state is stable. Oscillatory instability (OS1) is what follows a Hopf bifurcation.",
        holds=faster > 0,
        corrected=faster < 0 and rate.imag > 0,
        numbers={"Re": rate.real, "Im": rate.imag, "largest Re": faster},
    )


def _identical_maps() -> Finding:
    shifts = {}
    for version in Version:
        shifts[version] = [
            borders(p, Delta.NONE, W11, version).neutral - borders(p, Delta.FULL, W11, version).neutral
            for p in (0.26, 0.8, 1.1)
        ]
    per_p = 2 / np.pi / sigma_prime(Parameters(1.0, 0.0))
    printed, ours = shifts[Version.AS_PRINTED], shifts[Version.CORRECTED]
    return found(
        Judgement.NOT_REPRODUCED,
        f"w1,1 sets in earlier with δ = 1, by {', '.join(f'{s:.3f}' for s in printed)} in ψ at p = 0.26, 0.8,"
        f" 1.1 (printed), {', '.join(f'{s:.3f}' for s in ours)} corrected.",
        f"Every border of the printed map moves by (2/π)p/σ'(1) = {per_p:.4f} p, up to {1.74 * per_p:.2f} at"
        " p = 1.74. Corrected, the map for δ = 1 ends at p = 1.167, that for δ = 0 at 1.75.",
        holds=max(map(abs, printed)) < 1e-6,
        numbers={"at p = 0.8, printed": printed[1], "at p = 0.8, corrected": ours[1], "per p": per_p},
    )


def _transition_along_p() -> Finding:
    ring, inner = turns_real(Delta.FULL, Version.AS_PRINTED), turns_real(Delta.NONE, Version.AS_PRINTED)
    ours = turns_real(Delta.FULL, Version.CORRECTED)
    return found(
        Judgement.REPRODUCED,
        "ψ = 38.24: w1,1 grows for every p from 0 to 1.74 and turns from a pair to real rates at p ="
        f" {ring[0]:.3f} (δ = 1), {inner[0]:.3f} (δ = 0); corrected, δ = 1: {ours[0]:.3f}.",
        "One transition, in the direction stated, for both δ.",
        holds=all(0 < p < 1.74 and least > 0 for p, least in (ring, inner)),
        numbers={"δ = 1": ring[0], "δ = 0": inner[0], "δ = 1, corrected": ours[0]},
    )


def _transition_along_psi() -> Finding:
    rows = {(delta, version): borders(0.8, delta, W11, version) for delta in _CONSTANT for version in Version}
    ring, inner = rows[Delta.FULL, Version.AS_PRINTED], rows[Delta.NONE, Version.AS_PRINTED]
    inside = all(one.damped > 30 and one.real < 60 for one in rows.values())
    tail = all(30 < one.neutral < one.real < 60 for one in rows.values())
    return found(
        Judgement.NOT_REPRODUCED,
        f"p = 0.8: w1,1 starts to oscillate at ψ = {ring.damped:.2f} (δ = 1) and {inner.damped:.2f} (δ = 0),"
        f" grows from {ring.neutral:.2f} and {inner.neutral:.2f}, is real from {ring.real:.2f} and"
        f" {inner.real:.2f}. H to OS1 to Turing within 30 to 60: {'yes' if tail else 'no'}.",
        "At ψ = 30 the mode is in H already, so the first of the three transitions is not on this path; it"
        " would be from ψ = 15. In dyn/cm² the path runs from 26 to 52 and misses it too.",
        holds=inside,
        numbers={"H": ring.damped, "OS1": ring.neutral, "Turing": ring.real, "H, δ = 0": inner.damped},
    )


APPENDIX_SENTENCES: tuple[Row, ...] = (
    Row("sA.1-lowest", _lowest),
    Row(
        "sA.1-steady",
        _steady_solutions,
    ),
    Row("sA.1.1-c", _c_positive),
    Row(
        "sA.1.1-rising",
        _with_rising_psi,
    ),
    Row(
        "sA.1.1-typical",
        _typical_psi,
    ),
    Row(
        "sA.1.1-identical",
        _identical_curves,
    ),
    Row(
        "sA.1.1-only-first",
        _only_the_first,
    ),
    Row(
        "sA.1.1-k3",
        _first_two,
    ),
    Row(
        "sA.1.1-superposition",
        _superposition,
    ),
    Row(
        "sA.1.2-hopf",
        _hopf,
    ),
    Row(
        "sA.1.2-identical",
        _identical_maps,
    ),
    Row(
        "sA.1.2-along-p",
        _transition_along_p,
    ),
    Row(
        "sA.1.2-along-psi",
        _transition_along_psi,
    ),
)
