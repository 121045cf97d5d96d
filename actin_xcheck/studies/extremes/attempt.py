"""One run to its end, or to the model's or the mesh's; and beside a twin as long as both go on."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Ending
from actin_xcheck.runs.fidelity import FULL, Fidelity, reduced
from actin_xcheck.runs.march import Tolerance, checked_step, integrate
from actin_xcheck.runs.method import SHAPES, SOUNDNESS, load
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind, solver_for
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.extremes.approach import Approach
from actin_xcheck.studies.extremes.plan import SEED, Trial
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


def attempt(trial: Trial, folder: Path) -> Attempt:
    """Run a trial; what overflows ends as its Outcome."""
    began, level, scene = time.process_time(), trial.level, trial.loaded
    solver = _solver(trial, scene)
    watch = _Watch(solver)
    if trial.epsilon:
        watch.twin = _twin(trial, scene)
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
    return Attempt(
        scene=trial.scene,
        rheology=str(model.rheology),
        psi=model.parameters.psi,
        method=level.method,
        refine=level.refine,
        rtol=level.rtol,
        remesh=trial.remesh,
        command=trial.command,
        outcome=str(outcome.ending),
        message=outcome.message,
        t=last.t,
        breakdown=watch.breakdown if broke else np.nan,
        place=watch.place,
        dilation=watch.rows[-1][1],
        steps=len(watch.rows) - 1,
        residual=watch.residual,
        shape=watch.shape,
        worn=watch.worn,
        remeshings=getattr(last, "remeshings", 0),
        area_change=getattr(last, "area_change", 0.0),
        area=measured.area,
        total_actin=measured.total_actin,
        epsilon=trial.epsilon,
        times=times,
        apart=apart,
        rate=slope / model.parameters.mu - model.reaction_rate(),
        seconds=time.process_time() - began,
    )


def _solver(trial: Trial, scene: Scene) -> Solver:
    """On the whole disk where the mesh may be replaced or lose its symmetry, else on the smallest part."""
    method, whole = trial.level.of, trial.remesh or trial.epsilon or trial.level.of.family != "fem"
    reduction = FULL if whole else reduced(scene, method, Fidelity.SECTOR)
    numerics = Numerics(method, trial.level.refine, scene.time.end, reduction=reduction, remesh=trial.remesh)
    return bind(scene, numerics)


def _twin(trial: Trial, scene: Scene) -> Solver:
    """The method on the same disk, from data with relative noise."""
    problem = resolve(scene)
    mesh = disk(trial.level.refine, problem.model.parameters.l0)
    return solver_for(_noisy(problem, trial.epsilon), trial.level.of, mesh)


def _noisy(problem: Problem, epsilon: float) -> Problem:
    """The problem from a perturbed concentration; the same noise in every process."""

    def a0(xi: Array) -> Array:
        noise = np.random.default_rng(SEED).uniform(-1, 1, xi.shape[1])
        return problem.a0(xi) * (1 + epsilon * noise)

    return replace(problem, a0=a0)
