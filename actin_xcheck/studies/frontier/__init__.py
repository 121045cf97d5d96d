"""Frontiers: where runs are accurate, where they are silently wrong and where they fail, and of what."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from actin_xcheck.report.exhibits import Chapter, Classes, Line, Places, Plot
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.frontier.answers import (
    BOUND,
    ERRORS,
    NOT_RUN,
    TIME_BOUND,
    TRUTH_LEVELS,
    AnswerKind,
    ConvergedPlace,
    JudgedAnswer,
    PlaceTruth,
    answer_of,
    judge,
    lost_answer,
    lost_truth,
    truth_of,
    why_unknown,
)
from actin_xcheck.studies.frontier.limits import lines_of, theory_chapter
from actin_xcheck.studies.frontier.planes import (
    MOST_STEPS,
    REFINE,
    Axis,
    Bisection,
    Node,
    Plane,
    Point,
    end_at,
    point_of,
)
from actin_xcheck.studies.stored import LastState
from actin_xcheck.studies.study import Report, Study, Table, Task

_DECADES = (10.0, 100.0, 1e3, 1e4)

_RIGHT = (AnswerKind.ACCURATE, AnswerKind.ENDS)

_SAMPLES = 4
"""Looks between two places of an axis."""


def words_of(scene: Scene, plane: Plane, found: Bisection) -> str:
    """Up to which dt a method is right at which psi, and how much of the plane is of which class."""
    parts = _shares_in_words(shares(plane, found))
    if plane.name != "psi,dt":
        return f"{parts}."
    own = scene.parameters.psi
    inside = [own] if plane.x.values[0] < own < plane.x.values[-1] else []
    at = [f"{float(f'{psi:.3g}'):g}" for psi in sorted({*_DECADES, *inside})]
    reaches = [_reach(scene, plane, found, psi) for psi in sorted({*_DECADES, *inside})]
    alike: dict[str, list[str]] = {}
    for psi, reach in zip(at, reaches, strict=True):
        alike.setdefault(reach, []).append(psi)
    told = [f"{reach} at ψ = {_enumerated(psi)}" for reach, psi in alike.items()]
    return f"right within {BOUND:.0%} {', '.join(told)}. Over the whole map: {parts}."


def shares(plane: Plane, found: Bisection) -> Mapping[str, float]:
    """Parts of the plane by class, as cells are drawn: each corner stands for its quarter."""
    x, y = (np.log(axis.values) if axis.log else np.array(axis.values) for axis in (plane.x, plane.y))
    parts: Counter[str] = Counter()
    whole = (x[-1] - x[0]) * (y[-1] - y[0])
    for cell in found.cells:
        size = (x[cell.right] - x[cell.left]) * (y[cell.top] - y[cell.bottom]) / whole
        for node in cell.corners:
            parts[found.found[node] or str(AnswerKind.NOT_RUN)] += size / 4
    return parts


def _reach(scene: Scene, plane: Plane, found: Bisection, psi: float) -> str:
    """Up to which dt runs at psi are right, from the smallest one that is made."""
    column = _place(plane.x, psi)
    rows = np.arange((len(plane.y.values) - 1) * _SAMPLES + 1) / _SAMPLES
    steps = np.exp(np.interp(rows, np.arange(len(plane.y.values)), np.log(plane.y.values)))
    made = steps >= end_at(scene, psi) / MOST_STEPS
    classes = [found.class_at(column, float(row)) for row in rows[made]]
    wrong = next((i for i, known in enumerate(classes) if known not in _RIGHT), None)
    if wrong is None:
        return "at every Δt"
    if wrong == 0:
        return f"nowhere (Δt ≥ {steps[made][0]:.2g})"
    return f"up to Δt = {steps[made][wrong - 1]:.2g}"


def _place(axis: Axis, value: float) -> float:
    """Where a value lies between the places of a logarithmic axis."""
    return float(np.interp(math.log(value), np.log(axis.values), np.arange(len(axis.values))))


def _shares_in_words(parts: Mapping[str, float]) -> str:
    first = [str(AnswerKind.ACCURATE), str(AnswerKind.SILENT)]
    names = [*first, *sorted(parts.keys() - set(first))]
    said = [f"{name} in {_percent(parts[name])}" for name in names if parts.get(name)]
    if not any(name.startswith(AnswerKind.FAILED) for name in parts):
        said.append("never fails")
    return ", ".join(said)


def _enumerated(items: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(items[:-1]), items[-1])))


def _percent(part: float) -> str:
    return f"{part:.0%}" if part >= 0.005 else "under 1%"


LADDER = tuple(2**n for n in range(9))
"""Steps of the runs at the scene's own psi and p that show what a method answers."""

SHOWN = (
    *("method", "plane", "psi", "p", "dt", "refine", "steps", "label", "sentence", "seconds", "command"),
)


@dataclass(frozen=True)
class FrontierRow:
    """A point of a map as it came out.

    Attributes
    ----------
    plane, method : of which map.
    column, row : its place in the lattice.
    psi, p, end, dt, refine, steps, command : the run, and what makes it again.
    kind, label, sentence : its class, the same with the Outcome of a failure, and what happened.
    area_error, total_actin_error, a_error, x_error : see `answers.ERRORS`; nan where they mean nothing.
    outcome, message, t : how the run ended and when.
    area, total_actin : its answer.
    true_outcome, true_t, true_area, true_total_actin, uncertainty : the converged run's.
    seconds : wall time.
    """

    plane: str
    method: str
    column: int
    row: int
    psi: float
    p: float
    end: float
    dt: float
    refine: int
    steps: int
    command: str
    kind: str
    label: str
    sentence: str
    area_error: float
    total_actin_error: float
    a_error: float
    x_error: float
    outcome: str = ""
    message: str = ""
    t: float = math.nan
    area: float = math.nan
    total_actin: float = math.nan
    true_outcome: str = ""
    true_t: float = math.nan
    true_area: float = math.nan
    true_total_actin: float = math.nan
    uncertainty: float = math.nan
    seconds: float = math.nan


@dataclass
class _Known:
    """What has been run, by what was asked: answers of points and truths of scenes (TOML)."""

    answers: dict[Point, LastState] = field(default_factory=dict)
    truths: dict[str, PlaceTruth] = field(default_factory=dict)

    def judged(self, point: Point) -> JudgedAnswer:
        """What a point's run is worth."""
        if not point.within_budget:
            return NOT_RUN
        return judge(point, self.answers[point], self.truths[point.scene])

    def label(self, point: Point) -> str | None:
        """Its class; None where it is not run."""
        return self.judged(point).label if point.within_budget else None


@dataclass(frozen=True)
class _Map:
    """One map in the making."""

    scene: Scene
    method: Method
    plane: Plane
    refine: int
    search: Bisection
    points: dict[Node, Point] = field(default_factory=dict)

    def ask(self) -> list[Point]:
        """The runs that are wanted next; none when all borders are found."""
        new = {
            node: point_of(self.scene, self.method, self.plane.at(*node), self.refine)
            for node in self.search.wanted()
        }
        self.points.update(new)
        return list(new.values())

    def tell(self, known: _Known) -> None:
        """Give the search the classes of what it asked for."""
        self.search.tell(
            {node: known.label(self.points[node]) for node in self.points.keys() - self.search.found.keys()}
        )


def frontier(
    scene: Scene,
    planes: Sequence[tuple[Method, Plane]],
    refine: int = REFINE,
    ladder: Sequence[int] = LADDER,
    truth_levels: tuple[int, int] = TRUTH_LEVELS,
) -> Study:
    """Find the borders of classes of runs by bisection, each run held against a converged one.

    Parameters
    ----------
    scene : whose psi, p, mesh and steps are varied; see `planes.check`.
    planes : methods and what to draw for them, see `plane_of`.
    refine : where h is not varied, see `point_of`.
    ladder : numbers of steps of runs at the scene's own psi and p.
    truth_levels : see `Converged`.
    """
    methods = list(dict.fromkeys(method for method, _ in planes))
    maps, known = [_map(scene, method, plane, refine) for method, plane in planes], _Known()
    rungs = [
        point_of(scene, method, {"dt": scene.time.end / steps}, refine)
        for method in methods
        for steps in ladder
    ]
    wanted = list(rungs)
    while asked := [point for one in maps for point in one.ask()]:
        wanted += [point for point in asked if point.within_budget]
        new = [point for point in dict.fromkeys(wanted) if point not in known.answers]
        scenes = [text for text in dict.fromkeys(point.scene for point in new) if text not in known.truths]
        truths = [
            Task(truth_of, one, one.seconds, (), lost_truth)
            for one in (ConvergedPlace(text, truth_levels) for text in scenes)
        ]
        runs = [Task(answer_of, point, point.seconds, (point.file,), lost_answer) for point in new]
        answers = yield [*truths, *runs]
        known.truths.update(zip(scenes, answers, strict=False))
        known.answers.update(zip(new, answers[len(scenes) :], strict=True))
        for one in maps:
            one.tell(known)
        wanted = []
    return _report(scene, methods, maps, rungs, known)


def _map(scene: Scene, method: Method, plane: Plane, refine: int) -> _Map:
    x, y = plane.x, plane.y
    return _Map(scene, method, plane, refine, Bisection(len(x.values), len(y.values), x.stride, y.stride))


def _report(
    scene: Scene, methods: Sequence[Method], maps: Sequence[_Map], rungs: Sequence[Point], known: _Known
) -> Report:
    rows = [_row(one, node, known) for one in maps for node in sorted(one.search.found)]
    said = [
        f"{one.method.name} over ({one.plane.name}): {words_of(scene, one.plane, one.search)}" for one in maps
    ]
    chapters = (
        Chapter("maps", "Maps", _MAPS, tuple(_drawn(one, known) for one in maps)),
        _answers(scene, methods, rungs, known),
        theory_chapter(scene, methods),
    )
    return Report(
        f"Frontier of {scene.name}",
        _lead(rows),
        {"points": Table("Points", rows, "Commands are for this page's folder.", SHOWN)},
        findings=tuple(said),
        chapters=chapters,
    )


_MAPS = (
    "Each point is a run and says what happened when pointed at; a cell takes the class of its corners. "
    "psi, p and the end of the scene are replaced point by point, in the files under scenes/."
)


def _lead(rows: Sequence[FrontierRow]) -> str:
    run = [row for row in rows if row.kind != AnswerKind.NOT_RUN]
    uncertainty = max((row.uncertainty for row in run if row.kind != AnswerKind.UNKNOWN), default=math.nan)
    return (
        "Where runs complete and are accurate, where they complete and are silently wrong, and where "
        f"they fail, and of what. Each of {len(run)} points is a run in equal steps, held against a "
        "converged run at the same ψ and p: steps chosen by their error, accepted once two levels "
        f"agree; what these judge is known to {uncertainty:.3g} or better. The error is the largest of: "
        "area and total actin (relative), concentrations (relative) and positions (in radii) in the "
        f"root mean square over 64 material points. Above {100 * BOUND:.0f} % a completed run is "
        "silently wrong. Where the model itself ends, because 1 + φ reaches 0, a run is right to end so "
        f"within {100 * TIME_BOUND:.0f} % of that time, and wrong to complete. Runs at another ψ end "
        "after as many growth times 1/(k_a + σ′(1)/μ) as the scene itself. Borders were found by "
        f"bisection; runs of more than {MOST_STEPS} steps are not made."
    )


def _drawn(one: _Map, known: _Known) -> Classes:
    """A map as an exhibit."""
    nodes = sorted(one.search.found)
    judged = [known.judged(one.points[node]) for node in nodes]
    x, y = one.plane.x, one.plane.y
    return Classes(
        key=f"{one.plane.name}--{one.method.name}",
        title=f"{one.method.name} over ({x.label}, {y.label})",
        note=words_of(one.scene, one.plane, one.search),
        x=_places(x),
        y=_places(y),
        nodes=np.array(nodes).T,
        classes=tuple(found.label for found in judged),
        sentences=tuple(_said(one, node, found) for node, found in zip(nodes, judged, strict=True)),
        cells=np.array([(cell.left, cell.right, cell.bottom, cell.top) for cell in one.search.cells]),
        lines=lines_of(one.scene, one.method, one.plane),
    )


def _places(axis: Axis) -> Places:
    return Places(axis.label, np.array(axis.values), axis.log)


def _said(one: _Map, node: Node, judged: JudgedAnswer) -> str:
    """What a reader sees who points at a point."""
    point = one.points[node]
    places = zip((one.plane.x, one.plane.y), node, strict=True)
    where = ", ".join(f"{axis.label} = {axis.values[place]:.4g}" for axis, place in places)
    return f"{where}; {point.steps} steps, refine {point.refine}: {judged.label}. {judged.sentence}"


def _row(one: _Map, node: Node, known: _Known) -> FrontierRow:
    point = one.points[node]
    judged = known.judged(point)
    asked = ("psi", "p", "end", "dt", "refine", "steps", "command")
    values: dict[str, Any] = {name: getattr(point, name) for name in asked}
    values |= {"plane": one.plane.name, "method": one.method.name, "column": node[0], "row": node[1]}
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
    return FrontierRow(**values)


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
