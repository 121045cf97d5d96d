"""Is an uncertainty worth its name?  How often what is stated covers the true error, and by how much.

Each scene is run by each method on a ladder of meshes.  Every three neighbours state, as in a comparison,
an uncertainty of each number of the finest of them, and the truth is known: an exact solution, an exact
mode, a printed reference, or a run that was asked for a hundredth.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, shares
from actin_xcheck.runs.accuracy import deliver
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.numerics import Numerics, suited
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene import draw
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.stored import Stored, companions_of, run_and_read
from actin_xcheck.studies.study import Batch, Report, Study, Table, Task
from actin_xcheck.verdicts.known import known
from actin_xcheck.verdicts.triangulate import QUANTITIES, Levels, estimate, reaches

KNOWN = (
    *("static-decay", "growing-disk", "stirred", "manufactured-static", "manufactured-moving"),
    *("fig12-mixed-31-02-21", "fig14-four-fronts", "fig16-uniform-expansion", "fig17-uniform-contraction"),
    *("mode-11-wall", "mode-0-cell", "mode-1-cell", "mode-1-free-cell", "mode-1-viscous-cell", "mode-2-cell"),
)
"""Scenes with numbers that are known without running them."""

STATING = (
    *("fem-p1-paper", "fem-p1-imex2", "fem-p2-imex3", "fem-p3-imex4", "fem-p4-imex4"),
    *("fv-paper", "fv", "fv-coupled", "fv-order2"),
)
"""Methods that declare an order in space."""

FINEST = {1: 5, 2: 4, 3: 3, 4: 3}
"""Refinement of a ladder's finest mesh, by the order of elements; volumes have the first."""

RTOL = 1e-5
"""Of the finest run where steps have a tolerance."""

TRUTH = 1e-6
"""Accuracy of a run that stands for the truth of a scene that was drawn."""

RESOLVED = 10.0
"""Times what the truth is known to: a triplet counts where what is stated, or the true error, exceeds it."""

TRIVIAL = 1e-10
"""Errors up to this are round-off or exact by construction, and no test of an uncertainty."""

MISSED = 0.05
"""Share of triplets whose true error may exceed what is stated: an uncertainty of 95 %."""

GENEROUS = 5.0
"""Times the true error, the most that is stated for half of the triplets."""


@dataclass(frozen=True)
class Triplet:
    """A number of the finest of three levels.

    Attributes
    ----------
    scene, method : what was run.
    refine : of the finest of the three levels.
    rtol : its tolerance of a step; nan with equal steps.
    quantity, time : which number.
    stated : its uncertainty.
    error : its distance from the truth.
    how : how the uncertainty came about.
    """

    scene: str
    method: str
    refine: int
    rtol: float
    quantity: str
    time: float
    stated: float
    error: float
    how: str

    @property
    def covered(self) -> bool:
        """Whether the true error is no larger than what is stated."""
        return self.error <= self.stated


@dataclass(frozen=True)
class StatedErrors:
    """What a ladder states; triplets whose truth is not known well enough, or round-off, are left out."""

    triplets: tuple[Triplet, ...]


@dataclass(frozen=True)
class TruthRun:
    """How well the truth of a scene is known: the estimated error of its run, nan where it broke down."""

    estimate: float


@dataclass(frozen=True)
class AskedLadder:
    """A question: the finest run, and the file of the run that stands for the truth, where none is known."""

    finest: Stored
    truth: str


@dataclass(frozen=True)
class CoverageRow:
    """What the triplets of a method or a quantity come to.

    Attributes
    ----------
    of : which.
    triplets : how many.
    covered : share whose true error is covered.
    median : of stated over true.
    worst : the largest error over what is stated.
    """

    of: str
    triplets: int
    covered: float
    median: float
    worst: float


def coverage(
    scenes: Sequence[Scene], methods: Sequence[Method], made: str, finest: Mapping[int, int] = FINEST
) -> Study:
    """Hold every uncertainty that ladders of levels state against the true error.

    Parameters
    ----------
    scenes : where nothing is known of one, a run stands for its truth; such that break down are left out.
    methods : that declare an order in space.
    made : the command that makes the report again.
    finest : refinement of a ladder's finest mesh, by the order of elements.
    """
    unknown = [scene for scene in scenes if not _is_known(scene)]
    ladders = [
        Task(climb, one, _seconds(one)) for scene in scenes for one in _ladders(scene, methods, finest)
    ]
    truths: list[TruthRun] = []
    if unknown:
        later = sum(task.seconds for task in ladders)
        truths = yield Batch([Task(true, one, 20.0, (_file(one),)) for one in unknown], later)
    broken = {one.name for one, truth in zip(unknown, truths, strict=True) if np.isnan(truth.estimate)}
    found: list[StatedErrors] = yield [task for task in ladders if task.ask.finest.scene.name not in broken]
    return _report([triplet for one in found for triplet in one.triplets], made)


def drawn(seed: int, count: int) -> list[Scene]:
    """Scenes drawn by a seed."""
    names = [f"random-{seed}-{number}" for number in range(count)]
    return [parse_scene(draw.written(draw.drawn(seed, i)), name) for i, name in enumerate(names)]


def _is_known(scene: Scene) -> bool:
    expected = scene.expect
    return bool(expected.exact or expected.reference or expected.growth_rate)


def _file(scene: Scene) -> str:
    return f"truth--{scene.name}.vtkhdf"


def true(scene: Scene, folder: Path) -> TruthRun:
    """Leave a run that stands for the truth in the study's folder."""
    return TruthRun(deliver(scene, TRUTH, folder / _file(scene), "").estimate)


def _ladders(scene: Scene, methods: Sequence[Method], finest: Mapping[int, int]) -> Iterator[AskedLadder]:
    """A scene by every method, with equal steps and, where it is adaptive, with a tolerance."""
    truth = "" if _is_known(scene) else _file(scene)
    for method in methods:
        refine, (_, dt) = finest[method.space], suited(scene)
        for rtol in (None, RTOL) if method.adaptive else (None,):
            yield AskedLadder(Stored(scene, Numerics(method, refine, dt, rtol), "run.vtkhdf"), truth)


def _levels(finest: Stored) -> list[Stored]:
    return [finest, *companions_of(finest, finest.numerics.refine - 1)]


def _seconds(ladder: AskedLadder) -> float:
    return sum(job.seconds for job in _levels(ladder.finest))


def climb(ladder: AskedLadder, folder: Path) -> StatedErrors:
    """Run a ladder, and hold what every three neighbouring levels state against the truth."""
    scene, method = ladder.finest.scene, ladder.finest.numerics.method
    truth = read_run(folder / ladder.truth) if ladder.truth else None
    jobs = _levels(ladder.finest)
    with tempfile.TemporaryDirectory() as place:
        runs = [run_and_read(scene, job.numerics, Path(place) / job.file) for job in jobs]
    found = [
        triplet
        for finest in range(len(jobs) - 2)
        for triplet in _triplets(scene, Levels(method, tuple(runs[finest : finest + 3])), truth)
    ]
    return StatedErrors(tuple(found))


def _triplets(scene: Scene, levels: Levels, truth: Run | None) -> Iterator[Triplet]:
    finest = levels.runs[0]
    for quantity in QUANTITIES:
        for t in scene.output_times:
            last = t == scene.output_times[-1]
            exact = _truth(scene, quantity, t, truth)
            if exact is None or not exact[0].size or not reaches(finest, t):
                continue
            if quantity == "growth_rate" and not last:
                continue
            values, stated, how, _ = estimate(scene, levels, quantity, t)
            error = float(np.nanmax(np.abs(values - exact[0]), initial=0.0))
            trivial = error <= TRIVIAL * max(1.0, float(np.abs(values).max(initial=0.0)))
            if np.isfinite(stated) and not trivial and max(stated, error) > RESOLVED * exact[1]:
                yield Triplet(
                    scene=scene.name,
                    method=levels.method.name,
                    refine=int(finest.attributes["refine"]),
                    rtol=float(finest.attributes["rtol"]),
                    quantity=quantity,
                    time=t,
                    stated=stated,
                    error=error,
                    how=how,
                )


def _truth(scene: Scene, quantity: str, t: float, truth: Run | None) -> tuple[Array, float] | None:
    """True values (k,) in the scene's frame and what they are known to; None where they are not."""
    if truth is None:
        found = known(scene, quantity, t)
        return None if found is None else (found.values, found.uncertainty)
    if quantity not in truth.series:
        return None
    value = np.asarray(truth.row_at(t)[quantity], dtype=float)
    value = np.ravel(value @ turn_matrix(scene) if quantity == "probe_x" else value)
    size = float(np.abs(value).max(initial=0.0)) if quantity in ("area", "total_actin") else 1.0
    return value, float(truth.attributes["error_estimate"]) * size


def _row(of: str, triplets: Sequence[Triplet]) -> CoverageRow:
    stated, error = (np.array([getattr(one, name) for one in triplets]) for name in ("stated", "error"))
    with np.errstate(divide="ignore"):
        ratios = stated / error
    return CoverageRow(
        of=of,
        triplets=len(triplets),
        covered=float(np.mean(error <= stated)),
        median=float(np.median(ratios)),
        worst=float(1 / ratios.min()),
    )


def _report(triplets: Sequence[Triplet], made: str) -> Report:
    by_method = _grouped(triplets, "method")
    rows = [_row("all", triplets), *(_row(name, group) for name, group in by_method.items())]
    missed = [triplet for triplet in triplets if not triplet.covered]
    return Report(
        title=f"{len(triplets)} uncertainties: {100 * rows[0].covered:.1f} % cover the true error",
        lead="What three levels of meshes state, held against an exact solution, an exact mode, a reference "
        f"or a run of accuracy {TRUTH:g}.  Triplets whose truth is not known {RESOLVED:g} times better than "
        "that, and those of round-off, are left out.",
        tables={
            "methods": Table("By method", rows),
            "quantities": Table(
                "By quantity", [_row(name, group) for name, group in _grouped(triplets, "quantity").items()]
            ),
            "missed": Table("Not covered", sorted(missed, key=lambda one: one.stated / one.error)),
        },
        claims=tuple(_claims(rows, made)),
        chapters=(_chapter(by_method),),
    )


def _grouped(triplets: Sequence[Triplet], of: str) -> dict[str, list[Triplet]]:
    groups: dict[str, list[Triplet]] = {}
    for triplet in triplets:
        groups.setdefault(getattr(triplet, of), []).append(triplet)
    return groups


def _claims(rows: Sequence[CoverageRow], made: str) -> Iterator[Claim]:
    """That nearly all cover the true error, of all methods and of each; that half of all are near it."""

    def claim(row: CoverageRow, quantity: str, statement: str, value: float, bound: float) -> Claim:
        return Claim(
            kind=ClaimKind.COVERAGE,
            quantity=quantity,
            scene="coverage",
            methods=() if row.of == "all" else (row.of,),
            statement=f"of {row.triplets} uncertainties {statement}",
            value=value,
            bound=bound,
            command=made,
            path="/tables/methods",
        )

    for row in rows:
        yield claim(
            row, "missed", "all but one in twenty cover the true error (share)", 1 - row.covered, MISSED
        )
    near = "half are near the true error (median of stated over true)"
    yield claim(rows[0], "generous", near, rows[0].median, GENEROUS)


def _chapter(by_method: dict[str, list[Triplet]]) -> Chapter:
    """How far stated uncertainties are from the true error, over the share of triplets."""
    plot = shares(
        "Share of uncertainties below a multiple of the true error",
        "Left of 1 the true error is larger than what is stated.",
        "stated over true",
        "true",
        {name: [one.stated / one.error for one in group if one.error] for name, group in by_method.items()},
    )
    return Chapter("ratios", "How near to the true error", "", (plot,))
