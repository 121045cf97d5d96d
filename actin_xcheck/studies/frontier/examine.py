"""Frontiers at work: ask for points until borders are found, have them run, write what was found."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.files import replace_file
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.runs.executor import Executor, Lost, executor
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.store import provenance
from actin_xcheck.runs.version import code
from actin_xcheck.runs.workers import Report
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.frontier.answers import BOUND, ERRORS, TIME_BOUND, Answer, Truth
from actin_xcheck.studies.frontier.bisection import Bisection, Node
from actin_xcheck.studies.frontier.classes import NOT_RUN, Judged, judge, why_unknown
from actin_xcheck.studies.frontier.journal import FILE_NAME as JOURNAL_NAME
from actin_xcheck.studies.frontier.journal import Journal
from actin_xcheck.studies.frontier.limits import lines_of, theory_chapter
from actin_xcheck.studies.frontier.planes import MOST_STEPS, Plane, Point, plane_of, point_of
from actin_xcheck.studies.frontier.record import FILE_NAME, Map, Row, write_frontier
from actin_xcheck.studies.frontier.words import words_of
from actin_xcheck.studies.frontier.works import Task, without, work

LADDER = tuple(2**n for n in range(9))
"""Steps of the runs at the scene's own psi and p that show what a method answers."""


@dataclass
class _Known:
    """What has been run, by what was asked: answers of points and truths of scenes (TOML)."""

    answers: dict[Point, Answer] = field(default_factory=dict)
    truths: dict[str, Truth] = field(default_factory=dict)

    def judged(self, point: Point) -> Judged:
        """What a point's run is worth."""
        if not point.within_budget:
            return NOT_RUN
        return judge(point, self.answers[point], self.truths[point.scene])

    def label(self, point: Point) -> str | None:
        """Its class; None where it is not run."""
        return self.judged(point).label if point.within_budget else None


@dataclass(frozen=True)
class _Study:
    """One map in the making."""

    scene: Scene
    method: Method
    plane: Plane
    search: Bisection
    points: dict[Node, Point] = field(default_factory=dict)

    def ask(self) -> list[Point]:
        """The runs that are wanted next; none when all borders are found."""
        new = {node: point_of(self.scene, self.method, self.plane.at(*node)) for node in self.search.wanted()}
        self.points.update(new)
        return list(new.values())

    def tell(self, known: _Known) -> None:
        """Give the search the classes of what it asked for."""
        self.search.tell(
            {node: known.label(self.points[node]) for node in self.points.keys() - self.search.found.keys()}
        )


def examine(
    scene: Scene,
    methods: Sequence[Method],
    planes: Sequence[str],
    folder: Path,
    command: str,
    jobs: int,
    scheduler: str | None = None,
    report: Report = lambda label, done, total: None,
) -> list[Map]:
    """Find the borders of every method in every plane and write `folder/frontier.h5`.

    Runs that an interrupted report left in the folder are kept, where the same code made them.  One whose
    process ended every time is a failure in the file, and is tried again when the report is asked for again.

    Parameters
    ----------
    scene : whose psi, p, mesh and steps are varied; see `planes.check`.
    methods, planes : what to draw; names of `planes.PLANES`.
    folder : where files go; it exists.
    command : what makes the report again.
    jobs, scheduler : see `executor`.
    report : told of progress, round by round.
    """
    journal, known = Journal(folder / JOURNAL_NAME, provenance()), _Known()
    studies = [_study(scene, method, name) for name in planes for method in methods]
    ladder = _ladder(scene, methods)
    wanted, turn = list(ladder), 0
    with executor(jobs, scheduler) as processes:
        while asked := [point for study in studies for point in study.ask()]:
            turn += 1
            wanted += [point for point in asked if point.within_budget]
            _run(wanted, journal, known, processes, f"round {turn}", report)
            for study in studies:
                study.tell(known)
            wanted = []
    _write_scenes(known.answers, folder)
    maps = [_map(study, known) for study in studies]
    chapters = [_answers(scene, methods, ladder, known), theory_chapter(scene, methods)]
    attributes: dict[str, str | int | float] = {
        "command": command,
        "scene": scene.text,
        "scene_name": scene.name,
        "citation": scene.citation,
        "bound": BOUND,
        "time_bound": TIME_BOUND,
        "most_steps": MOST_STEPS,
    }
    write_frontier(folder / FILE_NAME, maps, chapters, attributes)
    return maps


def _study(scene: Scene, method: Method, name: str) -> _Study:
    plane = plane_of(name, method)
    x, y = plane.x, plane.y
    return _Study(scene, method, plane, Bisection(len(x.values), len(y.values), x.stride, y.stride))


def _run(
    points: Sequence[Point],
    journal: Journal,
    known: _Known,
    processes: Executor,
    label: str,
    report: Report,
) -> None:
    """Run what is not known yet, points and the truths they are held against, and take all of it in."""
    new = [point for point in dict.fromkeys(points) if point not in known.answers]
    scenes = [text for text in dict.fromkeys(point.scene for point in new) if text not in known.truths]
    tasks = []
    for point in new:
        if found := journal.answer(point):
            known.answers[point] = found
        else:
            tasks.append(Task(point, code()))
    for text in scenes:
        if truth := journal.truth(text):
            known.truths[text] = truth
        else:
            tasks.append(Task(text, code()))
    tasks.sort(key=lambda task: task.cost, reverse=True)
    whole, done = sum(task.cost for task in tasks), 0
    for number, result in processes.results(work, tasks):
        task = tasks[number]
        if isinstance(result, Lost):
            result = without(task, result)
        else:
            journal.keep(task.what, result)
        if isinstance(task.what, Point) and isinstance(result, Answer):
            known.answers[task.what] = result
        elif isinstance(task.what, str) and isinstance(result, Truth):
            known.truths[task.what] = result
        done += task.cost
        report(f"{label}, {len(tasks)} runs", done, whole)


def _write_scenes(points: Iterable[Point], folder: Path) -> None:
    """Write the scenes of points, which their commands name."""
    (folder / "scenes").mkdir(exist_ok=True)
    for name, text in {point.name: point.scene for point in points}.items():
        replace_file(folder / "scenes" / f"{name}.toml", text.encode())


def _map(study: _Study, known: _Known) -> Map:
    search, plane = study.search, study.plane
    rows = tuple(_row(node, study.points[node], known) for node in sorted(search.found))
    cells = np.array([(cell.left, cell.right, cell.bottom, cell.top) for cell in search.cells])
    words = words_of(study.scene, plane, search)
    return Map(study.method.name, plane, rows, cells, lines_of(study.scene, study.method, plane), words)


def _row(node: Node, point: Point, known: _Known) -> Row:
    judged = known.judged(point)
    asked = ("psi", "p", "end", "dt", "refine", "steps", "command")
    values: dict[str, Any] = {name: getattr(point, name) for name in asked}
    values |= {"column": node[0], "row": node[1]}
    values |= {"kind": str(judged.kind), "label": judged.label, "sentence": judged.sentence}
    values |= {f"{name}_error": error for name, error in zip(ERRORS, judged.errors, strict=True)}
    if point.within_budget:
        answer, truth = known.answers[point], known.truths[point.scene]
        for name in ("message", "t", "area", "total_actin", "seconds"):
            values[name] = getattr(answer, name)
        for name in ("t", "area", "total_actin"):
            values[f"true_{name}"] = getattr(truth.answer, name)
        values |= {"outcome": answer.ending, "true_outcome": truth.answer.ending}
        values["uncertainty"] = truth.uncertainty
    return Row(**values)


def _ladder(scene: Scene, methods: Sequence[Method]) -> list[Point]:
    """Runs of 1, 2, 4, ... steps at the scene's own psi and p."""
    end = scene.time.end
    return [point_of(scene, method, {"dt": end / steps}) for method in methods for steps in LADDER]


def _answers(scene: Scene, methods: Sequence[Method], ladder: Sequence[Point], known: _Known) -> Chapter:
    """What the methods answer for the area at the scene's own psi, over dt: failures leave a gap."""
    truth = known.truths[ladder[0].scene]
    lines = []
    for method in methods:
        ours = [point for point in ladder if point.method == method.name]
        areas = [known.answers[one].area if known.answers[one].completed else np.nan for one in ours]
        lines.append(Line(method.name, np.log10([one.dt for one in ours]), np.array(areas)))
    if truth.answer.completed:
        across = np.array([lines[0].x.min(), lines[0].x.max()])
        lines.append(Line(f"converged, {truth.level}", across, np.full(2, truth.answer.area), guide=True))
        held = f"The converged run says {truth.answer.area:.5g}, to {truth.uncertainty:.1g}."
    elif not truth.known:
        held = f"The truth is not known: {why_unknown(truth)}."
    else:
        held = f"In the converged run the model ends at t = {truth.answer.t:.4g}: {truth.answer.message}."
    note = f"Area at the end, t = {scene.time.end:g}, by time step. {held} A gap is a run that fails."
    title = f"What is answered at ψ = {scene.parameters.psi:g}, p = {scene.parameters.p:g}"
    plot = Plot("area", "Area at the end", note, "log₁₀ Δt", tuple(lines))
    return Chapter("answers", title, "", (plot,))
