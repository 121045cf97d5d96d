"""Closures at work: measure ripples, follow rims on finer and finer meshes, write what was found."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Closure
from actin_xcheck.runs.store import provenance
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.growth import BASE, Ripples, measure
from actin_xcheck.studies.closures.record import (
    FILE_NAME,
    Asked,
    Closures,
    Found,
    found_before,
    keep,
    read_closures,
    write_closures,
)
from actin_xcheck.studies.closures.refinement import Course, follow, scene_of

READINGS = (Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL)

ROUGH_SCENE, ARTICLES = "rough-swelling", "fig14-four-fronts"
"""A rim with kinks that doubles its radius, and the article's own cell, whose rim advances by 7 %."""

METHODS = ("fem-p1-paper", "fem-p2-imex3", "fem-p4-imex4", "fv-coupled")

ON_ARTICLES = "fem-p2-imex3"
"""The method that shows what the closures do to the article's cell."""

LEVELS = range(4)
"""32 to 256 rim nodes: refine 3 to 6 for P1 and the finite volumes, 2 to 5 for P2, 1 to 4 for P4."""

RIPPLED = 2
"""The level on which all methods' ripples are measured: 128 rim nodes."""


@dataclass(frozen=True)
class Task:
    """What is asked for, and the folder where the answer is kept."""

    asked: Asked
    folder: Path


def plan(methods: Sequence[str]) -> list[Asked]:
    """What a report asks for: ripples of both readings and ways, P2's on three meshes; refinement."""
    asked: list[Asked] = []
    for method in methods:
        refine = Course(ROUGH_SCENE, method, Closure.CURRENT_NORMAL, RIPPLED).refine
        whole = Ripples(method, refine, Closure.CURRENT_NORMAL)
        finer = [replace(whole, refine=refine + by) for by in (-1, 1)] if method == ON_ARTICLES else []
        asked += [whole, *finer, replace(whole, advancing=False)]
        asked.append(replace(whole, closure=Closure.REFERENCE_NORMAL))
    scenes = [(ROUGH_SCENE, method) for method in methods]
    scenes += [(ARTICLES, method) for method in methods if method == ON_ARTICLES]
    return asked + [
        Course(scene, method, closure, level)
        for scene, method in scenes
        for closure in READINGS
        for level in LEVELS
    ]


def examine(
    asked: Sequence[Asked], folder: Path, command: str, report: Report = lambda label, done, total: None
) -> Closures:
    """Find what is asked for on all cores and write `folder/closures.h5`.

    What an interrupted report left in the folder is kept, where the same code found it.

    Parameters
    ----------
    asked : see `plan`.
    folder : where files go; it exists.
    command : what makes the report again.
    report : told of progress.
    """
    versions = provenance()
    found: dict[Asked, Found] = {}
    for one in asked:
        if (before := found_before(folder, one, versions)) is not None:
            found[one] = before
    _write_scenes([one for one in asked if isinstance(one, Course)], folder)
    tasks = [Task(one, folder) for one in asked if one not in found]
    tasks.sort(key=lambda task: task.asked.cost, reverse=True)
    whole, done = sum(task.asked.cost for task in tasks), 0

    def told(_: str, cost: int, __: int) -> None:
        nonlocal done
        done += cost
        report(f"{len(tasks)} measurements", done, whole)

    for task, result in zip(tasks, work_off(work, tasks, told, lambda task: str(task.asked)), strict=True):
        found[task.asked] = result
    stated: dict[str, str | int | float] = {"command": command, "scene": load_scene(BASE).text}
    write_closures(folder / FILE_NAME, [found[one] for one in asked], stated)
    return read_closures(folder / FILE_NAME)


def work(task: Task, report: Report) -> Found:
    """What a worker does: find one thing, keep it and say so."""
    asked = task.asked
    found: Found = measure(asked) if isinstance(asked, Ripples) else follow(asked)
    keep(task.folder, asked, found)
    report("", asked.cost, asked.cost)
    return found


def _write_scenes(courses: Sequence[Course], folder: Path) -> None:
    """Write the scenes of runs, which their commands name."""
    for course in courses:
        path = folder / course.file
        path.parent.mkdir(exist_ok=True)
        replace_file(path, scene_of(course).text.encode())
