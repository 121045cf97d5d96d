"""From a scene and a method to a stored run: resolve the physics, bind the numerics, watch, write."""

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import cached_property
from pathlib import Path

import numpy as np

from actin_xcheck import observables, store
from actin_xcheck.geometry import INTERIOR_POINTS, Mesh, disk, locate, quadrature_points, signed_areas
from actin_xcheck.model import Array, Closure, Delta
from actin_xcheck.motion import PrescribedMotion, RecordedMotion
from actin_xcheck.prediction.dispersion import eigenfield, leading_growth_rate
from actin_xcheck.prediction.modes import Mode
from actin_xcheck.registry import FORCE_BALANCE, Method, find_method, load
from actin_xcheck.result import Outcome
from actin_xcheck.scene import Scene
from actin_xcheck.solver import Mechanics, Motion, Move, Problem, Solver, Source, State
from actin_xcheck.stepping import integrate, step_count

Progress = Callable[[int, int], None]
"""Called with steps done and steps in all."""

DEFAULT_REFINE = 5
"""2113 nodes."""


def numerics(scene: Scene, refine: int | None, dt: float | None) -> tuple[int, float]:
    """Mesh refinement and time step: as given, else as published, else 2113 nodes and 100 steps."""
    published = scene.as_published
    if refine is None:
        refine = published.refine if published and published.refine else DEFAULT_REFINE
    if dt is None:
        dt = published.dt if published and published.dt else scene.time.end / 100
    return refine, dt


def resolve(scene: Scene, perturbed: bool = True) -> Problem:
    """Turn a scene's expressions into callables on the reference disk, in the scene's (turned) frame.

    `perturbed=False` gives the unperturbed twin that growth is measured against: without the eigenmode, or
    from a = 1 where the scene writes its perturbation into `initial.a`.
    """
    turn = turn_matrix(scene)
    mode = scene.initial.eigenmode
    unit = not perturbed and mode is None

    def a0(xi: Array) -> Array:
        if unit:
            return np.ones(xi.shape[1])
        a = scene.initial.a(**_places(turn.T @ xi))
        return a + mode.amplitude * field.a(turn.T @ xi) if mode and perturbed else a

    def u0(xi: Array) -> Array:
        u = np.zeros_like(xi)
        if scene.initial.u is not None and not unit:
            u = np.array([component(**_places(turn.T @ xi)) for component in scene.initial.u])
        if mode and perturbed:
            u = u + mode.amplitude * field.u(turn.T @ xi)
        return turn @ u

    if mode and perturbed:
        field = eigenfield(scene.physics, Mode(mode.m, mode.n))
    return Problem(scene.physics, a0, u0, _motion(scene), _source(scene))


def turn_matrix(scene: Scene) -> Array:
    """Rotation (2, 2) from the scene's frame, in which its expressions are written, to the laboratory's."""
    angle = np.deg2rad(scene.domain.rotation)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _places(x: Array) -> dict[str, Array]:
    return {"x": x[0], "y": x[1], "r": np.hypot(x[0], x[1]), "theta": np.arctan2(x[1], x[0])}


def _motion(scene: Scene) -> Motion | None:
    if scene.motion is None:
        return None
    prescribed, turn = scene.motion, turn_matrix(scene)

    def motion(xi: Array, t: float) -> Array:
        start = turn.T @ xi
        return turn @ np.array([f(x0=start[0], y0=start[1], t=t) for f in (prescribed.x, prescribed.y)])

    return motion


def _source(scene: Scene) -> Source | None:
    if scene.source_term is None:
        return None
    term = scene.source_term
    return lambda x, xi, t: in_scene_frame(scene, term, x, xi, t)


def in_scene_frame(scene: Scene, expression: Callable[..., Array], x: Array, xi: Array, t: float) -> Array:
    """Evaluate an expression of x, y, r, theta, x0, y0, t at positions x of material points xi (2, ...)."""
    turn = turn_matrix(scene)
    place, start = np.tensordot(turn.T, x, 1), np.tensordot(turn.T, xi, 1)
    return expression(**_places(place), x0=start[0], y0=start[1], t=t)


def bind(scene: Scene, method: Method, refine: int, dt: float, perturbed: bool = True) -> Solver:
    """Return the method's solver for a scene, on its mesh and with whoever moves the nodes.

    A driven method first runs the method that drives it; it is shown no progress.
    """
    problem = resolve(scene, perturbed)
    mesh = disk(refine, scene.parameters.l0, np.deg2rad(scene.domain.rotation))
    solver: Solver = load(method.solver)(problem, mesh, _mechanics(scene, problem, mesh, method, refine, dt))
    return solver


def _mechanics(
    scene: Scene, problem: Problem, mesh: Mesh, method: Method, refine: int, dt: float
) -> Mechanics:
    if problem.motion is not None:
        return PrescribedMotion(mesh, problem.motion)
    if method.driven_by is None:
        mechanics: Mechanics = load(FORCE_BALANCE)(problem.model, mesh)
        return mechanics
    driver = _Recorder()
    outcome = integrate(bind(scene, find_method(method.driven_by), refine, dt), dt, scene.output_times, driver)
    return RecordedMotion(np.array(driver.times), tuple(driver.moves), outcome)


class _Recorder:
    """Keeps the node paths of a run."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.moves: list[Move] = []

    def record(self, dt: float, state: State) -> None:
        self.times.append(state.t)
        self.moves.append(
            Move(state.x, state.v, net_force=state.net_force, net_torque=state.net_torque)
        )

    def frame(self, state: State) -> None:
        pass


class _Corners:
    """Keeps the corner values of every state: the unperturbed twin."""

    def __init__(self, solver: Solver) -> None:
        self.solver = solver
        self.corners: list[Array] = []

    def record(self, dt: float, state: State) -> None:
        self.corners.append(self.solver.corners(state))

    def frame(self, state: State) -> None:
        pass


class Amplitude:
    """Projection of the growing difference to the unperturbed run on a mode, over the reference disk.

    c = int (a - a_unperturbed) w dxi / int w^2 dxi.  Where the unperturbed state is steady it is exactly
    a = 1, else a twin run supplies it step by step.
    """

    def __init__(self, scene: Scene, method: Method, mesh: Mesh, refine: int, dt: float) -> None:
        m, n = scene.mode
        mode, points = Mode(m, n), quadrature_points(mesh.xi, mesh.triangles)
        w = mode.value(turn_matrix(scene).T @ points.reshape(2, -1)).reshape(points.shape[1:])
        areas = signed_areas(mesh.xi, mesh.triangles)
        self.functional = INTERIOR_POINTS.T @ (w * areas / 3) / mode.norm2
        self.twin: list[Array] | None = None
        if not _steady(scene):
            solver = bind(scene, method, refine, dt, perturbed=False)
            twin = _Corners(solver)
            integrate(solver, dt, scene.output_times, twin)
            self.twin = twin.corners

    def __call__(self, step: int, corners: Array) -> float:
        """Amplitude of the state after `step` steps, nan where the twin has failed before."""
        if self.twin is None:
            return float((self.functional * (corners - 1)).sum())
        if step >= len(self.twin):
            return float("nan")
        return float((self.functional * (corners - self.twin[step])).sum())


def _steady(scene: Scene) -> bool:
    """Whether a = 1, u = 0 is the unperturbed run: it is not with p != 0 and a delta that jumps."""
    at_rest = scene.initial.eigenmode is None or (scene.initial.a.text.strip() in {"1", "1.0"})
    uniform = scene.parameters.p == 0 or scene.physics.delta in {Delta.NONE, Delta.FULL}
    return at_rest and uniform and scene.motion is None and scene.source_term is None


class _Watcher:
    """The observer that measures every state and hands rows and frames to the store."""

    def __init__(
        self, scene: Scene, solver: Solver, writer: store.RunWriter, amplitude: Amplitude | None, total: int,
        progress: Progress,
    ) -> None:
        self.scene, self.solver, self.writer, self.amplitude = scene, solver, writer, amplitude
        self.total, self.progress, self.step = total, progress, 0
        self.mesh = solver.mesh

    @cached_property
    def probes(self) -> tuple[Array, Array]:
        points = np.array(self.scene.probes.points, dtype=float).reshape(-1, 2).T
        return locate(self.mesh, turn_matrix(self.scene) @ points)

    def record(self, dt: float, state: State) -> None:
        mesh, corners = self.mesh, self.solver.corners(state)
        probe_a, probe_x = observables.probe(mesh.triangles, *self.probes, corners, state.x)
        row = {
            "time": state.t,
            "dt": dt,
            "area": observables.area(state.x, mesh.triangles),
            "total_actin": observables.total_actin(state.x, mesh.triangles, corners),
            "balance_residual": state.balance_residual,
            "centroid": observables.centroid(state.x, mesh.triangles),
            "polarity": observables.polarity(state.x[:, mesh.rim_nodes]),
            "a_min": state.a.min(),
            "a_max": state.a.max(),
            "jacobian_min": observables.jacobian_min(mesh, state.x),
            "probe_a": probe_a,
            "probe_x": probe_x,
        }
        if self.scene.physics.closure is Closure.TRACTION_FREE:
            row |= {"net_force": state.net_force, "net_torque": state.net_torque}
        if self.amplitude is not None:
            row["mode_amplitude"] = self.amplitude(self.step, corners)
        self.writer.record(row)
        self.progress(self.step, self.total)
        self.step += 1

    def frame(self, state: State) -> None:
        triangles, corners = self.mesh.triangles, self.solver.corners(state)
        count = state.x.shape[1]
        shares = np.bincount(triangles.ravel(), minlength=count)
        nodal = np.bincount(triangles.ravel(), corners.ravel(), count) / shares
        displacement = state.x - self.mesh.xi
        self.writer.frame(state.t, state.x, nodal, corners.mean(axis=0), displacement, state.v)


def run(
    scene: Scene,
    method: Method,
    refine: int,
    dt: float,
    path: Path,
    command: str = "",
    progress: Progress = lambda done, total: None,
) -> Outcome:
    """Run a scene with a method and store everything about it.

    Parameters
    ----------
    scene, method : physics and numerics.
    refine : the mesh has 2**refine layers.
    dt : the largest time step.
    path : the `.vtkhdf` file to write (replaced atomically where it exists).
    command : what reproduces the run.
    progress : called after every step.

    Returns
    -------
    The Outcome, which the file holds too: a failed run is stored like any other.
    """
    began = time.perf_counter()
    solver = bind(scene, method, refine, dt)
    growth = scene.mode is not None
    amplitude = Amplitude(scene, method, solver.mesh, refine, dt) if growth else None
    versions = store.provenance()
    attributes: dict[str, str | int | float] = {
        "scene": scene.text,
        "scene_name": scene.name,
        "method": json.dumps(asdict(method)),
        "method_name": method.name,
        "command": command,
        "refine": refine,
        "dt": dt,
        "seed": 0,  # nothing random enters: the article's rnd is a number in the scene
        "versions": json.dumps(versions),
        "commit": versions["commit"],
    }
    if growth and scene.physics.closure is Closure.IRROTATIONAL_WALL:
        attributes["growth_rate_predicted"] = float(leading_growth_rate(scene.physics, *scene.mode).real)
    delta = scene.physics.delta_on_cells(solver.mesh.centroids)
    with store.RunWriter(path, solver.mesh.xi, solver.mesh.triangles, delta, attributes) as writer:
        watcher = _Watcher(scene, solver, writer, amplitude, step_count(dt, scene.output_times), progress)
        outcome = integrate(solver, dt, scene.output_times, watcher)
        writer.finish(outcome, time.perf_counter() - began)
    return outcome
