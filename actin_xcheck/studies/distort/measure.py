"""One run on one mesh, measured: what it says at the end, and what its linear solvers did for it."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Array
from actin_xcheck.core.work import FACTORISATIONS, ITERATIONS, SOLVES, WORK
from actin_xcheck.runs.accuracy import Level
from actin_xcheck.runs.march import Tolerance, integrate
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.run import solver_for
from actin_xcheck.scene.distortion import aspects, largest_angle
from actin_xcheck.scene.outline import write_mesh
from actin_xcheck.scene.resolve import mesh_of, resolve
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.distort.cases import Case


@dataclass(frozen=True)
class Converged:
    """A run on the disk's own mesh that others are held against: a scene (TOML) and the level."""

    scene: str
    method: str
    refine: int
    rtol: float

    @classmethod
    def at(cls, scene: Scene, level: Level) -> "Converged":
        """A scene's run on a level."""
        return cls(scene.text, level.method.name, level.refine, level.rtol)

    @property
    def words(self) -> str:
        """The level for a reader."""
        return f"{self.method}, refine {self.refine}, rtol {self.rtol:g}"


@dataclass(frozen=True)
class Answer:
    """What a run says in its last state, and how it got there.

    Attributes
    ----------
    ending, message : its Outcome.
    area : of the cell.
    a : concentrations at the scene's probes, then at the points of `cloud`.
    residual : largest balance residual of a step.
    cells : of the mesh.
    aspect, angle : of its worst cells, see `distortion`; degrees.
    solves, factorisations, iterations : of linear systems; iterations are those of conjugate gradients.
    steps : that were made.
    seconds : what it took.
    """

    ending: str
    message: str
    area: float
    a: tuple[float, ...]
    residual: float
    cells: int
    aspect: float
    angle: float
    solves: int
    factorisations: int
    iterations: int
    steps: int
    seconds: float


class _Watch:
    """Keeps the last state, the largest balance residual and the number of steps."""

    state: State
    residual = 0.0
    steps = -1

    def record(self, dt: float, state: State) -> None:
        """See a state; the initial one is no step."""
        self.state, self.steps = state, self.steps + 1
        self.residual = max(self.residual, abs(state.balance_residual))

    def frame(self, state: State) -> None:
        """Output times mean nothing here."""


def answer_of(case: Case, folder: Path) -> Answer:
    """Run a case in equal steps, and leave its scene and mesh, which the case's command names."""
    scene, method = parse_scene(case.scene, case.scene_file), find_method(case.method)
    mesh, files = case.mesh(scene.parameters.l0), (folder / case.scene_file, folder / case.mesh_file)
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(files[0], case.scene.encode())
    write_mesh(files[1], mesh)
    return _answer(scene, solver_for(resolve(scene), method, mesh), scene.time.end / case.steps, None)


def converged(asked: Converged, folder: Path) -> Answer:
    """Run a scene with steps chosen by their error."""
    scene, method = parse_scene(asked.scene, "a scene"), find_method(asked.method)
    solver = solver_for(resolve(scene), method, mesh_of(scene, asked.refine))
    return _answer(scene, solver, scene.time.end, Tolerance(asked.rtol, method.order_dt))


def cloud(l0: float) -> Array:
    """Material points (2, 217), spread evenly over the disk within the ring and over what is beyond."""
    middles = [(np.arange(n) + 0.5) / n for n in (5, 2)]
    radii = np.concatenate([l0 * np.sqrt(middles[0]), np.sqrt(l0**2 + (1 - l0**2) * middles[1])])
    theta = 2 * np.pi * (np.arange(31) + 0.5) / 31  # odd: no mirror line of a scene is seen twice
    return np.array([np.outer(radii, np.cos(theta)), np.outer(radii, np.sin(theta))]).reshape(2, -1)


def _answer(scene: Scene, solver: Solver, dt: float, tolerance: Tolerance | None) -> Answer:
    began, watch = time.perf_counter(), _Watch()
    WORK.clear()
    with np.errstate(all="ignore"):  # what is not finite ends a run as a value
        outcome = integrate(solver, dt, scene.output_times, watch, tolerance)
        points = np.array(scene.probes.points, dtype=float).reshape(-1, 2).T
        a, _ = solver.probes(np.hstack([points, cloud(scene.parameters.l0)]))(watch.state)
        area = solver.measure(watch.state).area
    mesh = solver.mesh
    return Answer(
        ending=str(outcome.ending),
        message=outcome.message,
        area=area,
        a=tuple(a.tolist()),
        residual=watch.residual,
        cells=mesh.triangles.shape[1],
        aspect=float(aspects(mesh.xi, mesh.triangles).max()),
        angle=largest_angle(mesh.xi, mesh.triangles),
        solves=WORK[SOLVES],
        factorisations=WORK[FACTORISATIONS],
        iterations=WORK[ITERATIONS],
        steps=watch.steps,
        seconds=time.perf_counter() - began,
    )
