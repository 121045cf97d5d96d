"""From a scene's expressions to callables on the reference disk, in the scene's (turned) frame.

The terms of (3.2) that a scene may have are listed, and dropped one by one by changing one entry of the
scene: initial data stay those of the whole scene, also where they are one of its modes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from actin_xcheck.core.contract import Motion, Problem, Source
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Delta, Rheology
from actin_xcheck.scene.expression import Expression, coordinates
from actin_xcheck.scene.scene import Scene

if TYPE_CHECKING:
    from actin_xcheck.theory.eigenfields import Eigenfield


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


def probe_points(scene: Scene) -> Array:
    """The scene's probes (2, n) on the reference disk, in the laboratory's frame."""
    return turn_matrix(scene) @ np.array(scene.probes.points, dtype=float).reshape(-1, 2).T


def perturbation(scene: Scene) -> float:
    """Largest |a - 1| and |u| at the start, on circles in the disk."""
    radii, angles = np.linspace(0, 1, 9), np.linspace(0, 2 * np.pi, 33)
    xi = np.array([np.outer(radii, part(angles)).ravel() for part in (np.cos, np.sin)])
    problem = resolve(scene)
    return float(max(np.abs(problem.a0(xi) - 1).max(), np.abs(problem.u0(xi)).max()))


def in_scene_frame(scene: Scene, expression: Expression, x: Array, xi: Array, t: float) -> Array:
    """Evaluate an expression of x, y, r, theta, x0, y0, t at positions x of material points xi (2, ...)."""
    back = turn_matrix(scene).T
    start = np.tensordot(back, xi, 1)
    return expression(**coordinates(np.tensordot(back, x, 1)), x0=start[0], y0=start[1], t=t)


def starts_from_steady_state(scene: Scene) -> bool:
    """Whether the unperturbed twin is a = 1, u = 0 for ever: not where p != 0 and delta jumps."""
    model = scene.physics
    uniform = not model.sees("delta") or model.delta in {Delta.NONE, Delta.FULL}
    moved = scene.motion is not None or scene.source_term is not None or scene.initial.u is not None
    at_rest = scene.initial.eigenmode is None or str(scene.initial.a).strip() in {"1", "1.0"}
    return uniform and at_rest and not moved and model.is_smooth_at_rest


def mode_field(scene: Scene, m: int, n: int) -> "Eigenfield":
    """The eigenfield of a mode the scene names; UserError where its cell has no such mode."""
    from actin_xcheck.theory.eigenfields import eigenfield  # here: most scenes name none

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


@dataclass(frozen=True)
class Term:
    """A term of (3.2).

    Attributes
    ----------
    name, symbol : what a reader calls it, and how it is written.
    entry : the entry of the scene that drops it.
    there : whether a problem has it.
    idle : why it does nothing in a problem that has it; empty where it may do something.
    drop : the problem without it.
    """

    name: str
    symbol: str
    entry: str
    there: Callable[[Problem], bool]
    idle: Callable[[Problem], str]
    drop: Callable[[Problem], Problem]


def _model(**changes: Any) -> Callable[[Problem], Problem]:
    return lambda problem: replace(problem, model=problem.model.varied(**changes))


def _prescribed(problem: Problem) -> str:
    return "" if problem.motion is None else "the motion is prescribed"


def _without(law: str, **changes: Any) -> Callable[[Problem], Problem]:
    """Drop a law of the scene's own, or the article's by its parameter."""
    dropped: dict[str, Any] = {law: None}
    return lambda problem: _model(laws=replace(problem.model.laws, **dropped), **changes)(problem)


def _at_rest(problem: Problem) -> str:
    """Why nothing moves, or nothing of its own; empty where something does."""
    return _prescribed(problem) or ("nothing moves: ψ = p = 0, u = 0" if not _moves(problem) else "")


def _moves(problem: Problem) -> bool:
    model = problem.model
    return problem.motion is not None or model.contracts or model.pressed or _displaced(problem)


def _displaced(problem: Problem) -> bool:
    points = np.array([(0.0, 0.0), (0.4, 0.1), (-0.3, 0.6), (0.1, -0.9)]).T
    return bool(np.any(problem.u0(points)))


def _no_pressure(problem: Problem) -> str:
    return _prescribed(problem) or ("" if problem.model.sees("delta") else "p = 0")


def _always(problem: Problem) -> str:
    return ""


TERMS = (
    Term(
        "contraction",
        "∇(ψ a² e^(−a/a_sat))",
        "[parameters] psi = 0",
        lambda problem: problem.model.contracts,
        _prescribed,
        _without("contractility", psi=0.0),
    ),
    Term(
        "pressure",
        "∇(p/(1 + φ) (1 + (2/π) δ arctan a))",
        "[parameters] p = 0",
        lambda problem: problem.model.pressed,
        _prescribed,
        _without("pressure", p=0.0),
    ),
    Term(
        "the share of polymerisation in the pressure",
        "(2/π) δ arctan a",
        '[model] delta = "none"',
        lambda problem: problem.model.delta is not Delta.NONE,
        _no_pressure,
        _model(delta=Delta.NONE),
    ),
    Term(
        "the ring",
        "δ = 1 where |ξ| > ℓ₀ only",
        '[model] delta = "full"',
        lambda problem: problem.model.delta is Delta.RING,
        _no_pressure,
        _model(delta=Delta.FULL),
    ),
    Term(
        "elasticity and dilation",
        "∇·σ_e, φ",
        '[model] rheology = "viscous"',
        lambda problem: problem.model.rheology is Rheology.VISCOELASTIC,
        _at_rest,
        _model(rheology=Rheology.VISCOUS),
    ),
    Term(
        "motion and dilution",
        "∇·(a v)",
        '[motion] x = "x0", y = "y0"',
        lambda problem: True,
        lambda problem: "" if _moves(problem) else "nothing moves: ψ = p = 0, u = 0",
        lambda problem: replace(problem, motion=Motion(lambda xi, t: xi, lambda xi, t: np.zeros_like(xi))),
    ),
    Term(
        "diffusion",
        "d Δa",
        "[parameters] d = 0",
        lambda problem: problem.model.parameters.d != 0,
        _always,
        _model(d=0.0),
    ),
    Term(
        "reaction",
        "1 − a",
        "[model] reaction = false",
        lambda problem: problem.model.reaction,
        _always,
        _model(reaction=False),
    ),
    Term(
        "the source",
        "s",
        "no [source] a",
        lambda problem: problem.source is not None,
        _always,
        lambda problem: replace(problem, source=None),
    ),
    Term(
        "the initial displacement",
        "u(t = 0)",
        "no [initial] u",
        _displaced,
        _prescribed,
        lambda problem: replace(problem, u0=np.zeros_like),
    ),
)
