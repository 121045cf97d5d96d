"""Where the article's linear theory is misprinted or mistaken, as data: what it says beside what holds.

Entries whose values are numbers compute them here, so that none can drift from the functions it quotes.
"""

import math
from dataclasses import dataclass
from functools import cache

from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.theory.dispersion import (
    ComplexArray,
    Mode,
    Version,
    count_below,
    growth_rates,
    isolated_modes,
    k2_crit,
    leading_growth_rate,
    printed_3_7,
    wavenumber,
)
from actin_xcheck.theory.growth import amplitude_at_rest


@dataclass(frozen=True)
class Erratum:
    """One place where the article is wrong; several share a number where they have one cause.

    Attributes
    ----------
    number : the cause, 1 to 8.
    where : equation, table, figure or section of the article.
    printed, corrected : what it says and what holds.
    reason : one sentence.
    """

    number: int
    where: str
    printed: str
    corrected: str
    reason: str


@dataclass(frozen=True)
class Table4Row:
    """A row of Table 4 as printed: psi non-dimensional and in dyn/cm^2, and the modes it calls unstable."""

    psi: float
    psi_dimensional: float
    modes: tuple[Mode, ...]

    def model(self, delta: Delta) -> Model:
        """The row's linear model: Table 2 with p = 0.26 (A.1.1) and delta constant."""
        return Model(Parameters(psi=self.psi, p=0.26), delta=delta)


_IN_PRINT = tuple(
    Mode(m, n) for m, n in ((0, 1), (1, 1), (2, 1), (0, 2), (3, 1), (4, 1), (1, 2), (5, 1), (2, 2))
)

TABLE_4_PRINTED = (
    Table4Row(62.439, 72.045, _IN_PRINT[:2]),
    Table4Row(95.327, 109.993, _IN_PRINT[:3]),
    Table4Row(131.869, 152.157, _IN_PRINT[:4]),
    Table4Row(174.767, 201.654, _IN_PRINT[:6]),
    Table4Row(270.094, 311.647, _IN_PRINT[:8]),
    Table4Row(317.758, 366.643, _IN_PRINT[:9]),
)

TABLE_6_PRINTED = (
    (0.00000, 1.84118, 3.05424, 4.20119, 5.31755, 6.41562),
    (3.83170, 5.33144, 6.70613, 8.01524, 9.28240, 10.51986),
    (7.01558, 8.53632, 9.96947, 11.34592, 12.68191, 13.98719),
    (10.17346, 11.70600, 13.17037, 14.58585, 15.96411, 17.31284),
)
"""Table 6 as printed: row n - 1, column m holds j'_{m,n}."""

REALISTIC_CELL = Model(
    DimensionalParameters(psi=6.9e4, p=800.0, E=4000.0, D_a=1.6e-10, k_a=66.0, L=1e-3).non_dimensional(),
    delta=Delta.NONE,
)
"""Section 6's cell, with delta = 0."""


def _pair(rates: ComplexArray) -> str:
    """Two rates as a report prints them: both, or a conjugate pair."""
    if rates[0].imag:
        return f"{rates[0].real:.4f} ± {rates[0].imag:.4f}i"
    return f"{rates[0].real:.4f} and {rates[1].real:.4f}"


def _names(modes: tuple[Mode, ...]) -> str:
    return ", ".join(map(str, modes))


def _linearisation() -> list[Erratum]:
    """Errata 1 and 2 for w1,1 at psi = 62.4, p = 0.26, delta = 1 (Fig. 21) and p's bound in (A.2)."""
    figure_21 = Model(Parameters(psi=62.4, p=0.26), delta=Delta.FULL)
    k2 = wavenumber(1, 1) ** 2
    corrected = _pair(growth_rates(figure_21, k2))
    as_printed = _pair(growth_rates(figure_21, k2, Version.AS_PRINTED))
    stiff = 1 + figure_21.parameters.nu_prime
    arctan = "(3.3) expands arctan a about 0 instead of the steady state a = 1"
    return [
        Erratum(
            1,
            "(3.3), (3.5), (3.6), (3.8)",
            "p and (2/π) p δ",
            "p (1 + δ/2) in place of p, (p/π) δ in place of (2/π) p δ",
            f"{arctan}, where arctan a = π/4 and its slope is 1/2.",
        ),
        Erratum(
            1,
            "Fig. 21, w1,1 at ψ = 62.4, p = 0.26, δ = 1",
            f"λ = {as_printed}",
            f"λ = {corrected}",
            f"{arctan}; the printed value is the root of the printed (3.6).",
        ),
        Erratum(
            1,
            "(A.2), Section 5.1.2",
            f"c(k²) > 0 for p < {stiff:.2f}",
            f"c(k²) > 0 for p < {stiff:.2f} where δ = 0 and p < {stiff / 1.5:.4f} where δ = 1",
            f"{arctan}; Section 5.1.2's p = 1.646 makes every mode unstable where δ = 1.",
        ),
        Erratum(
            2,
            "(3.7), w1,1 at ψ = 62.4, p = 0.26, δ = 1",
            f"λ = {_pair(printed_3_7(figure_21, k2))}",
            f"λ = {as_printed}",
            "(3.7) has k² under the root and in the denominator although (3.6) has divided by it; both "
            "use the printed b and c, but only (3.6) gives the Turing instability (real λ) of A.1.1.",
        ),
    ]


def _table_4() -> list[Erratum]:
    """Erratum 3: rows of Table 4 that are not the modes with b(k^2) < 0 by the article's own (3.8)."""
    found = []
    for row in TABLE_4_PRINTED:
        isolated = isolated_modes(row.model(Delta.NONE), Version.AS_PRINTED)
        low, high = (k2_crit(row.model(delta), Version.AS_PRINTED) for delta in (Delta.NONE, Delta.FULL))
        changes = [f"{mode} (k² = {mode.k**2:.4f}) is missing" for mode in isolated if mode not in row.modes]
        changes += [f"{mode} (k² = {mode.k**2:.4f}) is stable" for mode in row.modes if mode not in isolated]
        if changes:
            reason = f"{' and '.join(changes)}: k²_crit = {low:.4f} (δ = 0) to {high:.4f} (δ = 1) by (3.8)."
            found.append(Erratum(3, f"Table 4, ψ = {row.psi}", _names(row.modes), _names(isolated), reason))
    return found


def _table_6() -> list[Erratum]:
    """Entries of Table 6 that differ from scipy's zeros in the fifth decimal."""
    return [
        Erratum(
            4,
            f"Table 6, j'_{{{m},{n}}}",
            f"{printed:.5f}",
            f"{wavenumber(m, n):.5f}",
            f"cut off instead of rounded: {wavenumber(m, n):.8f}.",
        )
        for n, row in enumerate(TABLE_6_PRINTED, start=1)
        for m, printed in enumerate(row)
        if f"{printed:.5f}" != f"{wavenumber(m, n):.5f}"
    ]


def _squares() -> list[Erratum]:
    """Wave numbers in the captions of Figs. 21 and 22: squares of zeros already rounded."""
    return [
        Erratum(
            4,
            where,
            f"k²_{{{m},1}} = {printed}",
            f"k²_{{{m},1}} = {wavenumber(m, 1) ** 2:.5f}",
            f"j'_{{{m},1}} = {wavenumber(m, 1):.8f} was rounded to five decimals before it was squared.",
        )
        for where, m, printed in (("Figs. 21, 22", 1, "3.38994"), ("Fig. 22", 2, "9.32838"))
    ]


def _numbering() -> list[Erratum]:
    """Erratum 4: what follows from counting j'_{0,1} = 0, and signs and words nearby."""
    at_zero = growth_rates(Model(Parameters(psi=270.0, p=0.0), delta=Delta.NONE), 0.0)[0].real
    return [
        Erratum(
            4,
            "Table 4, all rows",
            "w0,1 is unstable",
            "w0,1 (k = 0) decays with rate -1",
            f"(3.6) is void at k = 0 (it would give {at_zero:.2f} at ψ = 270): a uniform a exerts no force.",
        ),
        Erratum(
            4,
            "A.1.1",
            "k3² := k²_{0,1}",
            f"k3² := k²_{{0,2}} = {wavenumber(0, 2) ** 2:.4f}",
            "A.1 counts the zeros of J0' from j'_{0,1} = 0: the first non-trivial one is j'_{0,2} = 3.83171.",
        ),
        Erratum(4, "Remark A.1", "Δw = k² w", "Δw = -k² w", "a sign is missing; Section A.1 has it right."),
        Erratum(
            4,
            "A.1.2, Fig. 23",
            "Hopf instability: Re λ < 0 and Im λ > 0",
            "damped oscillation",
            "with Re λ < 0 the steady state is stable.",
        ),
        *_squares(),
        Erratum(
            4,
            "A.1.1",
            "any linear combination of eigenmodes solves the eigenvalue problem",
            "it solves the linearised equations (3.3), each part with its own rate",
            f"w0,2 has {wavenumber(0, 2) ** 2:.4f}, w2,1 {wavenumber(2, 1) ** 2:.4f}: no k² fits their sum.",
        ),
        *_table_6(),
    ]


def _simulations() -> list[Erratum]:
    """Errata 5 to 8: what the article says of its runs in the light of the theory."""
    near = Model(Parameters(psi=62.4, p=0.26), delta=Delta.NONE)
    growth = amplitude_at_rest(near, Mode(1, 1), 4 * 1.0228e-2)
    wall = leading_growth_rate(Model(Parameters(psi=62.4, p=0.0), delta=Delta.NONE), 1, 1).real
    cell = REALISTIC_CELL.parameters
    k_crit = math.sqrt(k2_crit(REALISTIC_CELL))
    zeros = count_below(k_crit)
    return [
        Erratum(
            5,
            "Fig. 13, text of Section 5.3",
            "n = 146 (t = 1.493)",
            f"n = 146 (t = {146 * 1.0228e-3:.4f})",
            "146 steps of 1.0228e-3.",
        ),
        Erratum(
            6,
            "Section 6",
            "more than seven wavenumbers",
            f"{zeros.sum()} wavenumbers, {2 * zeros.sum() - zeros[0]} modes with cos and sin",
            f"ψ = {cell.psi:.4g}, μ = {cell.mu:.4g}, d = {cell.d:.3g} give k_crit = {k_crit:.1f} (δ = 0).",
        ),
        Erratum(
            7,
            "Section 5.1",
            "validated against linear theory after two and four steps",
            "a growth rate was never compared",
            f"the initial a has the mode's shape, and four steps let w1,1 grow by only {growth - 1:.1%}.",
        ),
        Erratum(
            8,
            "(3.4), Section 3.3",
            "u is built of eigenfunctions with n·∇w = 0, hence u·n = 0 on the rim",
            "the rim is free to move along its normal (2.1e, f)",
            f"at ψ = 62.4, p = 0 w1,1 grows with {wall:.4f} on the static disk with an irrotational wall, "
            "while all eigenvalues measured on the discretised moving cell are stable: the article's "
            "bifurcation points are not those of its cell.",
        ),
    ]


@cache
def errata() -> tuple[Erratum, ...]:
    """Return all errata by number; their values are computed, except erratum 8's moving cell (by FEM)."""
    return (*_linearisation(), *_table_4(), *_numbering(), *_simulations())
