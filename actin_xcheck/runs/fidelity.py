"""No more model than a scene needs: the smallest one that is exact for it, and what that leaves out."""

from dataclasses import dataclass, replace

import numpy as np

from actin_xcheck.core.choices import Fidelity
from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Symmetry, disk, sector, unfold
from actin_xcheck.core.model import Array, Delta, Rheology
from actin_xcheck.runs.method import Method
from actin_xcheck.scene.resolve import resolve, starts_from_steady_state
from actin_xcheck.scene.scene import Scene
from actin_xcheck.scene.symmetry import Symmetries, symmetry_of


@dataclass(frozen=True)
class Reduction:
    """What is solved of a scene.

    Attributes
    ----------
    fidelity : any but AUTO.
    symmetry : mirror lines, for SECTOR and for what MODAL hands over to.
    bound : largest error that MODAL may make.
    still : whether the force balance is left out, for nothing moves.
    ring_free : whether the mesh has no line of nodes on the ring, for delta does not jump there.
    left_out : what is not solved and why, a sentence each.
    """

    fidelity: Fidelity = Fidelity.FULL
    symmetry: Symmetry | None = None
    bound: float = 0.0
    still: bool = False
    ring_free: bool = False
    left_out: tuple[str, ...] = ()

    def applied(self, problem: Problem) -> Problem:
        """Return the problem without what is left out of it."""
        if self.still:
            start = problem.u0
            still = Motion(lambda xi, t: xi + start(xi), lambda xi, t: np.zeros_like(xi))
            problem = replace(problem, motion=still)
        if self.ring_free:  # on 1/2 every mesh has a layer without being bent
            problem = replace(problem, model=problem.model.varied(l0=0.5))
        return problem


FULL = Reduction()
"""Nothing is left out."""


def reduced(
    scene: Scene, method: Method, wanted: Fidelity = Fidelity.AUTO, tolerance: float | None = None
) -> Reduction:
    """Return what has to be solved of a scene by a method.

    Parameters
    ----------
    scene, method : physics and numerics.
    wanted : AUTO, or what must be solved.
    tolerance : the error that MODAL may make; without one it is not chosen.

    Raises
    ------
    UserError : what is wanted is not exact for the scene, or not made for the method.
    """
    if wanted is Fidelity.FULL:
        return FULL
    problem = resolve(scene)
    found = symmetry_of(problem, scene.time.end)
    why_not = {
        Fidelity.RADIAL: _not_radial(method, found),
        Fidelity.MODAL: _not_modal(scene, problem, method, tolerance),
        Fidelity.SECTOR: _not_a_sector(scene, method, found),
    }
    if wanted is Fidelity.AUTO:
        chosen = next((one for one, reason in why_not.items() if not reason), Fidelity.FULL)
    else:
        chosen = wanted
        if reason := why_not[wanted]:
            valid = [str(one) for one, other in why_not.items() if not other]
            raise UserError(
                f"--fidelity: {wanted} is not for {scene.origin} with {method.name}: {reason}; "
                f"valid: {', '.join(['auto', 'full', *valid])}"
            )
    in_sector = chosen is Fidelity.SECTOR or (chosen is Fidelity.MODAL and not why_not[Fidelity.SECTOR])
    reduction = Reduction(
        chosen,
        found.mirrors if in_sector else None,
        tolerance or 0.0,
        _nothing_moves(scene),
        scene.physics.delta is not Delta.RING,
    )
    return replace(reduction, left_out=_left_out(scene, reduction))


def _not_radial(method: Method, found: Symmetries) -> str:
    if not _by_stages(method):
        return "it is integrated by the pairs fem-p*-imex* alone"
    return "" if found.axisymmetric else "its data depend on the angle"


def _not_a_sector(scene: Scene, method: Method, found: Symmetries) -> str:
    if method.family != "fem":
        return "symmetry sides are made for finite elements alone"
    if found.axisymmetric:
        return "its data are axisymmetric, which needs no sides"
    if found.mirrors is None:
        return "its data have no mirror line"
    if not method.adaptive and not _is_part_of_the_mesh(found.mirrors, scene):
        return "its mirror lines are no axes of the article's mesh"
    return ""


def _is_part_of_the_mesh(symmetry: Symmetry, scene: Scene) -> bool:
    """Whether the images of the sector's mesh are the scene's own."""
    rotation = np.deg2rad(scene.domain.rotation)
    tiled, own = unfold(sector(1, 0.5, symmetry, rotation)), disk(1, 0.5, rotation)
    gaps = np.abs(tiled.xi[:, :, None] - own.xi[:, None]).max(axis=0)
    return tiled.xi.shape == own.xi.shape and bool(gaps.min(axis=0).max() < 1e-9)


def _not_modal(scene: Scene, problem: Problem, method: Method, tolerance: float | None) -> str:
    if not _by_stages(method):
        return "it hands over to the pairs fem-p*-imex* alone"
    if not starts_from_steady_state(scene):
        return "it has no steady state a = 1 to be near to"
    if tolerance is None:
        return "without --rtol or --accuracy nothing says how small is small"
    if (neglected := 2 * _amplitude(problem) ** 2) > tolerance:
        return f"it starts so far from a = 1 that linear theory would be wrong by {neglected:.0e}"
    return ""


def _amplitude(problem: Problem) -> float:
    """The larger of |a - 1| and |u| at t = 0, on a few circles."""
    theta = np.linspace(0, 2 * np.pi, 64)
    circles = np.array([np.cos(theta), np.sin(theta)])[:, None] * np.linspace(0, 1, 9)[:, None]
    points = circles.reshape(2, -1)
    return float(max(np.abs(problem.a0(points) - 1).max(), np.abs(problem.u0(points)).max()))


def _by_stages(method: Method) -> bool:
    return method.family == "fem" and method.adaptive


def _nothing_moves(scene: Scene) -> bool:
    """Whether the load of the force balance is zero for ever: nothing active or displaced that counts."""
    if scene.motion is not None or scene.parameters.psi or scene.parameters.p:
        return False
    undisplaced = scene.initial.u is None and scene.initial.eigenmode is None
    return undisplaced or scene.physics.rheology is Rheology.VISCOUS


def _left_out(scene: Scene, reduction: Reduction) -> tuple[str, ...]:
    said = []
    if reduction.fidelity is Fidelity.RADIAL:
        said.append("all angles but one: the data are axisymmetric")
    if reduction.fidelity is Fidelity.MODAL:
        small = f"as long as it changes nothing by more than {reduction.bound:.0e}"
        said.append(f"what is quadratic in the distance to a = 1, u = 0, {small}")
    if reduction.symmetry is not None:
        lines = ", ".join(f"{angle:.4g}" for angle in np.rad2deg(_lines(reduction.symmetry)))
        said.append(f"the mirror images of a sector: the data have mirror lines at {lines} degrees")
    if reduction.still:
        said.append("the force balance: psi = p = 0 and nothing pushes back, so that nothing moves")
    elif scene.motion is None and scene.physics.rheology is Rheology.VISCOUS:
        said.append("elastic stress and dilation: a viscous network forgets its displacement")
    if reduction.ring_free:
        said.append(f"the line of nodes on the ring: delta is {scene.physics.delta} and does not jump there")
    return tuple(said)


def _lines(symmetry: Symmetry) -> Array:
    return symmetry.start + np.pi * np.arange(symmetry.mirrors) / symmetry.mirrors
