"""Where the article's linear theory is misprinted or mistaken, as data: what it says beside what holds.

The words stand in `errata.toml`; numbers in them are computed here, so that none can drift from the functions
it quotes.
"""

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

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


def _values() -> dict[str, Any]:
    """What the words of `errata.toml` name; w1,1 is that at psi = 62.4, p = 0.26, delta = 1 (Fig. 21)."""
    figure_21 = Model(Parameters(psi=62.4, p=0.26), delta=Delta.FULL)
    k_11, k_21, k_02 = wavenumber(1, 1), wavenumber(2, 1), wavenumber(0, 2)
    stiff, k_crit = 1 + figure_21.parameters.nu_prime, math.sqrt(k2_crit(REALISTIC_CELL))
    zeros = count_below(k_crit)
    near = figure_21.varied(delta=Delta.NONE)
    return {
        "corrected": _pair(growth_rates(figure_21, k_11**2)),
        "as_printed": _pair(growth_rates(figure_21, k_11**2, Version.AS_PRINTED)),
        "printed_3_7": _pair(printed_3_7(figure_21, k_11**2)),
        **{"stiff": stiff, "stiff_full": stiff / 1.5},
        "at_zero": growth_rates(Model(Parameters(psi=270.0, p=0.0), delta=Delta.NONE), 0.0)[0].real,
        **{"k_11": k_11, "k_21": k_21, "k2_11": k_11**2, "k2_21": k_21**2, "k2_02": k_02**2},
        "t_146": 146 * 1.0228e-3,
        **{"cell": REALISTIC_CELL.parameters, "k_crit": k_crit},
        **{"wavenumbers": zeros.sum(), "modes": 2 * zeros.sum() - zeros[0]},
        "growth": amplitude_at_rest(near, Mode(1, 1), 4 * 1.0228e-2) - 1,
        "wall": leading_growth_rate(near.varied(p=0.0), 1, 1).real,
    }


@cache
def errata() -> tuple[Erratum, ...]:
    """Return all errata by number; their values are computed, except erratum 8's moving cell (by FEM)."""
    written = (files(__package__) / "errata.toml").read_text(encoding="utf-8")
    said, values = tomllib.loads(written)["erratum"], _values()
    words = ("where", "printed", "corrected", "reason")
    found = [Erratum(one["number"], *(one[name].format_map(values) for name in words)) for one in said]
    return tuple(sorted((*found, *_table_4(), *_table_6()), key=lambda one: one.number))
