"""Scenes that nobody chose, drawn by a seed: do the codes agree wherever a scene can lead?

Each is run by finite elements and finite volumes on three meshes, by every smaller model that is
exact for it, and turned, reflected and in other units on a coarse mesh.  A scene that misses is made simpler
as long as it still misses, and left as a file that `compare` takes.
"""

import math
import tempfile
from collections.abc import Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import ClassVar

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.core.lagrange import least_dilation
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, shares
from actin_xcheck.runs.accuracy import change
from actin_xcheck.runs.fidelity import FULL, Fidelity, Reduction, reduced
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import Method, find_method
from actin_xcheck.runs.numerics import Numerics, command
from actin_xcheck.runs.run import bind, run
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene import draw
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.stored import Stored, companions_of, leave_scene, run_and_read
from actin_xcheck.studies.study import Report, Study, Table, Task, counted
from actin_xcheck.verdicts.judge import judge
from actin_xcheck.verdicts.triangulate import Levels, triangulate

METHODS = ("fem-p3-imex4", "fv")
"""One of each family; all that they share are the equations."""

REFINE = {"fem": 3, "fv": 4}
"""Their finest meshes, beside coarser ones: where h errs by a thousandth, uncertainties say so."""

COARSE = 2
"""The coarsest of finest meshes: one beside it is coarser."""

NEAR = 0.05
"""Smallest 1 + phi that codes are held to: on these meshes phi is known to some hundredths."""

STEPS = 16
RTOL = 1e-4

ALIKE_REFINE, ALIKE_STEPS = 2, 8
"""Where round-off alone may tell runs apart."""

SAME = 1e-9
"""Relative difference of runs that differ in round-off, which contraction amplifies."""

NEGLECTED = 1e-9
"""What a model of linear modes may leave out."""

SECONDS = 3.0
"""Of a scene on one core, about."""

ROUNDS, COARSEST = 8, 1
"""Of making a scene simpler; how often its meshes may be halved."""


@dataclass(frozen=True)
class DrawnScene:
    """A question: a scene's text, what it is called, and how often h and the number of steps are halved."""

    scene: str
    name: str
    coarser: int = 0


@dataclass(frozen=True)
class CheckedScene:
    """What was found of a scene.

    Attributes
    ----------
    name, scene : the scene and its text.
    claims : all that was asked of it.
    """

    name: str
    scene: str
    claims: tuple[Claim, ...]

    @property
    def worst(self) -> Claim:
        """The claim that is furthest from holding."""
        return max((claim for claim in self.claims if claim.judged), key=_ratio)

    @property
    def misses(self) -> bool:
        """Whether a claim fails."""
        return any(claim.judged and not claim.holds for claim in self.claims)


@dataclass(frozen=True)
class RandomRow:
    """A scene in the table of all.

    Attributes
    ----------
    name, rheology, closure, delta : the scene.
    worst : the claim that is furthest from holding.
    ratio : its value over its bound.
    misses : whether a claim fails.
    """

    name: str
    rheology: str
    closure: str
    delta: str
    worst: str
    ratio: float
    misses: bool


def _ratio(claim: Claim) -> float:
    """Value over bound; infinite where there is no value, 0 where both are 0."""
    if not math.isfinite(claim.value):
        return math.inf
    return claim.value / claim.bound if claim.bound else math.inf if claim.value else 0.0


def random_scenes(seed: int, count: int, first: int = 0) -> Study:
    """Draw scenes, check each, and make those that miss as simple as they can be."""
    numbers = range(first, first + count)
    asked = [_drawn(seed, number) for number in numbers]
    found = yield [_task(one) for one in asked]
    shrunk: list[CheckedScene] = []
    for question, checked in zip(asked, found, strict=True):
        if checked.misses:
            shrunk.append((yield from _shrink(question, checked)))
    claims = tuple(_holds(one, one.name, seed, number) for one, number in zip(found, numbers, strict=True))
    findings = tuple(
        f"{one.name}: the simplest scene that misses is scenes/{one.name}.toml: {one.worst.sentence}"
        for one in shrunk
    )
    return Report(
        title=counted(claims, f"scenes of seed {seed} hold"),
        lead="Each scene is run by both codes, by every smaller model that is exact for it, turned, "
        "reflected and in other units.  A scene holds when all of that agrees within what it is known to.",
        tables={
            "scenes": Table("Scenes", [_row(one) for one in found]),
            "simplest": Table("Simplest scenes that miss", [_row(one) for one in shrunk]),
        },
        claims=claims,
        findings=findings,
        chapters=(_chapter(found),),
        command=command("random", seed=seed, count=count, first=first),
    )


def seed_of_today() -> int:
    """The date as a number, such as 20261130."""
    return int(f"{date.today():%Y%m%d}")


def _drawn(seed: int, number: int) -> DrawnScene:
    return DrawnScene(draw.written(draw.drawn(seed, number)), f"random-{seed}-{number}")


def _holds(checked: CheckedScene, scene: str, seed: int, number: int) -> Claim:
    """What a scene comes to: the claim that is furthest from holding, in bounds."""
    made = command("random", seed=seed, count=1, first=number)
    return replace(checked.worst, scene=scene, value=_ratio(checked.worst), bound=1.0, command=made)


@dataclass(frozen=True)
class OfTheDate:
    """A night's check: scenes that the date draws, which are others every night.

    Attributes
    ----------
    first, count : which of them.
    """

    first: int
    count: int
    bounded: ClassVar[bool] = False  # steps are chosen by their error

    @property
    def name(self) -> str:
        """The words of the command but for the seed, which every claim's command states."""
        return f"random scenes {self.first} to {self.first + self.count - 1} of the date"

    @property
    def seconds(self) -> float:
        """About what it takes on one core."""
        return SECONDS * self.count

    def claims(self, folder: Path) -> list[Claim]:
        """One of each scene, which has the same key every night."""
        seed = seed_of_today()
        return [
            replace(
                _holds(check(_drawn(seed, number), folder), f"random scene {number}", seed, number),
                kind=ClaimKind.OTHER,
                quantity="",
                methods=METHODS,
            )
            for number in range(self.first, self.first + self.count)
        ]


def _task(asked: DrawnScene) -> Task:
    return Task(check, asked, seconds=SECONDS / 3**asked.coarser)


def _shrink(
    asked: DrawnScene, checked: CheckedScene
) -> Generator[Sequence[Task], list[CheckedScene], CheckedScene]:
    """Ask for ever simpler scenes, on ever coarser meshes, that still miss as this one does."""
    kind, quantity = checked.worst.kind, checked.worst.quantity

    def still(one: CheckedScene) -> bool:
        return any(
            claim.judged and not claim.holds and (claim.kind, claim.quantity) == (kind, quantity)
            for claim in one.claims
        )

    for _ in range(ROUNDS):
        scene = draw.read(asked.scene)
        candidates = [replace(asked, scene=draw.written(one)) for one in draw.simpler(scene)]
        if asked.coarser < COARSEST:
            candidates.insert(0, replace(asked, coarser=asked.coarser + 1))
        answers = yield [_task(one) for one in candidates]
        simpler = next(
            ((one, answer) for one, answer in zip(candidates, answers, strict=True) if still(answer)), None
        )
        if simpler is None:
            break
        asked, checked = simpler
    yield [Task(keep, asked, files=(f"scenes/{asked.name}.toml",))]
    return checked


def keep(asked: DrawnScene, folder: Path) -> CheckedScene:
    """Leave a scene as a file, and check it again there."""
    checked = check(asked, folder)
    leave_scene(folder, f"scenes/{asked.name}.toml", checked.scene)
    return checked


def check(asked: DrawnScene, folder: Path) -> CheckedScene:
    """Run a scene in every way that must agree, and say what does.

    One in which the model breaks down, or all but does, or the mesh folds, is ended half way there: how that
    ends is `extremes`'s question.
    """
    with tempfile.TemporaryDirectory() as place, np.errstate(all="ignore"):
        asked = replace(asked, scene=_lasting(asked.scene))
        scene = parse_scene(asked.scene, f"scenes/{asked.name}.toml")
        claims = [*_codes(scene, asked.coarser, Path(place)), *_alike(scene, Path(place))]
    return CheckedScene(asked.name, asked.scene, tuple(claims))


def _lasting(text: str) -> str:
    """A scene's text, up to half the time at which the model breaks down, or all but does, or its mesh."""
    scene = parse_scene(text, "drawn")
    if scene.mode is not None:
        return text
    numerics = Numerics(find_method(METHODS[0]), COARSE, scene.time.end / STEPS, RTOL)
    solver = bind(scene, numerics)
    march = March(solver, numerics, scene.output_times)
    for moment in march:
        if scene.physics.breaks_down and least_dilation(solver.grid, solver.frame(moment.state).x)[0] < NEAR:
            break
    else:
        if march.outcome.ending not in (Ending.SINGULAR_DILATION, Ending.TANGLED):
            return text
    return draw.written(draw.until(draw.read(text), march.state.t / 2))


def _codes(scene: Scene, coarser: int, place: Path) -> Iterator[Claim]:
    """Both codes and all smaller models on several meshes each: they end, conserve and agree.

    They agree where they are no further apart than the sum of their uncertainties.
    """
    elements, volumes = (_levels(scene, find_method(name), FULL, coarser, place) for name in METHODS)
    for one in (elements, volumes):
        for claim in judge(scene, {one.method.name: one.runs[0]}):
            if claim.kind in (ClaimKind.ENDS, ClaimKind.CONSERVATION):
                yield replace(claim, command=_again(scene))
    for triangle in triangulate(scene, [elements, volumes]):
        yield triangle.claim(_again(scene))
    for reduction in _reductions(scene, elements.method):
        smaller = _levels(scene, elements.method, reduction, coarser, place)
        for triangle in triangulate(scene, [smaller, volumes]):
            claim = triangle.claim(_again(scene))
            statement = f"{reduction.fidelity} instead of the whole cell: {claim.statement}"
            yield replace(claim, kind=ClaimKind.REDUCTION, statement=statement)


def _again(scene: Scene) -> str:
    return command("compare", scene.origin, method=METHODS)


def _levels(scene: Scene, method: Method, reduction: Reduction, coarser: int, place: Path) -> Levels:
    """Runs of a scene as they are stored, the finest first, and coarser ones."""
    dt, rtol = scene.time.end / STEPS * 2**coarser, RTOL * 10**coarser if method.adaptive else None
    numerics = Numerics(method, max(REFINE[method.family] - coarser, COARSE), dt, rtol, reduction)
    finest = Stored(scene, numerics, "run.vtkhdf")
    runs = tuple(
        run_and_read(scene, job.numerics, place / job.file) for job in (finest, *companions_of(finest))
    )
    return Levels(method, runs, reduction.bound if reduction.fidelity is Fidelity.MODAL else 0.0)


def _reductions(scene: Scene, method: Method) -> Iterator[Reduction]:
    """Every smaller model that is exact for a scene."""
    for fidelity in (Fidelity.SECTOR, Fidelity.RADIAL, Fidelity.MODAL):
        with suppress(UserError):  # where it is not
            yield reduced(scene, method, fidelity, NEGLECTED)


def _alike(scene: Scene, place: Path) -> Iterator[Claim]:
    """Both codes on scenes that differ by what must not matter."""
    for name in METHODS:
        method = find_method(name)
        own = _short(scene, method, place)
        for what, other in draw.alike(draw.read(scene.text)).items():
            there = _short(parse_scene(draw.written(other), what), method, place)
            if what == "a reflection":
                there = _seen(there, np.diag([1.0, -1.0]))
            yield Claim(
                kind=ClaimKind.INVARIANCE,
                quantity=what,
                scene=scene.name,
                methods=(name,),
                statement=f"{what} changes nothing (largest change of area, total actin and probes)",
                value=_apart(own, there, scene.output_times),
                bound=SAME,
                command=_again(scene),
                path="",
                note="they differ in round-off",
            )


def _apart(own: Run, there: Run, times: Sequence[float]) -> float:
    """The largest change at times that both runs reach, t = 0 at least; nan where they end differently."""
    if own.attributes["outcome"] != there.attributes["outcome"]:
        return math.nan
    last = min(float(run.series["time"][-1]) for run in (own, there)) * (1 + 1e-12)
    return change(own, there, [t for t in times if t <= last] or [0.0])


def _short(scene: Scene, method: Method, place: Path) -> Run:
    """A run in few steps on a coarse mesh, in the scene's own frame."""
    path = place / "short.vtkhdf"
    run(scene, Numerics(method, ALIKE_REFINE, scene.time.end / ALIKE_STEPS), path)
    return _seen(read_run(path), turn_matrix(scene))


def _seen(there: Run, matrix: Array) -> Run:
    """A run whose probes and centroid are seen in another frame."""
    turned = {name: there.series[name] @ matrix for name in ("probe_x", "centroid")}
    return replace(there, series=there.series | turned)


def _row(checked: CheckedScene) -> RandomRow:
    model, worst = parse_scene(checked.scene, checked.name).model, checked.worst
    return RandomRow(
        name=checked.name,
        rheology=str(model.rheology),
        closure=str(model.closure),
        delta=str(model.delta),
        worst=f"{worst.kind} {worst.quantity} {worst.statement}",
        ratio=_ratio(worst),
        misses=checked.misses,
    )


def _chapter(found: Sequence[CheckedScene]) -> Chapter:
    """How far from its bound each kind of claim stays, over the share of scenes."""
    ratios: dict[str, list[float]] = {}
    for claim in (claim for one in found for claim in one.claims if claim.judged):
        ratios.setdefault(f"{claim.kind} {claim.quantity}".strip(), []).append(_ratio(claim))
    words = "Share of claims below a part of their bound", "Beyond 1 a claim fails.", "value over bound"
    return Chapter("ratios", "How close to their bounds", "", (shares(*words, "bound", ratios),))
