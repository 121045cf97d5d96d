"""A theory report as a file: everything the atlas holds, computed and stored with how it came about."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from actin_xcheck.report.exhibit_file import read_chapters, write_chapters
from actin_xcheck.report.exhibits import Chapter, Plot, Sheet
from actin_xcheck.runs.store import provenance, reading, writing
from actin_xcheck.studies.theory.curves import pictures, plots
from actin_xcheck.studies.theory.regions import Report, delta_sheet, maps
from actin_xcheck.studies.theory.sheets import (
    CELLS,
    errata_sheet,
    modes_sheet,
    spectrum_sheet,
    threshold_sheet,
)

FILE_NAME = "predictions.h5"


@dataclass(frozen=True)
class Predictions:
    """Stored predictions: their chapters and what was stated about the whole."""

    path: Path
    attributes: dict[str, Any]
    chapters: tuple[Chapter, ...]


def compute(report: Report) -> tuple[Chapter, ...]:
    """Compute all chapters, a few minutes' work; `report` is told of it."""
    curves = {plot.key: plot for plot in plots()}
    functions = [curves.pop(key) for key in ("fig01", "fig02", "fig03")]
    relation: list[Plot] = list(curves.values())
    planes = maps(report)
    tables: list[Callable[[], Sheet]] = [
        *((lambda closure=closure: threshold_sheet(closure)) for closure in CELLS),
        *(modes_sheet, spectrum_sheet, delta_sheet, errata_sheet),
    ]
    made = []
    for step, table in enumerate(tables):
        report("tables", step, len(tables))
        made.append(table())
    report("tables", len(tables), len(tables))
    *thresholds, modes, spectrum, delta, errata = made
    return (
        Chapter(
            "thresholds",
            "Where the cell loses stability",
            "The article's eigenfunctions keep the rim in place (3.4); its cell moves its rim. Exact modes "
            "of that cell, for two readings of its conditions on the rim, set in elsewhere.",
            (*thresholds, modes),
        ),
        Chapter(
            "maps",
            "The (ψ, p) plane",
            "Fig. 23a and what becomes of it. A band is named after the mode that began to grow last: OS "
            "while it oscillates, T where its rates are real; H where the first mode to grow oscillates and "
            "still decays.",
            (*planes, delta),
        ),
        Chapter(
            "relation",
            "The dispersion relation",
            "Figs. 21, 22, 23b and 23c from the printed equations and from the corrected ones.",
            tuple(relation),
        ),
        Chapter(
            "modes",
            "Eigenmodes",
            "The article's w_m,n (A.1) and its sums of them; the concentration in the moving cell's own "
            "leading modes at ψ = 270, p = 0, closure reference-normal.",
            tuple(pictures()),
        ),
        Chapter("functions", "Constitutive laws", "Figs. 1 to 3.", tuple(functions)),
        Chapter(
            "spectrum",
            "Finite elements against theory",
            "The code's own growth rates without a time step and without a fit.",
            (spectrum,),
        ),
        Chapter("errata", "Errata of the article", "", (errata,)),
    )


def write_predictions(path: Path, chapters: Iterable[Chapter], command: str) -> None:
    """Write chapters with provenance and the command that makes them again, replacing `path` atomically.

    Each exhibit is the group `/exhibits/<chapter>/<key>`.  UserError where the file cannot be written.
    """
    with writing(path, {"command": command, **provenance()}) as file:
        write_chapters(file.create_group("exhibits", track_order=True), chapters)


def read_predictions(path: Path) -> Predictions:
    """Return the predictions stored in `path`; UserError where it is missing, not whole or something else."""
    with reading(path, "set of predictions") as file:
        return Predictions(Path(path), dict(file.attrs), read_chapters(file["exhibits"]))
