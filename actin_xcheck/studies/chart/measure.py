"""One point of a chart, measured in a process of its own: time, counted work, memory and what came out."""

import time
from dataclasses import dataclass, field

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Outcome
from actin_xcheck.core.work import FACTORISATIONS, SOLVES, WORK
from actin_xcheck.runs.fidelity import reduced
from actin_xcheck.runs.machine import forget_peak, peak_memory
from actin_xcheck.runs.march import Tolerance, integrate
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.recorder import PARTS
from actin_xcheck.runs.run import bind
from actin_xcheck.runs.workers import Report
from actin_xcheck.scene.resolve import turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.cloud import cloud
from actin_xcheck.studies.chart.points import Point

REPEATS = 3
"""How often a short run is timed."""

SHORT = 2.0
"""Processor seconds up to which a run is short."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A run as it was measured.

    Attributes
    ----------
    point : what was run.
    ending, message : of its Outcome.
    wall, cpu : seconds of set-up and time loop, (n,): a number a repetition.
    kernel : seconds of the reference kernel before and after, wall and processor time, (2, 2).
    steps, rejected : steps that were kept and that were tried in vain.
    cells : of the mesh.
    factorisations, solves : counted by the linear solvers; 0 where they do not count.
    memory, baseline : bytes that the run needed at its peak beyond what the process had in use before it.
    times : output times that were reached, (k,).
    area, probe_a, probe_x : at these times, (k,), (k, n) and (k, n, 2).
    cloud_a, cloud_x : at the points of `cloud` at the last of them, (m,) and (m, 2).
    """

    point: Point
    ending: str
    message: str
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
    times: Array
    area: Array
    probe_a: Array
    probe_x: Array
    cloud_a: Array
    cloud_x: Array

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


@dataclass
class _Watch:
    """Observes a run as cheaply as can be: counts steps and keeps the states at the output times."""

    end: float
    report: Report
    label: str
    steps: int = -1
    frames: list[State] = field(default_factory=list)

    def record(self, dt: float, state: State) -> None:
        """Count; the initial state is no step."""
        self.steps += 1
        self.report(self.label, round(PARTS * state.t / self.end), PARTS)

    def frame(self, state: State) -> None:
        """Keep a state; what is read off it is no part of the run."""
        self.frames.append(state)


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


def measured(task: tuple[Scene, Point], report: Report) -> Sample:
    """Run a point and measure it; to be called in a process of its own.

    A first step on the coarsest mesh loads whatever the method needs, which is no part of its work.
    """
    scene, point = task
    _warm_up(scene, point)
    forget_peak()
    baseline = peak_memory()
    runs = [_timed(scene, point, report)]
    memory = peak_memory() - baseline
    while runs[0].cpu < SHORT and len(runs) < REPEATS:
        runs.append(_timed(scene, point, report))
    last = runs[-1]
    reached = [state for state in last.watch.frames if state.t in scene.output_times]
    read = [_read(scene, last.solver, state) for state in reached]
    probes = len(scene.probes.points)
    cloud_a, cloud_x = _on_cloud(scene, last.solver, last.watch.frames[-1])
    return Sample(
        point,
        str(last.outcome.ending),
        last.outcome.message,
        np.array([run.wall for run in runs]),
        np.array([run.cpu for run in runs]),
        np.full((2, 2), np.nan),
        last.watch.steps,
        last.solver.tried - last.watch.steps,
        last.solver.mesh.triangles.shape[1],
        last.work.get(FACTORISATIONS, 0),
        last.work.get(SOLVES, 0),
        memory,
        baseline,
        np.array([state.t for state in reached]),
        np.array([area for area, _, _ in read]),
        np.array([a for _, a, _ in read]).reshape(len(read), probes),
        np.array([x for _, _, x in read]).reshape(len(read), probes, 2),
        cloud_a,
        cloud_x,
    )


@dataclass(frozen=True, eq=False)
class _Timed:
    """One repetition: seconds of wall and processor time, counted work, and what can be read off."""

    wall: float
    cpu: float
    work: dict[str, int]
    watch: _Watch
    solver: _Counted
    outcome: Outcome


def _timed(scene: Scene, point: Point, report: Report) -> _Timed:
    WORK.clear()
    method, watch = point.method, _Watch(scene.output_times[-1], report, point.key)
    tolerance = None if point.rtol is None else Tolerance(point.rtol, method.order_dt)
    began = time.perf_counter(), time.process_time()
    reduction = reduced(scene, method, point.fidelity, point.rtol)
    numerics = Numerics(method, point.refine, point.dt, point.rtol, reduction)
    solver = _Counted(bind(scene, numerics))
    outcome = integrate(solver, point.dt, scene.output_times, watch, tolerance)
    wall, cpu = time.perf_counter() - began[0], time.process_time() - began[1]
    return _Timed(wall, cpu, dict(WORK), watch, solver, outcome)


def _warm_up(scene: Scene, point: Point) -> None:
    solver = bind(scene, Numerics(point.method, 1, scene.time.end))
    state = solver.init()
    if solver.check(state).ok:
        # a driven method knows where the nodes are after the steps of its driver alone
        solver.step(state, scene.output_times[0] if point.method.driven_by else 1e-3 * scene.time.end)


def _read(scene: Scene, solver: _Counted, state: State) -> tuple[float, Array, Array]:
    """Area, and concentrations (n,) and positions (n, 2) of the scene's probes."""
    points = np.array(scene.probes.points, dtype=float).reshape(-1, 2).T
    a, x = solver.probes(turn_matrix(scene) @ points)(state)
    return solver.measure(state).area, a, x


def _on_cloud(scene: Scene, solver: _Counted, state: State) -> tuple[Array, Array]:
    points, _ = cloud(scene.parameters.l0)
    return solver.probes(turn_matrix(scene) @ points)(state)
