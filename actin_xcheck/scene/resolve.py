"""From a scene's expressions to callables on the reference disk, in the scene's (turned) frame."""

from collections.abc import Callable

import numpy as np

from actin_xcheck.core.contract import Motion, Problem, Source
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Delta
from actin_xcheck.scene.expression import Expression, coordinates
from actin_xcheck.scene.scene import Scene
from actin_xcheck.theory.eigenfields import Eigenfield, eigenfield


def resolve(scene: Scene, perturbed: bool = True) -> Problem:
    """Return the problem a scene states.

    `perturbed=False` gives the unperturbed twin that growth is measured against: without the eigenmode, or
    at rest with a = 1 where the scene writes its perturbation into `initial.a`.
    """
    turn = turn_matrix(scene)
    a0, u0 = _initial(scene, perturbed)
    return Problem(
        scene.physics,
        lambda xi: a0(turn.T @ xi),
        lambda xi: turn @ u0(turn.T @ xi),
        _motion(scene),
        _source(scene),
    )


def mesh_of(scene: Scene, refine: int) -> Mesh:
    """The scene's reference mesh with 2**refine layers, turned with the scene."""
    return disk(refine, scene.parameters.l0, np.deg2rad(scene.domain.rotation))


def turn_matrix(scene: Scene) -> Array:
    """Rotation (2, 2) from the scene's frame, in which its expressions are written, to the laboratory's."""
    angle = np.deg2rad(scene.domain.rotation)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def in_scene_frame(scene: Scene, expression: Expression, x: Array, xi: Array, t: float) -> Array:
    """Evaluate an expression of x, y, r, theta, x0, y0, t at positions x of material points xi (2, ...)."""
    back = turn_matrix(scene).T
    start = np.tensordot(back, xi, 1)
    return expression(**coordinates(np.tensordot(back, x, 1)), x0=start[0], y0=start[1], t=t)


def starts_from_steady_state(scene: Scene) -> bool:
    """Whether the unperturbed twin is a = 1, u = 0 for ever: not where p != 0 and delta jumps."""
    uniform = scene.parameters.p == 0 or scene.physics.delta in {Delta.NONE, Delta.FULL}
    moved = scene.motion is not None or scene.source_term is not None or scene.initial.u is not None
    at_rest = scene.initial.eigenmode is None or str(scene.initial.a).strip() in {"1", "1.0"}
    return uniform and at_rest and not moved


def mode_field(scene: Scene, m: int, n: int) -> Eigenfield:
    """The eigenfield of a mode the scene names; UserError where its cell has no such mode."""
    try:
        return eigenfield(scene.physics, m, n)
    except (
        ValueError,
        ArithmeticError,
    ) as error:  # no such mode, or one on the edge of where they are counted
        raise UserError(f"{scene.origin}: {error}") from None


def _initial(scene: Scene, perturbed: bool) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Initial concentration and displacement as functions of points (2, n) in the scene's frame."""
    initial, eigenmode = scene.initial, scene.initial.eigenmode
    if not perturbed and eigenmode is None:
        return lambda xi: np.ones(xi.shape[1]), np.zeros_like

    def a(xi: Array) -> Array:
        return initial.a(**coordinates(xi))

    def u(xi: Array) -> Array:
        if initial.u is None:
            return np.zeros_like(xi)
        return np.array([component(**coordinates(xi)) for component in initial.u])

    if not perturbed or eigenmode is None:
        return a, u
    field, amplitude = mode_field(scene, eigenmode.m, eigenmode.n), eigenmode.amplitude
    return lambda xi: a(xi) + amplitude * field.a(xi), lambda xi: u(xi) + amplitude * field.u(xi)


def _motion(scene: Scene) -> Motion | None:
    if scene.motion is None:
        return None
    formulas, turn = (scene.motion.x, scene.motion.y), turn_matrix(scene)

    def position(xi: Array, t: float) -> Array:
        start = turn.T @ xi
        at = {"x0": start[0], "y0": start[1], "t": min(t, scene.time.end)}
        return turn @ np.array([formula(**at) for formula in formulas])

    def velocity(xi: Array, t: float) -> Array:
        start = turn.T @ xi
        at = {"x0": start[0], "y0": start[1], "t": scene.time.within(t)}
        return turn @ np.array([formula.rate(**at) for formula in formulas])

    return Motion(position, velocity)


def _source(scene: Scene) -> Source | None:
    term = scene.source_term
    if term is None:
        return None
    end = scene.time.end  # which the last stage of a step may pass by round-off
    return lambda x, xi, t: in_scene_frame(scene, term, x, xi, min(t, end))
