"""The smallest plan of every study, carried out once; what it was answered can be played again."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from actin_xcheck.cli.conduct import page_of
from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.parameters import Closure
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.runs.accuracy import LEVELS
from actin_xcheck.runs.method import METHODS
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies import theory
from actin_xcheck.studies.audit import paper
from actin_xcheck.studies.chart import chart
from actin_xcheck.studies.chart.measure import Plan
from actin_xcheck.studies.checks import Compared
from actin_xcheck.studies.closures import ROUGH_SCENE, closures
from actin_xcheck.studies.closures.measure import Course, Ripples
from actin_xcheck.studies.compare import compare, jobs_of
from actin_xcheck.studies.converge import converge
from actin_xcheck.studies.converge.plan import Refined, Refinement, refinements_of
from actin_xcheck.studies.converge.plan import RefinedLevel as Mesh
from actin_xcheck.studies.coverage import coverage
from actin_xcheck.studies.distort import distort
from actin_xcheck.studies.distort.cases import FAMILIES
from actin_xcheck.studies.extremes import extremes
from actin_xcheck.studies.extremes.attempt import Trial, TrialLevel
from actin_xcheck.studies.faults import FAULTS, hunt
from actin_xcheck.studies.faults.fault import Fault, unchanged
from actin_xcheck.studies.frontier import frontier
from actin_xcheck.studies.frontier.planes import Axis, Plane
from actin_xcheck.studies.journal import stated
from actin_xcheck.studies.random_scenes import CheckedScene, DrawnScene, random_scenes
from actin_xcheck.studies.study import Report, Study
from tests.claims import claim
from tests.lab import FEM, FV, scene_of
from tests.studies import carry

P1_IMEX, P2_IMEX = "fem-p1-imex2", "fem-p2-imex3"
STRONG = "fig18-nonuniform-contraction-viscoelastic"

CHARTED = Plan(
    8.0,
    ((P1_IMEX, 1, 1e-3), (P1_IMEX, 2, 1e-4)),
    refines=((2, 3), (1, 2)),
    steps_beside=(1.0,),
    tolerances_beside=(1.0,),
    published=False,
)

PLACES = Plane(
    Axis("psi", (40.0, 160.0, 640.0), 2, log=True),
    Axis("dt", (0.008, 0.032), 1, log=True),
)
"""Of a frontier: psi from where all is well to where first order is wrong."""

MAPPED = (METHODS[FEM], METHODS[P2_IMEX])

CURRENT, REFERENCE = Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL
RIMS = [
    Ripples(FEM, 2, CURRENT, modes=(2, 4)),
    Ripples(FEM, 2, CURRENT, advancing=False, modes=(2, 4)),
    Ripples(FEM, 2, REFERENCE, modes=(2, 4)),
    *(Course(ROUGH_SCENE, FEM, closure, level) for closure in (CURRENT, REFERENCE) for level in (0, 1)),
]
"""Of the closures: three kinds of ripples, then four runs."""

STILL = Compared("static-decay", (FEM, FV), 2, 10)
NOTHING = Fault("nothing", "Nothing is wrong.", "fv", "fv.krylov:solve", unchanged)

IN_SPACE = (Mesh(2, 4), Mesh(3, 16), Mesh(4, 64))
IN_TIME = tuple(Mesh(2, steps) for steps in (10, 20, 40, 80))


def mapped(methods=MAPPED) -> Study:
    """A frontier of a few places on coarse meshes, held against quick truths."""
    return frontier(load_scene("fig14-four-fronts"), [(one, PLACES) for one in methods], 3, (1, 4), (0, 2))


def coarse(name: str, *methods: str) -> list[Refinement]:
    """What is refined of a scene, on three coarse meshes and in four steps."""
    levels = {Refined.H: IN_SPACE, Refined.DT: IN_TIME}
    planned = refinements_of(load_scene(name), [METHODS[method] for method in methods])
    return [replace(one, levels=levels[one.refined]) for one in planned]


def checked(asked: DrawnScene, folder: Path) -> CheckedScene:
    """In place of many runs: a miss as long as the pressure pushes outwards."""
    value = 2.0 if parse_scene(asked.scene, asked.name).parameters.p > 0 else 0.5
    made = claim("they agree", value, kind=ClaimKind.TRIANGLE, quantity="area", scene=asked.name)
    return CheckedScene(asked.name, asked.scene, (made,))


def drawn(asked: tuple[str, str], folder: Path) -> theory.DrawnChapter:
    """In place of minutes of theory: tables by what was asked for."""
    keys = ("fig01", "fig02", "fig03", "fig21a") if asked[0] == "curves" else ("-".join(asked),)
    return theory.DrawnChapter(tuple(Sheet(key, key, "", (("a", "b"), ("1", "2"))) for key in keys))


SMALL: dict[str, Callable[[], Study]] = {
    "compare": lambda: compare(jobs_of([load_scene("static-decay")], [METHODS[FEM], METHODS[FV]], 3, 0.05)),
    "converge": lambda: converge(coarse("growing-disk", FEM, FV)),
    "chart": lambda: chart(load_scene("growing-disk"), [METHODS[FEM], METHODS[P2_IMEX]], CHARTED),
    "frontier": mapped,
    "closures": lambda: closures(RIMS),
    "distort": lambda: distort(
        [(load_scene("static-decay"), [FAMILIES["slivers"]])], [METHODS[P1_IMEX]], LEVELS[1:3]
    ),
    "extremes": lambda: extremes(
        [Trial(STRONG, TrialLevel(method, 2, 1e-4), epsilon=1e-10) for method in (P2_IMEX, "fem-p3-imex4")]
    ),
    "faults": lambda: hunt([FAULTS["fv-leak"], NOTHING], [STILL]),
    "paper": lambda: paper(["fig20a", "eq3.7"], said=True),
    "predict": theory.atlas,
    "coverage": lambda: coverage(
        [load_scene("static-decay"), scene_of("psi = 20\np = 0.3", a="1 + 0.1*x*(3 - r**2)", end=0.02)],
        [METHODS[P1_IMEX]],
        "coverage",
        finest={1: 3},
    ),
    "random": lambda: random_scenes(3, 3),
}
"""By the name of the study's file."""

STAND_INS: dict[str, Callable[[Any, Path], Any]] = {"predict": drawn, "random": checked}
"""Of studies whose computations are of no interest where these are used."""


@dataclass
class Played:
    """Processes without processes: an answer that is known is given again, with the files it left."""

    folder: Path
    answers: dict[str, Any]
    stand_in: Callable[[Any, Path], Any] | None = None
    after: int | None = None
    asked: list[str] = field(default_factory=list)
    files: dict[str, tuple[str, ...]] = field(default_factory=dict)
    workers = 1

    def results(self, work, tasks):
        """As an `Executor`'s; interrupted after so many tasks."""
        yield from ((number, self.alone(work, task)) for number, task in enumerate(tasks))

    def alone(self, work, asked):
        """As `work_alone`."""
        if len(self.asked) == self.after:
            raise KeyboardInterrupt
        task = asked.task
        self.asked.append(key := f"{task.work.__qualname__} {stated(task.ask)}")
        self.files[key] = task.files
        if self.stand_in and key not in self.answers:
            self.answers[key] = self.stand_in(task.ask, asked.folder)
            for file in task.files:
                (asked.folder / file).parent.mkdir(parents=True, exist_ok=True)
                (asked.folder / file).write_text(key)
        elif key not in self.answers:
            self.answers[key] = work(asked)
        elif asked.folder != self.folder:
            for file in task.files:
                (asked.folder / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(self.folder / file, asked.folder / file)
        return self.answers[key]


@dataclass(frozen=True)
class Carried:
    """A study that was carried out in a folder: what it came to; by question, what was answered and left."""

    name: str
    folder: Path
    report: Report
    answers: dict[str, Any]
    files: dict[str, tuple[str, ...]]

    @property
    def file(self) -> Path:
        return self.folder / f"{self.name}.h5"

    @property
    def study(self) -> Callable[[], Study]:
        return SMALL[self.name]

    def played(self, after: int | None = None) -> Played:
        return Played(self.folder, self.answers, after=after)

    def again(self, folder: Path, processes: Played) -> Report:
        return carry(folder, self.study(), processes, self.name, alone=processes.alone)


def carried_out(name: str, folder: Path) -> Carried:
    """Carry a small study out, and write its page."""
    played = Played(folder.resolve(), {}, STAND_INS.get(name))
    report = carry(folder, SMALL[name](), played, name, alone=played.alone)
    page_of(folder / f"{name}.h5")
    return Carried(name, folder.resolve(), report, played.answers, played.files)
