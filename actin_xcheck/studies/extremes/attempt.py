"""One run to its end, or to the model's or the mesh's; and beside a twin as long as both go on.

The smallest dilation is read off what a method stores of a state, the same for all methods.
"""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Problem, Solver, State
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.lagrange import least_dilation
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Array
from actin_xcheck.runs.fidelity import FULL, Fidelity, reduced
from actin_xcheck.runs.march import March, Moment, checked_step
from actin_xcheck.runs.method import METHODS, SHAPES, SOUNDNESS, Method, load
from actin_xcheck.runs.numerics import Numerics, chosen_steps, command, seconds_of
from actin_xcheck.runs.records import gathered
from actin_xcheck.runs.run import bind, solver_for
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.theory.dispersion import sigma_prime

EPSILON, SEED = 1e-14, 1
"""Relative size of the perturbation that makes a twin, and the seed of its noise."""


@dataclass(frozen=True)
class TrialLevel:
    """One mesh of a method, and the largest local error of its steps."""

    method: str
    refine: int
    rtol: float

    @property
    def of(self) -> Method:
        """The method."""
        return METHODS[self.method]


@dataclass(frozen=True)
class Trial:
    """One run.

    Attributes
    ----------
    scene : a shipped name.
    level : how it is run.
    remesh : whether the mesh is replaced when it is about to fold.
    epsilon : of the twin that runs beside it; 0 without one.
    """

    scene: str
    level: TrialLevel
    remesh: bool = False
    epsilon: float = 0.0

    @property
    def loaded(self) -> Scene:
        """The scene."""
        return load_scene(self.scene)

    @property
    def seconds(self) -> float:
        """About what it takes; steps shorten towards the end of the model."""
        level = self.level
        once = seconds_of(level.of, level.refine, 2 * chosen_steps(level.of, level.rtol))
        return 2 * once if self.epsilon else once

    @property
    def command(self) -> str:
        """What makes its numbers again; `run` tells neither the breakdown nor how twins part."""
        return command("extremes", only=self.scene)


def _ladder(method: str, rtol: float, *refines: int) -> tuple[TrialLevel, ...]:
    """Meshes, coarsest first, and the coarsest one again with a tolerance ten times as large."""
    return (
        *(TrialLevel(method, refine, rtol) for refine in refines),
        TrialLevel(method, refines[0], 10 * rtol),
    )


LINEAR, CUBIC = _ladder("fem-p1-imex2", 1e-7, 4, 5, 6), _ladder("fem-p3-imex4", 1e-8, 2, 3, 4)
VOLUMES = _ladder("fv", 1e-6, 3, 4, 5)
"""With a force balance of their own: when the model ends is said twice."""

BREAKDOWNS = {
    "fig18-nonuniform-contraction-viscoelastic": (LINEAR, CUBIC, VOLUMES),
    "sec54-not-shown-viscoelastic": (LINEAR, CUBIC, VOLUMES),
    "sec54-failure-viscoelastic": (LINEAR, CUBIC, VOLUMES),
    "fig19-protrusions-viscoelastic": (LINEAR, CUBIC, VOLUMES),
    "sec6-long-viscoelastic": (_ladder("fem-p2-imex3", 1e-5, 3, 4, 5),),
}
"""Scenes whose model ends, and the ladders of methods that say when; see `_ladder`."""

CARRIED = {
    "sec54-failure": (TrialLevel("fem-p2-imex3", 4, 1e-5), TrialLevel("fem-p3-imex4", 4, 1e-6)),
    "sec54-not-shown": (TrialLevel("fem-p2-imex3", 4, 1e-5), TrialLevel("fem-p3-imex4", 3, 1e-6)),
    "fig18-nonuniform-contraction": (
        TrialLevel("fem-p2-imex3", 4, 1e-5),
        TrialLevel("fem-p3-imex4", 3, 1e-6),
    ),
    "fig19-protrusions": (TrialLevel("fem-p2-imex3", 4, 1e-5), TrialLevel("fem-p3-imex4", 3, 1e-6)),
    "sec6-long-viscous": (TrialLevel("fem-p2-imex3", 3, 1e-4),),
}
"""Scenes that the model carries through, each run as it is and with remeshing."""

TWINS = (TrialLevel("fem-p2-imex3", 4, 1e-5), TrialLevel("fem-p3-imex4", 4, 1e-6))
"""How the scene of the article's failure is run beside a twin."""


def trials() -> list[Trial]:
    """Every run, the longest first."""
    twins = [Trial("sec54-failure", level, epsilon=EPSILON) for level in TWINS]
    carried = [
        Trial(scene, level, remesh)
        for scene, levels in CARRIED.items()
        for level in levels
        for remesh in (True, False)
    ]
    ended = [
        Trial(scene, level) for scene, ladders in BREAKDOWNS.items() for ladder in ladders for level in ladder
    ]
    return twins + carried + ended


STEPS = 40
"""No step is longer than this part of the time."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A run as it came out.

    Attributes
    ----------
    scene, rheology, psi, method, refine, rtol, remesh, command : what was run.
    outcome, message, t : how it ended, and when.
    breakdown : when 1 + phi reaches zero, which ever shorter steps lead to; nan where it does not.
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
class _Watch:
    """Sees every state of a run, its cells' shapes too, and takes the twin's steps.

    `dilation` is the smallest 1 + phi of the last state, `place` where it is.
    """

    solver: Solver
    twin: Solver | None = None
    beside: State | None = None
    states: int = 0
    dilation: float = np.nan
    place: Array = field(default_factory=lambda: np.zeros(2))
    residual: float = 0.0
    shape: float = np.nan
    worn: float = np.nan
    apart: list[tuple[float, float]] = field(default_factory=list)

    def record(self, moment: Moment) -> None:
        """See a state."""
        state = moment.state
        self.states += 1
        self.dilation, self.place = least_dilation(self.solver.grid, self.solver.frame(state).x)
        self.residual = max(self.residual, abs(state.balance_residual))
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
            new, outcome = checked_step(self.twin, self.beside, moment.dt)
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
    numerics = _numerics(trial, scene)
    solver = bind(scene, numerics)
    watch = _Watch(solver)
    if trial.epsilon:
        watch.twin = _twin(trial, scene)
    march = March(solver, numerics, [scene.time.end])
    with np.errstate(all="ignore"):
        for moment in march:
            watch.record(moment)
    last, outcome = march.state, march.outcome
    measured, model = solver.measure(last), scene.physics
    slope = sigma_prime(model.parameters) + model.parameters.p / np.pi
    broke = outcome.ending is Ending.SINGULAR_DILATION
    times, apart = np.array(watch.apart, dtype=float).reshape(-1, 2).T
    return gathered(
        Attempt,
        trial,
        level,
        watch,
        measured,
        rheology=str(model.rheology),
        psi=model.parameters.psi,
        outcome=str(outcome.ending),
        message=outcome.message,
        t=last.t,
        breakdown=last.t if broke else np.nan,
        steps=watch.states - 1,
        remeshings=getattr(last, "remeshings", 0),
        area_change=getattr(last, "area_change", 0.0),
        times=times,
        apart=apart,
        rate=slope / model.parameters.mu - model.reaction_rate(),
        seconds=time.process_time() - began,
    )


def _numerics(trial: Trial, scene: Scene) -> Numerics:
    """On the whole disk where the mesh may be replaced or lose its symmetry, else on the smallest part."""
    level, end = trial.level, scene.time.end
    whole = trial.remesh or trial.epsilon or level.of.family != "fem"
    reduction = FULL if whole else reduced(scene, level.of, Fidelity.SECTOR)
    return Numerics(level.of, level.refine, end / STEPS, level.rtol, reduction, remesh=trial.remesh)


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
