"""From a scene and a method to a stored run: bind the physics to the numerics, integrate, write."""

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Mechanics, Move, Problem, Solver, State
from actin_xcheck.core.errors import Ending, Outcome, UserError
from actin_xcheck.core.files import locked
from actin_xcheck.core.mesh import Mesh, disk, sector
from actin_xcheck.core.motion import PrescribedMotion, RecordedMotion
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.march import Amplitude, Keeper, March, Progress, Recorder, earlier, taken_up
from actin_xcheck.runs.method import (
    FV_FORCE_BALANCE,
    HAND_OVER,
    METHODS,
    MODAL,
    RADIAL,
    REMESHING,
    SECTOR,
    SOUNDNESS,
    Method,
    find_method,
    load,
)
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.provenance import provenance
from actin_xcheck.runs.store import Run, RunWriter
from actin_xcheck.scene.resolve import mode_field, resolve, starts_from_steady_state
from actin_xcheck.scene.scene import Scene

RAY_DEGREE = 10
"""Of the polynomials on a ray; with 3 elements they are exact to 1e-9 unless contraction is strong."""

MODAL_ELEMENTS, ANGULAR = 3, 12
"""Elements of the ray and largest angular number of `modal`: its rates are exact to 1e-11."""


def bind(scene: Scene, numerics: Numerics, perturbed: bool = True) -> Solver:
    """Return the method's solver for a scene, on its mesh and with whoever moves the nodes.

    A driven method's driver is run here, in whole, with the same steps.  Without `perturbed` it starts
    without the mode that the scene's growth is measured of.
    """
    method, refine = numerics.method, numerics.refine
    reduction, mesh = numerics.reduction, numerics.mesh
    problem = reduction.applied(resolve(scene, perturbed))
    l0, rotation = problem.model.parameters.l0, np.deg2rad(scene.domain.rotation)
    if mesh is None:
        whole = disk(refine, l0, rotation)
    else:
        from actin_xcheck.scene.outline import refined  # here, with what reads outlines

        whole = refined(mesh, l0, refine)
    solver: Solver
    if reduction.fidelity is Fidelity.RADIAL:
        solver = load(RADIAL)(problem, whole, max(refine, 2), RAY_DEGREE, method.order_dt)
        return solver
    recorded: Mechanics | None = None
    if problem.motion is None and method.driven_by is not None:
        driver = bind(scene, replace(numerics, method=find_method(method.driven_by)), perturbed)
        recorded = _recorded(driver, numerics, scene.output_times)

    def spatial(problem: Problem) -> Solver:
        if reduction.symmetry is None:
            return solver_for(problem, method, whole, recorded)
        part = sector(refine, l0, reduction.symmetry, rotation)
        unfolded: Solver = load(SECTOR)(solver_for(problem, method, part), whole)
        return unfolded

    if numerics.remesh:
        solver = load(REMESHING[method.family])(
            solver_for(problem, method, whole),
            lambda mesh, balance=None: solver_for(problem, method, mesh, balance),
        )
        return solver
    if reduction.fidelity is not Fidelity.MODAL:
        return spatial(problem)
    later = spatial(problem)
    modal = load(MODAL)(problem, later.mesh, ANGULAR, MODAL_ELEMENTS, RAY_DEGREE)
    solver = load(HAND_OVER)(modal, later, spatial, reduction.bound)
    return solver


def _recorded(solver: Solver, numerics: Numerics, times: Sequence[float]) -> RecordedMotion:
    """The node paths of a run in equal steps, to drive another one."""
    march = March(solver, replace(numerics, rtol=None), times)
    states = [moment.state for moment in march]
    moves = (Move(one.x, one.v, net_force=one.net_force, net_torque=one.net_torque) for one in states)
    return RecordedMotion(np.array([one.t for one in states]), tuple(moves), march.outcome)


def solver_for(problem: Problem, method: Method, mesh: Mesh, mechanics: Mechanics | None = None) -> Solver:
    """Bind a method to a problem; nodes move as told, as prescribed or by the force balance."""
    if mechanics is None and problem.motion is not None:
        mechanics = PrescribedMotion(mesh.xi, problem.motion)
    elif mechanics is None:
        order = {"order": method.space} if method.space > 1 else {}
        mechanics = load(method.mechanics)(problem.model, mesh, **order)
    solver: Solver = load(method.solver)(problem, mesh, mechanics, **dict(method.options))
    return solver


def amplitude_of(scene: Scene, numerics: Numerics, solver: Solver) -> Amplitude | None:
    """What measures the growth of the scene's mode in a run of `solver`; None where it names no mode.

    Runs the unperturbed twin first, unless it is the steady state a = 1; UserError where its steps, chosen by
    their error, would not be the run's.
    """
    if scene.mode is None:
        return None
    if starts_from_steady_state(scene):
        return Amplitude(scene, solver.mesh)
    if numerics.rtol is not None:
        raise UserError(
            f"{scene.origin}: growth is measured against an unperturbed run, step by step; "
            "valid: --dt without --rtol"
        )
    twin = bind(scene, replace(numerics, remesh=False), perturbed=False)
    moments = March(twin, numerics, scene.output_times)
    return Amplitude(scene, solver.mesh, [twin.corners(moment.state) for moment in moments])


def run(
    scene: Scene,
    numerics: Numerics,
    path: Path,
    command: str = "",
    progress: Progress = lambda done, total: None,
    resume: bool = False,
    stop: Callable[[], int] = lambda: 0,
    passing: bool = False,
    pictures: int = 0,
) -> Outcome:
    """Run a scene and store everything about it; return its Outcome, which the file holds too.

    While it lasts, and if it is killed, `unfinished(path)` holds its last checkpoint, see `Keeper`.

    Parameters
    ----------
    scene, numerics : what is run, and how.
    path, command : the `.vtkhdf` file to write, replaced atomically, and what reproduces it.
    progress, stop : called, and asked, after every step; what is not 0 ends it there, as `interrupted`.
    resume : whether to go on from the checkpoint that an interrupted run of the same kind has left, to the
        bits that it would have reached; without one it begins at t = 0, and a finished run stays as it is.
        passing : whether it will be compared and thrown away: without polarity (nan), frames and checkpoints.
    pictures : of its film, evenly through its time beside those of the output times, where steps end.

    Raises UserError where the file cannot be written, or another process does, or `resume` finds another run.
    """
    began = time.perf_counter()
    attributes = _attributes(scene, numerics, command)
    with locked(path), np.errstate(all="ignore"):  # what overflows in a run ends as its Outcome
        before = earlier(path, attributes) if resume else None
        if before is not None and before.path == path:
            return _ended(before)
        began -= before.attributes["wall_seconds"] if before else 0.0
        goes_on, before = before is not None, None  # its film is large
        solver = bind(scene, numerics)
        _check(solver, numerics)
        amplitude = amplitude_of(scene, numerics, solver)
        delta, grid = scene.physics.delta_on_cells(solver.mesh.centroids), solver.grid
        with RunWriter(path, grid.xi, grid.cells, delta, attributes, goes_on) as writer:
            recorder = Recorder(scene, solver, writer, amplitude, progress, passing, pictures)
            begin = taken_up(solver, writer) if goes_on else None
            march = March(solver, numerics, scene.output_times, begin)
            keeper = Keeper(solver, writer, math.inf if passing else began, stop)
            outcome = _followed(march, recorder, keeper)
            if outcome.ending is Ending.TANGLED:
                outcome = _told(outcome, scene, numerics, solver, march.state)
            if outcome.ending is not Ending.INTERRUPTED:
                writer.finish(outcome, time.perf_counter() - began)
    return outcome


def _ended(before: Run) -> Outcome:
    """How a run that is there has ended."""
    said = before.attributes["message"] or f"{before.path} was finished before"
    return Outcome(Ending(before.attributes["outcome"]), said)


def _check(solver: Solver, numerics: Numerics) -> None:
    if not hasattr(solver, "memento"):
        raise UserError(
            f"--method {numerics.method.name}: its solver lacks memento and restored; valid: with both"
        )


def _followed(march: March, recorder: Recorder, keeper: Keeper) -> Outcome:
    """Record a run to its end, or to where it has to stop."""
    for moment in march:
        recorder.record(moment)
        if march.goes_on and not (kept := keeper(moment)).ok:
            return kept
    if march.is_cut_short:
        recorder.frame(march.state)
    return march.outcome


def remeshes(method: Method) -> bool:
    """Whether a method's mesh can be replaced in a run: that of curved elements integrated by the pairs, and
    that of volumes with a force balance of their own.
    """
    return method.solver == METHODS["fem-p1-imex2"].solver or method.mechanics == FV_FORCE_BALANCE


def _told(outcome: Outcome, scene: Scene, numerics: Numerics, solver: Solver, last: State) -> Outcome:
    """A fold with what the cells of the last state that stands say about it, where a new mesh would help."""
    own = numerics.mesh is not None or numerics.remesh or scene.motion is not None
    space = getattr(getattr(solver, "inner", solver), "space", None)  # of a sector's solver, or of the disk's
    if own or space is None or not remeshes(numerics.method):
        return outcome
    worn = load(SOUNDNESS)(space, last.t, last.x)
    return outcome if worn.ok else Outcome(outcome.ending, f"{worn.message}: {outcome.message}")


def _attributes(scene: Scene, numerics: Numerics, command: str) -> dict[str, str | int | float]:
    """How the numbers of a run were made."""
    versions, method, reduction = provenance(), numerics.method, numerics.reduction
    attributes: dict[str, str | int | float] = {
        "scene": scene.text,
        "scene_name": scene.name,
        "parameters": json.dumps(asdict(scene.parameters)),
        "method": json.dumps(asdict(method)),
        "method_name": method.name,
        "family": method.family,
        "command": command,
        "refine": numerics.refine,
        "dt": numerics.dt,
        "seed": 0,  # nothing random enters: the article's rnd is a number in the scene
        "versions": json.dumps(versions),
        "commit": versions["commit"],
        "rtol": np.nan if numerics.rtol is None else numerics.rtol,
        "fidelity": str(reduction.fidelity),
        "left_out": json.dumps(reduction.left_out),
        "mesh": "" if numerics.mesh is None else numerics.mesh.origin,
        "remesh": int(numerics.remesh),
    }
    if scene.mode is not None:
        rate = mode_field(scene, *scene.mode).rate
        attributes |= {"growth_rate_predicted": rate.real, "frequency_predicted": rate.imag}
    return attributes
