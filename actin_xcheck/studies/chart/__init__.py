"""Charts of error against work: every method on finer and finer meshes, each run timed by itself."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from actin_xcheck.core.parameters import CAVEATS
from actin_xcheck.report.exhibits import Chapter, Sheet
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics, run_seconds
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.ledger import LedgerEntry, ledger, ledger_sheet, ledger_tasks
from actin_xcheck.studies.chart.measure import (
    REPEATS,
    SHORT,
    WHOLE,
    Plan,
    Sample,
    SampleAnswer,
    answered,
    ladder,
    measured,
    published,
    reference_points,
)
from actin_xcheck.studies.chart.plots import WORKS, Chart, chapter_of, row_of
from actin_xcheck.studies.chart.truth import WRONG, ChartedQuantity, truth_of
from actin_xcheck.studies.stored import AskedRun
from actin_xcheck.studies.study import Batch, Report, Study, Table, Task

NEEDED = 1e-4
"""Error by which the term ledger says whether the scene needs a term."""

BUSY = 0.1
"""Part of the time that runs may wait for a processor before the page warns of it."""

SHOWN = (
    *("method", "numerics", "standing", "ending", "error_a", "error_area", "error_probes", "wall"),
    *("wall_least", "wall_most", "kernels", "cpu", "cpu_least", "cpu_most", "steps", "rejected"),
    *("cells_steps", "factorisations", "solves", "megabytes", "command"),
)


def default_methods() -> list[str]:
    """Those that move their own nodes."""
    return [name for name, method in METHODS.items() if method.driven_by is None]


@dataclass(frozen=True, eq=False)
class Reference:
    """A run that others are held against."""

    method: str
    numerics: str
    ending: str
    answer: SampleAnswer


@dataclass(frozen=True)
class Held:
    """What a quantity is held against: how its error is measured, from where it is known, and how well."""

    quantity: ChartedQuantity
    measure: str
    source: str
    known_to: float


@dataclass
class _Climb:
    """A method on its ladder, as far as its seconds reach."""

    scene: Scene
    rungs: list[Numerics]
    budget: float
    samples: list[tuple[Numerics, Sample]] = field(default_factory=list)

    @property
    def spent(self) -> float:
        """Processor seconds that all repetitions of its runs took."""
        return sum(float(sample.cpu.sum()) for _, sample in self.samples)

    def expected(self, point: Numerics) -> float:
        """Processor seconds that all repetitions of a point will take, by those of the one before it."""
        reckoned = run_seconds(point, self.scene.output_times)
        if not self.samples:
            return REPEATS * reckoned
        before, sample = self.samples[-1]
        once = float(np.median(sample.cpu)) * reckoned / run_seconds(before, self.scene.output_times)
        return once * (REPEATS if once < SHORT else 1)

    def goes_on(self) -> bool:
        """Whether the next rung is within the budget; the first is in any case."""
        if not self.rungs:
            return False
        return not self.samples or self.spent + self.expected(self.rungs[0]) <= self.budget

    @property
    def later(self) -> float:
        """Seconds that the rungs behind the next one may take."""
        return max(self.budget - self.spent - self.expected(self.rungs[0]), 0.0) if self.rungs[1:] else 0.0


def chart(scene: Scene, methods: Sequence[Method], plan: Plan = WHOLE) -> Study:
    """Measure all points of a scene's chart, rung by rung, and its terms."""
    fixed = reference_points(scene, plan)
    climbs = [_Climb(scene, ladder(scene, method, plan), plan.budget) for method in methods]
    asked = [AskedRun(scene, point) for point in fixed]
    held = [Task(answered, one, one.seconds) for one in asked]
    coarse, fine, *traces = yield Batch((*held, *ledger_tasks(scene)), later=len(climbs) * plan.budget)
    while under_way := [climb for climb in climbs if climb.goes_on()]:
        tasks = [_timed(scene, climb.rungs[0], climb.expected(climb.rungs[0])) for climb in under_way]
        samples = yield Batch(tasks, later=sum(climb.later for climb in under_way))
        for climb, sample in zip(under_way, samples, strict=True):
            climb.samples.append((climb.rungs.pop(0), sample))
    tried = {point for climb in climbs for point, _ in climb.samples}
    more = [point for method in methods for point in published(scene, method, plan) if point not in tried]
    samples = yield [_timed(scene, point, run_seconds(point, scene.output_times)) for point in more]
    charted = [pair for climb in climbs for pair in climb.samples]
    for point, sample in zip(more, samples, strict=True):
        last = max(i for i, (other, _) in enumerate(charted) if other.method == point.method)
        charted.insert(last + 1, (point, sample))
    truth = truth_of(scene, coarse, fine, asked[1].words)
    rows = [row_of(scene, truth, point, sample) for point, sample in charted]
    left_out = [f"{point.method.name} ({point.words})" for climb in climbs for point in climb.rungs]
    references = [
        Reference(point.method.name, point.words, answer.ending, answer)
        for point, answer in zip(fixed, (coarse, fine), strict=True)
    ]
    return _report(scene, Chart(truth.known, rows), references, ledger(scene, NEEDED, traces), left_out)


def _timed(scene: Scene, point: Numerics, seconds: float) -> Task:
    return Task(measured, AskedRun(scene, point), seconds, alone=True)


def in_words(chart: Chart) -> str:
    """The advice as one sentence, with seconds of one processor."""
    if not chart.advice:
        if ChartedQuantity.CONCENTRATION not in chart.quantities:
            return f"No advice: runs are held against {chart.known[ChartedQuantity.CONCENTRATION].source}."
        return "No run comes within an error of 1e-2."
    said = []
    for row, same in groupby(chart.advice, lambda one: one[1]):
        errors = " or ".join(_short(error) for error, _ in same)
        said.append(f"{errors} use {row.method} ({row.numerics}; {row.cpu:.2g} s)")
    return f"For an L2 error of {', of '.join(said)}."


def _short(value: float) -> str:
    """A number to one digit, its exponent without the zeros nobody reads."""
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def _report(
    scene: Scene,
    charted: Chart,
    references: Sequence[Reference],
    entries: Sequence[LedgerEntry],
    left_out: Sequence[str],
) -> Report:
    held = [Held(one, one.words, known.source, known.floor) for one, known in charted.known.items()]
    note = (
        "Times are medians of the repetitions, with the least and the most of them; kernels are units of the "
        "reference kernel beside the run. Memory is what the run needed at its peak beyond what its process "
        "had in use before. Cells × steps counts rejected steps too. Factorisations and solves of 0 were not "
        "counted."
    )
    if left_out:
        note = f"{note} Left out, for a method has so many seconds: {'; '.join(left_out)}."
    chapters = [_advice(charted), *(chapter_of(charted, work) for work in WORKS)]
    if entries:
        sheet = ledger_sheet(entries)
        chapters.append(Chapter("terms", "No more model than the scene needs", "", (sheet,)))
    return Report(
        f"Error against work: {scene.name}",
        "\n\n".join(_lead(scene, charted)),
        {
            "held": Table("What errors are held against", held, "0: exactly; nan: not at all."),
            "points": Table("All points", charted.rows, note, SHOWN),
            "reference": Table("Runs that others are held against", references),
            "ledger": Table("Terms", entries),
        },
        findings=(in_words(charted),),
        chapters=tuple(one for one in chapters if one.exhibits),
    )


def _lead(scene: Scene, chart: Chart) -> Iterator[str]:
    """What a reader must know before believing the chart, paragraph by paragraph."""
    if scene.citation:
        yield scene.citation
    if not scene.motion and (caveat := CAVEATS.get(scene.physics.closure)):
        yield caveat
    counts = ", ".join(f"{count} {one}" for one, count in Counter(row.standing for row in chart.rows).items())
    kernel = 1e3 * np.array([row.sample.kernel[:, 0] for row in chart.rows])
    yield (
        f"Every point is one run, in a process of its own, one after another: {len(chart.rows)} of them; by "
        f"their concentration {counts}. Colours are methods; a thin line joins what is worth its work within "
        "one, the stairs what is worth it among all (the Pareto front). Hollow points are not judged: their "
        "error is below the reference's own. Red ones are silently inaccurate: they complete, and are off by "
        f"more than {100 * WRONG:.0f} %. The unit of time is a reference kernel, a fixed sparse "
        "factorisation, solves and products, timed before and after each run: "
        f"{np.median(kernel):.3g} ms of wall time, from {kernel.min():.3g} to {kernel.max():.3g}."
    )
    waited = 1 - sum(row.sample.cpu.sum() for row in chart.rows) / sum(
        row.sample.wall.sum() for row in chart.rows
    )
    if waited > BUSY:
        yield (
            f"The machine was busy: runs waited for a processor in {100 * waited:.0f} % of their time. CPU "
            "time, by which the advice goes, is the better guide to what a quiet one would need."
        )


def _advice(chart: Chart) -> Chapter:
    head = ("For an error of", "use", "with", "it makes", "CPU, s", "kernels", "MB")
    rows = [
        (
            *(_short(error), row.method, row.numerics, f"{row.error_a:.2g}"),
            *(f"{row.cpu:.3g}", f"{row.cpu_kernels:.3g}", f"{row.megabytes:.2g}"),
        )
        for error, row in chart.advice
    ]
    sheets = (Sheet("advice", "The fastest run for each error", "", (head, *rows)),) if rows else ()
    return Chapter("advice", "Which method for which error", "", sheets)
