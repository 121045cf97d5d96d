"""Checks of the harness, which faults are held against: its own judges, on scenes and levels of a second.

A check is a few runs and the claims that are made of them: those of `compare`, observed orders of
`converge`, and what smaller models and chosen steps must keep to.  Nothing here judges; it chooses what is
judged.  Every claim must hold without a fault.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from actin_xcheck.core.claim import Claim
from actin_xcheck.runs.fidelity import Fidelity, Reduction, reduced
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics, command
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene, load_scene, parse_scene
from actin_xcheck.studies.balances import LOADS, Balanced
from actin_xcheck.studies.compare import compare, jobs_of
from actin_xcheck.studies.converge import converge
from actin_xcheck.studies.converge.plan import Refined, refinements_of
from actin_xcheck.studies.faults import Check
from actin_xcheck.studies.stored import run_and_read
from actin_xcheck.studies.study import carry_out_here
from actin_xcheck.verdicts.judge import judge, keeps_tolerance, same_as_whole


@dataclass(frozen=True)
class Compared:
    """A scene by one method or by two, as `compare` runs and judges it.

    Attributes
    ----------
    scene, methods, refine : what is run.
    steps : how many steps it is cut into at least.
    rtol : for the adaptive methods, in place of steps.
    """

    scene: str
    methods: tuple[str, ...]
    refine: int
    steps: int = 50
    rtol: float | None = None

    @property
    def name(self) -> str:
        """The words of the command."""
        return " ".join(["compare", self.scene, *self.methods, f"refine {self.refine}"])

    @property
    def bounded(self) -> bool:
        """Not where steps are chosen by their error."""
        return self.rtol is None

    def claims(self, folder: Path) -> list[Claim]:
        """What is claimed of each run, of pairs of them, and of triangles with theory."""
        scene = load_scene(self.scene)
        methods = [find_method(name) for name in self.methods]
        jobs = jobs_of([scene], methods, self.refine, scene.time.end / self.steps, self.rtol)
        return list(carry_out_here("compare", compare(jobs), folder, again(self)).claims)


FREE_CELL = "free-cell"
FREE_CELL_TEXT = f"""
name = "{FREE_CELL}"
source = "A mode of a free cell whose loads do not balance, without the pressure that costs an order"
[parameters]
psi = 200
p = 0
[model]
closure = "traction-free"
delta = "none"
[initial]
a = "1"
eigenmode = {{ m = 1, n = 1, amplitude = 1e-6 }}
[time]
end = 0.5
[expect.growth_rate]
m = 1
n = 1
window = [0, 0.5]
bound = {{ h2 = 14, dt = 7.2 }}
"""


@dataclass(frozen=True)
class Studied:
    """The first levels on which `converge` itself refines a scene by a method.

    Attributes
    ----------
    scene, method, refined : what is refined.
    levels : how many of their levels, coarsest first.
    quantities : of which an order shows on so few levels.
    """

    scene: str
    method: str
    refined: Refined
    levels: int
    quantities: tuple[str, ...]
    bounded: ClassVar[bool] = True  # all levels have their numbers of steps

    @property
    def name(self) -> str:
        """The words of the command."""
        return f"converge {self.scene} {self.method} in {self.refined}"

    def claims(self, folder: Path) -> list[Claim]:
        """That the orders are those which are declared."""
        own = self.scene == FREE_CELL
        scene = parse_scene(FREE_CELL_TEXT, f"{FREE_CELL}.toml") if own else load_scene(self.scene)
        asked = [
            replace(one, levels=one.levels[: self.levels])
            for one in refinements_of(scene, [find_method(self.method)])
            if one.refined is self.refined and one.quantity in self.quantities
        ]
        report = carry_out_here("converge", converge(asked), folder, again(self))
        return [replace(claim, command=again(self)) for claim in report.claims]


def again(check: Check) -> str:
    """What makes a check again where no command has its levels or smaller models: a night of it alone."""
    return command("nightly", only=check.name)


@dataclass(frozen=True)
class Reduced:
    """A smaller model of a scene, judged like any run; a sector is held against the whole cell too.

    Attributes
    ----------
    scene, method, fidelity, refine : what is run.
    steps : how many steps it is cut into at least.
    rtol : what linear modes may neglect, in which case steps are chosen by their error too.
    """

    scene: str
    method: str
    fidelity: Fidelity
    refine: int
    steps: int = 50
    rtol: float | None = None

    @property
    def name(self) -> str:
        """The words of the command."""
        return f"run {self.scene} {self.method} refine {self.refine} fidelity {self.fidelity}"

    @property
    def bounded(self) -> bool:
        """Linear modes are exact for a step of any length."""
        return self.rtol is None or self.fidelity is Fidelity.MODAL

    def claims(self, folder: Path) -> list[Claim]:
        """What the scene expects, and that a sector is the whole."""
        scene, method = load_scene(self.scene), find_method(self.method)
        reduction = reduced(scene, method, self.fidelity, self.rtol)
        part = self._run(scene, folder, reduction)
        claims = judge(scene, {self.method: part})
        if self.fidelity is Fidelity.SECTOR:
            whole = replace(reduction, fidelity=Fidelity.FULL, symmetry=None)  # on the same mesh
            claims.append(same_as_whole(scene, self.method, part, self._run(scene, folder, whole)))
        return claims

    def _run(self, scene: Scene, folder: Path, reduction: Reduction) -> Run:
        dt, method = scene.time.end / self.steps, find_method(self.method)
        numerics = Numerics(method, self.refine, dt, self.rtol, reduction)
        return run_and_read(scene, numerics, folder / f"{reduction.fidelity}.vtkhdf", again(self))


@dataclass(frozen=True)
class Tolerated:
    """A scene with steps chosen by a tolerance, and by a smaller one.

    Attributes
    ----------
    scene, method, refine, rtol : what is run.
    smaller : by how much the other tolerance is.
    """

    scene: str
    method: str
    refine: int
    rtol: float
    smaller: float = 30.0
    bounded: ClassVar[bool] = False  # steps are chosen by their error

    @property
    def name(self) -> str:
        """The words of the command."""
        return f"run {self.scene} {self.method} refine {self.refine} rtol {self.rtol:g}"

    def claims(self, folder: Path) -> list[Claim]:
        """That the tolerance is kept."""
        scene, method = load_scene(self.scene), find_method(self.method)
        numerics = [
            Numerics(method, self.refine, scene.time.end, rtol)
            for rtol in (self.rtol, self.rtol / self.smaller)
        ]
        runs = [run_and_read(scene, one, folder / f"{one.rtol:g}.vtkhdf", again(self)) for one in numerics]
        return [*judge(scene, {self.method: runs[0]}), keeps_tolerance(scene, self.method, *runs)]


PAPER, FV = "fem-p1-paper", "fv-coupled"
IMEX, CURVED, FV_2 = "fem-p1-imex2", "fem-p2-imex3", "fv-order2"
OWN = "fv"
FIELD, AREA, RATE = "concentration", "area", "growth_rate"

SUITE: tuple[Check, ...] = (
    Compared("static-decay", (PAPER, FV), 3),
    Compared("mode-11-wall", (PAPER, FV), 3),
    Compared("mode-1-cell", (PAPER,), 4),
    Compared("fig14-four-fronts", (PAPER,), 4, steps=80),
    Compared("fig16-uniform-expansion", (PAPER,), 4),
    Compared("fig14-four-fronts", (CURVED, FV_2), 3, rtol=1e-4),
    Compared("mode-1-free-cell", (CURVED, FV_2), 3),
    Compared("fig14-four-fronts", (CURVED, OWN), 3, rtol=1e-4),
    Compared("fitted-ring-elastic", (CURVED, OWN), 3),
    Compared("growing-disk", (IMEX, OWN), 4),  # on coarser meshes area is known to two parts in a hundred
    Compared("mode-11-wall", (IMEX, OWN), 3),
    Compared("mode-1-free-cell", (CURVED, OWN), 3),
    *map(Balanced, LOADS),
    Studied("manufactured-moving", PAPER, Refined.H, 4, (FIELD,)),
    Studied("manufactured-moving", IMEX, Refined.H, 4, (FIELD,)),
    Studied("manufactured-moving", FV, Refined.H, 4, (FIELD,)),
    Studied("manufactured-moving", FV_2, Refined.H, 4, (FIELD,)),
    Studied("smooth-fronts", IMEX, Refined.DT, 5, (FIELD, AREA)),
    Studied("smooth-fronts", FV_2, Refined.DT, 5, (FIELD,)),
    Studied("fitted-ring", IMEX, Refined.H, 4, (AREA,)),
    Studied("fitted-ring", CURVED, Refined.H, 4, (AREA,)),
    Studied("fitted-ring", CURVED, Refined.DT, 5, (FIELD, AREA)),
    Studied("mode-1-cell", CURVED, Refined.H, 4, (RATE,)),
    Studied(FREE_CELL, CURVED, Refined.H, 4, (RATE,)),
    Reduced("fig14-four-fronts", CURVED, Fidelity.SECTOR, 2, 40),
    Reduced("smooth-fronts", PAPER, Fidelity.SECTOR, 3, 40),
    Reduced("mode-0-cell", "fem-p4-imex4", Fidelity.RADIAL, 4, 100),
    Reduced("mode-1-cell", "fem-p4-imex4", Fidelity.MODAL, 3, 100, 1e-4),
    Tolerated("smooth-fronts", CURVED, 2, 1e-6),
    Tolerated("smooth-fronts", FV_2, 2, 1e-5, 10.0),
)
"""Every fault turns at least one of these red."""
