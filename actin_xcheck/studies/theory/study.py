"""The atlas of the linear theory: its curves, modes, maps and tables, as chapters of a report."""

from dataclasses import dataclass
from pathlib import Path

from actin_xcheck.core.model import Closure
from actin_xcheck.report.exhibits import Chapter, Exhibit
from actin_xcheck.studies.study import Report, Study, Task
from actin_xcheck.studies.theory.curves import pictures, plots
from actin_xcheck.studies.theory.regions import delta_sheet, map_of, versions
from actin_xcheck.studies.theory.sheets import (
    CELLS,
    errata_sheet,
    modes_sheet,
    spectrum_sheet,
    threshold_sheet,
)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Exhibits that are computed together."""

    exhibits: tuple[Exhibit, ...]


_SHEETS = {"modes": modes_sheet, "spectrum": spectrum_sheet, "delta": delta_sheet, "errata": errata_sheet}

_SECONDS = {"curves": 5.0, "pictures": 3.0, "thresholds": 25.0, "map": 30.0, "spectrum": 20.0, "delta": 10.0}
"""What each takes, about; a second where nothing is said."""


def drawn(asked: tuple[str, str], folder: Path) -> Drawn:
    """Compute exhibits: curves, pictures, the thresholds of a closure, a map, or one of the tables."""
    what, which = asked
    match what:
        case "curves":
            return Drawn(tuple(plots()))
        case "pictures":
            return Drawn(tuple(pictures()))
        case "thresholds":
            return Drawn((threshold_sheet(Closure(which)),))
        case "map":
            return Drawn((map_of(which),))
        case _:
            return Drawn((_SHEETS[what](),))


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
