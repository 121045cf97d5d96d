"""Points of a chart, and the run of each in a process of its own: time, counted work, memory, what came out.

A point is one method, one mesh, one time step or tolerance.  Along a ladder h is halved and errors in space
and in time fall together: dt ~ h^(order_h/order_dt) for equal steps, local errors ~ h^order_h for chosen
ones.  Beside each such point stand one of larger and one of smaller steps, for no rule knows where a scene
has its errors.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import FACTORISATIONS, SOLVES, WORK
from actin_xcheck.core.model import Array
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics, run_seconds
from actin_xcheck.runs.provenance import forget_peak, peak_memory, reference_kernel
from actin_xcheck.runs.records import gathered
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.resolve import probe_points, turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.stored import AskedRun

COARSEST_STEPS = 4
"""Equal steps on the mesh of refine 2, where h = 1/4."""

COARSEST_TOLERANCE = 1e-2
"""Of a step, times h^order_h."""

ARTICLE = "fem-p1-paper"
"""The scheme whose own mesh and step a scene may state."""


@dataclass(frozen=True)
class Plan:
    """How much is charted.

    Attributes
    ----------
    budget : processor seconds for the runs of one method; the first run is made in any case.
    reference : method, refine and tolerance of the run that others are held against, after those of the one
        that tells its error.
    refines : meshes of methods of order 2 or less, and of those of higher order, which are finer on the same
        cells.
    steps_beside, tolerances_beside : factors of the number of equal steps, and of the tolerance.
    published : whether the article's scheme is run with its own mesh and step too.
    """

    budget: float
    reference: tuple[tuple[str, int, float], tuple[str, int, float]]
    refines: tuple[tuple[int, ...], tuple[int, ...]] = ((2, 3, 4, 5, 6), (1, 2, 3, 4, 5))
    steps_beside: tuple[float, ...] = (0.25, 1.0, 4.0)
    tolerances_beside: tuple[float, ...] = (10.0, 1.0, 0.1)
    published: bool = True


WHOLE = Plan(32.0, (("fem-p4-imex4", 3, 1e-7), ("fem-p4-imex4", 4, 1e-8)))
QUICK = Plan(
    8.0,
    (("fem-p4-imex4", 2, 1e-6), ("fem-p4-imex4", 3, 1e-7)),
    steps_beside=(1.0,),
    tolerances_beside=(1.0,),
    published=False,
)


def command_of(point: Numerics, scene: Scene) -> str:
    """The command that makes a point's run again."""
    steps = f"dt-{point.dt:.6g}" if point.rtol is None else f"rtol-{point.rtol:g}"
    file = f"{point.method.name}--{point.reduction.fidelity}--{point.refine}--{steps}.vtkhdf"
    return point.command(scene.origin, file)


def ladder(scene: Scene, method: Method, plan: Plan = WHOLE) -> list[Numerics]:
    """Return the points of a method, from little work to much."""
    order = method.order_h or 2  # an exhibit that stalls takes the steps of the method it would be
    points = []
    for refine in plan.refines[order > 2]:
        for factor in plan.tolerances_beside if method.adaptive else plan.steps_beside:
            if method.adaptive:
                rtol = float(f"{factor * COARSEST_TOLERANCE * 2.0 ** (-order * refine):.0e}")
                points.append(Numerics(method, refine, scene.time.end, rtol))
            else:
                steps = factor * COARSEST_STEPS * 2 ** (order / method.order_dt * (refine - 2))
                points.append(Numerics(method, refine, scene.time.end / max(round(steps), 1)))
    return sorted(points, key=lambda point: run_seconds(point, scene.output_times))


def published(scene: Scene, method: Method, plan: Plan = WHOLE) -> list[Numerics]:
    """The article's scheme on the mesh and with the step that the scene says were used; or nothing."""
    stated = scene.as_published
    if not plan.published or method.name != ARTICLE or stated.refine is None or stated.dt is None:
        return []
    return [Numerics(method, stated.refine, stated.dt)]


def reference_points(scene: Scene, plan: Plan) -> list[Numerics]:
    """The runs that others are held against, coarse and fine."""
    return [Numerics(METHODS[name], refine, scene.time.end, rtol) for name, refine, rtol in plan.reference]


REPEATS = 3
"""How often a short run is timed."""

SHORT = 2.0
"""Processor seconds up to which a run is short."""

RADII = (6, 3)
"""Gauss points in [0, l0] and in [l0, 1]: fields have a kink at the ring."""

ANGLES = 31
"""Odd, so that a field with mirror lines is seen at angles that its symmetry does not repeat."""


@dataclass(frozen=True, eq=False)
class Trace:
    """What a run says at its output times.

    Attributes
    ----------
    ending, message : of its Outcome.
    times : output times that were reached, (k,).
    area, total_actin, probe_a, probe_x : at these times, (k,), (k,), (k, n) and (k, n, 2).
    """

    ending: str
    message: str
    times: Array
    area: Array
    total_actin: Array
    probe_a: Array
    probe_x: Array


@dataclass(frozen=True, eq=False)
class SampleAnswer(Trace):
    """What a run says at its output times, and of `cloud` in its last state, (m,) and (m, 2)."""

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

    answer: SampleAnswer
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


def measured(asked: AskedRun, folder: Path) -> Sample:
    """Run a point and measure it, the reference kernel beside it; to be called in a process of its own.

    A first step on the coarsest mesh loads whatever the method needs, which is no part of its work.
    """
    scene, point = asked.scene, asked.numerics
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
        steps=last.march.steps,
        rejected=last.solver.tried - last.march.steps,
        cells=last.solver.mesh.triangles.shape[1],
        factorisations=last.work.get(FACTORISATIONS, 0),
        solves=last.work.get(SOLVES, 0),
        memory=memory,
        baseline=baseline,
    )


def answered(asked: AskedRun, folder: Path) -> SampleAnswer:
    """Run a point that others are held against, beside other work."""
    return _answer(asked.scene, _timed(asked.scene, asked.numerics))


@dataclass(frozen=True, eq=False)
class _Timed:
    """One repetition: seconds of wall and processor time, counted work, and what can be read off.

    `outputs` are the states at the output times; reading them is no part of it.
    """

    wall: float
    cpu: float
    work: dict[str, int]
    outputs: list[State]
    solver: _Counted
    march: March


def _timed(scene: Scene, point: Numerics) -> _Timed:
    WORK.clear()
    began = time.perf_counter(), time.process_time()
    solver = _Counted(bind(scene, point))
    march = March(solver, point, scene.output_times)
    outputs = outputs_of(march)
    wall, cpu = time.perf_counter() - began[0], time.process_time() - began[1]
    return _Timed(wall, cpu, dict(WORK), outputs, solver, march)


def _warm_up(scene: Scene, point: Numerics) -> None:
    solver = bind(scene, Numerics(point.method, 1, scene.time.end))
    state = solver.init()
    if solver.check(state).ok:
        # a driven method knows where the nodes are after the steps of its driver alone
        solver.step(state, scene.output_times[0] if point.method.driven_by else 1e-3 * scene.time.end)


def _answer(scene: Scene, run: _Timed) -> SampleAnswer:
    points = turn_matrix(scene) @ cloud(scene.parameters.l0)[0]
    cloud_a, cloud_x = run.solver.probes(points)(run.march.state)
    said = trace_of(scene, run.solver, run.march, run.outputs)
    return gathered(SampleAnswer, said, cloud_a=cloud_a, cloud_x=cloud_x)


def outputs_of(march: March) -> list[State]:
    """Go through a run: its states at the output times, without the initial one."""
    return [moment.state for moment in march if moment.is_output and moment.dt]


def trace_of(scene: Scene, solver: Solver, march: March, outputs: Sequence[State]) -> Trace:
    """What a run that is over says by the states of `outputs_of`."""
    probes, count = solver.probes(probe_points(scene)), len(scene.probes.points)
    read, measured = [probes(state) for state in outputs], [solver.measure(state) for state in outputs]
    return Trace(
        ending=str(march.outcome.ending),
        message=march.outcome.message,
        times=np.array([state.t for state in outputs]),
        area=np.array([one.area for one in measured]),
        total_actin=np.array([one.total_actin for one in measured]),
        probe_a=np.array([a for a, _ in read]).reshape(len(read), count),
        probe_x=np.array([x for _, x in read]).reshape(len(read), count, 2),
    )
