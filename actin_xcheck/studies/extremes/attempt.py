"""One run to its end, or to the model's or the mesh's; and beside a twin as long as both go on."""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Ending
from actin_xcheck.runs.fidelity import FULL, Fidelity, reduced
from actin_xcheck.runs.march import Tolerance, checked_step, integrate
from actin_xcheck.runs.method import SHAPES, SOUNDNESS, load
from actin_xcheck.runs.run import bind, solver_for
from actin_xcheck.runs.workers import Report
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.extremes.approach import Approach
from actin_xcheck.studies.extremes.plan import SEED, Task
from actin_xcheck.theory.dispersion import sigma_prime

STEPS = 40
"""No step is longer than this part of the time."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A run as it came out.

    Attributes
    ----------
    scene, rheology, psi, method, refine, rtol, remesh, command : what was run.
    outcome, message, t : how it ended, and when.
    breakdown : when 1 + phi reaches zero; nan where it does not.
    place : material point (2,) where 1 + phi is smallest at the end.
    dilation : the smallest 1 + phi at the end.
    steps, residual : taken, and the largest balance residual of them.
    shape, worn : worst shape of a cell, and when the mesh was first about to fold; nan where not known.
    remeshings, area_change : meshes that were replaced, and what that changed of the area in all, relative.
    area, total_actin : at the end.
    epsilon : of the twin, 0 without.
    times, apart : of the twins: relative distance of their cell means, root mean square, (n,).
    rate : the largest growth rate at a = 1.
    seconds : of the processor.
    """

    scene: str
    rheology: str
    psi: float
    method: str
    refine: int
    rtol: float
    remesh: bool
    command: str
    outcome: str
    message: str
    t: float
    breakdown: float
    place: Array
    dilation: float
    steps: int
    residual: float
    shape: float
    worn: float
    remeshings: int
    area_change: float
    area: float
    total_actin: float
    epsilon: float
    times: Array
    apart: Array
    rate: float
    seconds: float

    @property
    def key(self) -> str:
        """Its name in the file."""
        kind = "--remesh" if self.remesh else "--twins" if self.epsilon else ""
        return f"{self.scene}--{self.method}-{self.refine}-{self.rtol:g}{kind}"

    @property
    def horizon(self) -> float:
        """Time in which round-off grows to the size of a at the largest rate."""
        return float(np.log(1 / np.finfo(float).eps) / self.rate)


@dataclass
class _Watch(Approach):
    """An `Approach` that sees the cells' shapes too, and takes the twin's steps."""

    twin: Solver | None = None
    beside: State | None = None
    shape: float = np.nan
    worn: float = np.nan
    apart: list[tuple[float, float]] = field(default_factory=list)

    def record(self, dt: float, state: State) -> None:
        """See every state."""
        super().record(dt, state)
        space = getattr(getattr(self.solver, "inner", self.solver), "space", None)
        if space is not None:
            self.shape = float(np.fmin(self.shape, load(SHAPES)(space, state.x).min()))
            if np.isnan(self.worn) and not load(SOUNDNESS)(space, state.t, state.x).ok:
                self.worn = state.t
        if self.twin is None:
            return
        if self.beside is None:
            self.beside = self.twin.init()
        elif self.beside.t < state.t:
            new, outcome = checked_step(self.twin, self.beside, dt)
            if not outcome.ok:
                self.twin = None  # what one of them does alone says nothing
                return
            self.beside = replace(new, t=state.t)
        self.apart.append((state.t, self._distance(state)))

    def _distance(self, state: State) -> float:
        assert self.twin is not None
        assert self.beside is not None
        one, other = (self.solver.frame(state).a_cells for state in (state, self.beside))
        return float(np.linalg.norm(one - other) / np.linalg.norm(one))


def attempt(task: Task, report: Report) -> Attempt:
    """Run a task; what overflows ends as its Outcome."""
    began, level, scene = time.process_time(), task.level, task.loaded
    solver = _solver(task, scene)
    watch = _Watch(solver)
    if task.epsilon:
        watch.twin = _twin(task, scene)
    end = scene.time.end
    tolerance = Tolerance(level.rtol, level.of.order_dt)
    with np.errstate(all="ignore"):
        outcome = integrate(solver, end / STEPS, [end], watch, tolerance)
    last = watch.last
    assert last is not None
    measured, model = solver.measure(last), scene.physics
    slope = sigma_prime(model.parameters) + model.parameters.p / np.pi
    broke = outcome.ending is Ending.SINGULAR_DILATION
    times, apart = np.array(watch.apart, dtype=float).reshape(-1, 2).T
    report("", 1, 1)
    return Attempt(
        task.scene, str(model.rheology), model.parameters.psi, level.method, level.refine, level.rtol,
        task.remesh, task.command, str(outcome.ending), outcome.message, last.t,
        watch.breakdown if broke else np.nan, watch.place, watch.rows[-1][1], len(watch.rows) - 1,
        watch.residual, watch.shape, watch.worn, getattr(last, "remeshings", 0),
        getattr(last, "area_change", 0.0), measured.area, measured.total_actin, task.epsilon,
        times, apart, slope / model.parameters.mu - model.reaction_rate(),
        time.process_time() - began,
    )  # fmt: skip


def _solver(task: Task, scene: Scene) -> Solver:
    """On the whole disk where the mesh may be replaced or lose its symmetry, else on the smallest part."""
    method, whole = task.level.of, task.remesh or task.epsilon or task.level.of.family != "fem"
    reduction = FULL if whole else reduced(scene, method, Fidelity.SECTOR)
    return bind(scene, method, task.level.refine, scene.time.end, reduction=reduction, remesh=task.remesh)


def _twin(task: Task, scene: Scene) -> Solver:
    """The method on the same disk, from data with relative noise."""
    problem = resolve(scene)
    mesh = disk(task.level.refine, problem.model.parameters.l0)
    return solver_for(_noisy(problem, task.epsilon), task.level.of, mesh)


def _noisy(problem: Problem, epsilon: float) -> Problem:
    """The problem from a perturbed concentration; the same noise in every process."""

    def a0(xi: Array) -> Array:
        noise = np.random.default_rng(SEED).uniform(-1, 1, xi.shape[1])
        return problem.a0(xi) * (1 + epsilon * noise)

    return replace(problem, a0=a0)
