"""Distortions at work: run every case on all cores, hold it against the truth, write what was found."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.report.exhibits import Chapter
from actin_xcheck.runs.method import Method, find_method
from actin_xcheck.runs.store import provenance
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.scene.outline import write_mesh
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.distort.cases import Case, Family, cases_of
from actin_xcheck.studies.distort.charts import chapter_of
from actin_xcheck.studies.distort.kept import Task, work
from actin_xcheck.studies.distort.measure import Answer, Truth
from actin_xcheck.studies.distort.record import FILE_NAME, Row, write_distortion
from actin_xcheck.studies.distort.words import Pair, sentence_of

KEPT = "runs"
"""Folder of the answers."""


def examine(
    studies: Sequence[tuple[Scene, Sequence[Family]]],
    methods: Sequence[Method],
    folder: Path,
    command: str,
    report: Report = lambda label, done, total: None,
) -> list[str]:
    """Run all distortions of all scenes and write `folder/distortion.h5`; return what they come to.

    Runs that an interrupted report left in the folder are kept, where the same code made them.

    Parameters
    ----------
    studies : scenes, see `cases.check`, and what their meshes suffer.
    methods : what is run.
    folder : where files go; it exists.
    command : what makes the report again.
    report : told of progress.

    Raises UserError where a scene's converged run does not complete.
    """
    (folder / KEPT).mkdir(exist_ok=True)
    rows: list[Row] = []
    chapters: list[Chapter] = []
    sentences: list[str] = []
    told: list[str] = []
    answers = _run(_wanted(studies, methods), folder, report)
    for scene, families in studies:
        truth = answers[scene.text]
        assert isinstance(truth, Truth)
        if truth.answer.ending != "completed":
            raise UserError(
                f"{scene.origin}: its converged run ends ({truth.answer.message}); valid: one that does not"
            )
        told.append(f"{scene.name}: {truth.level}, known to {truth.uncertainty:.1e}")
        found: dict[Case, Row] = {}

        def row(
            case: Case, scene: Scene = scene, truth: Truth = truth, found: dict[Case, Row] = found
        ) -> Row:
            if case not in found:
                answer = answers[case]
                assert isinstance(answer, Answer)
                found[case] = _row(scene, case, answer, truth)
            return found[case]

        for family in families:
            pairs = {
                method.name: [
                    Pair(
                        severity,
                        *(row(case) for case in cases_of(scene, method, family, severity)),
                        *(row(case) for case in cases_of(scene, method, family, family.none)),
                    )
                    for severity in family.severities
                ]
                for method in methods
            }
            chapters.append(chapter_of(scene, family, methods, pairs))
            sentences.append(sentence_of(scene, family, methods, pairs))
        _write_meshes(scene, found, folder)
        rows += found.values()
    attributes = {"command": command, "sentences": tuple(sentences), "truths": tuple(told)}
    write_distortion(folder / FILE_NAME, rows, chapters, attributes)
    return sentences


def _wanted(studies: Sequence[tuple[Scene, Sequence[Family]]], methods: Sequence[Method]) -> list[Case | str]:
    """Everything that has to be run, each once, the longest first."""
    truths = [scene.text for scene, _ in studies]
    cases = [
        case
        for scene, families in studies
        for family in families
        for severity in family.severities
        for method in methods
        for case in cases_of(scene, method, family, severity)
    ]
    return [*truths, *sorted(dict.fromkeys(cases), key=_cost, reverse=True)]


def _cost(case: Case) -> float:
    """About how long a case takes, in any unit."""
    method = find_method(case.method)
    stages = 1 + 2.5 * (method.order_dt - 1)
    return case.steps * 4.0**case.refine * stages * method.space**2 * (1 if method.family == "fem" else 2)


def _run(wanted: Sequence[Case | str], folder: Path, report: Report) -> dict[Case | str, Answer | Truth]:
    code = json.dumps(provenance(), sort_keys=True)
    tasks = {what: Task(what, folder / KEPT, code) for what in wanted}
    answers = {what: found for what, task in tasks.items() if (found := task.known()) is not None}
    left = [what for what in wanted if what not in answers]
    done = len(answers)

    def over(label: str, parts: int, total: int) -> None:
        nonlocal done
        done += 1
        report("distorted meshes", done, len(wanted))

    answers.update(zip(left, work_off(work, [tasks[what] for what in left], over), strict=True))
    return answers


def _row(scene: Scene, case: Case, answer: Answer, truth: Truth) -> Row:
    exact, probes = truth.answer, len(scene.probes.points)
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
        uncertainty=truth.uncertainty,
        residual=answer.residual,
        iterations=answer.iterations,
        solves=answer.solves,
        factorisations=answer.factorisations,
        steps_made=answer.steps,
        seconds=answer.seconds,
        command=case.command(scene),
    )


def _write_meshes(scene: Scene, cases: dict[Case, Row], folder: Path) -> None:
    """The files that the commands of the runs name."""
    place = folder / "meshes" / scene.name
    place.mkdir(parents=True, exist_ok=True)
    for name, case in {case.mesh_name: case for case in cases}.items():
        write_mesh(place / f"{name}.vtu", case.mesh(scene.parameters.l0))
