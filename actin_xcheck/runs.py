"""From a scene and a method to a stored run: bind the physics to the numerics, integrate, write."""

import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from actin_xcheck.errors import UserError
from actin_xcheck.fidelity import FULL, Fidelity, Reduction
from actin_xcheck.geometry import Mesh, disk, sector
from actin_xcheck.motion import PrescribedMotion, RecordedMotion
from actin_xcheck.registry import (
    FORCE_BALANCE,
    HAND_OVER,
    MODAL,
    RADIAL,
    SECTOR,
    Method,
    find_method,
    load,
)
from actin_xcheck.resolve import mode_field, resolve, starts_from_steady_state
from actin_xcheck.result import Outcome
from actin_xcheck.scene import Scene
from actin_xcheck.solver import Mechanics, Problem, Solver
from actin_xcheck.stepping import Tolerance, integrate
from actin_xcheck.store import RunWriter, provenance
from actin_xcheck.watch import Amplitude, Corners, Paths, Progress, Recorder

DEFAULT_REFINE = 5
"""2113 nodes."""

DEFAULT_STEPS = 100

MOST_STEPS = 1e7
"""A run of more would not end."""

RAY_DEGREE = 10
"""Of the polynomials on a ray; with 3 elements they are exact to 1e-9 unless contraction is strong."""

MODAL_ELEMENTS, ANGULAR = 3, 12
"""Elements of the ray and largest angular number of `modal`: its rates are exact to 1e-11."""


def numerics(scene: Scene, refine: int | None = None, dt: float | None = None) -> tuple[int, float]:
    """Mesh refinement and time step: as given, else as published, else 2113 nodes and 100 steps."""
    published = scene.as_published
    dt = dt or published.dt or scene.time.end / DEFAULT_STEPS
    if scene.time.end / dt > MOST_STEPS:
        raise UserError(
            f"{scene.origin}: steps of {dt:g} up to {scene.time.end:g}; valid: {MOST_STEPS:g} steps"
        )
    return refine or published.refine or DEFAULT_REFINE, dt


def bind(
    scene: Scene,
    method: Method,
    refine: int,
    dt: float,
    perturbed: bool = True,
    reduction: Reduction = FULL,
) -> Solver:
    """Return the method's solver for a scene, on its mesh and with whoever moves the nodes.

    A driven method's driver is run here, in whole, with the same steps of at most dt.
    """
    problem = reduction.applied(resolve(scene, perturbed))
    l0, rotation = problem.model.parameters.l0, np.deg2rad(scene.domain.rotation)
    whole = disk(refine, l0, rotation)
    solver: Solver
    if reduction.fidelity is Fidelity.RADIAL:
        solver = load(RADIAL)(problem, whole, max(refine, 2), RAY_DEGREE, method.order_dt)
        return solver
    recorded: Mechanics | None = None
    if problem.motion is None and method.driven_by is not None:
        driver = bind(scene, find_method(method.driven_by), refine, dt, perturbed, reduction)
        paths = Paths()
        outcome = integrate(driver, dt, scene.output_times, paths)
        recorded = RecordedMotion(np.array(paths.times), tuple(paths.moves), outcome)

    def spatial(problem: Problem) -> Solver:
        if reduction.symmetry is None:
            return solver_for(problem, method, whole, recorded)
        part = sector(refine, l0, reduction.symmetry, rotation)
        unfolded: Solver = load(SECTOR)(solver_for(problem, method, part), whole)
        return unfolded

    if reduction.fidelity is not Fidelity.MODAL:
        return spatial(problem)
    modal = load(MODAL)(problem, whole, ANGULAR, MODAL_ELEMENTS, RAY_DEGREE)
    solver = load(HAND_OVER)(modal, spatial, reduction.bound)
    return solver


def solver_for(problem: Problem, method: Method, mesh: Mesh, mechanics: Mechanics | None = None) -> Solver:
    """Bind a method to a problem; nodes move as told, as prescribed or by the force balance."""
    if mechanics is None and problem.motion is not None:
        mechanics = PrescribedMotion(mesh.xi, problem.motion)
    elif mechanics is None:
        mechanics = load(FORCE_BALANCE)(problem.model, mesh, method.space)
    solver: Solver = load(method.solver)(problem, mesh, mechanics, **dict(method.options))
    return solver


def amplitude_of(
    scene: Scene,
    method: Method,
    solver: Solver,
    refine: int,
    dt: float,
    rtol: float | None = None,
    reduction: Reduction = FULL,
) -> Amplitude | None:
    """What measures the growth of the scene's mode in a run of `solver`; None where it names no mode.

    Runs the unperturbed twin first, unless it is the steady state a = 1; UserError where its steps, chosen by
    their error, would not be the run's.
    """
    if scene.mode is None:
        return None
    if starts_from_steady_state(scene):
        return Amplitude(scene, solver.mesh)
    if rtol is not None:
        raise UserError(
            f"{scene.origin}: growth is measured against an unperturbed run, step by step; "
            "valid: --dt without --rtol"
        )
    twin = bind(scene, method, refine, dt, perturbed=False, reduction=reduction)
    corners = Corners(twin)
    integrate(twin, dt, scene.output_times, corners)
    return Amplitude(scene, solver.mesh, corners.values)


def run(
    scene: Scene,
    method: Method,
    refine: int,
    dt: float,
    path: Path,
    command: str = "",
    progress: Progress = lambda done, total: None,
    rtol: float | None = None,
    reduction: Reduction = FULL,
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
    rtol : largest local error of a step, for an adaptive method; None for equal steps.
    reduction : how much of the model is solved, see `fidelity.reduced`.

    Returns
    -------
    The Outcome, which the file holds too: a failed run is stored like any other.
    """
    began = time.perf_counter()
    solver = bind(scene, method, refine, dt, reduction=reduction)
    amplitude = amplitude_of(scene, method, solver, refine, dt, rtol, reduction)
    delta = scene.physics.delta_on_cells(solver.mesh.centroids)
    attributes = _attributes(scene, method, refine, dt, command) | {
        "rtol": np.nan if rtol is None else rtol,
        "fidelity": str(reduction.fidelity),
        "left_out": json.dumps(reduction.left_out),
    }
    grid = solver.grid
    # what overflows in a run ends as its Outcome
    with np.errstate(all="ignore"), RunWriter(path, grid.xi, grid.cells, delta, attributes) as writer:
        recorder = Recorder(scene, solver, writer, amplitude, progress)
        tolerance = None if rtol is None else Tolerance(rtol, method.order_dt)
        outcome = integrate(solver, dt, scene.output_times, recorder, tolerance)
        writer.finish(outcome, time.perf_counter() - began)
    return outcome


def _attributes(
    scene: Scene, method: Method, refine: int, dt: float, command: str
) -> dict[str, str | int | float]:
    """How the numbers of a run were made."""
    versions = provenance()
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
    if scene.mode is not None:
        rate = mode_field(scene, *scene.mode).rate
        attributes |= {"growth_rate_predicted": rate.real, "frequency_predicted": rate.imag}
    return attributes
