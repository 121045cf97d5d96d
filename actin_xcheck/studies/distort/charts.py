"""The chapters of a distortion report: charts against severity, and a table of every number."""

import math
from collections.abc import Sequence

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Line, Plot, Sheet
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.distort.cases import Family
from actin_xcheck.studies.distort.record import Row
from actin_xcheck.studies.distort.words import Pair, Pairs

QUANTITIES = {
    "a_error": "Concentration, relative, over a cloud of material points",
    "area_error": "Area, relative",
    "probes_error": "Concentration at the scene's probes, largest",
}
"""Errors that are charted, by the column they stand in."""


def chapter_of(scene: Scene, family: Family, methods: Sequence[Method], pairs: Pairs) -> Chapter:
    """What is shown of a family of distortions."""
    names = [method.name for method in methods]
    plots = [_plot(family, key, title, names, pairs) for key, title in QUANTITIES.items()]
    work = _plot(family, "iterations_a_solve", "Iterations of conjugate gradients a solve", names, pairs)
    chapter = f"{scene.name}--{family.key}"
    note = f"{family.note} Errors at the end of {scene.name}, on the finer of two meshes."
    return Chapter(
        chapter, f"{family.title}: {scene.name}", note, (*plots, work, _table(family, names, pairs))
    )


def _plot(family: Family, key: str, title: str, names: Sequence[str], pairs: Pairs) -> Plot:
    """One column against the aspect of the worst cell, or against the offset from the ring."""
    off_ring = family.key == "off-ring"
    fitted = family.severities[1] / 2  # a logarithm has no place for zero

    def place(pair: Pair) -> float:
        return (pair.severity or fitted) if off_ring else pair.fine.aspect

    lines = [
        Line(name, np.array([place(pair) for pair in pairs[name]]), _values(pairs[name], key))
        for name in names
    ]
    failed = sorted({place(pair) for name in names for pair in pairs[name] if not pair.fine.completed})
    marks = [("fitted", fitted)] if off_ring else []
    note = "Crossed: a run fails there." if failed else ""
    return Plot(
        key.replace("_", "-"),
        title,
        note,
        f"{family.severity}" if off_ring else "aspect of the worst cell",
        tuple(lines),
        (*marks, *(("✕", x) for x in failed)),
        log=True,
    )


def _values(pairs: Sequence[Pair], key: str) -> np.ndarray:
    """A column of the finer runs; nan where one failed, or its error is below what is known."""
    found = np.array([getattr(pair.fine, key) if pair.fine.completed else math.nan for pair in pairs])
    least = np.array([pair.fine.uncertainty if key in QUANTITIES else 0.0 for pair in pairs])
    return np.where(found > least, found, math.nan)


def _table(family: Family, names: Sequence[str], pairs: Pairs) -> Sheet:
    header = (
        *("Method", family.severity.capitalize(), "Aspect", "Angle", "Error of a, coarser", "finer", "Order"),
        *("Times undistorted", "Error of area", "Probes", "Iterations a solve", "Factorisations a step"),
        *("Balance", "Outcome"),
    )
    rows = [_row(name, pair) for name in names for pair in pairs[name]]
    return Sheet("numbers", "All numbers", _NOTE, (header, *rows))


_NOTE = (
    "Where nothing else is said, of the finer mesh. Orders are those of the concentration in h, from both "
    "meshes. Balance: largest residual of the scheme's own balance of total actin in a step."
)


def _row(name: str, pair: Pair) -> tuple[str, ...]:
    fine = pair.fine
    outcome = "; ".join(
        f"refine {row.refine}: {row.ending.replace('_', ' ')}, {row.message}"
        for row in (pair.coarse, fine)
        if not row.completed
    )
    return (
        name,
        f"{pair.severity:g}",
        f"{fine.aspect:.3g}",
        f"{fine.angle:.4g}",
        *(_error(row, row.a_error) for row in (pair.coarse, fine)),
        _number(pair.order),
        _number(pair.growth),
        *(_error(fine, value) for value in (fine.area_error, fine.probes_error)),
        _number(fine.iterations_a_solve),
        _number(_a_step(fine)),
        _number(fine.residual),
        outcome or "completed",
    )


def _error(row: Row, value: float) -> str:
    return f"below {row.uncertainty:.0e}" if value <= row.uncertainty else _number(value)


def _a_step(row: Row) -> float:
    return row.factorisations / row.steps_made if row.steps_made else math.nan


def _number(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else "none"
