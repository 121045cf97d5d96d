"""Distorted meshes: every method on the disk's mesh made worse on purpose, held against converged runs."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.accuracy import LEVELS, AccuracyLevel
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.distort.cases import Answer, Case, Converged, Family, answer_of, cases_of, converged
from actin_xcheck.studies.distort.findings import Pair, Row, chapter_of, sentence_of
from actin_xcheck.studies.study import Report, Study, Table, Task

TRUTH_LEVELS = LEVELS[3:5]
"""Levels of the converged runs, on the disk's own mesh; the second is believed, their change says how far."""

SHOWN = (
    "scene",
    "method",
    "family",
    "severity",
    "refine",
    "steps",
    "a_error",
    "ending",
    "message",
    "seconds",
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
    truths = [Converged.at(scene, level) for scene, _ in scenes for level in truth_levels]
    answers = yield [*(Task(converged, truth, truth.seconds) for truth in truths), *cases.values()]
    of_case = dict(zip(cases, answers[len(truths) :], strict=True))
    rows: list[Row] = []
    chapters, sentences, told = [], [], []
    for number, (scene, families) in enumerate(scenes):
        coarse, fine = answers[2 * number : 2 * number + 2]
        known = _known(scene, coarse, fine, truth_levels[1])
        told.append(f"{scene.name}: {truths[2 * number + 1].words}, known to {known:.1e}")
        found = {
            case: _row(scene, case, answer, fine, known)
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


def _pairs(scene: Scene, method: Method, family: Family, found: Mapping[Case, Row]) -> list[Pair]:
    """The runs of each severity beside those of the undistorted mesh."""
    return [
        Pair(
            severity,
            *(found[case] for case in cases_of(scene, method, family, severity)),
            *(found[case] for case in cases_of(scene, method, family, family.none)),
        )
        for severity in family.severities
    ]


def _known(scene: Scene, coarse: Answer, fine: Answer, level: AccuracyLevel) -> float:
    """How far the converged run may be off: area and concentrations, relative."""
    if fine.ending != "completed":
        raise UserError(f"{scene.origin}: its converged run ends ({fine.message}); valid: one that does not")
    change = max(abs(coarse.area / fine.area - 1), float(np.abs(np.subtract(coarse.a, fine.a)).max()))
    return level.share * change


def _row(scene: Scene, case: Case, answer: Answer, exact: Answer, uncertainty: float) -> Row:
    probes = len(scene.probes.points)
    off = np.subtract(answer.a, exact.a)
    known = 1.0 if answer.ending == "completed" else math.nan
    return Row(
        scene=scene.name,
        method=case.method,
        family=case.family,
        severity=case.severity,
        refine=case.refine,
        steps=case.steps,
        cells=answer.cells,
        aspect=answer.aspect,
        angle=answer.angle,
        ending=answer.ending,
        message=answer.message,
        area_error=known * abs(answer.area / exact.area - 1),
        probes_error=known * float(np.abs(off[:probes]).max(initial=0.0)),
        a_error=known * float(np.linalg.norm(off[probes:]) / np.linalg.norm(exact.a[probes:])),
        uncertainty=uncertainty,
        residual=answer.residual,
        iterations=answer.iterations,
        solves=answer.solves,
        factorisations=answer.factorisations,
        steps_made=answer.steps,
        seconds=answer.seconds,
        command=case.command(scene),
    )


def _lead(rows: Sequence[Row], truths: Sequence[str]) -> str:
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
