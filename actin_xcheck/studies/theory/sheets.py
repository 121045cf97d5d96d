"""Tables of a theory report: exact modes, thresholds, the finite elements' own spectrum, errata."""

from dataclasses import replace

from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.runs.spectra import discrete_rates, discrete_threshold
from actin_xcheck.theory.errata import TABLE_4_PRINTED, errata
from actin_xcheck.theory.exact import DiskModes
from actin_xcheck.theory.threshold import lowest, threshold

CELLS = (Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE)
"""Closures of the moving cell; `current-normal` is the same as `reference-normal` to first order."""

NUMBERS = range(5)
_SPECTRUM = ((0, 270.0), (1, 270.0), (2, 270.0), (3, 300.0), (4, 500.0))
"""Angular numbers with a psi at which each grows."""

_MESHES = (4, 5, 6)
_PRINTED = 62.4
"""Where the article has w1,1 alone grow at p = 0.26 (A.1.1, Table 4), and computes a cell."""


def modes_sheet() -> Sheet:
    """Return the leading growing rate per angular number at the psi of Table 4, for three closures."""
    rows = [("ψ", "closure", *(f"m = {m}" for m in NUMBERS))]
    for psi in (row.psi for row in TABLE_4_PRINTED):
        for closure in (Closure.IRROTATIONAL_WALL, *CELLS):
            model = Model(Parameters(psi, 0.26), closure=closure, delta=Delta.NONE)
            leading = [DiskModes(model, m).rates(0.0)[:1] for m in NUMBERS]
            rows.append(
                (f"{psi:g}", closure, *(_rate(complex(r[0])) if len(r) else "decay" for r in leading))
            )
    return Sheet(
        "modes",
        "Growing modes at the ψ of Table 4",
        "p = 0.26, δ = 0; leading exact rate of each angular number. The wall is the problem the article "
        "analyses, the others are the cell it computes. Every list is proved complete.",
        tuple(rows),
    )


def spectrum_sheet() -> Sheet:
    """Return the finite elements' eigenvalues about a = 1, m = 0..4, on three meshes with observed orders."""
    rows = [("m", "ψ", "exact λ", *(f"{4**n * 2 + 2 ** (n + 1) + 1} nodes" for n in _MESHES), "orders")]
    for m, psi in _SPECTRUM:
        found = discrete_rates(Model(Parameters(psi, 0.0), delta=Delta.NONE), m, _MESHES)
        orders = ", ".join(f"{order:.2f}" for order in found.orders)
        rows.append((str(m), f"{psi:g}", _rate(found.exact), *map(_rate, found.rates), orders))
    return Sheet(
        "spectrum",
        "The finite elements' own spectrum",
        "p = 0, δ = 0, normal closure: generalised eigenvalues of the semi-discrete system (B.21), (B.22) "
        "about a = 1. Orders are those of the rate, for a conjugate pair of its mean and product.",
        tuple(rows),
    )


def threshold_sheet(closure: Closure) -> Sheet:
    """Return psi* per angular number at p = 0.26, exact and by a bracketed search on the finite elements."""
    model = Model(Parameters(0.0, 0.26), closure=closure, delta=Delta.NONE)
    columns = ("m", "ψ*", "ω", "545 nodes", "2113 nodes", "extrapolated", "off by", f"ψ*/{_PRINTED}")
    rows = [(*columns, "ψ*, δ = 1")]
    exact = [threshold(model, m) for m in NUMBERS]
    for one in exact:
        assert one.psi is not None  # at this p every angular number has one
        coarse, fine = (discrete_threshold(model, one.m, refine) for refine in (4, 5))
        limit = fine + (fine - coarse) / 3
        rows.append(
            (
                str(one.m),
                f"{one.psi:.4f}",
                f"{one.omega:.4f}",
                f"{coarse:.3f}",
                f"{fine:.3f}",
                f"{limit:.3f}",
                f"{limit / one.psi - 1:+.2%}",
                f"{one.psi / _PRINTED:.2f}",
                f"{threshold(replace(model, delta=Delta.FULL), one.m).psi:.4f}",
            )
        )
    first = lowest(exact)
    wall = threshold(replace(model, closure=Closure.IRROTATIONAL_WALL), 1)
    assert first is not None
    return Sheet(
        f"thresholds-{closure}",
        f"Where modes set in: {closure}",
        f"p = 0.26, δ = 0 but for the last column. The cell first loses stability at ψ* = {first.psi:.3f} "
        f"(m = {first.m}, as a {first.crossing}). The article has w1,1 grow at {_PRINTED}; on its static "
        f"wall it does from {wall.psi:.3f}. Finite elements: bracketed search on their eigenvalues, two "
        "meshes, Richardson.",
        tuple(rows),
    )


def errata_sheet() -> Sheet:
    """Return the article's errata that concern its theory, printed beside corrected."""
    rows = [("cause", "where", "printed", "corrected", "reason")]
    rows += [(str(one.number), one.where, one.printed, one.corrected, one.reason) for one in errata()]
    note = "Computed where they are numbers. Entries with one number have one cause."
    return Sheet("errata", "Printed and corrected", note, tuple(rows))


def _rate(rate: complex) -> str:
    return f"{rate.real:.5f}" + (f" ± {abs(rate.imag):.5f}i" if abs(rate.imag) > 1e-9 else "")
