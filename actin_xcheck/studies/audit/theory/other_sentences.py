"""Rows of the audit: the parameters of Section 6, and sentences of Appendix B."""

from dataclasses import replace

import numpy as np

from actin_xcheck.core.model import Delta
from actin_xcheck.core.parameters import DimensionalParameters
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.figures import W11
from actin_xcheck.studies.audit.theory.measures import found
from actin_xcheck.theory.dispersion import Version, growth_rates, k2_crit
from actin_xcheck.theory.errata import REALISTIC_CELL
from actin_xcheck.theory.modes import Mode, count_below

_CONSTANT = (Delta.NONE, Delta.FULL)


def _label(computed: str, reason: str) -> Finding:
    """A wrong label: nothing to compute."""
    return Finding(Judgement.MISPRINT, computed, reason)


def _reaction_label() -> Finding:
    return _label(
        "(2.1a) is the force balance and (2.1b) the reaction-diffusion equation.",
        "Both are called (2.1a) in the first sentence of the appendices; B.3.1 has it right. B.3 likewise"
        " says that the four stresses are given in (2.3) to (2.5), of which σ_c is (2.2).",
    )


def _weak_solution_label() -> Finding:
    return _label(
        "(B.7) is the weak form of the force balance; (B.15) that of the coupled problem.",
        "u, v is a weak solution of the force balance if (B.7) holds; (B.15) is printed, which adds the"
        " equation for a, although a is assumed known there.",
    )


def _displacement_is_velocity() -> Finding:
    """Powers of (cm, s) of U and of beta."""
    displacement, velocity = np.array([1, 0]), np.array([1, -1])
    off = displacement - velocity
    step = off - np.array([0, 1])
    return found(
        Judgement.MISPRINT,
        f"Displacement over velocity has powers {off.tolist()} of (cm, s), one too many in time; Δt takes it:"
        f" {step.tolist()}.",
        "The interior nodes move with the velocity β = dx/dt, as the bracket says: their displacement per"
        " step is Δt β.",
        holds=not off.any(),
        corrected=not step.any(),
        numbers={"power of s": off[1]},
    )


def _realistic_scaling() -> Finding:
    units = DimensionalParameters(psi=6.9e4, p=800.0, E=4000.0, D_a=1.6e-10, k_a=66.0, L=1e-3)
    par = units.non_dimensional()
    by_hand = {
        "psi": 6.9e4 * 1.3 / 4000,
        "p": 800 * 1.3 / 4000,
        "d": 1.6e-10 / 66 / 1e-6,
        "mu1": 96.15 * 66 * 1.3 / 4000,
        "mu2": 250 * 66 * 1.3 / 4000,
    }
    worst = max(abs(getattr(par, name) / value - 1) for name, value in by_hand.items())
    same = REALISTIC_CELL.parameters == par
    return found(
        Judgement.REPRODUCED,
        f"ψ = {par.psi:.4f}, p = {par.p:.4f}, d = {par.d:.4g}, μ1 = {par.mu1:.4f}, μ2 = {par.mu2:.4f}; 10 µm"
        f" = {10e-4:g} cm.",
        "The scaling (3.1) with L = 0.001 cm; the pressure is Table 2's 0.26 again.",
        holds=worst < 1e-12 and same and units.L == 10e-4,
        numbers={name: getattr(par, name) for name in by_hand},
    )


def _realistic_wavenumbers() -> Finding:
    counts, crit = {}, {}
    for delta in _CONSTANT:
        crit[delta] = float(np.sqrt(k2_crit(replace(REALISTIC_CELL, delta=delta), Version.AS_PRINTED)))
        counts[delta] = count_below(crit[delta])
    zeros = counts[Delta.NONE]
    modes = int(2 * zeros.sum() - zeros[0])
    k41 = Mode(4, 1).k
    rate = growth_rates(REALISTIC_CELL, np.array([k41, W11.k]) ** 2)[0].real
    return found(
        Judgement.REPRODUCED,
        f"k_crit = {crit[Delta.NONE]:.1f} (δ = 0) and {crit[Delta.FULL]:.1f} (δ = 1): {zeros.sum()} wave"
        f" numbers are unstable, {modes} modes with cos and sin, k4,1 = {k41:.3f} among them. w4,1 grows with"
        f" {rate[0]:.4f}, w1,1 with {rate[1]:.4f}.",
        "Literally true, and understated by a factor of thousands: d = 2.4e-6 damps nothing that a mesh can "
        "resolve, all modes grow at nearly the same rate, and nothing but the initial condition selects"
        " w4,1.",
        holds=int(zeros.sum()) > 7 and k41 < crit[Delta.NONE],
        numbers={
            "k_crit": crit[Delta.NONE],
            "wave numbers": zeros.sum(),
            "modes": modes,
            "rate of w4,1": rate[0],
            "rate of w1,1": rate[1],
        },
    )


OTHER_SENTENCES: tuple[Row, ...] = (
    Row(
        "s6-scaling",
        _realistic_scaling,
    ),
    Row(
        "s6-wavenumbers",
        _realistic_wavenumbers,
    ),
    Row(
        "sB-reaction",
        _reaction_label,
    ),
    Row(
        "sB.3.1-solution",
        _weak_solution_label,
    ),
    Row(
        "sB.7-displacement",
        _displacement_is_velocity,
    ),
)
