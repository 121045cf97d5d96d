"""The atlas of the linear theory: its curves, modes, maps and tables, as chapters of a report."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Chapter, Exhibit, Sheet
from actin_xcheck.runs.method import SPECTRUM, load
from actin_xcheck.studies.study import Report, Study, Task
from actin_xcheck.studies.theory.figures import CELLS, delta_sheet, map_of, pictures, plots, versions
from actin_xcheck.theory.dispersion import active_slope, stiffness
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.errata import TABLE_4_PRINTED, errata
from actin_xcheck.theory.exact import DiskModes, lowest, threshold

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
                (f"{psi:g}", closure, *(_worded(complex(r[0])) if len(r) else "decay" for r in leading))
            )
    return Sheet(
        "modes",
        "Growing modes at the ψ of Table 4",
        "p = 0.26, δ = 0; leading exact rate of each angular number. The wall is the problem the article "
        "analyses, the others are the cell it computes. Every list is counted by the argument principle.",
        tuple(rows),
    )


def spectrum_sheet() -> Sheet:
    """Return the finite elements' eigenvalues about a = 1, m = 0..4, on three meshes with observed orders."""
    rows = [("m", "ψ", "exact λ", *(f"{4**n * 2 + 2 ** (n + 1) + 1} nodes" for n in _MESHES), "orders")]
    for m, psi in _SPECTRUM:
        found = discrete_rates(Model(Parameters(psi, 0.0), delta=Delta.NONE), m, _MESHES)
        orders = ", ".join(f"{order:.2f}" for order in found.orders)
        rows.append((str(m), f"{psi:g}", _worded(found.exact), *map(_worded, found.rates), orders))
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


def _worded(rate: complex) -> str:
    return f"{rate.real:.5f}" + (f" ± {abs(rate.imag):.5f}i" if abs(rate.imag) > 1e-9 else "")


@dataclass(frozen=True, eq=False)
class DrawnChapter:
    """Exhibits that are computed together."""

    exhibits: tuple[Exhibit, ...]


_SHEETS = {"modes": modes_sheet, "spectrum": spectrum_sheet, "delta": delta_sheet, "errata": errata_sheet}

_SECONDS = {"curves": 5.0, "pictures": 3.0, "thresholds": 25.0, "map": 30.0, "spectrum": 20.0, "delta": 10.0}
"""What each takes, about; a second where nothing is said."""


def drawn(asked: tuple[str, str], folder: Path) -> DrawnChapter:
    """Compute exhibits: curves, pictures, the thresholds of a closure, a map, or one of the tables."""
    what, which = asked
    match what:
        case "curves":
            return DrawnChapter(tuple(plots()))
        case "pictures":
            return DrawnChapter(tuple(pictures()))
        case "thresholds":
            return DrawnChapter((threshold_sheet(Closure(which)),))
        case "map":
            return DrawnChapter((map_of(which),))
        case _:
            return DrawnChapter((_SHEETS[what](),))


def atlas() -> Study:
    """Compute all chapters, a few minutes' work."""
    asked = [("curves", ""), ("pictures", "")]
    asked += [("thresholds", str(closure)) for closure in CELLS] + [("map", key) for key in versions()]
    asked += [(what, "") for what in _SHEETS]
    answers = yield [Task(drawn, one, _SECONDS.get(one[0], 1.0)) for one in asked]
    of: dict[str, tuple[Exhibit, ...]] = {}
    for (what, _), answer in zip(asked, answers, strict=True):
        of[what] = (*of.get(what, ()), *answer.exhibits)
    return Report("Linear theory", _LEAD, chapters=_chapters(of))


_LEAD = (
    "What the moving-cell model of George, Stéphanou and Madzvamuse, Mathematical modelling and "
    "numerical simulations of actin dynamics in the eukaryotic cell, does near its steady state a = 1, "
    "u = 0: the article's dispersion relation as printed and corrected, and beside it the exact modes "
    "of the cell it computes. All quantities are non-dimensional, equation numbers those of the "
    "article."
)


def _chapters(of: dict[str, tuple[Exhibit, ...]]) -> tuple[Chapter, ...]:
    """The chapters, of exhibits by what was asked for."""
    curves = {plot.key: plot for plot in of["curves"]}
    functions = tuple(curves.pop(key) for key in ("fig01", "fig02", "fig03"))
    return (
        Chapter(
            "thresholds",
            "Where the cell loses stability",
            "The article's eigenfunctions keep the rim in place (3.4); its cell moves its rim. Exact modes "
            "of that cell, for two readings of its conditions on the rim, set in elsewhere.",
            (*of["thresholds"], *of["modes"]),
        ),
        Chapter(
            "maps",
            "The (ψ, p) plane",
            "Fig. 23a and what becomes of it. A band is named after the mode that began to grow last: OS "
            "while it oscillates, T where its rates are real; H where the first mode to grow oscillates and "
            "still decays.",
            (*of["map"], *of["delta"]),
        ),
        Chapter(
            "relation",
            "The dispersion relation",
            "Figs. 21, 22, 23b and 23c from the printed equations and from the corrected ones.",
            tuple(curves.values()),
        ),
        Chapter(
            "modes",
            "Eigenmodes",
            "The article's w_m,n (A.1) and its sums of them; the concentration in the moving cell's own "
            "leading modes at ψ = 270, p = 0, closure reference-normal.",
            of["pictures"],
        ),
        Chapter("functions", "Constitutive laws", "Figs. 1 to 3.", functions),
        Chapter(
            "spectrum",
            "Finite elements against theory",
            "The code's own growth rates without a time step and without a fit.",
            of["spectrum"],
        ),
        Chapter("errata", "Errata of the article", "", of["errata"]),
    )


_HARMONICS = 10


@dataclass(frozen=True)
class DiscreteRates:
    """Rates of one exact mode on a sequence of meshes.

    Attributes
    ----------
    m : angular number.
    exact : the leading rate, imaginary part >= 0.
    refine : the meshes, 2**refine layers each.
    rates : one per mesh.
    """

    m: int
    exact: complex
    refine: tuple[int, ...]
    rates: tuple[complex, ...]

    @property
    def orders(self) -> tuple[float, ...]:
        """Observed order between consecutive meshes.

        Of the rates' mean and product for a conjugate pair: the pair itself is a square root of them, which
        near a double root is not yet asymptotic when they are.
        """
        errors = [_distance(rate, self.exact) for rate in self.rates]
        return tuple(float(np.log2(one / other)) for one, other in pairwise(errors))


def discrete_rates(model: Model, m: int, refine: tuple[int, ...]) -> DiscreteRates:
    """Return the finite elements' counterpart of the leading exact mode of angular number m.

    Raises ValueError where the exact mode cannot be listed, ArithmeticError where a mesh has no counterpart.
    """
    exact = growth_rate(model, m, 2 if m == 0 and model.closure is Closure.IRROTATIONAL_WALL else 1)
    return DiscreteRates(m, exact, refine, tuple(_rate(model, m, n, exact) for n in refine))


def discrete_threshold(model: Model, m: int, refine: int) -> float:
    """Return the psi at which the finite elements' leading rate of angular number m crosses Re lambda = 0.

    A bracketed search from the exact threshold upwards, in steps of 5 %, for a finite mesh grows less.
    Raises ValueError where there is no exact threshold, or no discrete one within twice of it.
    """
    exact = threshold(model, m)
    if exact.psi is None or exact.omega is None:
        raise ValueError(f"m = {m}: {exact.reason}")
    frequency = exact.omega

    @cache
    def growth(psi: float) -> float:
        at = model.varied(psi=psi)
        return _rate(at, m, refine, 1j * frequency).real

    for low in np.arange(0.95, 2.0, 0.05) * exact.psi:
        if growth(low) < 0 < growth(low + 0.05 * exact.psi):
            return float(brentq(growth, low, low + 0.05 * exact.psi, rtol=1e-5))
    raise ValueError(f"m = {m}: no discrete rate crosses between 0.95 and 2 of psi* = {exact.psi:g}")


def _distance(rate: complex, exact: complex) -> float:
    """Error of a real rate, or of a pair's mean and product."""
    if not exact.imag:
        return abs(rate - exact)
    return abs(complex(rate.real - exact.real, (abs(rate) ** 2 - abs(exact) ** 2) / (2 * abs(exact))))


def _rate(model: Model, m: int, refine: int, near: complex) -> complex:
    """The discrete rate of angular number m nearest to `near`."""
    mesh = disk(refine, model.parameters.l0)
    pressure = 1 + model.parameters.nu_prime - stiffness(model)  # `viscous` has none and ignores it
    spectrum = load(SPECTRUM)(model, mesh, active_slope(model), pressure)
    for count in (2, 4, 8, 16):
        rates, concentrations = spectrum.nearest(near, count)
        for rate, a in zip(rates, concentrations.T, strict=True):
            if _angular_number(mesh, a) == m:
                return complex(rate)
    raise ArithmeticError(
        f"m = {m}: none of the 16 discrete rates nearest to {near:.4g} has that angular number"
    )


def _angular_number(mesh: Mesh, a: NDArray[np.complex128]) -> int:
    """The strongest angular harmonic of nodal values on the mesh's circles."""
    radius = np.hypot(*mesh.xi).round(9)
    theta = np.arctan2(mesh.xi[1], mesh.xi[0])
    energy = np.zeros(_HARMONICS)
    for circle in np.unique(radius):
        on = radius == circle
        waves = np.exp(1j * np.outer(np.arange(_HARMONICS), theta[on]))
        known = np.arange(_HARMONICS) * 2 < on.sum()
        energy += known * (np.abs(waves @ a[on]) ** 2 + np.abs(waves.conj() @ a[on]) ** 2) / on.sum()
    energy[0] /= 2  # counted twice
    return int(np.argmax(energy))
