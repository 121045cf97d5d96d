"""From a scene and a method to a stored run: bind the physics to the numerics, integrate, write."""

import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from actin_xcheck.errors import UserError
from actin_xcheck.motion import PrescribedMotion, RecordedMotion
from actin_xcheck.registry import FORCE_BALANCE, Method, find_method, load
from actin_xcheck.resolve import mesh_of, mode_field, resolve, starts_from_steady_state
from actin_xcheck.result import Outcome
from actin_xcheck.scene import Scene
from actin_xcheck.solver import Mechanics, Solver
from actin_xcheck.stepping import Tolerance, integrate
from actin_xcheck.store import RunWriter, provenance
from actin_xcheck.watch import Amplitude, Corners, Paths, Progress, Recorder

DEFAULT_REFINE = 5
"""2113 nodes."""

DEFAULT_STEPS = 100


def numerics(scene: Scene, refine: int | None = None, dt: float | None = None) -> tuple[int, float]:
    """Mesh refinement and time step: as given, else as published, else 2113 nodes and 100 steps."""
    published = scene.as_published
    return (
        refine or published.refine or DEFAULT_REFINE,
        dt or published.dt or scene.time.end / DEFAULT_STEPS,
    )


def bind(scene: Scene, method: Method, refine: int, dt: float, perturbed: bool = True) -> Solver:
    """Return the method's solver for a scene, on its mesh and with whoever moves the nodes.

    A driven method's driver is run here, in whole, with the same steps of at most dt.
    """
    problem, mesh = resolve(scene, perturbed), mesh_of(scene, refine)
    mechanics: Mechanics
    if problem.motion is not None:
        mechanics = PrescribedMotion(mesh.xi, problem.motion)
    elif method.driven_by is None:
        mechanics = load(FORCE_BALANCE)(problem.model, mesh, method.space)
    else:
        driver, paths = bind(scene, find_method(method.driven_by), refine, dt, perturbed), Paths()
        outcome = integrate(driver, dt, scene.output_times, paths)
        mechanics = RecordedMotion(np.array(paths.times), tuple(paths.moves), outcome)
    solver: Solver = load(method.solver)(problem, mesh, mechanics, **dict(method.options))
    return solver


def amplitude_of(
    scene: Scene, method: Method, solver: Solver, refine: int, dt: float, rtol: float | None = None
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
    twin = bind(scene, method, refine, dt, perturbed=False)
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

    Returns
    -------
    The Outcome, which the file holds too: a failed run is stored like any other.
    """
    began = time.perf_counter()
    solver = bind(scene, method, refine, dt)
    amplitude = amplitude_of(scene, method, solver, refine, dt, rtol)
    delta = scene.physics.delta_on_cells(solver.mesh.centroids)
    attributes = _attributes(scene, method, refine, dt, command) | {"rtol": np.nan if rtol is None else rtol}
    with RunWriter(path, solver.mesh.xi, solver.mesh.triangles, delta, attributes) as writer:
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
