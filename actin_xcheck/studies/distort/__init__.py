"""Distorted meshes: every method on the disk's mesh made worse on purpose, held against converged runs."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.report.exhibits import Chapter, Line, Plot, Sheet
from actin_xcheck.runs.accuracy import LEVELS, AccuracyLevel
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.records import gathered
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.distort.cases import (
    Case,
    CaseAnswer,
    Family,
    answer_of,
    cases_of,
    converged,
)
from actin_xcheck.studies.stored import AskedRun, LastState
from actin_xcheck.studies.study import Report, Study, Table, Task

LOST = 0.5
"""An order that falls by more is lost."""

GROWN = 10.0
"""An error, or counted work, that grows by more is no matter of a constant."""


@dataclass(frozen=True)
class DistortRow:
    """One run as it came out.

    Attributes
    ----------
    scene, method, family, severity, refine, steps : what was run, see `cases.Case`; the scene by name.
    cells, aspect, angle : of the mesh, and of its worst cells; degrees.
    ending, message : of its Outcome.
    area_error, probes_error, a_error : at the end: relative; largest at the scene's probes; relative in the
        root mean square over a cloud of material points. nan where the run failed.
    uncertainty : of what they are held against: smaller errors mean nothing.
    residual : largest balance residual of a step.
    iterations, solves, factorisations, steps_made : counted work.
    seconds : what it took.
    command : what makes it again, in the report's folder.
    """

    scene: str
    method: str
    family: str
    severity: float
    refine: int
    steps: int
    cells: int
    aspect: float
    angle: float
    ending: str
    message: str
    area_error: float
    probes_error: float
    a_error: float
    uncertainty: float
    residual: float
    iterations: int
    solves: int
    factorisations: int
    steps_made: int
    seconds: float
    command: str

    @property
    def completed(self) -> bool:
        """Whether the run came to its end."""
        return self.ending == "completed"

    @property
    def end(self) -> str:
        """How it failed, and on which mesh."""
        return f"refine {self.refine}: {self.ending.replace('_', ' ')}, {self.message}"

    @property
    def iterations_a_solve(self) -> float:
        """Krylov iterations, over all linear systems."""
        return self.iterations / self.solves if self.solves else float("nan")


@dataclass(frozen=True)
class DistortPair:
    """A method on one distortion: its runs on the coarser and on the finer mesh, beside the undistorted ones.

    Attributes
    ----------
    severity : of the distortion.
    coarse, fine : the runs on it.
    plain_coarse, plain_fine : those on the disk's own mesh.
    """

    severity: float
    coarse: DistortRow
    fine: DistortRow
    plain_coarse: DistortRow
    plain_fine: DistortRow

    @property
    def failed(self) -> DistortRow | None:
        """The run that did not complete, if there is one."""
        return next((row for row in (self.coarse, self.fine) if not row.completed), None)

    @property
    def order(self) -> float:
        """Observed order of the concentration in h; nan where an error is not known."""
        return _order_of(self.coarse, self.fine)

    @property
    def plain_order(self) -> float:
        """The same on the disk's own mesh."""
        return _order_of(self.plain_coarse, self.plain_fine)

    @property
    def growth(self) -> float:
        """How many times larger the error of the concentration is than undistorted, on the finer mesh.

        Errors that are not known count as what is known: it may be more, where the undistorted one is not.
        """
        return _at_most(self.fine) / _at_most(self.plain_fine)

    @property
    def work(self) -> float:
        """How many times more iterations a solve takes than undistorted, on the finer mesh."""
        return self.fine.iterations_a_solve / self.plain_fine.iterations_a_solve


Pairs = dict[str, list[DistortPair]]
"""By the names of methods, from no distortion to the worst."""


def sentence_of(scene: Scene, family: Family, methods: Sequence[Method], pairs: Pairs) -> str:
    """What a family of distortions does to a scene's runs."""
    broken: list[str] = []
    held: list[str] = []
    for method in methods:
        found = _broken(pairs[method.name])
        (broken if found else held).append(f"{method.name} ({found or _held(pairs[method.name])})")
    every = [pair.fine for of_method in pairs.values() for pair in of_method]
    about = f"{family.title}, {scene.name}"
    if family.key != "off-ring":
        aspect, angle = max(row.aspect for row in every), max(row.angle for row in every)
        about += f", aspects up to {aspect:.0f}, angles up to {angle:.1f} degrees"
    parts = [f"breaks {'; '.join(broken)}"] if broken else []
    parts += [f"{'the others hold' if broken else 'all methods hold'}: {'; '.join(held)}"] if held else []
    return f"{about}: {'. '.join(parts)}."


def _broken(pairs: Sequence[DistortPair]) -> str:
    """What is lost at the worst, in words; empty where nothing is."""
    for pair in pairs[1:]:
        if row := pair.failed:
            return f"at {pair.severity:g}, {row.end}"
    worst = max(pairs, key=lambda pair: pair.growth)
    loss = worst.plain_order - worst.order
    if worst.growth > GROWN or (worst.growth > 2 and loss > LOST):
        before = f" instead of {worst.plain_order:.1f}" if math.isfinite(worst.plain_order) else ""
        return f"at {worst.severity:g} error ×{worst.growth:.3g}, of order {worst.order:.1f}{before}"
    return ""


def _held(pairs: Sequence[DistortPair]) -> str:
    """How far the worst distortion is from none."""
    worst = max(pairs, key=lambda pair: pair.growth)
    work = max(pair.work for pair in pairs)
    orders = [pair.order for pair in pairs if math.isfinite(pair.order)]
    order = f", order at least {min(orders):.1f}" if orders else ""
    return f"error ×{worst.growth:.2g}{order}, iterations ×{work:.2g}"


def _at_most(row: DistortRow) -> float:
    return max(row.a_error, row.uncertainty)


def _order_of(coarse: DistortRow, fine: DistortRow) -> float:
    known = min(coarse.a_error, fine.a_error) > max(coarse.uncertainty, fine.uncertainty)
    return math.log2(coarse.a_error / fine.a_error) / (fine.refine - coarse.refine) if known else math.nan


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
    work = _plot(family, "iterations_a_solve", "Krylov iterations a solve", names, pairs)
    key, title = f"{scene.name}--{family.key}", f"{family.title}: {scene.name}"
    note = f"{family.note} Errors at the end of {scene.name}, on the finer of two meshes."
    return Chapter(key, title, note, (*plots, work, _table(family, names, pairs)))


def _plot(family: Family, key: str, title: str, names: Sequence[str], pairs: Pairs) -> Plot:
    """One column against the aspect of the worst cell, or against the offset from the ring."""
    off_ring = family.key == "off-ring"
    fitted = family.severities[1] / 2  # a logarithm has no place for zero

    def place(pair: DistortPair) -> float:
        return (pair.severity or fitted) if off_ring else pair.fine.aspect

    lines = [
        Line(name, np.array([place(pair) for pair in pairs[name]]), _values(pairs[name], key))
        for name in names
    ]
    failed = sorted({place(pair) for name in names for pair in pairs[name] if not pair.fine.completed})
    marks = *([("fitted", fitted)] if off_ring else ()), *(("✕", x) for x in failed)
    note = "Crossed: a run fails there." if failed else ""
    xlabel = family.severity if off_ring else "aspect of the worst cell"
    return Plot(key.replace("_", "-"), title, note, xlabel, tuple(lines), marks, log=True)


def _values(pairs: Sequence[DistortPair], key: str) -> np.ndarray:
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


def _row(name: str, pair: DistortPair) -> tuple[str, ...]:
    fine = pair.fine
    outcome = "; ".join(row.end for row in (pair.coarse, fine) if not row.completed)
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


def _error(row: DistortRow, value: float) -> str:
    return f"below {row.uncertainty:.0e}" if value <= row.uncertainty else _number(value)


def _a_step(row: DistortRow) -> float:
    return row.factorisations / row.steps_made if row.steps_made else math.nan


def _number(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else "none"


TRUTH_LEVELS = LEVELS[3:5]
"""Levels of the converged runs, on the disk's own mesh; the second is believed, their change says how far."""

SHOWN = (
    *("scene", "method", "family", "severity", "refine", "steps"),
    *("a_error", "ending", "message", "seconds"),
)


def distort(
    scenes: Sequence[tuple[Scene, Sequence[Family]]],
    methods: Sequence[Method],
    truth_levels: Sequence[AccuracyLevel] = TRUTH_LEVELS,
) -> Study:
    """Run all distortions of all scenes, and two converged runs of each.

    Parameters
    ----------
    scenes : see `cases.check`, and what their meshes suffer.
    methods : what is run.
    truth_levels : two levels of converged runs.

    Raises UserError where a scene's converged run does not complete.
    """
    cases = {
        case: Task(answer_of, case, case.seconds, (case.scene_file, case.mesh_file))
        for scene, families in scenes
        for family in families
        for severity in family.severities
        for method in methods
        for case in cases_of(scene, method, family, severity)
    }
    truths = [AskedRun(scene, level.on(scene)) for scene, _ in scenes for level in truth_levels]
    answers = yield [*(Task(converged, truth, truth.seconds) for truth in truths), *cases.values()]
    of_case = dict(zip(cases, answers[len(truths) :], strict=True))
    rows: list[DistortRow] = []
    chapters, sentences, told = [], [], []
    for number, (scene, families) in enumerate(scenes):
        coarse, fine = answers[2 * number : 2 * number + 2]
        known = _known(scene, coarse, fine, truth_levels[1])
        told.append(f"{scene.name}: {truths[2 * number + 1].words}, known to {known:.1e}")
        found = {
            case: _row_of(scene, case, answer, fine, known)
            for case, answer in of_case.items()
            if case.scene == scene.text
        }
        for family in families:
            pairs = {method.name: _pairs(scene, method, family, found) for method in methods}
            chapters.append(chapter_of(scene, family, methods, pairs))
            sentences.append(sentence_of(scene, family, methods, pairs))
        rows += found.values()
    note = "What makes each again, in this page's folder, where scenes and meshes lie, stands in the file."
    return Report(
        "Distorted meshes",
        _lead(rows, told),
        {"runs": Table("Runs", rows, note, SHOWN)},
        findings=tuple(sentences),
        chapters=tuple(chapters),
    )


def _pairs(
    scene: Scene, method: Method, family: Family, found: Mapping[Case, DistortRow]
) -> list[DistortPair]:
    """The runs of each severity beside those of the undistorted mesh."""
    return [
        DistortPair(
            severity,
            *(found[case] for case in cases_of(scene, method, family, severity)),
            *(found[case] for case in cases_of(scene, method, family, family.none)),
        )
        for severity in family.severities
    ]


def _known(scene: Scene, coarse: LastState, fine: LastState, level: AccuracyLevel) -> float:
    """How far the converged run may be off: area and concentrations, relative."""
    if not fine.completed:
        raise UserError(f"{scene.origin}: its converged run ends ({fine.message}); valid: one that does not")
    change = max(abs(coarse.area / fine.area - 1), float(np.abs(np.subtract(coarse.a, fine.a)).max()))
    return level.share * change


def _row_of(scene: Scene, case: Case, answer: CaseAnswer, exact: LastState, uncertainty: float) -> DistortRow:
    probes = len(scene.probes.points)
    said = answer.said
    off = np.subtract(said.a, exact.a)
    known = 1.0 if said.completed else math.nan
    return gathered(
        DistortRow,
        case,
        answer,
        said,
        scene=scene.name,
        area_error=known * abs(said.area / exact.area - 1),
        probes_error=known * float(np.abs(off[:probes]).max(initial=0.0)),
        a_error=known * float(np.linalg.norm(off[probes:]) / np.linalg.norm(exact.a[probes:])),
        uncertainty=uncertainty,
        steps_made=said.steps,
        seconds=said.seconds,
        command=case.command(scene),
    )


def _lead(rows: Sequence[DistortRow], truths: Sequence[str]) -> str:
    endings = Counter(row.ending.replace("_", " ") for row in rows)
    counted = ", ".join(f"{count} {ending}" for ending, count in endings.items())
    residual = max((row.residual for row in rows if row.completed), default=math.nan)
    return (
        f"{len(rows)} runs ({counted}) on the disk's mesh made worse step by step; the disk, its rim and the "
        "physics stay. All meshes, the undistorted one too, are taken as if a user had given them: sides are "
        "straight but for arcs of rim and ring. Each distortion is made on two mesh widths, the finer with "
        "half of the other's h; steps are equal, and so many that errors in space lead. The scheme's own "
        f"balance of total actin is kept to {residual:.3g} in every step, whatever the mesh.\n\n"
        f"Errors are held against converged runs on the disk's own mesh ({'; '.join(truths)}). An order is "
        "lost where it falls by more than 0.5 and the error at least doubles."
    )
