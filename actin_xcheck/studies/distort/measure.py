"""One run on one mesh, measured: what it says at the end, and what its linear solvers did for it."""

import time
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.model import Array
from actin_xcheck.core.work import FACTORISATIONS, ITERATIONS, SOLVES, WORK
from actin_xcheck.runs.accuracy import LEVELS
from actin_xcheck.runs.march import Tolerance, integrate
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.run import solver_for
from actin_xcheck.scene.distortion import aspects, largest_angle
from actin_xcheck.scene.resolve import mesh_of, resolve
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.distort.cases import Case

TRUTH_LEVELS = LEVELS[3:5]
"""Levels of the converged runs, on the disk's own mesh; the second is believed, their change says how far."""


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


@dataclass(frozen=True)
class Truth:
    """A converged answer and how far it may be off: area and concentrations, relative."""

    answer: Answer
    level: str
    uncertainty: float


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


def answer_of(case: Case) -> Answer:
    """Run a case in equal steps."""
    scene, method = parse_scene(case.scene, "a scene"), find_method(case.method)
    solver = solver_for(resolve(scene), method, case.mesh(scene.parameters.l0))
    return _answer(scene, solver, scene.time.end / case.steps, None)


def truth_of(text: str) -> Truth:
    """Run a scene (TOML) with the best finite elements until it is converged."""
    scene, answers = parse_scene(text, "a scene"), []
    for level in TRUTH_LEVELS:
        solver = solver_for(resolve(scene), level.method, mesh_of(scene, level.refine))
        answers.append(_answer(scene, solver, scene.time.end, Tolerance(level.rtol, level.method.order_dt)))
    coarse, fine = answers
    level = TRUTH_LEVELS[1]
    words = f"{level.method.name}, refine {level.refine}, rtol {level.rtol:g}"
    change = max(abs(coarse.area / fine.area - 1), float(np.abs(np.subtract(coarse.a, fine.a)).max()))
    return Truth(fine, words, level.share * change)


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
        str(outcome.ending),
        outcome.message,
        area,
        tuple(a.tolist()),
        watch.residual,
        mesh.triangles.shape[1],
        float(aspects(mesh.xi, mesh.triangles).max()),
        largest_angle(mesh.xi, mesh.triangles),
        WORK[SOLVES],
        WORK[FACTORISATIONS],
        WORK[ITERATIONS],
        watch.steps,
        time.perf_counter() - began,
    )
