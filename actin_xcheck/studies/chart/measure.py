"""One run of a chart in a process of its own: time, counted work, memory, and what came out."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Outcome
from actin_xcheck.core.work import FACTORISATIONS, SOLVES, WORK
from actin_xcheck.runs.machine import forget_peak, peak_memory, reference_kernel
from actin_xcheck.runs.march import March
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene

REPEATS = 3
"""How often a short run is timed."""

SHORT = 2.0
"""Processor seconds up to which a run is short."""

RADII = (6, 3)
"""Gauss points in [0, l0] and in [l0, 1]: fields have a kink at the ring."""

ANGLES = 31
"""Odd, so that a field with mirror lines is seen at angles that its symmetry does not repeat."""


@dataclass(frozen=True)
class Asked:
    """A run that is asked for: a point of a scene's chart."""

    scene: Scene
    point: Numerics

    def __str__(self) -> str:
        return f"{self.point.method.name} ({self.point.words})"


@dataclass(frozen=True, eq=False)
class Answer:
    """What a run says.

    Attributes
    ----------
    ending, message : of its Outcome.
    times : output times that were reached, (k,).
    area, probe_a, probe_x : at these times, (k,), (k, n) and (k, n, 2).
    cloud_a, cloud_x : at the points of `cloud` in the last state, (m,) and (m, 2).
    """

    ending: str
    message: str
    times: Array
    area: Array
    probe_a: Array
    probe_x: Array
    cloud_a: Array
    cloud_x: Array


@dataclass(frozen=True, eq=False)
class Sample:
    """A run as it was measured.

    Attributes
    ----------
    answer : what it says.
    wall, cpu : seconds of set-up and time loop, (n,): a number a repetition.
    kernel : seconds of the reference kernel before and after, wall and processor time, (2, 2).
    steps, rejected : steps that were kept and that were tried in vain.
    cells : of the mesh.
    factorisations, solves : counted by the linear solvers; 0 where they do not count.
    memory, baseline : bytes that the run needed at its peak beyond what the process had in use before it.
    """

    answer: Answer
    wall: Array
    cpu: Array
    kernel: Array
    steps: int
    rejected: int
    cells: int
    factorisations: int
    solves: int
    memory: int
    baseline: int

    @property
    def seconds(self) -> float:
        """Median wall time."""
        return float(np.median(self.wall))

    @property
    def kernels(self) -> Array:
        """Wall times in units of the reference kernel's as it was beside this run, (n,)."""
        return self.wall / self.kernel[:, 0].mean()

    @property
    def cpu_kernels(self) -> Array:
        """The same of processor times."""
        return self.cpu / self.kernel[:, 1].mean()

    @property
    def cells_steps(self) -> int:
        """Cells x steps, those tried in vain included."""
        return self.cells * (self.steps + self.rejected)


def cloud(l0: float) -> tuple[Array, Array]:
    """Material points at which all methods say their concentration, so that L2 norms need no common mesh.

    Points (2, m) of a quadrature rule on the unit disk and their weights (m,), whose sum is pi.
    """
    radii, weights = [], []
    for number, low, high in zip(RADII, (0.0, l0), (l0, 1.0), strict=True):
        nodes, gauss = np.polynomial.legendre.leggauss(number)
        r = low + (high - low) * (nodes + 1) / 2
        radii.append(r)
        weights.append(gauss * (high - low) / 2 * r * 2 * np.pi / ANGLES)
    theta = 2 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    r = np.concatenate(radii)[:, None]
    points = np.array([r * np.cos(theta), r * np.sin(theta)]).reshape(2, -1)
    return points, np.repeat(np.concatenate(weights), ANGLES)


class _Counted:
    """A solver that counts how often it is asked for a step."""

    def __init__(self, solver: Solver) -> None:
        self._solver, self.tried = solver, 0
        self.mesh, self.grid = solver.mesh, solver.grid
        self.init, self.check, self.corners = solver.init, solver.check, solver.corners
        self.measure, self.frame, self.probes = solver.measure, solver.frame, solver.probes
        self.memento, self.restored = solver.memento, solver.restored

    def step(self, state: State, dt: float) -> tuple[State, Outcome]:
        """The solver's step."""
        self.tried += 1
        return self._solver.step(state, dt)


def measured(asked: Asked, folder: Path) -> Sample:
    """Run a point and measure it, the reference kernel beside it; to be called in a process of its own.

    A first step on the coarsest mesh loads whatever the method needs, which is no part of its work.
    """
    scene, point = asked.scene, asked.point
    kernel = [reference_kernel()]
    _warm_up(scene, point)
    forget_peak()
    baseline = peak_memory()
    runs = [_timed(scene, point)]
    memory = peak_memory() - baseline
    while runs[0].cpu < SHORT and len(runs) < REPEATS:
        runs.append(_timed(scene, point))
    kernel.append(reference_kernel())
    last = runs[-1]
    return Sample(
        answer=_answer(scene, last),
        wall=np.array([run.wall for run in runs]),
        cpu=np.array([run.cpu for run in runs]),
        kernel=np.stack(kernel),
        steps=last.steps,
        rejected=last.solver.tried - last.steps,
        cells=last.solver.mesh.triangles.shape[1],
        factorisations=last.work.get(FACTORISATIONS, 0),
        solves=last.work.get(SOLVES, 0),
        memory=memory,
        baseline=baseline,
    )


def answered(asked: Asked, folder: Path) -> Answer:
    """Run a point that others are held against, beside other work."""
    return _answer(asked.scene, _timed(asked.scene, asked.point))


@dataclass(frozen=True, eq=False)
class _Timed:
    """One repetition: seconds of wall and processor time, counted work, and what can be read off.

    `outputs` are the states at the output times, the initial one among them; reading them is no part of it.
    """

    wall: float
    cpu: float
    work: dict[str, int]
    steps: int
    outputs: list[State]
    solver: _Counted
    march: March


def _timed(scene: Scene, point: Numerics) -> _Timed:
    WORK.clear()
    steps, outputs = -1, []  # the initial state is no step
    began = time.perf_counter(), time.process_time()
    solver = _Counted(bind(scene, point))
    with np.errstate(all="ignore"):  # what is not finite ends a run as a value
        march = March(solver, point, scene.output_times)
        for moment in march:
            steps += 1
            if moment.is_output:
                outputs.append(moment.state)
    wall, cpu = time.perf_counter() - began[0], time.process_time() - began[1]
    return _Timed(wall, cpu, dict(WORK), steps, outputs, solver, march)


def _warm_up(scene: Scene, point: Numerics) -> None:
    solver = bind(scene, Numerics(point.method, 1, scene.time.end))
    state = solver.init()
    if solver.check(state).ok:
        # a driven method knows where the nodes are after the steps of its driver alone
        solver.step(state, scene.output_times[0] if point.method.driven_by else 1e-3 * scene.time.end)


def _answer(scene: Scene, run: _Timed) -> Answer:
    turn, count = turn_matrix(scene), len(scene.probes.points)
    reached = [state for state in run.outputs if state.t in scene.output_times]
    probes = run.solver.probes(turn @ np.array(scene.probes.points, dtype=float).reshape(-1, 2).T)
    read = [probes(state) for state in reached]
    cloud_a, cloud_x = run.solver.probes(turn @ cloud(scene.parameters.l0)[0])(run.march.state)
    return Answer(
        ending=str(run.march.outcome.ending),
        message=run.march.outcome.message,
        times=np.array([state.t for state in reached]),
        area=np.array([run.solver.measure(state).area for state in reached]),
        probe_a=np.array([a for a, _ in read]).reshape(len(read), count),
        probe_x=np.array([x for _, x in read]).reshape(len(read), count, 2),
        cloud_a=cloud_a,
        cloud_x=cloud_x,
    )
